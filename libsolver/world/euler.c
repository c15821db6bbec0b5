/* euler.c: the paper's step, corrected: one velocity problem, x += h v+, position corrections.
 * docs/step.md. */
#include "world/internal.h"

#include <math.h>

/* Position errors below this are left alone [L]; rounding of far coordinates is added. */
static const double POSITION_TOL = 1e-13;
/* Shares of a correction that are tried. */
enum { MAX_SHARES = 8 };

/* Contacts that pressed and did not bounce. */
static void mark_pressing(crm_substep *s)
{
    const crm_solve *c = &s->solve[0];
    for (int k = 0; k < s->n_contacts; k++) {
        const int bounces = c->cn[k] < 0 && !s->contacts[k].speculative;
        s->pressing[k] = c->mode[k] != CAROM_SEPARATED && c->ln[k] > 0 && !bounces;
    }
}

/* A pressing contact that the correction lets go presses no longer; 1 when there was one. */
static int release(crm_substep *s, const crm_solve *c)
{
    int any = 0;
    for (int k = 0; k < s->n_contacts; k++) {
        if (!s->pressing[k] || c->mode[k] != CAROM_SEPARATED) continue;
        s->pressing[k] = 0;
        any = 1;
    }
    return any;
}

/* x += scale J' for one row; x has three numbers per moving body. */
static void add_row(double *x, const int body[2], const double row[6], double scale)
{
    for (int side = 0; side < 2; side++) {
        if (body[side] < 0) continue;
        for (int i = 0; i < 3; i++) x[3 * body[side] + i] += scale * row[3 * side + i];
    }
}

/* The displacement that the pressing contacts and the joints of this sub-step gave, taken back:
 * u = -h W (Jn' ln + Je' le), rows at the pose of the correction. */
static void withdraw(carom_world *w, const crm_substep *s)
{
    const crm_rows *r = &w->rows;
    const crm_solve *c = &s->solve[0];
    memset(r->u, 0, 3 * (size_t)w->island->n_bodies * sizeof(double));
    for (int k = 0; k < s->n_contacts; k++) {
        if (s->pressing[k]) add_row(r->u, &r->contact_body[2 * k], &r->jn[6 * k], -s->h * c->ln[k]);
    }
    for (int k = 0; k < w->island->n_rows; k++) {
        add_row(r->u, &r->joint_body[2 * k], &r->je[6 * k], -s->h * c->le[k]);
    }
    for (int k = 0; k < 3 * w->island->n_bodies; k++) r->u[k] *= r->inv_mass[k];
}

/* Largest overlap, gap of a pressing contact or joint error at the rows [m]. */
static double violation(const carom_world *w, const crm_substep *s)
{
    double largest = 0;
    for (int k = 0; k < s->n_contacts; k++) {
        const double gap = s->moved[k].gap;
        largest = fmax(largest, s->pressing[k] ? fabs(gap) : -gap);
    }
    for (int k = 0; k < w->island->n_rows; k++) largest = fmax(largest, fabs(w->rows.error[k]));
    return largest;
}

static void set_sides(const carom_world *w, const crm_substep *s, crm_solve *c)
{
    for (int k = 0; k < s->n_contacts; k++) {
        c->cn[k] = s->moved[k].gap;
        c->ct[k] = 0;
    }
    for (int k = 0; k < w->island->n_rows; k++) c->ce[k] = w->rows.error[k];
}

/* One correction at c->q, rows in place: displacement, modes, and the multipliers added to those of
 * an Euler step; in a smooth one nothing is held from both sides, and there is nothing to add to.
 */
