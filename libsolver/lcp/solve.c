#include "libsolver/lcp/solver.h"
#include "libsolver/lcp/sparse.h"

#include <math.h>

/* Row i of M r - M'r may be this part of row i of |M| |r|. */
static const double SYMMETRY = 1e-10;

static int same_pattern(const carom_lcp *l, const carom_lcp_problem *p)
{
    const carom_lcp_problem *own = &l->scaled;
    return own->n_x == p->n_x && own->n_ineq == p->n_ineq && own->n_eq == p->n_eq &&
           crm_sparse_same(&own->M, &p->M, p->n_x) && crm_sparse_same(&own->A, &p->A, p->n_x) &&
           crm_sparse_same(&own->G, &p->G, p->n_x) && crm_sparse_same(&own->F, &p->F, p->n_ineq);
}

static int numbers_finite(const carom_lcp_problem *p)
{
    return crm_finite(crm_sparse_count(&p->M, p->n_x), p->M.val) &&
           crm_finite(crm_sparse_count(&p->A, p->n_x), p->A.val) &&
           crm_finite(crm_sparse_count(&p->G, p->n_x), p->G.val) &&
           crm_finite(crm_sparse_count(&p->F, p->n_ineq), p->F.val) && crm_finite(p->n_x, p->q) &&
           crm_finite(p->n_eq, p->b) && crm_finite(p->n_ineq, p->m);
}

/* M r = M'r for one generic r: an asymmetric M passes only by a coincidence of all its rows. */
static int symmetric(carom_lcp *l, const carom_lcp_problem *p)
{
    double *r = l->work.abs_x;
    double *difference = l->work.rx;
    double *size = l->work.row_x;
    for (int i = 0; i < p->n_x; i++) {
        r[i] = 1.0 + fmod((i + 1) * 0.61803398874989485, 1.0); /* golden ratio: no two alike */
        difference[i] = size[i] = 0.0;
    }
    crm_sparse_add(&p->M, p->n_x, 1.0, r, difference);
    crm_sparse_add_t(&p->M, p->n_x, -1.0, r, difference);
    crm_sparse_add_abs(&p->M, p->n_x, r, size);
    crm_sparse_add_abs_t(&p->M, p->n_x, r, size);
    for (int i = 0; i < p->n_x; i++)
        if (!(fabs(difference[i]) <= SYMMETRY * size[i])) return 0;
    return 1;
}

carom_status crm_lcp_check(carom_lcp *l, const carom_lcp_problem *p)
{
    if (!same_pattern(l, p)) return CAROM_E_STATE;
    return numbers_finite(p) && symmetric(l, p) ? CAROM_OK : CAROM_E_ARGUMENT;
}

void crm_lcp_load(carom_lcp *l, const carom_lcp_problem *p)
{
    crm_scale_find(p, l->settings.equilibrate, l->res, &l->scale);
    crm_scale_problem(p, &l->scale, &l->number);
    l->problem = p;
}

carom_lcp_point crm_iterate_point(const carom_lcp *l, crm_iterate it)
{
    const carom_lcp_point at = {it.u, it.s, it.u + l->scaled.n_x,
                                it.u + l->scaled.n_x + l->scaled.n_ineq};
    return at;
}

void crm_iterate_copy(const carom_lcp *l, crm_iterate from, crm_iterate to)
{
    memcpy(to.u, from.u, (size_t)l->kkt.n * sizeof *to.u);
    memcpy(to.s, from.s, (size_t)l->scaled.n_ineq * sizeof *to.s);
}

double crm_offer(carom_lcp *l, crm_iterate it)
{
    const carom_lcp_point at = crm_iterate_point(l, it);
    crm_unscale_point(&l->scaled, &l->scale, &at, &l->plain);
    const double residual = crm_natural_residual(l->problem, &l->plain, &l->work);
    if (residual < l->best_residual) {
        crm_iterate_copy(l, it, l->best);
        l->best_residual = residual;
    }
    if (residual < l->lead_residual) {
        crm_iterate_copy(l, it, l->lead);
        l->lead_residual = residual;
    }
    return residual;
}

