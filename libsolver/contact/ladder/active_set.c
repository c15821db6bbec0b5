#include "libsolver/contact/ladder/ladder.h"

#include <math.h>

/* Passes stop when the defect is below this [1] ... */
#define DEFECT_DONE 4e-15
/* ... or, below this, no longer halves. */
#define DEFECT_SMALL 1e-11
/* A mode is kept while it is violated by less, in unit scale [1]. */
#define KEEP 1e-11
/* After SETTLING rounds more than FEW modes that change have to become fewer. */
enum { MAX_ROUNDS = 32, SETTLING = 2, FEW = 3 };

double crm_slip_sign(unsigned char mode)
{
    return mode == CAROM_SLIP_PLUS ? 1 : mode == CAROM_SLIP_MINUS ? -1 : 0;
}

double crm_friction_share(unsigned char mode, double mu, double ln, double lt)
{
    if (mode != CAROM_SMOOTHED) return crm_slip_sign(mode);
    const double bound = mu * ln;
    const double size = bound * bound + lt * lt;
    return size > 0 ? 2 * bound * lt / size : 0;
}

/* (23) with all products kappa: P = p+^2 / kappa, Q = p-^2 / kappa. */
void crm_set_smooth_responses(crm_island *s)
{
    for (int k = 0; k < s->nc; k++) {
        if (s->mode[k] != CAROM_SMOOTHED) continue;
        const double mu = s->contact[k].mu;
        const double ln = s->x.n[k];
        const double plus = mu * ln + s->x.t[k];
        const double minus = mu * ln - s->x.t[k];
        const double nn = ln * ln / s->kappa;
        if (!(nn > 0)) { /* prescribed: nobody feels it */
            s->mode[k] = CAROM_SEPARATED;
            continue;
        }
        const double share = crm_friction_share(s->mode[k], mu, ln, s->x.t[k]);
        const double squares = plus * plus + minus * minus;
        s->slack[CRM_SMOOTH_NN][k] = nn;
        s->slack[CRM_SMOOTH_TN][k] = mu * nn * share;
        s->slack[CRM_SMOOTH_TT][k] =
            mu > 0 ? plus * plus * (minus * minus / squares) / s->kappa : 0;
    }
}

crm_response crm_smooth_compliance(const crm_island *s, int k)
{
    const double nn = s->slack[CRM_SMOOTH_NN][k];
    const double tn = s->slack[CRM_SMOOTH_TN][k];
    const double tt = s->slack[CRM_SMOOTH_TT][k];
    crm_response v = {1 / nn, 0, 0};
    if (!(s->contact[k].mu > 0)) return v;
    v.tt = 1 / tt;
    v.tn = -tn / nn / tt;
    return v;
}

/* Multipliers as the modes demand: zero when separated, on the cone when slipping. */
static void set_multipliers(crm_island *s)
{
    for (int k = 0; k < s->nc; k++) {
        const double mu = s->contact[k].mu;
        if (s->mode[k] == CAROM_SMOOTHED) continue;
        if (s->mode[k] == CAROM_SEPARATED) s->x.n[k] = 0;
        if (s->mode[k] == CAROM_SEPARATED || !(mu > 0)) s->x.t[k] = 0;
        if (s->mode[k] > CAROM_STICK) s->x.t[k] = crm_slip_sign(s->mode[k]) * mu * s->x.n[k];
    }
}

crm_response crm_mode_response(const crm_island *s, int k, double compliance)
{
    const double mu = s->contact[k].mu;
    if (s->mode[k] == CAROM_SMOOTHED) {
        return (crm_response){.nn = s->slack[CRM_SMOOTH_NN][k],
                              .tn = s->slack[CRM_SMOOTH_TN][k],
                              .tt = s->slack[CRM_SMOOTH_TT][k]};
    }
    const int active = s->mode[k] != CAROM_SEPARATED;
    return (crm_response){
        .nn = active ? 1 / compliance : 0,
        .tn = active ? crm_slip_sign(s->mode[k]) * mu / compliance : 0,
        .tt = s->mode[k] == CAROM_STICK && mu > 0 ? 1 / compliance : 0,
    };
}

void crm_set_responses(crm_island *s, double compliance)
{
    for (int k = 0; k < s->nc; k++) s->response[k] = crm_mode_response(s, k, compliance);
}

/* Defects of the motion that are rounding of their own terms become zero: another pass would only
 * turn them into new ones, and disturb the rows. */
static void drop_rounding(crm_island *s)
{
    crm_island_term_sizes(s, s->x, s->size);
    for (int i = 0; i < 3 * s->nb; i++) {
        if (fabs(s->rhs.z[i]) <= CRM_ROUNDING * s->size[i]) s->rhs.z[i] = 0;
    }
}

