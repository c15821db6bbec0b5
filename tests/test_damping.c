/* Bodies that are damped, weigh more or less, or do not turn, against closed forms. */
#include "near.h"
#include "scenes.h"

#include <float.h>
#include <string.h>

static const carom_integrator INTEGRATORS[] = {CAROM_EULER, CAROM_LOCATED, CAROM_FIXED};

/* A disc of mass 2 and radius 1 without contacts. */
static int add_disc(carom_world *w, double x, double y, double linear, double angular)
{
    carom_body_def d = carom_body_at(CAROM_DYNAMIC, x, y);
    int b;
    d.mass = 2;
    d.linear_damping = linear;
    d.angular_damping = angular;
    d.collide = 0;
    if (carom_world_add_body(w, &d, &b) < 0) fail_msg("%s", carom_world_error(w));
    return b;
}

/* v' = g - d v: v = v0 exp(-d t) + g (1 - exp(-d t)) / d, for any step: to rounding of 60 steps. */
static void velocity_is_exact(void **state)
{
    (void)state;
    static const double damping[] = {1e-12, 1e-3, 0.7, 30, 1e6};
    for (int k = 0; k < 15; k++) {
        const double d = damping[k / 3];
        scene_integrator = INTEGRATORS[k % 3];
        carom_world *w = scene_world(9.81, 1.0 / 60);
        const int b = add_disc(w, 0, 0, d, 2 * d);
        scene_push(w, b, 3, -2, 5);
        scene_run(w, 60, NULL);
        const double *v = carom_world_v(w);
        assert_near_case("omega", k, v[0], 3 * exp(-2 * d), 1e-13);
        assert_near_case("vx", k, v[1], -2 * exp(-d), 1e-13);
        assert_near_case("vy", k, v[2], 5 * exp(-d) + 9.81 * expm1(-d) / d, 1e-12);
        carom_world_destroy(w);
    }
}

/* Falling long enough it has the speed g / d. */
static void terminal_speed(void **state)
{
    (void)state;
    scene_integrator = CAROM_LOCATED;
    carom_world *w = scene_world(9.81, 1.0 / 60);
    add_disc(w, 0, 0, 4, 0);
    scene_run(w, 600, NULL); /* exp(-40) = 4e-18 of the start is left */
    assert_near(carom_world_v(w)[2], -9.81 / 4, 1e-13);
    carom_world_destroy(w);
}

/* Distance of a thrown disc from its closed form after 1 s in n steps. */
static double flight_error(int order, int n)
{
    const double d = 1.5;
    scene_order = order;
    carom_world *w = scene_world(9.81, 1.0 / n);
    scene_push(w, add_disc(w, 0, 0, d, 0), 0, 7, 4);
    scene_run(w, n, NULL);
    const double *q = carom_world_q(w);
    const double fade = -expm1(-d) / d;
    const double x = 7 * fade;
    const double y = 4 * fade - 9.81 * (1 - fade) / d;
    const double error = hypot(q[1] - x, q[2] - y);
    carom_world_destroy(w);
    scene_order = 2;
    return error;
}

/* A damped oscillator: spring on x of a disc whose body is damped, z < 1. */
static double oscillator_error(int order, int n)
{
    const double omega = 3;
    const double z = 0.3;
    scene_order = order;
    carom_world *w = scene_world(0, 1.0 / n);
    const int a = scene_anchor(w);
    const int b = add_disc(w, 1, 0, 2 * z * omega, 0);
    carom_joint_def d = carom_joint_defaults(CAROM_PRISMATIC);
    d.body_a = a;
    d.body_b = b;
    d.anchor.x = 1;
    d.stiffness = 2 * omega * omega;
    d.rest = -1;
    assert_int_equal(carom_world_add_joint(w, &d, NULL), CAROM_OK);
    scene_run(w, n, NULL);
    const double s = omega * sqrt(1 - z * z);
    const double exact = exp(-z * omega) * (cos(s) + z * omega / s * sin(s));
    const double error = fabs(carom_world_q(w)[3 * b + 1] - exact);
    carom_world_destroy(w);
    scene_order = 2;
    return error;
}

