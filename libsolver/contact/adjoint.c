#include "libsolver/contact/check.h"
#include "libsolver/contact/ladder/ladder.h"
#include "libsolver/contact/residual.h"
#include "libsolver/contact/solver.h"

#include <math.h>

/* Passes stop when the defect, relative to the cotangent, is below this [1] ... */
#define DEFECT_DONE 1e-15
/* ... or, below this, no longer falls. */
#define DEFECT_SMALL 1e-11

#define WIDE 10
enum { EXTRA = 2 };

/* The equations at the active set (on the central path as said in smooth.c), with B = [J_n' + s mu
 * J_t' (slip), J_t' (stick), J_e'] and C = [J_n; J_t (stick); J_e], are  v - u - W B l = 0,  C v +
 * c = 0.  Their adjoint is p + C' q = g,   B' W p = 0 and gives, with f = B l:  u_bar = p,  W_bar =
 * p f,  c_bar = -q,  B_bar = (W p) l', C_bar = -q v'.  This is (30) with d_v = W p, d_l = q. */
typedef struct adjoint {
    double *p;  /* 3 n_bodies */
    double *cn; /* n_contacts: -q */
    double *ct;
    double *ce; /* n_joint_rows */
} adjoint;

static adjoint carve(double *scratch, const carom_contact_problem *p)
{
    adjoint a;
    a.p = scratch;
    a.cn = a.p + 3 * p->n_bodies;
    a.ct = a.cn + p->n_contacts;
    a.ce = a.ct + p->n_contacts;
    return a;
}

/* B' p of contact k. */
static void project(const crm_island *s, int k, const double *p, double *bn, double *bt)
{
    const crm_contact *c = &s->contact[k];
    *bn = 0;
    *bt = 0;
    if (s->mode[k] == CAROM_SEPARATED) return;
    *bn = crm_dot(c->n, c->a, c->b, p);
    if (!(c->mu > 0)) return;
    const double t = crm_dot(c->t, c->a, c->b, p);
    if (crm_feels_slip(s, k))
        *bt = t;
    else
        *bn += crm_slip_sign(s->mode[k]) * c->mu * t;
}

/* z += C' q of contact k, with a factor. */
static void spread(const crm_island *s, int k, double factor, double qn, double qt, double *z)
{
    const crm_contact *c = &s->contact[k];
    if (s->mode[k] == CAROM_SEPARATED) return;
    crm_add(z, c->n, c->a, c->b, factor * qn);
    if (crm_feels_slip(s, k)) crm_add(z, c->t, c->a, c->b, factor * qt);
}

/* The row times p, 0 where that is rounding of its terms: divided by the compliance it would make q
 * noisy where rows depend on each other. */
static double past_rounding(const double *row, int a, int b, const double *p)
{
    double sum = 0;
    double size = 0;
    for (int e = 0; e < 2; e++) {
        const double *r = row + 3 * e;
        const double *x = p + 3 * (e ? b : a);
        if ((e ? b : a) < 0) continue;
        const double term[3] = {r[0] * x[0], r[1] * x[1], r[2] * x[2]};
        sum += term[0] + term[1] + term[2];
        size += fabs(term[0]) + fabs(term[1]) + fabs(term[2]);
    }
    return fabs(sum) <= DBL_EPSILON * size ? 0 : sum;
}

/* B' p - V' q of contact k on the central path, V its compliance, into s->rhs. */
static void smooth_defects(crm_island *s, int k)
{
    const crm_contact *c = &s->contact[k];
    const crm_response v = crm_smooth_compliance(s, k);
    s->rhs.n[k] = crm_dot(c->n, c->a, c->b, s->x.z) - v.nn * s->x.n[k] - v.tn * s->x.t[k];
    s->rhs.t[k] = c->mu > 0 ? crm_dot(c->t, c->a, c->b, s->x.z) - v.tt * s->x.t[k] : 0;
}

