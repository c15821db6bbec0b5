/* tangent.c: the forward pass over a tape: events, step borders, states.  docs/gradient.md. */
#include "grad/internal.h"

#include <math.h>

static void lay_line(crm_line *line, crm_block *b, const carom_world *w)
{
    const size_t n3 = 3 * (size_t)w->n_bodies;
    double **const full[] = {&line->q, &line->v, &line->q0, &line->v0};
    double **const columns[] = {&line->start_q, &line->start_v, &line->sum_q, &line->sum_v};
    for (int k = 0; k < 4; k++) *full[k] = crm_carve(b, n3, sizeof(double));
    for (int k = 0; w->settings.order > 2 && k < 4; k++) {
        *columns[k] = crm_carve(b, n3, sizeof(double));
    }
    line->clock = crm_carve(b, (size_t)w->n_bodies, sizeof(double));
    line->clock_old = crm_carve(b, (size_t)w->n_bodies, sizeof(double));
}

static void lay(crm_forward *f, crm_block *b, size_t m)
{
    const carom_world *w = f->world;
    const size_t n3 = 3 * (size_t)w->n_bodies;
    const size_t k3 = 3 * (size_t)w->n_moving;
    const size_t rows = (size_t)w->n_joint_rows;
    crm_line none = {0};
    double **const full[] = {&f->pose, &f->pose_dot, &f->rest, &f->trial};
    double **const moving[] = {&f->dot.inv_mass, &f->dot.u, &f->result};
    double **const contact_rows[] = {&f->dot.jn, &f->dot.jt, &f->turn.n, &f->turn.t};
    double **const contacts[] = {&f->dot.mu, &f->dot.cn, &f->dot.ct, &f->gap};
    for (int k = 0; k < 4; k++) *full[k] = crm_carve(b, n3, sizeof(double));
    for (int k = 0; k < 3; k++) *moving[k] = crm_carve(b, k3, sizeof(double));
    for (int k = 0; k < 4; k++) *contact_rows[k] = crm_carve(b, 6 * m, sizeof(double));
    for (int k = 0; k < 4; k++) *contacts[k] = crm_carve(b, m, sizeof(double));
    f->dot.je = crm_carve(b, 6 * rows, sizeof(double));
    f->turn.e = crm_carve(b, 6 * rows, sizeof(double));
    f->left = crm_carve(b, 6 * rows, sizeof(double));
    f->dot.ce = crm_carve(b, rows, sizeof(double));
    f->error = crm_carve(b, rows, sizeof(double));
    f->moved = crm_carve(b, m, sizeof *f->moved);
    crm_lay_smoothed(f->tape, &f->smoothed, b, k3, m, rows);
    crm_lay_unpacked(&f->work, b, n3);
    if (w->settings.order > 2) crm_lay_unpacked(&f->inner, b, n3);
    f->lines = crm_carve(b, (size_t)f->n + 1, sizeof *f->lines);
    for (int i = 0; i <= f->n; i++) lay_line(f->lines ? &f->lines[i] : &none, b, w);
}

static carom_status allocate(crm_forward *f)
{
    const size_t m = (size_t)f->tape->most_contacts;
    crm_block b = {NULL, 0};
    const carom_status e = crm_rows_reserve(f->world, f->tape->most_contacts);
    if (e) return e;
    lay(f, &b, m);
    f->bytes = b.used;
    f->block = crm_new(&f->tape->memory, b.used, 1);
    if (!f->block) return CAROM_E_MEMORY;
    b.base = f->block;
    b.used = 0;
    lay(f, &b, m);
    return CAROM_OK;
}

/* Change of the gap at q0, where the event is the return to it. */
static double start_jvp(const crm_forward *f, const crm_substep *s, const crm_line *line)
{
    if (!s->returns) return 0;
    const double *q_dot = s->map == CRM_MAP_EXTRAPOLATED ? line->start_q : line->q0;
    return crm_geometry_jvp(f->world, s->q0, &s->event, q_dot, line->by).gap;
}

double crm_event_jvp(const crm_forward *f, const crm_substep *s, const crm_line *line)
{
    const crm_contact *c = &s->event;
    const carom_contact_dot dot = crm_geometry_jvp(f->world, s->q1, c, line->q, line->by);
    double jn[6];
    double jt[6];
    double jt_dot[6];
    if (s->end != CRM_END_STOP) return dot.gap - start_jvp(f, s, line);
    crm_contact_rows(c, jn, jt);
    crm_contact_rows_jvp(c, &dot, jn, jt_dot);
    return crm_row_dot(jt, line->v, c->body_a, c->body_b) +
           crm_row_dot(jt_dot, s->v1, c->body_a, c->body_b);
}

crm_line *crm_begin_clockwork(const crm_forward *f)
{
    static const carom_gradient none = {0};
    crm_line *clock = &f->lines[f->n];
    const size_t bytes = 3 * (size_t)f->world->n_bodies * sizeof(double);
    memset(clock->q, 0, bytes);
    memset(clock->v, 0, bytes);
    clock->by = &none;
    clock->h = 1;
    clock->time = 0;
    return clock;
}

