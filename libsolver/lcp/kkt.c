#include "libsolver/lcp/kkt.h"

#include "libsolver/lcp/entries.h"
#include "libsolver/lcp/sparse.h"

#include <float.h>
#include <limits.h>
#include <math.h>

/* Pivots of an earlier factorization serve while min |u_ii| / max |u_ii| stays above this. */
static const double REUSE_RCOND = 1e-13;
/* A fresh factorization is singular below this (KLU's rows are scaled to maximum 1). */
static const double SINGULAR_RCOND = 1e-300;
/* A solve with reused pivots that leaves more than this is repeated with fresh ones. */
static const double REUSE_RESIDUAL = 1e-10;
/* Refinement ends when the residual is at rounding level or does not fall. */
static const double ROUNDING = 2.3e-16;

static void list_entries(const carom_lcp_problem *p, crm_entries *e)
{
    const int z = p->n_x;
    const int y = p->n_x + p->n_ineq;
    crm_entries_block(e, &p->M, p->n_x, 0, 0, 0);
    crm_entries_block(e, &p->A, p->n_x, y, 0, 0);
    crm_entries_block(e, &p->A, p->n_x, 0, y, 1);
    crm_entries_block(e, &p->G, p->n_x, z, 0, 0);
    crm_entries_block(e, &p->G, p->n_x, 0, z, 1);
    crm_entries_block(e, &p->F, p->n_ineq, z, z, 0);
    crm_entries_diagonal(e, y + p->n_eq, 0, 0);
}

/* Stable counting sort of order[0..m) by key[order[.]] in 0..n-1. */
static void sort_by(int m, int n, const int *key, const int *order, int *start, int *out)
{
    memset(start, 0, ((size_t)n + 1) * sizeof *start);
    for (int e = 0; e < m; e++) start[key[e] + 1]++;
    for (int i = 0; i < n; i++) start[i + 1] += start[i];
    for (int e = 0; e < m; e++) out[start[key[order[e]]]++] = order[e];
}

/* Merges the sorted entries into col, row and map. */
static void merge(crm_kkt *k, const crm_entries *e, const int *order)
{
    int last = -1;
    memset(k->col, 0, ((size_t)k->n + 1) * sizeof *k->col);
    k->nnz = 0;
    for (int t = 0; t < e->n; t++) {
        const int now = order[t];
        if (last < 0 || e->row[now] != e->row[last] || e->col[now] != e->col[last]) {
            k->row[k->nnz++] = e->row[now];
            k->col[e->col[now] + 1]++;
        }
        k->map[now] = k->nnz - 1;
        last = now;
    }
    for (int j = 0; j < k->n; j++) k->col[j + 1] += k->col[j];
}

static carom_status build_pattern(crm_kkt *k, crm_memory *memory, const carom_lcp_problem *pattern)
{
    const size_t m = (size_t)k->n_entries;
    const size_t n1 = (size_t)k->n + 1;
    carom_status status = CAROM_E_MEMORY;
    crm_entries e = {crm_new(memory, m, sizeof(int)), crm_new(memory, m, sizeof(int)), 0};
    int *start = crm_new(memory, n1, sizeof(int));
    int *first = crm_new(memory, m, sizeof(int));
    int *second = crm_new(memory, m, sizeof(int));
    if (e.row && e.col && start && first && second) {
        list_entries(pattern, &e);
        for (int t = 0; t < e.n; t++) second[t] = t;
        sort_by(e.n, k->n, e.row, second, start, first);
        sort_by(e.n, k->n, e.col, first, start, second);
        merge(k, &e, second);
        status = CAROM_OK;
    }
    crm_free(memory, second, m, sizeof(int));
    crm_free(memory, first, m, sizeof(int));
    crm_free(memory, start, n1, sizeof(int));
    crm_free(memory, e.col, m, sizeof(int));
    crm_free(memory, e.row, m, sizeof(int));
    return status;
}