/* B' p of contact k into s->rhs. */
static void row_defects(crm_island *s, int k)
{
    const crm_contact *c = &s->contact[k];
    s->rhs.n[k] = 0;
    s->rhs.t[k] = 0;
    if (s->mode[k] == CAROM_SEPARATED) return;
    if (s->mode[k] == CAROM_SMOOTHED) {
        smooth_defects(s, k);
        return;
    }
    s->rhs.n[k] = past_rounding(c->n, c->a, c->b, s->x.z);
    if (!(c->mu > 0)) return;
    const double t = past_rounding(c->t, c->a, c->b, s->x.z);
    if (crm_feels_slip(s, k)) {
        s->rhs.t[k] = t;
    } else {
        s->rhs.n[k] += crm_slip_sign(s->mode[k]) * c->mu * t;
    }
}

/* What is left of p + C' q = g, B' p = 0 at s->x, into s->rhs; returns its largest entry. */
static double find_defect(crm_island *s, const double *g)
{
    double e = 0;
    double *z = s->rhs.z;
    for (int i = 0; i < 3 * s->nb; i++) z[i] = g[i] - s->x.z[i];
    for (int k = 0; k < s->nc; k++) {
        spread(s, k, -1, s->x.n[k], s->x.t[k], z);
        row_defects(s, k);
        e = fmax(e, fmax(fabs(s->rhs.n[k]), fabs(s->rhs.t[k])));
    }
    for (int q = 0; q < s->ng; q++) {
        const crm_group *group = &s->group[q];
        const int at = 3 * (s->nb + q);
        for (int r = 0; r < CRM_GROUP_ROWS; r++) {
            crm_add(z, group->left[r], group->a, group->b, -s->x.z[at + r]);
            z[at + r] = crm_dot(group->j[r], group->a, group->b, s->x.z);
        }
    }
    for (int i = 0; i < 3 * (s->nb + s->ng); i++) e = fmax(e, fabs(z[i]));
    return e;
}

/* What contact k answers to (r_n, r_t): W' r, with W = 1 / compliance of the active rows. */
static void answer(const crm_island *s, int k, double compliance, double rn, double rt, double *qn,
                   double *qt)
{
    const crm_response *w = &s->response[k];
    const int smooth = s->mode[k] == CAROM_SMOOTHED;
    *qn = smooth ? w->nn * rn + w->tn * rt : rn / compliance;
    *qt = smooth ? w->tt * rt : rt / compliance;
}

/* One proximal pass: dp + C' dq = rhs.z, -B' dp + delta dq = rhs.n, rhs.t; s->x += (dp, dq). */
static void improve(crm_island *s, double compliance)
{
    double *z = s->step.z;
    memcpy(z, s->rhs.z, 3 * (size_t)(s->nb + s->ng) * sizeof(double));
    for (int k = 0; k < s->nc; k++) {
        double qn;
        double qt;
        if (s->rhs.n[k] == 0 && s->rhs.t[k] == 0) continue;
        answer(s, k, compliance, s->rhs.n[k], s->rhs.t[k], &qn, &qt);
        spread(s, k, -1, qn, qt, z);
    }
    crm_island_solve_transposed(s, z);
    for (int k = 0; k < s->nc; k++) {
        double bn;
        double bt;
        project(s, k, z, &bn, &bt);
        answer(s, k, compliance, s->rhs.n[k] + bn, s->rhs.t[k] + bt, &s->step.n[k], &s->step.t[k]);
    }
    crm_vec_add(s, s->x, 1, s->step);
}

/* s->rhs at s->x = 0. */
static void first_defect(crm_island *s, const double *g)
{
    memcpy(s->rhs.z, g, 3 * (size_t)s->nb * sizeof *g);
    memset(s->rhs.z + 3 * s->nb, 0, 3 * (size_t)s->ng * sizeof *g);
    memset(s->rhs.n, 0, (size_t)s->nc * sizeof *g);
    memset(s->rhs.t, 0, (size_t)s->nc * sizeof *g);
}

