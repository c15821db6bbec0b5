/* Gradients of runs with joints against central differences, by every number of a joint. */
#include "fdiff.h"
#include "near.h"
#include "rng.h"
#include "scenes.h"

#include "carom/grad.h"
#include "libsolver/world/internal.h" /* to move single numbers of a world for the differences */

#include <stdlib.h>

/* Differences of fourth order of runs of 20 steps; relative to the largest entry of an array. */
static const double DIFFERENCE_TOL = 1e-6;
static const double STEP = 2e-5;
enum { N_STEPS = 20, MAX_BODIES = 4, MAX_NUMBERS = 16 };

typedef struct scene {
    const char *name;
    carom_joint_kind kind;
    int to_world; /* 1: the joint holds the first body to the world, 0: two moving bodies */
    double lower; /* both 0: no limits; else reached within the run */
    double upper;
    double stiffness, damping;
    double motor_speed, motor_limit;
} scene;

static const scene SCENES[] = {
    {"revolute", CAROM_REVOLUTE, 0, 0, 0, 0, 0, 0, 0},
    {"prismatic", CAROM_PRISMATIC, 0, 0, 0, 0, 0, 0, 0},
    {"weld", CAROM_WELD, 0, 0, 0, 0, 0, 0, 0},
    {"wheel", CAROM_WHEEL, 0, 0, 0, 0, 0, 0, 0},
    {"distance", CAROM_DISTANCE, 0, 0, 0, 0, 0, 0, 0},
    {"lock x", CAROM_LOCK_X, 0, 0, 0, 0, 0, 0, 0},
    {"lock y", CAROM_LOCK_Y, 0, 0, 0, 0, 0, 0, 0},
    {"lock angle", CAROM_LOCK_ANGLE, 0, 0, 0, 0, 0, 0, 0},
    {"rail", CAROM_PRISMATIC, 1, 0, 0, 0, 0, 0, 0},
    {"wheel of the world", CAROM_WHEEL, 1, 0, 0, 0, 0, 0, 0},
    {"rod of the world", CAROM_DISTANCE, 1, 0, 0, 0, 0, 0, 0},
    {"x of the world", CAROM_LOCK_X, 1, 0, 0, 0, 0, 0, 0},
    {"rope", CAROM_ROPE, 0, 0.6, 0.68, 0, 0, 0, 0},
    {"stop of a hinge", CAROM_REVOLUTE, 0, -0.5, 0.4, 0, 0, 0, 0},
    {"stop of a slider", CAROM_PRISMATIC, 0, -0.06, 0.08, 0, 0, 0, 0},
    {"stop of a wheel", CAROM_WHEEL, 0, -0.1, 0.1, 0, 0, 0, 0},
    {"stop of a rail", CAROM_PRISMATIC, 1, -0.5, 0.1, 0, 0, 0, 0},
    {"spring of a hinge", CAROM_REVOLUTE, 0, 0, 0, 3, 0.4, 0, 0},
    {"spring of a slider", CAROM_PRISMATIC, 0, 0, 0, 40, 3, 0, 0},
    {"stiff spring of a wheel", CAROM_WHEEL, 0, 0, 0, 9000, 30, 0, 0},
    {"spring", CAROM_ROPE, 0, 0, 0, 60, 5, 0, 0},
    {"target", CAROM_TARGET, 1, 0, 0, 80, 2, 0, 0},
    {"motor of a hinge that holds", CAROM_REVOLUTE, 0, 0, 0, 0, 0, 2, 50},
    {"motor of a hinge at its limit", CAROM_REVOLUTE, 0, 0, 0, 0, 0, 9, 0.3},
    {"motor of a slider that holds", CAROM_PRISMATIC, 0, 0, 0, 0, 0, 0.3, 50},
    {"motor of a slider at its limit", CAROM_PRISMATIC, 0, 0, 0, 0, 0, -4, 2},
    {"car wheel", CAROM_WHEEL, 0, -0.1, 0.1, 40, 3, 9, 0.2},
};
enum { N_SCENES = sizeof SCENES / sizeof SCENES[0] };

static carom_pose at(double x, double y, double angle)
{
    const carom_pose p = {angle, x, y};
    return p;
}

static void join(carom_world *w, const scene *s, int a, int b, double x, double y)
{
    carom_joint_def d = carom_joint_defaults(s->kind);
    if (s->lower < s->upper) {
        d.lower = s->lower;
        d.upper = s->upper;
        d.restitution = 0.4;
    }
    d.stiffness = s->stiffness;
    d.damping = s->damping;
    d.rest = s->stiffness > 0 && s->kind != CAROM_TARGET ? 0.1 : 0;
    d.motor_speed = s->motor_speed;
    d.motor_limit = s->motor_limit;
    d.body_a = a;
    d.body_b = b;
    d.anchor.x = x;
    d.anchor.y = y;
    d.anchor_b.x = x + 0.5;
    d.anchor_b.y = y - 0.4;
    d.axis.x = 0.6;
    d.axis.y = -1.1;
    d.collide = 0;
    if (carom_world_add_joint(w, &d, NULL) < 0) fail_msg("%s", carom_world_error(w));
}

