/* clock.h: least CPU time of a repeated call. */
#ifndef BENCH_SOLVER_CLOCK_H
#define BENCH_SOLVER_CLOCK_H

#include <time.h>

static inline double cpu_seconds(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* Smallest of several means, each over calls of at least 20 ms together; one call when it takes
 * half a second [s]. */
static inline double least_time(void (*f)(void *user), void *user)
{
    double best = 1e300;
    int n = 1;
    const double start = cpu_seconds();
    f(user);
    const double once = cpu_seconds() - start;
    if (once > 0.5) return once;
    for (int i = 0; i < 5;) {
        const double from = cpu_seconds();
        for (int k = 0; k < n; k++) f(user);
        const double t = cpu_seconds() - from;
        if (t < 0.02 && n < 1 << 24) {
            n *= 2;
            continue;
        }
        if (t / n < best) best = t / n;
        i++;
    }
    return best;
}

#endif
