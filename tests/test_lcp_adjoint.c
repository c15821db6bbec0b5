/* carom_lcp_adjoint and carom_lcp_tangent: all seven inputs against central differences for each of
 * the three outputs, the transposed identity, degenerate and singular points. */
#include "near.h"

#include "carom/lcp.h"
#include "fdiff.h"
#include "lcp_case.h"

#include <stdlib.h>
#include <string.h>

/* Differences: h = 2e-3 with Richardson leaves C h^4 = 1e-11 C, and the solver's 1e-13 / h = 1e-10;
 * C is the fifth derivative, at most a few hundred here. */
static const double STEP = 2e-3;
static const double DIFFERENCE = 1e-7;

/* The loss <x_bar, x> + <z_bar, z> + <y_bar, y> of a problem solved anew. */
typedef struct loss {
    lcp_case *c;
    carom_lcp *l;
    carom_lcp_point at;
    carom_lcp_cotangent bar;
} loss;

static double dot(int n, const double *a, const double *b)
{
    double sum = 0.0;
    for (int i = 0; a && b && i < n; i++) sum += a[i] * b[i];
    return sum;
}

static double evaluate(void *user)
{
    loss *u = user;
    const carom_lcp_problem *p = &u->c->p;
    assert_int_equal(carom_lcp_solve(u->l, p, &u->at, NULL), CAROM_OK);
    return dot(p->n_x, u->bar.x, u->at.x) + dot(p->n_ineq, u->bar.z, u->at.z) +
           dot(p->n_eq, u->bar.y, u->at.y);
}

static carom_lcp *make(const lcp_case *c)
{
    carom_lcp_settings settings = carom_lcp_defaults();
    carom_lcp *l = NULL;
    settings.accept = 1e-13;
    assert_int_equal(carom_lcp_create(&c->p, &settings, NULL, &l), CAROM_OK);
    return l;
}

/* Seven gradients in one block, freed through M. */
static carom_lcp_gradient gradient_new(const lcp_case *c)
{
    const int n[] = {c->nnz[0], c->nnz[1], c->nnz[2], c->nnz[3], c->p.n_x, c->p.n_eq, c->p.n_ineq};
    carom_lcp_gradient g;
    double **const part[] = {&g.M, &g.A, &g.G, &g.F, &g.q, &g.b, &g.m};
    size_t total = 1;
    for (int k = 0; k < 7; k++) total += (size_t)n[k];
    double *at = calloc(total, sizeof *at);
    assert_non_null(at);
    for (int k = 0; k < 7; k++) {
        *part[k] = at;
        at += n[k];
    }
    return g;
}

static void check_array(const char *name, loss *u, int n, double *input, const double *bar)
{
    for (int i = 0; i < n; i++) {
        const double d = fdiff_entry(evaluate, u, &input[i], STEP, NULL);
        assert_near_case(name, i, bar[i], d, DIFFERENCE * (1.0 + fabs(d)));
    }
}

/* Position of entry (i, j) of M. */
static int place(const carom_sparse *M, int i, int j)
{
    for (int k = M->col[j]; k < M->col[j + 1]; k++)
        if (M->row[k] == i) return k;
    fail();
    return -1;
}

typedef struct mirrored {
    loss *u;
    double *one;
    double *other;
    double start;
} mirrored;

static double evaluate_mirrored(double t, void *user)
{
    mirrored *m = user;
    *m->one = m->start + t;
    *m->other = m->start + t;
    return evaluate(m->u);
}

/* M moves in both triangles at once. */
static void check_symmetric(const char *name, loss *u, const double *bar)
{
    const carom_sparse *M = &u->c->p.M;
    for (int j = 0; j < u->c->p.n_x; j++)
        for (int k = M->col[j]; k < M->col[j + 1]; k++) {
            const int i = M->row[k];
            const int t = place(M, j, i);
            if (i > j) continue;
            mirrored m = {u, &u->c->n.M[k], &u->c->n.M[t], u->c->n.M[k]};
            const double d = fdiff(evaluate_mirrored, &m, STEP, NULL);
            *m.one = *m.other = m.start;
            const double both = i == j ? bar[k] : bar[k] + bar[t];
            assert_near_case(name, k, both, d, DIFFERENCE * (1.0 + fabs(d)));
            assert_true(bar[k] == bar[t]);
        }
}