/* Two boxes in flight, joined; a ball on its way hits the second. */
static carom_world *build(const scene *s)
{
    carom_world *w = scene_world(9.81, 1.0 / 60);
    const int world = scene_anchor(w);
    const int a = scene_box(w, 1.4, 0.4, 0.1, at(0.3, 0.1, 0.2), 0.3, 0.5);
    const int b = scene_box(w, 0.6, 0.3, 0.15, at(1.1, -0.2, -0.4), 0.2, 0.4);
    const int ball = scene_disc(w, 0.5, 0.15, 1.3, 0.75, 0.3, 0.6);
    join(w, s, s->to_world ? world : a, s->to_world ? a : b, 0.7, 0.1);
    const scene hinge = {"hinge", CAROM_REVOLUTE, 0, 0, 0, 0, 0, 0, 0};
    if (s->to_world) join(w, &hinge, a, b, 0.7, -0.05);
    scene_push(w, a, 2, -0.3, 0.9);
    scene_push(w, b, -1, 0.4, 1.5);
    scene_push(w, ball, 1, -0.5, -3);
    assert_true(carom_world_seal(w) >= 0);
    return w;
}

enum {
    Q0,
    V0,
    MASS,
    INERTIA,
    GRAVITY,
    DT,
    ANCHORS,
    AXES,
    ANGLES,
    LENGTHS,
    LOWER,
    UPPER,
    STIFFNESS,
    DAMPING,
    REST,
    SPEED,
    LIMIT,
    N_ARRAYS
};
static const char *const NAMES[N_ARRAYS] = {
    "q0",        "v0",      "mass",   "inertia",     "gravity",    "dt",
    "anchors",   "axes",    "angles", "lengths",     "lower",      "upper",
    "stiffness", "damping", "rest",   "motor_speed", "motor_limit"};

static int count(const carom_world *w, int array)
{
    if (array >= ANCHORS) return (array == ANCHORS ? 4 : 1) * w->n_joints;
    if (array == GRAVITY) return 2;
    if (array == DT) return 1;
    return array <= V0 ? 3 * w->n_bodies : w->n_bodies;
}

static double *number(carom_world *w, int array, int k)
{
    switch (array) {
    case Q0: return &w->q[k];
    case V0: return &w->v[k];
    case MASS: return &w->mass[k];
    case INERTIA: return &w->inertia[k];
    case GRAVITY: return &w->settings.gravity[k];
    case DT: return &w->settings.dt;
    case AXES: return &w->joints[k].axis;
    case ANGLES: return &w->joints[k].angle;
    case LENGTHS: return &w->joints[k].length;
    case LOWER: return &w->joints[k].lower;
    case UPPER: return &w->joints[k].upper;
    case STIFFNESS: return &w->joints[k].stiffness;
    case DAMPING: return &w->joints[k].damping;
    case REST: return &w->joints[k].rest;
    case SPEED: return &w->joints[k].motor_speed;
    case LIMIT: return &w->joints[k].motor_limit;
    default: break;
    }
    crm_joint *j = &w->joints[k / 4];
    double *const anchors[4] = {&j->local_a.x, &j->local_a.y, &j->local_b.x, &j->local_b.y};
    return anchors[k % 4];
}

/* A static body has neither mass nor velocity; a joint may have no limits. */
static int has_meaning(const carom_world *w, int array, int k)
{
    const int body = array == V0 ? k / 3 : k;
    if (array == LOWER) return w->joints[k].lower > -HUGE_VAL;
    if (array == UPPER) return w->joints[k].upper < HUGE_VAL;
    if (array == STIFFNESS || array == DAMPING) return w->joints[k].stiffness > 0;
    if (array == LIMIT) return w->joints[k].motor_limit > 0;
    if (array != V0 && array != MASS && array != INERTIA) return 1;
    return w->bodies[body].type == CAROM_DYNAMIC;
}

typedef struct run {
    const scene *s;
    double weight[2][3 * MAX_BODIES]; /* of q, v at the end */
    int array, entry;                 /* the number that is moved */
} run;

static double loss(double t, void *user)
{
    const run *r = user;
    carom_world *w = build(r->s);
    *number(w, r->array, r->entry) += t;
    scene_run(w, N_STEPS, NULL);
    double sum = 0;
    for (int k = 0; k < 3 * w->n_bodies; k++) {
        sum += r->weight[0][k] * w->q[k] + r->weight[1][k] * w->v[k];
    }
    carom_world_destroy(w);
    return sum;
}