/* The origin solves a problem that asks for nothing: q = 0, b = 0, m >= 0. */
static void offer_origin(carom_lcp *l)
{
    memset(l->now.u, 0, (size_t)l->kkt.n * sizeof *l->now.u);
    for (int i = 0; i < l->scaled.n_ineq; i++) l->now.s[i] = fmax(l->scaled.m[i], 0.0);
    crm_offer(l, l->now);
}

/* Starts until one leads to an accepted point; CAROM_E_MEMORY is the only failure. */
static carom_status search(carom_lcp *l)
{
    offer_origin(l);
    const int starts = l->scaled.n_ineq ? l->settings.max_starts : 1;
    for (int k = 0; k < starts && !(l->best_residual <= l->settings.accept); k++) {
        l->stats.starts++;
        l->lead_residual = HUGE_VAL;
        if (crm_interior_run(l, k) == CAROM_E_MEMORY) return CAROM_E_MEMORY;
        if (crm_polish_run(l) == CAROM_E_MEMORY) return CAROM_E_MEMORY;
    }
    return CAROM_OK;
}

static carom_status judge(const carom_lcp *l, double residual)
{
    if (residual <= l->settings.accept) return CAROM_OK;
    if (residual <= l->settings.inexact) return CAROM_INEXACT;
    return l->scaled.n_ineq && residual < HUGE_VAL ? CAROM_E_NO_SOLUTION : CAROM_E_SINGULAR;
}

static void count_factorizations(carom_lcp *l, int sign)
{
    l->stats.factorizations += sign * l->kkt.factorizations;
    l->stats.refactorizations += sign * l->kkt.refactorizations;
}

static carom_status solve(carom_lcp *l, const carom_lcp_problem *p, carom_lcp_point *out)
{
    const carom_lcp_stats none = {CAROM_OK, HUGE_VAL, 0, 0, 0, 0, 0};
    l->stats = none;
    l->best_residual = l->lead_residual = HUGE_VAL;
    count_factorizations(l, -1);
    crm_kkt_forget(&l->kkt);
    crm_lcp_load(l, p);
    if (search(l) < 0) return CAROM_E_MEMORY;
    count_factorizations(l, 1);
    if (!(l->best_residual < HUGE_VAL)) return CAROM_E_SINGULAR;
    const carom_lcp_point best = crm_iterate_point(l, l->best);
    crm_unscale_point(p, &l->scale, &best, &l->plain);
    l->stats.residual = crm_natural_residual(p, &l->plain, &l->work);
    carom_status status = judge(l, l->stats.residual);
    if (status < 0 && l->settings.certify && crm_certify(&l->certifier, &l->scaled))
        status = CAROM_E_INFEASIBLE;
    if (status != CAROM_E_SINGULAR) crm_unscale_point(p, &l->scale, &best, out);
    return status;
}

int crm_point_given(const carom_lcp_problem *p, const carom_lcp_point *at)
{
    return at && (at->x || !p->n_x) && (at->z || !p->n_ineq) && (at->s || !p->n_ineq) &&
           (at->y || !p->n_eq);
}

carom_status carom_lcp_solve(carom_lcp *l, const carom_lcp_problem *problem, carom_lcp_point *out,
                             carom_lcp_stats *stats)
{
    if (!l || !problem || !crm_point_given(problem, out)) return CAROM_E_ARGUMENT;
    carom_status status = crm_lcp_check(l, problem);
    if (status < 0) return status;
    status = solve(l, problem, out);
    l->problem = NULL;
    l->stats.status = status;
    if (stats) *stats = l->stats;
    return status;
}

double carom_lcp_residual(carom_lcp *l, const carom_lcp_problem *problem, const carom_lcp_point *at)
{
    if (!l || !problem || !crm_point_given(problem, at)) return HUGE_VAL;
    if (!same_pattern(l, problem) || !numbers_finite(problem)) return HUGE_VAL;
    if (!crm_finite(problem->n_x, at->x) || !crm_finite(problem->n_ineq, at->s) ||
        !crm_finite(problem->n_ineq, at->z) || !crm_finite(problem->n_eq, at->y))
        return HUGE_VAL;
    return crm_natural_residual(problem, at, &l->work);
}
