#include "libsolver/contact/ladder/ladder.h"

#include <float.h>
#include <math.h>

/* Compliance of joint rows [1]. */
#define JOINT_COMPLIANCE 1e-12
/* The residual at which the active-set polish takes over [1]. */
#define HAND_OVER 1e-8
/* The crossover is tried when the residual is below this, and again each time that it has fallen by
 * CROSS_AGAIN [1]. */
#define CROSS       1e-2
#define CROSS_AGAIN 1e-2
/* Smallest centering [1]. */
#define SIGMA_MIN 1e-8
/* Products stay above this share of their mean [1]. */
#define NEIGHBORHOOD 1e-4
/* Iterations without progress before giving up. */
#define PATIENCE 8
enum { PIVOTS = 300 }; /* of one crossover */

/* A direction: the vector of the full system and its slacks. */
typedef struct direction {
    crm_vec v;
    double *a;
    double *wp;
    double *wm;
    /* Right-hand sides of the three products, s z = target - ... */
    double *cn;
    double *cp;
    double *cm;
} direction;

/* Iterate: s->x and slacks.  Per contact p+ = mu l_n + l_t, p- = mu l_n - l_t of (20). */
typedef struct interior {
    crm_island *s;
    double *a;
    double *wp;
    double *wm;
    double *ra;  /* J_n w + c_n - a */
    double *rt;  /* J_t w + c_t - w+ + w- */
    double *vtn; /* compliance [vnn 0; vtn vtt], the inverse of the response (23) */
    double *vtt;
    direction way[2]; /* the best so far and a trial */
    int n_products;
    double mean; /* of the products */
    double fraction;
} interior;

/* What is needed to see no progress over PATIENCE iterations. */
typedef struct progress {
    double best[PATIENCE + 1];
    double mean[PATIENCE + 1];
    double defect[PATIENCE + 1];
    int n;
} progress;

static void bind(interior *p, crm_island *s)
{
    double **k = s->slack;
    p->s = s;
    p->a = k[0];
    p->wp = k[1];
    p->wm = k[2];
    p->ra = k[3];
    p->rt = k[4];
    p->vtn = k[5];
    p->vtt = k[6]; /* 7 .. 12, 13 .. 18: directions */
    for (int i = 0; i < 2; i++) {
        double **d = k + 7 + 6 * i;
        p->way[i] = (direction){s->way[i], d[0], d[1], d[2], d[3], d[4], d[5]};
    }
}

static int has_cone(const interior *p, int k)
{
    return p->s->contact[k].mu > 0;
}

static double plus(const interior *p, crm_vec x, int k)
{
    return p->s->contact[k].mu * x.n[k] + x.t[k];
}

static double minus(const interior *p, crm_vec x, int k)
{
    return p->s->contact[k].mu * x.n[k] - x.t[k];
}

static void begin(interior *p, const crm_interior_start *start)
{
    crm_island *s = p->s;
    unsigned long long state = start->seed;
    p->n_products = 0;
    p->fraction = start->fraction;
    crm_vec_zero(s, s->x);
    for (int k = 0; k < s->nc; k++) {
        s->x.n[k] = start->ln;
        p->a[k] = start->slack;
        if (start->spread > 0) {
            s->x.n[k] *= exp(start->spread * crm_normal(&state));
            p->a[k] *= exp(start->spread * crm_normal(&state));
        }
        p->n_products++;
        if (!has_cone(p, k)) continue;
        p->n_products += 2;
        const double bound = s->contact[k].mu * s->x.n[k];
        if (start->spread > 0) s->x.t[k] = bound * (1.4 * crm_uniform(&state) - 0.7);
        p->wp[k] = s->x.n[k] * p->a[k] / plus(p, s->x, k);
        p->wm[k] = s->x.n[k] * p->a[k] / minus(p, s->x, k);
    }
}

/* From s->x, moved by `shift` into the interior: near a solution, without its decisions. */
static void begin_near(interior *p, const crm_interior_start *start)
{
    crm_island *s = p->s;
    const double shift = start->shift;
    p->n_products = 0;
    p->fraction = start->fraction;
    crm_island_residual(s, s->x); /* leaves a and u */
    for (int k = 0; k < s->nc; k++) {
        s->x.n[k] = fmax(s->x.n[k], shift);
        p->a[k] = fmax(s->an[k], shift);
        p->n_products++;
        if (!has_cone(p, k)) continue;
        p->n_products += 2;
        const double bound = s->contact[k].mu * s->x.n[k];
        const double inside = bound - fmin(0.5 * bound, 0.3 * shift);
        s->x.t[k] = fmax(-inside, fmin(inside, s->x.t[k]));
        p->wp[k] = fmax(s->ut[k], 0) + shift;
        p->wm[k] = fmax(-s->ut[k], 0) + shift;
    }
}

