/* The second-order step against closed forms, docs/math/equations.md section 6. */
#include "near.h"
#include "scenes.h"

static const double *q_of(const carom_world *w, int body)
{
    return carom_world_q(w) + 3 * body;
}

/* Height of a ball of restitution e dropped from rest with its lowest point at H, after time t. */
static double bounce(double H, double e, double g, double t)
{
    const double fall = sqrt(2 * H / g);
    if (t < fall) return H - 0.5 * g * t * t;
    double v = e * g * fall;
    t -= fall;
    while (t > 2 * v / g) {
        t -= 2 * v / g;
        v *= e;
    }
    return v * t - 0.5 * g * t * t;
}

/* Free flight and impacts are exact, whatever the step. */
static void bouncing_ball(void **state)
{
    (void)state;
    static const double es[] = {0.8, 1};
    for (int k = 0; k < 2; k++) {
        carom_world *w = scene_world(9.81, 1.0 / 60);
        scene_floor(w, 0.5, es[k]);
        const int b = scene_disc(w, 1, 0.25, 0, 1.25, 0.5, es[k]);
        for (int n = 1; n <= 120; n++) {
            scene_run(w, 1, NULL);
            /* rounding of the time of each impact, times the speed, over some bounces */
            assert_near_case("height", n, q_of(w, b)[2] - 0.25, bounce(1, es[k], 9.81, n / 60.0),
                             1e-12);
        }
        carom_world_destroy(w);
    }
}

/* Fifty bounces without loss: nothing may drift. */
static void elastic_energy(void **state)
{
    (void)state;
    carom_world *w = scene_world(9.81, 1.0 / 60);
    scene_floor(w, 0, 1);
    scene_disc(w, 1, 0.25, 0, 0.85, 0, 1);
    const double energy = carom_world_energy(w);
    scene_run(w, 60 * 35, NULL);
    assert_near(carom_world_energy(w), energy, 1e-11 * energy);
    carom_world_destroy(w);
}

/* A disc rolls off after sliding: both phases are exact, and the change between them is located. */
static double slide_to_roll_error(int n)
{
    const double T = 1;
    carom_world *w = scene_world(9.81, T / n);
    scene_floor(w, 0.3, 0);
    const int b = scene_disc(w, 1, 0.4, 0, 0.4, 0.3, 0);
    scene_push(w, b, 0, 3, 0);
    scene_run(w, n, NULL);
    const double slide = 3 / (3 * 0.3 * 9.81);
    const double exact = 5 * 9.0 / (18 * 0.3 * 9.81) + 2 * (T - slide);
    assert_near(carom_world_v(w)[3 * b + 1], 2, 1e-11);
    const double error = fabs(q_of(w, b)[1] - exact);
    carom_world_destroy(w);
    return error;
}

static void slide_to_roll(void **state)
{
    (void)state;
    /* rounding of some hundred sub-steps, and of the time of the change */
    static const int ns[] = {3, 30, 60, 120};
    for (int k = 0; k < 4; k++) assert_at_most("position", slide_to_roll_error(ns[k]), 1e-12);
}

/* A box pushed on a slope stops, and another turns back downhill: v^2 / (2 a) with a of each way.
 * The change of sign is an event, too. */
static void sliding_box_turns_back(void **state)
{
    (void)state;
    const double g = 9.81;
    const double mu = 0.2;
    const double s = 0.6; /* slope: tan > mu, so it comes back */
    const double c = 0.8;
    const double v = 2;
    carom_world_settings set = carom_world_defaults();
    carom_world *w = NULL;
    set.integrator = CAROM_LOCATED;
    set.gravity[0] = -g * s;
    set.gravity[1] = -g * c;
    set.dt = 1.0 / 25;
    assert_int_equal(carom_world_create(&set, NULL, &w), CAROM_OK);
    scene_floor(w, mu, 0);
    const int b = scene_box(w, 3, 0.5, 0.2, (carom_pose){0, 0, 0.2}, mu, 0);
    scene_push(w, b, 0, v, 0);
    scene_run(w, 30, NULL);
    const double up = g * (s + mu * c);
    const double down = g * (s - mu * c);
    const double t = 30 * set.dt - v / up;
    assert_near(q_of(w, b)[1], v * v / (2 * up) - 0.5 * down * t * t, 1e-12);
    carom_world_destroy(w);
}

