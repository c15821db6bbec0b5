/* Springs, targets and motors of joints against closed forms. */
#include "near.h"
#include "scenes.h"

#include <string.h>

static const carom_integrator INTEGRATORS[] = {CAROM_EULER, CAROM_LOCATED, CAROM_FIXED};

static carom_joint_def of(carom_joint_kind kind, int a, int b)
{
    carom_joint_def d = carom_joint_defaults(kind);
    d.body_a = a;
    d.body_b = b;
    return d;
}

static void join(carom_world *w, const carom_joint_def *d)
{
    if (carom_world_add_joint(w, d, NULL) < 0) fail_msg("%s", carom_world_error(w));
}

static const double *q_of(const carom_world *w, int body)
{
    return carom_world_q(w) + 3 * body;
}

static const double *v_of(const carom_world *w, int body)
{
    return carom_world_v(w) + 3 * body;
}

/* x of x'' = - w^2 x - 2 z w x', x(0) = 1, x'(0) = 0, z < 1. */
static double oscillator(double w, double z, double t)
{
    const double d = w * sqrt(1 - z * z);
    return exp(-z * w * t) * (cos(d * t) + z * w / d * sin(d * t));
}

/* A disc of mass 2 on a spring of frequency w and damping ratio z, from 1 m after 1 s in n steps.
 */
static double spring_error(carom_joint_kind kind, double w, double z, int n)
{
    carom_world *world = scene_world(0, 1.0 / n);
    const int a = scene_anchor(world);
    const int b = scene_disc(world, 2, 1, kind == CAROM_REVOLUTE ? 0 : 1, 0, 0, 0);
    const double inertia = kind == CAROM_REVOLUTE ? 1 : 2;
    carom_joint_def d = of(kind, a, b);
    d.anchor.x = kind == CAROM_ROPE || kind == CAROM_REVOLUTE ? 0 : 1;
    d.anchor_b.x = 1;
    d.stiffness = inertia * w * w;
    d.damping = inertia * 2 * z * w;
    d.rest = kind == CAROM_ROPE ? 2 : -1;
    join(world, &d);
    scene_run(world, n, NULL);
    const double x = kind == CAROM_REVOLUTE ? q_of(world, b)[0] : q_of(world, b)[1];
    /* distance from where it is at rest, over the first one */
    const double gone = kind == CAROM_REVOLUTE ? x + 1 : kind == CAROM_ROPE ? 2 - x : x;
    carom_world_destroy(world);
    return fabs(gone - oscillator(w, z, 1));
}

/* Second order with `located`, first with `euler`. */
static void oscillates(void **state)
{
    (void)state;
    static const carom_joint_kind kinds[] = {CAROM_REVOLUTE, CAROM_PRISMATIC, CAROM_WHEEL,
                                             CAROM_ROPE};
    for (int k = 0; k < 8; k++) {
        const double z = k % 2 ? 0.3 : 0;
        for (int i = 0; i < 2; i++) {
            scene_integrator = INTEGRATORS[i];
            const double coarse = spring_error(kinds[k / 2], 5, z, 240);
            const double fine = spring_error(kinds[k / 2], 5, z, 480);
            assert_near_case(carom_joint_kind_name(kinds[k / 2]), i, coarse / fine, i ? 4 : 2, 0.2);
        }
    }
}

/* Springs and dampers keep the map symmetric: order 4 by extrapolation. */
static void oscillates_at_order_4(void **state)
{
    (void)state;
    scene_integrator = CAROM_LOCATED;
    scene_order = 4;
    for (int k = 0; k < 2; k++) {
        const double z = k ? 0.3 : 0;
        const double coarse = spring_error(CAROM_PRISMATIC, 5, z, 30);
        const double fine = spring_error(CAROM_PRISMATIC, 5, z, 60);
        assert_near_case("ratio", k, coarse / fine, 16, 1.6);
    }
    scene_order = 2;
}

