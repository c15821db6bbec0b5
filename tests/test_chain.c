/* Chains: a closed convex one is its hull; no ghost contacts at joints; one-sided; recipes on the
 * whole chain; validation. */
#include "carom/chain.h"
#include "fdiff.h"
#include "near.h"
#include "rng.h"

#include <float.h>
#include <string.h>

static const double PI = 3.14159265358979323846;

enum { MAX_LINKS = 32 };

typedef struct found {
    int count; /* points within the margin, of all links */
    double distance;
    carom_vec2 normal[2 * MAX_LINKS];
    carom_contact_point point[2 * MAX_LINKS];
} found;

static found collide_all(const carom_chain *chain, carom_pose pose_a, const carom_shape *b,
                         carom_pose pose_b, double margin)
{
    found f = {0};
    f.distance = HUGE_VAL;
    for (int k = 0; k < carom_chain_links(chain); k++) {
        const carom_manifold m = carom_collide_chain(chain, k, pose_a, b, pose_b, margin);
        f.distance = fmin(f.distance, m.distance);
        for (int i = 0; i < m.count; i++) {
            f.normal[f.count] = m.normal;
            f.point[f.count++] = m.points[i];
        }
    }
    return f;
}

static void regular(int n, double r, double start, carom_vec2 *v)
{
    for (int i = 0; i < n; i++) {
        v[i].x = r * cos(start + 2 * PI * i / n);
        v[i].y = r * sin(start + 2 * PI * i / n);
    }
}

/* Outside a closed convex chain: distance, normal and points of the hull. */
static void closed_convex_chain_is_a_hull(void **state)
{
    (void)state;
    rng r = rng_from(1);
    for (int k = 0; k < 5000; k++) {
        carom_vec2 v[8];
        carom_vec2 u[6];
        const int n = 3 + rng_int(&r, 6);
        const int nb = 1 + rng_int(&r, 6);
        regular(n, 1, rng_uniform(&r, 0, 6), v);
        regular(nb, 0.4, rng_uniform(&r, 0, 6), u);
        const double round = rng_int(&r, 2) ? 0.1 : 0;
        const carom_chain chain = {round, n, v, 1};
        const carom_shape hull = {round, n, v};
        const carom_shape b = {nb == 1 || rng_int(&r, 2) ? 0.2 : 0, nb, u};
        const carom_pose qa = {rng_uniform(&r, -3, 3), 0.3, -0.2};
        const double t = rng_uniform(&r, 0, 6);
        const double away = rng_uniform(&r, 1, 2.5);
        const carom_pose qb = {rng_uniform(&r, -3, 3), 0.3 + away * cos(t), -0.2 + away * sin(t)};
        const carom_manifold m = carom_collide(&hull, qa, &b, qb, HUGE_VAL);
        if (m.distance + round + b.radius < 1e-3) continue; /* cores overlap: links answer apart */
        const found f = collide_all(&chain, qa, &b, qb, m.distance + 1e-9);
        assert_near_case("distance", k, f.distance, m.distance, 1e-14);
        const int within = m.count == 2 && m.points[1].gap <= m.distance + 1e-9 &&
                           m.points[0].gap <= m.distance + 1e-9;
        assert_int_equal(f.count, 1 + within);
        assert_near_case("normal", k, hypot(f.normal[0].x - m.normal.x, f.normal[0].y - m.normal.y),
                         0, 1e-12); /* rounding over cores 1e-3 apart */
    }
}

/* Links of random lengths along the x axis, right to left, up to x = 1 and down to x = -1. */
static void flat_chain(rng *r, int n, carom_vec2 *v)
{
    double sum = 0;
    for (int i = 0; i < n; i++) {
        v[i].x = sum;
        v[i].y = 0;
        sum += rng_uniform(r, 0.05, 1);
    }
    const double last = v[n - 1].x;
    for (int i = 0; i < n; i++) v[i].x = 1 - 2 * v[i].x / last;
}

/* A box that slides over the joints of a flat floor, a little in or out and a little tilted, meets
 * the floor's normal only, and the floor's farthest left and right points are those of one long
 * segment. */
