#include "libsolver/lcp/carve.h"
#include "libsolver/lcp/solver.h"
#include "libsolver/lcp/sparse.h"

carom_lcp_settings carom_lcp_defaults(void)
{
    const carom_lcp_settings s = {1e-10, 1e-6, 60, 8, 12, 1, 0};
    return s;
}

carom_lcp_settings carom_lcp_plain(void)
{
    carom_lcp_settings s = carom_lcp_defaults();
    s.max_starts = 1;
    s.polish_rounds = 0;
    s.equilibrate = 0;
    return s;
}

static int settings_valid(const carom_lcp_settings *s)
{
    return s->accept > 0.0 && s->accept <= s->inexact && s->inexact < 1.0 &&
           s->max_iterations >= 1 && s->max_starts >= 1 && s->max_starts <= crm_interior_starts() &&
           s->polish_rounds >= 0 && (s->equilibrate == 0 || s->equilibrate == 1) &&
           (s->certify == 0 || s->certify == 1);
}

static int pattern_valid(const carom_lcp_problem *p)
{
    return p->n_x >= 0 && p->n_ineq >= 0 && p->n_eq >= 0 &&
           crm_sparse_valid(&p->M, p->n_x, p->n_x) && crm_sparse_valid(&p->A, p->n_eq, p->n_x) &&
           crm_sparse_valid(&p->G, p->n_ineq, p->n_x) &&
           crm_sparse_valid(&p->F, p->n_ineq, p->n_ineq);
}

static size_t count(const carom_sparse *a, int n_cols)
{
    return (size_t)crm_sparse_count(a, n_cols);
}

/* Places the numbers of the scaled problem. */
static void place_numbers(carom_lcp *l, const carom_lcp_problem *p, crm_carver *c)
{
    l->number.M = crm_carve(c, count(&p->M, p->n_x));
    l->number.A = crm_carve(c, count(&p->A, p->n_x));
    l->number.G = crm_carve(c, count(&p->G, p->n_x));
    l->number.F = crm_carve(c, count(&p->F, p->n_ineq));
    l->number.q = crm_carve(c, (size_t)p->n_x);
    l->number.b = crm_carve(c, (size_t)p->n_eq);
    l->number.m = crm_carve(c, (size_t)p->n_ineq);
    l->scaled.M.val = l->number.M;
    l->scaled.A.val = l->number.A;
    l->scaled.G.val = l->number.G;
    l->scaled.F.val = l->number.F;
    l->scaled.q = l->number.q;
    l->scaled.b = l->number.b;
    l->scaled.m = l->number.m;
}

static void place_vectors(carom_lcp *l, crm_carver *c)
{
    const size_t nx = (size_t)l->scaled.n_x;
    const size_t nz = (size_t)l->scaled.n_ineq;
    const size_t ny = (size_t)l->scaled.n_eq;
    const size_t n = nx + nz + ny;
    double **const of_x[] = {&l->scale.x, &l->plain.x, &l->work.rx, &l->work.abs_x, &l->work.row_x};
    double **const of_z[] = {
        &l->scale.z, &l->plain.z, &l->plain.s, &l->work.rz, &l->work.row_z, &l->work.weigh_z, &l->w,
        &l->v,       &l->ds,      &l->target,  &l->now.s,   &l->best.s,     &l->lead.s};
    double **const of_y[] = {&l->scale.y, &l->plain.y, &l->work.ry, &l->work.row_y};
    double **const of_all[] = {&l->now.u, &l->best.u, &l->lead.u, &l->rhs, &l->res, &l->du};
    for (size_t i = 0; i < sizeof of_x / sizeof *of_x; i++) *of_x[i] = crm_carve(c, nx);
    for (size_t i = 0; i < sizeof of_z / sizeof *of_z; i++) *of_z[i] = crm_carve(c, nz);
    for (size_t i = 0; i < sizeof of_y / sizeof *of_y; i++) *of_y[i] = crm_carve(c, ny);
    for (size_t i = 0; i < sizeof of_all / sizeof *of_all; i++) *of_all[i] = crm_carve(c, n);
}

