/* euler.c: the paper's step, corrected: one velocity problem, x += h v+, position corrections.
 * docs/step.md. */
#include "world/internal.h"

#include <float.h>
#include <math.h>

/* Position errors below this are left alone [L]; rounding of far coordinates is added. */
static const double POSITION_TOL = 1e-13;

static void add_stats(carom_world *w, const carom_contact_stats *c)
{
    carom_step_stats *s = w->stats;
    if (c->status > s->status) s->status = c->status;
    s->residual = fmax(s->residual, c->residual);
    s->factorizations += c->factorizations;
    s->iterations += c->iterations;
    if (c->stage > s->stage) s->stage = c->stage;
}

double crm_rounding(const carom_world *w)
{
    double far = 0;
    for (int b = 0; b < w->n_bodies; b++) {
        far = fmax(far, fmax(fabs(w->q[3 * b + 1]), fabs(w->q[3 * b + 2])));
    }
    return 8 * DBL_EPSILON * far;
}

static carom_contact_solution velocity_solution(carom_world *w, crm_substep *s)
{
    const carom_contact_solution x = {w->rows.v, s->ln, s->lt, s->le, s->mode};
    return x;
}

/* Solves for v+.  Restitution may leave no solution (a disc wedged between walls): then the
 * sub-step is plastic, and says so. */
static carom_status solve_velocity(carom_world *w, crm_substep *s)
{
    carom_contact_stats stats = {0};
    s->restitution = 1;
    carom_contact_problem p = crm_velocity_problem(w, s);
    carom_contact_solution x = velocity_solution(w, s);
    carom_status e = carom_contact_solve(w->solver, &p, 1, &x, &stats);
    if (e == CAROM_E_INFEASIBLE || e == CAROM_E_NO_SOLUTION) {
        s->restitution = 0;
        p = crm_velocity_problem(w, s);
        e = carom_contact_solve(w->solver, &p, 0, &x, &stats);
        if (e >= 0 && w->stats->status < CAROM_RELAXED) w->stats->status = CAROM_RELAXED;
    }
    if (e < 0) return e;
    add_stats(w, &stats);
    s->degenerate = stats.degenerate;
    return e;
}

/* q1 += displacement of the moving bodies, scaled. */
static void move(carom_world *w, double *q, const double *displacement, double scale)
{
    for (int b = 0; b < w->n_bodies; b++) {
        const int i = crm_unknown(w, b);
        if (i < 0) continue;
        for (int k = 0; k < 3; k++) q[3 * b + k] += scale * displacement[3 * i + k];
    }
}

static void guess_closed(int n, const unsigned char *from, unsigned char *to)
{
    for (int k = 0; k < n; k++) to[k] = from[k] ? CAROM_STICK : CAROM_SEPARATED;
}

carom_status crm_project(carom_world *w, crm_substep *s)
{
    const double tol = POSITION_TOL * w->length + crm_rounding(w);
    s->n_projections = 0;
    if (!s->n_contacts && !w->n_joints) return CAROM_OK;
    for (int k = 0; k < CRM_MAX_PROJECTIONS; k++) {
        crm_projection *c = &s->projection[k];
        double violation;
        const carom_contact_problem p = crm_position_problem(w, s, s->q1, &violation);
        if (violation <= tol) break;
        memcpy(c->q, s->q1, 3 * (size_t)w->n_bodies * sizeof(double));
        guess_closed(s->n_contacts, k ? s->projection[k - 1].mode : s->mode, c->mode);
        carom_contact_solution x = {w->rows.v, c->ln, s->moved_lt, c->le, c->mode};
        carom_contact_stats stats = {0};
        const carom_status e = carom_contact_solve(w->solver, &p, 1, &x, &stats);
        if (e == CAROM_E_MEMORY) return e;
        if (e < 0) return CAROM_LIMIT;
        add_stats(w, &stats);
        move(w, s->q1, w->rows.v, 1);
        s->n_projections = k + 1;
    }
    return CAROM_OK;
}

carom_status crm_euler(carom_world *w, double h)
{
    crm_substep *s = &w->sub;
    const size_t bytes = 3 * (size_t)w->n_bodies * sizeof(double);
    s->h = h;
    const carom_status e = solve_velocity(w, s);
    if (e < 0) return e;
    memcpy(s->q1, s->q0, bytes);
    memcpy(s->v1, s->v0, bytes);
    for (int b = 0; b < w->n_bodies; b++) {
        const int i = crm_unknown(w, b);
        if (i >= 0) memcpy(&s->v1[3 * b], &w->rows.v[3 * i], 3 * sizeof(double));
    }
    move(w, s->q1, w->rows.v, h);
    return crm_project(w, s);
}

/* Both lists are ordered by shape pair: one merge. */
void crm_guess_load(carom_world *w)
{
    crm_substep *s = &w->sub;
    int g = 0;
    for (int k = 0; k < s->n_contacts; k++) {
        const crm_contact *c = &s->contacts[k];
        while (g < w->n_guess &&
               (w->guess[g].shape_a < c->shape_a ||
                (w->guess[g].shape_a == c->shape_a && w->guess[g].shape_b < c->shape_b))) {
            g++;
        }
        s->mode[k] = c->speculative ? CAROM_SEPARATED : CAROM_STICK;
        for (int i = g; i < w->n_guess && w->guess[i].shape_a == c->shape_a &&
                        w->guess[i].shape_b == c->shape_b;
             i++) {
            if (crm_recipe_same(w->guess[i].recipe, c->recipe)) s->mode[k] = w->guess[i].mode;
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
        const crm_guess g = {c->shape_a, c->shape_b, c->recipe, s->mode[k]};
        w->guess[k] = g;
    }
    return CAROM_OK;
}
