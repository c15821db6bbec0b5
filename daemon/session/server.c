/* server.c: the table of sessions, and what is answered without computation. */
#include "parts.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct crm_server {
    crm_server_settings set;
    crm_session *buckets[CRM_BUCKETS];
    int n_sessions;
    crm_session *ready_first;
    crm_session *ready_last;
    crm_budget budget;
    double started;
    /* For the status. */
    int64_t n_statuses;
    int64_t steps_total;
    double busy;      /* [s] since the last status */
    double status_at; /* [s] */
    int64_t malformed;
    char why[CRM_TEXT];
};

crm_server_settings crm_server_defaults(void)
{
    crm_server_settings set = {0};
    set.limits = crm_wire_default_limits();
#define CRM_SERVER_LIMIT_VALUE(name, value, unit, text) set.name = value;
    CRM_SERVER_LIMITS(CRM_SERVER_LIMIT_VALUE)
#undef CRM_SERVER_LIMIT_VALUE
    set.name = "";
    set.url = "";
    set.version = "";
    set.n_workers = 1;
    return set;
}

crm_server *crm_server_create(const crm_server_settings *settings)
{
    crm_server *v = calloc(1, sizeof *v);
    if (!v) return NULL;
    v->set = *settings;
    v->budget.limit = (size_t)settings->memory << 20;
    v->started = settings->now(settings->user);
    v->status_at = v->started;
    return v;
}

void crm_server_destroy(crm_server *v)
{
    if (!v) return;
    for (int i = 0; i < CRM_BUCKETS; i++) {
        while (v->buckets[i]) {
            crm_session *s = v->buckets[i];
            v->buckets[i] = s->next_in_bucket;
            crm_session_free(s);
        }
    }
    free(v);
}

int crm_server_n_sessions(const crm_server *v)
{
    return v->n_sessions;
}

int64_t crm_server_malformed(const crm_server *v, const char **why)
{
    *why = v->why;
    return v->malformed;
}

/* --- table */

/* The bits of a client id are random; mixing guards against clients that count. */
static crm_session **bucket_of(crm_server *v, int64_t client_id, int32_t id)
{
    uint64_t h = (uint64_t)client_id ^ (uint64_t)(uint32_t)id * 0x9e3779b97f4a7c15u;
    h ^= h >> 32;
    h *= 0x9e3779b97f4a7c15u;
    return &v->buckets[(h >> 32) % CRM_BUCKETS];
}

static crm_session *find_session(crm_server *v, int64_t client_id, int32_t id)
{
    crm_session *s = *bucket_of(v, client_id, id);
    while (s && (s->client_id != client_id || s->id != id)) s = s->next_in_bucket;
    return s;
}

static crm_session *add_session(crm_server *v, const crm_wire_header *h)
{
    if (v->n_sessions >= v->set.max_sessions) return NULL;
    crm_session *s = calloc(1, sizeof *s);
    if (!s) return NULL;
    s->client_id = h->client_id;
    s->id = h->session;
    s->next_seq = 1;
    s->lease = v->set.lease;
    s->budget.limit = (size_t)v->set.session_memory << 20;
    s->budget.parent = &v->budget;
    crm_session **bucket = bucket_of(v, h->client_id, h->session);
    s->next_in_bucket = *bucket;
    *bucket = s;
    v->n_sessions++;
    return s;
}

static void remove_session(crm_server *v, crm_session *s)
{
    crm_session **at = bucket_of(v, s->client_id, s->id);
    while (*at != s) at = &(*at)->next_in_bucket;
    *at = s->next_in_bucket;
    v->n_sessions--;
    crm_session_free(s);
}

/* --- replies */

static carom_reply_t reply_to(const crm_server *v, const crm_wire_header *h, const crm_session *s,
                              int code, char *text)
{
    carom_reply_t r = {0};
    r.utime = v->set.utime(v->set.user);
    r.client_id = h->client_id;
    r.session = h->session;
    r.seq = h->seq;
    r.reply_code = (int8_t)code;
    r.reply_text = text;
    r.next_seq = s ? s->next_seq : 1;
    r.window = CRM_WINDOW;
    r.boot_id = v->set.boot_id;
    r.step = s ? s->step : 0;
    r.first_step = s ? s->first_step : 0;
    r.recorded_steps = s ? s->recorded : 0;
    r.chunk_index = -1;
    return r;
}

static void emit_reply(const crm_server *v, const carom_reply_t *r)
{
    crm_message m = {0};
    if (crm_pack_reply(r, &m)) v->set.emit(v->set.user, m.type, m.bytes, m.size);
    free(m.bytes);
}

static void reply(const crm_server *v, const crm_wire_header *h, const crm_session *s, int code,
                  char *text)
{
    const carom_reply_t r = reply_to(v, h, s, code, text);
    emit_reply(v, &r);
}

