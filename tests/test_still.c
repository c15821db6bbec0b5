/* Islands that a step leaves as they are, to the last bit, are not run again: the bits are those of
 * a world that runs every step, as one does that is restored before each. */
#include "near.h"
#include "scenes.h"

#include "carom/events.h"
#include "carom/grad.h"
#include "carom/snapshot.h"

#include <stdlib.h>
#include <string.h>

enum {
    BASE = 6,
    SETTLE = 20,
    N_BOXES = BASE * (BASE + 1) / 2,
    N_BODIES = N_BOXES + 3,
    TOP = N_BOXES
};
enum { BOB = N_BODIES - 2, BALL = N_BODIES - 1, N_HELD = N_BOXES + 1 };

/* A pyramid, a pendulum that hangs, a ball that bounces for good. */
static carom_world *rests(void)
{
    carom_world *w = scene_world(9.81, 1.0 / 60);
    const int floor = scene_floor(w, 0.5, 0);
    for (int row = 0; row < BASE; row++) {
        for (int k = 0; k < BASE - row; k++) {
            const carom_pose pose = {0, k - 0.5 * (BASE - row - 1), row + 0.5};
            scene_box(w, 1, 0.45, 0.5, pose, 0.5, 0);
        }
    }
    const int bob = scene_disc(w, 1, 0.25, -8, 2, 0.5, 0);
    assert_int_equal(carom_world_add_revolute(w, floor, bob, (carom_vec2){-8, 4}, NULL), CAROM_OK);
    scene_disc(w, 1, 0.25, 9, 3, 0.5, 1);
    assert_int_equal(carom_world_record_events(w, 1), CAROM_OK);
    return w;
}

static void assert_same_contacts(const carom_world *a, const carom_world *b)
{
    const int n = carom_world_n_contacts(a);
    assert_int_equal(n, carom_world_n_contacts(b));
    for (int k = 0; k < n; k++) {
        const carom_contact_info x = carom_world_contact(a, k);
        const carom_contact_info y = carom_world_contact(b, k);
        assert_int_equal(x.mode, y.mode);
        assert_true(x.ln == y.ln && x.lt == y.lt && x.gap == y.gap);
        assert_true(x.point.x == y.point.x && x.point.y == y.point.y);
    }
}

static void assert_same(const carom_world *a, const carom_world *b, const carom_step_stats *s,
                        const carom_step_stats *t)
{
    const size_t bytes = 3 * (size_t)carom_world_n_bodies(a) * sizeof(double);
    assert_memory_equal(carom_world_q(a), carom_world_q(b), bytes);
    assert_memory_equal(carom_world_v(a), carom_world_v(b), bytes);
    assert_same_contacts(a, b);
    const carom_joint_force f = carom_world_joint_force(a, 0);
    const carom_joint_force g = carom_world_joint_force(b, 0);
    assert_true(f.force.x == g.force.x && f.force.y == g.force.y);
    assert_int_equal(s->n_contacts, t->n_contacts);
    assert_int_equal(s->n_substeps, t->n_substeps);
    assert_int_equal(s->degenerate, t->degenerate);
    assert_true(s->residual == t->residual && s->energy == t->energy);
    assert_true(s->penetration == t->penetration && s->joint_drift == t->joint_drift);
    int n;
    int m;
    carom_world_events(a, &n);
    carom_world_events(b, &m);
    assert_int_equal(n, m);
}

/* A step of a world that has forgotten what was still. */
static void run_step(carom_world *w, const double *force, carom_step_stats *s)
{
    size_t size = 0;
    assert_int_equal(carom_world_snapshot(w, 0, NULL, &size), CAROM_OK);
    unsigned char *bytes = malloc(size);
    assert_non_null(bytes);
    assert_int_equal(carom_world_snapshot(w, size, bytes, &size), CAROM_OK);
    assert_int_equal(carom_world_restore(w, size, bytes), CAROM_OK);
    free(bytes);
    assert_true(carom_world_step(w, force, s) >= 0);
    assert_int_equal(s->n_still, 0);
}

/* Everything but the ball is left out once it has settled, and again after a push on the top; also
 * on a tape, with or without records. */
static void bits_are_those_of_every_step(void **state)
{
    (void)state;
    carom_world *w[3] = {rests(), rests(), rests()};
    carom_world *run = rests();
    carom_tape *tape[2];
    double force[3 * N_BODIES] = {0};
    int n_still = 0;
    for (int i = 0; i < 2; i++) {
        assert_int_equal(carom_tape_create(w[i + 1], NULL, &tape[i]), CAROM_OK);
    }
    assert_int_equal(carom_tape_memory(tape[1], (size_t)1 << 22), CAROM_OK);
    for (int k = 0; k < 6 * SETTLE; k++) {
        carom_step_stats s[3];
        carom_step_stats t;
        force[3 * TOP + 2] = k == 3 * SETTLE ? -5 : 0;
        run_step(run, force, &t);
        assert_true(carom_world_step(w[0], force, &s[0]) >= 0);
        for (int i = 0; i < 2; i++) {
            assert_true(carom_tape_step(tape[i], force, &s[i + 1]) >= 0);
        }
        for (int i = 0; i < 3; i++) {
            assert_same(w[i], run, &s[i], &t);
            assert_int_equal(s[i].n_still, s[0].n_still);
        }
        if (k == 3 * SETTLE) assert_int_equal(s[0].n_still, 1); /* the bob */
        n_still += s[0].n_still == N_HELD;
    }
    assert_true(n_still > 3 * SETTLE);
    for (int i = 0; i < 2; i++) carom_tape_destroy(tape[i]);
    for (int i = 0; i < 3; i++) carom_world_destroy(w[i]);
    carom_world_destroy(run);
}

