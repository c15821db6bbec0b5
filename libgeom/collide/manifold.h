/* manifold.h: from the closest features to the contact points. */
#ifndef CRM_MANIFOLD_H
#define CRM_MANIFOLD_H

#include "collide/closest.h"

/* Nothing found: count 0 at a distance. */
carom_manifold crm_no_contact(double distance);

/* The points of the features, whatever their gaps; count and distance are set, not CRM_APART.  When
 * nothing of the other shape is over a face but a vertex by rounding, that vertex. */
carom_manifold crm_manifold_of(const crm_placed *a, const crm_placed *b, const crm_closest *c);

/* Keeps the points within the margin; the deepest one whenever the distance itself is within. */
void crm_keep_within(carom_manifold *m, double margin);

/* Closest features of any two placed shapes, circles too. */
crm_closest crm_features(const crm_placed *a, const crm_placed *b, double reach);

#endif