/* Angle of a compound pendulum a quarter period after its release at 60 degrees. */
static double pendulum_error(int n)
{
    const double a = acos(0.5);
    const double T = 4 * sqrt((1.0 / 12 + 0.25) / (9.81 * 0.5)) * 1.685750354812596;
    carom_world *w = scene_world(9.81, T / 4 / n);
    const carom_vec2 pin = {0, 0};
    scene_anchor(w);
    carom_body_def d = carom_body_defaults();
    const carom_pose pose = {a, 0.5 * sin(a), -0.5 * cos(a)};
    carom_step_stats s;
    int b;
    d.inertia = 1.0 / 12;
    d.pose = pose;
    assert_int_equal(carom_world_add_body(w, &d, &b), CAROM_OK);
    assert_int_equal(carom_world_add_revolute(w, 0, b, pin, NULL), CAROM_OK);
    scene_run(w, n, &s);
    assert_true(s.joint_drift < 1e-13);
    const double error = fabs(q_of(w, b)[0]);
    carom_world_destroy(w);
    return error;
}

/* Three links released from a bent rest, or a disc rolling off a disc: the pose of the last body.
 */
static void swing(int kind, int order, int n, double *q)
{
    scene_order = order;
    carom_world *w = scene_world(9.81, (kind ? 0.3 : 0.8) / n);
    scene_order = 2;
    const int last = kind ? scene_roll_off(w) : scene_links(w, 3);
    scene_run(w, n, NULL);
    for (int k = 0; k < 3; k++) q[k] = q_of(w, last)[k];
    carom_world_destroy(w);
}

static double swing_error(int kind, int order, int n, const double *exact)
{
    double q[3];
    double error = 0;
    swing(kind, order, n, q);
    for (int k = 0; k < 3; k++) error = fmax(error, fabs(q[k] - exact[k]));
    return error;
}

/* log2 of the ratio of errors from n to 2 n steps is the order.  The reference has order 8 and is
 * good to 1e-12, rounding; the coarse steps keep all errors above that. */
static void orders_are_what_they_say(void **state)
{
    (void)state;
    static const int coarse[2][3] = {{60, 20, 10}, {20, 6, 0}};
    for (int kind = 0; kind < 2; kind++) {
        double exact[3];
        swing(kind, 8, 480, exact);
        for (int order = 2; order <= (kind ? 4 : 6); order += 2) {
            const int n = coarse[kind][order / 2 - 1];
            const double e = swing_error(kind, order, n, exact);
            const double ratio = log2(e / swing_error(kind, order, 2 * n, exact));
            if (fabs(ratio - order) > 0.5) {
                fail_msg("kind %d, order %d: error %g, observed order %g", kind, order, e, ratio);
            }
        }
        /* rounding of a hundred sub-steps; the smooth motion of the disc gets there at order 6 */
        if (kind) assert_at_most("order 6", swing_error(kind, 6, 20, exact), 1e-12);
        assert_at_most("order 8", swing_error(kind, 8, 40, exact), 1e-10);
    }
}

static void after_one_second(int (*build)(carom_world *), int order, int n, double *q)
{
    scene_order = order;
    carom_world *w = scene_world(9.81, 1.0 / n);
    scene_order = 2;
    const int b = build(w);
    scene_run(w, n, NULL);
    for (int k = 0; k < 3; k++) q[k] = q_of(w, b)[k];
    carom_world_destroy(w);
}

typedef struct change_case {
    const char *name;
    int (*build)(carom_world *);
    int order;
    int n; /* steps in the second, and twice as many */
} change_case;

