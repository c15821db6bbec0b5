#include "libsolver/lcp/scale.h"

#include "libsolver/lcp/sparse.h"

#include <math.h>

/* Sweeps of Ruiz's iteration; each about halves the logarithm of the imbalance. */
enum { SWEEPS = 12 };

/* The power of two nearest to a > 0 (in the logarithm); 1 for 0. */
static double power_of_two(double a)
{
    int exponent;
    if (!(a > 0.0)) return 1.0;
    const double fraction = frexp(a, &exponent);
    return ldexp(1.0, fraction < 0.70710678118654752 ? exponent - 1 : exponent);
}

/* norm_r, norm_c <- max with the scaled entries of a, rows scaled by dr and columns by dc. */
static void raise_norms(const carom_sparse *a, int n_cols, const double *dr, const double *dc,
                        double *norm_r, double *norm_c)
{
    for (int j = 0; a->col && j < n_cols; j++)
        for (int p = a->col[j]; p < a->col[j + 1]; p++) {
            const int i = a->row[p];
            const double t = fabs(a->val[p]) * dr[i] * dc[j];
            norm_r[i] = fmax(norm_r[i], t);
            norm_c[j] = fmax(norm_c[j], t);
        }
}

static void divide(int n, const double *norm, double *d)
{
    for (int i = 0; i < n; i++)
        if (norm[i] > 0.0) d[i] /= sqrt(norm[i]);
}

/* One sweep: D_i <- D_i / sqrt(largest entry of row and column i of the scaled K). */
static void sweep(const carom_lcp_problem *p, double *norm, const crm_scale *d)
{
    double *nx = norm;
    double *nz = nx + p->n_x;
    double *ny = nz + p->n_ineq;
    for (int i = 0; i < p->n_x + p->n_ineq + p->n_eq; i++) norm[i] = 0.0;
    raise_norms(&p->M, p->n_x, d->x, d->x, nx, nx);
    raise_norms(&p->A, p->n_x, d->y, d->x, ny, nx);
    raise_norms(&p->G, p->n_x, d->z, d->x, nz, nx);
    raise_norms(&p->F, p->n_ineq, d->z, d->z, nz, nz);
    divide(p->n_x, nx, d->x);
    divide(p->n_ineq, nz, d->z);
    divide(p->n_eq, ny, d->y);
}

static double largest(int n, const double *d, const double *v, double at_least)
{
    for (int i = 0; i < n; i++) at_least = fmax(at_least, d[i] * fabs(v[i]));
    return at_least;
}

void crm_scale_find(const carom_lcp_problem *p, int wanted, double *norm, crm_scale *d)
{
    for (int i = 0; i < p->n_x; i++) d->x[i] = 1.0;
    for (int i = 0; i < p->n_ineq; i++) d->z[i] = 1.0;
    for (int i = 0; i < p->n_eq; i++) d->y[i] = 1.0;
    d->V = 1.0;
    if (!wanted) return;
    for (int k = 0; k < SWEEPS; k++) sweep(p, norm, d);
    for (int i = 0; i < p->n_x; i++) d->x[i] = power_of_two(d->x[i]);
    for (int i = 0; i < p->n_ineq; i++) d->z[i] = power_of_two(d->z[i]);
    for (int i = 0; i < p->n_eq; i++) d->y[i] = power_of_two(d->y[i]);
    double V = largest(p->n_x, d->x, p->q, 0.0);
    V = largest(p->n_ineq, d->z, p->m, V);
    d->V = power_of_two(largest(p->n_eq, d->y, p->b, V));
}

static void scale_entries(const carom_sparse *a, int n_cols, const double *dr, const double *dc,
                          double *to)
{
    for (int j = 0; a->col && j < n_cols; j++)
        for (int p = a->col[j]; p < a->col[j + 1]; p++) to[p] = a->val[p] * dr[a->row[p]] * dc[j];
}

/* to <- D from / V */
static void scale_vector(int n, const double *d, double V, const double *from, double *to)
{
    for (int i = 0; i < n; i++) to[i] = from[i] * d[i] / V;
}

/* to <- from / D V */
static void divide_vector(int n, const double *d, double V, const double *from, double *to)
{
    for (int i = 0; i < n; i++) to[i] = from[i] / d[i] * V;
}

void crm_scale_problem(const carom_lcp_problem *p, const crm_scale *d, const carom_lcp_gradient *to)
{
    scale_entries(&p->M, p->n_x, d->x, d->x, to->M);
    scale_entries(&p->A, p->n_x, d->y, d->x, to->A);
    scale_entries(&p->G, p->n_x, d->z, d->x, to->G);
    scale_entries(&p->F, p->n_ineq, d->z, d->z, to->F);
    scale_vector(p->n_x, d->x, d->V, p->q, to->q);
    scale_vector(p->n_eq, d->y, d->V, p->b, to->b);
    scale_vector(p->n_ineq, d->z, d->V, p->m, to->m);
}

void crm_scale_point(const carom_lcp_problem *p, const crm_scale *d, const carom_lcp_point *from,
                     carom_lcp_point *to)
{
    divide_vector(p->n_x, d->x, 1.0 / d->V, from->x, to->x);
    scale_vector(p->n_ineq, d->z, d->V, from->s, to->s);
    divide_vector(p->n_ineq, d->z, 1.0 / d->V, from->z, to->z);
    divide_vector(p->n_eq, d->y, 1.0 / d->V, from->y, to->y);
}

void crm_unscale_point(const carom_lcp_problem *p, const crm_scale *d, const carom_lcp_point *from,
                       carom_lcp_point *to)
{
    scale_vector(p->n_x, d->x, 1.0 / d->V, from->x, to->x);
    divide_vector(p->n_ineq, d->z, d->V, from->s, to->s);
    scale_vector(p->n_ineq, d->z, 1.0 / d->V, from->z, to->z);
    scale_vector(p->n_eq, d->y, 1.0 / d->V, from->y, to->y);
}
