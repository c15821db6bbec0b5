/* Joints that break: when, what follows, snapshots and gradients across it. */
#include "carom/events.h"
#include "carom/grad.h"
#include "carom/snapshot.h"
#include "near.h"
#include "scenes.h"

#include <stdlib.h>
#include <string.h>

static const double G = 9.81;

/* A bob of mass 2 on a weightless string of 1 m, pushed with vx at the bottom. */
static carom_world *bob(double vx, double force, double torque)
{
    carom_world *w = scene_world(G, 1.0 / 240);
    const int top = scene_anchor(w);
    const int b = scene_disc(w, 2, 0.1, 0, -1, 0.3, 0);
    carom_joint_def d = carom_joint_defaults(CAROM_DISTANCE);
    d.body_a = top;
    d.body_b = b;
    d.anchor_b.y = -1;
    d.break_force = force;
    d.break_torque = torque;
    if (carom_world_add_joint(w, &d, NULL) < 0) fail_msg("%s", carom_world_error(w));
    scene_push(w, b, 0, vx, 0);
    return w;
}

/* At the bottom the string pulls with m (g + v^2 / r): at v^2 = 3 this is 25.62 N and falls from
 * there on, at rest 19.62 N. */
static void breaks_at_its_limit(void **state)
{
    (void)state;
    scene_integrator = CAROM_LOCATED;
    const double pull = 2 * (G + 3);
    carom_world *w = bob(sqrt(3), 1.001 * pull, INFINITY);
    scene_run(w, 480, NULL);
    assert_int_equal(carom_world_joint_broken(w, 0), 0);
    assert_near(hypot(carom_world_q(w)[4], carom_world_q(w)[5]), 1, 1e-12);
    carom_world_destroy(w);
    w = bob(sqrt(3), 0.999 * pull, INFINITY);
    scene_run(w, 1, NULL);
    assert_int_equal(carom_world_joint_broken(w, 0), 1);
    assert_near(carom_world_joint_force(w, 0).force.y, 0, 0);
    /* From here on it is thrown. */
    const double *q = carom_world_q(w);
    const double *v = carom_world_v(w);
    const double x[2] = {q[4], q[5]};
    const double u[2] = {v[4], v[5]};
    carom_step_stats stats;
    scene_run(w, 240, &stats);
    assert_near(carom_world_q(w)[4], x[0] + u[0], 1e-12);
    assert_near(carom_world_q(w)[5], x[1] + u[1] - 0.5 * G, 1e-12);
    assert_near(stats.joint_drift, 0, 0);
    carom_world_destroy(w);
}

/* A weld bears the torque m g r of a body at its side. */
static void breaks_by_torque(void **state)
{
    (void)state;
    static const double share[2] = {1.01, 0.99};
    for (int k = 0; k < 2; k++) {
        carom_world *w = scene_world(G, 1.0 / 60);
        carom_joint_def d = carom_joint_defaults(CAROM_WELD);
        d.body_a = scene_anchor(w);
        d.body_b = scene_disc(w, 2, 0.1, 0.5, 0, 0.3, 0);
        d.break_torque = share[k] * 2 * G * 0.5;
        assert_int_equal(carom_world_add_joint(w, &d, NULL), CAROM_OK);
        scene_run(w, 30, NULL);
        assert_int_equal(carom_world_joint_broken(w, 0), k);
        carom_world_destroy(w);
    }
}

static void tells_of_it(void **state)
{
    (void)state;
    carom_world *w = bob(0, 19, INFINITY);
    int n;
    assert_int_equal(carom_world_record_events(w, 1), CAROM_OK);
    scene_run(w, 1, NULL);
    const carom_contact_event *e = carom_world_events(w, &n);
    assert_int_equal(n, 1);
    assert_int_equal(e->kind, CAROM_JOINT_BREAK);
    assert_int_equal(e->joint, 0);
    assert_int_equal(e->body_a, 0);
    assert_int_equal(e->body_b, 1);
    scene_run(w, 1, NULL);
    carom_world_events(w, &n);
    assert_int_equal(n, 0);
    carom_world_destroy(w);
}

/* Limits, springs and motors go with the joint. */
static void drives_go_with_it(void **state)
{
    (void)state;
    carom_world *w = scene_world(0, 1.0 / 60);
    carom_joint_def d = carom_joint_defaults(CAROM_REVOLUTE);
    d.body_a = scene_anchor(w);
    d.body_b = scene_disc(w, 1, 0.5, 0.5, 0, 0, 0);
    d.lower = -0.1;
    d.upper = 0.1;
    d.stiffness = 3;
    d.motor_speed = 2;
    d.motor_limit = 5;
    d.break_force = 1e-3;
    assert_int_equal(carom_world_add_joint(w, &d, NULL), CAROM_OK);
    scene_run(w, 2, NULL);
    assert_int_equal(carom_world_joint_broken(w, 0), 1);
    double v[3];
    memcpy(v, carom_world_v(w) + 3, sizeof v);
    scene_run(w, 120, NULL);
    assert_near_array("free", 3, carom_world_v(w) + 3, v, 1e-14);
    assert_true(fabs(carom_world_q(w)[3]) > 0.1);
    carom_world_destroy(w);
}

