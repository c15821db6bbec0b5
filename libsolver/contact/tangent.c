#include "libsolver/contact/check.h"
#include "libsolver/contact/ladder/ladder.h"
#include "libsolver/contact/residual.h"
#include "libsolver/contact/solver.h"

#include <math.h>

/* At the active set,  v - u - W B l = 0,  C v + c = 0  (adjoint.c).  Along a direction
 *   dv = e + W B dl,      e = du + dW B l + W dB l
 *   C dv = -(dC v + dc),  hence  C (W B dl) + (dC v + dc + C e) = 0
 * which has the form of the problem itself, with other constants c. */
typedef struct tangent {
    double *e;  /* 3 n_bodies */
    double *rn; /* n_contacts: dJ_n v + dc_n + J_n e */
    double *rt;
    double *re;     /* n_joint_rows */
    double *change; /* 3 n_bodies: dB l */
    double *spare;  /* 3 n_bodies */
} tangent;

/* Rows that are missed by more are at odds [largest constant]. */
static const double AT_ODDS = 1e-10;

static tangent carve(double *scratch, const carom_contact_problem *p)
{
    tangent t;
    t.e = scratch;
    t.rn = t.e + 3 * p->n_bodies;
    t.rt = t.rn + p->n_contacts;
    t.re = t.rt + p->n_contacts;
    t.change = t.re + p->n_joint_rows;
    t.spare = t.change + 3 * p->n_bodies;
    return t;
}

static double entry(const double *x, int i)
{
    return x ? x[i] : 0;
}

/* e += J' l. */
static void add_forces(const carom_contact_problem *p, const carom_contact_solution *x, double *e)
{
    for (int k = 0; k < p->n_contacts; k++) {
        const int *body = p->contact_body + 2 * k;
        crm_row_add(e, p->jn + 6 * k, body, x->ln[k]);
        if (crm_has_friction(p, k)) crm_row_add(e, p->jt + 6 * k, body, x->lt[k]);
    }
    for (int r = 0; r < p->n_joint_rows; r++)
        crm_row_add(e, p->je + 6 * r, p->joint_body + 2 * r, x->le[r]);
}

/* e += dB l. */
static void add_changes(const carom_contact_problem *p, const carom_contact_solution *x,
                        const carom_contact_direction *d, double *e)
{
    for (int k = 0; k < p->n_contacts; k++) {
        const int *body = p->contact_body + 2 * k;
        if (d->jn) crm_row_add(e, d->jn + 6 * k, body, x->ln[k]);
        if (!crm_has_friction(p, k)) continue;
        if (d->jt) crm_row_add(e, d->jt + 6 * k, body, x->lt[k]);
        const double share = crm_friction_share(x->mode[k], p->mu[k], x->ln[k], x->lt[k]);
        const double change = share * entry(d->mu, k) * x->ln[k];
        if (change != 0) crm_row_add(e, p->jt + 6 * k, body, change);
    }
    for (int r = 0; d->je && r < p->n_joint_rows; r++)
        crm_row_add(e, d->je + 6 * r, p->joint_body + 2 * r, x->le[r]);
}

static void find_motion(const carom_contact_problem *p, const carom_contact_solution *x,
                        const carom_contact_direction *d, tangent *t)
{
    const int n = 3 * p->n_bodies;
    memset(t->e, 0, (size_t)n * sizeof(double));
    memset(t->change, 0, (size_t)n * sizeof(double));
    if (d->inv_mass) add_forces(p, x, t->e);
    add_changes(p, x, d, t->change);
    for (int i = 0; i < n; i++) {
        t->e[i] = entry(d->u, i) + entry(d->inv_mass, i) * t->e[i];
        t->e[i] += p->inv_mass[i] * t->change[i];
    }
}

/* dJ v + dc + J e of one row. */
static double row_change(const double *row, const double *change, double c, const int *body,
                         const double *v, const double *e)
{
    return crm_row_times(row, body, e) + (change ? crm_row_times(change, body, v) : 0) + c;
}

