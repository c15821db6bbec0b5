/* Gradients of random scenes against differences of the discrete map, of every array.
 *
 * Usage: test_gradient_random [scenes (200) [first seed (1) [steps (24) [map]]]], map 0 located, 1
 * located of order 6, 2 fixed, 3 Euler, else all; prints what was found when given.
 *
 * Numbers are moved by t times their size.  With R(t) = (4 D(t/2) - D(t))/3 of central differences
 * D the derivative is R(t/2), good to |R(t/2) - R(t)|.  A run's active set is all that decides
 * which smooth map it is: the ends of its sub-steps, the points in contact, their modes.  Where it
 * is not the same in all probes t is made smaller; where it never is, a kink is between them. */
#include "gradient_numbers.h"
#include "gradient_random.h"
#include "near.h"
#include "rng.h"

#include "libsolver/grad/internal.h" /* the active set of a run */

#include <stdlib.h>
#include <string.h>

enum { N_MAPS = 4, N_LEVELS = 4 };
static const char *const MAPS[N_MAPS] = {"located", "order 6", "fixed", "euler"};
/* First step of differences [size of the number]; each level is 16 times as short. */
static const double STEP = 1e-4;
/* Of relative errors, what half of all entries are below: the bound of the project. */
static const double MEDIAN = 1e-8;
/* A difference of R by this times its own error is a disagreement: R(t/2) is 16 times as good as
 * R(t) where truncation rules, as good where rounding does. */
static const double DOUBT = 10;
/* Differences are never trusted further than this [largest entry of the array]. */
static const double FLOOR = 1e-7;
/* Differences worse than this say nothing [largest entry of the array]. */
static const double VAGUE = 1e-3;
/* Two steps confirm each other within this part of their distance from the gradient. */
static const double FIRM = 0.1;
/* Entries below this part of the largest of their array are measured against that. */
static const double SMALL = 1e-3;
/* Of entries that differences cannot judge, and of scenes that end in a failed step, at most. */
static const double MOST_KINKS = 0.1;
static const double MOST_FAILED = 0.02;

/* Builds with sanitizers, twenty times as slow, say fewer. */
#ifndef N_SCENES
#define N_SCENES 200
#endif
static int n_scenes = N_SCENES;
static uint64_t first_seed = 1;
static int n_steps = 24;
static int only = -1;
static int verbose = 0;

typedef struct scene {
    uint64_t seed;
    carom_world_settings set;
    int n;          /* 3 n_bodies */
    double *weight; /* 4 n: q, v at the middle; q, v at the end */
    gradient_room x;
    int degenerate; /* contacts at kinks, as the gradient counts them */
    unsigned long long active;
} scene;

typedef enum verdict { RIGHT, WRONG, COUNTED, AT_A_KINK, VAGUE_THERE, N_VERDICTS } verdict;
static const char *const VERDICTS[N_VERDICTS] = {
    "right", "wrong", "its kink is counted", "a kink between the probes", "differences too noisy"};

typedef struct tally {
    int n, max;
    double *error; /* of every entry that is right */
    int entries, failed;
    int of[N_VERDICTS];
} tally;

static double size_of(int array, double x)
{
    switch (array) {
    case BY_MASS:
    case BY_INERTIA:
    case BY_DT:
    case BY_RADIUS:
    case BY_STIFFNESS:
    case BY_DAMPING:
    case BY_MOTOR_LIMIT: return fabs(x);
    default: return 1;
    }
}

/* The run with number `entry` of `array` moved by t, recorded; NULL when a step failed. */
static carom_tape *record(const scene *s, int array, int entry, double t, carom_world **world)
{
    carom_tape *tape;
    carom_world *w = gradient_random_world(s->seed, &s->set);
    if (array >= 0) {
        double *x = gradient_number(w, array, entry);
        *x += t * size_of(array, *x);
    }
    assert_int_equal(carom_tape_create(w, NULL, &tape), CAROM_OK);
    carom_status e = CAROM_OK;
    for (int k = 0; e >= 0 && k < n_steps; k++) e = carom_tape_step(tape, NULL, NULL);
    *world = w;
    if (e >= 0) return tape;
    carom_tape_destroy(tape);
    return NULL;
}