/* Defects of the linear equations at the iterate; returns the largest. */
static double find_defects(interior *p)
{
    crm_island *s = p->s;
    double e = 0;
    p->mean = 0;
    crm_island_defect(s, s->x, s->rhs.z);
    for (int i = 0; i < 3 * (s->nb + s->ng); i++) e = fmax(e, fabs(s->rhs.z[i]));
    for (int k = 0; k < s->nc; k++) {
        p->ra[k] = s->an[k] - p->a[k];
        p->mean += s->x.n[k] * p->a[k];
        e = fmax(e, fabs(p->ra[k]));
        if (!has_cone(p, k)) continue;
        p->rt[k] = s->ut[k] - p->wp[k] + p->wm[k];
        p->mean += plus(p, s->x, k) * p->wp[k] + minus(p, s->x, k) * p->wm[k];
        e = fmax(e, fabs(p->rt[k]));
    }
    p->mean /= p->n_products;
    return e;
}

/* (23), interval form: W_nn = l_n/a, W_tn = mu W_nn (P - Q)/(P + Q), W_tt = P Q/(P + Q) with
 * P = p+/w+, Q = p-/w-. */
static void factor(interior *p)
{
    crm_island *s = p->s;
    for (int k = 0; k < s->nc; k++) {
        crm_response *w = &s->response[k];
        w->nn = s->x.n[k] / p->a[k];
        w->tn = 0;
        w->tt = 0;
        if (!has_cone(p, k)) continue;
        const double ip = p->wp[k] / plus(p, s->x, k); /* 1/P */
        const double iq = p->wm[k] / minus(p, s->x, k);
        p->vtn[k] = s->contact[k].mu * (ip - iq);
        p->vtt[k] = ip + iq;
        w->tt = 1 / p->vtt[k];
        w->tn = -w->tt * p->vtn[k] * w->nn;
    }
    crm_island_factor(s, 1, JOINT_COMPLIANCE);
}

/* rest <- right-hand side minus the full system times v. */
static void find_rest(const interior *p, crm_vec v)
{
    const crm_island *s = p->s;
    crm_vec e = s->rest;
    for (int i = 0; i < 3 * s->nb; i++) e.z[i] = s->rhs.z[i] - v.z[i];
    for (int k = 0; k < s->nc; k++) {
        const crm_contact *c = &s->contact[k];
        crm_add(e.z, c->n, c->a, c->b, v.n[k]);
        e.n[k] = s->rhs.n[k] - crm_dot(c->n, c->a, c->b, v.z) - v.n[k] / s->response[k].nn;
        e.t[k] = 0;
        if (!has_cone(p, k)) continue;
        crm_add(e.z, c->t, c->a, c->b, v.t[k]);
        e.t[k] =
            s->rhs.t[k] - crm_dot(c->t, c->a, c->b, v.z) - p->vtn[k] * v.n[k] - p->vtt[k] * v.t[k];
    }
    for (int q = 0; q < s->ng; q++) {
        const crm_group *g = &s->group[q];
        const int at = 3 * (s->nb + q);
        for (int r = 0; r < CRM_GROUP_ROWS; r++) {
            crm_add(e.z, g->j[r], g->a, g->b, v.z[at + r]);
            e.z[at + r] = s->rhs.z[at + r] - crm_dot(g->j[r], g->a, g->b, v.z) -
                          JOINT_COMPLIANCE * v.z[at + r];
        }
    }
}

/* Direction for the products' right-hand sides in d: one solve, one refinement.  rhs.z holds the
 * defects of the motion and the joints. */
static void find_direction(interior *p, direction *d)
{
    crm_island *s = p->s;
    const crm_vec x = s->x;
    for (int k = 0; k < s->nc; k++) {
        s->rhs.n[k] = d->cn[k] / x.n[k] - p->ra[k];
        s->rhs.t[k] = 0;
        if (!has_cone(p, k)) continue;
        s->rhs.t[k] = -p->rt[k] + d->cp[k] / plus(p, x, k) - d->cm[k] / minus(p, x, k);
    }
    crm_island_reduce(s, s->rhs, d->v);
    find_rest(p, d->v);
    crm_island_reduce(s, s->rest, s->step);
    crm_vec_add(s, d->v, 1, s->step);
    for (int k = 0; k < s->nc; k++) {
        d->a[k] = (d->cn[k] - p->a[k] * d->v.n[k]) / x.n[k];
        if (!has_cone(p, k)) continue;
        d->wp[k] = (d->cp[k] - p->wp[k] * plus(p, d->v, k)) / plus(p, x, k);
        d->wm[k] = (d->cm[k] - p->wm[k] * minus(p, d->v, k)) / minus(p, x, k);
    }
}

