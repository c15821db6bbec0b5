/* Limits of joints: where they stop a body, how it bounces there, and their derivatives. */
#include "near.h"
#include "scenes.h"

#include "carom/grad.h"

#include <string.h>

static const carom_integrator INTEGRATORS[] = {CAROM_EULER, CAROM_LOCATED, CAROM_FIXED};

static carom_joint_def of(carom_joint_kind kind, int a, int b)
{
    carom_joint_def d = carom_joint_defaults(kind);
    d.body_a = a;
    d.body_b = b;
    return d;
}

static void join(carom_world *w, const carom_joint_def *d)
{
    if (carom_world_add_joint(w, d, NULL) < 0) fail_msg("%s", carom_world_error(w));
}

/* A point that moves between lower and upper with speed v from 0, losing 1 - e at each end. */
static double to_and_fro(double lower, double upper, double v, double e, double t)
{
    double x = 0;
    for (int k = 0; k < 1000; k++) {
        const double end = v > 0 ? upper : lower;
        const double way = (end - x) / v;
        if (t <= way) return x + v * t;
        t -= way;
        x = end;
        v *= -e;
    }
    return x;
}

/* The measure of a joint that is free between its limits moves like a point. */
static double measure_at(carom_joint_kind kind, double e, int n, double h)
{
    carom_world *w = scene_world(0, h);
    const int world = scene_anchor(w);
    const int b = scene_disc(w, 2, 0.3, 1, 0, 0, 0);
    carom_joint_def d = of(kind, world, b);
    d.anchor.x = kind == CAROM_ROPE ? -1 : 1;
    d.anchor_b.x = 1;
    d.axis.x = 2;
    d.lower = -0.4 + (kind == CAROM_ROPE ? 2 : 0);
    d.upper = 0.7 + (kind == CAROM_ROPE ? 2 : 0);
    d.restitution = e;
    join(w, &d);
    scene_push(w, b, kind == CAROM_REVOLUTE ? 1.3 : 0, kind == CAROM_REVOLUTE ? 0 : 1.3, 0);
    carom_step_stats stats;
    for (int k = 0; k < n; k++) {
        scene_run(w, 1, &stats);
        assert_true(stats.joint_drift <= 1e-12); /* no limit is ever passed */
        assert_int_equal(carom_world_n_contacts(w), 0);
    }
    const double *q = carom_world_q(w) + 3 * b;
    const double x = kind == CAROM_REVOLUTE ? q[0] : q[1] - 1;
    carom_world_destroy(w);
    return x;
}

static void bounces_between_limits(void **state)
{
    (void)state;
    static const carom_joint_kind kinds[] = {CAROM_REVOLUTE, CAROM_PRISMATIC, CAROM_WHEEL,
                                             CAROM_ROPE};
    static const double es[] = {1, 0.6};
    for (int i = 0; i < 2; i++) { /* Euler and located both locate impacts */
        scene_integrator = INTEGRATORS[i];
        for (int k = 0; k < 8; k++) {
            const double e = es[k % 2];
            /* rounding of the times of six impacts */
            assert_near_case(carom_joint_kind_name(kinds[k / 2]), i,
                             measure_at(kinds[k / 2], e, 240, 1.0 / 60),
                             to_and_fro(-0.4, 0.7, 1.3, e, 4), 1e-11);
        }
    }
}

/* A plank pinned at one end falls onto its limit and lies there, with every map. */
static void lies_on_its_limit(void **state)
{
    (void)state;
    for (int i = 0; i < 3; i++) {
        scene_integrator = INTEGRATORS[i];
        carom_world *w = scene_world(9.81, 1.0 / 60);
        const int world = scene_anchor(w);
        const carom_pose start = {0, 0.5, 0};
        const int b = scene_box(w, 2, 0.5, 0.05, start, 0, 0);
        carom_joint_def d = of(CAROM_REVOLUTE, world, b);
        d.lower = -0.8;
        d.upper = 1;
        join(w, &d);
        carom_step_stats stats;
        for (int k = 0; k < 240; k++) {
            scene_run(w, 1, &stats);
            assert_true(stats.joint_drift <= 1e-9);
        }
        assert_near(carom_world_q(w)[3 * b], -0.8, 1e-9);
        assert_near(carom_world_v(w)[3 * b], 0, 1e-9);
        carom_world_destroy(w);
    }
}

/* A ball falls sqrt(L^2 - x^2) until the rope is tight; of its speed v the part across the rope is
 * left, v x / L, and the rope stays tight. */
static void rope_becomes_tight(void **state)
{
    (void)state;
    const double L = 1.25;
    const double x = 0.75;
    const double g = 9.81;
    scene_integrator = CAROM_LOCATED;
    carom_world *w = scene_world(g, 1.0 / 240);
    const int world = scene_anchor(w);
    const int b = scene_disc(w, 2, 0.1, x, 0, 0, 0);
    carom_joint_def d = of(CAROM_ROPE, world, b);
    d.anchor_b.x = x;
    d.upper = L;
    join(w, &d);
    const double energy = carom_world_energy(w);
    const double fall = sqrt(L * L - x * x);
    const double lost = 2 * g * fall * (1 - (x / L) * (x / L));
    for (int k = 0; k < 150; k++) {
        carom_step_stats stats;
        scene_run(w, 1, &stats);
        const double t = (k + 1) / 240.0;
        const double *q = carom_world_q(w) + 3 * b;
        assert_true(hypot(q[1], q[2]) <= L + 1e-12);
        if (0.5 * g * t * t < fall) {
            assert_near(q[2], -0.5 * g * t * t, 1e-12);
        } else {
            /* the swing is second order in dt: its energy varies by a few 1e-5 */
            assert_near(energy - carom_world_energy(w), lost, 5e-4);
            assert_near(hypot(q[1], q[2]), L, 1e-11);
        }
    }
    carom_world_destroy(w);
}

