#include "scenes.h"

#include "rng.h"

#include <math.h>

static const double FALL = 9.81 / 60;

/* Small random motion on top of one step of gravity. */
static void add_body(contact_case *c, int b, double inertia, rng *r, double noise)
{
    contact_case_body(c, b, 1, inertia, noise * rng_uniform(r, -1, 1),
                      noise * rng_uniform(r, -1, 1), -FALL + noise * rng_uniform(r, -1, 1));
}

static void add_contact(contact_case *c, int a, int b, double ax, double ay, double bx, double by,
                        double nx, double ny, double mu)
{
    const double ra[2] = {ax, ay};
    const double rb[2] = {bx, by};
    const double n[2] = {nx, ny};
    contact_case_contact(c, a, b, ra, rb, n, mu, 0);
}

contact_case scene_stack(int n)
{
    rng r = rng_from(1);
    contact_case c = contact_case_new(n, 2 * n, 0);
    for (int i = 0; i < n; i++) {
        add_body(&c, i, 1.0 / 6, &r, 0);
        add_contact(&c, i - 1, i, -0.5, 0.5, -0.5, -0.5, 0, 1, 0.5);
        add_contact(&c, i - 1, i, 0.5, 0.5, 0.5, -0.5, 0, 1, 0.5);
    }
    return c;
}

contact_case scene_pyramid(int rows)
{
    rng r = rng_from(2);
    const int n = rows * (rows + 1) / 2;
    contact_case c = contact_case_new(n, 4 * n, 0);
    const double shift = 0.55; /* half the distance of neighbors: they overlap by 0.9 */
    int id = 0;
    int below = 0;
    for (int row = 0; row < rows; row++) {
        for (int k = 0; k < rows - row; k++, id++) {
            add_body(&c, id, 1.0 / 6, &r, 0);
            if (!row) {
                add_contact(&c, -1, id, 0, 0, -0.5, -0.5, 0, 1, 0.5);
                add_contact(&c, -1, id, 0, 0, 0.5, -0.5, 0, 1, 0.5);
                continue;
            }
            const int left = below + k;
            add_contact(&c, left, id, shift - 0.5, 0.5, -0.5, -0.5, 0, 1, 0.5);
            add_contact(&c, left, id, 0.5, 0.5, 0.5 - shift, -0.5, 0, 1, 0.5);
            add_contact(&c, left + 1, id, -0.5, 0.5, shift - 0.5, -0.5, 0, 1, 0.5);
            add_contact(&c, left + 1, id, 0.5 - shift, 0.5, 0.5, -0.5, 0, 1, 0.5);
        }
        below = id - (rows - row);
    }
    return c;
}

contact_case scene_pile(int n)
{
    rng r = rng_from(3);
    contact_case c = contact_case_new(n, 4 * n, 0);
    const int width = (int)ceil(sqrt((double)n));
    const double half = 0.5;
    const double height = sqrt(3.0) / 2;
    const double mu = 0.3;
    for (int i = 0; i < n; i++) {
        const int row = i / width;
        const int col = i % width;
        const int odd = row & 1;
        add_body(&c, i, 0.125, &r, 0.02);
        if (!row) {
            add_contact(&c, -1, i, 0, 0, 0, -half, 0, 1, mu);
        } else {
            const int left = (row - 1) * width + col - !odd;
            if ((odd || col) && rng_unit(&r) < 0.8)
                add_contact(&c, left, i, 0.25, half * height, -0.25, -half * height, half, height,
                            mu);
            if ((!odd || col < width - 1) && rng_unit(&r) < 0.8)
                add_contact(&c, left + 1, i, -0.25, half * height, 0.25, -half * height, -half,
                            height, mu);
        }
        if (col && rng_unit(&r) < 0.4) add_contact(&c, i - 1, i, half, 0, -half, 0, 1, 0, mu);
        if (!col && !odd) add_contact(&c, -1, i, 0, 0, -half, 0, 1, 0, mu);
        if (col == width - 1 && odd) add_contact(&c, -1, i, 0, 0, half, 0, -1, 0, mu);
    }
    return c;
}

contact_case scene_chain(int n)
{
    rng r = rng_from(4);
    contact_case c = contact_case_new(n, 0, 2 * n);
    const double left[2] = {-0.5, 0};
    const double right[2] = {0.5, 0};
    for (int i = 0; i < n; i++) {
        add_body(&c, i, 1.0 / 12, &r, 0.02);
        contact_case_hinge(&c, i - 1, i, right, left);
    }
    return c;
}
