/* kkt.h: assembly against the dense definition, solves and transposed solves, reused pivots,
 * singular matrices, failing allocator. */
#include "near.h"

#include "alloc_fail.h"
#include "lcp_case.h"
#include "libsolver/lcp/kkt.h"

#include <stdlib.h>
#include <string.h>

enum { NX = 7, NZ = 5, NY = 2, N = NX + NZ + NY };

static const crm_kkt_reg NONE = {0.0, 0.0, 0.0};

typedef struct fixture {
    crm_memory memory;
    crm_kkt k;
    lcp_case c;
    double w[NZ];
    double v[NZ];
    double dense[N * N]; /* K, rows */
} fixture;

static void add_block(double *K, const carom_sparse *a, int n_cols, int row0, int col0,
                      const double *w, int transposed)
{
    for (int j = 0; j < n_cols; j++)
        for (int p = a->col[j]; p < a->col[j + 1]; p++) {
            const int i = a->row[p];
            const double value = a->val[p] * (w ? w[i] : 1.0);
            if (transposed)
                K[(row0 + j) * N + col0 + i] += value;
            else
                K[(row0 + i) * N + col0 + j] += value;
        }
}

/* [M G' A'; w G, w F - D(v), 0; A 0 0] */
static void make_dense(fixture *f)
{
    memset(f->dense, 0, sizeof f->dense);
    add_block(f->dense, &f->c.p.M, NX, 0, 0, NULL, 0);
    add_block(f->dense, &f->c.p.G, NX, 0, NX, NULL, 1);
    add_block(f->dense, &f->c.p.A, NX, 0, NX + NZ, NULL, 1);
    add_block(f->dense, &f->c.p.G, NX, NX, 0, f->w, 0);
    add_block(f->dense, &f->c.p.F, NZ, NX, NX, f->w, 0);
    add_block(f->dense, &f->c.p.A, NX, NX + NZ, 0, NULL, 0);
    for (int i = 0; i < NZ; i++) f->dense[(NX + i) * N + NX + i] -= f->v[i];
}

static void set_up(fixture *f, uint64_t seed)
{
    rng r = rng_from(seed);
    memset(f, 0, sizeof *f);
    f->memory = crm_memory_from(NULL);
    f->c = lcp_case_planted(&r, NX, NZ, NY, 0.5, LCP_MONOTONE);
    for (int i = 0; i < NZ; i++) {
        f->w[i] = rng_uniform(&r, 0.1, 0.9);
        f->v[i] = 1.0 - f->w[i];
    }
    assert_int_equal(crm_kkt_create(&f->k, &f->memory, &f->c.p), CAROM_OK);
    make_dense(f);
}

static void tear_down(fixture *f)
{
    crm_kkt_destroy(&f->k, &f->memory);
    assert_int_equal(f->memory.live, 0);
    lcp_case_free(&f->c);
}

static void assembles(void **state)
{
    (void)state;
    fixture f;
    set_up(&f, 1);
    const crm_kkt_reg reg = {0.25, 0.5, 0.125};
    crm_kkt_assemble(&f.k, &f.c.p, f.w, f.v, reg);
    double K[N * N] = {0};
    for (int j = 0; j < N; j++)
        for (int p = f.k.col[j]; p < f.k.col[j + 1]; p++) {
            assert_true(p == f.k.col[j] || f.k.row[p] > f.k.row[p - 1]); /* sorted, merged */
            K[f.k.row[p] * N + j] = f.k.val[p];
        }
    for (int i = 0; i < N; i++) f.dense[i * N + i] += i < NX ? 0.25 : i < NX + NZ ? -0.5 : -0.125;
    assert_near_array("K", N * N, K, f.dense, 1e-15); /* one addition per entry, order 1 */
    tear_down(&f);
}

/* Conditions of these matrices stay below 1e4. */
static void solves(void **state)
{
    (void)state;
    for (int transposed = 0; transposed < 2; transposed++)
        for (uint64_t seed = 1; seed <= 10; seed++) {
            fixture f;
            set_up(&f, seed);
            const crm_kkt_reg regs[] = {NONE, {1e-6, 1e-6, 1e-6}};
            for (int q = 0; q < 2; q++) { /* refinement takes the regularization out again */
                rng r = rng_from(seed + 100);
                double rhs[N];
                double expected[N];
                double u[N] = {0};
                double K[N * N];
                for (int i = 0; i < N; i++) expected[i] = rhs[i] = rng_uniform(&r, -1, 1);
                for (int i = 0; i < N; i++)
                    for (int j = 0; j < N; j++)
                        K[i * N + j] = f.dense[transposed ? j * N + i : i * N + j];
                assert_true(lcp_ref_linear(N, K, expected) > 0.0);
                crm_kkt_assemble(&f.k, &f.c.p, f.w, f.v, regs[q]);
                assert_int_equal(crm_kkt_factor(&f.k), CAROM_OK);
                assert_at_most("residual", crm_kkt_solve(&f.k, transposed, 8, rhs, u), 1e-15);
                assert_near_array("u", N, u, expected, 1e-11);
            }
            assert_int_equal(f.k.factorizations, 1);
            assert_int_equal(f.k.refactorizations, 1);
            tear_down(&f);
        }
}

