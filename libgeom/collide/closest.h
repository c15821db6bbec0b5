/* closest.h: signed distance of the cores (shapes without their radii) and the features that give
 * it.  The core of a circle is its center, of a capsule a segment with two edges back to back. */
#ifndef CRM_CLOSEST_H
#define CRM_CLOSEST_H

#include "collide/placed.h"

typedef enum crm_closest_kind {
    CRM_VERTICES, /* vertex `a` of A, vertex `b` of B */
    CRM_FACE_A,   /* edge `a` of A, vertex `b` of B */
    CRM_FACE_B,   /* vertex `a` of A, edge `b` of B */
    CRM_APART     /* farther than the reach; `gap` is a lower bound */
} crm_closest_kind;

typedef struct crm_closest {
    crm_closest_kind kind;
    int a;
    int b;
    int tied;          /* another face is as good within rounding */
    double gap;        /* signed distance of the cores [m] */
    crm_reference ref; /* faces: the edge */
} crm_closest;

/* What rounding may add to a distance between these vertices. */
double crm_noise(const crm_placed *a, int i, const crm_placed *b, int j);

/* Edge `edge` of p, vertex j of q; on_b: p is B. */
crm_closest crm_face_at(const crm_placed *p, int edge, const crm_placed *q, int j, int on_b);

/* The parts, in closest.c, walk.c, sweep.c and gjk.c. --------------------------------------- */

/* A direction d with its support vertices: certified when d . (b - a) > 0, for then the line across
 * d separates the cores. */
typedef struct crm_axis {
    carom_vec2 d;
    int a;
    int b;
} crm_axis;

/* From a certified axis to the closest features (docs/math/equations.md, end of section 5).
 * 0: not found, the certificate was rounding. */
int crm_walk(const crm_placed *a, const crm_placed *b, crm_axis from, crm_closest *out);

/* One core's faces against the other core, in the frame of the first one's body. */
typedef struct crm_side {
    const crm_placed *p;
    const crm_placed *q;
    double cos; /* from q's frame to p's */
    double sin;
    carom_vec2 at; /* q's position */
    int edge;      /* the face tried first, */
    int vertex;    /* q's vertex lowest over it */
    double height; /* and its separation */
} crm_side;

/* Two of the faces at the support vertices of an axis, one of A and one of B, with their heights.
 * Not both may be points. */
void crm_sweep_start(const crm_placed *a, const crm_placed *b, const crm_axis *x, crm_side side[2]);

/* The face of largest separation, O(n_a + n_b); the distance when the cores overlap.  Faces within
 * 1e-14 of the coordinates are tied: the first wins, A's before B's.  CRM_APART: it separates by
 * more than reach. */
crm_closest crm_sweep(const crm_side side[2], double reach);

/* libccd's GJK.  1: it says disjoint and *axis is its last direction with our support vertices, yet
 * to be certified by the caller. */
int crm_gjk(const crm_placed *a, const crm_placed *b, carom_vec2 first, crm_axis *axis);

/* ------------------------------------------------------------------------------------------- */

/* Pairs with fewer vertices skip GJK.  A setting of speed: the answer does not depend on it. */
enum { CRM_GJK_MIN_VERTICES = 24 };

/* reach [m]: give up (CRM_APART) when farther; HUGE_VAL: never.  Not both may be points. */
crm_closest crm_closest_features(const crm_placed *a, const crm_placed *b, double reach,
                                 int gjk_min_vertices);

/* The same from an axis that may or may not be certified, when it leads there; 0: it does not. */
int crm_closest_from(const crm_placed *a, const crm_placed *b, crm_axis x, double reach,
                     crm_closest *out);

#endif
