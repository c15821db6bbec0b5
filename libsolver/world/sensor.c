/* sensor.c: what overlaps the shapes of sensors. */
#include "world/query.h"

typedef struct sensing {
    carom_query *query;
    int shape; /* of the sensor */
} sensing;

static double least_overlap(const crm_search *s, const carom_box *b)
{
    const sensing *x = s->user;
    const carom_box *a = &x->query->tree.items[x->shape];
    return a->lower.x <= b->upper.x && b->lower.x <= a->upper.x && a->lower.y <= b->upper.y &&
                   b->lower.y <= a->upper.y
               ? 0
               : HUGE_VAL;
}

static int may_sense(const carom_world *w, int sensor, int other)
{
    const crm_body *a = &w->bodies[sensor];
    const crm_body *b = &w->bodies[other];
    if (b->sensor && other < sensor) return 0;
    if (a->type == CAROM_STATIC && b->type == CAROM_STATIC) return 0;
    return crm_may_meet(w, sensor, other);
}

static carom_status visit(crm_search *s, int other)
{
    const sensing *x = s->user;
    carom_query *q = x->query;
    const carom_world *w = q->world;
    if (!may_sense(w, w->shapes[x->shape].body, w->shapes[other].body)) return CAROM_OK;
    const carom_manifold m =
        carom_collide(crm_query_shape(q, x->shape), crm_query_pose(q, x->shape),
                      crm_query_shape(q, other), crm_query_pose(q, other), 0);
    if (!(m.distance <= 0)) return CAROM_OK;
    void *list = q->overlaps;
    const carom_status e =
        crm_reserve(&q->memory, &list, &q->max_overlaps, q->n_overlaps + 1, sizeof *q->overlaps);
    q->overlaps = list;
    if (e) return e;
    const carom_sensor_overlap o = {crm_found_at(q, x->shape), crm_found_at(q, other)};
    q->overlaps[q->n_overlaps++] = o;
    return CAROM_OK;
}

static int order_overlaps(const void *x, const void *y)
{
    const carom_sensor_overlap *a = x;
    const carom_sensor_overlap *b = y;
    const int first = crm_found_order(a->sensor, b->sensor);
    return first ? first : crm_found_order(a->other, b->other);
}

carom_status carom_query_sensors(carom_query *query, int *n, const carom_sensor_overlap **overlaps)
{
    if (!query || !n || !overlaps) return CAROM_E_ARGUMENT;
    carom_query *q = query;
    const carom_world *w = q->world;
    if (!w->sealed) return CAROM_E_STATE;
    q->n_overlaps = 0;
    for (int k = 0; k < q->tree.n; k++) {
        if (!w->bodies[w->shapes[k].body].sensor) continue;
        sensing x = {q, k};
        crm_search s = {least_overlap, visit, 0, &x};
        const carom_status e = crm_box_tree_search(&q->tree, &s);
        if (e < 0) return e;
    }
    crm_sort(q->overlaps, q->n_overlaps, sizeof *q->overlaps, order_overlaps);
    *n = q->n_overlaps;
    *overlaps = q->overlaps;
    return CAROM_OK;
}
