/* stop.c: the time at which a slipping contact stops.  docs/step.md, section "Friction that stops".
 */
#include "world/internal.h"

#include <math.h>

/* Slip speed that counts as none [fastest point of the world], and how well its root is found. */
static const double STOP_TOL = 1e-15;

double crm_slip_speed(const crm_contact *c, const double *v)
{
    double jn[6];
    double jt[6];
    crm_contact_rows(c, jn, jt);
    return crm_row_dot(jt, v, c->body_a, c->body_b);
}

/* Slip speed of contact k of sub at (q1, v1), along the direction in which it began. */
static double speed_left(const carom_world *w, const void *what, double h)
{
    (void)h;
    const crm_substep *s = &w->sub;
    const int k = *(const int *)what;
    crm_contact c = s->contacts[k];
    crm_contact_refresh(w, s->q1, &c);
    return s->slips[k] * crm_slip_speed(&c, s->v1);
}

/* The sign of the slip at the start, of a contact with friction; 0: it does not slip. */
static int slip_sign(const carom_world *w, const crm_substep *s, int k, double slow)
{
    const crm_contact *c = &s->contacts[k];
    const double mu = c->limit ? 0
                               : crm_combine(w->settings.combine_friction, w->friction[c->body_a],
                                             w->friction[c->body_b]);
    const double u = crm_slip_speed(c, s->v0);
    if (!(mu > 0) || fabs(u) <= slow) return 0;
    return u > 0 ? 1 : -1;
}

/* Whether contact k pressed and slipped to the end as it began; friction opposes the slip. */
static int keeps_slipping(const crm_substep *s, int k, int sign)
{
    const unsigned char slip = sign > 0 ? CAROM_SLIP_MINUS : CAROM_SLIP_PLUS;
    for (int i = 0; i < 2; i++) {
        const unsigned char mode = s->solve[i].mode[k];
        if (mode != slip && mode != CAROM_SEPARATED) return 0;
    }
    return 1;
}

/* Marks the contacts that slip at q0; 1 when one of them stops on the way. */
static int mark_slips(carom_world *w)
{
    crm_substep *s = &w->sub;
    const double slow = CRM_REST_TOL * (crm_top_speed(w, s->v0) + w->speed);
    int any = 0;
    for (int k = 0; k < s->n_contacts; k++) {
        const int sign = slip_sign(w, s, k, slow);
        s->slips[k] = (signed char)sign;
        any |= sign && !keeps_slipping(s, k, sign);
    }
    return any;
}

/* Of the contacts made to slip the one whose straight line meets zero first, into *first; 0 when
 * none has stopped at q1. */
static int first_stop(const carom_world *w, int *first, double *start, double *end)
{
    const crm_substep *s = &w->sub;
    double soonest = HUGE_VAL;
    for (int k = 0; k < s->n_contacts; k++) {
        if (!s->slips[k] || s->solve[1].mode[k] == CAROM_SEPARATED) continue;
        const double u0 = s->slips[k] * crm_slip_speed(&s->contacts[k], s->v0);
        const double u1 = speed_left(w, &k, s->h);
        if (u1 > 0 || u0 / (u0 - u1) >= soonest) continue;
        soonest = u0 / (u0 - u1);
        *first = k;
        *start = u0;
        *end = u1;
    }
    return soonest < HUGE_VAL;
}

static void end_at_stop(carom_world *w, int k)
{
    crm_substep *s = &w->sub;
    s->event = s->contacts[k];
    crm_contact_refresh(w, s->q1, &s->event);
    s->end = CRM_END_STOP;
}

/* From the end of the bracket to the earliest stop; each root may show an earlier one. */
static carom_status find_stop(carom_world *w)
{
    crm_substep *s = &w->sub;
    int k;
    double h = s->h;
    crm_indicator f = {speed_left, &k, 0, 0, 0};
    f.tol = STOP_TOL * (crm_top_speed(w, s->v0) + w->speed);
    for (int round = 0; round <= s->n_contacts; round++) {
        if (!first_stop(w, &k, &f.start, &f.end)) return CAROM_OK;
        if (s->end == CRM_END_STOP && fabs(f.end) <= f.tol) return CAROM_OK;
        const carom_status e = crm_find_root(w, &f, &h);
        if (e < 0) return e;
        if (h < CRM_NO_TIME * w->settings.dt) return CAROM_E_NO_SOLUTION;
        end_at_stop(w, k);
    }
    return CAROM_OK;
}

static void clear_slips(crm_substep *s)
{
    for (int k = 0; k < s->n_contacts; k++) s->slips[k] = 0;
}

/* All that slip are made to slip on together, so that what is searched is smooth in h; when none
 * stops in that, the sub-step is as it was. */
carom_status crm_locate_stop(carom_world *w)
{
    crm_substep *s = &w->sub;
    if (s->map != CRM_MAP_SMOOTH && s->map != CRM_MAP_EXTRAPOLATED) return CAROM_OK;
    if (!mark_slips(w)) {
        clear_slips(s);
        return CAROM_OK;
    }
    const crm_end end = s->end;
    const double h = s->h;
    const double fraction = s->fraction;
    const crm_contact event = s->event;
    carom_status e = crm_map_run(w, h);
    if (e >= 0) e = find_stop(w);
    /* friction that only slows gives nothing: what gains was made to slip against it */
    if (e >= 0 && s->end == CRM_END_STOP && crm_gains(w, s)) e = CAROM_E_NO_SOLUTION;
    clear_slips(s);
    if (e == CAROM_E_MEMORY || (e >= 0 && s->end == CRM_END_STOP)) return e;
    s->end = end;
    s->fraction = fraction;
    s->event = event;
    return crm_map_run(w, h);
}
