/* carom_collide on named degenerate pairs with known answers. */
#include "carom/collide.h"
#include "near.h"

#include <float.h>

typedef struct point_case {
    double ax, ay, bx, by; /* on A and on B, world */
} point_case;

typedef struct named {
    const char *name;
    carom_shape a;
    carom_pose pose_a;
    carom_shape b;
    carom_pose pose_b;
    double distance;
    carom_vec2 normal;
    int ambiguous;
    int count;
    point_case points[2]; /* in any order */
} named;

static const carom_vec2 ORIGIN[1] = {{0, 0}};
static const carom_vec2 BOX[4] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
static const carom_vec2 SMALL[4] = {{-0.5, -0.5}, {0.5, -0.5}, {0.5, 0.5}, {-0.5, 0.5}};
static const carom_vec2 GROUND[4] = {{-50, -1}, {50, -1}, {50, 0}, {-50, 0}};
static const carom_vec2 WIDE[4] = {{-20, -1}, {20, -1}, {20, 1}, {-20, 1}};
static const carom_vec2 PLATE[4] = {{-0.5, -0.25}, {0.5, -0.25}, {0.5, 0.25}, {-0.5, 0.25}};
static const carom_vec2 LEVEL[2] = {{-1, 0}, {1, 0}};
static const carom_vec2 FROM_ORIGIN[2] = {{0, 0}, {4, 0}};
static const carom_vec2 UPRIGHT[2] = {{0, -1}, {0, 1}};
static const carom_vec2 TRIANGLE[3] = {{0, 0}, {1, 1}, {-1, 1}};
/* 1e-11 high: near the smallest that carom_shape_check accepts. */
static const carom_vec2 NEEDLE[3] = {{-1, 0}, {1, 0}, {0, 1e-11}};
static const carom_vec2 TINY_BOX[4] = {{-1e-8, -1e-8}, {1e-8, -1e-8}, {1e-8, 1e-8}, {-1e-8, 1e-8}};
static const carom_vec2 HUGE_BOX[4] = {{-1e8, -1e8}, {1e8, -1e8}, {1e8, 1e8}, {-1e8, 1e8}};

#define DISC(r)                                                                                    \
    {                                                                                              \
        r, 1, ORIGIN                                                                               \
    }
#define HULL(v)                                                                                    \
    {                                                                                              \
        0, (int)(sizeof(v) / sizeof *(v)), v                                                       \
    }
#define ROUNDED(r, v)                                                                              \
    {                                                                                              \
        r, (int)(sizeof(v) / sizeof *(v)), v                                                       \
    }

