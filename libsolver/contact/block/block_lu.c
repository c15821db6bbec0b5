#include "libsolver/contact/block/block_lu.h"

#include <float.h>
#include <math.h>

/* c -= a b, 3x3 by rows; disjoint. */
static inline void subtract_product(double *restrict c, const double *restrict a,
                                    const double *restrict b)
{
    for (int r = 0; r < 3; r++) {
        const double a0 = a[3 * r];
        const double a1 = a[3 * r + 1];
        const double a2 = a[3 * r + 2];
        c[3 * r] -= a0 * b[0] + a1 * b[3] + a2 * b[6];
        c[3 * r + 1] -= a0 * b[1] + a1 * b[4] + a2 * b[7];
        c[3 * r + 2] -= a0 * b[2] + a1 * b[5] + a2 * b[8];
    }
}

static void swap_rows(double *d, int i, int j)
{
    for (int c = 0; c < 3; c++) {
        const double t = d[3 * i + c];
        d[3 * i + c] = d[3 * j + c];
        d[3 * j + c] = t;
    }
}

/* A pivot lost to rounding becomes that rounding, with its sign: refinement repairs the rest. */
static int guard_pivot(double *pivot, double floor)
{
    if (fabs(*pivot) > floor) return 0;
    *pivot = *pivot < 0 ? -floor : floor;
    return 1;
}

/* P D = L U in place, unit L, the diagonal of U inverted.  Returns the replaced pivots. */
static int factor_diagonal(double *d, int *pivot)
{
    double size = DBL_MIN;
    for (int i = 0; i < 9; i++) size = fmax(size, fabs(d[i]));
    const double floor = DBL_EPSILON * size;
    int replaced = 0;
    for (int c = 0; c < 2; c++) {
        int best = c;
        for (int r = c + 1; r < 3; r++) {
            if (fabs(d[3 * r + c]) > fabs(d[3 * best + c])) best = r;
        }
        pivot[c] = best;
        if (best != c) swap_rows(d, best, c);
        replaced += guard_pivot(&d[4 * c], floor * DBL_EPSILON);
        d[4 * c] = 1 / d[4 * c];
        for (int r = c + 1; r < 3; r++) {
            const double l = d[3 * r + c] *= d[4 * c];
            for (int q = c + 1; q < 3; q++) d[3 * r + q] -= l * d[3 * c + q];
        }
    }
    replaced += guard_pivot(&d[8], floor * DBL_EPSILON);
    d[8] = 1 / d[8];
    return replaced;
}

static inline void swap(double *x, int i, int j)
{
    const double t = x[i];
    x[i] = x[j];
    x[j] = t;
}

/* x <- L^-1 P x, elements `step` apart. */
static inline void lower(const double *d, const int *pivot, double *x, int step)
{
    if (pivot[0]) swap(x, 0, pivot[0] * step);
    if (pivot[1] == 2) swap(x, step, 2 * step);
    x[step] -= d[3] * x[0];
    x[2 * step] -= d[6] * x[0] + d[7] * x[step];
}

/* x <- U^-1 x. */
static inline void upper(const double *d, double *x)
{
    x[2] *= d[8];
    x[1] = (x[1] - d[5] * x[2]) * d[4];
    x[0] = (x[0] - d[1] * x[1] - d[2] * x[2]) * d[0];
}

/* x <- U'^-1 x. */
static inline void upper_transposed(const double *d, double *x)
{
    x[0] *= d[0];
    x[1] = (x[1] - d[1] * x[0]) * d[4];
    x[2] = (x[2] - d[2] * x[0] - d[5] * x[1]) * d[8];
}

/* x <- P' L'^-1 x. */
static inline void lower_transposed(const double *d, const int *pivot, double *x)
{
    x[1] -= d[7] * x[2];
    x[0] -= d[3] * x[1] + d[6] * x[2];
    if (pivot[1] == 2) swap(x, 1, 2);
    if (pivot[0]) swap(x, 0, pivot[0]);
}

/* Panels in point-LU form, L21 = A21 U11^-1 and U12 = L11^-1 P A12: each is then accurate to its
 * own size.  The form D^-1 A12 loses the last iterations, when D is ill conditioned. */