static carom_status place_reals(carom_lcp *l, const carom_lcp_problem *p)
{
    crm_carver c = {NULL, sizeof(double), 0};
    place_numbers(l, p, &c);
    place_vectors(l, &c);
    l->n_reals = c.used;
    l->reals = crm_new(&l->memory, l->n_reals, sizeof(double));
    if (!l->reals) return CAROM_E_MEMORY;
    c = crm_carver_at(l->reals, sizeof(double));
    place_numbers(l, p, &c);
    place_vectors(l, &c);
    return CAROM_OK;
}

static void copy_pattern(const carom_sparse *from, int n_cols, crm_carver *c, carom_sparse *to)
{
    if (!from->col) return;
    const size_t n = count(from, n_cols);
    int *col = crm_carve(c, (size_t)n_cols + 1);
    int *row = crm_carve(c, n);
    if (!c->base) return;
    memcpy(col, from->col, ((size_t)n_cols + 1) * sizeof *col);
    if (n) memcpy(row, from->row, n * sizeof *row);
    to->col = col;
    to->row = row;
}

static void copy_patterns(carom_lcp *l, const carom_lcp_problem *p, crm_carver *c)
{
    copy_pattern(&p->M, p->n_x, c, &l->scaled.M);
    copy_pattern(&p->A, p->n_x, c, &l->scaled.A);
    copy_pattern(&p->G, p->n_x, c, &l->scaled.G);
    copy_pattern(&p->F, p->n_ineq, c, &l->scaled.F);
}

static carom_status place_ints(carom_lcp *l, const carom_lcp_problem *p)
{
    crm_carver c = {NULL, sizeof(int), 0};
    copy_patterns(l, p, &c);
    l->n_ints = c.used;
    l->ints = crm_new(&l->memory, l->n_ints, sizeof(int));
    if (!l->ints) return CAROM_E_MEMORY;
    c = crm_carver_at(l->ints, sizeof(int));
    copy_patterns(l, p, &c);
    return CAROM_OK;
}

static carom_status build(carom_lcp *l, const carom_lcp_problem *pattern)
{
    l->scaled.n_x = pattern->n_x;
    l->scaled.n_ineq = pattern->n_ineq;
    l->scaled.n_eq = pattern->n_eq;
    carom_status status = crm_kkt_create(&l->kkt, &l->memory, pattern);
    if (status == CAROM_OK) status = place_ints(l, pattern);
    if (status == CAROM_OK) status = place_reals(l, pattern);
    if (status == CAROM_OK && l->settings.certify)
        status = crm_certifier_create(&l->certifier, &l->memory, pattern);
    return status;
}

carom_status carom_lcp_create(const carom_lcp_problem *pattern, const carom_lcp_settings *settings,
                              const carom_allocator *allocator, carom_lcp **out)
{
    const carom_lcp_settings chosen = settings ? *settings : carom_lcp_defaults();
    if (!pattern || !out || !settings_valid(&chosen) || !pattern_valid(pattern))
        return CAROM_E_ARGUMENT;
    crm_memory memory = crm_memory_from(allocator);
    carom_lcp *l = crm_new(&memory, 1, sizeof *l);
    if (!l) return CAROM_E_MEMORY;
    l->memory = memory;
    l->settings = chosen;
    const carom_status status = build(l, pattern);
    if (status < 0) {
        carom_lcp_destroy(l);
        return status;
    }
    *out = l;
    return CAROM_OK;
}

void carom_lcp_destroy(carom_lcp *l)
{
    if (!l) return;
    crm_memory memory = l->memory;
    crm_certifier_destroy(&l->certifier, &memory);
    crm_kkt_destroy(&l->kkt, &memory);
    crm_free(&memory, l->reals, l->n_reals, sizeof(double));
    crm_free(&memory, l->ints, l->n_ints, sizeof(int));
    crm_free(&memory, l, 1, sizeof *l);
}

void carom_lcp_memory(const carom_lcp *l, size_t *bytes, long *calls)
{
    size_t inner_bytes = 0;
    long inner_calls = 0;
    if (l->certifier.inner) carom_lcp_memory(l->certifier.inner, &inner_bytes, &inner_calls);
    if (bytes) *bytes = l->memory.live + inner_bytes;
    if (calls) *calls = l->memory.n_calls + inner_calls;
}
