/* Forces that the caller computes: closed forms, orders, gradients. */
#include "carom/grad.h"
#include "near.h"
#include "scenes.h"

#include <string.h>

typedef struct law {
    double k; /* strength */
    double d;
} law;

/* m a = -k x - d v of a disc of mass 2 */
static void spring(void *user, int body, double t, const double q[3], const double v[3],
                   double f[3])
{
    const law *a = user;
    (void)body;
    (void)t;
    for (int i = 0; i < 3; i++) f[i] = -a->k * q[i] - a->d * v[i];
}

static void spring_slopes(void *user, int body, double t, const double q[3], const double v[3],
                          double by_q[9], double by_v[9])
{
    const law *a = user;
    (void)body;
    (void)t;
    (void)q;
    (void)v;
    for (int i = 0; i < 3; i++) by_q[4 * i] = -a->k, by_v[4 * i] = -a->d;
}

/* -k x / |x|^3 */
static void center(void *user, int body, double t, const double q[3], const double v[3],
                   double f[3])
{
    const law *a = user;
    const double r = hypot(q[1], q[2]);
    (void)body;
    (void)t;
    (void)v;
    f[1] = -a->k * q[1] / (r * r * r);
    f[2] = -a->k * q[2] / (r * r * r);
}

/* k |v| v against the motion. */
static void air(void *user, int body, double t, const double q[3], const double v[3], double f[3])
{
    const law *a = user;
    const double speed = hypot(v[1], v[2]);
    (void)body;
    (void)t;
    (void)q;
    f[1] = -a->k * speed * v[1];
    f[2] = -a->k * speed * v[2];
}

static void air_slopes(void *user, int body, double t, const double q[3], const double v[3],
                       double by_q[9], double by_v[9])
{
    const law *a = user;
    const double speed = hypot(v[1], v[2]);
    (void)body;
    (void)t;
    (void)q;
    (void)by_q;
    for (int i = 1; speed > 0 && i < 3; i++) {
        for (int j = 1; j < 3; j++) {
            by_v[3 * i + j] = -a->k * (v[i] * v[j] / speed + (i == j ? speed : 0));
        }
    }
}

/* A charge in a magnetic field turns with k / m and keeps its speed. */
static void magnet(void *user, int body, double t, const double q[3], const double v[3],
                   double f[3])
{
    const law *a = user;
    (void)body;
    (void)t;
    (void)q;
    f[1] = a->k * v[2];
    f[2] = -a->k * v[1];
}

static void tide(void *user, int body, double t, const double q[3], const double v[3], double f[3])
{
    const law *a = user;
    (void)body;
    (void)q;
    (void)v;
    f[1] = a->k * cos(3 * t);
}

static carom_world *flight(carom_field field, int order, int n, double x, double y, double vx,
                           double vy)
{
    scene_order = order;
    carom_world *w = scene_world(0, 1.0 / n);
    scene_order = 2;
    scene_push(w, scene_disc(w, 2, 1, x, y, 0, 0), 0, vx, vy);
    assert_int_equal(carom_world_add_field(w, &field), CAROM_OK);
    return w;
}

typedef struct form {
    const char *name;
    void (*force)(void *, int, double, const double *, const double *, double *);
    law law;
    double start[4];
    double end[2]; /* after 1 s */
} form;

static double error_of(const form *f, int order, int n)
{
    law a = f->law;
    const carom_field field = {f->force, NULL, &a, NULL};
    carom_world *w = flight(field, order, n, f->start[0], f->start[1], f->start[2], f->start[3]);
    scene_run(w, n, NULL);
    const double *q = carom_world_q(w);
    const double error = hypot(q[1] - f->end[0], q[2] - f->end[1]);
    carom_world_destroy(w);
    return error;
}

