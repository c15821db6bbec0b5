/* lcp.h: the general sparse mixed linear complementarity problem, its adjoint and its tangent.
 *
 *   M x + A'y + G'z + q = 0
 *   A x = b
 *   G x + F z + s = m,    s >= 0,  z >= 0,  s_i z_i = 0
 *
 * (docs/math/equations.md (8).)  M: n_x x n_x, symmetric positive semidefinite, both triangles
 * stored.  A: n_eq x n_x.  G: n_ineq x n_x.  F: n_ineq x n_ineq.  With F = 0 this is a convex
 * quadratic program; -F positive semidefinite keeps it monotone; any other F (friction) is solved
 * as far as the method goes, and the status says whether it did.  Any of the three counts may be
 * zero.  This part of the library exists when it was built with CAROM_WITH_KLU. */
#ifndef CAROM_LCP_H
#define CAROM_LCP_H

#include "carom/base.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A view of a compressed-column matrix: column j holds the entries col[j] .. col[j + 1] - 1, in any
 * order of rows; entries at the same place add up.  col = NULL: no entries at all. */
typedef struct carom_sparse {
    const int *col;    /* number of columns + 1, col[0] = 0 */
    const int *row;    /* col[last] */
    const double *val; /* col[last] */
} carom_sparse;

/* A view; the caller owns every array. */
typedef struct carom_lcp_problem {
    int n_x;
    int n_ineq;
    int n_eq;
    carom_sparse M;
    carom_sparse A;
    carom_sparse G;
    carom_sparse F;
    const double *q; /* n_x */
    const double *b; /* n_eq */
    const double *m; /* n_ineq */
} carom_lcp_problem;

/* The caller owns the arrays.  An array of no elements may be NULL, here and below. */
typedef struct carom_lcp_point {
    double *x; /* n_x */
    double *s; /* n_ineq */
    double *z; /* n_ineq */
    double *y; /* n_eq */
} carom_lcp_point;

typedef struct carom_lcp_settings {
    double accept;      /* residual of CAROM_OK [1], 0 < accept <= inexact; 1e-10 */
    double inexact;     /* residual of CAROM_INEXACT [1], < 1; 1e-6 */
    int max_iterations; /* interior point iterations per start, >= 1; 60 */
    int max_starts;     /* 1: Mattingley and Boyd's alone; each further one retries; 1..8; 8 */
    int polish_rounds;  /* active sets tried after each start, >= 0; 12 */
    int equilibrate;    /* 0: solve the numbers as given; 1: scale rows and columns first; 1 */
    int certify;        /* 1: look for a proof when nothing is found, at five times the memory; 0 */
} carom_lcp_settings;

CAROM_API carom_lcp_settings carom_lcp_defaults(void);
/* The plain method of the paper: one start, no polish, no scaling; the rest as by default. */
CAROM_API carom_lcp_settings carom_lcp_plain(void);

typedef struct carom_lcp_stats {
    carom_status status;
    double residual;      /* carom_lcp_residual of the result [1] */
    int iterations;       /* interior point, over all starts */
    int starts;           /* starts used */
    int polish_rounds;    /* active sets tried */
    int factorizations;   /* with a search for pivots */
    int refactorizations; /* with the pivots of an earlier one */
} carom_lcp_stats;

/* A solver for one pattern: the symbolic work is done once, at creation. */
typedef struct carom_lcp carom_lcp;

/* pattern: counts and the col and row of the matrices are copied, numbers are not read.
 * settings, allocator: NULL for defaults.  CAROM_E_ARGUMENT: an index out of range, a column that
 * runs backwards, settings out of range.  All memory of ours comes from `allocator`, and all of it
 * here: the other functions request none.  KLU and AMD take theirs from SuiteSparse_config (malloc
 * unless the program changed it), for the factors also during a solve. */
CAROM_API carom_status carom_lcp_create(const carom_lcp_problem *pattern,
                                        const carom_lcp_settings *settings,
                                        const carom_allocator *allocator, carom_lcp **out);
CAROM_API void carom_lcp_destroy(carom_lcp *lcp);
/* Bytes held and number of allocations made so far, without KLU's own. */
CAROM_API void carom_lcp_memory(const carom_lcp *lcp, size_t *bytes, long *calls);

