/* The contact solver: closed forms, degenerate problems, and what is left out. */
#include "carom/contact.h"
#include "contact_case.h"
#include "contact_parts.h"
#include "near.h"
#include "rng.h"

#include <stdlib.h>
#include <string.h>

static const double UP[2] = {0, 1};

/* EQUATIONS 6: l_i = g h (sum of masses above), split equally at two corners. */
static void stack_carries_its_weight(void **state)
{
    (void)state;
    const double top[] = {1, 1e4, 1e8, 1e-4};
    for (int q = 0; q < 4; q++) {
        const int n = 5;
        contact_case c = contact_stack(n, top[q], 0.5, 0);
        contact_solve_ok(&c);
        for (int i = 0; i < n; i++) {
            const double above = (n - 1 - i) + top[q];
            const double each = 0.5 * GRAVITY * STEP * above;
            for (int e = 0; e < 2; e++) {
                /* The rest velocity 1e-16 of the velocity scale, times the mass on top. */
                assert_near(c.x.ln[2 * i + e], each, 1e-10 * (1 + top[q]) * GRAVITY * STEP);
                assert_int_equal(c.x.mode[2 * i + e], CAROM_STICK);
            }
        }
        for (int i = 0; i < 3 * n; i++) assert_near(c.x.v[i], 0, 1e-10 * GRAVITY * STEP);
        contact_case_free(&c);
    }
}

/* A point mass on a slope of the velocity plane: slips when |p_t| > mu p_n. */
static void block_slides_or_sticks(void **state)
{
    (void)state;
    const double mass = 3;
    for (int slide = -1; slide <= 1; slide++) {
        contact_case c = contact_case_new(1, 2, 0);
        const double vx = slide * 2.0 + 0.01;
        contact_case_body(&c, 0, mass, mass / 6, 0, vx, -GRAVITY * STEP);
        contact_feet(&c, -1, 0, 0.3);
        contact_solve_ok(&c);
        const double grip = 0.3 * GRAVITY * STEP;
        const double sign = vx > 0 ? 1 : -1;
        const double expected = fabs(vx) <= grip ? 0 : vx - sign * grip;
        assert_near(c.x.v[1], expected, CLOSE);
        assert_near(c.x.v[0], 0, CLOSE);
        assert_near(c.x.v[2], 0, CLOSE);
        assert_near(c.x.ln[0] + c.x.ln[1], mass * GRAVITY * STEP, CLOSE);
        /* t = (-1, 0): a box that moves along +x slides along -t, which l_t > 0 opposes. */
        const int mode = fabs(vx) <= grip ? CAROM_STICK
                         : vx > 0         ? CAROM_SLIP_PLUS
                                          : CAROM_SLIP_MINUS;
        assert_int_equal(c.x.mode[0], mode);
        assert_int_equal(c.x.mode[1], mode);
        contact_case_free(&c);
    }
}

/* Disc against a floor, EQUATIONS 6 "oblique impact": sticks iff |u| <= 3 mu (1 + e) v_n. */
static void disc_impact_sticks_or_slips(void **state)
{
    (void)state;
    const double r = 0.5;
    const double mass = 2;
    const double restitution = 0.6;
    const double vn = 1.5;
    const double mu = 0.2;
    const double tangential[] = {0.7, 3, -3};
    for (int q = 0; q < 3; q++) {
        const double omega = 0.4;
        const double vt = tangential[q];
        const double u = vt + omega * r;
        contact_case c = contact_case_new(1, 1, 0);
        contact_case_body(&c, 0, mass, 0.5 * mass * r * r, omega, vt, -vn);
        const double zero[2] = {0, 0};
        const double down[2] = {0, -r};
        contact_case_contact(&c, -1, 0, zero, down, UP, mu, -restitution * vn);
        contact_solve_ok(&c);
        const double jump = (1 + restitution) * vn;
        const int sticks = fabs(u) <= 3 * mu * jump;
        const double dv = sticks ? -u / 3 : -mu * jump * (u > 0 ? 1 : -1);
        const double domega = sticks ? -2 * u / (3 * r) : -2 * mu * jump * (u > 0 ? 1 : -1) / r;
        assert_near(c.x.v[2], restitution * vn, CLOSE);
        assert_near(c.x.v[1], vt + dv, CLOSE);
        assert_near(c.x.v[0], omega + domega, CLOSE);
        assert_near(c.x.ln[0], mass * jump, CLOSE);
        contact_case_free(&c);
    }
}

