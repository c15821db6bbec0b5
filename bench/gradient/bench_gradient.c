/* What gradients cost, and how right they are.
 *
 * Usage: bench_gradient [--quick]          all parts as CSV: cost, of steps and gradients of
 *                                          scenes; closed, derivatives with closed forms;
 *                                          differences of whole runs, and smoothed, of the same
 *        bench_gradient closed DT          the second part at a step of DT alone
 *        bench_gradient count SCENE WHAT   WHAT once, in `measured`: for count.sh under callgrind
 *
 * WHAT: 0 steps alone, 1 recorded, 2 backward by q0, 3 backward by all, 4 backward by all with
 * checkpoints, so that all but a tenth of the steps are run again. */
#include "bench/solver/clock.h"
#include "own.h"
#include "problems.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { FORWARD, RECORD, BACKWARD, BACKWARD_ALL, BACKWARD_AGAIN, N_WHATS };
static const char *const WHATS[N_WHATS] = {"forward", "recorded", "backward by q0",
                                           "backward by all", "backward by all with checkpoints"};
enum { N_WARM_UP = 60, N_STEPS = 60, N_OWN = 4 };
/* Relative error of a derivative that has a closed form, at most. */
static const double EXACT = 1e-10;
/* Rounds of each, the least time counts; a scene has no more of them after this [s]. */
enum { N_ROUNDS = 9 };
static const double BUDGET = 6;
/* Families of bench/step, of which stack and pyramid bear a pendulum: none of their steps is left
 * out; -1: a pile of this file. */
static const int FAMILIES[N_OWN] = {2, 1, 3, -1};
static const int SIZES[N_OWN] = {10, 10, 210, 40};
static const char *const NAMES[N_OWN] = {"stack of 10 under a pendulum", "chain of 10",
                                         "pyramid of 210 under a pendulum", "pile of 40"};

static void must(const char *what, carom_status e)
{
    if (e >= 0) return;
    fprintf(stderr, "bench_gradient: %s: %s\n", what, carom_status_name(e));
    exit(1);
}

static double *room(size_t n)
{
    double *p = calloc(n + 1, sizeof *p);
    if (!p) abort();
    return p;
}

/* Discs of two sizes fall into a box, ten columns wide. */
static carom_world *pile(int n, carom_integrator integrator)
{
    carom_world_settings set = carom_world_defaults();
    set.integrator = (int)integrator;
    carom_world *w = NULL;
    carom_body_def floor = carom_body_at(CAROM_STATIC, 0, -1);
    must("world", carom_world_create(&set, NULL, &w));
    must("floor", carom_world_add_box(w, &floor, 20, 2, 0, NULL));
    for (int side = -1; side <= 1; side += 2) {
        carom_body_def wall = carom_body_at(CAROM_STATIC, side * 2.2, 5);
        must("wall", carom_world_add_box(w, &wall, 2, 12, 0, NULL));
    }
    for (int k = 0; k < n; k++) {
        const double x = 0.23 * (k % 10 - 4.5) + 0.01 * sin(12.9898 * k);
        carom_body_def disc = carom_body_at(CAROM_DYNAMIC, x, 0.11 + 0.23 * (k / 10));
        must("disc", carom_world_add_circle(w, &disc, k % 3 ? 0.1 : 0.08, 100, NULL));
    }
    must("seal", carom_world_seal(w));
    return w;
}

static carom_world *build(int which, carom_integrator integrator)
{
    carom_world *w;
    if (FAMILIES[which] < 0) {
        w = pile(SIZES[which], integrator);
    } else {
        scene s = make_family(FAMILIES[which], SIZES[which]);
        w = own_create(&s, integrator, 2);
        free_scene(&s);
    }
    for (int k = 0; k < N_WARM_UP; k++) must("warm up", carom_world_step(w, NULL, NULL));
    return w;
}

/* Room for a gradient by everything. */
static carom_gradient everything(const carom_world *w)
{
    const size_t n = (size_t)carom_world_n_bodies(w);
    const carom_world_size size = carom_world_measure(w);
    carom_gradient g = {0};
    g.q0 = room(3 * n);
    g.v0 = room(3 * n);
    g.mass = room(n);
    g.inertia = room(n);
    g.friction = room(n);
    g.restitution = room(n);
    g.gravity = room(2);
    g.force = room(3 * n);
    g.force_steps = room(3 * n * N_STEPS);
    g.dt = room(1);
    g.radius = room((size_t)size.n_shapes);
    g.vertices = (carom_vec2 *)room(2 * (size_t)size.n_vertices);
    g.anchors = (carom_vec2 *)room(4 * (size_t)size.n_joints);
    return g;
}