/* The state of a damped two-link pendulum with different dampings, after 1 s in n steps. */
static void swing(int order, int n, double q[6])
{
    scene_order = order;
    carom_world *w = scene_world(9.81, 1.0 / n);
    const int a = scene_anchor(w);
    const int links[2] = {add_disc(w, 0.5, 0, 0.8, 0.3), add_disc(w, 1.2, 0.4, 0.1, 2)};
    const carom_vec2 pins[2] = {{0, 0}, {0.9, 0.1}};
    assert_int_equal(carom_world_add_revolute(w, a, links[0], pins[0], NULL), CAROM_OK);
    assert_int_equal(carom_world_add_revolute(w, links[0], links[1], pins[1], NULL), CAROM_OK);
    scene_run(w, n, NULL);
    memcpy(q, carom_world_q(w) + 3, 6 * sizeof *q);
    carom_world_destroy(w);
    scene_order = 2;
}

static double swing_error(int order, int n)
{
    double exact[6];
    double q[6];
    double worst = 0;
    swing(8, 160, exact); /* below 1e-13: its own estimate falls by 2^8 from 80 steps on */
    swing(order, n, q);
    for (int k = 0; k < 6; k++) worst = fmax(worst, fabs(q[k] - exact[k]));
    return worst;
}

/* Damping is part of the symmetric map, which extrapolation makes one of order 4 and 6. */
static void orders_are_kept(void **state)
{
    (void)state;
    static double (*const error[3])(int order, int n) = {flight_error, oscillator_error,
                                                         swing_error};
    static const char *const name[3] = {"flight", "oscillator", "pendulum"};
    /* Softening of the spring, of order 8, is what is seen of the oscillator at order 6. */
    static const int highest[3] = {6, 4, 6};
    scene_integrator = CAROM_LOCATED;
    for (int k = 0; k < 3; k++) {
        for (int order = 2; order <= highest[k]; order += 2) {
            const int n = order < 6 ? 40 : k ? 15 : 10;
            const double observed = log2(error[k](order, n) / error[k](order, 2 * n));
            assert_near_case(name[k], order, observed, order, 0.3);
        }
    }
}

/* A locked box slides on a damped way: v' = -mu g - d v stops after t = log(1 + d v0 / mu g) / d
 * and v0 / d - mu g t / d; the stop is located, so that what is left is of second order. */
static double slide_error(int n)
{
    const double d = 0.9;
    const double mu = 0.3;
    const double v0 = 2;
    carom_world *w = scene_world(9.81, 1.0 / n);
    scene_floor(w, mu, 0);
    carom_body_def def = carom_body_at(CAROM_DYNAMIC, 0, 0.25);
    const carom_vec2 corners[4] = {{-0.5, -0.25}, {0.5, -0.25}, {0.5, 0.25}, {-0.5, 0.25}};
    const carom_shape box = {0, 4, corners};
    def.shapes = &box;
    def.n_shapes = 1;
    def.inertia = INFINITY;
    def.friction = mu;
    def.linear_damping = d;
    def.velocity[1] = v0;
    assert_int_equal(carom_world_add_body(w, &def, NULL), CAROM_OK);
    scene_run(w, n, NULL);
    const double t = log(1 + d * v0 / (mu * 9.81)) / d;
    const double error = fabs(carom_world_q(w)[4] - (v0 / d - mu * 9.81 * t / d));
    assert_near(carom_world_v(w)[4], 0, 1e-13);
    assert_near(carom_world_q(w)[3], 0, 0);
    carom_world_destroy(w);
    return error;
}

static void slides_to_rest(void **state)
{
    (void)state;
    scene_integrator = CAROM_LOCATED;
    assert_near(log2(slide_error(40) / slide_error(80)), 2, 0.3);
}

