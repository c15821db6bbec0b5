#include "libsolver/lcp/sparse.h"

#include <math.h>
#include <string.h>

int crm_sparse_count(const carom_sparse *a, int n_cols)
{
    return a->col ? a->col[n_cols] : 0;
}

int crm_sparse_valid(const carom_sparse *a, int n_rows, int n_cols)
{
    if (!a->col) return 1;
    if (a->col[0] != 0) return 0;
    for (int j = 0; j < n_cols; j++)
        if (a->col[j + 1] < a->col[j]) return 0;
    if (a->col[n_cols] > 0 && !a->row) return 0;
    for (int p = 0; p < a->col[n_cols]; p++)
        if (a->row[p] < 0 || a->row[p] >= n_rows) return 0;
    return 1;
}

int crm_sparse_same(const carom_sparse *a, const carom_sparse *b, int n_cols)
{
    const int n = crm_sparse_count(a, n_cols);
    if (n != crm_sparse_count(b, n_cols)) return 0;
    if (n == 0) return 1;
    return memcmp(a->col, b->col, ((size_t)n_cols + 1) * sizeof *a->col) == 0 &&
           memcmp(a->row, b->row, (size_t)n * sizeof *a->row) == 0;
}

int crm_finite(int n, const double *x)
{
    for (int i = 0; i < n; i++)
        if (!isfinite(x[i])) return 0;
    return 1;
}

void crm_sparse_add(const carom_sparse *a, int n_cols, double c, const double *x, double *y)
{
    if (!a->col) return;
    for (int j = 0; j < n_cols; j++) {
        const double t = c * x[j];
        for (int p = a->col[j]; p < a->col[j + 1]; p++) y[a->row[p]] += a->val[p] * t;
    }
}

void crm_sparse_add_t(const carom_sparse *a, int n_cols, double c, const double *x, double *y)
{
    if (!a->col) return;
    for (int j = 0; j < n_cols; j++) {
        double sum = 0.0;
        for (int p = a->col[j]; p < a->col[j + 1]; p++) sum += a->val[p] * x[a->row[p]];
        y[j] += c * sum;
    }
}

void crm_sparse_add_abs(const carom_sparse *a, int n_cols, const double *x, double *y)
{
    if (!a->col) return;
    for (int j = 0; j < n_cols; j++)
        for (int p = a->col[j]; p < a->col[j + 1]; p++) y[a->row[p]] += fabs(a->val[p]) * x[j];
}

void crm_sparse_add_abs_t(const carom_sparse *a, int n_cols, const double *x, double *y)
{
    if (!a->col) return;
    for (int j = 0; j < n_cols; j++)
        for (int p = a->col[j]; p < a->col[j + 1]; p++) y[j] += fabs(a->val[p]) * x[a->row[p]];
}
