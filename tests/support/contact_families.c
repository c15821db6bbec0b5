#include "contact_families.h"

#include <math.h>

static const double FALL = 9.81 / 60;

static double logarithmic(rng *r, double low, double high)
{
    return exp(rng_uniform(r, log(low), log(high)));
}

/* One of: all 1; the top one heavy or light; geometric; alternating. */
static double mass_of(int kind, double ratio, int i, int n)
{
    switch (kind) {
    case 1: return i == n - 1 ? ratio : 1;
    case 2: return pow(ratio, (double)i / (n > 1 ? n - 1 : 1));
    case 3: return i % 2 ? ratio : 1;
    default: return 1;
    }
}

/* Box with gravity on top of a push. */
static void box(contact_case *c, int b, double mass, double push)
{
    contact_case_body(c, b, mass, mass / 6, 0, push, -FALL);
}

static void touch(contact_case *c, int a, int b, double ax, double ay, double bx, double by,
                  double nx, double ny, double mu)
{
    const double ra[2] = {ax, ay};
    const double rb[2] = {bx, by};
    const double n[2] = {nx, ny};
    contact_case_contact(c, a, b, ra, rb, n, mu, 0);
}

static contact_case stack(rng *r)
{
    const int n = 2 + rng_int(r, 29);
    const int kind = rng_int(r, 4);
    const double ratio = logarithmic(r, 1e-4, 1e8);
    const double mu = rng_uniform(r, 0.1, 1);
    const double push = rng_int(r, 2) ? rng_uniform(r, -2, 2) : 0;
    contact_case c = contact_case_new(n, 2 * n, 0);
    for (int i = 0; i < n; i++) {
        box(&c, i, mass_of(kind, ratio, i, n), push * rng_unit(r));
        const double shift = rng_uniform(r, 0, 0.05);
        touch(&c, i - 1, i, -0.5 + shift, 0.5, -0.5, -0.5, 0, 1, mu);
        touch(&c, i - 1, i, 0.5, 0.5, 0.5 - shift, -0.5, 0, 1, mu);
    }
    return c;
}

static contact_case pyramid(rng *r)
{
    const int rows = 2 + rng_int(r, 8);
    const int n = rows * (rows + 1) / 2;
    const double top = logarithmic(r, 1, 1e6);
    const double mu = rng_uniform(r, 0.1, 0.8);
    const double noise = rng_int(r, 2) ? 0.05 : 0;
    const double shift = 0.55;
    contact_case c = contact_case_new(n, 4 * n, 0);
    int below = 0;
    for (int row = 0, id = 0; row < rows; row++) {
        for (int k = 0; k < rows - row; k++, id++) {
            box(&c, id, id == n - 1 ? top : 1, noise * rng_uniform(r, -1, 1));
            const int left = below + k;
            touch(&c, row ? left : -1, id, shift - 0.5, 0.5, -0.5, -0.5, 0, 1, mu);
            touch(&c, row ? left + 1 : -1, id, 0.5 - shift, 0.5, 0.5, -0.5, 0, 1, mu);
            if (!row) continue;
            touch(&c, left, id, 0.5, 0.5, 0.5 - shift, -0.5, 0, 1, mu);
            touch(&c, left + 1, id, -0.5, 0.5, shift - 0.5, -0.5, 0, 1, mu);
        }
        below = id - (rows - row);
    }
    return c;
}

contact_case contact_discs(rng *r, int n, double low, double high)
{
    contact_case c = contact_case_new(n, 4 * n, 0);
    const int width = (int)ceil(sqrt((double)n));
    const double height = sqrt(3.0) / 4;
    const double heavy = rng_int(r, 2) ? logarithmic(r, 1, 1e4) : 1;
    for (int i = 0; i < n; i++) {
        const int odd = i / width & 1;
        const int col = i % width;
        const double m = rng_unit(r) < 0.2 ? heavy : 1;
        contact_case_body(&c, i, m, m / 8, 0, rng_uniform(r, -0.02, 0.02), -FALL);
        const int left = i - width - !odd;
        const double mu = logarithmic(r, low, high);
        if (i < width) touch(&c, -1, i, 0, 0, 0, -0.5, 0, 1, mu);
        if (i >= width && (odd || col) && rng_unit(r) < 0.8)
            touch(&c, left, i, 0.25, height, -0.25, -height, 0.5, 2 * height, mu);
        if (i >= width && (!odd || col < width - 1) && rng_unit(r) < 0.8)
            touch(&c, left + 1, i, -0.25, height, 0.25, -height, -0.5, 2 * height, mu);
        if (col && rng_unit(r) < 0.4) touch(&c, i - 1, i, 0.5, 0, -0.5, 0, 1, 0, mu);
        if (!col && !odd) touch(&c, -1, i, 0, 0, -0.5, 0, 1, 0, mu);
        if (col == width - 1 && odd) touch(&c, -1, i, 0, 0, 0.5, 0, -1, 0, mu);
    }
    return c;
}

static contact_case pile(rng *r)
{
    return contact_discs(r, 5 + rng_int(r, 96), 0.1, 0.8);
}

