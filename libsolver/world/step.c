/* step.c: one step = sub-steps from event to event.  docs/step.md. */
#include "world/internal.h"

#include <math.h>

/* Time below this fraction of a step is carried into the next one. */
static const double CARRY_TOL = 1e-13;
/* Held bodies times sub-steps of one frame; how many in flight are as much work as one that is
 * held; and sub-steps beyond all counting. */
enum { BODY_SUBSTEPS = 128, FLYING = 16, MAX_SUBSTEPS = 256 };
/* How often contacts are added that only the end of a sub-step shows. */
enum { MAX_LOOKS = 3 };
/* How often pairs are looked for again when bodies leave the room foreseen for them. */
enum { MAX_WIDENINGS = 4 };
/* Impacts without time between them, after which all that touches stops approaching at once: a
 * light body between two heavy ones is hit sqrt(mass ratio) times. */
enum { MAX_IMPACTS = 32 };

static void begin_substep(carom_world *w)
{
    crm_copy(w, w->sub.q0, w->q);
    crm_copy(w, w->sub.v0, w->v);
    w->sub.force = w->step_force;
}

/* Contacts of the coming sub-step.  The last one allowed takes every contact that may close, with
 * its gap as a bound on the approach, so that a step always ends. */
static carom_status find_contacts(carom_world *w, double left, int last)
{
    const double margin = w->settings.margin * w->length;
    w->sub.ahead = last && (w->island->n_pairs || w->island->n_limited);
    if (!last) return crm_detect(w, w->q, margin);
    return crm_detect_ahead(w, w->q, w->v, left, margin);
}

/* An impact: as a sub-step of its own, or within an Euler step. */
static int bounced(const crm_substep *s)
{
    const crm_solve *c = &s->solve[0];
    if (s->map != CRM_MAP_EULER) return s->map == CRM_MAP_IMPACT;
    for (int k = 0; k < s->n_contacts; k++) {
        if (c->cn[k] < 0 && c->ln[k] > 0) return 1;
    }
    return 0;
}

static carom_status commit(carom_world *w)
{
    const crm_substep *s = &w->sub;
    const crm_recorder *r = &w->recorder;
    carom_status e = crm_touches_save(w);
    const int n_inner = s->map == CRM_MAP_EXTRAPOLATED ? s->n_inner : 0;
    for (int k = 0; !e && r->substep && k < n_inner; k++) e = r->substep(r->user, &w->inner[k]);
    if (!e && r->substep) e = r->substep(r->user, s);
    if (e) return e;
    crm_copy(w, w->q, s->q1);
    crm_copy(w, w->v, s->v1);
    crm_islands_watch(w, w->q_saved, w->q);
    w->n_substeps += s->map != CRM_MAP_IMPACT;
    w->n_impacts = s->map == CRM_MAP_IMPACT ? w->n_impacts + 1 : 0;
    w->stats->n_events +=
        s->map == CRM_MAP_EULER ? s->end == CRM_END_EVENT || bounced(s) : bounced(s);
    w->stats->degenerate += s->degenerate;
    w->stats->estimate += s->map == CRM_MAP_EXTRAPOLATED ? s->estimate : 0;
    return CAROM_OK;
}

/* Whether a sub-step may end before the frame: at an event, or by its error. */
static int ends_early(const carom_world *w)
{
    if (w->settings.integrator == CAROM_FIXED) return 0;
    return w->settings.tolerance > 0 || w->island->n_pairs || w->island->n_limited;
}

/* Sub-steps of the frame beyond this one: each solves for all bodies that contacts or joints hold,
 * so that large islands get fewer. */
static int substeps_left(const carom_world *w)
{
    const int done = w->n_substeps - w->n_stiff + 1;
    const int n_bodies = w->island->n_bodies;
    const int n_rows = w->sub.n_contacts + w->island->n_joints;
    const int work = (n_rows < n_bodies ? n_rows : n_bodies) + n_bodies / FLYING;
    const int n = BODY_SUBSTEPS / (work > 0 ? work : 1);
    if (w->settings.tolerance > 0 || n > w->settings.max_substeps) {
        return w->settings.max_substeps - done;
    }
    return n - done;
}

/* Whether a contact that was ahead closed: an event that nobody located. */
static int met_ahead(const crm_substep *s)
{
    for (int k = 0; k < s->n_contacts; k++) {
        if (s->contacts[k].speculative && s->solve[0].mode[k] != CAROM_SEPARATED) return 1;
    }
    return 0;
}

