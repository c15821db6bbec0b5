/* sparse.h: compressed-column views: checks and products. */
#ifndef CRM_LCP_SPARSE_H
#define CRM_LCP_SPARSE_H

#include "carom/lcp.h"

/* Number of entries. */
int crm_sparse_count(const carom_sparse *a, int n_cols);
/* 1 when columns run forward from 0 and every row is in 0 .. n_rows - 1. */
int crm_sparse_valid(const carom_sparse *a, int n_rows, int n_cols);
/* 1 when both have the same columns and rows, entry by entry. */
int crm_sparse_same(const carom_sparse *a, const carom_sparse *b, int n_cols);
/* 1 when no number is infinite or NaN. */
int crm_finite(int n, const double *x);

/* y <- y + c A x */
void crm_sparse_add(const carom_sparse *a, int n_cols, double c, const double *x, double *y);
/* y <- y + c A'x */
void crm_sparse_add_t(const carom_sparse *a, int n_cols, double c, const double *x, double *y);
/* y <- y + |A| x */
void crm_sparse_add_abs(const carom_sparse *a, int n_cols, const double *x, double *y);
/* y <- y + |A|'x */
void crm_sparse_add_abs_t(const carom_sparse *a, int n_cols, const double *x, double *y);

#endif
