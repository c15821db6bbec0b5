/* Guard of accuracy and work.  Each row runs one scene; its error against a closed form, its counts
 * of work and its memory must stay below the limits of the table.  These are counts: the same on
 * every run and every machine that rounds alike.
 *
 * Limits of errors are claims: of docs/step.md, of the marks to beat, or of the order of the
 * method. Limits of work are what was counted on 2026-11-25, plus MARGIN.  `test_guard print`
 * prints the table as it is now: a change that lowers a count lowers its limit too.  Joints alone
 * factor twice a sub-step since then, stage 1 with the rows of its own end, for fewer
 * back-substitutions: of ten links 235 thousand instructions a step in place of 592. */
#include "near.h"
#include "scenes.h"

#include "carom/grad.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* For other roundings: compilers, libraries; what jams depends on them most. */
static const double MARGIN = 1.15;
static const double MARGIN_OF_PILES = 2;
static const double G = 9.81;

/* What a run cost. */
typedef struct work {
    long factorizations, iterations, substeps;
    long requests; /* to the allocator, in the second half of the run */
    double error;  /* by the scene's own measure */
} work;

typedef struct guard {
    const char *name;
    carom_integrator integrator;
    int order;
    carom_world *(*build)(void);
    int n_steps;
    double (*error)(const carom_world *w);
    double most_error;
    const char *claim;                                   /* where it is from */
    long factorizations, iterations, substeps, requests; /* counted */
    long bytes;                                          /* held at the end, counted */
} guard;

/* --- scenes: each starts at rest or as said, dt = 1/60 */

static carom_world *free_disc(void)
{
    carom_world *w = scene_world(G, 1.0 / 60);
    scene_disc(w, 1, 0.5, 0, 0, 0.5, 0.5);
    scene_push(w, 0, 3, 2, 5);
    return w;
}

static double off_parabola(const carom_world *w)
{
    const double t = carom_world_time(w);
    const double *q = carom_world_q(w);
    return hypot(q[1] - 2 * t, q[2] - 5 * t + 0.5 * G * t * t);
}

static carom_world *bouncing(void)
{
    carom_world *w = scene_world(G, 1.0 / 60);
    scene_floor(w, 0.5, 0.8);
    scene_disc(w, 1, 0.25, 0, 1.25, 0.5, 0.8);
    return w;
}

static double off_bounces(const carom_world *w)
{
    double v = sqrt(2 * G);
    double t = carom_world_time(w) - v / G;
    for (v *= 0.8; t > 2 * v / G; v *= 0.8) t -= 2 * v / G;
    return fabs(carom_world_q(w)[5] - 0.25 - v * t + 0.5 * G * t * t);
}

static carom_world *sliding(void)
{
    carom_world *w = scene_world(G, 1.0 / 60);
    scene_floor(w, 0.5, 0);
    const carom_pose at = {0, 0, 0.25};
    const int b = scene_box(w, 1, 0.5, 0.25, at, 0.5, 0);
    scene_push(w, b, 0, 3, 0);
    return w;
}

static double off_stop(const carom_world *w)
{
    return fabs(carom_world_q(w)[4] - 9 / (2 * 0.5 * G));
}

static carom_world *rolling(void)
{
    carom_world *w = scene_world(G, 1.0 / 60);
    scene_floor(w, 0.3, 0);
    const int b = scene_disc(w, 1, 0.5, 0, 0.5, 0.3, 0);
    scene_push(w, b, 0, 3, 0);
    return w;
}

static double off_roll(const carom_world *w)
{
    const double slide = 3 / (3 * 0.3 * G);
    const double x = 5 * 9 / (18 * 0.3 * G) + 2 * (carom_world_time(w) - slide);
    return fabs(carom_world_q(w)[4] - x);
}

/* What is known of a chain is its energy. */
static carom_world *links_of(int n)
{
    carom_world *w = scene_world(G, 1.0 / 60);
    scene_links(w, n);
    return w;
}

static carom_world *three_links(void)
{
    return links_of(3);
}

static carom_world *ten_links(void)
{
    return links_of(10);
}