static void find_rows(const carom_contact_problem *p, const carom_contact_solution *x,
                      const carom_contact_direction *d, tangent *t)
{
    for (int k = 0; k < p->n_contacts; k++) {
        const int *body = p->contact_body + 2 * k;
        t->rn[k] = row_change(p->jn + 6 * k, d->jn ? d->jn + 6 * k : NULL, entry(d->cn, k), body,
                              x->v, t->e);
        t->rt[k] = 0;
        if (!crm_has_friction(p, k)) continue;
        t->rt[k] = row_change(p->jt + 6 * k, d->jt ? d->jt + 6 * k : NULL, entry(d->ct, k), body,
                              x->v, t->e);
    }
    const double *left = p->je_left ? p->je_left : p->je;
    for (int r = 0; r < p->n_joint_rows; r++)
        t->re[r] = row_change(left + 6 * r, d->je ? d->je + 6 * r : NULL, entry(d->ce, r),
                              p->joint_body + 2 * r, x->v, t->e);
}

/* The island's constants become the changes, scaled to a largest entry of 1; returns the scale. */
static double set_constants(crm_system *y, const crm_graph *g, int island, const tangent *t)
{
    double size = 0;
    for (int k = g->contact_ptr[island]; k < g->contact_ptr[island + 1]; k++) {
        crm_contact *c = &y->contact[k];
        c->cn = y->scale_n[k] * t->rn[g->contact_of[k]];
        c->ct = y->scale_t[k] * t->rt[g->contact_of[k]];
        size = fmax(size, fmax(fabs(c->cn), fabs(c->ct)));
    }
    for (int q = g->group_ptr[island]; q < g->group_ptr[island + 1]; q++) {
        for (int i = 0; i < g->group_size[q]; i++) {
            y->group[q].c[i] = y->scale_e[3 * q + i] * t->re[g->group_row[q] + i];
            size = fmax(size, fabs(y->group[q].c[i]));
        }
    }
    for (int k = g->contact_ptr[island]; size > 0 && k < g->contact_ptr[island + 1]; k++) {
        y->contact[k].cn /= size;
        y->contact[k].ct /= size;
    }
    for (int q = g->group_ptr[island]; size > 0 && q < g->group_ptr[island + 1]; q++) {
        for (int i = 0; i < g->group_size[q]; i++) y->group[q].c[i] /= size;
    }
    return size;
}

/* Largest miss of the rows at s->x. */
static double row_miss(const crm_island *s)
{
    double miss = 0;
    for (int k = 0; k < s->nc; k++) {
        const crm_contact *c = &s->contact[k];
        if (s->mode[k] == CAROM_SEPARATED || s->mode[k] == CAROM_SMOOTHED) continue;
        miss = fmax(miss, fabs(c->cn + crm_dot(c->n, c->a, c->b, s->x.z)));
        if (s->mode[k] != CAROM_STICK || !(c->mu > 0)) continue;
        miss = fmax(miss, fabs(c->ct + crm_dot(c->t, c->a, c->b, s->x.z)));
    }
    for (int q = 0; q < s->ng; q++) {
        const crm_group *g = &s->group[q];
        for (int r = 0; r < CRM_GROUP_ROWS; r++) {
            miss = fmax(miss, fabs(g->c[r] + crm_dot(g->left[r], g->a, g->b, s->x.z)));
        }
    }
    return miss;
}

/* <q, c> of the adjoint in s->x. */
static double answer(const crm_island *s)
{
    double sum = 0;
    for (int k = 0; k < s->nc; k++) {
        if (s->mode[k] == CAROM_SEPARATED) continue;
        sum += s->x.n[k] * s->contact[k].cn;
        if (s->mode[k] == CAROM_STICK && s->contact[k].mu > 0) {
            sum += s->x.t[k] * s->contact[k].ct;
        }
    }
    for (int i = 0; i < CRM_GROUP_ROWS * s->ng; i++) {
        sum += s->x.z[3 * s->nb + i] * s->group[i / CRM_GROUP_ROWS].c[i % CRM_GROUP_ROWS];
    }
    return sum;
}

