/* Derivatives through the paper's four-variable friction, where (10) is singular at every sticking
 * and every separated contact: closed forms, and the contact solver's own adjoint. */
#include "near.h"

#include "carom/contact.h"
#include "carom/lcp.h"
#include "contact_case.h"
#include "four_variables.h"
#include "lcp_case.h"

#include <stdlib.h>
#include <string.h>

/* A point mass on a floor, one step h under weight g and push f: unknowns (vx, vy),
 * z = (l_n, l+, l-, gamma).  docs/math/equations.md (7)-(8). */
static const double H = 0.1;
static const double GRAVITY = 10.0;
static const double MASS = 2.0;

static lcp_case point_on_floor(double mu, double vx, double push)
{
    const double M[] = {MASS, 0, 0, MASS};
    const double G[] = {0, -1, -1, 0, 1, 0, 0, 0};
    const double F[] = {0, 0, 0, 0, 0, 0, 0, -1, 0, 0, 0, -1, -mu, 1, 1, 0};
    const double q[] = {-MASS * vx - H * push, H * MASS * GRAVITY};
    const double m[] = {0, 0, 0, 0};
    const lcp_ref d = {2, 4, 0, M, NULL, G, F, q, NULL, m};
    return lcp_case_dense(&d, 0);
}

/* Entry (i, j) of a matrix of the case. */
static int place(const carom_sparse *a, int i, int j)
{
    for (int k = a->col[j]; k < a->col[j + 1]; k++)
        if (a->row[k] == i) return k;
    fail();
    return -1;
}

typedef struct floor_row {
    const char *name;
    double mu;
    double vx;
    double push;
    double v;       /* vx after the step */
    double dv_dmu;  /* = -sign h g when it slides: F's entry is -mu */
    double dv_dq;   /* of the first entry of q: -1/m when it slides, 0 when it sticks */
    double dv_dgap; /* of m_0 = c, the right-hand side of the normal row */
} floor_row;

/* Sliding: v+ = v + h f/m - s mu l_n / m with l_n = m (h g - c), vy+ = -c. */
static const floor_row FLOOR[] = {
    {"slides right", 0.3, 2.0, 0.0, 1.7, -1.0, -0.5, 0.3},
    {"slides left", 0.3, -2.0, 0.0, -1.7, 1.0, -0.5, -0.3},
    {"sticks", 0.3, 0.1, 1.0, 0.0, 0.0, 0.0, 0.0},
    {"sticks at rest", 0.3, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0},
};

static void closed_forms(void **state)
{
    (void)state;
    for (size_t k = 0; k < sizeof FLOOR / sizeof FLOOR[0]; k++) {
        const floor_row *row = &FLOOR[k];
        lcp_case c = point_on_floor(row->mu, row->vx, row->push);
        carom_lcp *l = NULL;
        const double x_bar[] = {1, 0};
        double F_bar[16];
        double q_bar[2];
        double m_bar[4];
        const carom_lcp_cotangent bar = {x_bar, NULL, NULL};
        carom_lcp_gradient g = {NULL, NULL, NULL, F_bar, q_bar, NULL, m_bar};
        assert_int_equal(carom_lcp_create(&c.p, NULL, NULL, &l), CAROM_OK);
        assert_int_equal(carom_lcp_solve(l, &c.p, &c.at, NULL), CAROM_OK);
        assert_near_case(row->name, 0, c.at.x[0], row->v, 1e-12);
        assert_int_equal(carom_lcp_adjoint(l, &c.p, &c.at, &bar, &g, NULL), CAROM_OK);
        assert_near_case(row->name, 1, -F_bar[place(&c.p.F, 3, 0)], row->dv_dmu, 1e-11);
        assert_near_case(row->name, 2, q_bar[0], row->dv_dq, 1e-11);
        assert_near_case(row->name, 3, m_bar[0], row->dv_dgap, 1e-11);
        carom_lcp_destroy(l);
        lcp_case_free(&c);
    }
}

