/* remote.h: a scene file as the C client library takes it. */
#ifndef CRM_SCENE_REMOTE_H
#define CRM_SCENE_REMOTE_H

#include "carom/client.h"
#include "scene.h"

/* The scene with settings as text; arrays belong to it, numbers and shapes to the crm_scene.  Force
 * tables are not part of it: crm_scene_force gives the force of each step. */
carom_client_scene crm_scene_client(const crm_scene *scene);
void crm_scene_client_free(carom_client_scene *scene);

/* Text of one setting as carom_world_settings_set reads it, terminated: a number, or the word where
 * only words are taken.  words: the meaning of the setting in the table, which lists them. */
void crm_setting_text(const char *name, double value, const char *words, char *text, size_t size);

#endif
