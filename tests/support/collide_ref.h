/* collide_ref.h: signed distance and normal of two shapes in long double, by trying everything. */
#ifndef SUPPORT_COLLIDE_REF_H
#define SUPPORT_COLLIDE_REF_H

#include "carom/collide.h"

enum { COLLIDE_REF_MAX = 512 }; /* vertices of a shape */

/* A shape in the frame of a pair: origin at A's position, world axes. */
typedef struct collide_ref_shape {
    int n;
    long double radius;
    long double x[COLLIDE_REF_MAX];
    long double y[COLLIDE_REF_MAX];
    long double at_x; /* its body's position */
    long double at_y;
} collide_ref_shape;

typedef struct collide_ref {
    long double distance; /* of the shapes */
    long double gap;      /* of the cores */
    long double nx;       /* A to B */
    long double ny;
    long double second; /* cores overlap: the next best face separation, else -HUGE_VALL */
    long double size;   /* largest coordinate relative to the own body, and radius */
} collide_ref;

/* The pair in its frame, positions subtracted exactly. */
void collide_ref_place(const carom_shape *a, carom_pose pose_a, const carom_shape *b,
                       carom_pose pose_b, collide_ref_shape *ra, collide_ref_shape *rb);

collide_ref collide_ref_solve(const collide_ref_shape *a, const collide_ref_shape *b);

/* min_B n.b - max_A n.a - (both radii), n any unit vector: a lower bound of the distance. */
long double collide_ref_support(const collide_ref_shape *a, const collide_ref_shape *b,
                                long double nx, long double ny);

/* Distance of a point of the pair's frame from the outline of a core. */
long double collide_ref_outline(const collide_ref_shape *s, long double x, long double y);

#endif
