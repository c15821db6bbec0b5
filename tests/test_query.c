/* Queries against their definitions: the signed distance decides what is inside, sampling what is
 * between, closed forms the times of impact. */
#include "carom/query.h"
#include "collide_ref.h"
#include "near.h"
#include "rng.h"

#include <float.h>
#include <string.h>

static const double PI = 3.14159265358979323846;

typedef struct body {
    carom_shape shape;
    carom_pose pose;
    carom_vec2 v[10];
} body;

static void random_body(rng *r, body *b)
{
    memset(b, 0, sizeof *b);
    b->shape.vertices = b->v;
    b->shape.count = 1 + rng_int(r, 10);
    b->shape.radius = b->shape.count == 1 || rng_int(r, 2) ? rng_uniform(r, 0.05, 0.5) : 0;
    const double start = rng_uniform(r, 0, 6);
    for (int i = 0; i < b->shape.count; i++) {
        const double t = start + 2 * PI * (i + rng_uniform(r, -0.3, 0.3)) / b->shape.count;
        b->v[i].x = 0.2 + cos(t);
        b->v[i].y = 0.6 * sin(t);
    }
    b->pose.angle = rng_uniform(r, -4, 4);
    b->pose.x = rng_uniform(r, -1.5, 1.5);
    b->pose.y = rng_uniform(r, -1.5, 1.5);
}

static carom_vec2 along(carom_vec2 o, double t, carom_vec2 d)
{
    const carom_vec2 p = {o.x + t * d.x, o.y + t * d.y};
    return p;
}

static double distance_at(const body *b, carom_vec2 p)
{
    return carom_point_distance(&b->shape, b->pose, p, NULL);
}

/* Long-double signed distance of a point from a rounded hull: outline of the core, signed by the
 * edges' sides. */
static long double exact_distance(const body *b, carom_vec2 p)
{
    static collide_ref_shape s, q;
    const carom_vec2 origin = {0, 0};
    const carom_shape dot = {0, 1, &origin};
    const carom_pose at = {0, p.x, p.y};
    collide_ref_place(&b->shape, b->pose, &dot, at, &s, &q);
    const long double d = collide_ref_outline(&s, q.x[0], q.y[0]);
    int inside = s.n > 2;
    for (int i = 0; i < s.n; i++) {
        const int k = (i + 1) % s.n;
        const long double side =
            (s.x[k] - s.x[i]) * (q.y[0] - s.y[i]) - (s.y[k] - s.y[i]) * (q.x[0] - s.x[i]);
        if (side < 0) inside = 0;
    }
    return (inside ? -d : d) - s.radius;
}

static void point_distances(void **state)
{
    (void)state;
    rng r = rng_from(1);
    for (int k = 0; k < 20000; k++) {
        body b;
        random_body(&r, &b);
        const carom_vec2 p = {rng_uniform(&r, -3, 3), rng_uniform(&r, -3, 3)};
        carom_vec2 n;
        const double d = carom_point_distance(&b.shape, b.pose, p, &n);
        assert_near_case("point", k, d, (double)exact_distance(&b, p), 40 * DBL_EPSILON);
        /* Back along the normal by the distance: the boundary. */
        if (d > 0) assert_near_case("foot", k, distance_at(&b, along(p, -d, n)), 0, 1e-13);
        assert_near(hypot(n.x, n.y), 1, 4 * DBL_EPSILON);
    }
}

static void closest_points(void **state)
{
    (void)state;
    rng r = rng_from(2);
    for (int k = 0; k < 5000; k++) {
        body a;
        body b;
        random_body(&r, &a);
        random_body(&r, &b);
        const carom_separation s = carom_shape_distance(&a.shape, a.pose, &b.shape, b.pose);
        const carom_vec2 pa = {a.pose.x + s.arm_a.x, a.pose.y + s.arm_a.y};
        const carom_vec2 pb = {b.pose.x + s.arm_b.x, b.pose.y + s.arm_b.y};
        assert_near(pb.x - pa.x, s.distance * s.normal.x, 1e-13);
        assert_near(pb.y - pa.y, s.distance * s.normal.y, 1e-13);
        if (s.distance + a.shape.radius + b.shape.radius < 0) continue;
        assert_near_case("on A", k, distance_at(&a, pa), 0, 1e-13);
        assert_near_case("on B", k, distance_at(&b, pb), 0, 1e-13);
        if (s.distance > 0) assert_near_case("far", k, distance_at(&a, pb), s.distance, 1e-13);
    }
}