/* What is left of the equations at s->x, into s->rhs; returns its largest entry. */
static double find_defect(crm_island *s, int settle)
{
    double e = 0;
    crm_island_defect(s, s->x, s->rhs.z);
    if (settle) drop_rounding(s);
    for (int i = 0; i < 3 * (s->nb + s->ng); i++) e = fmax(e, fabs(s->rhs.z[i]));
    for (int k = 0; k < s->nc; k++) {
        const crm_contact *c = &s->contact[k];
        s->rhs.n[k] = 0;
        s->rhs.t[k] = 0;
        if (s->mode[k] == CAROM_SEPARATED) continue;
        const int smooth = s->mode[k] == CAROM_SMOOTHED;
        const crm_response v = smooth ? crm_smooth_compliance(s, k) : (crm_response){0, 0, 0};
        s->rhs.n[k] = -(c->cn + crm_dot(c->n, c->a, c->b, s->x.z)) - v.nn * s->x.n[k];
        e = fmax(e, fabs(s->rhs.n[k]));
        if (!crm_feels_slip(s, k)) continue;
        s->rhs.t[k] =
            -(c->ct + crm_dot(c->t, c->a, c->b, s->x.z)) - v.tn * s->x.n[k] - v.tt * s->x.t[k];
        e = fmax(e, fabs(s->rhs.t[k]));
    }
    return e;
}

static void factor_modes(crm_island *s, double compliance)
{
    s->compliance = compliance;
    crm_set_responses(s, compliance);
    crm_island_factor(s, 1, compliance);
}

/* [I -B; C delta I] (dw, dl) = defect, repeated: the proximal point iteration, which converges to
 * the exact solution where rows are independent and to a consistent one where they are not.  It
 * contracts by delta / (delta + sigma^2), sigma the smallest singular value: where masses differ
 * widely that is slow, and a smaller delta pays, at less accuracy of each pass. */
void crm_solve_modes(crm_island *s, int passes)
{
    set_multipliers(s);
    factor_modes(s, CRM_COMPLIANCE);
    double last = HUGE_VAL;
    int settle = 0;
    int tight = 0;
    for (int i = 0; i < passes; i++) {
        double e = find_defect(s, settle);
        if (!tight && i >= CRM_PATIENCE && e > CRM_SLOW * last && e > DEFECT_SMALL) {
            tight = 1;
            factor_modes(s, CRM_COMPLIANCE_TIGHT);
        } else if (e >= 0.5 * last && !settle) {
            settle = 1;
            e = find_defect(s, settle);
        } else if (e >= 0.5 * last && e < DEFECT_SMALL) {
            break;
        }
        if (e < DEFECT_DONE) break;
        last = fmin(e, last);
        crm_island_reduce(s, s->rhs, s->step);
        crm_vec_add(s, s->x, 1, s->step);
    }
}

void crm_modes_at(crm_island *s)
{
    for (int k = 0; k < s->nc; k++) {
        const crm_contact *c = &s->contact[k];
        const double a = crm_dot(c->n, c->a, c->b, s->x.z) + c->cn;
        const double u = c->mu > 0 ? crm_dot(c->t, c->a, c->b, s->x.z) + c->ct : 0;
        s->mode[k] = (unsigned char)crm_contact_mode_of(c, s->x.n[k], s->x.t[k], a, u);
    }
}

/* The new mode violates the old one by less than KEEP only. */
static int keep_mode(const crm_island *s, int k, unsigned char old, unsigned char new)
{
    const double ln = s->x.n[k];
    const double bound = s->contact[k].mu * fmax(ln, 0);
    if (old != CAROM_SEPARATED && new == CAROM_SEPARATED) return ln > -KEEP;
    if (old == CAROM_SEPARATED && new != CAROM_SEPARATED) return s->an[k] > -KEEP;
    if (old == CAROM_STICK && new > CAROM_STICK) return fabs(s->x.t[k]) <= bound + KEEP;
    if (old == CAROM_SLIP_MINUS && new == CAROM_STICK) return s->ut[k] > -KEEP;
    if (old == CAROM_SLIP_PLUS && new == CAROM_STICK) return s->ut[k] < KEEP;
    return 0;
}

/* Natural map at the point last measured; returns how many modes change. */
static int update_modes(crm_island *s)
{
    int changed = 0;
    for (int k = 0; k < s->nc; k++) {
        const unsigned char to = (unsigned char)crm_contact_mode_of(&s->contact[k], s->x.n[k],
                                                                    s->x.t[k], s->an[k], s->ut[k]);
        if (to == s->mode[k] || keep_mode(s, k, s->mode[k], to)) continue;
        s->mode[k] = to;
        changed++;
    }
    return changed;
}

/* FNV-1a. */
static unsigned long long hash_modes(const crm_island *s)
{
    unsigned long long h = 14695981039346656037ULL;
    for (int k = 0; k < s->nc; k++) h = (h ^ s->mode[k]) * 1099511628211ULL;
    return h;
}

int crm_active_set(crm_island *s, int rounds)
{
    unsigned long long seen[MAX_ROUNDS];
    int changed[MAX_ROUNDS];
    for (int i = 0; i < rounds && i < MAX_ROUNDS; i++) {
        seen[i] = hash_modes(s);
        for (int q = 0; q < i; q++) {
            if (seen[q] == seen[i]) return 0; /* cycles */
        }
        crm_solve_modes(s, CRM_PASSES);
        const double r = crm_island_residual(s, s->x);
        if (crm_island_offer(s, s->x, r)) return 1;
        if (!(r < HUGE_VAL)) return 0;
        changed[i] = update_modes(s);
        if (i >= SETTLING && changed[i] > FEW && changed[i] >= changed[i - 2]) return 0;
    }
    return 0;
}
