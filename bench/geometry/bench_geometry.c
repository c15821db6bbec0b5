/* Nanoseconds per pair of polygons, carom and its peers on the same pairs in the same run.
 *
 * Each figure is the median over rounds of the mean over N_PAIRS pairs; in a round each contender
 * has its turn, so that a busy machine is as slow for all.  The answers of carom are checked: with
 * and without a cache they must be the same bits. */
#include "pairs.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { N_ROUNDS = 101, MAX_CONTENDERS = 5 };

static double now_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

typedef struct own_scene {
    carom_shape shape;
    const pairs *p;
    carom_frame a[N_PAIRS];
    carom_frame b[N_PAIRS];
    carom_pair_cache cache[N_PAIRS];
} own_scene;

static void *own_create(const pairs *p)
{
    own_scene *s = calloc(1, sizeof *s);
    if (!s) abort();
    s->shape = (carom_shape){0, p->n, p->vertices};
    s->p = p;
    for (int k = 0; k < N_PAIRS; k++) {
        s->a[k] = carom_frame_at(p->a[k]);
        s->b[k] = carom_frame_at(p->b[k]);
    }
    return s;
}

static int from_poses(void *self, double *sum)
{
    own_scene *s = self;
    int n = 0;
    for (int k = 0; k < N_PAIRS; k++) {
        const carom_manifold m =
            carom_collide(&s->shape, s->p->a[k], &s->shape, s->p->b[k], MARGIN);
        n += m.count;
        if (m.count) *sum += m.normal.x;
    }
    return n;
}

static int from_frames(own_scene *s, int cached, double *sum)
{
    int n = 0;
    for (int k = 0; k < N_PAIRS; k++) {
        const carom_manifold m = carom_collide_frames(&s->shape, &s->a[k], &s->shape, &s->b[k],
                                                      MARGIN, cached ? &s->cache[k] : NULL);
        n += m.count;
        if (m.count) *sum += m.normal.x;
    }
    return n;
}

static int without_cache(void *self, double *sum)
{
    return from_frames(self, 0, sum);
}

static int with_cache(void *self, double *sum)
{
    return from_frames(self, 1, sum);
}

static const contender OWN[3] = {
    {"carom poses", MAX_VERTICES, own_create, from_poses, free},
    {"carom frames", MAX_VERTICES, own_create, without_cache, free},
    {"carom cache", MAX_VERTICES, own_create, with_cache, free},
};

static int compare(const void *x, const void *y)
{
    const double a = *(const double *)x;
    const double b = *(const double *)y;
    return (a > b) - (a < b);
}

typedef struct result {
    double ns; /* median per pair */
    int points;
    double digest; /* of what was found */
} result;

/* All contenders on the same pairs, by turns. */
static void measure(int n, const contender *const *all, const pairs *p, result *out)
{
    double t[MAX_CONTENDERS][N_ROUNDS];
    void *self[MAX_CONTENDERS];
    for (int c = 0; c < n; c++) {
        self[c] = all[c]->create(p);
        out[c].digest = 0;
        out[c].points = all[c]->run(self[c], &out[c].digest);
    }
    for (int r = 0; r < N_ROUNDS; r++) {
        for (int c = 0; c < n; c++) {
            double ignored = 0;
            const double start = now_ns();
            if (all[c]->run(self[c], &ignored) != out[c].points) abort();
            t[c][r] = (now_ns() - start) / N_PAIRS;
        }
    }
    for (int c = 0; c < n; c++) {
        all[c]->destroy(self[c]);
        qsort(t[c], N_ROUNDS, sizeof *t[c], compare);
        out[c].ns = t[c][N_ROUNDS / 2];
    }
}

static void print(int n, const contender *const *all, const pairs *p, situation s,
                  const result *results, FILE *csv)
{
    printf("%2d vertices, %-13s", p->n, situation_name(s));
    for (int c = 0; c < n; c++) {
        printf("  %s %.1f ns", all[c]->name, results[c].ns);
        if (!csv) continue;
        fprintf(csv, "%d,%s,%s,%.2f,%d\n", p->n, situation_name(s), all[c]->name, results[c].ns,
                results[c].points);
    }
    printf("\n");
}

static int run_all(int n, const contender *const *all, const pairs *p, situation s, FILE *csv)
{
    const contender *able[MAX_CONTENDERS];
    result results[MAX_CONTENDERS];
    int n_able = 0;
    for (int c = 0; c < n; c++) {
        if (p->n <= all[c]->max_vertices) able[n_able++] = all[c];
    }
    measure(n_able, able, p, results);
    print(n_able, able, p, s, results, csv);
    return results[0].digest == results[1].digest && results[1].digest == results[2].digest;
}

int main(int argc, char **argv)
{
    static pairs p;
    static const int counts[] = {4, 8, 16, 64};
    const contender *all[MAX_CONTENDERS] = {&OWN[0], &OWN[1], &OWN[2]};
    int n_all = 3;
#ifdef WITH_BOX2D
    all[n_all++] = &BOX2D;
#endif
#ifdef WITH_CHIPMUNK
    all[n_all++] = &CHIPMUNK;
#endif
    FILE *csv = argc > 1 ? fopen(argv[1], "w") : NULL;
    if (csv) fprintf(csv, "vertices,situation,who,ns,points\n");
    for (int k = 0; k < 4; k++) {
        for (int s = 0; s < N_SITUATIONS; s++) {
            make_pairs(counts[k], (situation)s, &p);
            if (run_all(n_all, all, &p, (situation)s, csv)) continue;
            fprintf(stderr, "the cache changed an answer\n");
            return 1;
        }
    }
    if (csv) fclose(csv);
    return 0;
}
