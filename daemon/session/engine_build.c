/* engine_build.c: scene message -> world. */
#include "engine_parts.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>

carom_status crm_engine_fault(carom_status status, char *text, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    vsnprintf(text, CRM_TEXT, format, args);
    va_end(args);
    return status;
}

static carom_status check_bodies(const carom_scene_t *s, char *text)
{
    for (int i = 0; i < s->num_bodies; i++) {
        if (s->body_type[i] < CAROM_SCENE_T_DYNAMIC || s->body_type[i] > CAROM_SCENE_T_KINEMATIC) {
            return crm_engine_fault(CAROM_E_ARGUMENT, text,
                                    "body_type[%d] = %d: 0 dynamic, 1 static, 2 kinematic", i,
                                    s->body_type[i]);
        }
    }
    return CAROM_OK;
}

static carom_status check_shapes(const carom_scene_t *s, char *text)
{
    int64_t vertices = 0;
    for (int k = 0; k < s->num_shapes; k++) {
        const int body = s->shape_body[k];
        if (body < 0 || body >= s->num_bodies) {
            return crm_engine_fault(CAROM_E_ARGUMENT, text,
                                    "shape_body[%d] = %d: there are %d bodies", k, body,
                                    s->num_bodies);
        }
        if (k > 0 && body < s->shape_body[k - 1]) {
            return crm_engine_fault(CAROM_E_ARGUMENT, text,
                                    "shape_body[%d] = %d after %d: must not decrease", k, body,
                                    s->shape_body[k - 1]);
        }
        if (s->shape_num_vertices[k] < 1) {
            return crm_engine_fault(CAROM_E_ARGUMENT, text,
                                    "shape_num_vertices[%d] = %d: at least 1", k,
                                    s->shape_num_vertices[k]);
        }
        vertices += s->shape_num_vertices[k];
    }
    if (2 * vertices != s->num_vertex_coords) {
        return crm_engine_fault(CAROM_E_ARGUMENT, text,
                                "num_vertex_coords = %d: the shapes have %" PRId64 " vertices",
                                s->num_vertex_coords, vertices);
    }
    return CAROM_OK;
}

static carom_status check_joints(const carom_scene_t *s, char *text)
{
    for (int k = 0; k < s->num_joints; k++) {
        const int a = s->joint_body_a[k], b = s->joint_body_b[k];
        if (!carom_joint_kind_name((carom_joint_kind)s->joint_type[k])) {
            return crm_engine_fault(CAROM_E_ARGUMENT, text,
                                    "joint_type[%d] = %d: 0 revolute to %d lock_angle", k,
                                    s->joint_type[k], CAROM_SCENE_T_LOCK_ANGLE);
        }
        if (a < 0 || a >= s->num_bodies || b < 0 || b >= s->num_bodies || a == b) {
            return crm_engine_fault(CAROM_E_ARGUMENT, text,
                                    "joint %d between bodies %d and %d: two of 0 to %d", k, a, b,
                                    s->num_bodies - 1);
        }
    }
    return CAROM_OK;
}

carom_status crm_engine_check_scene(const carom_scene_t *scene, char *text)
{
    carom_status status = check_bodies(scene, text);
    if (status >= 0) status = check_shapes(scene, text);
    if (status >= 0) status = check_joints(scene, text);
    return status;
}

static carom_status scene_settings(const carom_scene_t *s, char *text, carom_world_settings *out)
{
    *out = carom_world_defaults();
    out->gravity[0] = s->gravity[0];
    out->gravity[1] = s->gravity[1];
    for (int i = 0; i < s->num_settings; i++) {
        const char *reason = "";
        const carom_status status =
            carom_world_settings_set(out, s->setting_name[i], s->setting_value[i], &reason);
        if (status < 0) {
            return crm_engine_fault(status, text, "setting '%.60s' = '%.60s': %s",
                                    s->setting_name[i], s->setting_value[i], reason);
        }
    }
    return CAROM_OK;
}

static carom_status world_fault(const carom_world *world, carom_status status, char *text)
{
    const char *words = carom_world_error(world);
    return crm_engine_fault(status, text, "%s", words[0] ? words : carom_status_text(status));
}

static carom_body_def body_def(const carom_scene_t *s, int i)
{
    carom_body_def d = carom_body_defaults();
    d.type = (carom_body_type)s->body_type[i];
    d.pose = (carom_pose){s->q[3 * i], s->q[3 * i + 1], s->q[3 * i + 2]};
    memcpy(d.velocity, s->v + 3 * i, sizeof d.velocity);
    memcpy(d.force, s->force + 3 * i, sizeof d.force);
    d.mass = s->mass[i];
    d.inertia = s->inertia[i];
    d.friction = s->friction[i];
    d.restitution = s->restitution[i];
    d.gravity_scale = s->gravity_scale[i];
    d.linear_damping = s->linear_damping[i];
    d.angular_damping = s->angular_damping[i];
    d.sensor = s->sensor[i] != 0;
    d.collide = s->collide[i] != 0;
    d.filter.category = (unsigned)s->filter_category[i];
    d.filter.mask = (unsigned)s->filter_mask[i];
    d.filter.group = s->filter_group[i];
    return d;
}

