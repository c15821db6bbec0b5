/* Gradients of whole runs against central differences and closed forms. */
#include "fdiff.h"
#include "near.h"
#include "rng.h"
#include "scenes.h"

#include "carom/grad.h"
#include "libsolver/world/internal.h" /* to move single numbers of a world for the differences */

#include <stdlib.h>

/* Each number against central differences, relative to the largest entry of its array and of the
 * loss: the differences themselves are good to about 1e-8 on these runs. */
static const double DIFFERENCE_TOL = 1e-6;
#define STEP 2e-5
/* Two faces in contact are both candidates for the reference face.  Turned by d against each other
 * their separations differ by d^2, which decides once it is above the tie tolerance of 1e-14: the
 * normal then jumps by d.  Differences have to stay below. */
#define STEP_OF_FACES 1e-7

typedef struct scene {
    const char *name;
    carom_world *(*build)(void);
    int n_steps;
    double step; /* of the differences */
} scene;

/* --- scenes ----------------------------------------------------------------------------------- */

static carom_pose at(double x, double y, double angle)
{
    const carom_pose p = {angle, x, y};
    return p;
}

/* A resting start is a kink: moved down the floor pushes, moved up it does not.  Scenes start with
 * a small overlap instead, which the first step projects away. */
static void sink(carom_world *w, double depth)
{
    assert_true(carom_world_seal(w) >= 0);
    for (int b = 0; b < carom_world_n_bodies(w); b++) {
        if (w->bodies[b].type == CAROM_DYNAMIC) w->q[3 * b + 2] -= depth * (1 + b);
    }
}

static carom_world *sliding_box(void)
{
    carom_world *w = scene_world(50, 1.0 / 30);
    scene_floor(w, 0.2, 0);
    const int b = scene_box(w, 1.3, 0.5, 0.25, at(0, 0.25, 0), 0.3, 0);
    scene_push(w, b, 0, 20, 0);
    sink(w, 1e-4);
    return w;
}

static carom_world *slide_to_roll(void)
{
    carom_world *w = scene_world(9.81, 1.0 / 60);
    scene_floor(w, 0.3, 0);
    const int b = scene_disc(w, 1.7, 0.4, 0, 0.4, 0.2, 0);
    scene_push(w, b, 0.5, 3, 0);
    sink(w, 1e-4);
    return w;
}

static carom_world *oblique(double mu, double vx)
{
    carom_world *w = scene_world(9.81, 1.0 / 60);
    scene_floor(w, mu, 0.7);
    const int b = scene_disc(w, 2, 0.3, 0, 0.9123, mu, 0.5);
    scene_push(w, b, 0.5, vx, -2);
    return w;
}

static carom_world *oblique_stick(void)
{
    return oblique(0.6, 1);
}

static carom_world *oblique_slip(void)
{
    return oblique(0.08, 3);
}

static carom_world *two_discs(void)
{
    carom_world *w = scene_world(0, 1.0 / 60);
    scene_disc(w, 1, 0.5, -1.5, 0.1, 0.3, 0.8);
    const int b = scene_disc(w, 2.5, 0.4, 0, 0, 0.1, 0.6);
    scene_push(w, 0, 1, 3, 0.2);
    scene_push(w, b, 0, -0.1, 0);
    return w;
}

static carom_world *chain(void)
{
    carom_world *w = scene_world(10, 1.0 / 60);
    const carom_vec2 top = {0, 0.25};
    int before = scene_anchor(w);
    for (int k = 0; k < 10; k++) {
        const int b = scene_box(w, 0.7, 0.1, 0.3, at(0, -0.5 * k, 0), 0.3, 0.2);
        const carom_vec2 pin = {0, top.y - 0.5 * k};
        assert_int_equal(carom_world_add_revolute(w, before, b, pin, NULL), CAROM_OK);
        before = b;
    }
    const int ball = scene_disc(w, 3, 0.2, -0.6, -4.5, 0.3, 0.2);
    for (int b = 1; b < carom_world_n_bodies(w); b++)
        w->bodies[b].filter.group = b + 1 < ball ? -1 : 0;
    scene_push(w, ball, 0, 5, 1);
    return w;
}

/* Zigzag of links whose neighbors weigh 4e5 times as much or less: stage 1 and its adjoint converge
 * slowly, by the turn of a link times that ratio. */
