/* manifold.h: from the closest features to the contact points. */
#ifndef CRM_MANIFOLD_H
#define CRM_MANIFOLD_H

#include "carom/collide.h"
#include "collide/closest.h"

/* Nothing found: count 0 at a distance. */
carom_manifold crm_no_contact(double distance);

/* Edge k of p, vertex j of q closest to it: writes one or two recipes; flipped: p is B.  When
 * nothing of q is over k but a vertex by rounding, the recipe of that vertex. */
int crm_face_recipes(const crm_placed *p, int k, const crm_placed *q, int j, int flipped,
                     carom_recipe out[2]);

/* The points of the features, whatever their gaps; count and distance are set, not CRM_APART. */
carom_manifold crm_manifold_of(const crm_placed *a, const crm_placed *b, const crm_closest *c);

/* Keeps the points within the margin; the deepest one whenever the distance itself is within. */
void crm_keep_within(carom_manifold *m, double margin);

/* Closest features of any two placed shapes, circles too. */
crm_closest crm_features(const crm_placed *a, const crm_placed *b, double reach);

#endif
