/* query_path.c: what a ray or a moving shape meets first, or at all. */
#include "world/query.h"

#include <float.h>

/* The path of a point, o + t d, 0 <= t <= 1, grown by a radius. */
typedef struct path {
    carom_vec2 o;
    carom_vec2 d;
    double grow;
} path;

/* Narrows [enter, leave] to low <= o + t d <= high, outward rounded. */
static void cut(double o, double d, double low, double high, double *enter, double *leave)
{
    const double slack = 4 * DBL_EPSILON * (fabs(o) + fabs(d));
    low -= slack;
    high += slack;
    if (d == 0) {
        if (o < low || o > high) *leave = -HUGE_VAL;
        return;
    }
    const double t0 = ((d > 0 ? low : high) - o) / d;
    const double t1 = ((d > 0 ? high : low) - o) / d;
    if (t0 > *enter) *enter = t0;
    if (t1 < *leave) *leave = t1;
}

/* When the path enters the box, HUGE_VAL: never. */
static double entry(const path *p, const carom_box *b)
{
    double enter = 0;
    double leave = 1;
    cut(p->o.x, p->d.x, b->lower.x - p->grow, b->upper.x + p->grow, &enter, &leave);
    cut(p->o.y, p->d.y, b->lower.y - p->grow, b->upper.y + p->grow, &enter, &leave);
    return enter <= leave ? enter : HUGE_VAL;
}

/* --- rays ------------------------------------------------------------------------------------- */

typedef struct ray {
    path path; /* first: see least_entry */
    crm_asking asking;
    int best;
    carom_ray_hit at;
} ray;

static double least_entry(const crm_search *s, const carom_box *b)
{
    return entry(s->user, b);
}

static int hit_by(const ray *r, int shape, carom_ray_hit *hit)
{
    const carom_query *q = r->asking.query;
    return crm_finds(&r->asking, shape) &&
           carom_ray_cast(crm_query_shape(q, shape), crm_query_pose(q, shape), r->path.o, r->path.d,
                          hit);
}

static carom_status visit_first(crm_search *s, int shape)
{
    ray *r = s->user;
    carom_ray_hit hit;
    if (!hit_by(r, shape, &hit) || hit.enter > s->bound) return CAROM_OK;
    if (hit.enter == s->bound && r->best >= 0 && shape > r->best) return CAROM_OK;
    s->bound = hit.enter;
    r->best = shape;
    r->at = hit;
    return CAROM_OK;
}

static int finite(carom_vec2 v)
{
    return isfinite(v.x) && isfinite(v.y);
}

carom_status carom_query_ray(carom_query *query, const carom_who *who, carom_vec2 origin,
                             carom_vec2 translation, carom_ray_found *out)
{
    if (!query || !out || !finite(origin) || !finite(translation)) return CAROM_E_ARGUMENT;
    ray r = {.path = {origin, translation, 0}, .asking = crm_asking_of(query, who), .best = -1};
    crm_search s = {least_entry, visit_first, 1, &r};
    crm_box_tree_search(&query->tree, &s);
    out->who = r.best < 0 ? crm_found_none() : crm_found_at(query, r.best);
    out->at = r.at;
    return CAROM_OK;
}

static carom_status visit_all(crm_search *s, int shape)
{
    const ray *r = s->user;
    carom_query *q = r->asking.query;
    carom_ray_found f;
    if (!hit_by(r, shape, &f.at)) return CAROM_OK;
    f.who = crm_found_at(q, shape);
    void *list = q->rays;
    const carom_status e =
        crm_reserve(&q->memory, &list, &q->max_rays, q->n_rays + 1, sizeof *q->rays);
    q->rays = list;
    if (!e) q->rays[q->n_rays++] = f;
    return e;
}

static int order_rays(const void *x, const void *y)
{
    const carom_ray_found *a = x;
    const carom_ray_found *b = y;
    if (a->at.enter != b->at.enter) return a->at.enter < b->at.enter ? -1 : 1;
    return crm_found_order(a->who, b->who);
}

carom_status carom_query_ray_all(carom_query *query, const carom_who *who, carom_vec2 origin,
                                 carom_vec2 translation, int *n, const carom_ray_found **found)
{
    if (!query || !n || !found || !finite(origin) || !finite(translation)) return CAROM_E_ARGUMENT;
    ray r = {.path = {origin, translation, 0}, .asking = crm_asking_of(query, who), .best = -1};
    crm_search s = {least_entry, visit_all, 1, &r};
    query->n_rays = 0;
    const carom_status e = crm_box_tree_search(&query->tree, &s);
    if (e < 0) return e;
    crm_sort(query->rays, query->n_rays, sizeof *query->rays, order_rays);
    *n = query->n_rays;
    *found = query->rays;
    return CAROM_OK;
}

/* A shape's reach is widened by this share [1] against rounding; a cast's own tolerance is 1e-12.
 */
static const double REACH_SLACK = 1e-9;

/* --- casts ------------------------------------------------------------------------------------ */

typedef struct caster {
    path path; /* of the shape's position, grown by its reach: first, see least_entry */
    crm_asking asking;
    const carom_shape *shape;
    carom_sweep motion;
    double target;
    int limited; /* a cast was given up */
    int best;
    carom_cast_hit at;
} caster;

static double reach_of(const carom_shape *s)
{
    double r = 0;
    for (int k = 0; k < s->count; k++) r = fmax(r, hypot(s->vertices[k].x, s->vertices[k].y));
    return r + s->radius;
}

static carom_status visit_cast(crm_search *s, int shape)
{
    caster *c = s->user;
    const carom_query *q = c->asking.query;
    if (!crm_finds(&c->asking, shape)) return CAROM_OK;
    const carom_pose pose = crm_query_pose(q, shape);
    const carom_sweep still = {pose, pose};
    carom_cast_hit hit;
    if (carom_shape_cast(c->shape, c->motion, crm_query_shape(q, shape), still, c->target, &hit)) {
        c->limited = 1;
    }
    if (!hit.hit || hit.t > s->bound) return CAROM_OK;
    if (hit.t == s->bound && c->best >= 0 && shape > c->best) return CAROM_OK;
    s->bound = hit.t;
    c->best = shape;
    c->at = hit;
    return CAROM_OK;
}

carom_status carom_query_cast(carom_query *query, const carom_who *who, const carom_shape *shape,
                              carom_sweep motion, double target, carom_cast_found *out)
{
    const int moves = crm_pose_finite(motion.from) && crm_pose_finite(motion.to);
    if (!query || !out || !moves || !(target >= 0 && target < HUGE_VAL)) return CAROM_E_ARGUMENT;
    const carom_status e = crm_query_check(shape);
    if (e) return e;
    const double reach = reach_of(shape) + target;
    const carom_vec2 from = {motion.from.x, motion.from.y};
    const carom_vec2 move = {motion.to.x - from.x, motion.to.y - from.y};
    caster c = {.asking = crm_asking_of(query, who),
                .shape = shape,
                .motion = motion,
                .target = target,
                .best = -1};
    c.path.o = from;
    c.path.d = move;
    c.path.grow = (1 + REACH_SLACK) * reach;
    crm_search s = {least_entry, visit_cast, 1, &c};
    crm_box_tree_search(&query->tree, &s);
    memset(out, 0, sizeof *out);
    out->who = c.best < 0 ? crm_found_none() : crm_found_at(query, c.best);
    out->at = c.at;
    if (c.best < 0) out->at.t = 1;
    return c.limited ? CAROM_LIMIT : CAROM_OK;
}
