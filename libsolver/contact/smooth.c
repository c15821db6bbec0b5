#include "libsolver/contact/ladder/ladder.h"
#include "libsolver/contact/solver.h"

#include <math.h>

/* On the central path the equations of contact k are, with W_k of (23) at the products kappa,
 *   dl = -W_k (J dv + dJ v + dc) + (0, dl_t / dmu) dmu,
 * so that in the adjoint  p + C' q = g,  B' W p = W_k^-T q  with both rows of the contact in B and
 * C. With P = p+^2 / kappa and Q = p-^2 / kappa the impulses alone give W_k. */

void crm_take_modes(carom_contact_solver *c, int island, const carom_contact_solution *x)
{
    const crm_graph *g = &c->graph;
    crm_island *s = crm_system_begin(&c->system, island);
    const double speed = c->system.speed[island];
    int any = 0;
    crm_system_set_modes(g, s, island, x->mode);
    for (int k = 0; k < s->nc; k++) any |= s->mode[k] == CAROM_SMOOTHED;
    if (!any) return;
    crm_system_read(&c->system, g, s, island, x, CAROM_GUESS_IMPULSES);
    s->kappa = c->kappa / (speed * speed);
    crm_set_smooth_responses(s);
}

/* s->best <- the point of the path; 1: reached. */
static int find_point(carom_contact_solver *c, const carom_contact_problem *p, double kappa,
                      int island, const carom_contact_solution *x)
{
    crm_system_gather(&c->system, &c->graph, p, island);
    crm_island *s = crm_system_begin(&c->system, island);
    const double speed = c->system.speed[island];
    s->max_iterations = c->settings.max_iterations;
    crm_system_read(&c->system, &c->graph, s, island, x, CAROM_GUESS_IMPULSES);
    if (!crm_central_path(s, kappa / (speed * speed))) return 0;
    crm_vec_copy(s, s->best, s->x);
    for (int k = 0; k < s->nc; k++) s->best_mode[k] = CAROM_SMOOTHED;
    return 1;
}

carom_status carom_contact_smooth(carom_contact_solver *solver,
                                  const carom_contact_problem *problem, double kappa,
                                  carom_contact_solution *x)
{
    const carom_contact_problem *p = problem;
    if (!solver || !(kappa > 0) || !(kappa < HUGE_VAL)) return CAROM_E_ARGUMENT;
    const carom_status e = crm_solver_open(solver, p, x);
    if (e < 0) return e;
    for (int i = 0; i < solver->graph.n_islands; i++) {
        if (!find_point(solver, p, kappa, i, x)) return CAROM_E_NO_SOLUTION;
    }
    solver->kappa = kappa;
    crm_solver_write(solver, p, x);
    return CAROM_OK;
}
