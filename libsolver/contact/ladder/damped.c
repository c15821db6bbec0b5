#include "libsolver/contact/ladder/ladder.h"

#include <math.h>

/* Compliance of a contact at the start, and its range [1] ... */
#define START 1e-2
#define LEAST 1e-6
#define MOST  1
/* ... and its factors after a step in which its mode failed, or held. */
#define UP   4
#define DOWN 0.5
/* Compliance of joint rows [1]. */
#define JOINT 1e-9
/* A step is undone when the error grows by more than this factor: smaller growth is needed to leave
 * the neighborhood of a local minimum of the error. */
#define GROWTH 2
/* The crossover is tried from points below this residual [1]. */
#define NEAR 0.1
enum { EVERY = 5, PIVOTS = 1000, FIRST_SWEEPS = 20, SWEEPS = 50 };

/* Levenberg's damping, contact by contact.  At the center (w, l)^ with modes from the natural map
 * and compliances d, the step solves
 *   J_n w + c_n + d (l_n - l_n^) = 0 where closed,  J_t w + c_t + d (l_t - l_t^) = 0 where it
 * sticks so that a contact with large d hardly moves and one with small d takes Newton's step.  Its
 * mode holds when it is the mode of the multipliers l^ - (J w + c) / d (Alart, Curnier 1991); d
 * falls then, and grows otherwise.  Sweeps after each step repair what is wrong locally, steps
 * carry over long distances what sweeps are slow at. */
typedef struct damped {
    crm_island *s;
    crm_vec center;
    double *d;
    double error;    /* 2-norm of the natural map's defect at the center */
    double residual; /* (22) */
} damped;

/* 2-norm of the natural map's defect at s->x; leaves a and u; *residual: (22). */
static double measure(crm_island *s, double *residual)
{
    double e = 0;
    *residual = crm_island_residual(s, s->x);
    for (int k = 0; k < s->nc; k++) {
        const double a = fmin(s->an[k], s->x.n[k]);
        const double bound = s->contact[k].mu * fmax(s->x.n[k], 0);
        const double t = fmin(bound, fmax(-bound, s->x.t[k] - s->ut[k]));
        const double f = s->contact[k].mu > 0 ? s->x.t[k] - t : 0;
        e += a * a + f * f;
    }
    return sqrt(e);
}

static void set_rhs(const damped *p)
{
    const crm_island *s = p->s;
    memset(s->rhs.z, 0, 3 * (size_t)s->nb * sizeof(double));
    for (int q = 0; q < s->ng; q++) {
        for (int r = 0; r < CRM_GROUP_ROWS; r++) {
            const int at = 3 * (s->nb + q) + r;
            s->rhs.z[at] = JOINT * p->center.z[at] - s->group[q].c[r];
        }
    }
    for (int k = 0; k < s->nc; k++) {
        const crm_contact *c = &s->contact[k];
        const int sticks = s->mode[k] == CAROM_STICK && c->mu > 0;
        s->rhs.n[k] = s->mode[k] == CAROM_SEPARATED ? 0 : p->d[k] * p->center.n[k] - c->cn;
        s->rhs.t[k] = sticks ? p->d[k] * p->center.t[k] - c->ct : 0;
    }
}

/* The step at s->mode, from the center into s->x. */
static void step(damped *p)
{
    crm_island *s = p->s;
    for (int k = 0; k < s->nc; k++) s->response[k] = crm_mode_response(s, k, p->d[k]);
    crm_island_factor(s, 1, JOINT);
    set_rhs(p);
    crm_island_reduce(s, s->rhs, s->x);
}

static int mode_holds(const damped *p, int k)
{
    const crm_island *s = p->s;
    const crm_contact *c = &s->contact[k];
    const double n = p->center.n[k] - (crm_dot(c->n, c->a, c->b, s->x.z) + c->cn) / p->d[k];
    if (!(n > 0)) return s->mode[k] == CAROM_SEPARATED;
    if (!(c->mu > 0)) return s->mode[k] == CAROM_STICK;
    const double t = p->center.t[k] - (crm_dot(c->t, c->a, c->b, s->x.z) + c->ct) / p->d[k];
    if (fabs(t) <= c->mu * n) return s->mode[k] == CAROM_STICK;
    return s->mode[k] == (t > 0 ? CAROM_SLIP_PLUS : CAROM_SLIP_MINUS);
}

static void change(damped *p, int k, double factor)
{
    p->d[k] = fmin(MOST, fmax(LEAST, factor * p->d[k]));
}

/* New compliances after a step. */
static void adapt(damped *p)
{
    for (int k = 0; k < p->s->nc; k++) change(p, k, mode_holds(p, k) ? DOWN : UP);
}

static void keep(damped *p, double error, double residual)
{
    crm_vec_copy(p->s, p->center, p->s->x);
    p->error = error;
    p->residual = residual;
}

/* Everything stiffer; sweeps alone move the center. */
static void undo(damped *p)
{
    crm_island *s = p->s;
    double residual;
    for (int k = 0; k < s->nc; k++) change(p, k, UP);
    crm_vec_copy(s, s->x, p->center);
    crm_sweeps(s, SWEEPS);
    const double error = measure(s, &residual);
    keep(p, error, residual);
}

static void begin(damped *p, crm_island *s)
{
    p->s = s;
    p->center = s->swept;
    p->d = s->slack[0];
    if (s->best_residual < HUGE_VAL)
        crm_vec_copy(s, s->x, s->best);
    else
        crm_vec_zero(s, s->x);
    crm_into_cones(s);
    crm_sweeps(s, FIRST_SWEEPS);
    for (int k = 0; k < s->nc; k++) p->d[k] = START;
    p->error = measure(s, &p->residual);
    crm_vec_copy(s, p->center, s->x);
}

int crm_damped(crm_island *s, int steps)
{
    damped p;
    begin(&p, s);
    for (int i = 1; i <= steps; i++) {
        double residual;
        crm_vec_copy(s, s->x, p.center);
        crm_modes_at(s);
        step(&p);
        adapt(&p);
        crm_into_cones(s);
        crm_sweeps(s, SWEEPS);
        const double error = measure(s, &residual);
        if (!(residual < p.residual || error < GROWTH * p.error)) {
            undo(&p);
            continue;
        }
        keep(&p, error, residual);
        if (crm_island_offer(s, s->x, residual)) return 1;
        if (i % EVERY == 0 && residual < NEAR && crm_crossover(s, PIVOTS, (unsigned)i)) return 1;
    }
    return 0;
}
