/* Bodies that move as they are told: accelerations in place of forces, and gradients by them. */
#include "near.h"
#include "scenes.h"

#include "carom/grad.h"

#include <stdlib.h>
#include <string.h>

enum { FLOOR, BELT, BOX, STEPS = 30 };
static const double G = 9.81;
static const double DT = 1.0 / 60;
static const double MU = 0.5;

/* A body without shape flies on its parabola: without gravity, with its own acceleration. */
static void flies_as_told(void **state)
{
    (void)state;
    carom_world *w = scene_world(G, DT);
    const double a[3] = {0.25, 1, -2};
    const double v[3] = {-1, 0.5, 3};
    carom_body_def d = carom_body_at(CAROM_KINEMATIC, 1, 2);
    memcpy(d.velocity, v, sizeof v);
    memcpy(d.force, a, sizeof a);
    assert_int_equal(carom_world_add_body(w, &d, NULL), CAROM_OK);
    scene_run(w, STEPS, NULL);
    const double t = STEPS * DT;
    const double from[3] = {0, 1, 2};
    /* Euler moves with the velocity at the end of each step. */
    const double lag = scene_integrator == CAROM_EULER ? 0.5 * DT * t : 0;
    for (int k = 0; k < 3; k++) {
        assert_near(carom_world_v(w)[k], v[k] + a[k] * t, 1e-13);
        assert_near(carom_world_q(w)[k], from[k] + v[k] * t + a[k] * (0.5 * t * t + lag), 1e-13);
    }
    carom_world_destroy(w);
}

/* A box on a belt. */
static carom_world *belt(void)
{
    carom_world *w = scene_world(G, DT);
    scene_floor(w, 0, 0);
    carom_body_def d = carom_body_at(CAROM_KINEMATIC, 0, 1);
    d.friction = MU;
    assert_int_equal(carom_world_add_box(w, &d, 20, 0.5, 0, NULL), CAROM_OK);
    scene_box(w, 1, 0.25, 0.25, (carom_pose){0, 0, 1.5}, MU, 0);
    return w;
}

/* x of the box at the end by the belt's acceleration in each step, and by its friction. */
static double drive(double a, double *by_a, double *by_mu)
{
    carom_world *w = belt();
    carom_tape *t;
    double force[9] = {0};
    double q_bar[9] = {0};
    double friction[3] = {0};
    double *steps = calloc(9 * STEPS, sizeof *steps);
    assert_non_null(steps);
    force[3 * BELT + 1] = a;
    q_bar[3 * BOX + 1] = 1;
    assert_int_equal(carom_tape_create(w, NULL, &t), CAROM_OK);
    for (int k = 0; k < STEPS; k++) assert_int_equal(carom_tape_step(t, force, NULL), CAROM_OK);
    const double x = carom_world_q(w)[3 * BOX + 1];
    const carom_state_bar bar = {STEPS, q_bar, NULL};
    const carom_gradient g = {.force_steps = steps, .friction = friction};
    assert_int_equal(carom_tape_gradient(t, 1, &bar, &g, NULL), CAROM_OK);
    for (int k = 0; k < STEPS; k++) by_a[k] = steps[9 * k + 3 * BELT + 1];
    *by_mu = friction[BELT] + friction[BOX];
    free(steps);
    carom_tape_destroy(t);
    carom_world_destroy(w);
    return x;
}

/* Below mu g the box goes with the belt: x = sum of dt^2 (n - k - 1/2) a_k. */
static void a_belt_carries(void **state)
{
    (void)state;
    double by_a[STEPS];
    double by_mu;
    const double t = STEPS * DT;
    assert_near(drive(3, by_a, &by_mu), 1.5 * t * t, 1e-12);
    for (int k = 0; k < STEPS; k++) {
        assert_near(by_a[k], DT * DT * (STEPS - k - 0.5), 1e-12);
    }
    assert_near(by_mu, 0, 1e-12);
}

/* Above it slides behind: x = mu g t^2 / 2, whatever the belt does.  The pair's friction is the
 * root of a product: each body's has half of the derivative by mu. */
static void a_belt_slides_under(void **state)
{
    (void)state;
    double by_a[STEPS];
    double by_mu;
    const double t = STEPS * DT;
    assert_near(drive(8, by_a, &by_mu), 0.5 * MU * G * t * t, 1e-12);
    for (int k = 0; k < STEPS; k++) assert_near(by_a[k], 0, 1e-12);
    assert_near(by_mu, 0.5 * G * t * t, 1e-10);
}

/* A paddle that speeds up hits a ball, which flies on and bounces: differences of whole runs. */
static void a_paddle_strikes(void **state)
{
    (void)state;
    carom_world *w = scene_world(G, DT);
    scene_floor(w, 0.3, 0.6);
    carom_body_def d = carom_body_at(CAROM_KINEMATIC, -1, 1);
    d.friction = 0.4;
    d.restitution = 0.7;
    d.pose.angle = 0.2;
    assert_int_equal(carom_world_add_box(w, &d, 0.2, 1, 0, NULL), CAROM_OK);
    scene_disc(w, 1, 0.25, 0, 1.25, 0.4, 0.7);
    carom_tape *t;
    double force[9] = {0};
    double q_bar[9] = {0};
    static double steps[9 * STEPS];
    static carom_checked checked[9 * STEPS];
    memset(steps, 0, sizeof steps);
    q_bar[3 * BOX + 1] = 1;
    q_bar[3 * BOX + 2] = 0.5;
    assert_int_equal(carom_tape_create(w, NULL, &t), CAROM_OK);
    for (int k = 0; k < STEPS; k++) {
        force[3 * BELT] = 2 - 0.3 * k;
        force[3 * BELT + 1] = k < 20 ? 25 : -20;
        assert_true(carom_tape_step(t, force, NULL) >= 0);
    }
    assert_true(carom_world_q(w)[3 * BOX + 1] > 0.3);
    const carom_state_bar bar = {STEPS, q_bar, NULL};
    const carom_gradient g = {.force_steps = steps};
    assert_int_equal(carom_tape_gradient(t, 1, &bar, &g, NULL), CAROM_OK);
    carom_check_settings set = carom_check_defaults();
    int count;
    set.per_array = 0;
    assert_int_equal(carom_tape_check(t, 1, &bar, &g, &set, 9 * STEPS, checked, &count), CAROM_OK);
    int n_paddle = 0;
    for (int k = 0; k < count; k++) {
        assert_true(checked[k].kink || checked[k].disagreement < 1e-6);
        const int by_paddle = checked[k].index % 9 / 3 == BELT && checked[k].gradient != 0;
        n_paddle += by_paddle && !checked[k].kink;
    }
    assert_true(n_paddle > 2 * STEPS / 3);
    carom_tape_destroy(t);
    carom_world_destroy(w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(flies_as_told, scene_euler),
        cmocka_unit_test_setup(a_paddle_strikes, scene_euler),
        cmocka_unit_test_setup(flies_as_told, scene_located),
        cmocka_unit_test_setup(a_belt_carries, scene_located),
        cmocka_unit_test_setup(a_belt_slides_under, scene_located),
        cmocka_unit_test_setup(a_paddle_strikes, scene_located),
        cmocka_unit_test_setup(flies_as_told, scene_order_4),
        cmocka_unit_test_setup(a_belt_carries, scene_order_4),
        cmocka_unit_test_setup(a_belt_slides_under, scene_order_4),
        cmocka_unit_test_setup(a_paddle_strikes, scene_order_4),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
