/* Gradients of a smoothed tape: the derivative itself at kappa = 0, an error of order kappa, a
 * value between the one-sided derivatives at a kink, and the transposed identity. */
#include "carom/grad.h"
#include "gradient_numbers.h"
#include "gradient_scenes.h"
#include "near.h"
#include "rng.h"
#include "scenes.h"

#include <stdlib.h>
#include <string.h>

enum { MOST = 256 };

/* Gradient of component k of the final q. */
static gradient_room gradient_of(carom_tape *t, carom_world *w, int k, carom_gradient_stats *stats)
{
    static double q[MOST];
    gradient_room x = gradient_room_make(w, 1);
    const carom_state_bar bar = {carom_tape_steps(t), q, NULL};
    memset(q, 0, sizeof q);
    q[k] = 1;
    assert_int_equal(carom_tape_gradient(t, 1, &bar, &x.g, stats), CAROM_OK);
    return x;
}

static carom_tape *record(carom_world *w, int n)
{
    carom_tape *t;
    assert_int_equal(carom_tape_create(w, NULL, &t), CAROM_OK);
    for (int k = 0; k < n; k++) assert_true(carom_tape_step(t, NULL, NULL) >= 0);
    return t;
}

/* A box pushed over a floor with `force`, weight 9.81. */
static carom_world *pushed_box(double force, double speed, int *box)
{
    const carom_pose pose = {0, 0, 0.25};
    carom_world *w = scene_world(9.81, 1.0 / 60);
    scene_floor(w, 0.5, 0);
    carom_body_def d = carom_body_at(CAROM_DYNAMIC, pose.x, pose.y);
    const carom_vec2 corners[4] = {{-0.5, -0.25}, {0.5, -0.25}, {0.5, 0.25}, {-0.5, 0.25}};
    const carom_shape shape = {.count = 4, .vertices = corners};
    d.shapes = &shape;
    d.n_shapes = 1;
    d.mass = 1;
    d.inertia = 1e3; /* so heavy to turn that both feet press alike */
    d.friction = 0.5;
    d.force[1] = force;
    d.velocity[1] = speed;
    assert_int_equal(carom_world_add_body(w, &d, box), CAROM_OK);
    return w;
}

static void zero_is_the_derivative(void **state)
{
    (void)state;
    int b;
    carom_gradient_stats stats;
    carom_world *w = pushed_box(0, 3, &b);
    carom_tape *t = record(w, 60);
    gradient_room exact = gradient_of(t, w, 3 * b + 1, NULL);
    static const double tiny[] = {0, 1e-300};
    for (int i = 0; i < 2; i++) {
        assert_int_equal(carom_tape_smooth(t, tiny[i]), CAROM_OK);
        gradient_room x = gradient_of(t, w, 3 * b + 1, &stats);
        for (int a = 0; a < N_GRADIENT_ARRAYS; a++) {
            for (int k = 0; k < gradient_count(w, a); k++) {
                assert_true(x.array[a][k] == exact.array[a][k]);
            }
        }
        /* what is too small for the digits is counted */
        assert_true(i ? stats.unsmoothed > 0 : stats.unsmoothed == 0);
        gradient_room_free(&x);
    }
    gradient_room_free(&exact);
    carom_tape_destroy(t);
    carom_world_destroy(w);
}

/* Stops after v^2 / (2 mu g): the smoothed d/dmu and d/dv are off by O(kappa). */
static void error_falls_with_kappa(void **state)
{
    (void)state;
    double last = 0;
    int b;
    carom_world *w = pushed_box(0, 3, &b);
    carom_tape *t = record(w, 60);
    const double by_friction = -9 / (2 * 0.25 * 9.81);
    for (int k = 0; k < 4; k++) {
        assert_int_equal(carom_tape_smooth(t, pow(10, -4 - k)), CAROM_OK);
        gradient_room x = gradient_of(t, w, 3 * b + 1, NULL);
        const double d = fabs(x.g.friction[0] + x.g.friction[1] - by_friction);
        const double e = fabs(x.g.v0[3 * b + 1] - 3 / (0.5 * 9.81));
        assert_true(d > 0);
        /* weight times the way of a stage, 0.08 N s * 0.08 m/s, over ten: linear from there on */
        if (k > 1) assert_near(last / d, 10, 1);
        /* d x / d mu is -1.8 m, so much over the energy 2e-3 J of a stage */
        assert_at_most("error", fmax(d, e), 1e3 * pow(10, -4 - k));
        last = d;
        gradient_room_free(&x);
    }
    carom_tape_destroy(t);
    carom_world_destroy(w);
}

