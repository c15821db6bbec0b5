/* impact.c: impacts, at their times and at the end of a sub-step that located none, and which
 * contacts take part in what.  docs/step.md. */
#include "world/internal.h"

#include <math.h>

/* c_n of a contact of sub in a bounce: restitution of an approach at q1 that is faster than rest
 * and than what gravity does in a sub-step; gap / h where it is still open.  One that opens is let
 * alone: with others that bounce it would be driven, and give energy. */
static double bounce_side(const carom_world *w, const crm_substep *s, int k, double apart)
{
    const crm_contact *c = &s->moved[k];
    const double g =
        hypot(w->settings.gravity[0], w->settings.gravity[1]) *
        fmax(fabs(w->bodies[c->body_a].gravity_scale), fabs(w->bodies[c->body_b].gravity_scale));
    const double slop = w->settings.margin * w->length;
    if (c->gap > slop) return c->gap / s->h;
    const double un = crm_row_dot(&w->rows.jn[6 * k], s->v0, c->body_a, c->body_b);
    if (un > w->rest_speed) return apart;
    if (un >= -fmax(w->rest_speed, 2 * g * s->h)) return 0;
    return s->restitution * un * crm_restitution(w, c);
}

/* Right-hand sides of a bounce, rows at q1 in place; 1 when a contact bounces. */
static int bounce_sides(carom_world *w, crm_substep *s, crm_solve *c)
{
    const double apart = 4 * crm_top_speed(w, s->v0);
    int any = 0;
    for (int k = 0; k < s->n_contacts; k++) {
        c->cn[k] = bounce_side(w, s, k, apart);
        c->ct[k] = 0;
        c->mode[k] = s->solve[0].mode[k];
        any |= c->cn[k] < 0;
    }
    for (int k = 0; k < w->island->n_rows; k++) c->ce[k] = 0;
    crm_motor_sides(w, c);
    return any;
}

/* Impacts within a sub-step that located none: it has moved as if plastic; its velocities are those
 * of one impact at its end, v1 = v0 + h (W f + g) + W J1' l.  *done = 0: nothing bounces. */
carom_status crm_bounce(carom_world *w, crm_substep *s, int *done)
{
    crm_solve *c = &s->solve[1];
    *done = 0;
    c->kind = CRM_BOUNCE;
    crm_copy(w, c->q, s->q1);
    crm_rows_at(w, s, s->q1);
    crm_solve_start(w, s, c);
    if (!bounce_sides(w, s, c)) return CAROM_OK;
    carom_status e = crm_solve_run(w, s, c, 1);
    if (e == CAROM_E_INFEASIBLE || e == CAROM_E_NO_SOLUTION) {
        s->restitution = 0;
        bounce_sides(w, s, c);
        e = crm_solve_run(w, s, c, 0);
        if (e >= 0) e = CAROM_RELAXED;
    } else if (e >= 0) {
        e = crm_bound_bounce(w, s, c, bounce_sides, e);
    }
    if (e < 0) return e;
    crm_copy(w, s->v1, c->v);
    *done = 1;
    return e;
}

carom_status crm_impact(carom_world *w, int plastic)
{
    crm_substep *s = &w->sub;
    crm_solve *c = &s->solve[0];
    s->map = CRM_MAP_IMPACT;
    s->h = 0;
    s->n_solves = 1;
    s->end = CRM_END_IMPACT;
    c->kind = CRM_IMPACT;
    crm_copy(w, c->q, s->q0);
    crm_rows_at(w, s, s->q0);
    crm_solve_start(w, s, c);
    const carom_status e = crm_solve_bounce(w, s, c, plastic);
    if (e < 0) return e;
    crm_copy(w, s->v1, c->v);
    crm_copy(w, s->q1, s->q0);
    return plastic && e < CAROM_LIMIT ? CAROM_LIMIT : e;
}

static double approach(const crm_substep *s, int k)
{
    double jn[6];
    double jt[6];
    const crm_contact *c = &s->contacts[k];
    crm_contact_rows(c, jn, jt);
    return crm_row_dot(jn, s->v0, c->body_a, c->body_b);
}

/* Approach that may be rounding. */
static double rounding_speed(const carom_world *w, const crm_substep *s)
{
    return CRM_REST_TOL * (crm_top_speed(w, s->v0) + w->speed);
}

int crm_select_impact(carom_world *w)
{
    crm_substep *s = &w->sub;
    const double hit = CRM_HIT_TOL * w->length + crm_rounding(w);
    const double slow = rounding_speed(w, s);
    int any = 0;
    for (int k = 0; k < s->n_contacts; k++) {
        if (s->contacts[k].gap <= hit && approach(s, k) < -slow) any = 1;
    }
    return any;
}

void crm_select_contacts(carom_world *w, int for_impact)
{
    crm_substep *s = &w->sub;
    const double slop = w->settings.margin * w->length;
    /* Without gravity nothing but rounding is slow. */
    const double rest = fmax(w->rest_speed, rounding_speed(w, s));
    int n = 0;
    for (int k = 0; k < s->n_contacts; k++) {
        const double un = approach(s, k);
        const int meets = un <= rest || s->contacts[k].gap < -slop;
        const int rests = meets && (un >= -rest || s->contacts[k].gap < -slop);
        if (for_impact ? meets : rests) s->contacts[n++] = s->contacts[k];
    }
    s->n_contacts = n;
}
