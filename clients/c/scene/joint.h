/* joint.h: joints of a scene file. */
#ifndef CRM_SCENE_JOINT_H
#define CRM_SCENE_JOINT_H

#include "scene.h"

/* Reads joints[i]; the scene's bodies are there already. */
void crm_joint_read(crm_problems *problems, const crm_node *node, const crm_scene *scene,
                    carom_joint_def *def);

#endif
