/* The adjoint of the contact problem: every array against central differences of the solve, at
 * points with sticking, slipping (both signs), frictionless and separated contacts, joints, moving
 * and prescribed bodies, and redundant rows. */
#include "carom/contact.h"
#include "contact_case.h"
#include "fdiff.h"
#include "near.h"
#include "rng.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Differences of size 1e-5 with one Richardson step: error h^4 and rounding 1e-16/h; entries of the
 * gradient are of order 1 to 1e3 [1]. */
#define DIFFERENCE 1e-5
#define TOLERANCE  1e-7
/* A point is nondegenerate when nothing that decides a mode is closer to zero than this. */
#define MARGIN 0.02

static const double UP[2] = {0, 1};

typedef struct probe {
    contact_case c;
    carom_contact_solver *solver;
    unsigned char mode[64]; /* of the base point */
    double bar[64];         /* v_bar */
    int failures;
} probe;

/* <v_bar, v> of the case as it is. */
static double loss(void *user)
{
    probe *p = user;
    memcpy(p->c.x.mode, p->mode, (size_t)p->c.p.n_contacts);
    const carom_status s = carom_contact_solve(p->solver, &p->c.p, 1, &p->c.x, NULL);
    if (s != CAROM_OK) p->failures++;
    double sum = 0;
    for (int i = 0; i < 3 * p->c.p.n_bodies; i++) sum += p->bar[i] * p->c.x.v[i];
    return sum;
}

typedef struct gradient {
    double inv_mass[64];
    double u[64];
    double jn[400];
    double jt[400];
    double mu[64];
    double cn[64];
    double ct[64];
    double je[100];
    double ce[20];
} gradient;

static carom_contact_bars bars_of(gradient *g)
{
    return (carom_contact_bars){.inv_mass = g->inv_mass,
                                .u = g->u,
                                .jn = g->jn,
                                .jt = g->jt,
                                .mu = g->mu,
                                .cn = g->cn,
                                .ct = g->ct,
                                .je = g->je,
                                .ce = g->ce};
}

/* 0 when the problem has no solution, as random ones with c != 0 may (test_contact_exact.c). */
static int solve_base(probe *p, rng *r)
{
    assert_int_equal(carom_contact_create(NULL, NULL, &p->solver), CAROM_OK);
    const carom_status s = carom_contact_solve(p->solver, &p->c.p, 0, &p->c.x, NULL);
    memcpy(p->mode, p->c.x.mode, (size_t)p->c.p.n_contacts);
    for (int i = 0; i < 3 * p->c.p.n_bodies; i++) p->bar[i] = rng_uniform(r, -1, 1);
    p->failures = 0;
    return s == CAROM_OK;
}

static void find_gradient(probe *p, gradient *g)
{
    loss(p);
    carom_contact_bars bars = bars_of(g);
    memset(g, 0xA5, sizeof *g); /* must be overwritten */
    assert_int_equal(carom_contact_adjoint(p->solver, &p->c.p, &p->c.x, p->bar, &bars), CAROM_OK);
}

static void release(probe *p)
{
    assert_int_equal(p->failures, 0);
    carom_contact_destroy(p->solver);
    contact_case_free(&p->c);
}

/* Compares entry by entry; `skip` (may be NULL) marks entries that are not moved. */
static void compare(probe *p, const char *name, int n, double *data, const double *bar,
                    const unsigned char *skip)
{
    for (int i = 0; i < n; i++) {
        if (skip && skip[i]) continue;
        double error;
        const double d = fdiff_entry(loss, p, &data[i], DIFFERENCE, &error);
        assert_near_case(name, i, bar[i], d, TOLERANCE * (1 + fabs(d)) + error);
        assert_at_most("kink", error, 1e-5 * (1 + fabs(d)));
    }
}

static double dot_row(const double *row, const int *body, const double *v)
{
    double s = 0;
    for (int i = 0; i < 6; i++) {
        if (body[i / 3] >= 0) s += row[i] * v[3 * body[i / 3] + i % 3];
    }
    return s;
}

