/* Error against run time: carom's integrators and orders beside Box2D 2.4 and Chipmunk 7 where
 * these are installed, same scenes, same run, one thread.
 *
 * Usage: bench_precision [scene]: a number from 0; prints CSV: scene, contender, steps per second,
 * error [m], processor seconds per simulated second, worst status.  The error is that of one body's
 * pose at the end, an angle times its size.  References are closed forms, or order 8 at 480 steps
 * per second, if 960 agree to 1e-10; their agreement is printed as a comment.  bench/precision/
 * plot.py draws the figure and the table of docs/precision.md. */
#include "bench/contact/clock.h"
#include "bench/step/own.h"
#include "problems.h"

#include "carom/world.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

/* Rounds go on for so long [s], and are at least so many; the least time counts. */
static const double LONG_ENOUGH = 0.05;
enum { MIN_ROUNDS = 3, MAX_CONTENDERS = 8 };
static const double AGREE = 1e-10;

static void *order_4(const scene *s)
{
    return own_create(s, CAROM_LOCATED, 4);
}

static void *order_6(const scene *s)
{
    return own_create(s, CAROM_LOCATED, 6);
}

static void *order_8(const scene *s)
{
    return own_create(s, CAROM_LOCATED, 8);
}

static int contenders(contender *list)
{
    int n = 0;
    for (int k = 0; k < 3; k++) list[n++] = CAROM_CONTENDERS[k];
    static void *(*const orders[3])(const scene *) = {order_4, order_6, order_8};
    static const char *const names[3] = {"carom order 4", "carom order 6", "carom order 8"};
    for (int k = 0; k < 3; k++) {
        list[n] = CAROM_CONTENDERS[1];
        list[n].name = names[k];
        list[n++].create = orders[k];
    }
#ifdef WITH_BOX2D
    list[n++] = BOX2D;
#endif
#ifdef WITH_CHIPMUNK
    list[n++] = CHIPMUNK;
#endif
    return n;
}

/* One run; wall seconds of its steps. */
static double run(const problem *p, const contender *c, int n, double q[3], counters *count)
{
    scene s = p->s;
    s.dt = p->duration / n;
    void *self = c->create(&s);
    const counters none = {0};
    *count = none;
    const double start = cpu_seconds();
    for (int k = 0; k < n; k++) c->step(self, count);
    const double time = cpu_seconds() - start;
    c->place(self, p->body, q);
    c->destroy(self);
    return time;
}

static double error_of(const problem *p, const double q[3])
{
    const double turn = p->reach * fabs(q[0] - p->exact[0]);
    return fmax(turn, hypot(q[1] - p->exact[1], q[2] - p->exact[2]));
}

static void find_reference(problem *p)
{
    contender c = CAROM_CONTENDERS[1];
    counters count;
    double q[3];
    c.create = order_8;
    if (p->closed) return;
    run(p, &c, (int)(480 * p->duration), p->exact, &count);
    run(p, &c, (int)(960 * p->duration), q, &count);
    const double apart = error_of(p, q);
    printf("# %s: reference agrees to %.1e\n", p->name, apart);
    if (apart > AGREE) exit(1);
}

static void measure(const problem *p, const contender *c, int rate)
{
    const int n = (int)(rate * p->duration + 0.5);
    double q[3];
    counters count;
    double best = HUGE_VAL;
    double total = 0;
    for (int k = 0; k < MIN_ROUNDS || total < LONG_ENOUGH; k++) {
        const double t = run(p, c, n, q, &count);
        best = fmin(best, t);
        total += t;
    }
    printf("%s,%s,%d,%.3e,%.3e,%d\n", p->name, c->name, rate, error_of(p, q), best / p->duration,
           count.worst);
    fflush(stdout);
}

int main(int argc, char **argv)
{
    contender list[MAX_CONTENDERS];
    const int n = contenders(list);
    const int first = argc > 1 ? atoi(argv[1]) : 0;
    const int last = argc > 1 ? first : N_PROBLEMS - 1;
    if (first < 0 || last >= N_PROBLEMS) {
        fprintf(stderr, "usage: bench_precision [0..%d]\n", N_PROBLEMS - 1);
        return 1;
    }
    printf("scene,contender,rate,error,cost,status\n");
    for (int k = first; k <= last; k++) {
        problem p = make_problem(k);
        find_reference(&p);
        for (int i = 0; i < n; i++) {
            for (int rate = 15; rate <= 1920; rate *= 2) measure(&p, &list[i], rate);
        }
        free(p.s.bodies);
    }
    return 0;
}
