/* The contact solver: closed forms, degenerate and refused input, memory, repeatability. */
#include "alloc_fail.h"
#include "carom/contact.h"
#include "contact_case.h"
#include "near.h"
#include "rng.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double GRAVITY = 9.81;
static const double STEP = 0.01;
static const double UP[2] = {0, 1};

/* Impulses follow from rows of order 1: a few units of rounding [1]. */
#define CLOSE 1e-12

static carom_contact_stats solve_ok(contact_case *c)
{
    carom_contact_solver *s;
    carom_contact_stats st;
    assert_int_equal(carom_contact_create(NULL, NULL, &s), CAROM_OK);
    assert_int_equal(carom_contact_solve(s, &c->p, 0, &c->x, &st), CAROM_OK);
    assert_at_most("residual", contact_case_residual(c), 1e-10);
    carom_contact_destroy(s);
    return st;
}

/* Box of unit width on two corners: contacts at +-1/2. */
static void add_feet(contact_case *c, int below, int above, double mu)
{
    for (int e = -1; e <= 1; e += 2) {
        const double low[2] = {0.5 * e, 0.5};
        const double high[2] = {0.5 * e, -0.5};
        contact_case_contact(c, below, above, low, high, UP, mu, 0);
    }
}

/* n boxes on the ground; box i has mass base^(i / (n - 1) * power). */
static contact_case make_stack(int n, double top_mass, double mu, double push)
{
    contact_case c = contact_case_new(n, 2 * n, 0);
    for (int i = 0; i < n; i++) {
        const double m = i == n - 1 ? top_mass : 1;
        contact_case_body(&c, i, m, m / 6, 0, push, -GRAVITY * STEP);
        add_feet(&c, i - 1, i, mu);
    }
    return c;
}