/* clang-format off */
static const named CASES[] = {
    /* circles */
    {"circles apart", DISC(1), {0, 0, 0}, DISC(2), {9, 3, 4}, 2, {0.6, 0.8}, 0, 1,
     {{0.6, 0.8, 1.8, 2.4}}},
    {"circles touching", DISC(1), {0, 0, 0}, DISC(2), {0, 3, 0}, 0, {1, 0}, 0, 1, {{1, 0, 1, 0}}},
    {"circle in circle", DISC(3), {0, 0, 0}, DISC(1), {0, 0, 1}, -3, {0, 1}, 0, 1, {{0, 3, 0, 0}}},
    {"concentric circles", DISC(1), {1, 5, 6}, DISC(2), {2, 5, 6}, -3, {1, 0}, 1, 1,
     {{6, 6, 3, 6}}},
    /* circle and hull */
    {"circle over a face", HULL(BOX), {0, 0, 0}, DISC(0.5), {0, 0.25, 2}, 0.5, {0, 1}, 0, 1,
     {{0.25, 1, 0.25, 1.5}}},
    {"circle at a corner", HULL(BOX), {0, 0, 0}, DISC(1), {0, 4, 5}, 4, {0.6, 0.8}, 0, 1,
     {{1, 1, 3.4, 4.2}}},
    {"center on an edge", HULL(BOX), {0, 0, 0}, DISC(0.5), {0, 0.25, 1}, -0.5, {0, 1}, 0, 1,
     {{0.25, 1, 0.25, 0.5}}},
    {"center on a corner", HULL(BOX), {0, 0, 0}, DISC(0.5), {0, 1, 1}, -0.5, {1, 0}, 1, 1,
     {{1, 1, 0.5, 1}}},
    {"center inside", HULL(BOX), {0, 0, 0}, DISC(0.5), {0, 0.25, 0.5}, -1, {0, 1}, 0, 1,
     {{0.25, 1, 0.25, 0}}},
    {"center at the center", HULL(BOX), {0, 0, 0}, DISC(0.5), {0, 0, 0}, -1.5, {0, -1}, 1, 1,
     {{0, -1, 0, 0.5}}},
    {"circle contains hull", DISC(9), {0, 0, 0}, HULL(SMALL), {0, 0, 2}, -7.5, {0, 1}, 0, 1,
     {{0, 9, 0, 1.5}}},
    {"circle as A", DISC(0.5), {0, 0.25, 2}, HULL(BOX), {0, 0, 0}, 0.5, {0, -1}, 0, 1,
     {{0.25, 1.5, 0.25, 1}}},
    /* capsules and segments */
    {"circle at a segment's end, in line", HULL(LEVEL), {0, 0, 0}, DISC(0.5), {0, 3, 0}, 1.5, {1,
     0}, 0, 1, {{1, 0, 2.5, 0}}},
    {"segment from its body's position on, aslant", HULL(FROM_ORIGIN), {0.6435011087932844, 0, 0},
     DISC(1), {0, 4, 0}, 1.4, {0.6, -0.8}, 0, 1, {{2.56, 1.92, 3.4, 0.8}}},
    {"center on a segment", HULL(LEVEL), {0, 0, 0}, DISC(0.5), {0, 0.25, 0}, -0.5, {0, -1}, 1, 1,
     {{0.25, 0, 0.25, 0.5}}},
    {"segments in line, apart", HULL(LEVEL), {0, 0, 0}, HULL(LEVEL), {0, 3, 0}, 1, {1, 0}, 0, 1,
     {{1, 0, 2, 0}}},
    {"capsules in line, turned over", ROUNDED(0.5, LEVEL), {0, 0, 0}, ROUNDED(0.25, LEVEL),
     {3.14159265358979323846, 3, 0}, 0.25, {1, 0}, 0, 1, {{1.5, 0, 1.75, 0}}},
    {"segments in line, overlapping", HULL(LEVEL), {0, 0, 0}, HULL(LEVEL), {0, 1, 0}, 0, {0, -1},
     1, 2, {{0, 0, 0, 0}, {1, 0, 1, 0}}},
    {"segments crossing", HULL(LEVEL), {0, 0, 0}, HULL(UPRIGHT), {0, 0.25, 0.5}, -0.5, {0, 1}, 0, 2,
     {{0.25, 0, 0.25, -0.5}, {0.25, 0, 0.25, 1.5}}},
    {"segments side by side", HULL(LEVEL), {0, 0, 0}, HULL(LEVEL), {0, 0.5, 2}, 2, {0, 1}, 1, 2,
     {{-0.5, 0, -0.5, 2}, {1, 0, 1, 2}}},
    {"capsules overlapping side by side", ROUNDED(1, LEVEL), {0, 0, 0}, ROUNDED(2, LEVEL), {0,
     0.5, 2}, -1, {0, 1}, 1, 2, {{-0.5, 1, -0.5, 0}, {1, 1, 1, 0}}},
    {"capsule across a capsule", ROUNDED(0.5, LEVEL), {0, 0, 0}, ROUNDED(0.5, UPRIGHT), {0, 0,
     3}, 1, {0, 1}, 0, 2, {{0, 0.5, 0, 1.5}, {0, 0.5, 0, 3.5}}},
    {"segment on a face, its end over the corner", HULL(BOX), {0, 0, 0}, HULL(LEVEL), {0, 1,
     1.5}, 0.5, {0, 1}, 1, 2, {{0, 1, 0, 1.5}, {1, 1, 1, 1.5}}},
    /* hulls */
    {"boxes face to face", HULL(BOX), {0, 0, 0}, HULL(BOX), {0, 0, 3}, 1, {0, 1}, 1, 2,
     {{-1, 1, -1, 2}, {1, 1, 1, 2}}},
    {"boxes stacked, touching exactly", HULL(BOX), {0, 0, 0}, HULL(BOX), {0, 0, 2}, 0, {0, 1}, 1, 2,
     {{-1, 1, -1, 1}, {1, 1, 1, 1}}},
    {"boxes overhanging", HULL(BOX), {0, 0, 0}, HULL(BOX), {0, 1.5, 2}, 0, {0, 1}, 1, 2,
     {{0.5, 1, 0.5, 1}, {1, 1, 1, 1}}},
    {"boxes overlapping by 1/4", HULL(BOX), {0, 0, 0}, HULL(BOX), {0, 0.5, 1.75}, -0.25, {0, 1},
     1, 2, {{-0.5, 1, -0.5, 0.75}, {1, 1, 1, 0.75}}},
    {"box quarter turned on a box", HULL(BOX), {0, 0, 0}, HULL(BOX), {1.5707963267948966, 0, 3},
     1, {0, 1}, 1, 2, {{-1, 1, -1, 2}, {1, 1, 1, 2}}},
    {"box on the ground", HULL(GROUND), {0, 0, 0}, HULL(BOX), {0, 30, 1}, 0, {0, 1}, 1, 2,
     {{29, 0, 29, 0}, {31, 0, 31, 0}}},
    {"ground under a box, as B", HULL(BOX), {0, 30, 1}, HULL(GROUND), {0, 0, 0}, 0, {0, -1}, 1, 2,
     {{29, 0, 29, 0}, {31, 0, 31, 0}}},
    {"boxes corner to corner", HULL(BOX), {0, 0, 0}, HULL(BOX), {0, 5, 6}, 5, {0.6, 0.8}, 0, 1,
     {{1, 1, 4, 5}}},
    {"boxes corner to corner, face to face", HULL(BOX), {0, 0, 0}, HULL(BOX), {0, 2, 3}, 1, {0,
     1}, 0, 1, {{1, 1, 1, 2}}},
    {"tip over a face", HULL(BOX), {0, 0, 0}, HULL(TRIANGLE), {0, 0.25, 2}, 1, {0, 1}, 0, 2,
     {{0.25, 1, 0.25, 2}, {1, 1, 1, 2.75}}},
    {"coincident boxes", HULL(BOX), {0, 0, 0}, HULL(BOX), {0, 0, 0}, -2, {0, -1}, 1, 2,
     {{-1, -1, -1, 1}, {1, -1, 1, 1}}},
    {"small in large, same center", HULL(BOX), {0, 0, 0}, HULL(SMALL), {0, 0, 0}, -1.5, {0, -1},
     1, 2, {{-0.5, -1, -0.5, 0.5}, {0.5, -1, 0.5, 0.5}}},
    /* an axis that separates by rounding alone is no start for a walk: this was 20.5 m apart */
    {"flush, turned by a rounding", HULL(WIDE), {0, 0, -1.0000000499999999}, HULL(PLATE),
     {-1.4306165677880186e-17, -2.6858445809288368e-19, 0.24999995}, 0, {0, 1}, 1, 2,
     {{-0.5, -0.00000005, -0.5, -0.00000005}, {0.5, -0.00000005, 0.5, -0.00000005}}},
    {"rounded boxes apart", ROUNDED(0.5, BOX), {0, 0, 0}, ROUNDED(0.25, BOX), {0, 5, 6}, 4.25,
     {0.6, 0.8}, 0, 1, {{1.3, 1.4, 3.85, 4.8}}},
    {"rounded boxes, roundings overlap", ROUNDED(0.5, BOX), {0, 0, 0}, ROUNDED(0.25, BOX), {0, 0,
     2.5}, -0.25, {0, 1}, 1, 2, {{-1, 1.5, -1, 1.25}, {1, 1.5, 1, 1.25}}},
    {"rounded boxes, cores touch", ROUNDED(0.5, BOX), {0, 0, 0}, ROUNDED(0.25, BOX), {0, 0, 2},
     -0.75, {0, 1}, 1, 2, {{-1, 1.5, -1, 0.75}, {1, 1.5, 1, 0.75}}},
    /* needles */
    {"circle beyond a needle's tip", HULL(NEEDLE), {0, 0, 0}, DISC(0.5), {0, 3, 0}, 1.5, {1, 0},
     0, 1, {{1, 0, 2.5, 0}}},
    {"circle just beyond a needle's tip", HULL(NEEDLE), {0, 0, 0}, DISC(0.5), {0, 1.0009765625,
     0}, 0.0009765625 - 0.5, {1, 0}, 0, 1, {{1, 0, 0.5009765625, 0}}},
    {"needles tip to tip", HULL(NEEDLE), {0, 0, 0}, HULL(NEEDLE), {0, 2.5, 0}, 0.5, {1, 0}, 0, 1,
     {{1, 0, 1.5, 0}}},
    {"needle and segment in line", HULL(NEEDLE), {0, 0, 0}, HULL(LEVEL), {0, -2.25, 0}, 0.25,
     {-1, 0}, 0, 1, {{-1, 0, -1.25, 0}}},
    /* sizes */
    {"tiny boxes", HULL(TINY_BOX), {0, 0, 0}, HULL(TINY_BOX), {0, 5e-8, 6e-8}, 5e-8, {0.6, 0.8},
     0, 1, {{1e-8, 1e-8, 4e-8, 5e-8}}},
    {"huge boxes", HULL(HUGE_BOX), {0, 0, 0}, HULL(HUGE_BOX), {0, 5e8, 6e8}, 5e8, {0.6, 0.8}, 0, 1,
     {{1e8, 1e8, 4e8, 5e8}}},
    {"tiny box on a huge one", HULL(HUGE_BOX), {0, 0, 0}, HULL(TINY_BOX), {0, 0, 1e8 + 1}, 1, {0,
     1}, 1, 2, {{-1e-8, 1e8, -1e-8, 1e8 + 1}, {1e-8, 1e8, 1e-8, 1e8 + 1}}},
    {"far from the origin", HULL(BOX), {0, 1e7, -1e7}, HULL(BOX), {0, 1e7 + 5, 6 - 1e7}, 5, {0.6,
     0.8}, 0, 1, {{1e7 + 1, 1 - 1e7, 1e7 + 4, 5 - 1e7}}},
};
/* clang-format on */