/* A snapshot of before and one of after; a copy: all go on bit for bit. */
static void snapshots_carry_it(void **state)
{
    (void)state;
    carom_world *w = bob(1, 21, INFINITY); /* 2 (g + 1) = 21.6 */
    size_t size;
    assert_int_equal(carom_world_seal(w), CAROM_OK);
    assert_int_equal(carom_world_snapshot(w, 0, NULL, &size), CAROM_OK);
    void *before = malloc(size);
    void *after = malloc(size);
    assert_int_equal(carom_world_snapshot(w, size, before, &size), CAROM_OK);
    scene_run(w, 1, NULL);
    assert_int_equal(carom_world_joint_broken(w, 0), 1);
    assert_int_equal(carom_world_snapshot(w, size, after, &size), CAROM_OK);
    carom_world *copy;
    assert_int_equal(carom_world_copy(w, NULL, &copy), CAROM_OK);
    assert_int_equal(carom_world_joint_broken(copy, 0), 1);
    scene_run(w, 50, NULL);
    scene_run(copy, 50, NULL);
    assert_memory_equal(carom_world_q(w), carom_world_q(copy), 6 * sizeof(double));
    assert_int_equal(carom_world_restore(copy, size, before), CAROM_OK);
    assert_int_equal(carom_world_joint_broken(copy, 0), 0);
    scene_run(copy, 51, NULL);
    assert_memory_equal(carom_world_q(w), carom_world_q(copy), 6 * sizeof(double));
    assert_int_equal(carom_world_restore(copy, size, after), CAROM_OK);
    scene_run(copy, 50, NULL);
    assert_memory_equal(carom_world_q(w), carom_world_q(copy), 6 * sizeof(double));
    free(before);
    free(after);
    carom_world_destroy(w);
    carom_world_destroy(copy);
}

/* x of the bob after n steps, of which it is held for the first half or so: no push moves the step
 * of the break. */
static double thrown(double vx, int n, int every, double *by_vx)
{
    carom_world *w = bob(vx, 2 * (G + 0.955), INFINITY);
    carom_tape *tape;
    assert_int_equal(carom_tape_create(w, NULL, &tape), CAROM_OK);
    assert_int_equal(carom_tape_checkpoint(tape, every), CAROM_OK);
    const double push[6] = {0, 0, 0, 0, 2, 0};
    int broken = 0;
    for (int k = 0; k < n; k++) {
        assert_true(carom_tape_step(tape, push, NULL) >= 0);
        broken += carom_world_joint_broken(w, 0);
    }
    assert_true(broken > n / 4 && broken < 3 * n / 4);
    const double x = carom_world_q(w)[4];
    const double q_bar[6] = {0, 0, 0, 0, 1, 0};
    const carom_state_bar bar = {n, q_bar, NULL};
    double v0[6];
    carom_gradient g = {0};
    g.v0 = v0;
    if (by_vx) {
        assert_int_equal(carom_tape_gradient(tape, 1, &bar, &g, NULL), CAROM_OK);
        *by_vx = v0[4];
    }
    carom_tape_destroy(tape);
    carom_world_destroy(w);
    return x;
}

/* The time of the break is a constant; the gradient is that of the run as it was, whether its
 * records are kept or made again from snapshots. */
static void gradient_goes_through(void **state)
{
    (void)state;
    const double vx = 0.9;
    const double step = 1e-6; /* the break does not move for it */
    double kept;
    double again;
    thrown(vx, 60, 0, &kept);
    thrown(vx, 60, 7, &again);
    const double difference =
        (thrown(vx + step, 60, 0, NULL) - thrown(vx - step, 60, 0, NULL)) / (2 * step);
    assert_near(kept, difference, 1e-8); /* rounding over the step, its square */
    assert_near(again, kept, 0);
}

static void refused(void **state)
{
    (void)state;
    static const double bad[3] = {0, -1, NAN};
    carom_world *w = scene_world(G, 1.0 / 60);
    carom_joint_def d = carom_joint_defaults(CAROM_REVOLUTE);
    d.body_a = scene_anchor(w);
    d.body_b = scene_disc(w, 1, 1, 0, 0, 0, 0);
    for (int k = 0; k < 6; k++) {
        d.break_force = k % 2 ? bad[k / 2] : 1;
        d.break_torque = k % 2 ? 1 : bad[k / 2];
        assert_int_equal(carom_world_add_joint(w, &d, NULL), CAROM_E_ARGUMENT);
        assert_non_null(strstr(carom_world_error(w), "joint 0: breaks at"));
    }
    assert_int_equal(carom_world_joint_broken(w, 0), 0);
    assert_int_equal(carom_world_joint_broken(w, -1), 0);
    carom_world_destroy(w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(breaks_at_its_limit),
        cmocka_unit_test(breaks_by_torque),
        cmocka_unit_test(tells_of_it),
        cmocka_unit_test(drives_go_with_it),
        cmocka_unit_test(snapshots_carry_it),
        cmocka_unit_test(gradient_goes_through),
        cmocka_unit_test(refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
