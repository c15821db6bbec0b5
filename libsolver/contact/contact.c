#include "libsolver/contact/check.h"
#include "libsolver/contact/islands.h"
#include "libsolver/contact/residual.h"

#include <math.h>

carom_contact_settings carom_contact_defaults(void)
{
    return (carom_contact_settings){
        .accept = 1e-10, .inexact = 1e-6, .max_iterations = 60, .max_restarts = 12, .threads = 1};
}

static int settings_valid(const carom_contact_settings *s)
{
    return s->accept > 0 && s->accept < HUGE_VAL && s->inexact >= s->accept &&
           s->inexact < HUGE_VAL && s->max_iterations > 0 && s->max_restarts >= 0 &&
           s->threads >= 1 && s->threads <= CRM_MAX_THREADS;
}

carom_status carom_contact_create(const carom_contact_settings *settings,
                                  const carom_allocator *allocator, carom_contact_solver **out)
{
    const carom_contact_settings set = settings ? *settings : carom_contact_defaults();
    if (!out || !settings_valid(&set)) return CAROM_E_ARGUMENT;
    crm_memory m = crm_memory_from(allocator);
    carom_contact_solver *c = crm_new(&m, 1, sizeof *c);
    if (!c) return CAROM_E_MEMORY;
    c->memory = m;
    c->settings = set;
    c->graph.n_bodies = -1;
    *out = c;
    return CAROM_OK;
}

void carom_contact_destroy(carom_contact_solver *solver)
{
    if (!solver) return;
    crm_memory *m = &solver->memory;
    crm_graph_free(m, &solver->graph);
    crm_block_pattern_free(m, &solver->pattern);
    crm_system_free(m, &solver->system);
    crm_free(m, solver->scratch, (size_t)solver->scratch_max, sizeof(double));
    crm_free(m, solver->certificate, (size_t)solver->certificate_max, sizeof(double));
    crm_memory last = *m;
    crm_free(&last, solver, 1, sizeof *solver);
}

void carom_contact_memory(const carom_contact_solver *solver, size_t *bytes, long *calls)
{
    *bytes = solver->memory.live;
    *calls = solver->memory.n_calls;
}

carom_factor_size carom_contact_factor_size(const carom_contact_solver *solver)
{
    carom_factor_size z = {0, 0};
    if (!solver || !solver->pattern_valid) return z;
    const crm_block_pattern *s = &solver->pattern;
    for (int j = 0; j < s->n; j++) {
        const double c = s->lp[j + 1] - s->lp[j];
        z.nonzeros += 9 * (2 * c + 1);
        /* The diagonal, both panels, and c^2 products of blocks for the columns behind. */
        z.flops += 16 + 45 * c + 54 * c * c;
    }
    return z;
}

carom_status crm_solver_prepare(carom_contact_solver *c, const carom_contact_problem *p)
{
    crm_memory *m = &c->memory;
    int same;
    carom_status s = crm_graph_update(m, &c->graph, p, &same);
    if (!same) c->pattern_valid = c->system_valid = 0;
    if (s < 0) return s;
    if (!c->pattern_valid) {
        s = crm_block_analyze(m, &c->pattern, &c->graph);
        if (s < 0) return s;
        c->pattern_valid = 1;
    }
    if (c->system_valid) return CAROM_OK;
    s = crm_system_reserve(m, &c->system, &c->graph, &c->pattern);
    c->system_valid = s >= 0;
    return s;
}

carom_status crm_solver_open(carom_contact_solver *c, const carom_contact_problem *p,
                             const carom_contact_solution *x)
{
    carom_status s = crm_contact_check(p);
    if (s >= 0) s = crm_solution_check(p, x);
    if (s >= 0 && !crm_modes_valid(p, x->mode)) s = CAROM_E_ARGUMENT;
    return s < 0 ? s : crm_solver_prepare(c, p);
}

