#include "libsolver/lcp/solver.h"
#include "libsolver/lcp/sparse.h"

#include <math.h>

/* Proximal regularization: refinement from the present point solves the singular equations of
 * redundant rows and leaves what they do not determine where it was [1]. */
static const crm_kkt_reg PROXIMAL = {1e-10, 1e-9, 1e-9};
enum { REFINEMENTS = 6 };
/* A pair changes sides when it is violated by more than this, in scaled units. */
static const double VIOLATION = 1e-11;
/* Far enough below the accepted residual to stop. */
static const double MARGIN = 1e-3;
/* Active sets remembered, to see a cycle. */
enum { MEMORY = 64 };

/* FNV-1a of the active set. */
static uint64_t fingerprint(int n, const double *w)
{
    uint64_t h = UINT64_C(14695981039346656037);
    for (int i = 0; i < n; i++) h = (h ^ (w[i] > 0.5 ? 1u : 2u)) * UINT64_C(1099511628211);
    return h;
}

/* Solves with s_i = 0 where w_i = 1 and z_i = 0 elsewhere; l->now is start and result, signs free.
 */
static carom_status solve_active(carom_lcp *l)
{
    const carom_lcp_problem *p = &l->scaled;
    const int nx = p->n_x;
    const int nz = p->n_ineq;
    const carom_lcp_point at = crm_iterate_point(l, l->now);
    for (int i = 0; i < nz; i++) l->v[i] = 1.0 - l->w[i];
    crm_kkt_assemble(&l->kkt, p, l->w, l->v, PROXIMAL);
    const carom_status status = crm_kkt_factor(&l->kkt);
    if (status < 0) return status;
    for (int i = 0; i < nx; i++) l->rhs[i] = -p->q[i];
    for (int i = 0; i < p->n_eq; i++) l->rhs[nx + nz + i] = p->b[i];
    for (int i = 0; i < nz; i++) {
        l->rhs[nx + i] = l->w[i] * p->m[i];
        at.z[i] *= l->w[i];
    }
    if (!(crm_kkt_solve(&l->kkt, 0, REFINEMENTS, l->rhs, at.x) < HUGE_VAL)) return CAROM_E_SINGULAR;
    for (int i = 0; i < nz; i++) {
        at.z[i] *= l->w[i];
        at.s[i] = p->m[i];
    }
    crm_sparse_add(&p->G, nx, -1.0, at.x, at.s);
    crm_sparse_add(&p->F, nz, -1.0, at.z, at.s);
    for (int i = 0; i < nz; i++) at.s[i] *= l->v[i];
    return CAROM_OK;
}

/* Offers l->now with what is negative set to zero. */
static double offer_clipped(carom_lcp *l)
{
    const crm_iterate clipped = {l->du, l->ds};
    crm_iterate_copy(l, l->now, clipped);
    const carom_lcp_point at = crm_iterate_point(l, clipped);
    for (int i = 0; i < l->scaled.n_ineq; i++) {
        at.z[i] = fmax(at.z[i], 0.0);
        at.s[i] = fmax(at.s[i], 0.0);
    }
    return crm_offer(l, clipped);
}

/* Exchanges the violated pairs; returns their number. */
static int exchange(carom_lcp *l)
{
    const carom_lcp_point at = crm_iterate_point(l, l->now);
    int changed = 0;
    for (int i = 0; i < l->scaled.n_ineq; i++) {
        if ((l->w[i] > 0.5 ? at.z[i] : at.s[i]) >= -VIOLATION) continue;
        l->w[i] = 1.0 - l->w[i];
        changed++;
    }
    return changed;
}

carom_status crm_polish_run(carom_lcp *l)
{
    uint64_t seen[MEMORY];
    int n_seen = 0;
    if (!(l->lead_residual < HUGE_VAL)) return CAROM_OK;
    crm_iterate_copy(l, l->lead, l->now);
    const carom_lcp_point at = crm_iterate_point(l, l->now);
    for (int i = 0; i < l->scaled.n_ineq; i++) l->w[i] = at.z[i] > at.s[i] ? 1.0 : 0.0;
    for (int k = 0; k < l->settings.polish_rounds; k++) {
        const uint64_t set = fingerprint(l->scaled.n_ineq, l->w);
        for (int i = 0; i < n_seen; i++)
            if (seen[i] == set) return CAROM_OK;
        if (n_seen < MEMORY) seen[n_seen++] = set;
        l->stats.polish_rounds++;
        const carom_status status = solve_active(l);
        if (status < 0) return status;
        if (offer_clipped(l) <= MARGIN * l->settings.accept) return CAROM_OK;
        exchange(l);
    }
    return CAROM_OK;
}
