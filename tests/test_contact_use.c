/* The contact solver in use: refused input, repeatability, threads, guesses, memory, failure. */
#include "alloc_fail.h"
#include "carom/contact.h"
#include "contact_case.h"
#include "contact_parts.h"
#include "near.h"
#include "rng.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void bad_input_is_refused(void **state)
{
    (void)state;
    carom_contact_solver *s;
    carom_contact_stats st;
    assert_int_equal(carom_contact_create(NULL, NULL, &s), CAROM_OK);
    contact_case c = contact_case_new(2, 2, 2);
    const double zero[2] = {0, 0};
    contact_case_body(&c, 0, 1, 1, 0, 0, -1);
    contact_case_body(&c, 1, 1, 1, 0, 0, -1);
    contact_feet(&c, -1, 0, 0.5);
    contact_case_hinge(&c, 0, 1, zero, zero);
    double *const numbers[] = {c.inv_mass + 4, c.u + 3,  c.jn + 4, c.jt + 5, c.mu + 1,
                               c.cn,           c.ct + 1, c.je + 2, c.ce + 1};
    const double bad[] = {NAN, HUGE_VAL, -HUGE_VAL};
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
        const double keep = *numbers[i];
        for (int q = 0; q < 3; q++) {
            *numbers[i] = bad[q];
            assert_int_equal(carom_contact_solve(s, &c.p, 0, &c.x, &st), CAROM_E_ARGUMENT);
            assert_int_equal(carom_contact_adjoint(s, &c.p, &c.x, c.u, &(carom_contact_bars){0}),
                             CAROM_E_ARGUMENT);
        }
        *numbers[i] = keep;
    }
    c.jn[0] = NAN; /* the world's coefficient is not read */
    assert_int_equal(carom_contact_solve(s, &c.p, 0, &c.x, &st), CAROM_OK);
    c.inv_mass[1] = -1;
    assert_int_equal(carom_contact_solve(s, &c.p, 0, &c.x, NULL), CAROM_E_ARGUMENT);
    c.inv_mass[1] = 1;
    c.mu[0] = -0.1;
    assert_int_equal(carom_contact_solve(s, &c.p, 0, &c.x, NULL), CAROM_E_ARGUMENT);
    c.mu[0] = 0.5;
    const int pairs[][2] = {{-2, 0}, {0, 2}, {1, 1}};
    for (int q = 0; q < 3; q++) {
        c.joint_body[0] = pairs[q][0];
        c.joint_body[1] = pairs[q][1];
        assert_int_equal(carom_contact_solve(s, &c.p, 0, &c.x, NULL), CAROM_E_ARGUMENT);
    }
    c.joint_body[0] = 0;
    c.joint_body[1] = 1;
    c.x.mode[0] = CAROM_UNKNOWN;
    assert_int_equal(carom_contact_adjoint(s, &c.p, &c.x, c.u, &(carom_contact_bars){0}),
                     CAROM_E_ARGUMENT);
    carom_contact_solution missing = c.x;
    missing.le = NULL;
    assert_int_equal(carom_contact_solve(s, &c.p, 0, &missing, NULL), CAROM_E_ARGUMENT);
    assert_int_equal(carom_contact_solve(s, &c.p, 0, NULL, NULL), CAROM_E_ARGUMENT);
    assert_int_equal(carom_contact_solve(s, NULL, 0, &c.x, NULL), CAROM_E_ARGUMENT);
    assert_int_equal(carom_contact_solve(NULL, &c.p, 0, &c.x, NULL), CAROM_E_ARGUMENT);
    assert_int_equal(carom_contact_adjoint(s, &c.p, &c.x, NULL, NULL), CAROM_E_ARGUMENT);
    c.p.n_contacts = -1;
    assert_int_equal(carom_contact_solve(s, &c.p, 0, &c.x, NULL), CAROM_E_ARGUMENT);
    carom_contact_destroy(s);
    contact_case_free(&c);
}

