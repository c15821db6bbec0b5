/* Error against run time: carom's integrators, orders and tolerances beside Box2D 2.4 and Chipmunk
 * 7 where these are installed, same scenes, same run, one thread.
 *
 * Usage: bench_precision [--quick] [SCENE], or bench_precision scene SCENE, which prints it as JSON
 * for peers.py.  A scene is a number from 0 or a scene file of tests/data/scenes; prints CSV:
 * scene, contender, steps per second, tolerance [m], error [m], processor seconds per simulated
 * second (median, least and most of the rounds; the first step is not counted), worst status; then,
 * largest over time, overlap [m], gap of a joint [m], gain of energy [J]; seconds of the first
 * step, when nothing is known yet.  The error is that of one body's pose, an angle times its size:
 * at the end, or the largest over time of what should rest.  References are closed forms, or
 * equations of motion of their own (references.c); what these do not resolve is printed as a
 * comment, and is the least error shown.
 * --quick: fewer rates and rounds. */
#include "bench/solver/clock.h"
#include "bench/step/own.h"
#include "bench/step/poses.h"
#include "references.h"

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
enum { MAX_ROUNDS = 101, MAX_CONTENDERS = 13, FIRST_RATE = 15, TOLERANCE_RATE = 60 };

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
    for (int k = 0; k < 3; k++) list[n++] = BOX2D[k];
#endif
#ifdef WITH_CHIPMUNK
    for (int k = 0; k < 3; k++) list[n++] = CHIPMUNK[k];
#endif
    return n;
}

static double error_of(const problem *p, const double q[3])
{
    const double turn = p->reach * fabs(q[0] - p->exact[0]);
    return fmax(turn, hypot(q[1] - p->exact[1], q[2] - p->exact[2]));
}

/* What a run shows beside its cost, largest over time. */
typedef struct faults {
    double start; /* the energy then [J] */
    double error, overlap, gap, gain;
} faults;

/* Looks at every step up to this many, else at as many. */
enum { MAX_LOOKS = 120 };

static void look(const problem *p, const scene *s, const contender *c, void *self, faults *f)
{
    double q[3];
    c->place(self, p->body, q);
    const double e = fmax(error_of(p, q), p->resolved);
    f->error = p->rests ? fmax(f->error, e) : e;
    /* fmax leaves NaN out */
    if (!isfinite(q[0] + q[1] + q[2])) f->error = HUGE_VAL;
    f->overlap = fmax(f->overlap, largest_overlap(s, c, self));
    f->gap = fmax(f->gap, largest_gap(s, c, self));
    f->gain = fmax(f->gain, energy_of(s, c, self) - f->start);
}

/* One run; processor seconds of its steps after the first, as if there were n of them.  With f it
 * is looked at, while the clock stands still. */
static double run(const problem *p, const contender *c, int n, counters *count, faults *f,
                  double *first)
{
    scene s = p->s;
    s.dt = p->duration / n;
    void *self = c->create(&s);
    const counters none = {0};
    const int every = (n + MAX_LOOKS - 1) / MAX_LOOKS;
    double looking = 0;
    *count = none;
    if (f) f->start = energy_of(&s, c, self);
    double start = cpu_seconds();
    c->step(self, count);
    *first = cpu_seconds() - start;
    start = cpu_seconds();
    for (int k = 1; k <= n; k++) {
        if (k > 1) c->step(self, count);
        if (!f || (k % every && k < n)) continue;
        const double from = cpu_seconds();
        look(p, &s, c, self, f);
        looking += cpu_seconds() - from;
    }
    const double time = cpu_seconds() - start - looking;
    c->destroy(self);
    return time * n / (n - 1);
}

static int compare_times(const void *a, const void *b)
{
    const double *x = a;
    const double *y = b;
    return (*x > *y) - (*x < *y);
}

/* Prints a line: a fault of an overlap or a joint that the scene has not is 0. Returns the seconds
 * of a run. */
static double measure(const problem *p, const contender *c, int rate, const effort *work)
{
    const int n = (int)(rate * p->duration + 0.5);
    double times[MAX_ROUNDS];
    counters count;
    faults f = {0};
    double first = 0;
    double total = 0;
    int rounds = 0;
    while (rounds < MAX_ROUNDS && (rounds < work->rounds || total < work->long_enough)) {
        times[rounds] = run(p, c, n, &count, rounds ? NULL : &f, &first);
        total += times[rounds++];
        if (total > work->too_long) break;
    }
    qsort(times, (size_t)rounds, sizeof *times, compare_times);
    const int chosen = strcmp(c->name, "carom tolerance") == 0;
    printf("%s,%s,%d,%s,%.3e,%.3e,%.3e,%.3e,%d,%.1e,%.1e,%.1e,%.1e\n", p->name, c->name, rate,
           chosen ? tolerance : "0", f.error, times[rounds / 2] / p->duration,
           times[0] / p->duration, times[rounds - 1] / p->duration, count.worst, f.overlap, f.gap,
           f.gain, first);
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
    static const char *const names[4] = {"none", "disc", "box", "polygon"};
    return names[shape];
}

static void print_scene(const problem *p)
{
    printf("{\"name\": \"%s\", \"gravity\": %.17g, \"duration\": %.17g, \"body\": %d, \"reach\": "
           "%.17g, \"rests\": %d,\n"
           " \"resolved\": %.17g, \"exact\": [%.17g, %.17g, %.17g], \"bodies\": [",
           p->name, p->s.gravity, p->duration, p->body, p->reach, p->rests, p->resolved,
           p->exact[0], p->exact[1], p->exact[2]);
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

/* A number or a file; what is neither ends the program. */
static problem find_problem(const char *word)
{
    char *end;
    const long k = strtol(word, &end, 10);
    if (*end) return read_problem(word);
    if (k < 0 || k >= N_PROBLEMS) {
        fprintf(stderr, "usage: bench_precision [--quick] [0..%d | FILE]\n", N_PROBLEMS - 1);
        exit(1);
    }
    return make_problem((int)k);
}

static void compare(problem p, const effort *work)
{
    contender list[MAX_CONTENDERS];
    const int n = contenders(list);
    find_reference(&p);
    printf("# %s: errors below %.1e m are not resolved\n", p.name, p.resolved);
    for (int i = 0; i < n; i++) curve(&p, &list[i], work);
    free_problem(&p);
}

int main(int argc, char **argv)
{
    if (argc == 3 && strcmp(argv[1], "scene") == 0) {
        problem p = find_problem(argv[2]);
        find_reference(&p);
        print_scene(&p);
        free_problem(&p);
        return 0;
    }
    const int quick = argc > 1 && strcmp(argv[1], "--quick") == 0;
    const effort *work = quick ? &QUICK : &FULL;
    const char *one = argc > 1 + quick ? argv[1 + quick] : NULL;
    printf("scene,contender,rate,tolerance,error,cost,least,most,status,overlap,gap,gain,first\n");
    for (int k = 0; !one && k < N_PROBLEMS; k++) compare(make_problem(k), work);
    if (one) compare(find_problem(one), work);
    return 0;
}
