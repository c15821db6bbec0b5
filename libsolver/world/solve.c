/* solve.c: running one contact problem of a sub-step; first guesses. */
#include "world/internal.h"

#include <float.h>
#include <math.h>

double crm_rounding(const carom_world *w)
{
    double far = 0;
    for (int b = 0; b < w->n_bodies; b++) {
        far = fmax(far, fmax(fabs(w->q[3 * b + 1]), fabs(w->q[3 * b + 2])));
    }
    return 8 * DBL_EPSILON * far;
}

void crm_move(const carom_world *w, double *q, const double *v, double scale)
{
    for (int b = 0; b < w->n_bodies; b++) {
        if (crm_unknown(w, b) < 0) continue;
        for (int k = 3 * b; k < 3 * b + 3; k++) q[k] += scale * v[k];
    }
}

static void add_stats(carom_world *w, const carom_contact_stats *c)
{
    carom_step_stats *s = w->stats;
    if (c->status > s->status) s->status = c->status;
    s->residual = fmax(s->residual, c->residual);
    s->factorizations += c->factorizations;
    s->iterations += c->iterations;
    if (c->stage > s->stage) s->stage = c->stage;
}

carom_status crm_solve_run(carom_world *w, crm_substep *s, crm_solve *c, int use_guess)
{
    carom_contact_stats stats = {0};
    const carom_contact_problem p = crm_problem(w, s, c);
    carom_contact_solution x = {w->rows.v, c->ln, c->lt, c->le, c->mode};
    const carom_status e = carom_contact_solve(w->solver, &p, use_guess, &x, &stats);
    if (e < 0) return e;
    add_stats(w, &stats);
    if (c->kind != CRM_CORRECTION) s->degenerate = stats.degenerate;
    for (int b = 0; b < w->n_bodies; b++) {
        const int i = crm_unknown(w, b);
        for (int k = 0; k < 3; k++) c->v[3 * b + k] = i < 0 ? 0 : w->rows.v[3 * i + k];
    }
    return e;
}

carom_status crm_solve_bounce(carom_world *w, crm_substep *s, crm_solve *c, const double *v)
{
    s->restitution = 1;
    crm_velocity_targets(w, s, v, c);
    const carom_status e = crm_solve_run(w, s, c, 1);
    if (e != CAROM_E_INFEASIBLE && e != CAROM_E_NO_SOLUTION) return e;
    s->restitution = 0;
    crm_velocity_targets(w, s, v, c);
    const carom_status again = crm_solve_run(w, s, c, 0);
    if (again >= 0 && w->stats->status < CAROM_RELAXED) w->stats->status = CAROM_RELAXED;
    return again;
}

static int before(const crm_guess *g, const crm_contact *c)
{
    return g->shape_a < c->shape_a || (g->shape_a == c->shape_a && g->shape_b < c->shape_b);
}

/* Both lists are ordered by shape pair: one merge. */
void crm_guess_load(carom_world *w)
{
    crm_substep *s = &w->sub;
    int g = 0;
    for (int k = 0; k < s->n_contacts; k++) {
        const crm_contact *c = &s->contacts[k];
        unsigned char *mode = &s->solve[0].mode[k];
        while (g < w->n_guess && before(&w->guess[g], c)) g++;
        *mode = c->speculative ? CAROM_SEPARATED : CAROM_STICK;
        for (int i = g; i < w->n_guess && w->guess[i].shape_a == c->shape_a &&
                        w->guess[i].shape_b == c->shape_b;
             i++) {
            if (crm_recipe_same(w->guess[i].recipe, c->recipe)) *mode = w->guess[i].mode;
        }
    }
}

carom_status crm_guess_save(carom_world *w)
{
    const crm_substep *s = &w->sub;
    void *p = w->guess;
    const carom_status e =
        crm_reserve(&w->memory, &p, &w->max_guess, s->n_contacts, sizeof *w->guess);
    w->guess = p;
    if (e) return e;
    w->n_guess = s->n_contacts;
    for (int k = 0; k < s->n_contacts; k++) {
        const crm_contact *c = &s->contacts[k];
        const crm_guess g = {c->shape_a, c->shape_b, c->recipe, s->solve[0].mode[k]};
        w->guess[k] = g;
    }
    return CAROM_OK;
}

carom_status crm_map_run(carom_world *w, double h)
{
    return w->smooth ? crm_smooth(w, h) : crm_euler(w, h);
}
