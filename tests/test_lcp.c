/* carom_lcp: creation, settings, arguments, memory. */
#include "near.h"

#include "alloc_fail.h"
#include "carom/lcp.h"
#include "lcp_case.h"

#include <string.h>

/* min x^2 - 2x with x <= 1/2 and x_2 = 3: x = (1/2, 3), z = 1, y = -6, nothing degenerate. */
static const double M2[] = {2, 0, 0, 2};
static const double A2[] = {0, 1};
static const double G2[] = {1, 0};
static const double F2[] = {0};
static const double Q2[] = {-2, 0};
static const double B2[] = {3};
static const double m2[] = {0.5};
static const lcp_ref SMALL = {2, 1, 1, M2, A2, G2, F2, Q2, B2, m2};

static carom_lcp *make(const lcp_case *c, const carom_lcp_settings *settings)
{
    carom_lcp *l = NULL;
    assert_int_equal(carom_lcp_create(&c->p, settings, NULL, &l), CAROM_OK);
    assert_non_null(l);
    return l;
}

static void solves_the_small_one(void **state)
{
    (void)state;
    lcp_case c = lcp_case_dense(&SMALL, 0);
    carom_lcp *l = make(&c, NULL);
    carom_lcp_stats stats;
    assert_int_equal(carom_lcp_solve(l, &c.p, &c.at, &stats), CAROM_OK);
    /* well conditioned, entries below 6: a few roundings */
    assert_near(c.at.x[0], 0.5, 1e-13);
    assert_near(c.at.x[1], 3.0, 1e-13);
    assert_near(c.at.z[0], 1.0, 1e-13);
    assert_near(c.at.y[0], -6.0, 1e-13);
    assert_int_equal(stats.status, CAROM_OK);
    assert_at_most("residual", stats.residual, 1e-10);
    assert_true(stats.residual == carom_lcp_residual(l, &c.p, &c.at));
    assert_true(stats.starts == 1 && stats.iterations >= 1 && stats.factorizations >= 1);
    carom_lcp_destroy(l);
    lcp_case_free(&c);
}

static void refuses_settings(void **state)
{
    (void)state;
    lcp_case c = lcp_case_dense(&SMALL, 0);
    carom_lcp *l = NULL;
    const carom_lcp_settings good = carom_lcp_defaults();
    carom_lcp_settings bad[11];
    for (int i = 0; i < 11; i++) bad[i] = good;
    bad[0].accept = 0.0;
    bad[1].accept = NAN;
    bad[2].inexact = 0.5 * good.accept;
    bad[3].inexact = 1.0;
    bad[4].max_iterations = 0;
    bad[5].max_starts = 0;
    bad[6].max_starts = 9;
    bad[7].polish_rounds = -1;
    bad[8].equilibrate = 2;
    bad[9].inexact = NAN;
    bad[10].certify = -1;
    for (int i = 0; i < 11; i++) {
        assert_int_equal(carom_lcp_create(&c.p, &bad[i], NULL, &l), CAROM_E_ARGUMENT);
        assert_null(l);
    }
    lcp_case_free(&c);
}

static void refuses_patterns(void **state)
{
    (void)state;
    static const int backward[] = {0, 2, 1};
    static const int late[] = {1, 1, 1};
    static const int fine[] = {0, 1, 2};
    static const int negative[] = {0, -1};
    static const int outside[] = {0, 2};
    static const double val[] = {1, 1, 1};
    static const carom_sparse bad[] = {{backward, outside, val},
                                       {late, negative, val},
                                       {fine, negative, val},
                                       {fine, outside, val},
                                       {fine, NULL, val}};
    carom_lcp *l = NULL;
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        lcp_case c = lcp_case_dense(&SMALL, 0);
        c.p.M = bad[i];
        assert_int_equal(carom_lcp_create(&c.p, NULL, NULL, &l), CAROM_E_ARGUMENT);
        assert_null(l);
        lcp_case_free(&c);
    }
    lcp_case c = lcp_case_dense(&SMALL, 0);
    c.p.n_eq = -1;
    assert_int_equal(carom_lcp_create(&c.p, NULL, NULL, &l), CAROM_E_ARGUMENT);
    assert_int_equal(carom_lcp_create(NULL, NULL, NULL, &l), CAROM_E_ARGUMENT);
    c.p.n_eq = 1;
    assert_int_equal(carom_lcp_create(&c.p, NULL, NULL, NULL), CAROM_E_ARGUMENT);
    lcp_case_free(&c);
}

/* Every number of the problem, made NaN or infinite in turn, is refused and nothing is written. */
static void refuses_numbers(void **state)
{
    (void)state;
    lcp_case c = lcp_case_dense(&SMALL, 1);
    carom_lcp *l = make(&c, NULL);
    double *const arrays[] = {c.n.M, c.n.A, c.n.G, c.n.F, c.n.q, c.n.b, c.n.m};
    const int counts[] = {c.nnz[0], c.nnz[1], c.nnz[2], c.nnz[3], 2, 1, 1};
    const double bad[] = {NAN, HUGE_VAL};
    for (int a = 0; a < 7; a++)
        for (int i = 0; i < counts[a]; i++)
            for (int b = 0; b < 2; b++) {
                const double kept = arrays[a][i];
                arrays[a][i] = bad[b];
                c.at.x[0] = 77.0;
                assert_int_equal(carom_lcp_solve(l, &c.p, &c.at, NULL), CAROM_E_ARGUMENT);
                assert_true(c.at.x[0] == 77.0);
                assert_true(carom_lcp_residual(l, &c.p, &c.at) == HUGE_VAL);
                arrays[a][i] = kept;
            }
    c.n.M[1] = 0.5; /* not symmetric */
    assert_int_equal(carom_lcp_solve(l, &c.p, &c.at, NULL), CAROM_E_ARGUMENT);
    c.n.M[1] = 0.0;
    assert_int_equal(carom_lcp_solve(l, &c.p, &c.at, NULL), CAROM_OK);
    carom_lcp_destroy(l);
    lcp_case_free(&c);
}

