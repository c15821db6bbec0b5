/* scale.h: powers of two, balance, exact inverse. */
#include "near.h"

#include "lcp_case.h"
#include "libsolver/lcp/scale.h"
#include "rng.h"

#include <stdlib.h>
#include <string.h>

enum { NX = 9, NZ = 7, NY = 3 };

/* A problem in units spread over 2^60, and the room for its scales and scaled numbers. */
typedef struct fixture {
    lcp_case c;
    lcp_case scaled; /* same pattern; its numbers are overwritten */
    double dx[NX];
    double dz[NZ];
    double dy[NY];
    double norm[NX + NZ + NY];
    crm_scale d;
} fixture;

static void spread(const carom_sparse *a, int n_cols, const double *rows, const double *cols,
                   double *val)
{
    for (int j = 0; j < n_cols; j++)
        for (int k = a->col[j]; k < a->col[j + 1]; k++) val[k] *= rows[a->row[k]] * cols[j];
}

static void set_up(uint64_t seed, fixture *f)
{
    rng r = rng_from(seed);
    double ux[NX];
    double uz[NZ];
    double uy[NY];
    for (int i = 0; i < NX; i++) ux[i] = pow(2.0, rng_uniform(&r, -30, 30));
    for (int i = 0; i < NZ; i++) uz[i] = pow(2.0, rng_uniform(&r, -30, 30));
    for (int i = 0; i < NY; i++) uy[i] = pow(2.0, rng_uniform(&r, -30, 30));
    rng again = r;
    f->c = lcp_case_planted(&r, NX, NZ, NY, 0.4, LCP_MONOTONE);
    f->scaled = lcp_case_planted(&again, NX, NZ, NY, 0.4, LCP_MONOTONE);
    spread(&f->c.p.M, NX, ux, ux, f->c.n.M);
    spread(&f->c.p.A, NX, uy, ux, f->c.n.A);
    spread(&f->c.p.G, NX, uz, ux, f->c.n.G);
    spread(&f->c.p.F, NZ, uz, uz, f->c.n.F);
    f->d.x = f->dx;
    f->d.z = f->dz;
    f->d.y = f->dy;
}

static void tear_down(fixture *f)
{
    lcp_case_free(&f->c);
    lcp_case_free(&f->scaled);
}

static int is_power_of_two(double a)
{
    int e;
    return frexp(a, &e) == 0.5;
}

static void raise_to(const carom_sparse *a, int n_cols, double *rows, double *cols)
{
    for (int j = 0; j < n_cols; j++)
        for (int k = a->col[j]; k < a->col[j + 1]; k++) {
            rows[a->row[k]] = fmax(rows[a->row[k]], fabs(a->val[k]));
            cols[j] = fmax(cols[j], fabs(a->val[k]));
        }
}

/* Each row of the scaled K has its largest entry near 1, whatever the units were. */
static void balances(void **state)
{
    (void)state;
    for (uint64_t seed = 1; seed <= 20; seed++) {
        fixture f;
        set_up(seed, &f);
        crm_scale_find(&f.c.p, 1, f.norm, &f.d);
        crm_scale_problem(&f.c.p, &f.d, &f.scaled.n);
        double nx[NX] = {0};
        double nz[NZ] = {0};
        double ny[NY] = {0};
        raise_to(&f.scaled.p.M, NX, nx, nx);
        raise_to(&f.scaled.p.A, NX, ny, nx);
        raise_to(&f.scaled.p.G, NX, nz, nx);
        raise_to(&f.scaled.p.F, NZ, nz, nz);
        /* Ruiz reaches 1; each of the two factors of an entry is then rounded by up to sqrt(2) */
        for (int i = 0; i < NX; i++) assert_true(nx[i] >= 0.45 && nx[i] <= 2.2);
        for (int i = 0; i < NZ; i++) assert_true(nz[i] >= 0.45 && nz[i] <= 2.2);
        for (int i = 0; i < NY; i++) assert_true(ny[i] >= 0.45 && ny[i] <= 2.2);
        double top = fmax(near_norm(NX, f.scaled.p.q), near_norm(NZ, f.scaled.p.m));
        top = fmax(top, near_norm(NY, f.scaled.p.b));
        assert_true(top >= 0.7 && top <= 1.42); /* V within sqrt(2) */
        for (int i = 0; i < NX; i++) assert_true(is_power_of_two(f.dx[i]));
        for (int i = 0; i < NZ; i++) assert_true(is_power_of_two(f.dz[i]));
        for (int i = 0; i < NY; i++) assert_true(is_power_of_two(f.dy[i]));
        assert_true(is_power_of_two(f.d.V));
        tear_down(&f);
    }
}

static void inverse_is_exact(void **state)
{
    (void)state;
    fixture f;
    set_up(5, &f);
    crm_scale_find(&f.c.p, 1, f.norm, &f.d);
    carom_lcp_point there = lcp_point_new(&f.c.p);
    carom_lcp_point back = lcp_point_new(&f.c.p);
    crm_scale_point(&f.c.p, &f.d, &f.c.at, &there);
    crm_unscale_point(&f.c.p, &f.d, &there, &back);
    assert_memory_equal(back.x, f.c.at.x, NX * sizeof(double));
    assert_memory_equal(back.s, f.c.at.s, NZ * sizeof(double));
    assert_memory_equal(back.z, f.c.at.z, NZ * sizeof(double));
    assert_memory_equal(back.y, f.c.at.y, NY * sizeof(double));
    free(there.x);
    free(back.x);
    tear_down(&f);
}

/* A solution stays a solution: the scaled point solves the scaled problem. */
static void maps_solutions_to_solutions(void **state)
{
    (void)state;
    rng r = rng_from(6);
    rng again = r;
    lcp_case c = lcp_case_planted(&r, NX, NZ, NY, 0.4, LCP_MONOTONE);
    lcp_case scaled = lcp_case_planted(&again, NX, NZ, NY, 0.4, LCP_MONOTONE);
    double dx[NX];
    double dz[NZ];
    double dy[NY];
    double norm[NX + NZ + NY];
    crm_scale d = {1.0, dx, dz, dy};
    crm_scale_find(&c.p, 1, norm, &d);
    crm_scale_problem(&c.p, &d, &scaled.n);
    crm_scale_point(&c.p, &d, &c.at, &scaled.at);
    /* numbers of order 1 before and after: a few roundings */
    assert_at_most("scaled", lcp_case_error(&scaled.p, &scaled.at), 1e-13);
    lcp_case_free(&c);
    lcp_case_free(&scaled);
}

static void not_wanted_is_one(void **state)
{
    (void)state;
    fixture f;
    set_up(8, &f);
    crm_scale_find(&f.c.p, 0, f.norm, &f.d);
    for (int i = 0; i < NX; i++) assert_true(f.dx[i] == 1.0);
    for (int i = 0; i < NZ; i++) assert_true(f.dz[i] == 1.0);
    for (int i = 0; i < NY; i++) assert_true(f.dy[i] == 1.0);
    assert_true(f.d.V == 1.0);
    tear_down(&f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(balances),
        cmocka_unit_test(inverse_is_exact),
        cmocka_unit_test(maps_solutions_to_solutions),
        cmocka_unit_test(not_wanted_is_one),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