/* Every quantity that decides a mode keeps a distance from zero. */
static int nondegenerate(const contact_case *c)
{
    for (int k = 0; k < c->p.n_contacts; k++) {
        const int *body = c->contact_body + 2 * k;
        const double a = dot_row(c->jn + 6 * k, body, c->x.v) + c->cn[k];
        const double u = dot_row(c->jt + 6 * k, body, c->x.v) + c->ct[k];
        const double bound = c->mu[k] * c->x.ln[k];
        const int mode = c->x.mode[k];
        if (mode == CAROM_SEPARATED && a < MARGIN) return 0;
        if (mode != CAROM_SEPARATED && c->x.ln[k] < MARGIN) return 0;
        if (c->mu[k] == 0) continue;
        if (mode == CAROM_STICK && bound - fabs(c->x.lt[k]) < MARGIN) return 0;
        if (mode > CAROM_STICK && fabs(u) < MARGIN) return 0;
    }
    return 1;
}

/* Four moving bodies and a belt with W = 0; contacts and joints at random. */
static contact_case make_random(rng *r)
{
    const int nb = 5;
    contact_case c = contact_case_new(nb, 6, 4);
    for (int b = 0; b < nb - 1; b++) {
        contact_case_body(&c, b, exp(rng_uniform(r, -1, 1)), exp(rng_uniform(r, -2, 0)),
                          rng_uniform(r, -1, 1), rng_uniform(r, -1, 1), rng_uniform(r, -1, 1));
    }
    for (int i = 12; i < 15; i++) c.u[i] = rng_uniform(r, -0.5, 0.5);
    const int pairs[6][2] = {{-1, 0}, {0, 1}, {1, 2}, {4, 2}, {3, 4}, {2, 3}};
    for (int k = 0; k < 6; k++) {
        const double ra[2] = {rng_uniform(r, -1, 1), rng_uniform(r, -1, 1)};
        const double rb[2] = {rng_uniform(r, -1, 1), rng_uniform(r, -1, 1)};
        const double angle = rng_uniform(r, -3, 3);
        const double n[2] = {cos(angle), sin(angle)};
        const double mu = rng_unit(r) < 0.2 ? 0 : rng_uniform(r, 0.1, 1);
        contact_case_contact(&c, pairs[k][0], pairs[k][1], ra, rb, n, mu,
                             rng_uniform(r, -0.5, 0.1));
        c.ct[k] = rng_uniform(r, -0.2, 0.2);
    }
    for (int q = 0; q < 2; q++) {
        const double ra[2] = {rng_uniform(r, -1, 1), rng_uniform(r, -1, 1)};
        const double rb[2] = {rng_uniform(r, -1, 1), rng_uniform(r, -1, 1)};
        const int row =
            q ? contact_case_hinge(&c, 1, 3, ra, rb) : contact_case_hinge(&c, 4, 0, ra, rb);
        c.ce[row] = rng_uniform(r, -0.1, 0.1);
    }
    return c;
}

/* Entries that no derivative is defined for: the world's columns, frictionless rows. */
static void mark_unread(const contact_case *c, int contact_rows, int tangential,
                        unsigned char *skip)
{
    const int n = contact_rows ? c->p.n_contacts : c->p.n_joint_rows;
    const int *body = contact_rows ? c->contact_body : c->joint_body;
    for (int i = 0; i < 6 * n; i++) {
        skip[i] = body[2 * (i / 6) + i % 6 / 3] < 0;
        if (tangential && c->mu[i / 6] == 0) skip[i] = 1;
    }
}

static void assert_zero_where(const char *name, int n, const double *bar, const unsigned char *skip)
{
    for (int i = 0; i < n; i++) {
        if (skip[i]) assert_near_case(name, i, bar[i], 0, 0);
    }
}

