/* Sleeping islands: nothing that is not at rest sleeps, what sleeps costs nothing, and what wakes
 * goes on as if every step had been run. */
#include "near.h"
#include "scenes.h"

#include "carom/events.h"
#include "carom/grad.h"
#include "carom/snapshot.h"

#include <stdlib.h>
#include <string.h>

enum { N_STACKS = 5, STACK = 4, N_BOXES = N_STACKS * STACK, SETTLE = 8 };

static carom_world *world(int sleep, double g)
{
    carom_world_settings set = carom_world_defaults();
    carom_world *w;
    set.sleep = sleep;
    set.integrator = (int)scene_integrator;
    set.gravity[1] = -g;
    assert_int_equal(carom_world_create(&set, NULL, &w), CAROM_OK);
    return w;
}

/* Stacks at rest 2 m apart, a pendulum that hangs still; bodies 1 to N_BOXES + 1. */
static carom_world *stacks(int sleep)
{
    carom_world *w = world(sleep, 9.81);
    const int floor = scene_floor(w, 0.5, 0);
    for (int k = 0; k < N_BOXES; k++) {
        const carom_pose pose = {0, 2.0 * (k / STACK), 0.25 + 0.5 * (k % STACK)};
        scene_box(w, 1, 0.5, 0.25, pose, 0.5, 0);
    }
    const int bob = scene_disc(w, 1, 0.25, -8, 2, 0.5, 0);
    assert_int_equal(carom_world_add_revolute(w, floor, bob, (carom_vec2){-8, 4}, NULL), CAROM_OK);
    assert_int_equal(carom_world_record_events(w, 1), CAROM_OK);
    return w;
}

static int count_asleep(carom_world *w)
{
    carom_step_stats s;
    scene_run(w, 1, &s);
    return s.n_asleep;
}

static void assert_same_state(const carom_world *a, const carom_world *b)
{
    const size_t bytes = 3 * (size_t)carom_world_n_bodies(a) * sizeof(double);
    assert_memory_equal(carom_world_q(a), carom_world_q(b), bytes);
    assert_memory_equal(carom_world_v(a), carom_world_v(b), bytes);
}

/* All sleep: no work, no memory, no motion, and the contacts, joint forces and energy still there;
 * no event. */
static void rest_is_not_run(void **state)
{
    (void)state;
    carom_world *w = stacks(1);
    carom_world *awake = stacks(0);
    carom_step_stats s;
    int n_events;
    scene_run(w, SETTLE, NULL);
    scene_run(awake, SETTLE, NULL);
    double *q = malloc(3 * (N_BOXES + 2) * sizeof *q);
    assert_non_null(q);
    memcpy(q, carom_world_q(w), 3 * (N_BOXES + 2) * sizeof *q);
    for (int k = 0; k < 50; k++) {
        scene_run(w, 1, &s);
        assert_int_equal(s.n_asleep, N_BOXES + 1);
        assert_int_equal(s.factorizations, 0);
        assert_int_equal(s.allocations, 0);
        assert_memory_equal(carom_world_q(w), q, 3 * (N_BOXES + 2) * sizeof *q);
        carom_world_events(w, &n_events);
        assert_int_equal(n_events, 0);
    }
    carom_step_stats t;
    scene_run(awake, 51, &t);
    assert_int_equal(t.n_asleep, 0);
    assert_int_equal(s.n_contacts, t.n_contacts);
    assert_int_equal(carom_world_n_contacts(w), carom_world_n_contacts(awake));
    assert_near(s.energy, t.energy, 1e-12 * fabs(t.energy));
    /* m g, from a residual of 1e-10 */
    assert_near(carom_world_joint_force(w, 0).force.y, 9.81, 1e-8);
    free(q);
    carom_world_destroy(w);
    carom_world_destroy(awake);
}

/* What changes from outside wakes the islands it is about, in the same step. */
static void changes_wake(void **state)
{
    (void)state;
    carom_world *w = stacks(1);
    double force[3 * (N_BOXES + 2)] = {0};
    double q[3 * (N_BOXES + 2)];
    double v[3 * (N_BOXES + 2)];
    double friction[N_BOXES + 2];
    carom_step_stats s;
    scene_run(w, SETTLE, NULL);
    force[3 * STACK + 1] = 100; /* the top of the first stack */
    assert_int_equal(carom_world_step(w, force, &s), CAROM_OK);
    assert_int_equal(s.n_asleep, N_BOXES + 1 - STACK);
    assert_true(carom_world_v(w)[3 * STACK + 1] > 0.1);
    memcpy(q, carom_world_q(w), sizeof q);
    memcpy(v, carom_world_v(w), sizeof v);
    v[3 * N_BOXES + 2] = 1; /* the last one jumps */
    assert_int_equal(carom_world_set_state(w, q, v), CAROM_OK);
    scene_run(w, 1, NULL);
    assert_true(carom_world_v(w)[3 * N_BOXES + 2] > 0.5);
    scene_run(w, 200, NULL);
    assert_true(count_asleep(w) > N_BOXES / 2);
    carom_parameters p = {0};
    for (int k = 0; k < N_BOXES + 2; k++) friction[k] = 0.25;
    p.friction = friction;
    assert_int_equal(carom_world_set_parameters(w, &p), CAROM_OK);
    assert_int_equal(count_asleep(w), 0);
    carom_world_destroy(w);
}

