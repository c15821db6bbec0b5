#include "gradient_numbers.h"

#include "near.h"

#include "libsolver/world/internal.h" /* to move single numbers of a world */

#include <stdlib.h>

const char *const gradient_array_names[N_GRADIENT_ARRAYS] = {
    "q0",
    "v0",
    "mass",
    "inertia",
    "friction",
    "restitution",
    "gravity_scale",
    "linear_damping",
    "angular_damping",
    "gravity",
    "force",
    "dt",
    "radius",
    "vertices",
    "anchors",
    "axes",
    "angles",
    "lengths",
    "lower",
    "upper",
    "stiffness",
    "damping",
    "rest",
    "motor_speed",
    "motor_limit",
};

int gradient_count(const carom_world *w, int array)
{
    switch (array) {
    case BY_Q0:
    case BY_V0:
    case BY_FORCE: return 3 * w->n_bodies;
    case BY_GRAVITY: return 2;
    case BY_DT: return 1;
    case BY_RADIUS: return w->n_shapes;
    case BY_VERTICES: return 2 * w->n_vertices;
    case BY_ANCHORS: return 4 * w->n_joints;
    default: return array > BY_ANCHORS ? w->n_joints : w->n_bodies;
    }
}

static double *joint_number(crm_joint *j, int array)
{
    switch (array) {
    case BY_AXES: return &j->axis;
    case BY_ANGLES: return &j->angle;
    case BY_LENGTHS: return &j->length;
    case BY_LOWER: return &j->lower;
    case BY_UPPER: return &j->upper;
    case BY_STIFFNESS: return &j->stiffness;
    case BY_DAMPING: return &j->damping;
    case BY_REST: return &j->rest;
    case BY_MOTOR_SPEED: return &j->motor_speed;
    default: return &j->motor_limit;
    }
}

static double *anchor_number(crm_joint *j, int k)
{
    double *const anchors[4] = {&j->local_a.x, &j->local_a.y, &j->local_b.x, &j->local_b.y};
    return anchors[k];
}

double *gradient_number(carom_world *w, int array, int k)
{
    switch (array) {
    case BY_Q0: return &w->q[k];
    case BY_V0: return &w->v[k];
    case BY_MASS: return &w->mass[k];
    case BY_INERTIA: return &w->inertia[k];
    case BY_FRICTION: return &w->friction[k];
    case BY_RESTITUTION: return &w->restitution[k];
    case BY_GRAVITY_SCALE: return &w->bodies[k].gravity_scale;
    case BY_LINEAR_DAMPING: return &w->bodies[k].damping[1];
    case BY_ANGULAR_DAMPING: return &w->bodies[k].damping[0];
    case BY_GRAVITY: return &w->settings.gravity[k];
    case BY_FORCE: return &w->force[k];
    case BY_DT: return &w->settings.dt;
    case BY_RADIUS: return &w->shapes[k].view.radius;
    case BY_VERTICES: return k % 2 ? &w->vertices[k / 2].y : &w->vertices[k / 2].x;
    case BY_ANCHORS: return anchor_number(&w->joints[k / 4], k % 4);
    default: return joint_number(&w->joints[k], array);
    }
}

static int joint_has(const crm_joint *j, int array)
{
    switch (array) {
    case BY_LOWER: return j->lower > -HUGE_VAL;
    case BY_UPPER: return j->upper < HUGE_VAL;
    case BY_STIFFNESS: return j->stiffness > 0;
    case BY_DAMPING: return j->damping > 0;
    case BY_MOTOR_LIMIT: return j->motor_limit > 0;
    default: return 1;
    }
}

int gradient_has_meaning(const carom_world *w, int array, int k)
{
    switch (array) {
    case BY_MASS:
    case BY_GRAVITY_SCALE: return w->bodies[k].type == CAROM_DYNAMIC;
    case BY_INERTIA: return w->bodies[k].type == CAROM_DYNAMIC && w->inertia[k] < HUGE_VAL;
    case BY_LINEAR_DAMPING: return crm_is_damped(w, k, 1);
    case BY_ANGULAR_DAMPING: return crm_is_damped(w, k, 0);
    case BY_FORCE: return w->bodies[k / 3].type == CAROM_DYNAMIC;
    case BY_V0: return w->bodies[k / 3].type != CAROM_STATIC;
    default: return array <= BY_ANCHORS || joint_has(&w->joints[k], array);
    }
}

gradient_room gradient_room_make(const carom_world *w, int rows)
{
    gradient_room x;
    memset(&x, 0, sizeof x);
    for (int a = 0; a < N_GRADIENT_ARRAYS; a++) {
        const size_t n = (size_t)rows * (size_t)gradient_count(w, a);
        x.array[a] = calloc(n + 1, sizeof(double));
        assert_non_null(x.array[a]);
    }
    x.g.q0 = x.array[BY_Q0];
    x.g.v0 = x.array[BY_V0];
    x.g.mass = x.array[BY_MASS];
    x.g.inertia = x.array[BY_INERTIA];
    x.g.friction = x.array[BY_FRICTION];
    x.g.restitution = x.array[BY_RESTITUTION];
    x.g.gravity_scale = x.array[BY_GRAVITY_SCALE];
    x.g.linear_damping = x.array[BY_LINEAR_DAMPING];
    x.g.angular_damping = x.array[BY_ANGULAR_DAMPING];
    x.g.gravity = x.array[BY_GRAVITY];
    x.g.force = x.array[BY_FORCE];
    x.g.dt = x.array[BY_DT];
    x.g.radius = x.array[BY_RADIUS];
    x.g.vertices = (carom_vec2 *)x.array[BY_VERTICES];
    x.g.anchors = (carom_vec2 *)x.array[BY_ANCHORS];
    x.g.axes = x.array[BY_AXES];
    x.g.angles = x.array[BY_ANGLES];
    x.g.lengths = x.array[BY_LENGTHS];
    x.g.lower = x.array[BY_LOWER];
    x.g.upper = x.array[BY_UPPER];
    x.g.stiffness = x.array[BY_STIFFNESS];
    x.g.damping = x.array[BY_DAMPING];
    x.g.rest = x.array[BY_REST];
    x.g.motor_speed = x.array[BY_MOTOR_SPEED];
    x.g.motor_limit = x.array[BY_MOTOR_LIMIT];
    return x;
}

void gradient_room_free(gradient_room *x)
{
    for (int a = 0; a < N_GRADIENT_ARRAYS; a++) free(x->array[a]);
}
