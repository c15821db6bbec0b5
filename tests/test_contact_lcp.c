/* The structured solver beside the general one of libsolver/lcp on the four-variable form: the same
 * motion, and the same gradient, from different matrices. */
#include "carom/contact.h"
#include "carom/lcp.h"
#include "contact_families.h"
#include "four_variables.h"
#include "near.h"

#include <stdlib.h>
#include <string.h>

/* Two solvers to 1e-10 V, V of order 1, conditioned to 1e2; the general adjoint solves a singular
 * system in the least-squares sense. */
#define SAME_MOTION   1e-8
#define SAME_GRADIENT 1e-10
/* What decides a mode is farther from zero than this, else the point is passed over. */
#define MARGIN 1e-3

static double dot_row(const double *row, const int *body, const double *v)
{
    double s = 0;
    for (int i = 0; i < 6; i++) {
        if (body[i / 3] >= 0) s += row[i] * v[3 * body[i / 3] + i % 3];
    }
    return s;
}

/* Strictly complementary, so that the solution is smooth here. */
static int nondegenerate(const contact_case *c)
{
    for (int k = 0; k < c->p.n_contacts; k++) {
        const int *body = c->contact_body + 2 * k;
        const double a = dot_row(c->jn + 6 * k, body, c->x.v) + c->cn[k];
        const double u = dot_row(c->jt + 6 * k, body, c->x.v);
        const int mode = c->x.mode[k];
        if (mode == CAROM_SEPARATED && a < MARGIN) return 0;
        if (mode == CAROM_SEPARATED) continue;
        if (c->x.ln[k] < MARGIN) return 0;
        if (mode == CAROM_STICK && c->mu[k] * c->x.ln[k] - fabs(c->x.lt[k]) < MARGIN) return 0;
        if (mode != CAROM_STICK && fabs(u) < MARGIN) return 0;
    }
    return 1;
}

/* z = (l_n, (l+, l-) of each, g), s = m - G x - F z of the contact solution. */
static void make_point(const contact_case *c, carom_lcp_point *at)
{
    const int n = c->p.n_contacts;
    for (int k = 0; k < n; k++) {
        const int *body = c->contact_body + 2 * k;
        const double u = dot_row(c->jt + 6 * k, body, c->x.v);
        const double lt = c->x.lt[k];
        const double g = c->x.mode[k] != CAROM_STICK ? fabs(u) : 0;
        double *f = at->z + n + 2 * k;
        double *sigma = at->s + n + 2 * k;
        at->z[k] = c->x.ln[k];
        at->s[k] =
            c->x.mode[k] != CAROM_SEPARATED ? 0 : dot_row(c->jn + 6 * k, body, c->x.v) + c->cn[k];
        f[0] = fmax(lt, 0);
        f[1] = fmax(-lt, 0);
        sigma[0] = f[0] > 0 ? 0 : u + g;
        sigma[1] = f[1] > 0 ? 0 : -u + g;
        at->z[3 * n + k] = g;
        at->s[3 * n + k] = g > 0 ? 0 : c->mu[k] * c->x.ln[k] - f[0] - f[1];
    }
    for (int r = 0; r < c->p.n_joint_rows; r++) at->y[r] = -c->x.le[r];
}

