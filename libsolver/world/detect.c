/* detect.c: which shapes may touch, and where they do. */
#include "world/internal.h"

#include <math.h>
#include <stdlib.h>

/* Circles around shapes are larger than they need to be, for rounding and for shapes that
 * derivative checks have changed a little. */
static const double CUSHION = 1.01;

static long body_key(const carom_world *w, int a, int b)
{
    return a < b ? (long)a * w->n_bodies + b : (long)b * w->n_bodies + a;
}

static int compare_keys(const void *x, const void *y)
{
    const long a = *(const long *)x;
    const long b = *(const long *)y;
    return (a > b) - (a < b);
}

static int joined(const carom_world *w, int a, int b)
{
    if (!w->n_joined) return 0;
    const long key = body_key(w, a, b);
    return bsearch(&key, w->joined, (size_t)w->n_joined, sizeof key, compare_keys) != NULL;
}

/* In the room of the joined pairs, which are sorted in later. */
static void count_twins(carom_world *w)
{
    long *keys = w->joined;
    int n = 0;
    for (int k = 0; k < w->n_joints; k++) {
        const crm_joint *j = &w->joints[k];
        if (crm_joint_takes_along(j)) keys[n++] = body_key(w, j->body_a, j->body_b);
    }
    qsort(keys, (size_t)n, sizeof *keys, compare_keys);
    for (int k = 0; k < w->n_joints; k++) {
        crm_joint *j = &w->joints[k];
        if (!crm_joint_takes_along(j)) continue;
        const long key = body_key(w, j->body_a, j->body_b);
        const long *at = bsearch(&key, keys, (size_t)n, sizeof key, compare_keys);
        const long *end = at;
        while (at > keys && at[-1] == key) at--;
        while (end < keys + n && *end == key) end++;
        j->n_twins = (int)(end - at);
    }
}

void crm_sort_joined(carom_world *w)
{
    if (w->n_joints) count_twins(w);
    w->n_joined = 0;
    for (int k = 0; k < w->n_joints; k++) {
        const crm_joint *j = &w->joints[k];
        if (!j->collide) w->joined[w->n_joined++] = body_key(w, j->body_a, j->body_b);
    }
    qsort(w->joined, (size_t)w->n_joined, sizeof *w->joined, compare_keys);
}

int crm_may_meet(const carom_world *w, int body_a, int body_b)
{
    const crm_body *a = &w->bodies[body_a];
    const crm_body *b = &w->bodies[body_b];
    if (body_a == body_b || !a->collide || !b->collide) return 0;
    return crm_filters_meet(&a->filter, &b->filter) && !joined(w, body_a, body_b) &&
           !crm_excluded(w, body_a, body_b);
}

int crm_may_collide(const carom_world *w, carom_pair pair)
{
    const int ia = w->shapes[pair.a].body;
    const int ib = w->shapes[pair.b].body;
    const crm_body *a = &w->bodies[ia];
    const crm_body *b = &w->bodies[ib];
    if (a->sensor || b->sensor) return 0;
    if (a->type != CAROM_DYNAMIC && b->type != CAROM_DYNAMIC) return 0;
    return crm_may_meet(w, ia, ib);
}

carom_manifold crm_collide(const carom_world *w, carom_pair pair, const double *q, double margin)
{
    const crm_shape *a = &w->shapes[pair.a];
    const crm_shape *b = &w->shapes[pair.b];
    return carom_collide(&a->view, crm_pose(q, a->body), &b->view, crm_pose(q, b->body), margin);
}

static carom_pose pose_between(const double *q0, const double *q1, int body, double at)
{
    const double *a = q0 + 3 * body;
    const double *b = q1 + 3 * body;
    const carom_pose p = {a[0] + at * (b[0] - a[0]), a[1] + at * (b[1] - a[1]),
                          a[2] + at * (b[2] - a[2])};
    return p;
}

double crm_distance_between(const carom_world *w, carom_pair pair, const double *q0,
                            const double *q1, double at)
{
    const crm_shape *a = &w->shapes[pair.a];
    const crm_shape *b = &w->shapes[pair.b];
    return carom_collide(&a->view, pose_between(q0, q1, a->body, at), &b->view,
                         pose_between(q0, q1, b->body, at), 0)
        .distance;
}

/* The end of the reference edge as a vertex against the incident edge. */
static carom_recipe unclip(const carom_world *w, carom_pair pair, carom_recipe r)
{
    const carom_shape *ref = &w->shapes[r.flipped ? pair.b : pair.a].view;
    carom_recipe v = {r.inc, r.ref, CAROM_EDGE_VERTEX, !r.flipped, 0};
    if (r.at_end) v.inc = (r.ref + 1) % ref->count;
    return v;
}