/* A chain of five discs of radius 1 at 1 m, each held to the one before by a target. */
static carom_world *soft_chain(double w)
{
    carom_world *world = scene_world(0, 1.0 / 60);
    int before = scene_anchor(world);
    for (int i = 0; i < 5; i++) {
        const int b = scene_disc(world, 2, 1, i + 1.0, 0, 0, 0);
        carom_joint_def d = of(CAROM_TARGET, before, b);
        d.anchor.x = i + 1.0;
        d.stiffness = 2 * w * w;
        d.damping = i % 2 ? 2 * 2 * w : 0;
        join(world, &d);
        for (int k = 0; k < b; k++) {
            assert_int_equal(carom_world_exclude(world, k, b), CAROM_OK);
        }
        before = b;
    }
    scene_push(world, 3, 0, 1, 1);
    return world;
}

/* Springs too stiff for the step are as soft as it can follow: nothing grows. */
static void stiff_springs_are_stable(void **state)
{
    (void)state;
    static const double ws[] = {1e2, 1e4, 1e6};
    for (int k = 0; k < 9; k++) {
        scene_integrator = INTEGRATORS[k % 3];
        carom_world *world = soft_chain(ws[k / 3]);
        for (int n = 0; n < 1200; n++) {
            scene_run(world, 1, NULL);
            /* 2 J from the push, which the springs hold in part */
            assert_at_most("energy", carom_world_energy(world), 2.1);
        }
        carom_world_destroy(world);
    }
}

/* A load hangs m g / k below its target and stays there; the softening is of order h^8. */
static void hangs(void **state)
{
    (void)state;
    for (int i = 0; i < 3; i++) {
        scene_integrator = INTEGRATORS[i];
        carom_world *w = scene_world(9.81, 1.0 / 60);
        const int hook = scene_anchor(w);
        const int b = scene_disc(w, 2, 0.1, 0.5, 0, 0, 0);
        carom_joint_def d = of(CAROM_TARGET, hook, b);
        d.anchor.x = 0.5;
        d.stiffness = 2 * 10 * 10;
        d.damping = 2 * 20;
        join(w, &d);
        scene_run(w, 600, NULL);
        assert_near(q_of(w, b)[2], -9.81 / (10 * 10), 1e-7);
        assert_near(q_of(w, b)[1], 0.5, 1e-12);
        assert_near(v_of(w, b)[2], 0, 1e-9);
        carom_world_destroy(w);
    }
}

/* A wheel under the torque T gains T/I per second until it has the motor's speed, which it keeps.
 */
static void motor_spins_up(void **state)
{
    (void)state;
    const double h = 1.0 / 60;
    for (int i = 0; i < 3; i++) {
        scene_integrator = INTEGRATORS[i];
        carom_world *w = scene_world(9.81, h);
        const int axle = scene_anchor(w);
        const int b = scene_disc(w, 2, 0.5, 0, 0, 0, 0);
        carom_joint_def d = of(CAROM_REVOLUTE, axle, b);
        d.motor_speed = -7;
        d.motor_limit = 1.5;
        join(w, &d);
        for (int n = 1; n <= 120; n++) {
            scene_run(w, 1, NULL);
            assert_near_case("omega", n, v_of(w, b)[0], -fmin(1.5 / 0.25 * n * h, 7), 1e-11);
        }
        carom_world_destroy(w);
    }
}