static void box_on_a_flat_chain(void **state)
{
    (void)state;
    rng r = rng_from(2);
    const carom_vec2 box[4] = {{-0.2, -0.1}, {0.2, -0.1}, {0.2, 0.1}, {-0.2, 0.1}};
    const carom_vec2 ends[2] = {{1, 0}, {-1, 0}};
    const carom_shape floor = {0, 2, ends};
    for (int k = 0; k < 20000; k++) {
        carom_vec2 v[20];
        flat_chain(&r, 20, v);
        const carom_chain chain = {0, 20, v, 0};
        const carom_shape b = {rng_int(&r, 2) ? 0.02 : 0, 4, box};
        const double depth = pow(10, rng_uniform(&r, -12, -2)) * (rng_int(&r, 2) ? 1 : -1);
        const double tilt = pow(10, rng_uniform(&r, -16, -2)) * (rng_int(&r, 2) ? 1 : -1);
        const int turned = rng_int(&r, 4);
        const carom_pose qa = {0, 0, 0};
        /* Now and then with a side exactly over a joint. */
        const double x = rng_int(&r, 4) ? rng_uniform(&r, -0.7, 0.7) : v[10].x + 0.2;
        if (x > 0.7 || x < -0.7) continue;
        const double half = turned % 2 ? 0.2 : 0.1;
        const carom_pose qb = {tilt + turned * PI / 2, x, half + b.radius - depth};
        const double margin = 0.01;
        const carom_manifold m = carom_collide(&floor, qa, &b, qb, margin);
        const found f = collide_all(&chain, qa, &b, qb, margin);
        assert_int_equal(m.count > 0, f.count > 0);
        if (!m.count) continue;
        double left = HUGE_VAL, right = -HUGE_VAL, least = HUGE_VAL, most = -HUGE_VAL;
        for (int i = 0; i < f.count; i++) {
            assert_near_case("normal", k, hypot(f.normal[i].x, f.normal[i].y - 1), 0, 1e-12);
            left = fmin(left, f.point[i].arm_a.x);
            right = fmax(right, f.point[i].arm_a.x);
        }
        for (int i = 0; i < m.count; i++) {
            least = fmin(least, m.points[i].arm_a.x);
            most = fmax(most, m.points[i].arm_a.x);
        }
        assert_near_case("distance", k, f.distance, m.distance, 1e-14);
        /* The long segment shows two points or the deepest; the links show those between them too.
         */
        assert_true(left <= least + 1e-12 && right >= most - 1e-12);
    }
}

/* Over a ridge of two links: one contact everywhere; distance in closed form. */
static void circle_over_a_ridge(void **state)
{
    (void)state;
    const carom_vec2 v[3] = {{2, -1}, {0, 0}, {-2, -1}};
    const carom_vec2 center[1] = {{0, 0}};
    const carom_chain chain = {0, 3, v, 0};
    const carom_shape disc = {0.25, 1, center};
    const carom_pose qa = {0, 0, 0};
    const double c = 2 / sqrt(5.0);
    const double s = 1 / sqrt(5.0);
    for (int k = -1000; k <= 1000; k++) {
        const double x = k / 1000.0;
        const carom_pose qb = {0, x, 0.3};
        const found f = collide_all(&chain, qa, &disc, qb, 1);
        assert_int_equal(f.count, 1);
        /* Over the face to either side when the foot is past the top. */
        const double along = fabs(x) * c - 0.3 * s;
        const double expected = along > 0 ? fabs(x) * s + 0.3 * c : hypot(x, 0.3);
        assert_near(f.distance, expected - 0.25, 1e-15);
        assert_true(f.normal[0].y > 0);
    }
}

/* In a valley it rests on both links, at the bottom and not elsewhere. */
static void circle_in_a_valley(void **state)
{
    (void)state;
    const carom_vec2 v[3] = {{2, 2}, {0, 0}, {-2, 2}};
    const carom_vec2 center[1] = {{0, 0}};
    const carom_chain chain = {0, 3, v, 0};
    const carom_shape disc = {0.5, 1, center};
    const carom_pose qa = {0, 0, 0};
    const carom_pose bottom = {0, 0, 0.5 * sqrt(2)};
    const carom_pose side = {0, 0.1, 0.1 + 0.5 * sqrt(2)};
    found f = collide_all(&chain, qa, &disc, bottom, 1e-3);
    assert_int_equal(f.count, 2);
    assert_near(f.distance, 0, 4 * DBL_EPSILON);
    assert_near(f.normal[0].x + f.normal[1].x, 0, 4 * DBL_EPSILON);
    f = collide_all(&chain, qa, &disc, side, 1e-3);
    assert_int_equal(f.count, 1);
    assert_near(f.distance, 0, 4 * DBL_EPSILON);
    /* A point deep in the corner is over both. */
    const carom_shape dot = {1e-9, 1, center};
    const carom_pose corner = {0, 0, 1e-6};
    f = collide_all(&chain, qa, &dot, corner, 1e-3);
    assert_int_equal(f.count, 2);
}