/* Pivots chosen for one matrix, then zero in the next: a fresh factorization is made by itself. */
static void changes_pivots(void **state)
{
    (void)state;
    static const double M[] = {1, 2, 2, 0};
    static const double later[] = {0, 2, 2, 0}; /* the pivot (0, 0) vanishes */
    static const double q[] = {0, 0};
    const lcp_ref d = {2, 0, 0, M, NULL, NULL, NULL, q, NULL, NULL};
    lcp_case c = lcp_case_dense(&d, 1);
    crm_memory memory = crm_memory_from(NULL);
    crm_kkt k;
    const double rhs[] = {2, 4};
    double u[] = {0, 0};
    memset(&k, 0, sizeof k);
    assert_int_equal(crm_kkt_create(&k, &memory, &c.p), CAROM_OK);
    crm_kkt_assemble(&k, &c.p, NULL, NULL, NONE);
    assert_int_equal(crm_kkt_factor(&k), CAROM_OK);
    for (int i = 0; i < 4; i++) c.n.M[i] = later[i];
    crm_kkt_assemble(&k, &c.p, NULL, NULL, NONE);
    assert_int_equal(crm_kkt_factor(&k), CAROM_OK);
    assert_at_most("residual", crm_kkt_solve(&k, 0, 2, rhs, u), 1e-15);
    assert_near(u[0], 2.0, 1e-15);
    assert_near(u[1], 1.0, 1e-15);
    for (int i = 0; i < 4; i++) c.n.M[i] = 1.0; /* rank one */
    crm_kkt_assemble(&k, &c.p, NULL, NULL, NONE);
    const carom_status status = crm_kkt_factor(&k);
    assert_true(status == CAROM_E_SINGULAR || crm_kkt_condition(&k) > 1e15);
    crm_kkt_destroy(&k, &memory);
    assert_int_equal(memory.live, 0);
    lcp_case_free(&c);
}

/* 1-norm condition of a diagonal matrix, exactly. */
static void estimates_condition(void **state)
{
    (void)state;
    static const double M[] = {4, 0, 0, 0.5};
    static const double q[] = {0, 0};
    const lcp_ref d = {2, 0, 0, M, NULL, NULL, NULL, q, NULL, NULL};
    lcp_case c = lcp_case_dense(&d, 0);
    crm_memory memory = crm_memory_from(NULL);
    crm_kkt k;
    memset(&k, 0, sizeof k);
    assert_int_equal(crm_kkt_create(&k, &memory, &c.p), CAROM_OK);
    assert_true(crm_kkt_condition(&k) == HUGE_VAL); /* no factors yet */
    crm_kkt_assemble(&k, &c.p, NULL, NULL, NONE);
    assert_int_equal(crm_kkt_factor(&k), CAROM_OK);
    assert_near(crm_kkt_condition(&k), 8.0, 1e-12);
    crm_kkt_destroy(&k, &memory);
    lcp_case_free(&c);
}

static void survives_exhaustion(void **state)
{
    (void)state;
    rng r = rng_from(2);
    lcp_case c = lcp_case_planted(&r, NX, NZ, NY, 0.5, LCP_MONOTONE);
    carom_status status = CAROM_E_MEMORY;
    int k;
    for (k = 0; k < 100 && status != CAROM_OK; k++) {
        alloc_fail a = alloc_fail_at(k);
        const carom_allocator from = alloc_fail_allocator(&a);
        crm_memory memory = crm_memory_from(&from);
        crm_kkt kkt;
        memset(&kkt, 0, sizeof kkt);
        status = crm_kkt_create(&kkt, &memory, &c.p);
        assert_true(status == CAROM_OK || status == CAROM_E_MEMORY);
        crm_kkt_destroy(&kkt, &memory);
        assert_int_equal(a.live, 0);
        assert_int_equal(a.n_bad_sizes, 0);
    }
    assert_in_range(k, 10, 99);
    lcp_case_free(&c);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(assembles),           cmocka_unit_test(solves),
        cmocka_unit_test(changes_pivots),      cmocka_unit_test(estimates_condition),
        cmocka_unit_test(survives_exhaustion),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
