#include "lcp_case.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void *get(size_t n, size_t size)
{
    void *p = calloc(n + 1, size);
    if (!p) {
        fprintf(stderr, "lcp_case: out of memory\n");
        exit(1);
    }
    return p;
}

/* Columns of the dense matrix d at the next places of *ints and *reals. */
static int compress(int n_rows, int n_cols, const double *d, int keep_zeros, int **ints,
                    double **reals, carom_sparse *a, double **val)
{
    int *col = *ints;
    int *row = col + n_cols + 1;
    int n = 0;
    *val = *reals;
    for (int j = 0; j < n_cols; j++) {
        for (int i = 0; d && i < n_rows; i++)
            if (keep_zeros || d[i * n_cols + j] != 0.0) {
                row[n] = i;
                (*val)[n++] = d[i * n_cols + j];
            }
        col[j + 1] = n;
    }
    a->col = col;
    a->row = row;
    a->val = *val;
    *ints = row + n;
    *reals = *val + n;
    return n;
}

static double *put(int n, const double *from, double **reals)
{
    double *to = *reals;
    if (n) memcpy(to, from, (size_t)n * sizeof *to);
    *reals = to + n;
    return to;
}

carom_lcp_point lcp_point_new(const carom_lcp_problem *p)
{
    carom_lcp_point at;
    at.x = get((size_t)(p->n_x + 2 * p->n_ineq + p->n_eq), sizeof(double));
    at.s = at.x + p->n_x;
    at.z = at.s + p->n_ineq;
    at.y = at.z + p->n_ineq;
    return at;
}

lcp_case lcp_case_dense(const lcp_ref *d, int keep_zeros)
{
    lcp_case c;
    const int nx = d->n_x;
    const int nz = d->n_ineq;
    const int ny = d->n_eq;
    const size_t entries = (size_t)(nx * nx + ny * nx + nz * nx + nz * nz);
    int *ints = c.ints = get(entries + (size_t)(3 * (nx + 1) + nz + 1), sizeof *ints);
    double *reals = c.reals = get(entries + (size_t)(nx + ny + nz), sizeof *reals);
    c.p.n_x = nx;
    c.p.n_ineq = nz;
    c.p.n_eq = ny;
    c.nnz[0] = compress(nx, nx, d->M, keep_zeros, &ints, &reals, &c.p.M, &c.n.M);
    c.nnz[1] = compress(ny, nx, d->A, keep_zeros, &ints, &reals, &c.p.A, &c.n.A);
    c.nnz[2] = compress(nz, nx, d->G, keep_zeros, &ints, &reals, &c.p.G, &c.n.G);
    c.nnz[3] = compress(nz, nz, d->F, keep_zeros, &ints, &reals, &c.p.F, &c.n.F);
    c.p.q = c.n.q = put(nx, d->q, &reals);
    c.p.b = c.n.b = put(ny, d->b, &reals);
    c.p.m = c.n.m = put(nz, d->m, &reals);
    c.at = lcp_point_new(&c.p);
    return c;
}

void lcp_case_free(lcp_case *c)
{
    free(c->ints);
    free(c->reals);
    free(c->at.x);
    memset(c, 0, sizeof *c);
}

/* Random entries of the given density in [-1, 1). */
static double *random_matrix(rng *r, int n_rows, int n_cols, double density)
{
    double *a = get((size_t)(n_rows * n_cols), sizeof *a);
    for (int k = 0; k < n_rows * n_cols; k++) {
        const double value = rng_uniform(r, -1.0, 1.0);
        if (rng_unit(r) < density) a[k] = value;
    }
    return a;
}

/* out <- c B'B + d I, n*n */
static double *gram(int n, const double *B, double c, double d)
{
    double *out = get((size_t)(n * n), sizeof *out);
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) {
            for (int k = 0; k < n; k++) out[i * n + j] += c * B[k * n + i] * B[k * n + j];
            if (i == j) out[i * n + j] += d;
        }
    return out;
}

static double *random_f(rng *r, int n, double density, lcp_kind kind)
{
    double *B = random_matrix(r, n, n, density);
    if (kind == LCP_GENERAL) return B;
    double *F = gram(n, B, kind == LCP_MONOTONE ? -1.0 : 0.0, 0.0);
    if (kind == LCP_MONOTONE)
        for (int i = 0; i < n; i++)
            for (int j = 0; j < i; j++) {
                F[i * n + j] += B[i * n + j];
                F[j * n + i] -= B[i * n + j];
            }
    free(B);
    return F;
}

/* y <- y + c A x, or A'x */
static void add(int n_rows, int n_cols, const double *A, int transposed, double c, const double *x,
                double *y)
{
    for (int i = 0; i < n_rows; i++)
        for (int j = 0; j < n_cols; j++) {
            if (transposed)
                y[j] += c * A[i * n_cols + j] * x[i];
            else
                y[i] += c * A[i * n_cols + j] * x[j];
        }
}