static void settings_are_checked(void **state)
{
    (void)state;
    carom_contact_solver *s = NULL;
    carom_contact_settings set = carom_contact_defaults();
    set.accept = 0;
    assert_int_equal(carom_contact_create(&set, NULL, &s), CAROM_E_ARGUMENT);
    set = carom_contact_defaults();
    set.inexact = 1e-12;
    assert_int_equal(carom_contact_create(&set, NULL, &s), CAROM_E_ARGUMENT);
    set = carom_contact_defaults();
    set.max_iterations = 0;
    assert_int_equal(carom_contact_create(&set, NULL, &s), CAROM_E_ARGUMENT);
    set = carom_contact_defaults();
    set.max_restarts = -1;
    assert_int_equal(carom_contact_create(&set, NULL, &s), CAROM_E_ARGUMENT);
    set = carom_contact_defaults();
    set.threads = 0;
    assert_int_equal(carom_contact_create(&set, NULL, &s), CAROM_E_ARGUMENT);
    assert_int_equal(carom_contact_create(NULL, NULL, NULL), CAROM_E_ARGUMENT);
    assert_null(s);
    carom_contact_destroy(NULL);
}

static void residual_of_a_wrong_point(void **state)
{
    (void)state;
    contact_case c = contact_stack(2, 1, 0.5, 0);
    contact_solve_ok(&c);
    c.x.v[2] += 1e-3 * GRAVITY * STEP; /* 1e-3 of V, in the rows and in (4) */
    const double r = carom_contact_residual(&c.p, &c.x);
    assert_true(r > 0.9e-3);
    assert_near(r, contact_case_residual(&c), 1e-12);
    c.x.v[2] = NAN;
    assert_true(carom_contact_residual(&c.p, &c.x) == HUGE_VAL);
    c.x.v[2] = 0;
    c.x.ln[1] = NAN;
    assert_true(carom_contact_residual(&c.p, &c.x) == HUGE_VAL);
    contact_case_free(&c);
}

static void repeats_bit_for_bit(void **state)
{
    (void)state;
    contact_case c = contact_mixed(3, 6);
    contact_case d = contact_case_copy(&c);
    contact_case other = contact_mixed(4, 5);
    carom_contact_solver *s;
    assert_int_equal(carom_contact_create(NULL, NULL, &s), CAROM_OK);
    assert_int_equal(carom_contact_solve(s, &c.p, 0, &c.x, NULL), CAROM_OK);
    assert_int_equal(carom_contact_solve(s, &other.p, 0, &other.x, NULL), CAROM_OK);
    assert_int_equal(carom_contact_solve(s, &d.p, 0, &d.x, NULL), CAROM_OK); /* after another */
    assert_memory_equal(c.x.v, d.x.v, 3 * (size_t)c.p.n_bodies * sizeof(double));
    assert_memory_equal(c.x.ln, d.x.ln, (size_t)c.p.n_contacts * sizeof(double));
    assert_memory_equal(c.x.lt, d.x.lt, (size_t)c.p.n_contacts * sizeof(double));
    assert_memory_equal(c.x.mode, d.x.mode, (size_t)c.p.n_contacts);
    carom_contact_destroy(s);
    contact_case_free(&c);
    contact_case_free(&d);
    contact_case_free(&other);
}

