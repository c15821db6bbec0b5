/* scene_message.c: carom_client_scene -> scene_t. */
#include "parts.h"

#include <stdlib.h>
#include <string.h>

/* The arrays of a scene_t, taken one after the other from one block. */
typedef struct block {
    unsigned char *bytes; /* NULL: only the size is counted */
    size_t at;
} block;

static void *take(block *b, int n, size_t size)
{
    void *p = b->bytes ? b->bytes + b->at : NULL;
    b->at += ((size_t)n * size + 7) / 8 * 8;
    return p;
}

static void count(const carom_client_scene *s, carom_scene_t *m)
{
    m->num_settings = s->n_settings;
    m->num_bodies = s->n_bodies;
    m->num_coords = 3 * s->n_bodies;
    m->num_joints = s->n_joints;
    m->num_anchor_coords = 2 * s->n_joints;
    for (int i = 0; i < s->n_bodies; i++) {
        const carom_body_def *d = &s->bodies[i];
        m->num_shapes += d->n_shapes;
        for (int k = 0; k < d->n_shapes; k++) m->num_vertex_coords += 2 * d->shapes[k].count;
    }
}

static void lay_out_joints(carom_scene_t *m, block *b)
{
    const int n = m->num_joints;
    m->joint_type = take(b, n, 1);
    m->joint_body_a = take(b, n, sizeof(int32_t));
    m->joint_body_b = take(b, n, sizeof(int32_t));
    m->anchor = take(b, 2 * n, sizeof(double));
    m->anchor_b = take(b, 2 * n, sizeof(double));
    m->axis = take(b, 2 * n, sizeof(double));
    m->joint_collide = take(b, n, 1);
    m->joint_lower = take(b, n, sizeof(double));
    m->joint_upper = take(b, n, sizeof(double));
    m->joint_restitution = take(b, n, sizeof(double));
    m->stiffness = take(b, n, sizeof(double));
    m->joint_damping = take(b, n, sizeof(double));
    m->rest = take(b, n, sizeof(double));
    m->motor_speed = take(b, n, sizeof(double));
    m->motor_limit = take(b, n, sizeof(double));
    m->break_force = take(b, n, sizeof(double));
    m->break_torque = take(b, n, sizeof(double));
}

static void lay_out(carom_scene_t *m, block *b)
{
    const int n = m->num_bodies;
    m->setting_name = take(b, m->num_settings, sizeof(char *));
    m->setting_value = take(b, m->num_settings, sizeof(char *));
    m->body_name = take(b, n, sizeof(char *));
    m->body_type = take(b, n, 1);
    m->collide = take(b, n, 1);
    m->mass = take(b, n, sizeof(double));
    m->inertia = take(b, n, sizeof(double));
    m->friction = take(b, n, sizeof(double));
    m->restitution = take(b, n, sizeof(double));
    m->gravity_scale = take(b, n, sizeof(double));
    m->linear_damping = take(b, n, sizeof(double));
    m->angular_damping = take(b, n, sizeof(double));
    m->sensor = take(b, n, 1);
    m->filter_category = take(b, n, sizeof(int32_t));
    m->filter_mask = take(b, n, sizeof(int32_t));
    m->filter_group = take(b, n, sizeof(int32_t));
    m->q = take(b, m->num_coords, sizeof(double));
    m->v = take(b, m->num_coords, sizeof(double));
    m->force = take(b, m->num_coords, sizeof(double));
    m->shape_body = take(b, m->num_shapes, sizeof(int32_t));
    m->shape_num_vertices = take(b, m->num_shapes, sizeof(int32_t));
    m->radius = take(b, m->num_shapes, sizeof(double));
    m->vertices = take(b, m->num_vertex_coords, sizeof(double));
    lay_out_joints(m, b);
}

static int32_t bits(unsigned x)
{
    int32_t y;
    memcpy(&y, &x, sizeof y);
    return y;
}

static void fill_body(carom_scene_t *m, int i, const carom_body_def *d)
{
    m->body_type[i] = (int8_t)d->type;
    m->collide[i] = d->collide != 0;
    m->mass[i] = d->mass;
    m->inertia[i] = d->inertia;
    m->friction[i] = d->friction;
    m->restitution[i] = d->restitution;
    m->gravity_scale[i] = d->gravity_scale;
    m->linear_damping[i] = d->linear_damping;
    m->angular_damping[i] = d->angular_damping;
    m->sensor[i] = d->sensor != 0;
    m->filter_category[i] = bits(d->filter.category);
    m->filter_mask[i] = bits(d->filter.mask);
    m->filter_group[i] = d->filter.group;
    m->q[3 * i] = d->pose.angle;
    m->q[3 * i + 1] = d->pose.x;
    m->q[3 * i + 2] = d->pose.y;
    memcpy(m->v + 3 * i, d->velocity, sizeof d->velocity);
    memcpy(m->force + 3 * i, d->force, sizeof d->force);
}