static carom_world *uneven_chain(void)
{
    static const double mass[4] = {500, 0.002, 800, 0.001};
    carom_world *w = scene_world(10, 1.0 / 60);
    carom_vec2 pin = {0, 0};
    int before = scene_anchor(w);
    for (int k = 0; k < 4; k++) {
        const double turn = k % 2 ? -0.7 : 0.5;
        const carom_vec2 half = {0.5 * cos(turn), 0.5 * sin(turn)};
        const int b =
            scene_box(w, mass[k], 0.5, 0.05, at(pin.x + half.x, pin.y + half.y, turn), 0, 0);
        assert_int_equal(carom_world_add_revolute(w, before, b, pin, NULL), CAROM_OK);
        pin.x += 2 * half.x;
        pin.y += 2 * half.y;
        before = b;
    }
    for (int b = 1; b < carom_world_n_bodies(w); b++) w->bodies[b].filter.group = -1;
    scene_push(w, 3, 0, 2, -2);
    return w;
}

static carom_world *pushed_stack(void)
{
    carom_world *w = scene_world(9.81, 1.0 / 60);
    scene_floor(w, 0.4, 0);
    /* Each box within the one below: where flush faces overhang, the reference face depends on
     * the sign of a turn.  Each with its own friction and speed: a box that gains mu g h in one
     * step and loses it in the next is at the border of sticking.  All of that are kinks. */
    static const double aside[4] = {0, 0.03, 0.02, 0.05};
    static const double speed[4] = {1, 1.6, 1.25, 2.1};
    for (int k = 0; k < 4; k++) {
        scene_box(w, 1 + k, 0.5 - 0.06 * k, 0.25, at(aside[k], 0.25 + 0.5 * k, 0), 0.5 - 0.07 * k,
                  0);
    }
    for (int k = 0; k < 4; k++) scene_push(w, 1 + k, 0, speed[k], 0);
    sink(w, 1e-5);
    return w;
}

static carom_world *tumbling_box(void)
{
    carom_world *w = scene_world(9.81, 1.0 / 60);
    scene_floor(w, 0.3, 0.4);
    const int b = scene_box(w, 1.1, 0.4, 0.2, at(0, 0.9, 0.35), 0.3, 0.4);
    scene_push(w, b, 1, 1, 0);
    return w;
}

static carom_world *pendulum(void)
{
    carom_world *w = scene_world(9.81, 1.0 / 60);
    const carom_vec2 pin = {0, 0};
    scene_anchor(w);
    const int a = scene_box(w, 1, 0.5, 0.05, at(0.5, 0, 0), 0, 0);
    const int b = scene_box(w, 2, 0.5, 0.05, at(1.5, 0, 0), 0, 0);
    const carom_vec2 elbow = {1, 0};
    assert_int_equal(carom_world_add_revolute(w, 0, a, pin, NULL), CAROM_OK);
    assert_int_equal(carom_world_add_revolute(w, a, b, elbow, NULL), CAROM_OK);
    return w;
}

static carom_world *rounded_on_slope(void)
{
    carom_world *w = scene_world(9.81, 1.0 / 60);
    const carom_vec2 ground[4] = {{-20, -1}, {20, -1}, {20, 1}, {-20, 1}};
    const carom_vec2 corners[5] = {{-0.3, -0.2}, {0.3, -0.2}, {0.35, 0.1}, {0, 0.3}, {-0.3, 0.2}};
    const carom_shape shapes[2] = {{0.05, 4, ground}, {0.1, 5, corners}};
    carom_body_def d = carom_body_defaults();
    d.type = CAROM_STATIC;
    d.n_shapes = 1;
    d.shapes = &shapes[0];
    d.pose = at(0, -1.05, 0.1);
    d.friction = 0.2;
    assert_int_equal(carom_world_add_body(w, &d, NULL), CAROM_OK);
    d = carom_body_defaults();
    d.n_shapes = 1;
    d.shapes = &shapes[1];
    d.pose = at(0.2, 0.7, 0.4);
    d.restitution = 0.5;
    assert_int_equal(carom_world_add_body(w, &d, NULL), CAROM_OK);
    scene_push(w, 1, -1, 0.5, 0);
    return w;
}

