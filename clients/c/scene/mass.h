/* mass.h: mass and inertia of a body from its shapes. */
#ifndef CRM_SCENE_MASS_H
#define CRM_SCENE_MASS_H

#include "scene.h"

/* Moments of the shapes of one body about its position, at density 1; overlaps count twice. */
typedef struct crm_moments {
    double area;         /* [m^2] */
    carom_vec2 centroid; /* [m] */
    double second;       /* int |x|^2 dA [m^4] */
    double extent;       /* largest distance of a surface point from the position, at most [m] */
} crm_moments;

crm_moments crm_body_moments(const carom_body_def *def);

/* Squared radius of gyration of the shapes about the position [m^2]: inertia = mass * this.  A lone
 * segment has the one of a thin rod.  0: there is no shape with an extent. */
double crm_body_gyration(const carom_body_def *def);

/* Sets the numbers of def that follow from its shapes: inertia from the mass, or both from the
 * density; nothing when the file gives both. */
void crm_body_follow(crm_scene_body *body);

/* crm_body_follow, with a fault where the shapes do not give what the file leaves to them. */
void crm_body_mass(crm_problems *problems, const crm_node *node, crm_scene_body *body);

#endif