static void scale_panels(const crm_block_lu *f, int j)
{
    const double *d = f->d + 9 * (size_t)j;
    const int *pivot = f->pivot + 2 * j;
    for (int p = f->lp[j]; p < f->lp[j + 1]; p++) {
        double *l = f->l + 9 * (size_t)p;
        double *u = f->u + 9 * (size_t)p;
        for (int c = 0; c < 3; c++) {
            lower(d, pivot, u + c, 3);
            upper_transposed(d, l + 3 * c);
        }
    }
}

/* c -= a b + p q. */
static inline void subtract_two(double *restrict c, const double *restrict a,
                                const double *restrict b, const double *restrict p,
                                const double *restrict q)
{
    for (int r = 0; r < 3; r++) {
        const double *x = a + 3 * r;
        const double *y = p + 3 * r;
        for (int k = 0; k < 3; k++) {
            c[3 * r + k] -= (x[0] * b[k] + x[1] * b[3 + k] + x[2] * b[6 + k]) +
                            (y[0] * q[k] + y[1] * q[3 + k] + y[2] * q[6 + k]);
        }
    }
}

/* Column and row j lose the product of column k of L and row k of U, from entry p on (row j). */
static void apply_column(const crm_block_lu *f, int k, int p, int j, const int *at)
{
    const double *ljk = f->l + 9 * (size_t)p;
    const double *ukj = f->u + 9 * (size_t)p;
    subtract_product(f->d + 9 * (size_t)j, ljk, ukj);
    for (int q = p + 1; q < f->lp[k + 1]; q++) {
        const size_t to = 9 * (size_t)at[f->li[q]];
        subtract_product(f->l + to, f->l + 9 * (size_t)q, ukj);
        subtract_product(f->u + to, ljk, f->u + 9 * (size_t)q);
    }
}

/* The same of columns k and k + 1, whose entries from p and p2 on have the same rows. */
static void apply_two(const crm_block_lu *f, int k, int p, int p2, int j, const int *at)
{
    const double *l1 = f->l + 9 * (size_t)p;
    const double *u1 = f->u + 9 * (size_t)p;
    const double *l2 = f->l + 9 * (size_t)p2;
    const double *u2 = f->u + 9 * (size_t)p2;
    subtract_two(f->d + 9 * (size_t)j, l1, u1, l2, u2);
    for (int q = 1; q < f->lp[k + 1] - p; q++) {
        const size_t to = 9 * (size_t)at[f->li[p + q]];
        const size_t skip = 9 * (size_t)q;
        subtract_two(f->l + to, l1 + skip, u1, l2 + skip, u2);
        subtract_two(f->u + to, l1, u1 + skip, l2, u2 + skip);
    }
}

/* Columns first .. last of L share the rows of the last `n` entries of each; the one `t` behind the
 * first of these is row j.  Column and row j lose their products. */
static void apply_columns(const crm_block_lu *f, int first, int last, int n, int t, int j,
                          const int *at)
{
    int k = first;
    for (; k < last; k += 2) {
        const int p = f->lp[k + 1] - n + t;
        const int p2 = f->lp[k + 2] - n + t;
        apply_two(f, k, p, p2, j, at);
    }
    if (k == last) apply_column(f, k, f->lp[k + 1] - n + t, j, at);
}

/* Column j has the rows of column j - 1 without j. */
static int continues(const crm_block_lu *f, int j)
{
    return j > 0 && f->lp[j] - f->lp[j - 1] == f->lp[j + 1] - f->lp[j] + 1 &&
           f->li[f->lp[j - 1]] == j;
}

/* Left-looking.  Columns with the same rows below them act together; they hang, by the last of
 * them, in a list at the next row that they act on. */
