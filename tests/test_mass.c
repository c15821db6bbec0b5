/* Mass properties against closed forms and against the moments of the outline; their derivatives
 * against central differences. */
#include "carom/shape.h"
#include "fdiff.h"
#include "near.h"
#include "rng.h"

#include <float.h>
#include <string.h>

enum { MAX_N = 16 };

static const double PI = 3.14159265358979323846;

typedef struct mass_case {
    const char *name;
    double radius;
    int count;
    double area;
    double x;
    double y;
    double inertia; /* density 1 */
    carom_vec2 v[4];
} mass_case;

/* Textbook values.  A capsule (straight length 2, radius 1): rectangle 2 x 2 and two half discs,
 * whose centroid is 4 r / (3 pi) beyond the ends. */
static void closed_forms(void **state)
{
    (void)state;
    const double half_disc = 4 / (3 * PI);
    const double capsule = 4 * (4 + 4) / 12.0 + 2 * (PI / 4 - PI / 2 * half_disc * half_disc +
                                                     PI / 2 * (1 + half_disc) * (1 + half_disc));
    /* Square of half side 1 rounded by 1: square, four strips at 1.5, four quarter discs. */
    const double rounded = 4 * (4 + 4) / 12.0 + 4 * (2 * (4 + 1) / 12.0 + 2 * 1.5 * 1.5) +
                           4 * (PI / 4 * (2 + 2 * half_disc * 2 + 0.5));
    const mass_case cases[] = {
        {"disc", 2, 1, 4 * PI, 3, -1, 8 * PI, {{3, -1}}},
        {"segment", 0, 2, 0, 0.5, 1, 0, {{0, 0}, {1, 2}}},
        {"box 2 x 1", 0, 4, 2, 1, 0.5, 2 * 5 / 12.0, {{0, 0}, {2, 0}, {2, 1}, {0, 1}}},
        {"right triangle", 0, 3, 0.5, 1 / 3.0, 1 / 3.0, 1 / 18.0, {{0, 0}, {1, 0}, {0, 1}}},
        {"capsule", 1, 2, 4 + PI, 1, 0, capsule, {{0, 0}, {2, 0}}},
        {"rounded square", 1, 4, 12 + PI, 0, 0, rounded, {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}}},
    };
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        const mass_case *c = &cases[k];
        const carom_shape shape = {c->radius, c->count, c->v};
        const carom_mass_properties m = carom_shape_mass(&shape, 3);
        const double tol = 64 * DBL_EPSILON; /* sums of a dozen terms below 30 */
        assert_near_case(c->name, 0, m.area, c->area, tol * 10);
        assert_near_case(c->name, 1, m.centroid.x, c->x, tol);
        assert_near_case(c->name, 2, m.centroid.y, c->y, tol);
        assert_near_case(c->name, 3, m.mass, 3 * c->area, tol * 30);
        assert_near_case(c->name, 4, m.inertia, 3 * c->inertia, tol * 100);
    }
}

/* Moments of the solid as integrals along its outline (Green), 12-point Gauss-Legendre on each edge
 * and arc: exact on edges, 1e-15 on arcs of at most 180 degrees cut in eight. */
typedef struct outline_moments {
    double s;
    double x;
    double y;
    double j;
} outline_moments;

static const double NODE[6] = {0.12523340851146891, 0.36783149899818019, 0.58731795428661745,
                               0.76990267419430469, 0.90411725637047486, 0.98156063424671925};
static const double WEIGHT[6] = {0.24914704581340279, 0.23349253653835481, 0.20316742672306592,
                                 0.16007832854334623, 0.10693932599531843, 0.04717533638651183};

static void add_outline(outline_moments *m, double w, carom_vec2 p, carom_vec2 dp)
{
    m->s += w * (p.x * dp.y - p.y * dp.x) / 2;
    m->x += w * p.x * p.x * dp.y / 2;
    m->y -= w * p.y * p.y * dp.x / 2;
    m->j += w * (p.x * p.x * p.x * dp.y - p.y * p.y * p.y * dp.x) / 3;
}

