/* Microseconds per step of small and large scenes: carom with each integrator beside Box2D 2.4 and
 * Chipmunk 7 where these are installed, one thread, in one run.
 *
 * Usage: bench_step [scene [contender]]: numbers from 0, or a contender's name; prints a table for
 * docs/performance.md. Each figure is the least over rounds of the mean over the scene's steps.
 * Beside it stand the largest overlap at the end and how far bodies moved that should rest,
 * measured from the poses with carom_collide for all alike.  A failed step ends in exit code 1. */
#include "bench/solver/clock.h"
#include "poses.h"

#include "carom/base.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Rounds go on for so long [s], and are at least so many. */
static const double LONG_ENOUGH = 0.3;
enum { MIN_ROUNDS = 3, MAX_CONTENDERS = 5 };
/* A round is cut short after this [s], and is then the only one. */
static const double BUDGET = 15;

typedef struct figures {
    double seconds; /* per step */
    int n_steps;    /* on the clock, of one round */
    counters c;     /* of one round */
    double overlap, moved;
} figures;

static int step_on_the_clock(const scene *s, const contender *c, void *self, counters *count)
{
    const int at_once = s->n_bodies > 100 ? 1 : 10; /* steps between two looks at the clock */
    const double start = cpu_seconds();
    for (int k = 0; k < s->n_steps; k++) {
        if (k % at_once == 0 && cpu_seconds() - start > BUDGET) return k;
        c->step(self, count);
    }
    return s->n_steps;
}

/* One round: seconds per step. */
static double run(const scene *s, const contender *c, figures *f)
{
    void *self = c->create(s);
    counters warm = {0, 0, 0, 0, 0};
    counters count = {0, 0, 0, 0, 0};
    const double first = cpu_seconds();
    for (int k = 0; k < s->warm_up && cpu_seconds() - first < BUDGET; k++) c->step(self, &warm);
    const double start = cpu_seconds();
    f->n_steps = step_on_the_clock(s, c, self, &count);
    const double seconds = (cpu_seconds() - start) / f->n_steps;
    f->c = count;
    if (warm.worst < 0 || warm.worst > f->c.worst) f->c.worst = warm.worst;
    f->overlap = largest_overlap(s, c, self);
    f->moved = s->rests ? largest_move(s, c, self) : 0;
    c->destroy(self);
    return seconds;
}

static figures measure(const scene *s, const contender *c)
{
    figures f = {HUGE_VAL, 0, {0, 0, 0, 0, 0}, 0, 0};
    const double start = cpu_seconds();
    for (int k = 0; k < MIN_ROUNDS || cpu_seconds() - start < LONG_ENOUGH; k++) {
        f.seconds = fmin(f.seconds, run(s, c, &f));
        if (cpu_seconds() - start > BUDGET) break;
    }
    return f;
}

static void print_row(const scene *s, const contender *c, const figures *f, double peer, int own)
{
    printf("| %s | %s | %.3g | ", s->name, c->name, 1e6 * f->seconds);
    if (peer > 0) {
        printf("%.2g | ", f->seconds / peer);
    } else {
        printf("- | ");
    }
    if (own) {
        printf("%.3g | %d | %d | ", (double)f->c.factorizations / f->n_steps, f->c.n_substeps,
               f->c.n_contacts);
    } else {
        printf("- | - | - | ");
    }
    printf("%.1e | ", f->overlap);
    if (s->rests) {
        printf("%.1e |", f->moved);
    } else {
        printf("- |");
    }
    if (f->n_steps < s->n_steps) printf(" %d of %d steps", f->n_steps, s->n_steps);
    if (f->c.worst) printf(" %s", carom_status_name((carom_status)f->c.worst));
    printf(" |\n");
    fflush(stdout);
}

/* A wish is a number or a name; none: all. */
static int is_wanted(const char *wish, int i, const contender *c)
{
    char number[16];
    snprintf(number, sizeof number, "%d", i);
    return !wish || strcmp(wish, number) == 0 || strcmp(wish, c->name) == 0;
}

int main(int argc, char **argv)
{
    const int only_scene = argc > 1 ? atoi(argv[1]) : -1;
    const char *only_contender = argc > 2 ? argv[2] : NULL;
    const contender *all[MAX_CONTENDERS] = {NULL};
    int n = 0;
    int failed = 0;
#ifdef WITH_BOX2D
    all[n++] = &BOX2D[0];
#endif
#ifdef WITH_CHIPMUNK
    all[n++] = &CHIPMUNK[0];
#endif
    const int first_own = n;
    for (int k = 0; k < 3; k++) all[n++] = &CAROM_CONTENDERS[k];
    printf("| scene | engine | us per step | times Box2D | factorizations per step | "
           "most sub-steps | contacts | overlap [m] | moved [m] | |\n");
    printf("|---|---|---|---|---|---|---|---|---|---|\n");
    for (int k = 0; k < N_SCENES; k++) {
        if (only_scene >= 0 && only_scene != k) continue;
        scene s = make_scene(k);
        double peer = 0;
        for (int i = 0; i < n; i++) {
            if (!is_wanted(only_contender, i, all[i])) continue;
            const figures f = measure(&s, all[i]);
            if (i == 0 && first_own > 0) peer = f.seconds;
            print_row(&s, all[i], &f, peer, i >= first_own);
            failed |= f.c.worst < 0;
        }
        free_scene(&s);
    }
    return failed;
}