/* A cotangent of the multiplier that friction does not determine (l+ alone, sticking) is refused;
 * the one it does, l+ - l-, is answered: m vx + h f = 0 gives d(l+ - l-)/dq_0 = 1. */
static void undetermined_multipliers(void **state)
{
    (void)state;
    lcp_case c = point_on_floor(0.3, 0.1, 1.0);
    carom_lcp *l = NULL;
    const double one[] = {0, 1, 0, 0};
    const double difference[] = {0, 1, -1, 0};
    double q_bar[2] = {77, 77};
    carom_lcp_cotangent bar = {NULL, one, NULL};
    carom_lcp_gradient g = {NULL, NULL, NULL, NULL, q_bar, NULL, NULL};
    carom_lcp_derivative info;
    assert_int_equal(carom_lcp_create(&c.p, NULL, NULL, &l), CAROM_OK);
    assert_int_equal(carom_lcp_solve(l, &c.p, &c.at, NULL), CAROM_OK);
    assert_int_equal(carom_lcp_adjoint(l, &c.p, &c.at, &bar, &g, NULL), CAROM_E_SINGULAR);
    assert_true(q_bar[0] == 77.0);
    bar.z = difference;
    assert_int_equal(carom_lcp_adjoint(l, &c.p, &c.at, &bar, &g, &info), CAROM_OK);
    assert_int_equal(info.singular, 1);
    assert_near(q_bar[0], 1.0, 1e-11);
    assert_near(q_bar[1], 0.0, 1e-11);
    carom_lcp_destroy(l);
    lcp_case_free(&c);
}

/* Both adjoints of one problem of tests/data/lcp. */
typedef struct both {
    const problem_file *file;
    four_variables f;
    contact_case c;
    carom_lcp *l;
    carom_contact_solver *solver;
    carom_lcp_point at;
    double *bar; /* v_bar */
    double *room;
    carom_lcp_gradient g;
    carom_contact_bars b;
    carom_lcp_derivative info;
} both;

typedef struct comparison {
    int motions;
    int rows;
    int held;
    double worst_motion;
    double worst_row;
    double worst_held;
} comparison;

/* Largest of the diagonal of M over the smallest. */
static double mass_ratio(const problem_file *p)
{
    double low = HUGE_VAL;
    double high = 0.0;
    for (int i = 0; i < 3 * p->n_bodies; i++) {
        low = fmin(low, p->M[i]);
        high = fmax(high, p->M[i]);
    }
    return high / low;
}

static double *take(double **room, int n)
{
    double *at = *room;
    *room += n;
    return at;
}

static void make_room(both *t)
{
    const carom_lcp_problem *p = &t->f.problem;
    const int nv = p->n_x;
    const int nc = t->file->n_contacts;
    const int nj = t->file->n_joint_rows;
    const int ng = p->G.col[nv];
    const int na = p->A.col[nv];
    const int nf = p->F.col[p->n_ineq];
    double *room = t->room =
        calloc((size_t)(3 * nv + ng + na + nf + p->n_ineq + 14 * nc + 7 * nj + 1), sizeof *room);
    assert_non_null(room);
    memset(&t->g, 0, sizeof t->g);
    memset(&t->b, 0, sizeof t->b);
    t->bar = take(&room, nv);
    t->g.q = take(&room, nv);
    t->g.G = take(&room, ng);
    t->g.A = take(&room, na);
    t->g.F = take(&room, nf);
    t->g.m = take(&room, p->n_ineq);
    t->b.u = take(&room, nv);
    t->b.jn = take(&room, 6 * nc);
    t->b.jt = take(&room, 6 * nc);
    t->b.mu = take(&room, nc);
    t->b.cn = take(&room, nc);
    t->b.je = take(&room, 6 * nj);
    rng r = rng_from(71);
    for (int i = 0; i < nv; i++) t->bar[i] = rng_uniform(&r, -1.0, 1.0);
}

