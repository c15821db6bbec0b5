/* Symmetries of carom_collide: A and B, common rigid motion, scale, numbering of vertices,
 * rounding, margin; continuity along paths. */
#include "carom/collide.h"
#include "near.h"
#include "rng.h"

#include <float.h>
#include <string.h>

static const double PI = 3.14159265358979323846;

typedef struct body {
    carom_shape shape;
    carom_pose pose;
    carom_vec2 v[12];
} body;

static void random_body(rng *r, body *b)
{
    memset(b, 0, sizeof *b);
    b->shape.vertices = b->v;
    b->shape.count = 1 + rng_int(r, 12);
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

static carom_vec2 turned(carom_vec2 v, double angle)
{
    const carom_vec2 u = {cos(angle) * v.x - sin(angle) * v.y, sin(angle) * v.x + cos(angle) * v.y};
    return u;
}

static double apart(carom_vec2 a, carom_vec2 b)
{
    return hypot(a.x - b.x, a.y - b.y);
}

/* How the first manifold, turned and scaled, differs from the second; HUGE_VAL for other counts. */
static double difference(const carom_manifold *a, const carom_manifold *b, double angle,
                         double scale)
{
    if (a->count != b->count) return HUGE_VAL;
    double d = fabs(a->distance - b->distance / scale);
    for (int i = 0; i < a->count; i++) {
        const carom_contact_point *p = &a->points[i];
        const carom_contact_point *q = &b->points[i];
        const carom_vec2 qa = {q->arm_a.x / scale, q->arm_a.y / scale};
        const carom_vec2 qb = {q->arm_b.x / scale, q->arm_b.y / scale};
        d = fmax(d, apart(turned(p->arm_a, angle), qa));
        d = fmax(d, apart(turned(p->arm_b, angle), qb));
        d = fmax(d, fabs(p->gap - q->gap / scale));
    }
    return d;
}

/* Rounding is amplified by 1 / |edge| and by the slope of a clip (the incident edge is the one most
 * opposite: above 45 degrees it would not be chosen but for sharp corners); by 1 / distance at
 * vertices.  Pairs where that is large are left out. */
static int is_tame(const carom_manifold *m, double radii)
{
    if (m->ambiguous) return 0;
    if (m->points[0].recipe.kernel == CAROM_POINT_POINT) return m->distance + radii > 0.01;
    for (int i = 0; i < m->count; i++) {
        if (fabs(m->points[i].gap - m->distance) > 1) return 0;
    }
    return 1;
}

static carom_manifold mirrored(carom_manifold m)
{
    for (int i = 0; i < m.count; i++) {
        const carom_vec2 arm = m.points[i].arm_a;
        m.points[i].arm_a = m.points[i].arm_b;
        m.points[i].arm_b = arm;
    }
    m.normal.x = -m.normal.x;
    m.normal.y = -m.normal.y;
    return m;
}

typedef carom_manifold (*variant)(rng *r, body *a, body *b, double *angle, double *scale);

/* Exchange of A and B. */
static carom_manifold exchanged(rng *r, body *a, body *b, double *angle, double *scale)
{
    (void)r;
    (void)angle;
    (void)scale;
    return mirrored(carom_collide(&b->shape, b->pose, &a->shape, a->pose, HUGE_VAL));
}

/* A common rigid motion; positions within 8 lose a rounding or two. */
static carom_manifold moved(rng *r, body *a, body *b, double *angle, double *scale)
{
    (void)scale;
    *angle = rng_uniform(r, -3, 3);
    const carom_vec2 by = {rng_uniform(r, -4, 4), rng_uniform(r, -4, 4)};
    body *both[2] = {a, b};
    for (int k = 0; k < 2; k++) {
        const carom_vec2 p = turned((carom_vec2){both[k]->pose.x, both[k]->pose.y}, *angle);
        both[k]->pose.angle += *angle;
        both[k]->pose.x = p.x + by.x;
        both[k]->pose.y = p.y + by.y;
    }
    return carom_collide(&a->shape, a->pose, &b->shape, b->pose, HUGE_VAL);
}

/* All lengths times a power of two, from 2^-27 to 2^27. */
static carom_manifold scaled(rng *r, body *a, body *b, double *angle, double *scale)
{
    (void)angle;
    *scale = ldexp(1, rng_int(r, 55) - 27);
    body *both[2] = {a, b};
    for (int k = 0; k < 2; k++) {
        both[k]->shape.radius *= *scale;
        both[k]->pose.x *= *scale;
        both[k]->pose.y *= *scale;
        for (int i = 0; i < both[k]->shape.count; i++) {
            both[k]->v[i].x *= *scale;
            both[k]->v[i].y *= *scale;
        }
    }
    return carom_collide(&a->shape, a->pose, &b->shape, b->pose, HUGE_VAL);
}

/* Vertices numbered from another one on. */
static carom_manifold renumbered(rng *r, body *a, body *b, double *angle, double *scale)
{
    (void)angle;
    (void)scale;
    body *both[2] = {a, b};
    for (int k = 0; k < 2; k++) {
        carom_vec2 v[12];
        const int n = both[k]->shape.count;
        const int shift = rng_int(r, n);
        for (int i = 0; i < n; i++) v[i] = both[k]->v[(i + shift) % n];
        memcpy(both[k]->v, v, sizeof v);
    }
    return carom_collide(&a->shape, a->pose, &b->shape, b->pose, HUGE_VAL);
}

static void check_variant(const char *name, variant f, uint64_t seed)
{
    rng r = rng_from(seed);
    int n_checked = 0;
    for (int k = 0; k < 3000; k++) {
        body a;
        body b;
        double angle = 0;
        double scale = 1;
        random_body(&r, &a);
        random_body(&r, &b);
        const double radii = a.shape.radius + b.shape.radius;
        const carom_manifold m = carom_collide(&a.shape, a.pose, &b.shape, b.pose, HUGE_VAL);
        const carom_manifold w = f(&r, &a, &b, &angle, &scale);
        if (!is_tame(&m, radii)) {
            assert_near_case(name, k, w.distance / scale, m.distance, 1e-14);
            continue;
        }
        n_checked++;
        /* Coordinates up to 8, edges above 0.05 of them. */
        assert_near_case(name, k, difference(&m, &w, angle, scale), 0, 1e-12);
        assert_near_case(name, k, apart(turned(m.normal, angle), w.normal), 0, 1e-13);
    }
    assert_true(n_checked > 2000);
}

static void symmetries(void **state)
{
    (void)state;
    check_variant("exchanged", exchanged, 1);
    check_variant("moved", moved, 2);
    check_variant("scaled", scaled, 3);
    check_variant("renumbered", renumbered, 4);
}

/* Rounding both shapes moves the points by the radii and lowers the gaps by their sum. */
static void rounding_shifts_points(void **state)
{
    (void)state;
    rng r = rng_from(5);
    for (int k = 0; k < 2000; k++) {
        body a;
        body b;
        do random_body(&r, &a);
        while (a.shape.count == 1);
        do random_body(&r, &b);
        while (b.shape.count == 1);
        const double ra = a.shape.radius;
        const double rb = b.shape.radius;
        const carom_manifold m = carom_collide(&a.shape, a.pose, &b.shape, b.pose, HUGE_VAL);
        a.shape.radius = b.shape.radius = 0;
        const carom_manifold c = carom_collide(&a.shape, a.pose, &b.shape, b.pose, HUGE_VAL);
        assert_int_equal(m.count, c.count);
        assert_near(m.distance, c.distance - ra - rb, 4 * DBL_EPSILON * (1 + fabs(c.distance)));
        for (int i = 0; i < c.count; i++) {
            const carom_vec2 n = c.normal;
            assert_near(m.points[i].arm_a.x, c.points[i].arm_a.x + ra * n.x, 1e-14);
            assert_near(m.points[i].arm_a.y, c.points[i].arm_a.y + ra * n.y, 1e-14);
            assert_near(m.points[i].arm_b.x, c.points[i].arm_b.x - rb * n.x, 1e-14);
            assert_near(m.points[i].arm_b.y, c.points[i].arm_b.y - rb * n.y, 1e-14);
        }
    }
}

/* Bit for bit, but for the padding. */
static int same_point(const carom_contact_point *a, const carom_contact_point *b)
{
    const carom_recipe r = a->recipe;
    const carom_recipe s = b->recipe;
    return a->gap == b->gap && a->arm_a.x == b->arm_a.x && a->arm_a.y == b->arm_a.y &&
           a->arm_b.x == b->arm_b.x && a->arm_b.y == b->arm_b.y && r.ref == s.ref &&
           r.inc == s.inc && r.kernel == s.kernel && r.flipped == s.flipped && r.at_end == s.at_end;
}

/* A margin keeps the points of the unlimited manifold with gap <= margin, and gives none exactly
 * when the distance exceeds it; then it still bounds the distance from below. */
static void margin_selects(void **state)
{
    (void)state;
    rng r = rng_from(6);
    int n_by_count[3] = {0};
    for (int k = 0; k < 5000; k++) {
        body a;
        body b;
        random_body(&r, &a);
        random_body(&r, &b);
        const double margin = rng_uniform(&r, 0, 1);
        const carom_manifold all = carom_collide(&a.shape, a.pose, &b.shape, b.pose, HUGE_VAL);
        const carom_manifold m = carom_collide(&a.shape, a.pose, &b.shape, b.pose, margin);
        int n = 0;
        for (int i = 0; i < all.count; i++) {
            if (all.points[i].gap > margin) continue;
            assert_true(n < m.count);
            assert_true(same_point(&m.points[n++], &all.points[i]));
        }
        assert_int_equal(m.count, n);
        n_by_count[n]++;
        if (n) {
            assert_true(m.distance == all.distance && m.ambiguous == all.ambiguous);
            assert_memory_equal(&m.normal, &all.normal, sizeof m.normal);
        } else {
            assert_true(m.distance >= margin * (1 - 4 * DBL_EPSILON));
            assert_true(m.distance <= all.distance + 16 * DBL_EPSILON * (1 + all.distance));
        }
    }
    for (int n = 0; n < 3; n++) assert_true(n_by_count[n] > 100);
}

/* Along a path the distance is Lipschitz, and while the cores are apart so is the normal: it turns
 * by no more than the motion over the distance. */
static void distance_and_normal_are_continuous(void **state)
{
    (void)state;
    rng r = rng_from(8);
    const double step = 1e-4;
    for (int path = 0; path < 60; path++) {
        body a;
        body b;
        random_body(&r, &a);
        random_body(&r, &b);
        const double radii = a.shape.radius + b.shape.radius;
        const double spin = rng_uniform(&r, -1, 1);
        b.pose.x = -2.5;
        carom_manifold last = carom_collide(&a.shape, a.pose, &b.shape, b.pose, HUGE_VAL);
        for (int i = 0; i < 4000; i++) {
            b.pose.x += step;
            b.pose.angle += spin * step;
            const carom_manifold m = carom_collide(&a.shape, a.pose, &b.shape, b.pose, HUGE_VAL);
            /* Speed of a point of B: 1 + |spin| * reach, reach <= 1.7. */
            const double motion = step * (1 + 1.7 * fabs(spin)) + 1e-14;
            assert_at_most("distance", fabs(m.distance - last.distance), motion);
            const double core = fmin(m.distance, last.distance) + radii;
            if (core > 0.01) {
                const double turn = motion / core + fabs(spin) * step;
                assert_at_most("normal", apart(m.normal, last.normal), 1.1 * turn);
            }
            last = m;
        }
    }
}

/* NaN ends and is not an answer. */
static void nan_pose_ends(void **state)
{
    (void)state;
    rng r = rng_from(10);
    for (int k = 0; k < 300; k++) {
        body a;
        body b;
        random_body(&r, &a);
        random_body(&r, &b);
        double *field[3] = {&b.pose.angle, &b.pose.x, &b.pose.y};
        *field[k % 3] = NAN;
        if (b.shape.count == 1 && k % 3 == 0) continue; /* a disc may turn as it likes */
        const carom_manifold m = carom_collide(&a.shape, a.pose, &b.shape, b.pose, 0.1);
        assert_int_equal(m.count, 0);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(symmetries),     cmocka_unit_test(rounding_shifts_points),
        cmocka_unit_test(margin_selects), cmocka_unit_test(distance_and_normal_are_continuous),
        cmocka_unit_test(nan_pose_ends),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
