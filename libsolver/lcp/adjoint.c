#include "libsolver/lcp/solver.h"
#include "libsolver/lcp/sparse.h"

#include <math.h>

/* Above this condition number the equations count as singular and are solved proximally. */
static const double SINGULAR_CONDITION = 1e13;
static const crm_kkt_reg NONE = {0.0, 0.0, 0.0};
static const crm_kkt_reg PROXIMAL = {1e-10, 1e-10, 1e-10};
enum { REFINEMENTS = 3, PROXIMAL_REFINEMENTS = 40 };
/* Singular equations have a solution when this part of the right-hand side is left at most: what a
 * right-hand side leaves outside the range stays, of order 1. */
static const double CONSISTENT = 1e-8;
/* A pair is degenerate when both are below this part of their scales. */
static const double DEGENERATE = 1e-9;

/* Row weights of kkt.h from the active set; needs l->work as crm_natural_residual leaves it. */
static int choose_active(carom_lcp *l, const carom_lcp_point *at)
{
    int degenerate = 0;
    for (int i = 0; i < l->scaled.n_ineq; i++) {
        const double t = l->work.row_z[i];
        const double s = t > 0.0 ? at->s[i] / t : at->s[i] > 0.0 ? HUGE_VAL : 0.0;
        const double z = at->z[i] > 0.0 ? at->z[i] * l->work.weigh_z[i] : 0.0;
        l->w[i] = z > s ? 1.0 : 0.0;
        l->v[i] = 1.0 - l->w[i];
        if (fmax(s, z) <= DEGENERATE) degenerate++;
    }
    return degenerate;
}

/* Checks the arguments, scales the problem, chooses the active set. */
static carom_status prepare(carom_lcp *l, const carom_lcp_problem *p, const carom_lcp_point *at,
                            carom_lcp_derivative *info)
{
    if (!l || !p || !crm_point_given(p, at)) return CAROM_E_ARGUMENT;
    const carom_status status = crm_lcp_check(l, p);
    if (status < 0) return status;
    if (!(carom_lcp_residual(l, p, at) <= l->settings.inexact)) return CAROM_E_ARGUMENT;
    info->residual = 0.0;
    info->singular = 0;
    info->degenerate = choose_active(l, at);
    crm_lcp_load(l, p);
    l->problem = NULL;
    return CAROM_OK;
}

/* du <- K^-1 rhs (or K'^-1); where K is singular, a solution if there is one. */
static carom_status solve(carom_lcp *l, int transposed, carom_lcp_derivative *info)
{
    crm_kkt_forget(&l->kkt);
    memset(l->du, 0, (size_t)l->kkt.n * sizeof *l->du);
    crm_kkt_assemble(&l->kkt, &l->scaled, l->w, l->v, NONE);
    carom_status status = crm_kkt_factor(&l->kkt);
    if (status == CAROM_E_MEMORY) return status;
    int rounds = REFINEMENTS;
    if (status < 0 || crm_kkt_condition(&l->kkt) > SINGULAR_CONDITION) {
        info->singular = 1;
        rounds = PROXIMAL_REFINEMENTS;
        crm_kkt_assemble(&l->kkt, &l->scaled, l->w, l->v, PROXIMAL);
        status = crm_kkt_factor(&l->kkt);
        if (status < 0) return status;
    }
    info->residual = crm_kkt_solve(&l->kkt, transposed, rounds, l->rhs, l->du);
    return info->residual < HUGE_VAL && (!info->singular || l->kkt.left <= CONSISTENT)
               ? CAROM_OK
               : CAROM_E_SINGULAR;
}

/* to <- D from, 0 where from is NULL */
static void scaled_copy(int n, const double *d, const double *from, double *to)
{
    for (int i = 0; i < n; i++) to[i] = from ? d[i] * from[i] : 0.0;
}

/* bar <- -1/2 (u x' + x u') on the pattern of a */
static void symmetric_outer(const carom_sparse *a, int n_cols, const double *u, const double *x,
                            double *bar)
{
    for (int j = 0; a->col && j < n_cols; j++)
        for (int p = a->col[j]; p < a->col[j + 1]; p++) {
            const int i = a->row[p];
            bar[p] = -0.5 * (u[i] * x[j] + x[i] * u[j]);
        }
}

/* bar <- -(a b' + c d') on the pattern; c, d may be NULL. */
static void outer(const carom_sparse *pattern, int n_cols, const double *a, const double *b,
                  const double *c, const double *d, double *bar)
{
    for (int j = 0; pattern->col && j < n_cols; j++)
        for (int p = pattern->col[j]; p < pattern->col[j + 1]; p++) {
            const int i = pattern->row[p];
            bar[p] = -(a[i] * b[j] + (c ? c[i] * d[j] : 0.0));
        }
}

static void copy(int n, double sign, const double *from, double *to)
{
    for (int i = 0; to && i < n; i++) to[i] = sign * from[i];
}