static void check_all(probe *p, const gradient *g)
{
    contact_case *c = &p->c;
    unsigned char skip[400] = {0};
    const int nb = 3 * c->p.n_bodies;
    const int nc = c->p.n_contacts;
    const int ne = c->p.n_joint_rows;
    compare(p, "u", nb, c->u, g->u, NULL);
    for (int i = 0; i < nb; i++) skip[i] = c->inv_mass[i] == 0;
    compare(p, "inv_mass", nb, c->inv_mass, g->inv_mass, skip);
    mark_unread(c, 1, 0, skip);
    compare(p, "jn", 6 * nc, c->jn, g->jn, skip);
    assert_zero_where("jn of the world", 6 * nc, g->jn, skip);
    mark_unread(c, 1, 1, skip);
    compare(p, "jt", 6 * nc, c->jt, g->jt, skip);
    assert_zero_where("jt not read", 6 * nc, g->jt, skip);
    for (int k = 0; k < nc; k++) skip[k] = c->mu[k] == 0;
    compare(p, "mu", nc, c->mu, g->mu, skip);
    compare(p, "cn", nc, c->cn, g->cn, NULL);
    compare(p, "ct", nc, c->ct, g->ct, NULL);
    mark_unread(c, 0, 0, skip);
    compare(p, "je", 6 * ne, c->je, g->je, skip);
    compare(p, "ce", ne, c->ce, g->ce, NULL);
}

static void generic_points(void **state)
{
    (void)state;
    int seen[5] = {0}; /* by mode; [4]: frictionless and closed */
    int n = 0;
    for (uint64_t seed = 0; n < 60 && seed < 2000; seed++) {
        rng r = rng_from(seed);
        probe p;
        gradient g;
        p.c = make_random(&r);
        if (solve_base(&p, &r) && nondegenerate(&p.c)) {
            for (int k = 0; k < p.c.p.n_contacts; k++) {
                const int closed = p.mode[k] != CAROM_SEPARATED;
                seen[closed && p.c.mu[k] == 0 ? 4 : p.mode[k]]++;
            }
            find_gradient(&p, &g);
            check_all(&p, &g);
            n++;
        }
        release(&p);
    }
    print_message("%d points: separated %d, stick %d, slip- %d, slip+ %d, frictionless %d\n", n,
                  seen[0], seen[1], seen[2], seen[3], seen[4]);
    assert_int_equal(n, 60);
    for (int i = 0; i < 5; i++) assert_true(seen[i] >= 5);
}

/* A body with W = 0 that gains a little mobility: one-sided difference, error O(h). */
static void immovable_bodies_have_a_gradient(void **state)
{
    (void)state;
    rng r = rng_from(11);
    probe p;
    gradient g;
    do {
        p.c = make_random(&r);
        if (solve_base(&p, &r) && nondegenerate(&p.c)) break;
        release(&p);
    } while (1);
    find_gradient(&p, &g);
    const double h = 1e-6;
    for (int i = 12; i < 15; i++) {
        double f[3];
        for (int q = 0; q < 3; q++) {
            p.c.inv_mass[i] = q * h;
            f[q] = loss(&p);
        }
        p.c.inv_mass[i] = 0;
        const double d = (-3 * f[0] + 4 * f[1] - f[2]) / (2 * h);
        assert_near_case("inv_mass at 0", i, g.inv_mass[i], d, 1e-5 * (1 + fabs(d)));
    }
    release(&p);
}

/* Moves the first numbers of both of two equal rows. */
typedef struct twin {
    probe *p;
    double *a;
    double *b;
} twin;

static double twin_loss(double t, void *user)
{
    twin *w = user;
    const double a = *w->a;
    const double b = *w->b;
    *w->a += t;
    *w->b += t;
    const double f = loss(w->p);
    *w->a = a;
    *w->b = b;
    return f;
}

static void compare_twin(probe *p, const char *name, double *a, double *b, double bar_a,
                         double bar_b)
{
    twin w = {p, a, b};
    double error;
    const double d = fdiff(twin_loss, &w, DIFFERENCE, &error);
    assert_near_case(name, 0, bar_a + bar_b, d, TOLERANCE * (1 + fabs(d)) + error);
}