/* n links of weight w hang from the world, pulled by H: force of joint i is (H, sum of weights). */
static void chain_hangs(void **state)
{
    (void)state;
    const int n = 30;
    contact_case c = contact_case_new(n, 0, 2 * n);
    const double pull = 0.7;
    for (int i = 0; i < n; i++) {
        const double m = i % 2 ? 1e3 : 1;
        const double down[2] = {0, -0.5};
        const double up[2] = {0, 0.5};
        contact_case_body(&c, i, m, m / 12, 0, 0, -GRAVITY * STEP);
        contact_case_hinge(&c, i - 1, i, down, up);
    }
    contact_solve_ok(&c); /* vertical chain at rest: every joint carries what hangs below */
    double below = 0;
    for (int i = n - 1; i >= 0; i--) {
        below += 1 / c.inv_mass[3 * i + 1] * GRAVITY * STEP;
        assert_near(c.x.le[2 * i], 0, 1e-9 * below);
        assert_near(c.x.le[2 * i + 1], -below, 1e-9 * below);
    }
    for (int i = 0; i < 3 * n; i++) assert_near(c.x.v[i], 0, 1e-10 * GRAVITY * STEP);
    c.u[3 * (n - 1) + 1] = pull;
    const carom_contact_stats st = contact_solve_ok(&c);
    assert_int_equal(st.factorizations, 1);
    contact_case_free(&c);
}

/* The same hinge three times, and a loop: consistent redundant rows. */
static void redundant_joints_change_nothing(void **state)
{
    (void)state;
    const double ra[2] = {0.5, 0.1};
    const double rb[2] = {-0.4, 0.2};
    double v[2][6];
    for (int twice = 0; twice < 2; twice++) {
        contact_case c = contact_case_new(2, 0, 10);
        contact_case_body(&c, 0, 1, 0.3, 0.2, 1, -1);
        contact_case_body(&c, 1, 5, 0.7, -0.5, 0.3, 2);
        contact_case_hinge(&c, -1, 0, ra, ra);
        for (int k = 0; k <= 3 * twice; k++) contact_case_hinge(&c, 0, 1, ra, rb);
        contact_solve_ok(&c);
        memcpy(v[twice], c.x.v, sizeof v[twice]);
        contact_case_free(&c);
    }
    assert_near_array("redundant", 6, v[1], v[0], CLOSE);
}

/* Conflicting joints: one point held at two velocities. */
static void conflicting_joints_are_infeasible(void **state)
{
    (void)state;
    const double r[2] = {0.5, 0.1};
    carom_contact_solver *s;
    carom_contact_stats st;
    contact_case c = contact_case_new(1, 0, 4);
    contact_case_body(&c, 0, 1, 0.3, 0.2, 1, -1);
    contact_case_hinge(&c, -1, 0, r, r);
    contact_case_hinge(&c, -1, 0, r, r);
    c.ce[3] = 0.5;
    assert_int_equal(carom_contact_create(NULL, NULL, &s), CAROM_OK);
    c.x.v[0] = 77;
    assert_int_equal(carom_contact_solve(s, &c.p, 0, &c.x, &st), CAROM_E_INFEASIBLE);
    assert_near(c.x.v[0], 77, 0); /* outputs untouched */
    double y[4];
    assert_int_equal(carom_contact_certificate(s, NULL, y), CAROM_OK);
    assert_near(y[1] + y[3], 0, 1e-8 * fabs(y[3])); /* the rows cancel, as far as certified */
    assert_true(y[3] * c.ce[3] < 0);
    c.ce[3] = 0;
    assert_int_equal(carom_contact_solve(s, &c.p, 0, &c.x, &st), CAROM_OK);
    assert_int_equal(carom_contact_certificate(s, NULL, y), CAROM_E_STATE);
    carom_contact_destroy(s);
    contact_case_free(&c);
}

