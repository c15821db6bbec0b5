/* carom/base.h and the allocation helpers of libgeom/base/memory.h. */
#include "alloc_fail.h"
#include "near.h"

#include "carom/base.h"
#include "libgeom/base/memory.h"

#include <limits.h>
#include <stdio.h>
#include <string.h>

/* Callers store these numbers and print these names: neither may ever change. */
static const struct {
    int value;
    const char *name;
} CODES[] = {
    {0, "CAROM_OK"},
    {1, "CAROM_INEXACT"},
    {2, "CAROM_LIMIT"},
    {3, "CAROM_RELAXED"},
    {-1, "CAROM_E_ARGUMENT"},
    {-2, "CAROM_E_MEMORY"},
    {-3, "CAROM_E_CAPACITY"},
    {-4, "CAROM_E_SHAPE"},
    {-5, "CAROM_E_INFEASIBLE"},
    {-6, "CAROM_E_NO_SOLUTION"},
    {-7, "CAROM_E_SINGULAR"},
    {-8, "CAROM_E_STATE"},
};
enum { N_CODES = sizeof CODES / sizeof *CODES };

static void test_status_codes_are_stable(void **state)
{
    (void)state;
    for (int i = 0; i < N_CODES; i++) {
        assert_string_equal(carom_status_name((carom_status)CODES[i].value), CODES[i].name);
    }
}

static void test_status_texts_differ(void **state)
{
    (void)state;
    const char *none = carom_status_text((carom_status)77);
    for (int i = 0; i < N_CODES; i++) {
        const char *text = carom_status_text((carom_status)CODES[i].value);
        assert_true(strlen(text) > 3);
        assert_string_not_equal(text, none);
        for (int j = 0; j < i; j++)
            assert_string_not_equal(text, carom_status_text((carom_status)CODES[j].value));
    }
}

/* Every number between and around the codes is answered, never with NULL. */
static void test_unknown_status(void **state)
{
    (void)state;
    for (int value = -100; value <= 100; value++) {
        int known = 0;
        for (int i = 0; i < N_CODES; i++) known |= CODES[i].value == value;
        const char *name = carom_status_name((carom_status)value);
        assert_non_null(name);
        assert_non_null(carom_status_text((carom_status)value));
        assert_int_equal(strcmp(name, "unknown") == 0, !known);
    }
}

/* "MAJOR.MINOR.PATCH" and nothing else: printing the three numbers gives the text back. */
static void test_version(void **state)
{
    (void)state;
    int part[3] = {-1, -1, -1};
    char again[64];
    assert_int_equal(sscanf(carom_version(), "%d.%d.%d", part, part + 1, part + 2), 3);
    snprintf(again, sizeof again, "%d.%d.%d", part[0], part[1], part[2]);
    assert_string_equal(again, carom_version());
    assert_true(part[0] >= 0 && part[1] >= 0 && part[2] >= 0);
}

static void test_default_allocator(void **state)
{
    (void)state;
    const carom_allocator a = carom_allocator_default();
    a.release(a.user, NULL, 0);
    for (size_t bytes = 1; bytes <= 4096; bytes *= 2) {
        unsigned char *p = a.allocate(a.user, bytes);
        assert_non_null(p);
        assert_int_equal((uintptr_t)p % sizeof(double), 0);
        memset(p, 0xa5, bytes); /* all of it is ours: the address sanitizer watches */
        a.release(a.user, p, bytes);
    }
}

static void test_memory_counts(void **state)
{
    (void)state;
    alloc_fail source = alloc_fail_never();
    const carom_allocator from = alloc_fail_allocator(&source);
    crm_memory m = crm_memory_from(&from);
    double *a = crm_new(&m, 10, sizeof *a);
    int *b = crm_new(&m, 3, sizeof *b);
    const size_t both = 10 * sizeof *a + 3 * sizeof *b;
    for (int i = 0; i < 10; i++) assert_true(a[i] == 0.0);
    for (int i = 0; i < 3; i++) assert_int_equal(b[i], 0);
    assert_int_equal(m.live, both);
    assert_int_equal(m.live, source.live);
    crm_free(&m, a, 10, sizeof *a);
    assert_int_equal(m.live, 3 * sizeof *b);
    assert_int_equal(m.high, both);
    crm_free(&m, b, 3, sizeof *b);
    assert_int_equal(m.live, 0);
    assert_int_equal(m.high, both);
    assert_int_equal(m.n_calls, 2);
    assert_int_equal(source.n_bad_sizes, 0);
}

/* Nothing is still something that can be freed; NULL frees nothing. */
static void test_memory_of_nothing(void **state)
{
    (void)state;
    alloc_fail source = alloc_fail_never();
    const carom_allocator from = alloc_fail_allocator(&source);
    crm_memory m = crm_memory_from(&from);
    static const size_t SIZES[][2] = {{0, 8}, {8, 0}, {0, 0}};
    for (int i = 0; i < 3; i++) {
        void *p = crm_new(&m, SIZES[i][0], SIZES[i][1]);
        assert_non_null(p);
        assert_int_equal(source.n_live, 1);
        crm_free(&m, p, SIZES[i][0], SIZES[i][1]);
    }
    crm_free(&m, NULL, 5, 8);
    assert_int_equal(m.live, 0);
    assert_int_equal(source.n_live, 0);
    assert_int_equal(source.n_bad_sizes, 0);
}

