/* Points of the central path and their derivatives: closed form, every array against differences,
 * the transposed identity, the limit of small kappa, what is refused. */
#include "carom/contact.h"
#include "contact_case.h"
#include "contact_parts.h"
#include "fdiff.h"
#include "near.h"
#include "rng.h"

#include <stdlib.h>
#include <string.h>

/* Differences of size 1e-5 with one Richardson step where fifth derivatives are at most kappa^-2.
 */
#define DIFFERENCE 1e-5
#define TOLERANCE  1e-7
enum { MOST = 512 };

static const double KAPPAS[] = {1e-3, 1e-5};

/* A smoothed problem near its solution. */
typedef struct probe {
    contact_case c;    /* x: where the path begins */
    contact_case path; /* the same data, x on the path */
    carom_contact_solver *solver;
    double kappa;
    double bar[MOST];
} probe;

static void copy_solution(const contact_case *from, contact_case *to)
{
    const carom_contact_problem *p = &from->p;
    memcpy(to->x.v, from->x.v, 3 * (size_t)p->n_bodies * sizeof(double));
    memcpy(to->x.ln, from->x.ln, (size_t)p->n_contacts * sizeof(double));
    memcpy(to->x.lt, from->x.lt, (size_t)p->n_contacts * sizeof(double));
    memcpy(to->x.mode, from->x.mode, (size_t)p->n_contacts);
    memcpy(to->x.le, from->x.le, (size_t)p->n_joint_rows * sizeof(double));
}

static void begin(probe *p, contact_case c, double kappa, rng *r)
{
    p->c = c;
    p->kappa = kappa;
    contact_solve_ok(&p->c);
    p->path = contact_case_copy(&p->c);
    assert_int_equal(carom_contact_create(NULL, NULL, &p->solver), CAROM_OK);
    for (int i = 0; i < 3 * c.p.n_bodies; i++) p->bar[i] = rng_uniform(r, -1, 1);
}

static void end(probe *p)
{
    carom_contact_destroy(p->solver);
    contact_case_free(&p->c);
    contact_case_free(&p->path);
}

/* <bar, v> on the path of the data in p->path. */
static double loss(void *user)
{
    probe *p = user;
    copy_solution(&p->c, &p->path);
    assert_int_equal(carom_contact_smooth(p->solver, &p->path.p, p->kappa, &p->path.x), CAROM_OK);
    double sum = 0;
    for (int i = 0; i < 3 * p->c.p.n_bodies; i++) sum += p->bar[i] * p->path.x.v[i];
    return sum;
}

/* One contact whose row has J W J' = 1 / m: with a = v_n + c,  a - l / m = u + c  and  l a = kappa
 * give a = (b + sqrt(b^2 + 4 kappa / m)) / 2, b = u + c, and da/du = a / (2 a - b). */
static void one_contact(void **state)
{
    (void)state;
    const double zero[2] = {0, 0};
    const double up[2] = {0, 1};
    static const double speeds[] = {-1, -1e-3, 0, 1e-3, 1};
    for (int i = 0; i < 5; i++) {
        for (double kappa = 1e-12; kappa < 1; kappa *= 1e3) {
            const double m = 2;
            const double b = speeds[i];
            carom_contact_solver *s;
            contact_case c = contact_case_new(1, 1, 0);
            contact_case_body(&c, 0, m, 1, 0, 0, b);
            contact_case_contact(&c, -1, 0, zero, zero, up, 0.5, 0);
            assert_int_equal(carom_contact_create(NULL, NULL, &s), CAROM_OK);
            assert_int_equal(carom_contact_solve(s, &c.p, 0, &c.x, NULL), CAROM_OK);
            assert_int_equal(carom_contact_smooth(s, &c.p, kappa, &c.x), CAROM_OK);
            assert_int_equal(c.x.mode[0], CAROM_SMOOTHED);
            const double root = sqrt(b * b + 4 * kappa / m);
            const double a = b > 0 ? 0.5 * (b + root) : 2 * kappa / m / (root - b);
            /* products are found to 1e-9; v to rounding of the speed */
            assert_near(c.x.v[2], a, 1e-9 * a + 1e-15);
            assert_near(c.x.ln[0], kappa / a, 2e-9 * kappa / a);
            double u_bar[3];
            double bar[3] = {0, 0, 1};
            carom_contact_bars bars = {.u = u_bar};
            assert_int_equal(carom_contact_adjoint(s, &c.p, &c.x, bar, &bars), CAROM_OK);
            assert_near(u_bar[2], a / root, 1e-8 * a / root + 1e-15);
            carom_contact_destroy(s);
            contact_case_free(&c);
        }
    }
}

