/* Pairs of boxes against trying all pairs, on ordinary and on hostile boxes; memory; shapes are
 * inside their boxes. */
#include "alloc_fail.h"
#include "carom/broadphase.h"
#include "near.h"
#include "rng.h"

#include <float.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_BOXES = 2000 };

static carom_box boxes[MAX_BOXES];

static int meet(const carom_box *a, const carom_box *b)
{
    const double v[8] = {a->lower.x, a->lower.y, a->upper.x, a->upper.y,
                         b->lower.x, b->lower.y, b->upper.x, b->upper.y};
    for (int i = 0; i < 8; i++) {
        if (isnan(v[i])) return 0;
    }
    if (a->lower.x > a->upper.x || a->lower.y > a->upper.y) return 0;
    if (b->lower.x > b->upper.x || b->lower.y > b->upper.y) return 0;
    return fmax(a->lower.x, b->lower.x) <= fmin(a->upper.x, b->upper.x) &&
           fmax(a->lower.y, b->lower.y) <= fmin(a->upper.y, b->upper.y);
}

/* The expected pairs in the expected order; returns their number. */
static int check_pairs(const char *name, carom_broadphase *bp, int n)
{
    int n_pairs = -1;
    const carom_pair *pairs = NULL;
    assert_int_equal(carom_broadphase_pairs(bp, n, boxes, &n_pairs, &pairs), CAROM_OK);
    int k = 0;
    for (int i = 0; i < n; i++) {
        for (int j = i + 1; j < n; j++) {
            if (!meet(&boxes[i], &boxes[j])) continue;
            if (k >= n_pairs || pairs[k].a != i || pairs[k].b != j) {
                fail_msg("%s, %d boxes: pair %d of %d is (%d, %d), expected (%d, %d)", name, n, k,
                         n_pairs, k < n_pairs ? pairs[k].a : -1, k < n_pairs ? pairs[k].b : -1, i,
                         j);
            }
            k++;
        }
    }
    if (k != n_pairs) fail_msg("%s, %d boxes: %d pairs, expected %d", name, n, n_pairs, k);
    return k;
}

typedef void (*filler)(rng *r, int n);

static carom_box box_at(double x, double y, double w, double h)
{
    const carom_box b = {{x - w, y - h}, {x + w, y + h}};
    return b;
}

static void fill_pile(rng *r, int n)
{
    const double side = sqrt((double)n);
    for (int i = 0; i < n; i++) {
        boxes[i] = box_at(rng_uniform(r, 0, side), rng_uniform(r, 0, side),
                          rng_uniform(r, 0.2, 0.8), rng_uniform(r, 0.2, 0.8));
    }
}

/* A ground under everything, walls beside it. */
static void fill_pile_on_ground(rng *r, int n)
{
    fill_pile(r, n);
    boxes[n / 2] = box_at(0, -1, 1e6, 1);
    boxes[n - 1] = box_at(-1, 0, 1, 1e6);
}

/* Lower sides equal, all touching: closed boxes, ties. */
static void fill_lattice(rng *r, int n)
{
    for (int i = 0; i < n; i++) boxes[i] = box_at(rng_int(r, 12), rng_int(r, 12), 0.5, 0.5);
}

static void fill_column(rng *r, int n)
{
    for (int i = 0; i < n; i++) boxes[i] = box_at(0, 1.01 * rng_int(r, n), 0.5, 0.5);
}

static void fill_row(rng *r, int n)
{
    for (int i = 0; i < n; i++) boxes[i] = box_at(1.01 * rng_int(r, n), 0, 0.5, 0.5);
}

/* Sizes over 16 decades. */
static void fill_wide_sizes(rng *r, int n)
{
    for (int i = 0; i < n; i++) {
        const double size = pow(10, rng_uniform(r, -8, 8));
        boxes[i] = box_at(size * rng_uniform(r, -2, 2), size * rng_uniform(r, -2, 2), size,
                          size * rng_uniform(r, 0.1, 1));
    }
}

/* A cluster, and a few boxes as far away as doubles go. */
static void fill_far(rng *r, int n)
{
    fill_pile(r, n);
    boxes[0] = box_at(1e300, -1e300, 1, 1);
    boxes[1] = box_at(-DBL_MAX, DBL_MAX, 0, 0);
    boxes[2] = box_at(1e9, 1e9, 1e-3, 1e-3);
    boxes[3] = boxes[0];
}

