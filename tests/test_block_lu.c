/* Order, pattern and factors of the block LU against a dense matrix. */
#include "libsolver/contact/block/block_lu.h"

#include "near.h"
#include "rng.h"

#include <stdlib.h>
#include <string.h>

/* A graph of bodies, contacts (pairs) and joint groups, and the system built on it. */
typedef struct fixture {
    crm_memory memory;
    crm_graph graph;
    crm_block_pattern pattern;
    int n_bodies;
    int n_contacts;
    int n_rows;
    int contact_body[400];
    int joint_body[400];
    double inv_mass[300];
} fixture;

static void add_contact(fixture *f, int a, int b)
{
    f->contact_body[2 * f->n_contacts] = a;
    f->contact_body[2 * f->n_contacts++ + 1] = b;
}

static void add_hinge(fixture *f, int a, int b)
{
    for (int i = 0; i < 2; i++) {
        f->joint_body[2 * f->n_rows] = a;
        f->joint_body[2 * f->n_rows++ + 1] = b;
    }
}

static void begin(fixture *f, int n_bodies)
{
    memset(f, 0, sizeof *f);
    f->memory = crm_memory_from(NULL);
    f->graph.n_bodies = -1;
    f->n_bodies = n_bodies;
    for (int i = 0; i < 3 * n_bodies; i++) f->inv_mass[i] = 1;
}

static void analyze(fixture *f)
{
    const carom_contact_problem p = {.n_bodies = f->n_bodies,
                                     .n_contacts = f->n_contacts,
                                     .n_joint_rows = f->n_rows,
                                     .inv_mass = f->inv_mass,
                                     .contact_body = f->contact_body,
                                     .joint_body = f->joint_body};
    int same;
    assert_int_equal(crm_graph_update(&f->memory, &f->graph, &p, &same), CAROM_OK);
    assert_int_equal(same, 0);
    assert_int_equal(crm_block_analyze(&f->memory, &f->pattern, &f->graph), CAROM_OK);
    assert_int_equal(crm_graph_update(&f->memory, &f->graph, &p, &same), CAROM_OK);
    assert_int_equal(same, 1);
}

static void end(fixture *f)
{
    crm_graph_free(&f->memory, &f->graph);
    crm_block_pattern_free(&f->memory, &f->pattern);
    assert_int_equal(f->memory.live, 0);
}

/* The island's matrix, dense and in blocks. */
typedef struct values {
    int n;
    int n_nodes;
    double *dense; /* (3 n)^2, by block ids */
    crm_block_lu lu;
    double *memory;
    int *ints;
} values;

static values room_for(const fixture *f, int island)
{
    const crm_graph *g = &f->graph;
    const crm_block_pattern *s = &f->pattern;
    const int first = g->node_ptr[island] + g->group_ptr[island];
    values m;
    m.n_nodes = g->node_ptr[island + 1] - g->node_ptr[island];
    m.n = g->node_ptr[island + 1] + g->group_ptr[island + 1] - first;
    const size_t n = (size_t)m.n;
    const size_t nz = (size_t)s->lp[s->n];
    m.dense = calloc(9 * n * n + 1, sizeof(double));
    m.memory = calloc(18 * nz + 12 * n + 1, sizeof(double));
    m.ints = calloc(7 * n + 1, sizeof(int));
    assert_true(m.dense && m.memory && m.ints);
    m.lu = (crm_block_lu){.n = m.n,
                          .place = s->place + first,
                          .lp = s->lp + first,
                          .li = s->li,
                          .l = m.memory,
                          .u = m.memory + 9 * nz,
                          .d = m.memory + 18 * nz,
                          .x = m.memory + 18 * nz + 9 * n,
                          .pivot = m.ints,
                          .work = m.ints + 2 * n};
    return m;
}

static void free_values(values *m)
{
    free(m->dense);
    free(m->memory);
    free(m->ints);
}

/* Adds x to entry (r, c) of block (i, j); target as in the pattern, or the diagonal. */
static void add_entry(values *m, int i, int j, int target, int r, int c, double x)
{
    m->dense[(size_t)(3 * i + r) * (size_t)(3 * m->n) + (size_t)(3 * j + c)] += x;
    double *block;
    if (i == j)
        block = m->lu.d + 9 * m->lu.place[i];
    else
        block = target >= 0 ? m->lu.l + 9 * target : m->lu.u + 9 * (-1 - target);
    block[3 * r + c] += x;
}