static void check_against_differences(lcp_case *c, const carom_lcp_cotangent *bar)
{
    loss u = {c, make(c), lcp_point_new(&c->p), *bar};
    carom_lcp_gradient g = gradient_new(c);
    carom_lcp_derivative info;
    evaluate(&u);
    assert_int_equal(carom_lcp_adjoint(u.l, &c->p, &u.at, bar, &g, &info), CAROM_OK);
    assert_int_equal(info.degenerate, 0);
    assert_int_equal(info.singular, 0);
    assert_at_most("linear residual", info.residual, 1e-14);
    check_symmetric("M", &u, g.M);
    check_array("A", &u, c->nnz[1], c->n.A, g.A);
    check_array("G", &u, c->nnz[2], c->n.G, g.G);
    check_array("F", &u, c->nnz[3], c->n.F, g.F);
    check_array("q", &u, c->p.n_x, c->n.q, g.q);
    check_array("b", &u, c->p.n_eq, c->n.b, g.b);
    check_array("m", &u, c->p.n_ineq, c->n.m, g.m);
    free(g.M);
    free(u.at.x);
    carom_lcp_destroy(u.l);
}

static double *random_vector(rng *r, int n)
{
    double *a = calloc((size_t)n + 1, sizeof *a);
    assert_non_null(a);
    for (int i = 0; i < n; i++) a[i] = rng_uniform(r, -1.0, 1.0);
    return a;
}

typedef struct derivative_row {
    int n_x;
    int n_ineq;
    int n_eq;
    lcp_kind kind;
} derivative_row;

static const derivative_row ROWS[] = {
    {6, 5, 2, LCP_QP}, {6, 5, 2, LCP_MONOTONE}, {6, 5, 2, LCP_GENERAL},  {6, 5, 0, LCP_MONOTONE},
    {6, 0, 2, LCP_QP}, {5, 0, 0, LCP_QP},       {0, 5, 0, LCP_MONOTONE},
};

/* The planted points are strictly complementary: z_i or s_i at least 0.5. */
static void agrees_with_differences(void **state)
{
    (void)state;
    rng r = rng_from(41);
    for (size_t k = 0; k < sizeof ROWS / sizeof ROWS[0]; k++)
        for (int repeat = 0; repeat < 2; repeat++) {
            const derivative_row *row = &ROWS[k];
            lcp_case c = lcp_case_planted(&r, row->n_x, row->n_ineq, row->n_eq, 0.5, row->kind);
            double *x = random_vector(&r, row->n_x);
            double *z = random_vector(&r, row->n_ineq);
            double *y = random_vector(&r, row->n_eq);
            const carom_lcp_cotangent bars[] = {{x, NULL, NULL}, {NULL, z, NULL}, {NULL, NULL, y}};
            for (int b = 0; b < 3; b++) check_against_differences(&c, &bars[b]);
            free(x);
            free(z);
            free(y);
            lcp_case_free(&c);
        }
}

/* A direction of the data, M symmetric; the arrays of g. */
static carom_lcp_direction random_direction(rng *r, const lcp_case *c, const carom_lcp_gradient *g)
{
    double *const part[] = {g->M, g->A, g->G, g->F, g->q, g->b, g->m};
    const int n[] = {c->nnz[0], c->nnz[1], c->nnz[2], c->nnz[3], c->p.n_x, c->p.n_eq, c->p.n_ineq};
    for (int k = 0; k < 7; k++)
        for (int i = 0; i < n[k]; i++) part[k][i] = rng_uniform(r, -1.0, 1.0);
    for (int j = 0; j < c->p.n_x; j++)
        for (int k = c->p.M.col[j]; k < c->p.M.col[j + 1]; k++)
            g->M[place(&c->p.M, j, c->p.M.row[k])] = g->M[k];
    const carom_lcp_direction d = {g->M, g->A, g->G, g->F, g->q, g->b, g->m};
    return d;
}

