#include "libsolver/lcp/certify.h"

#include "libsolver/lcp/carve.h"
#include "libsolver/lcp/entries.h"
#include "libsolver/lcp/sparse.h"

#include <limits.h>
#include <math.h>

/* Conditions of the certificate hold to this part of its value [1]. */
static const double ERROR = 1e-9;

/* First columns of the unknowns (x, y, z, u, v, w). */
typedef struct layout {
    int y;
    int z;
    int u;
    int v;
    int w;
    int n;
} layout;

static layout layout_of(const carom_lcp_problem *p)
{
    layout o;
    o.y = p->n_x;
    o.z = o.y + p->n_eq;
    o.u = o.z + p->n_ineq;
    o.v = o.u + p->n_x;
    o.w = o.v + p->n_eq;
    o.n = o.w + p->n_ineq;
    return o;
}

/* Equalities: [M A' G' -I 0 0; A 0 0 0 -I 0] = (-q, b). */
static void list_equalities(const carom_lcp_problem *p, crm_entries *e)
{
    const layout o = layout_of(p);
    crm_entries_block(e, &p->M, p->n_x, 0, 0, 0);
    crm_entries_block(e, &p->A, p->n_x, p->n_x, 0, 0);
    crm_entries_block(e, &p->A, p->n_x, 0, o.y, 1);
    crm_entries_block(e, &p->G, p->n_x, 0, o.z, 1);
    crm_entries_diagonal(e, p->n_x + p->n_eq, 0, o.u);
}

/* Inequalities: [G 0 F 0 0 -I; 0 0 -I 0 0 0] <= (m, 0). */
static void list_inequalities(const carom_lcp_problem *p, crm_entries *e)
{
    const layout o = layout_of(p);
    crm_entries_block(e, &p->G, p->n_x, 0, 0, 0);
    crm_entries_block(e, &p->F, p->n_ineq, 0, o.z, 0);
    crm_entries_diagonal(e, p->n_ineq, 0, o.w);
    crm_entries_diagonal(e, p->n_ineq, p->n_ineq, o.z);
}

/* Places of the integer arrays; e_row, e_col: scratch for the longer list. */
typedef struct int_arrays {
    int *m_col;
    int *m_row;
    int *a_col;
    int *a_row;
    int *g_col;
    int *g_row;
    int *e_row;
    int *e_col;
} int_arrays;

static int_arrays place_ints(crm_certifier *c, crm_carver *k)
{
    const size_t n = (size_t)c->p.n_x;
    const size_t na = (size_t)c->n_a;
    const size_t ng = (size_t)c->n_g;
    const size_t longer = na > ng ? na : ng;
    int_arrays t;
    c->map_a = crm_carve(k, na);
    c->map_g = crm_carve(k, ng);
    t.m_col = crm_carve(k, n + 1);
    t.m_row = crm_carve(k, n / 2);
    t.a_col = crm_carve(k, n + 1);
    t.a_row = crm_carve(k, na);
    t.g_col = crm_carve(k, n + 1);
    t.g_row = crm_carve(k, ng);
    t.e_row = crm_carve(k, longer);
    t.e_col = crm_carve(k, longer);
    return t;
}

static void place_reals(crm_certifier *c, crm_carver *k)
{
    const size_t n = (size_t)c->p.n_x;
    const size_t nz = (size_t)c->p.n_ineq;
    const size_t ny = (size_t)c->p.n_eq;
    c->n.M = crm_carve(k, n / 2);
    c->n.A = crm_carve(k, (size_t)c->n_a);
    c->n.G = crm_carve(k, (size_t)c->n_g);
    c->n.q = crm_carve(k, n);
    c->n.b = crm_carve(k, ny);
    c->n.m = crm_carve(k, nz);
    c->at.x = crm_carve(k, n);
    c->at.s = crm_carve(k, nz);
    c->at.z = crm_carve(k, nz);
    c->at.y = crm_carve(k, ny);
    c->check = crm_carve(k, n / 2);
    c->p.M.val = c->n.M;
    c->p.A.val = c->n.A;
    c->p.G.val = c->n.G;
    c->p.q = c->n.q;
    c->p.b = c->n.b;
    c->p.m = c->n.m;
}

/* M = diag(0, I); the patterns of A and G from the lists. */
static void build_pattern(crm_certifier *c, const carom_lcp_problem *pattern, const int_arrays *t)
{
    const int n = c->p.n_x;
    crm_entries e = {t->e_row, t->e_col, 0};
    for (int j = 0; j <= n; j++) t->m_col[j] = j > n / 2 ? j - n / 2 : 0;
    for (int j = 0; j < n / 2; j++) {
        t->m_row[j] = n / 2 + j;
        c->n.M[j] = 1.0;
    }
    list_equalities(pattern, &e);
    crm_entries_compress(&e, n, t->a_col, t->a_row, c->map_a);
    e.n = 0;
    list_inequalities(pattern, &e);
    crm_entries_compress(&e, n, t->g_col, t->g_row, c->map_g);
    c->p.M.col = t->m_col;
    c->p.M.row = t->m_row;
    c->p.A.col = t->a_col;
    c->p.A.row = t->a_row;
    c->p.G.col = t->g_col;
    c->p.G.row = t->g_row;
}

static void set_sizes(crm_certifier *c, const carom_lcp_problem *p)
{
    crm_entries e = {NULL, NULL, 0};
    const layout o = layout_of(p);
    c->p.n_x = o.n;
    c->p.n_ineq = 2 * p->n_ineq;
    c->p.n_eq = p->n_x + p->n_eq;
    list_equalities(p, &e);
    c->n_a = e.n;
    e.n = 0;
    list_inequalities(p, &e);
    c->n_g = e.n;
}