/* Rows that no impulse can change must hold as they are. */
static carom_status check_prescribed(carom_contact_solver *c, const carom_contact_problem *p,
                                     double speed)
{
    const double limit = c->settings.accept * speed;
    for (int k = 0; k < p->n_contacts; k++) {
        const int *body = p->contact_body + 2 * k;
        const double a = crm_row_times(p->jn + 6 * k, body, p->u) + p->cn[k];
        if (a >= 0 || crm_row_weight(p->jn + 6 * k, body, p->inv_mass) > 0) continue;
        if (a < -limit) return crm_give_row(c, p, k, 1);
    }
    for (int r = 0; r < p->n_joint_rows; r++) {
        const int *body = p->joint_body + 2 * r;
        if (crm_row_weight(p->je + 6 * r, body, p->inv_mass) > 0) continue;
        const double e = crm_row_times(p->je + 6 * r, body, p->u) + (p->ce ? p->ce[r] : 0);
        if (fabs(e) > limit) return crm_give_row(c, p, p->n_contacts + r, e > 0 ? -1 : 1);
    }
    return CAROM_OK;
}

/* What no island owns: bodies in free flight, rows of prescribed motion. */
static void write_rest(const crm_graph *g, const carom_contact_problem *p,
                       carom_contact_solution *x)
{
    for (int i = 0; i < 3 * p->n_bodies; i++) x->v[i] = p->u[i];
    if (g->n_live < p->n_contacts) {
        for (int k = 0; k < p->n_contacts; k++) {
            x->ln[k] = 0;
            x->lt[k] = 0;
            x->mode[k] = CAROM_SEPARATED;
        }
    }
    for (int r = 0; r < p->n_joint_rows; r++) x->le[r] = 0;
}

void crm_solver_write(carom_contact_solver *c, const carom_contact_problem *p,
                      carom_contact_solution *x)
{
    write_rest(&c->graph, p, x);
    for (int i = 0; i < c->graph.n_islands; i++) {
        crm_system_write(&c->system, &c->graph, p, &c->system.island[i], i, x);
    }
}

/* What there is to solve, from the graph. */
static void count(const carom_contact_solver *c, carom_contact_stats *stats)
{
    const crm_graph *g = &c->graph;
    stats->islands = g->n_islands;
    stats->bodies = g->n_nodes;
    stats->contacts = g->n_live;
    for (int q = 0; q < g->n_groups; q++) stats->joint_rows += g->group_size[q];
}

static carom_status judge(const carom_contact_settings *s, double residual)
{
    if (residual <= s->accept) return CAROM_OK;
    return residual <= s->inexact ? CAROM_INEXACT : CAROM_E_NO_SOLUTION;
}

carom_status crm_reserve_residual(carom_contact_solver *c, const carom_contact_problem *p)
{
    return crm_reserve(&c->memory, (void **)&c->scratch, &c->scratch_max, 6 * p->n_bodies + 1,
                       sizeof(double));
}

static carom_status solve(carom_contact_solver *c, const carom_contact_problem *p, int use_guess,
                          carom_contact_solution *x, carom_contact_stats *stats)
{
    carom_status s = crm_contact_check(p);
    if (s >= 0) s = crm_solution_check(p, x);
    if (s < 0) return s;
    s = crm_reserve_residual(c, p);
    if (s >= 0) s = crm_solver_prepare(c, p);
    if (s < 0) return s;
    const double speed = crm_contact_speed(p);
    s = check_prescribed(c, p, speed);
    if (s >= 0) count(c, stats);
    if (s >= 0) s = crm_islands_solve(c, p, use_guess, x, stats);
    if (s < 0) return s;
    crm_solver_write(c, p, x);
    stats->residual = crm_contact_residual(p, x, speed, c->scratch);
    return judge(&c->settings, stats->residual);
}

carom_status carom_contact_solve(carom_contact_solver *solver, const carom_contact_problem *problem,
                                 int use_guess, carom_contact_solution *x,
                                 carom_contact_stats *stats)
{
    carom_contact_stats own = {.stage = CAROM_STAGE_NONE, .residual = HUGE_VAL};
    if (!solver) return CAROM_E_ARGUMENT;
    solver->certificate_valid = 0;
    own.status = solve(solver, problem, use_guess, x, &own);
    if (stats) *stats = own;
    return own.status;
}

carom_status carom_contact_certificate(const carom_contact_solver *solver, double *yn, double *ye)
{
    if (!solver || !solver->certificate_valid) return CAROM_E_STATE;
    const crm_graph *g = &solver->graph;
    for (int k = 0; k < g->n_contacts; k++) yn[k] = solver->certificate[k];
    for (int r = 0; r < g->n_rows; r++) ye[r] = solver->certificate[g->n_contacts + r];
    return CAROM_OK;
}
