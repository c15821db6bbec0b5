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

/* The equations at the active set, with B = [J_n' + s mu J_t' (slip), J_t' (stick), J_e'] and
 * C = [J_n; J_t (stick); J_e], are  v - u - W B l = 0,  C v + c = 0.  Their adjoint is
 *   p + C' q = g,   B' W p = 0
 * and gives, with f = B l:  u_bar = p,  W_bar = p f,  c_bar = -q,  B_bar = (W p) l',
 * C_bar = -q v'.  This is (30) with d_v = W p, d_l = q. */
typedef struct adjoint {
    double *p;  /* 3 n_bodies */
    double *f;  /* 3 n_bodies */
    double *qn; /* n_contacts */
    double *qt;
    double *qe; /* n_joint_rows */
} adjoint;

static adjoint carve(double *scratch, const carom_contact_problem *p)
{
    adjoint a;
    a.p = scratch;
    a.f = a.p + 3 * p->n_bodies;
    a.qn = a.f + 3 * p->n_bodies;
    a.qt = a.qn + p->n_contacts;
    a.qe = a.qt + p->n_contacts;
    return a;
}

static int sticks(const crm_island *s, int k)
{
    return s->mode[k] == CAROM_STICK && s->contact[k].mu > 0;
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
    if (sticks(s, k))
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
    if (sticks(s, k)) crm_add(z, c->t, c->a, c->b, factor * qt);
}

/* Row defects that are rounding of their own terms become zero: divided by the compliance they
 * would make q noisy where rows depend on each other. */
static double past_rounding(const double *row, int a, int b, const double *p, double defect)
{
    double size = 0;
    for (int i = 0; a >= 0 && i < 3; i++) size += fabs(row[i] * p[3 * a + i]);
    for (int i = 0; b >= 0 && i < 3; i++) size += fabs(row[3 + i] * p[3 * b + i]);
    return fabs(defect) <= CRM_ROUNDING * size ? 0 : defect;
}

static void row_defects(crm_island *s, int k)
{
    const crm_contact *c = &s->contact[k];
    double *n = &s->rhs.n[k];
    double *t = &s->rhs.t[k];
    project(s, k, s->x.z, n, t);
    *n = past_rounding(c->n, c->a, c->b, s->x.z, *n);
    *t = past_rounding(c->t, c->a, c->b, s->x.z, *t);
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
            crm_add(z, group->j[r], group->a, group->b, -s->x.z[at + r]);
            z[at + r] = crm_dot(group->j[r], group->a, group->b, s->x.z);
        }
    }
    for (int i = 0; i < 3 * (s->nb + s->ng); i++) e = fmax(e, fabs(z[i]));
    return e;
}

/* One proximal pass: dp + C' dq = rhs.z, -B' dp + delta dq = rhs.n, rhs.t; s->x += (dp, dq). */
static void improve(crm_island *s, double compliance)
{
    double *z = s->step.z;
    memcpy(z, s->rhs.z, 3 * (size_t)(s->nb + s->ng) * sizeof(double));
    for (int k = 0; k < s->nc; k++) spread(s, k, -1 / compliance, s->rhs.n[k], s->rhs.t[k], z);
    crm_island_solve_transposed(s, z);
    for (int k = 0; k < s->nc; k++) {
        double bn;
        double bt;
        project(s, k, z, &bn, &bt);
        s->step.n[k] = (s->rhs.n[k] + bn) / compliance;
        s->step.t[k] = (s->rhs.t[k] + bt) / compliance;
    }
    crm_vec_add(s, s->x, 1, s->step);
}