/* The sub-step ended at the root h of g, so that g_dot + (dg/dh) h_dot = 0, with g_dot at constant
 * h: the lines go on with what the clockwork has, times h_dot. */
static carom_status locate_jvp(crm_forward *f, crm_substep *s)
{
    const carom_world *w = f->world;
    const crm_line *clock = crm_begin_clockwork(f);
    for (int i = 0; i < f->n; i++) f->lines[i].h = 0;
    const carom_status e = crm_substep_jvp(f, s, f->n + 1);
    if (e < 0) return e;
    const double slope = crm_event_jvp(f, s, clock);
    if (fabs(slope) <= crm_grazing(w, s)) {
        return crm_kinks_add(&f->tape->memory, &f->kinks, f->frame + 1, &s->event,
                             CAROM_KINK_GRAZING);
    }
    for (int i = 0; i < f->n; i++) {
        crm_line *line = &f->lines[i];
        const double h = -crm_event_jvp(f, s, line) / slope;
        crm_move(w, line->q, clock->q, h);
        crm_move(w, line->v, clock->v, h);
        line->left -= h;
    }
    return CAROM_OK;
}

/* Changes of the length of the sub-step and of the time left after it, from that before it. */
static void share_time(const crm_forward *f, const crm_substep *s)
{
    const double share = s->end == CRM_END_FRAME ? 1 : s->end == CRM_END_FRACTION ? s->fraction : 0;
    for (int i = 0; i < f->n; i++) {
        crm_line *line = &f->lines[i];
        line->h = share * line->left;
        line->left -= line->h;
    }
}

void crm_end_of(const crm_forward *f, int record, int end, crm_substep *s)
{
    const carom_tape *t = f->tape;
    const crm_record *next = &t->records[record + 1];
    if (record + 1 < end && next->which == t->records[record].which) {
        crm_scatter(f->world, next->s.q0, s->q1);
        crm_scatter(f->world, next->s.v0, s->v1);
        return;
    }
    crm_copy(f->world, s->q1, carom_tape_q(t, f->frame + 1));
    crm_copy(f->world, s->v1, carom_tape_v(t, f->frame + 1));
}

/* A sub-step of frame n starts at (n + 1) dt less what is left then. */
static void start_time(const crm_forward *f)
{
    const double n = (double)(f->tape->first_step + f->frame);
    for (int i = 0; i < f->n; i++) {
        crm_line *line = &f->lines[i];
        line->time = (n + 1) * crm_entry(line->by->dt, 0) - line->left;
    }
}

static carom_status forward_record(crm_forward *f, int record, int end)
{
    crm_substep *s = &f->work.s;
    f->record = record;
    crm_unpack(f->world, &f->tape->records[record], f->moved, &f->work);
    crm_end_of(f, record, end, s);
    start_time(f);
    if (s->end == CRM_END_EVENT || s->end == CRM_END_STOP) return locate_jvp(f, s);
    share_time(f, s);
    return crm_substep_jvp(f, s, f->n);
}

/* The time left to an island before its first sub-step is dt and what its clock owes. */
static void open_island(const crm_forward *f, const crm_record *first)
{
    for (int i = 0; i < f->n; i++) {
        crm_line *line = &f->lines[i];
        line->left = crm_entry(line->by->dt, 0) + line->clock_old[first->island.clock];
    }
}

/* What is left after the last one all its bodies owe. */
static carom_status close_island(crm_forward *f, const crm_record *last)
{
    for (int i = 0; i < f->n; i++) {
        crm_line *line = &f->lines[i];
        for (int k = 0; k < last->island.n_bodies; k++) {
            line->clock[last->island.bodies[k]] = line->left;
        }
    }
    if (!f->asked || last->s.end != CRM_END_EVENT) return CAROM_OK;
    return crm_kinks_add(&f->tape->memory, &f->kinks, f->frame + 1, &last->s.event,
                         CAROM_KINK_BORDER);
}

static void turn_clocks(const crm_forward *f)
{
    for (int i = 0; i < f->n; i++) {
        crm_line *line = &f->lines[i];
        double *const swap = line->clock;
        line->clock = line->clock_old;
        line->clock_old = swap;
        memset(line->clock, 0, (size_t)f->world->n_bodies * sizeof *swap);
    }
}

carom_status crm_forward_frame(crm_forward *f, int frame)
{
    const carom_tape *t = f->tape;
    const crm_record *records = t->records;
    const int first = t->frames[frame].first_record;
    const int end = crm_frame_end(t, frame);
    f->frame = frame;
    f->kinks.n = 0;
    turn_clocks(f);
    for (int k = first; k < end; k++) {
        if (k == first || records[k - 1].which != records[k].which) open_island(f, &records[k]);
        if (records[k].inner) continue; /* the extrapolated one behind them takes them up */
        const int last = k + 1 == end || records[k + 1].which != records[k].which;
        carom_status e = forward_record(f, k, end);
        if (e >= 0 && last) e = close_island(f, &records[k]);
        if (e < 0) return e;
    }
    f->stats.degenerate += f->kinks.n;
    if (f->kinks.n && f->stats.first_degenerate_step < 0) {
        f->stats.first_degenerate_step = frame + 1;
    }
    return f->failure;
}