/* x(T) = U - e (v T - U): d/dv = -e T, d/dU = 1 + e, d/dx0 = -e; the time of impact counts. */
static void bounce_gradient(void **state)
{
    (void)state;
    const double e = 0.6;
    for (int i = 0; i < 2; i++) {
        scene_integrator = INTEGRATORS[i];
        carom_world *w = scene_world(0, 1.0 / 60);
        const int world = scene_anchor(w);
        const int b = scene_disc(w, 2, 0.3, 0, 0, 0, 0);
        carom_joint_def d = of(CAROM_PRISMATIC, world, b);
        d.upper = 0.7312;
        d.restitution = e;
        join(w, &d);
        scene_push(w, b, 0, 1.3, 0);
        carom_tape *tape;
        assert_int_equal(carom_tape_create(w, NULL, &tape), CAROM_OK);
        for (int k = 0; k < 60; k++) assert_true(carom_tape_step(tape, NULL, NULL) >= 0);
        const double q_bar[6] = {0, 0, 0, 0, 1, 0};
        const carom_state_bar bar = {60, q_bar, NULL};
        double q0[6];
        double v0[6];
        double lower;
        double upper;
        carom_gradient g = {0};
        g.q0 = q0;
        g.v0 = v0;
        g.lower = &lower;
        g.upper = &upper;
        assert_int_equal(carom_tape_gradient(tape, 1, &bar, &g, NULL), CAROM_OK);
        assert_near(upper, 1 + e, 1e-11);
        assert_near(lower, 0, 0);
        assert_near(v0[4], -e * 1, 1e-11);
        assert_near(q0[4], -e, 1e-11);
        carom_tape_destroy(tape);
        carom_world_destroy(w);
    }
}

/* Ten ropes and rails that hit their limits all the time, fast: never past one, never NaN. */
static void crowd(void **state)
{
    (void)state;
    for (int i = 0; i < 3; i++) {
        scene_integrator = INTEGRATORS[i];
        carom_world *w = scene_world(9.81, 1.0 / 60);
        int before = scene_anchor(w);
        for (int k = 0; k < 10; k++) {
            const int b = scene_disc(w, 1 + k % 3, 0.1, 0.3 * (k + 1), 0.1 * k, 0.3, 0.2);
            carom_joint_def d = of(k % 2 ? CAROM_ROPE : CAROM_WHEEL, before, b);
            d.anchor.x = 0.3 * k;
            d.anchor.y = k ? 0.1 * (k - 1) : 0;
            d.anchor_b.x = 0.3 * (k + 1);
            d.anchor_b.y = 0.1 * k;
            if (k % 2 == 0) d.anchor = d.anchor_b;
            d.lower = k % 2 ? 0.2 : -0.05;
            d.upper = k % 2 ? 0.4 : 0.1;
            /* Euler: Newton's law for contacts that close beside others that open gives energy */
            d.restitution = i == 0 ? 0 : 0.5;
            join(w, &d);
            scene_push(w, b, k - 4, 3 * (k % 4 - 2), k % 5);
            before = b;
        }
        for (int k = 0; k < 300; k++) {
            carom_step_stats stats;
            const carom_status e = carom_world_step(w, NULL, &stats);
            if (e < 0) fail_msg("integrator %d, step %d: %s", i, k, carom_world_error(w));
            /* a step whose corrections did not end says so */
            assert_at_most("past a limit", stats.joint_drift,
                           (e < CAROM_LIMIT ? 1e-9 : 1e-3) * 0.2);
        }
        carom_world_destroy(w);
    }
}

static void refusals(void **state)
{
    (void)state;
    scene_integrator = CAROM_EULER;
    carom_world *w = scene_world(0, 0.1);
    const int world = scene_anchor(w);
    const int b = scene_disc(w, 1, 0.1, 0, 0, 0, 0);
    static const char *const words[6] = {"has no limits",      "needs a limit", "not below",
                                         "outside its limits", "restitution",   "not below"};
    carom_joint_def bad[6];
    for (int k = 0; k < 6; k++) bad[k] = of(CAROM_REVOLUTE, world, b);
    bad[0].kind = CAROM_WELD;
    bad[0].upper = 1;
    bad[1].kind = CAROM_ROPE;
    bad[2].lower = bad[2].upper = 0;
    bad[3].lower = 0.1;
    bad[4].restitution = 1.5;
    bad[5].upper = NAN;
    for (int k = 0; k < 6; k++) {
        assert_int_equal(carom_world_add_joint(w, &bad[k], NULL), CAROM_E_ARGUMENT);
        if (!strstr(carom_world_error(w), words[k])) {
            fail_msg("case %d: \"%s\" lacks \"%s\"", k, carom_world_error(w), words[k]);
        }
    }
    carom_world_destroy(w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bounces_between_limits),
        cmocka_unit_test(lies_on_its_limit),
        cmocka_unit_test(rope_becomes_tight),
        cmocka_unit_test(bounce_gradient),
        cmocka_unit_test(crowd),
        cmocka_unit_test(refusals),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
