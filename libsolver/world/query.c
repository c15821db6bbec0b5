/* query.c: which bodies are near a shape or at a place. */
#include "world/query.h"

#include <float.h>

carom_status carom_query_create(const carom_world *world, const carom_allocator *allocator,
                                carom_query **out)
{
    if (!out) return CAROM_E_ARGUMENT;
    *out = NULL;
    if (!world) return CAROM_E_ARGUMENT;
    crm_memory memory = crm_memory_from(allocator);
    carom_query *q = crm_new(&memory, 1, sizeof *q);
    if (!q) return CAROM_E_MEMORY;
    q->memory = memory;
    q->world = world;
    *out = q;
    return CAROM_OK;
}

void carom_query_destroy(carom_query *query)
{
    if (!query) return;
    carom_query *q = query;
    crm_box_tree_free(&q->memory, &q->tree);
    crm_free(&q->memory, q->q, (size_t)q->max_q, sizeof *q->q);
    crm_free(&q->memory, q->found, (size_t)q->max_found, sizeof *q->found);
    crm_free(&q->memory, q->rays, (size_t)q->max_rays, sizeof *q->rays);
    crm_free(&q->memory, q->overlaps, (size_t)q->max_overlaps, sizeof *q->overlaps);
    crm_memory m = q->memory;
    crm_free(&m, q, 1, sizeof *q);
}

carom_status carom_query_refresh(carom_query *query)
{
    if (!query) return CAROM_E_ARGUMENT;
    carom_query *q = query;
    const carom_world *w = q->world;
    void *poses = q->q;
    carom_status e = crm_reserve(&q->memory, &poses, &q->max_q, 3 * w->n_bodies, sizeof *q->q);
    q->q = poses;
    if (!e) e = crm_box_tree_resize(&q->memory, &q->tree, w->n_shapes);
    if (e) {
        q->tree.n = 0;
        return e;
    }
    if (w->n_bodies) memcpy(q->q, w->q, 3 * (size_t)w->n_bodies * sizeof *q->q);
    for (int k = 0; k < w->n_shapes; k++) {
        q->tree.items[k] = carom_shape_box(crm_query_shape(q, k), crm_query_pose(q, k));
    }
    crm_box_tree_update(&q->tree);
    return CAROM_OK;
}

carom_who carom_who_defaults(void)
{
    const carom_who who = {{1, ~0U, 0}, 0, 0, -1};
    return who;
}

int crm_finds(const crm_asking *a, int shape)
{
    const carom_world *w = a->query->world;
    const int body = w->shapes[shape].body;
    const crm_body *b = &w->bodies[body];
    if (body == a->who.except) return 0;
    if ((b->sensor && !a->who.sensors) || (!b->collide && !a->who.idle)) return 0;
    return crm_filters_meet(&a->who.filter, &b->filter);
}

int crm_found_order(carom_found a, carom_found b)
{
    if (a.body != b.body) return a.body < b.body ? -1 : 1;
    return (a.shape > b.shape) - (a.shape < b.shape);
}

carom_status crm_query_check(const carom_shape *shape)
{
    if (!shape) return CAROM_E_ARGUMENT;
    if (shape->count == 1 && shape->radius == 0 && shape->vertices) {
        const carom_vec2 v = shape->vertices[0];
        return isfinite(v.x) && isfinite(v.y) ? CAROM_OK : CAROM_E_SHAPE;
    }
    return carom_shape_check(shape, NULL);
}

static void swap_bytes(char *a, char *b, size_t size)
{
    for (size_t k = 0; k < size; k++) {
        const char c = a[k];
        a[k] = b[k];
        b[k] = c;
    }
}

/* Children of i: 2 i + 1, 2 i + 2; none greater than its parent. */
static void sift(char *x, int i, int n, size_t size, int (*order)(const void *, const void *))
{
    for (int child = 2 * i + 1; child < n; child = 2 * i + 1) {
        char *c = x + (size_t)child * size;
        if (child + 1 < n && order(c, c + size) < 0) {
            child++;
            c += size;
        }
        if (order(x + (size_t)i * size, c) >= 0) return;
        swap_bytes(x + (size_t)i * size, c, size);
        i = child;
    }
}

void crm_sort(void *items, int n, size_t size, int (*order)(const void *, const void *))
{
    char *x = items;
    for (int i = n / 2 - 1; i >= 0; i--) sift(x, i, n, size, order);
    for (int last = n - 1; last > 0; last--) {
        swap_bytes(x, x + (size_t)last * size, size);
        sift(x, 0, last, size, order);
    }
}

/* --- nearest ---------------------------------------------------------------------------------- */

typedef struct nearest {
    crm_asking asking;
    const carom_shape *shape;
    carom_pose pose;
    carom_box box; /* of the shape */
    int best;
    carom_separation at;
} nearest;

/* Distance of two boxes, rounded down; where they overlap the shapes may be any depth. */
static double least_distance(const crm_search *s, const carom_box *b)
{
    const carom_box *a = &((const nearest *)s->user)->box;
    const double x = fmax(b->lower.x - a->upper.x, a->lower.x - b->upper.x);
    const double y = fmax(b->lower.y - a->upper.y, a->lower.y - b->upper.y);
    if (x <= 0 && y <= 0) return -HUGE_VAL;
    return fmin((1 - 4 * DBL_EPSILON) * hypot(fmax(x, 0), fmax(y, 0)), DBL_MAX);
}

