/* Islands shared among threads: the same bits for any number of them, whatever is recorded. */
#include "near.h"
#include "scenes.h"

#include "carom/events.h"
#include "carom/grad.h"
#include "carom/snapshot.h"

#include <stdlib.h>
#include <string.h>

enum { N_PLACES = 48, STEPS = 60 };

/* Every 10 m one of: a box that slides under another, a chain of three, two discs that collide, a
 * ball that bounces for ever. */
static void add_place(carom_world *w, int k)
{
    const double x = 10.0 * k;
    if (k % 4 == 0) {
        scene_push(w, scene_box(w, 1 + k, 0.5, 0.25, (carom_pose){0, x, 0.25}, 0.5, 0.25), 0, 2, 0);
        scene_box(w, 1, 0.25, 0.25, (carom_pose){0.03, x, 0.8}, 0.5, 0.25);
    } else if (k % 4 == 1) {
        int last = 0;
        for (int i = 0; i < 3; i++) {
            const carom_pose pose = {acos(-1) / 2, x + 0.5 + i, 4};
            const int b = scene_box(w, 1, 0.05, 0.5, pose, 0.5, 0);
            const carom_vec2 pin = {x + i, 4};
            assert_int_equal(carom_world_add_revolute(w, last, b, pin, NULL), CAROM_OK);
            last = b;
        }
    } else if (k % 4 == 2) {
        scene_push(w, scene_disc(w, 1, 0.3, x - 2, 0.3, 0.4, 0.5), 0, 4, 0);
        scene_push(w, scene_disc(w, 2 + k, 0.4, x + 2, 0.4, 0.4, 0.5), 0, -3, 0);
    } else {
        scene_disc(w, 1, 0.25, x, 1 + 0.05 * k, 0.5, 1);
    }
}

static carom_world *build(int threads, int order)
{
    carom_world_settings set = carom_world_defaults();
    carom_world *w;
    set.threads = threads;
    set.order = order;
    assert_int_equal(carom_world_create(&set, NULL, &w), CAROM_OK);
    const carom_vec2 corners[4] = {{-100, -1}, {600, -1}, {600, 0}, {-100, 0}};
    const carom_shape shape = {0, 4, corners};
    carom_body_def floor = carom_body_at(CAROM_STATIC, 0, 0);
    floor.shapes = &shape;
    floor.n_shapes = 1;
    assert_int_equal(carom_world_add_body(w, &floor, NULL), CAROM_OK);
    for (int k = 0; k < N_PLACES; k++) add_place(w, k);
    assert_int_equal(carom_world_record_events(w, 1), CAROM_OK);
    return w;
}

static void assert_same_state(const carom_world *a, const carom_world *b)
{
    const size_t bytes = 3 * (size_t)carom_world_n_bodies(a) * sizeof(double);
    assert_memory_equal(carom_world_q(a), carom_world_q(b), bytes);
    assert_memory_equal(carom_world_v(a), carom_world_v(b), bytes);
}

static void assert_same_events(const carom_world *a, const carom_world *b)
{
    int n;
    int m;
    const carom_contact_event *x = carom_world_events(a, &n);
    const carom_contact_event *y = carom_world_events(b, &m);
    assert_int_equal(n, m);
    for (int k = 0; k < n; k++) {
        assert_int_equal(x[k].kind, y[k].kind);
        assert_int_equal(x[k].body_a, y[k].body_a);
        assert_int_equal(x[k].body_b, y[k].body_b);
        assert_true(x[k].time == y[k].time && x[k].ln == y[k].ln && x[k].lt == y[k].lt);
    }
}

static void assert_same_figures(const carom_step_stats *a, const carom_step_stats *b)
{
    assert_int_equal(a->status, b->status);
    assert_int_equal(a->n_islands, b->n_islands);
    assert_int_equal(a->n_contacts, b->n_contacts);
    assert_int_equal(a->n_events, b->n_events);
    assert_int_equal(a->n_substeps, b->n_substeps);
    assert_true(a->residual == b->residual && a->penetration == b->penetration);
    assert_true(a->estimate == b->estimate && a->energy == b->energy);
}

static void same_bits(void **state)
{
    (void)state;
    static const int counts[] = {2, 3, 64};
    for (int order = 2; order <= 4; order += 2) {
        for (int i = 0; i < 3; i++) {
            carom_world *one = build(1, order);
            carom_world *many = build(counts[i], order);
            for (int k = 0; k < STEPS; k++) {
                carom_step_stats a;
                carom_step_stats b;
                scene_run(one, 1, &a);
                scene_run(many, 1, &b);
                assert_same_state(one, many);
                assert_same_events(one, many);
                assert_same_figures(&a, &b);
            }
            carom_world_destroy(one);
            carom_world_destroy(many);
        }
    }
}

