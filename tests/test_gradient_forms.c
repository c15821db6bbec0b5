/* Gradients against closed forms, docs/math/equations.md section 6. */
#include "gradient_numbers.h"
#include "near.h"
#include "scenes.h"

#include <stdlib.h>

static carom_pose at(double x, double y, double angle)
{
    const carom_pose p = {angle, x, y};
    return p;
}

/* Gradient of component k of the final q with respect to everything. */
static gradient_room gradient_of_final(carom_world *w, int n_steps, int component)
{
    carom_tape *tape;
    double *seed = calloc(3 * (size_t)carom_world_n_bodies(w), sizeof(double));
    assert_non_null(seed);
    seed[component] = 1;
    assert_int_equal(carom_tape_create(w, NULL, &tape), CAROM_OK);
    for (int k = 0; k < n_steps; k++) assert_true(carom_tape_step(tape, NULL, NULL) >= 0);
    const carom_state_bar bar = {n_steps, seed, NULL};
    gradient_room x = gradient_room_make(w, 1);
    assert_int_equal(carom_tape_gradient(tape, 1, &bar, &x.g, NULL), CAROM_OK);
    carom_tape_destroy(tape);
    free(seed);
    return x;
}

/* Lengths of a step at which every closed form must hold to REL [of the number itself]: of located
 * events the time is known to rounding, and all between them is exact. */
static const double DTS[] = {1.0 / 15, 1.0 / 60, 1.0 / 97.3, 1.0 / 240};
enum { N_DTS = sizeof DTS / sizeof DTS[0] };
static const double REL = 1e-10;

static void check_form(const char *what, int k, double actual, double exact)
{
    assert_near_case(what, k, actual, exact, REL * fabs(exact));
}

static int steps_for(double time, double dt)
{
    return (int)(time / dt + 0.5);
}

/* Still sliding after n steps: x = v0 n h - mu g h^2 n (n+1)/2.  The paper's code has +25.83 for
 * dx/dmu: it solves the adjoint without transposing F. */
static void sliding_friction_sign(void **state)
{
    (void)state;
    const double h = 1.0 / 30;
    scene_integrator = CAROM_EULER;
    carom_world *w = scene_world(50, h);
    scene_floor(w, 0.25, 0);
    const int b = scene_box(w, 1, 0.5, 0.25, at(0, 0.25, 0), 0.25, 0);
    scene_push(w, b, 0, 20, 0);
    gradient_room x = gradient_of_final(w, 30, 3 * b + 1);
    const double exact = -50 * h * h * 30 * 31 / 2;
    /* mu is the mean of two: both shares together are d/dmu */
    assert_near(x.g.friction[0] + x.g.friction[1], exact, 1e-9);
    assert_near(exact, -25.8333, 1e-4);
    assert_near(x.g.v0[3 * b + 1], 30 * h, 1e-11);
    gradient_room_free(&x);
    carom_world_destroy(w);
}

/* y(T) = r + e v T - e (y0 - r): dy/dy0 = -e, though every engine that is blind to the time of
 * impact says +1; dy/dv = -e T for v upward; dy/de = v T - (y0 - r); dy/dr = 1 + e. */
static void wall_bounce(void **state)
{
    (void)state;
    const double e = 0.7;
    const double v = 2;
    scene_integrator = CAROM_LOCATED;
    for (int k = 0; k < N_DTS; k++) {
        const int n = steps_for(1, DTS[k]);
        const double T = n * DTS[k];
        carom_world *w = scene_world(0, DTS[k]);
        scene_floor(w, 0, e);
        const int b = scene_disc(w, 1, 0.2, 0, 1.03, 0, e);
        scene_push(w, b, 0, 0, -v);
        gradient_room x = gradient_of_final(w, n, 3 * b + 2);
        check_form("d/dy0", k, x.g.q0[3 * b + 2], -e);
        check_form("d/dv", k, x.g.v0[3 * b + 2], -e * T);
        check_form("d/de", k, x.g.restitution[0] + x.g.restitution[1], v * T - (1.03 - 0.2));
        check_form("d/dr", k, x.g.radius[1], 1 + e);
        check_form("d/dfloor", k, x.g.q0[2], 1 + e);
        check_form("d/ddt", k, x.g.dt[0], e * v * n);
        gradient_room_free(&x);
        carom_world_destroy(w);
    }
}

/* A ball falls from y0 with e < 1: v1 = sqrt(2 g (y0 - r)), t1 = v1 / g, then flights of 2 e^k v1 /
 * g. After n bounces, tau later, y = r + e^n v1 tau - g tau^2 / 2. */