/* Energy against that at the start, which the same scene has before its first step. */
static double energy_lost(const carom_world *w, carom_world *(*build)(void))
{
    carom_world *fresh = build();
    const double before = carom_world_energy(fresh);
    carom_world_destroy(fresh);
    return fabs(carom_world_energy(w) - before);
}

static double three_links_lost(const carom_world *w)
{
    return energy_lost(w, three_links);
}

static double ten_links_lost(const carom_world *w)
{
    return energy_lost(w, ten_links);
}

static carom_world *heavy_end(void)
{
    carom_world *w = scene_world(G, 1.0 / 60);
    int before = scene_anchor(w);
    for (int k = 0; k < 10; k++) {
        const carom_pose mid = {0, k + 0.5, 0};
        const carom_vec2 pin = {k, 0};
        const int b = scene_box(w, k < 9 ? 1 : 1e4, 0.5, 0.05, mid, 0, 0);
        assert_int_equal(carom_world_add_revolute(w, before, b, pin, NULL), CAROM_OK);
        before = b;
    }
    return w;
}

/* Of what the heavy end may fall, 10 m. */
static double heavy_end_lost(const carom_world *w)
{
    return energy_lost(w, heavy_end) / (1e4 * G * 10);
}

static carom_world *stack(void)
{
    carom_world *w = scene_world(G, 1.0 / 60);
    scene_floor(w, 0.5, 0);
    for (int k = 0; k < 10; k++) {
        const carom_pose at = {0, 0, k + 0.5};
        scene_box(w, 1, 0.5, 0.5, at, 0.5, 0);
    }
    return w;
}

static double stack_moved(const carom_world *w)
{
    double most = 0;
    const double *q = carom_world_q(w);
    for (int b = 1; b <= 10; b++) {
        most = fmax(most, hypot(q[3 * b + 1], q[3 * b + 2] - (b - 0.5)));
    }
    return most;
}

enum { BASE = 10 };

static carom_world *pyramid(void)
{
    carom_world *w = scene_world(G, 1.0 / 60);
    scene_floor(w, 0.5, 0);
    for (int row = 0; row < BASE; row++) {
        for (int k = 0; k < BASE - row; k++) {
            const carom_pose at = {0, k - 0.5 * (BASE - row - 1), row + 0.5};
            scene_box(w, 1, 0.45, 0.5, at, 0.5, 0);
        }
    }
    return w;
}

static double pyramid_moved(const carom_world *w)
{
    double most = 0;
    int b = 1;
    const double *q = carom_world_q(w);
    for (int row = 0; row < BASE; row++) {
        for (int k = 0; k < BASE - row; k++, b++) {
            const double x = k - 0.5 * (BASE - row - 1);
            most = fmax(most, hypot(q[3 * b + 1] - x, q[3 * b + 2] - row - 0.5));
        }
    }
    return most;
}

/* Three balls apart, one flies: the last one flies on. */
static carom_world *cradle(void)
{
    carom_world *w = scene_world(0, 1.0 / 60);
    for (int k = 0; k < 3; k++) scene_disc(w, 1, 0.5, 1.125 * k, 0, 0, 1);
    scene_push(w, 0, 0, 1, 0);
    return w;
}

/* Each ball goes as far as its gap, 0.125, at speed 1. */
static double off_cradle(const carom_world *w)
{
    const double *q = carom_world_q(w);
    const double last = 2.25 + carom_world_time(w) - 0.25;
    return fmax(fabs(q[1] - 0.125), fmax(fabs(q[4] - 1.25), fabs(q[7] - last)));
}