/* A ball driven between two walls that approach: no v has both contacts open. */
static void crushed_ball_is_infeasible(void **state)
{
    (void)state;
    const double right[2] = {1, 0};
    const double zero[2] = {0, 0};
    carom_contact_solver *s;
    carom_contact_stats st;
    contact_case c = contact_case_new(3, 2, 0);
    contact_case_body(&c, 1, 1, 0.3, 0, 0, 0);
    c.u[1] = 1;  /* prescribed: W = 0 */
    c.u[7] = -1; /* prescribed */
    contact_case_contact(&c, 0, 1, zero, zero, right, 0.5, 0);
    contact_case_contact(&c, 1, 2, zero, zero, right, 0.5, 0);
    assert_int_equal(carom_contact_create(NULL, NULL, &s), CAROM_OK);
    assert_int_equal(carom_contact_solve(s, &c.p, 0, &c.x, &st), CAROM_E_INFEASIBLE);
    double y[2];
    assert_int_equal(carom_contact_certificate(s, y, NULL), CAROM_OK);
    assert_true(y[0] > 0);
    assert_near(y[0], y[1], CLOSE * y[0]);
    c.u[7] = 1.5; /* the far wall leaves faster */
    assert_int_equal(carom_contact_solve(s, &c.p, 0, &c.x, &st), CAROM_OK);
    assert_near(c.x.v[4], 1, CLOSE);
    assert_int_equal(c.x.mode[1], CAROM_SEPARATED);
    carom_contact_destroy(s);
    contact_case_free(&c);
}

/* Bodies with W = 0 on both sides: the row is a fact, not an unknown. */
static void prescribed_rows_are_checked(void **state)
{
    (void)state;
    const double zero[2] = {0, 0};
    carom_contact_solver *s;
    carom_contact_stats st;
    contact_case c = contact_case_new(2, 2, 2);
    contact_case_contact(&c, 0, 1, zero, zero, UP, 0.5, 0);
    contact_case_contact(&c, -1, -1, zero, zero, UP, 0.5, 0);
    contact_case_hinge(&c, -1, 0, zero, zero);
    assert_int_equal(carom_contact_create(NULL, NULL, &s), CAROM_OK);
    assert_int_equal(carom_contact_solve(s, &c.p, 0, &c.x, &st), CAROM_OK);
    assert_int_equal(st.factorizations, 0);
    assert_int_equal(st.stage, CAROM_STAGE_NONE);
    c.u[5] = 0.25; /* body 1 rises: the contact opens */
    assert_int_equal(carom_contact_solve(s, &c.p, 0, &c.x, &st), CAROM_OK);
    assert_near(c.x.v[5], 0.25, 0);
    assert_int_equal(c.x.mode[0], CAROM_SEPARATED);
    c.u[5] = -0.25; /* approaches a body that cannot yield */
    assert_int_equal(carom_contact_solve(s, &c.p, 0, &c.x, &st), CAROM_E_INFEASIBLE);
    c.u[5] = 0;
    c.u[1] = 1; /* the hinge would have to slide */
    assert_int_equal(carom_contact_solve(s, &c.p, 0, &c.x, &st), CAROM_E_INFEASIBLE);
    carom_contact_destroy(s);
    contact_case_free(&c);
}

