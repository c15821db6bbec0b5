/* step.c: one step = sub-steps from event to event.  docs/step.md. */
#include "world/internal.h"

#include <math.h>

/* Time below this fraction of a step is carried into the next one. */
static const double CARRY_TOL = 1e-13;
/* Moving bodies times sub-steps in one step, and sub-steps beyond all counting. */
enum { BODY_SUBSTEPS = 512, MAX_SUBSTEPS = 256 };

static void begin_substep(carom_world *w)
{
    const size_t bytes = 3 * (size_t)w->n_bodies * sizeof(double);
    memcpy(w->sub.q0, w->q, bytes);
    memcpy(w->sub.v0, w->v, bytes);
    w->sub.force = w->step_force;
}

/* Contacts of the coming sub-step.  The last one allowed takes every contact that may close, with
 * its gap as a bound on the approach, so that a step always ends. */
static carom_status find_contacts(carom_world *w, double left, int last)
{
    const double margin = w->settings.margin * w->length;
    if (!last) return crm_detect(w, w->q, margin);
    if (w->stats->status < CAROM_LIMIT) w->stats->status = CAROM_LIMIT;
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
    const size_t bytes = 3 * (size_t)w->n_bodies * sizeof(double);
    carom_status e = crm_guess_save(w);
    if (!e && w->recorder.substep) e = w->recorder.substep(w->recorder.user, s);
    if (e) return e;
    memcpy(w->q, s->q1, bytes);
    memcpy(w->v, s->v1, bytes);
    w->stats->n_substeps += s->map != CRM_MAP_IMPACT;
    w->stats->n_events +=
        s->map == CRM_MAP_EULER ? s->end == CRM_END_EVENT || bounced(s) : bounced(s);
    w->stats->n_contacts = s->n_contacts;
    w->stats->degenerate += s->degenerate;
    return CAROM_OK;
}

/* Sub-steps of one step: every impact costs solves of the whole world, so large worlds get fewer.
 */
static int substeps_allowed(const carom_world *w)
{
    int n = w->n_moving > 0 ? BODY_SUBSTEPS / w->n_moving : BODY_SUBSTEPS;
    if (n < 2) n = 2;
    return n < w->settings.max_substeps ? n : w->settings.max_substeps;
}

static carom_status substep(carom_world *w, double *left)
{
    const int last = w->stats->n_substeps + 1 >= substeps_allowed(w);
    begin_substep(w);
    carom_status e = find_contacts(w, *left, last);
    if (e < 0) return e;
    const int smooth = w->smooth && !last;
    const int hit = smooth && crm_select_impact(w);
    if (smooth) crm_select_contacts(w, hit);
    crm_guess_load(w);
    e = hit ? crm_impact(w) : last ? crm_run_through(w, *left) : crm_locate(w, *left);
    if (e < 0) return e;
    if (e > w->stats->status) w->stats->status = e;
    *left = w->sub.end == CRM_END_FRAME ? 0 : *left - w->sub.h;
    return commit(w);
}

static carom_status advance(carom_world *w)
{
    const double dt = w->settings.dt;
    double left = dt + w->carry;
    w->carry = 0;
    for (int k = 0; left > CARRY_TOL * dt; k++) {
        if (k >= MAX_SUBSTEPS) return CAROM_E_NO_SOLUTION;
        const carom_status e = substep(w, &left);
        if (e < 0) return e;
    }
    w->carry = left;
    return CAROM_OK;
}

static void finish_stats(carom_world *w)
{
    carom_step_stats *t = w->stats;
    for (int k = 0; k < w->sub.n_contacts; k++) {
        crm_contact c = w->sub.contacts[k];
        crm_contact_refresh(w, w->q, &c);
        t->penetration = fmax(t->penetration, -c.gap);
    }
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

static carom_status step(carom_world *w, const double *force)
{
    carom_status e = crm_seal(w);
    if (!e) e = take_forces(w, force);
    if (e < 0) return e;
    const size_t bytes = 3 * (size_t)w->n_bodies * sizeof(double);
    const double carry = w->carry;
    memcpy(w->q_saved, w->q, bytes);
    memcpy(w->v_saved, w->v, bytes);
    e = advance(w);
    if (e < 0) {
        memcpy(w->q, w->q_saved, bytes);
        memcpy(w->v, w->v_saved, bytes);
        w->carry = carry;
        w->n_guess = 0;
        return crm_world_fail(w, e, "step %ld, sub-step %d: %s", w->n_steps + 1,
                              w->stats->n_substeps + 1, carom_status_text(e));
    }
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
