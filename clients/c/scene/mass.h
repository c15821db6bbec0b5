/* mass.h: mass and inertia of a body from its shapes. */
#ifndef CRM_SCENE_MASS_H
#define CRM_SCENE_MASS_H

#include "scene.h"

/* Of the shapes of a body. */
carom_moments crm_body_moments(const carom_body_def *def);

/* Squared radius of gyration of the shapes about the position [m^2]: inertia = mass * this.  A lone
 * segment has the one of a thin rod.  0: there is no shape with an extent. */
double crm_body_gyration(const carom_body_def *def);

/* Sets the numbers of def that follow from its shapes: inertia from the mass, or both from the
 * density; nothing when the file gives both. */
void crm_body_follow(crm_scene_body *body);

/* crm_body_follow, with a fault where the shapes do not give what the file leaves to them. */
void crm_body_mass(crm_problems *problems, const crm_node *node, crm_scene_body *body);

#endif
