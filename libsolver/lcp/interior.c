#include "libsolver/lcp/solver.h"
#include "libsolver/lcp/sparse.h"

#include <math.h>

/* The factored matrix is regularized by this part of a unit row; refinement removes it [1]. */
static const crm_kkt_reg REGULARIZATION = {1e-12, 0.0, 1e-12};
enum { REFINEMENTS = 3 };

/* A step goes this part of the way to the boundary. */
static const double FRACTION = 0.995;
/* Below these steps the direction is taken anew, more centered. */
static const double SHORT_STEP = 0.1;
static const double TINY_STEP = 0.05;
/* Iterations without progress before a start is given up. */
enum { STALL = 10 };
/* The loop ends this far below the accepted residual: what polishing starts from. */
static const double MARGIN = 1e-2;

/* Starts after Mattingley and Boyd's: all z_i, all s_i, in scaled units. */
static const double STARTS[][2] = {{0, 0},     {10, 0.01},  {1, 1},     {1e3, 1},
                                   {0.01, 10}, {1e4, 1e-3}, {100, 100}, {1e6, 1}};

int crm_interior_starts(void)
{
    return (int)(sizeof STARTS / sizeof STARTS[0]);
}

static double dot(int n, const double *a, const double *b)
{
    double sum = 0.0;
    for (int i = 0; i < n; i++) sum += a[i] * b[i];
    return sum;
}

/* Largest t <= 1 with s + t ds >= 0 and z + t dz >= 0. */
static double to_boundary(int n, const double *s, const double *ds, const double *z,
                          const double *dz)
{
    double t = 1.0;
    for (int i = 0; i < n; i++) {
        if (ds[i] < 0.0) t = fmin(t, -s[i] / ds[i]);
        if (dz[i] < 0.0) t = fmin(t, -z[i] / dz[i]);
    }
    return t;
}

/* Matrix of (9) with ds eliminated, at the present iterate. */
static carom_status factor(carom_lcp *l)
{
    const carom_lcp_point at = crm_iterate_point(l, l->now);
    for (int i = 0; i < l->scaled.n_ineq; i++) {
        const double sum = at.z[i] + at.s[i];
        l->w[i] = at.z[i] / sum;
        l->v[i] = at.s[i] / sum;
    }
    crm_kkt_assemble(&l->kkt, &l->scaled, l->w, l->v, REGULARIZATION);
    return crm_kkt_factor(&l->kkt);
}

/* Direction (l->du, l->ds) of (9) for the complementarity residual l->target.  ds comes from the
 * third row where s dominates and from the second where z does: the smaller of a pair then keeps
 * its relative accuracy. */
static carom_status direction(carom_lcp *l)
{
    const int nx = l->scaled.n_x;
    const int nz = l->scaled.n_ineq;
    const carom_lcp_point at = crm_iterate_point(l, l->now);
    const double *rz = l->res + nx;
    const double *dz = l->du + nx;
    for (int i = 0; i < l->kkt.n; i++) {
        l->rhs[i] = -l->res[i];
        l->du[i] = 0.0;
    }
    for (int i = 0; i < nz; i++) {
        l->rhs[nx + i] = (l->target[i] - at.z[i] * rz[i]) / (at.z[i] + at.s[i]);
        l->ds[i] = -rz[i];
    }
    if (!(crm_kkt_solve(&l->kkt, 0, REFINEMENTS, l->rhs, l->du) < HUGE_VAL))
        return CAROM_E_SINGULAR;
    crm_sparse_add(&l->scaled.G, nx, -1.0, l->du, l->ds);
    crm_sparse_add(&l->scaled.F, nz, -1.0, dz, l->ds);
    for (int i = 0; i < nz; i++)
        if (at.z[i] >= at.s[i]) l->ds[i] = (-l->target[i] - at.s[i] * dz[i]) / at.z[i];
    return CAROM_OK;
}

/* Step to the boundary along (l->du, l->ds). */
static double longest_step(const carom_lcp *l)
{
    const carom_lcp_point at = crm_iterate_point(l, l->now);
    return to_boundary(l->scaled.n_ineq, at.s, l->ds, at.z, l->du + l->scaled.n_x);
}

/* mu after a step t along (l->du, l->ds). */
static double mu_after(const carom_lcp *l, double t)
{
    const int n = l->scaled.n_ineq;
    const carom_lcp_point at = crm_iterate_point(l, l->now);
    const double *dz = l->du + l->scaled.n_x;
    double sum = 0.0;
    for (int i = 0; i < n; i++) sum += (at.s[i] + t * l->ds[i]) * (at.z[i] + t * dz[i]);
    return sum / n;
}

/* target <- s z - sigma mu, plus ds dz of the last direction when `corrector`. */
static void set_target(carom_lcp *l, double sigma_mu, int corrector)
{
    const carom_lcp_point at = crm_iterate_point(l, l->now);
    const double *dz = l->du + l->scaled.n_x;
    for (int i = 0; i < l->scaled.n_ineq; i++) {
        const double second = corrector ? l->ds[i] * dz[i] : 0.0;
        l->target[i] = at.s[i] * at.z[i] - sigma_mu + second;
    }
}

