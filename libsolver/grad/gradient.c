/* gradient.c: the reverse pass over a tape: events, step borders, losses.  docs/gradient.md. */
#include "grad/internal.h"

#include <math.h>

/* A cotangent below this is dropped [largest seed]: at rest it shrinks by 1e-9 a sub-step, and
 * numbers that have lost their normal form make every product slow. */
static const double NEGLIGIBLE = 1e-200;

/* One behind the other. */
static void lay_sides(carom_contact_bars *bars, crm_block *b, size_t k3, size_t m, size_t rows)
{
    double *at = crm_carve(b, k3 + 2 * m + rows, sizeof(double));
    bars->u = at;
    bars->cn = at ? at + k3 : NULL;
    bars->ct = at ? bars->cn + m : NULL;
    bars->ce = at ? bars->ct + m : NULL;
}

static void lay(crm_reverse *r, crm_block *b, size_t m)
{
    const size_t n3 = 3 * (size_t)r->world->n_bodies;
    const size_t k3 = 3 * (size_t)r->world->n_moving;
    const size_t rows = (size_t)r->world->n_joint_rows;
    double **const full[] = {&r->q_bar,    &r->v_bar,    &r->solve_bar, &r->pose,    &r->pose_bar,
                             &r->rest,     &r->spare_q,  &r->spare_v,   &r->q_after, &r->v_after,
                             &r->column_q, &r->column_v, &r->start_q,   &r->start_v, &r->late_bar};
    for (size_t k = 0; k < sizeof full / sizeof *full; k++) {
        *full[k] = crm_carve(b, n3, sizeof(double));
    }
    crm_lay_unpacked(&r->work, b, n3);
    if (r->world->settings.order > 2) crm_lay_unpacked(&r->inner, b, n3);
    r->clock_bar = crm_carve(b, (size_t)r->world->n_bodies, sizeof(double));
    r->clock_old = crm_carve(b, (size_t)r->world->n_bodies, sizeof(double));
    r->velocity_bar = crm_carve(b, k3, sizeof(double));
    lay_sides(&r->bars, b, k3, m, rows);
    lay_sides(&r->total, b, k3, m, rows);
    r->n_sides = k3 + 2 * m + rows;
    r->bars.inv_mass = crm_carve(b, k3, sizeof(double));
    r->bars.jn = crm_carve(b, 6 * m, sizeof(double));
    r->bars.jt = crm_carve(b, 6 * m, sizeof(double));
    r->bars.mu = crm_carve(b, m, sizeof(double));
    r->bars.je = crm_carve(b, 6 * rows, sizeof(double));
    r->turn.n = crm_carve(b, 6 * m, sizeof(double));
    r->turn.t = crm_carve(b, 6 * m, sizeof(double));
    r->turn.e = crm_carve(b, 6 * rows, sizeof(double));
    r->moved = crm_carve(b, m, sizeof *r->moved);
    r->gap_bar = crm_carve(b, m, sizeof(double));
    crm_lay_smoothed(r->tape, &r->smoothed, b, k3, m, rows);
}

static carom_status allocate(crm_reverse *r)
{
    const int m = r->tape->most_contacts;
    const carom_status e = crm_rows_reserve(r->world, m);
    if (e) return e;
    crm_block b = {NULL, 0};
    lay(r, &b, (size_t)m);
    r->bytes = b.used;
    r->block = crm_new(&r->tape->memory, b.used, 1);
    if (!r->block) return CAROM_E_MEMORY;
    b.base = r->block;
    b.used = 0;
    lay(r, &b, (size_t)m);
    return CAROM_OK;
}

static void clear(double *x, size_t n)
{
    if (x && n) memset(x, 0, n * sizeof *x);
}

static void clear_sink(const crm_reverse *r)
{
    const int n_frames = r->to - r->from;
    for (int k = 0; k < CRM_N_ARRAYS; k++) {
        clear(crm_array(&r->sink.g, k), crm_array_size(r->world, n_frames, k));
    }
}

static void drop_negligible(const carom_world *w, double *x, double scale)
{
    for (int i = 0; i < w->island->n_bodies; i++) {
        double *y = x + 3 * w->island->bodies[i];
        for (int k = 0; k < 3; k++) {
            if (fabs(y[k]) < NEGLIGIBLE * scale) y[k] = 0;
        }
    }
}

