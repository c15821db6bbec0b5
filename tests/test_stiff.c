/* Stiff joints: light links that hold heavy bodies.  docs/step.md, section "Stiff joints". */
#include "near.h"
#include "scenes.h"

#include <math.h>
#include <string.h>

/* n links of 0.1 kg in a row, the last `ratio` times as heavy; every hinge given so often. */
static carom_world *links(int n, double angle, double ratio, int times)
{
    scene_integrator = CAROM_LOCATED;
    carom_world *w = scene_world(9.81, 1.0 / 60);
    int before = scene_anchor(w);
    for (int k = 0; k < n; k++) {
        const double x = cos(angle);
        const double y = sin(angle);
        const carom_pose mid = {angle, (k + 0.5) * x, (k + 0.5) * y};
        const int b = scene_box(w, k < n - 1 ? 0.1 : 0.1 * ratio, 0.5, 0.05, mid, 0, 0);
        const carom_vec2 pin = {k * x, k * y};
        for (int i = 0; i < times; i++) {
            assert_int_equal(carom_world_add_revolute(w, before, b, pin, NULL), CAROM_OK);
        }
        before = b;
    }
    return w;
}

static carom_world *chain(double angle, double ratio)
{
    return links(3, angle, ratio, 1);
}

/* Energy is kept to the square of h w <= 2, a thousandth of which is left by the few that turn
 * fast; joints hold to what Newton's method is asked for, 1e-14 L.  Hinges that are given six times
 * pull as one. */
static void falls(void **state)
{
    (void)state;
    static const double ratios[] = {1e2, 1e3, 1e4, 1e5, 1e6};
    for (int i = 0; i < 5 + 4; i++) {
        carom_world *w = i < 5 ? chain(-0.3, ratios[i]) : links(3, -0.3, ratios[i - 5], 6);
        const double before = carom_world_energy(w);
        const double scale = 0.1 * ratios[i % 5] * 9.81;
        for (int k = 0; k < 60; k++) {
            carom_step_stats s;
            assert_int_equal(carom_world_step(w, NULL, &s), CAROM_OK);
            assert_at_most("joint drift", s.joint_drift, 1e-12);
            assert_at_most("energy", fabs(s.energy - before), 1e-3 * scale);
        }
        carom_world_destroy(w);
    }
}

/* At rest it stays, whatever rounding does. */
static void hangs(void **state)
{
    (void)state;
    static const double ratios[] = {1, 1e2, 1e4, 1e6};
    for (int i = 0; i < 4; i++) {
        carom_world *w = chain(-1.5707963267948966, ratios[i]);
        scene_run(w, 120, NULL);
        const double *q = carom_world_q(w);
        for (int b = 1; b <= 3; b++) {
            assert_near(q[3 * b + 1], 0, 1e-12);
            assert_near(q[3 * b + 2], 0.5 - b, 1e-12);
        }
        carom_world_destroy(w);
    }
}

/* Nothing is divided where links are alike, nor for a light one that no other lets swing alone. */
static void soft_joints_divide_nothing(void **state)
{
    (void)state;
    for (int i = 0; i < 2; i++) {
        carom_world *w = i ? links(2, -0.3, 1e8, 1) : chain(-0.3, 1);
        for (int k = 0; k < 60; k++) {
            carom_step_stats s;
            assert_int_equal(carom_world_step(w, NULL, &s), CAROM_OK);
            assert_int_equal(s.n_substeps, 1);
            assert_at_most("joint drift", s.joint_drift, 1e-12);
        }
        carom_world_destroy(w);
    }
}

/* More than allowed are asked for: said. */
static void too_stiff_is_said(void **state)
{
    (void)state;
    carom_world *w = chain(-1.5707963267948966, 1e8);
    carom_step_stats s;
    scene_run(w, 2, &s);
    assert_int_equal(s.status, CAROM_LIMIT);
    carom_world_destroy(w);
}

/* What was asked for by forces of another state is forgotten with it. */
static void forces_are_forgotten(void **state)
{
    (void)state;
    carom_world *w = chain(-1.5707963267948966, 1e4);
    carom_world *fresh = chain(-1.5707963267948966, 1e4);
    const int n = 3 * carom_world_n_bodies(w);
    double q[12];
    double v[12];
    carom_step_stats s;
    memcpy(q, carom_world_q(w), sizeof q);
    memcpy(v, carom_world_v(w), sizeof v);
    scene_run(w, 5, NULL);
    assert_int_equal(carom_world_set_state(w, q, v), CAROM_OK);
    scene_run(w, 3, &s);
    assert_true(s.n_substeps > 4);
    scene_run(fresh, 3, NULL);
    for (int k = 0; k < n; k++) assert_true(carom_world_q(w)[k] == carom_world_q(fresh)[k]);
    carom_world_destroy(w);
    carom_world_destroy(fresh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(falls),
        cmocka_unit_test(hangs),
        cmocka_unit_test(soft_joints_divide_nothing),
        cmocka_unit_test(too_stiff_is_said),
        cmocka_unit_test(forces_are_forgotten),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
