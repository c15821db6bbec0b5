/* certify.h: a certificate that the linear part of a mixed LCP has no point.
 *
 *   M x + A'y + G'z + q = 0,  A x = b,  G x + F z + s = m,  s, z >= 0
 *
 * has none when there are (u, v, w) with
 *
 *   M u + A'v + G'w = 0,  A u = 0,  G u + F'w >= 0,  w >= 0,  -q'u + b'v + m'w < 0   (Farkas).
 *
 * The least-squares residual of the first system is such a triple whenever it is not zero; it comes
 * from a convex LCP of its own, solved by the same method:
 *
 *   min 1/2 (|u|^2 + |v|^2 + |w|^2)   u = M x + A'y + G'z + q,  v = A x - b,  w >= G x + F z - m,
 *                                     z >= 0. */
#ifndef CRM_LCP_CERTIFY_H
#define CRM_LCP_CERTIFY_H

#include "carom/lcp.h"
#include "libgeom/base/memory.h"

typedef struct crm_certifier {
    carom_lcp_problem p;  /* the convex problem; unknowns (x, y, z, u, v, w) */
    carom_lcp_gradient n; /* its numbers */
    carom_lcp_point at;
    carom_lcp *inner;
    int *map_a; /* entries of M, A, A', G', -I -> place in p.A */
    int *map_g; /* entries of G, F, -I, -I -> place in p.G */
    int n_a;
    int n_g;
    double *check; /* n_x + n_eq + n_ineq */
    int *ints;
    size_t n_ints;
    double *reals;
    size_t n_reals;
} crm_certifier;

/* c is zeroed by the caller; destroy accepts a half-built one. */
carom_status crm_certifier_create(crm_certifier *c, crm_memory *memory,
                                  const carom_lcp_problem *pattern);
void crm_certifier_destroy(crm_certifier *c, crm_memory *memory);

/* 1 when p (scaled numbers, the pattern of creation) is shown to have no point: the conditions
 * above hold to 1e-9 of the value, so that no point below 1e9 in scaled units exists. */
int crm_certify(crm_certifier *c, const carom_lcp_problem *p);

#endif
