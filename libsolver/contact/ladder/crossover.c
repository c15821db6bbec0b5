#include "libsolver/contact/ladder/path.h"

#include <math.h>

/* Compliance of active rows on the path: the active set's, so that the path's last factors serve
 * its polish [1]. */
#define COMPLIANCE CRM_COMPLIANCE
/* Range of the distance to the borders of the modes that the start is given [1]. */
#define NEAREST  1e-11
#define FARTHEST 1e-3
/* Paths that come back to where they began rarely lead on: most are closed [1]. */
#define T_MAX 1
/* End of a path with a residual above this: rounding won [1]. */
#define LOST 1e-3

/* Times the path is begun anew where its end is not good enough: rows that depend on each other
 * let impulses move by defect / compliance. */
enum { PASSES = 6 };

/* Distance from the border of a mode, around `scale`: no two alike, so that no two contacts change
 * at once. */
static double distance(double scale, unsigned long long *seed)
{
    return scale * (0.5 + crm_uniform(seed));
}

/* Modes of the natural map at s->x, and impulses that obey them with some distance to their
 * borders, which is left in d. */
static void choose_modes(crm_path *p, double scale, unsigned long long seed)
{
    crm_island *s = p->s;
    crm_modes_at(s);
    for (int k = 0; k < s->nc; k++) {
        const double mu = s->contact[k].mu;
        double *ln = &s->x.n[k];
        double *lt = &s->x.t[k];
        p->d.n[k] = distance(scale, &seed);
        p->d.t[k] = distance(scale, &seed);
        *ln = s->mode[k] == CAROM_SEPARATED ? 0 : fmax(*ln, p->d.n[k]);
        const double bound = mu * *ln;
        const double inside = fmax(0, bound - 0.1 * mu * p->d.t[k]);
        if (s->mode[k] == CAROM_STICK)
            *lt = fmin(inside, fmax(-inside, *lt));
        else
            *lt = crm_slip_sign(s->mode[k]) * bound;
    }
}

/* d such that s->x solves the problem with c + d: a and u become what the modes ask for. */
static void choose_data(crm_path *p)
{
    crm_island *s = p->s;
    crm_island_residual(s, s->x); /* leaves a and u, and the defects of the joints in rest */
    for (int k = 0; k < s->nc; k++) {
        const double sign = crm_slip_sign(s->mode[k]);
        const double near = p->d.t[k];
        double u = 0;
        double a = 0;
        if (s->mode[k] == CAROM_SEPARATED) {
            a = fmax(s->an[k], p->d.n[k]);
            u = s->ut[k];
        }
        if (sign > 0) u = fmin(s->ut[k], -near);
        if (sign < 0) u = fmax(s->ut[k], near);
        p->d.n[k] = a - s->an[k];
        p->d.t[k] = u - s->ut[k];
    }
    for (int i = 3 * s->nb; i < 3 * (s->nb + s->ng); i++) p->d.z[i] = s->rest.z[i];
}

static void begin(crm_path *p, unsigned long long seed)
{
    crm_island *s = p->s;
    crm_into_cones(s);
    const double r = crm_island_residual(s, s->x);
    choose_modes(p, fmin(FARTHEST, fmax(NEAREST, r)), seed);
    crm_into_cones(s);
    choose_data(p);
    crm_vec_copy(s, p->ref, s->x);
    p->t = 1;
}

int crm_crossover(crm_island *s, int max_pivots, unsigned long long seed)
{
    crm_path p = {
        .s = s, .d = s->path[0], .ref = s->path[1], .compliance = COMPLIANCE, .most = T_MAX};
    for (int i = 0; i < PASSES; i++) {
        begin(&p, seed + (unsigned)i);
        if (!crm_path_follow(&p, max_pivots)) return 0;
        const double r = crm_island_residual(s, s->x);
        crm_island_offer(s, s->x, r);
        crm_vec_copy(s, p.ref, s->x);
        if (crm_active_set(s, 1)) return 1;
        if (!(r <= LOST)) return 0;
        crm_vec_copy(s, s->x, p.ref);
    }
    return 0;
}