static void many_bounces(void **state)
{
    (void)state;
    const double e = 0.8;
    const double g = 9.81;
    const double r = 0.2;
    const double y0 = 1.13;
    const double v1 = sqrt(2 * g * (y0 - r));
    scene_integrator = CAROM_LOCATED;
    for (int k = 0; k < N_DTS; k++) {
        const int steps = steps_for(2.4, DTS[k]);
        double tau = steps * DTS[k] - v1 / g;
        double sum = 0;   /* of e^k */
        double slope = 0; /* its derivative by e */
        int n = 1;
        for (double en = e; tau > 2 * en * v1 / g; n++, en *= e) {
            tau -= 2 * en * v1 / g;
            sum += en;
            slope += n * en / e;
        }
        const double en = pow(e, n);
        const double up = en * v1 - g * tau;
        const double by_v = en * tau - up * (1 + 2 * sum) / g;
        const double by_g =
            -0.5 * tau * tau + up * (v1 / (g * g)) * (1 + 2 * sum) + by_v * v1 / (2 * g);
        carom_world *w = scene_world(g, DTS[k]);
        scene_floor(w, 0, e);
        const int b = scene_disc(w, 1, r, 0, y0, 0, e);
        gradient_room x = gradient_of_final(w, steps, 3 * b + 2);
        assert_true(n >= 3);
        check_form("y", k, carom_world_q(w)[3 * b + 2], r + en * v1 * tau - 0.5 * g * tau * tau);
        check_form("d/dy0", k, x.g.q0[3 * b + 2], by_v * g / v1);
        check_form("d/de", k, x.g.restitution[0] + x.g.restitution[1],
                   n * en / e * v1 * tau - up * 2 * slope * v1 / g);
        check_form("d/dg", k, x.g.gravity[1], -by_g);
        gradient_room_free(&x);
        carom_world_destroy(w);
    }
}

/* A disc hits the floor obliquely at t1 = (y0 - r) / v; u = vx + omega r.  It sticks: vx' = vx - u
 * / 3, omega' = omega - 2 u / (3 r); or slips: vx' = vx - mu (1 + e) v. */
static void oblique(double mu, int sticks)
{
    const double e = 0.5;
    const double v = 2;
    const double r = 0.3;
    const double vx = sticks ? 1 : 3;
    const double omega = 0.5;
    const double u = vx + omega * r;
    const double t1 = (0.9123 - r) / v;
    const double jump = sticks ? u / 3 : mu * (1 + e) * v; /* vx - vx' */
    scene_integrator = CAROM_LOCATED;
    for (int k = 0; k < N_DTS; k++) {
        const int n = steps_for(0.8, DTS[k]);
        const double left = n * DTS[k] - t1;
        carom_world *w = scene_world(0, DTS[k]);
        scene_floor(w, mu, e);
        const int b = scene_disc(w, 2, r, 0, 0.9123, mu, e);
        scene_push(w, b, omega, vx, -v);
        gradient_room x = gradient_of_final(w, n, 3 * b + 1);
        const double mu_bar = x.g.friction[0] + x.g.friction[b];
        const double e_bar = x.g.restitution[0] + x.g.restitution[b];
        check_form("x", k, carom_world_q(w)[3 * b + 1], vx * t1 + (vx - jump) * left);
        check_form("d/dvx", k, x.g.v0[3 * b + 1], t1 + (sticks ? 2.0 / 3 : 1) * left);
        check_form("d/dy0", k, x.g.q0[3 * b + 2], jump / v);
        check_form("d/dvy", k, x.g.v0[3 * b + 2],
                   jump * t1 / v + (sticks ? 0 : mu * (1 + e) * left));
        if (sticks) {
            check_form("d/domega", k, x.g.v0[3 * b], -r / 3 * left);
            assert_near_case("d/dmu", k, mu_bar, 0, REL);
            assert_near_case("d/de", k, e_bar, 0, REL);
        } else {
            assert_near_case("d/domega", k, x.g.v0[3 * b], 0, REL);
            check_form("d/dmu", k, mu_bar, -(1 + e) * v * left);
            check_form("d/de", k, e_bar, -mu * v * left);
        }
        gradient_room_free(&x);
        carom_world_destroy(w);
    }
}

static void oblique_stick(void **state)
{
    (void)state;
    oblique(0.6, 1);
}

static void oblique_slip(void **state)
{
    (void)state;
    oblique(0.08, 0);
}

/* A disc falls with vx onto a floor, e = 0: at t1 = vn / g it keeps vx - mu vn and slips at
 * u1 = vx - 3 mu vn for ts = u1 / (3 mu g), then it rolls at 2 vx / 3. */