crm_contact crm_contact_of(const carom_world *w, carom_pair pair, const carom_manifold *m, int k,
                           const double *q)
{
    crm_contact c = {0};
    c.shape_a = pair.a;
    c.shape_b = pair.b;
    c.body_a = w->shapes[pair.a].body;
    c.body_b = w->shapes[pair.b].body;
    c.recipe = m->points[k].recipe;
    c.normal = m->normal;
    c.arm_a = m->points[k].arm_a;
    c.arm_b = m->points[k].arm_b;
    c.gap = m->points[k].gap;
    if (c.recipe.kernel == CAROM_EDGE_CLIPPED) {
        c.recipe = unclip(w, pair, c.recipe);
        crm_contact_refresh(w, q, &c);
    }
    return c;
}

static carom_status add_contacts(carom_world *w, carom_pair pair, const carom_manifold *m,
                                 const double *q, double margin)
{
    crm_substep *s = &w->sub;
    const carom_status e = crm_substep_reserve(w, s, s->n_contacts + m->count);
    if (e) return e;
    for (int k = 0; k < m->count; k++) {
        crm_contact *c = &s->contacts[s->n_contacts++];
        *c = crm_contact_of(w, pair, m, k, q);
        c->speculative = c->gap > margin;
    }
    return crm_rows_reserve(w, s->n_contacts);
}

int crm_far_apart(const carom_world *w, carom_pair pair, const double *q, double margin)
{
    const crm_shape *a = &w->shapes[pair.a];
    const crm_shape *b = &w->shapes[pair.b];
    const double dx = q[3 * b->body + 1] - q[3 * a->body + 1];
    const double dy = q[3 * b->body + 2] - q[3 * a->body + 2];
    const double reach = CUSHION * (a->reach + b->reach) + margin;
    return dx * dx + dy * dy > reach * reach;
}

carom_status crm_detect(carom_world *w, const double *q, double margin)
{
    const crm_island *island = w->island;
    w->sub.n_contacts = 0;
    for (int k = 0; k < island->n_pairs; k++) {
        const carom_pair pair = island->pairs[k];
        if (crm_far_apart(w, pair, q, margin)) continue;
        const carom_manifold m = crm_collide(w, pair, q, margin);
        const carom_status e = m.count ? add_contacts(w, pair, &m, q, margin) : CAROM_OK;
        if (e) return e;
    }
    return crm_detect_limits(w, q, margin, margin);
}

/* How far a point of the shape may get within h from velocity v: its way and its room [m]. */
static double travel(const carom_world *w, int shape, const double *v, double h)
{
    const crm_shape *s = &w->shapes[shape];
    const double *vb = v + 3 * s->body;
    if (w->bodies[s->body].type == CAROM_STATIC) return 0;
    const double room = w->islands.slack[s->body] + w->islands.excess[s->body];
    return h * (hypot(vb[1], vb[2]) + fabs(vb[0]) * s->reach) + room;
}

carom_status crm_detect_ahead(carom_world *w, const double *q, const double *v, double h,
                              double margin)
{
    const crm_island *island = w->island;
    w->sub.n_contacts = 0;
    w->islands.looked_ahead = 1;
    for (int k = 0; k < island->n_pairs; k++) {
        const carom_pair pair = island->pairs[k];
        const double reach = margin + travel(w, pair.a, v, h) + travel(w, pair.b, v, h);
        if (crm_far_apart(w, pair, q, reach)) continue;
        const carom_manifold m = crm_collide(w, pair, q, reach);
        const carom_status e = m.count ? add_contacts(w, pair, &m, q, margin) : CAROM_OK;
        if (e) return e;
    }
    return crm_detect_limits(w, q, HUGE_VAL, margin);
}

void crm_contact_refresh(const carom_world *w, const double *q, crm_contact *c)
{
    if (c->limit) {
        crm_limit_refresh(w, q, c);
        return;
    }
    const carom_contact_point p = carom_contact_eval(
        &w->shapes[c->shape_a].view, crm_pose(q, c->body_a), &w->shapes[c->shape_b].view,
        crm_pose(q, c->body_b), c->recipe, &c->normal);
    c->arm_a = p.arm_a;
    c->arm_b = p.arm_b;
    c->gap = p.gap;
}

int crm_recipe_same(carom_recipe a, carom_recipe b)
{
    return a.ref == b.ref && a.inc == b.inc && a.kernel == b.kernel && a.flipped == b.flipped &&
           a.at_end == b.at_end;
}
