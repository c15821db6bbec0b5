/* cache.c: closest features from those of last time, when it can be shown that they must be the
 * same.
 *
 * Features of cores apart prove themselves: a foot clearly inside an edge under a vertex that is
 * clearly the lowest, or a line between vertices clearly inside both cones.  Any walk ends there.
 *
 * Otherwise the motion must be small.  Seen from A, B has moved since a pose was kept by at most
 *   motion = |change of position| + |change of (cos, sin)| * reach,
 * reach the farthest that matters from B's position: a vertex of B for distances, one of A too for
 * heights over B's faces.  No distance and no height has changed by more.  So cores that were
 * farther apart than the reach and the motion still are; and the face of largest separation is
 * still that when it led by more than twice the motion. */
#include "collide/cache.h"

enum { NOT_KNOWN, VERTICES, FACE_A, FACE_B, BEYOND, OVERLAP_A, OVERLAP_B };

/* A lead is looked for up to this share of the coordinates: worth it for slow pairs. */
static const double SLACK = 0.02;

/* Motions are rounded to this [1], times the coordinates. */
static const double MOTION_TOL = 1e-14;

static carom_frame seen_from(const carom_frame *a, const carom_frame *b)
{
    const double x = b->x - a->x;
    const double y = b->y - a->y;
    const carom_frame f = {a->cos * x + a->sin * y, a->cos * y - a->sin * x,
                           a->cos * b->cos + a->sin * b->sin, a->cos * b->sin - a->sin * b->cos};
    return f;
}

/* Pair frame: A's position is the origin. */
static carom_frame frame_of(const crm_placed *p)
{
    const carom_frame f = {p->at.x, p->at.y, p->cos, p->sin};
    return f;
}

static double motion_since(const carom_pair_cache *c, const carom_frame *now)
{
    const double turned = fabs(now->cos - c->pose.cos) + fabs(now->sin - c->pose.sin);
    const double moved = fabs(now->x - c->pose.x) + fabs(now->y - c->pose.y);
    const double noise = MOTION_TOL * (fabs(now->x) + fabs(now->y) + c->reach);
    return moved + turned * c->reach + noise;
}

int crm_still_beyond(const carom_frame *a, const carom_frame *b, double reach,
                     const carom_pair_cache *cache, double *gap)
{
    if (cache->kind != BEYOND) return 0;
    const carom_frame now = seen_from(a, b);
    *gap = cache->slack - motion_since(cache, &now);
    return *gap > reach;
}

/* Edge k of p under vertex j of q.  Overlapping: the face is proven, the vertex is not. */
static int recall_face(const crm_placed *p, int k, const crm_placed *q, int j, int on_b,
                       int overlap, crm_closest *out)
{
    crm_face_at(p, k, q, j, on_b, out);
    if (!overlap) return crm_face_is_closest(p, k, q, j, out);
    return out->gap < -crm_noise(p, k, q, j) && crm_is_lowest(q, j, out->ref.m, 1.0);
}

/* 1: the cache has the answer. */
static int recall(const crm_placed *a, const crm_placed *b, const carom_pair_cache *cache,
                  crm_closest *out)
{
    const int i = cache->a;
    const int j = cache->b;
    if (i >= a->n || j >= b->n) return 0;
    switch (cache->kind) {
    case VERTICES: return crm_vertices_are_closest(a, i, b, j, out);
    case FACE_A: return recall_face(a, i, b, j, 0, 0, out);
    case FACE_B: return recall_face(b, j, a, i, 1, 0, out);
    case OVERLAP_A:
    case OVERLAP_B: break;
    default: return 0;
    }
    const carom_frame fa = frame_of(a);
    const carom_frame fb = frame_of(b);
    const carom_frame now = seen_from(&fa, &fb);
    if (!(motion_since(cache, &now) < cache->slack)) return 0;
    return cache->kind == OVERLAP_A ? recall_face(a, i, b, j, 0, 1, out)
                                    : recall_face(b, j, a, i, 1, 1, out);
}

static double reach_of(const crm_placed *p)
{
    double top = 0;
    for (int i = 0; i < p->n; i++) {
        const double r = crm_dot(p->v[i], p->v[i]);
        if (r > top) top = r;
    }
    return sqrt(top);
}

static void remember(const crm_placed *a, const crm_placed *b, double reach, const crm_closest *c,
                     carom_pair_cache *cache)
{
    const int on_a = c->kind == CRM_FACE_A;
    cache->kind = on_a ? FACE_A : c->kind == CRM_FACE_B ? FACE_B : VERTICES;
    cache->a = c->a;
    cache->b = c->b;
    if (c->gap > reach) {
        cache->kind = BEYOND;
        cache->slack = c->gap;
        cache->reach = reach_of(b);
    } else if (c->gap < 0 && c->lead > 0) {
        cache->kind = on_a ? OVERLAP_A : OVERLAP_B;
        cache->slack = 0.5 * c->lead - MOTION_TOL * crm_coordinates(a, b);
        cache->reach =
            reach_of(a) + reach_of(b) + fabs(b->at.x - a->at.x) + fabs(b->at.y - a->at.y);
    } else {
        return;
    }
    const carom_frame fa = frame_of(a);
    const carom_frame fb = frame_of(b);
    cache->pose = seen_from(&fa, &fb);
}

void crm_closest_cached(const crm_placed *a, const crm_placed *b, double reach,
                        carom_pair_cache *cache, crm_closest *out)
{
    if (recall(a, b, cache, out) && !(out->gap > reach)) return;
    const crm_search how = {HUGE_VAL, SLACK * crm_coordinates(a, b), CRM_GJK_MIN_VERTICES};
    crm_closest_features(a, b, &how, out);
    remember(a, b, reach, out, cache);
}
