/* Success by family of four methods on the same problems: the ladder, the paper's interior point on
 * the four-variable form (carom_lcp_plain), projected Gauss-Seidel, and Lemke's path.
 * Usage: bench_families [problems per family] */
#include "carom/contact.h"
#include "carom/lcp.h"
#include "clock.h"
#include "contact_families.h"
#include "four_variables.h"
#include "libsolver/contact/ladder/ladder.h"
#include "libsolver/contact/system.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { N_SWEEPS = 1000, N_PIVOTS = 20 };

/* The methods that look inside the solver share its arrays. */
typedef struct inside {
    crm_memory memory;
    crm_graph graph;
    crm_block_pattern pattern;
    crm_system system;
} inside;

static void inside_update(inside *o, const carom_contact_problem *p)
{
    int same;
    if (crm_graph_update(&o->memory, &o->graph, p, &same) < 0 ||
        crm_block_analyze(&o->memory, &o->pattern, &o->graph) < 0 ||
        crm_system_reserve(&o->memory, &o->system, &o->graph, &o->pattern) < 0)
        exit(1);
}

/* One method on every island: 0 sweeps, 1 Lemke with its polish. */
static int solve_inside(inside *o, const carom_contact_problem *p, int lemke)
{
    inside_update(o, p);
    for (int i = 0; i < o->graph.n_islands; i++) {
        crm_system_gather(&o->system, &o->graph, p, i);
        crm_island s = *crm_system_begin(&o->system, i);
        s.accept = 1e-10;
        crm_vec_zero(&s, s.x);
        if (!lemke) {
            crm_sweeps(&s, N_SWEEPS);
            if (!crm_island_offer(&s, s.x, crm_island_residual(&s, s.x))) return 0;
        } else if (!crm_lemke(&s, N_PIVOTS * s.nc + 50, 1) || !crm_active_set(&s, 15)) {
            return 0;
        }
    }
    return 1;
}

/* The paper's method; its velocity and impulses are judged by the contact residual. */
static int solve_plain(contact_case *c)
{
    const carom_contact_problem *p = &c->p;
    const int nc = p->n_contacts;
    problem_file f = contact_case_to_file(c);
    four_variables v;
    int solved = 0;
    if (!four_variables_make(&f, &v)) {
        const carom_lcp_settings plain = carom_lcp_plain();
        const size_t n_z = (size_t)v.problem.n_ineq + 1;
        double *z = calloc(2 * n_z + (size_t)v.problem.n_eq + 1, sizeof(double));
        carom_lcp_point at = {c->x.v, z, z + n_z, z + 2 * n_z};
        carom_lcp *lcp = NULL;
        if (carom_lcp_create(&v.problem, &plain, NULL, &lcp) == CAROM_OK &&
            carom_lcp_solve(lcp, &v.problem, &at, NULL) >= 0) {
            for (int k = 0; k < nc; k++) {
                c->x.ln[k] = at.z[k];
                c->x.lt[k] = at.z[nc + 2 * k] - at.z[nc + 2 * k + 1];
            }
            for (int r = 0; r < p->n_joint_rows; r++) c->x.le[r] = -at.y[r];
            solved = carom_contact_residual(p, &c->x) <= 1e-8;
        }
        carom_lcp_destroy(lcp);
        free(z);
        four_variables_free(&v);
    }
    contact_case_free_file(&f);
    return solved;
}

static int compare_ints(const void *a, const void *b)
{
    return *(const int *)a - *(const int *)b;
}

typedef struct row {
    int n;
    int solved;
    int inexact;
    int infeasible;
    int plain;
    int sweeps;
    int lemke;
    int *factorizations;
    double seconds;
} row;

static void run_problem(carom_contact_solver *s, inside *o, contact_case *c, row *t)
{
    carom_contact_stats st;
    const double from = cpu_seconds();
    const carom_status status = carom_contact_solve(s, &c->p, CAROM_GUESS_NONE, &c->x, &st);
    t->seconds += cpu_seconds() - from;
    t->factorizations[t->n++] = st.factorizations;
    t->infeasible += status == CAROM_E_INFEASIBLE;
    t->inexact += status == CAROM_INEXACT;
    if (status == CAROM_OK && contact_case_residual(c) <= 1e-10) t->solved++;
    t->plain += solve_plain(c);
    t->sweeps += solve_inside(o, &c->p, 0);
    t->lemke += solve_inside(o, &c->p, 1);
}

static void print_row(const char *name, row *t)
{
    qsort(t->factorizations, (size_t)t->n, sizeof(int), compare_ints);
    printf("| %-11s | %5d | %6d | %7d | %10d | %6d | %6d | %6d | %6d | %4d | %6d | %8.0f |\n", name,
           t->n, t->solved, t->inexact, t->infeasible, t->plain, t->sweeps, t->lemke,
           t->factorizations[t->n / 2], t->factorizations[t->n * 95 / 100],
           t->factorizations[t->n - 1], 1e6 * t->seconds / t->n);
    fflush(stdout);
}

int main(int argc, char **argv)
{
    const int n = argc > 1 ? atoi(argv[1]) : 250;
    inside o;
    memset(&o, 0, sizeof o);
    o.memory = crm_memory_from(NULL);
    o.graph.n_bodies = -1;
    carom_contact_solver *s;
    if (n < 1 || carom_contact_create(NULL, NULL, &s) < 0) return 1;
    printf(
        "| family      |     n | solved | inexact | infeasible |  paper |     GS |  Lemke | median "
        "|  95 %% |    max |  us each |\n"
        "|---|---|---|---|---|---|---|---|---|---|---|---|\n");
    for (int f = 0; f < n_contact_families; f++) {
        row t;
        memset(&t, 0, sizeof t);
        t.factorizations = calloc((size_t)n, sizeof(int));
        for (int i = 0; i < n; i++) {
            rng r = rng_from(100000 + 1000 * (uint64_t)f + (uint64_t)i);
            contact_case c = contact_families[f].make(&r);
            run_problem(s, &o, &c, &t);
            contact_case_free(&c);
        }
        print_row(contact_families[f].name, &t);
        free(t.factorizations);
    }
    carom_contact_destroy(s);
    crm_graph_free(&o.memory, &o.graph);
    crm_block_pattern_free(&o.memory, &o.pattern);
    crm_system_free(&o.memory, &o.system);
    return 0;
}