/* By the fastest of balls: what is still joins its island before it can touch. */
static void a_hit_is_felt(void **state)
{
    (void)state;
    carom_world *w = rests();
    carom_world *run = rests();
    carom_step_stats s;
    carom_step_stats t;
    for (int k = 0; k < 3 * SETTLE; k++) {
        if (k == 2 * SETTLE) {
            assert_true(s.n_still > 0);
            scene_push(w, BALL, 0, -80, 0);
            scene_push(run, BALL, 0, -80, 0);
        }
        assert_true(carom_world_step(w, NULL, &s) >= 0);
        run_step(run, NULL, &t);
        assert_same(w, run, &s, &t);
    }
    double moved = 0;
    for (int b = 1; b <= TOP; b++) moved = fmax(moved, fabs(carom_world_v(w)[3 * b + 1]));
    assert_true(moved > 0.1);
    carom_world_destroy(w);
    carom_world_destroy(run);
}

typedef struct gradients {
    double q0[3 * N_BODIES], v0[3 * N_BODIES], mass[N_BODIES], friction[N_BODIES];
    double force_steps[3 * N_BODIES * 2 * SETTLE];
} gradients;

static void find_gradients(carom_tape *t, gradients *x)
{
    double q_bar[3 * N_BODIES];
    double v_bar[3 * N_BODIES];
    for (int k = 0; k < 3 * N_BODIES; k++) {
        q_bar[k] = 1 + 0.1 * k;
        v_bar[k] = 0.3;
    }
    const carom_state_bar bar = {2 * SETTLE, q_bar, v_bar};
    const carom_gradient g = {.q0 = x->q0,
                              .v0 = x->v0,
                              .mass = x->mass,
                              .friction = x->friction,
                              .force_steps = x->force_steps};
    for (int k = 0; k < 2 * SETTLE; k++) assert_true(carom_tape_step(t, NULL, NULL) >= 0);
    assert_true(carom_tape_gradient(t, 1, &bar, &g, NULL) >= 0);
}

/* Records that are repeated give the gradient of those that are made anew: with a checkpoint before
 * every step no step knows the one before it. */
static void gradients_are_those_of_every_step(void **state)
{
    (void)state;
    gradients *x = calloc(2, sizeof *x);
    assert_non_null(x);
    for (int i = 0; i < 2; i++) {
        carom_world *w = rests();
        carom_tape *t;
        carom_step_stats s;
        assert_int_equal(carom_tape_create(w, NULL, &t), CAROM_OK);
        if (i) assert_int_equal(carom_tape_checkpoint(t, 1), CAROM_OK);
        find_gradients(t, &x[i]);
        assert_true(carom_tape_step(t, NULL, &s) >= 0);
        assert_int_equal(s.n_still, i ? 0 : N_HELD);
        carom_tape_destroy(t);
        carom_world_destroy(w);
    }
    assert_memory_equal(&x[0], &x[1], sizeof x[0]);
    assert_true(x[0].q0[3 * TOP + 1] != 0);
    free(x);
}

/* Slow is not still: without friction a box under gravity slides on at 1e-15 m/s, and at 1e-150. */
static void the_slow_moves_on(void **state)
{
    (void)state;
    const double speed[] = {1e-15, 1e-150};
    for (int i = 0; i < 2; i++) {
        carom_world *w = scene_world(9.81, 1.0 / 60);
        carom_step_stats s;
        scene_floor(w, 0, 0);
        const int box = scene_box(w, 1, 0.5, 0.5, (carom_pose){0, 0, 0.5}, 0, 0);
        scene_push(w, box, 0, speed[i], 0);
        for (int k = 1; k <= SETTLE; k++) {
            scene_run(w, 1, &s);
            assert_int_equal(s.n_still, 0);
            assert_near(carom_world_q(w)[3 * box + 1], k * speed[i] / 60, 1e-12 * speed[i]);
        }
        carom_world_destroy(w);
    }
}

/* At the top of its throw a ball is at rest for a moment only. */
static void a_moment_is_no_rest(void **state)
{
    (void)state;
    carom_world *w = scene_world(8, 1.0 / 64);
    scene_floor(w, 0, 0);
    const int ball = scene_disc(w, 1, 0.25, 0, 0.25, 0, 0);
    carom_step_stats s;
    scene_push(w, ball, 0, 0, 4);
    for (int k = 1; k <= 60; k++) {
        const double t = k / 64.0;
        scene_run(w, 1, &s);
        assert_int_equal(s.n_still, 0);
        assert_near(carom_world_q(w)[3 * ball + 2], 0.25 + 4 * t - 4 * t * t, 1e-12);
    }
    carom_world_destroy(w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(bits_are_those_of_every_step, scene_euler),
        cmocka_unit_test_setup(bits_are_those_of_every_step, scene_located),
        cmocka_unit_test_setup(bits_are_those_of_every_step, scene_fixed),
        cmocka_unit_test_setup(a_hit_is_felt, scene_euler),
        cmocka_unit_test_setup(a_hit_is_felt, scene_located),
        cmocka_unit_test_setup(a_hit_is_felt, scene_fixed),
        cmocka_unit_test_setup(gradients_are_those_of_every_step, scene_euler),
        cmocka_unit_test_setup(gradients_are_those_of_every_step, scene_located),
        cmocka_unit_test_setup(the_slow_moves_on, scene_located),
        cmocka_unit_test_setup(a_moment_is_no_rest, scene_located),
        cmocka_unit_test_setup(bits_are_those_of_every_step, scene_order_4),
        cmocka_unit_test_setup(gradients_are_those_of_every_step, scene_order_4),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
