/* The step on random scenes: it ends within counted bounds, nothing is NaN, nothing passes through
 * anything, and a step that fails leaves the world as it was.
 *
 * Usage: test_random_scenes [scenes (334) [first seed (1) [steps (30) [integrator]]]], integrator 0
 * Euler, 1 located, 2 fixed, else all; prints what the statuses were and the seeds of the worst
 * cases when given.  1e5 scenes of 2 s: test_random_scenes 33334 1 120. */
#include "carom/grad.h"
#include "near.h"
#include "random_scene.h"

#include <stdlib.h>
#include <string.h>

enum { N_INTEGRATORS = 3, N_STATUSES = 12 };
static const char *const NAMES[N_INTEGRATORS] = {"euler", "located", "fixed"};

/* With each integrator; builds with sanitizers, twenty times as slow, say fewer. */
#ifndef N_SCENES
#define N_SCENES 334
#endif
static int n_scenes = N_SCENES;
static uint64_t first_seed = 1;
static int n_steps = 30;
static int only = -1;
static int verbose = 0;

/* Scenes that may end in a step that fails twice: one in fifty. */
static const double STUCK_SHARE = 0.02;
/* A step that climbs the whole ladder of a contact problem a hundred times: 600 factorizations. */
static const double MOST_FACTORIZATIONS = 2e5;
/* Bodies are up to a cell of 1 m wide: none is swallowed by another [m]. */
static const double DEEPEST = 0.5;
/* A step says what overlaps deeper than 1e-4 L, with L at most the diagonal of a cell [m]. */
static const double SILENT = 1.5e-4;
/* Joints are closed, or the step says that they are not: 1e-8 of a cell [m]. */
static const double LOOSE_JOINT = 1e-8;

/* The largest value of something and the scene where it was. */
typedef struct record {
    double value;
    uint64_t seed;
    int step;
} record;

typedef struct tally {
    long scenes, steps;
    long stuck; /* scenes given up: a step failed twice */
    long status[N_STATUSES];
    double factorizations;
    long escaped;   /* scenes in which a body went through a wall */
    record overlap; /* where nothing is driven; a rotor may crush what is between it and a wall */
    record crushed; /* where something is */
    record silent;  /* overlap that came in a step without a caveat */
    record drift;   /* of joints */
    record unsaid;  /* drift in a step without a caveat */
    record growth;  /* of energy where nothing is driven */
    record given;   /* ... in a step without a caveat */
    record residual, busiest, substeps, events;
} tally;

static int status_row(carom_status e)
{
    return e >= 0 ? e : 3 - e;
}

static void note(record *r, double value, uint64_t seed, int step)
{
    if (!(value > r->value)) return;
    r->value = value;
    r->seed = seed;
    r->step = step;
}

static void check_finite(const random_scene *s, uint64_t seed, int step)
{
    const double *q = carom_world_q(s->world);
    const double *v = carom_world_v(s->world);
    for (int k = 0; k < 3 * s->n_bodies; k++) {
        if (isfinite(q[k]) && isfinite(v[k])) continue;
        fail_msg("seed %llu, step %d: number %d of the state is not finite",
                 (unsigned long long)seed, step, k);
    }
}

/* One step; on failure the world must be as it was. */
static carom_status step_or_nothing(random_scene *s, uint64_t seed, carom_step_stats *stats)
{
    double q[3 * RANDOM_SCENE_BODIES];
    double v[3 * RANDOM_SCENE_BODIES];
    const size_t bytes = 3 * (size_t)s->n_bodies * sizeof *q;
    const long before = carom_world_steps(s->world);
    memcpy(q, carom_world_q(s->world), bytes);
    memcpy(v, carom_world_v(s->world), bytes);
    const carom_status e = carom_world_step(s->world, NULL, stats);
    if (e >= 0) return e;
    if (carom_world_error(s->world)[0] == '\0') {
        fail_msg("seed %llu: a failure without a word", (unsigned long long)seed);
    }
    if (carom_world_steps(s->world) != before || memcmp(q, carom_world_q(s->world), bytes) != 0 ||
        memcmp(v, carom_world_v(s->world), bytes) != 0) {
        fail_msg("seed %llu: a failed step changed the world", (unsigned long long)seed);
    }
    return e;
}

