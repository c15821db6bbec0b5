/* Random problems by family: those with c = 0 have a solution, which is found in at least 99.5 of
 * 100; whatever the status says, the residual recomputed here agrees. */
#include "carom/contact.h"
#include "contact_families.h"
#include "near.h"

enum { N_EACH = 100 };

/* Agreement of two computations of the residual: rounding of terms of up to 1e5 V [1]. */
#define RESIDUAL_ROUNDING 1e-11

static void families_are_solved(void **state)
{
    (void)state;
    carom_contact_solver *s;
    int n = 0;
    int n_missed = 0;
    assert_int_equal(carom_contact_create(NULL, NULL, &s), CAROM_OK);
    for (int f = 0; f < n_contact_families; f++) {
        int n_solved = 0;
        int n_infeasible = 0;
        for (uint64_t i = 0; i < N_EACH; i++) {
            rng r = rng_from(1000 * (uint64_t)f + i);
            contact_case c = contact_families[f].make(&r);
            carom_contact_stats st;
            const carom_status status = carom_contact_solve(s, &c.p, CAROM_GUESS_NONE, &c.x, &st);
            if (status != CAROM_E_INFEASIBLE)
                assert_near_case(contact_families[f].name, (int)i, st.residual,
                                 contact_case_residual(&c), RESIDUAL_ROUNDING);
            if (status == CAROM_OK) assert_at_most("solved", contact_case_residual(&c), 1e-10);
            if (contact_families[f].solvable && status != CAROM_OK) {
                print_message("%s %d: %s, residual %.1e\n", contact_families[f].name, (int)i,
                              carom_status_name(status), st.residual);
                assert_int_not_equal(status, CAROM_E_INFEASIBLE);
                n_missed++;
            }
            n += contact_families[f].solvable;
            n_solved += status == CAROM_OK;
            n_infeasible += status == CAROM_E_INFEASIBLE;
            contact_case_free(&c);
        }
        print_message("%-12s %3d of %d solved, %d infeasible\n", contact_families[f].name, n_solved,
                      N_EACH, n_infeasible);
    }
    carom_contact_destroy(s);
    assert_in_range(n_missed, 0, n / 200);
}

/* Cold piles of 300 discs that jam (mu about tan 30 degrees): damped steps find what the interior
 * point, sweeps and restarts miss, on the way from any of their ends. */
static void jammed_piles_are_solved(void **state)
{
    (void)state;
    const uint64_t seeds[] = {7001, 7005};
    carom_contact_solver *s;
    assert_int_equal(carom_contact_create(NULL, NULL, &s), CAROM_OK);
    for (int i = 0; i < 2; i++) {
        rng r = rng_from(seeds[i]);
        contact_case c = contact_discs(&r, 300, 0.5, 0.8);
        carom_contact_stats st;
        assert_int_equal(carom_contact_solve(s, &c.p, CAROM_GUESS_NONE, &c.x, &st), CAROM_OK);
        assert_int_equal(st.stage, CAROM_STAGE_SWEEPS);
        assert_at_most("jammed", contact_case_residual(&c), 1e-10);
        contact_case_free(&c);
    }
    carom_contact_destroy(s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(families_are_solved),
                                       cmocka_unit_test(jammed_piles_are_solved)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
