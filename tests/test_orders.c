/* Orders through events: contacts that open, stop, begin to slip or bounce within a step cost none
 * of the order, of the state or of its gradient.  docs/step.md.
 *
 * Usage: test_orders [print]: what is observed. */
#include "near.h"
#include "scenes.h"

#include "carom/grad.h"

#include <string.h>

static const double G = 9.81;
/* An observed order is within this of that of the scheme. */
static const double ORDER_TOL = 0.4;
/* Rounding of a thousand steps, and of the times of events. */
static const double REFERENCE_TOL = 1e-10;
static int verbose = 0;
enum { N_ORDERS = 3, MAX_BODIES = 4, N_NUMBERS = 2 + 4 * MAX_BODIES + 1 };

/* --- scenes; each returns the body that is looked at */

/* A block, tilted on a corner, comes down on the other and rocks on. */
static int rocking_block(carom_world *w)
{
    const double a = 0.25;
    const double hx = 0.2;
    const double hy = 0.5;
    scene_floor(w, 5, 0);
    const carom_pose pose = {a, hx * cos(a) - hy * sin(a), hx * sin(a) + hy * cos(a)};
    return scene_box(w, 1, hx, hy, pose, 5, 0);
}

/* A block that cannot turn, on one point, held by a spring of V w < mu g on a belt of speed V: it
 * slips at x = x_s (1 - cos wt), x_s = mu g / w^2, sticks from x' = V on, and slips from x = x_s on
 * at x = x_s + V/w sin. */
static const double BELT = 0.7;
static const double STIFFNESS = 30;
static const double MU = 0.4;
static int stick_slip(carom_world *w)
{
    scene_belt(w, BELT, MU);
    const carom_vec2 center = {0, 0};
    const carom_shape round = {0.2, 1, &center};
    carom_body_def d = carom_body_at(CAROM_DYNAMIC, 0, 0.2);
    d.shapes = &round;
    d.n_shapes = 1;
    d.mass = 1;
    d.inertia = INFINITY;
    d.friction = MU;
    d.restitution = 0;
    int b;
    assert_int_equal(carom_world_add_body(w, &d, &b), CAROM_OK);
    carom_joint_def j = carom_joint_defaults(CAROM_ROPE);
    j.body_a = scene_anchor(w);
    j.body_b = b;
    j.anchor = (carom_vec2){-2, 0.2};
    j.anchor_b = (carom_vec2){0, 0.2};
    j.rest = 2;
    j.stiffness = STIFFNESS;
    assert_int_equal(carom_world_add_joint(w, &j, NULL), CAROM_OK);
    return b;
}

static double stick_slip_at(double t, double mu, double g)
{
    const double w = sqrt(STIFFNESS);
    const double far = mu * g / (w * w);
    const double stops = asin(BELT / (far * w)) / w;
    const double x = far * (1 - cos(w * stops));
    const double slips = stops + (far - x) / BELT;
    if (t < stops) return far * (1 - cos(w * t));
    return t < slips ? x + BELT * (t - stops) : far + BELT / w * sin(w * (t - slips));
}

/* Its lower link's end comes down on the floor and bounces. */
static int pendulum_on_floor(carom_world *w)
{
    const carom_vec2 floor[4] = {{-5, -3}, {5, -3}, {5, -1.9}, {-5, -1.9}};
    const carom_shape shape = {0, 4, floor};
    carom_body_def d = carom_body_at(CAROM_STATIC, 0, 0);
    d.shapes = &shape;
    d.n_shapes = 1;
    d.friction = 0.3;
    d.restitution = 0.6;
    assert_int_equal(carom_world_add_body(w, &d, NULL), CAROM_OK);
    return scene_links(w, 2);
}

/* Where an event falls in its step moves errors up and down; the largest over N_PHASES numbers of
 * steps from `coarse` on, and over twice as many, show the order.  `coarse` is where the power law
 * has begun and rounding, 1e-12, has not. */
enum { N_PHASES = 8 };
typedef struct event_case {
    const char *name;
    int (*build)(carom_world *);
    double duration; /* [s] */
    int coarse[N_ORDERS];
    int better; /* 1: order 6 has more */
} event_case;

/* Between the events of the last the motion is that of a spring, where order 6 has 8. */
static const event_case CASES[] = {
    {"ladder", scene_ladder, 1, {15, 15, 15}, 0},
    {"disc off a disc", scene_roll_off, 1, {60, 60, 24}, 0},
    {"rocking block", rocking_block, 1, {15, 15, 15}, 0},
    {"pendulum on a floor", pendulum_on_floor, 0.9, {60, 60, 60}, 0},
    {"stick-slip", stick_slip, 0.8, {60, 60, 15}, 1},
};
enum { N_CASES = sizeof CASES / sizeof CASES[0] };

/* --- runs */

/* Pose and velocity of the body at the end, and derivatives of the sum of its pose by gravity,
 * masses, inertias, friction, restitution of all bodies and by the time. */
typedef struct outcome {
    double state[6];
    double by[N_NUMBERS];
} outcome;