/* One sub-step over all contacts ahead, and over those that its end shows. */
static carom_status run_ahead(carom_world *w, double left)
{
    int added = 1;
    int deep = 0;
    carom_status e = CAROM_OK;
    for (int k = 0; e >= 0 && added && k <= MAX_LOOKS; k++) {
        crm_guess_load(w, left);
        e = crm_run_through(w, left);
        if (e < 0) return e;
        const carom_status f = crm_detect_further(w, k < MAX_LOOKS, &added, &deep);
        if (f < 0) return f;
    }
    return deep && e < CAROM_LIMIT ? CAROM_LIMIT : e;
}

/* The rest of the frame as one sub-step; events in it are said, unless nobody asked for them. */
static carom_status run_last(carom_world *w, double left)
{
    carom_status e = find_contacts(w, left, 1);
    if (e < 0) return e;
    e = run_ahead(w, left);
    if (e >= 0 && w->n_substeps + 1 < w->settings.max_substeps) {
        const carom_status stopped = crm_stop_passing(w, left);
        if (stopped) e = stopped;
    }
    double h;
    const int asked = w->settings.integrator != CAROM_FIXED;
    const int missed = (asked && met_ahead(&w->sub)) || crm_is_too_long(w, &h);
    return e >= 0 && e < CAROM_LIMIT && missed ? CAROM_LIMIT : e;
}

/* Up to the next event; *busy: there are more of them than sub-steps left. */
static carom_status run_located(carom_world *w, double left, int *busy)
{
    carom_status e = find_contacts(w, left, 0);
    if (e < 0) return e;
    const int hit = w->smooth && crm_select_impact(w);
    const int tired = w->n_impacts >= MAX_IMPACTS;
    if (w->smooth && !(hit && tired)) crm_select_contacts(w, hit);
    const int further = substeps_left(w);
    *busy = further <= 0;
    if (*busy) return CAROM_OK;
    crm_guess_load(w, left);
    if (hit) return crm_impact(w, tired);
    return crm_locate(w, left, further, busy);
}

/* A sub-step over `share` of the time left, which knew of no more than that. */
static void end_early(carom_world *w, double share)
{
    crm_substep *s = &w->sub;
    if (!(share < 1)) return;
    if (s->end == CRM_END_FRACTION) s->fraction *= share;
    if (s->end != CRM_END_FRAME) return;
    s->end = CRM_END_FRACTION;
    s->fraction = share;
    w->n_stiff++;
}

/* Over `span` of the time left; its joint forces are known then. */
static carom_status try_substep(carom_world *w, double span, int last)
{
    int busy = last || !ends_early(w) || w->effort >= CRM_WORN;
    begin_substep(w);
    carom_status e = busy ? CAROM_OK : run_located(w, span, &busy);
    if (e >= 0 && busy) e = run_last(w, span);
    if (e >= 0) crm_joint_totals(w);
    return e;
}

/* Joints that turn out too stiff for the span are given a shorter one, while there is strength. */
static carom_status run_stable(carom_world *w, double left, int last, double *span)
{
    const carom_status before = w->stats->status;
    const int whole = last || w->effort >= CRM_WORN;
    *span = whole ? left : crm_stiff_span(w, left, 0);
    carom_status e = try_substep(w, *span, last);
    while (e >= 0 && !whole && w->effort < CRM_WORN) {
        const double next = crm_stiff_span(w, left, 1);
        if (!(next < 0.75 * fmin(*span, w->sub.h))) break;
        w->stats->status = before;
        *span = next;
        e = try_substep(w, next, last);
    }
    return e;
}

static carom_status substep(carom_world *w, double *left, int last)
{
    const double since = fmax(w->settings.dt - *left, 0);
    w->sub.time = carom_world_time(w) + w->settings.dt - *left;
    double span;
    carom_status e = run_stable(w, *left, last, &span);
    if (e < 0) return e;
    end_early(w, span / *left);
    if (e > w->stats->status) w->stats->status = e;
    *left = w->sub.end == CRM_END_FRAME ? 0 : *left - w->sub.h;
    e = commit(w);
    return !e && w->events.on ? crm_events_note(w, since) : e;
}

/* How far a point of a body has moved in the frame, at most [m]. */
static double way_of(const carom_world *w, int body)
{
    const double *to = w->q + 3 * body;
    const double *from = w->q_saved + 3 * body;
    return fabs(to[1] - from[1]) + fabs(to[2] - from[2]) +
           fabs(to[0] - from[0]) * w->bodies[body].reach;
}

