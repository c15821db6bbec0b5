/* session.c: requests and their execution, one time slice after the other. */
#include "parts.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int crm_request_decode(crm_request *r, crm_wire_type type, const void *bytes, size_t size)
{
    const int n = (int)size;
    r->type = type;
    switch (type) {
    case CRM_WIRE_SCENE: return carom_scene_t_decode(bytes, 0, n, &r->as.scene) == n;
    case CRM_WIRE_STEP: return carom_step_request_t_decode(bytes, 0, n, &r->as.step) == n;
    case CRM_WIRE_LOSS_GRADIENT: return carom_loss_gradient_t_decode(bytes, 0, n, &r->as.loss) == n;
    case CRM_WIRE_DESCEND:
        return carom_parameter_gradient_t_decode(bytes, 0, n, &r->as.descent) == n;
    case CRM_WIRE_SESSION: return carom_session_request_t_decode(bytes, 0, n, &r->as.session) == n;
    default: return 0;
    }
}

void crm_request_free(crm_request *r)
{
    switch (r->type) {
    case CRM_WIRE_SCENE: carom_scene_t_decode_cleanup(&r->as.scene); break;
    case CRM_WIRE_STEP: carom_step_request_t_decode_cleanup(&r->as.step); break;
    case CRM_WIRE_LOSS_GRADIENT: carom_loss_gradient_t_decode_cleanup(&r->as.loss); break;
    case CRM_WIRE_DESCEND: carom_parameter_gradient_t_decode_cleanup(&r->as.descent); break;
    case CRM_WIRE_SESSION: carom_session_request_t_decode_cleanup(&r->as.session); break;
    default: break;
    }
    memset(r, 0, sizeof *r);
}

static void drop_engine(crm_session *s)
{
    crm_engine_destroy(s->engine);
    s->engine = NULL;
    crm_budget_give(&s->budget, s->scene_held);
    s->scene_held = 0;
    const carom_allocator a = crm_budget_allocator(&s->budget);
    a.release(a.user, s->force, (size_t)s->n_force * sizeof(double));
    s->force = NULL;
    s->n_force = 0;
}

void crm_session_free(crm_session *s)
{
    drop_engine(s);
    for (int i = 0; i < s->n_queued; i++) crm_request_free(&s->queue[i]);
    for (int i = 0; i < CRM_WINDOW; i++) crm_answer_clear(&s->kept[i], &s->budget);
    crm_answer_clear(&s->answer, &s->budget);
    crm_assembly_clear(&s->assembly, &s->budget);
    /* What is left is the queue's share. */
    crm_budget_give(&s->budget, s->budget.held);
    free(s);
}

/* The request ends with this code. */
static void finish(crm_progress *p, int code)
{
    p->code = code;
    p->done = 1;
}

/* Code of a request that the engine answered with `status`; the text is the engine's. */
static void finish_status(const crm_server_settings *set, crm_session *s, carom_status status)
{
    crm_progress *p = &s->progress;
    p->status = status;
    if (status >= 0) {
        finish(p, CAROM_REPLY_T_OK);
        return;
    }
    if (status == CAROM_E_MEMORY) {
        snprintf(p->text, sizeof p->text,
                 "no memory: a session may hold %d MB (--session-memory), all together %d MB "
                 "(--memory)",
                 set->session_memory, set->memory);
    }
    const int refused = status == CAROM_E_ARGUMENT || status == CAROM_E_SHAPE ||
                        status == CAROM_E_STATE || status == CAROM_E_CAPACITY;
    finish(p, refused ? CAROM_REPLY_T_REFUSED : CAROM_REPLY_T_FAILED);
}

static int64_t max_answer_bytes(const crm_server_settings *set)
{
    return (int64_t)set->max_answer << 20;
}

/* Publishes the message and keeps it with the answer.  0: the request is finished, for lack of
 * room. */
