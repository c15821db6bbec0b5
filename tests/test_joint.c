/* Joints: what they measure, against differences; how they move, against closed forms. */
#include "fdiff.h"
#include "near.h"
#include "rng.h"
#include "scenes.h"

#include "carom/grad.h"
#include "libsolver/grad/internal.h"

#include <stdlib.h>

static const carom_integrator INTEGRATORS[] = {CAROM_EULER, CAROM_LOCATED, CAROM_FIXED};

static const carom_joint_kind KINDS[] = {CAROM_REVOLUTE, CAROM_PRISMATIC, CAROM_WELD,
                                         CAROM_WHEEL,    CAROM_DISTANCE,  CAROM_LOCK_X,
                                         CAROM_LOCK_Y,   CAROM_LOCK_ANGLE};
enum { N_KINDS = sizeof KINDS / sizeof KINDS[0] };

static carom_pose at(double x, double y, double angle)
{
    const carom_pose p = {angle, x, y};
    return p;
}

static carom_joint_def between(carom_joint_kind kind, int a, int b, double x, double y)
{
    carom_joint_def d = carom_joint_defaults(kind);
    d.body_a = a;
    d.body_b = b;
    d.anchor.x = x;
    d.anchor.y = y;
    return d;
}

static int join(carom_world *w, const carom_joint_def *d)
{
    int index = -1;
    if (carom_world_add_joint(w, d, &index) < 0) fail_msg("%s", carom_world_error(w));
    return index;
}

static const double *q_of(const carom_world *w, int body)
{
    return carom_world_q(w) + 3 * body;
}

static const double *v_of(const carom_world *w, int body)
{
    return carom_world_v(w) + 3 * body;
}

/* --- measures against differences --------------------------------------------------------------
 */

/* A measure, its row, and every number that they depend on. */
typedef struct probe {
    crm_joint j;
    crm_measure m;
    double q[6];
    double row_bar[6];
    double value_bar;
} probe;

static double value_of(void *user)
{
    const probe *p = user;
    double row[6];
    return crm_measure_at(&p->j, p->m, p->q, row);
}

/* What crm_measure_vjp is the gradient of. */
static double paired(void *user)
{
    const probe *p = user;
    double row[6];
    double sum = p->value_bar * crm_measure_at(&p->j, p->m, p->q, row);
    for (int k = 0; k < 6; k++) sum += p->row_bar[k] * row[k];
    return sum;
}

static probe random_probe(rng *r, crm_measure m)
{
    probe p = {0};
    p.m = m;
    p.j.body_b = 1;
    double *const numbers[] = {&p.j.local_a.x, &p.j.local_a.y, &p.j.local_b.x, &p.j.local_b.y,
                               &p.j.axis,      &p.j.angle,     &p.j.length,    &p.value_bar};
    for (int k = 0; k < 8; k++) *numbers[k] = rng_uniform(r, -2, 2);
    p.j.lever = 0.7;
    for (int k = 0; k < 6; k++) p.q[k] = rng_uniform(r, -2, 2);
    for (int k = 0; k < 6; k++) p.row_bar[k] = rng_uniform(r, -2, 2);
    return p;
}

/* Differences of fourth order with steps of 1e-3 on numbers of size one: 1e-10 and rounding.  Two
 * points that meet within 0.3 have larger derivatives: left out. */
static void rows_against_differences(void **state)
{
    (void)state;
    rng r = rng_from(7);
    for (int trial = 0; trial < 300; trial++) {
        probe p = random_probe(&r, (crm_measure)(trial % (CRM_TURN + 1)));
        const crm_joint_frame f = crm_joint_frame_at(&p.j, p.q);
        if (hypot(f.d.x, f.d.y) < 0.3) continue;
        double row[6];
        crm_measure_at(&p.j, p.m, p.q, row);
        for (int k = 0; k < 6; k++) {
            assert_near_case("row", k, row[k], fdiff_entry(value_of, &p, &p.q[k], 1e-3, NULL),
                             1e-9);
        }
    }
}