/* A box on two feet: two identical tangential rows.  Sticking (the rows are redundant) it follows
 * the belt; slipping, friction and masses matter. */
static void box_at_rest_has_redundant_rows(void **state)
{
    (void)state;
    for (int slips = 0; slips < 2; slips++) {
        rng r = rng_from(21);
        probe p;
        gradient g;
        p.c = contact_case_new(2, 2, 0);
        contact_case_body(&p.c, 1, 2, 0.4, 0, slips ? 2.0 : 0.1, -0.5);
        for (int e = -1; e <= 1; e += 2) {
            const double low[2] = {0.5 * e, 0.5};
            const double high[2] = {0.5 * e, -0.5};
            contact_case_contact(&p.c, 0, 1, low, high, UP, 0.6, 0);
        }
        assert_true(solve_base(&p, &r));
        assert_int_equal(p.mode[0], slips ? CAROM_SLIP_PLUS : CAROM_STICK);
        find_gradient(&p, &g);
        contact_case *c = &p.c;
        const unsigned char masses[6] = {1, 1, 1, 0, 0, 0};
        /* The belt's own rotation and rise move both normal rows consistently. */
        compare(&p, "u", 6, c->u, g.u, NULL);
        compare(&p, "inv_mass", 6, c->inv_mass, g.inv_mass, masses);
        compare(&p, "mu", 2, c->mu, g.mu, NULL);
        compare(&p, "cn", 2, c->cn, g.cn, NULL);
        compare(&p, "jn", 12, c->jn, g.jn, NULL);
        compare_twin(&p, "ct", c->ct, c->ct + 1, g.ct[0], g.ct[1]);
        for (int i = 0; i < 6; i++)
            compare_twin(&p, "jt", c->jt + i, c->jt + 6 + i, g.jt[i], g.jt[6 + i]);
        release(&p);
    }
}

/* The same hinge twice. */
static void doubled_hinge_has_redundant_rows(void **state)
{
    (void)state;
    rng r = rng_from(31);
    probe p;
    gradient g;
    p.c = contact_case_new(2, 0, 6);
    const double ra[2] = {0.5, 0.1};
    const double rb[2] = {-0.4, 0.2};
    contact_case_body(&p.c, 0, 1, 0.3, 0.2, 1, -1);
    contact_case_body(&p.c, 1, 5, 0.7, -0.5, 0.3, 2);
    contact_case_hinge(&p.c, -1, 0, ra, ra);
    contact_case_hinge(&p.c, 0, 1, ra, rb);
    contact_case_hinge(&p.c, 0, 1, ra, rb);
    assert_true(solve_base(&p, &r));
    find_gradient(&p, &g);
    contact_case *c = &p.c;
    compare(&p, "u", 6, c->u, g.u, NULL);
    compare(&p, "inv_mass", 6, c->inv_mass, g.inv_mass, NULL);
    compare(&p, "ce of the single hinge", 2, c->ce, g.ce, NULL);
    for (int i = 0; i < 2; i++)
        compare_twin(&p, "ce", c->ce + 2 + i, c->ce + 4 + i, g.ce[2 + i], g.ce[4 + i]);
    for (int i = 0; i < 12; i++)
        compare_twin(&p, "je", c->je + 12 + i, c->je + 24 + i, g.je[12 + i], g.je[24 + i]);
    release(&p);
}

/* A random direction of all data, into the arrays of d; 0 where no derivative is defined. */
static void random_direction(const contact_case *c, rng *r, gradient *d)
{
    double *const arrays[] = {d->inv_mass, d->u, d->jn, d->jt, d->mu, d->cn, d->ct, d->je, d->ce};
    const int nb = 3 * c->p.n_bodies;
    const int nc = c->p.n_contacts;
    const int ne = c->p.n_joint_rows;
    const int n[] = {nb, nb, 6 * nc, 6 * nc, nc, nc, nc, 6 * ne, ne};
    for (int k = 0; k < 9; k++) {
        for (int i = 0; i < n[k]; i++) arrays[k][i] = rng_uniform(r, -1, 1);
    }
    for (int k = 0; k < nc; k++) {
        if (c->mu[k] == 0) d->mu[k] = 0;
    }
    for (int i = 0; i < nb; i++) {
        if (c->inv_mass[i] == 0) d->inv_mass[i] = 0;
    }
}