static carom_world *pile(void)
{
    carom_world *w = scene_world(G, 1.0 / 60);
    scene_floor(w, 0.5, 0);
    for (int side = -1; side <= 1; side += 2) {
        const carom_pose at = {0, side * 1.2, 3};
        carom_body_def d = carom_body_at(CAROM_STATIC, at.x, at.y);
        const carom_vec2 v[4] = {{-0.1, -3}, {0.1, -3}, {0.1, 3}, {-0.1, 3}};
        const carom_shape wall = {0, 4, v};
        d.shapes = &wall;
        d.n_shapes = 1;
        assert_int_equal(carom_world_add_body(w, &d, NULL), CAROM_OK);
    }
    for (int k = 0; k < 30; k++) {
        const double x = -0.9 + 0.22 * (k % 9) + 0.003 * (k % 7);
        scene_disc(w, 1, 0.1 - 0.002 * (k % 5), x, 0.12 + 0.23 * (k / 9), 0.5, 0);
    }
    return w;
}

/* Deepest overlap of what touches. */
static double deepest(const carom_world *w)
{
    double most = 0;
    for (int k = 0; k < carom_world_n_contacts(w); k++) {
        most = fmax(most, -carom_world_contact(w, k).gap);
    }
    return most;
}

static const guard GUARDS[] = {
    {"free disc", CAROM_LOCATED, 2, free_disc, 120, off_parabola, 1e-12,
     "free flight is exact: rounding of 120 steps", 0, 0, 120, 0, 20088},
    {"bouncing ball", CAROM_LOCATED, 2, bouncing, 120, off_bounces, 1e-12,
     "docs/step.md: within 1e-12 m over 2 s", 1, 0, 123, 1, 33592},
    {"sliding stop", CAROM_LOCATED, 2, sliding, 60, off_stop, 1e-12,
     "docs/step.md: exact to 1e-12; peers at best 1e-5", 14, 0, 61, 0, 37096},
    {"slide to roll", CAROM_LOCATED, 2, rolling, 60, off_roll, 1e-12,
     "docs/step.md: exact to 1e-12; peers at best 1e-4", 5, 0, 61, 0, 34264},
    {"three links, order 2", CAROM_LOCATED, 2, three_links, 60, three_links_lost, 1.5e-02,
     "twice what was measured on 2026-11-25 [J]", 120, 0, 60, 0, 34520},
    {"three links, order 6", CAROM_LOCATED, 6, three_links, 60, three_links_lost, 2.2e-08,
     "twice what was measured on 2026-11-25 [J]", 840, 0, 60, 0, 55448},
    {"ten links", CAROM_LOCATED, 2, ten_links, 60, ten_links_lost, 6.9e-02,
     "twice what was measured on 2026-11-25 [J]", 120, 0, 60, 0, 65500},
    {"heavy end, 1e4", CAROM_LOCATED, 2, heavy_end, 60, heavy_end_lost, 1e-5,
     "3e-7 on 2026-11-25; 4 times that with half as many parts, twice; peers 1e-2", 1116, 0, 538, 0,
     72220},
    {"stack of 10", CAROM_LOCATED, 2, stack, 120, stack_moved, 1e-12,
     "marks: peers at best 1e-5 m; rounding of 10 m is 2e-15", 1, 0, 120, 0, 103812},
    {"stack of 10, fixed", CAROM_FIXED, 2, stack, 120, stack_moved, 1e-12, "as located", 1, 0, 120,
     0, 103812},
    {"stack of 10, euler", CAROM_EULER, 2, stack, 120, stack_moved, 1e-12, "as located", 1, 0, 120,
     0, 90372},
    {"pyramid 10", CAROM_LOCATED, 2, pyramid, 30, pyramid_moved, 1e-12,
     "marks: peers at best 1e-3 m (base 20)", 67, 2, 30, 0, 753944},
    {"cradle with gaps", CAROM_LOCATED, 2, cradle, 60, off_cradle, 1e-12,
     "marks: peers at best 1e-3; two impacts located to 1e-13", 0, 0, 61, 0, 34000},
    {"pile of 30", CAROM_LOCATED, 2, pile, 60, deepest, 1e-12,
     "docs/performance.md: no overlap beyond rounding", 10808, 565, 150, 4, 494496},
    {"pile of 30, fixed", CAROM_FIXED, 2, pile, 60, deepest, 1e-12,
     "docs/performance.md: no overlap beyond rounding", 747, 167, 60, 4, 558508},
};
enum { N_GUARDS = sizeof GUARDS / sizeof GUARDS[0] };

