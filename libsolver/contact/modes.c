#include "libsolver/contact/ladder/ladder.h"
#include "libsolver/contact/solver.h"

#include <math.h>

static void solve_island(carom_contact_solver *c, const carom_contact_problem *p, int island,
                         carom_contact_solution *x)
{
    const crm_graph *g = &c->graph;
    crm_system_gather(&c->system, g, p, island);
    crm_island *s = crm_system_begin(&c->system, island);
    crm_system_set_modes(g, s, island, x->mode);
    for (int k = 0; k < s->nc; k++) s->best_mode[k] = s->mode[k];
    crm_vec_zero(s, s->x);
    crm_solve_modes(s, CRM_PASSES);
    crm_vec_copy(s, s->best, s->x);
    crm_system_write(&c->system, g, p, s, island, x);
}

carom_status carom_contact_modes(carom_contact_solver *solver, const carom_contact_problem *problem,
                                 carom_contact_solution *x)
{
    const carom_contact_problem *p = problem;
    if (!solver) return CAROM_E_ARGUMENT;
    const carom_status s = crm_solver_open(solver, p, x);
    if (s < 0) return s;
    for (int i = 0; i < 3 * p->n_bodies; i++) x->v[i] = p->u[i];
    for (int k = 0; k < p->n_contacts; k++) x->ln[k] = x->lt[k] = 0;
    for (int r = 0; r < p->n_joint_rows; r++) x->le[r] = 0;
    for (int i = 0; i < solver->graph.n_islands; i++) solve_island(solver, p, i, x);
    for (int i = 0; i < 3 * p->n_bodies; i++) {
        if (!isfinite(x->v[i])) return CAROM_E_SINGULAR;
    }
    return CAROM_OK;
}
