/* Contact events against closed forms: when a ball hits, how fast, with which impulse; what begins
 * and ends; in which order. */
#include "alloc_fail.h"
#include "carom/events.h"
#include "near.h"
#include "scenes.h"

#include <stdlib.h>
#include <string.h>

/* Rounding of a second of motion at some m/s, with room for the root of a gap: 1e-13 L. */
static const double TOL = 1e-10;

static carom_world *world_of(carom_integrator integrator, double g, double dt)
{
    scene_integrator = integrator;
    carom_world *w = scene_world(g, dt);
    assert_int_equal(carom_world_record_events(w, 1), CAROM_OK);
    return w;
}

/* A ball of 2 kg falls 1 m on the floor, e = 0.5: hits at sqrt(2 h / g), then at e^k of the speed.
 */
static void bounces(void **state)
{
    (void)state;
    const double dt = 1.0 / 60;
    const double fall = sqrt(2 * 1.0 / 9.81);
    carom_world *w = world_of(CAROM_LOCATED, 9.81, dt);
    scene_floor(w, 0, 0.5);
    const int ball = scene_disc(w, 2, 0.5, 0, 1.5, 0, 0.5);
    int hits = 0;
    double expected = fall;
    double speed = 9.81 * fall;
    for (int k = 0; k < 90; k++) {
        scene_run(w, 1, NULL);
        int n;
        const carom_contact_event *e = carom_world_events(w, &n);
        for (int i = 0; i < n; i++) {
            if (e[i].kind != CAROM_CONTACT_IMPACT || hits == 3) continue;
            assert_near_case("time", hits, k * dt + e[i].time, expected, TOL);
            assert_near_case("approach", hits, e[i].approach, speed, TOL);
            assert_near_case("ln", hits, e[i].ln, 2 * speed * 1.5, TOL); /* m v (1 + e) */
            assert_near_case("lt", hits, e[i].lt, 0, TOL);
            assert_near_case("point", hits, e[i].point.y, 0, TOL);
            assert_near_case("normal", hits, fabs(e[i].normal.y), 1, TOL);
            assert_int_equal(e[i].body_a + e[i].body_b, ball);
            speed *= 0.5;
            expected += 2 * speed / 9.81;
            hits++;
        }
    }
    assert_int_equal(hits, 3);
    carom_world_destroy(w);
}

/* A plastic fall on the floor with every integrator.  Euler sees the speed of a step early; `fixed`
 * takes the impact in two: it brakes to gap / h, then stops. */
static void every_integrator_hits(void **state)
{
    (void)state;
    const double m = 2;
    const double v = sqrt(2 * 9.81);
    const double gh = 9.81 / 60;
    static const int most[3] = {1, 1, 2};
    const double limit[3] = {gh, TOL, 2 * gh};
    for (int i = CAROM_EULER; i <= CAROM_FIXED; i++) {
        carom_world *w = world_of((carom_integrator)i, 9.81, 1.0 / 60);
        scene_floor(w, 0.5, 0);
        scene_disc(w, m, 0.5, 0, 1.5, 0.5, 0);
        int hits = 0;
        int begins = 0;
        double given = 0;
        for (int k = 0; k < 40; k++) {
            scene_run(w, 1, NULL);
            int n;
            const carom_contact_event *e = carom_world_events(w, &n);
            for (int x = 0; x < n; x++) {
                begins += e[x].kind == CAROM_CONTACT_BEGIN;
                assert_int_not_equal(e[x].kind, CAROM_CONTACT_END);
                if (e[x].kind != CAROM_CONTACT_IMPACT) continue;
                if (!hits) assert_near_case("approach", i, e[x].approach, v, limit[i]);
                given += e[x].ln;
                hits++;
            }
        }
        assert_near_case("impulse", i, given, m * v, m * limit[i]);
        assert_true(hits >= 1 && hits <= most[i]);
        assert_int_equal(begins, 1);
        carom_world_destroy(w);
    }
}