/* radius > 0: arc around c from angle t0 to t1; else the line from c to d. */
static void add_piece(outline_moments *m, carom_vec2 c, carom_vec2 d, double r, double t0,
                      double t1)
{
    for (int k = 0; k < 12; k++) {
        const double z = k < 6 ? NODE[k] : -NODE[k - 6];
        const double u = (1 + z) / 2;
        const double w = WEIGHT[k < 6 ? k : k - 6] / 2;
        const double t = t0 + u * (t1 - t0);
        carom_vec2 p = {c.x + u * (d.x - c.x), c.y + u * (d.y - c.y)};
        carom_vec2 dp = {d.x - c.x, d.y - c.y};
        if (r > 0) {
            p.x = c.x + r * cos(t);
            p.y = c.y + r * sin(t);
            dp.x = -r * sin(t) * (t1 - t0);
            dp.y = r * cos(t) * (t1 - t0);
        }
        add_outline(m, w, p, dp);
    }
}

static outline_moments outline_of(const carom_shape *s)
{
    outline_moments m = {0, 0, 0, 0};
    for (int i = 0; i < s->count; i++) {
        const carom_vec2 a = s->vertices[i];
        const carom_vec2 b = s->vertices[(i + 1) % s->count];
        const carom_vec2 c = s->vertices[(i + 2) % s->count];
        const double t0 = atan2(b.y - a.y, b.x - a.x) - PI / 2;
        double t1 = atan2(c.y - b.y, c.x - b.x) - PI / 2;
        while (t1 < t0) t1 += 2 * PI;
        const carom_vec2 n = {s->radius * cos(t0), s->radius * sin(t0)};
        const carom_vec2 p = {a.x + n.x, a.y + n.y};
        const carom_vec2 q = {b.x + n.x, b.y + n.y};
        add_piece(&m, p, q, 0, 0, 0);
        for (int k = 0; s->radius > 0 && k < 8; k++) {
            add_piece(&m, b, b, s->radius, t0 + (t1 - t0) * k / 8, t0 + (t1 - t0) * (k + 1) / 8);
        }
    }
    return m;
}

/* A convex hull with random corner angles, away from the origin. */
static void random_hull(rng *r, int n, carom_vec2 *v)
{
    const double turn = rng_uniform(r, 0, 6);
    const double height = rng_uniform(r, 0.1, 1);
    for (int i = 0; i < n; i++) {
        const double t = turn + 2 * PI * (i + rng_uniform(r, -0.3, 0.3)) / n;
        v[i].x = 2 + cos(t);
        v[i].y = -1 + height * sin(t);
    }
}

static void moments_of_the_outline(void **state)
{
    (void)state;
    rng r = rng_from(3);
    for (int k = 0; k < 2000; k++) {
        carom_vec2 v[MAX_N];
        const int n = 2 + rng_int(&r, MAX_N - 1);
        const double radius = n == 2 || rng_int(&r, 2) ? rng_uniform(&r, 0.05, 2) : 0;
        const carom_shape shape = {radius, n, v};
        random_hull(&r, n, v);
        const outline_moments m = outline_of(&shape);
        const carom_mass_properties p = carom_shape_mass(&shape, 2);
        /* The outline's moments are taken about the origin, up to 6 away: squares of 36. */
        const double tol = 1e-14 * (1 + m.s) * 36;
        assert_near_case("area", k, p.area, m.s, tol);
        assert_near_case("x", k, p.centroid.x, m.x / m.s, tol / m.s);
        assert_near_case("y", k, p.centroid.y, m.y / m.s, tol / m.s);
        const double inertia = m.j - (m.x * m.x + m.y * m.y) / m.s;
        assert_near_case("inertia", k, p.inertia, 2 * inertia, 4 * tol);
    }
}

