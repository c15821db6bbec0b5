#include "libsolver/contact/ladder.h"

#include <math.h>

/* Compliance of joint rows when they are eliminated [1]. */
#define JOINT_COMPLIANCE 1e-12
/* Smallest entry to pivot on [1]. */
#define PIVOT_MIN 1e-11
/* Ratios closer than this tie [1]. */
#define TIE 1e-13
/* Entries of the lexicographic comparison closer than this are equal [1]. */
#define LEX_TIE 1e-14

crm_lemke_work crm_lemke_layout(const crm_island *s, crm_arena *arena)
{
    crm_lemke_work k = {.n = s->nc};
    for (int i = 0; i < s->nc; i++) k.n += s->contact[i].mu > 0 ? 3 : 0;
    const size_t n = (size_t)k.n;
    k.tableau = crm_arena_take(arena, n * (2 * n + 2), sizeof(double));
    k.covering = crm_arena_doubles(arena, k.n);
    k.basis = crm_arena_ints(arena, k.n);
    k.cone = crm_arena_ints(arena, s->nc);
    return k;
}

/* Order of the variables: l_n of m contacts, l+ , l- and g of f cones, as in (7). */
typedef struct numbering {
    int m;
    int f;
} numbering;

/* Row i of the tableau, 2 n + 2 wide. */
static double *row_of(const crm_lemke_work *k, int i)
{
    return k->tableau + (size_t)i * (size_t)(2 * k->n + 2);
}

static void no_responses(crm_island *s)
{
    memset(s->response, 0, (size_t)s->nc * sizeof *s->response);
    crm_island_factor(s, 1, JOINT_COMPLIANCE);
}

/* z <- motion that the joints leave of the impulse `row`. */
static void response_of(crm_island *s, const double *row, const crm_contact *c, double *z)
{
    memset(z, 0, 3 * (size_t)(s->nb + s->ng) * sizeof(double));
    crm_add(z, row, c->a, c->b, 1);
    crm_island_solve(s, z);
}

/* Motion of the joints alone: -c_e at the groups. */
static void joint_motion(crm_island *s, double *z)
{
    memset(z, 0, 3 * (size_t)(s->nb + s->ng) * sizeof(double));
    for (int q = 0; q < s->ng; q++) {
        for (int r = 0; r < CRM_GROUP_ROWS; r++) z[3 * (s->nb + q) + r] = -s->group[q].c[r];
    }
    crm_island_solve(s, z);
}

/* Column of -M for an impulse along `row`, at column `to` with sign. */
static void put_column(const crm_island *s, const crm_lemke_work *k, numbering o, const double *z,
                       int to, double sign)
{
    const int n = k->n;
    for (int i = 0; i < o.m; i++) {
        const crm_contact *c = &s->contact[i];
        row_of(k, i)[n + to] = -sign * crm_dot(c->n, c->a, c->b, z);
    }
    for (int q = 0; q < o.f; q++) {
        const crm_contact *c = &s->contact[k->cone[q]];
        const double u = sign * crm_dot(c->t, c->a, c->b, z);
        row_of(k, o.m + q)[n + to] = -u;
        row_of(k, o.m + o.f + q)[n + to] = u;
    }
}

/* E, -E' and mu of (7). */
static void put_cones(const crm_island *s, const crm_lemke_work *k, numbering o)
{
    const int n = k->n;
    for (int q = 0; q < o.f; q++) {
        const int plus = o.m + q;
        const int minus = plus + o.f;
        const int g = minus + o.f;
        row_of(k, plus)[n + g] = -1;
        row_of(k, minus)[n + g] = -1;
        row_of(k, g)[n + k->cone[q]] = -s->contact[k->cone[q]].mu;
        row_of(k, g)[n + plus] = 1;
        row_of(k, g)[n + minus] = 1;
    }
}

/* Tableau [I, -M, -d, q]. */
static void fill(crm_island *s, crm_lemke_work *k, numbering o, double regular,
                 unsigned long long seed)
{
    const int n = k->n;
    double *z = s->step.z;
    memset(k->tableau, 0, (size_t)n * (size_t)(2 * n + 2) * sizeof(double));
    for (int i = 0; i < o.m; i++) {
        response_of(s, s->contact[i].n, &s->contact[i], z);
        put_column(s, k, o, z, i, 1);
    }
    for (int q = 0; q < o.f; q++) {
        const crm_contact *c = &s->contact[k->cone[q]];
        response_of(s, c->t, c, z);
        put_column(s, k, o, z, o.m + q, 1);
        put_column(s, k, o, z, o.m + o.f + q, -1);
    }
    put_cones(s, k, o);
    joint_motion(s, z);
    for (int i = 0; i < n; i++) {
        double *row = row_of(k, i);
        row[i] = 1;
        if (i < o.m + 2 * o.f) row[n + i] -= regular;
        k->covering[i] = seed ? 0.5 + 1.5 * crm_uniform(&seed) : 1;
        row[2 * n] = -k->covering[i];
        k->basis[i] = i;
    }
    for (int i = 0; i < o.m; i++) {
        const crm_contact *c = &s->contact[i];
        row_of(k, i)[2 * n + 1] = crm_dot(c->n, c->a, c->b, z) + c->cn;
    }
    for (int q = 0; q < o.f; q++) {
        const crm_contact *c = &s->contact[k->cone[q]];
        const double u = crm_dot(c->t, c->a, c->b, z) + c->ct;
        row_of(k, o.m + q)[2 * n + 1] = u;
        row_of(k, o.m + o.f + q)[2 * n + 1] = -u;
    }
}

