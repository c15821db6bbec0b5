/* What is not asked for is not done: a world without a tape, and gradients by few arrays. */
#include "alloc_fail.h"
#include "carom/grad.h"
#include "gradient_numbers.h"
#include "near.h"
#include "scenes.h"

#include <stdlib.h>
#include <string.h>

enum { N_STEPS = 30, MOST = 64 };

/* A box slides on a floor while two links swing beside it. */
static carom_world *scene(const carom_allocator *from)
{
    carom_world_settings set = carom_world_defaults();
    carom_world *w = NULL;
    const carom_vec2 anchor = {10, 3};
    const carom_vec2 middle = {11, 3};
    carom_body_def floor = carom_body_at(CAROM_STATIC, 0, -1);
    carom_body_def box = carom_body_at(CAROM_DYNAMIC, 0, 0.25);
    carom_body_def link = carom_body_at(CAROM_DYNAMIC, 10.5, 3);
    int f;
    int a;
    int b;
    floor.friction = box.friction = 0.3;
    box.velocity[1] = 4;
    assert_int_equal(carom_world_create(&set, from, &w), CAROM_OK);
    assert_int_equal(carom_world_add_box(w, &floor, 40, 2, 0, &f), CAROM_OK);
    assert_int_equal(carom_world_add_box(w, &box, 1, 0.5, 1, NULL), CAROM_OK);
    assert_int_equal(carom_world_add_box(w, &link, 1, 0.1, 1, &a), CAROM_OK);
    link.pose.x = 11.5;
    assert_int_equal(carom_world_add_box(w, &link, 1, 0.1, 1, &b), CAROM_OK);
    assert_int_equal(carom_world_add_revolute(w, f, a, anchor, NULL), CAROM_OK);
    assert_int_equal(carom_world_add_revolute(w, a, b, middle, NULL), CAROM_OK);
    return w;
}

/* Steps of a world that no tape records request nothing and hold as much as those of one that never
 * knew a tape, also after a tape has gone; and they are the same bits. */
static void off_means_zero(void **state)
{
    (void)state;
    size_t bytes[2];
    double q[2][MOST];
    for (int taped = 0; taped < 2; taped++) {
        alloc_fail a = alloc_fail_never();
        const carom_allocator from = alloc_fail_allocator(&a);
        carom_world *w = scene(&from);
        carom_tape *t = NULL;
        if (taped) assert_int_equal(carom_tape_create(w, NULL, &t), CAROM_OK);
        for (int k = 0; k < N_STEPS; k++) {
            assert_true(
                (taped ? carom_tape_step(t, NULL, NULL) : carom_world_step(w, NULL, NULL)) >= 0);
        }
        carom_tape_destroy(t);
        const long calls = a.n_calls;
        for (int k = 0; k < N_STEPS; k++) {
            carom_step_stats s;
            assert_true(carom_world_step(w, NULL, &s) >= 0);
            assert_int_equal(s.allocations, 0);
        }
        assert_int_equal(a.n_calls, calls);
        bytes[taped] = a.live;
        assert_true(3 * carom_world_n_bodies(w) <= MOST);
        memcpy(q[taped], carom_world_q(w), 3 * (size_t)carom_world_n_bodies(w) * sizeof(double));
        carom_world_destroy(w);
        assert_int_equal(a.live, 0);
    }
    assert_int_equal(bytes[0], bytes[1]);
    assert_memory_equal(q[0], q[1], 12 * sizeof(double));
}

/* Counts of a gradient of the last poses by some of x's arrays. */
static carom_gradient_stats count(carom_tape *t, const carom_gradient *g)
{
    double ones[MOST];
    carom_gradient_stats s;
    for (int k = 0; k < MOST; k++) ones[k] = 1;
    const carom_state_bar bar = {carom_tape_steps(t), ones, NULL};
    assert_int_equal(carom_tape_gradient(t, 1, &bar, g, &s), CAROM_OK);
    return s;
}

/* Contact problems are differentiated once, whatever is asked; shapes and anchors, whose kernels at
 * the end of a stage are theirs alone, only when they are. */
static void what_is_not_asked_costs_nothing(void **state)
{
    (void)state;
    carom_world *w = scene(NULL);
    carom_tape *t;
    assert_int_equal(carom_tape_create(w, NULL, &t), CAROM_OK);
    for (int k = 0; k < N_STEPS; k++) assert_true(carom_tape_step(t, NULL, NULL) >= 0);
    gradient_room x = gradient_room_make(w, 1);
    carom_gradient by = {0};
    by.q0 = x.g.q0;
    const carom_gradient_stats poses = count(t, &by);
    by.mass = x.g.mass;
    by.friction = x.g.friction;
    by.force = x.g.force;
    by.gravity = x.g.gravity;
    by.dt = x.g.dt;
    const carom_gradient_stats numbers = count(t, &by);
    by.radius = x.g.radius;
    const carom_gradient_stats radii = count(t, &by);
    by.radius = NULL;
    by.anchors = x.g.anchors;
    const carom_gradient_stats anchors = count(t, &by);
    const carom_gradient_stats all = count(t, &x.g);
    assert_true(poses.solves > 0 && poses.contacts > 0 && poses.joints > 0);
    assert_int_equal(numbers.solves, poses.solves);
    assert_int_equal(all.solves, poses.solves);
    assert_int_equal(numbers.contacts, poses.contacts);
    assert_int_equal(numbers.joints, poses.joints);
    /* two feet, a pose more in each step whose end counts */
    assert_in_range(radii.contacts, poses.contacts + 1, poses.contacts + 2 * N_STEPS);
    assert_int_equal(radii.joints, poses.joints);
    assert_int_equal(anchors.contacts, poses.contacts);
    assert_int_equal(anchors.joints, poses.joints + 2 * N_STEPS);
    assert_int_equal(all.contacts, radii.contacts);
    assert_int_equal(all.joints, anchors.joints);
    gradient_room_free(&x);
    carom_tape_destroy(t);
    carom_world_destroy(w);
}

/* A body in free flight: no problem, no geometry. */
static void free_flight_has_nothing(void **state)
{
    (void)state;
    carom_world *w = scene_world(9.81, 1.0 / 60);
    carom_tape *t;
    scene_disc(w, 1, 0.5, 0, 100, 0.5, 0.5);
    assert_int_equal(carom_tape_create(w, NULL, &t), CAROM_OK);
    for (int k = 0; k < N_STEPS; k++) assert_true(carom_tape_step(t, NULL, NULL) >= 0);
    gradient_room x = gradient_room_make(w, 1);
    const carom_gradient_stats s = count(t, &x.g);
    assert_int_equal(s.solves + s.contacts + s.joints, 0);
    gradient_room_free(&x);
    carom_tape_destroy(t);
    carom_world_destroy(w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(off_means_zero),
                                       cmocka_unit_test(what_is_not_asked_costs_nothing),
                                       cmocka_unit_test(free_flight_has_nothing)};
    scene_integrator = CAROM_LOCATED;
    return cmocka_run_group_tests(tests, NULL, NULL);
}