static double error_after(const change_case *c, int n, const double *exact)
{
    double q[3];
    double error = 0;
    scene_events = 1;
    after_one_second(c->build, c->order, n, q);
    scene_events = 0;
    for (int k = 0; k < 3; k++) error = fmax(error, fabs(q[k] - exact[k]));
    return error;
}

/* Changes of mode are located, so the order holds through them: releases, begins of slip, impacts.
 * Reference: order 8 with 960 steps; all errors are well above 1e-12, its rounding.  Steps are as
 * large as the asymptotic order allows: several impacts of the block and of the pendulum fall into
 * one step of 1/60 s. */
static void orders_hold_through_changes(void **state)
{
    (void)state;
    static const change_case cases[] = {
        {"ladder", scene_ladder, 2, 30},          {"ladder", scene_ladder, 4, 30},
        {"ladder", scene_ladder, 6, 15},          {"disc off disc", scene_roll_off, 2, 60},
        {"disc off disc", scene_roll_off, 4, 60}, {"rocking block", scene_rocking, 2, 60},
        {"rocking block", scene_rocking, 4, 120}, {"landing", scene_landing, 2, 240},
        {"landing", scene_landing, 4, 120},
    };
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        const change_case *c = &cases[k];
        double exact[3];
        after_one_second(c->build, 8, 960, exact);
        const double coarse = error_after(c, c->n, exact);
        const double observed = log2(coarse / error_after(c, 2 * c->n, exact));
        if (fabs(observed - c->order) > 0.4) {
            fail_msg("%s, order %d: error %g, observed order %g", c->name, c->order, coarse,
                     observed);
        }
    }
    double exact[3];
    double q[3];
    for (int k = 0; k < 2; k++) {
        after_one_second(k ? scene_roll_off : scene_ladder, 8, 960, exact);
        after_one_second(k ? scene_roll_off : scene_ladder, 8, 30, q);
        for (int i = 0; i < 3; i++) assert_near(q[i], exact[i], 1e-11);
    }
}

/* The estimate is that of the order below: above the error, and going to zero with its order. */
static void estimate_is_above_the_error(void **state)
{
    (void)state;
    scene_order = 4;
    carom_world *w = scene_world(9.81, 1.0 / 60);
    scene_order = 2;
    const carom_vec2 pin = {0, 0};
    scene_anchor(w);
    const int b = scene_box(w, 1, 0.05, 0.5, (carom_pose){0.5 * acos(-1), 0.5, 0}, 0, 0);
    assert_int_equal(carom_world_add_revolute(w, 0, b, pin, NULL), CAROM_OK);
    const double energy = carom_world_energy(w);
    for (int k = 0; k < 60; k++) {
        carom_step_stats s;
        scene_run(w, 1, &s);
        assert_true(s.estimate > 0 && s.estimate < 1e-3);
        assert_near(s.energy, energy, 1e-6 * 9.81);
        assert_true(s.joint_drift < 1e-13);
    }
    carom_world_destroy(w);
}

static void pendulum_is_second_order(void **state)
{
    (void)state;
    const double ratio = pendulum_error(40) / pendulum_error(80);
    if (!(ratio > 3.6 && ratio < 4.4)) fail_msg("ratio %g is not in (3.6, 4.4)", ratio);
}

/* A disc meets the floor obliquely, without gravity. */
static void oblique_impact(void **state)
{
    (void)state;
    static const double mus[] = {0.6, 0.1};
    for (int k = 0; k < 2; k++) {
        const double r = 0.3;
        const double e = 0.5;
        const double vn = 1;
        carom_world *w = scene_world(0, 1.0 / 60);
        scene_floor(w, mus[k], e);
        const int b = scene_disc(w, 2, r, 0, 0.63, mus[k], e);
        scene_push(w, b, 0.2, 1.5, -vn);
        scene_run(w, 60, NULL);
        const double u = 1.5 + 0.2 * r;
        const double most = mus[k] * (1 + e) * vn;
        const double dv = u <= 3 * most ? -u / 3 : -most;
        const double *v = carom_world_v(w) + 3 * b;
        assert_near_case("omega", k, v[0], 0.2 + 2 * dv / r, 1e-12);
        assert_near_case("vx", k, v[1], 1.5 + dv, 1e-12);
        assert_near_case("vy", k, v[2], e * vn, 1e-12);
        assert_near_case("x", k, q_of(w, b)[1], 1.5 * 0.33 + (1.5 + dv) * 0.67, 1e-12);
        carom_world_destroy(w);
    }
}