/* Against the distance of the box as a hull, and on boxes that are none. */
static void box_overlaps(void **state)
{
    (void)state;
    rng r = rng_from(3);
    int n_inside = 0;
    for (int k = 0; k < 2000; k++) {
        body b;
        random_body(&r, &b);
        const double w = k % 5 == 0 ? 0 : rng_uniform(&r, 0, 2);
        const double h = k % 7 == 0 ? 0 : rng_uniform(&r, 0, 2);
        const carom_vec2 low = {rng_uniform(&r, -3, 2), rng_uniform(&r, -3, 2)};
        const carom_box box = {low, {low.x + w, low.y + h}};
        /* The nearest of a fine grid of points bounds the distance from above. */
        double least = HUGE_VAL;
        for (int i = 0; i <= 20; i++) {
            for (int j = 0; j <= 20; j++) {
                const carom_vec2 p = {low.x + w * i / 20, low.y + h * j / 20};
                least = fmin(least, distance_at(&b, p));
            }
        }
        const double cell = hypot(w, h) / 40;
        const int overlap = carom_box_overlap(&b.shape, b.pose, &box);
        if (least < -1e-9) assert_int_equal(overlap, 1);
        if (least > cell + 1e-9) assert_int_equal(overlap, 0);
        n_inside += overlap;
    }
    assert_true(n_inside > 300 && n_inside < 1700);
    body b;
    random_body(&r, &b);
    const carom_box all = {{-HUGE_VAL, -HUGE_VAL}, {HUGE_VAL, HUGE_VAL}};
    const carom_box right = {{b.pose.x, -HUGE_VAL}, {HUGE_VAL, HUGE_VAL}};
    const carom_box none = {{1, 1}, {-1, -1}};
    const carom_box nan = {{-9, NAN}, {9, 9}};
    const carom_box away = {{50, -HUGE_VAL}, {HUGE_VAL, HUGE_VAL}};
    assert_int_equal(carom_box_overlap(&b.shape, b.pose, &all), 1);
    assert_int_equal(carom_box_overlap(&b.shape, b.pose, &right), 1);
    assert_int_equal(carom_box_overlap(&b.shape, b.pose, &none), 0);
    assert_int_equal(carom_box_overlap(&b.shape, b.pose, &nan), 0);
    assert_int_equal(carom_box_overlap(&b.shape, b.pose, &away), 0);
}

/* Ends of the interval on the boundary, inside between them, outside beyond; a miss stays outside.
 */
static void rays(void **state)
{
    (void)state;
    rng r = rng_from(4);
    int n_hits = 0;
    int n_inside = 0;
    for (int k = 0; k < 20000; k++) {
        body b;
        carom_ray_hit h;
        random_body(&r, &b);
        const carom_vec2 o = {rng_uniform(&r, -3, 3), rng_uniform(&r, -3, 3)};
        const carom_vec2 d = {rng_uniform(&r, -4, 4), rng_uniform(&r, -4, 4)};
        if (!carom_ray_cast(&b.shape, b.pose, o, d, &h)) {
            for (int i = 0; i <= 50; i++) {
                assert_true(distance_at(&b, along(o, i / 50.0, d)) > -1e-13);
            }
            continue;
        }
        n_hits++;
        assert_true(h.enter >= 0 && h.enter <= h.leave && h.leave <= 1);
        assert_true(distance_at(&b, along(o, 0.5 * (h.enter + h.leave), d)) < 1e-14);
        if (h.leave < 1)
            assert_near_case("exit", k, distance_at(&b, along(o, h.leave, d)), 0, 1e-13);
        if (h.enter > 0) {
            carom_vec2 n;
            const carom_vec2 p = along(o, h.enter, d);
            assert_near_case("entry", k, distance_at(&b, p), 0, 1e-13);
            assert_true(h.normal.x * d.x + h.normal.y * d.y <= 0);
            /* A little out along the normal the nearest point is the entry. */
            const carom_vec2 out = along(p, 1e-3, h.normal);
            assert_near_case("out", k, carom_point_distance(&b.shape, b.pose, out, &n), 1e-3,
                             1e-12);
            for (int i = 0; i < 10; i++) {
                assert_true(distance_at(&b, along(o, h.enter * i / 10, d)) > -1e-13);
            }
        } else {
            n_inside++;
            assert_true(h.normal.x == 0 && h.normal.y == 0);
            assert_true(distance_at(&b, o) <= 1e-14);
        }
    }
    assert_true(n_hits > 2000 && n_inside > 500);
}

