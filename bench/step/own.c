/* own.c: carom with each of its integrators. */
#include "own.h"

#include <stdio.h>
#include <stdlib.h>

static void must(const carom_world *w, carom_status e)
{
    if (e >= 0) return;
    fprintf(stderr, "carom: %s: %s\n", carom_status_name(e), carom_world_error(w));
    exit(1);
}

static carom_body_type type_of(const scene_body *b)
{
    if (b->moves == SCENE_KINEMATIC) return CAROM_KINEMATIC;
    return b->moves ? CAROM_DYNAMIC : CAROM_STATIC;
}

static void add_body(carom_world *w, const scene *s, int k)
{
    const scene_body *b = &s->bodies[k];
    const carom_vec2 corners[4] = {
        {-b->hx, -b->hy}, {b->hx, -b->hy}, {b->hx, b->hy}, {-b->hx, b->hy}};
    const carom_vec2 center = {0, 0};
    carom_vec2 polygon[MAX_CORNERS];
    const int n = b->shape == SHAPE_POLYGON ? s->polygons[k].n : 0;
    for (int i = 0; i < n; i++) {
        polygon[i].x = s->polygons[k].corners[i][0];
        polygon[i].y = s->polygons[k].corners[i][1];
    }
    const carom_shape shapes[4] = {
        {0, 0, NULL}, {b->hx, 1, &center}, {0, 4, corners}, {0, n, polygon}};
    carom_body_def d = carom_body_at(type_of(b), b->q[1], b->q[2]);
    d.pose.angle = b->q[0];
    for (int i = 0; i < 3; i++) d.velocity[i] = b->v[i];
    d.n_shapes = b->shape != SHAPE_NONE;
    d.shapes = &shapes[b->shape];
    d.mass = b->mass;
    d.inertia = b->inertia;
    d.friction = b->friction;
    d.restitution = b->restitution;
    must(w, carom_world_add_body(w, &d, NULL));
}

static carom_world *build(const scene *s, carom_world_settings set)
{
    carom_world *w = NULL;
    set.dt = s->dt;
    set.gravity[1] = -s->gravity;
    must(NULL, carom_world_create(&set, NULL, &w));
    for (int k = 0; k < s->n_bodies; k++) add_body(w, s, k);
    for (int k = 0; k < s->n_pins; k++) {
        const scene_pin *p = &s->pins[k];
        const carom_vec2 at = {p->x, p->y};
        must(w, carom_world_add_revolute(w, p->a, p->b, at, NULL));
    }
    return w;
}

static carom_world_settings settings(carom_integrator integrator, int order)
{
    carom_world_settings set = carom_world_defaults();
    set.integrator = (int)integrator;
    set.order = order;
    return set;
}

carom_world *own_build(const scene *s, carom_integrator integrator, int order)
{
    return build(s, settings(integrator, order));
}

void *own_create(const scene *s, carom_integrator integrator, int order)
{
    carom_world *w = own_build(s, integrator, order);
    must(w, carom_world_seal(w));
    return w;
}

void *own_create_with(const scene *s, carom_integrator integrator, int order, const char *name,
                      const char *value)
{
    carom_world_settings set = settings(integrator, order);
    must(NULL, carom_world_settings_set(&set, name, value, NULL));
    carom_world *w = build(s, set);
    must(w, carom_world_seal(w));
    return w;
}

static void *create_euler(const scene *s)
{
    return own_create(s, CAROM_EULER, 2);
}

static void *create_located(const scene *s)
{
    return own_create(s, CAROM_LOCATED, 2);
}

static void *create_fixed(const scene *s)
{
    return own_create(s, CAROM_FIXED, 2);
}

static void step(void *self, counters *c)
{
    carom_step_stats t;
    const carom_status e = carom_world_step(self, NULL, &t);
    c->factorizations += t.factorizations;
    c->allocations += t.allocations;
    c->n_contacts = t.n_contacts;
    if (t.n_substeps > c->n_substeps) c->n_substeps = t.n_substeps;
    if (c->worst >= 0 && (e < 0 || (int)e > c->worst)) c->worst = (int)e;
}

static void place(void *self, int body, double q[3])
{
    const double *all = carom_world_q(self);
    for (int k = 0; k < 3; k++) q[k] = all[3 * body + k];
}

static void speed(void *self, int body, double v[3])
{
    const double *all = carom_world_v(self);
    for (int k = 0; k < 3; k++) v[k] = all[3 * body + k];
}

static void destroy(void *self)
{
    carom_world_destroy(self);
}

const contender CAROM_CONTENDERS[3] = {
    {"carom euler", create_euler, step, place, destroy, speed},
    {"carom located", create_located, step, place, destroy, speed},
    {"carom fixed", create_fixed, step, place, destroy, speed},
};