static void plant_point(rng *r, int nx, int nz, int ny, carom_lcp_point *at)
{
    int room = nx - ny;
    for (int i = 0; i < nx; i++) at->x[i] = rng_uniform(r, -2.0, 2.0);
    for (int i = 0; i < ny; i++) at->y[i] = rng_uniform(r, -2.0, 2.0);
    for (int i = 0; i < nz; i++) {
        const double positive = rng_uniform(r, 0.5, 2.0);
        const int active = rng_unit(r) < 0.5 && room-- > 0;
        at->z[i] = active ? positive : 0.0;
        at->s[i] = active ? 0.0 : positive;
    }
}

lcp_case lcp_case_planted(rng *r, int nx, int nz, int ny, double density, lcp_kind kind)
{
    carom_lcp_problem sizes = {0};
    sizes.n_x = nx;
    sizes.n_ineq = nz;
    sizes.n_eq = ny;
    carom_lcp_point at = lcp_point_new(&sizes);
    plant_point(r, nx, nz, ny, &at);
    double *B = random_matrix(r, nx, nx, density);
    double *M = gram(nx, B, 1.0, 0.5);
    double *A = random_matrix(r, ny, nx, fmax(density, 0.3));
    double *G = random_matrix(r, nz, nx, density);
    double *F = random_f(r, nz, density, kind);
    for (int i = 0; i < 3 * nz && nx; i++) /* parallel rows would have unbounded multipliers */
        G[i / 3 * nx + rng_int(r, nx)] += rng_uniform(r, -1.0, 1.0);
    for (int i = 0; i < ny; i++) A[i * nx + i % (nx ? nx : 1)] += 2.0; /* full rank */
    double *q = get((size_t)nx, sizeof *q);
    double *b = get((size_t)ny, sizeof *b);
    double *m = get((size_t)nz, sizeof *m);
    add(nx, nx, M, 0, -1.0, at.x, q);
    add(ny, nx, A, 1, -1.0, at.y, q);
    add(nz, nx, G, 1, -1.0, at.z, q);
    add(ny, nx, A, 0, 1.0, at.x, b);
    add(nz, nx, G, 0, 1.0, at.x, m);
    add(nz, nz, F, 0, 1.0, at.z, m);
    for (int i = 0; i < nz; i++) m[i] += at.s[i];
    const lcp_ref d = {nx, nz, ny, M, A, G, F, q, b, m};
    lcp_case c = lcp_case_dense(&d, 0);
    free(c.at.x);
    c.at = at;
    free(B);
    free(M);
    free(A);
    free(G);
    free(F);
    free(q);
    free(b);
    free(m);
    return c;
}

/* Column j of every matrix with x_j, added where it belongs. */
static void add_column(const carom_sparse *a, int j, double x, double *y)
{
    for (int k = a->col ? a->col[j] : 0; a->col && k < a->col[j + 1]; k++)
        y[a->row[k]] += a->val[k] * x;
}

static double dot_column(const carom_sparse *a, int j, const double *y)
{
    double sum = 0.0;
    for (int k = a->col ? a->col[j] : 0; a->col && k < a->col[j + 1]; k++)
        sum += a->val[k] * y[a->row[k]];
    return sum;
}

/* The larger of both; NaN wins. */
static double worse(double a, double b)
{
    return isnan(a) || a >= b ? a : b;
}

double lcp_case_error(const carom_lcp_problem *p, const carom_lcp_point *at)
{
    double worst = 0.0;
    carom_lcp_point r = lcp_point_new(p); /* x: momentum, s: constraints, y: joints */
    for (int j = 0; j < p->n_x; j++) {
        add_column(&p->M, j, at->x[j], r.x);
        add_column(&p->G, j, at->x[j], r.s);
        add_column(&p->A, j, at->x[j], r.y);
    }
    for (int j = 0; j < p->n_ineq; j++) add_column(&p->F, j, at->z[j], r.s);
    for (int j = 0; j < p->n_x; j++) {
        r.x[j] += p->q[j] + dot_column(&p->A, j, at->y) + dot_column(&p->G, j, at->z);
        worst = worse(worst, fabs(r.x[j]));
    }
    for (int i = 0; i < p->n_eq; i++) worst = worse(worst, fabs(r.y[i] - p->b[i]));
    for (int i = 0; i < p->n_ineq; i++) {
        worst = worse(worst, fabs(r.s[i] + at->s[i] - p->m[i]));
        worst = worse(worst, fabs(fmin(at->s[i], at->z[i])));
    }
    free(r.x);
    return worst;
}
