#include "contact_parts.h"

#include "near.h"

#include <math.h>

static const double UP[2] = {0, 1};

carom_contact_stats contact_solve_ok(contact_case *c)
{
    carom_contact_solver *s;
    carom_contact_stats st;
    assert_int_equal(carom_contact_create(NULL, NULL, &s), CAROM_OK);
    assert_int_equal(carom_contact_solve(s, &c->p, 0, &c->x, &st), CAROM_OK);
    assert_at_most("residual", contact_case_residual(c), 1e-10);
    carom_contact_destroy(s);
    return st;
}

void contact_feet(contact_case *c, int below, int above, double mu)
{
    for (int e = -1; e <= 1; e += 2) {
        const double low[2] = {0.5 * e, 0.5};
        const double high[2] = {0.5 * e, -0.5};
        contact_case_contact(c, below, above, low, high, UP, mu, 0);
    }
}

contact_case contact_stack(int n, double top_mass, double mu, double push)
{
    contact_case c = contact_case_new(n, 2 * n, 0);
    for (int i = 0; i < n; i++) {
        const double m = i == n - 1 ? top_mass : 1;
        contact_case_body(&c, i, m, m / 6, 0, push, -GRAVITY * STEP);
        contact_feet(&c, i - 1, i, mu);
    }
    return c;
}

contact_case contact_mixed(uint64_t seed, int n_parts)
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
            contact_feet(&c, i % 4 ? i - 1 : -1, i, rng_uniform(&r, 0, 0.6));
        else
            contact_case_hinge(&c, i - 1, i, down, up);
    }
    return c;
}
