#include "libsolver/contact/ladder/ladder.h"

#include <math.h>

/* Smallest violation, relative to the velocity scale, that counts as infeasible [1]. */
#define VIOLATION 1e-7
/* The certificate excludes all motions up to 1 / CERTIFICATE velocity scales [1]. */
#define CERTIFICATE 1e-8
/* Weight of the proximal term [1]. */
#define PROXIMAL 1e-6

enum { MAX_PASSES = 8, MAX_NEWTON = 50 };

/* f(w) = 1/2 |min(J_n w + c_n, 0)|^2 + 1/2 |J_e w + c_e|^2, the violation of the constraints.  At
 * its minimum y = (-min(J_n w + c_n, 0), -(J_e w + c_e)) satisfies J' y = 0 and c' y = -|y|^2: when
 * y != 0, it is a Farkas certificate. */

/* s->x.n, s->x.z (groups) <- y at w = s->x.z; returns f. */
static double find_violation(crm_island *s)
{
    double f = 0;
    for (int k = 0; k < s->nc; k++) {
        const crm_contact *c = &s->contact[k];
        s->x.n[k] = fmax(0, -(crm_dot(c->n, c->a, c->b, s->x.z) + c->cn));
        s->x.t[k] = 0;
        f += 0.5 * s->x.n[k] * s->x.n[k];
    }
    for (int q = 0; q < s->ng; q++) {
        const crm_group *g = &s->group[q];
        for (int r = 0; r < CRM_GROUP_ROWS; r++) {
            const double y = -(crm_dot(g->j[r], g->a, g->b, s->x.z) + g->c[r]);
            s->x.z[3 * (s->nb + q) + r] = y;
            f += 0.5 * y * y;
        }
    }
    return f;
}

/* z <- J' y, bodies. */
static void find_force(const crm_island *s, double *z)
{
    memset(z, 0, 3 * (size_t)s->nb * sizeof(double));
    for (int k = 0; k < s->nc; k++) {
        const crm_contact *c = &s->contact[k];
        crm_add(z, c->n, c->a, c->b, s->x.n[k]);
    }
    for (int q = 0; q < s->ng; q++) {
        const crm_group *g = &s->group[q];
        for (int r = 0; r < CRM_GROUP_ROWS; r++)
            crm_add(z, g->j[r], g->a, g->b, s->x.z[3 * (s->nb + q) + r]);
    }
}

/* f plus the proximal term at the center s->top. */
static double objective(crm_island *s)
{
    double f = find_violation(s);
    for (int i = 0; i < 3 * s->nb; i++) {
        const double d = s->x.z[i] - s->top.z[i];
        f += 0.5 * PROXIMAL * d * d;
    }
    return f;
}

/* One Newton step of the piecewise quadratic objective, halved until it descends.  Returns 0 at
 * the minimum. */
static int newton(crm_island *s, double now)
{
    const size_t bytes = 3 * (size_t)s->nb * sizeof(double);
    for (int k = 0; k < s->nc; k++) s->response[k] = (crm_response){s->x.n[k] > 0 ? 1 : 0, 0, 0};
    crm_island_factor(s, PROXIMAL, 1);
    double *d = s->step.z;
    memset(d, 0, 3 * (size_t)(s->nb + s->ng) * sizeof(double));
    find_force(s, d);
    double slope = 0;
    for (int i = 0; i < 3 * s->nb; i++) {
        d[i] -= PROXIMAL * (s->x.z[i] - s->top.z[i]);
        s->rest.z[i] = d[i];
    }
    crm_island_solve(s, d);
    for (int i = 0; i < 3 * s->nb; i++) slope += s->rest.z[i] * d[i];
    memcpy(s->rhs.z, s->x.z, bytes);
    for (double t = 1; slope > 0 && t > 0x1p-40; t *= 0.5) {
        for (int i = 0; i < 3 * s->nb; i++) s->x.z[i] = s->rhs.z[i] + t * d[i];
        if (objective(s) <= now - 1e-4 * t * slope) return 1;
    }
    memcpy(s->x.z, s->rhs.z, bytes);
    return 0;
}

/* y is a certificate: |J' y| small against -c' y = |y|^2. */
static int certifies(crm_island *s, double f)
{
    if (!(sqrt(2 * f) > VIOLATION)) return 0;
    double force = 0;
    find_force(s, s->rest.z);
    for (int i = 0; i < 3 * s->nb; i++) force += s->rest.z[i] * s->rest.z[i];
    return sqrt(force) < CERTIFICATE * 2 * f;
}

/* Bodies at rest, w = -u / (V sqrt(W)), satisfy everything to rounding, as without restitution. */
static int rest_is_feasible(crm_island *s)
{
    for (int i = 0; i < 3 * s->nb; i++) s->x.z[i] = -s->free[i];
    return sqrt(2 * find_violation(s)) <= VIOLATION;
}

int crm_farkas(crm_island *s)
{
    if (rest_is_feasible(s)) return 0;
    crm_vec_copy(s, s->x, s->best);
    for (int i = 0; i < MAX_PASSES; i++) {
        crm_vec_copy(s, s->top, s->x);
        for (int k = 0; k < MAX_NEWTON; k++) {
            if (!newton(s, objective(s))) break;
        }
        const double f = find_violation(s);
        if (certifies(s, f)) return 1;
        if (!(sqrt(2 * f) > VIOLATION)) return 0;
    }
    return 0;
}
