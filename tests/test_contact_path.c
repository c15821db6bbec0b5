/* Paths of pivots, libsolver/contact/ladder/path.h: their ends solve what they say, with far fewer
 * factorizations than pivots. */
#include "contact_families.h"
#include "libsolver/contact/ladder/ladder.h"
#include "libsolver/contact/system.h"
#include "near.h"

#include <math.h>

/* A problem and its islands, as carom_contact_solve sees them. */
typedef struct inside {
    crm_memory memory;
    crm_graph graph;
    crm_block_pattern pattern;
    crm_system system;
} inside;

static void inside_make(inside *o, const carom_contact_problem *p)
{
    int same;
    memset(o, 0, sizeof *o);
    o->memory = crm_memory_from(NULL);
    o->graph.n_bodies = -1;
    assert_int_equal(crm_graph_update(&o->memory, &o->graph, p, &same), CAROM_OK);
    assert_int_equal(crm_block_analyze(&o->memory, &o->pattern, &o->graph), CAROM_OK);
    assert_int_equal(crm_system_reserve(&o->memory, &o->system, &o->graph, &o->pattern), CAROM_OK);
    for (int i = 0; i < o->graph.n_islands; i++) o->system.key[i].valid = 0;
}

static void inside_free(inside *o)
{
    crm_graph_free(&o->memory, &o->graph);
    crm_block_pattern_free(&o->memory, &o->pattern);
    crm_system_free(&o->memory, &o->system);
    assert_int_equal(o->memory.live, 0);
}

static crm_island island(inside *o, const carom_contact_problem *p, int i)
{
    crm_system_gather(&o->system, &o->graph, p, i);
    crm_island s = *crm_system_begin(&o->system, i);
    s.accept = 1e-10;
    return s;
}

/* Work of the paths of a test. */
typedef struct work {
    int tries;
    int failed;
    int pivots;
    int factorizations;
} work;

/* The solution with every impulse off by up to `noise` of itself, led back. */
static void cross_back(contact_case *c, rng *r, double noise, work *w)
{
    inside o;
    int done = 1;
    inside_make(&o, &c->p);
    for (int k = 0; k < c->p.n_contacts; k++) {
        c->x.ln[k] *= 1 + noise * rng_uniform(r, -1, 1);
        c->x.lt[k] *= 1 + noise * rng_uniform(r, -1, 1);
    }
    for (int k = 0; k < c->p.n_joint_rows; k++) c->x.le[k] *= 1 + noise * rng_uniform(r, -1, 1);
    for (int i = 0; i < o.graph.n_islands; i++) {
        crm_island s = island(&o, &c->p, i);
        crm_system_read(&o.system, &o.graph, &s, i, &c->x, CAROM_GUESS_IMPULSES);
        if (crm_crossover(&s, 1000, 1))
            crm_system_write(&o.system, &o.graph, &c->p, &s, i, &c->x);
        else
            done = 0;
        w->pivots += s.pivots;
        w->factorizations += s.factorizations;
    }
    w->tries++;
    w->failed += !done;
    /* Bodies of no island move freely. */
    for (int b = 0; b < c->p.n_bodies; b++) {
        for (int i = 0; i < 3 && o.graph.node_of[b] < 0; i++) c->x.v[3 * b + i] = c->p.u[3 * b + i];
    }
    if (done) assert_at_most("crossed over", contact_case_residual(c), 1e-10);
    inside_free(&o);
}

/* All families, joints and mass ratios included.  Where friction makes a path turn back it is given
 * up: that may happen, to one in ten. */
static void crossovers_lead_back(void **state)
{
    (void)state;
    const double noise[] = {1e-6, 1e-2};
    carom_contact_solver *s;
    assert_int_equal(carom_contact_create(NULL, NULL, &s), CAROM_OK);
    for (int q = 0; q < 2; q++) {
        work w = {0};
        for (int f = 0; f < n_contact_families; f++) {
            for (uint64_t i = 0; i < 20; i++) {
                rng r = rng_from(500 * (uint64_t)f + i);
                contact_case c = contact_families[f].make(&r);
                if (carom_contact_solve(s, &c.p, CAROM_GUESS_NONE, &c.x, NULL) == CAROM_OK)
                    cross_back(&c, &r, noise[q], &w);
                contact_case_free(&c);
            }
        }
        print_message("noise %g: %d tries, %d given up, %d pivots, %d factorizations\n", noise[q],
                      w.tries, w.failed, w.pivots, w.factorizations);
        assert_in_range(w.tries, 100, 1000);
        assert_in_range(w.failed, 0, w.tries / 10);
    }
    carom_contact_destroy(s);
}

/* Lemke's path from where all contacts are open: hundreds of pivots, one factorization in ten or
 * more.  Its end solves the problem with compliance 1e-7, a = -1e-7 l_n where closed, u = -1e-7 l_t
 * where it sticks: that is its residual in unit scale, and nothing else but rounding. */
static void long_paths_factor_rarely(void **state)
{
    (void)state;
    int pivots = 0;
    int factorizations = 0;
    for (uint64_t seed = 1; seed <= 10; seed++) {
        rng r = rng_from(seed);
        contact_case c = contact_discs(&r, 60, 0.3, 0.6);
        inside o;
        inside_make(&o, &c.p);
        for (int i = 0; i < o.graph.n_islands; i++) {
            crm_island s = island(&o, &c.p, i);
            double most = 0;
            double error = 0;
            assert_true(crm_lemke(&s, 100 * s.nc + 50, 1));
            crm_island_residual(&s, s.x); /* leaves a and u */
            for (int k = 0; k < s.nc; k++) {
                const double bound = s.contact[k].mu * s.x.n[k];
                const double t = fmin(bound, fmax(-bound, s.x.t[k] - s.ut[k]));
                most = fmax(most, fmax(s.x.n[k], fabs(s.x.t[k])));
                error = fmax(error, fabs(fmin(s.an[k], s.x.n[k])));
                error = fmax(error, fabs(s.x.t[k] - t));
            }
            assert_at_most("compliance", error, 1.001e-7 * most + 1e-12);
            pivots += s.pivots;
            factorizations += s.factorizations;
        }
        inside_free(&o);
        contact_case_free(&c);
    }
    print_message("%d pivots, %d factorizations\n", pivots, factorizations);
    assert_in_range(factorizations, 1, pivots / 10);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(crossovers_lead_back),
                                       cmocka_unit_test(long_paths_factor_rarely)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