/* Whatever a box does at a blunt ridge, the normals stay between those of the two links. */
static void box_at_a_ridge(void **state)
{
    (void)state;
    rng r = rng_from(3);
    const carom_vec2 v[4] = {{3, -1}, {0, 0}, {-3, 0}, {-6, 1}};
    const carom_vec2 box[4] = {{-0.2, -0.1}, {0.2, -0.1}, {0.2, 0.1}, {-0.2, 0.1}};
    const carom_chain chain = {0, 4, v, 0};
    const carom_shape b = {0, 4, box};
    const carom_pose qa = {0, 0, 0};
    int n_points = 0;
    for (int k = 0; k < 20000; k++) {
        const carom_pose qb = {rng_uniform(&r, -0.4, 0.1), rng_uniform(&r, -0.5, 0.5),
                               0.1 + rng_uniform(&r, -0.05, 0.05)};
        const found f = collide_all(&chain, qa, &b, qb, 0.01);
        for (int i = 0; i < f.count; i++) {
            /* From straight up to the right link's (1, 3) / sqrt(10). */
            assert_true(f.normal[i].x >= -1e-12);
            assert_true(f.normal[i].x * 3 <= f.normal[i].y + 1e-12);
            n_points++;
        }
    }
    assert_true(n_points > 5000);
}

static void one_sided(void **state)
{
    (void)state;
    const carom_vec2 v[3] = {{1, 0}, {0, 0}, {-1, 0}};
    const carom_vec2 box[4] = {{-0.2, -0.1}, {0.2, -0.1}, {0.2, 0.1}, {-0.2, 0.1}};
    const carom_vec2 center[1] = {{0, 0}};
    const carom_chain chain = {0, 3, v, 0};
    const carom_shape b = {0, 4, box};
    const carom_shape disc = {0.1, 1, center};
    const carom_pose qa = {0, 0, 0};
    for (int k = 1; k < 40; k++) {
        const carom_pose below = {0, 0.05, -0.01 * k};
        const found f = collide_all(&chain, qa, &b, below, 1);
        assert_int_equal(f.count, 0);
        assert_true(f.distance == HUGE_VAL);
        assert_int_equal(collide_all(&chain, qa, &disc, below, 1).count, 0);
        const carom_pose above = {0, 0.05, 0.001 * k};
        assert_near(collide_all(&chain, qa, &disc, above, 1).distance, 0.001 * k - 0.1, 1e-16);
    }
    /* Beyond an end of the floor, level with it: its end is hit, from the front only. */
    const carom_pose beside = {0, 1.3, 0.05};
    const found f = collide_all(&chain, qa, &disc, beside, 1);
    assert_int_equal(f.count, 1);
    assert_near(f.distance, hypot(0.3, 0.05) - 0.1, 1e-15);
}

typedef struct gap_scene {
    carom_chain chain;
    carom_pose qa;
    carom_shape b;
    carom_pose qb;
    carom_recipe recipe;
    carom_vec2 v[5];
} gap_scene;

static double gap_of(void *user)
{
    const gap_scene *k = user;
    const carom_shape a = carom_chain_shape(&k->chain);
    carom_vec2 n;
    return carom_contact_eval(&a, k->qa, &k->b, k->qb, k->recipe, &n).gap;
}

/* Recipes belong to the whole chain: the same bits, and derivatives that land on its vertices. */
static void recipes_are_of_the_chain(void **state)
{
    (void)state;
    rng r = rng_from(4);
    const carom_vec2 box[4] = {{-0.5, -0.3}, {0.5, -0.3}, {0.5, 0.3}, {-0.5, 0.3}};
    int seen[3] = {0};
    for (int k = 0; k < 3000; k++) {
        gap_scene s = {{0.05, 5, NULL, rng_int(&r, 2)},
                       {0.3, 1, 2},
                       {0.1, 4, box},
                       {0, 0, 0},
                       {0, 0, 0, 0, 0},
                       {{0, 0}}};
        regular(5, 1.5, rng_uniform(&r, 0, 6), s.v);
        s.chain.vertices = s.v;
        s.qb.angle = rng_uniform(&r, -3, 3);
        const double t = rng_uniform(&r, 0, 6);
        const double away = rng_uniform(&r, 1.7, 2.8);
        s.qb.x = 1 + away * cos(t);
        s.qb.y = 2 + away * sin(t);
        const found f = collide_all(&s.chain, s.qa, &s.b, s.qb, 1);
        for (int i = 0; i < f.count; i++) {
            const carom_shape a = carom_chain_shape(&s.chain);
            carom_vec2 n;
            s.recipe = f.point[i].recipe;
            const carom_contact_point p = carom_contact_eval(&a, s.qa, &s.b, s.qb, s.recipe, &n);
            assert_true(p.gap == f.point[i].gap && n.x == f.normal[i].x && n.y == f.normal[i].y);
            seen[s.recipe.kernel]++;
            carom_vec2 v_bar[5] = {{0, 0}};
            carom_shape_bar a_bar = {{0, 0, 0}, 0, v_bar};
            carom_shape_bar b_bar = {{0, 0, 0}, 0, NULL};
            const carom_contact_bar bar = {{0, 0}, {0, 0}, {0, 0}, 1};
            carom_contact_vjp(&a, s.qa, &s.b, s.qb, s.recipe, &bar, &a_bar, &b_bar);
            if (i) continue;
            for (int j = 0; j < 5; j++) {
                double error;
                const double x = fdiff_entry(gap_of, &s, &s.v[j].x, 1e-4, &error);
                /* The estimate covers points with a steep cut, where the step is too long. */
                assert_near_case("vertex", j, v_bar[j].x, x, 1e-8 * (1 + fabs(x)) + 10 * error);
            }
        }
    }
    for (int i = 0; i < 3; i++) assert_true(seen[i] > 100);
}