static void note_malformed(crm_server *v, const char *text)
{
    v->malformed++;
    snprintf(v->why, sizeof v->why, "%s", text);
}

static void refuse(crm_server *v, const crm_wire_header *h, int code, char *text)
{
    note_malformed(v, text);
    reply(v, h, find_session(v, h->client_id, h->session), code, text);
}

/* --- admission */

static void repeat(crm_server *v, crm_session *s, const crm_wire_header *h,
                   const carom_step_request_t *step)
{
    char nothing[] = "", forgotten[] = "the answer is no longer kept";
    for (int i = 0; i < s->n_queued; i++) {
        if (s->queue[i].seq == h->seq) {
            reply(v, h, s, CAROM_REPLY_T_PENDING, nothing);
            return;
        }
    }
    const crm_answer *a = &s->kept[h->seq % CRM_WINDOW];
    if (a->seq != h->seq) {
        reply(v, h, s, CAROM_REPLY_T_FORGOTTEN, forgotten);
        return;
    }
    crm_answer_repeat(a, &v->set, step ? step->num_resend : 0, step ? step->resend_step : NULL);
}

static void make_ready(crm_server *v, crm_session *s)
{
    s->next_ready = NULL;
    if (v->ready_last) {
        v->ready_last->next_ready = s;
    } else {
        v->ready_first = s;
    }
    v->ready_last = s;
}

static void enqueue(crm_server *v, crm_session *s, const crm_wire_header *h, crm_wire_type type,
                    const void *bytes, size_t size)
{
    char full[] = "the queue of the session is full", memory[] = "the session's memory is full";
    if (s->n_queued == CRM_WINDOW) {
        reply(v, h, s, CAROM_REPLY_T_BUSY, full);
        return;
    }
    crm_request *r = &s->queue[s->n_queued];
    const size_t held = CRM_DECODED * size;
    if (!crm_budget_take(&s->budget, held)) {
        reply(v, h, s, CAROM_REPLY_T_BUSY, memory);
        return;
    }
    if (!crm_request_decode(r, type, bytes, size)) {
        crm_budget_give(&s->budget, held);
        reply(v, h, s, CAROM_REPLY_T_BUSY, memory);
        return;
    }
    r->seq = h->seq;
    r->held = held;
    s->n_queued++;
    s->next_seq++;
    if (s->n_queued == 1 && !s->working) make_ready(v, s);
}

/* Bytes that passed the check, of a request with a seq. */
static void admit(crm_server *v, crm_session *s, const crm_wire_header *h, crm_wire_type type,
                  const void *bytes, size_t size)
{
    char text[CRM_TEXT];
    if (h->seq > s->next_seq) {
        snprintf(text, sizeof text, "seq %" PRId64 " before %" PRId64, h->seq, s->next_seq);
        reply(v, h, s, CAROM_REPLY_T_GAP, text);
    } else if (h->seq == s->next_seq) {
        enqueue(v, s, h, type, bytes, size);
    } else if (type == CRM_WIRE_STEP) {
        carom_step_request_t step;
        if (carom_step_request_t_decode(bytes, 0, (int)size, &step) != (int)size) return;
        repeat(v, s, h, &step);
        carom_step_request_t_decode_cleanup(&step);
    } else {
        repeat(v, s, h, NULL);
    }
}

/* The session of the header; with `opens` a new one.  NULL: answered. */
static crm_session *session_for(crm_server *v, const crm_wire_header *h, int opens)
{
    char text[CRM_TEXT] = "unknown, expired, or the daemon was started again";
    crm_session *s = find_session(v, h->client_id, h->session);
    if (!s && opens && h->seq == 1) {
        s = add_session(v, h);
        snprintf(text, sizeof text, "there are %d sessions of %d (--max-sessions)", v->n_sessions,
                 v->set.max_sessions);
    }
    if (!s) {
        const int full = opens && h->seq == 1;
        reply(v, h, NULL, full ? CAROM_REPLY_T_LIMIT : CAROM_REPLY_T_NO_SESSION, text);
        return NULL;
    }
    s->seen = v->set.now(v->set.user);
    return s;
}

/* The last piece has come.  The answer is the scene's. */
static void receive_whole(crm_server *v, crm_session *s, const crm_wire_header *h)
{
    char other[] = "the pieces do not make a scene_t of this client, session and seq";
    crm_assembly whole = s->assembly;
    crm_wire_header inner;
    s->assembly = (crm_assembly){0};
    if (crm_wire_read_header(CRM_WIRE_SCENE, whole.bytes, (size_t)whole.size, &inner) &&
        inner.client_id == h->client_id && inner.session == h->session && inner.seq == h->seq) {
        crm_server_receive(v, CRM_WIRE_SCENE, whole.bytes, (size_t)whole.size);
    } else {
        refuse(v, h, CAROM_REPLY_T_MALFORMED, other);
    }
    crm_assembly_clear(&whole, &s->budget);
}