/* Threads take islands in any order: the result, its statistics and a certificate are the same. */
static void threads_do_not_matter(void **state)
{
    (void)state;
    contact_case one = contact_mixed(21, 200);
    carom_contact_stats first;
    for (int threads = 1; threads <= 4; threads++) {
        contact_case c = contact_case_copy(&one);
        carom_contact_settings set = carom_contact_defaults();
        carom_contact_solver *s;
        carom_contact_stats st;
        set.threads = threads;
        assert_int_equal(carom_contact_create(&set, NULL, &s), CAROM_OK);
        assert_int_equal(carom_contact_solve(s, &c.p, CAROM_GUESS_NONE, &c.x, &st), CAROM_OK);
        assert_true(st.islands > 100);
        if (threads == 1) {
            first = st;
            memcpy(one.x.v, c.x.v, 3 * (size_t)c.p.n_bodies * sizeof(double));
            memcpy(one.x.ln, c.x.ln, (size_t)c.p.n_contacts * sizeof(double));
        }
        assert_memory_equal(c.x.v, one.x.v, 3 * (size_t)c.p.n_bodies * sizeof(double));
        assert_memory_equal(c.x.ln, one.x.ln, (size_t)c.p.n_contacts * sizeof(double));
        assert_int_equal(st.factorizations, first.factorizations);
        assert_int_equal(st.stage, first.stage);
        assert_int_equal(st.degenerate, first.degenerate);
        const int last = c.p.n_joint_rows - 1;
        c.joint_body[2 * last] = -1; /* a second hinge of one point, which moves */
        memcpy(c.joint_body + 2 * (last - 1), c.joint_body + 2 * last, 2 * sizeof(int));
        memcpy(c.joint_body + 2 * (last - 2), c.joint_body + 2 * last, 2 * sizeof(int));
        memcpy(c.joint_body + 2 * (last - 3), c.joint_body + 2 * last, 2 * sizeof(int));
        memcpy(c.je + 6 * (last - 3), c.je + 6 * (last - 1), 12 * sizeof(double));
        c.ce[last] = 1;
        assert_int_equal(carom_contact_solve(s, &c.p, CAROM_GUESS_NONE, &c.x, &st),
                         CAROM_E_INFEASIBLE);
        carom_contact_destroy(s);
        contact_case_free(&c);
    }
    contact_case_free(&one);
}

static void move_contact(const contact_case *from, int k, contact_case *to, int at)
{
    memcpy(to->contact_body + 2 * at, from->contact_body + 2 * k, 2 * sizeof(int));
    memcpy(to->jn + 6 * at, from->jn + 6 * k, 6 * sizeof(double));
    memcpy(to->jt + 6 * at, from->jt + 6 * k, 6 * sizeof(double));
    to->mu[at] = from->mu[k];
    to->cn[at] = from->cn[k];
    to->ct[at] = from->ct[k];
}

static void order_of_contacts_does_not_matter(void **state)
{
    (void)state;
    for (uint64_t seed = 0; seed < 20; seed++) {
        rng r = rng_from(100 + seed);
        contact_case c = contact_mixed(seed, 3);
        contact_case d = contact_case_copy(&c);
        const int n = c.p.n_contacts;
        int order[64];
        for (int i = 0; i < n; i++) order[i] = i;
        for (int i = n - 1; i > 0; i--) {
            const int j = rng_int(&r, i + 1);
            const int t = order[i];
            order[i] = order[j];
            order[j] = t;
        }
        for (int i = 0; i < n; i++) move_contact(&c, order[i], &d, i);
        contact_solve_ok(&c);
        contact_solve_ok(&d);
        /* Two solutions of residual 1e-10 V, V about 0.2 m/s, well conditioned. */
        assert_near_array("shuffled", 3 * c.p.n_bodies, d.x.v, c.x.v, 1e-10);
        contact_case_free(&c);
        contact_case_free(&d);
    }
}

/* A solution as the guess: of the same problem, and of one with other right-hand sides, it takes no
 * factorization, for the last one is kept; of a neighbor one, also where many impulses give the
 * same motion; modes alone take one where they fit the impulses nearest to zero. */
/* Passes at moved constants lead where a solve leads, by back-substitutions alone; from impulses
 * alone, too. */
static void passes_follow_the_constants(void **state)
{
    (void)state;
    rng r = {7};
    for (uint64_t seed = 1; seed <= 20; seed++) {
        contact_case c = contact_mixed(seed, 6);
        carom_contact_solver *s;
        carom_contact_stats st;
        assert_int_equal(carom_contact_create(NULL, NULL, &s), CAROM_OK);
        assert_int_equal(carom_contact_solve(s, &c.p, 0, &c.x, NULL), CAROM_OK);
        /* of joints: a contact that touches without pressing would change its mode */
        for (int k = 0; k < c.p.n_joint_rows; k++) c.ce[k] += 1e-6 * rng_unit(&r);
        contact_case other = contact_case_copy(&c);
        for (int start = 0; start < 2; start++) {
            if (start) assert_int_equal(carom_contact_start(s, &c.p, &c.x), CAROM_OK);
            for (int k = 0; k < 3; k++) {
                assert_int_equal(carom_contact_pass(s, &c.p, &c.x, &st), CAROM_OK);
                if (k) assert_int_equal(st.factorizations, 0);
            }
            assert_at_most("residual", carom_contact_measure(s, &c.p, &c.x), 1e-11);
            assert_true(carom_contact_measure(s, &c.p, &c.x) == carom_contact_residual(&c.p, &c.x));
            assert_at_most("own residual", contact_case_residual(&c), 1e-11);
        }
        assert_int_equal(carom_contact_solve(s, &other.p, CAROM_GUESS_MODES, &other.x, NULL),
                         CAROM_OK);
        for (int i = 0; i < 3 * c.p.n_bodies; i++) assert_near(c.x.v[i], other.x.v[i], 1e-10);
        carom_contact_destroy(s);
        contact_case_free(&c);
        contact_case_free(&other);
    }
}

