/* engine_parts.h: what engine*.c share. */
#ifndef CRM_ENGINE_PARTS_H
#define CRM_ENGINE_PARTS_H

#include "base/memory.h"
#include "carom_step_request_t.h"
#include "engine.h"

typedef struct crm_snapshot {
    int number; /* 0: free */
    int64_t step;
    double *state; /* q then v, 6 n_bodies */
} crm_snapshot;

struct crm_engine {
    crm_memory memory;
    carom_scene_t *scene; /* own copy, malloc */
    carom_world *world;
    carom_tape *tape; /* NULL: not recording */
    int64_t step;
    int64_t first_step; /* of the tape */
    double dt;          /* [s] */
    carom_step_stats stats;
    crm_snapshot snapshots[CRM_MAX_SNAPSHOTS];
    /* Contact points as the message wants them: ints is 2 n, reals 7 n. */
    int n_points_max;
    int32_t *point_ints;
    int8_t *point_modes;
    double *point_reals;
    /* Last gradient. */
    size_t n_gradient;
    double *gradient;
};

/* Number of vertices of all shapes. */
static inline int crm_scene_n_vertices(const carom_scene_t *scene)
{
    return scene->num_vertex_coords / 2;
}

/* Checks what relates the arrays of a decoded scene to each other. */
carom_status crm_engine_check_scene(const carom_scene_t *scene, char *text);
/* The sealed world of a scene that passed the check. */
carom_status crm_engine_build(const carom_scene_t *scene, carom_allocator allocator, char *text,
                              carom_world **out);
void crm_engine_forget_tape(crm_engine *engine);

/* Writes the sentence and returns the status. */
carom_status crm_engine_fault(carom_status status, char *text, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

#endif