static void receive_chunk(crm_server *v, const crm_wire_header *h, const void *bytes, size_t size)
{
    char text[CRM_TEXT] = "the session's memory is full";
    carom_scene_chunk_t c;
    crm_session *s = session_for(v, h, 1);
    if (!s) return;
    if (h->seq != s->next_seq) {
        admit(v, s, h, CRM_WIRE_SCENE_CHUNK, bytes, size);
        return;
    }
    if (carom_scene_chunk_t_decode(bytes, 0, (int)size, &c) != (int)size) return;
    const int added = crm_assembly_add(&s->assembly, &s->budget, &c, v->set.limits.message, text);
    const int index = c.chunk_index;
    carom_scene_chunk_t_decode_cleanup(&c);
    if (added == 0) refuse(v, h, CAROM_REPLY_T_MALFORMED, text);
    if (added < 0) reply(v, h, s, CAROM_REPLY_T_BUSY, text);
    if (added <= 0) return;
    if (s->assembly.n_missing > 0) {
        char nothing[] = "";
        carom_reply_t r = reply_to(v, h, s, CAROM_REPLY_T_CHUNK, nothing);
        r.chunk_index = index;
        emit_reply(v, &r);
        return;
    }
    receive_whole(v, s, h);
}

/* Returns 1 when the request is answered here: KEEP_ALIVE, and CLOSE of no session. */
static int receive_action(crm_server *v, const crm_wire_header *h, const void *bytes, size_t size,
                          int *opens)
{
    carom_session_request_t r;
    char nothing[] = "";
    if (carom_session_request_t_decode(bytes, 0, (int)size, &r) != (int)size) return 1;
    *opens = r.session_action == CAROM_SESSION_REQUEST_T_OPEN;
    if (*opens) {
        crm_session *s = session_for(v, h, 1);
        if (!s) return 1;
        if (h->seq == s->next_seq && r.lease >= 0) s->lease = r.lease;
    }
    if (r.session_action != CAROM_SESSION_REQUEST_T_KEEP_ALIVE) return 0;
    crm_session *s = session_for(v, h, 0);
    if (s) reply(v, h, s, CAROM_REPLY_T_OK, nothing);
    return 1;
}

static int check(crm_server *v, crm_wire_type type, const void *bytes, size_t size,
                 crm_wire_header *h)
{
    char text[CRM_TEXT];
    const int has_header = crm_wire_read_header(type, bytes, size, h);
    if (!crm_wire_check(type, &v->set.limits, bytes, size, text, sizeof text)) {
        if (has_header) {
            refuse(v, h, CAROM_REPLY_T_MALFORMED, text);
        } else {
            note_malformed(v, text);
        }
        return 0;
    }
    char low[] = "session must be >= 1";
    if (h->session < 1) {
        refuse(v, h, CAROM_REPLY_T_MALFORMED, low);
        return 0;
    }
    return 1;
}

void crm_server_receive(crm_server *v, crm_wire_type type, const void *bytes, size_t size)
{
    crm_wire_header h;
    int opens = type == CRM_WIRE_SCENE;
    if (type >= CRM_WIRE_N_REQUESTS || !check(v, type, bytes, size, &h)) return;
    if (type == CRM_WIRE_SESSION && receive_action(v, &h, bytes, size, &opens)) return;
    if (h.seq < 1) {
        char low[] = "seq must be >= 1";
        refuse(v, &h, CAROM_REPLY_T_MALFORMED, low);
        return;
    }
    if (type == CRM_WIRE_SCENE_CHUNK) {
        receive_chunk(v, &h, bytes, size);
        return;
    }
    crm_session *s = session_for(v, &h, opens);
    if (s) admit(v, s, &h, type, bytes, size);
}

void crm_server_refuse_size(crm_server *v, crm_wire_type type, const void *head, size_t n,
                            size_t size)
{
    crm_wire_header h;
    char text[CRM_TEXT];
    snprintf(text, sizeof text, "%s: %zu bytes are more than %d (--max-message)",
             crm_wire_type_name(type), size, v->set.limits.message);
    if (crm_wire_read_header(type, head, n, &h)) {
        refuse(v, &h, CAROM_REPLY_T_LIMIT, text);
    } else {
        note_malformed(v, text);
    }
}

/* --- work */

crm_session *crm_server_take(crm_server *v)
{
    crm_session *s = v->ready_first;
    if (!s) return NULL;
    v->ready_first = s->next_ready;
    if (!v->ready_first) v->ready_last = NULL;
    s->working = 1;
    return s;
}