static void good_guess_takes_one_factorization(void **state)
{
    (void)state;
    for (int pushed = 0; pushed < 2; pushed++) {
        contact_case c = contact_stack(6, 10, 0.5, 0.02 * pushed);
        carom_contact_solver *s;
        carom_contact_stats st;
        double v[18];
        assert_int_equal(carom_contact_create(NULL, NULL, &s), CAROM_OK);
        assert_int_equal(carom_contact_solve(s, &c.p, CAROM_GUESS_NONE, &c.x, &st), CAROM_OK);
        memcpy(v, c.x.v, sizeof v);
        assert_int_equal(carom_contact_solve(s, &c.p, CAROM_GUESS_IMPULSES, &c.x, &st), CAROM_OK);
        assert_int_equal(st.stage, CAROM_STAGE_GUESS);
        assert_int_equal(st.factorizations, 0);
        assert_near_array("impulses", 18, c.x.v, v, CLOSE);
        for (int i = 0; i < 6; i++) c.u[3 * i + 2] *= 1.001; /* all impulses scale */
        assert_int_equal(carom_contact_solve(s, &c.p, CAROM_GUESS_IMPULSES, &c.x, &st), CAROM_OK);
        assert_int_equal(st.factorizations, 0);
        for (int i = 0; i < 6; i++) {
            c.u[3 * i + 2] *= 1.001;
            c.inv_mass[3 * i] *= 1.001; /* another matrix */
        }
        assert_int_equal(carom_contact_solve(s, &c.p, CAROM_GUESS_IMPULSES, &c.x, &st), CAROM_OK);
        assert_int_equal(st.factorizations, 1);
        for (int i = 0; i < 6; i++) c.inv_mass[3 * i] /= 1.001;
        for (int i = 0; i < 6; i++) c.u[3 * i + 2] = -GRAVITY * STEP;
        assert_int_equal(carom_contact_solve(s, &c.p, CAROM_GUESS_MODES, &c.x, &st), CAROM_OK);
        if (!pushed) assert_int_equal(st.factorizations, 1);
        assert_near_array("modes", 18, c.x.v, v, CLOSE);
        for (int k = 0; k < 12; k++) {
            c.x.mode[k] = CAROM_UNKNOWN;
            c.x.ln[k] = k % 2 ? NAN : HUGE_VAL; /* as good as none */
        }
        assert_int_equal(carom_contact_solve(s, &c.p, CAROM_GUESS_IMPULSES, &c.x, &st), CAROM_OK);
        assert_near_array("unknown", 18, c.x.v, v, 1e-11);
        carom_contact_destroy(s);
        contact_case_free(&c);
    }
}

/* Impulses of 300 boxes cancel to 1e-14 of the velocity scale at best: still nothing has changed,
 * and the guess comes back bit for bit. */