static void drop_slide_roll(void **state)
{
    (void)state;
    const double mu = 0.1;
    const double g = 9.81;
    const double vx = 3;
    const double r = 0.25;
    const double y0 = 0.7;
    const double vn = sqrt(2 * g * (y0 - r));
    const double t1 = vn / g;
    const double ts = (vx - 3 * mu * vn) / (3 * mu * g);
    const double x1 = vx * t1 + (vx - mu * vn) * ts - 0.5 * mu * g * ts * ts;
    scene_integrator = CAROM_LOCATED;
    for (int k = 0; k < N_DTS; k++) {
        const int n = steps_for(1.6, DTS[k]);
        const double T = n * DTS[k];
        carom_world *w = scene_world(g, DTS[k]);
        scene_floor(w, mu, 0);
        const int b = scene_disc(w, 1.5, r, 0, y0, mu, 0);
        scene_push(w, b, 0, vx, 0);
        gradient_room x = gradient_of_final(w, n, 3 * b + 1);
        assert_true(T > t1 + ts && ts > 0);
        check_form("x", k, carom_world_q(w)[3 * b + 1], x1 + 2.0 / 3 * vx * (T - t1 - ts));
        check_form("d/dy0", k, x.g.q0[3 * b + 2], (vx / (3 * g) - mu * ts) * g / vn);
        check_form("d/dmu", k, x.g.friction[0] + x.g.friction[b], -vn * ts - 0.5 * g * ts * ts);
        check_form("d/ddt", k, x.g.dt[0], 2.0 / 3 * vx * n);
        gradient_room_free(&x);
        carom_world_destroy(w);
    }
}

/* The same with the impact exactly on the border of two steps.  A run that ends there ends with the
 * state before the impact: its derivative is that of the fall. */
static void bounce_on_a_border(void **state)
{
    (void)state;
    static const double dts[3] = {1.0 / 4, 1.0 / 16, 1.0 / 64};
    for (int k = 0; k < 12; k++) {
        const double T = k % 2 ? 1 : 0.5;
        const double by_y = T > 0.5 ? -0.5 : 1;
        const double dt = dts[k / 2 % 3];
        scene_integrator = k < 6 ? CAROM_LOCATED : CAROM_EULER;
        carom_world *w = scene_world(0, dt);
        scene_floor(w, 0, 0.5);
        const int b = scene_disc(w, 1, 0.25, 0, 1.25, 0, 0.5);
        scene_push(w, b, 0, 0, -2);
        gradient_room x = gradient_of_final(w, steps_for(T, dt), 3 * b + 2);
        check_form("d/dy0", k, x.g.q0[3 * b + 2], by_y);
        check_form("d/dv", k, x.g.v0[3 * b + 2], by_y * T);
        gradient_room_free(&x);
        carom_world_destroy(w);
    }
}

/* Equal discs head on, e = 1: they change places.  With x1 + r and x2 - r moving like points:
 * x2(T) = x1 + 2 r + v1 T. */
static void head_on(void **state)
{
    (void)state;
    scene_integrator = CAROM_LOCATED;
    for (int k = 0; k < N_DTS; k++) {
        const int n = steps_for(1, DTS[k]);
        carom_world *w = scene_world(0, DTS[k]);
        scene_disc(w, 1, 0.2, -1, 0, 0, 1);
        scene_disc(w, 1, 0.2, 1, 0, 0, 1);
        scene_push(w, 0, 0, 2, 0);
        scene_push(w, 1, 0, -1, 0);
        gradient_room x = gradient_of_final(w, n, 4);
        check_form("d/dx1", k, x.g.q0[1], 1);
        assert_near_case("d/dx2", k, x.g.q0[4], 0, REL);
        check_form("d/dv1", k, x.g.v0[1], n * DTS[k]);
        assert_near_case("d/dv2", k, x.g.v0[4], 0, REL);
        check_form("d/dr", k, x.g.radius[0] + x.g.radius[1], 2);
        gradient_room_free(&x);
        carom_world_destroy(w);
    }
}

/* Free flight: x = x0 + v T + F/m h^2 n (n+1)/2; dx/dm = -F/m^2 h^2 n (n+1)/2. */
static void free_flight(void **state)
{
    (void)state;
    const double h = 0.1;
    scene_integrator = CAROM_EULER;
    carom_world *w = scene_world(9.81, h);
    const int b = scene_disc(w, 2, 0.2, 0, 0, 0, 0);
    *gradient_number(w, BY_FORCE, 3 * b + 1) = 3;
    gradient_room x = gradient_of_final(w, 10, 3 * b + 1);
    const double s = h * h * 10 * 11 / 2;
    assert_near(x.g.q0[3 * b + 1], 1, 1e-13);
    assert_near(x.g.v0[3 * b + 1], 1, 1e-13);
    assert_near(x.g.force[3 * b + 1], s / 2, 1e-13);
    assert_near(x.g.mass[b], -3.0 / 4 * s, 1e-13);
    assert_near(x.g.gravity[0], s, 1e-13);
    assert_near(x.g.gravity[1], 0, 1e-13);
    assert_near(x.g.dt[0], 2 * 1.5 * s / h, 1e-12); /* x ~ h^2 */
    gradient_room_free(&x);
    carom_world_destroy(w);
}