/* An eccentric hit gives a body that does not turn the momentum of a point mass. */
static void locked_rotation(void **state)
{
    (void)state;
    for (int i = 0; i < 3; i++) {
        scene_integrator = INTEGRATORS[i];
        carom_world *w = scene_world(0, 1.0 / 60);
        carom_body_def d = carom_body_at(CAROM_DYNAMIC, 0, 0);
        const carom_vec2 corners[4] = {{-0.5, -1}, {0.5, -1}, {0.5, 1}, {-0.5, 1}};
        const carom_shape box = {0, 4, corners};
        d.shapes = &box;
        d.n_shapes = 1;
        d.mass = 3;
        d.inertia = INFINITY;
        d.restitution = 1;
        d.friction = 0;
        assert_int_equal(carom_world_add_body(w, &d, NULL), CAROM_OK);
        const int ball = scene_disc(w, 1, 0.25, -2, 0.8, 0, 1);
        scene_push(w, ball, 0, 4, 0);
        scene_run(w, 60, NULL);
        const double *v = carom_world_v(w);
        /* Elastic, masses 1 and 3: -v/2 and v/2. */
        assert_near_case("omega", i, v[0], 0, 0);
        assert_near_case("box", i, v[1], 2, 1e-12);
        assert_near_case("ball", i, v[4], -2, 1e-12);
        assert_near_case("energy", i, carom_world_energy(w), 0.5 * 16, 1e-11);
        carom_world_destroy(w);
    }
}

/* A locked body turns on as it was: forces, torques and joints change nothing of it. */
static void locked_body_turns_on(void **state)
{
    (void)state;
    scene_integrator = CAROM_LOCATED;
    carom_world *w = scene_world(9.81, 1.0 / 60);
    carom_body_def d = carom_body_at(CAROM_DYNAMIC, 0, 0);
    d.inertia = INFINITY;
    d.velocity[0] = 0.5;
    d.force[0] = 7;
    assert_int_equal(carom_world_add_body(w, &d, NULL), CAROM_OK);
    scene_run(w, 60, NULL);
    assert_near(carom_world_v(w)[0], 0.5, 0);
    assert_near(carom_world_q(w)[0], 0.5, 1e-14);
    assert_near(carom_world_q(w)[2], -0.5 * 9.81, 1e-13);
    carom_world_destroy(w);
}

static void gravity_scales(void **state)
{
    (void)state;
    static const double scale[3] = {0, -1, 2.5};
    for (int k = 0; k < 9; k++) {
        scene_integrator = INTEGRATORS[k % 3];
        carom_world *w = scene_world(9.81, 1.0 / 60);
        carom_body_def d = carom_body_at(CAROM_DYNAMIC, 0, 3);
        d.gravity_scale = scale[k / 3];
        assert_int_equal(carom_world_add_body(w, &d, NULL), CAROM_OK);
        scene_run(w, 60, NULL);
        assert_near_case("vy", k, carom_world_v(w)[2], -9.81 * scale[k / 3], 1e-13);
        const double height = carom_world_q(w)[2];
        const double energy = 0.5 * pow(9.81 * scale[k / 3], 2) + 9.81 * scale[k / 3] * height;
        assert_near_case("energy", k, carom_world_energy(w), energy, 1e-11);
        carom_world_destroy(w);
    }
}

/* On a floor at scale 2 a box presses with twice its weight. */
static void weight_on_the_floor(void **state)
{
    (void)state;
    scene_integrator = CAROM_LOCATED;
    carom_world *w = scene_world(9.81, 1.0 / 60);
    const carom_pose pose = {0, 0, 0.25};
    scene_floor(w, 0.5, 0);
    const int b = scene_box(w, 3, 0.5, 0.25, pose, 0.5, 0);
    const double scales[2] = {1, 2};
    const carom_parameters p = {.gravity_scale = scales};
    assert_int_equal(carom_world_set_parameters(w, &p), CAROM_OK);
    scene_run(w, 10, NULL);
    double pressed = 0;
    for (int k = 0; k < carom_world_n_contacts(w); k++) pressed += carom_world_contact(w, k).ln;
    assert_near(pressed, 2 * 3 * 9.81 / 60, 1e-11);
    assert_near(carom_world_q(w)[3 * b + 2], 0.25, 1e-12);
    carom_world_destroy(w);
}

