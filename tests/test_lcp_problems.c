/* The contact problems of tests/data/lcp in the paper's four-variable form: how many the plain
 * method and the default one solve, by family; every claim checked apart from the library. */
#include "near.h"

#include "carom/lcp.h"
#include "four_variables.h"
#include "lcp_case.h"

#include <stdlib.h>
#include <string.h>

enum { MAX_FAMILIES = 32 };

typedef struct tally {
    const char *method;
    carom_lcp_settings settings;
    int n_families;
    char family[MAX_FAMILIES][32];
    int feasible[MAX_FAMILIES];
    int solved[MAX_FAMILIES];
    int all_feasible;
    int all_solved;
    int inexact;
    int infeasible; /* problems without a solution */
    int shown;      /* ... reported as such */
    int failures;   /* claims that do not hold */
} tally;

static int family_index(tally *t, const char *family)
{
    int k = 0;
    while (k < t->n_families && strcmp(t->family[k], family) != 0) k++;
    if (k == t->n_families) {
        assert_true(k < MAX_FAMILIES);
        strcpy(t->family[t->n_families++], family);
    }
    return k;
}

/* Row sums of a triplet matrix times v, plain and absolute. */
static void multiply(const problem_triplets *t, const double *v, double *sum, double *size)
{
    for (int k = 0; k < t->n; k++) {
        sum[t->i[k]] += t->x[k] * v[t->j[k]];
        size[t->i[k]] += fabs(t->x[k]) * fabs(v[t->j[k]]);
    }
}

static void multiply_t(const problem_triplets *t, const double *l, double sign, double *sum,
                       double *size)
{
    for (int k = 0; k < t->n; k++) {
        sum[t->j[k]] += sign * t->x[k] * l[t->i[k]];
        if (size) size[t->j[k]] += fabs(t->x[k] * l[t->i[k]]);
    }
}

/* w = diag(J M^-1 J') */
static void add_response(const problem_file *p, const problem_triplets *t, double *w)
{
    for (int k = 0; k < t->n; k++) w[t->i[k]] += t->x[k] * t->x[k] / p->M[t->j[k]];
}

/* The contact laws (4)-(6) themselves, with l_t = l+ - l-, by their natural residual (22), apart
 * from the four-variable form: momentum componentwise, the rest relative to
 * V = max(|v|, |q_i| / M_ii); an impulse counts by the velocity it gives, w l. */
static double contact_error(const problem_file *p, const carom_lcp_point *at)
{
    const int nv = 3 * p->n_bodies;
    const int nc = p->n_contacts;
    double *room = calloc((size_t)(2 * nv + 7 * nc + 2 * p->n_joint_rows + 1), sizeof *room);
    assert_non_null(room);
    double *momentum = room;
    double *size = momentum + nv;
    double *un = size + nv;
    double *ut = un + nc;
    double *sn = ut + nc;
    double *st = sn + nc;
    double *lt = st + nc;
    double *wn = lt + nc;
    double *wt = wn + nc;
    double *ue = wt + nc;
    double *se = ue + p->n_joint_rows;
    double V = 0.0;
    double worst = 0.0;
    for (int i = 0; i < nv; i++) {
        momentum[i] = p->M[i] * at->x[i] + p->q[i];
        V = fmax(V, fmax(fabs(at->x[i]), fabs(p->q[i]) / p->M[i]));
    }
    for (int i = 0; i < nv; i++) /* 1e-6 V: rounding noise of bodies at rest is no error */
        size[i] = p->M[i] * (fabs(at->x[i]) + 1e-6 * V) + fabs(p->q[i]);
    for (int k = 0; k < nc; k++) lt[k] = at->z[nc + 2 * k] - at->z[nc + 2 * k + 1];
    multiply_t(&p->jc, at->z, -1.0, momentum, size);
    multiply_t(&p->jt, lt, -1.0, momentum, NULL);
    for (int k = 0; k < nc; k++) wt[k] = at->z[nc + 2 * k] + at->z[nc + 2 * k + 1];
    multiply_t(&p->jt, wt, 0.0, momentum, size); /* l+ and l- round one by one */
    memset(wt, 0, (size_t)nc * sizeof *wt);
    multiply_t(&p->je, at->y, 1.0, momentum, size);
    multiply(&p->jc, at->x, un, sn);
    multiply(&p->jt, at->x, ut, st);
    multiply(&p->je, at->x, ue, se);
    add_response(p, &p->jc, wn);
    add_response(p, &p->jt, wt);
    for (int i = 0; i < nv; i++)
        if (size[i] > 0.0) worst = fmax(worst, fabs(momentum[i]) / size[i]);
    for (int k = 0; k < nc; k++) {
        const double a = un[k] + p->c[k];
        const double scale = sn[k] + V + fabs(p->c[k]);
        const double ln = at->z[k];
        const double cone = p->mu[k] * fmax(ln, 0.0);
        const double free_lt = lt[k] - (wt[k] > 0.0 ? ut[k] / wt[k] : 0.0);
        const double held = fmax(-cone, fmin(cone, free_lt));
        worst = fmax(worst, fabs(fmin(a, wn[k] * ln)) / scale);
        worst = fmax(worst, wt[k] * fabs(lt[k] - held) / (st[k] + V));
    }
    for (int i = 0; i < p->n_joint_rows; i++)
        if (V > 0.0) worst = fmax(worst, fabs(ue[i]) / (se[i] + V));
    free(room);
    return worst;
}

