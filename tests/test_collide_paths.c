/* All ways to the closest features end at the same ones: through libccd's GJK, through the sweep,
 * and by walks from any certified axis. */
#include "collide/closest.h"
#include "near.h"
#include "rng.h"

#include <limits.h>
#include <string.h>

enum { MAX_N = 64 };

static const double PI = 3.14159265358979323846;

typedef struct core {
    carom_shape shape;
    carom_vec2 v[MAX_N];
} core;

static void random_core(rng *r, int n, double thin, core *c)
{
    const double start = rng_uniform(r, 0, 6);
    c->shape.radius = 0;
    c->shape.count = n;
    c->shape.vertices = c->v;
    for (int i = 0; i < n; i++) {
        const double t = start + 2 * PI * (i + rng_uniform(r, -0.3, 0.3)) / n;
        c->v[i].x = cos(t);
        c->v[i].y = thin * sin(t);
    }
}

/* Integer boxes and diamonds: parallel edges, aligned corners, exact ties. */
static void lattice_core(rng *r, core *c)
{
    const int w = 1 + rng_int(r, 3);
    const int h = 1 + rng_int(r, 3);
    const carom_vec2 box[4] = {{-w, -h}, {w, -h}, {w, h}, {-w, h}};
    const carom_vec2 diamond[4] = {{0, -h}, {w, 0}, {0, h}, {-w, 0}};
    const int kind = rng_int(r, 3);
    c->shape.radius = 0;
    c->shape.vertices = c->v;
    c->shape.count = kind ? 4 : 2;
    memcpy(c->v, kind == 2 ? diamond : box, sizeof box);
    if (kind == 0) c->v[1] = box[2];
}

static crm_placed placed(const carom_shape *s, double angle, carom_vec2 at)
{
    const carom_frame f = {0, 0, cos(angle), sin(angle)};
    return crm_place(s, &f, at);
}

static void random_pair(rng *r, int lattice, core *a, core *b, crm_placed *pa, crm_placed *pb)
{
    if (lattice) {
        lattice_core(r, a);
        lattice_core(r, b);
        const carom_vec2 at = {rng_int(r, 13) - 6, rng_int(r, 13) - 6};
        *pa = placed(&a->shape, 0, (carom_vec2){0, 0});
        *pb = placed(&b->shape, 0, at);
        return;
    }
    const double thin = rng_int(r, 4) ? rng_uniform(r, 0.2, 1) : 1e-4;
    random_core(r, 2 + rng_int(r, rng_int(r, 2) ? 4 : MAX_N - 1), thin, a);
    random_core(r, 1 + rng_int(r, rng_int(r, 2) ? 4 : MAX_N), thin, b);
    const carom_vec2 at = {rng_uniform(r, -2.5, 2.5), rng_uniform(r, -2.5, 2.5)};
    *pa = placed(&a->shape, rng_uniform(r, -4, 4), (carom_vec2){0, 0});
    *pb = placed(&b->shape, rng_uniform(r, -4, 4), at);
}

static crm_closest features(const crm_placed *a, const crm_placed *b, int gjk_min_vertices)
{
    const crm_search how = {HUGE_VAL, 0, gjk_min_vertices};
    crm_closest c;
    crm_closest_features(a, b, &how, &c);
    return c;
}

static int same(const crm_closest *x, const crm_closest *y)
{
    return x->kind == y->kind && x->a == y->a && x->b == y->b && x->tied == y->tied &&
           x->gap == y->gap;
}

static void expect_same(const char *way, int k, const crm_closest *x, const crm_closest *y)
{
    if (same(x, y)) return;
    fail_msg(
        "%s, pair %d: kind %d, %d and %d, tied %d, gap %.17g; expected %d, %d and %d, %d, %.17g",
        way, k, (int)x->kind, x->a, x->b, x->tied, x->gap, (int)y->kind, y->a, y->b, y->tied,
        y->gap);
}

static crm_axis axis_along(const crm_placed *a, const crm_placed *b, carom_vec2 d)
{
    const crm_axis x = {d, crm_support(a, d), crm_support(b, crm_neg(d))};
    return x;
}

static int is_certified(const crm_placed *a, const crm_placed *b, crm_axis x)
{
    return crm_dot(x.d, crm_between(a, x.a, b, x.b)) > 1e-12 * crm_length(x.d);
}

static void check_ways(int lattice, uint64_t seed)
{
    rng r = rng_from(seed);
    int n_apart = 0;
    int n_gjk = 0;
    for (int k = 0; k < 20000; k++) {
        core ca;
        core cb;
        crm_placed a;
        crm_placed b;
        random_pair(&r, lattice, &ca, &cb, &a, &b);
        const crm_closest plain = features(&a, &b, INT_MAX);
        const crm_closest through = features(&a, &b, 0);
        expect_same("with GJK", k, &through, &plain);
        if (!(plain.gap > 1e-9)) continue;
        n_apart++;
        crm_axis x;
        crm_closest walked;
        if (crm_gjk(&a, &b, crm_vec(1, 0), &x) && is_certified(&a, &b, x)) {
            n_gjk++;
            assert_int_equal(crm_closest_from(&a, &b, x, HUGE_VAL, &walked), 1);
            expect_same("from GJK's axis", k, &walked, &plain);
        }
        for (int turn = 0; turn < 16; turn++) {
            const double t = turn * PI / 8;
            x = axis_along(&a, &b, crm_vec(cos(t), sin(t)));
            if (!is_certified(&a, &b, x)) continue;
            assert_int_equal(crm_closest_from(&a, &b, x, HUGE_VAL, &walked), 1);
            expect_same("from an axis", k, &walked, &plain);
        }
    }
    assert_true(n_apart > 5000);
    /* libccd's zero tests leave out few; what it leaves out the sweep finds. */
    assert_true(n_gjk > n_apart * 99 / 100);
}