static void derive(carom_tape *tape, const carom_world *w, int body, int n, outcome *x)
{
    double q_bar[3 * MAX_BODIES] = {0};
    const carom_state_bar bar = {n, q_bar, NULL};
    carom_gradient g = {0};
    double *to = x->by;
    q_bar[3 * body] = q_bar[3 * body + 1] = q_bar[3 * body + 2] = 1;
    g.gravity = to;
    g.mass = to + 2;
    g.inertia = g.mass + MAX_BODIES;
    g.friction = g.inertia + MAX_BODIES;
    g.restitution = g.friction + MAX_BODIES;
    g.dt = g.restitution + MAX_BODIES;
    assert_true(carom_world_n_bodies(w) <= MAX_BODIES);
    assert_int_equal(carom_tape_gradient(tape, 1, &bar, &g, NULL), CAROM_OK);
    *g.dt /= n;
}

static outcome run(const event_case *c, int order, int n)
{
    outcome x = {{0}, {0}};
    carom_tape *tape;
    scene_order = order;
    scene_events = 1;
    carom_world *w = scene_world(G, c->duration / n);
    scene_events = 0;
    scene_order = 2;
    const int body = c->build(w);
    assert_int_equal(carom_tape_create(w, NULL, &tape), CAROM_OK);
    for (int k = 0; k < n; k++) assert_true(carom_tape_step(tape, NULL, NULL) >= 0);
    for (int k = 0; k < 3; k++) {
        x.state[k] = carom_world_q(w)[3 * body + k];
        x.state[3 + k] = carom_world_v(w)[3 * body + k];
    }
    derive(tape, w, body, n, &x);
    carom_tape_destroy(tape);
    carom_world_destroy(w);
    return x;
}

static double apart(int n, const double *a, const double *b)
{
    double d = 0;
    for (int k = 0; k < n; k++) d = fmax(d, fabs(a[k] - b[k]));
    return d;
}

/* Largest errors of the state and of the gradient. */
static void largest_errors(const event_case *c, int order, int times, const outcome *exact,
                           double error[2])
{
    error[0] = error[1] = 0;
    for (int i = 0; i < N_PHASES; i++) {
        const outcome x = run(c, order, times * (c->coarse[order / 2 - 1] + i));
        error[0] = fmax(error[0], apart(6, x.state, exact->state));
        error[1] = fmax(error[1], apart(N_NUMBERS, x.by, exact->by));
    }
}

static void check_order(const event_case *c, int order, const outcome *exact)
{
    static const char *const what[2] = {"state", "gradient"};
    double coarse[2];
    double fine[2];
    largest_errors(c, order, 1, exact, coarse);
    largest_errors(c, order, 2, exact, fine);
    for (int k = 0; k < 2; k++) {
        const double observed = log2(coarse[k] / fine[k]);
        const int better = c->better && order == 6;
        if (verbose) {
            print_message("%-20s order %d, %-8s: %.2f, errors %.1e and %.1e\n", c->name, order,
                          what[k], observed, coarse[k], fine[k]);
        }
        if (observed > order - ORDER_TOL && (better || observed < order + ORDER_TOL)) continue;
        fail_msg("%s, order %d: observed order of the %s %g", c->name, order, what[k], observed);
    }
}

/* The reference is order 8 at 960 steps; order 6 at 1440 agrees with it to REFERENCE_TOL. */
static void orders_through_events(void **state)
{
    (void)state;
    for (int k = 0; k < N_CASES; k++) {
        const event_case *c = &CASES[k];
        const outcome exact = run(c, 8, 960);
        const outcome other = run(c, 6, 1440);
        assert_at_most(c->name, apart(6, exact.state, other.state), REFERENCE_TOL);
        assert_at_most(c->name, apart(N_NUMBERS, exact.by, other.by), 20 * REFERENCE_TOL);
        for (int order = 2; order <= 6; order += 2) check_order(c, order, &exact);
    }
}

/* Its gradients by mu (half of each friction), g, m and T are derivatives of the formula. */
static void stick_slip_is_exact(void **state)
{
    (void)state;
    const event_case *c = &CASES[N_CASES - 1];
    const double h = 1e-4;
    const double T = c->duration;
    const outcome x = run(c, 8, 120);
    assert_near(x.state[1], stick_slip_at(T, MU, G), 1e-12);
    const double by_mu = (stick_slip_at(T, MU + h, G) - stick_slip_at(T, MU - h, G)) / (2 * h);
    const double by_g = (stick_slip_at(T, MU, G + h) - stick_slip_at(T, MU, G - h)) / (2 * h);
    const double *friction = x.by + 2 + 2 * MAX_BODIES;
    /* truncation of the differences: h^2 times a third derivative of some tens */
    assert_near(friction[0] + friction[1], by_mu, 1e-6);
    assert_near(x.by[1], -by_g, 1e-6);
    assert_near(x.by[N_NUMBERS - 1] * 1, x.state[4], 1e-9);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(stick_slip_is_exact),
                                       cmocka_unit_test(orders_through_events)};
    scene_integrator = CAROM_LOCATED;
    verbose = argc > 1 && !strcmp(argv[1], "print");
    return cmocka_run_group_tests(tests, NULL, NULL);
}
