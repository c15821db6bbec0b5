/* carom_lcp_solve: planted solutions, dense enumeration, named degenerate cases, statuses. */
#include "near.h"

#include "carom/lcp.h"
#include "lcp_case.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static carom_status solve_with(const carom_lcp_settings *settings, const lcp_case *c,
                               carom_lcp_point *at, carom_lcp_stats *stats)
{
    carom_lcp *l = NULL;
    assert_int_equal(carom_lcp_create(&c->p, settings, NULL, &l), CAROM_OK);
    const carom_status status = carom_lcp_solve(l, &c->p, at, stats);
    carom_lcp_destroy(l);
    return status;
}

static carom_status solve(const lcp_case *c, carom_lcp_point *at, carom_lcp_stats *stats)
{
    return solve_with(NULL, c, at, stats);
}

/* Numbers are of order 1 to 10 and residuals relative: accept = 1e-10 leaves less than 1e-8. */
static const double ABSOLUTE = 1e-8;

static void check_solution(const char *name, const lcp_case *c, const carom_lcp_point *at)
{
    assert_at_most(name, lcp_case_error(&c->p, at), ABSOLUTE);
}

typedef struct planted_row {
    const char *name;
    int n_x;
    int n_ineq;
    int n_eq;
    double density;
    lcp_kind kind;
    int unique; /* monotone: the planted x is the only one */
} planted_row;

static const planted_row PLANTED[] = {
    {"qp 8", 8, 6, 2, 0.5, LCP_QP, 1},
    {"qp 60", 60, 40, 10, 0.05, LCP_QP, 1},
    {"qp 300", 300, 250, 40, 0.006, LCP_QP, 1},
    {"qp no equality", 20, 15, 0, 0.2, LCP_QP, 1},
    {"qp no inequality", 20, 0, 7, 0.2, LCP_QP, 1},
    {"qp neither", 20, 0, 0, 0.2, LCP_QP, 1},
    {"no unknowns x", 0, 12, 0, 0.5, LCP_MONOTONE, 0},
    {"monotone 8", 8, 6, 2, 0.5, LCP_MONOTONE, 1},
    {"monotone 60", 60, 40, 10, 0.05, LCP_MONOTONE, 1},
    {"monotone 300", 300, 250, 40, 0.006, LCP_MONOTONE, 1},
};

static void recovers_planted_solutions(void **state)
{
    (void)state;
    rng r = rng_from(2026);
    for (size_t k = 0; k < sizeof PLANTED / sizeof PLANTED[0]; k++)
        for (int repeat = 0; repeat < 10; repeat++) {
            const planted_row *row = &PLANTED[k];
            lcp_case c =
                lcp_case_planted(&r, row->n_x, row->n_ineq, row->n_eq, row->density, row->kind);
            carom_lcp_point at = lcp_point_new(&c.p);
            carom_lcp_stats stats;
            assert_at_most(row->name, lcp_case_error(&c.p, &c.at), 1e-12); /* the plant itself */
            assert_int_equal(solve(&c, &at, &stats), CAROM_OK);
            check_solution(row->name, &c, &at);
            /* M >= 0.5: an error of ABSOLUTE in the equations moves x by its size times about 10 */
            for (int i = 0; row->unique && i < row->n_x; i++)
                assert_near_case(row->name, i, at.x[i], c.at.x[i], 10.0 * ABSOLUTE);
            free(at.x);
            lcp_case_free(&c);
        }
}

/* The plain method of the paper solves monotone problems of order 1, too. */
static void plain_method_recovers_planted_solutions(void **state)
{
    (void)state;
    rng r = rng_from(11);
    const carom_lcp_settings plain = carom_lcp_plain();
    for (int repeat = 0; repeat < 20; repeat++) {
        lcp_case c = lcp_case_planted(&r, 30, 20, 5, 0.1, repeat % 2 ? LCP_QP : LCP_MONOTONE);
        carom_lcp_point at = lcp_point_new(&c.p);
        carom_lcp_stats stats;
        assert_int_equal(solve_with(&plain, &c, &at, &stats), CAROM_OK);
        assert_int_equal(stats.starts, 1);
        assert_int_equal(stats.polish_rounds, 0);
        check_solution("plain", &c, &at);
        free(at.x);
        lcp_case_free(&c);
    }
}