/* Predictor, Mehrotra's centering, corrector; where the step is short, a centered direction
 * instead.  tiny: short steps in a row so far.  Leaves the direction, returns its step. */
static carom_status choose_direction(carom_lcp *l, double mu, int tiny, double *step)
{
    set_target(l, 0.0, 0);
    carom_status status = direction(l);
    if (status < 0) return status;
    const double ratio = mu_after(l, longest_step(l)) / mu;
    double sigma = fmin(1.0, fmax(1e-8, ratio * ratio * ratio));
    if (tiny >= 4) sigma = fmax(sigma, 0.8);
    if (tiny >= 2) sigma = fmax(sigma, 0.3);
    set_target(l, sigma * mu, tiny < 4);
    status = direction(l);
    if (status < 0) return status;
    *step = fmin(1.0, FRACTION * longest_step(l));
    if (*step >= SHORT_STEP) return CAROM_OK;
    set_target(l, fmax(sigma, 0.1) * mu, 0);
    status = direction(l);
    *step = fmin(1.0, FRACTION * longest_step(l));
    return status;
}

static void move(carom_lcp *l, double step)
{
    for (int i = 0; i < l->kkt.n; i++) l->now.u[i] += step * l->du[i];
    for (int i = 0; i < l->scaled.n_ineq; i++) l->now.s[i] += step * l->ds[i];
}

/* Shifts v so that its smallest entry is at least 1 when it was not positive. */
static void shift_positive(int n, double *v)
{
    double low = HUGE_VAL;
    for (int i = 0; i < n; i++) low = fmin(low, v[i]);
    if (low > 0.0) return;
    for (int i = 0; i < n; i++) v[i] += 1.0 - low;
}

/* Mattingley and Boyd: the problem with s + z = 0 in place of complementarity, then shifts. */
static carom_status start_point(carom_lcp *l, int start)
{
    const int nx = l->scaled.n_x;
    const int nz = l->scaled.n_ineq;
    const carom_lcp_point at = crm_iterate_point(l, l->now);
    for (int i = 0; i < nz; i++) l->w[i] = l->v[i] = 1.0;
    crm_kkt_assemble(&l->kkt, &l->scaled, l->w, l->v, REGULARIZATION);
    const carom_status status = crm_kkt_factor(&l->kkt);
    if (status < 0) return status;
    for (int i = 0; i < nx; i++) l->rhs[i] = -l->scaled.q[i];
    for (int i = 0; i < nz; i++) l->rhs[nx + i] = l->scaled.m[i];
    for (int i = 0; i < l->scaled.n_eq; i++) l->rhs[nx + nz + i] = l->scaled.b[i];
    for (int i = 0; i < l->kkt.n; i++) at.x[i] = 0.0;
    if (!(crm_kkt_solve(&l->kkt, 0, REFINEMENTS, l->rhs, at.x) < HUGE_VAL)) return CAROM_E_SINGULAR;
    for (int i = 0; i < nz; i++) {
        at.s[i] = start == 0 ? -at.z[i] : STARTS[start][1];
        if (start > 0) at.z[i] = STARTS[start][0];
    }
    shift_positive(nz, at.s);
    shift_positive(nz, at.z);
    return CAROM_OK;
}

/* One iteration; *step is 0 when the iterate can no longer move. */
static carom_status iterate(carom_lcp *l, int tiny, double *step)
{
    const int nz = l->scaled.n_ineq;
    const carom_lcp_point at = crm_iterate_point(l, l->now);
    const double mu = dot(nz, at.s, at.z) / nz;
    *step = 0.0;
    if (!(mu > 0.0)) return CAROM_OK;
    carom_status status = factor(l);
    if (status < 0) return status;
    crm_linear_residual(&l->scaled, &at, l->res, l->res + l->scaled.n_x,
                        l->res + l->scaled.n_x + nz);
    status = choose_direction(l, mu, tiny, step);
    if (status == CAROM_OK) move(l, *step);
    return status;
}

carom_status crm_interior_run(carom_lcp *l, int start)
{
    carom_status status = start_point(l, start);
    if (status < 0) return status;
    double low = crm_offer(l, l->now);
    int tiny = 0;
    int since = 0;
    for (int k = 0; l->scaled.n_ineq && k < l->settings.max_iterations; k++) {
        double step;
        status = iterate(l, tiny, &step);
        if (status < 0 || !(step > 0.0)) return status;
        l->stats.iterations++;
        const double residual = crm_offer(l, l->now);
        if (residual <= MARGIN * l->settings.accept) break;
        tiny = step < TINY_STEP ? tiny + 1 : 0;
        since = residual < 0.9 * low ? 0 : since + 1;
        low = fmin(low, residual);
        if (since >= STALL) break;
    }
    return CAROM_OK;
}
