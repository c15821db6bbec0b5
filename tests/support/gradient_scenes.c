#include "gradient_scenes.h"

#include "near.h"
#include "scenes.h"

#include "libsolver/world/internal.h" /* to move bodies of a sealed world */

#define STEP 2e-5
/* Two faces in contact are both candidates for the reference face.  Turned by d against each other
 * their separations differ by d^2, which decides once it is above the tie tolerance of 1e-14: the
 * normal then jumps by d.  Differences have to stay below. */
#define STEP_OF_FACES 1e-7

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

static carom_world *sliding_box(const gradient_scene *s)
{
    (void)s;
    carom_world *w = scene_world(50, 1.0 / 30);
    scene_floor(w, 0.2, 0);
    const int b = scene_box(w, 1.3, 0.5, 0.25, at(0, 0.25, 0), 0.3, 0);
    scene_push(w, b, 0, 20, 0);
    sink(w, 1e-4);
    return w;
}

static carom_world *slide_to_roll(const gradient_scene *s)
{
    (void)s;
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

static carom_world *oblique_stick(const gradient_scene *s)
{
    (void)s;
    return oblique(0.6, 1);
}

static carom_world *oblique_slip(const gradient_scene *s)
{
    (void)s;
    return oblique(0.08, 3);
}

static carom_world *two_discs(const gradient_scene *s)
{
    (void)s;
    carom_world *w = scene_world(0, 1.0 / 60);
    scene_disc(w, 1, 0.5, -1.5, 0.1, 0.3, 0.8);
    const int b = scene_disc(w, 2.5, 0.4, 0, 0, 0.1, 0.6);
    scene_push(w, 0, 1, 3, 0.2);
    scene_push(w, b, 0, -0.1, 0);
    return w;
}

static carom_world *chain(const gradient_scene *s)
{
    (void)s;
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
static carom_world *uneven_chain(const gradient_scene *s)
{
    (void)s;
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
    /* A perturbation that changes the number of sub-steps jumps: see heavy_end. */
    w->settings.max_stiff = 1;
    scene_push(w, 3, 0, 2, -2);
    return w;
}

/* Light links under a heavy one: stiff joints divide each step into 4. */
static carom_world *heavy_end(const gradient_scene *s)
{
    (void)s;
    carom_world *w = scene_world(9.81, 1.0 / 60);
    int before = scene_anchor(w);
    for (int k = 0; k < 3; k++) {
        const double x = k * cos(0.3);
        const double y = -k * sin(0.3);
        const carom_pose mid = at(x + 0.5 * cos(0.3), y - 0.5 * sin(0.3), -0.3);
        const int b = scene_box(w, k < 2 ? 0.1 : 30, 0.5, 0.05, mid, 0, 0);
        const carom_vec2 pin = {x, y};
        assert_int_equal(carom_world_add_revolute(w, before, b, pin, NULL), CAROM_OK);
        before = b;
    }
    return w;
}

static carom_world *pushed_stack(const gradient_scene *s)
{
    (void)s;
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

static carom_world *tumbling_box(const gradient_scene *s)
{
    (void)s;
    carom_world *w = scene_world(9.81, 1.0 / 60);
    scene_floor(w, 0.3, 0.4);
    const int b = scene_box(w, 1.1, 0.4, 0.2, at(0, 0.9, 0.35), 0.3, 0.4);
    scene_push(w, b, 1, 1, 0);
    return w;
}

static carom_world *pendulum(const gradient_scene *s)
{
    (void)s;
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

static carom_world *rounded_on_slope(const gradient_scene *s)
{
    (void)s;
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

static carom_world *kinematic_belt(const gradient_scene *s)
{
    (void)s;
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

/* Damped parts on a damped pendulum, one of which does not turn; a damped ball that slides, and
 * hits.
 */
static carom_world *damped_parts(const gradient_scene *s)
{
    carom_world *w = pendulum(s);
    const int ball = scene_disc(w, 0.8, 0.2, -0.6, 0.9, 0.3, 0.4);
    const int locked = scene_box(w, 0.5, 0.2, 0.1, at(2.6, 0.3, 0.3), 0.3, 0);
    const carom_vec2 pin = {2.2, 0.1};
    assert_int_equal(carom_world_add_revolute(w, 2, locked, pin, NULL), CAROM_OK);
    w->inertia[locked] = HUGE_VAL;
    for (int b = 1; b < carom_world_n_bodies(w); b++) {
        w->bodies[b].damping[0] = b == ball ? 0 : 0.4 * b;
        w->bodies[b].damping[1] = 0.3 + 0.2 * b;
        w->bodies[b].gravity_scale = 1.5 - 0.2 * b;
    }
    scene_push(w, ball, 2, 3.5, -1);
    return w;
}

const gradient_scene gradient_scenes[] = {
    {"damped parts", damped_parts, 30, STEP, 0},
    {"sliding box", sliding_box, 30, STEP, 0},
    {"slide to roll", slide_to_roll, 60, STEP, 0},
    {"oblique stick", oblique_stick, 30, STEP, 0},
    {"oblique slip", oblique_slip, 30, STEP, 0},
    {"two discs", two_discs, 40, STEP, 0},
    {"chain of ten", chain, 15, STEP, 0},
    {"uneven chain", uneven_chain, 20, 1e-6, 0},
    {"heavy end", heavy_end, 10, 1e-6, 0},
    {"pushed stack", pushed_stack, 20, STEP_OF_FACES, 0},
    {"tumbling box", tumbling_box, 30, STEP, 0},
    {"double pendulum", pendulum, 40, STEP, 0},
    {"rounded hull on slope", rounded_on_slope, 40, STEP, 0},
    {"box on a belt", kinematic_belt, 20, STEP, 0},
};
const int n_gradient_scenes = sizeof gradient_scenes / sizeof gradient_scenes[0];

/* --- joints ------------------------------------------------------------------------------------
 */

typedef struct joint_case {
    carom_joint_kind kind;
    int to_world; /* 1: the joint holds the first body to the world, 0: two moving bodies */
    double lower; /* both 0: no limits; else reached within the run */
    double upper;
    double stiffness, damping;
    double motor_speed, motor_limit;
} joint_case;

static const joint_case JOINTS[] = {
    {CAROM_REVOLUTE, 0, 0, 0, 0, 0, 0, 0},         /* revolute */
    {CAROM_PRISMATIC, 0, 0, 0, 0, 0, 0, 0},        /* prismatic */
    {CAROM_WELD, 0, 0, 0, 0, 0, 0, 0},             /* weld */
    {CAROM_WHEEL, 0, 0, 0, 0, 0, 0, 0},            /* wheel */
    {CAROM_DISTANCE, 0, 0, 0, 0, 0, 0, 0},         /* distance */
    {CAROM_LOCK_X, 0, 0, 0, 0, 0, 0, 0},           /* lock x */
    {CAROM_LOCK_Y, 0, 0, 0, 0, 0, 0, 0},           /* lock y */
    {CAROM_LOCK_ANGLE, 0, 0, 0, 0, 0, 0, 0},       /* lock angle */
    {CAROM_PRISMATIC, 1, 0, 0, 0, 0, 0, 0},        /* rail */
    {CAROM_WHEEL, 1, 0, 0, 0, 0, 0, 0},            /* wheel of the world */
    {CAROM_DISTANCE, 1, 0, 0, 0, 0, 0, 0},         /* rod of the world */
    {CAROM_LOCK_X, 1, 0, 0, 0, 0, 0, 0},           /* x of the world */
    {CAROM_ROPE, 0, 0.6, 0.68, 0, 0, 0, 0},        /* rope */
    {CAROM_REVOLUTE, 0, -0.5, 0.4, 0, 0, 0, 0},    /* stop of a hinge */
    {CAROM_PRISMATIC, 0, -0.06, 0.08, 0, 0, 0, 0}, /* stop of a slider */
    {CAROM_WHEEL, 0, -0.1, 0.1, 0, 0, 0, 0},       /* stop of a wheel */
    {CAROM_PRISMATIC, 1, -0.5, 0.1, 0, 0, 0, 0},   /* stop of a rail */
    {CAROM_REVOLUTE, 0, 0, 0, 3, 0.4, 0, 0},       /* spring of a hinge */
    {CAROM_PRISMATIC, 0, 0, 0, 40, 3, 0, 0},       /* spring of a slider */
    {CAROM_WHEEL, 0, 0, 0, 9000, 30, 0, 0},        /* stiff spring of a wheel */
    {CAROM_ROPE, 0, 0, 0, 60, 5, 0, 0},            /* spring */
    {CAROM_TARGET, 1, 0, 0, 80, 2, 0, 0},          /* target */
    {CAROM_REVOLUTE, 0, 0, 0, 0, 0, 2, 50},        /* motor of a hinge that holds */
    {CAROM_REVOLUTE, 0, 0, 0, 0, 0, 9, 0.3},       /* motor of a hinge at its limit */
    {CAROM_PRISMATIC, 0, 0, 0, 0, 0, 0.3, 50},     /* motor of a slider that holds */
    {CAROM_PRISMATIC, 0, 0, 0, 0, 0, -4, 2},       /* motor of a slider at its limit */
    {CAROM_WHEEL, 0, -0.1, 0.1, 40, 3, 9, 0.2},    /* car wheel */
};

static void join(carom_world *w, const joint_case *s, int a, int b, double x, double y)
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
static carom_world *two_joined(const gradient_scene *scene)
{
    const joint_case *s = &JOINTS[scene->joint];
    carom_world *w = scene_world(9.81, 1.0 / 60);
    const int world = scene_anchor(w);
    const int a = scene_box(w, 1.4, 0.4, 0.1, at(0.3, 0.1, 0.2), 0.3, 0.5);
    const int b = scene_box(w, 0.6, 0.3, 0.15, at(1.1, -0.2, -0.4), 0.2, 0.4);
    const int ball = scene_disc(w, 0.5, 0.15, 1.3, 0.75, 0.3, 0.6);
    join(w, s, s->to_world ? world : a, s->to_world ? a : b, 0.7, 0.1);
    const joint_case hinge = {CAROM_REVOLUTE, 0, 0, 0, 0, 0, 0, 0};
    if (s->to_world) join(w, &hinge, a, b, 0.7, -0.05);
    scene_push(w, a, 2, -0.3, 0.9);
    scene_push(w, b, -1, 0.4, 1.5);
    scene_push(w, ball, 1, -0.5, -3);
    assert_true(carom_world_seal(w) >= 0);
    return w;
}

const gradient_scene gradient_joint_scenes[] = {
    {"revolute", two_joined, 20, 2e-5, 0},
    {"prismatic", two_joined, 20, 2e-5, 1},
    {"weld", two_joined, 20, 2e-5, 2},
    {"wheel", two_joined, 20, 2e-5, 3},
    {"distance", two_joined, 20, 2e-5, 4},
    {"lock x", two_joined, 20, 2e-5, 5},
    {"lock y", two_joined, 20, 2e-5, 6},
    {"lock angle", two_joined, 20, 2e-5, 7},
    {"rail", two_joined, 20, 2e-5, 8},
    {"wheel of the world", two_joined, 20, 2e-5, 9},
    {"rod of the world", two_joined, 20, 2e-5, 10},
    {"x of the world", two_joined, 20, 2e-5, 11},
    {"rope", two_joined, 20, 2e-5, 12},
    {"stop of a hinge", two_joined, 20, 2e-5, 13},
    {"stop of a slider", two_joined, 20, 2e-5, 14},
    {"stop of a wheel", two_joined, 20, 2e-5, 15},
    {"stop of a rail", two_joined, 20, 2e-5, 16},
    {"spring of a hinge", two_joined, 20, 2e-5, 17},
    {"spring of a slider", two_joined, 20, 2e-5, 18},
    {"stiff spring of a wheel", two_joined, 20, 2e-5, 19},
    {"spring", two_joined, 20, 2e-5, 20},
    {"target", two_joined, 20, 2e-5, 21},
    {"motor of a hinge that holds", two_joined, 20, 2e-5, 22},
    {"motor of a hinge at its limit", two_joined, 20, 2e-5, 23},
    {"motor of a slider that holds", two_joined, 20, 2e-5, 24},
    {"motor of a slider at its limit", two_joined, 20, 2e-5, 25},
    {"car wheel", two_joined, 20, 2e-5, 26},
};
const int n_gradient_joint_scenes = sizeof gradient_joint_scenes / sizeof gradient_joint_scenes[0];