/* A product that wraps around, or reaches the signed half, never reaches the allocator. */
static void test_memory_overflow(void **state)
{
    (void)state;
    alloc_fail source = alloc_fail_never();
    const carom_allocator from = alloc_fail_allocator(&source);
    crm_memory m = crm_memory_from(&from);
    static const size_t SIZES[][2] = {
        {SIZE_MAX, 1},
        {1, SIZE_MAX},
        {SIZE_MAX / 2, 3},
        {SIZE_MAX / 8 + 2, 8},
        {SIZE_MAX / 2 + 2, 2},
        {(size_t)1 << (sizeof(size_t) * 4), (size_t)1 << (sizeof(size_t) * 4)},
    };
    for (int i = 0; i < 6; i++) assert_null(crm_new(&m, SIZES[i][0], SIZES[i][1]));
    assert_int_equal(source.n_calls, 0);
    assert_int_equal(m.n_calls, 0);
    assert_int_equal(m.live, 0);
}

static void test_memory_exhausted(void **state)
{
    (void)state;
    alloc_fail source = alloc_fail_at(1);
    const carom_allocator from = alloc_fail_allocator(&source);
    crm_memory m = crm_memory_from(&from);
    int *p = NULL;
    int n_max = 0;
    assert_int_equal(crm_reserve(&m, (void **)&p, &n_max, 4, sizeof *p), CAROM_OK);
    int *const before = p;
    const int held = n_max;
    const size_t live = m.live;
    assert_int_equal(crm_reserve(&m, (void **)&p, &n_max, held + 1, sizeof *p), CAROM_E_MEMORY);
    assert_ptr_equal(p, before);
    assert_int_equal(n_max, held);
    assert_int_equal(m.live, live);
    crm_free(&m, p, (size_t)n_max, sizeof *p);
    assert_int_equal(source.live, 0);
}

/* One element at a time up to N: contents stay, new elements are zero, and growth by half makes
 * O(log N) requests: 8 * 1.5^k (less the rounding down) reaches 10000 for k <= 19. */
static void test_growth(void **state)
{
    (void)state;
    enum { N = 10000, MAX_REQUESTS = 20 };
    alloc_fail source = alloc_fail_never();
    const carom_allocator from = alloc_fail_allocator(&source);
    crm_memory m = crm_memory_from(&from);
    int *p = NULL;
    int n_max = 0;
    for (int n = 0; n < N; n++) {
        assert_int_equal(crm_reserve(&m, (void **)&p, &n_max, n + 1, sizeof *p), CAROM_OK);
        assert_true(n_max > n);
        assert_int_equal(p[n], 0);
        p[n] = n + 1;
    }
    for (int n = 0; n < N; n++) assert_int_equal(p[n], n + 1);
    assert_true(m.n_calls <= MAX_REQUESTS);
    const long n_calls = m.n_calls;
    assert_int_equal(crm_reserve(&m, (void **)&p, &n_max, 1, sizeof *p), CAROM_OK);
    assert_int_equal(m.n_calls, n_calls); /* what is there is not asked for again */
    crm_free(&m, p, (size_t)n_max, sizeof *p);
    assert_int_equal(source.live, 0);
    assert_int_equal(source.n_bad_sizes, 0);
}

/* Refuses, and remembers what was asked. */
static void *refuse(void *user, size_t bytes)
{
    *(size_t *)user = bytes;
    return NULL;
}

static void release_nothing(void *user, void *memory, size_t bytes)
{
    (void)user;
    (void)memory;
    (void)bytes;
}

/* Half of a large count more would not fit an int: then exactly what is needed is asked for. */
static void test_growth_near_int_max(void **state)
{
    (void)state;
    static const int HELD[] = {INT_MAX / 3 * 2, INT_MAX / 3 * 2 + 2, INT_MAX - 1};
    for (int i = 0; i < 3; i++) {
        size_t asked = 0;
        const carom_allocator from = {refuse, release_nothing, &asked};
        crm_memory m = crm_memory_from(&from);
        void *p = NULL;
        int n_max = HELD[i];
        assert_int_equal(crm_reserve(&m, &p, &n_max, HELD[i] + 1, 1), CAROM_E_MEMORY);
        assert_true(asked > (size_t)HELD[i]);
        assert_true(asked <= (size_t)INT_MAX);
        assert_int_equal(n_max, HELD[i]);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_status_codes_are_stable), cmocka_unit_test(test_status_texts_differ),
        cmocka_unit_test(test_unknown_status),          cmocka_unit_test(test_version),
        cmocka_unit_test(test_default_allocator),       cmocka_unit_test(test_memory_counts),
        cmocka_unit_test(test_memory_of_nothing),       cmocka_unit_test(test_memory_overflow),
        cmocka_unit_test(test_memory_exhausted),        cmocka_unit_test(test_growth),
        cmocka_unit_test(test_growth_near_int_max),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