static carom_world *kinematic_belt(void)
{
    carom_world *w = scene_world(9.81, 1.0 / 60);
    const carom_vec2 corners[4] = {{-20, -1}, {20, -1}, {20, 1}, {-20, 1}};
    const carom_shape belt = {0, 4, corners};
    carom_body_def d = carom_body_defaults();
    d.type = CAROM_KINEMATIC;
    d.n_shapes = 1;
    d.shapes = &belt;
    d.pose = at(0, -1, 0);
    d.velocity[1] = 1.5;
    d.friction = 0.3;
    assert_int_equal(carom_world_add_body(w, &d, NULL), CAROM_OK);
    scene_box(w, 1, 0.5, 0.25, at(0, 0.25, 0), 0.3, 0);
    sink(w, 1e-4);
    return w;
}

static const scene SCENES[] = {
    {"sliding box", sliding_box, 30, STEP},
    {"slide to roll", slide_to_roll, 60, STEP},
    {"oblique stick", oblique_stick, 30, STEP},
    {"oblique slip", oblique_slip, 30, STEP},
    {"two discs", two_discs, 40, STEP},
    {"chain of ten", chain, 15, STEP},
    {"uneven chain", uneven_chain, 20, 1e-6},
    {"pushed stack", pushed_stack, 20, STEP_OF_FACES},
    {"tumbling box", tumbling_box, 30, STEP},
    {"double pendulum", pendulum, 40, STEP},
    {"rounded hull on slope", rounded_on_slope, 40, STEP},
    {"box on a belt", kinematic_belt, 20, STEP},
};
enum { N_SCENES = sizeof SCENES / sizeof SCENES[0] };

/* --- a loss with weights on every component of two states ------------------------------------- */

typedef struct run {
    const scene *s;
    int n;          /* 3 n_bodies */
    double *weight; /* 4 n: q, v at the middle; q, v at the end */
    const double *force;
    int array; /* which number is moved */
    int entry;
} run;

static double dot(int n, const double *a, const double *b)
{
    double sum = 0;
    for (int k = 0; k < n; k++) sum += a[k] * b[k];
    return sum;
}

enum {
    Q0,
    V0,
    MASS,
    INERTIA,
    FRICTION,
    RESTITUTION,
    GRAVITY,
    FORCE,
    DT,
    RADIUS,
    VERTICES,
    ANCHORS,
    N_ARRAYS
};
static const char *const ARRAY_NAMES[N_ARRAYS] = {"q0",       "v0",          "mass",     "inertia",
                                                  "friction", "restitution", "gravity",  "force",
                                                  "dt",       "radius",      "vertices", "anchors"};

static double *number(carom_world *w, int array, int k)
{
    switch (array) {
    case Q0: return &w->q[k];
    case V0: return &w->v[k];
    case MASS: return &w->mass[k];
    case INERTIA: return &w->inertia[k];
    case FRICTION: return &w->friction[k];
    case RESTITUTION: return &w->restitution[k];
    case GRAVITY: return &w->settings.gravity[k];
    case FORCE: return &w->force[k];
    case DT: return &w->settings.dt;
    case RADIUS: return &w->shapes[k].view.radius;
    case VERTICES: return k % 2 ? &w->vertices[k / 2].y : &w->vertices[k / 2].x;
    default: {
        crm_joint *j = &w->joints[k / 4];
        carom_vec2 *local = k % 4 < 2 ? &j->local_a : &j->local_b;
        return k % 2 ? &local->y : &local->x;
    }
    }
}

static int count(const carom_world *w, int array)
{
    switch (array) {
    case Q0:
    case V0:
    case FORCE: return 3 * w->n_bodies;
    case GRAVITY: return 2;
    case DT: return 1;
    case RADIUS: return w->n_shapes;
    case VERTICES: return 2 * w->n_vertices;
    case ANCHORS: return 4 * w->n_joints;
    default: return w->n_bodies;
    }
}

/* Numbers that mean nothing for the body: a static body's mass and velocity. */
static int has_meaning(const carom_world *w, int array, int k)
{
    const int b = array == Q0 || array == V0 || array == FORCE ? k / 3 : k;
    switch (array) {
    case MASS:
    case INERTIA:
    case FORCE: return w->bodies[b].type == CAROM_DYNAMIC;
    case V0: return w->bodies[b].type != CAROM_STATIC;
    default: return 1;
    }
}