static double inner(int n, const double *x, const double *y)
{
    double s = 0;
    for (int i = 0; i < n; i++) s += x[i] * y[i];
    return s;
}

static carom_contact_direction direction_of(const gradient *d)
{
    return (carom_contact_direction){d->inv_mass, d->u,  d->jn, d->jt, d->mu,
                                     d->cn,       d->ct, d->je, d->ce};
}

/* <v_bar, J d> = <J' v_bar, d>, with both sides computed apart. */
static void transposed_identity(void **state)
{
    (void)state;
    int n = 0;
    for (uint64_t seed = 0; n < 40; seed++) {
        rng r = rng_from(500 + seed);
        probe p;
        gradient g;
        gradient d;
        double dv[64];
        p.c = make_random(&r);
        if (solve_base(&p, &r) && nondegenerate(&p.c)) {
            const contact_case *c = &p.c;
            const int nb = 3 * c->p.n_bodies;
            const int nc = c->p.n_contacts;
            const int ne = c->p.n_joint_rows;
            find_gradient(&p, &g);
            random_direction(c, &r, &d);
            const carom_contact_direction direction = direction_of(&d);
            assert_int_equal(carom_contact_tangent(p.solver, &c->p, &c->x, &direction, dv),
                             CAROM_OK);
            const double backward = inner(nb, g.inv_mass, d.inv_mass) + inner(nb, g.u, d.u) +
                                    inner(6 * nc, g.jn, d.jn) + inner(6 * nc, g.jt, d.jt) +
                                    inner(nc, g.mu, d.mu) + inner(nc, g.cn, d.cn) +
                                    inner(nc, g.ct, d.ct) + inner(6 * ne, g.je, d.je) +
                                    inner(ne, g.ce, d.ce);
            /* Sums of a hundred terms of up to 1e2. */
            assert_near(inner(nb, p.bar, dv), backward, 1e-11 * (1 + fabs(backward)));
            n++;
        }
        release(&p);
    }
}

/* A stack that slides under a top 1 to 1e8 times as heavy: u_bar against each column of the
 * tangent. Both solve K or K' to rounding, conditioned to 1e8 at worst. */
static void heavy_tops_keep_their_gradient(void **state)
{
    (void)state;
    const double tops[] = {1, 1e4, 1e6, 1e8};
    enum { N = 20 };
    for (int q = 0; q < 4; q++) {
        rng r = rng_from(41);
        contact_case c = contact_case_new(N, 2 * N, 0);
        carom_contact_solver *s;
        double bar[3 * N];
        double u_bar[3 * N];
        for (int i = 0; i < N; i++) {
            const double m = i == N - 1 ? tops[q] : 1;
            contact_case_body(&c, i, m, m / 6, 0, 0.02 * (i * 7 % 5 - 2), -0.0981);
            for (int e = -1; e <= 1; e += 2) {
                const double low[2] = {0.5 * e + 0.01 * (i % 3), 0.5};
                const double high[2] = {0.5 * e, -0.5};
                contact_case_contact(&c, i - 1, i, low, high, UP, 0.5, 0);
            }
        }
        assert_int_equal(carom_contact_create(NULL, NULL, &s), CAROM_OK);
        assert_int_equal(carom_contact_solve(s, &c.p, CAROM_GUESS_NONE, &c.x, NULL), CAROM_OK);
        for (int i = 0; i < 3 * N; i++) bar[i] = rng_uniform(&r, -1, 1);
        carom_contact_bars bars = {.u = u_bar};
        assert_int_equal(carom_contact_adjoint(s, &c.p, &c.x, bar, &bars), CAROM_OK);
        for (int j = 0; j < 3 * N; j++) {
            double unit[3 * N] = {0};
            double dv[3 * N];
            unit[j] = 1;
            const carom_contact_direction d = {.u = unit};
            assert_int_equal(carom_contact_tangent(s, &c.p, &c.x, &d, dv), CAROM_OK);
            assert_near_case("u_bar", j, u_bar[j], inner(3 * N, bar, dv), 1e-11 + 1e-17 * tops[q]);
        }
        carom_contact_destroy(s);
        contact_case_free(&c);
    }
}

