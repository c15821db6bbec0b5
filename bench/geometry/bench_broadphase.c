/* Milliseconds per step of the broadphase on a pile of moving boxes, carom and its peers in the
 * same run. Carom's pairs must be those that Chipmunk reports, in number. */
#include "piles.h"

#include "rng.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

enum { N_STEPS = 21, MAX_FINDERS = 3 };

static double now_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return 1e3 * (double)t.tv_sec + 1e-6 * (double)t.tv_nsec;
}

static void *own_create(int n, const carom_box *boxes)
{
    carom_broadphase *bp = NULL;
    (void)n;
    (void)boxes;
    if (carom_broadphase_create(NULL, &bp)) abort();
    return bp;
}

static int own_step(void *self, int n, const carom_box *boxes)
{
    int n_pairs;
    const carom_pair *pairs;
    if (carom_broadphase_pairs(self, n, boxes, &n_pairs, &pairs)) abort();
    return n_pairs;
}

static void own_destroy(void *self)
{
    carom_broadphase_destroy(self);
}

static const finder OWN = {"carom", own_create, own_step, own_destroy};

/* A square pile, boxes half overlapping on average, on a ground that all of the lowest row touch.
 */
static void make_pile(int n, rng *r, carom_box *boxes)
{
    const double side = sqrt((double)n);
    for (int i = 0; i < n; i++) {
        const double x = rng_uniform(r, 0, side);
        const double y = rng_uniform(r, 0, side);
        const double w = rng_uniform(r, 0.3, 0.6);
        const carom_box b = {{x - w, y - w}, {x + w, y + w}};
        boxes[i] = b;
    }
    const carom_box ground = {{-10, -10}, {side + 10, 0}};
    boxes[0] = ground;
}

static void jitter(int n, rng *r, carom_box *boxes)
{
    for (int i = 1; i < n; i++) {
        const double dx = rng_uniform(r, -0.01, 0.01);
        const double dy = rng_uniform(r, -0.01, 0.01);
        boxes[i].lower.x += dx;
        boxes[i].upper.x += dx;
        boxes[i].lower.y += dy;
        boxes[i].upper.y += dy;
    }
}

static int compare(const void *x, const void *y)
{
    const double a = *(const double *)x;
    const double b = *(const double *)y;
    return (a > b) - (a < b);
}

static double measure(const finder *f, int n, int *pairs)
{
    rng r = rng_from(7);
    double t[N_STEPS];
    carom_box *boxes = malloc((size_t)n * sizeof *boxes);
    if (!boxes) abort();
    make_pile(n, &r, boxes);
    void *self = f->create(n, boxes);
    for (int k = 0; k < N_STEPS; k++) {
        jitter(n, &r, boxes);
        const double start = now_ms();
        *pairs = f->step(self, n, boxes);
        t[k] = now_ms() - start;
    }
    f->destroy(self);
    free(boxes);
    qsort(t, N_STEPS, sizeof *t, compare);
    return t[N_STEPS / 2];
}

int main(int argc, char **argv)
{
    static const int counts[] = {1000, 10000, 100000};
    const finder *all[MAX_FINDERS] = {&OWN};
    int n_all = 1;
#ifdef WITH_CHIPMUNK
    all[n_all++] = &CHIPMUNK_TREE;
#endif
#ifdef WITH_BOX2D
    all[n_all++] = &BOX2D_TREE;
#endif
    FILE *csv = argc > 1 ? fopen(argv[1], "w") : NULL;
    if (csv) fprintf(csv, "boxes,who,ms,pairs\n");
    for (int k = 0; k < 3; k++) {
        int pairs[MAX_FINDERS];
        printf("%6d boxes", counts[k]);
        for (int f = 0; f < n_all; f++) {
            const double ms = measure(all[f], counts[k], &pairs[f]);
            printf("  %s %.3f ms (%d pairs)", all[f]->name, ms, pairs[f]);
            if (csv) fprintf(csv, "%d,%s,%.4f,%d\n", counts[k], all[f]->name, ms, pairs[f]);
        }
        printf("\n");
#ifdef WITH_CHIPMUNK
        if (pairs[0] != pairs[1]) {
            fprintf(stderr, "carom and Chipmunk disagree\n");
            return 1;
        }
#endif
    }
    if (csv) fclose(csv);
    return 0;
}
