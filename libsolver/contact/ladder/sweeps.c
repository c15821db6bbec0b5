#include "libsolver/contact/ladder/ladder.h"

#include <float.h>
#include <math.h>

/* A 2x2 block is singular when its determinant is below this share of its diagonal's product. */
#define SINGULAR 1e-14
/* A sweep that changes no multiplier by more ends the loop [1]. */
#define SETTLED 1e-14
/* Added to the diagonal of a joint group, whose rows have unit norm [1]. */
#define GROUP_COMPLIANCE 1e-12

static double dot6(const crm_contact *c, const double *p, const double *q)
{
    double s = 0;
    for (int i = 0; c->a >= 0 && i < 3; i++) s += p[i] * q[i];
    for (int i = 3; c->b >= 0 && i < 6; i++) s += p[i] * q[i];
    return s;
}

/* One contact alone: a0, u0 are its velocities without its own impulse, [nn nt; nt tt] its
 * response.  Separation is taken when admissible, then sticking, then slip. */
static void solve_one(double mu, double nn, double nt, double tt, double a0, double u0, double *ln,
                      double *lt)
{
    *ln = 0;
    *lt = 0;
    if (a0 >= 0) return;
    *ln = -a0 / nn;
    if (!(mu > 0)) return;
    const double det = nn * tt - nt * nt;
    if (det > SINGULAR * nn * tt) {
        const double x = (u0 * nt - a0 * tt) / det;
        const double y = (a0 * nt - u0 * nn) / det;
        if (x >= 0 && fabs(y) <= mu * x) {
            *ln = x;
            *lt = y;
            return;
        }
    }
    for (int sign = -1; sign <= 1; sign += 2) {
        const double d = nn + sign * mu * nt;
        if (!(d > SINGULAR)) continue;
        const double x = -a0 / d;
        const double u = u0 + nt * x + tt * sign * mu * x;
        if (u * sign > 0) continue;
        *ln = x;
        *lt = sign * mu * x;
        return;
    }
}

static double sweep_contact(crm_island *s, int k)
{
    const crm_contact *c = &s->contact[k];
    const double nn = dot6(c, c->n, c->n);
    if (!(nn > 0)) return 0;
    const double nt = dot6(c, c->n, c->t);
    const double tt = dot6(c, c->t, c->t);
    double *ln = &s->x.n[k];
    double *lt = &s->x.t[k];
    const double a = crm_dot(c->n, c->a, c->b, s->x.z) + c->cn;
    const double u = crm_dot(c->t, c->a, c->b, s->x.z) + c->ct;
    double x;
    double y;
    solve_one(c->mu, nn, nt, tt, a - nn * *ln - nt * *lt, u - nt * *ln - tt * *lt, &x, &y);
    const double dx = x - *ln;
    const double dy = y - *lt;
    crm_add(s->x.z, c->n, c->a, c->b, dx);
    crm_add(s->x.z, c->t, c->a, c->b, dy);
    *ln = x;
    *lt = y;
    return fmax(fabs(dx), fabs(dy));
}

/* m x = x by Cholesky, m symmetric positive definite. */
static void solve_3x3(double m[3][3], double *x)
{
    for (int j = 0; j < 3; j++) {
        for (int k = 0; k < j; k++) m[j][j] -= m[j][k] * m[j][k];
        m[j][j] = sqrt(fmax(m[j][j], DBL_MIN));
        for (int i = j + 1; i < 3; i++) {
            for (int k = 0; k < j; k++) m[i][j] -= m[i][k] * m[j][k];
            m[i][j] /= m[j][j];
        }
        for (int k = 0; k < j; k++) x[j] -= m[j][k] * x[k];
        x[j] /= m[j][j];
    }
    for (int j = 2; j >= 0; j--) {
        for (int k = j + 1; k < 3; k++) x[j] -= m[k][j] * x[k];
        x[j] /= m[j][j];
    }
}

static double sweep_group(crm_island *s, int q)
{
    const crm_group *g = &s->group[q];
    double m[3][3];
    double dl[3];
    for (int r = 0; r < CRM_GROUP_ROWS; r++) {
        dl[r] = -(crm_dot(g->j[r], g->a, g->b, s->x.z) + g->c[r]);
        for (int p = 0; p < CRM_GROUP_ROWS; p++) {
            m[r][p] = r == p ? GROUP_COMPLIANCE : 0;
            for (int i = 0; i < 6; i++) m[r][p] += g->j[r][i] * g->j[p][i];
        }
    }
    solve_3x3(m, dl);
    double change = 0;
    for (int r = 0; r < CRM_GROUP_ROWS; r++) {
        crm_add(s->x.z, g->j[r], g->a, g->b, dl[r]);
        s->x.z[3 * (s->nb + q) + r] += dl[r];
        change = fmax(change, fabs(dl[r]));
    }
    return change;
}

void crm_into_cones(crm_island *s)
{
    for (int k = 0; k < s->nc; k++) {
        s->x.n[k] = fmax(0, s->x.n[k]);
        const double bound = s->contact[k].mu * s->x.n[k];
        s->x.t[k] = fmin(bound, fmax(-bound, s->x.t[k]));
    }
    memset(s->x.z, 0, 3 * (size_t)s->nb * sizeof(double));
    crm_island_defect(s, s->x, s->rest.z);
    memcpy(s->x.z, s->rest.z, 3 * (size_t)s->nb * sizeof(double));
}

void crm_sweeps(crm_island *s, int n_sweeps)
{
    for (int i = 0; i < n_sweeps; i++) {
        double change = 0;
        for (int k = 0; k < s->nc; k++) change = fmax(change, sweep_contact(s, k));
        for (int q = 0; q < s->ng; q++) change = fmax(change, sweep_group(s, q));
        if (change < SETTLED) break;
    }
    crm_modes_at(s);
}