/* The indicator g whose root ended the sub-step: the gap of its contact, or Jt v1.  Adds the
 * cotangents of scale g at (q1, v1) and of the parameters. */
static void event_vjp(crm_reverse *r, const crm_substep *s, double scale)
{
    static const double none[6] = {0};
    const crm_contact *c = &s->event;
    carom_contact_bar bar = {{0, 0}, {0, 0}, {0, 0}, scale};
    if (s->end == CRM_END_STOP) {
        double jn[6];
        double jt[6];
        double jt_bar[6];
        bar.gap = 0;
        crm_contact_rows(c, jn, jt);
        for (int i = 0; i < 6; i++) {
            const int x = 3 * (i < 3 ? c->body_a : c->body_b) + i % 3;
            r->v_bar[x] += scale * jt[i];
            jt_bar[i] = scale * s->v1[x];
        }
        crm_contact_rows_vjp(c, none, jt_bar, &bar);
    }
    crm_geometry_vjp(r, s->q1, c, &bar, r->q_bar);
}

static double dot_island(const carom_world *w, const double *x, const double *y)
{
    double sum = 0;
    for (int i = 0; i < w->island->n_bodies; i++) {
        const int b = 3 * w->island->bodies[i];
        sum += x[b] * y[b] + x[b + 1] * y[b + 1] + x[b + 2] * y[b + 2];
    }
    return sum;
}

/* Adds the cotangents of -scale g0, where the event is the return to the gap g0 at q0. */
static void event_start_vjp(crm_reverse *r, const crm_substep *s, double scale)
{
    if (s->end != CRM_END_EVENT || !s->returns || scale == 0) return;
    const carom_contact_bar bar = {{0, 0}, {0, 0}, {0, 0}, -scale};
    crm_geometry_vjp(r, s->q0, &s->event, &bar, r->q_bar);
}

/* The sub-step ended at the root h* of g: dh* = -(dg/dtheta) / (dg/dh).  With H = h_bar - left_bar,
 * the cotangent of h*, every derivative of g enters with k = -H / (dg/dh): the seeds k dg/dq1 and
 * k dg/dv1 are added to q_bar and v_bar, and k dg/dparameter to the sink.  What h does to (q1, v1)
 * is found forward: it gives h_bar and dg/dh.  *k stays where the time has no usable derivative. */
static carom_status locate_vjp(crm_reverse *r, crm_substep *s, double left_bar, double *k)
{
    const carom_world *w = r->world;
    crm_forward *f = &r->clockwork;
    carom_status e = CAROM_OK;
    if (!f->block) e = crm_forward_open(f, r->tape, 0, NULL, r->to);
    if (e < 0) return e;
    f->record = r->record;
    const crm_line *clock = crm_begin_clockwork(f);
    e = crm_substep_jvp(f, s, 1);
    if (e < 0) return e;
    const double slope = crm_event_jvp(f, s, clock);
    const double h_bar = dot_island(w, r->q_bar, clock->q) + dot_island(w, r->v_bar, clock->v);
    if (fabs(slope) <= crm_grazing(w, s)) {
        return crm_kinks_add(&r->tape->memory, &r->kinks, r->frame + 1, &s->event,
                             CAROM_KINK_GRAZING);
    }
    *k = -(h_bar - left_bar) / slope;
    event_vjp(r, s, *k);
    return CAROM_OK;
}

/* A sub-step of frame n starts at (n + 1) dt less what is left then. */
static void give_time(crm_reverse *r, double *left_bar)
{
    const double n = (double)(r->tape->first_step + r->frame);
    *left_bar -= r->time_bar;
    if (r->sink.g.dt) *r->sink.g.dt += (n + 1) * r->time_bar;
}