/* Unscaled units, rows and columns by up to 2^40: the answer is the scaled one. */
static void solves_in_any_units(void **state)
{
    (void)state;
    rng r = rng_from(5);
    for (int repeat = 0; repeat < 20; repeat++) {
        lcp_case c = lcp_case_planted(&r, 12, 8, 3, 0.4, LCP_MONOTONE);
        double dx[12];
        double dz[8];
        for (int j = 0; j < 12; j++) dx[j] = ldexp(1.0, rng_int(&r, 41) - 20);
        for (int i = 0; i < 8; i++) dz[i] = ldexp(1.0, rng_int(&r, 41) - 20);
        for (int j = 0; j < 12; j++) {
            for (int k = c.p.M.col[j]; k < c.p.M.col[j + 1]; k++)
                c.n.M[k] *= dx[c.p.M.row[k]] * dx[j];
            for (int k = c.p.A.col[j]; k < c.p.A.col[j + 1]; k++) c.n.A[k] *= dx[j];
            for (int k = c.p.G.col[j]; k < c.p.G.col[j + 1]; k++)
                c.n.G[k] *= dz[c.p.G.row[k]] * dx[j];
            c.n.q[j] *= dx[j];
        }
        for (int j = 0; j < 8; j++) {
            for (int k = c.p.F.col[j]; k < c.p.F.col[j + 1]; k++)
                c.n.F[k] *= dz[c.p.F.row[k]] * dz[j];
            c.n.m[j] *= dz[j];
        }
        carom_lcp_point at = lcp_point_new(&c.p);
        assert_int_equal(solve(&c, &at, NULL), CAROM_OK);
        for (int j = 0; j < 12; j++)
            assert_near_case("units x", j, at.x[j] * dx[j], c.at.x[j], 10.0 * ABSOLUTE);
        for (int i = 0; i < 8; i++) {
            assert_near_case("units s", i, at.s[i] / dz[i], c.at.s[i], 100.0 * ABSOLUTE);
            assert_near_case("units z", i, at.z[i] * dz[i], c.at.z[i], 100.0 * ABSOLUTE);
        }
        free(at.x);
        lcp_case_free(&c);
    }
}

static double *random_dense(rng *r, int n, double low, double high)
{
    double *a = calloc((size_t)n + 1, sizeof *a);
    assert_non_null(a);
    for (int i = 0; i < n; i++) a[i] = rng_uniform(r, low, high);
    return a;
}

/* Distance of x from the nearest of the points that enumeration found. */
static double nearest(int n_x, int n_points, const lcp_ref_point *points, const double *x)
{
    double best = HUGE_VAL;
    for (int k = 0; k < n_points; k++) {
        double d = 0.0;
        for (int i = 0; i < n_x; i++) d = fmax(d, fabs(points[k].x[i] - x[i]));
        best = fmin(best, d);
    }
    return best;
}

/* Dense random problems with F of any kind against enumeration: a solution claimed is one of the
 * solutions there are.  With F = 0 there is exactly one, and it must be found. */
static void agrees_with_enumeration(void **state)
{
    (void)state;
    enum { MAX = 64 };
    static lcp_ref_point points[MAX];
    rng r = rng_from(99);
    int claimed = 0;
    int with_solution = 0;
    for (int repeat = 0; repeat < 300; repeat++) {
        const int nx = 1 + rng_int(&r, 6);
        const int nz = rng_int(&r, 9);
        const int ny = rng_int(&r, nx > 2 ? 3 : 1);
        const int convex = repeat % 2;
        double *M = random_dense(&r, nx * nx, 0.0, 0.0);
        for (int i = 0; i < nx; i++) M[i * nx + i] = rng_uniform(&r, 0.5, 3.0);
        double *A = random_dense(&r, ny * nx, -1, 1);
        double *G = random_dense(&r, nz * nx, -1, 1);
        double *F = random_dense(&r, nz * nz, convex ? 0 : -1, convex ? 0 : 1);
        double *q = random_dense(&r, nx, -3, 3);
        double *b = random_dense(&r, ny, -0.2, 0.2);
        double *m = random_dense(&r, nz, convex ? 0.3 : -1, 1);
        const lcp_ref d = {nx, nz, ny, M, A, G, F, q, b, m};
        const int n = lcp_ref_solve(&d, 1e-9, MAX, points);
        lcp_case c = lcp_case_dense(&d, repeat % 3 == 0);
        carom_lcp_point at = lcp_point_new(&c.p);
        const carom_status status = solve(&c, &at, NULL);
        with_solution += n > 0;
        if (status == CAROM_OK) {
            claimed++;
            check_solution("enumeration", &c, &at);
            assert_true(n > 0);
            /* bases of random problems are well conditioned up to about 1e5 */
            if (n <= MAX) assert_at_most("x", nearest(nx, n, points, at.x), 1e-4);
        }
        if (convex && n > 0) assert_int_equal(status, CAROM_OK);
        if (n == 0) assert_int_not_equal(status, CAROM_OK);
        free(M);
        free(A);
        free(G);
        free(F);
        free(q);
        free(b);
        free(m);
        free(at.x);
        lcp_case_free(&c);
    }
    print_message("enumeration: %d of %d solvable problems solved\n", claimed, with_solution);
    assert_true(with_solution > 150);
    assert_at_most("unsolved", with_solution - claimed, 0.1 * with_solution);
}

