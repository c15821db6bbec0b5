/* Gradients of long runs from snapshots: the same bits in less memory. */
#include "near.h"
#include "scenes.h"

#include "carom/grad.h"

#include <stdlib.h>
#include <string.h>

enum { N_BODIES = 6, STEPS = 100 };

/* A box slides, a ball bounces into two joined links: impacts, friction that stops, joints. */
static carom_world *machine(void)
{
    carom_world *w = scene_world(9.81, 1.0 / 60);
    scene_floor(w, 0.4, 0.6);
    const int box = scene_box(w, 2, 0.4, 0.2, (carom_pose){0, -3, 0.2}, 0.3, 0);
    const int ball = scene_disc(w, 1, 0.2, -1, 1, 0.5, 0.7);
    const int hook = scene_anchor(w);
    const int upper = scene_box(w, 1, 0.05, 0.4, (carom_pose){0, 1, 1.6}, 0.3, 0.5);
    const int lower = scene_box(w, 1, 0.05, 0.4, (carom_pose){0, 1, 0.8}, 0.3, 0.5);
    const carom_vec2 pins[2] = {{1, 2}, {1, 1.2}};
    assert_int_equal(carom_world_add_revolute(w, hook, upper, pins[0], NULL), CAROM_OK);
    assert_int_equal(carom_world_add_revolute(w, upper, lower, pins[1], NULL), CAROM_OK);
    scene_push(w, box, 0, 2, 0);
    scene_push(w, ball, 3, 1.5, 0);
    return w;
}

typedef struct result {
    double q0[3 * N_BODIES], v0[3 * N_BODIES], mass[N_BODIES], friction[N_BODIES];
    double force_steps[3 * N_BODIES * STEPS];
    double anchors[8];
    long replayed; /* no bit of the gradient, so last */
} result;

static void push(int step, double *force)
{
    memset(force, 0, 3 * N_BODIES * sizeof *force);
    force[3 * 1 + 1] = 0.5 * sin(0.1 * step);
    force[3 * 5 + 1] = 0.2 * cos(0.07 * step);
}

static void record(carom_tape *t, int from, int to)
{
    double force[3 * N_BODIES];
    for (int k = from; k < to; k++) {
        push(k, force);
        assert_true(carom_tape_step(t, force, NULL) >= 0);
    }
}

/* Of the last poses and of some on the way. */
static carom_status try_gradient(carom_tape *t, result *x)
{
    double q_bar[3 * N_BODIES] = {0};
    double v_bar[3 * N_BODIES] = {0};
    const int last = carom_tape_steps(t);
    for (int k = 3; k < 3 * N_BODIES; k++) q_bar[k] = 1 + 0.1 * k;
    for (int k = 3; k < 3 * N_BODIES; k++) v_bar[k] = 0.3;
    const carom_state_bar bars[2] = {{last, q_bar, v_bar}, {last / 3, q_bar, NULL}};
    carom_gradient g = {0};
    carom_gradient_stats stats;
    memset(x, 0, sizeof *x);
    g.q0 = x->q0;
    g.v0 = x->v0;
    g.mass = x->mass;
    g.friction = x->friction;
    g.force_steps = x->force_steps;
    g.anchors = (carom_vec2 *)x->anchors;
    const carom_status e = carom_tape_gradient(t, 2, bars, &g, &stats);
    x->replayed = e < 0 ? 0 : stats.replayed;
    return e;
}

static void differentiate(carom_tape *t, result *x)
{
    assert_int_equal(try_gradient(t, x), CAROM_OK);
}