/* A moving belt (W = 0) carries a box along until it sticks. */
static void belt_carries_a_box(void **state)
{
    (void)state;
    contact_case c = contact_case_new(2, 2, 0);
    const double belt = 0.02;
    c.u[1] = belt;
    contact_case_body(&c, 1, 2, 0.4, 0, 0, -GRAVITY * STEP);
    contact_feet(&c, 0, 1, 0.5);
    contact_solve_ok(&c);
    assert_near(c.x.v[1], belt, 0);
    assert_near(c.x.v[4], belt, CLOSE); /* 0.02 < mu g h = 0.049: sticks */
    c.u[1] = 3;
    contact_solve_ok(&c);
    assert_near(c.x.v[4], 0.5 * GRAVITY * STEP, CLOSE);
    /* The same through c_t, with the ground at rest. */
    contact_case d = contact_case_new(1, 2, 0);
    contact_case_body(&d, 0, 2, 0.4, 0, 0, -GRAVITY * STEP);
    contact_feet(&d, -1, 0, 0.5);
    d.ct[0] = d.ct[1] = belt; /* J_t v = -vx */
    contact_solve_ok(&d);
    assert_near(d.x.v[1], belt, CLOSE);
    contact_case_free(&c);
    contact_case_free(&d);
}

/* Inertia prescribed (W_0 = 0): the box cannot turn, one foot suffices. */
static void locked_axis_stays(void **state)
{
    (void)state;
    contact_case c = contact_case_new(1, 1, 0);
    const double zero[2] = {0, 0};
    const double foot[2] = {0.5, -0.5};
    contact_case_body(&c, 0, 2, 1, 0.125, 0, -GRAVITY * STEP);
    c.inv_mass[0] = 0;
    contact_case_contact(&c, -1, 0, zero, foot, UP, 0.5, 0);
    contact_solve_ok(&c);
    assert_near(c.x.v[0], 0.125, 0);
    assert_near(c.x.v[2], -0.5 * 0.125, CLOSE); /* the foot rests: v_y + omega r_x = 0 */
    contact_case_free(&c);
}

static void nothing_to_solve(void **state)
{
    (void)state;
    contact_case c = contact_case_new(0, 0, 0);
    carom_contact_stats st = contact_solve_ok(&c);
    assert_int_equal(st.stage, CAROM_STAGE_NONE);
    contact_case_free(&c);
    c = contact_case_new(3, 0, 0);
    for (int i = 0; i < 9; i++) c.u[i] = i - 4.5;
    c.inv_mass[0] = 2;
    st = contact_solve_ok(&c);
    assert_int_equal(st.factorizations, 0);
    assert_near(st.residual, 0, 0);
    assert_near_array("free flight", 9, c.x.v, c.u, 0);
    contact_case_free(&c);
}

/* A contact that the free motion opens costs no factorization, with any guess. */
static void open_contacts_cost_nothing(void **state)
{
    (void)state;
    contact_case c = contact_stack(3, 1, 0.5, 0);
    for (int i = 0; i < 3; i++) c.u[3 * i + 2] = 1 + i;
    carom_contact_stats st = contact_solve_ok(&c);
    assert_int_equal(st.factorizations, 0);
    assert_int_equal(st.stage, CAROM_STAGE_NONE);
    assert_near_array("open", 9, c.x.v, c.u, 0);
    contact_case_free(&c);
}

/* Of three bodies in free flight, a box at rest, a chain of two, a box above the ground and a box
 * that rubs on a wall with W = 0, only what touches is in the counts. */
static void absent_parts_are_left_out(void **state)
{
    (void)state;
    contact_case c = contact_case_new(9, 7, 4);
    const double zero[2] = {0, 0};
    const double up[2] = {0, 0.5};
    for (int i = 0; i < 8; i++) contact_case_body(&c, i, 1, 0.2, 0, 0, -GRAVITY * STEP);
    contact_feet(&c, -1, 3, 0.5);
    contact_case_hinge(&c, -1, 4, zero, up);
    contact_case_hinge(&c, 4, 5, zero, up);
    contact_feet(&c, -1, 6, 0.5);
    c.u[3 * 6 + 2] = 1;
    contact_feet(&c, 8, 7, 0.5);
    contact_case_contact(&c, -1, 8, zero, zero, UP, 0.5, 0); /* prescribed */
    const carom_contact_stats st = contact_solve_ok(&c);
    assert_int_equal(st.islands, 4);
    assert_int_equal(st.bodies, 5);
    assert_int_equal(st.contacts, 6);
    assert_int_equal(st.joint_rows, 4);
    assert_int_equal(st.factorizations, 3); /* the open box has none */
    contact_case_free(&c);
}