static void release(carom_gradient *g)
{
    free(g->q0);
    free(g->v0);
    free(g->mass);
    free(g->inertia);
    free(g->friction);
    free(g->restitution);
    free(g->gravity);
    free(g->force);
    free(g->force_steps);
    free(g->dt);
    free(g->radius);
    free(g->vertices);
    free(g->anchors);
}

/* What is on the clock. */
typedef struct work {
    int what;
    carom_world *world;
    carom_tape *tape;
    double *ones;
    carom_gradient gradient;
    double size; /* |d loss / d q0|, so that nothing is computed for nothing */
} work;

__attribute__((noinline)) static void measured(work *x)
{
    if (x->what == FORWARD) {
        for (int k = 0; k < N_STEPS; k++) must("step", carom_world_step(x->world, NULL, NULL));
    } else if (x->what == RECORD) {
        for (int k = 0; k < N_STEPS; k++) must("step", carom_tape_step(x->tape, NULL, NULL));
    } else {
        const carom_state_bar bar = {N_STEPS, x->ones, x->ones};
        must("gradient", carom_tape_gradient(x->tape, 1, &bar, &x->gradient, NULL));
        x->size = hypot(x->gradient.q0[4], x->gradient.q0[5]);
    }
}

/* One run of a scene; processor seconds of what is measured, and bytes of the tape per step. */
static double run(int which, carom_integrator integrator, int what, double *bytes)
{
    carom_world *w = build(which, integrator);
    work x = {what, w, NULL, room(3 * (size_t)carom_world_n_bodies(w)), {0}, 0};
    carom_gradient all = everything(w);
    x.gradient = all;
    if (what == BACKWARD) memset(&x.gradient, 0, sizeof x.gradient);
    x.gradient.q0 = all.q0;
    for (int k = 0; k < 3 * carom_world_n_bodies(w); k++) x.ones[k] = 1;
    must("tape", carom_tape_create(w, NULL, &x.tape));
    if (what == BACKWARD_AGAIN) must("tape", carom_tape_checkpoint(x.tape, N_STEPS / 10));
    for (int k = 0; what >= BACKWARD && k < N_STEPS; k++) {
        must("step", carom_tape_step(x.tape, NULL, NULL));
    }
    const double start = cpu_seconds();
    measured(&x);
    const double seconds = cpu_seconds() - start;
    if (x.size < 0 || isnan(x.size)) must("gradient", CAROM_E_NO_SOLUTION);
    *bytes = (double)carom_tape_bytes(x.tape) / N_STEPS;
    release(&all);
    free(x.ones);
    carom_tape_destroy(x.tape);
    carom_world_destroy(w);
    return seconds;
}

static void cost_of(int which, carom_integrator integrator, const char *name)
{
    double least[N_WHATS] = {HUGE_VAL, HUGE_VAL, HUGE_VAL, HUGE_VAL, HUGE_VAL};
    double bytes[N_WHATS];
    const double start = cpu_seconds();
    for (int round = 0; round < N_ROUNDS && cpu_seconds() - start < BUDGET; round++) {
        for (int k = 0; k < N_WHATS; k++) {
            least[k] = fmin(least[k], run(which, integrator, k, &bytes[k]));
        }
    }
    for (int k = 0; k < N_WHATS; k++) {
        printf("cost,%s,%s,%s,%.4g,,,,%.4g,%.3f,%.0f\n", NAMES[which], name, WHATS[k], 1.0 / 60,
               least[k] / N_STEPS, least[k] / least[FORWARD], k == FORWARD ? 0 : bytes[k]);
    }
    fflush(stdout);
}

static void costs(int quick)
{
    for (int which = 0; which < N_OWN - 2 * quick; which++) {
        cost_of(which, CAROM_LOCATED, "carom located");
        cost_of(which, CAROM_EULER, "carom euler");
    }
}

/* --- closed forms -------------------------------------------------------------------------------
 */

typedef struct trial {
    const problem *p;
    double dt;
    int n;
    double kappa; /* of smoothing; 0: none */
    double by;    /* of differences */
    double value;
} trial;

static void steps_alone(void *user)
{
    const trial *x = user;
    carom_world *w = x->p->build(x->dt);
    for (int k = 0; k < x->n; k++) must(x->p->name, carom_world_step(w, NULL, NULL));
    carom_world_destroy(w);
}