static void same_bits(void **state)
{
    (void)state;
    static const int every[4] = {1, 7, 10, 1000};
    static result whole;
    static result pieces;
    carom_world *w = machine();
    carom_tape *t;
    assert_int_equal(carom_tape_create(w, NULL, &t), CAROM_OK);
    record(t, 0, STEPS);
    differentiate(t, &whole);
    carom_tape_destroy(t);
    carom_world_destroy(w);
    for (int i = 0; i < 4; i++) {
        w = machine();
        assert_int_equal(carom_tape_create(w, NULL, &t), CAROM_OK);
        assert_int_equal(carom_tape_checkpoint(t, every[i]), CAROM_OK);
        record(t, 0, STEPS);
        for (int again = 0; again < 2; again++) {
            differentiate(t, &pieces);
            assert_memory_equal(&pieces, &whole, offsetof(result, replayed));
        }
        carom_tape_destroy(t);
        carom_world_destroy(w);
    }
}

/* A gradient half way neither disturbs the run nor what is recorded after it. */
static void a_gradient_on_the_way(void **state)
{
    (void)state;
    static result whole;
    static result pieces;
    static result half;
    carom_world *w[2];
    carom_tape *t[2];
    for (int i = 0; i < 2; i++) {
        w[i] = machine();
        assert_int_equal(carom_tape_create(w[i], NULL, &t[i]), CAROM_OK);
        if (i) assert_int_equal(carom_tape_checkpoint(t[i], 8), CAROM_OK);
        record(t[i], 0, 53);
        if (i) differentiate(t[i], &half);
        record(t[i], 53, STEPS);
    }
    assert_memory_equal(carom_world_q(w[0]), carom_world_q(w[1]), 3 * N_BODIES * sizeof(double));
    differentiate(t[0], &whole);
    differentiate(t[1], &pieces);
    assert_memory_equal(&pieces, &whole, offsetof(result, replayed));
    for (int i = 0; i < 2; i++) {
        carom_tape_destroy(t[i]);
        carom_world_destroy(w[i]);
    }
}

/* The least bytes in which this run of so many steps has a gradient, by halving. */
static size_t least_memory(int steps)
{
    static result x;
    size_t low = 1000;
    size_t high = 4000000;
    while (high - low > low / 50) {
        const size_t middle = (low + high) / 2;
        double force[3 * N_BODIES];
        carom_world *w = machine();
        carom_tape *t;
        carom_status e = CAROM_OK;
        assert_int_equal(carom_tape_create(w, NULL, &t), CAROM_OK);
        assert_int_equal(carom_tape_memory(t, middle), CAROM_OK);
        for (int k = 0; k < steps && e >= 0; k++) {
            push(k, force);
            e = carom_tape_step(t, force, NULL);
        }
        if (e >= 0) e = try_gradient(t, &x);
        assert_true(e >= 0 || e == CAROM_E_CAPACITY);
        *(e >= 0 ? &high : &low) = middle;
        carom_tape_destroy(t);
        carom_world_destroy(w);
    }
    return high;
}

/* In all the memory that it wants no step is run twice; in less the bits are the same, the bound
 * holds, and no step is run more often than binomial checkpoints need. */
static void bounded(void **state)
{
    (void)state;
    static const double shares[4] = {1.02, 1.5, 4, 64};
    static result whole;
    static result pieces;
    const size_t least = least_memory(STEPS);
    long most = 30 * STEPS;
    carom_world *w = machine();
    carom_tape *t;
    assert_int_equal(carom_tape_create(w, NULL, &t), CAROM_OK);
    record(t, 0, STEPS);
    differentiate(t, &whole);
    assert_int_equal(whole.replayed, 0);
    carom_tape_destroy(t);
    carom_world_destroy(w);
    for (int i = 0; i < 4; i++) {
        const size_t bytes = (size_t)(shares[i] * (double)least);
        w = machine();
        assert_int_equal(carom_tape_create(w, NULL, &t), CAROM_OK);
        assert_int_equal(carom_tape_memory(t, bytes), CAROM_OK);
        record(t, 0, STEPS);
        for (int again = 0; again < 2; again++) {
            differentiate(t, &pieces);
            assert_memory_equal(&pieces, &whole, offsetof(result, replayed));
            assert_in_range(carom_tape_bytes(t), 1, bytes);
            assert_in_range(pieces.replayed, STEPS, most);
        }
        most = pieces.replayed;
        carom_tape_destroy(t);
        carom_world_destroy(w);
    }
    assert_in_range(most, STEPS, STEPS + 32); /* the first block measures what a step takes */
}