/* Solves a problem of the pattern the solver was created for.  stats may be NULL.
 *   CAROM_OK             residual <= accept
 *   CAROM_INEXACT        residual <= inexact
 *   CAROM_E_NO_SOLUTION  `out` holds the best point found, stats its residual (the one exception to
 *                        "outputs untouched")
 *   CAROM_E_INFEASIBLE   no point fulfills even the linear equations with s, z >= 0, as a Farkas
 *                        certificate shows (settings.certify; docs/lcp.md); `out` as above
 *   CAROM_E_SINGULAR     the linear equations of the method have no solution: x is not determined
 *   CAROM_E_ARGUMENT     a number that is not finite, or M not symmetric to 1e-10
 *   CAROM_E_STATE        another pattern
 * The status comes from the recomputed residual of what is returned, from nothing else. */
CAROM_API carom_status carom_lcp_solve(carom_lcp *lcp, const carom_lcp_problem *problem,
                                       carom_lcp_point *out, carom_lcp_stats *stats);

/* The natural residual of any point [1]: the largest relative error that remains in an equation
 * when of each pair (s_i, z_i) the one that matters less is set to zero; docs/lcp.md gives the
 * formula. It does not depend on the units of rows, of z or of y.  NaN gives HUGE_VAL. */
CAROM_API double carom_lcp_residual(carom_lcp *lcp, const carom_lcp_problem *problem,
                                    const carom_lcp_point *at);

/* What derivatives report. */
typedef struct carom_lcp_derivative {
    double residual; /* relative residual of the linear system [1] */
    int degenerate;  /* pairs with s_i and z_i both zero (1e-9 of their scale) */
    int singular;    /* 1: the linear system is singular but has a solution; see below */
} carom_lcp_derivative;

/* Cotangents of the solution; NULL: zero. */
typedef struct carom_lcp_cotangent {
    const double *x; /* n_x */
    const double *z; /* n_ineq */
    const double *y; /* n_eq */
} carom_lcp_cotangent;

/* Gradients or directions of the data; the arrays of M, A, G, F run parallel to the val of the
 * problem's matrices.  NULL: not wanted (gradient), zero (direction). */
typedef struct carom_lcp_gradient {
    double *M;
    double *A;
    double *G;
    double *F;
    double *q;
    double *b;
    double *m;
} carom_lcp_gradient;

typedef struct carom_lcp_direction {
    const double *M; /* symmetric: both triangles move alike */
    const double *A;
    const double *G;
    const double *F;
    const double *q;
    const double *b;
    const double *m;
} carom_lcp_direction;

/* Adjoint at a solution, docs/math/equations.md (10)-(11): OVERWRITES the wanted arrays of
 * `gradient` with the derivatives of <x_bar, x> + <z_bar, z> + <y_bar, y>.  The gradient of M is
 * symmetric: its inner product with a symmetric dM is the change of the loss.
 *
 * The active set {i: z_i > s_i}, scaled, is held; a pair with z_i = s_i = 0 counts as inactive (z_i
 * stays zero): a one-sided derivative, counted in `degenerate`.  Redundant constraints make the
 * equations singular.  As long as they have a solution for the cotangent asked for (always so for
 * x_bar when x is unique), it is found and `singular` is set; otherwise, when the loss depends on
 * what the problem does not determine, CAROM_E_SINGULAR.  CAROM_E_ARGUMENT also when `at` is not a
 * solution (residual > inexact).  info may be NULL. */
CAROM_API carom_status carom_lcp_adjoint(carom_lcp *lcp, const carom_lcp_problem *problem,
                                         const carom_lcp_point *at,
                                         const carom_lcp_cotangent *cotangent,
                                         carom_lcp_gradient *gradient, carom_lcp_derivative *info);

/* Tangent at a solution: (dx, dz, dy) for a direction of the data, same conventions.  Any of the
 * outputs may be NULL. */
CAROM_API carom_status carom_lcp_tangent(carom_lcp *lcp, const carom_lcp_problem *problem,
                                         const carom_lcp_point *at,
                                         const carom_lcp_direction *direction, double *dx,
                                         double *dz, double *dy, carom_lcp_derivative *info);

#ifdef __cplusplus
}
#endif
#endif
