/* kkt.h: the matrix shared by interior point, polish and derivatives, and its factors by KLU.
 *
 *       [ M    G'          A' ]   x: n_x
 *   K = [ w G  w F - D(v)  0  ]   z: n_ineq      w, v >= 0 per row
 *       [ A    0           0  ]   y: n_eq
 *
 * Row i of z is docs/math/equations.md (10) divided by z_i + s_i: w = z/(z + s), v = s/(z + s). The
 * factored matrix is K + D(r), r = (+rho, -delta, -epsilon) by block; solves refine toward K. */
#ifndef CRM_LCP_KKT_H
#define CRM_LCP_KKT_H

#include "carom/lcp.h"
#include "libgeom/base/memory.h"

#include <klu.h>

typedef struct crm_kkt {
    int n_x;
    int n_ineq;
    int n_eq;
    int n;         /* n_x + n_ineq + n_eq */
    int nnz;       /* duplicates merged */
    int n_entries; /* M, A, A', G, G', F, diagonal */
    int *col;      /* n + 1 */
    int *row;      /* nnz */
    double *val;   /* nnz, of the regularized matrix */
    int *map;      /* n_entries: entry -> position in val */
    double *reg;   /* n: r */
    double *res;   /* n, scratch of refinement */
    double *fix;   /* n, scratch of refinement */
    double *size;  /* n, scratch of refinement */
    int fresh;     /* pivots were chosen for the present values */
    double left;   /* after a solve: max |rhs - K u| / max |rhs| */
    int factorizations;
    int refactorizations;
    klu_common common;
    klu_symbolic *symbolic;
    klu_numeric *numeric;
} crm_kkt;

/* Sizes of the regularization by block [1, of a scaled matrix]. */
typedef struct crm_kkt_reg {
    double x;
    double z;
    double y;
} crm_kkt_reg;

/* k is zeroed by the caller; destroy accepts a half-built one. */
carom_status crm_kkt_create(crm_kkt *k, crm_memory *memory, const carom_lcp_problem *pattern);
void crm_kkt_destroy(crm_kkt *k, crm_memory *memory);

/* Drops the factors: what follows depends on no earlier call. */
void crm_kkt_forget(crm_kkt *k);

/* Values of K + D(r) for the numbers of p (same pattern) and row weights w, v: n_ineq each. */
void crm_kkt_assemble(crm_kkt *k, const carom_lcp_problem *p, const double *w, const double *v,
                      crm_kkt_reg reg);

/* Factors with the pivots at hand while they serve, else with new ones.  CAROM_E_SINGULAR,
 * CAROM_E_MEMORY. */
carom_status crm_kkt_factor(crm_kkt *k);

/* u <- u + (K + D(r))^-1 (rhs - K u), repeated until the residual stops falling, at most `rounds`
 * times; transposed: with K' instead of K.  u holds the start, rhs is kept.  Returns
 * max |rhs - K u| / max (|rhs| + |K| |u|), 0 when both are zero, HUGE_VAL when not finite. */
double crm_kkt_solve(crm_kkt *k, int transposed, int rounds, const double *rhs, double *u);

/* Estimate of the condition number of the factored matrix, 1-norm; HUGE_VAL when singular. */
double crm_kkt_condition(crm_kkt *k);

#endif