/* Forward through a bounded tape, and a run that goes on after a pass. */
static void bounded_forward(void **state)
{
    (void)state;
    double x[4][3 * N_BODIES];
    double one[3 * N_BODIES] = {0};
    carom_gradient d = {0};
    one[3 * 1 + 1] = one[3 * 2 + 2] = 1;
    d.v0 = one;
    for (int i = 0; i < 2; i++) {
        carom_world *w = machine();
        carom_tape *t;
        assert_int_equal(carom_tape_create(w, NULL, &t), CAROM_OK);
        if (i) assert_int_equal(carom_tape_memory(t, 150000), CAROM_OK);
        record(t, 0, 60);
        const carom_state_dot half = {60, x[2 * i], NULL};
        assert_int_equal(carom_tape_tangent(t, 1, &d, 1, &half, NULL), CAROM_OK);
        record(t, 60, STEPS);
        const carom_state_dot end = {STEPS, x[2 * i + 1], NULL};
        assert_int_equal(carom_tape_tangent(t, 1, &d, 1, &end, NULL), CAROM_OK);
        assert_true(i == 0 || carom_tape_bytes(t) <= 150000);
        carom_tape_destroy(t);
        carom_world_destroy(w);
    }
    assert_memory_equal(x[0], x[2], sizeof x[0]);
    assert_memory_equal(x[1], x[3], sizeof x[1]);
}

/* Too little is said, with what it would take; the world is as it was. */
static void too_little(void **state)
{
    (void)state;
    carom_world *w = machine();
    carom_tape *t;
    assert_int_equal(carom_tape_create(w, NULL, &t), CAROM_OK);
    assert_int_equal(carom_tape_memory(t, 3000), CAROM_OK);
    assert_int_equal(carom_tape_step(t, NULL, NULL), CAROM_E_CAPACITY);
    assert_non_null(strstr(carom_world_error(w), "3000 bytes"));
    assert_int_equal(carom_world_steps(w), 0);
    assert_int_equal(carom_tape_steps(t), 0);
    assert_int_equal(carom_tape_memory(NULL, 1), CAROM_E_ARGUMENT);
    carom_tape_destroy(t);
    carom_world_destroy(w);
}

/* After a rewind the tape starts anew, with the same checkpoints. */
static void rewound(void **state)
{
    (void)state;
    static result first;
    static result second;
    carom_world *w = machine();
    carom_tape *t;
    double q[3 * N_BODIES];
    double v[3 * N_BODIES];
    memcpy(q, carom_world_q(w), sizeof q);
    memcpy(v, carom_world_v(w), sizeof v);
    assert_int_equal(carom_tape_create(w, NULL, &t), CAROM_OK);
    assert_int_equal(carom_tape_checkpoint(t, 9), CAROM_OK);
    record(t, 0, STEPS);
    differentiate(t, &first);
    assert_int_equal(carom_tape_checkpoint(t, 5), CAROM_E_STATE);
    assert_int_equal(carom_world_set_state(w, q, v), CAROM_OK);
    carom_tape_rewind(t);
    assert_int_equal(carom_tape_checkpoint(t, 5), CAROM_OK);
    record(t, 0, STEPS);
    differentiate(t, &second);
    assert_memory_equal(&first, &second, offsetof(result, replayed));
    assert_int_equal(carom_tape_checkpoint(t, -1), CAROM_E_ARGUMENT);
    carom_tape_destroy(t);
    carom_world_destroy(w);
}

/* 1e5 steps of an elastic ball.  Kept whole, a step takes more than a kilobyte; with checkpoints
 * what is kept of every step are its two states and its force.  Energy is kept, so the height of
 * the last apex moves with the first height one to one. */