/* A sliding box stops after v^2 / (2 mu g), wherever that falls within a step. */
static void stopping_distance(void **state)
{
    (void)state;
    static const double dts[] = {1.0 / 15, 1.0 / 60, 1.0 / 97.3, 1.0 / 240, 1.0 / 7, 0.31};
    const double mu = 0.4;
    const double v = 3;
    const double g = 9.81;
    for (int k = 0; k < 6; k++) {
        scene_integrator = CAROM_LOCATED;
        carom_world *w = scene_world(g, dts[k]);
        scene_floor(w, 0.5, 0);
        const int b = scene_box(w, 2, 0.5, 0.25, at(0, 0.25, 0), 0.3, 0);
        scene_push(w, b, 0, v, 0);
        gradient_room x = gradient_of_final(w, (int)(1.5 / dts[k]), 3 * b + 1);
        const double d = v * v / (2 * mu * g);
        /* rounding over some hundred sub-steps */
        assert_near_case("distance", k, carom_world_q(w)[3 * b + 1], d, 1e-12);
        assert_near_case("d/dv", k, x.g.v0[3 * b + 1], v / (mu * g), 1e-10);
        assert_near_case("d/dmu", k, x.g.friction[0] + x.g.friction[b], -d / mu, 1e-10 * d / mu);
        assert_near_case("d/dg", k, x.g.gravity[1], d / g, 1e-10); /* gravity = -g */
        assert_near_case("d/dm", k, x.g.mass[b], 0, 1e-10);
        gradient_room_free(&x);
        carom_world_destroy(w);
    }
    scene_integrator = CAROM_EULER;
}

/* A disc slides until t1 = v / (3 mu g) and rolls at 2 v / 3 from x1 = 5 v t1 / 6:
 * x(T) = 2/3 v T + v^2 / (18 mu g). */
static void slide_then_roll(void **state)
{
    (void)state;
    static const double dts[] = {1.0 / 15, 1.0 / 60, 1.0 / 97.3, 1.0 / 240, 1.0 / 7, 0.25};
    const double mu = 0.4;
    const double v = 3;
    const double g = 9.81;
    for (int k = 0; k < 6; k++) {
        const int n = (int)(1.5 / dts[k]);
        const double T = n * dts[k];
        scene_integrator = CAROM_LOCATED;
        carom_world *w = scene_world(g, dts[k]);
        scene_floor(w, 0.5, 0);
        const int b = scene_disc(w, 2, 0.5, 0, 0.5, 0.3, 0);
        scene_push(w, b, 0, v, 0);
        gradient_room x = gradient_of_final(w, n, 3 * b + 1);
        const double c = v / (18 * mu * g);
        assert_near_case("x", k, carom_world_q(w)[3 * b + 1], 2.0 / 3 * v * T + v * c, 1e-12);
        assert_near_case("d/dv", k, x.g.v0[3 * b + 1], 2.0 / 3 * T + 2 * c, 1e-10);
        assert_near_case("d/dmu", k, x.g.friction[0] + x.g.friction[b], -v * c / mu, 1e-10);
        assert_near_case("d/ddt", k, x.g.dt[0], 2.0 / 3 * v * n, 1e-9);
        gradient_room_free(&x);
        carom_world_destroy(w);
    }
    scene_integrator = CAROM_EULER;
}

/* A disc slides without friction; a little of it would slow it: x(T) = v T - mu g T^2 / 2, from the
 * right at mu = 0. */
static void first_of_friction(void **state)
{
    (void)state;
    static const carom_integrator maps[2] = {CAROM_LOCATED, CAROM_FIXED};
    for (int k = 0; k < 2; k++) {
        scene_integrator = maps[k];
        carom_world *w = scene_world(9.81, 1.0 / 50);
        scene_floor(w, 0, 0);
        const int b = scene_disc(w, 3, 0.5, 0, 0.5, 0, 0);
        scene_push(w, b, 0, -2, 0);
        gradient_room x = gradient_of_final(w, 50, 3 * b + 1);
        assert_near(x.g.friction[0] + x.g.friction[b], 0.5 * 9.81, 1e-10);
        gradient_room_free(&x);
        carom_world_destroy(w);
    }
    scene_integrator = CAROM_EULER;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(first_of_friction), cmocka_unit_test(stopping_distance),
        cmocka_unit_test(slide_then_roll),   cmocka_unit_test(sliding_friction_sign),
        cmocka_unit_test(wall_bounce),       cmocka_unit_test(bounce_on_a_border),
        cmocka_unit_test(head_on),           cmocka_unit_test(free_flight),
        cmocka_unit_test(many_bounces),      cmocka_unit_test(oblique_stick),
        cmocka_unit_test(oblique_slip),      cmocka_unit_test(drop_slide_roll)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
