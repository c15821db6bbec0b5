/* exchange.c: one request until its answer is complete. */
#include "parts.h"

#include <errno.h>
#include <inttypes.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <time.h>

static const double FIRST_WAIT = 0.02; /* [s] until a request is repeated */
static const double WAIT_GROWTH = 1.5;
static const double LONGEST_WAIT = 0.5; /* [s] */
static const double PATIENCE = 10.0;    /* [s] without anything new */

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static int64_t utime(void)
{
    struct timespec t;
    clock_gettime(CLOCK_REALTIME, &t);
    return (int64_t)t.tv_sec * 1000000 + t.tv_nsec / 1000;
}

crm_wire_header crm_client_next_header(carom_client *c)
{
    const crm_wire_header h = {utime(), c->client_id, c->session, c->seq + 1};
    return h;
}

/* LCM writes a message to TCP in five pieces.  Corked, they leave as one; other sockets refuse the
 * option, which does no harm. */
static void cork(const carom_client *c, int on)
{
    setsockopt(c->fd, IPPROTO_TCP, TCP_CORK, &on, sizeof on);
}

/* A connection that broke raises SIGPIPE inside LCM; the program's own signals are left alone. */
void crm_client_guard(crm_guard *g)
{
    sigset_t pipe_signal, pending;
    sigemptyset(&pipe_signal);
    sigaddset(&pipe_signal, SIGPIPE);
    sigpending(&pending);
    g->was_pending = sigismember(&pending, SIGPIPE);
    pthread_sigmask(SIG_BLOCK, &pipe_signal, &g->mask);
}

void crm_client_unguard(const crm_guard *g)
{
    const struct timespec at_once = {0, 0};
    sigset_t pipe_signal;
    sigemptyset(&pipe_signal);
    sigaddset(&pipe_signal, SIGPIPE);
    if (!g->was_pending) {
        while (sigtimedwait(&pipe_signal, NULL, &at_once) < 0 && errno == EINTR) {
        }
    }
    pthread_sigmask(SIG_SETMASK, &g->mask, NULL);
}

static int publish(carom_client *c, crm_wire_type type, const void *bytes, int size)
{
    crm_guard g;
    crm_client_guard(&g);
    cork(c, 1);
    const int done = lcm_publish(c->lcm, c->channels[type], bytes, (unsigned)size);
    cork(c, 0);
    crm_client_unguard(&g);
    return done;
}

/* Encodes the request again, with the steps of the states that are missing. */
static int encode_resend(crm_exchange *x, int n, int64_t *steps)
{
    x->step->num_resend = n;
    x->step->resend_step = steps;
    const int size = carom_step_request_t_encoded_size(x->step);
    unsigned char *bytes = realloc(x->bytes, (size_t)size);
    if (!bytes) return 0;
    x->bytes = bytes;
    x->size = size;
    return carom_step_request_t_encode(bytes, 0, size, x->step) == size;
}

static int send_chunk(carom_client *c, crm_exchange *x, int k)
{
    unsigned char buffer[CRM_CHUNK_BYTES + 256];
    carom_scene_chunk_t m;
    m.utime = utime();
    m.client_id = c->client_id;
    m.session = c->session;
    m.seq = x->seq;
    m.scene_bytes = x->size;
    m.chunk_stride = CRM_CHUNK_BYTES;
    m.chunk_index = k;
    m.chunk_offset = k * CRM_CHUNK_BYTES;
    const int rest = x->size - m.chunk_offset;
    m.num_bytes = rest < CRM_CHUNK_BYTES ? rest : CRM_CHUNK_BYTES;
    m.chunk_data = x->bytes + m.chunk_offset;
    const int size = carom_scene_chunk_t_encode(buffer, 0, sizeof buffer, &m);
    return publish(c, CRM_WIRE_SCENE_CHUNK, buffer, size);
}

/* New pieces, as long as few enough are on their way. */
static int send_new_chunks(carom_client *c, crm_exchange *x)
{
    while (x->next_chunk < x->n_chunks &&
           x->next_chunk - x->n_acknowledged < CRM_CHUNKS_UNDER_WAY) {
        if (send_chunk(c, x, x->next_chunk++) < 0) return -1;
    }
    return 0;
}

/* Pieces without acknowledgment.  When none is left the last one asks for the answer. */
static int repeat_chunks(carom_client *c, crm_exchange *x)
{
    for (int k = 0; k < x->next_chunk; k++) {
        const int ask = k == x->n_chunks - 1 && x->n_acknowledged >= x->n_chunks - 1;
        if (x->acknowledged[k] && !ask) continue;
        if (send_chunk(c, x, k) < 0) return -1;
        c->info.repeated++;
    }
    return 0;
}

static int send_again(carom_client *c, crm_exchange *x)
{
    int64_t steps[CRM_MAX_RESEND];
    if (x->n_chunks > 0) return repeat_chunks(c, x);
    if (x->step) {
        const int n = crm_client_missing(x, CRM_MAX_RESEND, steps);
        c->info.resent += x->has_reply ? n : 0;
        if (!encode_resend(x, n, steps)) return -1;
    }
    c->info.repeated++;
    return publish(c, x->type, x->bytes, x->size);
}

static int send_first(carom_client *c, crm_exchange *x)
{
    if (x->n_chunks > 0) return send_new_chunks(c, x);
    return publish(c, x->type, x->bytes, x->size);
}

