#include "direct.h"

#include <stdlib.h>
#include <string.h>

static void add_body(const carom_scene_t *s, int i, const carom_shape *shape, carom_world *w)
{
    carom_body_def d = carom_body_defaults();
    d.type = (carom_body_type)s->body_type[i];
    d.n_shapes = 1;
    d.shapes = shape;
    d.pose = (carom_pose){s->q[3 * i], s->q[3 * i + 1], s->q[3 * i + 2]};
    memcpy(d.velocity, s->v + 3 * i, sizeof d.velocity);
    memcpy(d.force, s->force + 3 * i, sizeof d.force);
    d.mass = s->mass[i];
    d.inertia = s->inertia[i];
    d.friction = s->friction[i];
    d.restitution = s->restitution[i];
    d.collide = s->collide[i];
    if (carom_world_add_body(w, &d, NULL) < 0) abort();
}

carom_world *direct_world(const carom_scene_t *s)
{
    carom_world_settings set = carom_world_defaults();
    carom_world *w = NULL;
    int at = 0;
    set.dt = strtod(s->setting_value[0], NULL);
    memcpy(set.gravity, s->gravity, sizeof set.gravity);
    if (carom_world_create(&set, NULL, &w) < 0) abort();
    for (int i = 0; i < s->num_bodies; i++) {
        carom_vec2 v[8];
        const int n = s->shape_num_vertices[i];
        for (int k = 0; k < n; k++, at += 2)
            v[k] = (carom_vec2){s->vertices[at], s->vertices[at + 1]};
        const carom_shape shape = {s->radius[i], n, v};
        add_body(s, i, &shape, w);
    }
    for (int k = 0; k < s->num_joints; k++) {
        const carom_vec2 p = {s->anchor[2 * k], s->anchor[2 * k + 1]};
        if (carom_world_add_revolute(w, s->joint_body_a[k], s->joint_body_b[k], p, NULL) < 0) {
            abort();
        }
    }
    return w;
}
