/* The stability atlas: maps of stiff and extreme cases; each cell is run with every method of carom
 * and, where they can, with Box2D 2.4 and Chipmunk 7, and is judged from the poses alone.
 *
 * Usage: bench_stability [--quick] [family [x y [engine]]]
 * CSV to standard output, progress to standard error.  With x and y (indices) one cell.
 * bench/stability/plot.py draws the maps and writes a page that has the criteria.
 * Exit code 1 when a cell of carom is black: wrong, and no status said so.
 *
 * A cell runs in a process of its own: one that crashes or never ends is one cell. */
#include "trial.h"

#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

/* Seconds of a cell's steps; it is killed when a step goes on for so many more. */
static const double LIMIT_QUICK = 0.3;
static const double LIMIT_FULL = 5;
enum { KILL_AFTER = 30 };

static const char *const COLORS[] = {"green", "yellow", "red", "black", "none"};

static int engines(engine *list)
{
    int n = 0;
    const engine own[4] = {{"located", NULL, CAROM_LOCATED, 2},
                           {"order 6", NULL, CAROM_LOCATED, 6},
                           {"fixed", NULL, CAROM_FIXED, 2},
                           {"euler", NULL, CAROM_EULER, 2}};
    for (int k = 0; k < 4; k++) list[n++] = own[k];
#ifdef WITH_BOX2D
    const engine box2d = {"Box2D 2.4", &BOX2D[0], CAROM_EULER, 0};
    list[n++] = box2d;
#endif
#ifdef WITH_CHIPMUNK
    const engine chipmunk = {"Chipmunk 7", &CHIPMUNK[0], CAROM_EULER, 0};
    list[n++] = chipmunk;
#endif
    return n;
}

static outcome run_here(const family *f, double x, double y, const engine *e, double limit)
{
    trial t;
    f->build(&t, x, y);
    outcome o = trial_run(&t, e, limit);
    if (!e->peer && t.probe >= 0 && (o.color == GREEN) && o.seconds < 0.1 * limit) {
        o.gradient = trial_gradient(&t, e, limit);
        if (o.gradient > 1e-3) {
            o.color = BLACK;
            snprintf(o.why, sizeof o.why, "gradient off by %.1e", o.gradient);
        }
    }
    trial_free(&t);
    return o;
}

/* In a process of its own. */
static outcome run_apart(const family *f, double x, double y, const engine *e, double limit)
{
    int ends[2];
    outcome o;
    memset(&o, 0, sizeof o);
    fflush(stdout);
    if (pipe(ends)) abort();
    const pid_t child = fork();
    if (child < 0) abort();
    if (child == 0) {
        alarm((unsigned)ceil(KILL_AFTER + 2 * limit));
        o = run_here(f, x, y, e, limit);
        const ssize_t sent = write(ends[1], &o, sizeof o);
        _exit(sent != (ssize_t)sizeof o);
    }
    close(ends[1]);
    const ssize_t got = read(ends[0], &o, sizeof o);
    close(ends[0]);
    int status = 0;
    waitpid(child, &status, 0);
    if (got == (ssize_t)sizeof o) return o;
    memset(&o, 0, sizeof o);
    o.color = BLACK;
    o.error = o.gradient = -1;
    o.seconds = KILL_AFTER + 2 * limit;
    snprintf(o.why, sizeof o.why, "%s",
             WIFSIGNALED(status) && WTERMSIG(status) == SIGALRM ? "a step does not end"
                                                                : "crashed");
    return o;
}

static void print_row(const family *f, double x, double y, const engine *e, const outcome *o,
                      int n_steps)
{
    printf("%s,%s,%s,%g,%g,%s,%s,%s,%.2e,%.2e,%.2e,%.2e,%.2e,%.2e,%d,%d,%d,%.3g,%s\n", f->name,
           f->x_name, f->y_name, x, y, e->name, COLORS[o->color],
           e->peer ? "" : carom_status_name((carom_status)o->worst), o->residual, o->overlap,
           o->drift, o->gain, o->error, o->gradient, o->n_said, o->n_steps, n_steps, o->seconds,
           o->why);
    fflush(stdout);
}

/* 1 when the cell is black and carom's. */
static int cell(const family *f, double x, double y, const engine *e, double limit)
{
    trial t;
    f->build(&t, x, y);
    const int n_steps = t.s.n_steps;
    trial_free(&t);
    const outcome o = run_apart(f, x, y, e, limit);
    print_row(f, x, y, e, &o, n_steps);
    return o.color == BLACK && !e->peer;
}

/* Every other value, and the last. */
static int in_quick(int k, int n)
{
    return k % 2 == 0 || k == n - 1;
}

static int map(const family *f, double limit, int quick, int x, int y, int only)
{
    engine list[8];
    printf("# %s | %s | %s\n", f->name, f->known ? f->known : "", f->hard ? f->hard : "");
    const int n = engines(list);
    int black = 0;
    for (int i = 0; i < f->nx; i++) {
        fprintf(stderr, "\r%-32s %3d/%d ", f->name, i + 1, f->nx);
        for (int j = 0; j < f->ny; j++) {
            if (x >= 0 && (i != x || j != y)) continue;
            if (quick && !(in_quick(i, f->nx) && in_quick(j, f->ny))) continue;
            for (int k = 0; k < n; k++) {
                if (only >= 0 && k != only) continue;
                black += cell(f, f->x[i], f->y[j], &list[k], limit);
            }
        }
    }
    fprintf(stderr, "%d black\n", black);
    return black;
}

int main(int argc, char **argv)
{
    const int quick = argc > 1 && strcmp(argv[1], "--quick") == 0;
    const char *only = argc > 1 + quick ? argv[1 + quick] : NULL;
    const int x = argc > 3 + quick ? atoi(argv[2 + quick]) : -1;
    const int y = argc > 3 + quick ? atoi(argv[3 + quick]) : -1;
    const int e = argc > 4 + quick ? atoi(argv[4 + quick]) : -1;
    const double limit = quick ? LIMIT_QUICK : LIMIT_FULL;
    const family *const lists[3] = {CONTACT_FAMILIES, JOINT_FAMILIES, STRUCTURE_FAMILIES};
    const int counts[3] = {N_CONTACT_FAMILIES, N_JOINT_FAMILIES, N_STRUCTURE_FAMILIES};
    int black = 0;
    printf("family,x_name,y_name,x,y,engine,color,status,residual,overlap,drift,gain,error,"
           "gradient,said,steps,of,seconds,why\n");
    for (int k = 0; k < 3; k++) {
        for (int i = 0; i < counts[k]; i++) {
            const family *f = &lists[k][i];
            if (!only || strcmp(f->name, only) == 0) black += map(f, limit, quick, x, y, e);
        }
    }
    return black > 0;
}
