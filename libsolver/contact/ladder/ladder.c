#include "libsolver/contact/ladder/ladder.h"

#include <math.h>

/* Guessed impulses need no solve when each row holds to the rounding of its own terms, or to this;
 * far below `accept`, so that the solution stays a smooth function of the data, for differences
 * too [1]. */
#define GUESS_EXACT 1e-14
/* Share of what is accepted that such a guess may miss: a pass would do better. */
#define GUESS_ACCEPT 0.1

enum {
    ROUNDS_GUESS = 12,  /* of the active set from the caller's modes */
    ROUNDS_TRY = 5,     /* from the free motion, and from everything sticking */
    ROUNDS_POLISH = 8,  /* after the interior point */
    ROUNDS_REPAIR = 15, /* after sweeps and Lemke */
    DAMPED_STEPS = 150,
    N_SWEEPS = 300, /* first bout; each further one is twice as long */
    N_BOUTS = 5,
    LEMKE_CONTACTS = 300, /* most contacts for Lemke's method ... */
    LEMKE_PIVOTS = 20,    /* ... and pivots per contact */
    WIDE_RESTARTS = 6     /* restarts from this one on spread twice as far */
};

/* One climb. */
typedef struct climb {
    crm_island *s;
    carom_contact_stage *stage;
    double *unpolished;
    double large; /* multiplier estimate L */
} climb;

static int polish(climb *c, carom_contact_stage stage, int rounds)
{
    crm_island *s = c->s;
    *c->unpolished = s->best_residual;
    *c->stage = stage;
    return crm_active_set(s, rounds);
}

/* Contacts that the guess does not know are tested at the free motion. */
static void set_free_modes(crm_island *s, int unknown_only)
{
    for (int k = 0; k < s->nc; k++) {
        const crm_contact *c = &s->contact[k];
        if (unknown_only && s->mode[k] <= CAROM_SLIP_PLUS) continue;
        s->mode[k] = (unsigned char)crm_contact_mode_of(c, 0, 0, c->cn, c->ct);
    }
}

static void fit_guess(crm_island *s)
{
    set_free_modes(s, 1);
    for (int k = 0; k < s->nc; k++) {
        if (!(s->contact[k].mu > 0) && s->mode[k] > CAROM_STICK) s->mode[k] = CAROM_STICK;
    }
}

/* No joint, no contact that the free motion violates: nothing to solve. */
static int is_free(crm_island *s)
{
    if (s->ng) return 0;
    for (int k = 0; k < s->nc; k++) {
        if (s->contact[k].cn < 0) return 0;
    }
    memset(s->mode, CAROM_SEPARATED, (size_t)s->nc);
    crm_vec_zero(s, s->x);
    return crm_island_offer(s, s->x, crm_island_residual(s, s->x));
}

static int try_modes(climb *c, carom_contact_stage stage, int rounds)
{
    *c->stage = stage;
    const int done = crm_active_set(c->s, rounds);
    *c->unpolished = c->s->best_residual;
    return done;
}

/* Rounding of a row at the point last measured: of |c| + |J| (|v| + |u| + |J|' |l|). */
static double row_rounding(const crm_island *s, const double *row, int a, int b, double c)
{
    double terms = fabs(c);
    for (int i = 0; a >= 0 && i < 3; i++) terms += fabs(row[i]) * s->size[3 * a + i];
    for (int i = 0; b >= 0 && i < 3; i++) terms += fabs(row[3 + i]) * s->size[3 * b + i];
    return fmax(GUESS_EXACT, CRM_ROUNDING * terms);
}

/* The equations and inequalities of contact k's mode hold at the point last measured. */
static int mode_fits(const crm_island *s, int k, unsigned char mode, double tiny_n, double tiny_t)
{
    const double ln = s->x.n[k];
    const double bound = s->contact[k].mu * ln;
    const double sign = crm_slip_sign(mode);
    if (mode == CAROM_SEPARATED) return fabs(ln) <= tiny_n && s->an[k] >= -tiny_n;
    if (!(fabs(s->an[k]) <= tiny_n && ln >= -tiny_n)) return 0;
    if (sign != 0) return fabs(s->x.t[k] - sign * bound) <= tiny_t && sign * s->ut[k] <= tiny_t;
    return fabs(s->ut[k]) <= tiny_t && fabs(s->x.t[k]) <= bound + tiny_t;
}

/* The mode in which contact k obeys its laws to rounding, its present one first; -1: none. */
static int exact_mode(const crm_island *s, int k)
{
    const crm_contact *c = &s->contact[k];
    const double tiny_n = row_rounding(s, c->n, c->a, c->b, c->cn);
    const double tiny_t = row_rounding(s, c->t, c->a, c->b, c->ct);
    const int to = (int)crm_contact_mode_of(c, s->x.n[k], s->x.t[k], s->an[k], s->ut[k]);
    if (mode_fits(s, k, s->mode[k], tiny_n, tiny_t)) return s->mode[k];
    return mode_fits(s, k, (unsigned char)to, tiny_n, tiny_t) ? to : -1;
}