static void measures_backward(void **state)
{
    (void)state;
    rng r = rng_from(8);
    for (int trial = 0; trial < 300; trial++) {
        probe p = random_probe(&r, (crm_measure)(trial % (CRM_TURN + 1)));
        const crm_joint_frame f = crm_joint_frame_at(&p.j, p.q);
        if (hypot(f.d.x, f.d.y) < 0.3) continue;
        double q_bar[6] = {0};
        crm_joint_bar bar = {{{0, 0}, {0, 0}}, 0, 0, 0};
        crm_measure_vjp(&p.j, p.m, p.q, p.row_bar, p.value_bar, q_bar, &bar);
        double *const moved[] = {&p.j.local_a.x, &p.j.local_a.y, &p.j.local_b.x, &p.j.local_b.y,
                                 &p.j.axis,      &p.j.angle,     &p.j.length};
        const double *const got[] = {&bar.anchor[0].x, &bar.anchor[0].y, &bar.anchor[1].x,
                                     &bar.anchor[1].y, &bar.axis,        &bar.angle,
                                     &bar.length};
        for (int k = 0; k < 6; k++) {
            assert_near_case("q", k, q_bar[k], fdiff_entry(paired, &p, &p.q[k], 1e-3, NULL), 1e-8);
        }
        for (int k = 0; k < 7; k++) {
            assert_near_case("parameter", k, *got[k], fdiff_entry(paired, &p, moved[k], 1e-3, NULL),
                             1e-8);
        }
    }
}

/* --- motion ------------------------------------------------------------------------------------
 */

/* A box on a rail of slope theta has acceleration g sin(theta); its turn is held.  Both maps are
 * exact for a constant acceleration: s = a t^2/2, and a h^2 n (n+1)/2 with Euler's. */
static void slides_down_a_rail(void **state)
{
    (void)state;
    const double theta = 0.6;
    const double h = 1.0 / 60;
    const int n = 90;
    for (int i = 0; i < 3; i++) {
        scene_integrator = INTEGRATORS[i];
        carom_world *w = scene_world(9.81, h);
        const int rail = scene_anchor(w);
        const int b = scene_box(w, 2, 0.3, 0.2, at(0.4, 0.1, 0.25), 0.5, 0);
        carom_joint_def d = between(CAROM_PRISMATIC, rail, b, 0.7, 0.9);
        d.axis.x = -3 * cos(theta);
        d.axis.y = -3 * sin(theta);
        join(w, &d);
        carom_step_stats stats;
        scene_run(w, n, &stats);
        const double a = 9.81 * sin(theta);
        const double s = i == 0 ? a * h * h * n * (n + 1) / 2 : 0.5 * a * (n * h) * (n * h);
        /* rounding of 90 steps, on a way of 6 m */
        assert_near(q_of(w, b)[0], 0.25, 1e-12);
        assert_near(q_of(w, b)[1], 0.4 - s * cos(theta), 1e-11);
        assert_near(q_of(w, b)[2], 0.1 - s * sin(theta), 1e-11);
        assert_true(stats.joint_drift <= 1e-12);
        carom_world_destroy(w);
    }
}

/* Welded bodies answer a force as one body of their mass and their inertia about the common
 * center. */
static void weld_is_one_body(void **state)
{
    (void)state;
    const double h = 1.0 / 60;
    scene_integrator = CAROM_EULER;
    carom_world *w = scene_world(0, h);
    const int a = scene_box(w, 2, 0.5, 0.1, at(0, 0, 0.3), 0, 0);
    const int b = scene_disc(w, 3, 0.2, 1.2, 0.5, 0, 0);
    const carom_joint_def d = between(CAROM_WELD, a, b, 0.4, -0.3);
    join(w, &d);
    const double f[6] = {0.7, 3, -2, 0, 0, 0};
    assert_int_equal(carom_world_step(w, f, NULL), CAROM_OK);
    const double ia = 2 * (0.25 + 0.01) / 3;
    const double ib = 0.5 * 3 * 0.04;
    const double cx = 3 * 1.2 / 5;
    const double cy = 3 * 0.5 / 5;
    const double inertia = ia + ib + 2 * 3 / 5.0 * (1.2 * 1.2 + 0.5 * 0.5);
    const double omega = h * (0.7 + (-cx * -2 - -cy * 3)) / inertia;
    for (int k = 0; k < 2; k++) {
        const double rx = (k ? 1.2 : 0) - cx;
        const double ry = (k ? 0.5 : 0) - cy;
        assert_near(v_of(w, k ? b : a)[0], omega, 1e-14);
        assert_near(v_of(w, k ? b : a)[1], h * 3 / 5 - omega * ry, 1e-14);
        assert_near(v_of(w, k ? b : a)[2], h * -2 / 5 + omega * rx, 1e-14);
    }
    carom_world_destroy(w);
}

