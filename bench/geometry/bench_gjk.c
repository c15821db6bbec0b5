/* From how many vertices on libccd's GJK pays: nanoseconds per pair to the closest features with it
 * and without, for round and for long polygons.  Sets CRM_GJK_MIN_VERTICES; the features are the
 * same either way, and checked to be. */
#include "collide/closest.h"
#include "rng.h"

#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

enum { N_PAIRS = 256, N_ROUNDS = 7, MAX_N = 1024 };

#define PI 3.14159265358979323846

typedef struct scene {
    carom_vec2 v[MAX_N];
    carom_shape shape;
    crm_placed a[N_PAIRS];
    crm_placed b[N_PAIRS];
} scene;

static double now_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

typedef struct situation {
    const char *name;
    double thin;
    double low; /* distance of the centers [half lengths] */
    double high;
    double turn; /* of each body, and of B's place from straight above [rad] */
} situation;

/* n vertices on an ellipse. */
static void make(scene *s, int n, const situation *c)
{
    rng r = rng_from((uint64_t)n);
    s->shape.radius = 0;
    s->shape.count = n;
    s->shape.vertices = s->v;
    for (int i = 0; i < n; i++) {
        s->v[i].x = cos(2 * PI * i / n);
        s->v[i].y = c->thin * sin(2 * PI * i / n);
    }
    for (int k = 0; k < N_PAIRS; k++) {
        const double t = 0.5 * PI + rng_uniform(&r, -c->turn, c->turn);
        const double d = rng_uniform(&r, c->low, c->high);
        const carom_pose qa = {rng_uniform(&r, -c->turn, c->turn), 0, 0};
        const carom_pose qb = {rng_uniform(&r, -c->turn, c->turn), 0, 0};
        const carom_frame fa = carom_frame_at(qa);
        const carom_frame fb = carom_frame_at(qb);
        s->a[k] = crm_place(&s->shape, &fa, crm_vec(0, 0));
        s->b[k] = crm_place(&s->shape, &fb, crm_vec(d * cos(t), d * sin(t)));
    }
}

static int compare(const void *x, const void *y)
{
    const double a = *(const double *)x;
    const double b = *(const double *)y;
    return (a > b) - (a < b);
}

/* Median over rounds; *sum: a digest of the features. */
static double measure(const scene *s, int gjk_min_vertices, double *sum)
{
    const crm_search how = {HUGE_VAL, 0, gjk_min_vertices};
    double t[N_ROUNDS];
    for (int r = 0; r < N_ROUNDS; r++) {
        *sum = 0;
        const double start = now_ns();
        for (int k = 0; k < N_PAIRS; k++) {
            crm_closest c;
            crm_closest_features(&s->a[k], &s->b[k], &how, &c);
            *sum += c.gap + c.a + c.b;
        }
        t[r] = (now_ns() - start) / N_PAIRS;
    }
    qsort(t, N_ROUNDS, sizeof *t, compare);
    return t[N_ROUNDS / 2];
}

int main(void)
{
    static const situation cases[] = {{"round, overlapping", 1, 0.5, 1.9, PI},
                                      {"round, apart", 1, 2.05, 3, PI},
                                      {"long, overlapping", 0.1, 0, 0.3, PI},
                                      {"long, side by side", 0.1, 0.25, 0.6, 0.1},
                                      {"long, any", 0.1, 0, 2, PI}};
    static scene s;
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        for (int n = 8; n <= MAX_N; n *= 2) {
            double with;
            double without;
            make(&s, n, &cases[c]);
            const double t_without = measure(&s, INT_MAX, &without);
            const double t_with = measure(&s, 0, &with);
            printf("%-18s  2 x %3d vertices  without GJK %7.1f ns  with %7.1f ns\n", cases[c].name,
                   n, t_without, t_with);
            if (with != without) {
                fprintf(stderr, "GJK changed the features\n");
                return 1;
            }
        }
    }
    return 0;
}