static void fill_thin(rng *r, int n)
{
    for (int i = 0; i < n; i++) {
        const double x = rng_uniform(r, 0, 10);
        const double y = rng_uniform(r, 0, 10);
        boxes[i] = i % 2 ? box_at(x, y, 0, 3) : box_at(x, y, rng_int(r, 2) ? 3 : 1e-300, 0);
    }
}

static void fill_hostile(rng *r, int n)
{
    const double odd[] = {NAN, HUGE_VAL, -HUGE_VAL, DBL_MAX, -DBL_MAX, 0, -0.0, 1, DBL_MIN, 5e-324};
    for (int i = 0; i < n; i++) {
        double v[4];
        for (int k = 0; k < 4; k++) {
            v[k] = rng_int(r, 4) ? rng_uniform(r, -1, 1) : odd[rng_int(r, 10)];
        }
        const carom_box b = {{v[0], v[1]}, {v[2], v[3]}};
        boxes[i] = b;
    }
}

static void fill_everything(rng *r, int n)
{
    (void)r;
    for (int i = 0; i < n; i++) {
        const carom_box b = {{-HUGE_VAL, -HUGE_VAL}, {HUGE_VAL, HUGE_VAL}};
        boxes[i] = b;
    }
}

static void pairs_are_all_pairs(void **state)
{
    static const struct {
        const char *name;
        filler fill;
    } scenes[] = {
        {"pile", fill_pile},       {"pile on ground", fill_pile_on_ground},
        {"lattice", fill_lattice}, {"column", fill_column},
        {"row", fill_row},         {"wide sizes", fill_wide_sizes},
        {"far", fill_far},         {"thin", fill_thin},
        {"hostile", fill_hostile}, {"everything", fill_everything},
    };
    const int counts[] = {4, 5, 30, 63, 64, 65, 66, 100, 500, MAX_BOXES};
    (void)state;
    carom_broadphase *bp = NULL;
    assert_int_equal(carom_broadphase_create(NULL, &bp), CAROM_OK);
    for (size_t s = 0; s < sizeof scenes / sizeof *scenes; s++) {
        rng r = rng_from(s);
        for (size_t c = 0; c < sizeof counts / sizeof *counts; c++) {
            scenes[s].fill(&r, counts[c]);
            const int found = check_pairs(scenes[s].name, bp, counts[c]);
            if (counts[c] == MAX_BOXES) assert_true(found > 0);
        }
    }
    carom_broadphase_destroy(bp);
}

static void few_boxes(void **state)
{
    (void)state;
    carom_broadphase *bp = NULL;
    assert_int_equal(carom_broadphase_create(NULL, &bp), CAROM_OK);
    int n_pairs = -1;
    const carom_pair *pairs;
    assert_int_equal(carom_broadphase_pairs(bp, 0, NULL, &n_pairs, &pairs), CAROM_OK);
    assert_int_equal(n_pairs, 0);
    boxes[0] = boxes[1] = box_at(0, 0, 1, 1);
    assert_int_equal(check_pairs("one", bp, 1), 0);
    assert_int_equal(check_pairs("two", bp, 2), 1);
    boxes[1] = box_at(2, 0, 1, 1); /* they share a side */
    assert_int_equal(check_pairs("touching", bp, 2), 1);
    boxes[1] = box_at(2, 2, 1, 1); /* a corner */
    assert_int_equal(check_pairs("touching at a corner", bp, 2), 1);
    assert_int_equal(carom_broadphase_pairs(bp, -1, boxes, &n_pairs, &pairs), CAROM_E_ARGUMENT);
    assert_int_equal(carom_broadphase_pairs(bp, 2, NULL, &n_pairs, &pairs), CAROM_E_ARGUMENT);
    assert_int_equal(carom_broadphase_pairs(NULL, 2, boxes, &n_pairs, &pairs), CAROM_E_ARGUMENT);
    assert_int_equal(carom_broadphase_create(NULL, NULL), CAROM_E_ARGUMENT);
    carom_broadphase_destroy(bp);
    carom_broadphase_destroy(NULL);
}