/* What is not dynamic moves as it is told. */
static void kinematic_is_not_damped(void **state)
{
    (void)state;
    carom_world *w = scene_world(9.81, 1.0 / 60);
    carom_body_def d = carom_body_at(CAROM_KINEMATIC, 0, 0);
    d.velocity[1] = 2;
    d.linear_damping = 5;
    assert_int_equal(carom_world_add_body(w, &d, NULL), CAROM_OK);
    scene_push(w, add_disc(w, 0, 5, 1, 0), 0, 1, 0);
    scene_run(w, 60, NULL);
    assert_near(carom_world_v(w)[1], 2, 0);
    assert_near(carom_world_q(w)[1], 2, 1e-13);
    carom_world_destroy(w);
}

static void refused(void **state)
{
    (void)state;
    static const double bad[4] = {-1e-300, INFINITY, NAN, -INFINITY};
    carom_world *w = scene_world(9.81, 1.0 / 60);
    for (int k = 0; k < 4; k++) {
        carom_body_def d = carom_body_defaults();
        d.linear_damping = bad[k];
        assert_int_equal(carom_world_add_body(w, &d, NULL), CAROM_E_ARGUMENT);
        assert_non_null(strstr(carom_world_error(w), "body 0: damping"));
        d = carom_body_defaults();
        d.angular_damping = bad[k];
        assert_int_equal(carom_world_add_body(w, &d, NULL), CAROM_E_ARGUMENT);
        d = carom_body_defaults();
        d.gravity_scale = k ? bad[k] : NAN;
        assert_int_equal(carom_world_add_body(w, &d, NULL), CAROM_E_ARGUMENT);
        assert_non_null(strstr(carom_world_error(w), "gravity scale"));
    }
    add_disc(w, 0, 0, 1, 1);
    const carom_parameters p = {.linear_damping = bad};
    assert_int_equal(carom_world_set_parameters(w, &p), CAROM_E_ARGUMENT);
    scene_push(w, 0, 1, 1, 0);
    scene_run(w, 60, NULL); /* as before */
    assert_near(carom_world_v(w)[1], exp(-1), 1e-14);
    carom_world_destroy(w);
}

/* Free flight is not extrapolated; damping that begins later would find no tables for it. */
static void begins_in_time(void **state)
{
    (void)state;
    const double some[1] = {0.5};
    const carom_parameters p = {.angular_damping = some};
    scene_integrator = CAROM_LOCATED;
    scene_order = 4;
    carom_world *w = scene_world(9.81, 1.0 / 60);
    scene_order = 2;
    scene_push(w, add_disc(w, 0, 0, 0, 0), 1, 0, 0);
    scene_run(w, 1, NULL);
    assert_int_equal(carom_world_set_parameters(w, &p), CAROM_E_STATE);
    scene_run(w, 59, NULL);
    assert_near(carom_world_v(w)[0], 1, 0);
    carom_world_destroy(w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(velocity_is_exact),       cmocka_unit_test(terminal_speed),
        cmocka_unit_test(orders_are_kept),         cmocka_unit_test(slides_to_rest),
        cmocka_unit_test(locked_rotation),         cmocka_unit_test(locked_body_turns_on),
        cmocka_unit_test(gravity_scales),          cmocka_unit_test(weight_on_the_floor),
        cmocka_unit_test(kinematic_is_not_damped), cmocka_unit_test(refused),
        cmocka_unit_test(begins_in_time),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
