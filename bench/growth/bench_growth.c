/* Time, memory and work of a step against the number of bodies: carom beside Box2D 2.4 and Chipmunk
 * 7 where these are installed, same scenes, same run.
 *
 * Usage: bench_growth [--quick] [family]: prints CSV: family, contender, bodies, contacts, seconds
 * per step (wall time: threads count), steps on the clock, factorizations per step, bytes held,
 * nonzeros and flops of one factorization, worst status.  A cell whose step is expected to take
 * longer than the budget is left out, and said on stderr.  Comments give the bandwidth of memory
 * and the rate of arithmetic. */
#include "bench/step/own.h"

#include "carom/world.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

/* A cell ends after this [s] of steps; a step longer than that share of it ends the family. */
static const double BUDGET = 4;
static const double BUDGET_QUICK = 0.1;
enum { MAX_CONTENDERS = 6, N_SIZES = 11, WARM_UP = 3 };
static const int SIZES[N_SIZES] = {1, 3, 10, 30, 100, 300, 1000, 3000, 10000, 30000, 100000};

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void *two_threads(const scene *s)
{
    return own_create_with(s, CAROM_LOCATED, 2, "threads", "2");
}

static int contenders(contender *list)
{
    int n = 0;
    list[n++] = CAROM_CONTENDERS[1];
    list[n] = CAROM_CONTENDERS[1];
    list[n].name = "carom located 2 threads";
    list[n++].create = two_threads;
    list[n++] = CAROM_CONTENDERS[2];
#ifdef WITH_BOX2D
    list[n++] = BOX2D[0];
#endif
#ifdef WITH_CHIPMUNK
    list[n++] = CHIPMUNK[0];
#endif
    return n;
}

static int is_own(const contender *c)
{
    return strncmp(c->name, "carom", 5) == 0;
}

/* Seconds per step. */
static double cell(int family, int n, const contender *c, double budget)
{
    scene s = make_family(family, n);
    void *self = c->create(&s);
    counters count = {0};
    for (int k = 0; k < WARM_UP; k++) c->step(self, &count);
    count.factorizations = 0;
    int steps = 0;
    const double from = now();
    double spent = 0;
    while (steps < s.n_steps && (spent < budget || steps < 2)) {
        c->step(self, &count);
        steps++;
        spent = now() - from;
    }
    carom_world_size z = {0};
    if (is_own(c)) z = carom_world_measure(self);
    printf("%s,%s,%d,%d,%.3e,%d,%.3g,%zu,%.0f,%.0f,%d\n", FAMILY_NAMES[family], c->name, s.n_bodies,
           count.n_contacts, spent / steps, steps, (double)count.factorizations / steps, z.bytes,
           z.factor.nonzeros, z.factor.flops, count.worst);
    fflush(stdout);
    c->destroy(self);
    free_scene(&s);
    return spent / steps;
}

/* Sizes grow until the next step is expected to take more than the budget. */
static void grow(int family, const contender *c, double budget)
{
    for (int i = 0; i < N_SIZES; i++) {
        const double t = cell(family, SIZES[i], c, budget);
        if (i + 1 == N_SIZES || t * pow((double)SIZES[i + 1] / SIZES[i], 1.6) <= budget) continue;
        fprintf(stderr, "%s, %s: cut after %d bodies (%.2g s a step)\n", FAMILY_NAMES[family],
                c->name, SIZES[i], t);
        return;
    }
}

/* Bytes per second of a copy that fits no cache. */
static double bandwidth(void)
{
    const size_t bytes = (size_t)1 << 26;
    char *a = malloc(2 * bytes);
    if (!a) return 0;
    memset(a, 1, 2 * bytes);
    double best = HUGE_VAL;
    volatile char seen = 0; /* the copies are looked at, or they would be left out */
    for (int k = 0; k < 5; k++) {
        const double from = now();
        memcpy(a, a + bytes, bytes);
        seen = (char)(seen + a[(size_t)k << 20]);
        best = fmin(best, now() - from);
    }
    free(a);
    return 2 * (double)bytes / best;
}

/* Flops per second of y += a x within the nearest cache, as this compiler makes it. */
static double arithmetic_rate(void)
{
    enum { N = 512, TIMES = 20000 };
    double x[N];
    double y[N];
    double best = HUGE_VAL;
    volatile double seen = 0;
    for (int k = 0; k < N; k++) x[k] = y[k] = 1.0 / (k + 1);
    for (int round = 0; round < 5; round++) {
        const double from = now();
        for (int t = 0; t < TIMES; t++) {
            const double a = 1e-9 * t;
            for (int k = 0; k < N; k++) y[k] += a * x[k];
        }
        seen = seen + y[round];
        best = fmin(best, now() - from);
    }
    return 2.0 * N * TIMES / best;
}

int main(int argc, char **argv)
{
    contender list[MAX_CONTENDERS];
    const int n = contenders(list);
    const int quick = argc > 1 && strcmp(argv[1], "--quick") == 0;
    const char *only = argc > 1 + quick ? argv[1 + quick] : NULL;
    printf("family,contender,bodies,contacts,seconds,steps,factorizations,bytes,nonzeros,"
           "flops,status\n");
    printf("# bandwidth %.3g\n", bandwidth());
    printf("# arithmetic %.3g\n", arithmetic_rate());
    for (int k = 0; k < N_FAMILIES; k++) {
        if (only && strcmp(only, FAMILY_NAMES[k]) != 0) continue;
        for (int i = 0; i < n; i++) grow(k, &list[i], quick ? BUDGET_QUICK : BUDGET);
    }
    return 0;
}