static void compare(probe *p, const char *name, int n, double *data, const double *bar)
{
    for (int i = 0; i < n; i++) {
        double error;
        const double size = fmax(fabs(data[i]), 0.1); /* inverse masses are not small */
        const double d = fdiff_entry(loss, p, &data[i], DIFFERENCE * size, &error);
        assert_near_case(name, i, bar[i], d, TOLERANCE * (1 + fabs(d)) + error);
        assert_at_most("differences", error, 1e-5 * (1 + fabs(d)));
    }
}

/* The world's columns have no derivative. */
static void compare_rows(probe *p, const char *name, int n, double *rows, const int *body,
                         const double *bar)
{
    for (int i = 0; i < 6 * n; i++) {
        if (body[2 * (i / 6) + i % 6 / 3] >= 0) compare(p, name, 1, &rows[i], &bar[i]);
    }
}

/* Feet on feet, with redundant rows, hinges, and frictions from almost none. */
static void every_array(void **state)
{
    (void)state;
    rng r = rng_from(3);
    for (uint64_t seed = 1; seed <= 4; seed++) {
        for (int i = 0; i < 2; i++) {
            static double g[9][MOST];
            carom_contact_bars bars = {g[0], g[1], g[2], g[3], g[4], g[5], g[6], g[7], g[8]};
            probe p;
            begin(&p, contact_mixed(seed, 2), KAPPAS[i], &r);
            contact_case *c = &p.path;
            loss(&p);
            assert_int_equal(carom_contact_adjoint(p.solver, &c->p, &c->x, p.bar, &bars), CAROM_OK);
            compare(&p, "u", 3 * c->p.n_bodies, c->u, bars.u);
            compare(&p, "inv_mass", 3 * c->p.n_bodies, c->inv_mass, bars.inv_mass);
            compare(&p, "mu", c->p.n_contacts, c->mu, bars.mu);
            compare(&p, "cn", c->p.n_contacts, c->cn, bars.cn);
            compare(&p, "ct", c->p.n_contacts, c->ct, bars.ct);
            compare(&p, "ce", c->p.n_joint_rows, c->ce, bars.ce);
            compare_rows(&p, "jn", c->p.n_contacts, c->jn, c->contact_body, bars.jn);
            compare_rows(&p, "jt", c->p.n_contacts, c->jt, c->contact_body, bars.jt);
            compare_rows(&p, "je", c->p.n_joint_rows, c->je, c->joint_body, bars.je);
            end(&p);
        }
    }
}

static double dot(int n, const double *a, const double *b)
{
    double sum = 0;
    for (int i = 0; i < n; i++) sum += a[i] * b[i];
    return sum;
}

/* <bar, J d> = <J' bar, d>. */
static void transposed(void **state)
{
    (void)state;
    rng r = rng_from(4);
    for (double kappa = 1e-2; kappa > 1e-11; kappa *= 1e-2) {
        static double g[9][MOST];
        static double d[9][MOST];
        carom_contact_bars bars = {g[0], g[1], g[2], g[3], g[4], g[5], g[6], g[7], g[8]};
        /* in the order of carom_contact_direction */
        const carom_contact_direction dir = {d[0], d[1], d[2], d[3], d[4], d[5], d[6], d[7], d[8]};
        probe p;
        begin(&p, contact_mixed(9, 4), kappa, &r);
        contact_case *c = &p.path;
        const int nb = 3 * c->p.n_bodies;
        const int nc = c->p.n_contacts;
        const int ne = c->p.n_joint_rows;
        double dv[MOST];
        for (int k = 0; k < 9; k++) {
            for (int i = 0; i < MOST; i++) d[k][i] = rng_uniform(&r, -1, 1);
        }
        loss(&p);
        assert_int_equal(carom_contact_adjoint(p.solver, &c->p, &c->x, p.bar, &bars), CAROM_OK);
        assert_int_equal(carom_contact_tangent(p.solver, &c->p, &c->x, &dir, dv), CAROM_OK);
        const double left = dot(nb, p.bar, dv);
        const double right = dot(nb, bars.inv_mass, dir.inv_mass) + dot(nb, bars.u, dir.u) +
                             dot(6 * nc, bars.jn, dir.jn) + dot(6 * nc, bars.jt, dir.jt) +
                             dot(nc, bars.mu, dir.mu) + dot(nc, bars.cn, dir.cn) +
                             dot(nc, bars.ct, dir.ct) + dot(6 * ne, bars.je, dir.je) +
                             dot(ne, bars.ce, dir.ce);
        /* responses of up to ln^2 / kappa, refined */
        assert_near(left, right, 1e-10 * (1 + fabs(left)));
        end(&p);
    }
}

