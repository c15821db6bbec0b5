#include "libsolver/contact/ladder/ladder.h"

#include <math.h>

/* Compliance of active rows on the path: it makes impulses unique [1]. */
#define COMPLIANCE 1e-7
/* Passes of refinement stop when the defect, relative to the solution, is below this [1]. */
#define DEFECT_DONE 1e-12
/* A slope that counts as zero [1]. */
#define SLOPE_ZERO 1e-14
/* Velocity, in units of V, at which no contact closes; a path that comes back here is a ray. */
#define TAU_MAX 1e4

enum { PASSES = 6, REFRESH = 8 };

/* With c_n + tau d, d > 0, instead of c_n all contacts are open for large tau: a solution.  On each
 * set of modes the solution is linear in tau; where a condition of a mode is about to fail, that
 * contact takes the adjacent mode and tau goes on in the direction that satisfies the new
 * condition: back, if need be, so that turning points are passed as in Lemke's tableau. */
typedef struct path {
    crm_island *s;
    crm_vec d; /* n: d_n, t: d_t, z behind the bodies: d_e */
    crm_vec tangent;
    double tau;
    double direction;
} path;

static double row_n(const crm_island *s, int k, const double *z)
{
    const crm_contact *c = &s->contact[k];
    return crm_dot(c->n, c->a, c->b, z);
}

static double row_t(const crm_island *s, int k, const double *z)
{
    const crm_contact *c = &s->contact[k];
    return c->mu > 0 ? crm_dot(c->t, c->a, c->b, z) : 0;
}

static int sticks(const crm_island *s, int k)
{
    return s->mode[k] == CAROM_STICK && s->contact[k].mu > 0;
}

/* a and u of contact k at x, for data alpha c + beta d. */
static double opening(const path *p, int k, crm_vec x, double alpha, double beta)
{
    const crm_island *s = p->s;
    const double l = s->mode[k] == CAROM_SEPARATED ? 0 : COMPLIANCE * x.n[k];
    return row_n(s, k, x.z) + alpha * s->contact[k].cn + beta * p->d.n[k] + l;
}

static double sliding(const path *p, int k, crm_vec x, double alpha, double beta)
{
    const crm_island *s = p->s;
    return row_t(s, k, x.z) + alpha * s->contact[k].ct + beta * p->d.t[k] + COMPLIANCE * x.t[k];
}

/* What x misses of the equations of the modes, for data alpha c + beta d, into rhs. */
static double find_defect(const path *p, crm_vec x, double alpha, double beta)
{
    crm_island *s = p->s;
    double e = 0;
    crm_island_defect(s, x, s->rhs.z);
    for (int q = 0; q < s->ng; q++) {
        for (int r = 0; r < CRM_GROUP_ROWS; r++) {
            const int at = 3 * (s->nb + q) + r;
            s->rhs.z[at] += s->group[q].c[r] * (1 - alpha) - beta * p->d.z[at];
            s->rhs.z[at] -= COMPLIANCE * x.z[at];
        }
    }
    for (int i = 0; i < 3 * (s->nb + s->ng); i++) e = fmax(e, fabs(s->rhs.z[i]));
    for (int k = 0; k < s->nc; k++) {
        const int active = s->mode[k] != CAROM_SEPARATED;
        s->rhs.n[k] = active ? -opening(p, k, x, alpha, beta) : 0;
        s->rhs.t[k] = sticks(s, k) ? -sliding(p, k, x, alpha, beta) : 0;
        e = fmax(e, fmax(fabs(s->rhs.n[k]), fabs(s->rhs.t[k])));
    }
    return e;
}

static double size_of(const crm_island *s, crm_vec x)
{
    double m = 0;
    for (int i = 0; i < 3 * s->nb; i++) m = fmax(m, fabs(x.z[i]));
    return m;
}

/* Solves the equations of the modes, starting from x. */
static void solve(path *p, crm_vec x, double alpha, double beta)
{
    crm_island *s = p->s;
    for (int i = 0; i < PASSES; i++) {
        if (find_defect(p, x, alpha, beta) <= DEFECT_DONE * (1 + size_of(s, x)) && i) return;
        crm_island_reduce(s, s->rhs, s->step);
        crm_vec_add(s, x, 1, s->step);
    }
}

static void fit(const crm_island *s, crm_vec x)
{
    for (int k = 0; k < s->nc; k++) {
        const double mu = s->contact[k].mu;
        if (s->mode[k] == CAROM_SEPARATED) x.n[k] = x.t[k] = 0;
        if (!(mu > 0)) x.t[k] = 0;
        if (s->mode[k] > CAROM_STICK) x.t[k] = crm_slip_sign(s->mode[k]) * mu * x.n[k];
    }
}

