/* Islands: bodies that cannot meet within a frame do not notice each other; those that are thrown
 * out of the room foreseen for them meet all the same. */
#include "near.h"
#include "scenes.h"

#include "carom/grad.h"

#include <string.h>

enum { N_PARTS = 4, STEPS = 90 };

/* Part k of the world alone, or all of them, 20 m apart so that x is exact in binary fractions. */
static void add_part(carom_world *w, int k)
{
    const double x = 20.0 * k;
    const carom_pose low = {0, x, 0.25};
    const carom_pose high = {0.03 * k, x + 0.0625, 0.78125};
    const int a = scene_box(w, 1 + k, 0.5, 0.25, low, 0.5, 0.25);
    const int b = scene_box(w, 1, 0.25, 0.25, high, 0.5, 0.25);
    const int c = scene_disc(w, 2, 0.25, x - 1, 1 + 0.25 * k, 0.5, 0.75);
    scene_push(w, a, 0, 0.5, 0);
    scene_push(w, b, 0.25, 0, 0);
    scene_push(w, c, 0, 0.125 * k, 0);
}

static carom_world *parts(int first, int count)
{
    carom_world *w = scene_world(9.81, 1.0 / 60);
    carom_body_def floor = carom_body_defaults();
    const carom_vec2 corners[4] = {{-100, -1}, {100, -1}, {100, 0}, {-100, 0}};
    const carom_shape shape = {0, 4, corners};
    floor.type = CAROM_STATIC;
    floor.shapes = &shape;
    floor.n_shapes = 1;
    assert_int_equal(carom_world_add_body(w, &floor, NULL), CAROM_OK);
    for (int k = first; k < first + count; k++) add_part(w, k);
    return w;
}

/* The same bits with and without the others. */
static void others_are_not_noticed(void **state)
{
    (void)state;
    carom_step_stats s;
    carom_world *all = parts(0, N_PARTS);
    scene_run(all, STEPS, &s);
    assert_true(s.n_islands >= N_PARTS);
    for (int k = 0; k < N_PARTS; k++) {
        carom_world *one = parts(k, 1);
        scene_run(one, STEPS, NULL);
        const size_t bytes = 9 * sizeof(double);
        assert_memory_equal(carom_world_q(one) + 3, carom_world_q(all) + 3 + 9 * k, bytes);
        assert_memory_equal(carom_world_v(one) + 3, carom_world_v(all) + 3 + 9 * k, bytes);
        carom_world_destroy(one);
    }
    carom_world_destroy(all);
}

typedef struct recording {
    carom_world *w;
    carom_tape *tape;
    double q0[3 * (1 + 3 * N_PARTS)];
    double friction[1 + 3 * N_PARTS];
    double mass[1 + 3 * N_PARTS];
} recording;

/* Gradient of the last heights, weighted by the part. */
static void differentiate(recording *r, int first, int count)
{
    double q_bar[3 * (1 + 3 * N_PARTS)] = {0};
    r->w = parts(first, count);
    assert_int_equal(carom_tape_create(r->w, NULL, &r->tape), CAROM_OK);
    for (int k = 0; k < STEPS; k++) assert_true(carom_tape_step(r->tape, NULL, NULL) >= 0);
    for (int k = 3; k < 3 * (1 + 3 * count); k++) q_bar[k] = 1;
    const carom_state_bar bar = {STEPS, q_bar, NULL};
    carom_gradient g = {0};
    g.q0 = r->q0;
    g.friction = r->friction;
    g.mass = r->mass;
    assert_int_equal(carom_tape_gradient(r->tape, 1, &bar, &g, NULL), CAROM_OK);
    carom_tape_destroy(r->tape);
    carom_world_destroy(r->w);
}

/* The gradient of a part is the same bits with and without the others; the floor's is the sum. */
static void gradients_are_apart(void **state)
{
    (void)state;
    static recording all;
    static recording one;
    double floor_friction = 0;
    differentiate(&all, 0, N_PARTS);
    for (int k = 0; k < N_PARTS; k++) {
        differentiate(&one, k, 1);
        assert_memory_equal(one.q0 + 3, all.q0 + 3 + 9 * k, 9 * sizeof(double));
        assert_memory_equal(one.mass + 1, all.mass + 1 + 3 * k, 3 * sizeof(double));
        assert_memory_equal(one.friction + 1, all.friction + 1 + 3 * k, 3 * sizeof(double));
        floor_friction += one.friction[0];
    }
    /* sums of some hundred terms in another order */
    assert_near(all.friction[0], floor_friction, 1e-11 * (1 + fabs(floor_friction)));
}

/* A heavy ball hits a light one, which leaves its foreseen room twice as fast as the heavy one and
 * hits a third within the same frame: one-dimensional elastic impacts in closed form. */
static void thrown_out_of_its_room(void **state)
{
    (void)state;
    const double M = 1000;
    const double m = 1;
    const double V = 30;
    carom_world *w = scene_world(0, 1.0 / 60);
    const int heavy = scene_disc(w, M, 0.125, 0, 0, 0, 1);
    const int light = scene_disc(w, m, 0.125, 0.375, 0, 0, 1);
    const int third = scene_disc(w, m, 0.125, 1.0, 0, 0, 1);
    carom_step_stats s;
    scene_push(w, heavy, 0, V, 0);
    scene_run(w, 1, &s);
    /* The light one takes 2 M V / (M + m) over the gap of 0.375 m, then gives it to the third. */
    const double u = 2 * M * V / (M + m);
    const double first = 0.125 / V;
    const double second = first + 0.375 / u;
    const double dt = 1.0 / 60;
    assert_true(second < dt);
    assert_near(carom_world_v(w)[3 * third + 1], u, 1e-9 * u);
    /* The heavy one meets the light one, at rest now, after this frame. */
    assert_near(carom_world_v(w)[3 * light + 1], 0, 1e-9 * u);
    assert_near(carom_world_q(w)[3 * third + 1], 1 + u * (dt - second), 1e-9);
    carom_world_destroy(w);
}