/* *overlap: before the step, and then after it. */
static void note_step(tally *t, const random_scene *s, const carom_step_stats *x, uint64_t seed,
                      int step, double *overlap)
{
    int a, b;
    const double before = *overlap;
    *overlap = random_scene_overlap(s, &a, &b);
    t->steps++;
    t->factorizations += x->factorizations;
    note(s->has_kinematic ? &t->crushed : &t->overlap, *overlap, seed, step);
    if (x->status == CAROM_OK && !s->has_kinematic) {
        note(&t->silent, *overlap - before, seed, step);
    }
    note(&t->residual, x->residual, seed, step);
    note(&t->busiest, x->factorizations, seed, step);
    note(&t->substeps, x->n_substeps, seed, step);
    note(&t->events, x->n_events, seed, step);
    note(&t->drift, x->joint_drift, seed, step);
    if (x->status == CAROM_OK) note(&t->unsaid, x->joint_drift, seed, step);
}

/* before: kinetic and gravitational energy before the step. */
static void note_energy(tally *t, const carom_step_stats *x, double before, uint64_t seed, int step)
{
    note(&t->growth, x->energy - before, seed, step);
    if (x->status == CAROM_OK) note(&t->given, x->energy - before, seed, step);
}

static void run_scene(int integrator, uint64_t seed, tally *t)
{
    static random_scene s;
    carom_world_settings set = carom_world_defaults();
    set.integrator = integrator;
    random_scene_make(seed, &set, &s);
    t->scenes++;
    int failed = 0;
    double overlap = 0;
    for (int k = 0; k < n_steps && failed < 2; k++) {
        carom_step_stats x;
        const double energy = carom_world_energy(s.world);
        const carom_status e = step_or_nothing(&s, seed, &x);
        t->status[status_row(e)]++;
        failed = e < 0 ? failed + 1 : 0;
        check_finite(&s, seed, k);
        if (e < 0) {
            if (verbose) {
                print_message("%s, seed %llu, step %d: %s\n", NAMES[integrator],
                              (unsigned long long)seed, k, carom_world_error(s.world));
            }
            continue;
        }
        note_step(t, &s, &x, seed, k, &overlap);
        if (!s.has_kinematic) note_energy(t, &x, energy, seed, k);
        if (random_scene_escaped(&s) >= 0) {
            t->escaped++;
            if (verbose) {
                print_message("%s, seed %llu, step %d: body %d left the room\n", NAMES[integrator],
                              (unsigned long long)seed, k, random_scene_escaped(&s));
            }
            break;
        }
    }
    t->stuck += failed >= 2;
    carom_world_destroy(s.world);
}

static void print_record(const char *what, const record *r)
{
    print_message("  %-28s %10.3g  seed %llu, step %d\n", what, r->value,
                  (unsigned long long)r->seed, r->step);
}

