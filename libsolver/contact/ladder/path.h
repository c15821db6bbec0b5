/* path.h: parametric pivoting on the natural map, docs/contact.md.
 *
 * With c + t d for c, and closed rows J w + c + t d + compliance (l - l_ref) = 0, the solution is
 * linear in t as long as the modes hold.  Where a condition of a mode is about to fail, that
 * contact takes the adjacent mode and t goes on in the direction that satisfies the new condition:
 * back, if need be, so that turning points are passed as in Lemke's tableau. */
#ifndef CRM_CONTACT_PATH_H
#define CRM_CONTACT_PATH_H

#include "libsolver/contact/ladder/ladder.h"

typedef struct crm_path {
    crm_island *s; /* s->x: the point at t, with its modes in s->mode */
    crm_vec d;     /* n: d_n, t: d_t, z behind the bodies: d_e */
    crm_vec ref;   /* l_ref */
    double compliance;
    double t;
    double most; /* a path that comes up to this t is given up */
} crm_path;

/* Follows the path down to t = 0, in so many changes of mode.  1: reached; s->x is the solution
 * there. */
int crm_path_follow(crm_path *p, int max_pivots);

#endif