static void put_vec(double *to, carom_vec2 x)
{
    to[0] = x.x;
    to[1] = x.y;
}

/* The kinds have the same numbers on the wire. */
static void fill_joint(carom_scene_t *m, int k, const carom_joint_def *d)
{
    const int two = d->kind == CAROM_DISTANCE || d->kind == CAROM_ROPE;
    m->joint_type[k] = (int8_t)d->kind;
    m->joint_body_a[k] = d->body_a;
    m->joint_body_b[k] = d->body_b;
    put_vec(&m->anchor[2 * k], d->anchor);
    put_vec(&m->anchor_b[2 * k], two ? d->anchor_b : d->anchor);
    put_vec(&m->axis[2 * k], d->axis);
    m->joint_collide[k] = d->collide != 0;
    m->joint_lower[k] = d->lower;
    m->joint_upper[k] = d->upper;
    m->joint_restitution[k] = d->restitution;
    m->stiffness[k] = d->stiffness;
    m->joint_damping[k] = d->damping;
    m->rest[k] = d->rest;
    m->motor_speed[k] = d->motor_speed;
    m->motor_limit[k] = d->motor_limit;
    m->break_force[k] = d->break_force;
    m->break_torque[k] = d->break_torque;
}

static void fill(const carom_client_scene *s, carom_scene_t *m)
{
    int shape = 0, coord = 0;
    for (int i = 0; i < s->n_settings; i++) {
        m->setting_name[i] = (char *)s->setting_names[i]; /* the encoder only reads */
        m->setting_value[i] = (char *)s->setting_values[i];
    }
    for (int i = 0; i < s->n_bodies; i++) {
        const char *name = s->body_names ? s->body_names[i] : NULL;
        m->body_name[i] = (char *)(name ? name : "");
        fill_body(m, i, &s->bodies[i]);
        for (int k = 0; k < s->bodies[i].n_shapes; k++, shape++) {
            const carom_shape *h = &s->bodies[i].shapes[k];
            m->shape_body[shape] = i;
            m->shape_num_vertices[shape] = h->count;
            m->radius[shape] = h->radius;
            for (int j = 0; j < h->count; j++) {
                m->vertices[coord++] = h->vertices[j].x;
                m->vertices[coord++] = h->vertices[j].y;
            }
        }
    }
    for (int k = 0; k < s->n_joints; k++) fill_joint(m, k, &s->joints[k]);
}

static carom_client_code check(carom_client *c, const carom_client_scene *s)
{
    if (s->n_bodies < 0 || s->n_joints < 0 || s->n_settings < 0) {
        return crm_client_fail(c, CAROM_CLIENT_E_ARGUMENT, "a count of the scene is negative");
    }
    for (int i = 0; i < s->n_bodies; i++) {
        for (int k = 0; k < s->bodies[i].n_shapes; k++) {
            if (s->bodies[i].shapes[k].count >= 1) continue;
            return crm_client_fail(c, CAROM_CLIENT_E_ARGUMENT, "body %d, shape %d: no vertices", i,
                                   k);
        }
    }
    return CAROM_CLIENT_OK;
}

static carom_client_code encode(carom_client *c, const carom_scene_t *m, unsigned char **bytes,
                                int *size)
{
    *size = carom_scene_t_encoded_size(m);
    if (*size > CRM_MAX_SCENE_BYTES) {
        return crm_client_fail(c, CAROM_CLIENT_E_ARGUMENT,
                               "the scene takes %d bytes; the limit is %d (4 MB)", *size,
                               CRM_MAX_SCENE_BYTES);
    }
    *bytes = malloc((size_t)*size);
    if (*bytes && carom_scene_t_encode(*bytes, 0, *size, m) == *size) return CAROM_CLIENT_OK;
    return crm_client_fail(c, CAROM_CLIENT_E_MEMORY, "no memory for a scene of %d bytes", *size);
}

carom_client_code crm_client_pack_scene(carom_client *c, const carom_client_scene *s,
                                        crm_wire_header h, unsigned char **bytes, int *size)
{
    carom_scene_t m;
    block b = {NULL, 0};
    carom_client_code code = check(c, s);
    if (code < 0) return code;
    memset(&m, 0, sizeof m);
    m.utime = h.utime;
    m.client_id = h.client_id;
    m.session = h.session;
    m.seq = h.seq;
    m.scene_name = (char *)(s->name ? s->name : "");
    m.gravity[0] = s->gravity[0];
    m.gravity[1] = s->gravity[1];
    count(s, &m);
    lay_out(&m, &b);
    b.bytes = calloc(b.at + 1, 1);
    b.at = 0;
    if (!b.bytes) return crm_client_fail(c, CAROM_CLIENT_E_MEMORY, "no memory for the scene");
    lay_out(&m, &b);
    fill(s, &m);
    code = encode(c, &m, bytes, size);
    free(b.bytes);
    return code;
}