/* A stack begins to touch in its first step, is silent while it rests, and one pair ends when its
 * top box is lifted away. */
static void begins_and_ends(void **state)
{
    (void)state;
    for (int i = CAROM_EULER; i <= CAROM_FIXED; i++) {
        carom_world *w = world_of((carom_integrator)i, 9.81, 1.0 / 60);
        scene_floor(w, 0.5, 0);
        for (int k = 0; k < 3; k++) {
            const carom_pose at = {0, 0, 0.5 + k};
            scene_box(w, 1, 0.5, 0.5, at, 0.5, 0);
        }
        int n;
        scene_run(w, 1, NULL);
        const carom_contact_event *e = carom_world_events(w, &n);
        assert_int_equal(n, 3);
        for (int k = 0; k < 3; k++) {
            assert_int_equal(e[k].kind, CAROM_CONTACT_BEGIN);
            assert_int_equal(e[k].shape_a, k);
            assert_int_equal(e[k].shape_b, k + 1);
            assert_near(e[k].time, 1.0 / 60, 0);
        }
        for (int k = 0; k < 20; k++) {
            scene_run(w, 1, NULL);
            carom_world_events(w, &n);
            assert_int_equal(n, 0);
        }
        double force[12] = {0};
        force[11] = 3 * 9.81;
        int ends = 0;
        for (int k = 0; k < 20; k++) {
            assert_true(carom_world_step(w, force, NULL) >= 0);
            e = carom_world_events(w, &n);
            for (int m = 0; m < n; m++) {
                assert_int_equal(e[m].kind, CAROM_CONTACT_END);
                assert_int_equal(e[m].shape_a, 2);
                assert_int_equal(e[m].shape_b, 3);
                ends++;
            }
        }
        assert_int_equal(ends, 1);
        carom_world_destroy(w);
    }
}

/* Equal balls in a row, e = 1: the impulse m v passes through; momentum of the last is the sum of
 * what its contact gave. */
static void impulses_are_momenta(void **state)
{
    (void)state;
    carom_world *w = world_of(CAROM_LOCATED, 0, 0.01);
    int last = 0;
    for (int k = 0; k < 3; k++) last = scene_disc(w, 2, 0.5, 1.1 * k, 0, 0, 1);
    scene_push(w, 0, 0, 3, 0);
    double given = 0;
    for (int k = 0; k < 30; k++) {
        scene_run(w, 1, NULL);
        int n;
        const carom_contact_event *e = carom_world_events(w, &n);
        for (int i = 0; i < n; i++) {
            if (e[i].kind == CAROM_CONTACT_IMPACT && e[i].body_b == last) given += e[i].ln;
        }
    }
    assert_near(given, 6, TOL);
    assert_near(given, 2 * carom_world_v(w)[3 * last + 1], TOL);
    carom_world_destroy(w);
}

static int busy(const carom_allocator *a, carom_world **out, int record)
{
    carom_world_settings set = carom_world_defaults();
    carom_body_def d = carom_body_at(CAROM_STATIC, 0, -1);
    *out = NULL;
    carom_status e = carom_world_create(&set, a, out);
    if (!e) e = carom_world_add_box(*out, &d, 40, 2, 0, NULL);
    for (int k = 0; !e && k < 6; k++) {
        d = carom_body_at(CAROM_DYNAMIC, 1.5 * k, 0.6 + 0.3 * (k % 3));
        d.restitution = 0.4;
        e = carom_world_add_circle(*out, &d, 0.5, 1, NULL);
    }
    return e ? (int)e : (int)carom_world_record_events(*out, record);
}