/* I + sum of J' W J with rank-two unsymmetric W of size `stiff`, and joint rows. */
static void fill(const fixture *f, int island, values *m, rng *r, double stiff, double delta)
{
    const crm_graph *g = &f->graph;
    for (int v = 0; v < m->n_nodes; v++) {
        for (int i = 0; i < 3; i++) add_entry(m, v, v, 0, i, i, 1);
    }
    for (int k = g->contact_ptr[island]; k < g->contact_ptr[island + 1]; k++) {
        const int *v = g->contact_node + 2 * k;
        const int target = f->pattern.contact_target[k];
        double row[2][6];
        for (int i = 0; i < 12; i++) row[i / 6][i % 6] = rng_uniform(r, -1, 1);
        const double tn = 0.5 * rng_uniform(r, -1, 1);
        for (int q = 0; q < 36; q++) {
            const int i = q / 6;
            const int j = q % 6;
            if (v[i / 3] < 0 || v[j / 3] < 0) continue;
            const double x =
                stiff * (row[0][i] * row[0][j] + row[1][i] * (row[1][j] + tn * row[0][j]));
            const int to = i / 3 < j / 3 ? target : -1 - target;
            add_entry(m, v[i / 3], v[j / 3], to, i % 3, j % 3, x);
        }
    }
    for (int q = g->group_ptr[island]; q < g->group_ptr[island + 1]; q++) {
        const int id = m->n_nodes + q - g->group_ptr[island];
        for (int i = 0; i < 3; i++) add_entry(m, id, id, 0, i, i, -delta);
        for (int e = 0; e < 2; e++) {
            const int v = g->group_node[2 * q + e];
            const int target = f->pattern.group_target[2 * q + e];
            for (int i = 0; v >= 0 && i < 3 * g->group_size[q]; i++) {
                const double x = rng_uniform(r, -1, 1);
                add_entry(m, id, v, target, i / 3, i % 3, x);
                add_entry(m, v, id, -1 - target, i % 3, i / 3, x);
            }
        }
    }
}

/* max |A x - b| / (|A| |x| + |b|), A or A'. */
static double backward_error(const values *m, int transposed, const double *x, const double *b)
{
    const int n = 3 * m->n;
    double worst = 0;
    for (int i = 0; i < n; i++) {
        double s = -b[i];
        double size = fabs(b[i]);
        for (int j = 0; j < n; j++) {
            const double a = m->dense[transposed ? j * n + i : i * n + j] * x[j];
            s += a;
            size += fabs(a);
        }
        worst = fmax(worst, fabs(s) / (size + 1e-300));
    }
    return worst;
}

/* Factors and solves with A and A'; returns the larger backward error. */
static double check_solves(values *m, rng *r)
{
    const int n = 3 * m->n;
    double b[600];
    double x[600];
    double worst = 0;
    assert_true(n <= 600);
    assert_int_equal(crm_block_factor(&m->lu), 0);
    for (int transposed = 0; transposed < 2; transposed++) {
        for (int i = 0; i < n; i++) x[i] = b[i] = rng_uniform(r, -1, 1);
        if (transposed)
            crm_block_solve_transposed(&m->lu, x);
        else
            crm_block_solve(&m->lu, x);
        worst = fmax(worst, backward_error(m, transposed, x, b));
    }
    return worst;
}

/* Every group follows a body matched to it directly, or stands at the end. */
static void check_order(const fixture *f, int island, int n_last)
{
    const crm_graph *g = &f->graph;
    const int first = g->node_ptr[island] + g->group_ptr[island];
    const int n_nodes = g->node_ptr[island + 1] - g->node_ptr[island];
    const int n_groups = g->group_ptr[island + 1] - g->group_ptr[island];
    const int *place = f->pattern.place + first;
    int used[200] = {0};
    int last = 0;
    for (int q = 0; q < n_groups; q++) {
        const int at = place[n_nodes + q];
        const int *v = g->group_node + 2 * (g->group_ptr[island] + q);
        int matched = 0;
        for (int e = 0; e < 2; e++) matched |= v[e] >= 0 && place[v[e]] == at - 1;
        if (!matched) assert_true(at >= n_nodes + n_groups - n_last);
        last += !matched;
        assert_int_equal(used[at]++, 0);
    }
    assert_int_equal(last, n_last);
    for (int v = 0; v < n_nodes; v++) assert_int_equal(used[place[v]]++, 0);
}

/* Rows of each column ascend, below the diagonal, and hold the matrix. */
static void check_pattern(const fixture *f)
{
    const crm_block_pattern *s = &f->pattern;
    const crm_graph *g = &f->graph;
    for (int i = 0; i < g->n_islands; i++) {
        const int first = g->node_ptr[i] + g->group_ptr[i];
        const int n = g->node_ptr[i + 1] + g->group_ptr[i + 1] - first;
        for (int j = 0; j < n; j++) {
            int before = j;
            for (int p = s->lp[first + j]; p < s->lp[first + j + 1]; p++) {
                assert_true(s->li[p] > before && s->li[p] < n);
                before = s->li[p];
            }
        }
    }
}