/* One sub-step backward; *left_bar is the cotangent of the time left after it, then before it. */
static carom_status reverse_record(crm_reverse *r, int record, double *left_bar)
{
    crm_substep *s = &r->work.s;
    double h_bar;
    double k = 0;
    r->record = record;
    crm_unpack(r->world, &r->tape->records[record], r->moved, &r->work);
    crm_copy(r->world, s->q1, r->q_after);
    crm_copy(r->world, s->v1, r->v_after);
    if (s->end == CRM_END_EVENT || s->end == CRM_END_STOP) {
        const carom_status e = locate_vjp(r, s, *left_bar, &k);
        if (e < 0) return e;
    }
    r->time_bar = 0;
    const carom_status e = crm_substep_vjp(r, s, r->q_bar, r->v_bar, &h_bar);
    if (e < 0) return e;
    event_start_vjp(r, s, k);
    drop_negligible(r->world, r->q_bar, r->scale);
    drop_negligible(r->world, r->v_bar, r->scale);
    crm_copy(r->world, r->q_after, s->q0);
    crm_copy(r->world, r->v_after, s->v0);
    switch (s->end) {
    case CRM_END_FRAME: *left_bar = h_bar; break;
    case CRM_END_FRACTION: *left_bar = s->fraction * h_bar + (1 - s->fraction) * *left_bar; break;
    case CRM_END_IMPACT: break; /* no time passes */
    case CRM_END_EVENT:
    case CRM_END_STOP: break; /* left_before = left_after + h*, and h* is in k */
    }
    give_time(r, left_bar);
    return CAROM_OK;
}

/* Adds the losses on the state after `step` steps.  A step that ended with an event owes the time
 * `carry` = 0 to the next one; the state at the border moves with it at (v, W f + g). */
static void add_bars(crm_reverse *r, int step, int n_bars, const carom_state_bar *bars)
{
    const carom_tape *t = r->tape;
    const carom_world *w = r->world;
    const double *v = carom_tape_v(t, step);
    r->asked = 0;
    for (int i = 0; i < n_bars; i++) {
        if (bars[i].step != step) continue;
        r->asked = 1;
        for (int k = 0; k < 3 * w->n_bodies; k++) {
            const int b = k / 3;
            const double q_bar = bars[i].q ? bars[i].q[k] : 0;
            const double v_bar = bars[i].v ? bars[i].v[k] : 0;
            r->scale = fmax(r->scale, fmax(fabs(q_bar), fabs(v_bar)));
            r->q_bar[k] += q_bar;
            r->v_bar[k] += v_bar;
            r->clock_bar[b] += q_bar * v[k] + v_bar * crm_border_acceleration(t, step, k);
        }
    }
}

/* The time left to an island before its first sub-step is dt and what its clock owes. */
static void close_island(crm_reverse *r, const crm_record *first, double left_bar)
{
    if (r->sink.g.dt) *r->sink.g.dt += left_bar;
    r->clock_old[first->island.clock] += left_bar;
}

/* The time owed after the last sub-step of an island: of all its bodies. */
static carom_status open_island(crm_reverse *r, const crm_record *last, double *left_bar)
{
    *left_bar = 0;
    for (int k = 0; k < last->island.n_bodies; k++) {
        *left_bar += r->clock_bar[last->island.bodies[k]];
    }
    if (!r->asked || last->s.end != CRM_END_EVENT) return CAROM_OK;
    return crm_kinks_add(&r->tape->memory, &r->kinks, r->frame + 1, &last->s.event,
                         CAROM_KINK_BORDER);
}

static carom_status reverse_frame(crm_reverse *r, int frame)
{
    const carom_tape *t = r->tape;
    const int first = t->frames[frame].first_record;
    const int end = crm_frame_end(t, frame);
    double *steps = r->sink.g.force_steps;
    if (steps) steps += 3 * (size_t)r->world->n_bodies * (size_t)(frame - r->from);
    r->sink.force_step = steps;
    const crm_record *records = t->records;
    double left_bar = 0;
    r->frame = frame;
    r->kinks.n = 0;
    clear(r->clock_old, (size_t)r->world->n_bodies);
    for (int k = end - 1; k >= first; k--) {
        const crm_record *x = &records[k];
        carom_status e = CAROM_OK;
        if (k == end - 1 || records[k + 1].which != x->which) e = open_island(r, x, &left_bar);
        if (e >= 0) e = reverse_record(r, k, &left_bar);
        if (e < 0) return e;
        if (x->s.map == CRM_MAP_EXTRAPOLATED) k -= x->s.n_inner; /* those before it are its own */
        if (k == first || records[k - 1].which != x->which) close_island(r, x, left_bar);
    }
    double *const swap = r->clock_bar;
    r->clock_bar = r->clock_old;
    r->clock_old = swap;
    r->stats.degenerate += r->kinks.n;
    if (r->kinks.n) r->stats.first_degenerate_step = frame + 1;
    return r->failure;
}