/* Stacks that sleep, and balls that wake some of them. */
static carom_world *sleepers(int threads)
{
    carom_world_settings set = carom_world_defaults();
    carom_world *w;
    set.threads = threads;
    set.sleep = 1;
    assert_int_equal(carom_world_create(&set, NULL, &w), CAROM_OK);
    scene_floor(w, 0.5, 0);
    for (int s = 0; s < 9; s++) {
        for (int k = 0; k < 12; k++) {
            scene_box(w, 1, 0.5, 0.5, (carom_pose){0, 3.0 * s - 12, k + 0.5}, 0.5, 0);
        }
    }
    for (int k = 0; k < 3; k++) {
        scene_push(w, scene_disc(w, 3, 0.4, -15 - k, 6 + k, 0.5, 0.5), 0, 8 + k, 6);
    }
    return w;
}

static void sleep_is_the_same(void **state)
{
    (void)state;
    carom_world *one = sleepers(1);
    carom_world *many = sleepers(3);
    int asleep = 0;
    for (int k = 0; k < 2 * STEPS; k++) {
        carom_step_stats a;
        carom_step_stats b;
        scene_run(one, 1, &a);
        scene_run(many, 1, &b);
        assert_same_state(one, many);
        assert_int_equal(a.n_asleep, b.n_asleep);
        if (a.n_asleep > asleep) asleep = a.n_asleep;
    }
    assert_true(asleep >= 12);
    carom_world_destroy(one);
    carom_world_destroy(many);
}

/* A tape is recorded by one thread, a snapshot of one number of threads is restored by another. */
static void tapes_and_snapshots(void **state)
{
    (void)state;
    carom_world *one = build(1, 2);
    carom_world *many = build(4, 2);
    carom_tape *tape;
    scene_run(one, STEPS, NULL);
    assert_int_equal(carom_tape_create(many, NULL, &tape), CAROM_OK);
    for (int k = 0; k < STEPS / 2; k++) {
        assert_int_equal(carom_tape_step(tape, NULL, NULL), CAROM_OK);
    }
    carom_tape_destroy(tape);
    scene_run(many, STEPS / 2, NULL);
    assert_same_state(one, many);
    size_t size = 0;
    assert_int_equal(carom_world_snapshot(many, 0, NULL, &size), CAROM_OK);
    unsigned char *bytes = malloc(size);
    assert_non_null(bytes);
    assert_int_equal(carom_world_snapshot(many, size, bytes, &size), CAROM_OK);
    scene_run(many, 10, NULL);
    assert_int_equal(carom_world_restore(one, size, bytes), CAROM_OK);
    scene_run(one, 10, NULL);
    assert_same_state(one, many);
    free(bytes);
    carom_world_destroy(one);
    carom_world_destroy(many);
}

/* What a step needs is there after the first ones, also that of the threads; with one thread there
 * is nothing of theirs. */
static void memory(void **state)
{
    (void)state;
    carom_world *one = build(1, 2);
    carom_world *many = build(4, 2);
    carom_step_stats s;
    scene_run(one, STEPS, NULL);
    scene_run(many, STEPS, NULL);
    /* at least two of the threads have states of their own: q and v of each of ten solves */
    const size_t states = 10 * 6 * sizeof(double) * (size_t)carom_world_n_bodies(one);
    assert_true(carom_world_measure(many).bytes > carom_world_measure(one).bytes + 2 * states);
    long requests = 0;
    for (int k = 0; k < STEPS; k++) {
        scene_run(one, 1, &s);
        requests += s.allocations;
    }
    /* discs that have met go their ways; what is new is seldom */
    assert_at_most("requests", (double)requests, 4);
    carom_world_destroy(one);
    carom_world_destroy(many);
}

static void bad_numbers_are_refused(void **state)
{
    (void)state;
    static const int bad[] = {0, -1, 65};
    for (int k = 0; k < 3; k++) {
        carom_world_settings set = carom_world_defaults();
        carom_world *w;
        set.threads = bad[k];
        assert_int_equal(carom_world_create(&set, NULL, &w), CAROM_E_ARGUMENT);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(same_bits),
        cmocka_unit_test(sleep_is_the_same),
        cmocka_unit_test(tapes_and_snapshots),
        cmocka_unit_test(memory),
        cmocka_unit_test(bad_numbers_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