static void pivot(const crm_lemke_work *k, int row, int column)
{
    double *p = row_of(k, row);
    const double scale = 1 / p[column];
    for (int j = 0; j < 2 * k->n + 2; j++) p[j] *= scale;
    for (int i = 0; i < k->n; i++) {
        double *x = row_of(k, i);
        const double f = x[column];
        if (i == row || f == 0) continue; /* exact: nothing to eliminate */
        for (int j = 0; j < 2 * k->n + 2; j++) x[j] -= f * p[j];
    }
}

/* Row i precedes row `best` in the lexicographic ratio test; the covering variable goes first. */
static int precedes(const crm_lemke_work *k, int column, int i, int best)
{
    const int n = k->n;
    const double *x = row_of(k, i);
    const double *y = row_of(k, best);
    const double rx = fmax(x[2 * n + 1], 0) / x[column];
    const double ry = fmax(y[2 * n + 1], 0) / y[column];
    const double tie = TIE * (1 + fabs(ry));
    if (rx < ry - tie) return 1;
    if (rx > ry + tie) return 0;
    if (k->basis[i] == 2 * n) return 1;
    if (k->basis[best] == 2 * n) return 0;
    for (int j = 0; j < n; j++) {
        const double d = x[j] / x[column] - y[j] / y[column];
        if (d < -LEX_TIE) return 1;
        if (d > LEX_TIE) return 0;
    }
    return 0;
}

static int leaving_row(const crm_lemke_work *k, int column)
{
    int best = -1;
    for (int i = 0; i < k->n; i++) {
        if (!(row_of(k, i)[column] > PIVOT_MIN)) continue;
        if (best < 0 || precedes(k, column, i, best)) best = i;
    }
    return best;
}

/* Row where the covering variable enters; -1 when q >= 0 already. */
static int first_row(const crm_lemke_work *k)
{
    int row = -1;
    double least = 0;
    for (int i = 0; i < k->n; i++) {
        const double ratio = row_of(k, i)[2 * k->n + 1] / k->covering[i];
        if (ratio < least) {
            least = ratio;
            row = i;
        }
    }
    return row;
}

/* Complementary pivots until the covering variable leaves.  0: ray, or too many pivots. */
static int run(crm_lemke_work *k, int max_pivots)
{
    const int n = k->n;
    int column = 2 * n;
    int row = first_row(k);
    if (row < 0) return 1;
    for (int i = 0; i < max_pivots; i++) {
        const int leaving = k->basis[row];
        pivot(k, row, column);
        k->basis[row] = column;
        if (leaving == 2 * n) return 1;
        column = leaving < n ? leaving + n : leaving - n;
        row = leaving_row(k, column);
        if (row < 0) return 0;
    }
    return 0;
}

/* Multipliers of the basis, and the motion that follows from them. */
static void read_solution(crm_island *s, const crm_lemke_work *k, numbering o)
{
    const int n = k->n;
    crm_vec_zero(s, s->x);
    for (int i = 0; i < n; i++) {
        const int v = k->basis[i] - n;
        if (v < 0 || v >= n) continue;
        const double value = row_of(k, i)[2 * n + 1];
        if (v < o.m)
            s->x.n[v] = value;
        else if (v < o.m + o.f)
            s->x.t[k->cone[v - o.m]] += value;
        else if (v < o.m + 2 * o.f)
            s->x.t[k->cone[v - o.m - o.f]] -= value;
    }
    crm_island_defect(s, s->x, s->x.z); /* z = 0 on entry: J' l, -c_e */
    crm_island_solve(s, s->x.z);
    crm_modes_at(s);
}

int crm_lemke(crm_island *s, double regular, unsigned long long seed, crm_lemke_work *k)
{
    numbering o = {.m = s->nc, .f = 0};
    for (int i = 0; i < s->nc; i++) {
        if (s->contact[i].mu > 0) k->cone[o.f++] = i;
    }
    no_responses(s);
    fill(s, k, o, regular, seed);
    if (!run(k, 20 * s->nc + 50)) return 0;
    read_solution(s, k, o);
    return 1;
}