/* --- a break: equal balls, elastic, without friction or gravity ---------------------------------
 */

enum { N_BALLS = 16 };

/* Position, then velocity. */
typedef struct ball {
    double x[2], v[2];
} ball;

static double dot(const double a[2], const double b[2])
{
    return a[0] * b[0] + a[1] * b[1];
}

/* Of two balls of diameter d that fly on: the smaller root of |x + t v| = d. */
static double time_to_meet(const ball *a, const ball *b, double d)
{
    const double x[2] = {b->x[0] - a->x[0], b->x[1] - a->x[1]};
    const double v[2] = {b->v[0] - a->v[0], b->v[1] - a->v[1]};
    const double gap = dot(x, x) - d * d;
    const double under = dot(x, v) * dot(x, v) - dot(v, v) * gap;
    return dot(x, v) < 0 && under > 0 ? fmax(gap, 0) / (sqrt(under) - dot(x, v)) : HUGE_VAL;
}

/* Equal masses exchange their velocities along the centers. */
static void exchange(ball *a, ball *b)
{
    const double x[2] = {b->x[0] - a->x[0], b->x[1] - a->x[1]};
    const double v[2] = {b->v[0] - a->v[0], b->v[1] - a->v[1]};
    const double share = dot(x, v) / dot(x, x);
    for (int i = 0; i < 2; i++) {
        a->v[i] += share * x[i];
        b->v[i] -= share * x[i];
    }
}

/* From impact to impact for `left`; the number of impacts. */
static int break_by_hand(ball *balls, double d, double left)
{
    for (int n = 0;; n++) {
        double first = left;
        int pair[2] = {0, 0};
        for (int a = 0; a < N_BALLS; a++) {
            for (int b = a + 1; b < N_BALLS; b++) {
                const double t = time_to_meet(&balls[a], &balls[b], d);
                if (t >= first) continue;
                first = t;
                pair[0] = a;
                pair[1] = b;
            }
        }
        for (int k = 0; k < N_BALLS; k++) {
            for (int i = 0; i < 2; i++) balls[k].x[i] += first * balls[k].v[i];
        }
        if (!(first < left)) return n;
        exchange(&balls[pair[0]], &balls[pair[1]]);
        left -= first;
    }
}

/* A ball meets a rack of fifteen, a millimeter apart: more than twenty impacts, most within one
 * step of 1/15 s, each located.  An impact widens what rounding left before it, 1e-17 m between
 * balls a millimeter apart, by up to 2 (way / diameter), 10 for those that fly out last: five rows,
 * 1e-12. */
static void billiard_break(void **state)
{
    (void)state;
    static const double radius = 0.028;
    static const double pitch = 0.057;
    ball balls[N_BALLS] = {{{-0.2, 0.004}, {5, 0}}};
    for (int row = 0, k = 1; row < 5; row++) {
        for (int i = 0; i <= row; i++, k++) {
            balls[k].x[0] = pitch * row * sqrt(0.75);
            balls[k].x[1] = pitch * (i - 0.5 * row);
        }
    }
    carom_world *w = scene_world(0, 1.0 / 15);
    for (int k = 0; k < N_BALLS; k++) {
        const int b = scene_disc(w, 0.2, radius, balls[k].x[0], balls[k].x[1], 0, 1);
        scene_push(w, b, 0, balls[k].v[0], balls[k].v[1]);
    }
    int events = 0;
    for (int k = 0; k < 3; k++) {
        carom_step_stats last;
        scene_run(w, 1, &last);
        assert_int_equal(last.status, CAROM_OK);
        events += last.n_events;
    }
    const int n = break_by_hand(balls, 2 * radius, 0.2);
    assert_true(n > 20);
    assert_int_equal(events, n);
    for (int k = 0; k < N_BALLS; k++) {
        for (int i = 0; i < 2; i++) {
            assert_near_case("place", k, q_of(w, k)[1 + i], balls[k].x[i], 1e-12);
        }
    }
    carom_world_destroy(w);
}