/* A lift: held at its speed by a motor that can, else it sinks with g - F/m. */
static void lift(void **state)
{
    (void)state;
    for (int k = 0; k < 6; k++) {
        scene_integrator = INTEGRATORS[k % 3];
        const double most = k < 3 ? 25 : 10;
        carom_world *w = scene_world(9.81, 1.0 / 60);
        const int shaft = scene_anchor(w);
        const int b = scene_box(w, 2, 0.3, 0.2, (carom_pose){0.1, 0, 0}, 0, 0);
        carom_joint_def d = of(CAROM_PRISMATIC, shaft, b);
        d.axis.x = 0;
        d.axis.y = 1;
        d.motor_speed = 0.5;
        d.motor_limit = most;
        join(w, &d);
        scene_push(w, b, 0, 0, 0.5);
        scene_run(w, 60, NULL);
        const double a = most >= 2 * 9.81 ? 0 : most / 2 - 9.81;
        assert_near(v_of(w, b)[2], 0.5 + a, 1e-11);
        if (k % 3) assert_near(q_of(w, b)[2], 0.5 + 0.5 * a, 1e-11);
        carom_world_destroy(w);
    }
}

/* A motor that nothing lets turn pushes with all it has, and the step has a solution. */
static void stalled_motor(void **state)
{
    (void)state;
    for (int i = 0; i < 3; i++) {
        scene_integrator = INTEGRATORS[i];
        carom_world *w = scene_world(9.81, 1.0 / 60);
        const int wall = scene_anchor(w);
        const int b = scene_disc(w, 2, 0.5, 0, 0, 0, 0);
        carom_joint_def motor = of(CAROM_REVOLUTE, wall, b);
        const carom_joint_def lock = of(CAROM_LOCK_ANGLE, wall, b);
        motor.motor_speed = 3;
        motor.motor_limit = 1.5;
        join(w, &motor);
        join(w, &lock);
        scene_run(w, 30, NULL);
        assert_near(q_of(w, b)[0], 0, 1e-12);
        assert_near(carom_world_joint_force(w, 0).torque, 1.5, 1e-9);
        assert_near(carom_world_joint_force(w, 1).torque, -1.5, 1e-9);
        carom_world_destroy(w);
    }
}

/* An arm that a strong motor drives against its stop stays there, whatever its speed rounds to. */
static void stop_stands(void **state)
{
    (void)state;
    static const double rates[] = {10, 60, 100, 240};
    static const double torques[] = {10, 1e3, 1e5};
    for (int k = 0; k < 36; k++) {
        scene_integrator = INTEGRATORS[k % 3];
        carom_world *w = scene_world(9.81, 1 / rates[k / 3 % 4]);
        const int base = scene_anchor(w);
        const carom_pose level = {0, 0.5, 0};
        const int arm = scene_box(w, 0.1, 0.5, 0.05, level, 0, 0);
        carom_joint_def d = of(CAROM_REVOLUTE, base, arm);
        d.lower = -0.5;
        d.upper = 0.5;
        d.motor_speed = 3;
        d.motor_limit = torques[k / 12] * 0.1 * 9.81 * 0.5;
        join(w, &d);
        for (int n = 1; n <= 2 * (int)rates[k / 3 % 4]; n++) {
            scene_run(w, 1, NULL);
            /* the way to the stop at 3 rad/s, then it stays: a step that locates nothing is late */
            const double way = fmin(0.5, 3 * n / rates[k / 3 % 4]);
            assert_near_case("angle", k, q_of(w, arm)[0], way, 0.1);
        }
        assert_near_case("at the stop", k, q_of(w, arm)[0], 0.5, 1e-9);
        carom_world_destroy(w);
    }
}

/* A car on two wheels that drive: it rolls at motor speed times radius, on springs. */
static void car(void **state)
{
    (void)state;
    for (int i = 0; i < 3; i++) {
        scene_integrator = INTEGRATORS[i];
        carom_world *w = scene_world(9.81, 1.0 / 60);
        scene_floor(w, 0.9, 0);
        const int body = scene_box(w, 10, 0.8, 0.2, (carom_pose){0, 0, 0.7}, 0.3, 0);
        for (int k = -1; k <= 1; k += 2) {
            const int wheel = scene_disc(w, 1, 0.3, 0.6 * k, 0.3, 0.9, 0);
            carom_joint_def d = of(CAROM_WHEEL, body, wheel);
            d.anchor.x = 0.6 * k;
            d.anchor.y = 0.3;
            d.axis.x = 0;
            d.axis.y = 1;
            d.stiffness = 600;
            d.damping = 60;
            d.motor_speed = -5;
            d.motor_limit = 4;
            d.lower = -0.2;
            d.upper = 0.2;
            join(w, &d);
        }
        scene_run(w, 600, NULL);
        assert_near(v_of(w, body)[1], 5 * 0.3, 1e-6);
        assert_near(q_of(w, body)[0], 0, 1e-6);
        assert_near(q_of(w, body)[2], 0.7 - 10 * 9.81 / 2 / 600, 2e-3);
        carom_world_destroy(w);
    }
}