static double dot(int n, const double *a, const double *b)
{
    double sum = 0;
    for (int k = 0; k < n; k++) sum += a[k] * b[k];
    return sum;
}

/* NaN: a step failed, or the active set is not that of the scene. */
static double loss(const scene *s, int array, int entry, double t)
{
    carom_world *w;
    carom_tape *tape = record(s, array, entry, t, &w);
    double sum = NAN;
    if (tape && crm_branch_of(tape) == s->active) {
        const int half = n_steps / 2;
        sum = dot(s->n, s->weight, carom_tape_q(tape, half)) +
              dot(s->n, s->weight + s->n, carom_tape_v(tape, half)) +
              dot(s->n, s->weight + 2 * s->n, carom_tape_q(tape, n_steps)) +
              dot(s->n, s->weight + 3 * s->n, carom_tape_v(tape, n_steps));
    }
    carom_tape_destroy(tape);
    carom_world_destroy(w);
    return sum;
}

static double central(const scene *s, int array, int entry, double t)
{
    const double right = loss(s, array, entry, t);
    return isnan(right) ? right : (right - loss(s, array, entry, -t)) / (2 * t);
}

/* Derivative by t at 0 and how good it is; NaN: a kink lies between the probes. */
static double difference(const scene *s, int array, int entry, double t, double *error)
{
    const double d1 = central(s, array, entry, t);
    if (isnan(d1)) return d1;
    const double d2 = central(s, array, entry, 0.5 * t);
    const double d4 = central(s, array, entry, 0.25 * t);
    const double coarse = (4 * d2 - d1) / 3;
    const double fine = (4 * d4 - d2) / 3;
    *error = fabs(fine - coarse);
    return fine;
}

static void note(tally *t, double error)
{
    if (t->n == t->max) {
        t->max = 2 * t->max + 64;
        t->error = realloc(t->error, (size_t)t->max * sizeof *t->error);
        assert_non_null(t->error);
    }
    t->error[t->n++] = error;
}

/* What differences with steps 16 times as short each say of a derivative g. */
static verdict judge(const scene *s, int array, int entry, double g, double largest, double *best)
{
    double before = NAN;
    double step = STEP;
    verdict v = AT_A_KINK;
    for (int level = 0; level < N_LEVELS; level++, step /= 16) {
        double e;
        const double d = difference(s, array, entry, step, &e);
        if (isnan(d)) continue;
        *best = d;
        v = VAGUE_THERE;
        if (fabs(d - g) <= fmax(DOUBT * e, FLOOR * largest)) {
            if (DOUBT * e <= VAGUE * largest) return RIGHT;
            continue;
        }
        /* Two that agree with each other and not with g. */
        if (fabs(d - before) < FIRM * fabs(d - g)) return WRONG;
        before = d;
    }
    return v;
}

static void check_entry(const scene *s, const carom_world *w, int array, int entry, double largest,
                        tally *t)
{
    const double size = size_of(array, *gradient_number((carom_world *)w, array, entry));
    const double g = s->x.array[array][entry] * size;
    double best = NAN;
    verdict v = judge(s, array, entry, g, largest, &best);
    if (v == WRONG && s->degenerate) v = COUNTED;
    t->entries++;
    t->of[v]++;
    if (v == RIGHT) note(t, fabs(best - g) / fmax(fmax(fabs(g), fabs(best)), SMALL * largest));
    if (v == WRONG || (verbose && v != RIGHT)) {
        print_message("seed %llu: d/d %s[%d] = %.12g, differences %.12g, largest %.3g: %s\n",
                      (unsigned long long)s->seed, gradient_array_names[array], entry, g, best,
                      largest, VERDICTS[v]);
    }
}

/* One number of every array that the scene has. */
static void check_scene(const scene *s, const carom_world *w, rng *r, tally *t)
{
    for (int a = 0; a < N_GRADIENT_ARRAYS; a++) {
        const int n = gradient_count(w, a);
        double largest = 0;
        for (int k = 0; k < n; k++) {
            largest = fmax(largest, fabs(s->x.array[a][k]) *
                                        size_of(a, *gradient_number((carom_world *)w, a, k)));
        }
        for (int tries = 0; n > 0 && tries < 8; tries++) {
            const int k = rng_int(r, n);
            if (!gradient_has_meaning(w, a, k)) continue;
            check_entry(s, w, a, k, fmax(largest, SMALL), t);
            break;
        }
    }
}