/* EQUATIONS 6: l_i = g h (sum of masses above), split equally at two corners. */
static void stack_carries_its_weight(void **state)
{
    (void)state;
    const double top[] = {1, 1e4, 1e8, 1e-4};
    for (int q = 0; q < 4; q++) {
        const int n = 5;
        contact_case c = make_stack(n, top[q], 0.5, 0);
        solve_ok(&c);
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
        add_feet(&c, -1, 0, 0.3);
        solve_ok(&c);
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
        solve_ok(&c);
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
    solve_ok(&c); /* vertical chain at rest: every joint carries what hangs below */
    double below = 0;
    for (int i = n - 1; i >= 0; i--) {
        below += 1 / c.inv_mass[3 * i + 1] * GRAVITY * STEP;
        assert_near(c.x.le[2 * i], 0, 1e-9 * below);
        assert_near(c.x.le[2 * i + 1], -below, 1e-9 * below);
    }
    for (int i = 0; i < 3 * n; i++) assert_near(c.x.v[i], 0, 1e-10 * GRAVITY * STEP);
    c.u[3 * (n - 1) + 1] = pull;
    const carom_contact_stats st = solve_ok(&c);
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
        solve_ok(&c);
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
    add_feet(&c, 0, 1, 0.5);
    solve_ok(&c);
    assert_near(c.x.v[1], belt, 0);
    assert_near(c.x.v[4], belt, CLOSE); /* 0.02 < mu g h = 0.049: sticks */
    c.u[1] = 3;
    solve_ok(&c);
    assert_near(c.x.v[4], 0.5 * GRAVITY * STEP, CLOSE);
    /* The same through c_t, with the ground at rest. */
    contact_case d = contact_case_new(1, 2, 0);
    contact_case_body(&d, 0, 2, 0.4, 0, 0, -GRAVITY * STEP);
    add_feet(&d, -1, 0, 0.5);
    d.ct[0] = d.ct[1] = belt; /* J_t v = -vx */
    solve_ok(&d);
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
    solve_ok(&c);
    assert_near(c.x.v[0], 0.125, 0);
    assert_near(c.x.v[2], -0.5 * 0.125, CLOSE); /* the foot rests: v_y + omega r_x = 0 */
    contact_case_free(&c);
}

static void nothing_to_solve(void **state)
{
    (void)state;
    contact_case c = contact_case_new(0, 0, 0);
    carom_contact_stats st = solve_ok(&c);
    assert_int_equal(st.stage, CAROM_STAGE_NONE);
    contact_case_free(&c);
    c = contact_case_new(3, 0, 0);
    for (int i = 0; i < 9; i++) c.u[i] = i - 4.5;
    c.inv_mass[0] = 2;
    st = solve_ok(&c);
    assert_int_equal(st.factorizations, 0);
    assert_near(st.residual, 0, 0);
    assert_near_array("free flight", 9, c.x.v, c.u, 0);
    contact_case_free(&c);
}

/* A contact that the free motion opens costs no factorization, with any guess. */
static void open_contacts_cost_nothing(void **state)
{
    (void)state;
    contact_case c = make_stack(3, 1, 0.5, 0);
    for (int i = 0; i < 3; i++) c.u[3 * i + 2] = 1 + i;
    carom_contact_stats st = solve_ok(&c);
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
    add_feet(&c, -1, 3, 0.5);
    contact_case_hinge(&c, -1, 4, zero, up);
    contact_case_hinge(&c, 4, 5, zero, up);
    add_feet(&c, -1, 6, 0.5);
    c.u[3 * 6 + 2] = 1;
    add_feet(&c, 8, 7, 0.5);
    contact_case_contact(&c, -1, 8, zero, zero, UP, 0.5, 0); /* prescribed */
    const carom_contact_stats st = solve_ok(&c);
    assert_int_equal(st.islands, 4);
    assert_int_equal(st.bodies, 5);
    assert_int_equal(st.contacts, 6);
    assert_int_equal(st.joint_rows, 4);
    assert_int_equal(st.factorizations, 3); /* the open box has none */
    /* Two boxes alone; two links and two hinges, coupled by three pairs, at most all of them. */
    assert_in_range(st.blocks, 1 + 1 + 4 + 2 * 3, 1 + 1 + 4 * 4);
    contact_case_free(&c);
}

/* Islands do not see each other: the same bits with and without a second stack. */
static void islands_are_solved_apart(void **state)
{
    (void)state;
    contact_case one = make_stack(4, 3, 0.5, 0.03);
    contact_case two = contact_case_new(7, 14, 0);
    for (int i = 0; i < 7; i++) {
        const int first = i < 3;
        const double m = i == 6 ? 3 : 1;
        contact_case_body(&two, i, m, m / 6, 0, first ? 2 : 0.03, -GRAVITY * STEP);
        add_feet(&two, i == 3 ? -1 : i - 1, i, first ? 0.1 : 0.5);
    }
    solve_ok(&one);
    solve_ok(&two);
    assert_memory_equal(two.x.v + 9, one.x.v, 12 * sizeof(double));
    assert_memory_equal(two.x.ln + 6, one.x.ln, 8 * sizeof(double));
    contact_case_free(&one);
    contact_case_free(&two);
}

/* Zero tangential row, frictionless contacts whose tangential rows are not numbers, no J_t. */
static void absent_friction_is_left_out(void **state)
{
    (void)state;
    contact_case c = make_stack(2, 1, 0.5, 0.3);
    for (int i = 0; i < 6 * 4; i++) c.jt[i] = 0;
    solve_ok(&c);
    assert_near(c.x.v[1], 0.3, CLOSE);
    assert_near(c.x.lt[0], 0, 0);
    for (int k = 0; k < 4; k++) c.mu[k] = 0;
    for (int i = 0; i < 6 * 4; i++) c.jt[i] = NAN;
    solve_ok(&c);
    c.p.jt = NULL;
    c.p.ct = NULL;
    solve_ok(&c);
    assert_near(c.x.v[4], 0.3, CLOSE);
    contact_case_free(&c);
}

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
    add_feet(&c, -1, 0, 0.5);
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
    contact_case c = make_stack(2, 1, 0.5, 0);
    solve_ok(&c);
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

/* Many stacks and chains, pushed at random. */
static contact_case make_mixed(uint64_t seed, int n_parts)
{
    rng r = rng_from(seed);
    const int n = 4 * n_parts;
    contact_case c = contact_case_new(n, 2 * n, 2 * n);
    for (int i = 0; i < n; i++) {
        const double m = exp(rng_uniform(&r, -2, 2));
        contact_case_body(&c, i, m, m / 6, 0, rng_uniform(&r, -0.2, 0.2), -GRAVITY * STEP);
        const double up[2] = {0.1, 0.5};
        const double down[2] = {-0.2, -0.5};
        if (i % 4 < 3)
            add_feet(&c, i % 4 ? i - 1 : -1, i, rng_uniform(&r, 0, 0.6));
        else
            contact_case_hinge(&c, i - 1, i, down, up);
    }
    return c;
}

static void repeats_bit_for_bit(void **state)
{
    (void)state;
    contact_case c = make_mixed(3, 6);
    contact_case d = contact_case_copy(&c);
    contact_case other = make_mixed(4, 5);
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
    contact_case one = make_mixed(21, 200);
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
        contact_case c = make_mixed(seed, 3);
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
        solve_ok(&c);
        solve_ok(&d);
        /* Two solutions of residual 1e-10 V, V about 0.2 m/s, well conditioned. */
        assert_near_array("shuffled", 3 * c.p.n_bodies, d.x.v, c.x.v, 1e-10);
        contact_case_free(&c);
        contact_case_free(&d);
    }
}

/* A solution as the guess: of the same problem it takes no factorization, of a neighbor one, also
 * where many impulses give the same motion; modes alone take one where they fit the impulses
 * nearest to zero. */
static void good_guess_takes_one_factorization(void **state)
{
    (void)state;
    for (int pushed = 0; pushed < 2; pushed++) {
        contact_case c = make_stack(6, 10, 0.5, 0.02 * pushed);
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
        assert_int_equal(st.factorizations, 1);
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

static void no_allocation_in_steady_state(void **state)
{
    (void)state;
    alloc_fail a = alloc_fail_never();
    const carom_allocator from = alloc_fail_allocator(&a);
    carom_contact_solver *s;
    contact_case c = make_mixed(7, 8);
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
    contact_case c = make_mixed(8, 3);
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
    contact_case c = make_mixed(9, 2);
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
        cmocka_unit_test(islands_are_solved_apart),
        cmocka_unit_test(absent_friction_is_left_out),
        cmocka_unit_test(bad_input_is_refused),
        cmocka_unit_test(settings_are_checked),
        cmocka_unit_test(residual_of_a_wrong_point),
        cmocka_unit_test(repeats_bit_for_bit),
        cmocka_unit_test(threads_do_not_matter),
        cmocka_unit_test(order_of_contacts_does_not_matter),
        cmocka_unit_test(good_guess_takes_one_factorization),
        cmocka_unit_test(no_allocation_in_steady_state),
        cmocka_unit_test(every_allocation_may_fail),
        cmocka_unit_test(failure_is_reported),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