/* dv of each unit direction of u, and along mu, against differences of the solve. */
static void tangent_agrees_with_differences(void **state)
{
    (void)state;
    rng r = rng_from(77);
    probe p;
    do {
        p.c = make_random(&r);
        if (solve_base(&p, &r) && nondegenerate(&p.c)) break;
        release(&p);
    } while (1);
    contact_case *c = &p.c;
    for (int i = 0; i < 15 + c->p.n_contacts; i++) {
        double unit[64] = {0};
        double dv[64];
        double error;
        const int k = i - 15;
        if (k >= 0 && c->mu[k] == 0) continue;
        unit[k < 0 ? i : k] = 1;
        const carom_contact_direction d =
            k < 0 ? (carom_contact_direction){.u = unit} : (carom_contact_direction){.mu = unit};
        loss(&p);
        assert_int_equal(carom_contact_tangent(p.solver, &c->p, &c->x, &d, dv), CAROM_OK);
        const double expected =
            fdiff_entry(loss, &p, k < 0 ? &c->u[i] : &c->mu[k], DIFFERENCE, &error);
        assert_near_case("tangent", i, inner(15, p.bar, dv), expected,
                         TOLERANCE * (1 + fabs(expected)) + error);
    }
    const carom_contact_direction none = {0};
    double dv[64];
    assert_int_equal(carom_contact_tangent(p.solver, &c->p, &c->x, &none, dv), CAROM_OK);
    for (int i = 0; i < 15; i++) assert_near(dv[i], 0, 0);
    c->x.mode[0] = CAROM_UNKNOWN;
    assert_int_equal(carom_contact_tangent(p.solver, &c->p, &c->x, &none, dv), CAROM_E_ARGUMENT);
    release(&p);
}

/* Nothing touches: the adjoint is the identity; unwanted arrays are left out. */
static void free_bodies_pass_through(void **state)
{
    (void)state;
    probe p;
    rng r = rng_from(5);
    p.c = contact_case_new(2, 1, 0);
    contact_case_body(&p.c, 0, 1, 1, 0.1, 0.2, 0.3);
    contact_case_body(&p.c, 1, 2, 1, 0.1, 0.2, 5);
    const double zero[2] = {0, 0};
    contact_case_contact(&p.c, 0, 1, zero, zero, UP, 0.5, 0);
    assert_true(solve_base(&p, &r));
    gradient g;
    find_gradient(&p, &g);
    assert_near_array("u_bar", 6, g.u, p.bar, 1e-15);
    for (int i = 0; i < 6; i++) {
        assert_near(g.inv_mass[i], 0, 0);
        assert_near(g.jn[i], 0, 0);
        assert_near(g.jt[i], 0, 0);
    }
    assert_near(g.mu[0], 0, 0);
    carom_contact_bars none = {0};
    assert_int_equal(carom_contact_adjoint(p.solver, &p.c.p, &p.c.x, p.bar, &none), CAROM_OK);
    release(&p);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(generic_points),
        cmocka_unit_test(immovable_bodies_have_a_gradient),
        cmocka_unit_test(box_at_rest_has_redundant_rows),
        cmocka_unit_test(doubled_hinge_has_redundant_rows),
        cmocka_unit_test(transposed_identity),
        cmocka_unit_test(heavy_tops_keep_their_gradient),
        cmocka_unit_test(tangent_agrees_with_differences),
        cmocka_unit_test(free_bodies_pass_through),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
