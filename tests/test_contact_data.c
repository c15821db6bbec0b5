/* The contact problems of tests/data/lcp: every one is solved or shown infeasible, with the
 * residual and the certificate recomputed here. */
#include "carom/contact.h"
#include "contact_case.h"
#include "near.h"
#include "problem_file.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Rounding of the residual: terms |J| |v| of up to 1e5 V, and of impulses beyond it [1]. */
#define RESIDUAL_ROUNDING 1e-11

typedef struct tally {
    carom_contact_solver *solver;
    int n;
    int n_dense; /* joint rows of more than two bodies: not this solver's form */
    int n_solved;
    int n_infeasible;
    int n_missed;
    int n_lied;  /* status and recomputed residual disagree */
    int n_wrong; /* velocity off where it is known */
    long factorizations;
} tally;

static void check_residual(const problem_file *f, const contact_case *c,
                           const carom_contact_stats *st, tally *t)
{
    const double r = contact_case_residual(c);
    const double public = carom_contact_residual(&c->p, &c->x);
    if (fabs(r - st->residual) > RESIDUAL_ROUNDING || public != st->residual) {
        print_error("%s: residual %.3g reported, %.3g public, %.3g here\n", f->name, st->residual,
                    public, r);
        t->n_lied++;
    }
}

static void check_velocity(const problem_file *f, const contact_case *c, tally *t)
{
    const double limit = fmax(1e-9, 10 * f->spread);
    for (int i = 0; f->compare_v && i < 3 * f->n_bodies; i++) {
        if (fabs(c->x.v[i] - f->v[i]) <= limit) continue;
        print_error("%s: v[%d] = %.12g, reference %.12g, limit %.1e\n", f->name, i, c->x.v[i],
                    f->v[i], limit);
        t->n_wrong++;
        return;
    }
}

/* y_n >= 0, |W J' y| small against -y . (J u + c). */
static void check_certificate(const problem_file *f, const contact_case *c, tally *t)
{
    const carom_contact_problem *p = &c->p;
    double *y = calloc((size_t)(p->n_contacts + p->n_joint_rows) + 1, sizeof *y);
    double *force = calloc((size_t)(3 * p->n_bodies) + 1, sizeof *force);
    assert_int_equal(carom_contact_certificate(t->solver, y, y + p->n_contacts), CAROM_OK);
    double gain = 0;
    for (int k = 0; k < p->n_contacts + p->n_joint_rows; k++) {
        const int joint = k >= p->n_contacts;
        const int r = joint ? k - p->n_contacts : k;
        const double *row = joint ? p->je + 6 * r : p->jn + 6 * r;
        const int *body = joint ? p->joint_body + 2 * r : p->contact_body + 2 * r;
        if (!joint) assert_true(y[k] >= 0);
        gain += y[k] * (joint ? p->ce[r] : p->cn[r]);
        for (int i = 0; i < 6; i++) {
            if (body[i / 3] < 0) continue;
            force[3 * body[i / 3] + i % 3] += row[i] * y[k];
            gain += y[k] * row[i] * p->u[3 * body[i / 3] + i % 3];
        }
    }
    double size = 0;
    for (int i = 0; i < 3 * p->n_bodies; i++) size += force[i] * force[i] * p->inv_mass[i];
    /* Excludes every motion of energy below (gain / size)^2 / 2: here a million times V. */
    if (!(gain < 0 && sqrt(size) * 1e6 < -gain)) {
        print_error("%s: certificate: |W J'y| = %.2e, gain %.2e\n", f->name, sqrt(size), gain);
        t->n_lied++;
    }
    free(y);
    free(force);
}

static void visit(const problem_file *f, void *user)
{
    tally *t = user;
    contact_case c;
    carom_contact_stats st;
    t->n++;
    if (contact_case_from_file(f, &c)) {
        t->n_dense++;
        return;
    }
    const carom_status s = carom_contact_solve(t->solver, &c.p, 0, &c.x, &st);
    assert_int_equal(s, st.status);
    t->factorizations += st.factorizations;
    if (s == CAROM_E_INFEASIBLE) {
        t->n_infeasible++;
        check_certificate(f, &c, t);
    } else {
        check_residual(f, &c, &st, t);
        t->n_solved += s == CAROM_OK;
    }
    if (s != (f->feasible ? CAROM_OK : CAROM_E_INFEASIBLE)) {
        print_message("%s: %s, residual %.1e\n", f->name, carom_status_name(s), st.residual);
        t->n_missed++;
    } else if (s == CAROM_OK) {
        check_velocity(f, &c, t);
    }
    contact_case_free(&c);
}

static void data_problems_are_solved(void **state)
{
    (void)state;
    tally t;
    memset(&t, 0, sizeof t);
    assert_int_equal(carom_contact_create(NULL, NULL, &t.solver), CAROM_OK);
    const int n = problem_file_each(TEST_DATA "/lcp", visit, &t);
    assert_int_equal(n, t.n);
    carom_contact_destroy(t.solver);
    print_message("%d problems, %d with rows of more than two bodies left out; %d solved, %d "
                  "infeasible, %d missed; %.1f factorizations each\n",
                  t.n, t.n_dense, t.n_solved, t.n_infeasible, t.n_missed,
                  (double)t.factorizations / (t.n - t.n_dense));
    assert_true(t.n - t.n_dense >= 150);
    assert_int_equal(t.n_lied, 0);
    assert_int_equal(t.n_wrong, 0);
    assert_in_range(t.n_missed, 0, 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(data_problems_are_solved)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