/* --- named cases; every matrix by hand, so that the answer is known exactly --- */

static const double ONE[] = {1};
static const double MINUS_ONE[] = {-1};
static const double ZERO[] = {0, 0, 0, 0};
/* Answers of order 1, condition numbers below 100: rounding times a few. */
static const double EXACT = 1e-12;
/* A pair that is zero twice is only as good as the square root of its product: an interior point
 * that stops at s z = 1e-20 leaves 1e-10. */
static const double PAIRED = 1e-9;

/* min 1/2 (x - t)^2 with x <= t: s = z = 0 at the solution x = t. */
static void pair_both_zero(void **state)
{
    (void)state;
    const double t[] = {0.0, 1.0};
    for (int k = 0; k < 2; k++) {
        const double q = -t[k];
        const lcp_ref d = {1, 1, 0, ONE, NULL, ONE, NULL, &q, NULL, &t[k]};
        lcp_case c = lcp_case_dense(&d, 0);
        assert_int_equal(solve(&c, &c.at, NULL), CAROM_OK);
        assert_near(c.at.x[0], t[k], PAIRED);
        assert_near(c.at.z[0], 0.0, PAIRED);
        assert_near(c.at.s[0], 0.0, PAIRED);
        lcp_case_free(&c);
    }
}

/* A constraint of zeros: 0 x + s = m.  m = 1: s = 1 and z = 0; m = 0: any z; m = -1: none. */
static void zero_row(void **state)
{
    (void)state;
    const double m_of[] = {1.0, 0.0, -1.0};
    for (int k = 0; k < 3; k++) {
        const lcp_ref d = {1, 1, 0, ONE, NULL, ZERO, NULL, MINUS_ONE, NULL, &m_of[k]};
        lcp_case c = lcp_case_dense(&d, k % 2);
        const carom_status status = solve(&c, &c.at, NULL);
        if (m_of[k] < 0.0) {
            assert_int_equal(status, CAROM_E_NO_SOLUTION);
        } else {
            assert_int_equal(status, CAROM_OK);
            assert_near(c.at.x[0], 1.0, EXACT);
            assert_near(c.at.s[0], m_of[k], EXACT);
            assert_near(c.at.z[0] * m_of[k], 0.0, EXACT);
        }
        lcp_case_free(&c);
    }
}

/* x_0 + x_1 = 2 three times, once doubled: x = (1, 1), the sum of the weighted y is -1. */
static void redundant_equalities(void **state)
{
    (void)state;
    const double M[] = {1, 0, 0, 1};
    const double A[] = {1, 1, 1, 1, 2, 2};
    const double b[] = {2, 2, 4};
    const lcp_ref d = {2, 0, 3, M, A, NULL, NULL, ZERO, b, NULL};
    lcp_case c = lcp_case_dense(&d, 0);
    assert_int_equal(solve(&c, &c.at, NULL), CAROM_OK);
    assert_near(c.at.x[0], 1.0, EXACT);
    assert_near(c.at.x[1], 1.0, EXACT);
    assert_near(c.at.y[0] + c.at.y[1] + 2.0 * c.at.y[2], -1.0, EXACT);
    lcp_case_free(&c);
}