/* Where more rows than there are freedoms are asked for motions at odds, as when two contacts of a
 * face stick and turn, multipliers grow without end and their rounding spoils the motion.  The
 * adjoint has no such rows: the motion then is its transpose, entry by entry, -<q_i, c>. */
static void transpose_adjoint(crm_island *s, double *z, double *unit)
{
    for (int i = 0; i < 3 * s->nb; i++) unit[i] = 0;
    for (int i = 0; i < 3 * s->nb; i++) {
        unit[i] = 1;
        crm_island_adjoint(s, unit, 0, 0);
        unit[i] = 0;
        z[i] = -answer(s);
    }
}

/* e += W B dl of one island, whose values and modes are gathered. */
static void solve_island(carom_contact_solver *c, int island, tangent *t)
{
    const crm_graph *g = &c->graph;
    const double size = set_constants(&c->system, g, island, t);
    if (!(size > 0)) return;
    crm_island *s = crm_system_begin(&c->system, island);
    crm_vec_zero(s, s->x);
    crm_solve_modes(s, CRM_PASSES);
    double *z = s->x.z;
    if (row_miss(s) > AT_ODDS) {
        z = t->change; /* as large, and used up */
        transpose_adjoint(s, z, t->spare);
    }
    for (int i = 0; i < 3 * s->nb; i++) {
        const int node = g->node_ptr[island] + i / 3;
        t->e[3 * g->body_of[node] + i % 3] += size * c->system.root[3 * node + i % 3] * z[i];
    }
}

/* 9 per body, 2 per contact, 1 per joint row. */
static carom_status reserve_scratch(carom_contact_solver *c, const carom_contact_problem *p)
{
    const int n = 9 * p->n_bodies + 2 * p->n_contacts + p->n_joint_rows + 1;
    return crm_reserve(&c->memory, (void **)&c->scratch, &c->scratch_max, n, sizeof(double));
}

carom_status carom_contact_tangent_again(carom_contact_solver *solver,
                                         const carom_contact_problem *problem,
                                         const carom_contact_solution *x,
                                         const carom_contact_direction *direction, double *dv)
{
    const carom_contact_problem *p = problem;
    if (!solver || !p || !x || !direction || !dv) return CAROM_E_ARGUMENT;
    tangent t = carve(solver->scratch, p);
    find_motion(p, x, direction, &t);
    find_rows(p, x, direction, &t);
    for (int i = 0; i < solver->graph.n_islands; i++) solve_island(solver, i, &t);
    for (int i = 0; i < 3 * p->n_bodies; i++) {
        if (!isfinite(t.e[i])) return CAROM_E_SINGULAR;
    }
    for (int i = 0; i < 3 * p->n_bodies; i++) dv[i] = t.e[i];
    return CAROM_OK;
}

carom_status carom_contact_tangent(carom_contact_solver *solver,
                                   const carom_contact_problem *problem,
                                   const carom_contact_solution *x,
                                   const carom_contact_direction *direction, double *dv)
{
    const carom_contact_problem *p = problem;
    if (!solver || !direction || !dv) return CAROM_E_ARGUMENT;
    carom_status s = crm_contact_check(p);
    if (s >= 0) s = crm_solution_check(p, x);
    if (s >= 0 && !crm_modes_valid(p, x->mode)) s = CAROM_E_ARGUMENT;
    if (s >= 0) s = reserve_scratch(solver, p);
    if (s >= 0) s = crm_solver_prepare(solver, p);
    for (int i = 0; s >= 0 && i < solver->graph.n_islands; i++) {
        crm_system_gather(&solver->system, &solver->graph, p, i);
        crm_take_modes(solver, i, x);
    }
    return s < 0 ? s : carom_contact_tangent_again(solver, p, x, direction, dv);
}