/* Views of all shapes of the scene. */
static void shape_views(const carom_scene_t *s, carom_shape *shapes)
{
    const double *at = s->vertices;
    for (int k = 0; k < s->num_shapes; k++) {
        shapes[k].radius = s->radius[k];
        shapes[k].count = s->shape_num_vertices[k];
        shapes[k].vertices = (const carom_vec2 *)(const void *)at;
        at += 2 * shapes[k].count;
    }
}

static carom_status add_bodies(const carom_scene_t *s, const carom_shape *shapes,
                               carom_world *world, char *text)
{
    int k = 0;
    for (int i = 0; i < s->num_bodies; i++) {
        carom_body_def d = body_def(s, i);
        d.shapes = shapes + k;
        while (k < s->num_shapes && s->shape_body[k] == i) {
            d.n_shapes++;
            k++;
        }
        const carom_status status = carom_world_add_body(world, &d, NULL);
        if (status < 0 && s->body_name[i][0]) {
            const char *words = carom_world_error(world);
            return crm_engine_fault(status, text, "'%.40s': %s", s->body_name[i],
                                    words[0] ? words : carom_status_text(status));
        }
        if (status < 0) return world_fault(world, status, text);
    }
    return CAROM_OK;
}

/* The kinds have the same numbers on the wire. */
static carom_joint_def joint_def(const carom_scene_t *s, int k)
{
    carom_joint_def d = carom_joint_defaults((carom_joint_kind)s->joint_type[k]);
    d.body_a = s->joint_body_a[k];
    d.body_b = s->joint_body_b[k];
    d.anchor = (carom_vec2){s->anchor[2 * k], s->anchor[2 * k + 1]};
    d.anchor_b = (carom_vec2){s->anchor_b[2 * k], s->anchor_b[2 * k + 1]};
    d.axis = (carom_vec2){s->axis[2 * k], s->axis[2 * k + 1]};
    d.collide = s->joint_collide[k] != 0;
    d.lower = s->joint_lower[k];
    d.upper = s->joint_upper[k];
    d.restitution = s->joint_restitution[k];
    d.stiffness = s->stiffness[k];
    d.damping = s->joint_damping[k];
    d.rest = s->rest[k];
    d.motor_speed = s->motor_speed[k];
    d.motor_limit = s->motor_limit[k];
    d.break_force = s->break_force[k];
    d.break_torque = s->break_torque[k];
    return d;
}

static carom_status add_joints(const carom_scene_t *s, carom_world *world, char *text)
{
    for (int k = 0; k < s->num_joints; k++) {
        const carom_joint_def d = joint_def(s, k);
        const carom_status status = carom_world_add_joint(world, &d, NULL);
        if (status < 0) return world_fault(world, status, text);
    }
    return CAROM_OK;
}

static carom_status fill_world(const carom_scene_t *s, crm_memory *memory, carom_world *world,
                               char *text)
{
    const size_t n = (size_t)s->num_shapes;
    carom_shape *shapes = crm_new(memory, n, sizeof *shapes);
    if (!shapes) return crm_engine_fault(CAROM_E_MEMORY, text, "no memory for %zu shapes", n);
    shape_views(s, shapes);
    carom_status status = add_bodies(s, shapes, world, text);
    crm_free(memory, shapes, n, sizeof *shapes);
    if (status >= 0) status = add_joints(s, world, text);
    if (status < 0) return status;
    status = carom_world_seal(world);
    return status < 0 ? world_fault(world, status, text) : status;
}

carom_status crm_engine_build(const carom_scene_t *scene, carom_allocator allocator, char *text,
                              carom_world **out)
{
    carom_world_settings settings;
    carom_status status = scene_settings(scene, text, &settings);
    if (status < 0) return status;
    carom_world *world = NULL;
    status = carom_world_create(&settings, &allocator, &world);
    if (status < 0) {
        return crm_engine_fault(status, text, "settings of the world: %s",
                                carom_status_text(status));
    }
    crm_memory memory = crm_memory_from(&allocator);
    status = fill_world(scene, &memory, world, text);
    if (status < 0) {
        carom_world_destroy(world);
        return status;
    }
    *out = world;
    return status;
}