static void reverse(const run *r, carom_world *w, double x[N_ARRAYS][MAX_NUMBERS])
{
    carom_gradient g = {0};
    carom_tape *tape;
    const carom_state_bar bar = {N_STEPS, r->weight[0], r->weight[1]};
    g.q0 = x[Q0];
    g.v0 = x[V0];
    g.mass = x[MASS];
    g.inertia = x[INERTIA];
    g.gravity = x[GRAVITY];
    g.dt = x[DT];
    g.anchors = (carom_vec2 *)x[ANCHORS];
    g.axes = x[AXES];
    g.angles = x[ANGLES];
    g.lengths = x[LENGTHS];
    g.lower = x[LOWER];
    g.upper = x[UPPER];
    g.stiffness = x[STIFFNESS];
    g.damping = x[DAMPING];
    g.rest = x[REST];
    g.motor_speed = x[SPEED];
    g.motor_limit = x[LIMIT];
    assert_int_equal(carom_tape_create(w, NULL, &tape), CAROM_OK);
    for (int k = 0; k < N_STEPS; k++) {
        if (carom_tape_step(tape, NULL, NULL) < 0) fail_msg("%s", carom_world_error(w));
    }
    assert_int_equal(carom_tape_gradient(tape, 1, &bar, &g, NULL), CAROM_OK);
    carom_tape_destroy(tape);
}

static void check_array(run *r, carom_world *w, int a, const double *x)
{
    /* events are located to 1e-13 m, which differences magnify to 1e-8: that counts as zero */
    double largest = 1e-2;
    for (int k = 0; k < count(w, a); k++) largest = fmax(largest, fabs(x[k]));
    r->array = a;
    for (int k = 0; k < count(w, a); k++) {
        double error;
        if (!has_meaning(w, a, k)) continue;
        r->entry = k;
        const double step = STEP * fmax(1, fabs(*number(w, a, k)));
        double expected = fdiff(loss, r, step, &error);
        /* an event that crosses the end of a step kinks the differences */
        if (error > DIFFERENCE_TOL * largest) expected = fdiff(loss, r, step / 32, &error);
        if (fabs(x[k] - expected) <= DIFFERENCE_TOL * largest) continue;
        fail_msg("%s, integrator %d: d/d %s[%d] = %.12g, differences %.12g (+- %.2g)", r->s->name,
                 (int)scene_integrator, NAMES[a], k, x[k], expected, error);
    }
}

static void check_scene(const scene *s)
{
    rng g = rng_from(99);
    run r = {s, {{0}, {0}}, -1, 0};
    double x[N_ARRAYS][MAX_NUMBERS];
    for (int k = 0; k < 6 * MAX_BODIES; k++) r.weight[k % 2][k / 2] = rng_uniform(&g, -1, 1);
    carom_world *w = build(s);
    reverse(&r, w, x);
    assert_true(carom_world_n_bodies(w) <= MAX_BODIES);
    for (int a = 0; a < N_ARRAYS; a++) check_array(&r, w, a, x[a]);
    carom_world_destroy(w);
}

static void euler(void **state)
{
    scene_integrator = CAROM_EULER;
    check_scene(*state);
}

static void located(void **state)
{
    scene_integrator = CAROM_LOCATED;
    check_scene(*state);
}

static void fourth_order(void **state)
{
    scene_integrator = CAROM_LOCATED;
    scene_order = 4;
    check_scene(*state);
    scene_order = 2;
}

/* A disc that hangs still on a rod of length l: y = (anchor of the world) - l - (anchor of the
 * disc). */
static void closed_forms(void **state)
{
    (void)state;
    for (int i = 0; i < 2; i++) {
        scene_integrator = i ? CAROM_LOCATED : CAROM_EULER;
        carom_world *w = scene_world(9.81, 1.0 / 60);
        const int world = scene_anchor(w);
        const int b = scene_disc(w, 1, 0.2, 0, -2, 0, 0);
        carom_joint_def d = carom_joint_defaults(CAROM_DISTANCE);
        d.body_a = world;
        d.body_b = b;
        d.anchor_b.y = -2;
        assert_int_equal(carom_world_add_joint(w, &d, NULL), CAROM_OK);
        carom_tape *tape;
        assert_int_equal(carom_tape_create(w, NULL, &tape), CAROM_OK);
        for (int k = 0; k < 10; k++) assert_true(carom_tape_step(tape, NULL, NULL) >= 0);
        const double q_bar[6] = {0, 0, 0, 0, 0, 1};
        const carom_state_bar bar = {10, q_bar, NULL};
        carom_vec2 anchors[2];
        double length;
        carom_gradient g = {0};
        g.anchors = anchors;
        g.lengths = &length;
        assert_int_equal(carom_tape_gradient(tape, 1, &bar, &g, NULL), CAROM_OK);
        assert_near(length, -1, 1e-10);
        assert_near(anchors[0].y, 1, 1e-10);
        assert_near(anchors[1].y, -1, 1e-10);
        carom_tape_destroy(tape);
        carom_world_destroy(w);
    }
}

int main(void)
{
    static void (*const maps[3])(void **) = {euler, located, fourth_order};
    struct CMUnitTest tests[3 * N_SCENES + 1];
    memset(tests, 0, sizeof tests);
    for (int k = 0; k < 3 * N_SCENES; k++) {
        tests[k].name = SCENES[k / 3].name;
        tests[k].test_func = maps[k % 3];
        tests[k].initial_state = (void *)(size_t)&SCENES[k / 3];
    }
    const struct CMUnitTest closed = cmocka_unit_test(closed_forms);
    tests[3 * N_SCENES] = closed;
    return cmocka_run_group_tests(tests, NULL, NULL);
}