int crm_block_factor(crm_block_lu *f)
{
    const int n = f->n;
    int *head = f->work;
    int *next = head + n;
    int *front = next + n; /* next entry of the last column to act */
    int *at = front + n;   /* row -> entry of the current column */
    int *first = at + n;   /* of the columns that hang by their last */
    int replaced = 0;
    int start = 0; /* of the columns that go with the present one */
    for (int j = 0; j < n; j++) head[j] = -1;
    for (int j = 0; j < n; j++) {
        const int size = f->lp[j + 1] - f->lp[j];
        for (int p = f->lp[j]; p < f->lp[j + 1]; p++) at[f->li[p]] = p;
        for (int k = head[j]; k >= 0;) {
            const int after = next[k];
            const int t = front[k]++;
            const int m = f->lp[k + 1] - f->lp[k];
            apply_columns(f, first[k], k, m, t, j, at);
            if (t + 1 < m) {
                const int i = f->li[f->lp[k] + t + 1];
                next[k] = head[i];
                head[i] = k;
            }
            k = after;
        }
        if (!continues(f, j)) start = j;
        if (start < j) apply_columns(f, start, j - 1, size + 1, 0, j, at);
        replaced += factor_diagonal(f->d + 9 * (size_t)j, f->pivot + 2 * j);
        scale_panels(f, j);
        if (!size || (j + 1 < n && continues(f, j + 1))) continue;
        const int i = f->li[f->lp[j]];
        first[j] = start;
        front[j] = 0;
        next[j] = head[i];
        head[i] = j;
    }
    return replaced;
}

static void gather(const crm_block_lu *f, const double *x)
{
    for (int b = 0; b < f->n; b++) {
        double *to = f->x + 3 * f->place[b];
        for (int i = 0; i < 3; i++) to[i] = x[3 * b + i];
    }
}

static void scatter(const crm_block_lu *f, double *x)
{
    for (int b = 0; b < f->n; b++) {
        const double *from = f->x + 3 * f->place[b];
        for (int i = 0; i < 3; i++) x[3 * b + i] = from[i];
    }
}

/* y -= a x and y -= a' x. */
static inline void subtract_times(double *y, const double *a, const double *x)
{
    y[0] -= a[0] * x[0] + a[1] * x[1] + a[2] * x[2];
    y[1] -= a[3] * x[0] + a[4] * x[1] + a[5] * x[2];
    y[2] -= a[6] * x[0] + a[7] * x[1] + a[8] * x[2];
}

static inline void subtract_times_transposed(double *y, const double *a, const double *x)
{
    y[0] -= a[0] * x[0] + a[3] * x[1] + a[6] * x[2];
    y[1] -= a[1] * x[0] + a[4] * x[1] + a[7] * x[2];
    y[2] -= a[2] * x[0] + a[5] * x[1] + a[8] * x[2];
}

void crm_block_solve(crm_block_lu *f, double *x)
{
    gather(f, x);
    for (int j = 0; j < f->n; j++) {
        double *xj = f->x + 3 * j;
        lower(f->d + 9 * (size_t)j, f->pivot + 2 * j, xj, 1);
        for (int p = f->lp[j]; p < f->lp[j + 1]; p++)
            subtract_times(f->x + 3 * f->li[p], f->l + 9 * (size_t)p, xj);
    }
    for (int j = f->n - 1; j >= 0; j--) {
        double *xj = f->x + 3 * j;
        for (int p = f->lp[j]; p < f->lp[j + 1]; p++)
            subtract_times(xj, f->u + 9 * (size_t)p, f->x + 3 * f->li[p]);
        upper(f->d + 9 * (size_t)j, xj);
    }
    scatter(f, x);
}

void crm_block_solve_transposed(crm_block_lu *f, double *x)
{
    gather(f, x);
    for (int j = 0; j < f->n; j++) {
        double *xj = f->x + 3 * j;
        upper_transposed(f->d + 9 * (size_t)j, xj);
        for (int p = f->lp[j]; p < f->lp[j + 1]; p++)
            subtract_times_transposed(f->x + 3 * f->li[p], f->u + 9 * (size_t)p, xj);
    }
    for (int j = f->n - 1; j >= 0; j--) {
        double *xj = f->x + 3 * j;
        for (int p = f->lp[j]; p < f->lp[j + 1]; p++)
            subtract_times_transposed(xj, f->l + 9 * (size_t)p, f->x + 3 * f->li[p]);
        lower_transposed(f->d + 9 * (size_t)j, f->pivot + 2 * j, xj);
    }
    scatter(f, x);
}
