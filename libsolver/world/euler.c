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

/* Contacts that pressed and did not bounce. */
static void mark_pressing(crm_substep *s)
{
    for (int k = 0; k < s->n_contacts; k++) {
        const int bounces = s->cn[k] < 0 && !s->contacts[k].speculative;
        s->pressing[k] = s->mode[k] != CAROM_SEPARATED && s->ln[k] > 0 && !bounces;
    }
}

/* A pressing contact that the correction lets go presses no longer; 1 when there was one. */
static int release(crm_substep *s, const crm_projection *c)
{
    int any = 0;
    for (int k = 0; k < s->n_contacts; k++) {
        if (!s->pressing[k] || c->mode[k] != CAROM_SEPARATED) continue;
        s->pressing[k] = 0;
        any = 1;
    }
    return any;
}

/* One correction at c->q: multipliers, modes, and the displacement in rows.v. */
static carom_status correct(carom_world *w, crm_substep *s, crm_projection *c)
{
    carom_contact_stats stats = {0};
    carom_contact_solution x = {w->rows.v, c->ln, s->moved_lt, c->le, c->mode};
    for (int again = 1; again;) {
        const carom_contact_problem p = crm_position_problem(w, s, c->q, NULL);
        const carom_status e = carom_contact_solve(w->solver, &p, 1, &x, &stats);
        if (e < 0) return e;
        add_stats(w, &stats);
        again = release(s, c);
    }
    for (int k = 0; k < s->n_contacts; k++) {
        if (s->pressing[k]) c->ln[k] -= s->h * s->ln[k];
    }
    for (int k = 0; k < 2 * w->n_joints; k++) c->le[k] -= s->h * s->le[k];
    return CAROM_OK;
}

/* Nothing to correct: the correction is zero, but its derivative is not; the reverse pass needs to
 * know what is held. */
static void correct_nothing(carom_world *w, const crm_substep *s, crm_projection *c)
{
    memset(c->le, 0, 2 * (size_t)w->n_joints * sizeof *c->le);
    if (s->n_contacts) memset(c->ln, 0, (size_t)s->n_contacts * sizeof *c->ln);
}

carom_status crm_project(carom_world *w, crm_substep *s)
{
    const double tol = POSITION_TOL * w->length + crm_rounding(w);
    s->n_projections = 0;
    if (!s->n_contacts && !w->n_joints) return CAROM_OK;
    for (int k = 0; k < CRM_MAX_PROJECTIONS; k++) {
        crm_projection *c = &s->projection[k];
        double violation;
        crm_position_problem(w, s, s->q1, &violation);
        if (k && violation <= tol) break;
        memcpy(c->q, s->q1, 3 * (size_t)w->n_bodies * sizeof(double));
        for (int i = 0; i < s->n_contacts; i++) {
            const int closed = s->pressing[i] || (k && c[-1].mode[i]);
            c->mode[i] = closed ? CAROM_STICK : CAROM_SEPARATED;
        }
        s->n_projections = k + 1;
        if (violation <= tol) {
            correct_nothing(w, s, c);
            break;
        }
        const carom_status e = correct(w, s, c);
        if (e < 0) s->n_projections = k;
        if (e < 0) return e == CAROM_E_MEMORY ? e : CAROM_LIMIT;
        move(w, s->q1, w->rows.v, 1);
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
    mark_pressing(s);
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
