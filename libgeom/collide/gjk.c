/* gjk.c: the one file that calls libccd, for its GJK intersection test alone: its separation,
 * penetration and MPR queries are inexact or may not end (docs/geometry.md).
 *
 * Plane shapes become prisms z = -1 .. 1.  libccd compares with an absolute 2.2e-16, so coordinates
 * are taken from A's first vertex and divided by the pair's extent. */
#include "collide/closest.h"

#include <ccd/ccd.h>

#ifndef CCD_DOUBLE
#error "carom needs libccd in double precision (CCD_DOUBLE); this one is single"
#endif

enum { MAX_ITERATIONS = 64 };

typedef struct gjk_call {
    carom_vec2 first;
    carom_vec2 last; /* direction of the latest support query on A */
} gjk_call;

typedef struct gjk_shape {
    const crm_placed *p;
    gjk_call *call;
    int *hint;         /* latest support vertex */
    carom_vec2 origin; /* relative to p's body */
    double scale;
    int is_a;
} gjk_shape;

static void support(const void *object, const ccd_vec3_t *dir, ccd_vec3_t *out)
{
    const gjk_shape *s = object;
    const carom_vec2 d = {dir->v[0], dir->v[1]};
    if (s->is_a) s->call->last = d;
    *s->hint = crm_climb(s->p, crm_turn_back(s->p, d), *s->hint);
    const carom_vec2 x = crm_scale(s->scale, crm_sub(crm_arm(s->p, *s->hint), s->origin));
    ccdVec3Set(out, x.x, x.y, dir->v[2] > 0 ? 1.0 : -1.0);
}

static void first_direction(const void *a, const void *b, ccd_vec3_t *dir)
{
    const gjk_shape *s = a;
    (void)b;
    ccdVec3Set(dir, s->call->first.x, s->call->first.y, 0.0);
}

/* Largest coordinate of p's vertices relative to its first. */
static double reach_of(const crm_placed *p)
{
    double top = 0.0;
    for (int i = 1; i < p->n; i++) {
        const double x = fabs(p->v[i].x - p->v[0].x);
        const double y = fabs(p->v[i].y - p->v[0].y);
        if (x > top) top = x;
        if (y > top) top = y;
    }
    return top;
}

int crm_gjk(const crm_placed *a, const crm_placed *b, carom_vec2 first, crm_axis *axis)
{
    const double scale = 1.0 / fmax(reach_of(a), reach_of(b));
    const carom_vec2 origin = crm_arm(a, 0);
    gjk_call call = {first, first};
    int hint_a = 0;
    int hint_b = 0;
    const gjk_shape sa = {a, &call, &hint_a, origin, scale, 1};
    const gjk_shape sb = {b, &call, &hint_b, crm_sub(origin, crm_sub(b->at, a->at)), scale, 0};
    ccd_t ccd;
    CCD_INIT(&ccd);
    ccd.first_dir = first_direction;
    ccd.support1 = support;
    ccd.support2 = support;
    ccd.max_iterations = MAX_ITERATIONS;
    if (ccdGJKIntersect(&sa, &sb, &ccd)) return 0;
    axis->d = call.last;
    axis->a = crm_support(a, axis->d);
    axis->b = crm_support(b, crm_neg(axis->d));
    return 1;
}