/* Column `j` of the two bodies of row k, among the 6 numbers of the contact's row; -1: neither. */
static int local(const int *body, int k, int j)
{
    if (body[2 * k] == j / 3) return j % 3;
    if (body[2 * k + 1] == j / 3) return 3 + j % 3;
    return -1;
}

static void worsen(double *worst, double a, double b, double size)
{
    *worst = fmax(*worst, fabs(a - b) / size);
}

/* The multipliers agree (they are not unique where contacts are redundant). */
static int same_multipliers(const both *t)
{
    const int nc = t->file->n_contacts;
    const double size = near_norm(nc, t->c.x.ln);
    for (int k = 0; k < nc; k++) {
        const double lt = t->at.z[nc + 2 * k] - t->at.z[nc + 2 * k + 1];
        if (fabs(t->at.z[k] - t->c.x.ln[k]) > 1e-10 * size) return 0;
        if (fabs(lt - t->c.x.lt[k]) > 1e-10 * size) return 0;
    }
    return 1;
}

/* Rows that hold: two where a contact sticks, one where it slides, and the joints'. */
static int active_rows(const both *t)
{
    int n = t->file->n_joint_rows;
    for (int k = 0; k < t->file->n_contacts; k++) {
        const int mode = t->c.x.mode[k];
        if (mode != CAROM_SEPARATED) n += mode == CAROM_STICK && t->file->mu[k] > 0.0 ? 2 : 1;
    }
    return n;
}

/* What free bodies would answer: |v_bar_i| / M_ii. */
static double free_answer(const both *t)
{
    double size = 0.0;
    for (int i = 0; i < t->f.problem.n_x; i++) size = fmax(size, fabs(t->bar[i]) / t->file->M[i]);
    return size;
}

/* q = -M u: the motion is unique, and so is its gradient, redundant rows or not. */
static void compare_motion(const both *t, comparison *out)
{
    const double size = free_answer(t);
    for (int i = 0; i < t->f.problem.n_x; i++)
        worsen(&out->worst_motion, -t->g.q[i], t->b.u[i] / t->file->M[i], size);
    out->motions++;
}

/* A stack whose two contacts per box all stick cannot move: the gradient is zero. */
static void check_held(const both *t, comparison *out)
{
    if (strncmp(t->file->family, "stack", 5) != 0) return;
    if (t->file->n_contacts != 2 * t->file->n_bodies) return;
    for (int k = 0; k < t->file->n_contacts; k++)
        if (t->c.x.mode[k] != CAROM_STICK) return;
    const double size = free_answer(t);
    for (int i = 0; i < t->f.problem.n_x; i++) worsen(&out->worst_held, t->g.q[i], 0.0, size);
    out->held++;
}

/* m_n = c, F_gn = -mu, G_n = -J_n, G_+ = -J_t, G_- = J_t, relative to each array. */
static void compare_rows(const both *t, comparison *out)
{
    const carom_lcp_problem *p = &t->f.problem;
    const int nv = p->n_x;
    const int nc = t->file->n_contacts;
    double size = near_norm(nc, t->b.cn) + 1e-300;
    for (int k = 0; k < nc; k++) worsen(&out->worst_row, t->g.m[k], t->b.cn[k], size);
    size = near_norm(nc, t->b.mu) + near_norm(nc, t->b.cn) + 1e-300;
    for (int k = 0; k < nc; k++)
        worsen(&out->worst_row, -t->g.F[place(&p->F, 3 * nc + k, k)], t->b.mu[k], size);
    double *jn = calloc((size_t)(12 * nc + 1), sizeof *jn);
    assert_non_null(jn);
    double *jt = jn + 6 * nc;
    for (int j = 0; j < nv; j++)
        for (int e = p->G.col[j]; e < p->G.col[j + 1]; e++) {
            const int row = p->G.row[e];
            const int k = row < nc ? row : (row - nc) / 2;
            const int at = local(t->c.contact_body, k, j);
            assert_true(at >= 0);
            if (row < nc)
                jn[6 * k + at] -= t->g.G[e];
            else
                jt[6 * k + at] += (row - nc) % 2 ? t->g.G[e] : -t->g.G[e];
        }
    size = near_norm(6 * nc, t->b.jn) + near_norm(6 * nc, t->b.jt) + 1e-300;
    for (int i = 0; i < 6 * nc; i++) {
        /* the lcp's pattern leaves out coefficients that are zero */
        if (t->c.jn[i] != 0.0) worsen(&out->worst_row, jn[i], t->b.jn[i], size);
        if (t->c.jt[i] != 0.0 && t->file->mu[i / 6] > 0.0)
            worsen(&out->worst_row, jt[i], t->b.jt[i], size);
    }
    free(jn);
    out->rows++;
}