typedef struct ray_case {
    const char *name;
    carom_shape shape;
    carom_vec2 o, d;
    int hit;
    double enter, leave;
    carom_vec2 n;
} ray_case;

static void named_rays(void **state)
{
    (void)state;
    const carom_vec2 origin[1] = {{0, 0}};
    const carom_vec2 level[2] = {{-1, 0}, {1, 0}};
    const carom_vec2 box[4] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
    const carom_shape disc = {1, 1, origin};
    const carom_shape segment = {0, 2, level};
    const carom_shape capsule = {0.5, 2, level};
    const carom_shape hull = {0, 4, box};
    const carom_shape rounded = {1, 4, box};
    const ray_case cases[] = {
        {"disc, through the center", disc, {-4, 0}, {8, 0}, 1, 0.375, 0.625, {-1, 0}},
        {"disc, too short", disc, {-4, 0}, {2, 0}, 0, 0, 0, {0, 0}},
        {"disc, away from it", disc, {-4, 0}, {-2, 0}, 0, 0, 0, {0, 0}},
        {"disc, past it", disc, {-4, 2}, {8, 0}, 0, 0, 0, {0, 0}},
        {"disc, from inside", disc, {0, 0}, {0, 2}, 1, 0, 0.5, {0, 0}},
        {"disc, inside", disc, {0, 0}, {0, 0.5}, 1, 0, 1, {0, 0}},
        {"segment, across", segment, {0.3, 2}, {0, -4}, 1, 0.5, 0.5, {0, 1}},
        {"segment, beyond its end", segment, {1.1, 2}, {0, -4}, 0, 0, 0, {0, 0}},
        {"segment, along it", segment, {-3, 0}, {8, 0}, 1, 0.25, 0.5, {-1, 0}},
        {"capsule, on its cap", capsule, {-3, 0}, {8, 0}, 1, 0.1875, 0.5625, {-1, 0}},
        {"box", hull, {-3, 0.5}, {4, 0}, 1, 0.5, 1, {-1, 0}},
        {"rounded box, face", rounded, {0.5, 4}, {0, -8}, 1, 0.25, 0.75, {0, 1}},
        /* The corner's arc around (1, 1), hit at 45 degrees. */
        {"rounded box, corner",
         rounded,
         {5, 5},
         {-4, -4},
         1,
         1 - sqrt(0.125) / 2,
         1,
         {sqrt(0.5), sqrt(0.5)}},
        {"no length, outside", hull, {2, 0}, {0, 0}, 0, 0, 0, {0, 0}},
        {"no length, inside", hull, {0.5, 0}, {0, 0}, 1, 0, 1, {0, 0}},
    };
    const carom_pose q = {0, 0, 0};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        const ray_case *c = &cases[k];
        carom_ray_hit h = {9, 9, {9, 9}};
        const int hit = carom_ray_cast(&c->shape, q, c->o, c->d, &h);
        if (hit != c->hit) fail_msg("%s: hit %d", c->name, hit);
        if (!hit) continue;
        assert_near_case(c->name, 0, h.enter, c->enter, 4 * DBL_EPSILON);
        assert_near_case(c->name, 1, h.leave, c->leave, 4 * DBL_EPSILON);
        assert_near_case(c->name, 2, h.normal.x, c->n.x, 8 * DBL_EPSILON);
        assert_near_case(c->name, 3, h.normal.y, c->n.y, 8 * DBL_EPSILON);
    }
}

static carom_pose pose_at(carom_sweep m, double t)
{
    const carom_pose q = {m.from.angle + t * (m.to.angle - m.from.angle),
                          m.from.x + t * (m.to.x - m.from.x), m.from.y + t * (m.to.y - m.from.y)};
    return q;
}

static double distance_during(const body *a, carom_sweep ma, const body *b, carom_sweep mb,
                              double t)
{
    return carom_shape_distance(&a->shape, pose_at(ma, t), &b->shape, pose_at(mb, t)).distance;
}