/* docs/math/equations.md (11), with u_z standing for D(z) d_z. */
static void write_gradient(const carom_lcp_problem *p, const carom_lcp_point *at, const double *u,
                           carom_lcp_gradient *g)
{
    const double *u_x = u;
    const double *u_z = u + p->n_x;
    const double *u_y = u_z + p->n_ineq;
    if (g->M) symmetric_outer(&p->M, p->n_x, u_x, at->x, g->M);
    if (g->A) outer(&p->A, p->n_x, u_y, at->x, at->y, u_x, g->A);
    if (g->G) outer(&p->G, p->n_x, u_z, at->x, at->z, u_x, g->G);
    if (g->F) outer(&p->F, p->n_ineq, u_z, at->z, NULL, NULL, g->F);
    copy(p->n_x, -1.0, u_x, g->q);
    copy(p->n_eq, 1.0, u_y, g->b);
    copy(p->n_ineq, 1.0, u_z, g->m);
}

carom_status carom_lcp_adjoint(carom_lcp *l, const carom_lcp_problem *problem,
                               const carom_lcp_point *at, const carom_lcp_cotangent *cotangent,
                               carom_lcp_gradient *gradient, carom_lcp_derivative *info)
{
    carom_lcp_derivative mine;
    if (!cotangent || !gradient) return CAROM_E_ARGUMENT;
    carom_status status = prepare(l, problem, at, &mine);
    if (status < 0) return status;
    const int nx = problem->n_x;
    const int nz = problem->n_ineq;
    const int ny = problem->n_eq;
    scaled_copy(nx, l->scale.x, cotangent->x, l->rhs);
    scaled_copy(nz, l->scale.z, cotangent->z, l->rhs + nx);
    scaled_copy(ny, l->scale.y, cotangent->y, l->rhs + nx + nz);
    if (!crm_finite(l->kkt.n, l->rhs)) return CAROM_E_ARGUMENT;
    status = solve(l, 1, &mine);
    if (info) *info = mine;
    if (status < 0) return status;
    for (int i = 0; i < nx; i++) l->du[i] *= l->scale.x[i];
    for (int i = 0; i < nz; i++) l->du[nx + i] *= l->scale.z[i] * l->w[i];
    for (int i = 0; i < ny; i++) l->du[nx + nz + i] *= l->scale.y[i];
    write_gradient(problem, at, l->du, gradient);
    return CAROM_OK;
}

/* The pattern of a with other numbers; no entries when val is NULL. */
static carom_sparse moved(const carom_sparse *a, const double *val)
{
    const carom_sparse d = {val ? a->col : NULL, a->row, val};
    return d;
}

/* rhs <- (-(dM x + dA'y + dG'z + dq), dm - dG x - dF z, db - dA x) */
static void perturb(const carom_lcp_problem *p, const carom_lcp_point *at,
                    const carom_lcp_direction *d, double *rhs)
{
    const carom_sparse dM = moved(&p->M, d->M);
    const carom_sparse dA = moved(&p->A, d->A);
    const carom_sparse dG = moved(&p->G, d->G);
    const carom_sparse dF = moved(&p->F, d->F);
    double *rz = rhs + p->n_x;
    double *ry = rz + p->n_ineq;
    for (int i = 0; i < p->n_x; i++) rhs[i] = d->q ? -d->q[i] : 0.0;
    for (int i = 0; i < p->n_ineq; i++) rz[i] = d->m ? d->m[i] : 0.0;
    for (int i = 0; i < p->n_eq; i++) ry[i] = d->b ? d->b[i] : 0.0;
    crm_sparse_add(&dM, p->n_x, -1.0, at->x, rhs);
    crm_sparse_add_t(&dA, p->n_x, -1.0, at->y, rhs);
    crm_sparse_add_t(&dG, p->n_x, -1.0, at->z, rhs);
    crm_sparse_add(&dG, p->n_x, -1.0, at->x, rz);
    crm_sparse_add(&dF, p->n_ineq, -1.0, at->z, rz);
    crm_sparse_add(&dA, p->n_x, -1.0, at->x, ry);
}

carom_status carom_lcp_tangent(carom_lcp *l, const carom_lcp_problem *problem,
                               const carom_lcp_point *at, const carom_lcp_direction *direction,
                               double *dx, double *dz, double *dy, carom_lcp_derivative *info)
{
    carom_lcp_derivative mine;
    if (!direction) return CAROM_E_ARGUMENT;
    carom_status status = prepare(l, problem, at, &mine);
    if (status < 0) return status;
    const int nx = problem->n_x;
    const int nz = problem->n_ineq;
    const int ny = problem->n_eq;
    perturb(problem, at, direction, l->rhs);
    for (int i = 0; i < nx; i++) l->rhs[i] *= l->scale.x[i];
    for (int i = 0; i < nz; i++) l->rhs[nx + i] *= l->scale.z[i] * l->w[i];
    for (int i = 0; i < ny; i++) l->rhs[nx + nz + i] *= l->scale.y[i];
    if (!crm_finite(l->kkt.n, l->rhs)) return CAROM_E_ARGUMENT;
    status = solve(l, 0, &mine);
    if (info) *info = mine;
    if (status < 0) return status;
    if (dx) scaled_copy(nx, l->scale.x, l->du, dx);
    if (dz) scaled_copy(nz, l->scale.z, l->du + nx, dz);
    if (dy) scaled_copy(ny, l->scale.y, l->du + nx + nz, dy);
    return CAROM_OK;
}