static void stack_stays(void **state)
{
    (void)state;
    carom_world *w = scene_world(9.81, 1.0 / 60);
    scene_floor(w, 0.5, 0);
    for (int k = 0; k < 8; k++) {
        const carom_pose pose = {0, 0, 0.5 + k};
        scene_box(w, k % 2 ? 1e4 : 1, 0.5, 0.5, pose, 0.5, 0);
    }
    scene_run(w, 300, NULL);
    for (int k = 0; k < 8; k++) assert_near_case("height", k, q_of(w, k + 1)[2], 0.5 + k, 1e-12);
    carom_world_destroy(w);
}

/* A rod comes down on one end and slides towards its center of mass: with r from the center to the
 * end, A = J W J' = [1/m + rx^2/I, -rx ry/I; ., 1/m + ry^2/I], an impact that sticks with
 * restitution e takes g = J v from (-1, u) to (e, 0) and gives (g1' A^-1 g1 - g0' A^-1 g0) / 2,
 * which for e = 1 is u P12 - u^2 P22 / 2 > 0, P = A^-1: Newton's law makes energy. */
static void impact_gives_no_energy(void **state)
{
    (void)state;
    static const carom_vec2 ends[2] = {{-0.3, 0.3}, {0.3, -0.3}};
    static const double u = -0.5;
    static const double inertia = 0.03;
    const double a11 = 1 + 0.09 / inertia;
    const double a12 = 0.09 / inertia;
    const double det = a11 * a11 - a12 * a12;
    assert_true(u * -a12 / det - 0.5 * u * u * a11 / det > 0.1);
    for (int k = 0; k < 3; k++) {
        scene_integrator = (carom_integrator)k;
        carom_world *w = scene_world(0, 1.0 / 60);
        scene_floor(w, 1, 1);
        carom_body_def d = carom_body_at(CAROM_DYNAMIC, 0, 0.3 + 0.5 / 60);
        const carom_shape rod = {.count = 2, .vertices = ends};
        d.shapes = &rod;
        d.n_shapes = 1;
        d.inertia = inertia;
        d.friction = d.restitution = 1;
        d.velocity[1] = u;
        d.velocity[2] = -1;
        assert_int_equal(carom_world_add_body(w, &d, NULL), CAROM_OK);
        const double before = carom_world_energy(w);
        carom_step_stats stats;
        assert_int_equal(carom_world_step(w, NULL, &stats), CAROM_RELAXED);
        /* none given; the restitution left is within 1/64 of the largest that gives none: at its
         * derivative d(energy)/de < 1.2 J that is 0.02 J */
        assert_at_most("energy", carom_world_energy(w), before * (1 + 1e-9));
        assert_at_most("energy lost", before - carom_world_energy(w), 0.02);
        const double *v = carom_world_v(w) + 3;
        assert_true(v[2] + 0.3 * v[0] > 0); /* the end rises */
        carom_world_destroy(w);
    }
    scene_integrator = CAROM_LOCATED;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bouncing_ball),
        cmocka_unit_test(elastic_energy),
        cmocka_unit_test(impact_gives_no_energy),
        cmocka_unit_test(orders_are_what_they_say),
        cmocka_unit_test(orders_hold_through_changes),
        cmocka_unit_test(estimate_is_above_the_error),
        cmocka_unit_test(slide_to_roll),
        cmocka_unit_test(sliding_box_turns_back),
        cmocka_unit_test(pendulum_is_second_order),
        cmocka_unit_test(oblique_impact),
        cmocka_unit_test(billiard_break),
        cmocka_unit_test(stack_stays),
    };
    scene_integrator = CAROM_LOCATED;
    return cmocka_run_group_tests(tests, NULL, NULL);
}