/* At the hit the distance is the target, and before it nothing is closer. */
static void casts(void **state)
{
    (void)state;
    rng r = rng_from(5);
    int n_hits = 0;
    for (int k = 0; k < 2000; k++) {
        body a;
        body b;
        carom_cast_hit h;
        random_body(&r, &a);
        random_body(&r, &b);
        carom_sweep ma = {a.pose, a.pose};
        carom_sweep mb = {b.pose, b.pose};
        mb.from.x -= 6;
        mb.to.x += rng_uniform(&r, -2, 4);
        mb.to.y += rng_uniform(&r, -2, 2);
        ma.to.angle += rng_uniform(&r, -2, 2);
        mb.to.angle += rng_uniform(&r, -2, 2);
        const double target = k % 3 ? 0 : 0.1;
        assert_int_equal(carom_shape_cast(&a.shape, ma, &b.shape, mb, target, &h), CAROM_OK);
        n_hits += h.hit;
        assert_true(h.t >= 0 && h.t <= 1 && (h.hit || h.t == 1));
        /* Reach below 3 each; a distance's own rounding 1e-14. */
        if (h.hit && h.t > 0) {
            assert_near_case("at the hit", k, distance_during(&a, ma, &b, mb, h.t), target, 7e-12);
        }
        for (int i = 0; i < 100; i++) {
            assert_true(distance_during(&a, ma, &b, mb, h.t * i / 100) > target - 1e-13);
        }
    }
    assert_true(n_hits > 500 && n_hits < 1900);
}

static void named_casts(void **state)
{
    (void)state;
    const carom_vec2 origin[1] = {{0, 0}};
    const carom_vec2 box[4] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
    const carom_vec2 rod[2] = {{0, 0}, {4, 0}};
    const carom_shape disc = {1, 1, origin};
    const carom_shape hull = {0, 4, box};
    const carom_shape bar = {0, 2, rod};
    const carom_sweep still = {{0, 0, 0}, {0, 0, 0}};
    const carom_sweep right = {{0, -8, 0}, {0, 8, 0}};
    const carom_sweep grazing = {{0, -8, 1.5}, {0, 8, 1.5}};
    const carom_sweep past = {{0, -8, 2.5}, {0, 8, 2.5}};
    const carom_sweep inside = {{0, 0.5, 0}, {0, 9, 0}};
    const carom_sweep fall = {{0, 0.5, 9}, {0, 0.5, 1}};
    const carom_sweep swing = {{0, 0, -4}, {PI / 2, 0, -4}};
    carom_cast_hit h;
    /* Two discs of radius 1: |x| = 2 on the way to the middle. */
    assert_int_equal(carom_shape_cast(&disc, still, &disc, right, 0, &h), CAROM_OK);
    assert_true(h.hit);
    assert_near(h.t, 6 / 16.0, 1e-12);
    assert_near(h.at.normal.x, -1, 4 * DBL_EPSILON);
    /* Off center by 1.5: (8 - sqrt(4 - 2.25)) / 16. */
    assert_int_equal(carom_shape_cast(&disc, still, &disc, grazing, 0, &h), CAROM_OK);
    assert_true(h.hit);
    assert_near(h.t, (8 - sqrt(1.75)) / 16, 1e-12);
    assert_int_equal(carom_shape_cast(&disc, still, &disc, past, 0, &h), CAROM_OK);
    assert_true(!h.hit && h.t == 1);
    assert_int_equal(carom_shape_cast(&disc, still, &disc, past, 0.5, &h), CAROM_OK);
    assert_near(h.t, 0.5, 1e-5); /* touches at the closest approach: sqrt of the tolerance */
    assert_int_equal(carom_shape_cast(&disc, still, &disc, inside, 0, &h), CAROM_OK);
    assert_true(h.hit && h.t == 0 && h.at.distance == -1.5);
    /* A box onto a box: from 9 down to 2. */
    assert_int_equal(carom_shape_cast(&hull, still, &hull, fall, 0, &h), CAROM_OK);
    assert_near(h.t, 7 / 8.0, 1e-12);
    assert_int_equal(h.iterations <= 3, 1);
    /* A bar of length 4 swings up from (0, -4) to the vertical: its line meets the disc of radius 1
     * around the origin when 4 cos(angle) = 1. */
    assert_int_equal(carom_shape_cast(&disc, still, &bar, swing, 0, &h), CAROM_OK);
    assert_true(h.hit);
    assert_near(h.t, acos(0.25) / (PI / 2), 1e-11);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(point_distances), cmocka_unit_test(closest_points),
        cmocka_unit_test(box_overlaps),    cmocka_unit_test(rays),
        cmocka_unit_test(named_rays),      cmocka_unit_test(casts),
        cmocka_unit_test(named_casts),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