static void orders_are_kept(void **state)
{
    (void)state;
    const double s = sqrt(25 - 1.5 * 1.5); /* k/m = 25, d/m = 3 */
    const double swing = exp(-1.5) * (cos(s) + 1.5 / s * sin(s));
    const form forms[] = {
        {"oscillator", spring, {50, 6}, {1, 0, 0, 0}, {swing, 0}},
        /* circle of radius 1: omega^2 = k/m = 4 */
        {"orbit", center, {8, 0}, {1, 0, 0, 2}, {cos(2), sin(2)}},
        /* v' = -k/m v^2: x = log(1 + k/m v0 t) m/k */
        {"air", air, {1, 0}, {0, 0, 3, 0}, {2 * log(1 + 1.5), 0}},
        {"magnet", magnet, {6, 0}, {0, 0, 1.5, 0}, {0.5 * sin(3), 0.5 * (cos(3) - 1)}},
        /* x'' = k/m cos 3t */
        {"tide", tide, {4, 0}, {0, 0, 0, 0}, {2 * (1 - cos(3)) / 9, 0}},
    };
    scene_integrator = CAROM_LOCATED;
    for (size_t k = 0; k < sizeof forms / sizeof forms[0]; k++) {
        for (int order = 2; order <= 6; order += 2) {
            const int n = order < 6 ? 40 : 20;
            const double coarse = error_of(&forms[k], order, n);
            const double fine = error_of(&forms[k], order, 2 * n);
            assert_near_case(forms[k].name, order, log2(coarse / fine), order, 0.4);
        }
    }
}

/* The symmetric map turns velocities in a magnetic field: no speed is lost in 1000 steps. */
static void magnet_keeps_speed(void **state)
{
    (void)state;
    law a = {6, 0};
    const carom_field field = {magnet, NULL, &a, NULL};
    scene_integrator = CAROM_LOCATED;
    carom_world *w = flight(field, 2, 60, 0, 0, 1.5, 0);
    scene_run(w, 1000, NULL);
    const double *v = carom_world_v(w);
    assert_near(hypot(v[1], v[2]), 1.5, 1e-11); /* 1000 fixed points to 1e-14 */
    carom_world_destroy(w);
}

/* Linear drag as a force is the same as as damping, but for the order of the map. */
static void strong_drag_holds(void **state)
{
    (void)state;
    law a = {0, 200}; /* h d / m = 1.7 */
    const carom_field field = {spring, NULL, &a, NULL};
    scene_integrator = CAROM_LOCATED;
    carom_world *w = flight(field, 2, 60, 0, 0, 1, 0);
    scene_run(w, 60, NULL);
    assert_near(carom_world_v(w)[1], 0, 1e-13); /* ((1 - .83)/(1 + .83))^60 = 1e-63 */
    carom_world_destroy(w);
}

/* A pendulum in air over a floor, which a ball in air hits. */
static carom_world *parts(carom_field field, carom_integrator integrator, int order)
{
    scene_integrator = integrator;
    scene_order = order;
    carom_world *w = scene_world(9.81, 1.0 / 60);
    scene_order = 2;
    const carom_vec2 pin = {0, 0};
    const carom_pose pose = {0, 0.5, 0};
    const int floor = scene_floor(w, 0.4, 0.5);
    const int bar = scene_box(w, 1, 0.5, 0.05, pose, 0, 0.5);
    const int ball = scene_disc(w, 0.7, 0.2, 2, 0.45, 0.4, 0.5);
    assert_int_equal(carom_world_exclude(w, floor, bar), CAROM_OK);
    assert_int_equal(carom_world_add_revolute(w, floor, bar, pin, NULL), CAROM_OK);
    assert_int_equal(carom_world_add_field(w, &field), CAROM_OK);
    scene_push(w, ball, 1, 2, -1);
    return w;
}

