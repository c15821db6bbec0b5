/* closest.h: signed distance of the cores (shapes without their radii) and the features that give
 * it.  The core of a circle is its center, of a capsule a segment with two edges back to back. */
#ifndef CRM_CLOSEST_H
#define CRM_CLOSEST_H

#include "collide/few/lanes.h"
#include "collide/placed.h"

typedef enum crm_closest_kind {
    CRM_VERTICES, /* vertex `a` of A, vertex `b` of B */
    CRM_FACE_A,   /* edge `a` of A, vertex `b` of B */
    CRM_FACE_B,   /* vertex `a` of A, edge `b` of B */
    CRM_APART     /* clearly farther than the reach; `gap` is a lower bound */
} crm_closest_kind;

typedef struct crm_closest {
    crm_closest_kind kind;
    int a;
    int b;
    int tied;          /* another face is as good within rounding */
    double gap;        /* signed distance of the cores [m] */
    double lead;       /* of a swept face over the next best one, at least [m] */
    crm_reference ref; /* faces: the edge */
    carom_vec2 x;      /* faces: from the start of the edge to the other's vertex */
} crm_closest;

/* Distances below this are rounding [1], times the coordinates they come from [m]. */
#define CRM_NEAR_TOL 2e-14

/* Heights of faces that differ by less are tied [1], times the coordinates [m]. */
#define CRM_TIE_TOL 1e-14

/* ... and of the bodies' positions from each other [1], times that distance [m]: vertices at the
 * bodies' origins have no coordinates, and yet are turned and subtracted. */
#define CRM_FAR_TOL 2e-15

/* From one body's position to the other's, summed over the axes [m]. */
static inline double crm_spread(const crm_placed *a, const crm_placed *b)
{
    const carom_vec2 d = crm_sub(b->at, a->at);
    return fabs(d.x) + fabs(d.y);
}

/* What rounding may add to a distance between these vertices. */
static inline double crm_noise(const crm_placed *p, int i, const crm_placed *q, int j)
{
    const carom_vec2 a = p->v[i];
    const carom_vec2 b = q->v[j];
    return CRM_NEAR_TOL * (fabs(a.x) + fabs(a.y) + fabs(b.x) + fabs(b.y)) +
           CRM_FAR_TOL * crm_spread(p, q);
}

/* The size of a core's coordinates, by two vertices far from each other [m]. */
static inline double crm_core_coordinates(const crm_placed *p)
{
    const crm_lanes a = crm_lanes_abs(crm_lanes_load(&p->v[0].x));
    const crm_lanes b = crm_lanes_abs(crm_lanes_load(&p->v[p->n >> 1].x));
    const crm_lanes sum = crm_lanes_add(a, b);
    const double x = 0.5 * (crm_lanes_first(sum) + crm_lanes_second(sum));
    return x > p->radius ? x : p->radius;
}

static inline double crm_coordinates(const crm_placed *a, const crm_placed *b)
{
    const double x = crm_core_coordinates(a);
    const double y = crm_core_coordinates(b);
    return x > y ? x : y;
}

/* Faces whose heights differ by less are tied [m]. */
static inline double crm_tie(const crm_placed *a, const crm_placed *b)
{
    return CRM_TIE_TOL * crm_coordinates(a, b);
}

/* What is clearly farther than reach: what is just within is for the distance itself to decide. */
static inline double crm_beyond(double reach, double tie)
{
    return reach * (1 + 2 * CRM_FAR_TOL) + tie;
}

/* Edge `edge` of p, vertex j of q; on_b: p is B.  Not tied, no lead. */
static inline void crm_face_at(const crm_placed *p, int edge, const crm_placed *q, int j, int on_b,
                               crm_closest *out)
{
    out->kind = on_b ? CRM_FACE_B : CRM_FACE_A;
    out->a = on_b ? j : edge;
    out->b = on_b ? edge : j;
    out->tied = 0;
    out->lead = 0;
    out->ref = crm_reference_at(p, edge);
    out->x = crm_between(p, edge, q, j);
    out->gap = crm_dot(out->ref.m, out->x);
}

/* Vertex j of q is lower along d (of the given length) than its neighbors by more than rounding:
 * any search finds that one. */
static inline int crm_is_lowest(const crm_placed *q, int j, carom_vec2 d, double length)
{
    if (q->n == 1) return 1;
    const carom_vec2 u = crm_turn_back(q, d);
    const carom_vec2 v = q->v[j];
    const carom_vec2 w = q->v[crm_next(q, j)];
    const carom_vec2 x = q->v[crm_prev(q, j)];
    const double size = fabs(v.x) + fabs(v.y);
    const double tol = CRM_NEAR_TOL * length;
    const double ahead = crm_dot(u, crm_sub(w, v));
    const double back = crm_dot(u, crm_sub(x, v));
    return (ahead > tol * (size + fabs(w.x) + fabs(w.y))) &
           (back > tol * (size + fabs(x.x) + fabs(x.y)));
}

