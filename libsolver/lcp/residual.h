/* residual.h: linear residuals and the natural residual of a point, docs/lcp.md 3. */
#ifndef CRM_LCP_RESIDUAL_H
#define CRM_LCP_RESIDUAL_H

#include "carom/lcp.h"

/* r_x = M x + A'y + G'z + q, r_z = G x + F z + s - m, r_y = A x - b. */
void crm_linear_residual(const carom_lcp_problem *p, const carom_lcp_point *at, double *rx,
                         double *rz, double *ry);

/* Scratch of crm_natural_residual. */
typedef struct crm_residual_work {
    double *rx;      /* n_x */
    double *rz;      /* n_ineq */
    double *ry;      /* n_eq */
    double *abs_x;   /* n_x */
    double *row_x;   /* n_x: c of docs/lcp.md 3 */
    double *row_z;   /* n_ineq: t */
    double *row_y;   /* n_eq */
    double *weigh_z; /* n_ineq: the z_i that matters */
} crm_residual_work;

/* carom_lcp_residual of the point. */
double crm_natural_residual(const carom_lcp_problem *p, const carom_lcp_point *at,
                            const crm_residual_work *work);

#endif