static void refuses_other_patterns(void **state)
{
    (void)state;
    lcp_case c = lcp_case_dense(&SMALL, 0);
    lcp_case full = lcp_case_dense(&SMALL, 1);
    carom_lcp *l = make(&c, NULL);
    assert_int_equal(carom_lcp_solve(l, &full.p, &c.at, NULL), CAROM_E_STATE);
    carom_lcp_problem fewer = c.p;
    fewer.n_eq = 0;
    assert_int_equal(carom_lcp_solve(l, &fewer, &c.at, NULL), CAROM_E_STATE);
    assert_int_equal(carom_lcp_solve(l, NULL, &c.at, NULL), CAROM_E_ARGUMENT);
    assert_int_equal(carom_lcp_solve(NULL, &c.p, &c.at, NULL), CAROM_E_ARGUMENT);
    assert_int_equal(carom_lcp_solve(l, &c.p, NULL, NULL), CAROM_E_ARGUMENT);
    carom_lcp_point holes = c.at;
    holes.z = NULL;
    assert_int_equal(carom_lcp_solve(l, &c.p, &holes, NULL), CAROM_E_ARGUMENT);
    carom_lcp_destroy(l);
    carom_lcp_destroy(NULL);
    lcp_case_free(&full);
    lcp_case_free(&c);
}

/* Each request fails once: CAROM_E_MEMORY, no object, nothing held. */
static void survives_exhaustion(void **state)
{
    (void)state;
    lcp_case c = lcp_case_dense(&SMALL, 0);
    carom_lcp_settings settings = carom_lcp_defaults();
    settings.certify = 1; /* the most that is ever requested */
    carom_status status = CAROM_E_MEMORY;
    long k;
    for (k = 0; k < 1000 && status != CAROM_OK; k++) {
        alloc_fail a = alloc_fail_at(k);
        const carom_allocator from = alloc_fail_allocator(&a);
        carom_lcp *l = NULL;
        status = carom_lcp_create(&c.p, &settings, &from, &l);
        if (status != CAROM_OK) {
            assert_int_equal(status, CAROM_E_MEMORY);
            assert_null(l);
        }
        carom_lcp_destroy(l);
        assert_int_equal(a.live, 0);
        assert_int_equal(a.n_live, 0);
        assert_int_equal(a.n_bad_sizes, 0);
    }
    assert_in_range(k, 30, 999); /* several requests were made, and all were failed */
    lcp_case_free(&c);
}

/* After creation nothing more is requested from the allocator, whatever is called. */
static void steady_state_requests_nothing(void **state)
{
    (void)state;
    rng r = rng_from(7);
    lcp_case c = lcp_case_planted(&r, 12, 8, 3, 0.4, LCP_MONOTONE);
    alloc_fail a = alloc_fail_never();
    const carom_allocator from = alloc_fail_allocator(&a);
    carom_lcp_settings settings = carom_lcp_defaults();
    carom_lcp *l = NULL;
    settings.certify = 1;
    assert_int_equal(carom_lcp_create(&c.p, &settings, &from, &l), CAROM_OK);
    const long calls = a.n_calls;
    size_t bytes;
    long counted;
    double bar[12] = {1.0};
    carom_lcp_cotangent cotangent = {bar, NULL, NULL};
    carom_lcp_gradient gradient;
    carom_lcp_direction direction;
    memset(&gradient, 0, sizeof gradient);
    memset(&direction, 0, sizeof direction);
    direction.q = bar;
    for (int k = 0; k < 3; k++) {
        c.n.q[k] += 0.01;
        assert_int_equal(carom_lcp_solve(l, &c.p, &c.at, NULL), CAROM_OK);
        assert_int_equal(carom_lcp_adjoint(l, &c.p, &c.at, &cotangent, &gradient, NULL), CAROM_OK);
        assert_int_equal(carom_lcp_tangent(l, &c.p, &c.at, &direction, NULL, NULL, NULL, NULL),
                         CAROM_OK);
    }
    assert_int_equal(a.n_calls, calls);
    carom_lcp_memory(l, &bytes, &counted);
    assert_int_equal(counted, calls);
    assert_int_equal(bytes, a.live);
    carom_lcp_destroy(l);
    assert_int_equal(a.live, 0);
    lcp_case_free(&c);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(solves_the_small_one),
        cmocka_unit_test(refuses_settings),
        cmocka_unit_test(refuses_patterns),
        cmocka_unit_test(refuses_numbers),
        cmocka_unit_test(refuses_other_patterns),
        cmocka_unit_test(survives_exhaustion),
        cmocka_unit_test(steady_state_requests_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