static carom_status visit_nearest(crm_search *s, int shape)
{
    nearest *n = s->user;
    const carom_query *q = n->asking.query;
    if (!crm_finds(&n->asking, shape)) return CAROM_OK;
    const carom_separation at = carom_shape_distance(n->shape, n->pose, crm_query_shape(q, shape),
                                                     crm_query_pose(q, shape));
    if (!(at.distance <= s->bound)) return CAROM_OK;
    if (at.distance == s->bound && n->best >= 0 && shape > n->best) return CAROM_OK;
    s->bound = at.distance;
    n->best = shape;
    n->at = at;
    return CAROM_OK;
}

carom_status carom_query_nearest(carom_query *query, const carom_who *who, const carom_shape *shape,
                                 carom_pose pose, double within, carom_near *out)
{
    if (!query || !out || isnan(within) || !crm_pose_finite(pose)) return CAROM_E_ARGUMENT;
    const carom_status e = crm_query_check(shape);
    if (e) return e;
    nearest n = {.asking = crm_asking_of(query, who), .shape = shape, .pose = pose, .best = -1};
    n.box = carom_shape_box(shape, pose);
    crm_search s = {least_distance, visit_nearest, within, &n};
    crm_box_tree_search(&query->tree, &s);
    memset(out, 0, sizeof *out);
    out->who = n.best < 0 ? crm_found_none() : crm_found_at(query, n.best);
    out->at = n.at;
    return CAROM_OK;
}

/* --- lists ------------------------------------------------------------------------------------ */

/* The shapes that touch an area. */
typedef struct area {
    crm_asking asking;
    carom_box box; /* around the area */
    int (*touches)(const struct area *a, const carom_shape *shape, carom_pose pose);
    carom_vec2 point;
    const carom_shape *shape;
    carom_pose pose;
} area;

static double least_overlap(const crm_search *s, const carom_box *b)
{
    const carom_box *a = &((const area *)s->user)->box;
    return a->lower.x <= b->upper.x && b->lower.x <= a->upper.x && a->lower.y <= b->upper.y &&
                   b->lower.y <= a->upper.y
               ? 0
               : HUGE_VAL;
}

static int has_point(const area *a, const carom_shape *shape, carom_pose pose)
{
    return carom_point_distance(shape, pose, a->point, NULL) <= 0;
}

static int meets_box(const area *a, const carom_shape *shape, carom_pose pose)
{
    return carom_box_overlap(shape, pose, &a->box);
}

static int meets_shape(const area *a, const carom_shape *shape, carom_pose pose)
{
    return carom_collide(a->shape, a->pose, shape, pose, 0).distance <= 0;
}

static carom_status visit_area(crm_search *s, int shape)
{
    area *a = s->user;
    carom_query *q = a->asking.query;
    if (!crm_finds(&a->asking, shape)) return CAROM_OK;
    if (!a->touches(a, crm_query_shape(q, shape), crm_query_pose(q, shape))) return CAROM_OK;
    void *list = q->found;
    const carom_status e =
        crm_reserve(&q->memory, &list, &q->max_found, q->n_found + 1, sizeof *q->found);
    q->found = list;
    if (!e) q->found[q->n_found++] = crm_found_at(q, shape);
    return e;
}

static int order_found(const void *x, const void *y)
{
    return crm_found_order(*(const carom_found *)x, *(const carom_found *)y);
}

static carom_status list_area(area *a, int *n, const carom_found **found)
{
    carom_query *q = a->asking.query;
    crm_search s = {least_overlap, visit_area, 0, a};
    q->n_found = 0;
    const carom_status e = crm_box_tree_search(&q->tree, &s);
    if (e < 0) return e;
    crm_sort(q->found, q->n_found, sizeof *q->found, order_found);
    *n = q->n_found;
    *found = q->found;
    return CAROM_OK;
}

carom_status carom_query_point(carom_query *query, const carom_who *who, carom_vec2 point, int *n,
                               const carom_found **found)
{
    if (!query || !n || !found || !isfinite(point.x) || !isfinite(point.y)) return CAROM_E_ARGUMENT;
    area a = {.asking = crm_asking_of(query, who),
              .box = {point, point},
              .touches = has_point,
              .point = point};
    return list_area(&a, n, found);
}

carom_status carom_query_box(carom_query *query, const carom_who *who, const carom_box *box, int *n,
                             const carom_found **found)
{
    if (!query || !box || !n || !found) return CAROM_E_ARGUMENT;
    area a = {.asking = crm_asking_of(query, who), .box = *box, .touches = meets_box};
    return list_area(&a, n, found);
}

carom_status carom_query_overlaps(carom_query *query, const carom_who *who,
                                  const carom_shape *shape, carom_pose pose, int *n,
                                  const carom_found **found)
{
    if (!query || !n || !found || !crm_pose_finite(pose)) return CAROM_E_ARGUMENT;
    const carom_status e = crm_query_check(shape);
    if (e) return e;
    area a = {
        crm_asking_of(query, who), carom_shape_box(shape, pose), meets_shape, {0, 0}, shape, pose};
    return list_area(&a, n, found);
}