/* A welded pair that spins freely keeps its rate and its momentum. */
static void weld_spins(void **state)
{
    (void)state;
    scene_integrator = CAROM_LOCATED;
    carom_world *w = scene_world(0, 1.0 / 60);
    const int a = scene_box(w, 2, 0.5, 0.1, at(0, 0, 0.3), 0, 0);
    const int b = scene_disc(w, 3, 0.2, 1.2, 0.5, 0, 0);
    const carom_joint_def d = between(CAROM_WELD, a, b, 0.4, -0.3);
    join(w, &d);
    scene_push(w, a, 2, 0.3 + 2 * 0.3, 2 * -0.72);
    scene_push(w, b, 2, 0.3 - 2 * 0.2, 2 * 0.48);
    scene_run(w, 300, NULL);
    for (int k = 0; k < 2; k++) assert_near(v_of(w, k ? b : a)[0], 2, 1e-11);
    assert_near(2 * v_of(w, a)[1] + 3 * v_of(w, b)[1], 5 * 0.3, 1e-11);
    assert_near(2 * v_of(w, a)[2] + 3 * v_of(w, b)[2], 0, 1e-11);
    carom_world_destroy(w);
}

/* Complete elliptic integral K(k) by the arithmetic-geometric mean. */
static double elliptic(double k)
{
    double a = 1;
    double b = sqrt(1 - k * k);
    for (int i = 0; i < 8; i++) {
        const double c = 0.5 * (a + b);
        b = sqrt(a * b);
        a = c;
    }
    return acos(-1) / (2 * a);
}

/* Distance from the lowest point of a disc on a rod, let go at 60 degrees, after a quarter of a
 * period. */
static double rod_pendulum_error(int n)
{
    const double l = 0.8;
    const double start = acos(-1) / 3;
    const double quarter = sqrt(l / 9.81) * elliptic(sin(start / 2));
    scene_integrator = CAROM_LOCATED;
    carom_world *w = scene_world(9.81, quarter / n);
    const int pin = scene_anchor(w);
    const int b = scene_disc(w, 1.3, 0.1, l * sin(start), -l * cos(start), 0, 0);
    carom_joint_def d = between(CAROM_DISTANCE, pin, b, 0, 0);
    d.anchor_b.x = l * sin(start);
    d.anchor_b.y = -l * cos(start);
    join(w, &d);
    scene_run(w, n, NULL);
    assert_near(q_of(w, b)[0], 0, 1e-14); /* the rod holds its center: no torque */
    const double error = hypot(q_of(w, b)[1], q_of(w, b)[2] + l);
    carom_world_destroy(w);
    return error;
}

/* At its lowest point after sqrt(l/g) K(sin(theta/2)), with an error of second order: a quarter at
 * half the step. */
static void rod_is_a_pendulum(void **state)
{
    (void)state;
    const double coarse = rod_pendulum_error(25);
    const double fine = rod_pendulum_error(50);
    assert_at_most("error of 50 steps", fine, 1e-3);
    assert_near(coarse / fine, 4, 0.2);
}

/* One number of a body is held, the others move as if nothing were. */
static void locks(void **state)
{
    (void)state;
    static const carom_joint_kind held[3] = {CAROM_LOCK_ANGLE, CAROM_LOCK_X, CAROM_LOCK_Y};
    static const double start[3] = {0.3, 0.2, 0.4};
    static const double speed[3] = {1.5, -2, 0.7};
    for (int k = 0; k < 3; k++) {
        scene_integrator = CAROM_LOCATED;
        carom_world *w = scene_world(9.81, 1.0 / 60);
        const int world = scene_anchor(w);
        const int b = scene_box(w, 2, 0.3, 0.2, at(start[1], start[2], start[0]), 0.5, 0);
        /* at the center of mass, as the paper has it: the lock then turns nothing */
        const carom_joint_def d = between(held[k], world, b, start[1], start[2]);
        join(w, &d);
        scene_push(w, b, speed[0], speed[1], speed[2]);
        scene_run(w, 60, NULL);
        for (int i = 0; i < 3; i++) {
            const double fall = i == 2 ? -0.5 * 9.81 : 0;
            const double expected = start[i] + (i == k ? 0 : speed[i] + fall);
            assert_near_case("number", i, q_of(w, b)[i], expected, 1e-12);
        }
        carom_world_destroy(w);
    }
}