static double loss(double t, void *user)
{
    const run *r = user;
    carom_world *w = r->s->build();
    assert_true(carom_world_seal(w) >= 0);
    if (r->array >= 0) *number(w, r->array, r->entry) += t;
    scene_run(w, r->s->n_steps / 2, NULL);
    double sum = dot(r->n, r->weight, w->q) + dot(r->n, r->weight + r->n, w->v);
    scene_run(w, r->s->n_steps - r->s->n_steps / 2, NULL);
    sum += dot(r->n, r->weight + 2 * r->n, w->q) + dot(r->n, r->weight + 3 * r->n, w->v);
    carom_world_destroy(w);
    return sum;
}

typedef struct whole {
    double *array[N_ARRAYS];
    carom_gradient g;
} whole;

static whole make_gradient(const carom_world *w)
{
    whole x;
    for (int a = 0; a < N_ARRAYS; a++) {
        x.array[a] = calloc((size_t)count(w, a) + 1, sizeof(double));
        assert_non_null(x.array[a]);
    }
    memset(&x.g, 0, sizeof x.g);
    x.g.q0 = x.array[Q0];
    x.g.v0 = x.array[V0];
    x.g.mass = x.array[MASS];
    x.g.inertia = x.array[INERTIA];
    x.g.friction = x.array[FRICTION];
    x.g.restitution = x.array[RESTITUTION];
    x.g.gravity = x.array[GRAVITY];
    x.g.force = x.array[FORCE];
    x.g.dt = x.array[DT];
    x.g.radius = x.array[RADIUS];
    x.g.vertices = (carom_vec2 *)x.array[VERTICES];
    x.g.anchors = (carom_vec2 *)x.array[ANCHORS];
    return x;
}

static void free_gradient(whole *x)
{
    for (int a = 0; a < N_ARRAYS; a++) free(x->array[a]);
}

static whole reverse(const run *r, carom_world **world)
{
    carom_world *w = r->s->build();
    carom_tape *tape;
    carom_gradient_stats stats;
    assert_int_equal(carom_tape_create(w, NULL, &tape), CAROM_OK);
    for (int k = 0; k < r->s->n_steps; k++) assert_true(carom_tape_step(tape, NULL, NULL) >= 0);
    const carom_state_bar bars[2] = {{r->s->n_steps, r->weight + 2 * r->n, r->weight + 3 * r->n},
                                     {r->s->n_steps / 2, r->weight, r->weight + r->n}};
    whole x = make_gradient(w);
    if (carom_tape_gradient(tape, 2, bars, &x.g, &stats) < 0) {
        fail_msg("%s: %s", r->s->name, carom_world_error(w));
    }
    carom_tape_destroy(tape);
    *world = w;
    return x;
}

static void check_array(run *r, const carom_world *w, const whole *x, int a)
{
    double largest = 1e-3; /* of loss weights of size one: below this an entry counts as zero */
    for (int k = 0; k < count(w, a); k++) largest = fmax(largest, fabs(x->array[a][k]));
    r->array = a;
    for (int k = 0; k < count(w, a); k++) {
        double error;
        if (!has_meaning(w, a, k)) {
            assert_true(x->array[a][k] == 0);
            continue;
        }
        r->entry = k;
        /* Rounding asks for a long step, kinks for a short one: the best of three. */
        double best = fdiff(loss, r, r->s->step, &error);
        for (int i = 0; i < 2; i++) {
            double other_error;
            if (fabs(best - x->array[a][k]) <= DIFFERENCE_TOL * largest) break;
            const double other = fdiff(loss, r, r->s->step * (i ? 0.0625 : 32), &other_error);
            if (other_error < error) best = other;
            error = fmin(error, other_error);
        }
        if (fabs(best - x->array[a][k]) > DIFFERENCE_TOL * largest) {
            fail_msg("%s: d/d %s[%d] = %.12g, differences %.12g (+- %.2g), largest %.3g",
                     r->s->name, ARRAY_NAMES[a], k, x->array[a][k], best, error, largest);
        }
    }
}