static void factor_active(crm_island *s, double compliance)
{
    crm_set_responses(s, compliance);
    crm_island_factor(s, 1, compliance);
}

void crm_island_adjoint(crm_island *s, const double *g, double tol, int extra)
{
    double size = 0;
    double last = 1;
    double compliance = CRM_COMPLIANCE;
    const double enough = fmax(tol, DEFECT_DONE);
    const int alike = extra == 0;
    for (int i = 0; i < 3 * s->nb; i++) size = fmax(size, fabs(g[i]));
    crm_vec_zero(s, s->x);
    if (!(size > 0)) return;
    factor_active(s, compliance);
    first_defect(s, g);
    improve(s, compliance);
    for (int i = 1; i < CRM_PASSES; i++) {
        const double e = find_defect(s, g) / size;
        const int done = e < enough || (i > 1 && e >= last && e < DEFECT_SMALL);
        if (done && extra-- == 0) break;
        if (!done && compliance > CRM_COMPLIANCE_TIGHT && i >= CRM_PATIENCE &&
            e > CRM_SLOW * last) {
            compliance = CRM_COMPLIANCE_TIGHT;
            factor_active(s, compliance);
        }
        improve(s, compliance);
        /* The first pass left so little that one more leaves rounding. */
        if (alike && e < DEFECT_SMALL) break;
        last = fmin(e, last);
    }
}

/* Where sqrt(W) spans more than WIDE, p = p^ / sqrt(W) of the heavy bodies needs more digits than
 * the size of g^ shows; their rows have them, since both of their terms are small. */
static int masses_differ(const crm_island *s, const double *root)
{
    double least = HUGE_VAL;
    double largest = 0;
    for (int i = 0; i < 3 * s->nb; i++) {
        if (!(root[i] > 0)) continue;
        least = fmin(least, root[i]);
        largest = fmax(largest, root[i]);
    }
    return largest > WIDE * least;
}

/* Adjoint of one island, whose values and modes are gathered, into the arrays of a. */
static void solve_island(carom_contact_solver *c, const double *v_bar, double tol, int island,
                         adjoint *a)
{
    const crm_graph *g = &c->graph;
    const crm_system *y = &c->system;
    crm_island *s = crm_system_begin(&c->system, island);
    double *bar = s->size;
    const double *root = y->root + 3 * g->node_ptr[island];
    const int *body_of = g->body_of + g->node_ptr[island];
    for (int i = 0; i < 3 * s->nb; i++) bar[i] = root[i] * v_bar[3 * body_of[i / 3] + i % 3];
    crm_island_adjoint(s, bar, tol, masses_differ(s, root) ? EXTRA : 0);
    for (int i = 0; i < 3 * s->nb; i++) {
        if (root[i] > 0) a->p[3 * body_of[i / 3] + i % 3] = s->x.z[i] / root[i];
    }
    for (int k = 0; k < s->nc; k++) {
        const int slot = g->contact_ptr[island] + k;
        a->cn[g->contact_of[slot]] = -y->scale_n[slot] * s->x.n[k];
        a->ct[g->contact_of[slot]] = crm_feels_slip(s, k) ? -y->scale_t[slot] * s->x.t[k] : 0;
    }
    for (int q = 0; q < s->ng; q++) {
        const int slot = g->group_ptr[island] + q;
        for (int i = 0; i < g->group_size[slot]; i++)
            a->ce[g->group_row[slot] + i] = -y->scale_e[3 * slot + i] * s->x.z[3 * (s->nb + q) + i];
    }
}

