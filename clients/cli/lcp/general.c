/* A problem file in the four-variable form, docs/math/equations.md (7)-(8), for carom_lcp_solve.
 * z = (l_n, l+, l-, g): n_c normal multipliers, then three blocks of n_f, one entry for each
 * contact with friction.  G = -[J_n; J_f; 0], F = -[[0,0,0], [0,0,E], [mu,-E',0]], y = -l_e. */
#include "carom/lcp.h"
#include "io/memory.h"
#include "io/progress.h"
#include "lcp/file.h"

#include <stdlib.h>
#include <string.h>

/* Entries of a matrix, gathered before they are sorted into columns. */
typedef struct entries {
    int count;
    int n_max;
    int *i, *j;
    double *x;
} entries;

typedef struct columns {
    int *col, *row;
    double *val;
} columns;

static void add(entries *e, int i, int j, double x)
{
    if (e->count == e->n_max) {
        e->n_max = 2 * e->n_max + 64;
        e->i = crm_resize(e->i, (size_t)e->n_max, sizeof *e->i);
        e->j = crm_resize(e->j, (size_t)e->n_max, sizeof *e->j);
        e->x = crm_resize(e->x, (size_t)e->n_max, sizeof *e->x);
    }
    e->i[e->count] = i;
    e->j[e->count] = j;
    e->x[e->count++] = x;
}

/* Sorts by column, keeping the order within one, and frees the entries. */
static columns compress(entries *e, int n_cols)
{
    const size_t n = (size_t)e->count;
    columns c;
    c.col = crm_resize(NULL, (size_t)n_cols + 2, sizeof *c.col);
    c.row = crm_resize(NULL, n, sizeof *c.row);
    c.val = crm_resize(NULL, n, sizeof *c.val);
    memset(c.col, 0, ((size_t)n_cols + 2) * sizeof *c.col);
    for (int k = 0; k < e->count; k++) c.col[e->j[k] + 2]++;
    for (int j = 0; j < n_cols; j++) c.col[j + 2] += c.col[j + 1];
    for (int k = 0; k < e->count; k++) {
        const int p = c.col[e->j[k] + 1]++;
        c.row[p] = e->i[k];
        c.val[p] = e->x[k];
    }
    free(e->i);
    free(e->j);
    free(e->x);
    return c;
}

static void free_columns(columns *c)
{
    free(c->col);
    free(c->row);
    free(c->val);
}

static carom_sparse view(const columns *c)
{
    const carom_sparse s = {c->col, c->row, c->val};
    return s;
}

typedef struct general {
    int n_c, n_f, n_ineq;
    int *friction; /* per contact: its place among those with friction, -1: none */
    columns M, A, G, F;
    double *zero, *m;
} general;

static columns make_g(const crm_lcp *lcp, const general *g)
{
    entries e = {0, 0, NULL, NULL, NULL};
    for (int k = 0; k < lcp->jn.count; k++) add(&e, lcp->jn.i[k], lcp->jn.j[k], -lcp->jn.x[k]);
    for (int k = 0; k < lcp->jt.count; k++) {
        const int f = g->friction[lcp->jt.i[k]];
        if (f < 0) continue;
        add(&e, g->n_c + f, lcp->jt.j[k], -lcp->jt.x[k]);
        add(&e, g->n_c + g->n_f + f, lcp->jt.j[k], lcp->jt.x[k]);
    }
    return compress(&e, 3 * lcp->n_bodies);
}

static columns make_f(const crm_lcp *lcp, const general *g)
{
    entries e = {0, 0, NULL, NULL, NULL};
    for (int k = 0; k < g->n_c; k++) {
        if (g->friction[k] < 0) continue;
        const int plus = g->n_c + g->friction[k];
        const int minus = plus + g->n_f;
        const int gamma = minus + g->n_f;
        add(&e, plus, gamma, -1);
        add(&e, minus, gamma, -1);
        add(&e, gamma, k, -lcp->mu[k]);
        add(&e, gamma, plus, 1);
        add(&e, gamma, minus, 1);
    }
    return compress(&e, g->n_ineq);
}