/* Pushed with just what friction can hold, the box slips to one side of the force and stays to the
 * other: dx/df is t^2 / 2 m or 0.  Smoothed, each sub-step lets half of a change of velocity
 * through. */
static void between_at_a_kink(void **state)
{
    (void)state;
    int b;
    carom_world *w = pushed_box(0.5 * 9.81, 0, &b);
    carom_tape *t = record(w, 30);
    carom_gradient_stats stats;
    assert_int_equal(carom_tape_smooth(t, 1e-7), CAROM_OK);
    gradient_room x = gradient_of(t, w, 3 * b + 1, &stats);
    assert_true(stats.degenerate > 0);
    assert_int_equal(stats.unsmoothed, 0);
    const double slips = 0.5 * 0.5 * 0.5;
    assert_true(x.g.force[3 * b + 1] > 1e-3 * slips);
    assert_true(x.g.force[3 * b + 1] < 0.9 * slips);
    gradient_room_free(&x);
    carom_tape_destroy(t);
    carom_world_destroy(w);
}

/* <w, J d> = <J' w, d> over all arrays. */
static void transposed_scene(const gradient_scene *scene, double kappa)
{
    static double w_q[MOST];
    static double w_v[MOST];
    static double q_dot[MOST];
    static double v_dot[MOST];
    rng g = rng_from(5);
    carom_world *w = scene->build(scene);
    carom_tape *t = record(w, scene->n_steps);
    const int n = 3 * carom_world_n_bodies(w);
    const carom_state_bar bar = {scene->n_steps, w_q, w_v};
    const carom_state_dot dot = {scene->n_steps, q_dot, v_dot};
    gradient_room d = gradient_room_make(w, 1);
    gradient_room x = gradient_room_make(w, 1);
    double size = 0;
    double backward = 0;
    double forward = 0;
    assert_true(n <= MOST);
    for (int k = 0; k < n; k++) {
        w_q[k] = rng_uniform(&g, -1, 1);
        w_v[k] = rng_uniform(&g, -1, 1);
    }
    assert_int_equal(carom_tape_smooth(t, kappa), CAROM_OK);
    assert_int_equal(carom_tape_gradient(t, 1, &bar, &x.g, NULL), CAROM_OK);
    for (int a = 0; a < N_GRADIENT_ARRAYS; a++) {
        for (int k = 0; k < gradient_count(w, a); k++) {
            d.array[a][k] = rng_uniform(&g, -1, 1);
            backward += d.array[a][k] * x.array[a][k];
            size += fabs(d.array[a][k] * x.array[a][k]);
        }
    }
    assert_int_equal(carom_tape_tangent(t, 1, &d.g, 1, &dot, NULL), CAROM_OK);
    for (int k = 0; k < n; k++) forward += w_q[k] * q_dot[k] + w_v[k] * v_dot[k];
    /* responses of ln^2 / kappa up to 1e6 in each of some tens of sub-steps */
    if (!(fabs(forward - backward) <= 1e-9 * (1 + size))) {
        fail_msg("%s: <w, J d> = %.17g, <J' w, d> = %.17g, sizes %g", scene->name, forward,
                 backward, size);
    }
    gradient_room_free(&d);
    gradient_room_free(&x);
    carom_tape_destroy(t);
    carom_world_destroy(w);
}

static void transposed(void **state)
{
    (void)state;
    for (int i = 0; i < 2; i++) {
        scene_integrator = i ? CAROM_LOCATED : CAROM_EULER;
        for (int k = 0; k < n_gradient_scenes; k++) transposed_scene(&gradient_scenes[k], 1e-5);
    }
}

static void refused(void **state)
{
    (void)state;
    int b;
    carom_world *w = pushed_box(0, 3, &b);
    carom_tape *t = record(w, 1);
    static const double bad[] = {-1, NAN, HUGE_VAL};
    for (int k = 0; k < 3; k++) {
        assert_int_equal(carom_tape_smooth(t, bad[k]), CAROM_E_ARGUMENT);
    }
    assert_int_equal(carom_tape_smooth(NULL, 1), CAROM_E_ARGUMENT);
    carom_tape_destroy(t);
    carom_world_destroy(w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(zero_is_the_derivative),
                                       cmocka_unit_test(error_falls_with_kappa),
                                       cmocka_unit_test(between_at_a_kink),
                                       cmocka_unit_test(transposed), cmocka_unit_test(refused)};
    scene_integrator = CAROM_LOCATED;
    return cmocka_run_group_tests(tests, NULL, NULL);
}