static void faults(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        int count;
        int closed;
        double radius;
        carom_shape_fault fault;
        int vertex;
        carom_vec2 v[4];
    } cases[] = {
        {"good", 3, 0, 0, CAROM_SHAPE_VALID, -1, {{0, 0}, {1, 0}, {2, 0}}},
        {"good, closed", 3, 1, 0.1, CAROM_SHAPE_VALID, -1, {{0, 0}, {1, 0}, {0, 1}}},
        {"one vertex", 1, 0, 0, CAROM_SHAPE_COUNT, -1, {{0, 0}}},
        {"two, closed", 2, 1, 0, CAROM_SHAPE_COUNT, -1, {{0, 0}, {1, 0}}},
        {"NaN", 3, 0, 0, CAROM_SHAPE_NOT_FINITE, 1, {{0, 0}, {NAN, 0}, {2, 0}}},
        {"radius", 3, 0, -1, CAROM_SHAPE_RADIUS, -1, {{0, 0}, {1, 0}, {2, 0}}},
        {"duplicate", 3, 0, 0, CAROM_SHAPE_DUPLICATE, 1, {{0, 0}, {1, 0}, {1, 0}}},
        {"ends meet, open", 4, 0, 0, CAROM_SHAPE_VALID, -1, {{0, 0}, {1, 0}, {0, 1}, {0, 0}}},
        {"ends meet, closed", 4, 1, 0, CAROM_SHAPE_DUPLICATE, 3, {{0, 0}, {1, 0}, {0, 1}, {0, 0}}},
        {"fold", 3, 0, 0, CAROM_SHAPE_FOLD, 1, {{0, 0}, {2, 0}, {1, 1e-13}}},
        {"fold at the closing", 3, 1, 0, CAROM_SHAPE_FOLD, 0, {{0, 0}, {1, 0}, {2, 0}}},
        {"far out", 2, 0, 0, CAROM_SHAPE_SIZE, 0, {{1e41, 0}, {2, 0}}},
    };
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        const carom_chain chain = {cases[k].radius, cases[k].count, cases[k].v, cases[k].closed};
        carom_shape_error e;
        const carom_status s = carom_chain_check(&chain, &e);
        assert_int_equal(s, cases[k].fault ? CAROM_E_SHAPE : CAROM_OK);
        if (e.fault != cases[k].fault || e.vertex != cases[k].vertex) {
            fail_msg("%s: fault %d at %d", cases[k].name, (int)e.fault, e.vertex);
        }
    }
    char text[100];
    const carom_shape_error fold = {CAROM_SHAPE_FOLD, 1};
    carom_shape_error_text(fold, text, sizeof text);
    assert_string_equal(
        text, "vertex 1: the chain turns back onto itself; move the vertex or end the chain there");
    assert_int_equal(carom_chain_check(NULL, NULL), CAROM_E_ARGUMENT);
}

static void boxes_hold_links(void **state)
{
    (void)state;
    const carom_vec2 v[3] = {{0, 0}, {2, 0}, {2, 3}};
    const carom_chain chain = {0.5, 3, v, 1};
    const carom_pose q = {0, 10, 20};
    assert_int_equal(carom_chain_links(&chain), 3);
    const carom_box b = carom_chain_box(&chain, 2, q); /* from (2, 3) to (0, 0) */
    assert_near(b.lower.x, 9.5, 1e-13);
    assert_near(b.lower.y, 19.5, 1e-13);
    assert_near(b.upper.x, 12.5, 1e-13);
    assert_near(b.upper.y, 23.5, 1e-13);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(closed_convex_chain_is_a_hull),
        cmocka_unit_test(box_on_a_flat_chain),
        cmocka_unit_test(circle_over_a_ridge),
        cmocka_unit_test(circle_in_a_valley),
        cmocka_unit_test(box_at_a_ridge),
        cmocka_unit_test(one_sided),
        cmocka_unit_test(recipes_are_of_the_chain),
        cmocka_unit_test(faults),
        cmocka_unit_test(boxes_hold_links),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
