/* query.h: questions about shapes: how far, what is here, what does a ray or a moving shape hit. */
#ifndef CAROM_QUERY_H
#define CAROM_QUERY_H

#include "carom/broadphase.h"
#include "carom/collide.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Distance of two shapes and a pair of closest points (overlapping: deepest points). */
typedef struct carom_separation {
    double distance;   /* [m], < 0: overlap */
    carom_vec2 normal; /* unit, from A to B */
    carom_vec2 arm_a;  /* point on A - position of A, world axes [m] */
    carom_vec2 arm_b;  /* point on B - position of B, world axes [m] */
} carom_separation;

CAROM_API carom_separation carom_shape_distance(const carom_shape *a, carom_pose pose_a,
                                                const carom_shape *b, carom_pose pose_b);

/* Signed distance of a point from a shape's boundary, < 0 inside.  normal (may be NULL): unit, from
 * the shape to the point, outward inside. */
CAROM_API double carom_point_distance(const carom_shape *shape, carom_pose pose, carom_vec2 point,
                                      carom_vec2 *normal);

/* 1: the shape and the closed box have a point in common; touching within rounding may go either
 * way.  Infinite sides are allowed; a box with a NaN or with lower > upper is empty. */
CAROM_API int carom_box_overlap(const carom_shape *shape, carom_pose pose, const carom_box *box);

/* The part of the segment origin + t translation, 0 <= t <= 1, that is inside a shape. */
typedef struct carom_ray_hit {
    double enter;      /* t; 0 when the origin is inside */
    double leave;      /* t; 1 when the end is inside */
    carom_vec2 normal; /* outward at the entry, zero when the origin is inside */
} carom_ray_hit;

/* 1 and *hit, or 0.  What grazes within rounding may go either way. */
CAROM_API int carom_ray_cast(const carom_shape *shape, carom_pose pose, carom_vec2 origin,
                             carom_vec2 translation, carom_ray_hit *hit);

/* A motion: pose(t) = from + t (to - from), angle included, 0 <= t <= 1. */
typedef struct carom_sweep {
    carom_pose from;
    carom_pose to;
} carom_sweep;

typedef struct carom_cast_hit {
    int hit;             /* 0: the distance stays above the target */
    double t;            /* first time that it does not; 1 without a hit */
    carom_separation at; /* at t */
    int iterations;
} carom_cast_hit;

/* First t at which the distance of two moving shapes is down to target [m]: found from above,
 * at.distance is within 1e-12 of the shapes' reach (farthest point from the body's position) over
 * the target, and never was below it before t.  Already below: t = 0.  CAROM_LIMIT: 10000
 * evaluations were not enough (grazing); up to t there is no hit. */
CAROM_API carom_status carom_shape_cast(const carom_shape *a, carom_sweep motion_a,
                                        const carom_shape *b, carom_sweep motion_b, double target,
                                        carom_cast_hit *out);

#ifdef __cplusplus
}
#endif
#endif
