/* Error against run time: carom's integrators, orders and tolerances beside Box2D 2.4 and Chipmunk
 * 7 where these are installed, same scenes, same run, one thread.
 *
 * Usage: bench_precision [--quick] [scene], or bench_precision scene K, which prints scene K as
 * JSON for peers.py.  A scene is a number from 0; prints CSV: scene, contender, steps per second,
 * tolerance [m], error [m], processor seconds per simulated second (median, least and most of the
 * rounds; the first step is not counted), worst status.  The error is that of one body's pose at
 * the end, an angle times its size.  References are closed forms, or order 8 at 480 steps per
 * second, if 960 agree to 1e-10; their agreement is printed as a comment.  --quick: fewer rates and
 * rounds. */
#include "bench/solver/clock.h"
#include "bench/step/own.h"
#include "problems.h"

#include "carom/world.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Rounds go on for so long [s], and are at least so many; a setting that takes longer than the last
 * is run once and ends its curve. */
typedef struct effort {
    double long_enough, too_long;
    int rounds;
    int last_rate, rate_factor;
} effort;

static const effort FULL = {0.05, 10, 3, 1920, 2};
static const effort QUICK = {0.01, 0.5, 1, 960, 4};
enum { MAX_ROUNDS = 101, MAX_CONTENDERS = 9, FIRST_RATE = 15, TOLERANCE_RATE = 60 };
static const double AGREE = 1e-10;

/* Of the contender `tolerance`: creation knows the scene alone. */
static char tolerance[32] = "0";

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

static void *within(const scene *s)
{
    return own_create_with(s, CAROM_LOCATED, 2, "tolerance", tolerance);
}

static int contenders(contender *list)
{
    static void *(*const creators[4])(const scene *) = {order_4, order_6, order_8, within};
    static const char *const names[4] = {"carom order 4", "carom order 6", "carom order 8",
                                         "carom tolerance"};
    int n = 0;
    for (int k = 0; k < 3; k++) list[n++] = CAROM_CONTENDERS[k];
    for (int k = 0; k < 4; k++) {
        list[n] = CAROM_CONTENDERS[1];
        list[n].name = names[k];
        list[n++].create = creators[k];
    }
#ifdef WITH_BOX2D
    list[n++] = BOX2D;
#endif
#ifdef WITH_CHIPMUNK
    list[n++] = CHIPMUNK;
#endif
    return n;
}

/* One run; processor seconds of its steps, the first one as long as the others. */
static double run(const problem *p, const contender *c, int n, double q[3], counters *count)
{
    scene s = p->s;
    s.dt = p->duration / n;
    void *self = c->create(&s);
    const counters none = {0};
    *count = none;
    c->step(self, count);
    const double start = cpu_seconds();
    for (int k = 1; k < n; k++) c->step(self, count);
    const double time = cpu_seconds() - start;
    c->place(self, p->body, q);
    c->destroy(self);
    return time * n / (n - 1);
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
    if (apart > AGREE) {
        fprintf(stderr, "%s: its references agree to %.1e only\n", p->name, apart);
        exit(1);
    }
}

static int compare(const void *a, const void *b)
{
    const double *x = a;
    const double *y = b;
    return (*x > *y) - (*x < *y);
}

/* Prints a line; returns the seconds of a run. */
static double measure(const problem *p, const contender *c, int rate, const effort *f)
{
    const int n = (int)(rate * p->duration + 0.5);
    double times[MAX_ROUNDS];
    double q[3];
    counters count;
    double total = 0;
    int rounds = 0;
    while (rounds < MAX_ROUNDS && (rounds < f->rounds || total < f->long_enough)) {
        times[rounds] = run(p, c, n, q, &count);
        total += times[rounds++];
        if (total > f->too_long) break;
    }
    qsort(times, (size_t)rounds, sizeof *times, compare);
    const int chosen = strcmp(c->name, "carom tolerance") == 0;
    printf("%s,%s,%d,%s,%.3e,%.3e,%.3e,%.3e,%d\n", p->name, c->name, rate, chosen ? tolerance : "0",
           error_of(p, q), times[rounds / 2] / p->duration, times[0] / p->duration,
           times[rounds - 1] / p->duration, count.worst);
    fflush(stdout);
    return times[0];
}

static void curve(const problem *p, const contender *c, const effort *f)
{
    if (strcmp(c->name, "carom tolerance") == 0) {
        for (int k = 2; k <= 12; k += 2) {
            snprintf(tolerance, sizeof tolerance, "1e-%d", k);
            if (measure(p, c, TOLERANCE_RATE, f) > f->too_long) return;
        }
        return;
    }
    for (int rate = FIRST_RATE; rate <= f->last_rate; rate *= f->rate_factor) {
        if (measure(p, c, rate, f) * f->rate_factor > f->too_long) return;
    }
}

static const char *shape_name(body_shape shape)
{
    return shape == SHAPE_DISC ? "disc" : shape == SHAPE_BOX ? "box" : "none";
}

static void print_scene(const problem *p)
{
    printf("{\"name\": \"%s\", \"gravity\": %.17g, \"duration\": %.17g, \"body\": %d, \"reach\": "
           "%.17g,\n"
           " \"exact\": [%.17g, %.17g, %.17g], \"bodies\": [",
           p->name, p->s.gravity, p->duration, p->body, p->reach, p->exact[0], p->exact[1],
           p->exact[2]);
    for (int k = 0; k < p->s.n_bodies; k++) {
        const scene_body *b = &p->s.bodies[k];
        printf("%s\n  {\"moves\": %d, \"shape\": \"%s\", \"hx\": %.17g, \"hy\": %.17g, \"mass\": "
               "%.17g, "
               "\"inertia\": %.17g, \"friction\": %.17g, \"restitution\": %.17g, "
               "\"q\": [%.17g, %.17g, %.17g], \"v\": [%.17g, %.17g, %.17g]}",
               k ? "," : "", b->moves, shape_name(b->shape), b->hx, b->hy, b->mass, b->inertia,
               b->friction, b->restitution, b->q[0], b->q[1], b->q[2], b->v[0], b->v[1], b->v[2]);
    }
    printf("],\n \"pins\": [");
    for (int k = 0; k < p->s.n_pins; k++) {
        const scene_pin *x = &p->s.pins[k];
        printf("%s\n  {\"a\": %d, \"b\": %d, \"x\": %.17g, \"y\": %.17g}", k ? "," : "", x->a, x->b,
               x->x, x->y);
    }
    printf("]}\n");
}

int main(int argc, char **argv)
{
    contender list[MAX_CONTENDERS];
    const int n = contenders(list);
    if (argc == 3 && strcmp(argv[1], "scene") == 0) {
        problem p = make_problem(atoi(argv[2]));
        find_reference(&p);
        print_scene(&p);
        free(p.s.bodies);
        return 0;
    }
    const int quick = argc > 1 && strcmp(argv[1], "--quick") == 0;
    const int one = argc > 1 + quick;
    const int first = one ? atoi(argv[1 + quick]) : 0;
    const int last = one ? first : N_PROBLEMS - 1;
    if (first < 0 || last >= N_PROBLEMS) {
        fprintf(stderr, "usage: bench_precision [--quick] [0..%d]\n", N_PROBLEMS - 1);
        return 1;
    }
    printf("scene,contender,rate,tolerance,error,cost,least,most,status\n");
    for (int k = first; k <= last; k++) {
        problem p = make_problem(k);
        find_reference(&p);
        for (int i = 0; i < n; i++) curve(&p, &list[i], quick ? &QUICK : &FULL);
        free(p.s.bodies);
    }
    return 0;
}