static void check_scene(const scene *s)
{
    rng g = rng_from(12345);
    run r = {s, 0, NULL, NULL, -1, 0};
    carom_world *w = s->build();
    r.n = 3 * carom_world_n_bodies(w);
    carom_world_destroy(w);
    r.weight = calloc(4 * (size_t)r.n, sizeof(double));
    assert_non_null(r.weight);
    for (int k = 0; k < 4 * r.n; k++) r.weight[k] = rng_uniform(&g, -1, 1);
    whole x = reverse(&r, &w);
    for (int a = 0; a < N_ARRAYS; a++) check_array(&r, w, &x, a);
    free_gradient(&x);
    carom_world_destroy(w);
    free(r.weight);
}

static void against_differences(void **state)
{
    scene_integrator = CAROM_EULER;
    check_scene(*state);
}

static void located_against_differences(void **state)
{
    scene_integrator = CAROM_LOCATED;
    check_scene(*state);
    scene_integrator = CAROM_EULER;
}

static void sixth_order_against_differences(void **state)
{
    /* Its boxes sink in by 1e-5 so that faces meet: at this order the events of their first
     * millisecond make differences of gravity noisy by 1e-6. */
    if (((const scene *)*state)->build == pushed_stack) skip();
    scene_integrator = CAROM_LOCATED;
    scene_order = 6;
    check_scene(*state);
    scene_integrator = CAROM_EULER;
    scene_order = 2;
}

static void fixed_against_differences(void **state)
{
    scene_integrator = CAROM_FIXED;
    check_scene(*state);
    scene_integrator = CAROM_EULER;
}

/* --- closed forms ------------------------------------------------------------------------------
 */

/* Gradient of component k of the final q with respect to everything. */
static whole gradient_of_final(carom_world *w, int n_steps, int component)
{
    carom_tape *tape;
    double *seed = calloc(3 * (size_t)carom_world_n_bodies(w), sizeof(double));
    assert_non_null(seed);
    seed[component] = 1;
    assert_int_equal(carom_tape_create(w, NULL, &tape), CAROM_OK);
    for (int k = 0; k < n_steps; k++) assert_true(carom_tape_step(tape, NULL, NULL) >= 0);
    const carom_state_bar bar = {n_steps, seed, NULL};
    whole x = make_gradient(w);
    assert_int_equal(carom_tape_gradient(tape, 1, &bar, &x.g, NULL), CAROM_OK);
    carom_tape_destroy(tape);
    free(seed);
    return x;
}

/* Still sliding after n steps: x = v0 n h - mu g h^2 n (n+1)/2.  The paper's code has +25.83 for
 * dx/dmu: it solves the adjoint without transposing F. */
static void sliding_friction_sign(void **state)
{
    (void)state;
    const double h = 1.0 / 30;
    scene_integrator = CAROM_EULER;
    carom_world *w = scene_world(50, h);
    scene_floor(w, 0.25, 0);
    const int b = scene_box(w, 1, 0.5, 0.25, at(0, 0.25, 0), 0.25, 0);
    scene_push(w, b, 0, 20, 0);
    whole x = gradient_of_final(w, 30, 3 * b + 1);
    const double exact = -50 * h * h * 30 * 31 / 2;
    /* mu is the mean of two: both shares together are d/dmu */
    assert_near(x.g.friction[0] + x.g.friction[1], exact, 1e-9);
    assert_near(exact, -25.8333, 1e-4);
    assert_near(x.g.v0[3 * b + 1], 30 * h, 1e-11);
    free_gradient(&x);
    carom_world_destroy(w);
}

/* y(T) = r + e v T - e (y0 - r): dy/dy0 = -e, though every engine that is blind to the time of
 * impact says +1; dy/dv = -e T for v upward; dy/de = v T - (y0 - r); dy/dr = 1 + e. */
static void wall_bounce(void **state)
{
    (void)state;
    const double e = 0.7;
    const double v = 2;
    carom_world *w = scene_world(0, 1.0 / 60);
    scene_floor(w, 0, e);
    const int b = scene_disc(w, 1, 0.2, 0, 1.03, 0, e);
    scene_push(w, b, 0, 0, -v);
    whole x = gradient_of_final(w, 60, 3 * b + 2);
    assert_near(x.g.q0[3 * b + 2], -e, 1e-11);
    assert_near(x.g.v0[3 * b + 2], -e * 1, 1e-11);
    assert_near(x.g.restitution[0] + x.g.restitution[1], v - (1.03 - 0.2), 1e-11);
    assert_near(x.g.radius[1], 1 + e, 1e-11);
    assert_near(x.g.q0[2], 1 + e, 1e-11); /* the floor moves up */
    free_gradient(&x);
    carom_world_destroy(w);
}