/* p = g - C' q where W = 0. */
static void prescribed(const carom_contact_problem *p, adjoint *a, double *cq)
{
    int any = 0;
    for (int i = 0; i < 3 * p->n_bodies; i++) any |= !(p->inv_mass[i] > 0);
    if (!any) return;
    memset(cq, 0, 3 * (size_t)p->n_bodies * sizeof(double));
    for (int k = 0; k < p->n_contacts; k++) {
        const int *body = p->contact_body + 2 * k;
        crm_row_add(cq, p->jn + 6 * k, body, a->cn[k]);
        if (crm_has_friction(p, k)) crm_row_add(cq, p->jt + 6 * k, body, a->ct[k]);
    }
    for (int r = 0; r < p->n_joint_rows; r++) {
        crm_row_add(cq, (p->je_left ? p->je_left : p->je) + 6 * r, p->joint_body + 2 * r, a->ce[r]);
    }
    for (int i = 0; i < 3 * p->n_bodies; i++) {
        if (!(p->inv_mass[i] > 0)) a->p[i] += cq[i];
    }
}

/* f = J' l. */
static void find_forces(const carom_contact_problem *p, const carom_contact_solution *x, double *f)
{
    memset(f, 0, 3 * (size_t)p->n_bodies * sizeof *f);
    for (int k = 0; k < p->n_contacts; k++) {
        const int *body = p->contact_body + 2 * k;
        crm_row_add(f, p->jn + 6 * k, body, x->ln[k]);
        if (crm_has_friction(p, k)) crm_row_add(f, p->jt + 6 * k, body, x->lt[k]);
    }
    for (int r = 0; r < p->n_joint_rows; r++) {
        crm_row_add(f, p->je + 6 * r, p->joint_body + 2 * r, x->le[r]);
    }
}

/* row_bar = l (W p)' + c_bar v'; nothing for the world. */
static void row_bar(const carom_contact_problem *p, const adjoint *a, const double *v,
                    const int *body, double l, double c_bar, double *bar)
{
    for (int i = 0; i < 6; i++) {
        const int at = 3 * body[i / 3] + i % 3;
        bar[i] = body[i / 3] < 0 ? 0 : l * p->inv_mass[at] * a->p[at] + c_bar * v[at];
    }
}

static double mu_bar(const carom_contact_problem *p, const carom_contact_solution *x,
                     const adjoint *a, int k)
{
    if (!crm_has_friction(p, k)) return 0;
    const double share = crm_friction_share(x->mode[k], p->mu[k], x->ln[k], x->lt[k]);
    double sum = 0;
    for (int i = 0; i < 6 && share != 0; i++) {
        const int body = p->contact_body[2 * k + i / 3];
        const int at = 3 * body + i % 3;
        if (body >= 0) sum += p->jt[6 * k + i] * p->inv_mass[at] * a->p[at];
    }
    return share * x->ln[k] * sum;
}

/* Of W, J and mu.  f: 3 n_bodies of room. */
static void write_rest(const carom_contact_problem *p, const carom_contact_solution *x,
                       const adjoint *a, double *f, const carom_contact_bars *bars)
{
    if (bars->inv_mass) {
        find_forces(p, x, f);
        for (int i = 0; i < 3 * p->n_bodies; i++) bars->inv_mass[i] = a->p[i] * f[i];
    }
    for (int k = 0; k < p->n_contacts; k++) {
        const int *body = p->contact_body + 2 * k;
        const double lt = crm_has_friction(p, k) ? x->lt[k] : 0;
        if (bars->jn) row_bar(p, a, x->v, body, x->ln[k], a->cn[k], bars->jn + 6 * k);
        if (bars->jt) row_bar(p, a, x->v, body, lt, a->ct[k], bars->jt + 6 * k);
        if (bars->mu) bars->mu[k] = mu_bar(p, x, a, k);
    }
    for (int r = 0; bars->je && r < p->n_joint_rows; r++) {
        row_bar(p, a, x->v, p->joint_body + 2 * r, x->le[r], a->ce[r], bars->je + 6 * r);
    }
}

static void give(double *to, const double *from, int n)
{
    if (to && n > 0) memcpy(to, from, (size_t)n * sizeof *to);
}