static double size_of(const carom_shape *s)
{
    double size = s->radius;
    for (int i = 0; i < s->count; i++) {
        size = fmax(size, fmax(fabs(s->vertices[i].x), fabs(s->vertices[i].y)) + s->radius);
    }
    return size;
}

static double far_by(const named *c, const carom_contact_point *p, const point_case *q)
{
    const double a =
        fmax(fabs(c->pose_a.x + p->arm_a.x - q->ax), fabs(c->pose_a.y + p->arm_a.y - q->ay));
    const double b =
        fmax(fabs(c->pose_b.x + p->arm_b.x - q->bx), fabs(c->pose_b.y + p->arm_b.y - q->by));
    return fmax(a, b);
}

/* Every answer is a few roundings of the shapes' size away from the exact one; world coordinates
 * add theirs. */
static void check_named(const named *c, const carom_manifold *m)
{
    const double tol = 16 * DBL_EPSILON * fmax(size_of(&c->a), size_of(&c->b));
    const double world = tol + 2 * DBL_EPSILON * (fabs(c->pose_b.x) + fabs(c->pose_b.y));
    assert_near_case(c->name, 0, m->distance, c->distance, tol);
    assert_near_case(c->name, 1, m->normal.x, c->normal.x, 16 * DBL_EPSILON);
    assert_near_case(c->name, 2, m->normal.y, c->normal.y, 16 * DBL_EPSILON);
    if (m->ambiguous != c->ambiguous) fail_msg("%s: ambiguous %d", c->name, m->ambiguous);
    if (m->count != c->count) fail_msg("%s: %d points, expected %d", c->name, m->count, c->count);
    const int crossed = m->count == 2 && far_by(c, &m->points[0], &c->points[0]) >
                                             far_by(c, &m->points[0], &c->points[1]);
    for (int i = 0; i < m->count; i++) {
        const point_case *p = &c->points[crossed ? 1 - i : i];
        assert_near_case(c->name, 3 + i, far_by(c, &m->points[i], p), 0, world);
    }
}

