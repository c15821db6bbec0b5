/* Small random problems against enumeration: all modes of all contacts are tried, so that a problem
 * the solver gives up on is shown to have no solution (with c != 0 it need not have one), and a
 * problem without one is never called solved. */
#include "carom/contact.h"
#include "contact_case.h"
#include "near.h"
#include "rng.h"

#include <stdlib.h>
#include <string.h>

enum { N_BODIES = 5, N_CONTACTS = 6, N_ROWS = 4, N_CASES = 200 };
enum { V = 3 * N_BODIES, L = V + 2 * N_CONTACTS, N = L + N_ROWS };

/* Four moving bodies, a belt with W = 0; six contacts, two hinges. */
static contact_case make_random(rng *r, double mu_max)
{
    static const int pairs[N_CONTACTS][2] = {{-1, 0}, {0, 1}, {1, 2}, {4, 2}, {3, 4}, {2, 3}};
    contact_case c = contact_case_new(N_BODIES, N_CONTACTS, N_ROWS);
    for (int b = 0; b < N_BODIES - 1; b++) {
        const double mass = exp(rng_uniform(r, -1, 1));
        const double inertia = exp(rng_uniform(r, -2, 0));
        contact_case_body(&c, b, mass, inertia, rng_uniform(r, -1, 1), 0, 0);
        c.u[3 * b + 1] = rng_uniform(r, -1, 1);
        c.u[3 * b + 2] = rng_uniform(r, -1, 1);
    }
    for (int i = 12; i < 15; i++) c.u[i] = rng_uniform(r, -0.5, 0.5);
    for (int k = 0; k < N_CONTACTS + 2; k++) {
        double arm[4];
        for (int i = 0; i < 4; i++) arm[i] = rng_uniform(r, -1, 1);
        const double angle = rng_uniform(r, -3, 3);
        const double n[2] = {cos(angle), sin(angle)};
        if (k == N_CONTACTS) c.ce[contact_case_hinge(&c, 4, 0, arm, arm + 2)] = 0.1;
        if (k > N_CONTACTS) contact_case_hinge(&c, 1, 3, arm, arm + 2);
        if (k >= N_CONTACTS) continue;
        const double mu = rng_unit(r) < 0.2 ? 0 : rng_uniform(r, 0.1, mu_max);
        contact_case_contact(&c, pairs[k][0], pairs[k][1], arm, arm + 2, n, mu,
                             rng_uniform(r, -0.5, 0.1));
        c.ct[k] = rng_uniform(r, -0.2, 0.2);
    }
    return c;
}

/* b <- A^-1 b by Gauss with row exchanges; -1 when singular. */
static int gauss(double a[N][N], double *b)
{
    for (int j = 0; j < N; j++) {
        int p = j;
        for (int i = j + 1; i < N; i++) p = fabs(a[i][j]) > fabs(a[p][j]) ? i : p;
        if (fabs(a[p][j]) < 1e-13) return -1;
        for (int k = 0; k < N; k++) {
            const double t = a[p][k];
            a[p][k] = a[j][k];
            a[j][k] = t;
        }
        const double t = b[p];
        b[p] = b[j];
        b[j] = t;
        for (int i = j + 1; i < N; i++) {
            const double l = a[i][j] / a[j][j];
            if (l == 0) continue;
            for (int k = j; k < N; k++) a[i][k] -= l * a[j][k];
            b[i] -= l * b[j];
        }
    }
    for (int i = N - 1; i >= 0; i--) {
        for (int k = i + 1; k < N; k++) b[i] -= a[i][k] * b[k];
        b[i] /= a[i][i];
    }
    return 0;
}

/* Column `to` gets -W row', row `to` gets row when `held`. */
static void put_row(const contact_case *c, const double *row, const int *body, int to, int held,
                    double a[N][N])
{
    for (int i = 0; i < 6; i++) {
        const int at = 3 * body[i / 3] + i % 3;
        if (body[i / 3] < 0) continue;
        a[at][to] -= c->inv_mass[at] * row[i];
        if (held) a[to][at] += row[i];
    }
}