static void with_gradient(void *user)
{
    trial *x = user;
    const problem *p = x->p;
    carom_world *w = p->build(x->dt);
    carom_tape *tape;
    double q_bar[6] = {0}, q0[6], v0[6], friction[2], restitution[2];
    must(p->name, carom_tape_create(w, NULL, &tape));
    for (int k = 0; k < x->n; k++) must(p->name, carom_tape_step(tape, NULL, NULL));
    must(p->name, carom_tape_smooth(tape, x->kappa));
    q_bar[3 + p->coordinate] = 1;
    const carom_state_bar bar = {x->n, q_bar, NULL};
    carom_gradient g = {0};
    g.q0 = q0;
    g.v0 = v0;
    g.friction = friction;
    g.restitution = restitution;
    must(p->name, carom_tape_gradient(tape, 1, &bar, &g, NULL));
    x->value = 0;
    if (p->by_q0 >= 0) x->value = q0[3 + p->by_q0];
    if (p->by_v0 >= 0) x->value = v0[3 + p->by_v0];
    if (p->by_friction) x->value = friction[0] + friction[1];
    if (p->by_restitution) x->value = restitution[0] + restitution[1];
    carom_tape_destroy(tape);
    carom_world_destroy(w);
}

/* The loss where the parameter is moved by `by`. */
static double moved(const trial *x, double by)
{
    const problem *p = x->p;
    carom_world *w = p->build(x->dt);
    double q[6], v[6], friction[2], restitution[2];
    for (int k = 0; k < 2; k++) friction[k] = restitution[k] = p->coefficient + by;
    carom_parameters set = {0};
    if (p->by_friction) set.friction = friction;
    if (p->by_restitution) set.restitution = restitution;
    memcpy(q, carom_world_q(w), sizeof q);
    memcpy(v, carom_world_v(w), sizeof v);
    if (p->by_q0 >= 0) q[3 + p->by_q0] += by;
    if (p->by_v0 >= 0) v[3 + p->by_v0] += by;
    must(p->name, carom_world_set_state(w, q, v));
    must(p->name, carom_world_set_parameters(w, &set));
    for (int k = 0; k < x->n; k++) must(p->name, carom_world_step(w, NULL, NULL));
    const double loss = carom_world_q(w)[3 + p->coordinate];
    carom_world_destroy(w);
    return loss;
}

static void by_differences(void *user)
{
    trial *x = user;
    x->value = (moved(x, x->by) - moved(x, -x->by)) / (2 * x->by);
}

static trial trial_of(const problem *p, double dt)
{
    const trial x = {p, dt, (int)(p->seconds / dt + 0.5), 0, 0, 0};
    return x;
}

/* In the columns of the closed forms, with the name of the setting in that of the engine. */
static void print_trial(const char *part, const trial *x, const char *setting, double size,
                        double seconds, double forward)
{
    const double error = fabs(x->value / x->p->exact - 1);
    printf("%s,%s,%s %.0e,%s,%.4g,%.12g,%.12g,%.1e,%.3e,%.3g,\n", part, x->p->name, setting, size,
           x->p->parameter, x->dt, x->value, x->p->exact, error, seconds, seconds / forward);
}

static void differences_and_smoothing(double dt)
{
    for (int k = 0; k < N_PROBLEMS; k++) {
        trial x = trial_of(&problems[k], dt);
        const double forward = least_time(steps_alone, &x);
        for (x.by = 1e-2; x.by > 1e-11; x.by *= 1e-2) {
            const double seconds = least_time(by_differences, &x);
            print_trial("differences", &x, "differences of", x.by, seconds, forward);
        }
        for (x.kappa = 1e-2; x.kappa > 1e-13; x.kappa *= 1e-2) {
            const double seconds = least_time(with_gradient, &x);
            print_trial("smoothed", &x, "smoothed by", x.kappa, seconds, forward);
        }
    }
}

static int closed_forms(double dt)
{
    int failed = 0;
    for (int k = 0; k < N_PROBLEMS; k++) {
        trial x = trial_of(&problems[k], dt);
        const double forward = least_time(steps_alone, &x);
        const double both = least_time(with_gradient, &x);
        const double error = fabs(x.value / x.p->exact - 1);
        printf("closed,%s,carom located,%s,%.4g,%.12g,%.12g,%.1e,%.3e,%.3g,\n", x.p->name,
               x.p->parameter, dt, x.value, x.p->exact, error, both, both / forward);
        failed |= !(error < EXACT);
    }
    return failed;
}

static int count(int which, int what)
{
    double bytes;
    if (which < 0 || which >= N_OWN || what < 0 || what >= N_WHATS) return 2;
    run(which, CAROM_LOCATED, what, &bytes);
    return 0;
}

int main(int argc, char **argv)
{
    const int quick = argc > 1 && strcmp(argv[1], "--quick") == 0;
    if (argc > 3 && strcmp(argv[1], "count") == 0) return count(atoi(argv[2]), atoi(argv[3]));
    printf("part,scene,engine,what,dt,value,exact,error,seconds,over_forward,bytes\n");
    if (argc > 2 && strcmp(argv[1], "closed") == 0) return closed_forms(atof(argv[2]));
    costs(quick);
    differences_and_smoothing(1.0 / 60);
    return closed_forms(1.0 / 60) | closed_forms(1e-3);
}