/* Largest step from x along d that stays nonnegative, at most `most`. */
static double room(double x, double d, double most)
{
    return d < 0 && -x / d < most ? -x / d : most;
}

static double longest_step(const interior *p, const direction *d)
{
    const crm_vec x = p->s->x;
    double step = 1;
    for (int k = 0; k < p->s->nc; k++) {
        step = room(x.n[k], d->v.n[k], step);
        step = room(p->a[k], d->a[k], step);
        if (!has_cone(p, k)) continue;
        step = room(p->wp[k], d->wp[k], step);
        step = room(p->wm[k], d->wm[k], step);
        step = room(plus(p, x, k), plus(p, d->v, k), step);
        step = room(minus(p, x, k), minus(p, d->v, k), step);
    }
    return step;
}

/* The three products of contact k after a step. */
static void products_at(const interior *p, const direction *d, double step, int k, double *out)
{
    const crm_vec x = p->s->x;
    out[0] = (x.n[k] + step * d->v.n[k]) * (p->a[k] + step * d->a[k]);
    if (!has_cone(p, k)) return;
    out[1] = (plus(p, x, k) + step * plus(p, d->v, k)) * (p->wp[k] + step * d->wp[k]);
    out[2] = (minus(p, x, k) + step * minus(p, d->v, k)) * (p->wm[k] + step * d->wm[k]);
}

/* Smallest and mean product after a step. */
static void measure_products(const interior *p, const direction *d, double step, double *least,
                             double *mean)
{
    *least = HUGE_VAL;
    *mean = 0;
    for (int k = 0; k < p->s->nc; k++) {
        double c[3];
        products_at(p, d, step, k, c);
        const int n = has_cone(p, k) ? 3 : 1;
        for (int i = 0; i < n; i++) {
            *least = fmin(*least, c[i]);
            *mean += c[i];
        }
    }
    *mean /= p->n_products;
}

/* d's right-hand sides: target - products. */
static void set_target(const interior *p, direction *d, double target)
{
    const crm_vec x = p->s->x;
    for (int k = 0; k < p->s->nc; k++) {
        d->cn[k] = target - x.n[k] * p->a[k];
        if (!has_cone(p, k)) continue;
        d->cp[k] = target - plus(p, x, k) * p->wp[k];
        d->cm[k] = target - minus(p, x, k) * p->wm[k];
    }
}

/* Mehrotra's corrector: d's right-hand sides lose the products of the affine steps. */
static void add_corrector(const interior *p, direction *d, const direction *affine)
{
    for (int k = 0; k < p->s->nc; k++) {
        d->cn[k] -= affine->v.n[k] * affine->a[k];
        if (!has_cone(p, k)) continue;
        d->cp[k] -= plus(p, affine->v, k) * affine->wp[k];
        d->cm[k] -= minus(p, affine->v, k) * affine->wm[k];
    }
}

/* Moves products that a longer step would leave far from the target toward it (Gondzio). */
static void set_centering(const interior *p, direction *d, const direction *from, double step,
                          double target)
{
    const double longer = fmin(1, 1.1 * step + 0.1);
    for (int k = 0; k < p->s->nc; k++) {
        double c[3] = {target, target, target};
        products_at(p, from, longer, k, c);
        for (int i = 0; i < 3; i++) {
            const double to = fmax(0.1 * target, fmin(10 * target, c[i]));
            c[i] = fmax(to - c[i], -10 * target);
        }
        d->cn[k] = from->cn[k] + c[0];
        if (!has_cone(p, k)) continue;
        d->cp[k] = from->cp[k] + c[1];
        d->cm[k] = from->cm[k] + c[2];
    }
}

/* Mehrotra's centering (kappa_aff / kappa)^3, more of it after short steps. */
static double centering(const interior *p, const direction *affine, int short_steps)
{
    double least;
    double mean;
    measure_products(p, affine, longest_step(p, affine), &least, &mean);
    const double ratio = mean / p->mean;
    double sigma = fmin(1, fmax(ratio * ratio * ratio, SIGMA_MIN));
    if (short_steps >= 2) sigma = fmax(sigma, short_steps < 4 ? 0.3 : 0.8);
    return sigma;
}