static void start(crm_reverse *r)
{
    const size_t n3 = 3 * (size_t)r->world->n_bodies;
    const double *q = carom_tape_q(r->tape, r->to);
    memcpy(r->pose, q, n3 * sizeof *q);
    memcpy(r->q_after, q, n3 * sizeof *q);
    memcpy(r->v_after, carom_tape_v(r->tape, r->to), n3 * sizeof *q);
    crm_place_statics(&r->work, q, n3);
    if (r->world->settings.order > 2) crm_place_statics(&r->inner, q, n3);
    clear_sink(r);
    r->stats.first_degenerate_step = -1;
}

static carom_status reverse_span(crm_reverse *r, int n_bars, const carom_state_bar *bars)
{
    const size_t n3 = 3 * (size_t)r->world->n_bodies;
    start(r);
    for (int frame = r->to - 1; frame >= r->from; frame--) {
        carom_status e = crm_hold_segment(r->tape, frame);
        if (e < 0) return e;
        add_bars(r, frame + 1, n_bars, bars);
        e = reverse_frame(r, frame);
        if (e < 0) return e;
    }
    add_bars(r, r->from, n_bars, bars);
    for (int b = 0; b < r->world->n_bodies; b++) {
        if (r->world->bodies[b].type == CAROM_STATIC) clear(&r->v_bar[3 * b], 3);
    }
    if (r->sink.g.q0) memcpy(r->sink.g.q0, r->q_bar, n3 * sizeof(double));
    if (r->sink.g.v0) memcpy(r->sink.g.v0, r->v_bar, n3 * sizeof(double));
    return CAROM_OK;
}

static carom_status check(const carom_tape *t, int n_bars, const carom_state_bar *bars)
{
    if (n_bars < 0 || (n_bars > 0 && !bars)) return CAROM_E_ARGUMENT;
    for (int i = 0; i < n_bars; i++) {
        if (bars[i].step >= 0 && bars[i].step <= t->n_frames) continue;
        return crm_world_fail(t->world, CAROM_E_ARGUMENT,
                              "loss at step %d, but the tape has %d steps", bars[i].step,
                              t->n_frames);
    }
    return crm_tape_current(t);
}

carom_status crm_gradient_span(carom_tape *t, int from, int to, int n_bars,
                               const carom_state_bar *bars, const carom_gradient *gradient,
                               carom_gradient_stats *stats)
{
    crm_reverse r = {0};
    const long before = t->n_replayed;
    t->ascending = 0;
    r.tape = t;
    r.world = t->world;
    r.sink.g = *gradient;
    r.from = from;
    r.to = to;
    r.wants_shapes = gradient->radius || gradient->vertices;
    r.wants_joints = gradient->anchors || gradient->axes || gradient->angles || gradient->lengths;
    carom_status e = allocate(&r);
    if (!e) e = reverse_span(&r, n_bars, bars);
    r.stats.solves += r.clockwork.stats.solves;
    r.stats.replayed = t->n_replayed - before;
    crm_free(&t->memory, r.block, r.bytes, 1);
    crm_kinks_free(&t->memory, &r.kinks);
    if (r.clockwork.block) crm_forward_close(&r.clockwork);
    if (e < 0) return crm_world_fail(t->world, e, "gradient: %s", carom_status_text(e));
    if (stats) *stats = r.stats;
    return CAROM_OK;
}

carom_status carom_tape_gradient(carom_tape *tape, int n_bars, const carom_state_bar *bars,
                                 const carom_gradient *gradient, carom_gradient_stats *stats)
{
    if (!tape || !gradient) return CAROM_E_ARGUMENT;
    const carom_status e = check(tape, n_bars, bars);
    return e ? e : crm_gradient_span(tape, 0, tape->n_frames, n_bars, bars, gradient, stats);
}
