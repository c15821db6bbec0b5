/* The contact solver: time, instructions, factorizations; block LU beside KLU on the same matrix.
 * Usage: bench_contact [csv | resting ROWS N]   (the last for callgrind: N solves at rest after one
 * cold one; the difference of two runs is what N cost) */
#include "carom/contact.h"
#include "clock.h"
#include "libsolver/contact/ladder/ladder.h"
#include "libsolver/contact/system.h"
#include "rng.h"
#include "scenes.h"

#include <klu.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct bench {
    contact_case c;
    crm_memory memory;
    crm_graph graph;
    crm_block_pattern pattern;
    crm_system system;
    crm_island island; /* the first */
    int n;             /* unknowns of the scalar matrix */
    int *ap;
    int *ai;
    double *ax;
    klu_common common;
    klu_symbolic *symbolic;
    klu_numeric *numeric;
    carom_contact_solver *solver;
    carom_contact_bars bars;
} bench;

/* Responses as in the middle of the interior point. */
static void set_responses(bench *b)
{
    rng r = rng_from(9);
    for (int k = 0; k < b->island.nc; k++) {
        const double n = exp(rng_uniform(&r, -5, 10));
        const double t = n * rng_unit(&r);
        b->island.response[k] = (crm_response){n, 0.2 * n * rng_uniform(&r, -1, 1), t};
    }
}

static void prepare(bench *b)
{
    int same;
    b->memory = crm_memory_from(NULL);
    memset(&b->graph, 0, sizeof b->graph);
    memset(&b->pattern, 0, sizeof b->pattern);
    memset(&b->system, 0, sizeof b->system);
    b->graph.n_bodies = -1;
    if (crm_graph_update(&b->memory, &b->graph, &b->c.p, &same) < 0 ||
        crm_block_analyze(&b->memory, &b->pattern, &b->graph) < 0 ||
        crm_system_reserve(&b->memory, &b->system, &b->graph, &b->pattern) < 0 ||
        carom_contact_create(NULL, NULL, &b->solver) < 0)
        exit(1);
    crm_system_gather(&b->system, &b->graph, &b->c.p, 0);
    b->island = *crm_system_begin(&b->system, 0);
    set_responses(b);
}

/* Scalar compressed columns of the assembled, unfactored blocks; padded rows are left out. */
static int real_rows(const bench *b, int block)
{
    return block < b->island.nb ? 3 : b->graph.group_size[block - b->island.nb];
}

static const double *block_at(const bench *b, int pi, int pj)
{
    const crm_block_lu *f = &b->island.lu;
    if (pi == pj) return f->d + 9 * pi;
    const int column = pi < pj ? pi : pj;
    const int row = pi < pj ? pj : pi;
    for (int p = f->lp[column]; p < f->lp[column + 1]; p++) {
        if (f->li[p] == row) return (pi > pj ? f->l : f->u) + 9 * (size_t)p;
    }
    return NULL;
}

/* Neighbors of a block: pairs that a contact or a joint couples. */
static int coupled(const bench *b, int *list, int block, int *mark)
{
    int n = 0;
    const crm_island *s = &b->island;
    list[n++] = block;
    mark[block] = block;
    for (int k = 0; k < s->nc; k++) {
        const int v[2] = {s->contact[k].a, s->contact[k].b};
        for (int e = 0; e < 2; e++) {
            if (v[e] != block || v[1 - e] < 0 || mark[v[1 - e]] == block) continue;
            mark[v[1 - e]] = block;
            list[n++] = v[1 - e];
        }
    }
    for (int q = 0; q < s->ng; q++) {
        const int id = s->nb + q;
        const int v[2] = {s->group[q].a, s->group[q].b};
        for (int e = 0; e < 2; e++) {
            if (v[e] >= 0 && v[e] == block) list[n++] = id;
            if (v[e] >= 0 && id == block) list[n++] = v[e];
        }
    }
    return n;
}

static int compare_ints(const void *a, const void *b)
{
    return *(const int *)a - *(const int *)b;
}

static void make_scalar(bench *b)
{
    const crm_island *s = &b->island;
    const int n = s->nb + s->ng;
    int *start = calloc((size_t)n + 1, sizeof(int));
    int *mark = malloc(((size_t)n + 1) * sizeof(int));
    int *list = malloc(((size_t)n + (size_t)s->nc + 4 * (size_t)s->ng + 1) * sizeof(int));
    const size_t cap = 9 * ((size_t)n + 2 * (size_t)s->nc + 4 * (size_t)s->ng);
    for (int i = 0; i < n; i++) {
        start[i + 1] = start[i] + real_rows(b, i);
        mark[i] = -1;
    }
    b->n = start[n];
    b->ap = malloc(((size_t)b->n + 1) * sizeof(int));
    b->ai = malloc(cap * sizeof(int));
    b->ax = malloc(cap * sizeof(double));
    b->ap[0] = 0;
    int z = 0;
    for (int j = 0; j < n; j++) {
        const int m = coupled(b, list, j, mark);
        qsort(list, (size_t)m, sizeof(int), compare_ints);
        for (int c = 0; c < real_rows(b, j); c++) {
            for (int q = 0; q < m; q++) {
                const double *block = block_at(b, s->lu.place[list[q]], s->lu.place[j]);
                for (int r = 0; r < real_rows(b, list[q]); r++) {
                    b->ai[z] = start[list[q]] + r;
                    b->ax[z++] = block[3 * r + c];
                }
            }
            b->ap[start[j] + c + 1] = z;
        }
    }
    free(start);
    free(mark);
    free(list);
}

static void run_assemble(void *user)
{
    bench *b = user;
    crm_island_assemble(&b->island, 1, 1e-12);
}