/* The same with the impact exactly on the border of two steps. */
static void bounce_on_a_border(void **state)
{
    (void)state;
    carom_world *w = scene_world(0, 1.0 / 16);
    scene_floor(w, 0, 0.5);
    const int b = scene_disc(w, 1, 0.25, 0, 1.25, 0, 0.5);
    scene_push(w, b, 0, 0, -2);
    whole x = gradient_of_final(w, 16, 3 * b + 2);
    assert_near(x.g.q0[3 * b + 2], -0.5, 1e-11);
    assert_near(x.g.v0[3 * b + 2], -0.5, 1e-11);
    free_gradient(&x);
    carom_world_destroy(w);
}

/* Equal discs head on, e = 1: they change places.  With x1 + r and x2 - r moving like points:
 * x2(T) = x1 + 2 r + v1 T. */
static void head_on(void **state)
{
    (void)state;
    carom_world *w = scene_world(0, 1.0 / 60);
    scene_disc(w, 1, 0.2, -1, 0, 0, 1);
    scene_disc(w, 1, 0.2, 1, 0, 0, 1);
    scene_push(w, 0, 0, 2, 0);
    scene_push(w, 1, 0, -1, 0);
    whole x = gradient_of_final(w, 60, 4);
    assert_near(x.g.q0[1], 1, 1e-11);
    assert_near(x.g.q0[4], 0, 1e-11);
    assert_near(x.g.v0[1], 1, 1e-11);
    assert_near(x.g.v0[4], 0, 1e-11);
    assert_near(x.g.radius[0] + x.g.radius[1], 2, 1e-11);
    free_gradient(&x);
    carom_world_destroy(w);
}

/* Free flight: x = x0 + v T + F/m h^2 n (n+1)/2; dx/dm = -F/m^2 h^2 n (n+1)/2. */
static void free_flight(void **state)
{
    (void)state;
    const double h = 0.1;
    scene_integrator = CAROM_EULER;
    carom_world *w = scene_world(9.81, h);
    const int b = scene_disc(w, 2, 0.2, 0, 0, 0, 0);
    w->force[3 * b + 1] = 3;
    whole x = gradient_of_final(w, 10, 3 * b + 1);
    const double s = h * h * 10 * 11 / 2;
    assert_near(x.g.q0[3 * b + 1], 1, 1e-13);
    assert_near(x.g.v0[3 * b + 1], 1, 1e-13);
    assert_near(x.g.force[3 * b + 1], s / 2, 1e-13);
    assert_near(x.g.mass[b], -3.0 / 4 * s, 1e-13);
    assert_near(x.g.gravity[0], s, 1e-13);
    assert_near(x.g.gravity[1], 0, 1e-13);
    assert_near(x.g.dt[0], 2 * 1.5 * s / h, 1e-12); /* x ~ h^2 */
    free_gradient(&x);
    carom_world_destroy(w);
}

/* A sliding box stops after v^2 / (2 mu g), wherever that falls within a step. */
static void stopping_distance(void **state)
{
    (void)state;
    static const double dts[3] = {1.0 / 60, 1.0 / 7, 0.31};
    const double mu = 0.4;
    const double v = 3;
    const double g = 9.81;
    for (int k = 0; k < 3; k++) {
        scene_integrator = CAROM_LOCATED;
        carom_world *w = scene_world(g, dts[k]);
        scene_floor(w, 0.5, 0);
        const int b = scene_box(w, 2, 0.5, 0.25, at(0, 0.25, 0), 0.3, 0);
        scene_push(w, b, 0, v, 0);
        whole x = gradient_of_final(w, (int)(1.5 / dts[k]), 3 * b + 1);
        const double d = v * v / (2 * mu * g);
        /* rounding over some hundred sub-steps */
        assert_near_case("distance", k, carom_world_q(w)[3 * b + 1], d, 1e-12);
        assert_near_case("d/dv", k, x.g.v0[3 * b + 1], v / (mu * g), 1e-10);
        assert_near_case("d/dmu", k, x.g.friction[0] + x.g.friction[b], -d / mu, 1e-10 * d / mu);
        assert_near_case("d/dg", k, x.g.gravity[1], d / g, 1e-10); /* gravity = -g */
        assert_near_case("d/dm", k, x.g.mass[b], 0, 1e-10);
        free_gradient(&x);
        carom_world_destroy(w);
    }
    scene_integrator = CAROM_EULER;
}

