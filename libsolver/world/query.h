/* query.h: what the questions about a world share. */
#ifndef CRM_WORLD_QUERY_H
#define CRM_WORLD_QUERY_H

#include "carom/world_query.h"
#include "world/box_tree.h"
#include "world/internal.h"

struct carom_query {
    crm_memory memory;
    const carom_world *world;
    crm_box_tree tree; /* items: boxes of the world's shapes */
    int max_q;
    double *q; /* 3 per body: as of the last refresh */
    int n_found, max_found;
    carom_found *found;
    int n_rays, max_rays;
    carom_ray_found *rays;
    int n_overlaps, max_overlaps;
    carom_sensor_overlap *overlaps;
};

/* A search under way: the first member of what a question keeps. */
typedef struct crm_asking {
    carom_query *query;
    carom_who who;
} crm_asking;

static inline crm_asking crm_asking_of(carom_query *query, const carom_who *who)
{
    const crm_asking a = {query, who ? *who : carom_who_defaults()};
    return a;
}

/* Whether the asker finds the body of this shape. */
int crm_finds(const crm_asking *a, int shape);

static inline const carom_shape *crm_query_shape(const carom_query *q, int shape)
{
    return &q->world->shapes[shape].view;
}

static inline carom_pose crm_query_pose(const carom_query *q, int shape)
{
    return crm_pose(q->q, q->world->shapes[shape].body);
}

static inline carom_found crm_found_at(const carom_query *q, int shape)
{
    const int body = q->world->shapes[shape].body;
    const carom_found f = {body, shape - q->world->bodies[body].first_shape};
    return f;
}

static inline carom_found crm_found_none(void)
{
    const carom_found f = {-1, -1};
    return f;
}

/* Number of a shape in the world. */
static inline int crm_found_index(const carom_query *q, carom_found f)
{
    return q->world->bodies[f.body].first_shape + f.shape;
}

int crm_found_order(carom_found a, carom_found b);

static inline int crm_pose_finite(carom_pose p)
{
    return isfinite(p.angle) && isfinite(p.x) && isfinite(p.y);
}

/* CAROM_OK for a valid shape and for a point. */
carom_status crm_query_check(const carom_shape *shape);

/* Sorts in place: heap sort, no memory. */
void crm_sort(void *items, int n, size_t size, int (*order)(const void *, const void *));

#endif