static int publish(const crm_server_settings *set, crm_session *s, crm_message m)
{
    crm_progress *p = &s->progress;
    if ((int64_t)s->answer.bytes + m.size > max_answer_bytes(set)) {
        snprintf(p->text, sizeof p->text,
                 "step %" PRId64 ": the answer is larger than %d MB (--max-answer): ask for fewer "
                 "steps or publish less often",
                 s->engine ? crm_engine_step_count(s->engine) : 0, set->max_answer);
        free(m.bytes);
        p->status = CAROM_E_CAPACITY;
        finish(p, CAROM_REPLY_T_FAILED);
        return 0;
    }
    const crm_message sent = m;
    if (!crm_answer_add(&s->answer, &s->budget, m)) {
        finish_status(set, s, CAROM_E_MEMORY);
        return 0;
    }
    set->emit(set->user, sent.type, sent.bytes, sent.size);
    return 1;
}

static int publish_state(const crm_server_settings *set, crm_session *s, int want)
{
    carom_state_t state = {0};
    crm_message m = {0};
    const carom_status status = crm_engine_state(s->engine, want, &state);
    state.utime = set->utime(set->user);
    state.client_id = s->client_id;
    state.session = s->id;
    state.seq = s->queue[0].seq;
    if (status < 0 || !crm_pack_state(&state, &m)) {
        finish_status(set, s, CAROM_E_MEMORY);
        return 0;
    }
    s->progress.published = state.step;
    return publish(set, s, m);
}

/* --- scene */

static void run_scene(const crm_server_settings *set, crm_session *s, const carom_scene_t *scene)
{
    crm_engine *engine = NULL;
    const size_t held = CRM_DECODED * (size_t)carom_scene_t_encoded_size(scene);
    if (!crm_budget_take(&s->budget, held)) {
        finish_status(set, s, CAROM_E_MEMORY);
        return;
    }
    const carom_status status =
        crm_engine_create(scene, crm_budget_allocator(&s->budget), s->progress.text, &engine);
    if (status >= 0) {
        drop_engine(s);
        s->engine = engine;
        s->scene_held = held;
    } else {
        crm_budget_give(&s->budget, held);
    }
    finish_status(set, s, status);
}

/* --- steps */

static int check_forces(const carom_step_request_t *r, int n_bodies, char *text)
{
    for (int k = 0; k < r->num_forces; k++) {
        const int step = r->force_step[k], body = r->force_body[k];
        const double *f = r->step_force + 3 * k;
        if (step < 0 || step >= r->num_steps || body < 0 || body >= n_bodies) {
            snprintf(text, CRM_TEXT,
                     "force %d on body %d in step %d: there are bodies 0 to %d and steps 0 to %d",
                     k, body, step, n_bodies - 1, r->num_steps - 1);
            return 0;
        }
        if (k > 0 && step < r->force_step[k - 1]) {
            snprintf(text, CRM_TEXT, "force_step[%d] = %d after %d: must not decrease", k, step,
                     r->force_step[k - 1]);
            return 0;
        }
        if (!isfinite(f[0]) || !isfinite(f[1]) || !isfinite(f[2])) {
            snprintf(text, CRM_TEXT, "force %d on body %d in step %d is not finite", k, body, step);
            return 0;
        }
    }
    return 1;
}

static int check_step_request(const crm_server_settings *set, const crm_session *s,
                              const carom_step_request_t *r, char *text)
{
    if (r->num_steps < 0 || r->num_steps > set->max_steps) {
        snprintf(text, CRM_TEXT, "num_steps = %d is outside 0 to %d (--max-steps)", r->num_steps,
                 set->max_steps);
        return 0;
    }
    if (r->publish_every < 0) {
        snprintf(text, CRM_TEXT, "publish_every = %d: must be >= 0", r->publish_every);
        return 0;
    }
    if (r->record < CAROM_STEP_REQUEST_T_RECORD_OFF ||
        r->record > CAROM_STEP_REQUEST_T_RECORD_RESTART) {
        snprintf(text, CRM_TEXT, "record = %d: 0 off, 1 on, 2 restart", r->record);
        return 0;
    }
    return check_forces(r, crm_engine_n_bodies(s->engine), text);
}