static carom_status correct(carom_world *w, crm_substep *s, crm_solve *c)
{
    const crm_solve *step = &s->solve[0];
    if (s->map == CRM_MAP_SMOOTH) {
        memset(w->rows.u, 0, 3 * (size_t)w->island->n_bodies * sizeof(double));
        return crm_solve_run(w, s, c, 1);
    }
    for (int again = 1; again;) {
        withdraw(w, s);
        const carom_status e = crm_solve_run(w, s, c, 1);
        if (e < 0) return e;
        again = release(s, c);
    }
    for (int k = 0; k < s->n_contacts; k++) {
        if (s->pressing[k]) c->ln[k] -= s->h * step->ln[k];
    }
    for (int k = 0; k < w->island->n_rows; k++) c->le[k] -= s->h * step->le[k];
    return CAROM_OK;
}

/* Nothing to correct: the correction is zero, but its derivative is not; the reverse pass needs to
 * know what is held. */
static void correct_nothing(const carom_world *w, const crm_substep *s, crm_solve *c)
{
    crm_zero(w, c->v);
    for (int k = 0; k < w->island->n_rows; k++) c->le[k] = 0;
    for (int k = 0; k < s->n_contacts; k++) {
        c->ln[k] = 0;
        c->lt[k] = 0;
    }
}

/* q1 = q + share v with the largest share of 1, 1/2, ... that does not make it worse; 0 when none
 * does.  Leaves the rows at q1. */
static int take_share(carom_world *w, crm_substep *s, crm_solve *c, double worst)
{
    c->share = 1;
    for (int k = 0; k < MAX_SHARES; k++) {
        crm_copy(w, s->q1, c->q);
        crm_move(w, s->q1, c->v, c->share);
        crm_rows_at(w, s, s->q1);
        if (violation(w, s) <= worst) return 1;
        c->share *= 0.5;
    }
    crm_copy(w, s->q1, c->q);
    crm_rows_at(w, s, s->q1);
    return 0;
}

static void guess_modes(const crm_substep *s, crm_solve *c, int first)
{
    for (int i = 0; i < s->n_contacts; i++) {
        const int closed = s->pressing[i] || (!first && c[-1].mode[i]);
        c->mode[i] = closed ? CAROM_STICK : CAROM_SEPARATED;
    }
}

carom_status crm_project(carom_world *w, crm_substep *s, int first)
{
    const double tol = POSITION_TOL * w->length + crm_rounding(w);
    if (!s->n_contacts && !w->island->n_rows) return CAROM_OK;
    for (int k = first; k < first + CRM_MAX_CORRECTIONS; k++) {
        crm_solve *c = &s->solve[k];
        if (k == first) crm_rows_at(w, s, s->q1);
        const double worst = violation(w, s);
        if (k > first && worst <= tol) return CAROM_OK;
        c->share = 1;
        c->kind = CRM_CORRECTION;
        crm_copy(w, c->q, s->q1);
        set_sides(w, s, c);
        guess_modes(s, c, k == first);
        if (worst <= tol) {
            correct_nothing(w, s, c);
            s->n_solves = k + 1;
            return CAROM_OK;
        }
        const carom_status e = correct(w, s, c);
        if (e < 0) return e == CAROM_E_MEMORY ? e : CAROM_LIMIT;
        if (!take_share(w, s, c, worst)) break;
        s->n_solves = k + 1;
    }
    return violation(w, s) > w->settings.penetration * w->length ? CAROM_LIMIT : CAROM_OK;
}

carom_status crm_euler(carom_world *w, double h)
{
    crm_substep *s = &w->sub;
    crm_solve *c = &s->solve[0];
    s->map = CRM_MAP_EULER;
    s->h = h;
    s->n_solves = 1;
    c->kind = CRM_VELOCITY;
    crm_copy(w, c->q, s->q0);
    crm_rows_at(w, s, s->q0);
    crm_solve_start(w, s, c);
    const carom_status e = crm_solve_bounce(w, s, c, 0);
    if (e < 0) return e;
    crm_copy(w, s->v1, c->v);
    crm_copy(w, s->q1, s->q0);
    crm_move(w, s->q1, c->v, h);
    mark_pressing(s);
    return crm_project(w, s, 1);
}