static void compare(const contact_case *c, carom_contact_solver *s, rng *r)
{
    problem_file f = contact_case_to_file(c);
    four_variables v;
    carom_lcp *lcp;
    const int nb = 3 * c->p.n_bodies;
    double v_bar[60];
    double u_bar[60];
    double q_bar[60];
    double *z = calloc(2 * 400 + 200, sizeof *z);
    assert_int_equal(four_variables_make(&f, &v), 0);
    assert_true(nb <= 60 && v.problem.n_ineq <= 400 && v.problem.n_eq <= 200);
    carom_lcp_point at = {c->x.v, z, z + 400, z + 800};
    for (int i = 0; i < nb; i++) v_bar[i] = rng_uniform(r, -1, 1);
    carom_contact_bars bars = {.u = u_bar};
    assert_int_equal(carom_contact_adjoint(s, &c->p, &c->x, v_bar, &bars), CAROM_OK);
    assert_int_equal(carom_lcp_create(&v.problem, NULL, NULL, &lcp), CAROM_OK);
    make_point(c, &at);
    assert_at_most("point of the general form", carom_lcp_residual(lcp, &v.problem, &at), 1e-8);
    const carom_lcp_cotangent cotangent = {.x = v_bar};
    carom_lcp_gradient gradient = {.q = q_bar};
    assert_true(carom_lcp_adjoint(lcp, &v.problem, &at, &cotangent, &gradient, NULL) >= 0);
    for (int i = 0; i < nb; i++) /* q = -M u */
        assert_near_case("u_bar", i, u_bar[i], -q_bar[i] / c->inv_mass[i], SAME_GRADIENT);
    carom_lcp_destroy(lcp);
    free(z);
    four_variables_free(&v);
    contact_case_free_file(&f);
}

static const contact_family *family(const char *name)
{
    for (int i = 0; i < n_contact_families; i++) {
        if (!strcmp(contact_families[i].name, name)) return &contact_families[i];
    }
    return NULL;
}

static void gradients_agree(void **state)
{
    (void)state;
    carom_contact_solver *s;
    int n = 0;
    assert_int_equal(carom_contact_create(NULL, NULL, &s), CAROM_OK);
    for (uint64_t seed = 0; n < 40 && seed < 4000; seed++) {
        rng r = rng_from(seed);
        contact_case c = family("random")->make(&r);
        if (carom_contact_solve(s, &c.p, CAROM_GUESS_NONE, &c.x, NULL) == CAROM_OK &&
            c.p.n_contacts && nondegenerate(&c)) {
            compare(&c, s, &r);
            n++;
        }
        contact_case_free(&c);
    }
    assert_int_equal(n, 40);
    carom_contact_destroy(s);
}

/* Where the general solver finds a solution of a problem that has only one, it is the same. */
static void motions_agree(void **state)
{
    (void)state;
    carom_contact_solver *s;
    int n = 0;
    assert_int_equal(carom_contact_create(NULL, NULL, &s), CAROM_OK);
    for (uint64_t seed = 0; seed < 40; seed++) {
        rng r = rng_from(seed);
        contact_case c = family("chain")->make(&r);
        for (int k = 0; k < c.p.n_contacts; k++) c.mu[k] = 0; /* convex: one motion */
        problem_file f = contact_case_to_file(&c);
        four_variables v;
        carom_lcp *lcp;
        assert_int_equal(four_variables_make(&f, &v), 0);
        const size_t nz = (size_t)v.problem.n_ineq + 1;
        double *x = calloc((size_t)v.problem.n_x + 2 * nz + (size_t)v.problem.n_eq + 1, sizeof *x);
        carom_lcp_point at = {x, x + v.problem.n_x, x + v.problem.n_x + nz,
                              x + v.problem.n_x + 2 * nz};
        assert_int_equal(carom_lcp_create(&v.problem, NULL, NULL, &lcp), CAROM_OK);
        const carom_status general = carom_lcp_solve(lcp, &v.problem, &at, NULL);
        assert_int_equal(carom_contact_solve(s, &c.p, CAROM_GUESS_NONE, &c.x, NULL), CAROM_OK);
        if (general == CAROM_OK) {
            assert_near_array("v", v.problem.n_x, at.x, c.x.v, SAME_MOTION);
            n++;
        }
        carom_lcp_destroy(lcp);
        free(x);
        four_variables_free(&v);
        contact_case_free_file(&f);
        contact_case_free(&c);
    }
    print_message("%d of 40 problems solved by both\n", n);
    assert_true(n >= 20);
    carom_contact_destroy(s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(gradients_agree),
        cmocka_unit_test(motions_agree),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