static void random_pairs(void **state)
{
    (void)state;
    check_ways(0, 1);
}

static void lattice_pairs(void **state)
{
    (void)state;
    check_ways(1, 2);
}

/* GJK never separates cores that overlap by more than rounding, whatever its tolerances say: with
 * the certificate. */
static void gjk_is_certified(void **state)
{
    (void)state;
    rng r = rng_from(3);
    for (int k = 0; k < 20000; k++) {
        core ca;
        core cb;
        crm_placed a;
        crm_placed b;
        crm_axis x;
        random_pair(&r, 0, &ca, &cb, &a, &b);
        if (!crm_gjk(&a, &b, crm_vec(0, 1), &x) || !is_certified(&a, &b, x)) continue;
        assert_true(features(&a, &b, INT_MAX).gap > 0);
    }
}

/* Thousands of vertices: two polygons on circles; the gap differs from that of the circles by at
 * most the two sagittas 1 - cos(pi / n). */
static void thousands_of_vertices(void **state)
{
    (void)state;
    enum { N = 5000 };
    static carom_vec2 v[N];
    for (int i = 0; i < N; i++) {
        v[i].x = cos(2 * PI * i / N);
        v[i].y = sin(2 * PI * i / N);
    }
    const carom_shape shape = {0, N, v};
    const double sagitta = 1 - cos(PI / N);
    for (int k = 0; k < 50; k++) {
        const double t = 0.37 * k;
        const double d = 2 + 0.04 * (k - 10);
        const crm_placed a = placed(&shape, 0.1 * k, (carom_vec2){0, 0});
        const crm_placed b = placed(&shape, 0.2 * k, crm_vec(d * cos(t), d * sin(t)));
        const crm_closest with = features(&a, &b, 0);
        const crm_closest without = features(&a, &b, INT_MAX);
        expect_same("5000 vertices", k, &with, &without);
        assert_true(with.gap >= d - 2 - 1e-13 && with.gap <= d - 2 + 2 * sagitta + 1e-13);
    }
}

static void same_sweep(crm_sweep_function *f, crm_sweep_function *g, const char *way, int k,
                       const crm_placed *a, const crm_placed *b, double reach)
{
    crm_closest x;
    crm_closest y;
    const crm_search how = {reach, 0.02, INT_MAX};
    f(a, b, crm_tie(a, b), &how, &x);
    g(a, b, crm_tie(a, b), &how, &y);
    expect_same(way, k, &x, &y);
    assert_true(x.lead == y.lead);
    if (x.kind == CRM_APART) return;
    assert_true(x.ref.m.x == y.ref.m.x && x.ref.m.y == y.ref.m.y);
}

#ifdef CRM_AVX2
static void check_avx2(int k, int four, const crm_placed *a, const crm_placed *b, double reach)
{
    if (!__builtin_cpu_supports("avx2")) return;
    if (four) same_sweep(crm_sweep_four_avx2, crm_sweep_four, "four, AVX2", k, a, b, reach);
    same_sweep(crm_sweep_eight_avx2, crm_sweep_eight, "eight, AVX2", k, a, b, reach);
}
#else
static void check_avx2(int k, int four, const crm_placed *a, const crm_placed *b, double reach)
{
    (void)k, (void)four, (void)a, (void)b, (void)reach;
}
#endif

/* One quad or two, with AVX2 and without: the same bits. */
static void small_sweeps(void **state)
{
    (void)state;
    rng r = rng_from(4);
    int n_small = 0;
    for (int k = 0; k < 40000; k++) {
        core ca;
        core cb;
        crm_placed a;
        crm_placed b;
        random_pair(&r, k % 4 == 0, &ca, &cb, &a, &b);
        if (a.n > CRM_FEW || b.n > CRM_FEW) continue;
        n_small++;
        const double reach = k % 3 ? HUGE_VAL : 0.1;
        const int four = a.n <= 4 && b.n <= 4;
        if (four) same_sweep(crm_sweep_eight, crm_sweep_four, "four", k, &a, &b, reach);
        check_avx2(k, four, &a, &b, reach);
    }
    assert_true(n_small > 10000);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(random_pairs),     cmocka_unit_test(lattice_pairs),
        cmocka_unit_test(gjk_is_certified), cmocka_unit_test(thousands_of_vertices),
        cmocka_unit_test(small_sweeps),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