static void named_cases(void **state)
{
    (void)state;
    for (size_t k = 0; k < sizeof CASES / sizeof *CASES; k++) {
        const named *c = &CASES[k];
        if (carom_shape_check(&c->a, NULL)) fail_msg("%s: A is not valid", c->name);
        if (carom_shape_check(&c->b, NULL)) fail_msg("%s: B is not valid", c->name);
        const carom_manifold m = carom_collide(&c->a, c->pose_a, &c->b, c->pose_b, HUGE_VAL);
        check_named(c, &m);
    }
}

/* The same with A and B exchanged; of tied faces another may then be the reference. */
static void named_cases_swapped(void **state)
{
    (void)state;
    for (size_t k = 0; k < sizeof CASES / sizeof *CASES; k++) {
        const named *c = &CASES[k];
        const double tol = 16 * DBL_EPSILON * fmax(size_of(&c->a), size_of(&c->b));
        const carom_manifold m = carom_collide(&c->b, c->pose_b, &c->a, c->pose_a, HUGE_VAL);
        assert_near_case(c->name, 0, m.distance, c->distance, tol);
        assert_int_equal(m.ambiguous, c->ambiguous);
        if (m.ambiguous) continue;
        named swapped = *c;
        swapped.a = c->b;
        swapped.b = c->a;
        swapped.pose_a = c->pose_b;
        swapped.pose_b = c->pose_a;
        swapped.normal.x = -c->normal.x;
        swapped.normal.y = -c->normal.y;
        for (int i = 0; i < 2; i++) {
            const point_case p = c->points[i];
            swapped.points[i] = (point_case){p.bx, p.by, p.ax, p.ay};
        }
        check_named(&swapped, &m);
    }
}

