/* engine.h: the scene of a session in motion.  The only files that call the physics are engine*.c.
 *
 * Text: every function that can fail writes one sentence, terminated, of at most CRM_TEXT bytes. */
#ifndef CRM_ENGINE_H
#define CRM_ENGINE_H

#include "carom/grad.h"
#include "carom_loss_gradient_t.h"
#include "carom_parameter_gradient_t.h"
#include "carom_scene_t.h"
#include "carom_state_t.h"

#include <stdint.h>

enum { CRM_TEXT = 256, CRM_MAX_SNAPSHOTS = 16 };

typedef struct crm_engine crm_engine;

typedef enum crm_record { CRM_RECORD_OFF, CRM_RECORD_ON, CRM_RECORD_RESTART } crm_record;

/* Builds the world of a decoded scene; the engine keeps a copy of the scene.  The allocator must
 * outlive the engine. */
carom_status crm_engine_create(const carom_scene_t *scene, carom_allocator allocator, char *text,
                               crm_engine **out);
void crm_engine_destroy(crm_engine *engine);

int crm_engine_n_bodies(const crm_engine *engine);
/* Steps since the scene was opened. */
int64_t crm_engine_step_count(const crm_engine *engine);
/* Step at which the tape starts (the present one without tape), and steps on it. */
int64_t crm_engine_first_step(const crm_engine *engine);
int crm_engine_recorded(const crm_engine *engine);

/* Called before the steps of a request. */
carom_status crm_engine_record(crm_engine *engine, crm_record record, char *text);
/* One step.  force: 3 per body, NULL: none beyond the constant ones. */
carom_status crm_engine_advance(crm_engine *engine, const double *force, char *text);
/* Fills a message with the present state and the figures of the last step, except the header; the
 * arrays belong to the engine and hold until it changes. */
carom_status crm_engine_state(crm_engine *engine, int want, carom_state_t *state);

/* The gradient of the loss over the tape; arrays belong to the engine until its next gradient. */
carom_status crm_engine_gradient(crm_engine *engine, const carom_loss_gradient_t *loss, char *text,
                                 carom_parameter_gradient_t *out);
/* Parameters -= rate * gradient, projected; builds the world anew.  Unchanged on an error. */
carom_status crm_engine_descend(crm_engine *engine, const carom_parameter_gradient_t *descent,
                                char *text);
/* The scene as it is now. */
const carom_scene_t *crm_engine_scene(const crm_engine *engine);

carom_status crm_engine_snapshot(crm_engine *engine, int number, char *text);
carom_status crm_engine_restore(crm_engine *engine, int number, char *text);
/* Step 0 of the present scene. */
carom_status crm_engine_reset(crm_engine *engine, char *text);

#endif