/* A claim of "solved" must hold for the contact laws, and give the known velocity where one is. */
static void check_claim(tally *t, const problem_file *p, const carom_lcp_point *at)
{
    /* The two residuals differ by the spread of entries in a row. */
    const double error = contact_error(p, at);
    double off = 0.0;
    for (int i = 0; p->compare_v && i < 3 * p->n_bodies; i++)
        off = fmax(off, fabs(at->x[i] - p->v[i]));
    if (!(off <= fmax(1e-9, 10.0 * p->spread))) {
        print_error("%s: %s: velocity off by %.2g\n", t->method, p->name, off);
        t->failures++;
    }
    if (!(error <= 10.0 * t->settings.accept)) {
        print_error("%s: %s: contact laws violated by %.2g\n", t->method, p->name, error);
        t->failures++;
    }
}

static void visit(const problem_file *p, void *user)
{
    tally *t = user;
    four_variables f;
    carom_lcp *l = NULL;
    assert_int_equal(four_variables_make(p, &f), 0);
    assert_int_equal(carom_lcp_create(&f.problem, &t->settings, NULL, &l), CAROM_OK);
    carom_lcp_point at = lcp_point_new(&f.problem);
    carom_lcp_stats stats;
    const carom_status status = carom_lcp_solve(l, &f.problem, &at, &stats);
    const int k = family_index(t, p->family);
    t->feasible[k] += p->feasible;
    t->all_feasible += p->feasible;
    t->infeasible += !p->feasible;
    t->shown += !p->feasible && status == CAROM_E_INFEASIBLE;
    t->inexact += status == CAROM_INEXACT;
    if (status == CAROM_OK) {
        t->solved[k]++;
        t->all_solved++;
        check_claim(t, p, &at);
    }
    if ((p->feasible && status == CAROM_E_INFEASIBLE) || (!p->feasible && status >= CAROM_OK)) {
        print_error("%s: %s: wrong status %s\n", t->method, p->name, carom_status_name(status));
        t->failures++;
    }
    carom_lcp_destroy(l);
    free(at.x);
    four_variables_free(&f);
}

static tally run(const char *method, carom_lcp_settings settings)
{
    tally t;
    memset(&t, 0, sizeof t);
    t.method = method;
    t.settings = settings;
    assert_int_equal(problem_file_each(TEST_DATA "/lcp", visit, &t), 160);
    assert_int_equal(t.all_feasible, 155);
    assert_int_equal(t.failures, 0);
    return t;
}

static void solves_and_says_what_it_does_not(void **state)
{
    (void)state;
    const tally plain = run("plain", carom_lcp_plain());
    carom_lcp_settings settings = carom_lcp_defaults();
    settings.certify = 1;
    const tally full = run("default", settings);
    print_message("%-16s %8s %8s %8s\n", "family", "feasible", "plain", "default");
    for (int k = 0; k < full.n_families; k++)
        print_message("%-16s %8d %8d %8d\n", full.family[k], full.feasible[k], plain.solved[k],
                      full.solved[k]);
    print_message("%-16s %8d %8d %8d   (inexact: %d, %d; shown infeasible of %d: %d, %d)\n", "all",
                  full.all_feasible, plain.all_solved, full.all_solved, plain.inexact, full.inexact,
                  full.infeasible, plain.shown, full.shown);
    /* Floors: the paper's method is known to solve 57 % of hard problems (docs/lcp.md); the default
     * one is held to 95 %, below the 99 % measured, above anything a broken part would reach. */
    assert_true(plain.all_solved >= 88);
    assert_true(full.all_solved >= 147);
    assert_int_equal(full.shown, full.infeasible);
}

/* --- random contact graphs: c = 0, so that a solution exists (Anitescu and Potra) --- */

static void put(problem_triplets *t, int i, int j, double x)
{
    t->i[t->n] = i;
    t->j[t->n] = j;
    t->x[t->n++] = x;
}

/* Row k: body `a` against, body `b` along the direction d, at random lever arms. */
static void put_row(problem_triplets *t, int k, int a, int b, const double *arm, const double *d)
{
    for (int side = 0; side < 2; side++) {
        const int body = side ? b : a;
        const double sign = side ? 1.0 : -1.0;
        const double *r = arm + 2 * side;
        if (body < 0) continue;
        put(t, k, 3 * body, sign * (r[0] * d[1] - r[1] * d[0]));
        put(t, k, 3 * body + 1, sign * d[0]);
        put(t, k, 3 * body + 2, sign * d[1]);
    }
}