static int group_is_exact(const crm_island *s, int q, const double *defect)
{
    const crm_group *g = &s->group[q];
    for (int r = 0; r < CRM_GROUP_ROWS; r++) {
        const double tiny = row_rounding(s, g->j[r], g->a, g->b, g->c[r]);
        if (!(fabs(defect[3 * (s->nb + q) + r]) <= tiny)) return 0;
    }
    return 1;
}

/* Guessed impulses that fit as they are: nothing has changed.  (Where something has, its rows see
 * more than the rounding of their own terms.) */
static int guess_is_exact(crm_island *s)
{
    const double r = crm_island_residual(s, s->x); /* leaves the sizes, and the defect in rest */
    if (!(r <= GUESS_ACCEPT * s->accept)) return 0;
    for (int q = 0; q < s->ng; q++) {
        if (!group_is_exact(s, q, s->rest.z)) return 0;
    }
    for (int k = 0; k < s->nc; k++) {
        const int mode = exact_mode(s, k);
        if (mode < 0) return 0;
        s->base_mode[k] = (unsigned char)mode;
    }
    memcpy(s->mode, s->base_mode, (size_t)s->nc);
    return crm_island_offer(s, s->x, r);
}

/* Guessed impulses that are accepted as they are, when their modes led nowhere: where rows depend
 * on each other, as between bodies that jam, rounding of the data moves the impulses of a set of
 * modes by rounding / compliance.  Modes are the guess's where they fit as well. */
static int guess_is_accepted(crm_island *s)
{
    const double tiny = s->accept;
    const double r = crm_island_residual(s, s->x);
    if (!(r <= s->accept)) return 0;
    for (int k = 0; k < s->nc; k++) {
        if (mode_fits(s, k, s->mode[k], tiny, tiny)) continue;
        s->mode[k] = (unsigned char)crm_contact_mode_of(&s->contact[k], s->x.n[k], s->x.t[k],
                                                        s->an[k], s->ut[k]);
    }
    return crm_island_offer(s, s->x, r);
}

/* The rounds from the guess; then the guess itself. */
static int try_guess_modes(climb *c, int use_guess)
{
    crm_island *s = c->s;
    crm_vec_copy(s, s->swept, s->x);
    memcpy(s->base_mode, s->mode, (size_t)s->nc);
    if (try_modes(c, CAROM_STAGE_GUESS, ROUNDS_GUESS)) return 1;
    if (use_guess != CAROM_GUESS_IMPULSES) return 0;
    crm_vec_copy(s, s->x, s->swept);
    memcpy(s->mode, s->base_mode, (size_t)s->nc);
    return guess_is_accepted(s);
}

/* The polish also follows an accepted point: it makes complementarity exact.  Large islands have
 * crossed over. */
static int try_interior(climb *c, carom_contact_stage stage, crm_interior_start start)
{
    const int done = crm_interior_point(c->s, start);
    const int rounds = done || c->s->nc >= CRM_MANY ? 1 : ROUNDS_POLISH;
    return polish(c, stage, rounds) || done;
}

static int try_damped(climb *c)
{
    *c->unpolished = c->s->best_residual;
    *c->stage = CAROM_STAGE_SWEEPS;
    return crm_damped(c->s, DAMPED_STEPS);
}

/* From the guess; where that fails and there are many contacts, from the interior near it. */
static int try_guess(climb *c, int use_guess)
{
    crm_island *s = c->s;
    const crm_interior_start near = {.fraction = 0.99, .shift = 0.1};
    fit_guess(s);
    *c->stage = CAROM_STAGE_GUESS;
    if (use_guess == CAROM_GUESS_IMPULSES && guess_is_exact(s)) return 1;
    if (try_guess_modes(c, use_guess)) return 1;
    if (s->nc < CRM_MANY || !(s->best_residual < HUGE_VAL)) return 0;
    crm_vec_copy(s, s->x, s->best);
    return try_interior(c, CAROM_STAGE_INTERIOR_POINT, near) || try_damped(c);
}

/* Without a guess to follow. */
static int try_active_sets(climb *c)
{
    crm_island *s = c->s;
    crm_vec_zero(s, s->x);
    set_free_modes(s, 0);
    if (try_modes(c, CAROM_STAGE_FREE, ROUNDS_TRY)) return 1;
    if (!s->nc) return 0;
    crm_vec_zero(s, s->x);
    memset(s->mode, CAROM_STICK, (size_t)s->nc);
    return try_modes(c, CAROM_STAGE_STICK, ROUNDS_TRY);
}