/* Bodies in free flight: one island, nothing solved, nothing factored. */
static void free_flight_solves_nothing(void **state)
{
    (void)state;
    carom_world *w = scene_world(9.81, 1.0 / 60);
    for (int k = 0; k < 50; k++) scene_disc(w, 1, 0.2, k, 0, 0.5, 0.5);
    carom_step_stats s;
    scene_run(w, 10, &s);
    assert_int_equal(s.n_islands, 1);
    assert_int_equal(s.factorizations, 0);
    assert_int_equal(s.n_contacts, 0);
    assert_int_equal(s.n_candidates, 0);
    assert_int_equal(s.allocations, 0);
    carom_world_destroy(w);
}

/* One ball bounces, nine rest: the bounce subdivides nobody else's frame. */
static void an_impact_is_its_islands(void **state)
{
    (void)state;
    carom_world *w = scene_world(9.81, 1.0 / 60);
    scene_floor(w, 0.5, 0.5);
    for (int k = 0; k < 9; k++) scene_disc(w, 1, 0.25, k - 4, 0.25, 0.5, 0);
    scene_disc(w, 1, 0.25, 6, 0.30, 0.5, 0.5);
    scene_run(w, 4, NULL);
    carom_step_stats most = {0};
    for (int k = 0; k < 20; k++) {
        carom_step_stats s;
        scene_run(w, 1, &s);
        assert_int_equal(s.n_islands, 10);
        if (s.n_substeps > most.n_substeps) most = s;
    }
    assert_true(most.n_substeps > 1);
    /* Nine at rest know their impulses: only the bouncing one factors. */
    assert_in_range(most.factorizations, 0, 20);
    carom_world_destroy(w);
}

/* Links that swing, 30 m away from stacks of 1 to n boxes. */
static carom_world *links_beside_stacks(int n)
{
    carom_world *w = scene_world(9.81, 1.0 / 60);
    scene_links(w, 2);
    const carom_vec2 corners[4] = {{-200, -11}, {0, -11}, {0, -10}, {-200, -10}};
    const carom_shape shape = {0, 4, corners};
    carom_body_def floor = carom_body_at(CAROM_STATIC, 0, 0);
    floor.shapes = &shape;
    floor.n_shapes = 1;
    assert_int_equal(carom_world_add_body(w, &floor, NULL), CAROM_OK);
    for (int k = 0; k < n; k++) {
        for (int i = 0; i <= k; i++) {
            scene_box(w, 1, 0.5, 0.25, (carom_pose){0, -30 - 3 * k, -9.75 + 0.5 * i}, 0.5, 0);
        }
    }
    return w;
}

/* Stacks at rest keep their factors while other islands come between: of all factorizations none is
 * theirs, and nothing is allocated. */
static void factors_are_kept_by_island(void **state)
{
    (void)state;
    carom_world *alone = links_beside_stacks(0);
    carom_world *all = links_beside_stacks(6);
    scene_run(alone, 5, NULL);
    scene_run(all, 5, NULL);
    for (int k = 0; k < 150; k++) {
        carom_step_stats a;
        carom_step_stats b;
        scene_run(alone, 1, &a);
        scene_run(all, 1, &b);
        assert_int_equal(b.n_islands, 7);
        assert_true(a.factorizations > 0);
        assert_int_equal(a.factorizations, b.factorizations);
        assert_int_equal(b.allocations, 0);
    }
    carom_world_destroy(alone);
    carom_world_destroy(all);
}

/* Solvers of islands that are no more are given up. */
static void solvers_of_the_past_are_given_up(void **state)
{
    (void)state;
    carom_world *w = scene_world(0, 1.0 / 60);
    for (int k = 0; k < 20; k++) {
        scene_push(w, scene_disc(w, 1, 0.25, 100 * k, 0, 0.5, 1), 0, 1, 0);
        scene_push(w, scene_disc(w, 1, 0.25, 100 * k + 1, 0, 0.5, 1), 0, -1, 0);
    }
    carom_step_stats s;
    scene_run(w, 20, &s);
    const size_t busy = carom_world_measure(w).bytes;
    scene_run(w, 160, &s); /* each pair has met and parted */
    assert_int_equal(s.n_candidates, 0);
    assert_true(carom_world_measure(w).bytes < busy);
    carom_world_destroy(w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(others_are_not_noticed, scene_euler),
        cmocka_unit_test_setup(others_are_not_noticed, scene_located),
        cmocka_unit_test_setup(others_are_not_noticed, scene_fixed),
        cmocka_unit_test_setup(gradients_are_apart, scene_euler),
        cmocka_unit_test_setup(gradients_are_apart, scene_located),
        cmocka_unit_test_setup(thrown_out_of_its_room, scene_euler),
        cmocka_unit_test_setup(thrown_out_of_its_room, scene_located),
        cmocka_unit_test_setup(free_flight_solves_nothing, scene_located),
        cmocka_unit_test_setup(an_impact_is_its_islands, scene_located),
        cmocka_unit_test_setup(factors_are_kept_by_island, scene_located),
        cmocka_unit_test_setup(factors_are_kept_by_island, scene_fixed),
        cmocka_unit_test_setup(solvers_of_the_past_are_given_up, scene_located),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