static problem_triplets triplets_new(int n_rows, int n_cols, int room)
{
    problem_triplets t = {n_rows, n_cols, 0, NULL, NULL, NULL};
    t.i = calloc((size_t)room + 1, sizeof *t.i);
    t.j = calloc((size_t)room + 1, sizeof *t.j);
    t.x = calloc((size_t)room + 1, sizeof *t.x);
    assert_true(t.i && t.j && t.x);
    return t;
}

/* 2 to 15 bodies, masses 1 to `ratio`, up to 3 contacts per body anywhere on them, friction
 * mu / 100 to mu, velocities of order 1. */
static problem_file random_contacts(rng *r, double ratio, double mu)
{
    problem_file p;
    memset(&p, 0, sizeof p);
    strcpy(p.name, "random contacts");
    strcpy(p.family, "random contacts");
    p.feasible = 1;
    p.n_bodies = 2 + rng_int(r, 14);
    p.n_contacts = 1 + rng_int(r, 3 * p.n_bodies);
    const int nv = 3 * p.n_bodies;
    p.M = calloc((size_t)nv, sizeof *p.M);
    p.q = calloc((size_t)nv, sizeof *p.q);
    p.mu = calloc((size_t)p.n_contacts, sizeof *p.mu);
    p.c = calloc((size_t)p.n_contacts, sizeof *p.c);
    assert_true(p.M && p.q && p.mu && p.c);
    p.jc = triplets_new(p.n_contacts, nv, 6 * p.n_contacts);
    p.jt = triplets_new(p.n_contacts, nv, 6 * p.n_contacts);
    p.je = triplets_new(0, nv, 0);
    for (int i = 0; i < nv; i += 3) {
        const double mass = pow(ratio, rng_unit(r));
        p.M[i] = 0.1 * mass;
        p.M[i + 1] = p.M[i + 2] = mass;
        for (int k = i; k < i + 3; k++) p.q[k] = -p.M[k] * rng_uniform(r, -2.0, 2.0);
    }
    for (int k = 0; k < p.n_contacts; k++) {
        int a = rng_int(r, p.n_bodies + 1) - 1;
        const int b = rng_int(r, p.n_bodies);
        const double angle = rng_uniform(r, 0.0, 6.283185307179586);
        const double n[] = {cos(angle), sin(angle)};
        const double t[] = {-n[1], n[0]};
        double arm[4];
        if (a == b) a = -1; /* the world instead */
        for (int i = 0; i < 4; i++) arm[i] = rng_uniform(r, -0.7, 0.7);
        p.mu[k] = mu * pow(1e-2, rng_unit(r));
        put_row(&p.jc, k, a, b, arm, n);
        put_row(&p.jt, k, a, b, arm, t);
    }
    return p;
}

enum { REPEATS = 100 };

static void run_random(tally *t, double ratio, double mu)
{
    rng r = rng_from(1000);
    for (int k = 0; k < REPEATS; k++) {
        problem_file p = random_contacts(&r, ratio, mu);
        visit(&p, t);
        problem_file_free(&p);
    }
}

static void solves_random_contacts(void **state)
{
    (void)state;
    const double ratios[] = {1.0, 1e4, 1e8};
    const double mus[] = {0.5, 2.0, 20.0};
    int solved[2] = {0, 0};
    print_message("%-12s %-6s %8s %8s %8s\n", "mass ratio", "mu to", "problems", "plain",
                  "default");
    for (int cell = 0; cell < 9; cell++) {
        tally t[2];
        memset(t, 0, sizeof t);
        t[0].method = "plain";
        t[0].settings = carom_lcp_plain();
        t[1].method = "default";
        t[1].settings = carom_lcp_defaults();
        for (int k = 0; k < 2; k++) {
            run_random(&t[k], ratios[cell / 3], mus[cell % 3]);
            assert_int_equal(t[k].failures, 0);
            solved[k] += t[k].all_solved;
        }
        print_message("%-12g %-6g %8d %8d %8d\n", ratios[cell / 3], mus[cell % 3], REPEATS,
                      t[0].all_solved, t[1].all_solved);
    }
    print_message("%-12s %-6s %8d %8d %8d\n", "all", "", 9 * REPEATS, solved[0], solved[1]);
    /* As above: well below what is measured (docs/lcp.md), above what a broken part would reach. */
    assert_true(solved[0] >= 0.7 * 9 * REPEATS);
    assert_true(solved[1] >= 0.95 * 9 * REPEATS);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(solves_and_says_what_it_does_not),
        cmocka_unit_test(solves_random_contacts),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