void crm_give_state(const crm_forward *f, const crm_line *line, const carom_state_dot *to)
{
    const carom_world *w = f->world;
    const double *v = carom_tape_v(f->tape, to->step);
    for (int k = 0; k < 3 * w->n_bodies; k++) {
        const double owed = line->clock[k / 3];
        const double a = owed != 0 ? crm_border_acceleration(f->tape, to->step, k) : 0;
        if (to->q) to->q[k] = line->q[k] + owed * v[k];
        if (to->v) to->v[k] = line->v[k] + owed * a;
    }
}

static int asks(int n, const carom_state_dot *dots, int step)
{
    int any = 0;
    for (int i = 0; i < n; i++) any |= dots[i].step == step;
    return any;
}

/* The states after `step` steps that are asked for. */
static void give_states(const crm_forward *f, int step, int n_dots, const carom_state_dot *dots)
{
    for (int i = 0; i < f->n * n_dots; i++) {
        if (dots[i].step == step) crm_give_state(f, &f->lines[i / n_dots], &dots[i]);
    }
}

static void start_line(const crm_forward *f, crm_line *line, const carom_gradient *by)
{
    const carom_world *w = f->world;
    line->by = by;
    for (int k = 0; k < 3 * w->n_bodies; k++) {
        line->q[k] = crm_entry(by->q0, k);
        line->v[k] = w->bodies[k / 3].type == CAROM_STATIC ? 0 : crm_entry(by->v0, k);
    }
}

carom_status crm_forward_open(crm_forward *f, carom_tape *tape, int n,
                              const carom_gradient *directions, int step)
{
    const size_t n3 = 3 * (size_t)tape->n_bodies;
    const double *q = tape->q_end; /* of which only the static bodies count */
    memset(f, 0, sizeof *f);
    f->tape = tape;
    f->world = tape->world;
    f->n = n;
    f->from = step;
    const carom_status e = allocate(f);
    if (e) return e;
    memcpy(f->pose, q, n3 * sizeof *q);
    crm_place_statics(&f->work, q, n3);
    if (f->world->settings.order > 2) crm_place_statics(&f->inner, q, n3);
    for (int i = 0; i < n; i++) start_line(f, &f->lines[i], &directions[i]);
    f->stats.first_degenerate_step = -1;
    return CAROM_OK;
}

void crm_forward_close(crm_forward *f)
{
    crm_free(&f->tape->memory, f->block, f->bytes, 1);
    crm_kinks_free(&f->tape->memory, &f->kinks);
}

static carom_status check(const carom_tape *t, int n, int n_dots, const carom_state_dot *dots)
{
    for (int i = 0; i < n * n_dots; i++) {
        if (dots[i].step >= 0 && dots[i].step <= t->n_frames) continue;
        return crm_world_fail(t->world, CAROM_E_ARGUMENT,
                              "state after step %d, but the tape has %d steps", dots[i].step,
                              t->n_frames);
    }
    return crm_tape_current(t);
}

carom_status carom_tape_tangent(carom_tape *tape, int n_directions,
                                const carom_gradient *directions, int n_dots,
                                const carom_state_dot *dots, carom_gradient_stats *stats)
{
    if (!tape || n_directions < 0 || n_dots < 0) return CAROM_E_ARGUMENT;
    if ((n_directions && !directions) || (n_dots && !dots)) return CAROM_E_ARGUMENT;
    carom_status e = check(tape, n_directions, n_dots, dots);
    if (e) return e;
    crm_forward f;
    const long before = tape->n_replayed;
    tape->ascending = 1;
    if (tape->n_frames > 0) e = crm_hold_segment(tape, 0);
    if (e < 0) return crm_world_fail(tape->world, e, "tangent: %s", carom_status_text(e));
    e = crm_forward_open(&f, tape, n_directions, directions, 0);
    if (e >= 0) give_states(&f, 0, n_dots, dots);
    for (int frame = 0; e >= 0 && frame < tape->n_frames; frame++) {
        e = crm_hold_segment(tape, frame);
        f.asked = asks(n_directions * n_dots, dots, frame + 1);
        if (e >= 0) e = crm_forward_frame(&f, frame);
        if (e >= 0) give_states(&f, frame + 1, n_dots, dots);
    }
    f.stats.replayed = tape->n_replayed - before;
    crm_forward_close(&f);
    if (e < 0) return crm_world_fail(tape->world, e, "tangent: %s", carom_status_text(e));
    if (stats) *stats = f.stats;
    return CAROM_OK;
}
