/* certify.h: no false alarm on problems with a solution, an alarm on those without. */
#include "near.h"

#include "lcp_case.h"
#include "libsolver/lcp/certify.h"

#include <string.h>

static int shown_infeasible(const carom_lcp_problem *p)
{
    crm_memory memory = crm_memory_from(NULL);
    crm_certifier c;
    memset(&c, 0, sizeof c);
    assert_int_equal(crm_certifier_create(&c, &memory, p), CAROM_OK);
    const int answer = crm_certify(&c, p);
    crm_certifier_destroy(&c, &memory);
    assert_int_equal(memory.live, 0);
    return answer;
}

/* Problems with a planted solution are never shown infeasible. */
static void no_false_alarm(void **state)
{
    (void)state;
    rng r = rng_from(61);
    for (int repeat = 0; repeat < 100; repeat++) {
        const int nz = rng_int(&r, 12);
        const int ny = rng_int(&r, 5);
        lcp_case c = lcp_case_planted(&r, 10, nz, ny, 0.4, (lcp_kind)(repeat % 3));
        assert_false(shown_infeasible(&c.p));
        lcp_case_free(&c);
    }
}

/* A planted problem plus the constraint that contradicts row 0, by `gap`: -G_0 x - s' = ... so that
 * G_0 x <= m_0 and G_0 x >= m_0 + gap.  F = 0. */
static void contradiction_is_shown(void **state)
{
    (void)state;
    enum { NX = 8, NZ = 6, NY = 2 };
    rng r = rng_from(67);
    const double gaps[] = {1e-3, 1e-1, 10.0};
    for (int repeat = 0; repeat < 30; repeat++) {
        double M[NX * NX] = {0};
        double A[NY * NX];
        double G[NZ * NX];
        double q[NX];
        double b[NY];
        double m[NZ];
        for (int i = 0; i < NX; i++) M[i * NX + i] = rng_uniform(&r, 0.5, 2.0);
        for (int i = 0; i < NY * NX; i++) A[i] = rng_uniform(&r, -1.0, 1.0);
        for (int i = 0; i < NZ * NX; i++) G[i] = rng_uniform(&r, -1.0, 1.0);
        for (int i = 0; i < NX; i++) q[i] = rng_uniform(&r, -1.0, 1.0);
        for (int i = 0; i < NY; i++) b[i] = rng_uniform(&r, -1.0, 1.0);
        for (int i = 0; i < NZ; i++) m[i] = rng_uniform(&r, 0.0, 1.0);
        for (int j = 0; j < NX; j++) G[(NZ - 1) * NX + j] = -G[j];
        m[NZ - 1] = -m[0] - gaps[repeat % 3];
        const lcp_ref d = {NX, NZ, NY, M, A, G, NULL, q, b, m};
        lcp_case c = lcp_case_dense(&d, 0);
        assert_true(shown_infeasible(&c.p));
        c.n.m[NZ - 1] = -m[0] + 1e-3; /* a slab of width 1e-3 remains */
        assert_false(shown_infeasible(&c.p));
        lcp_case_free(&c);
    }
}

/* Through F: s + z = -1 with s, z >= 0; and x = 1 beside x = 2. */
static void small_ones(void **state)
{
    (void)state;
    const double one[] = {1, 1};
    const double minus_one[] = {-1};
    const double b[] = {1, 2};
    const double q[] = {0};
    const lcp_ref coupled = {0, 1, 0, NULL, NULL, NULL, one, NULL, NULL, minus_one};
    const lcp_ref joints = {1, 0, 2, one, one, NULL, NULL, q, b, NULL};
    lcp_case c = lcp_case_dense(&coupled, 0);
    assert_true(shown_infeasible(&c.p));
    c.n.m[0] = 1.0;
    assert_false(shown_infeasible(&c.p));
    lcp_case_free(&c);
    c = lcp_case_dense(&joints, 0);
    assert_true(shown_infeasible(&c.p));
    c.n.b[1] = 1.0;
    assert_false(shown_infeasible(&c.p));
    lcp_case_free(&c);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(no_false_alarm),
        cmocka_unit_test(contradiction_is_shown),
        cmocka_unit_test(small_ones),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
