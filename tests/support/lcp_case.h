/* lcp_case.h: mixed LCPs that own their arrays: from dense matrices, and with planted solutions. */
#ifndef SUPPORT_LCP_CASE_H
#define SUPPORT_LCP_CASE_H

#include "carom/lcp.h"
#include "lcp_ref.h"
#include "rng.h"

typedef struct lcp_case {
    carom_lcp_problem p;  /* a view of the arrays below */
    carom_lcp_gradient n; /* the same numbers, writable */
    carom_lcp_point at;   /* room for a point; the planted solution where there is one */
    int nnz[4];           /* entries of M, A, G, F */
    int *ints;
    double *reals;
} lcp_case;

/* Dense rows; a NULL matrix has no entries; zeros are left out of the pattern unless keep_zeros.
 * Ends the test program when memory is exhausted. */
lcp_case lcp_case_dense(const lcp_ref *d, int keep_zeros);
void lcp_case_free(lcp_case *c);

typedef enum lcp_kind {
    LCP_QP,       /* F = 0 */
    LCP_MONOTONE, /* -F = B'B + skew */
    LCP_GENERAL   /* F random: may have several solutions */
} lcp_kind;

/* Random sparse problem with a strictly complementary solution in c.at: half of the z_i positive
 * (at most n_x - n_eq of them), all positive numbers in [0.5, 2); M = B'B + 0.5 I of `density`. */
lcp_case lcp_case_planted(rng *r, int n_x, int n_ineq, int n_eq, double density, lcp_kind kind);

/* max over equations and pairs, absolute: |M x + A'y + G'z + q|, |A x - b|, |G x + F z + s - m|,
 * |min(s, z)|; written apart from the library. */
double lcp_case_error(const carom_lcp_problem *p, const carom_lcp_point *at);

/* A point with zeroed arrays of the problem's sizes; one block, freed through `x`. */
carom_lcp_point lcp_point_new(const carom_lcp_problem *p);

#endif