static double end_of(double vx, double k, carom_integrator integrator, int order, double *by_vx,
                     double *forward)
{
    law a = {k, 0};
    const carom_field field = {air, air_slopes, &a, NULL};
    carom_world *w = parts(field, integrator, order);
    carom_tape *tape;
    const double weight[9] = {0, 0, 0, 1, 0.3, 0.2, 0.1, 1, -0.5};
    double v0[9] = {0};
    double q_dot[9];
    double v_dot[9];
    carom_gradient g = {0};
    carom_gradient along = {0};
    double sum = 0;
    scene_push(w, 2, 1, vx, -1);
    scene_push(w, 1, vx - 2, 0, 0);
    assert_int_equal(carom_tape_create(w, NULL, &tape), CAROM_OK);
    for (int i = 0; i < 30; i++) assert_true(carom_tape_step(tape, NULL, NULL) >= 0);
    const carom_state_bar bar = {30, weight, weight};
    const carom_state_dot dot = {30, q_dot, v_dot};
    g.v0 = v0;
    if (by_vx) {
        const double ahead[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
        along.v0 = (double *)ahead;
        assert_int_equal(carom_tape_gradient(tape, 1, &bar, &g, NULL), CAROM_OK);
        assert_int_equal(carom_tape_tangent(tape, 1, &along, 1, &dot, NULL), CAROM_OK);
        *by_vx = v0[3] + v0[7];
        *forward = 0;
        for (int i = 0; i < 9; i++) *forward += weight[i] * (q_dot[i] + v_dot[i]);
    }
    for (int i = 0; i < 9; i++) sum += weight[i] * (carom_world_q(w)[i] + carom_world_v(w)[i]);
    carom_tape_destroy(tape);
    carom_world_destroy(w);
    return sum;
}

/* Through impacts, friction and a joint, with every map and order. */
static void gradients_go_through(void **state)
{
    (void)state;
    static const struct {
        carom_integrator integrator;
        int order;
    } maps[] = {{CAROM_EULER, 2}, {CAROM_FIXED, 2}, {CAROM_LOCATED, 2}, {CAROM_LOCATED, 4}};
    const double step = 1e-5; /* rounding 1e-16 / step, curvature step^2 */
    for (int k = 0; k < 4; k++) {
        double reverse;
        double forward;
        const carom_integrator m = maps[k].integrator;
        end_of(2, 0.8, m, maps[k].order, &reverse, &forward);
        const double difference = (end_of(2 + step, 0.8, m, maps[k].order, NULL, NULL) -
                                   end_of(2 - step, 0.8, m, maps[k].order, NULL, NULL)) /
                                  (2 * step);
        assert_near_case("reverse", k, reverse, difference, 1e-7);
        assert_near_case("forward", k, forward, reverse, 1e-10);
    }
}

/* d x(1) / d x(0) of the oscillator is x(1) itself, its motion being linear. */
static void gradient_of_the_oscillator(void **state)
{
    (void)state;
    law a = {50, 6};
    const carom_field field = {spring, spring_slopes, &a, NULL};
    scene_integrator = CAROM_LOCATED;
    for (int order = 2; order <= 6; order += 2) {
        carom_world *w = flight(field, order, 60, 1, 0, 0, 0);
        carom_tape *tape;
        const double weight[3] = {0, 1, 0};
        double q0[3];
        carom_gradient g = {0};
        g.q0 = q0;
        assert_int_equal(carom_tape_create(w, NULL, &tape), CAROM_OK);
        for (int i = 0; i < 60; i++) assert_true(carom_tape_step(tape, NULL, NULL) >= 0);
        const carom_state_bar bar = {60, weight, NULL};
        assert_int_equal(carom_tape_gradient(tape, 1, &bar, &g, NULL), CAROM_OK);
        assert_near_case("by x", order, q0[1], carom_world_q(w)[1], 1e-12);
        assert_near_case("by y", order, q0[2], 0, 1e-12);
        carom_tape_destroy(tape);
        carom_world_destroy(w);
    }
}

/* A wind in gusts, faster with height. */
static void gust(void *user, int body, double t, const double q[3], const double v[3], double f[3])
{
    const law *a = user;
    (void)body;
    f[1] = a->k * (1 + 0.5 * q[2]) * cos(7 * t) - a->d * v[1];
    f[2] = 0.3 * a->k * sin(5 * t);
}

static void gust_slopes(void *user, int body, double t, const double q[3], const double v[3],
                        double by_q[9], double by_v[9])
{
    const law *a = user;
    (void)body;
    (void)q;
    (void)v;
    by_q[3 + 2] = a->k * 0.5 * cos(7 * t);
    by_v[3 + 1] = -a->d;
}

static void gust_rate(void *user, int body, double t, const double q[3], const double v[3],
                      double by_t[3])
{
    const law *a = user;
    (void)body;
    (void)v;
    by_t[1] = -7 * a->k * (1 + 0.5 * q[2]) * sin(7 * t);
    by_t[2] = 1.5 * a->k * cos(5 * t);
}

/* Balls that bounce, roll and are joined, in gusts: impacts move in time, and with dt everything
 * does.  The recording begins in the fourth step. */
static carom_world *in_gusts(const carom_field *field)
{
    carom_world *w = scene_world(9.81, 1.0 / 60);
    scene_floor(w, 0.3, 0.7);
    scene_push(w, scene_disc(w, 1, 0.25, -1, 0.7, 0.4, 0.7), 2, 1, 0.3);
    const int upper = scene_disc(w, 2, 0.2, 2, 1.4, 0.4, 0.5);
    const int lower = scene_disc(w, 1, 0.2, 2.9, 1.2, 0.4, 0.5);
    assert_int_equal(carom_world_add_revolute(w, upper, lower, (carom_vec2){2.5, 1.3}, NULL),
                     CAROM_OK);
    assert_int_equal(carom_world_add_field(w, field), CAROM_OK);
    scene_run(w, 3, NULL);
    return w;
}

/* Reverse against differences of whole runs; forward, by dt and the first speeds, against reverse.
 */
static void gusts(void **state)
{
    (void)state;
    enum { N = 12, STEPS = 40, ALL = 4 * N + 3 * 4 + 3, SOME = 8 };
    static const struct {
        carom_integrator integrator;
        int order;
    } maps[] = {{CAROM_EULER, 2}, {CAROM_FIXED, 2}, {CAROM_LOCATED, 2}, {CAROM_LOCATED, 4}};
    law a = {2, 0.3};
    const carom_field field = {gust, gust_slopes, &a, gust_rate};
    for (int m = 0; m < 4; m++) {
        double bar[N], q0[N], v0[N], mass[4], friction[4], restitution[4], gravity[2], dt[1];
        double q_dot[N], v_dot[N];
        double one[1] = {1};
        double speeds[N];
        carom_checked checked[ALL];
        carom_tape *tape;
        int count;
        scene_integrator = maps[m].integrator;
        scene_order = maps[m].order;
        carom_world *w = in_gusts(&field);
        scene_order = 2;
        for (int k = 0; k < N; k++) bar[k] = k < 3 ? 0 : cos(1.7 * k);
        for (int k = 0; k < N; k++) speeds[k] = k < 3 ? 0 : sin(2.3 * k);
        assert_int_equal(carom_tape_create(w, NULL, &tape), CAROM_OK);
        for (int k = 0; k < STEPS; k++) assert_true(carom_tape_step(tape, NULL, NULL) >= 0);
        const carom_state_bar bars = {STEPS, bar, bar};
        const carom_gradient g = {.q0 = q0,
                                  .v0 = v0,
                                  .mass = mass,
                                  .friction = friction,
                                  .restitution = restitution,
                                  .gravity = gravity,
                                  .dt = dt};
        assert_int_equal(carom_tape_gradient(tape, 1, &bars, &g, NULL), CAROM_OK);
        carom_check_settings set = carom_check_defaults();
        set.per_array = 0;
        assert_int_equal(carom_tape_check(tape, 1, &bars, &g, &set, ALL, checked, &count),
                         CAROM_OK);
        int n_smooth = 0;
        for (int k = 0; k < count && k < ALL; k++) {
            n_smooth += !checked[k].kink;
            if (checked[k].kink) continue;
            /* losses of some 10 and rounding 1e-14 over steps of 1e-5 of the numbers: 1e-8 */
            const double off = fmin(fabs(checked[k].difference[0] - checked[k].gradient),
                                    fabs(checked[k].difference[1] - checked[k].gradient));
            assert_at_most(carom_gradient_name(checked[k].array), off,
                           1e-8 + 1e-6 * fabs(checked[k].gradient));
        }
        assert_true(n_smooth > SOME);
        const carom_gradient along = {.v0 = speeds, .dt = one};
        const carom_state_dot dots = {STEPS, q_dot, v_dot};
        assert_int_equal(carom_tape_tangent(tape, 1, &along, 1, &dots, NULL), CAROM_OK);
        double forward = 0;
        double reverse = dt[0];
        for (int k = 0; k < N; k++) forward += bar[k] * (q_dot[k] + v_dot[k]);
        for (int k = 0; k < N; k++) reverse += v0[k] * speeds[k];
        assert_near_case("forward", m, forward, reverse, 1e-11 * fabs(dt[0]));
        assert_true(fabs(dt[0]) > 1);
        carom_tape_destroy(tape);
        carom_world_destroy(w);
    }
}

static void refused(void **state)
{
    (void)state;
    law a = {1, 0};
    const carom_field field = {air, NULL, &a, NULL};
    const carom_field empty = {NULL, air_slopes, &a, NULL};
    carom_tape *tape;
    double q0[3];
    carom_gradient g = {0};
    g.q0 = q0;
    carom_world *w = flight(field, 2, 60, 0, 0, 1, 0);
    assert_int_equal(carom_world_add_field(w, &empty), CAROM_E_ARGUMENT);
    assert_int_equal(carom_world_add_field(w, NULL), CAROM_E_ARGUMENT);
    assert_int_equal(carom_tape_create(w, NULL, &tape), CAROM_OK);
    assert_int_equal(carom_tape_step(tape, NULL, NULL), CAROM_OK);
    assert_int_equal(carom_tape_gradient(tape, 0, NULL, &g, NULL), CAROM_E_STATE);
    assert_non_null(strstr(carom_world_error(w), "a field has no derivative"));
    assert_int_equal(carom_world_add_field(w, &field), CAROM_E_STATE);
    carom_tape_destroy(tape);
    carom_world_destroy(w);
}

static void breaks_down(void *user, int body, double t, const double q[3], const double v[3],
                        double f[3])
{
    (void)user;
    (void)body;
    (void)q;
    (void)v;
    f[1] = t > 0.1 ? (double)NAN : 0;
}

/* A force that is no number: the step fails, names the body, and the world is as it was. */
static void not_finite(void **state)
{
    (void)state;
    for (int k = 0; k < 6; k++) {
        scene_integrator = (carom_integrator)(k % 3);
        carom_world *w = scene_world(9.81, 1.0 / 60);
        if (k >= 3) scene_floor(w, 0.5, 0);
        const int b = scene_disc(w, 1, 0.5, 0, k < 3 ? 3 : 0.5, 0.5, 0.5);
        const carom_field field = {.force = breaks_down};
        assert_int_equal(carom_world_add_field(w, &field), CAROM_OK);
        double before[3] = {0, 0, 0};
        int n = 0;
        while (n < 20 && carom_world_step(w, NULL, NULL) >= 0) {
            memcpy(before, carom_world_q(w) + 3 * b, sizeof before);
            n++;
        }
        assert_true(n >= 6 && n <= 7); /* t = 0.1 is the end of the sixth step */
        assert_memory_equal(before, carom_world_q(w) + 3 * b, sizeof before);
        assert_int_equal(carom_world_step(w, NULL, NULL), CAROM_E_ARGUMENT);
        assert_true(strlen(carom_world_error(w)) > 0);
        carom_world_destroy(w);
    }
    scene_integrator = CAROM_LOCATED;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(not_finite),
        cmocka_unit_test(orders_are_kept),
        cmocka_unit_test(magnet_keeps_speed),
        cmocka_unit_test(strong_drag_holds),
        cmocka_unit_test(gradients_go_through),
        cmocka_unit_test(gradient_of_the_oscillator),
        cmocka_unit_test(gusts),
        cmocka_unit_test(refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