static contact_case friction(rng *r)
{
    return contact_discs(r, 3 + rng_int(r, 38), 1e-3, 1e3);
}

/* Boxes jammed between two walls that lean by an angle near the angle of friction. */
static contact_case wedge(rng *r)
{
    const int n = 1 + rng_int(r, 6);
    const double angle = rng_uniform(r, 0.02, 0.8);
    const double mu = tan(angle) * logarithmic(r, 0.5, 3);
    const double s = sin(angle);
    const double k = cos(angle);
    contact_case c = contact_case_new(n, 6 * n, 0);
    for (int i = 0; i < n; i++) {
        box(&c, i, logarithmic(r, 1, 1e4), rng_uniform(r, -0.1, 0.1));
        const double low = rng_uniform(r, -0.5, 0);
        touch(&c, -1, i, 0, 0, -0.5, low, k, s, mu);
        touch(&c, -1, i, 0, 0, 0.5, low, -k, s, mu);
        touch(&c, -1, i, 0, 0, -0.5 - s, low + 0.5, k, s, mu);
        touch(&c, -1, i, 0, 0, 0.5 + s, low + 0.5, -k, s, mu);
        if (!i) continue;
        touch(&c, i - 1, i, -0.4, 0.5, -0.4, -0.5, 0, 1, mu);
        touch(&c, i - 1, i, 0.4, 0.5, 0.4, -0.5, 0, 1, mu);
    }
    return c;
}

/* Links that lie on the ground, some of them, or hang; one hinge is doubled at times. */
static contact_case chain(rng *r)
{
    const int n = 2 + rng_int(r, 60);
    contact_case c = contact_case_new(n, n, 4 * n);
    const double ratio = logarithmic(r, 1e-4, 1e6);
    const int kind = rng_int(r, 4);
    const double left[2] = {-0.5, 0};
    const double right[2] = {0.5, 0};
    for (int i = 0; i < n; i++) {
        const double m = mass_of(kind, ratio, i, n);
        contact_case_body(&c, i, m, m / 12, rng_uniform(r, -1, 1), rng_uniform(r, -1, 1), -FALL);
        if (i || rng_int(r, 2)) contact_case_hinge(&c, i - 1, i, right, left);
        if (i && rng_unit(r) < 0.05) contact_case_hinge(&c, i - 1, i, right, left);
        if (rng_unit(r) < 0.5)
            touch(&c, -1, i, 0, 0, rng_uniform(r, -0.5, 0.5), -0.1, 0, 1, rng_uniform(r, 0, 1));
    }
    return c;
}

/* A pile that arrives with speed: c = e min(0, J_n v) before gravity. */
static contact_case restitution(rng *r)
{
    contact_case c = contact_discs(r, 3 + rng_int(r, 58), 0.1, 0.5);
    const double e = rng_uniform(r, 0.1, 1);
    for (int i = 0; i < 3 * c.p.n_bodies; i++) c.u[i] += rng_uniform(r, -1, 1);
    for (int k = 0; k < c.p.n_contacts; k++) {
        double before = 0;
        for (int i = 0; i < 6; i++) {
            const int b = c.contact_body[2 * k + i / 3];
            if (b >= 0) before += c.jn[6 * k + i] * (c.u[3 * b + i % 3] + (i % 3 == 2) * FALL);
        }
        c.cn[k] = e * fmin(0, before);
    }
    return c;
}

/* Rows without geometry: arms and directions at random, mu up to 5. */
static contact_case random_rows(rng *r)
{
    const int n = 1 + rng_int(r, 15);
    const int m = 1 + rng_int(r, 2 * n + 2);
    contact_case c = contact_case_new(n, m, 2 * n);
    for (int i = 0; i < n; i++) {
        contact_case_body(&c, i, logarithmic(r, 0.1, 10), logarithmic(r, 0.01, 1),
                          rng_uniform(r, -1, 1), rng_uniform(r, -1, 1), rng_uniform(r, -1, 1));
        const double arm[4] = {rng_unit(r), rng_unit(r), -rng_unit(r), -rng_unit(r)};
        if (i && rng_unit(r) < 0.3) contact_case_hinge(&c, rng_int(r, i), i, arm, arm + 2);
    }
    for (int k = 0; k < m; k++) {
        const double angle = rng_uniform(r, -3, 3);
        const int b = rng_int(r, n);
        const int a = b ? rng_int(r, b + 1) - 1 : -1;
        touch(&c, a, b, rng_uniform(r, -1, 1), rng_uniform(r, -1, 1), rng_uniform(r, -1, 1),
              rng_uniform(r, -1, 1), cos(angle), sin(angle),
              rng_unit(r) < 0.2 ? 0 : rng_uniform(r, 0, 5));
    }
    return c;
}

const contact_family contact_families[] = {
    {"stack", stack, 1},        {"pyramid", pyramid, 1},
    {"pile", pile, 1},          {"wedge", wedge, 1},
    {"chain", chain, 1},        {"friction", friction, 1},
    {"random", random_rows, 1}, {"restitution", restitution, 0},
};
const int n_contact_families = sizeof contact_families / sizeof *contact_families;