/* The direction of this iteration, in way[returned]; *step its longest step. */
static int choose_direction(interior *p, int short_steps, double *step)
{
    set_target(p, &p->way[0], 0);
    find_direction(p, &p->way[0]);
    const double sigma = centering(p, &p->way[0], short_steps);
    const double target = sigma * p->mean;
    int now = 1;
    set_target(p, &p->way[1], target);
    if (short_steps < 3) add_corrector(p, &p->way[1], &p->way[0]);
    find_direction(p, &p->way[1]);
    *step = longest_step(p, &p->way[1]);
    if (*step < 0.1) { /* the corrector harms: plain centered step */
        set_target(p, &p->way[0], fmax(sigma, 0.1) * p->mean);
        find_direction(p, &p->way[0]);
        const double plain = longest_step(p, &p->way[0]);
        if (plain > *step) {
            *step = plain;
            now = 0;
        }
    }
    set_centering(p, &p->way[1 - now], &p->way[now], *step, target);
    find_direction(p, &p->way[1 - now]);
    const double centered = longest_step(p, &p->way[1 - now]);
    if (!(centered >= 1.01 * *step)) return now;
    *step = centered;
    return 1 - now;
}

/* Shortens a step until no product falls far below the mean. */
static double stay_central(const interior *p, const direction *d, double step)
{
    double least;
    double mean;
    measure_products(p, d, 0, &least, &mean);
    if (least < NEIGHBORHOOD * mean) return step;
    for (int i = 0; i < 30; i++) {
        measure_products(p, d, step, &least, &mean);
        if (least >= NEIGHBORHOOD * mean) break;
        step *= 0.8;
    }
    return step;
}

static void move(interior *p, const direction *d, double step)
{
    crm_vec_add(p->s, p->s->x, step, d->v);
    for (int k = 0; k < p->s->nc; k++) {
        p->a[k] += step * d->a[k];
        if (!has_cone(p, k)) continue;
        p->wp[k] += step * d->wp[k];
        p->wm[k] += step * d->wm[k];
    }
}

/* Records an iteration; returns whether the last PATIENCE brought nothing. */
static int stalls(progress *h, double best, double mean, double defect)
{
    const int n = PATIENCE + 1;
    const int at = h->n++ % n;
    h->best[at] = best;
    h->mean[at] = mean;
    h->defect[at] = fmax(defect, 1e-14); /* rounding */
    if (h->n <= PATIENCE + 4) return 0;
    const int old = h->n % n;
    const double was = fmin(h->defect[old], 1);
    return h->best[at] > 0.5 * h->best[old] && h->mean[at] > 0.2 * h->mean[old] &&
           h->defect[at] > 0.2 * was &&
           (h->defect[at] > 0.5 * h->defect[old] || h->defect[at] < 1e-9);
}

/* From the iterate, which is the best, by pivots; the iterate stays when they fail. */
static int cross(interior *p)
{
    crm_island *s = p->s;
    if (crm_crossover(s, PIVOTS, (unsigned)s->iterations)) return 1;
    crm_vec_copy(s, s->x, s->top);
    crm_island_residual(s, s->x);
    return 0;
}

/* Returns 1 when a crossover was accepted on the way. */
static int iterate(interior *p)
{
    crm_island *s = p->s;
    progress history = {.n = 0};
    double best = HUGE_VAL;
    double near = s->nc < CRM_MANY ? 0 : CROSS;
    int short_steps = 0;
    crm_vec_copy(s, s->top, s->x);
    for (int i = 0; i < s->max_iterations; i++) {
        const double r = crm_island_residual(s, s->x);
        if (r < best) {
            best = r;
            crm_vec_copy(s, s->top, s->x);
            if (r < near && cross(p)) return 1;
            if (r < near) near = CROSS_AGAIN * r;
        }
        const double defect = find_defects(p);
        if (stalls(&history, best, p->mean, defect) || r < HAND_OVER || !(r < HUGE_VAL)) break;
        s->iterations++;
        factor(p);
        double step;
        const int now = choose_direction(p, short_steps, &step);
        if (step < 1) step *= p->fraction;
        step = stay_central(p, &p->way[now], step);
        if (step < 0.05)
            short_steps++;
        else if (short_steps)
            short_steps--;
        move(p, &p->way[now], step);
    }
    return 0;
}

int crm_interior_point(crm_island *s, crm_interior_start start)
{
    interior p;
    bind(&p, s);
    if (start.shift > 0)
        begin_near(&p, &start);
    else
        begin(&p, &start);
    if (!p.n_products) return 0; /* joints alone have no inequality */
    if (iterate(&p)) return 1;
    crm_vec_copy(s, s->x, s->top);
    crm_modes_at(s);
    return crm_island_offer(s, s->x, crm_island_residual(s, s->x));
}