static void hundred_thousand_steps(void **state)
{
    (void)state;
    const int n = 100000;
    carom_world *w = scene_world(9.81, 1.0 / 60);
    carom_tape *t;
    scene_floor(w, 0, 1);
    const int b = scene_disc(w, 1, 0.25, 0, 0.85, 0, 1);
    assert_int_equal(carom_tape_create(w, NULL, &t), CAROM_OK);
    for (int k = 0; k < 200; k++) assert_true(carom_tape_step(t, NULL, NULL) >= 0);
    assert_true(carom_tape_bytes(t) > 200 * 1000);
    carom_tape_rewind(t);
    assert_int_equal(carom_tape_checkpoint(t, 316), CAROM_OK);
    for (int k = 0; k < n; k++) assert_true(carom_tape_step(t, NULL, NULL) >= 0);
    /* e = g y + v^2 / 2 of the last state, as a loss */
    double q_bar[6] = {0};
    double v_bar[6] = {0};
    double q0[6];
    q_bar[3 * b + 2] = 9.81;
    v_bar[3 * b + 2] = carom_world_v(w)[3 * b + 2];
    const carom_state_bar bar = {n, q_bar, v_bar};
    carom_gradient g = {0};
    g.q0 = q0;
    assert_int_equal(carom_tape_gradient(t, 1, &bar, &g, NULL), CAROM_OK);
    assert_near(q0[3 * b + 2], 9.81, 1e-6 * 9.81);
    const size_t states = (size_t)n * 18 * sizeof(double);
    assert_in_range(carom_tape_bytes(t), 0, states + states / 2 + 2000000);
    carom_tape_destroy(t);
    carom_world_destroy(w);
}

/* The same in 6 MB: 40 bytes per step, half as much again while their list grows, and snapshots. */
static void hundred_thousand_steps_bounded(void **state)
{
    (void)state;
    const int n = 100000;
    const size_t bytes = 6000000;
    carom_world *w = scene_world(9.81, 1.0 / 60);
    carom_tape *t;
    scene_floor(w, 0, 1);
    const int b = scene_disc(w, 1, 0.25, 0, 0.85, 0, 1);
    assert_int_equal(carom_tape_create(w, NULL, &t), CAROM_OK);
    assert_int_equal(carom_tape_memory(t, bytes), CAROM_OK);
    for (int k = 0; k < n; k++) {
        if (carom_tape_step(t, NULL, NULL) < 0) fail_msg("step %d: %s", k, carom_world_error(w));
    }
    assert_in_range(carom_tape_bytes(t), 1, bytes);
    double q_bar[6] = {0};
    double v_bar[6] = {0};
    double q0[6];
    q_bar[3 * b + 2] = 9.81;
    v_bar[3 * b + 2] = carom_world_v(w)[3 * b + 2];
    const carom_state_bar bar = {n, q_bar, v_bar};
    carom_gradient g = {0};
    carom_gradient_stats stats;
    g.q0 = q0;
    assert_int_equal(carom_tape_gradient(t, 1, &bar, &g, &stats), CAROM_OK);
    assert_near(q0[3 * b + 2], 9.81, 1e-6 * 9.81);
    assert_in_range(carom_tape_bytes(t), 1, bytes);
    assert_in_range(stats.replayed, n, 3 * n); /* every step twice at most, and to the blocks */
    carom_tape_destroy(t);
    carom_world_destroy(w);
}

static int located(void **state)
{
    (void)state;
    scene_integrator = CAROM_LOCATED;
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(same_bits),
        cmocka_unit_test_setup(same_bits, located),
        cmocka_unit_test_setup(a_gradient_on_the_way, located),
        cmocka_unit_test_setup(rewound, located),
        cmocka_unit_test_setup(bounded, located),
        cmocka_unit_test_setup(bounded_forward, located),
        cmocka_unit_test_setup(too_little, located),
        cmocka_unit_test_setup(hundred_thousand_steps, located),
        cmocka_unit_test_setup(hundred_thousand_steps_bounded, located),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