static void factor(path *p)
{
    crm_set_responses(p->s, COMPLIANCE);
    crm_island_factor(p->s, 1, COMPLIANCE);
}

/* All contacts open, pushed apart at different speeds; what joints ask for is in the point. */
static void begin(path *p, unsigned long long seed)
{
    crm_island *s = p->s;
    memset(s->mode, CAROM_SEPARATED, (size_t)s->nc);
    crm_vec_zero(s, s->x);
    crm_vec_zero(s, p->d);
    for (int k = 0; k < s->nc; k++) p->d.n[k] = 0.5 + crm_uniform(&seed);
    p->tau = TAU_MAX;
    p->direction = -1;
}

/* Conditions of contact k's mode, all >= 0: at a point (alpha = 1) or along the tangent (0). */
static int conditions(const path *p, int k, crm_vec x, double alpha, double beta, double f[2])
{
    const crm_island *s = p->s;
    const double mu = s->contact[k].mu;
    switch (s->mode[k]) {
    case CAROM_SEPARATED: f[0] = opening(p, k, x, alpha, beta); return 1;
    case CAROM_STICK:
        f[0] = mu > 0 ? mu * x.n[k] - x.t[k] : x.n[k];
        f[1] = mu * x.n[k] + x.t[k];
        return mu > 0 ? 2 : 1;
    default:
        f[0] = x.n[k];
        f[1] = -crm_slip_sign(s->mode[k]) * sliding(p, k, x, alpha, beta);
        return 2;
    }
}

/* Mode on the other side of condition i of contact k; *now: index of the new mode's condition that
 * starts from zero. */
static unsigned char adjacent(const path *p, int k, int i, int *now)
{
    const crm_island *s = p->s;
    const double mu = s->contact[k].mu;
    *now = 0;
    switch (s->mode[k]) {
    case CAROM_SEPARATED:
        if (!(mu > 0)) return CAROM_STICK;
        return sliding(p, k, s->x, 1, p->tau) > 0 ? CAROM_SLIP_MINUS : CAROM_SLIP_PLUS;
    case CAROM_STICK:
        if (!(mu > 0)) return CAROM_SEPARATED;
        *now = 1;
        return i ? CAROM_SLIP_MINUS : CAROM_SLIP_PLUS;
    default:
        if (!i) return CAROM_SEPARATED;
        *now = s->mode[k] == CAROM_SLIP_PLUS ? 0 : 1;
        return CAROM_STICK;
    }
}

/* Longest step along the tangent; the contact and condition that end it, or -1. */
static double find_event(const path *p, int *contact, int *condition)
{
    const crm_island *s = p->s;
    double step = p->direction < 0 ? p->tau : TAU_MAX - p->tau;
    *contact = -1;
    for (int k = 0; k < s->nc; k++) {
        double f[2];
        double g[2];
        const int n = conditions(p, k, s->x, 1, p->tau, f);
        conditions(p, k, p->tangent, 0, 1, g);
        for (int i = 0; i < n; i++) {
            const double slope = p->direction * g[i];
            if (!(slope < -SLOPE_ZERO)) continue;
            const double t = fmax(f[i], 0) / -slope;
            if (t >= step) continue;
            step = t;
            *contact = k;
            *condition = i;
        }
    }
    return step;
}

/* Tangent on the present modes, and the direction in which condition `now` of contact k grows. */
static int turn(path *p, int k, int now)
{
    double g[2];
    crm_vec_zero(p->s, p->tangent);
    solve(p, p->tangent, 0, 1);
    fit(p->s, p->tangent);
    if (k < 0) return 1;
    conditions(p, k, p->tangent, 0, 1, g);
    if (!(fabs(g[now]) > SLOPE_ZERO)) return 0;
    p->direction = g[now] > 0 ? 1 : -1;
    return 1;
}

int crm_lemke(crm_island *s, int max_pivots, unsigned long long seed)
{
    path p = {.s = s, .d = s->top, .tangent = s->way[0]};
    begin(&p, seed);
    int contact = -1;
    int condition = 0;
    int now = 0;
    for (int i = 0; i < max_pivots; i++) {
        factor(&p);
        if (i % REFRESH == 0) solve(&p, s->x, 1, p.tau);
        fit(s, s->x);
        if (!turn(&p, contact, now)) return 0;
        const double step = find_event(&p, &contact, &condition);
        if (!(step < HUGE_VAL)) return 0;
        crm_vec_add(s, s->x, p.direction * step, p.tangent);
        p.tau += p.direction * step;
        if (contact < 0) return p.direction < 0;
        s->mode[contact] = adjacent(&p, contact, condition, &now);
    }
    return 0;
}
