#include "libsolver/lcp/residual.h"

#include "libsolver/lcp/sparse.h"

#include <math.h>
#include <string.h>

/* With accept = 1e-10, an error of 1e-16 of the largest x, or of a multiplier, never counts [1]. */
static const double NOISE = 1e-6;

void crm_linear_residual(const carom_lcp_problem *p, const carom_lcp_point *at, double *rx,
                         double *rz, double *ry)
{
    for (int i = 0; i < p->n_x; i++) rx[i] = p->q[i];
    crm_sparse_add(&p->M, p->n_x, 1.0, at->x, rx);
    crm_sparse_add_t(&p->A, p->n_x, 1.0, at->y, rx);
    crm_sparse_add_t(&p->G, p->n_x, 1.0, at->z, rx);
    for (int i = 0; i < p->n_ineq; i++) rz[i] = at->s[i] - p->m[i];
    crm_sparse_add(&p->G, p->n_x, 1.0, at->x, rz);
    crm_sparse_add(&p->F, p->n_ineq, 1.0, at->z, rz);
    for (int i = 0; i < p->n_eq; i++) ry[i] = -p->b[i];
    crm_sparse_add(&p->A, p->n_x, 1.0, at->x, ry);
}

/* |a| / b, with 0 / 0 = 0. */
static double ratio(double a, double b)
{
    if (a == 0.0) return 0.0;
    return b > 0.0 ? fabs(a) / b : HUGE_VAL;
}

static double worse(double worst, double next)
{
    return next <= worst ? worst : isnan(next) ? HUGE_VAL : next;
}

static double diagonal_of(const carom_sparse *M, int j)
{
    double sum = 0.0;
    for (int k = M->col ? M->col[j] : 0; M->col && k < M->col[j + 1]; k++)
        if (M->row[k] == j) sum += M->val[k];
    return sum;
}

/* X = max(|x|, |q_i| / M_ii): the size of x with and without constraints. */
static double size_of_x(const carom_lcp_problem *p, const double *x)
{
    double size = 0.0;
    for (int j = 0; j < p->n_x; j++) {
        const double diagonal = diagonal_of(&p->M, j);
        size = worse(size, fabs(x[j]));
        if (diagonal > 0.0) size = worse(size, fabs(p->q[j]) / diagonal);
    }
    return size;
}

/* row_x: c_i = |q_i| + |M_i| (|x| + NOISE X) + |A'|_i |y| + |G'|_i |z|; where M_ii = 0, at least
 * NOISE of the largest: nothing else gives such a row a size when its multipliers vanish. */
static void scale_x(const carom_lcp_problem *p, const carom_lcp_point *at, double size,
                    const crm_residual_work *w)
{
    for (int i = 0; i < p->n_x; i++) {
        w->row_x[i] = fabs(p->q[i]);
        w->abs_x[i] = fabs(at->x[i]) + NOISE * size;
    }
    crm_sparse_add_abs(&p->M, p->n_x, w->abs_x, w->row_x);
    for (int i = 0; i < p->n_eq; i++) w->row_y[i] = fabs(at->y[i]);
    crm_sparse_add_abs_t(&p->A, p->n_x, w->row_y, w->row_x);
    for (int i = 0; i < p->n_ineq; i++) w->row_z[i] = fabs(at->z[i]);
    crm_sparse_add_abs_t(&p->G, p->n_x, w->row_z, w->row_x);
    double top = 0.0;
    for (int i = 0; i < p->n_x; i++) top = fmax(top, w->row_x[i]);
    for (int i = 0; i < p->n_x; i++)
        if (!(diagonal_of(&p->M, i) > 0.0)) w->row_x[i] = fmax(w->row_x[i], NOISE * top);
}

/* Rows of zeros have no scale of their own: they get the largest, or 1 where all are zero. */
static void fill_zeros(int n, double *scale)
{
    double top = 0.0;
    for (int i = 0; i < n; i++) top = fmax(top, scale[i]);
    for (int i = 0; i < n; i++)
        if (scale[i] == 0.0) scale[i] = top > 0.0 ? top : 1.0;
}

/* row_z: |m_i| + |G_i| X; row_y: |b_i| + |A_i| X. */
static void scale_rows(const carom_lcp_problem *p, double size, const crm_residual_work *w)
{
    for (int i = 0; i < p->n_ineq; i++) w->row_z[i] = fabs(p->m[i]);
    for (int i = 0; i < p->n_eq; i++) w->row_y[i] = fabs(p->b[i]);
    for (int j = 0; j < p->n_x; j++) w->abs_x[j] = size;
    crm_sparse_add_abs(&p->A, p->n_x, w->abs_x, w->row_y);
    crm_sparse_add_abs(&p->G, p->n_x, w->abs_x, w->row_z);
}