/* The solution of the equations of these modes into c->x; -1 when singular. */
static int solve_modes(contact_case *c, const int *mode)
{
    double a[N][N] = {{0}};
    double b[N] = {0};
    for (int i = 0; i < V; i++) {
        a[i][i] = 1;
        b[i] = c->u[i];
    }
    for (int k = 0; k < N_CONTACTS; k++) {
        const int n = V + 2 * k;
        const int t = n + 1;
        const int *body = c->contact_body + 2 * k;
        const int sticks = mode[k] == CAROM_STICK && c->mu[k] > 0;
        put_row(c, c->jn + 6 * k, body, n, mode[k] != CAROM_SEPARATED, a);
        put_row(c, c->jt + 6 * k, body, t, sticks, a);
        b[n] = mode[k] ? -c->cn[k] : 0;
        b[t] = sticks ? -c->ct[k] : 0;
        if (!mode[k]) a[n][n] = 1;
        if (!sticks) a[t][t] = 1;
        if (mode[k] > CAROM_STICK) a[t][n] = mode[k] == CAROM_SLIP_PLUS ? -c->mu[k] : c->mu[k];
    }
    for (int r = 0; r < N_ROWS; r++) {
        put_row(c, c->je + 6 * r, c->joint_body + 2 * r, L + r, 1, a);
        b[L + r] = -c->ce[r];
    }
    if (gauss(a, b)) return -1;
    memcpy(c->x.v, b, V * sizeof(double));
    for (int k = 0; k < N_CONTACTS; k++) {
        c->x.ln[k] = b[V + 2 * k];
        c->x.lt[k] = b[V + 2 * k + 1];
    }
    memcpy(c->x.le, b + L, N_ROWS * sizeof(double));
    return 0;
}

/* Smallest residual over all modes. */
static double enumerate(contact_case *c)
{
    double best = HUGE_VAL;
    for (int m = 0; m < 1 << (2 * N_CONTACTS); m++) {
        int mode[N_CONTACTS];
        int wanted = 1;
        for (int k = 0; k < N_CONTACTS; k++) {
            mode[k] = m >> (2 * k) & 3;
            wanted &= c->mu[k] > 0 || mode[k] <= CAROM_STICK;
        }
        if (wanted && !solve_modes(c, mode)) best = fmin(best, contact_case_residual(c));
    }
    return best;
}

static void solver_finds_what_exists(void **state)
{
    (void)state;
    carom_contact_solver *s;
    carom_contact_stats st;
    int n_none = 0;
    int stages[CAROM_STAGE_RESTART + 1] = {0};
    assert_int_equal(carom_contact_create(NULL, NULL, &s), CAROM_OK);
    for (uint64_t seed = 0; seed < N_CASES; seed++) {
        rng r = rng_from(seed);
        contact_case c = make_random(&r, seed % 2 ? 1 : 0.4);
        const carom_status status = carom_contact_solve(s, &c.p, 0, &c.x, &st);
        if (status == CAROM_OK) {
            assert_at_most("residual", contact_case_residual(&c), 1e-10);
            stages[st.stage]++;
        } else {
            const double best = enumerate(&c);
            /* Exact solutions of the right modes are good to 1e-13. */
            if (best < 1e-9) fail_msg("seed %d: missed, residual %g", (int)seed, best);
            n_none++;
        }
        contact_case_free(&c);
    }
    print_message("%d problems, %d without solution; by guess of free motion %d, sticking %d, "
                  "interior point %d, later %d\n",
                  N_CASES, n_none, stages[CAROM_STAGE_FREE], stages[CAROM_STAGE_STICK],
                  stages[CAROM_STAGE_INTERIOR_POINT],
                  stages[CAROM_STAGE_SWEEPS] + stages[CAROM_STAGE_LEMKE] +
                      stages[CAROM_STAGE_RESTART]);
    assert_in_range(n_none, 1, N_CASES / 4); /* both outcomes occur */
    carom_contact_destroy(s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(solver_finds_what_exists)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