/* A box of weight m g at rest, held at a point that lies d to the right of its center: the joint
 * pushes up with m g, and turns it back with m g d where it holds the turn. */
static void forces_at_rest(void **state)
{
    (void)state;
    const double mg = 2 * 9.81;
    const double d = 0.3;
    for (int k = 0; k < 9; k++) {
        scene_integrator = INTEGRATORS[k % 3];
        carom_world *w = scene_world(9.81, 1.0 / 60);
        const int wall = scene_anchor(w);
        const int b = scene_box(w, 2, 0.5, 0.1, (carom_pose){0, -d, 0}, 0, 0);
        carom_joint_def j = of(k < 3 ? CAROM_WELD : CAROM_REVOLUTE, wall, b);
        if (k >= 6) j.upper = 0;                  /* rests on its limit: the box would turn left */
        if (k >= 3 && k < 6) j.motor_limit = 100; /* a motor that stands */
        join(w, &j);
        scene_run(w, 30, NULL);
        const carom_joint_force f = carom_world_joint_force(w, 0);
        assert_near(f.force.x, 0, 1e-8 * mg);
        assert_near(f.force.y, mg, 1e-8 * mg);
        /* about the anchor the weight turns by + m g d, so the joint by - m g d */
        assert_near(f.torque, -mg * d, 1e-8 * mg);
        carom_world_destroy(w);
    }
}

static void refusals(void **state)
{
    (void)state;
    scene_integrator = CAROM_EULER;
    carom_world *w = scene_world(0, 0.1);
    const int world = scene_anchor(w);
    const int b = scene_disc(w, 1, 0.1, 0, 0, 0, 0);
    static const char *const words[6] = {"leaves nothing", "has no motor",   "target pulls",
                                         "finite, the",    "must be finite", "has no motor"};
    carom_joint_def bad[6];
    for (int k = 0; k < 6; k++) bad[k] = of(CAROM_REVOLUTE, world, b);
    bad[0].kind = CAROM_WELD;
    bad[0].stiffness = 1;
    bad[1].kind = CAROM_TARGET;
    bad[1].stiffness = bad[1].motor_limit = 1;
    bad[2].kind = CAROM_TARGET;
    bad[3].damping = -1;
    bad[4].motor_limit = HUGE_VAL;
    bad[5].kind = CAROM_LOCK_X;
    bad[5].motor_limit = 1;
    for (int k = 0; k < 6; k++) {
        assert_int_equal(carom_world_add_joint(w, &bad[k], NULL), CAROM_E_ARGUMENT);
        if (!strstr(carom_world_error(w), words[k])) {
            fail_msg("case %d: \"%s\" lacks \"%s\"", k, carom_world_error(w), words[k]);
        }
    }
    carom_world_destroy(w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(oscillates),
        cmocka_unit_test(oscillates_at_order_4),
        cmocka_unit_test(stiff_springs_are_stable),
        cmocka_unit_test(hangs),
        cmocka_unit_test(motor_spins_up),
        cmocka_unit_test(lift),
        cmocka_unit_test(stalled_motor),
        cmocka_unit_test(stop_stands),
        cmocka_unit_test(car),
        cmocka_unit_test(forces_at_rest),
        cmocka_unit_test(refusals),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
