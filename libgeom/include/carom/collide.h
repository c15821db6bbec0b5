/* collide.h: distance, normal and contact points of two convex shapes, and their derivatives.
 *
 * The normal is a unit vector from A to B.  Gaps are positive apart and negative overlapping.
 * All results are relative to the bodies' positions (arms), so a scene far from the origin loses
 * nothing: world point on A = (pose_a.x, pose_a.y) + arm_a. */
#ifndef CAROM_COLLIDE_H
#define CAROM_COLLIDE_H

#include "carom/shape.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum carom_kernel {
    CAROM_POINT_POINT, /* EQUATIONS (41): vertex `ref` of A, vertex `inc` of B */
    CAROM_EDGE_VERTEX, /* (42): edge `ref` of the reference shape, vertex `inc` of the other */
    CAROM_EDGE_CLIPPED /* (42) after (43): edge `inc` of the other shape, clipped at an end of `ref`
                        */
} carom_kernel;

/* How a contact point is computed: all that its derivative needs.  Edge k runs from vertex k to
 * k + 1 (cyclic); its normal is on the right.  A capsule has two edges, 0 and 1, back to back.
 * Also the point's stable identity across steps. */
typedef struct carom_recipe {
    int ref;
    int inc;
    unsigned char kernel;  /* carom_kernel */
    unsigned char flipped; /* 1: the reference edge belongs to B */
    unsigned char at_end;  /* clipped: 0 at the start of the reference edge, 1 at its end */
} carom_recipe;

typedef struct carom_contact_point {
    carom_vec2 arm_a; /* contact point on A - position of A, world axes [m] */
    carom_vec2 arm_b; /* contact point on B - position of B, world axes [m] */
    double gap;       /* [m] */
    carom_recipe recipe;
} carom_contact_point;

typedef struct carom_manifold {
    carom_vec2 normal; /* unit, from A to B; common to all points */
    double distance; /* signed distance of the shapes [m]; a lower bound > margin when count = 0 */
    int count;       /* 0, 1 or 2 */
    int ambiguous;   /* 1: another reference face is as good within rounding, or centers coincide */
    carom_contact_point points[2]; /* with gap <= margin */
} carom_manifold;

/* Contact manifold of two valid shapes.  margin [m] >= 0, or HUGE_VAL for points at any gap.
 *
 * Let the cores be the shapes without their radii.  Apart, closest at two vertices: one point, the
 * normal along the line between them.  Otherwise the reference is the closest face (overlapping:
 * the face of largest separation; ties go to A, then to the lowest index), the normal is its
 * normal, and the points are the ends of the other shape's opposite edge, clipped at the planes
 * through the ends of the reference edge.  distance = signed distance of the cores - both radii.
 * Concentric circles have the normal (1, 0) and are ambiguous. */
CAROM_API carom_manifold carom_collide(const carom_shape *a, carom_pose pose_a,
                                       const carom_shape *b, carom_pose pose_b, double margin);

/* A pose with its rotation worked out: once per body instead of once per pair. */
typedef struct carom_frame {
    double x; /* [m] */
    double y; /* [m] */
    double cos;
    double sin;
} carom_frame;

CAROM_API carom_frame carom_frame_at(carom_pose pose);

/* What one pair remembers from one call to the next.  All zero: nothing; to be zeroed when the
 * vertices of either shape change. */
typedef struct carom_pair_cache {
    int kind;
    int a;
    int b;
    double slack;     /* how far B may move until a proof ends [m] */
    double reach;     /* [m] */
    carom_frame pose; /* of B seen from A, at the proof */
} carom_pair_cache;

/* carom_collide from frames.  cache (may be NULL) is read and written; it saves time and changes
 * nothing, bit for bit, but the bound given as distance with count = 0. */
CAROM_API carom_manifold carom_collide_frames(const carom_shape *a, const carom_frame *frame_a,
                                              const carom_shape *b, const carom_frame *frame_b,
                                              double margin, carom_pair_cache *cache);

/* The point and normal that a recipe gives at these poses (no search).  recipe: from carom_collide
 * on shapes with the same numbers of vertices.  Where the formula has no value (two vertices at one
 * place, an incident edge square to the reference edge) the normal is (1, 0), or the clipped point
 * the start of its edge, and derivatives hold that fixed. */
CAROM_API carom_contact_point carom_contact_eval(const carom_shape *a, carom_pose pose_a,
                                                 const carom_shape *b, carom_pose pose_b,
                                                 carom_recipe recipe, carom_vec2 *normal);

/* Cotangent of one contact point. */
typedef struct carom_contact_bar {
    carom_vec2 normal;
    carom_vec2 arm_a;
    carom_vec2 arm_b;
    double gap;
} carom_contact_bar;

/* Cotangent of one posed shape; vertices (count of them) may be NULL. */
typedef struct carom_shape_bar {
    carom_pose pose;
    double radius;
    carom_vec2 *vertices;
} carom_shape_bar;

/* Reverse derivative of carom_contact_eval: ADDS to *a_bar and *b_bar the gradient of
 * <bar, (normal, arm_a, arm_b, gap)> with respect to both poses, radii and vertices. */
CAROM_API void carom_contact_vjp(const carom_shape *a, carom_pose pose_a, const carom_shape *b,
                                 carom_pose pose_b, carom_recipe recipe,
                                 const carom_contact_bar *bar, carom_shape_bar *a_bar,
                                 carom_shape_bar *b_bar);

/* Tangent of one posed shape; vertices (count of them) may be NULL: they rest. */
typedef struct carom_shape_dot {
    carom_pose pose;
    double radius;
    const carom_vec2 *vertices;
} carom_shape_dot;

/* Tangent of one contact point. */
typedef struct carom_contact_dot {
    carom_vec2 normal;
    carom_vec2 arm_a;
    carom_vec2 arm_b;
    double gap;
} carom_contact_dot;

/* Forward derivative of carom_contact_eval: the transpose of carom_contact_vjp. */
CAROM_API carom_contact_dot carom_contact_jvp(const carom_shape *a, carom_pose pose_a,
                                              const carom_shape *b, carom_pose pose_b,
                                              carom_recipe recipe, const carom_shape_dot *a_dot,
                                              const carom_shape_dot *b_dot);

#ifdef __cplusplus
}
#endif
#endif
