#include "pairs.h"

#include "rng.h"

#include <math.h>

static const double PI = 3.14159265358979323846;

const char *situation_name(situation s)
{
    static const char *const names[N_SITUATIONS] = {"deep", "touching", "within margin", "apart"};
    return names[s];
}

static double wanted_gap(rng *r, situation s)
{
    switch (s) {
    case DEEP: return rng_uniform(r, -0.5, -0.05);
    case TOUCHING: return rng_uniform(r, -1e-3, 1e-3);
    case WITHIN_MARGIN: return rng_uniform(r, 1e-3, MARGIN);
    default: return rng_uniform(r, 0.2, 1);
    }
}

/* Moving along the normal changes the gap by as much unless the features change. */
static int move_to_gap(const carom_shape *s, double gap, carom_pose a, carom_pose *b)
{
    for (int k = 0; k < 4; k++) {
        const carom_manifold m = carom_collide(s, a, s, *b, HUGE_VAL);
        if (fabs(m.distance - gap) < 1e-4 * fabs(gap)) return 1;
        b->x += (gap - m.distance) * m.normal.x;
        b->y += (gap - m.distance) * m.normal.y;
    }
    return 0;
}

void make_pairs(int n, situation s, pairs *out)
{
    rng r = rng_from((uint64_t)(100 * n + (int)s));
    const carom_shape shape = {0, n, out->vertices};
    out->n = n;
    for (int i = 0; i < n; i++) {
        out->vertices[i].x = sqrt(2) * cos(2 * PI * (i + 0.5) / n);
        out->vertices[i].y = sqrt(2) * sin(2 * PI * (i + 0.5) / n);
    }
    for (int k = 0; k < N_PAIRS;) {
        const double t = rng_uniform(&r, 0, 2 * PI);
        const double d = rng_uniform(&r, 1, 4);
        carom_pose *a = &out->a[k];
        carom_pose *b = &out->b[k];
        a->angle = rng_uniform(&r, -3, 3);
        a->x = rng_uniform(&r, -9, 9);
        a->y = rng_uniform(&r, -9, 9);
        b->angle = rng_uniform(&r, -3, 3);
        b->x = a->x + d * cos(t);
        b->y = a->y + d * sin(t);
        k += move_to_gap(&shape, wanted_gap(&r, s), *a, b);
    }
}
