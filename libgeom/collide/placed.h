/* placed.h: a shape at its place in the frame of a pair: origin at the position of A, world axes.
 *
 * Positions are subtracted before anything is rotated, so a pair far from the origin loses nothing.
 * Vertices are turned one at a time, when asked for: no storage, any number of them. */
#ifndef CRM_PLACED_H
#define CRM_PLACED_H

#include "carom/collide.h"
#include "vec.h"

typedef struct crm_placed {
    const carom_vec2 *v; /* body frame */
    int n;
    double radius;
    double cos;
    double sin;
    carom_vec2 at; /* position of the body - position of A */
} crm_placed;

static inline crm_placed crm_place(const carom_shape *shape, const carom_frame *f, carom_vec2 at)
{
    const crm_placed p = {shape->vertices, shape->count, shape->radius, f->cos, f->sin, at};
    return p;
}

static inline int crm_next(const crm_placed *p, int i)
{
    return i + 1 < p->n ? i + 1 : 0;
}

static inline int crm_prev(const crm_placed *p, int i)
{
    return i ? i - 1 : p->n - 1;
}

/* R u and R' u. */
static inline carom_vec2 crm_turn(const crm_placed *p, carom_vec2 u)
{
    return crm_vec(p->cos * u.x - p->sin * u.y, p->sin * u.x + p->cos * u.y);
}

static inline carom_vec2 crm_turn_back(const crm_placed *p, carom_vec2 u)
{
    return crm_vec(p->cos * u.x + p->sin * u.y, p->cos * u.y - p->sin * u.x);
}

/* Vertex i relative to its own body. */
static inline carom_vec2 crm_arm(const crm_placed *p, int i)
{
    return crm_turn(p, p->v[i]);
}

/* Edge k, from vertex k to the next.  The difference is taken in the body frame, so its direction
 * is good to a rounding however far the edge is from the body's origin. */
static inline carom_vec2 crm_edge(const crm_placed *p, int k)
{
    return crm_turn(p, crm_sub(p->v[crm_next(p, k)], p->v[k]));
}

/* Outward normal of edge k, as long as the edge. */
static inline carom_vec2 crm_normal(const crm_placed *p, int k)
{
    return crm_right(crm_edge(p, k));
}

/* From vertex i of p to vertex j of q. */
static inline carom_vec2 crm_between(const crm_placed *p, int i, const crm_placed *q, int j)
{
    return crm_add(crm_sub(q->at, p->at), crm_sub(crm_arm(q, j), crm_arm(p, i)));
}

/* A point inside the core: halfway between vertex 0 and the one half around. */
static inline carom_vec2 crm_middle(const crm_placed *p)
{
    return crm_scale(0.5, crm_add(p->v[0], p->v[p->n / 2])); /* body frame */
}

/* The vertex farthest along u, body frame; of equal ones the first. */
int crm_farthest(const crm_placed *p, carom_vec2 u);

/* The same along d, pair frame. */
static inline int crm_support(const crm_placed *p, carom_vec2 d)
{
    return p->n > 1 ? crm_farthest(p, crm_turn_back(p, d)) : 0;
}

/* The farthest vertex along u, body frame, from vertex i: around a convex core u . v rises to one
 * top and falls, so the first vertex without a higher neighbor is there. */
int crm_climb(const crm_placed *p, carom_vec2 u, int i);

/* Edge k as a reference. */
typedef struct crm_reference {
    carom_vec2 e;
    double length;
    carom_vec2 t; /* unit tangent */
    carom_vec2 m; /* unit outward normal */
} crm_reference;

static inline crm_reference crm_reference_at(const crm_placed *p, int k)
{
    crm_reference r;
    r.e = crm_edge(p, k);
    r.length = crm_length(r.e);
    r.t = crm_scale(1.0 / r.length, r.e);
    r.m = crm_right(r.t);
    return r;
}

#endif