void crm_session_slice(const crm_server *v, crm_session *s)
{
    crm_session_run(&v->set, s);
}

/* Answers are kept while all of them fit into the room of one; the newest always is. */
static void trim_answers(crm_server *v, crm_session *s, int64_t newest)
{
    const size_t limit = (size_t)v->set.max_answer << 20;
    size_t bytes = s->kept[newest % CRM_WINDOW].bytes;
    for (int64_t seq = newest - 1; seq > 0 && seq > newest - CRM_WINDOW; seq--) {
        crm_answer *a = &s->kept[seq % CRM_WINDOW];
        bytes += a->bytes;
        if (bytes > limit) crm_answer_clear(a, &s->budget);
    }
}

/* The reply of the request at the head; with it the answer is complete. */
static void conclude(crm_server *v, crm_session *s)
{
    crm_progress *p = &s->progress;
    const crm_wire_header h = {0, s->client_id, s->id, s->queue[0].seq};
    carom_reply_t r = reply_to(v, &h, s, p->code, p->text);
    r.status = p->status;
    r.num_states = s->answer.n_states;
    r.seconds = p->seconds;
    crm_message m = {0};
    crm_answer *kept = &s->kept[h.seq % CRM_WINDOW];
    crm_answer_clear(kept, &s->budget);
    if (crm_pack_reply(&r, &m)) {
        v->set.emit(v->set.user, m.type, m.bytes, m.size);
        crm_answer_add(&s->answer, &s->budget, m);
    }
    *kept = s->answer;
    s->answer = (crm_answer){0};
    trim_answers(v, s, h.seq);
}

static void shift_queue(crm_session *s)
{
    crm_budget_give(&s->budget, s->queue[0].held);
    crm_request_free(&s->queue[0]);
    s->n_queued--;
    memmove(&s->queue[0], &s->queue[1], (size_t)s->n_queued * sizeof s->queue[0]);
    s->progress = (crm_progress){0};
}

void crm_server_give(crm_server *v, crm_session *s)
{
    v->busy += s->progress.slice_seconds;
    v->steps_total += s->progress.steps_in_slice;
    s->working = 0;
    s->seen = v->set.now(v->set.user);
    s->step = s->engine ? crm_engine_step_count(s->engine) : 0;
    s->first_step = s->engine ? crm_engine_first_step(s->engine) : 0;
    s->recorded = s->engine ? crm_engine_recorded(s->engine) : 0;
    if (s->progress.done) {
        conclude(v, s);
        const int closing = s->progress.closing;
        shift_queue(s);
        if (closing) {
            remove_session(v, s);
            return;
        }
    }
    if (s->n_queued > 0) make_ready(v, s);
}

/* --- time */

void crm_server_tick(crm_server *v)
{
    const double now = v->set.now(v->set.user);
    for (int i = 0; i < CRM_BUCKETS; i++) {
        crm_session *s = v->buckets[i];
        while (s) {
            crm_session *next = s->next_in_bucket;
            const int idle = !s->working && s->n_queued == 0;
            if (idle && s->lease > 0 && now - s->seen > s->lease) remove_session(v, s);
            s = next;
        }
    }
}

static int queue_depth(const crm_server *v)
{
    int n = 0;
    for (int i = 0; i < CRM_BUCKETS; i++) {
        for (const crm_session *s = v->buckets[i]; s; s = s->next_in_bucket) n += s->n_queued;
    }
    return n;
}

void crm_server_status(crm_server *v, crm_transport_figures figures)
{
    const double now = v->set.now(v->set.user), span = now - v->status_at;
    carom_status_t m = {0};
    m.utime = v->set.utime(v->set.user);
    m.client_id = v->set.boot_id;
    m.seq = ++v->n_statuses;
    m.daemon_name = (char *)v->set.name; /* the encoder only reads */
    m.daemon_version = (char *)v->set.version;
    m.url = (char *)v->set.url;
    m.boot_id = v->set.boot_id;
    m.uptime = now - v->started;
    m.num_sessions = v->n_sessions;
    m.num_clients = figures.n_clients;
    m.queue_depth = queue_depth(v);
    m.steps_total = v->steps_total;
    m.states_dropped = figures.states_dropped;
    m.malformed = v->malformed;
    m.busy = span > 0 ? fmin(v->busy / (span * v->set.n_workers), 1) : 0;
    m.max_message = v->set.limits.message;
    v->busy = 0;
    v->status_at = now;
    crm_message packed = {0};
    if (crm_pack_status(&m, &packed)) {
        v->set.emit(v->set.user, packed.type, packed.bytes, packed.size);
    }
    free(packed.bytes);
}