static int solve_both(both *t)
{
    const carom_lcp_cotangent bar = {t->bar, NULL, NULL};
    carom_contact_stats stats;
    return carom_lcp_solve(t->l, &t->f.problem, &t->at, NULL) == CAROM_OK &&
           carom_contact_solve(t->solver, &t->c.p, 0, &t->c.x, &stats) == CAROM_OK &&
           stats.degenerate == 0 &&
           carom_lcp_adjoint(t->l, &t->f.problem, &t->at, &bar, &t->g, &t->info) == CAROM_OK &&
           carom_contact_adjoint(t->solver, &t->c.p, &t->c.x, t->bar, &t->b) == CAROM_OK;
}

static void visit(const problem_file *file, void *user)
{
    comparison *out = user;
    both t;
    memset(&t, 0, sizeof t);
    if (!file->feasible || !file->compare_v) return;
    if (contact_case_from_file(file, &t.c) != 0) return;
    t.file = file;
    assert_int_equal(four_variables_make(file, &t.f), 0);
    assert_int_equal(carom_lcp_create(&t.f.problem, NULL, NULL, &t.l), CAROM_OK);
    assert_int_equal(carom_contact_create(NULL, NULL, &t.solver), CAROM_OK);
    t.at = lcp_point_new(&t.f.problem);
    make_room(&t);
    if (solve_both(&t)) {
        check_held(&t, out);
        /* Beyond these sizes the comparison shows the conditions of the matrices, not mistakes. */
        const int moderate = mass_ratio(file) < 1e6 && file->n_bodies <= 20;
        if (moderate) compare_motion(&t, out);
        if (moderate && same_multipliers(&t) && active_rows(&t) <= 3 * file->n_bodies)
            compare_rows(&t, out);
    }
    free(t.room);
    free(t.at.x);
    carom_lcp_destroy(t.l);
    carom_contact_destroy(t.solver);
    contact_case_free(&t.c);
    four_variables_free(&t.f);
}

static void agrees_with_contact_adjoint(void **state)
{
    (void)state;
    comparison all = {0, 0, 0, 0.0, 0.0, 0.0};
    assert_int_equal(problem_file_each(TEST_DATA "/lcp", visit, &all), 160);
    print_message("compared with the contact adjoint: %d motions to %.1e, %d sets of rows to %.1e; "
                  "%d held stacks to %.1e\n",
                  all.motions, all.worst_motion, all.rows, all.worst_row, all.held, all.worst_held);
    assert_true(all.motions >= 40 && all.rows >= 20 && all.held >= 15);
    assert_at_most("motion", all.worst_motion, 1e-10);
    assert_at_most("rows", all.worst_row, 1e-10);
    /* mass ratios to 1e8 here: rounding times that */
    assert_at_most("held", all.worst_held, 1e-8);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(closed_forms),
        cmocka_unit_test(undetermined_multipliers),
        cmocka_unit_test(agrees_with_contact_adjoint),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