/* Sizes whose doubles do not fit an int are refused before anything is counted in one. */
static int small_enough(const carom_lcp_problem *p)
{
    const double n = (double)p->n_x + p->n_ineq + p->n_eq;
    const double m = crm_sparse_count(&p->M, p->n_x) + 2.0 * crm_sparse_count(&p->A, p->n_x) +
                     2.0 * crm_sparse_count(&p->G, p->n_x) + crm_sparse_count(&p->F, p->n_ineq);
    return 2.0 * m + 8.0 * n < (double)(INT_MAX / 4);
}

carom_status crm_certifier_create(crm_certifier *c, crm_memory *memory,
                                  const carom_lcp_problem *pattern)
{
    crm_carver k = {NULL, sizeof(int), 0};
    if (!small_enough(pattern)) return CAROM_E_CAPACITY;
    set_sizes(c, pattern);
    place_ints(c, &k);
    c->n_ints = k.used;
    c->ints = crm_new(memory, c->n_ints, sizeof(int));
    crm_carver r = {NULL, sizeof(double), 0};
    place_reals(c, &r);
    c->n_reals = r.used;
    c->reals = crm_new(memory, c->n_reals, sizeof(double));
    if (!c->ints || !c->reals) return CAROM_E_MEMORY;
    k = crm_carver_at(c->ints, sizeof(int));
    r = crm_carver_at(c->reals, sizeof(double));
    const int_arrays t = place_ints(c, &k);
    place_reals(c, &r);
    build_pattern(c, pattern, &t);
    return carom_lcp_create(&c->p, NULL, &memory->from, &c->inner);
}

void crm_certifier_destroy(crm_certifier *c, crm_memory *memory)
{
    carom_lcp_destroy(c->inner);
    crm_free(memory, c->reals, c->n_reals, sizeof(double));
    crm_free(memory, c->ints, c->n_ints, sizeof(int));
}

/* val[map[k]] <- the next n numbers (from NULL: -1); returns the rest of the map. */
static const int *fill(double *val, const int *map, int n, const double *from)
{
    for (int k = 0; k < n; k++) val[map[k]] = from ? from[k] : -1.0;
    return map + n;
}

static void load(crm_certifier *c, const carom_lcp_problem *p)
{
    const int n_a = crm_sparse_count(&p->A, p->n_x);
    const int n_g = crm_sparse_count(&p->G, p->n_x);
    const int *map = fill(c->n.A, c->map_a, crm_sparse_count(&p->M, p->n_x), p->M.val);
    map = fill(c->n.A, map, n_a, p->A.val);
    map = fill(c->n.A, map, n_a, p->A.val);
    map = fill(c->n.A, map, n_g, p->G.val);
    fill(c->n.A, map, p->n_x + p->n_eq, NULL);
    map = fill(c->n.G, c->map_g, n_g, p->G.val);
    map = fill(c->n.G, map, crm_sparse_count(&p->F, p->n_ineq), p->F.val);
    fill(c->n.G, map, 2 * p->n_ineq, NULL);
    for (int i = 0; i < p->n_x; i++) c->n.b[i] = -p->q[i];
    for (int i = 0; i < p->n_eq; i++) c->n.b[p->n_x + i] = p->b[i];
    for (int i = 0; i < p->n_ineq; i++) {
        c->n.m[i] = p->m[i];
        c->n.m[p->n_ineq + i] = 0.0;
    }
}

static double dot(int n, const double *a, const double *b)
{
    double sum = 0.0;
    for (int i = 0; i < n; i++) sum += a[i] * b[i];
    return sum;
}

/* Largest violation of the conditions by (u, v, w). */
static double violation(crm_certifier *c, const carom_lcp_problem *p, const double *u,
                        const double *v, const double *w)
{
    double *of_x = c->check;
    double *of_y = of_x + p->n_x;
    double *of_z = of_y + p->n_eq;
    double worst = 0.0;
    for (int i = 0; i < c->p.n_x / 2; i++) c->check[i] = 0.0;
    crm_sparse_add(&p->M, p->n_x, 1.0, u, of_x);
    crm_sparse_add_t(&p->A, p->n_x, 1.0, v, of_x);
    crm_sparse_add_t(&p->G, p->n_x, 1.0, w, of_x);
    crm_sparse_add(&p->A, p->n_x, 1.0, u, of_y);
    crm_sparse_add(&p->G, p->n_x, 1.0, u, of_z);
    crm_sparse_add_t(&p->F, p->n_ineq, 1.0, w, of_z);
    for (int i = 0; i < p->n_x + p->n_eq; i++) worst = fmax(worst, fabs(c->check[i]));
    for (int i = 0; i < p->n_ineq; i++) worst = fmax(worst, fmax(-of_z[i], -w[i]));
    return worst;
}

int crm_certify(crm_certifier *c, const carom_lcp_problem *p)
{
    const layout o = layout_of(p);
    load(c, p);
    if (carom_lcp_solve(c->inner, &c->p, &c->at, NULL) < 0) return 0;
    const double *u = c->at.x + o.u;
    const double *v = c->at.x + o.v;
    const double *w = c->at.x + o.w;
    const double value = -dot(p->n_x, p->q, u) + dot(p->n_eq, p->b, v) + dot(p->n_ineq, p->m, w);
    return value < 0.0 && violation(c, p, u, v, w) <= -ERROR * value;
}