/* x = 2 and x = 3: no solution, and without inequalities the equations are to blame. */
static void contradicting_equalities(void **state)
{
    (void)state;
    const double A[] = {1, 1};
    const double b[] = {2, 3};
    const lcp_ref d = {1, 0, 2, ONE, A, NULL, NULL, ZERO, b, NULL};
    lcp_case c = lcp_case_dense(&d, 0);
    c.at.x[0] = 77.0;
    assert_int_equal(solve(&c, &c.at, NULL), CAROM_E_SINGULAR);
    assert_true(c.at.x[0] == 77.0); /* untouched */
    lcp_case_free(&c);
}

/* M = 0, q = 1, no constraint: no x gives 0 x + 1 = 0.  With q = 0 any x will do. */
static void nothing_holds_x(void **state)
{
    (void)state;
    const lcp_ref bad = {1, 0, 0, ZERO, NULL, NULL, NULL, ONE, NULL, NULL};
    const lcp_ref free_x = {1, 0, 0, ZERO, NULL, NULL, NULL, ZERO, NULL, NULL};
    for (int keep = 0; keep < 2; keep++) {
        lcp_case c = lcp_case_dense(&bad, keep);
        assert_int_equal(solve(&c, &c.at, NULL), CAROM_E_SINGULAR);
        lcp_case_free(&c);
        c = lcp_case_dense(&free_x, keep);
        assert_int_equal(solve(&c, &c.at, NULL), CAROM_OK);
        lcp_case_free(&c);
    }
}

/* Linear program: min -x_0 - 2 x_1 with x_0 + x_1 <= 1, x >= 0: x = (0, 1), z = (2, 1, 0). */
static void linear_program(void **state)
{
    (void)state;
    const double G[] = {1, 1, -1, 0, 0, -1};
    const double q[] = {-1, -2};
    const double m[] = {1, 0, 0};
    const lcp_ref d = {2, 3, 0, NULL, NULL, G, NULL, q, NULL, m};
    lcp_case c = lcp_case_dense(&d, 0);
    assert_int_equal(solve(&c, &c.at, NULL), CAROM_OK);
    const double x[] = {0, 1};
    const double z[] = {2, 1, 0};
    assert_near_array("x", 2, c.at.x, x, EXACT);
    assert_near_array("z", 3, c.at.z, z, EXACT);
    lcp_case_free(&c);
}

/* x <= -1 and x >= 1: not called solved, and shown to have no solution when that is asked for. */
static void infeasible(void **state)
{
    (void)state;
    const double G[] = {1, -1};
    const double m[] = {-1, -1};
    const lcp_ref d = {1, 2, 0, ONE, NULL, G, NULL, ZERO, NULL, m};
    lcp_case c = lcp_case_dense(&d, 0);
    carom_lcp_settings settings = carom_lcp_defaults();
    carom_lcp_stats stats;
    for (int certify = 0; certify < 2; certify++) {
        settings.certify = certify;
        const carom_status expected = certify ? CAROM_E_INFEASIBLE : CAROM_E_NO_SOLUTION;
        assert_int_equal(solve_with(&settings, &c, &c.at, &stats), expected);
        assert_int_equal(stats.status, expected);
        /* the best x = 0 misses both by 1 where rows have size 1 to 3 */
        assert_true(stats.residual > 0.1);
    }
    lcp_case_free(&c);
}

/* No unknown at all. */
static void empty(void **state)
{
    (void)state;
    const lcp_ref d = {0, 0, 0, NULL, NULL, NULL, NULL, NULL, NULL, NULL};
    lcp_case c = lcp_case_dense(&d, 0);
    carom_lcp_stats stats;
    const carom_lcp_point none = {NULL, NULL, NULL, NULL};
    carom_lcp_point at = none;
    assert_int_equal(solve(&c, &at, &stats), CAROM_OK);
    assert_true(stats.residual == 0.0);
    lcp_case_free(&c);
}