/* weigh_z: 1/Z_i = max(max_k |G_ik| / c_k, sum_k G_ik^2 / M_kk / row_z): what a unit of z_i does to
 * an equation of momentum, and to its own row through diag(M). */
static void weigh_by_momentum(const carom_lcp_problem *p, const crm_residual_work *w)
{
    double *response = w->rz; /* free until the residuals are evaluated */
    for (int i = 0; i < p->n_ineq; i++) w->weigh_z[i] = response[i] = 0.0;
    for (int j = 0; p->G.col && j < p->n_x; j++) {
        const double diagonal = diagonal_of(&p->M, j);
        for (int k = p->G.col[j]; k < p->G.col[j + 1]; k++) {
            const int i = p->G.row[k];
            const double g = p->G.val[k];
            w->weigh_z[i] = fmax(w->weigh_z[i], ratio(g, w->row_x[j]));
            if (diagonal > 0.0) response[i] += g * g / diagonal;
        }
    }
    for (int i = 0; i < p->n_ineq; i++)
        w->weigh_z[i] = fmax(w->weigh_z[i], ratio(response[i], w->row_z[i]));
}

/* row_z: t_i = |m_i| + |G_i| X + |F_i| max(NOISE |z|, Z), |z| where z_j has no row in G and thus no
 * Z: the rounding of large multipliers is no error, more than that is. */
static void scale_coupled_rows(const carom_lcp_problem *p, const carom_lcp_point *at,
                               const crm_residual_work *w)
{
    for (int j = 0; p->F.col && j < p->n_ineq; j++) {
        const double Z = w->weigh_z[j] > 0.0 ? 1.0 / w->weigh_z[j] : fabs(at->z[j]);
        const double z = fmax(NOISE * fabs(at->z[j]), Z);
        for (int k = p->F.col[j]; k < p->F.col[j + 1]; k++)
            w->row_z[p->F.row[k]] += fabs(p->F.val[k]) * z;
    }
    fill_zeros(p->n_ineq, w->row_z);
}

/* weigh_z: 1/T_j = max(1/Z_j, max_i |F_ij| / t_i), or 1 / max |z| where z_j enters no equation. */
static void scale_z(const carom_lcp_problem *p, const carom_lcp_point *at,
                    const crm_residual_work *w)
{
    double size = 0.0;
    for (int j = 0; j < p->n_ineq; j++) size = fmax(size, fabs(at->z[j]));
    for (int j = 0; j < p->n_ineq; j++) {
        for (int k = p->F.col ? p->F.col[j] : 0; p->F.col && k < p->F.col[j + 1]; k++)
            w->weigh_z[j] = fmax(w->weigh_z[j], ratio(p->F.val[k], w->row_z[p->F.row[k]]));
        if (w->weigh_z[j] == 0.0 && size > 0.0) w->weigh_z[j] = 1.0 / size;
    }
}

/* |min(s_i / t_i, z_i / T_i)|; a zero of either is exact. */
static double pair_residual(double s, double t, double z, double weight)
{
    const double a = ratio(s, t);
    const double b = z == 0.0 ? 0.0 : fabs(z) * weight;
    if (s < 0.0 || z < 0.0) return fmax(s < 0.0 ? a : 0.0, z < 0.0 ? b : 0.0);
    return a < b ? a : b;
}

double crm_natural_residual(const carom_lcp_problem *p, const carom_lcp_point *at,
                            const crm_residual_work *w)
{
    double worst = 0.0;
    const double size = size_of_x(p, at->x);
    scale_x(p, at, size, w);
    scale_rows(p, size, w);
    weigh_by_momentum(p, w);
    scale_coupled_rows(p, at, w);
    scale_z(p, at, w);
    crm_linear_residual(p, at, w->rx, w->rz, w->ry);
    for (int i = 0; i < p->n_x; i++) worst = worse(worst, ratio(w->rx[i], w->row_x[i]));
    for (int i = 0; i < p->n_eq; i++) worst = worse(worst, ratio(w->ry[i], w->row_y[i]));
    for (int i = 0; i < p->n_ineq; i++) {
        worst = worse(worst, ratio(w->rz[i], w->row_z[i]));
        worst = worse(worst, pair_residual(at->s[i], w->row_z[i], at->z[i], w->weigh_z[i]));
    }
    return worst;
}