/* The three locks are a weld to the world. */
static void total_lock(void **state)
{
    (void)state;
    for (int i = 0; i < 3; i++) {
        scene_integrator = INTEGRATORS[i];
        carom_world *w = scene_world(9.81, 1.0 / 60);
        const int world = scene_anchor(w);
        const int b = scene_box(w, 2, 0.3, 0.2, at(0.5, 0.2, 0.3), 0.5, 0);
        for (int k = CAROM_LOCK_X; k <= CAROM_LOCK_ANGLE; k++) {
            const carom_joint_def d = between((carom_joint_kind)k, world, b, 0.7, 0.1);
            join(w, &d);
        }
        scene_run(w, 60, NULL);
        assert_near(q_of(w, b)[0], 0.3, 1e-14);
        assert_near(q_of(w, b)[1], 0.5, 1e-14);
        assert_near(q_of(w, b)[2], 0.2, 1e-14);
        carom_world_destroy(w);
    }
}

/* A frictionless stick whose angle is locked bounces from one corner like a point, with e. */
static void locked_angle_at_an_impact(void **state)
{
    (void)state;
    scene_integrator = CAROM_LOCATED;
    carom_world *w = scene_world(0, 1.0 / 60);
    const int floor = scene_floor(w, 0, 0.6);
    const int b = scene_box(w, 2, 0.5, 0.05, at(0, 1, 0.5), 0, 0.6);
    const carom_joint_def d = between(CAROM_LOCK_ANGLE, floor, b, 0, 0);
    join(w, &d);
    scene_push(w, b, 0, 0.5, -2);
    scene_run(w, 60, NULL);
    assert_near(v_of(w, b)[0], 0, 1e-12);
    assert_near(v_of(w, b)[1], 0.5, 1e-12);
    assert_near(v_of(w, b)[2], 0.6 * 2, 1e-12);
    carom_world_destroy(w);
}

/* --- drift, loops, conflicts -------------------------------------------------------------------
 */

/* Two boxes in flight without gravity, so that they stay as fast as they are.  The first is pinned
 * to the world; the second is joined to the first, or by a lock to the world. */
static carom_world *thrown(carom_joint_kind kind)
{
    carom_world *w = scene_world(0, 1.0 / 60);
    const int world = scene_anchor(w);
    const int a = scene_box(w, 1.4, 0.4, 0.1, at(0.3, 0.1, 0.2), 0, 0);
    const int b = scene_box(w, 0.6, 0.3, 0.1, at(1.1, -0.2, -0.4), 0, 0);
    carom_joint_def d = between(kind, kind < CAROM_LOCK_X ? a : world, b, 0.7, 0.1);
    d.anchor_b.x = 1.3;
    d.anchor_b.y = -0.5;
    d.axis.x = 0.5;
    d.axis.y = -1;
    d.collide = 0;
    join(w, &d);
    const carom_joint_def pin = between(CAROM_REVOLUTE, world, a, 0, 0);
    join(w, &pin);
    scene_push(w, a, 1.5, -0.15, 0.45);
    scene_push(w, b, 1.5, 0, 1.5);
    return w;
}

/* joint_drift <= 1e-10 L over the run, L = 0.82 m; 1e5 steps with the argument `long`. */
static int drift_steps = 4000;

static void no_drift(void **state)
{
    (void)state;
    for (int k = 0; k < 3 * N_KINDS; k++) {
        scene_integrator = INTEGRATORS[k / N_KINDS];
        carom_world *w = thrown(KINDS[k % N_KINDS]);
        for (int n = 0; n < drift_steps; n++) {
            carom_step_stats stats;
            const carom_status e = carom_world_step(w, NULL, &stats);
            if (e < 0 || !(stats.joint_drift <= 1e-10 * 0.82)) {
                fail_msg("%s, integrator %d, step %d: %s, drift %g",
                         carom_joint_kind_name(KINDS[k % N_KINDS]), k / N_KINDS, n,
                         carom_world_error(w), stats.joint_drift);
            }
        }
        carom_world_destroy(w);
    }
}

/* A parallelogram of rods and pins, each twice, and a weld on top of a pin: more rows than the
 * motion needs.  The pendulum that is left swings as without them. */