/* L: the largest multiplier when everything sticks. */
static double estimate_multiplier(crm_island *s)
{
    double l = 1;
    memset(s->mode, CAROM_STICK, (size_t)s->nc);
    crm_vec_zero(s, s->x);
    crm_solve_modes(s, 2);
    for (int k = 0; k < s->nc; k++) l = fmax(l, fmax(fabs(s->x.n[k]), fabs(s->x.t[k])));
    return fmin(1e8, fmax(10, l));
}

/* A bout of sweeps from where the last one ended, then the interior point from there. */
static int try_sweeps(climb *c, int bout)
{
    crm_island *s = c->s;
    if (!bout) crm_vec_zero(s, s->x);
    if (bout) crm_vec_copy(s, s->x, s->swept);
    crm_sweeps(s, N_SWEEPS << bout);
    crm_vec_copy(s, s->swept, s->x);
    crm_island_offer(s, s->x, crm_island_residual(s, s->x));
    if (polish(c, CAROM_STAGE_SWEEPS, ROUNDS_REPAIR)) return 1;
    for (double shift = 0.1; shift > 0.005; shift *= 0.1) {
        const crm_interior_start start = {.fraction = 0.95, .shift = shift};
        crm_vec_copy(s, s->x, s->swept);
        if (try_interior(c, CAROM_STAGE_SWEEPS, start)) return 1;
    }
    return 0;
}

static int try_lemke(climb *c)
{
    crm_island *s = c->s;
    if (s->nc > LEMKE_CONTACTS) return 0;
    for (unsigned seed = 1; seed <= 2; seed++) {
        if (!crm_lemke(s, LEMKE_PIVOTS * s->nc + 50, seed)) continue;
        crm_island_offer(s, s->x, crm_island_residual(s, s->x));
        if (polish(c, CAROM_STAGE_LEMKE, ROUNDS_REPAIR)) return 1;
    }
    return 0;
}

static int try_restarts(climb *c)
{
    for (int i = 0; i < c->s->max_restarts; i++) {
        const double ln[] = {10, c->large, 1};
        const double slack[] = {0.01, 1, 1};
        const crm_interior_start start = {.ln = ln[i % 3],
                                          .slack = slack[i % 3],
                                          .fraction = 0.95,
                                          .spread = i < WIDE_RESTARTS ? 1 : 2,
                                          .seed = 1 + (unsigned long long)i};
        if (try_interior(c, CAROM_STAGE_RESTART, start)) return 1;
        if (i > 2 && c->s->best_residual <= c->s->inexact) return 0;
    }
    return 0;
}

/* The rungs for what neither a guess nor the first interior point solved. */
static int try_harder(climb *c)
{
    const crm_interior_start second = {.ln = 10, .slack = 0.01, .fraction = 0.95};
    const crm_interior_start third = {.ln = 1, .slack = 1, .fraction = 0.95};
    if (try_interior(c, CAROM_STAGE_INTERIOR_POINT, second)) return 1;
    if (try_interior(c, CAROM_STAGE_INTERIOR_POINT, third)) return 1;
    if (try_damped(c)) return 1;
    if (try_sweeps(c, 0) || try_lemke(c)) return 1;
    for (int bout = 1; c->s->max_restarts && bout < N_BOUTS; bout++) {
        if (try_sweeps(c, bout)) return 1;
        if (c->s->best_residual <= c->s->inexact) break;
    }
    return try_restarts(c);
}

carom_status crm_ladder_climb(crm_island *s, int use_guess, carom_contact_stage *stage,
                              double *unpolished)
{
    climb c = {s, stage, unpolished, 0};
    *stage = CAROM_STAGE_NONE;
    *unpolished = 0;
    if (is_free(s)) return CAROM_OK;
    const int guessed = use_guess && (s->nc || use_guess == CAROM_GUESS_IMPULSES);
    if (guessed && try_guess(&c, use_guess)) return CAROM_OK;
    if (!(guessed && s->nc >= CRM_MANY) && try_active_sets(&c)) return CAROM_OK;
    if (s->nc) {
        c.large = estimate_multiplier(s);
        const crm_interior_start start = {.ln = c.large, .slack = 1, .fraction = 0.995};
        if (try_interior(&c, CAROM_STAGE_INTERIOR_POINT, start)) return CAROM_OK;
    }
    if (crm_farkas(s)) return CAROM_E_INFEASIBLE;
    if (!s->nc || s->brief) return CAROM_E_NO_SOLUTION;
    return try_harder(&c) ? CAROM_OK : CAROM_E_NO_SOLUTION;
}