static work run(const guard *g, long *bytes)
{
    work x = {0, 0, 0, 0, 0};
    scene_integrator = g->integrator;
    scene_order = g->order;
    carom_world *w = g->build();
    for (int k = 0; k < g->n_steps; k++) {
        carom_step_stats s;
        assert_true(carom_world_step(w, NULL, &s) >= 0);
        x.factorizations += s.factorizations;
        x.iterations += s.iterations;
        x.substeps += s.n_substeps;
        if (2 * k >= g->n_steps) x.requests += s.allocations;
    }
    x.error = g->error(w);
    *bytes = (long)carom_world_measure(w).bytes;
    carom_world_destroy(w);
    return x;
}

static void print_guards(void)
{
    for (int k = 0; k < N_GUARDS; k++) {
        long bytes;
        const work x = run(&GUARDS[k], &bytes);
        printf("%-22s error %.2e (%.1e)  %ld, %ld, %ld, %ld, %ld\n", GUARDS[k].name, x.error,
               GUARDS[k].most_error, x.factorizations, x.iterations, x.substeps, x.requests, bytes);
    }
}

static void check_count(const char *name, const char *what, long counted, long limit)
{
    const double margin = strncmp(name, "pile", 4) ? MARGIN : MARGIN_OF_PILES;
    const long most = (long)ceil(margin * (double)limit);
    if (counted <= most) return;
    fail_msg("%s: %ld %s, %ld were enough (limit %ld)", name, counted, what, limit, most);
}

static void accuracy_and_work(void **state)
{
    (void)state;
    for (int k = 0; k < N_GUARDS; k++) {
        const guard *g = &GUARDS[k];
        long bytes;
        const work x = run(g, &bytes);
        if (!(x.error <= g->most_error)) {
            fail_msg("%s: error %.3g, limit %.3g (%s)", g->name, x.error, g->most_error, g->claim);
        }
        check_count(g->name, "factorizations", x.factorizations, g->factorizations);
        check_count(g->name, "iterations", x.iterations, g->iterations);
        check_count(g->name, "sub-steps", x.substeps, g->substeps);
        check_count(g->name, "requests in the second half", x.requests, g->requests);
        check_count(g->name, "bytes", bytes, g->bytes);
    }
}

/* A ball that comes back from a wall: dx/dx0 = -e, dx/dv0 = -e t, one solve per impact backward. */
static void gradient(void **state)
{
    (void)state;
    const double e = 0.6;
    scene_integrator = CAROM_LOCATED;
    scene_order = 2;
    carom_world *w = scene_world(0, 1.0 / 60);
    const carom_pose wall = {0, 3, 0};
    const int a = scene_box(w, 1e30, 0.5, 5, wall, 0, e);
    const int b = scene_disc(w, 1, 0.25, 0.1, 0, 0, e);
    scene_push(w, b, 0, 4, 0);
    (void)a;
    carom_tape *tape = NULL;
    carom_gradient_stats stats;
    double bar[6] = {0};
    double q0[6];
    double v0[6];
    carom_gradient g = {0};
    bar[3 * b + 1] = 1;
    g.q0 = q0;
    g.v0 = v0;
    assert_int_equal(carom_tape_create(w, NULL, &tape), CAROM_OK);
    for (int k = 0; k < 60; k++) assert_int_equal(carom_tape_step(tape, NULL, NULL), CAROM_OK);
    const carom_state_bar end = {60, bar, NULL};
    assert_int_equal(carom_tape_gradient(tape, 1, &end, &g, &stats), CAROM_OK);
    assert_near(q0[3 * b + 1], -e, 1e-12); /* rounding of 61 sub-steps */
    assert_near(v0[3 * b + 1], -e, 1e-12); /* t = 1 s */
    check_count("gradient", "solves", stats.solves, 1);
    carom_tape_destroy(tape);
    carom_world_destroy(w);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(accuracy_and_work),
        cmocka_unit_test(gradient),
    };
    if (argc > 1 && strcmp(argv[1], "print") == 0) {
        print_guards();
        return 0;
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