/* The method is the one the boxes ask for, and its work stays near linear. */
static void methods_are_chosen(void **state)
{
    static const struct {
        const char *name;
        filler fill;
        int n;
        carom_broadphase_method method;
    } cases[] = {
        {"few", fill_pile, 64, CAROM_ALL_PAIRS},
        {"pile", fill_pile, MAX_BOXES, CAROM_GRID},
        {"pile on ground", fill_pile_on_ground, MAX_BOXES, CAROM_GRID},
        {"far", fill_far, MAX_BOXES, CAROM_GRID},
        {"column", fill_column, MAX_BOXES, CAROM_GRID},
        {"row", fill_row, MAX_BOXES, CAROM_GRID},
        {"wide sizes", fill_wide_sizes, MAX_BOXES, CAROM_SORT_AND_SWEEP},
        {"everything", fill_everything, MAX_BOXES, CAROM_SORT_AND_SWEEP},
    };
    (void)state;
    carom_broadphase *bp = NULL;
    assert_int_equal(carom_broadphase_create(NULL, &bp), CAROM_OK);
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        rng r = rng_from(k);
        cases[k].fill(&r, cases[k].n);
        check_pairs(cases[k].name, bp, cases[k].n);
        const carom_broadphase_stats s = carom_broadphase_statistics(bp);
        if (s.method != cases[k].method) fail_msg("%s: method %d", cases[k].name, (int)s.method);
        /* A box of size below 1.6 in cells of 2 has some ten neighbors; a few large ones meet all.
         */
        if (s.method == CAROM_GRID) {
            assert_true(s.n_tests < 40L * cases[k].n + (long)s.n_large * cases[k].n);
            assert_true(s.n_large <= 32);
        }
    }
    carom_broadphase_destroy(bp);
}

/* Moving all boxes far from the origin changes neither pairs nor work, as long as they are exact.
 */
static void far_from_the_origin(void **state)
{
    (void)state;
    carom_broadphase *bp = NULL;
    assert_int_equal(carom_broadphase_create(NULL, &bp), CAROM_OK);
    rng r = rng_from(5);
    for (int i = 0; i < MAX_BOXES; i++) {
        boxes[i] = box_at(rng_int(&r, 400) / 8.0, rng_int(&r, 400) / 8.0, 0.5, 0.5);
    }
    const int near_pairs = check_pairs("near", bp, MAX_BOXES);
    const long near_tests = carom_broadphase_statistics(bp).n_tests;
    for (int i = 0; i < MAX_BOXES; i++) {
        boxes[i].lower.x += 1e12;
        boxes[i].upper.x += 1e12;
        boxes[i].lower.y -= 1e12;
        boxes[i].upper.y -= 1e12;
    }
    assert_int_equal(check_pairs("far", bp, MAX_BOXES), near_pairs);
    assert_int_equal(carom_broadphase_statistics(bp).n_tests, near_tests);
    carom_broadphase_destroy(bp);
}

/* The pairs depend on the boxes alone, and repeating a call allocates nothing. */
static void steady_state(void **state)
{
    (void)state;
    alloc_fail a = alloc_fail_never();
    const carom_allocator from = alloc_fail_allocator(&a);
    carom_broadphase *bp = NULL;
    assert_int_equal(carom_broadphase_create(&from, &bp), CAROM_OK);
    rng r = rng_from(11);
    fill_wide_sizes(&r, MAX_BOXES);
    const int first = check_pairs("first", bp, MAX_BOXES);
    const long calls = a.n_calls;
    size_t bytes;
    long counted;
    carom_broadphase_memory(bp, &bytes, &counted);
    assert_int_equal(counted, calls);
    assert_int_equal(bytes, a.live);
    assert_int_equal(check_pairs("again", bp, MAX_BOXES), first);
    rng s = rng_from(12);
    fill_pile(&s, 500);
    check_pairs("fewer", bp, 500);
    assert_int_equal(a.n_calls, calls);
    carom_broadphase_destroy(bp);
    assert_int_equal(a.live, 0);
    assert_int_equal(a.n_bad_sizes, 0);
}

