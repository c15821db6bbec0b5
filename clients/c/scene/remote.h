/* remote.h: a scene file as the C client library takes it. */
#ifndef CRM_SCENE_REMOTE_H
#define CRM_SCENE_REMOTE_H

#include "carom/client.h"
#include "scene.h"

/* The scene with settings as text; its texts and bodies are its own, joints and shapes the
 * crm_scene's.  Force tables are not part of it.  0: no memory, *out is empty. */
int crm_scene_client(const crm_scene *scene, carom_client_scene *out);
void crm_scene_client_free(carom_client_scene *scene);

/* The forces of the tables in `count` steps from step `start` on, in the order of steps: *n of
 * them; malloc.  0: no memory. */
int crm_scene_forces(const crm_scene *scene, int64_t start, int count, carom_client_force **list,
                     int *n);

/* Text of one setting as carom_world_settings_set reads it, terminated: a number, or the word where
 * only words are taken.  words: the meaning of the setting in the table, which lists them. */
void crm_setting_text(const char *name, double value, const char *words, char *text, size_t size);

#endif