/* Of u and c. */
static void write_sides(const carom_contact_problem *p, const adjoint *a,
                        const carom_contact_bars *bars)
{
    give(bars->u, a->p, 3 * p->n_bodies);
    give(bars->cn, a->cn, p->n_contacts);
    give(bars->ct, a->ct, p->n_contacts);
    give(bars->ce, a->ce, p->n_joint_rows);
}

/* 6 per body, 2 per contact, 1 per joint row. */
static carom_status reserve_scratch(carom_contact_solver *c, const carom_contact_problem *p)
{
    const int n = 6 * p->n_bodies + 2 * p->n_contacts + p->n_joint_rows + 1;
    return crm_reserve(&c->memory, (void **)&c->scratch, &c->scratch_max, n, sizeof(double));
}

/* All islands are gathered; the scratch behind a has room for 3 n_bodies. */
static carom_status respond(carom_contact_solver *c, const carom_contact_problem *p,
                            const double *v_bar, double tol, adjoint *a)
{
    const int n = 3 * p->n_bodies;
    memset(a->cn, 0, (size_t)(2 * p->n_contacts + p->n_joint_rows) * sizeof(double));
    for (int i = 0; i < n; i++) a->p[i] = v_bar[i];
    for (int i = 0; i < c->graph.n_islands; i++) solve_island(c, v_bar, tol, i, a);
    prescribed(p, a, a->ce + p->n_joint_rows);
    for (int i = 0; i < n; i++) {
        if (!isfinite(a->p[i])) return CAROM_E_SINGULAR;
    }
    return CAROM_OK;
}

carom_status carom_contact_adjoint(carom_contact_solver *solver,
                                   const carom_contact_problem *problem,
                                   const carom_contact_solution *x, const double *v_bar,
                                   carom_contact_bars *bars)
{
    const carom_contact_problem *p = problem;
    if (!solver || !v_bar || !bars) return CAROM_E_ARGUMENT;
    carom_status s = crm_contact_check(p);
    if (s >= 0) s = crm_solution_check(p, x);
    if (s >= 0 && !crm_modes_valid(p, x->mode)) s = CAROM_E_ARGUMENT;
    if (s >= 0) s = reserve_scratch(solver, p);
    if (s >= 0) s = crm_solver_prepare(solver, p);
    for (int i = 0; s >= 0 && i < solver->graph.n_islands; i++) {
        crm_system_gather(&solver->system, &solver->graph, p, i);
        crm_take_modes(solver, i, x);
    }
    if (s < 0) return s;
    adjoint a = carve(solver->scratch, p);
    s = respond(solver, p, v_bar, 0, &a);
    if (s < 0) return s;
    write_sides(p, &a, bars);
    write_rest(p, x, &a, a.ce + p->n_joint_rows, bars);
    return CAROM_OK;
}

carom_status carom_contact_adjoint_again(carom_contact_solver *solver,
                                         const carom_contact_problem *problem, const double *v_bar,
                                         double tol, carom_contact_bars *bars)
{
    if (!solver || !problem || !v_bar || !bars) return CAROM_E_ARGUMENT;
    adjoint a = carve(solver->scratch, problem);
    const carom_status s = respond(solver, problem, v_bar, tol, &a);
    if (s >= 0) write_sides(problem, &a, bars);
    return s;
}

carom_status carom_contact_adjoint_rest(carom_contact_solver *solver,
                                        const carom_contact_problem *problem,
                                        const carom_contact_solution *x, carom_contact_bars *bars)
{
    if (!solver || !problem || !x || !bars || !bars->u) return CAROM_E_ARGUMENT;
    const carom_status s = reserve_scratch(solver, problem);
    if (s < 0) return s;
    const adjoint a = {bars->u, bars->cn, bars->ct, bars->ce};
    write_rest(problem, x, &a, solver->scratch, bars);
    return CAROM_OK;
}
