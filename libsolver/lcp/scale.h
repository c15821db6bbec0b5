/* scale.h: the equilibrated problem.
 *
 *   x = V D_x x^,  s = V D_z^-1 s^,  z = V D_z z^,  y = V D_y y^
 *   M^ = D_x M D_x,  A^ = D_y A D_x,  G^ = D_z G D_x,  F^ = D_z F D_z
 *   q^ = D_x q / V,  b^ = D_y b / V,  m^ = D_z m / V
 *
 * All factors are powers of two: scaling and its inverse round nothing. */
#ifndef CRM_LCP_SCALE_H
#define CRM_LCP_SCALE_H

#include "carom/lcp.h"

typedef struct crm_scale {
    double V;
    double *x; /* n_x: D_x */
    double *z; /* n_ineq: D_z */
    double *y; /* n_eq: D_y */
} crm_scale;

/* Row norms of K = [M G' A'; G F 0; A 0 0] toward 1 by the symmetric iteration of Ruiz, F with its
 * rows and columns; V: max(|q^|, |b^|, |m^|) toward 1.  wanted = 0: all factors 1.  norm: scratch,
 * n_x + n_ineq + n_eq. */
void crm_scale_find(const carom_lcp_problem *p, int wanted, double *norm, crm_scale *d);

/* The numbers of the scaled problem, arrays as in carom_lcp_gradient, from those of p. */
void crm_scale_problem(const carom_lcp_problem *p, const crm_scale *d,
                       const carom_lcp_gradient *to);

/* Points from and to scaled coordinates; `to` may not overlap `from`. */
void crm_scale_point(const carom_lcp_problem *p, const crm_scale *d, const carom_lcp_point *from,
                     carom_lcp_point *to);
void crm_unscale_point(const carom_lcp_problem *p, const crm_scale *d, const carom_lcp_point *from,
                       carom_lcp_point *to);

#endif