/* Within an island times ascend; begins and ends follow, by pair; the same in every run. */
static void order_is_fixed(void **state)
{
    (void)state;
    carom_world *w[2];
    int total = 0;
    for (int i = 0; i < 2; i++) assert_int_equal(busy(NULL, &w[i], 1), CAROM_OK);
    for (int k = 0; k < 120; k++) {
        int n[2];
        const carom_contact_event *e[2];
        for (int i = 0; i < 2; i++) {
            scene_run(w[i], 1, NULL);
            e[i] = carom_world_events(w[i], &n[i]);
        }
        assert_int_equal(n[0], n[1]);
        for (int m = 0; m < n[0]; m++) {
            assert_int_equal(e[0][m].kind, e[1][m].kind);
            assert_int_equal(e[0][m].shape_a, e[1][m].shape_a);
            assert_int_equal(e[0][m].shape_b, e[1][m].shape_b);
            assert_near(e[0][m].time, e[1][m].time, 0);
            assert_near(e[0][m].ln, e[1][m].ln, 0);
            assert_true(e[0][m].time >= 0 && e[0][m].time <= 1.0 / 60);
            if (!m) continue;
            const carom_contact_event *x = &e[0][m - 1];
            const carom_contact_event *y = &e[0][m];
            assert_true((x->kind == CAROM_CONTACT_IMPACT) >= (y->kind == CAROM_CONTACT_IMPACT));
            if (y->kind == CAROM_CONTACT_IMPACT || x->kind == CAROM_CONTACT_IMPACT) continue;
            assert_true(x->shape_a < y->shape_a ||
                        (x->shape_a == y->shape_a && x->shape_b < y->shape_b));
        }
        total += n[0];
    }
    assert_true(total > 20); /* six balls fall and bounce at least once each, then begin to rest */
    for (int i = 0; i < 2; i++) carom_world_destroy(w[i]);
}

/* Recording changes no bit of the motion, and no recording holds no memory. */
static void costs_nothing(void **state)
{
    (void)state;
    carom_world *w[2];
    for (int i = 0; i < 2; i++) assert_int_equal(busy(NULL, &w[i], i), CAROM_OK);
    for (int i = 0; i < 2; i++) scene_run(w[i], 90, NULL);
    const size_t bytes = 21 * sizeof(double);
    assert_memory_equal(carom_world_q(w[0]), carom_world_q(w[1]), bytes);
    int n;
    assert_null(carom_world_events(w[0], &n));
    assert_int_equal(n, 0);
    assert_true(carom_world_measure(w[0]).bytes < carom_world_measure(w[1]).bytes);
    carom_step_stats s;
    for (int k = 0; k < 30; k++) {
        scene_run(w[1], 1, &s);
        assert_int_equal(s.allocations, 0);
    }
    assert_int_equal(carom_world_record_events(w[1], 0), CAROM_OK);
    scene_run(w[1], 1, NULL);
    carom_world_events(w[1], &n);
    assert_int_equal(n, 0);
    assert_int_equal(carom_world_record_events(NULL, 1), CAROM_E_ARGUMENT);
    for (int i = 0; i < 2; i++) carom_world_destroy(w[i]);
}

/* A step that finds no memory for its events has none, and did not happen. */
static void every_allocation_may_fail(void **state)
{
    (void)state;
    int k = 0;
    for (;; k++) {
        alloc_fail f = alloc_fail_at(k);
        const carom_allocator a = alloc_fail_allocator(&f);
        carom_world *w;
        int e = busy(&a, &w, 1);
        for (int i = 0; !e && i < 60; i++) {
            e = carom_world_step(w, NULL, NULL);
            if (e >= 0) {
                e = 0;
                continue;
            }
            int n;
            carom_world_events(w, &n);
            assert_int_equal(n, 0);
            assert_int_equal(carom_world_steps(w), i);
        }
        carom_world_destroy(w);
        assert_int_equal(f.live, 0);
        assert_int_equal(f.n_bad_sizes, 0);
        if (!e) break;
        assert_int_equal(e, CAROM_E_MEMORY);
    }
    assert_true(k > 10);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bounces),
        cmocka_unit_test(every_integrator_hits),
        cmocka_unit_test(begins_and_ends),
        cmocka_unit_test(impulses_are_momenta),
        cmocka_unit_test(order_is_fixed),
        cmocka_unit_test(costs_nothing),
        cmocka_unit_test(every_allocation_may_fail),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