/* Away from kinks the derivative is that of the active set within O(kappa). */
static void error_is_linear(void **state)
{
    (void)state;
    const double zero[2] = {0, 0};
    const double up[2] = {0, 1};
    const double foot[2] = {0, -0.5};
    static const double slides[] = {0.05, 2}; /* sticks, slips */
    for (int i = 0; i < 2; i++) {
        contact_case c = contact_case_new(1, 1, 0);
        carom_contact_solver *s;
        double exact[3];
        double errors[3];
        double bar[3] = {0.3, 1, 0.2};
        carom_contact_bars bars = {.u = exact};
        contact_case_body(&c, 0, 1, 0.1, 0, slides[i], -1);
        contact_case_contact(&c, -1, 0, zero, foot, up, 0.4, 0);
        assert_int_equal(carom_contact_create(NULL, NULL, &s), CAROM_OK);
        assert_int_equal(carom_contact_solve(s, &c.p, 0, &c.x, NULL), CAROM_OK);
        contact_case smooth = contact_case_copy(&c);
        assert_int_equal(carom_contact_adjoint(s, &c.p, &c.x, bar, &bars), CAROM_OK);
        for (int k = 0; k < 3; k++) {
            double u_bar[3];
            bars.u = u_bar;
            copy_solution(&c, &smooth);
            assert_int_equal(carom_contact_smooth(s, &smooth.p, pow(10, -3 - k), &smooth.x),
                             CAROM_OK);
            assert_int_equal(carom_contact_adjoint(s, &smooth.p, &smooth.x, bar, &bars), CAROM_OK);
            errors[k] = 0;
            for (int q = 0; q < 3; q++) errors[k] = fmax(errors[k], fabs(u_bar[q] - exact[q]));
            assert_true(errors[k] > 0);
            /* kappa is 1e-3 of the energies at most: the next term is a hundredth */
            if (k) assert_near(errors[k - 1] / errors[k], 10, 0.7);
        }
        carom_contact_destroy(s);
        contact_case_free(&c);
        contact_case_free(&smooth);
    }
}

/* At the border of sticking the derivative lies between both sides. */
static void between_at_a_kink(void **state)
{
    (void)state;
    const double zero[2] = {0, 0};
    const double up[2] = {0, 1};
    contact_case c = contact_case_new(1, 1, 0);
    carom_contact_solver *s;
    contact_case_body(&c, 0, 1, 0.1, 0, 0.4,
                      -1); /* needs l_t = -0.4 = -mu l_n: no lever, no turn */
    contact_case_contact(&c, -1, 0, zero, zero, up, 0.4, 0);
    assert_int_equal(carom_contact_create(NULL, NULL, &s), CAROM_OK);
    assert_int_equal(carom_contact_solve(s, &c.p, 0, &c.x, NULL), CAROM_OK);
    for (double kappa = 1e-4; kappa > 1e-11; kappa *= 0.1) {
        double u_bar[3];
        double bar[3] = {0, 1, 0};
        carom_contact_bars bars = {.u = u_bar};
        assert_int_equal(carom_contact_smooth(s, &c.p, kappa, &c.x), CAROM_OK);
        assert_int_equal(carom_contact_adjoint(s, &c.p, &c.x, bar, &bars), CAROM_OK);
        /* d v_t / d u_t: 0 where it sticks, 1 where it slips; p- w- = kappa with both of order
         * sqrt(kappa) is halfway */
        assert_near(u_bar[1], 0.5, 2 * sqrt(kappa));
    }
    carom_contact_destroy(s);
    contact_case_free(&c);
}