static general make_general(const crm_lcp *lcp)
{
    general g;
    g.n_c = lcp->n_contacts;
    g.n_f = 0;
    g.friction = crm_resize(NULL, (size_t)g.n_c, sizeof *g.friction);
    for (int k = 0; k < g.n_c; k++) g.friction[k] = lcp->mu[k] > 0 ? g.n_f++ : -1;
    g.n_ineq = g.n_c + 3 * g.n_f;
    entries mass = {0, 0, NULL, NULL, NULL};
    entries joints = {0, 0, NULL, NULL, NULL};
    for (int k = 0; k < 3 * lcp->n_bodies; k++) add(&mass, k, k, lcp->mass[k]);
    for (int k = 0; k < lcp->je.count; k++) add(&joints, lcp->je.i[k], lcp->je.j[k], lcp->je.x[k]);
    g.M = compress(&mass, 3 * lcp->n_bodies);
    g.A = compress(&joints, 3 * lcp->n_bodies);
    g.G = make_g(lcp, &g);
    g.F = make_f(lcp, &g);
    const size_t n = (size_t)g.n_ineq + (size_t)lcp->n_joint_rows;
    g.m = crm_resize(NULL, n, sizeof *g.m);
    memset(g.m, 0, n * sizeof *g.m);
    memcpy(g.m, lcp->c, (size_t)g.n_c * sizeof *g.m);
    g.zero = g.m + g.n_ineq;
    return g;
}

static void free_general(general *g)
{
    free_columns(&g->M);
    free_columns(&g->A);
    free_columns(&g->G);
    free_columns(&g->F);
    free(g->friction);
    free(g->m);
}

static void take_multipliers(const general *g, const carom_lcp_point *at, int n_joint_rows,
                             carom_contact_solution *x)
{
    for (int k = 0; k < g->n_c; k++) {
        const int f = g->friction[k];
        x->ln[k] = at->z[k];
        x->lt[k] = f < 0 ? 0 : at->z[g->n_c + f] - at->z[g->n_c + g->n_f + f];
    }
    for (int k = 0; k < n_joint_rows; k++) x->le[k] = -at->y[k];
}

static void solve(const crm_lcp *lcp, const general *g, carom_contact_solution *x,
                  carom_contact_stats *stats, double *seconds)
{
    const carom_lcp_problem p = {3 * lcp->n_bodies, g->n_ineq,   lcp->n_joint_rows, view(&g->M),
                                 view(&g->A),       view(&g->G), view(&g->F),       lcp->q,
                                 g->zero,           g->m};
    const size_t n = 2 * (size_t)g->n_ineq + (size_t)lcp->n_joint_rows;
    double *room = crm_resize(NULL, n, sizeof *room);
    memset(room, 0, n * sizeof *room);
    carom_lcp_point at = {x->v, room, room + g->n_ineq, room + 2 * g->n_ineq};
    carom_lcp_stats s;
    carom_lcp *solver = NULL;
    memset(&s, 0, sizeof s);
    const double start = crm_clock();
    stats->status = carom_lcp_create(&p, NULL, NULL, &solver);
    if (stats->status >= 0) stats->status = carom_lcp_solve(solver, &p, &at, &s);
    *seconds = crm_clock() - start;
    stats->residual = s.residual;
    stats->factorizations = s.factorizations + s.refactorizations;
    take_multipliers(g, &at, lcp->n_joint_rows, x);
    carom_lcp_destroy(solver);
    free(room);
}

void crm_lcp_general(const crm_lcp *lcp, carom_contact_solution *x, carom_contact_stats *stats,
                     double *seconds)
{
    general g = make_general(lcp);
    solve(lcp, &g, x, stats, seconds);
    free_general(&g);
}