/* A segment of 5 m, 1e40 m away in its body's frame: turned, its ends are one place within
 * rounding.  The distance is still right to the rounding of the coordinates, either way around. */
static void edge_lost_in_rounding(void **state)
{
    (void)state;
    const carom_vec2 v[2] = {{-1e40, 5}, {-1e40, 0}};
    const carom_shape segment = {8, 2, v};
    const carom_shape disc = DISC(1e39);
    for (int k = 0; k < 100; k++) {
        const carom_pose q = {0.1 * k, 1, -2};
        const carom_pose o = {0, 0, 0};
        const carom_manifold m[2] = {carom_collide(&disc, o, &segment, q, HUGE_VAL),
                                     carom_collide(&segment, q, &disc, o, HUGE_VAL)};
        for (int i = 0; i < 2; i++) {
            assert_true(m[i].count > 0);
            assert_near_case("distance", k, m[i].distance, 9e39, 1e26);
            assert_near_case("normal", k, hypot(m[i].normal.x, m[i].normal.y), 1, 1e-12);
        }
    }
}

/* A disc ever farther along the line of a segment: no face separates but by rounding. */
static void distant_in_line(void **state)
{
    (void)state;
    const carom_shape disc = DISC(0.5);
    const carom_shape bar = {0.25, 2, FROM_ORIGIN};
    for (int k = 0; k < 400; k++) {
        const double d = 5 * pow(10, 0.09 * k); /* to 4e36 */
        const carom_pose o = {0.3 * k, 0, 0};
        const carom_pose q = {k, d * cos(o.angle), d * sin(o.angle)};
        const carom_manifold m[2] = {carom_collide(&bar, o, &disc, q, HUGE_VAL),
                                     carom_collide(&disc, q, &bar, o, HUGE_VAL)};
        for (int i = 0; i < 2; i++) {
            const double tol = 16 * DBL_EPSILON * d;
            assert_near_case("distance", k, m[i].distance, d - 4 - 0.75, tol);
            assert_near_case("x", k, fabs(m[i].normal.x), fabs(cos(o.angle)), 1e-14);
        }
        const carom_frame fa = carom_frame_at(o);
        const carom_frame fb = carom_frame_at(q);
        carom_pair_cache cache = {0};
        for (int i = 0; i < 3; i++) {
            assert_int_equal(carom_collide_frames(&bar, &fa, &disc, &fb, 0.1, &cache).count, 0);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(named_cases),
        cmocka_unit_test(named_cases_swapped),
        cmocka_unit_test(edge_lost_in_rounding),
        cmocka_unit_test(distant_in_line),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