static carom_world *parallelogram(int twice)
{
    carom_world *w = scene_world(9.81, 1.0 / 60);
    const int world = scene_anchor(w);
    const int bar = scene_box(w, 2, 0.5, 0.05, at(0.5, -1, 0), 0, 0);
    const int load = scene_box(w, 1, 0.1, 0.1, at(0.5, -1.2, 0), 0, 0);
    for (int k = 0; k < 2; k++) {
        carom_joint_def rod = between(CAROM_DISTANCE, world, bar, k, 0);
        rod.anchor_b.x = k;
        rod.anchor_b.y = -1;
        for (int i = 0; i <= twice; i++) join(w, &rod);
        if (twice) {
            carom_joint_def middle = between(CAROM_DISTANCE, world, bar, 0.5, 0);
            middle.anchor_b.x = 0.5;
            middle.anchor_b.y = -1;
            join(w, &middle);
        }
    }
    const carom_joint_def weld = between(CAROM_WELD, bar, load, 0.5, -1.1);
    const carom_joint_def pin = between(CAROM_REVOLUTE, bar, load, 0.5, -1.1);
    join(w, &weld);
    if (twice) join(w, &pin);
    scene_push(w, bar, 0, 2, 0);
    scene_push(w, load, 0, 2, 0);
    return w;
}

static void redundant_rows(void **state)
{
    (void)state;
    for (int i = 0; i < 3; i++) {
        scene_integrator = INTEGRATORS[i];
        carom_world *w[2] = {parallelogram(0), parallelogram(1)};
        carom_step_stats stats[2];
        for (int k = 0; k < 2; k++) scene_run(w[k], 60, &stats[k]);
        /* multipliers of redundant rows are not unique; the motion is, to the residual of 1e-10 */
        assert_near_array("q", 9, carom_world_q(w[0]), carom_world_q(w[1]), 1e-8);
        assert_near_array("v", 9, carom_world_v(w[0]), carom_world_v(w[1]), 1e-8);
        assert_true(stats[1].joint_drift <= 1e-10);
        assert_near(q_of(w[1], 1)[0], 0, 1e-10); /* a parallelogram does not turn its bar */
        for (int k = 0; k < 2; k++) carom_world_destroy(w[k]);
    }
}

/* A body pinned to the world and to a body that drives away: no motion satisfies both.  The step
 * says so and leaves the world as it was. */
static void conflicting_joints(void **state)
{
    (void)state;
    for (int i = 0; i < 3; i++) {
        scene_integrator = INTEGRATORS[i];
        carom_world *w = scene_world(9.81, 1.0 / 60);
        const int world = scene_anchor(w);
        carom_body_def driven = carom_body_at(CAROM_KINEMATIC, 2, 0);
        driven.velocity[1] = 1;
        int cart = -1;
        assert_int_equal(carom_world_add_body(w, &driven, &cart), CAROM_OK);
        const int b = scene_box(w, 1, 1, 0.1, at(1, 0, 0), 0, 0);
        const carom_joint_def pins[2] = {between(CAROM_REVOLUTE, world, b, 0, 0),
                                         between(CAROM_REVOLUTE, cart, b, 2, 0)};
        for (int k = 0; k < 2; k++) join(w, &pins[k]);
        assert_int_equal(carom_world_seal(w), CAROM_OK);
        double before[18];
        memcpy(before, carom_world_q(w), 9 * sizeof(double));
        memcpy(before + 9, carom_world_v(w), 9 * sizeof(double));
        const carom_status e = carom_world_step(w, NULL, NULL);
        assert_true(e == CAROM_E_INFEASIBLE || e == CAROM_E_NO_SOLUTION);
        assert_non_null(strstr(carom_world_error(w), "step 1"));
        assert_memory_equal(before, carom_world_q(w), 9 * sizeof(double));
        assert_memory_equal(before + 9, carom_world_v(w), 9 * sizeof(double));
        carom_world_destroy(w);
    }
}

/* Joints whose places do not fit after set_state, far from any solution: a status, never NaN. */
static void torn_joints(void **state)
{
    (void)state;
    for (int k = 0; k < 3 * N_KINDS; k++) {
        scene_integrator = INTEGRATORS[k / N_KINDS];
        carom_world *w = thrown(KINDS[k % N_KINDS]);
        assert_int_equal(carom_world_seal(w), CAROM_OK);
        const double q[9] = {0, 0, 0, 2, 30, 10, -1, -20, 40};
        assert_int_equal(carom_world_set_state(w, q, NULL), CAROM_OK);
        for (int n = 0; n < 20; n++) carom_world_step(w, NULL, NULL);
        for (int i = 0; i < 9; i++) {
            assert_true(isfinite(carom_world_q(w)[i]) && isfinite(carom_world_v(w)[i]));
        }
        carom_world_destroy(w);
    }
}