/* Two discs; and none. */
static void moments_of_several(void **state)
{
    (void)state;
    const carom_vec2 at[2] = {{-2, 0}, {3, 1}};
    const carom_shape discs[2] = {{1, 1, &at[0]}, {0.5, 1, &at[1]}};
    const carom_moments m = carom_shapes_moments(2, discs);
    /* rounding of numbers up to 20 */
    assert_near(m.area, PI * 1.25, 1e-14);
    assert_near(m.centroid.x, (-2 + 0.25 * 3) / 1.25, 1e-14);
    assert_near(m.centroid.y, 0.25 / 1.25, 1e-14);
    assert_near(m.second, PI * (0.5 + 4 + 0.25 * (0.5 * 0.25 + 10)), 1e-13);
    assert_near(m.extent, sqrt(10) + 0.5, 1e-14);
    const carom_moments none = carom_shapes_moments(0, NULL);
    assert_true(none.area == 0 && none.second == 0 && none.extent == 0);
}

/* Moving and turning a shape moves its centroid and changes nothing else; order does not matter. */
static void mass_is_invariant(void **state)
{
    (void)state;
    rng r = rng_from(4);
    for (int k = 0; k < 500; k++) {
        carom_vec2 v[MAX_N];
        carom_vec2 u[MAX_N];
        const int n = 2 + rng_int(&r, MAX_N - 1);
        const double radius = rng_uniform(&r, 0.01, 1);
        const double angle = rng_uniform(&r, -3, 3);
        const int shift = rng_int(&r, n);
        random_hull(&r, n, v);
        for (int i = 0; i < n; i++) {
            const carom_vec2 p = v[(i + shift) % n];
            u[i].x = 5 + cos(angle) * p.x - sin(angle) * p.y;
            u[i].y = -7 + sin(angle) * p.x + cos(angle) * p.y;
        }
        const carom_shape before = {radius, n, v};
        const carom_shape after = {radius, n, u};
        const carom_mass_properties a = carom_shape_mass(&before, 1);
        const carom_mass_properties b = carom_shape_mass(&after, 1);
        const double x = 5 + cos(angle) * a.centroid.x - sin(angle) * a.centroid.y;
        const double y = -7 + sin(angle) * a.centroid.x + cos(angle) * a.centroid.y;
        assert_near_case("area", k, b.area, a.area, 1e-14 * (1 + a.area)); /* coordinates of 10 */
        assert_near_case("x", k, b.centroid.x, x, 1e-13);
        assert_near_case("y", k, b.centroid.y, y, 1e-13);
        assert_near_case("inertia", k, b.inertia, a.inertia, 1e-13 * (1 + a.inertia));
    }
}

typedef struct mass_scene {
    carom_shape shape;
    double density;
    carom_mass_properties bar;
    carom_vec2 v[MAX_N];
} mass_scene;

static double mass_inner(void *user)
{
    const mass_scene *k = user;
    const carom_mass_properties p = carom_shape_mass(&k->shape, k->density);
    return k->bar.area * p.area + k->bar.centroid.x * p.centroid.x +
           k->bar.centroid.y * p.centroid.y + k->bar.mass * p.mass + k->bar.inertia * p.inertia;
}

static void random_mass_scene(rng *r, int n, double radius, mass_scene *k)
{
    memset(k, 0, sizeof *k);
    k->shape.vertices = k->v;
    k->shape.count = n;
    k->shape.radius = radius;
    k->density = rng_uniform(r, 0.5, 2);
    random_hull(r, n, k->v);
    k->bar.area = rng_uniform(r, -1, 1);
    k->bar.centroid.x = rng_uniform(r, -1, 1);
    k->bar.centroid.y = rng_uniform(r, -1, 1);
    k->bar.mass = rng_uniform(r, -1, 1);
    k->bar.inertia = rng_uniform(r, -1, 1);
}