/* Sizes of the pattern; CAROM_E_CAPACITY when an int cannot hold them. */
static carom_status set_sizes(crm_kkt *k, const carom_lcp_problem *p)
{
    const double n = (double)p->n_x + p->n_ineq + p->n_eq;
    const double m = n + crm_sparse_count(&p->M, p->n_x) + 2.0 * crm_sparse_count(&p->A, p->n_x) +
                     2.0 * crm_sparse_count(&p->G, p->n_x) + crm_sparse_count(&p->F, p->n_ineq);
    if (m > (double)(INT_MAX / 2)) return CAROM_E_CAPACITY;
    k->n_x = p->n_x;
    k->n_ineq = p->n_ineq;
    k->n_eq = p->n_eq;
    k->n = (int)n;
    k->n_entries = (int)m;
    return CAROM_OK;
}

carom_status crm_kkt_create(crm_kkt *k, crm_memory *memory, const carom_lcp_problem *pattern)
{
    carom_status status = set_sizes(k, pattern);
    if (status < 0) return status;
    const size_t n = (size_t)k->n;
    const size_t m = (size_t)k->n_entries;
    k->col = crm_new(memory, n + 1, sizeof *k->col);
    k->row = crm_new(memory, m, sizeof *k->row);
    k->val = crm_new(memory, m, sizeof *k->val);
    k->map = crm_new(memory, m, sizeof *k->map);
    k->reg = crm_new(memory, n, sizeof *k->reg);
    k->res = crm_new(memory, n, sizeof *k->res);
    k->fix = crm_new(memory, n, sizeof *k->fix);
    k->size = crm_new(memory, n, sizeof *k->size);
    if (!k->col || !k->row || !k->val || !k->map || !k->reg || !k->res || !k->fix || !k->size)
        return CAROM_E_MEMORY;
    status = build_pattern(k, memory, pattern);
    if (status < 0 || k->n == 0) return status;
    klu_defaults(&k->common);
    k->symbolic = klu_analyze(k->n, k->col, k->row, &k->common);
    return k->symbolic ? CAROM_OK : CAROM_E_MEMORY;
}

void crm_kkt_forget(crm_kkt *k)
{
    if (k->numeric) klu_free_numeric(&k->numeric, &k->common);
}

void crm_kkt_destroy(crm_kkt *k, crm_memory *memory)
{
    const size_t n = (size_t)k->n;
    const size_t m = (size_t)k->n_entries;
    crm_kkt_forget(k);
    if (k->symbolic) klu_free_symbolic(&k->symbolic, &k->common);
    crm_free(memory, k->size, n, sizeof *k->size);
    crm_free(memory, k->fix, n, sizeof *k->fix);
    crm_free(memory, k->res, n, sizeof *k->res);
    crm_free(memory, k->reg, n, sizeof *k->reg);
    crm_free(memory, k->map, m, sizeof *k->map);
    crm_free(memory, k->val, m, sizeof *k->val);
    crm_free(memory, k->row, m, sizeof *k->row);
    crm_free(memory, k->col, n + 1, sizeof *k->col);
}

/* Adds the entries of a, row i times w_i (w NULL: 1), at the next places of the map. */
static const int *add_entries(crm_kkt *k, const int *map, const carom_sparse *a, int n_cols,
                              const double *w)
{
    const int count = crm_sparse_count(a, n_cols);
    for (int p = 0; p < count; p++) k->val[map[p]] += a->val[p] * (w ? w[a->row[p]] : 1.0);
    return map + count;
}

void crm_kkt_assemble(crm_kkt *k, const carom_lcp_problem *p, const double *w, const double *v,
                      crm_kkt_reg reg)
{
    const int y = k->n_x + k->n_ineq;
    const int *map = k->map;
    memset(k->val, 0, (size_t)k->nnz * sizeof *k->val);
    map = add_entries(k, map, &p->M, k->n_x, NULL);
    map = add_entries(k, map, &p->A, k->n_x, NULL);
    map = add_entries(k, map, &p->A, k->n_x, NULL);
    map = add_entries(k, map, &p->G, k->n_x, w);
    map = add_entries(k, map, &p->G, k->n_x, NULL);
    map = add_entries(k, map, &p->F, k->n_ineq, w);
    for (int i = 0; i < k->n; i++) {
        k->reg[i] = i < k->n_x ? reg.x : i < y ? -reg.z : -reg.y;
        k->val[map[i]] += k->reg[i];
        if (i >= k->n_x && i < y) k->val[map[i]] -= v[i - k->n_x];
    }
}

static int healthy(crm_kkt *k, double rcond)
{
    return k->common.status == KLU_OK && klu_rcond(k->symbolic, k->numeric, &k->common) &&
           k->common.rcond >= rcond;
}