/* --- the interface -----------------------------------------------------------------------------
 */

static void refusals(void **state)
{
    (void)state;
    scene_integrator = CAROM_EULER;
    carom_world *w = scene_world(0, 0.1);
    const int world = scene_anchor(w);
    const int also = scene_anchor(w);
    const int b = scene_disc(w, 1, 0.1, 0, 0, 0, 0);
    carom_joint_def bad[8];
    static const char *const words[8] = {"no kind 77",   "no body -1", "one body twice",
                                         "is dynamic",   "not finite", "set them apart",
                                         "no direction", "not finite"};
    for (int k = 0; k < 8; k++) bad[k] = between(CAROM_PRISMATIC, world, b, 0, 0);
    bad[0].kind = (carom_joint_kind)77;
    bad[1] = carom_joint_defaults(CAROM_WELD);
    bad[2].body_a = b;
    bad[3].body_b = also;
    bad[4].anchor.x = NAN;
    bad[5].kind = CAROM_DISTANCE;
    bad[6].axis.x = 0;
    bad[7].kind = CAROM_DISTANCE;
    bad[7].anchor_b.y = HUGE_VAL;
    for (int k = 0; k < 8; k++) {
        assert_int_equal(carom_world_add_joint(w, &bad[k], NULL), CAROM_E_ARGUMENT);
        if (!strstr(carom_world_error(w), words[k]) || !strstr(carom_world_error(w), "joint 0")) {
            fail_msg("case %d: \"%s\" lacks \"%s\"", k, carom_world_error(w), words[k]);
        }
    }
    assert_int_equal(carom_world_n_joints(w), 0);
    assert_int_equal(carom_world_seal(w), CAROM_OK);
    const carom_joint_def late = between(CAROM_WELD, world, b, 0, 0);
    assert_int_equal(carom_world_add_joint(w, &late, NULL), CAROM_E_STATE);
    assert_int_equal(carom_world_add_joint(NULL, &late, NULL), CAROM_E_ARGUMENT);
    assert_int_equal(carom_world_add_joint(w, NULL, NULL), CAROM_E_ARGUMENT);
    assert_null(carom_joint_kind_name(CAROM_N_JOINT_KINDS));
    carom_world_destroy(w);
}

/* Rows are counted by kind, and joined bodies touch each other only when they may. */
static void counts_and_contacts(void **state)
{
    (void)state;
    static const int rows[N_KINDS] = {2, 2, 3, 1, 1, 1, 1, 1};
    for (int k = 0; k < N_KINDS; k++) {
        for (int collide = 0; collide < 2; collide++) {
            scene_integrator = CAROM_EULER;
            carom_world *w = scene_world(0, 0.01);
            const int a = scene_disc(w, 1, 0.5, 0, 0, 0, 0);
            const int b = scene_disc(w, 1, 0.5, 1, 0, 0, 0);
            carom_joint_def d = between(KINDS[k], a, b, 0.5, 0);
            d.anchor_b.x = 1;
            d.collide = collide;
            join(w, &d);
            scene_run(w, 1, NULL);
            assert_int_equal(carom_world_measure(w).n_joint_rows, rows[k]);
            assert_int_equal(carom_world_n_contacts(w), collide);
            carom_world_destroy(w);
        }
    }
}

int main(int argc, char **argv)
{
    if (argc > 1 && !strcmp(argv[1], "long")) drift_steps = 100000;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rows_against_differences),
        cmocka_unit_test(measures_backward),
        cmocka_unit_test(slides_down_a_rail),
        cmocka_unit_test(weld_is_one_body),
        cmocka_unit_test(weld_spins),
        cmocka_unit_test(rod_is_a_pendulum),
        cmocka_unit_test(locks),
        cmocka_unit_test(total_lock),
        cmocka_unit_test(locked_angle_at_an_impact),
        cmocka_unit_test(no_drift),
        cmocka_unit_test(redundant_rows),
        cmocka_unit_test(conflicting_joints),
        cmocka_unit_test(torn_joints),
        cmocka_unit_test(refusals),
        cmocka_unit_test(counts_and_contacts),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