static double pair_gradient(const lcp_case *c, const carom_lcp_gradient *g,
                            const carom_lcp_direction *d)
{
    return dot(c->nnz[0], g->M, d->M) + dot(c->nnz[1], g->A, d->A) + dot(c->nnz[2], g->G, d->G) +
           dot(c->nnz[3], g->F, d->F) + dot(c->p.n_x, g->q, d->q) + dot(c->p.n_eq, g->b, d->b) +
           dot(c->p.n_ineq, g->m, d->m);
}

/* <bar, J d> = <J' bar, d>: two solves of one matrix, so only rounding times its condition (at most
 * 1e4 here) is left. */
static void transposed_identity(void **state)
{
    (void)state;
    rng r = rng_from(43);
    for (int repeat = 0; repeat < 60; repeat++) {
        const lcp_kind kind = (lcp_kind)(repeat % 3);
        lcp_case c = lcp_case_planted(&r, 30, 20, 6, 0.15, kind);
        carom_lcp *l = make(&c);
        double *x = random_vector(&r, 30);
        double *z = random_vector(&r, 20);
        double *y = random_vector(&r, 6);
        double dx[30];
        double dz[20];
        double dy[6];
        const carom_lcp_cotangent bar = {x, z, y};
        carom_lcp_gradient g = gradient_new(&c);
        carom_lcp_gradient room = gradient_new(&c);
        const carom_lcp_direction d = random_direction(&r, &c, &room);
        assert_int_equal(carom_lcp_adjoint(l, &c.p, &c.at, &bar, &g, NULL), CAROM_OK);
        assert_int_equal(carom_lcp_tangent(l, &c.p, &c.at, &d, dx, dz, dy, NULL), CAROM_OK);
        const double left = dot(30, x, dx) + dot(20, z, dz) + dot(6, y, dy);
        const double size = 1.0 + near_norm(30, dx) + near_norm(20, dz) + near_norm(6, dy);
        assert_near_case("identity", repeat, pair_gradient(&c, &g, &d), left, 1e-11 * size);
        free(g.M);
        free(room.M);
        free(x);
        free(z);
        free(y);
        carom_lcp_destroy(l);
        lcp_case_free(&c);
    }
}

static const double ONE[] = {1};

/* min 1/2 (x - 1)^2 with x <= m = 1: x = min(1, m) has slopes 1 to the left and 0 to the right.
 * The convention is the inactive side: dx/dm = 0, dx/dq = -1. */
static void one_sided_where_degenerate(void **state)
{
    (void)state;
    const double q[] = {-1};
    const lcp_ref d = {1, 1, 0, ONE, NULL, ONE, NULL, q, NULL, ONE};
    lcp_case c = lcp_case_dense(&d, 0);
    carom_lcp *l = make(&c);
    const carom_lcp_cotangent bar = {ONE, NULL, NULL};
    double dm = 77.0;
    double dq = 77.0;
    carom_lcp_gradient g = {NULL, NULL, NULL, NULL, &dq, NULL, &dm};
    carom_lcp_derivative info;
    c.at.x[0] = 1.0;
    c.at.s[0] = c.at.z[0] = 0.0;
    assert_int_equal(carom_lcp_adjoint(l, &c.p, &c.at, &bar, &g, &info), CAROM_OK);
    assert_int_equal(info.degenerate, 1);
    assert_true(dm == 0.0);
    assert_near(dq, -1.0, 1e-15);
    carom_lcp_destroy(l);
    lcp_case_free(&c);
}

/* x_0 + x_1 = b three times over.  x is unique: its derivatives exist and are found; y is not, only
 * the sum of the three is. */
