/* Gradients of runs with joints against central differences, by every number of a joint. */
#include "fdiff.h"
#include "gradient_numbers.h"
#include "gradient_scenes.h"
#include "near.h"
#include "rng.h"
#include "scenes.h"

#include <stdlib.h>

/* Differences of fourth order of runs of 20 steps; relative to the largest entry of an array. */
static const double DIFFERENCE_TOL = 1e-6;
enum { N_STEPS = 20, MAX_BODIES = 4, MAX_TESTS = 128 };

typedef struct run {
    const gradient_scene *s;
    double weight[2][3 * MAX_BODIES]; /* of q, v at the end */
    int array, entry;                 /* the number that is moved */
} run;

static double loss(double t, void *user)
{
    const run *r = user;
    carom_world *w = r->s->build(r->s);
    *gradient_number(w, r->array, r->entry) += t;
    scene_run(w, N_STEPS, NULL);
    double sum = 0;
    for (int k = 0; k < 3 * carom_world_n_bodies(w); k++) {
        sum += r->weight[0][k] * carom_world_q(w)[k] + r->weight[1][k] * carom_world_v(w)[k];
    }
    carom_world_destroy(w);
    return sum;
}

static void reverse(const run *r, carom_world *w, const carom_gradient *g)
{
    carom_tape *tape;
    const carom_state_bar bar = {N_STEPS, r->weight[0], r->weight[1]};
    assert_int_equal(carom_tape_create(w, NULL, &tape), CAROM_OK);
    for (int k = 0; k < N_STEPS; k++) {
        if (carom_tape_step(tape, NULL, NULL) < 0) fail_msg("%s", carom_world_error(w));
    }
    assert_int_equal(carom_tape_gradient(tape, 1, &bar, g, NULL), CAROM_OK);
    carom_tape_destroy(tape);
}

static void check_array(run *r, carom_world *w, int a, const double *x)
{
    /* events are located to 1e-13 m, which differences magnify to 1e-8: that counts as zero */
    double largest = 1e-2;
    for (int k = 0; k < gradient_count(w, a); k++) largest = fmax(largest, fabs(x[k]));
    r->array = a;
    for (int k = 0; k < gradient_count(w, a); k++) {
        double error;
        if (!gradient_has_meaning(w, a, k)) continue;
        r->entry = k;
        const double step = r->s->step * fmax(1, fabs(*gradient_number(w, a, k)));
        double expected = fdiff(loss, r, step, &error);
        /* an event that crosses the end of a step kinks the differences */
        if (error > DIFFERENCE_TOL * largest) expected = fdiff(loss, r, step / 32, &error);
        if (fabs(x[k] - expected) <= DIFFERENCE_TOL * largest) continue;
        fail_msg("%s, integrator %d: d/d %s[%d] = %.12g, differences %.12g (+- %.2g)", r->s->name,
                 (int)scene_integrator, gradient_array_names[a], k, x[k], expected, error);
    }
}

static void check_scene(const gradient_scene *s)
{
    rng g = rng_from(99);
    run r = {s, {{0}, {0}}, -1, 0};
    for (int k = 0; k < 6 * MAX_BODIES; k++) r.weight[k % 2][k / 2] = rng_uniform(&g, -1, 1);
    carom_world *w = s->build(s);
    gradient_room x = gradient_room_make(w, 1);
    reverse(&r, w, &x.g);
    assert_true(carom_world_n_bodies(w) <= MAX_BODIES);
    for (int a = 0; a < N_GRADIENT_ARRAYS; a++) check_array(&r, w, a, x.array[a]);
    gradient_room_free(&x);
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
    static struct CMUnitTest tests[MAX_TESTS];
    const struct CMUnitTest closed = cmocka_unit_test(closed_forms);
    const int n = 3 * n_gradient_joint_scenes;
    assert_true(n < MAX_TESTS);
    for (int k = 0; k < n; k++) {
        tests[k].name = gradient_joint_scenes[k / 3].name;
        tests[k].test_func = maps[k % 3];
        tests[k].initial_state = (void *)(size_t)&gradient_joint_scenes[k / 3];
    }
    tests[n] = closed;
    return _cmocka_run_group_tests("joint_gradient", tests, (size_t)n + 1, NULL, NULL);
}