/* --- one point of the central path ---------------------------------------------------------- */

/* Products are kappa and the equations hold to this [1] ... */
#define ON_PATH   1e-9
#define PATH_HOLD 1e-13
/* ... or, where rounding keeps them from that, to this when neither halves any more: near its limit
 * friction knows mu l_n - l_t only to rounding of l_n. */
#define NEAR_PATH  1e-3
#define PATH_LOOSE 1e-9
/* Responses l_n^2 / kappa beyond this are those of the solution, to all digits [1]. */
#define STIFFEST 1e16

/* l_t in (-bound, bound) with kappa / (bound + l_t) - kappa / (bound - l_t) = u. */
static double central_friction(double bound, double u, double kappa)
{
    const double ub = u * bound;
    return -u * bound * bound / (kappa + sqrt(kappa * kappa + ub * ub));
}

/* Slacks at s->x of which all products are kappa: pressing contacts keep l_n, others a; sticking
 * ones l_t, others the slip. */
static void begin_on_path(interior *p, double kappa)
{
    crm_island *s = p->s;
    const double least = sqrt(kappa);
    p->n_products = 0;
    p->fraction = 0.95;
    crm_island_residual(s, s->x); /* leaves a and u */
    for (int k = 0; k < s->nc; k++) {
        const int presses = s->x.n[k] >= s->an[k];
        const double larger = fmax(presses ? s->x.n[k] : s->an[k], least);
        s->x.n[k] = presses ? larger : kappa / larger;
        p->a[k] = presses ? kappa / larger : larger;
        p->n_products++;
        if (!has_cone(p, k)) continue;
        p->n_products += 2;
        const double bound = s->contact[k].mu * s->x.n[k];
        const double inside = bound - fmin(0.5 * bound, least);
        s->x.t[k] = s->mode[k] == CAROM_STICK ? fmax(-inside, fmin(inside, s->x.t[k]))
                                              : central_friction(bound, s->ut[k], kappa);
        p->wp[k] = kappa / plus(p, s->x, k);
        p->wm[k] = kappa / minus(p, s->x, k);
    }
}

/* Largest of |product / kappa - 1|. */
static double off_path(const interior *p, double kappa)
{
    const crm_vec x = p->s->x;
    double off = 0;
    for (int k = 0; k < p->s->nc; k++) {
        off = fmax(off, fabs(x.n[k] * p->a[k] / kappa - 1));
        if (!has_cone(p, k)) continue;
        off = fmax(off, fabs(plus(p, x, k) * p->wp[k] / kappa - 1));
        off = fmax(off, fabs(minus(p, x, k) * p->wm[k] / kappa - 1));
    }
    return off;
}

static int is_soft(const crm_island *s, double kappa)
{
    double largest = 0;
    for (int k = 0; k < s->nc; k++) largest = fmax(largest, s->x.n[k]);
    return largest * largest <= STIFFEST * kappa;
}

/* Newton's method toward equal products, the target falling to kappa. */
static int follow_path(interior *p, double kappa)
{
    crm_island *s = p->s;
    double last = HUGE_VAL;
    double last_off = HUGE_VAL;
    int vain = 0;
    for (int i = 0; i < s->max_iterations; i++) {
        if (!(crm_island_residual(s, s->x) < HUGE_VAL)) return 0;
        const double defect = find_defects(p);
        const double off = off_path(p, kappa);
        const int halves = (defect > PATH_HOLD && defect <= 0.5 * last) ||
                           (off > ON_PATH && off <= 0.5 * last_off);
        if (off <= ON_PATH && defect <= PATH_HOLD) return is_soft(s, kappa);
        vain = halves ? 0 : vain + 1;
        if (off <= NEAR_PATH && defect <= PATH_LOOSE && vain > 2) return is_soft(s, kappa);
        last = defect;
        last_off = off;
        s->iterations++;
        factor(p);
        set_target(p, &p->way[0], fmax(kappa, 0.1 * p->mean));
        find_direction(p, &p->way[0]);
        const double step = longest_step(p, &p->way[0]);
        move(p, &p->way[0], step < 1 ? p->fraction * step : 1);
    }
    return 0;
}

int crm_central_path(crm_island *s, double kappa)
{
    const crm_interior_start apart = {.fraction = 0.95, .shift = 0.1};
    interior p;
    bind(&p, s);
    crm_vec_copy(s, s->swept, s->x);
    begin_on_path(&p, kappa);
    if (!p.n_products || follow_path(&p, kappa)) return 1;
    crm_vec_copy(s, s->x, s->swept);
    begin_near(&p, &apart);
    return follow_path(&p, kappa);
}