static carom_status factor_fresh(crm_kkt *k)
{
    crm_kkt_forget(k);
    k->factorizations++;
    k->numeric = klu_factor(k->col, k->row, k->val, k->symbolic, &k->common);
    k->fresh = 1;
    if (k->common.status == KLU_OUT_OF_MEMORY || k->common.status == KLU_TOO_LARGE)
        return CAROM_E_MEMORY;
    if (k->numeric && healthy(k, SINGULAR_RCOND)) return CAROM_OK;
    crm_kkt_forget(k);
    return CAROM_E_SINGULAR;
}

carom_status crm_kkt_factor(crm_kkt *k)
{
    if (k->n == 0) return CAROM_OK;
    if (!k->numeric) return factor_fresh(k);
    k->refactorizations++;
    k->fresh = 0;
    if (klu_refactor(k->col, k->row, k->val, k->symbolic, k->numeric, &k->common) &&
        healthy(k, REUSE_RCOND))
        return CAROM_OK;
    return factor_fresh(k);
}

/* res <- rhs - K u (or K'u), K without its regularization; returns the relative size, kkt.h. */
static double residual(crm_kkt *k, int transposed, const double *rhs, const double *u)
{
    double *size = k->size;
    double top = 0.0;
    double scale = 0.0;
    double given = 0.0;
    for (int i = 0; i < k->n; i++) {
        k->res[i] = rhs[i] + k->reg[i] * u[i];
        size[i] = fabs(rhs[i]);
    }
    for (int j = 0; j < k->n; j++)
        for (int p = k->col[j]; p < k->col[j + 1]; p++) {
            const int to = transposed ? j : k->row[p];
            const double t = k->val[p] * u[transposed ? k->row[p] : j];
            k->res[to] -= t;
            size[to] += fabs(t);
        }
    for (int i = 0; i < k->n; i++) {
        if (!isfinite(k->res[i])) return k->left = HUGE_VAL;
        top = fmax(top, fabs(k->res[i]));
        given = fmax(given, fabs(rhs[i]));
        scale = fmax(scale, size[i]);
    }
    k->left = given > 0.0 ? top / given : scale > 0.0 ? HUGE_VAL : 0.0;
    return scale > 0.0 ? top / scale : 0.0;
}

/* fix <- (K + D(r))^-1 res, or with the transpose. */
static int back_substitute(crm_kkt *k, int transposed)
{
    memcpy(k->fix, k->res, (size_t)k->n * sizeof *k->fix);
    return transposed ? klu_tsolve(k->symbolic, k->numeric, k->n, 1, k->fix, &k->common)
                      : klu_solve(k->symbolic, k->numeric, k->n, 1, k->fix, &k->common);
}

static double refine(crm_kkt *k, int transposed, int rounds, const double *rhs, double *u)
{
    double error = residual(k, transposed, rhs, u);
    for (int r = 0; r < rounds && error > ROUNDING; r++) {
        if (!back_substitute(k, transposed)) return HUGE_VAL;
        for (int i = 0; i < k->n; i++) u[i] += k->fix[i];
        const double next = residual(k, transposed, rhs, u);
        if (!(next < error)) {
            for (int i = 0; i < k->n; i++) u[i] -= k->fix[i];
            return residual(k, transposed, rhs, u);
        }
        error = next;
    }
    return error;
}

double crm_kkt_solve(crm_kkt *k, int transposed, int rounds, const double *rhs, double *u)
{
    if (k->n == 0) return 0.0;
    double error = refine(k, transposed, rounds, rhs, u);
    if (error <= REUSE_RESIDUAL || k->fresh) return error;
    if (factor_fresh(k) < 0) return HUGE_VAL;
    if (!(error < HUGE_VAL)) memset(u, 0, (size_t)k->n * sizeof *u);
    return refine(k, transposed, rounds, rhs, u);
}

double crm_kkt_condition(crm_kkt *k)
{
    if (k->n == 0) return 1.0;
    if (!k->numeric || !klu_condest(k->col, k->val, k->symbolic, k->numeric, &k->common))
        return HUGE_VAL;
    return k->common.condest <= DBL_MAX ? k->common.condest : HUGE_VAL; /* NaN too */
}