/* Entries given twice add up, rows of a column come in any order. */
static void duplicates_add_up(void **state)
{
    (void)state;
    static const int col[] = {0, 3, 5};
    static const int row[] = {1, 0, 0, 1, 0};
    static const double val[] = {1, 0.5, 1.5, 2, 1}; /* [2 1; 1 2] */
    static const double q[] = {-4, -5};              /* x = (1, 2) */
    carom_lcp_problem p;
    carom_lcp *l = NULL;
    double x[2];
    memset(&p, 0, sizeof p);
    p.n_x = 2;
    p.M.col = col;
    p.M.row = row;
    p.M.val = val;
    p.q = q;
    carom_lcp_point at = {x, NULL, NULL, NULL};
    assert_int_equal(carom_lcp_create(&p, NULL, NULL, &l), CAROM_OK);
    assert_int_equal(carom_lcp_solve(l, &p, &at, NULL), CAROM_OK);
    assert_near(x[0], 1.0, EXACT);
    assert_near(x[1], 2.0, EXACT);
    carom_lcp_destroy(l);
}

/* The same solver, other numbers, then the first again: bit for bit the same answer. */
static void solves_again(void **state)
{
    (void)state;
    rng r = rng_from(3);
    lcp_case c = lcp_case_planted(&r, 20, 15, 4, 0.3, LCP_MONOTONE);
    carom_lcp_point first = lcp_point_new(&c.p);
    carom_lcp *l = NULL;
    carom_lcp_stats stats;
    assert_int_equal(carom_lcp_create(&c.p, NULL, NULL, &l), CAROM_OK);
    assert_int_equal(carom_lcp_solve(l, &c.p, &first, NULL), CAROM_OK);
    double q[20];
    memcpy(q, c.n.q, sizeof q);
    for (int i = 0; i < 20; i++) c.n.q[i] += 0.5;
    assert_int_equal(carom_lcp_solve(l, &c.p, &c.at, &stats), CAROM_OK);
    check_solution("other numbers", &c, &c.at);
    memcpy(c.n.q, q, sizeof q);
    assert_int_equal(carom_lcp_solve(l, &c.p, &c.at, NULL), CAROM_OK);
    assert_memory_equal(first.x, c.at.x, 20 * sizeof(double));
    assert_memory_equal(first.z, c.at.z, 15 * sizeof(double));
    carom_lcp_destroy(l);
    free(first.x);
    lcp_case_free(&c);
}

/* The residual against errors put in by hand, by size and place. */
static void residual_sees_errors(void **state)
{
    (void)state;
    rng r = rng_from(17);
    lcp_case c = lcp_case_planted(&r, 8, 6, 2, 0.5, LCP_MONOTONE);
    carom_lcp *l = NULL;
    assert_int_equal(carom_lcp_create(&c.p, NULL, NULL, &l), CAROM_OK);
    assert_at_most("planted", carom_lcp_residual(l, &c.p, &c.at), 1e-14);
    double *const entry[] = {c.at.x, c.at.s, c.at.z, c.at.y};
    const int n[] = {8, 6, 6, 2};
    for (int a = 0; a < 4; a++)
        for (int i = 0; i < n[a]; i++)
            for (int k = 2; k <= 8; k += 3) {
                const double kept = entry[a][i];
                const double error = pow(10.0, -k);
                entry[a][i] += error;
                /* rows of this problem have sizes from 0.5 to 50 */
                const double seen = carom_lcp_residual(l, &c.p, &c.at);
                assert_true(seen > 1e-3 * error && seen < 10.0 * error);
                entry[a][i] = NAN;
                assert_true(carom_lcp_residual(l, &c.p, &c.at) == HUGE_VAL);
                entry[a][i] = kept;
            }
    carom_lcp_destroy(l);
    lcp_case_free(&c);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(recovers_planted_solutions),
        cmocka_unit_test(plain_method_recovers_planted_solutions),
        cmocka_unit_test(solves_in_any_units),
        cmocka_unit_test(agrees_with_enumeration),
        cmocka_unit_test(pair_both_zero),
        cmocka_unit_test(zero_row),
        cmocka_unit_test(redundant_equalities),
        cmocka_unit_test(contradicting_equalities),
        cmocka_unit_test(nothing_holds_x),
        cmocka_unit_test(linear_program),
        cmocka_unit_test(infeasible),
        cmocka_unit_test(empty),
        cmocka_unit_test(duplicates_add_up),
        cmocka_unit_test(solves_again),
        cmocka_unit_test(residual_sees_errors),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