static carom_factor_size factor_size_of(contact_case *c)
{
    carom_contact_solver *s;
    assert_int_equal(carom_contact_create(NULL, NULL, &s), CAROM_OK);
    assert_true(carom_contact_factor_size(s).nonzeros == 0);
    assert_int_equal(carom_contact_solve(s, &c->p, 0, &c->x, NULL), CAROM_OK);
    const carom_factor_size z = carom_contact_factor_size(s);
    carom_contact_destroy(s);
    return z;
}

/* A stack is a chain of blocks without fill.  Per block 3 reciprocals, 3 quotients and 5 updates of
 * two flops; per pair two panels of 18 and 27 and one product of 54. */
static void factors_of_a_stack(void **state)
{
    (void)state;
    for (int n = 1; n <= 7; n += 3) {
        contact_case c = contact_stack(n, 1, 0.5, 0);
        const carom_factor_size z = factor_size_of(&c);
        assert_true(z.nonzeros == 9 * (n + 2 * (n - 1)));
        assert_true(z.flops == 16 * n + (18 + 27 + 54) * (n - 1));
        contact_case_free(&c);
    }
}

/* Islands do not see each other: the same bits with and without a second stack. */
static void islands_are_solved_apart(void **state)
{
    (void)state;
    contact_case one = contact_stack(4, 3, 0.5, 0.03);
    contact_case two = contact_case_new(7, 14, 0);
    for (int i = 0; i < 7; i++) {
        const int first = i < 3;
        const double m = i == 6 ? 3 : 1;
        contact_case_body(&two, i, m, m / 6, 0, first ? 2 : 0.03, -GRAVITY * STEP);
        contact_feet(&two, i == 3 ? -1 : i - 1, i, first ? 0.1 : 0.5);
    }
    contact_solve_ok(&one);
    contact_solve_ok(&two);
    assert_memory_equal(two.x.v + 9, one.x.v, 12 * sizeof(double));
    assert_memory_equal(two.x.ln + 6, one.x.ln, 8 * sizeof(double));
    contact_case_free(&one);
    contact_case_free(&two);
}

/* Zero tangential row, frictionless contacts whose tangential rows are not numbers, no J_t. */
static void absent_friction_is_left_out(void **state)
{
    (void)state;
    contact_case c = contact_stack(2, 1, 0.5, 0.3);
    for (int i = 0; i < 6 * 4; i++) c.jt[i] = 0;
    contact_solve_ok(&c);
    assert_near(c.x.v[1], 0.3, CLOSE);
    assert_near(c.x.lt[0], 0, 0);
    for (int k = 0; k < 4; k++) c.mu[k] = 0;
    for (int i = 0; i < 6 * 4; i++) c.jt[i] = NAN;
    contact_solve_ok(&c);
    c.p.jt = NULL;
    c.p.ct = NULL;
    contact_solve_ok(&c);
    assert_near(c.x.v[4], 0.3, CLOSE);
    contact_case_free(&c);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(stack_carries_its_weight),
        cmocka_unit_test(block_slides_or_sticks),
        cmocka_unit_test(disc_impact_sticks_or_slips),
        cmocka_unit_test(chain_hangs),
        cmocka_unit_test(redundant_joints_change_nothing),
        cmocka_unit_test(conflicting_joints_are_infeasible),
        cmocka_unit_test(crushed_ball_is_infeasible),
        cmocka_unit_test(prescribed_rows_are_checked),
        cmocka_unit_test(belt_carries_a_box),
        cmocka_unit_test(locked_axis_stays),
        cmocka_unit_test(nothing_to_solve),
        cmocka_unit_test(open_contacts_cost_nothing),
        cmocka_unit_test(absent_parts_are_left_out),
        cmocka_unit_test(factors_of_a_stack),
        cmocka_unit_test(islands_are_solved_apart),
        cmocka_unit_test(absent_friction_is_left_out),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
