/* scene.h: a scene file, "carom-scene/1", as plain structs.  docs/scene.md is its manual. */
#ifndef CRM_SCENE_H
#define CRM_SCENE_H

#include "carom/world.h"
#include "json.h"

/* The row of a force table: from `time` on, until the next row. */
typedef struct crm_force_row {
    double time;     /* [s] */
    double force[3]; /* (torque, fx, fy) [N m, N, N] */
} crm_force_row;

typedef struct crm_scene_body {
    const char *name;   /* view into the file; NULL: none */
    carom_body_def def; /* shapes and their vertices belong to the scene */
    double density;     /* [kg/m^2] when has_density */
    int has_mass;
    int has_inertia;
    int has_density;
    int n_rows;
    crm_force_row *rows; /* the table, times increasing */
} crm_scene_body;

typedef struct crm_scene {
    const char *name;
    carom_world_settings settings; /* dt and gravity included */
    double duration;               /* [s]; < 0: not given */
    double sample;                 /* [s]; < 0: every step */
    int n_bodies;
    crm_scene_body *bodies;
    int n_joints;
    carom_joint_def *joints; /* at the initial poses */
    json_t *json;            /* what the views point into */
} crm_scene;

/* Reads problems->file.  NULL when anything is wrong: every fault is then in problems. */
crm_scene *crm_scene_read(crm_problems *problems);
void crm_scene_free(crm_scene *scene);

/* One shape of the file ({"type": "circle", ...}) with vertices of its own; faults are noted.  1
 * when it is valid.  Free with crm_shape_free in either case. */
int crm_shape_read(crm_problems *problems, const crm_node *node, carom_shape *shape);
void crm_shape_free(carom_shape *shape);

/* Moves one anchor of one joint in the frame of its body, away from the world point of the file. */
typedef struct crm_anchor_shift {
    int joint;
    int of_body_b; /* 0: the anchor in the frame of body A, 1: of body B */
    carom_vec2 by; /* body frame [m] */
} crm_anchor_shift;

/* The world of the scene, not sealed; shift may be NULL.  On a negative status *out is NULL and
 * `why` says what is wrong in words, always terminated. */
carom_status crm_scene_world(const crm_scene *scene, const crm_anchor_shift *shift,
                             carom_world **out, char *why, size_t size);

/* Mean of the force tables over [t, t + dt], written to force (3 n_bodies).  0: no body has a table
 * and force is not written.  The mean keeps impulses exact where a row starts within a step. */
int crm_scene_force(const crm_scene *scene, double t, double dt, double *force);

/* Gradient with respect to the numbers of the file.  On input mass and inertia are the partial
 * derivatives of the stored numbers; where the file leaves inertia (or both) to the shape, `mass`
 * receives its share through inertia, `radius` and `vertices` theirs through both.  radius: one per
 * shape, vertices: one per vertex, of all bodies in order; each may be NULL. */
void crm_scene_chain(const crm_scene *scene, double *mass, const double *inertia, double *radius,
                     carom_vec2 *vertices);

#endif
