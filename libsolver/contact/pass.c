#include "libsolver/contact/ladder/ladder.h"
#include "libsolver/contact/residual.h"
#include "libsolver/contact/solver.h"

#include <math.h>

/* What a row that holds misses, J v + c, in the island's units. */
static double miss(const double *row, const int *body, const double *v, double c, double scale)
{
    return scale * (crm_row_times(row, body, v) + c);
}

/* s->rhs: what is left of the equations of s->mode; the motion follows the impulses as it is. */
static void find_misses(const crm_system *y, const crm_graph *g, const carom_contact_problem *p,
                        crm_island *s, int island, const double *v)
{
    const double speed = y->speed[island];
    memset(s->rhs.z, 0, 3 * (size_t)(s->nb + s->ng) * sizeof(double));
    for (int k = 0; k < s->nc; k++) {
        const int slot = g->contact_ptr[island] + k;
        const int c = g->contact_of[slot];
        const int *body = p->contact_body + 2 * c;
        s->rhs.n[k] = 0;
        s->rhs.t[k] = 0;
        if (s->mode[k] == CAROM_SEPARATED) continue;
        s->rhs.n[k] = -miss(p->jn + 6 * c, body, v, p->cn[c], y->scale_n[slot] / speed);
        if (s->mode[k] != CAROM_STICK || !(s->contact[k].mu > 0)) continue;
        s->rhs.t[k] = -miss(p->jt + 6 * c, body, v, p->ct ? p->ct[c] : 0, y->scale_t[slot] / speed);
    }
    const double *left = p->je_left ? p->je_left : p->je;
    for (int q = 0; q < s->ng; q++) {
        const int slot = g->group_ptr[island] + q;
        for (int i = 0; i < g->group_size[slot]; i++) {
            const int r = g->group_row[slot] + i;
            s->rhs.z[3 * (s->nb + q) + i] =
                -miss(left + 6 * r, p->joint_body + 2 * r, v, p->ce ? p->ce[r] : 0,
                      y->scale_e[3 * slot + i] / speed);
        }
    }
}

/* x += s->step, in the problem's units. */
static void add_step(const crm_system *y, const crm_graph *g, const carom_contact_problem *p,
                     const crm_island *s, int island, carom_contact_solution *x)
{
    const double speed = y->speed[island];
    const double *root = y->root + 3 * g->node_ptr[island];
    for (int i = 0; i < 3 * s->nb; i++) {
        x->v[3 * g->body_of[g->node_ptr[island] + i / 3] + i % 3] += speed * root[i] * s->step.z[i];
    }
    for (int k = 0; k < s->nc; k++) {
        const int slot = g->contact_ptr[island] + k;
        const int c = g->contact_of[slot];
        x->ln[c] += y->scale_n[slot] * speed * s->step.n[k];
        if (s->mode[k] == CAROM_STICK && s->contact[k].mu > 0) {
            x->lt[c] += y->scale_t[slot] * speed * s->step.t[k];
        } else {
            x->lt[c] = crm_slip_sign(s->mode[k]) * p->mu[c] * x->ln[c];
        }
    }
    for (int q = 0; q < s->ng; q++) {
        const int slot = g->group_ptr[island] + q;
        for (int i = 0; i < g->group_size[slot]; i++) {
            x->le[g->group_row[slot] + i] +=
                y->scale_e[3 * slot + i] * speed * s->step.z[3 * (s->nb + q) + i];
        }
    }
}

/* v = u + W J'l. */
static void follow_impulses(const carom_contact_problem *p, carom_contact_solution *x)
{
    const int n = 3 * p->n_bodies;
    memset(x->v, 0, (size_t)n * sizeof(double));
    for (int k = 0; k < p->n_contacts; k++) {
        const int *body = p->contact_body + 2 * k;
        crm_row_add(x->v, p->jn + 6 * k, body, x->ln[k]);
        if (crm_has_friction(p, k)) crm_row_add(x->v, p->jt + 6 * k, body, x->lt[k]);
    }
    for (int r = 0; r < p->n_joint_rows; r++) {
        crm_row_add(x->v, p->je + 6 * r, p->joint_body + 2 * r, x->le[r]);
    }
    for (int i = 0; i < n; i++) x->v[i] = p->u[i] + p->inv_mass[i] * x->v[i];
}

carom_status carom_contact_start(carom_contact_solver *solver, const carom_contact_problem *problem,
                                 carom_contact_solution *x)
{
    const carom_contact_problem *p = problem;
    if (!solver) return CAROM_E_ARGUMENT;
    const carom_status e = crm_solver_open(solver, p, x);
    if (e < 0) return e;
    for (int i = 0; i < solver->graph.n_islands; i++) {
        crm_system_gather(&solver->system, &solver->graph, p, i);
        crm_system_begin(&solver->system, i);
    }
    follow_impulses(p, x);
    return CAROM_OK;
}

carom_status carom_contact_pass(carom_contact_solver *solver, const carom_contact_problem *problem,
                                carom_contact_solution *x, carom_contact_stats *stats)
{
    if (!solver || !solver->system_valid || !problem || !x) return CAROM_E_ARGUMENT;
    const crm_graph *g = &solver->graph;
    crm_system *y = &solver->system;
    carom_contact_stats own = {0};
    for (int i = 0; i < g->n_islands; i++) {
        crm_island *s = &y->island[i];
        const int before = s->factorizations;
        crm_system_set_modes(g, s, i, x->mode);
        find_misses(y, g, problem, s, i, x->v);
        crm_set_responses(s, s->compliance);
        crm_island_factor(s, 1, s->compliance);
        crm_island_reduce(s, s->rhs, s->step);
        add_step(y, g, problem, s, i, x);
        own.factorizations += s->factorizations - before;
    }
    if (stats) *stats = own;
    return CAROM_OK;
}

double carom_contact_measure(carom_contact_solver *solver, const carom_contact_problem *problem,
                             const carom_contact_solution *x)
{
    if (!solver || !problem || !x || crm_reserve_residual(solver, problem) < 0) return HUGE_VAL;
    return crm_contact_residual(problem, x, crm_contact_speed(problem), solver->scratch);
}