/* Bodies that turn or fly far within a sub-step may lie across each other at its end without a
 * contact that was held, as may what an event elsewhere has thrown: pairs that moved by more than
 * that and are near are looked at once more. */
static void look_at_end(const carom_world *w)
{
    carom_step_stats *t = w->stats;
    const double rounding = crm_rounding(w);
    for (int k = 0; k < w->island->n_pairs; k++) {
        const carom_pair pair = w->island->pairs[k];
        const double deep = crm_deep(w, pair, rounding);
        const double way = way_of(w, w->shapes[pair.a].body) + way_of(w, w->shapes[pair.b].body);
        if (way <= deep || crm_far_apart(w, pair, w->q, 0)) continue;
        const double overlap = -crm_collide(w, pair, w->q, HUGE_VAL).distance;
        if (overlap <= deep) continue;
        t->penetration = fmax(t->penetration, overlap);
        const double before = -crm_collide(w, pair, w->q_saved, HUGE_VAL).distance;
        if (overlap > before + deep && t->status < CAROM_LIMIT) t->status = CAROM_LIMIT;
    }
}

static void finish_island(carom_world *w, double left)
{
    carom_step_stats *t = w->stats;
    const crm_substep *s = &w->sub;
    const int owes = s->end == CRM_END_EVENT || s->end == CRM_END_STOP || s->end == CRM_END_IMPACT;
    for (int k = 0; k < w->island->n_bodies; k++) {
        w->carry[w->island->bodies[k]] = left;
        w->owes[w->island->bodies[k]] = (unsigned char)owes;
    }
    for (int k = 0; k < s->n_contacts; k++) {
        crm_contact c = s->contacts[k];
        if (c.limit) continue;
        crm_contact_refresh(w, w->q, &c);
        t->penetration = fmax(t->penetration, -c.gap);
        t->n_contacts++;
    }
    look_at_end(w);
    if (w->n_substeps > t->n_substeps) t->n_substeps = w->n_substeps;
}

/* One island through the whole frame. */
static carom_status advance_island(carom_world *w, const crm_island *island)
{
    const double dt = w->settings.dt;
    double left = dt + w->carry[island->clock];
    int asleep;
    crm_enter(w, island);
    w->n_substeps = 0;
    w->n_impacts = 0;
    w->n_stiff = 0;
    w->n_parts = 0;
    w->effort = 0;
    w->first_touch = w->next.n;
    const carom_status slept = crm_sleep_on(w, &asleep);
    if (slept || asleep) return slept;
    for (int k = 0; left > CARRY_TOL * dt; k++) {
        const int n = k - w->n_stiff;
        if (n >= 2 * MAX_SUBSTEPS) return CAROM_E_NO_SOLUTION;
        const carom_status e = substep(w, &left, n >= MAX_SUBSTEPS);
        if (e < 0) return e;
    }
    finish_island(w, left);
    crm_sleep_settle(w);
    return CAROM_OK;
}

static carom_status advance_islands(carom_world *w)
{
    carom_step_stats *sum = w->stats;
    const int threads = crm_threads_that_pay(w);
    carom_status e = CAROM_OK;
    w->next.n = 0;
    w->events.n = 0;
    if (threads > 1) return crm_advance_shared(w, threads, advance_island);
    for (int k = 0; e >= 0 && k < w->islands.n; k++) {
        carom_step_stats part = {0};
        w->stats = &part;
        e = advance_island(w, &w->islands.list[k]);
        crm_stats_add(sum, &part);
    }
    w->stats = sum;
    return e;
}

void crm_put_statics(carom_world *w)
{
    if (w->statics_placed) return;
    const size_t bytes = 3 * (size_t)w->n_bodies * sizeof(double);
    memcpy(w->sub.q0, w->q, bytes);
    memcpy(w->sub.q1, w->q, bytes);
    for (int k = 0; k < w->n_solves; k++) memcpy(w->sub.solve[k].q, w->q, bytes);
    for (int i = 0; i < CRM_MAX_INNER && w->inner[i].q0; i++) {
        memcpy(w->inner[i].q0, w->q, bytes);
        memcpy(w->inner[i].q1, w->q, bytes);
        for (int k = 0; k < w->n_solves; k++) memcpy(w->inner[i].solve[k].q, w->q, bytes);
    }
    if (w->plan.changes) memcpy(w->probe, w->q, bytes);
    w->statics_placed = 1;
}