static void print_tally(const char *name, const tally *t)
{
    print_message(
        "%s: %ld scenes, %ld steps, %ld scenes given up, %ld left; %.1f factorizations per step\n",
        name, t->scenes, t->steps, t->stuck, t->escaped, t->factorizations / (double)t->steps);
#define PRINT_STATUS(id, value, text)                                                              \
    if (t->status[status_row(id)]) print_message("  %-28s %10ld\n", #id, t->status[status_row(id)]);
    CAROM_STATUS_TABLE(PRINT_STATUS)
#undef PRINT_STATUS
    print_record("overlap [m]", &t->overlap);
    print_record("overlap, driven scenes [m]", &t->crushed);
    print_record("overlap without a caveat [m]", &t->silent);
    print_record("residual", &t->residual);
    print_record("factorizations in a step", &t->busiest);
    print_record("sub-steps in a step", &t->substeps);
    print_record("events in a step", &t->events);
    print_record("joint drift [m]", &t->drift);
    print_record("drift without a caveat [m]", &t->unsaid);
    print_record("energy gained in a step [J]", &t->growth);
    print_record("... without a caveat [J]", &t->given);
}

static void check_tally(const char *name, const tally *t, const carom_world_settings *set)
{
    assert_int_equal(t->escaped, 0);
    assert_at_most(name, (double)t->stuck, ceil(STUCK_SHARE * (double)t->scenes));
    assert_at_most(name, t->busiest.value, MOST_FACTORIZATIONS);
    /* each of the frames that are run again has its own */
    assert_at_most(name, t->substeps.value, 2 * (set->max_substeps + set->max_stiff));
    assert_at_most(name, t->residual.value, set->inexact);
    assert_at_most(name, t->overlap.value, DEEPEST);
    assert_at_most(name, t->unsaid.value, LOOSE_JOINT);
    assert_at_most(name, t->silent.value, SILENT);
}

static void run_integrator(int integrator)
{
    const carom_world_settings set = carom_world_defaults();
    static tally t;
    memset(&t, 0, sizeof t);
    if (only >= 0 && only != integrator) return;
    for (int k = 0; k < n_scenes; k++) run_scene(integrator, first_seed + (uint64_t)k, &t);
    if (verbose) print_tally(NAMES[integrator], &t);
    check_tally(NAMES[integrator], &t, &set);
}

static void euler(void **state)
{
    (void)state;
    run_integrator(CAROM_EULER);
}

static void located(void **state)
{
    (void)state;
    run_integrator(CAROM_LOCATED);
}

static void fixed(void **state)
{
    (void)state;
    run_integrator(CAROM_FIXED);
}

/* Where steps end, a gradient of them exists, and it is finite. */
static void gradients(void **state)
{
    (void)state;
    if (only >= 0 && only != CAROM_LOCATED) return;
    for (uint64_t seed = first_seed;
         seed < first_seed + (uint64_t)(n_scenes < 100 ? n_scenes : 100); seed++) {
        static random_scene s;
        static double ones[3 * RANDOM_SCENE_BODIES];
        static double q0[3 * RANDOM_SCENE_BODIES];
        carom_world_settings set = carom_world_defaults();
        carom_tape *tape;
        set.integrator = CAROM_LOCATED;
        random_scene_make(seed, &set, &s);
        assert_int_equal(carom_tape_create(s.world, NULL, &tape), CAROM_OK);
        int n = 0;
        while (n < 30 && carom_tape_step(tape, NULL, NULL) >= 0) n++;
        for (int k = 0; k < 3 * s.n_bodies; k++) ones[k] = 1;
        const carom_state_bar bar = {n, ones, NULL};
        carom_gradient g = {0};
        g.q0 = q0;
        const carom_status e = carom_tape_gradient(tape, 1, &bar, &g, NULL);
        if (e < 0) fail_msg("seed %llu: %s", (unsigned long long)seed, carom_status_name(e));
        for (int k = 0; k < 3 * s.n_bodies; k++) assert_true(isfinite(q0[k]));
        carom_tape_destroy(tape);
        carom_world_destroy(s.world);
    }
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(euler), cmocka_unit_test(located),
                                       cmocka_unit_test(fixed), cmocka_unit_test(gradients)};
    if (argc > 1) n_scenes = atoi(argv[1]);
    if (argc > 2) first_seed = strtoull(argv[2], NULL, 10);
    if (argc > 3) n_steps = atoi(argv[3]);
    if (argc > 4) only = atoi(argv[4]);
    verbose = argc > 1;
    return cmocka_run_group_tests(tests, NULL, NULL);
}
