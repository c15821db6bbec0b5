#include "gradient_numbers.h"

#include "near.h"

#include "libsolver/grad/internal.h" /* to move single numbers of a world */

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

/* That of carom_gradient, which has the forces of steps behind the constant ones. */
static int member(int array)
{
    return array > BY_FORCE ? array + 1 : array;
}

double *gradient_number(carom_world *w, int array, int k)
{
    return crm_number(w, member(array), (size_t)k);
}

int gradient_has_meaning(const carom_world *w, int array, int k)
{
    return crm_number_means(w, member(array), (size_t)k);
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
