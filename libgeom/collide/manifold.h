/* manifold.h: from the closest features to the contact points. */
#ifndef CRM_MANIFOLD_H
#define CRM_MANIFOLD_H

#include "collide/closest.h"

/* Nothing found: count 0 at a distance. */
carom_manifold crm_no_contact(double distance);

/* The points of the features (not CRM_APART) within margin; the deepest one whenever the distance
 * itself is within.  When nothing of the other shape is over a face but a vertex by rounding, that
 * vertex. Without a point all but the distance is zero. */
void crm_manifold_of(const crm_placed *a, const crm_placed *b, const crm_closest *c, double margin,
                     carom_manifold *out);

/* Closest features of any two placed shapes, circles too. */
void crm_features(const crm_placed *a, const crm_placed *b, double reach, double slack,
                  crm_closest *out);

#endif
