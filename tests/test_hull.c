/* carom_hull_from_points: against its definition, and on degenerate points. */
#include "carom/shape.h"
#include "near.h"
#include "rng.h"

#include <stdlib.h>

enum { MAX_POINTS = 3000 };

static carom_vec2 points[MAX_POINTS];
static carom_vec2 v[MAX_POINTS];
static int hull[MAX_POINTS];

static double cross(carom_vec2 a, carom_vec2 b, carom_vec2 c)
{
    return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

/* The hull is a valid shape of some of the points, and no point is outside by more than tol. */
static void check_hull(const char *name, int n, double tol)
{
    int count = -1;
    assert_int_equal(carom_hull_from_points(n, points, hull, &count), CAROM_OK);
    if (count < 3) fail_msg("%s: %d vertices", name, count);
    for (int i = 0; i < count; i++) {
        assert_true(hull[i] >= 0 && hull[i] < n);
        v[i] = points[hull[i]];
    }
    const carom_shape shape = {0, count, v};
    carom_shape_error e;
    if (carom_shape_check(&shape, &e)) {
        fail_msg("%s: fault %d at vertex %d of %d", name, (int)e.fault, e.vertex, count);
    }
    for (int i = 0; i < count; i++) {
        const carom_vec2 a = v[i];
        const carom_vec2 b = v[(i + 1) % count];
        const double length = hypot(b.x - a.x, b.y - a.y);
        for (int k = 0; k < n; k++) {
            if (!(cross(a, b, points[k]) >= -tol * length)) {
                fail_msg("%s: point %d is outside edge %d by %g", name, k, i,
                         -cross(a, b, points[k]) / length);
            }
        }
    }
    for (int k = 1; k < count; k++) {
        assert_true(v[k].x > v[0].x || (v[k].x == v[0].x && v[k].y > v[0].y));
    }
}

static void random_clouds(void **state)
{
    (void)state;
    rng r = rng_from(1);
    for (int k = 0; k < 400; k++) {
        const int n = 3 + rng_int(&r, 60);
        for (int i = 0; i < n; i++) {
            points[i].x = rng_uniform(&r, -1, 1);
            points[i].y = rng_uniform(&r, -1, 1) * (k % 3 == 0 ? 1e-6 : 1);
        }
        /* Left out: points within 4e-12 of the extent of 2, each time one is. */
        check_hull("cloud", n, 1e-10);
    }
}

static void on_a_circle(void **state)
{
    (void)state;
    for (int i = 0; i < MAX_POINTS; i++) {
        const double t = 6.283185307179586 * ((i * 1009) % MAX_POINTS) / MAX_POINTS;
        points[i].x = 3 + cos(t);
        points[i].y = sin(t);
    }
    check_hull("circle", MAX_POINTS, 1e-11);
    int count;
    assert_int_equal(carom_hull_from_points(MAX_POINTS, points, hull, &count), CAROM_OK);
    assert_int_equal(count, MAX_POINTS);
}

/* Integers: many duplicates, many collinear points, all exact. */
static void on_a_lattice(void **state)
{
    (void)state;
    rng r = rng_from(2);
    for (int k = 0; k < 400; k++) {
        const int n = 20 + rng_int(&r, 60);
        for (int i = 0; i < n; i++) {
            points[i].x = rng_int(&r, 6);
            points[i].y = rng_int(&r, 6);
        }
        check_hull("lattice", n, 0);
    }
}

static void square_with_everything(void **state)
{
    (void)state;
    const carom_vec2 given[] = {{1, 1}, {0, 0}, {2, 0}, {1, 0}, {2, 2}, {0, 2},
                                {2, 1}, {0, 0}, {1, 2}, {0, 1}, {2, 2}};
    const int n = (int)(sizeof given / sizeof *given);
    const carom_vec2 expected[4] = {{0, 0}, {2, 0}, {2, 2}, {0, 2}};
    int count;
    assert_int_equal(carom_hull_from_points(n, given, hull, &count), CAROM_OK);
    assert_int_equal(count, 4);
    for (int i = 0; i < 4; i++) {
        assert_true(given[hull[i]].x == expected[i].x && given[hull[i]].y == expected[i].y);
    }
}

typedef struct flat_case {
    const char *name;
    int n;
    int count;
    carom_vec2 p[6];
} flat_case;

static void flat_sets(void **state)
{
    (void)state;
    const flat_case cases[] = {
        {"one point", 1, 1, {{3, 4}}},
        {"one place", 3, 1, {{3, 4}, {3, 4}, {3, 4}}},
        {"two points", 2, 2, {{3, 4}, {1, 2}}},
        {"vertical", 4, 2, {{1, 4}, {1, 0}, {1, 2}, {1, 4}}},
        {"slanted", 5, 2, {{3, 3}, {1, 1}, {2, 2}, {0, 0}, {3, 3}}},
        {"nearly flat", 4, 2, {{0, 0}, {1, 1e-12}, {2, 0}, {1, -1e-12}}},
        {"nearly flat, far", 3, 2, {{1e8, 0}, {1e8 + 2, 0}, {1e8 + 1, 1e-12}}},
    };
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        const flat_case *c = &cases[k];
        int count = -1;
        assert_int_equal(carom_hull_from_points(c->n, c->p, hull, &count), CAROM_OK);
        if (count != c->count) fail_msg("%s: %d vertices, expected %d", c->name, count, c->count);
        if (count < 2) continue;
        /* The two farthest apart. */
        const carom_vec2 a = c->p[hull[0]];
        const carom_vec2 b = c->p[hull[1]];
        for (int i = 0; i < c->n; i++) {
            for (int j = 0; j < i; j++) {
                assert_true(hypot(c->p[i].x - c->p[j].x, c->p[i].y - c->p[j].y) <=
                            hypot(a.x - b.x, a.y - b.y));
            }
        }
    }
}

static void bad_arguments(void **state)
{
    (void)state;
    const carom_vec2 nan[3] = {{0, 0}, {NAN, 0}, {0, 1}};
    const carom_vec2 far[3] = {{0, 0}, {1e41, 0}, {0, 1}};
    int count = 77;
    assert_int_equal(carom_hull_from_points(0, nan, hull, &count), CAROM_E_ARGUMENT);
    assert_int_equal(carom_hull_from_points(3, NULL, hull, &count), CAROM_E_ARGUMENT);
    assert_int_equal(carom_hull_from_points(3, nan, hull, &count), CAROM_E_ARGUMENT);
    assert_int_equal(carom_hull_from_points(3, far, hull, &count), CAROM_E_ARGUMENT);
    assert_int_equal(count, 77);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(random_clouds), cmocka_unit_test(on_a_circle),
        cmocka_unit_test(on_a_lattice),  cmocka_unit_test(square_with_everything),
        cmocka_unit_test(flat_sets),     cmocka_unit_test(bad_arguments),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