/* Handles what arrives within the time.  Negative: the connection broke. */
static int wait_for(carom_client *c, double seconds)
{
    struct pollfd p = {c->fd, POLLIN, 0};
    const int ms = seconds > 0 ? (int)(1000 * seconds) + 1 : 0;
    const int n = poll(&p, 1, ms);
    if (n < 0) return errno == EINTR ? 0 : -1;
    if (n == 0) return 0;
    return lcm_handle(c->lcm);
}

static carom_client_code broken(carom_client *c)
{
    return crm_client_fail(c, CAROM_CLIENT_E_NETWORK, "the connection to %s broke", c->where);
}

static carom_client_code no_answer(carom_client *c, const crm_exchange *x)
{
    if (x->busy_text[0]) {
        return crm_client_fail(c, CAROM_CLIENT_E_TIMEOUT, "the server at %s is busy: %s", c->where,
                               x->busy_text);
    }
    return crm_client_fail(c, CAROM_CLIENT_E_TIMEOUT,
                           "no answer from %s for %.0f s: is caromd running there?", c->where,
                           PATIENCE);
}

/* A message that brings something extends the patience, and puts off the next repetition. */
static carom_client_code run(carom_client *c, crm_exchange *x)
{
    double wait = FIRST_WAIT, seen = now(), next = seen + wait;
    long signs = 0;
    if (send_first(c, x) < 0) return broken(c);
    while (!crm_client_complete(x)) {
        const double t = now();
        if (x->signs_of_life > signs) {
            signs = x->signs_of_life;
            if (!x->busy_text[0]) seen = t;
            next = t + wait;
            if (send_new_chunks(c, x) < 0) return broken(c);
        }
        if (t - seen > PATIENCE) return no_answer(c, x);
        if (t >= next) {
            if (send_again(c, x) < 0) return broken(c);
            wait = wait * WAIT_GROWTH < LONGEST_WAIT ? wait * WAIT_GROWTH : LONGEST_WAIT;
            next = t + wait;
        }
        if (wait_for(c, next - now()) < 0) return broken(c);
        crm_client_deliver(c);
    }
    return CAROM_CLIENT_OK;
}

/* The code of a complete answer. */
static carom_client_code judge(carom_client *c, const crm_exchange *x)
{
    const carom_reply_t *r = &x->reply;
    c->info.boot_id = r->boot_id;
    c->info.step = r->step;
    c->info.first_step = r->first_step;
    c->info.recorded_steps = r->recorded_steps;
    c->info.status = (carom_status)r->status;
    c->info.seconds = r->seconds;
    switch (r->reply_code) {
    case CAROM_REPLY_T_OK: return CAROM_CLIENT_OK;
    case CAROM_REPLY_T_FAILED:
        return crm_client_fail(c, CAROM_CLIENT_E_FAILED, "%s", x->reply_text);
    case CAROM_REPLY_T_NO_SESSION:
        c->open = 0;
        return crm_client_fail(c, CAROM_CLIENT_E_SESSION, "session %d: %s", c->session,
                               x->reply_text);
    case CAROM_REPLY_T_GAP:
    case CAROM_REPLY_T_FORGOTTEN:
        c->open = 0;
        return crm_client_fail(c, CAROM_CLIENT_E_SESSION,
                               "session %d: the server expects request %" PRId64 ", not %" PRId64,
                               c->session, r->next_seq, x->seq);
    default: return crm_client_fail(c, CAROM_CLIENT_E_REFUSED, "%s", x->reply_text);
    }
}

/* Codes after which the seq is used up. */
static int executed(const crm_exchange *x)
{
    const int8_t code = x->reply.reply_code;
    return x->has_reply && (code == CAROM_REPLY_T_OK || code == CAROM_REPLY_T_MISMATCH ||
                            code == CAROM_REPLY_T_REFUSED || code == CAROM_REPLY_T_FAILED);
}

static void free_exchange(crm_exchange *x)
{
    for (int64_t k = 0; x->held && k < x->n_regular && x->n_held > 0; k++) {
        if (!x->held[k]) continue;
        carom_state_t_destroy(x->held[k]);
        x->n_held--;
    }
    if (x->last) carom_state_t_destroy(x->last);
    free(x->held);
    free(x->acknowledged);
    free(x->bytes);
}

carom_client_code crm_client_exchange(carom_client *c, crm_exchange *x)
{
    carom_client_code code = CAROM_CLIENT_OK;
    x->seq = c->seq + 1;
    if (x->type == CRM_WIRE_SCENE && x->size > CRM_CHUNK_BYTES) {
        x->n_chunks = (x->size - 1) / CRM_CHUNK_BYTES + 1;
        x->acknowledged = calloc((size_t)x->n_chunks, 1);
        if (!x->acknowledged) code = crm_client_fail(c, CAROM_CLIENT_E_MEMORY, "no memory");
    }
    if (code >= 0) {
        c->exchange = x;
        code = run(c, x);
        c->exchange = NULL;
    }
    /* Nobody knows whether the request was executed: its seq cannot be used again. */
    if (code == CAROM_CLIENT_E_NETWORK || code == CAROM_CLIENT_E_TIMEOUT) c->open = 0;
    if (code >= 0) code = judge(c, x);
    if (executed(x)) c->seq = x->seq;
    free_exchange(x);
    return code;
}
