/* manifold.h: from the closest features to the contact points. */
#ifndef CRM_MANIFOLD_H
#define CRM_MANIFOLD_H

#include "collide/closest.h"

static inline void crm_clear_point(carom_contact_point *p)
{
    p->arm_a = p->arm_b = crm_vec(0, 0);
    p->gap = 0;
    p->recipe.ref = p->recipe.inc = 0;
    p->recipe.kernel = p->recipe.flipped = p->recipe.at_end = 0;
}

/* Nothing found: count 0 at a distance.
 *
 * Manifolds are returned by value from where they are made, field by field: so a compiler makes
 * them in the caller's memory, without a copy. */
static inline carom_manifold crm_no_contact(double distance)
{
    carom_manifold m;
    m.normal = crm_vec(0, 0);
    m.distance = distance;
    m.count = 0;
    m.ambiguous = 0;
    crm_clear_point(&m.points[0]);
    crm_clear_point(&m.points[1]);
    return m;
}

/* The points of the features (not CRM_APART) within margin; the deepest one whenever the distance
 * itself is within.  When nothing of the other shape is over a face but a vertex by rounding, that
 * vertex. Without a point all but the distance is zero. */
carom_manifold crm_manifold_of(const crm_placed *a, const crm_placed *b, const crm_closest *c,
                               double margin);

/* Closest features of any two placed shapes, circles too. */
void crm_features(const crm_placed *a, const crm_placed *b, double reach, double slack,
                  crm_closest *out);

#endif