/* Apart, at a face: its vertex is clearly the lowest and its foot clearly inside the edge.  Any
 * walk ends there. */
static inline int crm_face_is_closest(const crm_placed *p, int edge, const crm_placed *q, int j,
                                      const crm_closest *c)
{
    const double tol = crm_noise(p, edge, q, j);
    const double along = crm_dot(c->ref.t, c->x);
    return (c->gap > tol) & (along > tol) & (along < c->ref.length - tol) &&
           crm_is_lowest(q, j, c->ref.m, 1.0);
}

/* Vertices i of A and j of B.  1: apart, and the line between them is clearly inside both cones:
 * any walk ends there. */
static inline int crm_vertices_are_closest(const crm_placed *a, int i, const crm_placed *b, int j,
                                           crm_closest *out)
{
    const carom_vec2 w = crm_between(a, i, b, j);
    out->kind = CRM_VERTICES;
    out->a = i;
    out->b = j;
    out->tied = 0;
    out->lead = 0;
    out->gap = crm_length(w);
    return out->gap > crm_noise(a, i, b, j) && crm_is_lowest(b, j, w, out->gap) &&
           crm_is_lowest(a, i, crm_neg(w), out->gap);
}

/* The foot of the face's vertex is on its edge, or the other core's edge at that vertex lies along
 * the face within tol and reaches over it. */
int crm_foot_is_on(const crm_placed *p, int edge, const crm_placed *q, int j, double tol);

/* The parts, in closest.c, walk.c, sweep.c and gjk.c. --------------------------------------- */

/* A direction d with its support vertices: certified when d . (b - a) > 0, for then the line across
 * d separates the cores. */
typedef struct crm_axis {
    carom_vec2 d;
    int a;
    int b;
} crm_axis;

/* From a certified axis to the closest features (docs/math/equations.md, end of section 5): kind,
 * a, b and tied of *out.  0: not found, the certificate was rounding. */
int crm_walk(const crm_placed *a, const crm_placed *b, crm_axis from, crm_closest *out);

/* The face of largest separation, O(n_a + n_b); the distance when the cores overlap.  Of the faces
 * within 1e-14 of the coordinates of that, the first with a foot on it is taken, A's before B's. x:
 * any axis with its support vertices, to begin with.  CRM_APART: a face separates by more than
 * reach.  Not both may be points. */
void crm_sweep(const crm_placed *a, const crm_placed *b, const crm_axis *x, double reach,
               double slack, crm_closest *out);

/* libccd's GJK.  1: it says disjoint and *axis is its last direction with our support vertices, yet
 * to be certified by the caller. */
int crm_gjk(const crm_placed *a, const crm_placed *b, carom_vec2 first, crm_axis *axis);

/* ------------------------------------------------------------------------------------------- */

/* Pairs with fewer vertices skip GJK.  A setting of speed: the answer does not depend on it.
 * bench_gjk: below this GJK gains nothing apart and costs up to 1.9 times overlapping. */
enum { CRM_GJK_MIN_VERTICES = 1024 };

/* reach [m]: give up (CRM_APART) when farther; HUGE_VAL: never.  slack: see crm_sweep.  Not both
 * may be points. */
typedef struct crm_search {
    double reach;
    double slack;
    int gjk_min_vertices;
} crm_search;

/* The same where neither core has more than four, or CRM_FEW, vertices; without a start; the lead
 * when there is a slack.  tie: crm_tie(a, b).  With AVX2 (CRM_AVX2: compiled in) they give the same
 * bits. */
enum { CRM_FEW = 8 };
typedef void crm_sweep_function(const crm_placed *a, const crm_placed *b, double tie,
                                const crm_search *how, crm_closest *out);
crm_sweep_function crm_sweep_four;
crm_sweep_function crm_sweep_eight;
crm_sweep_function crm_sweep_four_avx2;
crm_sweep_function crm_sweep_eight_avx2;

void crm_closest_features(const crm_placed *a, const crm_placed *b, const crm_search *how,
                          crm_closest *out);

/* The same from an axis that may or may not be certified, when it leads there; 0: it does not, and
 * *out is not touched. */
int crm_closest_from(const crm_placed *a, const crm_placed *b, crm_axis x, double reach,
                     crm_closest *out);

#endif
