/* world_query.h: questions about all bodies of a world: how far, what is here, what does a ray or
 * a moving shape hit, what is in a sensor.
 *
 * A query holds a tree of boxes around the world's shapes.  A world that nobody asks pays nothing.
 * Answers are those of trying every shape (carom/query.h), in an order that depends on the world
 * alone.  Nothing is allocated once the lists have grown to their sizes. */
#ifndef CAROM_WORLD_QUERY_H
#define CAROM_WORLD_QUERY_H

#include "carom/query.h"
#include "carom/world.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A view of a world, which must outlive it.  One object, one thread; several queries may look at
 * one world at a time, while it does not step. */
typedef struct carom_query carom_query;

/* Sees nothing before the first refresh.  allocator: NULL for malloc. */
CAROM_API carom_status carom_query_create(const carom_world *world,
                                          const carom_allocator *allocator, carom_query **out);
CAROM_API void carom_query_destroy(carom_query *query);

/* Takes the world's present shapes and poses: to be called after each change that is to be seen,
 * and before the first question after a body was added.  O(shapes), or O(shapes log shapes) when
 * they have moved far since the tree was built.  CAROM_E_MEMORY: the query sees nothing. */
CAROM_API carom_status carom_query_refresh(carom_query *query);

/* Which bodies are found: those that would collide with a body with this filter. */
typedef struct carom_who {
    carom_filter filter; /* category 1, all, no group */
    int sensors;         /* 1: sensors too; 0 */
    int idle;            /* 1: bodies with collide = 0 too; 0 */
    int except;          /* a body that is not found; -1: none */
} carom_who;

CAROM_API carom_who carom_who_defaults(void);

/* In all calls: who NULL: the defaults; lists belong to the query, valid until its next call.
 * shape: a valid shape, or a point (one vertex, radius 0).  Errors: CAROM_E_ARGUMENT (a pose,
 * point or distance that is not finite where it has to be), CAROM_E_SHAPE, CAROM_E_MEMORY. */

/* A shape of a world: shape counts from 0 in its body.  body = -1: none. */
typedef struct carom_found {
    int body;
    int shape;
} carom_found;

typedef struct carom_near {
    carom_found who;
    carom_separation at; /* A: the given shape, B: the one found */
} carom_near;

/* The shape nearest to a given one, of those no farther than within [m] (HUGE_VAL: any); of equals
 * the first in the world.  Overlapping: the deepest. */
CAROM_API carom_status carom_query_nearest(carom_query *query, const carom_who *who,
                                           const carom_shape *shape, carom_pose pose, double within,
                                           carom_near *out);

/* All shapes that contain a point, that have a point in common with a box (carom_box_overlap), or
 * with a shape (distance <= 0), in the order of the world. */
CAROM_API carom_status carom_query_point(carom_query *query, const carom_who *who, carom_vec2 point,
                                         int *n, const carom_found **found);
CAROM_API carom_status carom_query_box(carom_query *query, const carom_who *who,
                                       const carom_box *box, int *n, const carom_found **found);
CAROM_API carom_status carom_query_overlaps(carom_query *query, const carom_who *who,
                                            const carom_shape *shape, carom_pose pose, int *n,
                                            const carom_found **found);

typedef struct carom_ray_found {
    carom_found who;
    carom_ray_hit at;
} carom_ray_found;

/* What the segment origin + t translation, 0 <= t <= 1, enters first; of equals the first in the
 * world. */
CAROM_API carom_status carom_query_ray(carom_query *query, const carom_who *who, carom_vec2 origin,
                                       carom_vec2 translation, carom_ray_found *out);
/* All that it goes through, by t of entry, then in the order of the world. */
CAROM_API carom_status carom_query_ray_all(carom_query *query, const carom_who *who,
                                           carom_vec2 origin, carom_vec2 translation, int *n,
                                           const carom_ray_found **found);

typedef struct carom_cast_found {
    carom_found who;
    carom_cast_hit at; /* A: the given shape, B: the one found */
} carom_cast_found;

/* The first shape that a moving one comes within target [m] >= 0 of (carom_shape_cast; the world
 * rests), and when; of equals the first in the world.  CAROM_LIMIT: a cast that grazes one shape
 * was given up; the result is the first hit of the others. */
CAROM_API carom_status carom_query_cast(carom_query *query, const carom_who *who,
                                        const carom_shape *shape, carom_sweep motion, double target,
                                        carom_cast_found *out);

typedef struct carom_sensor_overlap {
    carom_found sensor;
    carom_found other; /* another sensor: listed once, sensor.body < other.body */
} carom_sensor_overlap;

/* All shapes that overlap (distance <= 0) the shapes of sensors: of bodies that would collide were
 * it no sensor (filters, joints, exclusions), but of two static bodies.  Ordered by sensor, then
 * other.  CAROM_E_STATE: the world is not sealed. */
CAROM_API carom_status carom_query_sensors(carom_query *query, int *n,
                                           const carom_sensor_overlap **overlaps);

#ifdef __cplusplus
}
#endif
#endif