static void run_factor(void *user)
{
    bench *b = user;
    b->island.key->valid = 0; /* the same matrix would not be factored again */
    crm_island_factor(&b->island, 1, 1e-12);
}

static void run_klu(void *user)
{
    bench *b = user;
    klu_refactor(b->ap, b->ai, b->ax, b->symbolic, b->numeric, &b->common);
}

static void run_cold(void *user)
{
    bench *b = user;
    carom_contact_solve(b->solver, &b->c.p, CAROM_GUESS_NONE, &b->c.x, NULL);
}

static void run_warm(void *user)
{
    bench *b = user;
    carom_contact_solve(b->solver, &b->c.p, CAROM_GUESS_IMPULSES, &b->c.x, NULL);
}

static void run_adjoint(void *user)
{
    bench *b = user;
    carom_contact_adjoint(b->solver, &b->c.p, &b->c.x, b->c.u, &b->bars);
}

static void run_case(const char *name, contact_case c, int csv)
{
    bench b;
    memset(&b, 0, sizeof b);
    b.c = c;
    prepare(&b);
    const double assemble = least_time(run_assemble, &b);
    make_scalar(&b);
    klu_defaults(&b.common);
    b.symbolic = klu_analyze(b.n, b.ap, b.ai, &b.common);
    b.numeric = klu_factor(b.ap, b.ai, b.ax, b.symbolic, &b.common);
    const double factor = least_time(run_factor, &b) - assemble;
    const double klu = b.numeric ? least_time(run_klu, &b) : NAN;
    carom_contact_stats cold;
    carom_contact_stats warm;
    const carom_status status =
        carom_contact_solve(b.solver, &b.c.p, CAROM_GUESS_NONE, &b.c.x, &cold);
    double *bars = calloc(3 * (size_t)c.p.n_bodies, sizeof(double));
    b.bars.u = bars;
    for (int i = 0; status == CAROM_OK && i < 3; i++) run_warm(&b); /* modes settle */
    warm = cold;
    if (status == CAROM_OK)
        carom_contact_solve(b.solver, &b.c.p, CAROM_GUESS_IMPULSES, &b.c.x, &warm);
    const double t_warm = status == CAROM_OK ? least_time(run_warm, &b) : NAN;
    const double t_adjoint = least_time(run_adjoint, &b);
    const double t_cold = status == CAROM_OK ? least_time(run_cold, &b) : NAN;
    const double rows = c.p.n_contacts + 0.5 * c.p.n_joint_rows;
    const char *format =
        csv ? "%s,%d,%d,%s,%.1e,%.4g,%.4g,%.4g,%.3g,%.3g,%d,%.4g,%d,%.4g,%.4g,%.1f\n"
            : "%-8s %6d %6d %-10s %8.1e %9.4g %9.4g %9.4g %6.3g %6.3g %4d %9.4g %4d %9.4g %9.4g "
              "%8.1f\n";
    printf(format, name, c.p.n_bodies, c.p.n_contacts, status == CAROM_OK ? "solved" : "NOT",
           warm.residual, 1e6 * factor, 1e6 * klu, 1e6 * assemble, klu / factor, assemble / factor,
           cold.factorizations, 1e6 * t_cold, warm.factorizations, 1e6 * t_warm, 1e6 * t_adjoint,
           1e9 * t_warm / rows);
    fflush(stdout);
    klu_free_numeric(&b.numeric, &b.common);
    klu_free_symbolic(&b.symbolic, &b.common);
    free(b.ap);
    free(b.ai);
    free(b.ax);
    free(bars);
    crm_graph_free(&b.memory, &b.graph);
    crm_block_pattern_free(&b.memory, &b.pattern);
    crm_system_free(&b.memory, &b.system);
    carom_contact_destroy(b.solver);
    contact_case_free(&b.c);
}

/* One cold solve, then n from its solution. */
static int run_resting(int rows, int n)
{
    contact_case c = scene_pyramid(rows);
    carom_contact_solver *s;
    if (carom_contact_create(NULL, NULL, &s) < 0) return 1;
    carom_contact_stats st = {0};
    carom_contact_solve(s, &c.p, CAROM_GUESS_NONE, &c.x, &st);
    for (int i = 0; i < n; i++) carom_contact_solve(s, &c.p, CAROM_GUESS_IMPULSES, &c.x, &st);
    printf("%d contacts, %d factorizations\n", c.p.n_contacts, st.factorizations);
    carom_contact_destroy(s);
    contact_case_free(&c);
    return 0;
}

int main(int argc, char **argv)
{
    if (argc > 3 && !strcmp(argv[1], "resting")) return run_resting(atoi(argv[2]), atoi(argv[3]));
    const int csv = argc > 1 && !strcmp(argv[1], "csv");
    printf(csv ? "scene,bodies,contacts,status,residual,factor_us,klu_us,assemble_us,klu_ratio,"
                 "assemble_share,cold_factorizations,cold_us,warm_factorizations,warm_us,"
                 "adjoint_us,warm_ns_per_contact\n"
               : "scene    bodies contacts           residual factor/us    klu/us  assem/us "
                 "ratio  share cold    cold/us warm  warm/us  adjoint/us ns/contact\n");
    const int sizes[] = {1, 10, 100, 1000, 10000};
    for (int i = 0; i < 5; i++) run_case("stack", scene_stack(sizes[i]), csv);
    const int rows[] = {4, 14, 44, 140};
    for (int i = 0; i < 4; i++) run_case("pyramid", scene_pyramid(rows[i]), csv);
    for (int i = 1; i < 5; i++) run_case("pile", scene_pile(sizes[i]), csv);
    for (int i = 0; i < 5; i++) run_case("chain", scene_chain(sizes[i]), csv);
    return 0;
}