static void run_scene(uint64_t seed, const carom_world_settings *set, tally *t)
{
    rng r = rng_from(seed + 1000000);
    carom_world *w;
    scene s = {seed, *set, 0, NULL, {{NULL}, {0}}, 0, 0};
    carom_tape *tape = record(&s, -1, 0, 0, &w);
    if (!tape) {
        if (verbose)
            print_message("seed %llu: %s\n", (unsigned long long)seed, carom_world_error(w));
        t->failed++;
        carom_world_destroy(w);
        return;
    }
    carom_gradient_stats stats;
    s.n = 3 * carom_world_n_bodies(w);
    s.weight = calloc(4 * (size_t)s.n, sizeof(double));
    assert_non_null(s.weight);
    for (int k = 0; k < 4 * s.n; k++) s.weight[k] = rng_uniform(&r, -1, 1);
    s.active = crm_branch_of(tape);
    s.x = gradient_room_make(w, 1);
    const carom_state_bar bars[2] = {{n_steps, s.weight + 2 * s.n, s.weight + 3 * s.n},
                                     {n_steps / 2, s.weight, s.weight + s.n}};
    const carom_status e = carom_tape_gradient(tape, 2, bars, &s.x.g, &stats);
    if (e < 0) fail_msg("seed %llu: %s", (unsigned long long)seed, carom_world_error(w));
    s.degenerate = stats.degenerate;
    check_scene(&s, w, &r, t);
    carom_tape_destroy(tape);
    carom_world_destroy(w);
    gradient_room_free(&s.x);
    free(s.weight);
}

static int ascending(const void *a, const void *b)
{
    const double x = *(const double *)a;
    const double y = *(const double *)b;
    return (x > y) - (x < y);
}

static void run_map(int map, int scenes)
{
    tally t = {0, 0, NULL, 0, 0, {0}};
    carom_world_settings set = carom_world_defaults();
    if (only >= 0 && only != map) return;
    set.integrator = map == 3 ? CAROM_EULER : map == 2 ? CAROM_FIXED : CAROM_LOCATED;
    if (map == 1) set.order = 6;
    for (int k = 0; k < scenes; k++) run_scene(first_seed + (uint64_t)k, &set, &t);
    assert_true(t.n > 0);
    qsort(t.error, (size_t)t.n, sizeof *t.error, ascending);
    const double median = t.error[t.n / 2];
    if (verbose) {
        print_message("%s: %d scenes, %d failed; %d entries: relative error median %.1e, nine of "
                      "ten %.1e, largest %.1e\n",
                      MAPS[map], scenes, t.failed, t.entries, median, t.error[t.n * 9 / 10],
                      t.error[t.n - 1]);
        for (int v = 0; v < N_VERDICTS; v++) print_message("  %-26s %d\n", VERDICTS[v], t.of[v]);
    }
    free(t.error);
    assert_int_equal(t.of[WRONG], 0);
    assert_at_most("median", median, MEDIAN);
    assert_at_most("not judged", t.entries - t.n, MOST_KINKS * t.entries);
    assert_at_most("failed", t.failed, MOST_FAILED * scenes);
}

static void located(void **state)
{
    (void)state;
    run_map(0, n_scenes);
}

static void sixth_order(void **state)
{
    (void)state;
    run_map(1, (n_scenes + 9) / 10);
}

static void fixed(void **state)
{
    (void)state;
    run_map(2, (n_scenes + 9) / 10);
}

static void euler(void **state)
{
    (void)state;
    run_map(3, (n_scenes + 9) / 10);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(located), cmocka_unit_test(sixth_order),
                                       cmocka_unit_test(fixed), cmocka_unit_test(euler)};
    if (argc > 1) n_scenes = atoi(argv[1]);
    if (argc > 2) first_seed = strtoull(argv[2], NULL, 10);
    if (argc > 3) n_steps = atoi(argv[3]);
    if (argc > 4) only = atoi(argv[4]);
    verbose = argc > 1;
    return cmocka_run_group_tests(tests, NULL, NULL);
}