static void save_state(carom_world *w)
{
    const size_t n = (size_t)w->n_bodies;
    memcpy(w->q_saved, w->q, 3 * n * sizeof(double));
    memcpy(w->v_saved, w->v, 3 * n * sizeof(double));
    memcpy(w->carry_saved, w->carry, n * sizeof(double));
    memcpy(w->owes_saved, w->owes, n);
}

static void restore_state(carom_world *w)
{
    const size_t n = (size_t)w->n_bodies;
    memcpy(w->q, w->q_saved, 3 * n * sizeof(double));
    memcpy(w->v, w->v_saved, 3 * n * sizeof(double));
    memcpy(w->carry, w->carry_saved, n * sizeof(double));
    memcpy(w->owes, w->owes_saved, n);
}

/* Bodies that were thrown out of the room foreseen for them may have met others unseen: then the
 * frame is run again with more room. */
static carom_status advance(carom_world *w)
{
    const carom_step_stats fresh = *w->stats;
    carom_status e = crm_islands_find(w, w->settings.dt);
    for (int k = 0; !e; k++) {
        e = crm_solvers_assign(w);
        if (!e) e = advance_islands(w);
        if (e < 0 || !w->islands.escaped) break;
        if (k == MAX_WIDENINGS) {
            if (w->stats->status < CAROM_LIMIT) w->stats->status = CAROM_LIMIT;
            break;
        }
        const crm_recorder *r = &w->recorder;
        int changed;
        e = crm_islands_widen(w, &changed);
        if (e || !changed) break;
        restore_state(w);
        if (r->restart) r->restart(r->user);
        *w->stats = fresh;
    }
    return e;
}

static void finish_stats(carom_world *w)
{
    carom_step_stats *t = w->stats;
    t->n_islands = w->islands.n;
    t->n_candidates = w->islands.n_pairs;
    t->joint_drift = crm_joint_drift(w, w->q);
    t->energy = carom_world_energy(w);
}

static carom_status take_forces(carom_world *w, const double *force)
{
    for (int k = 0; k < 3 * w->n_bodies; k++) {
        w->step_force[k] = w->force[k] + (force ? force[k] : 0);
        if (!isfinite(w->step_force[k])) {
            return crm_world_fail(w, CAROM_E_ARGUMENT, "force of body %d is not finite", k / 3);
        }
    }
    return CAROM_OK;
}

/* A body whose state a force field has made no number; -1: none. */
static int lost_body(const carom_world *w)
{
    for (int k = 0; w->n_fields && k < 3 * w->n_bodies; k++) {
        if (!isfinite(w->q[k]) || !isfinite(w->v[k])) return k / 3;
    }
    return -1;
}

/* The world as it was before the step, which ended with e. */
static carom_status give_up(carom_world *w, carom_status e)
{
    const int lost = lost_body(w);
    restore_state(w);
    crm_forget_guesses(w);
    w->events.n = 0;
    if (lost >= 0) {
        return crm_world_fail(w, CAROM_E_ARGUMENT,
                              "step %ld: a field gave body %d a force that is not finite",
                              w->n_steps + 1, lost);
    }
    return crm_world_fail(w, e, "step %ld, sub-step %d: %s", w->n_steps + 1, w->n_substeps + 1,
                          carom_status_text(e));
}

static carom_status step(carom_world *w, const double *force)
{
    carom_status e = crm_seal(w);
    if (!e) e = take_forces(w, force);
    if (e < 0) return e;
    crm_put_statics(w);
    save_state(w);
    e = advance(w);
    carom_status full = e < 0 ? CAROM_OK : crm_touches_even(w);
    if (!full && e >= 0 && w->events.on) full = crm_events_reserve(w);
    if (full) e = full;
    if (e < 0 || lost_body(w) >= 0) return give_up(w, e);
    const int n_before = w->touches.n;
    crm_touches_turn(w);
    if (w->events.on) crm_events_compare(w, n_before);
    crm_break_joints(w);
    w->n_steps++;
    finish_stats(w);
    return w->stats->status;
}

carom_status carom_world_step(carom_world *world, const double *force, carom_step_stats *stats)
{
    if (!world) return CAROM_E_ARGUMENT;
    carom_step_stats own = {0};
    carom_step_stats *t = stats ? stats : &own;
    memset(t, 0, sizeof *t);
    world->error[0] = '\0';
    world->stats = t;
    const long before = crm_allocations(world);
    const carom_status e = step(world, force);
    t->allocations = crm_allocations(world) - before;
    t->status = e;
    world->stats = NULL;
    return e;
}