static void check_mass_vjp(const char *name, mass_scene *k)
{
    double density_bar = 1;
    double radius_bar = 2;
    carom_vec2 v_bar[MAX_N];
    for (int i = 0; i < MAX_N; i++) v_bar[i].x = v_bar[i].y = 3;
    carom_shape_mass_vjp(&k->shape, k->density, k->bar, &density_bar, &radius_bar, v_bar);
    /* Fourth-order differences at step 1e-3 of lengths above 0.05: 1e-8 of sums below 100. */
    const double h = 1e-3 * fmin(1, k->shape.radius > 0 ? k->shape.radius : 1);
    double expected = fdiff_entry(mass_inner, k, &k->density, 1e-3, NULL);
    assert_near_case(name, -1, density_bar - 1, expected, 1e-8 * (1 + fabs(expected)));
    if (k->shape.radius > 0) {
        expected = fdiff_entry(mass_inner, k, &k->shape.radius, h, NULL);
        assert_near_case(name, -2, radius_bar - 2, expected, 1e-8 * (1 + fabs(expected)));
    }
    for (int i = 0; i < k->shape.count; i++) {
        expected = fdiff_entry(mass_inner, k, &k->v[i].x, 1e-3, NULL);
        assert_near_case(name, 2 * i, v_bar[i].x - 3, expected, 1e-7 * (1 + fabs(expected)));
        expected = fdiff_entry(mass_inner, k, &k->v[i].y, 1e-3, NULL);
        assert_near_case(name, 2 * i + 1, v_bar[i].y - 3, expected, 1e-7 * (1 + fabs(expected)));
    }
}

static void mass_derivatives(void **state)
{
    (void)state;
    rng r = rng_from(5);
    for (int i = 0; i < 400; i++) {
        mass_scene k;
        random_mass_scene(&r, 1, rng_uniform(&r, 0.1, 1), &k);
        check_mass_vjp("disc", &k);
        random_mass_scene(&r, 2, rng_uniform(&r, 0.1, 1), &k);
        check_mass_vjp("capsule", &k);
        random_mass_scene(&r, 2, 0, &k);
        check_mass_vjp("segment", &k);
        const int n = 3 + rng_int(&r, 6);
        random_mass_scene(&r, n, 0, &k);
        check_mass_vjp("hull", &k);
        random_mass_scene(&r, n, rng_uniform(&r, 0.05, 1), &k);
        check_mass_vjp("rounded hull", &k);
    }
}

/* One-sided at radius 0: d area / d radius is the perimeter, of a segment twice its length. */
static void radius_derivative_at_zero(void **state)
{
    (void)state;
    const carom_vec2 box[4] = {{0, 0}, {2, 0}, {2, 1}, {0, 1}};
    const carom_mass_properties area = {1, {0, 0}, 0, 0};
    const carom_mass_properties inertia = {0, {0, 0}, 0, 1};
    const carom_shape hull = {0, 4, box};
    const carom_shape segment = {0, 2, box};
    double r_bar = 0;
    carom_shape_mass_vjp(&hull, 1, area, NULL, &r_bar, NULL);
    assert_near(r_bar, 6, 8 * DBL_EPSILON);
    r_bar = 0;
    carom_shape_mass_vjp(&segment, 1, area, NULL, &r_bar, NULL);
    assert_near(r_bar, 4, 8 * DBL_EPSILON);
    /* A thin rectangle of length 2 and width 2 r: 2 r 2^3 / 12. */
    r_bar = 0;
    carom_shape_mass_vjp(&segment, 1, inertia, NULL, &r_bar, NULL);
    assert_near(r_bar, 16 / 12.0, 8 * DBL_EPSILON);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(closed_forms),       cmocka_unit_test(moments_of_the_outline),
        cmocka_unit_test(moments_of_several), cmocka_unit_test(mass_is_invariant),
        cmocka_unit_test(mass_derivatives),   cmocka_unit_test(radius_derivative_at_zero),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
