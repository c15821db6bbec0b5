/* lcp_ref.h: all solutions of a small dense mixed LCP by enumeration of complementary bases.
 *
 *   M x + A'y + G'z + q = 0,  A x = b,  G x + F z + s = m,  0 <= s _|_ z >= 0
 *
 * (docs/math/equations.md (8)).  Matrices are dense, row after row.  The plain LCP w = Q z + r is
 * n_x = n_eq = 0, F = -Q, m = r, s = w. */
#ifndef SUPPORT_LCP_REF_H
#define SUPPORT_LCP_REF_H

enum { LCP_REF_MAX = 40 }; /* n_x + n_ineq + n_eq at most */

typedef struct lcp_ref {
    int n_x;
    int n_ineq; /* <= 16: 2^n_ineq bases are tried */
    int n_eq;
    const double *M; /* n_x * n_x */
    const double *A; /* n_eq * n_x */
    const double *G; /* n_ineq * n_x */
    const double *F; /* n_ineq * n_ineq */
    const double *q; /* n_x */
    const double *b; /* n_eq */
    const double *m; /* n_ineq */
} lcp_ref;

typedef struct lcp_ref_point {
    double x[LCP_REF_MAX];
    double s[LCP_REF_MAX];
    double z[LCP_REF_MAX];
    double y[LCP_REF_MAX];
} lcp_ref_point;

/* Number of nonsingular bases whose point has s, z >= -tol; their points, at most n_max, go to
 * `out` (may be NULL when n_max = 0).  A degenerate point is found once per basis that holds it.
 * Solutions on singular bases only are not found. */
int lcp_ref_solve(const lcp_ref *p, double tol, int n_max, lcp_ref_point *out);

/* x <- K^-1 x, K n*n dense by rows, destroyed; complete pivoting.  Returns the ratio of the
 * smallest to the largest pivot; 0 when K is singular (x is then meaningless). */
double lcp_ref_linear(int n, double *K, double *x);

#endif