/* A disc slides until t1 = v / (3 mu g) and rolls at 2 v / 3 from x1 = 5 v t1 / 6:
 * x(T) = 2/3 v T + v^2 / (18 mu g). */
static void slide_then_roll(void **state)
{
    (void)state;
    static const double dts[3] = {1.0 / 60, 1.0 / 7, 0.25};
    const double mu = 0.4;
    const double v = 3;
    const double g = 9.81;
    for (int k = 0; k < 3; k++) {
        const int n = (int)(1.5 / dts[k]);
        const double T = n * dts[k];
        scene_integrator = CAROM_LOCATED;
        carom_world *w = scene_world(g, dts[k]);
        scene_floor(w, 0.5, 0);
        const int b = scene_disc(w, 2, 0.5, 0, 0.5, 0.3, 0);
        scene_push(w, b, 0, v, 0);
        whole x = gradient_of_final(w, n, 3 * b + 1);
        const double c = v / (18 * mu * g);
        assert_near_case("x", k, carom_world_q(w)[3 * b + 1], 2.0 / 3 * v * T + v * c, 1e-12);
        assert_near_case("d/dv", k, x.g.v0[3 * b + 1], 2.0 / 3 * T + 2 * c, 1e-10);
        assert_near_case("d/dmu", k, x.g.friction[0] + x.g.friction[b], -v * c / mu, 1e-10);
        assert_near_case("d/ddt", k, x.g.dt[0], 2.0 / 3 * v * n, 1e-9);
        free_gradient(&x);
        carom_world_destroy(w);
    }
    scene_integrator = CAROM_EULER;
}

/* A disc slides without friction; a little of it would slow it: x(T) = v T - mu g T^2 / 2, from the
 * right at mu = 0. */
static void first_of_friction(void **state)
{
    (void)state;
    static const carom_integrator maps[2] = {CAROM_LOCATED, CAROM_FIXED};
    for (int k = 0; k < 2; k++) {
        scene_integrator = maps[k];
        carom_world *w = scene_world(9.81, 1.0 / 50);
        scene_floor(w, 0, 0);
        const int b = scene_disc(w, 3, 0.5, 0, 0.5, 0, 0);
        scene_push(w, b, 0, -2, 0);
        whole x = gradient_of_final(w, 50, 3 * b + 1);
        assert_near(x.g.friction[0] + x.g.friction[b], 0.5 * 9.81, 1e-10);
        free_gradient(&x);
        carom_world_destroy(w);
    }
    scene_integrator = CAROM_EULER;
}

int main(void)
{
    static const CMUnitTestFunction maps[4] = {against_differences, located_against_differences,
                                               sixth_order_against_differences,
                                               fixed_against_differences};
    struct CMUnitTest tests[4 * N_SCENES + 8];
    memset(tests, 0, sizeof tests);
    for (int k = 0; k < 4 * N_SCENES; k++) {
        tests[k].name = SCENES[k % N_SCENES].name;
        tests[k].test_func = maps[k / N_SCENES];
        tests[k].initial_state = (void *)(size_t)&SCENES[k % N_SCENES];
    }
    const struct CMUnitTest closed[8] = {
        cmocka_unit_test(first_of_friction), cmocka_unit_test(stopping_distance),
        cmocka_unit_test(slide_then_roll),   cmocka_unit_test(sliding_friction_sign),
        cmocka_unit_test(wall_bounce),       cmocka_unit_test(bounce_on_a_border),
        cmocka_unit_test(head_on),           cmocka_unit_test(free_flight)};
    memcpy(tests + 4 * N_SCENES, closed, sizeof closed);
    return cmocka_run_group_tests(tests, NULL, NULL);
}