/* 1: s->force has 3 zeros per body. */
static int reserve_force(crm_session *s)
{
    const int n = 3 * crm_engine_n_bodies(s->engine);
    if (n <= s->n_force) return 1;
    const carom_allocator a = crm_budget_allocator(&s->budget);
    double *force = a.allocate(a.user, (size_t)n * sizeof *force);
    if (!force) return 0;
    memset(force, 0, (size_t)n * sizeof *force);
    a.release(a.user, s->force, (size_t)s->n_force * sizeof *force);
    s->force = force;
    s->n_force = n;
    return 1;
}

static void start_steps(const crm_server_settings *set, crm_session *s,
                        const carom_step_request_t *r)
{
    crm_progress *p = &s->progress;
    const int64_t step = crm_engine_step_count(s->engine);
    if (r->from_step != step) {
        snprintf(p->text, sizeof p->text, "the session is at step %" PRId64 ", not %" PRId64, step,
                 r->from_step);
        finish(p, CAROM_REPLY_T_MISMATCH);
        return;
    }
    if (!check_step_request(set, s, r, p->text)) {
        p->status = CAROM_E_ARGUMENT;
        finish(p, CAROM_REPLY_T_REFUSED);
        return;
    }
    if (r->num_forces > 0 && !reserve_force(s)) {
        finish_status(set, s, CAROM_E_MEMORY);
        return;
    }
    const carom_status status = crm_engine_record(s->engine, (crm_record)r->record, p->text);
    if (status < 0) finish_status(set, s, status);
}

/* Adds (sign = 1) or takes out (sign = 0) the forces of the step that is next; returns the index
 * after them. */
static int place_forces(crm_session *s, const carom_step_request_t *r, int sign)
{
    int k = s->progress.at_force;
    for (; k < r->num_forces && r->force_step[k] == s->progress.n_steps; k++) {
        double *f = s->force + 3 * r->force_body[k];
        for (int i = 0; i < 3; i++) f[i] = sign ? f[i] + r->step_force[3 * k + i] : 0;
    }
    return k;
}

/* One step; 0: the request is finished. */
static int one_step(const crm_server_settings *set, crm_session *s, const carom_step_request_t *r)
{
    crm_progress *p = &s->progress;
    const int next = place_forces(s, r, 1);
    const double *force = next > p->at_force ? s->force : NULL;
    const carom_status status = crm_engine_advance(s->engine, force, p->text);
    place_forces(s, r, 0);
    p->at_force = next;
    if (status < 0) {
        if (p->published != crm_engine_step_count(s->engine)) publish_state(set, s, r->want);
        finish_status(set, s, status);
        p->code = CAROM_REPLY_T_FAILED; /* steps before it are made */
        return 0;
    }
    p->n_steps++;
    p->steps_in_slice++;
    if (status > p->status) p->status = status;
    if (r->publish_every == 0 || p->n_steps % r->publish_every != 0) return 1;
    return publish_state(set, s, r->want);
}

static void run_steps(const crm_server_settings *set, crm_session *s, const carom_step_request_t *r,
                      double until)
{
    crm_progress *p = &s->progress;
    if (!p->started) start_steps(set, s, r);
    p->started = 1;
    while (!p->done && p->n_steps < r->num_steps) {
        if (!one_step(set, s, r)) return;
        if (set->now(set->user) >= until) break;
    }
    if (p->done || p->n_steps < r->num_steps) return;
    const int last_is_out = p->published == crm_engine_step_count(s->engine);
    if (last_is_out || publish_state(set, s, r->want)) finish(p, CAROM_REPLY_T_OK);
}

/* --- gradients */

