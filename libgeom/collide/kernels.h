/* kernels.h: contact points from their recipes, on placed shapes. */
#ifndef CRM_KERNELS_H
#define CRM_KERNELS_H

#include "collide/placed.h"

/* docs/math/equations.md (41)-(43) with a radius on either side. */
carom_contact_point crm_contact_at(const crm_placed *a, const crm_placed *b, carom_recipe recipe,
                                   carom_vec2 *normal);

/* The same for a recipe with a reference edge, which is given. */
carom_contact_point crm_contact_on(const crm_reference *ref, const crm_placed *a,
                                   const crm_placed *b, carom_recipe recipe, carom_vec2 *normal);

#endif