/* A box slides into sleeping stacks: until then they sleep, then the run is that of a world that
 * never slept, to what 1e-10 in the residual allows, and ends asleep. */
static void a_hit_wakes(void **state)
{
    (void)state;
    carom_world *w[2];
    for (int i = 0; i < 2; i++) {
        w[i] = stacks(i);
        const int hit = scene_box(w[i], 0.25, 0.25, 0.25, (carom_pose){0, 13, 0.25}, 0.5, 0);
        scene_push(w[i], hit, 0, -7, 0);
        scene_run(w[i], 30, NULL);
    }
    int least = N_BOXES;
    for (int k = 0; k < 45; k++) {
        const int n = count_asleep(w[1]);
        scene_run(w[0], 1, NULL);
        least = n < least ? n : least;
        for (int b = 0; b < 3 * (N_BOXES + 3); b++) {
            assert_near(carom_world_q(w[1])[b], carom_world_q(w[0])[b], 1e-7);
        }
    }
    assert_int_equal(least, N_BOXES + 1 - STACK);
    scene_run(w[1], 300, NULL);
    assert_int_equal(count_asleep(w[1]), N_BOXES + 2);
    carom_world_destroy(w[0]);
    carom_world_destroy(w[1]);
}

/* A snapshot does not say who sleeps, and need not: running what sleeps changes no bit. */
static void restored_asleep(void **state)
{
    (void)state;
    carom_world *w = stacks(1);
    carom_world *other = stacks(1);
    const int box = N_BOXES;
    double v[3 * (N_BOXES + 2)];
    size_t size = 0;
    scene_run(w, SETTLE, NULL);
    assert_int_equal(carom_world_snapshot(w, 0, NULL, &size), CAROM_OK);
    unsigned char *bytes = malloc(size);
    assert_non_null(bytes);
    assert_int_equal(carom_world_snapshot(w, size, bytes, &size), CAROM_OK);
    assert_int_equal(carom_world_restore(other, size, bytes), CAROM_OK);
    double force[3 * (N_BOXES + 2)] = {0};
    force[3 * box + 1] = 30;
    assert_int_equal(count_asleep(w), N_BOXES + 1);
    assert_int_equal(count_asleep(other), 0);
    assert_same_state(w, other);
    for (int k = 0; k < 30; k++) {
        assert_int_equal(carom_world_step(w, force, NULL), CAROM_OK);
        assert_int_equal(carom_world_step(other, force, NULL), CAROM_OK);
        assert_same_state(w, other);
    }
    memcpy(v, carom_world_v(w), sizeof v);
    assert_true(fabs(v[3 * box + 1]) > 0.1);
    free(bytes);
    carom_world_destroy(w);
    carom_world_destroy(other);
}

/* At the top of a throw a ball has no speed, and does not stay there; one that has never moved
 * falls; one on a slope too steep for it slides. */
static void what_moves_does_not_sleep(void **state)
{
    (void)state;
    const double g = 8;
    const double dt = 1.0 / 64;
    carom_world_settings set = carom_world_defaults();
    carom_world *w;
    set.sleep = 1;
    set.dt = dt;
    set.gravity[1] = -g;
    assert_int_equal(carom_world_create(&set, NULL, &w), CAROM_OK);
    scene_push(w, scene_disc(w, 1, 0.25, 0, 0, 0.5, 0), 0, 0, 4);
    scene_disc(w, 1, 0.25, 5, 0, 0.5, 0);
    for (int k = 1; k <= 64; k++) {
        const double t = k * dt;
        assert_int_equal(count_asleep(w), 0);
        assert_near(carom_world_q(w)[2], 4 * t - 0.5 * g * t * t, 1e-12);
        assert_near(carom_world_q(w)[5], -0.5 * g * t * t, 1e-12);
    }
    carom_world_destroy(w);
}

/* On a tape nothing sleeps, and its bits are those without the setting. */
static void tapes_are_awake(void **state)
{
    (void)state;
    carom_world *w[2];
    for (int i = 0; i < 2; i++) {
        carom_tape *tape;
        carom_step_stats s;
        w[i] = stacks(i);
        assert_int_equal(carom_tape_create(w[i], NULL, &tape), CAROM_OK);
        for (int k = 0; k < 20; k++) {
            assert_int_equal(carom_tape_step(tape, NULL, &s), CAROM_OK);
            assert_int_equal(s.n_asleep, 0);
        }
        carom_tape_destroy(tape);
    }
    assert_same_state(w[0], w[1]);
    carom_world_destroy(w[0]);
    carom_world_destroy(w[1]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(rest_is_not_run, scene_euler),
        cmocka_unit_test_setup(rest_is_not_run, scene_located),
        cmocka_unit_test_setup(rest_is_not_run, scene_fixed),
        cmocka_unit_test_setup(changes_wake, scene_located),
        cmocka_unit_test_setup(a_hit_wakes, scene_located),
        cmocka_unit_test_setup(a_hit_wakes, scene_fixed),
        cmocka_unit_test_setup(restored_asleep, scene_euler),
        cmocka_unit_test_setup(restored_asleep, scene_located),
        cmocka_unit_test_setup(what_moves_does_not_sleep, scene_located),
        cmocka_unit_test_setup(tapes_are_awake, scene_located),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