static void run_gradient(const crm_server_settings *set, crm_session *s,
                         const carom_loss_gradient_t *loss)
{
    carom_parameter_gradient_t out = {0};
    crm_message m = {0};
    const carom_status status = crm_engine_gradient(s->engine, loss, s->progress.text, &out);
    if (status < 0) {
        finish_status(set, s, status);
        return;
    }
    out.utime = set->utime(set->user);
    out.client_id = s->client_id;
    out.session = s->id;
    out.seq = loss->seq;
    if (!crm_pack_gradient(&out, &m)) {
        finish_status(set, s, CAROM_E_MEMORY);
        return;
    }
    if (publish(set, s, m)) finish_status(set, s, status);
}

static void run_descent(const crm_server_settings *set, crm_session *s,
                        const carom_parameter_gradient_t *descent)
{
    crm_message m = {0};
    const carom_status status = crm_engine_descend(s->engine, descent, s->progress.text);
    if (status < 0) {
        finish_status(set, s, status);
        return;
    }
    carom_scene_t scene = *crm_engine_scene(s->engine);
    scene.utime = set->utime(set->user);
    scene.client_id = s->client_id;
    scene.session = s->id;
    scene.seq = descent->seq;
    if (!crm_pack_scene_updated(&scene, &m)) {
        finish_status(set, s, CAROM_E_MEMORY);
        return;
    }
    if (publish(set, s, m)) finish_status(set, s, status);
}

/* --- session requests */

static void run_action(const crm_server_settings *set, crm_session *s,
                       const carom_session_request_t *r)
{
    crm_progress *p = &s->progress;
    switch (r->session_action) {
    case CAROM_SESSION_REQUEST_T_OPEN: finish(p, CAROM_REPLY_T_OK); return;
    case CAROM_SESSION_REQUEST_T_CLOSE:
        p->closing = 1;
        finish(p, CAROM_REPLY_T_OK);
        return;
    case CAROM_SESSION_REQUEST_T_SNAPSHOT:
        finish_status(set, s, crm_engine_snapshot(s->engine, r->snapshot, p->text));
        return;
    case CAROM_SESSION_REQUEST_T_RESTORE:
        finish_status(set, s, crm_engine_restore(s->engine, r->snapshot, p->text));
        return;
    case CAROM_SESSION_REQUEST_T_RESET:
        finish_status(set, s, crm_engine_reset(s->engine, p->text));
        return;
    default:
        snprintf(p->text, sizeof p->text, "session_action = %d is none of 1 to 6",
                 r->session_action);
        finish(p, CAROM_REPLY_T_REFUSED);
    }
}

static int needs_scene(const crm_request *r)
{
    if (r->type == CRM_WIRE_SCENE) return 0;
    return r->type != CRM_WIRE_SESSION ||
           r->as.session.session_action >= CAROM_SESSION_REQUEST_T_SNAPSHOT;
}

static void run(const crm_server_settings *set, crm_session *s, double until)
{
    const crm_request *r = &s->queue[0];
    if (!s->engine && needs_scene(r)) {
        snprintf(s->progress.text, sizeof s->progress.text, "the session has no scene yet");
        finish(&s->progress, CAROM_REPLY_T_REFUSED);
        return;
    }
    switch (r->type) {
    case CRM_WIRE_SCENE: run_scene(set, s, &r->as.scene); break;
    case CRM_WIRE_STEP: run_steps(set, s, &r->as.step, until); break;
    case CRM_WIRE_LOSS_GRADIENT: run_gradient(set, s, &r->as.loss); break;
    case CRM_WIRE_DESCEND: run_descent(set, s, &r->as.descent); break;
    case CRM_WIRE_SESSION: run_action(set, s, &r->as.session); break;
    default: finish(&s->progress, CAROM_REPLY_T_REFUSED); break;
    }
}

void crm_session_run(const crm_server_settings *set, crm_session *s)
{
    crm_progress *p = &s->progress;
    const double start = set->now(set->user);
    if (!p->started) p->published = -1;
    p->steps_in_slice = 0;
    run(set, s, start + 1e-3 * set->slice);
    p->slice_seconds = set->now(set->user) - start;
    p->seconds += p->slice_seconds;
    s->answer.seq = s->queue[0].seq;
}