void crm_island_adjoint(crm_island *s, const double *g, int extra)
{
    double size = 0;
    double last = HUGE_VAL;
    for (int i = 0; i < 3 * s->nb; i++) size = fmax(size, fabs(g[i]));
    crm_vec_zero(s, s->x);
    if (!(size > 0)) return;
    double compliance = CRM_COMPLIANCE;
    crm_set_responses(s, compliance);
    crm_island_factor(s, 1, compliance);
    for (int i = 0; i < CRM_PASSES; i++) {
        const double e = find_defect(s, g) / size;
        const int done = e < DEFECT_DONE || (e >= last && e < DEFECT_SMALL);
        if (done && extra-- == 0) break;
        if (!done && compliance > CRM_COMPLIANCE_TIGHT && i >= CRM_PATIENCE &&
            e > CRM_SLOW * last) {
            compliance = CRM_COMPLIANCE_TIGHT;
            crm_set_responses(s, compliance);
            crm_island_factor(s, 1, compliance);
        }
        last = fmin(e, last);
        improve(s, compliance);
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

/* Adjoint of one island into the arrays of a. */
static void solve_island(carom_contact_solver *c, const carom_contact_problem *p,
                         const unsigned char *mode, const double *v_bar, int island, adjoint *a)
{
    const crm_graph *g = &c->graph;
    const crm_system *y = &c->system;
    crm_system_gather(&c->system, g, p, island);
    crm_island s = crm_system_island(&c->system, g, &c->pattern, island);
    crm_system_set_modes(g, &s, island, mode);
    double *bar = s.size;
    const int extra = masses_differ(&s, y->root + 3 * g->node_ptr[island]) ? EXTRA : 0;
    const double *root = y->root + 3 * g->node_ptr[island];
    const int *body_of = g->body_of + g->node_ptr[island];
    for (int i = 0; i < 3 * s.nb; i++) bar[i] = root[i] * v_bar[3 * body_of[i / 3] + i % 3];
    crm_island_adjoint(&s, bar, extra);
    for (int i = 0; i < 3 * s.nb; i++) {
        if (root[i] > 0) a->p[3 * body_of[i / 3] + i % 3] = s.x.z[i] / root[i];
    }
    for (int k = 0; k < s.nc; k++) {
        const int slot = g->contact_ptr[island] + k;
        a->qn[g->contact_of[slot]] = y->scale_n[slot] * s.x.n[k];
        a->qt[g->contact_of[slot]] = sticks(&s, k) ? y->scale_t[slot] * s.x.t[k] : 0;
    }
    for (int q = 0; q < s.ng; q++) {
        const int slot = g->group_ptr[island] + q;
        for (int i = 0; i < g->group_size[slot]; i++)
            a->qe[g->group_row[slot] + i] = y->scale_e[3 * slot + i] * s.x.z[3 * (s.nb + q) + i];
    }
}

/* f = J' l; and p = g - C' q where W = 0. */
static void finish(const carom_contact_problem *p, const carom_contact_solution *x, adjoint *a,
                   double *cq)
{
    memset(a->f, 0, 3 * (size_t)p->n_bodies * sizeof(double));
    memset(cq, 0, 3 * (size_t)p->n_bodies * sizeof(double));
    for (int k = 0; k < p->n_contacts; k++) {
        const int *body = p->contact_body + 2 * k;
        crm_row_add(a->f, p->jn + 6 * k, body, x->ln[k]);
        crm_row_add(cq, p->jn + 6 * k, body, a->qn[k]);
        if (!crm_has_friction(p, k)) continue;
        crm_row_add(a->f, p->jt + 6 * k, body, x->lt[k]);
        crm_row_add(cq, p->jt + 6 * k, body, a->qt[k]);
    }
    for (int r = 0; r < p->n_joint_rows; r++) {
        const int *body = p->joint_body + 2 * r;
        crm_row_add(a->f, p->je + 6 * r, body, x->le[r]);
        crm_row_add(cq, p->je + 6 * r, body, a->qe[r]);
    }
    for (int i = 0; i < 3 * p->n_bodies; i++) {
        if (!(p->inv_mass[i] > 0)) a->p[i] -= cq[i];
    }
}

/* row_bar = l (W p)' - q v'; nothing for the world. */
static void row_bar(const carom_contact_problem *p, const adjoint *a, const double *v,
                    const int *body, double l, double q, double *bar)
{
    for (int i = 0; i < 6; i++) {
        const int at = 3 * body[i / 3] + i % 3;
        bar[i] = body[i / 3] < 0 ? 0 : l * p->inv_mass[at] * a->p[at] - q * v[at];
    }
}

static void write_contacts(const carom_contact_problem *p, const carom_contact_solution *x,
                           const adjoint *a, carom_contact_bars *bars)
{
    for (int k = 0; k < p->n_contacts; k++) {
        const int *body = p->contact_body + 2 * k;
        const int friction = crm_has_friction(p, k);
        const double sign = friction ? crm_slip_sign(x->mode[k]) : 0;
        if (bars->cn) bars->cn[k] = -a->qn[k];
        if (bars->ct) bars->ct[k] = -a->qt[k];
        if (bars->jn) row_bar(p, a, x->v, body, x->ln[k], a->qn[k], bars->jn + 6 * k);
        if (bars->jt) {
            const double lt = friction ? x->lt[k] : 0;
            row_bar(p, a, x->v, body, lt, a->qt[k], bars->jt + 6 * k);
        }
        if (!bars->mu) continue;
        bars->mu[k] = 0;
        for (int i = 0; i < 6 && sign != 0; i++) {
            const int at = 3 * body[i / 3] + i % 3;
            if (body[i / 3] < 0) continue;
            bars->mu[k] += sign * x->ln[k] * p->jt[6 * k + i] * p->inv_mass[at] * a->p[at];
        }
    }
}

static void write_bars(const carom_contact_problem *p, const carom_contact_solution *x,
                       const adjoint *a, carom_contact_bars *bars)
{
    for (int i = 0; i < 3 * p->n_bodies; i++) {
        if (bars->u) bars->u[i] = a->p[i];
        if (bars->inv_mass) bars->inv_mass[i] = a->p[i] * a->f[i];
    }
    write_contacts(p, x, a, bars);
    for (int r = 0; r < p->n_joint_rows; r++) {
        if (bars->ce) bars->ce[r] = -a->qe[r];
        if (bars->je)
            row_bar(p, a, x->v, p->joint_body + 2 * r, x->le[r], a->qe[r], bars->je + 6 * r);
    }
}

/* 9 per body, 2 per contact, 1 per joint row. */
static carom_status reserve_scratch(carom_contact_solver *c, const carom_contact_problem *p)
{
    const int n = 9 * p->n_bodies + 2 * p->n_contacts + p->n_joint_rows + 1;
    return crm_reserve(&c->memory, (void **)&c->scratch, &c->scratch_max, n, sizeof(double));
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
    if (s < 0) return s;
    adjoint a = carve(solver->scratch, p);
    const int n = 3 * p->n_bodies;
    memset(a.qn, 0, (size_t)(2 * p->n_contacts + p->n_joint_rows) * sizeof(double));
    for (int i = 0; i < n; i++) a.p[i] = v_bar[i];
    for (int i = 0; i < solver->graph.n_islands; i++)
        solve_island(solver, p, x->mode, v_bar, i, &a);
    finish(p, x, &a, a.qe + p->n_joint_rows);
    for (int i = 0; i < n; i++) {
        if (!isfinite(a.p[i])) return CAROM_E_SINGULAR;
    }
    write_bars(p, x, &a, bars);
    return CAROM_OK;
}
