/* body.h: the parts of a scene file that crm_scene_read hands on. */
#ifndef CRM_SCENE_BODY_H
#define CRM_SCENE_BODY_H

#include "scene.h"

/* Reads bodies[i] into *body (zeroed); faults are noted.  Free with crm_body_free in any case. */
void crm_body_read(crm_problems *problems, const crm_node *node, crm_scene_body *body);
void crm_body_free(crm_scene_body *body);

#endif