static void refused(void **state)
{
    (void)state;
    contact_case c = contact_mixed(1, 1);
    carom_contact_solver *s;
    static const double bad[] = {0, -1, NAN, HUGE_VAL};
    assert_int_equal(carom_contact_create(NULL, NULL, &s), CAROM_OK);
    assert_int_equal(carom_contact_solve(s, &c.p, 0, &c.x, NULL), CAROM_OK);
    const double v = c.x.v[1];
    for (int k = 0; k < 4; k++) {
        assert_int_equal(carom_contact_smooth(s, &c.p, bad[k], &c.x), CAROM_E_ARGUMENT);
    }
    assert_int_equal(carom_contact_smooth(NULL, &c.p, 1, &c.x), CAROM_E_ARGUMENT);
    /* far below what the digits of an impulse resolve: said, and x is kept */
    assert_int_equal(carom_contact_smooth(s, &c.p, 1e-300, &c.x), CAROM_E_NO_SOLUTION);
    assert_true(c.x.v[1] == v);
    assert_true(c.x.mode[0] != CAROM_SMOOTHED);
    carom_contact_destroy(s);
    contact_case_free(&c);
}

/* Nothing to smooth: joints alone, and nothing at all. */
static void without_contacts(void **state)
{
    (void)state;
    const double arm[2] = {0.5, 0};
    const double zero[2] = {0, 0};
    for (int joints = 0; joints < 2; joints++) {
        contact_case c = contact_case_new(2, 0, 2);
        carom_contact_solver *s;
        contact_case_body(&c, 0, 1, 1, 0, 0, -1);
        contact_case_body(&c, 1, 1, 1, 0, 0, 1);
        if (joints) contact_case_hinge(&c, 0, 1, zero, arm);
        assert_int_equal(carom_contact_create(NULL, NULL, &s), CAROM_OK);
        assert_int_equal(carom_contact_solve(s, &c.p, 0, &c.x, NULL), CAROM_OK);
        double v[6];
        memcpy(v, c.x.v, sizeof v);
        assert_int_equal(carom_contact_smooth(s, &c.p, 1e-3, &c.x), CAROM_OK);
        for (int i = 0; i < 6; i++) assert_near(c.x.v[i], v[i], 1e-14);
        carom_contact_destroy(s);
        contact_case_free(&c);
    }
}

/* A contact whose normal only sees what is prescribed is none, beside one that is smoothed. */
static void prescribed_motion(void **state)
{
    (void)state;
    const double zero[2] = {0, 0};
    const double arm[2] = {0.5, 0};
    const double up[2] = {0, 1};
    contact_case c = contact_case_new(2, 2, 0);
    carom_contact_solver *s;
    double u_bar[6];
    const double bar[6] = {1, 1, 1, 1, 1, 1};
    carom_contact_bars bars = {.u = u_bar};
    contact_case_body(&c, 0, 1, 1, -1, 0, 1);
    c.inv_mass[1] = c.inv_mass[2] = 0; /* it turns, and goes where it goes */
    contact_case_body(&c, 1, 1, 1, 0, 0, -1);
    contact_case_contact(&c, -1, 0, zero, zero, up, 0.5, 0);
    contact_case_contact(&c, 0, 1, arm, zero, up, 0.5, 0);
    assert_int_equal(carom_contact_create(NULL, NULL, &s), CAROM_OK);
    assert_int_equal(carom_contact_solve(s, &c.p, 0, &c.x, NULL), CAROM_OK);
    assert_int_equal(carom_contact_smooth(s, &c.p, 1e-4, &c.x), CAROM_OK);
    assert_int_equal(carom_contact_adjoint(s, &c.p, &c.x, bar, &bars), CAROM_OK);
    for (int i = 0; i < 6; i++) assert_true(isfinite(u_bar[i]));
    assert_true(u_bar[5] > 0 && u_bar[5] < 1);
    carom_contact_destroy(s);
    contact_case_free(&c);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(one_contact),       cmocka_unit_test(every_array),
        cmocka_unit_test(transposed),        cmocka_unit_test(error_is_linear),
        cmocka_unit_test(between_at_a_kink), cmocka_unit_test(refused),
        cmocka_unit_test(without_contacts),  cmocka_unit_test(prescribed_motion),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