/* Boxes that only look large: memory follows boxes and pairs, not extents. */
static void memory_is_linear(void **state)
{
    const filler fills[] = {fill_far, fill_thin, fill_hostile, fill_wide_sizes,
                            fill_pile_on_ground};
    (void)state;
    for (size_t k = 0; k < sizeof fills / sizeof *fills; k++) {
        carom_broadphase *bp = NULL;
        assert_int_equal(carom_broadphase_create(NULL, &bp), CAROM_OK);
        rng r = rng_from(k);
        fills[k](&r, MAX_BOXES);
        const int n_pairs = check_pairs("memory", bp, MAX_BOXES);
        size_t bytes;
        long calls;
        carom_broadphase_memory(bp, &bytes, &calls);
        /* Keys, orders and sorted boxes: 56 bytes a box; pairs twice, grown by half: 48 a pair. */
        assert_true(bytes < 128 * (size_t)MAX_BOXES + 48 * (size_t)n_pairs + 4096);
        carom_broadphase_destroy(bp);
    }
}

static void failing_allocations(void **state)
{
    (void)state;
    rng r = rng_from(13);
    fill_pile(&r, 500);
    for (long k = 0;; k++) {
        alloc_fail a = alloc_fail_at(k);
        const carom_allocator from = alloc_fail_allocator(&a);
        carom_broadphase *bp = NULL;
        int n_pairs = -7;
        const carom_pair *pairs = NULL;
        carom_status e = carom_broadphase_create(&from, &bp);
        if (e) assert_null(bp);
        if (!e) e = carom_broadphase_pairs(bp, 500, boxes, &n_pairs, &pairs);
        if (e) {
            assert_int_equal(e, CAROM_E_MEMORY);
            assert_int_equal(n_pairs, -7);
            assert_null(pairs);
        }
        carom_broadphase_destroy(bp);
        assert_int_equal(a.live, 0);
        assert_int_equal(a.n_bad_sizes, 0);
        if (!e) {
            assert_true(k > 3);
            return;
        }
    }
}

/* In long double: every rounded vertex inside, and the box no wider than some roundings. */
static void shapes_are_in_their_boxes(void **state)
{
    (void)state;
    rng r = rng_from(14);
    for (int k = 0; k < 5000; k++) {
        carom_vec2 v[8];
        const int n = 1 + rng_int(&r, 8);
        const double far = k % 2 ? 1e7 : 1;
        for (int i = 0; i < n; i++) {
            v[i].x = rng_uniform(&r, -1, 1);
            v[i].y = rng_uniform(&r, -1, 1);
        }
        const carom_shape s = {rng_int(&r, 2) ? rng_uniform(&r, 0, 1) : 0, n, v};
        const carom_pose q = {rng_uniform(&r, -9, 9), far * rng_uniform(&r, -1, 1),
                              far * rng_uniform(&r, -1, 1)};
        const carom_box b = carom_shape_box(&s, q);
        long double low_x = HUGE_VALL, low_y = HUGE_VALL, high_x = -HUGE_VALL, high_y = -HUGE_VALL;
        for (int i = 0; i < n; i++) {
            const long double c = cosl(q.angle);
            const long double t = sinl(q.angle);
            const long double x = q.x + c * v[i].x - t * v[i].y;
            const long double y = q.y + t * v[i].x + c * v[i].y;
            low_x = fminl(low_x, x - s.radius);
            low_y = fminl(low_y, y - s.radius);
            high_x = fmaxl(high_x, x + s.radius);
            high_y = fmaxl(high_y, y + s.radius);
        }
        const long double slack = 20 * DBL_EPSILON * (fabs(q.x) + fabs(q.y) + 3);
        assert_true(b.lower.x <= low_x && low_x - b.lower.x <= slack);
        assert_true(b.lower.y <= low_y && low_y - b.lower.y <= slack);
        assert_true(b.upper.x >= high_x && b.upper.x - high_x <= slack);
        assert_true(b.upper.y >= high_y && b.upper.y - high_y <= slack);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(pairs_are_all_pairs), cmocka_unit_test(few_boxes),
        cmocka_unit_test(methods_are_chosen),  cmocka_unit_test(far_from_the_origin),
        cmocka_unit_test(steady_state),        cmocka_unit_test(memory_is_linear),
        cmocka_unit_test(failing_allocations), cmocka_unit_test(shapes_are_in_their_boxes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