static void tall_stack_at_rest_costs_nothing(void **state)
{
    (void)state;
    contact_case c = contact_stack(300, 1, 0.5, 0);
    contact_case d;
    carom_contact_solver *s;
    carom_contact_stats st;
    assert_int_equal(carom_contact_create(NULL, NULL, &s), CAROM_OK);
    assert_int_equal(carom_contact_solve(s, &c.p, CAROM_GUESS_NONE, &c.x, &st), CAROM_OK);
    assert_true(st.factorizations > 0);
    d = contact_case_copy(&c);
    assert_int_equal(carom_contact_solve(s, &d.p, CAROM_GUESS_IMPULSES, &d.x, &st), CAROM_OK);
    assert_int_equal(st.factorizations, 0);
    assert_at_most("residual", contact_case_residual(&d), 1e-10);
    assert_memory_equal(c.x.ln, d.x.ln, 600 * sizeof(double));
    d.u[2] *= 1 + 1e-9; /* a change beyond rounding is seen */
    assert_int_equal(carom_contact_solve(s, &d.p, CAROM_GUESS_IMPULSES, &d.x, &st), CAROM_OK);
    assert_memory_not_equal(c.x.ln, d.x.ln, 600 * sizeof(double));
    assert_at_most("residual", contact_case_residual(&d), 1e-10);
    carom_contact_destroy(s);
    contact_case_free(&c);
    contact_case_free(&d);
}

static void no_allocation_in_steady_state(void **state)
{
    (void)state;
    alloc_fail a = alloc_fail_never();
    const carom_allocator from = alloc_fail_allocator(&a);
    carom_contact_solver *s;
    contact_case c = contact_mixed(7, 8);
    double *bar = calloc((size_t)c.p.n_bodies * 3, sizeof *bar);
    carom_contact_bars bars = {.u = bar};
    assert_int_equal(carom_contact_create(NULL, &from, &s), CAROM_OK);
    assert_int_equal(carom_contact_solve(s, &c.p, 0, &c.x, NULL), CAROM_OK);
    assert_int_equal(carom_contact_adjoint(s, &c.p, &c.x, c.x.v, &bars), CAROM_OK);
    const long calls = a.n_calls;
    size_t bytes;
    long counted;
    for (int i = 0; i < 20; i++) {
        for (int b = 0; b < c.p.n_bodies; b++) c.u[3 * b + 1] += 0.01 * (b % 3 - 1);
        assert_int_equal(carom_contact_solve(s, &c.p, i % 2, &c.x, NULL), CAROM_OK);
        assert_int_equal(carom_contact_adjoint(s, &c.p, &c.x, c.x.v, &bars), CAROM_OK);
    }
    /* A smaller graph fits into the same memory. */
    const int n = c.p.n_contacts;
    c.p.n_contacts = n - 3;
    carom_contact_solve(s, &c.p, 0, &c.x, NULL);
    c.p.n_contacts = n;
    assert_int_equal(carom_contact_solve(s, &c.p, 0, &c.x, NULL), CAROM_OK);
    carom_contact_memory(s, &bytes, &counted);
    assert_int_equal(a.n_calls, calls);
    assert_int_equal(counted, calls);
    assert_int_equal(bytes, a.live);
    carom_contact_destroy(s);
    assert_int_equal(a.live, 0);
    assert_int_equal(a.n_bad_sizes, 0);
    free(bar);
    contact_case_free(&c);
}

static void every_allocation_may_fail(void **state)
{
    (void)state;
    contact_case c = contact_mixed(8, 3);
    double bar[36];
    carom_contact_bars bars = {.u = bar};
    long k = 0;
    for (int done = 0; !done; k++) {
        assert_true(k < 100);
        alloc_fail a = alloc_fail_at(k);
        const carom_allocator from = alloc_fail_allocator(&a);
        carom_contact_solver *s = NULL;
        const carom_status made = carom_contact_create(NULL, &from, &s);
        if (made < 0) {
            assert_int_equal(made, CAROM_E_MEMORY);
            assert_null(s);
            assert_int_equal(a.live, 0);
            continue;
        }
        c.x.v[0] = 55;
        carom_status st = carom_contact_solve(s, &c.p, 0, &c.x, NULL);
        if (st < 0) {
            assert_int_equal(st, CAROM_E_MEMORY);
            assert_near(c.x.v[0], 55, 0);
        } else {
            bar[0] = 66;
            st = carom_contact_adjoint(s, &c.p, &c.x, c.x.v, &bars);
            if (st < 0) assert_near(bar[0], 66, 0);
        }
        if (st < 0) { /* memory is back: the same object goes on */
            a.fail_at = -1;
            assert_int_equal(carom_contact_solve(s, &c.p, 0, &c.x, NULL), CAROM_OK);
        }
        done = st >= 0;
        carom_contact_destroy(s);
        assert_int_equal(a.live, 0);
        assert_int_equal(a.n_bad_sizes, 0);
    }
    assert_true(k > 4); /* object, graph, pattern, system at least */
    contact_case_free(&c);
}