static void redundant_equalities(void **state)
{
    (void)state;
    const double M[] = {1, 0, 0, 3};
    const double A[] = {1, 1, 1, 1, 1, 1};
    const double b[] = {4, 4, 4};
    const double q[] = {0, 0};
    const lcp_ref d = {2, 0, 3, M, A, NULL, NULL, q, b, NULL};
    lcp_case c = lcp_case_dense(&d, 0);
    carom_lcp *l = make(&c);
    carom_lcp_derivative info;
    double dq[2] = {77, 77};
    double db[3];
    carom_lcp_gradient g = {NULL, NULL, NULL, NULL, dq, db, NULL};
    const double x_bar[] = {1, 0};
    const double sum_bar[] = {1, 1, 1};
    const double first_bar[] = {1, 0, 0};
    const carom_lcp_cotangent of_x = {x_bar, NULL, NULL};
    const carom_lcp_cotangent of_sum = {NULL, NULL, sum_bar};
    const carom_lcp_cotangent of_first = {NULL, NULL, first_bar};
    assert_int_equal(carom_lcp_solve(l, &c.p, &c.at, NULL), CAROM_OK);
    /* x_0 = 3/4 b + (q_1 - q_0)/4: proximal refinement ends at rounding over 1e-9 in y alone */
    assert_int_equal(carom_lcp_adjoint(l, &c.p, &c.at, &of_x, &g, &info), CAROM_OK);
    assert_int_equal(info.singular, 1);
    assert_near(dq[0], -0.25, 1e-12);
    assert_near(dq[1], 0.25, 1e-12);
    assert_near(db[0] + db[1] + db[2], 0.75, 1e-12);
    /* y_0 + y_1 + y_2 = -x_0 - q_0 */
    assert_int_equal(carom_lcp_adjoint(l, &c.p, &c.at, &of_sum, &g, &info), CAROM_OK);
    assert_near(dq[0], -0.75, 1e-12);
    assert_near(dq[1], -0.25, 1e-12);
    dq[0] = 77.0;
    assert_int_equal(carom_lcp_adjoint(l, &c.p, &c.at, &of_first, &g, NULL), CAROM_E_SINGULAR);
    assert_true(dq[0] == 77.0); /* untouched */
    /* raising one of three equal equations leaves no solution: no tangent */
    carom_lcp_direction e = {NULL, NULL, NULL, NULL, NULL, first_bar, NULL};
    double dx[2];
    assert_int_equal(carom_lcp_tangent(l, &c.p, &c.at, &e, dx, NULL, NULL, NULL), CAROM_E_SINGULAR);
    e.b = sum_bar;
    assert_int_equal(carom_lcp_tangent(l, &c.p, &c.at, &e, dx, NULL, NULL, NULL), CAROM_OK);
    assert_near(dx[0], 0.75, 1e-12);
    assert_near(dx[1], 0.25, 1e-12);
    carom_lcp_destroy(l);
    lcp_case_free(&c);
}

static void refuses_what_is_no_solution(void **state)
{
    (void)state;
    rng r = rng_from(47);
    lcp_case c = lcp_case_planted(&r, 6, 5, 2, 0.5, LCP_MONOTONE);
    carom_lcp *l = make(&c);
    double x_bar[6] = {1, 0, 0, 0, 0, 0};
    double dq[6] = {77, 77, 77, 77, 77, 77};
    const carom_lcp_cotangent bar = {x_bar, NULL, NULL};
    carom_lcp_gradient g = {NULL, NULL, NULL, NULL, dq, NULL, NULL};
    c.at.x[0] += 1e-3;
    assert_int_equal(carom_lcp_adjoint(l, &c.p, &c.at, &bar, &g, NULL), CAROM_E_ARGUMENT);
    c.at.x[0] -= 1e-3;
    x_bar[3] = NAN;
    assert_int_equal(carom_lcp_adjoint(l, &c.p, &c.at, &bar, &g, NULL), CAROM_E_ARGUMENT);
    x_bar[3] = 0.0;
    assert_int_equal(carom_lcp_adjoint(l, &c.p, &c.at, NULL, &g, NULL), CAROM_E_ARGUMENT);
    assert_int_equal(carom_lcp_adjoint(l, &c.p, &c.at, &bar, NULL, NULL), CAROM_E_ARGUMENT);
    assert_int_equal(carom_lcp_tangent(l, &c.p, &c.at, NULL, NULL, NULL, NULL, NULL),
                     CAROM_E_ARGUMENT);
    assert_true(dq[0] == 77.0);
    assert_int_equal(carom_lcp_adjoint(l, &c.p, &c.at, &bar, &g, NULL), CAROM_OK);
    carom_lcp_destroy(l);
    lcp_case_free(&c);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(agrees_with_differences),     cmocka_unit_test(transposed_identity),
        cmocka_unit_test(one_sided_where_degenerate),  cmocka_unit_test(redundant_equalities),
        cmocka_unit_test(refuses_what_is_no_solution),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