static void random_graphs_solve(void **state)
{
    (void)state;
    for (uint64_t seed = 0; seed < 200; seed++) {
        rng r = rng_from(seed);
        fixture f;
        begin(&f, 2 + rng_int(&r, 20));
        const int n = f.n_bodies;
        for (int i = 0; i < 2 * n; i++) {
            const int a = rng_int(&r, n);
            const int b = rng_int(&r, n + 2) - 2;
            if (a != b) add_contact(&f, a, b < 0 ? -1 : b);
        }
        /* A forest of hinges, so that no row is redundant. */
        for (int b = 1; b < n; b++) {
            if (rng_unit(&r) < 0.5) add_hinge(&f, rng_int(&r, b), b);
        }
        analyze(&f);
        check_pattern(&f);
        for (int i = 0; i < f.graph.n_islands; i++) {
            values m = room_for(&f, i);
            check_order(&f, i, 0);
            fill(&f, i, &m, &r, 10, 1e-12);
            /* Pivoting inside 3x3 blocks alone: growth of 1e3 or so at this stiffness. */
            assert_at_most("backward error", check_solves(&m, &r), 1e-12);
            free_values(&m);
        }
        end(&f);
    }
}

/* Late in the interior point, responses of 1e10 meet the unit mass: panels in point-LU form keep
 * the error of each row relative to the row. */
static void stiff_responses_solve(void **state)
{
    (void)state;
    for (uint64_t seed = 0; seed < 50; seed++) {
        rng r = rng_from(1000 + seed);
        fixture f;
        begin(&f, 12);
        for (int i = 0; i < 12; i++) {
            add_contact(&f, i, i - 1);
            add_contact(&f, i, i - 1);
        }
        analyze(&f);
        values m = room_for(&f, 0);
        fill(&f, 0, &m, &r, 1e10, 1e-12);
        assert_at_most("backward error", check_solves(&m, &r), 1e-11);
        free_values(&m);
        end(&f);
    }
}

/* Chains, trees: all groups matched.  A ring hung on the world: one loop-closing group, last. */
static void joints_are_matched(void **state)
{
    (void)state;
    fixture f;
    begin(&f, 31);
    for (int b = 1; b < 31; b++) add_hinge(&f, (b - 1) / 2, b);
    add_hinge(&f, -1, 0);
    analyze(&f);
    check_order(&f, 0, 0);
    end(&f);
    rng r = rng_from(1);
    begin(&f, 12);
    for (int b = 0; b < 12; b++) add_hinge(&f, b, (b + 1) % 12);
    add_hinge(&f, 0, -1);
    analyze(&f);
    check_order(&f, 0, 1);
    values m = room_for(&f, 0);
    fill(&f, 0, &m, &r, 0, 1e-12);
    assert_at_most("ring", check_solves(&m, &r), 1e-12);
    free_values(&m);
    end(&f);
}

/* A body that cannot turn has no room for every pair of rows: its groups wait. */
static void locked_bodies_are_not_matched(void **state)
{
    (void)state;
    fixture f;
    begin(&f, 3);
    f.inv_mass[0] = 0;
    add_hinge(&f, -1, 0);
    add_hinge(&f, 0, 1);
    add_hinge(&f, 1, 2);
    analyze(&f);
    check_order(&f, 0, 1);
    end(&f);
}

/* Bodies that touch nothing and bodies with W = 0 are left out; islands are separate. */
static void islands_are_found(void **state)
{
    (void)state;
    fixture f;
    begin(&f, 8);
    for (int i = 9; i < 12; i++) f.inv_mass[i] = 0; /* body 3: does not join 2 and 4 */
    add_contact(&f, 2, 3);
    add_contact(&f, 4, 3);
    add_contact(&f, 0, 6);
    add_contact(&f, 3, -1); /* prescribed on both sides */
    add_hinge(&f, 6, 1);
    analyze(&f);
    const crm_graph *g = &f.graph;
    assert_int_equal(g->n_islands, 3);
    assert_int_equal(g->n_nodes, 5);
    assert_int_equal(g->n_live, 3);
    assert_int_equal(g->n_groups, 1);
    assert_int_equal(g->n_fixed, 1);
    const int bodies[] = {0, 1, 6, 2, 4};
    for (int i = 0; i < 5; i++) assert_int_equal(g->body_of[i], bodies[i]);
    assert_int_equal(g->node_of[5], -1);
    assert_int_equal(g->node_of[7], -1);
    assert_int_equal(g->node_of[3], -1);
    end(&f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(random_graphs_solve), cmocka_unit_test(stiff_responses_solve),
        cmocka_unit_test(joints_are_matched),  cmocka_unit_test(locked_bodies_are_not_matched),
        cmocka_unit_test(islands_are_found),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