/* A ball that has to bounce from the floor, under a ceiling: the certificate names the restitution
 * that cannot be; the caller who gives that one up, and no other, has a solution. */
static void caller_relaxes_what_the_certificate_names(void **state)
{
    (void)state;
    contact_case c = contact_case_new(2, 3, 0);
    const double up[2] = {0, 1};
    const double down[2] = {0, -1};
    const double zero[2] = {0, 0};
    carom_contact_solver *s;
    double yn[3];
    for (int b = 0; b < 2; b++) contact_case_body(&c, b, 1, 1, 0, 0, -1);
    contact_case_contact(&c, -1, 0, zero, zero, up, 0, -0.5); /* e = 1/2 after speed 1 */
    contact_case_contact(&c, -1, 0, zero, zero, down, 0, 0);
    contact_case_contact(&c, -1, 1, zero, zero, up, 0, -0.5); /* another ball, free to bounce */
    assert_int_equal(carom_contact_create(NULL, NULL, &s), CAROM_OK);
    assert_int_equal(carom_contact_solve(s, &c.p, CAROM_GUESS_NONE, &c.x, NULL),
                     CAROM_E_INFEASIBLE);
    assert_int_equal(carom_contact_certificate(s, yn, NULL), CAROM_OK);
    assert_true(yn[0] > 0 && yn[1] > 0 && yn[2] == 0);
    for (int k = 0; k < 3; k++) {
        if (yn[k] > 0) c.cn[k] = fmax(0, c.cn[k]);
    }
    assert_int_equal(carom_contact_solve(s, &c.p, CAROM_GUESS_NONE, &c.x, NULL), CAROM_OK);
    assert_near(c.x.v[2], 0, CLOSE);
    assert_near(c.x.v[5], 0.5, CLOSE);
    carom_contact_destroy(s);
    contact_case_free(&c);
}

/* One iteration, no restart, a tolerance out of reach: the best point and its residual. */
static void failure_is_reported(void **state)
{
    (void)state;
    carom_contact_settings set = carom_contact_defaults();
    set.accept = 1e-300;
    set.inexact = 1e-299;
    set.max_iterations = 1;
    set.max_restarts = 0;
    carom_contact_solver *s;
    carom_contact_stats st;
    contact_case c = contact_mixed(9, 2);
    assert_int_equal(carom_contact_create(&set, NULL, &s), CAROM_OK);
    assert_int_equal(carom_contact_solve(s, &c.p, 0, &c.x, &st), CAROM_E_NO_SOLUTION);
    assert_near(st.residual, contact_case_residual(&c), 1e-12);
    assert_true(st.residual > set.inexact && st.residual < 1e-10);
    carom_contact_destroy(s);
    set.inexact = 1e-6;
    assert_int_equal(carom_contact_create(&set, NULL, &s), CAROM_OK);
    assert_int_equal(carom_contact_solve(s, &c.p, 0, &c.x, &st), CAROM_INEXACT);
    carom_contact_destroy(s);
    contact_case_free(&c);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bad_input_is_refused),
        cmocka_unit_test(settings_are_checked),
        cmocka_unit_test(residual_of_a_wrong_point),
        cmocka_unit_test(repeats_bit_for_bit),
        cmocka_unit_test(threads_do_not_matter),
        cmocka_unit_test(order_of_contacts_does_not_matter),
        cmocka_unit_test(passes_follow_the_constants),
        cmocka_unit_test(good_guess_takes_one_factorization),
        cmocka_unit_test(tall_stack_at_rest_costs_nothing),
        cmocka_unit_test(no_allocation_in_steady_state),
        cmocka_unit_test(every_allocation_may_fail),
        cmocka_unit_test(caller_relaxes_what_the_certificate_names),
        cmocka_unit_test(failure_is_reported),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
