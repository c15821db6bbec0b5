/* Forward derivatives: the transposed identity <w, J d> = <J' w, d> over every scene, every number
 * and every map; dense derivatives of a step. */
#include "gradient_numbers.h"
#include "gradient_scenes.h"
#include "near.h"
#include "rng.h"
#include "scenes.h"

#include <stdlib.h>
#include <string.h>

/* Of the sum of the sizes of all products in <J' w, d>, and of the loss, which is of size one:
 * rounding of as many sub-steps, ... */
static const double IDENTITY_TOL = 1e-12;
/* ... magnified by the condition of contact problems whose neighbors weigh 8e5 times as much:
 * 2.2e-16 * 8e5 * 20 steps. */
static const double UNEVEN_TOL = 4e-9;
/* ... or 300 times as much, in four parts of each of ten steps: 2.2e-16 * 300 * 40. */
static const double HEAVY_TOL = 3e-12;
enum { N_DIRECTIONS = 3, N_STATES = 2, N_MAPS = 5, MAX_TESTS = 1024 };

typedef struct map {
    const char *name;
    carom_integrator integrator;
    int order;
} map;

static const map MAPS[N_MAPS] = {{"euler", CAROM_EULER, 2},
                                 {"located", CAROM_LOCATED, 2},
                                 {"fixed", CAROM_FIXED, 2},
                                 {"order 4", CAROM_LOCATED, 4},
                                 {"order 6", CAROM_LOCATED, 6}};

static double identity_tol(const char *scene)
{
    if (strcmp(scene, "uneven chain") == 0) return UNEVEN_TOL;
    return strcmp(scene, "heavy end") == 0 ? HEAVY_TOL : IDENTITY_TOL;
}

static void use_map(const map *m)
{
    scene_integrator = m->integrator;
    scene_order = m->order;
}

static double *numbers(size_t n)
{
    double *x = calloc(n + 1, sizeof *x);
    assert_non_null(x);
    return x;
}

static double *random_numbers(rng *g, size_t n)
{
    double *x = numbers(n);
    for (size_t k = 0; k < n; k++) x[k] = rng_uniform(g, -1, 1);
    return x;
}

static carom_tape *record(carom_world *w, int n_steps)
{
    carom_tape *tape;
    assert_int_equal(carom_tape_create(w, NULL, &tape), CAROM_OK);
    for (int k = 0; k < n_steps; k++) assert_true(carom_tape_step(tape, NULL, NULL) >= 0);
    return tape;
}

static void fill(const carom_world *w, rng *g, const gradient_room *d, int only)
{
    for (int a = 0; a < N_GRADIENT_ARRAYS; a++) {
        for (int k = 0; k < gradient_count(w, a); k++) {
            const double x = rng_uniform(g, -1, 1);
            d->array[a][k] = only < 0 || only == a ? x : 0;
        }
    }
}

/* <J' w, d> over all arrays; *size is the sum of the sizes of its products. */
static double product(const carom_world *w, const gradient_room *x, const gradient_room *d,
                      double *size)
{
    double sum = 0;
    *size = 0;
    for (int a = 0; a < N_GRADIENT_ARRAYS; a++) {
        for (int k = 0; k < gradient_count(w, a); k++) {
            sum += x->array[a][k] * d->array[a][k];
            *size += fabs(x->array[a][k] * d->array[a][k]);
        }
    }
    return sum;
}

/* One run, its states at the middle and at the end. */
typedef struct sums {
    const char *name, *map;
    int steps[N_STATES];
    int n; /* 3 n_bodies */
    double *weight[N_STATES][2];
} sums;

static void check_directions(const sums *s, carom_world *w, carom_tape *tape, int only)
{
    rng g = rng_from(77 + (uint64_t)only);
    const size_t n = (size_t)s->n;
    gradient_room d[N_DIRECTIONS];
    carom_gradient directions[N_DIRECTIONS];
    carom_state_dot dots[N_DIRECTIONS * N_STATES];
    carom_state_bar bars[N_STATES];
    gradient_room x = gradient_room_make(w, 1);
    for (int i = 0; i < N_STATES; i++) {
        const carom_state_bar bar = {s->steps[i], s->weight[i][0], s->weight[i][1]};
        bars[i] = bar;
    }
    for (int i = 0; i < N_DIRECTIONS; i++) {
        d[i] = gradient_room_make(w, 1);
        fill(w, &g, &d[i], only);
        directions[i] = d[i].g;
        for (int k = 0; k < N_STATES; k++) {
            const carom_state_dot dot = {s->steps[k], numbers(n), numbers(n)};
            dots[i * N_STATES + k] = dot;
        }
    }
    assert_int_equal(carom_tape_gradient(tape, N_STATES, bars, &x.g, NULL), CAROM_OK);
    if (carom_tape_tangent(tape, N_DIRECTIONS, directions, N_STATES, dots, NULL) < 0) {
        fail_msg("%s, %s: %s", s->name, s->map, carom_world_error(w));
    }
    for (int i = 0; i < N_DIRECTIONS; i++) {
        double size;
        double forward = 0;
        const double backward = product(w, &x, &d[i], &size);
        for (int k = 0; k < N_STATES * s->n; k++) {
            const int at = k / s->n;
            forward += s->weight[at][0][k % s->n] * dots[i * N_STATES + at].q[k % s->n];
            forward += s->weight[at][1][k % s->n] * dots[i * N_STATES + at].v[k % s->n];
        }
        const double tol = identity_tol(s->name);
        if (!(fabs(forward - backward) <= tol * (1 + size))) {
            fail_msg("%s, %s, by %s: <w, J d> = %.17g, <J' w, d> = %.17g, sizes %.3g: off by %.3g",
                     s->name, s->map, only < 0 ? "all" : gradient_array_names[only], forward,
                     backward, size, fabs(forward - backward) / size);
        }
        for (int k = 0; k < N_STATES; k++) {
            free(dots[i * N_STATES + k].q);
            free(dots[i * N_STATES + k].v);
        }
        gradient_room_free(&d[i]);
    }
    gradient_room_free(&x);
}

typedef struct run {
    const gradient_scene *scene;
    const map *map;
} run;

static void transposed(void **state)
{
    const run *r = *state;
    const gradient_scene *scene = r->scene;
    rng g = rng_from(12345);
    use_map(r->map);
    carom_world *w = scene->build(scene);
    carom_tape *tape = record(w, scene->n_steps);
    sums s = {scene->name, r->map->name, {scene->n_steps, scene->n_steps / 2}, 0, {{0}}};
    s.n = 3 * carom_world_n_bodies(w);
    for (int i = 0; i < N_STATES; i++) {
        for (int k = 0; k < 2; k++) s.weight[i][k] = random_numbers(&g, (size_t)s.n);
    }
    for (int a = -1; a < N_GRADIENT_ARRAYS; a++) check_directions(&s, w, tape, a);
    for (int i = 0; i < N_STATES; i++) {
        for (int k = 0; k < 2; k++) free(s.weight[i][k]);
    }
    carom_tape_destroy(tape);
    carom_world_destroy(w);
}

/* --- dense derivatives of a step -----------------------------------------------------------------
 */

/* Largest entry of a row of array a, and 1. */
static double row_size(const carom_world *w, const gradient_room *x, int a)
{
    return 1 + near_norm(gradient_count(w, a), x->array[a]);
}

/* Row `row` of the Jacobian of one step against the gradient of that component. */
static void check_row(const run *r, carom_world *w, carom_tape *t, const gradient_room *rows,
                      int row, const int *wanted)
{
    const int n = 3 * carom_world_n_bodies(w);
    double *seed = numbers(2 * (size_t)n);
    const carom_state_bar bar = {1, seed, seed + n};
    gradient_room x = gradient_room_make(w, 1);
    seed[row] = 1;
    assert_int_equal(carom_tape_gradient(t, 1, &bar, &x.g, NULL), CAROM_OK);
    const double tol = identity_tol(r->scene->name);
    for (int a = 0; a < N_GRADIENT_ARRAYS; a++) {
        const int m = gradient_count(w, a);
        if (!wanted[a]) continue;
        for (int k = 0; k < m; k++) {
            const double d = rows->array[a][row * m + k] - x.array[a][k];
            if (fabs(d) <= tol * row_size(w, &x, a)) continue;
            fail_msg("%s, %s: row %d, %s[%d] is %.17g, by gradient %.17g", r->scene->name,
                     r->map->name, row, gradient_array_names[a], k, rows->array[a][row * m + k],
                     x.array[a][k]);
        }
    }
    gradient_room_free(&x);
    free(seed);
}

/* The step in the middle of a run, as the only one of a tape: its Jacobian has the gradients as
 * rows, asked for all at once (by rows) and only by state and force (by columns). */
static void dense(void **state)
{
    const run *r = *state;
    use_map(r->map);
    carom_world *w = r->scene->build(r->scene);
    for (int k = 0; k < r->scene->n_steps / 2; k++) {
        assert_true(carom_world_step(w, NULL, NULL) >= 0);
    }
    carom_tape *t = record(w, 1);
    const int n_rows = 6 * carom_world_n_bodies(w);
    for (int few = 0; few < 2; few++) {
        int wanted[N_GRADIENT_ARRAYS];
        gradient_room rows = gradient_room_make(w, n_rows);
        carom_gradient g = {0};
        for (int a = 0; a < N_GRADIENT_ARRAYS; a++) {
            wanted[a] = !few || a == BY_Q0 || a == BY_V0 || a == BY_FORCE;
        }
        if (few) {
            g.q0 = rows.g.q0;
            g.v0 = rows.g.v0;
            g.force = rows.g.force;
        }
        assert_int_equal(carom_tape_jacobian(t, 0, few ? &g : &rows.g, NULL), CAROM_OK);
        for (int row = 0; row < n_rows; row++) check_row(r, w, t, &rows, row, wanted);
        gradient_room_free(&rows);
    }
    carom_tape_destroy(t);
    carom_world_destroy(w);
}

/* Jacobians of the steps of a run multiply to the derivative of the run. */
static void chained(void **state)
{
    const run *r = *state;
    rng g = rng_from(5);
    use_map(r->map);
    carom_world *w = r->scene->build(r->scene);
    carom_tape *t = record(w, 10);
    const int n = 3 * carom_world_n_bodies(w);
    double *x = random_numbers(&g, 2 * (size_t)n);
    double *y = numbers(2 * (size_t)n);
    double *end = numbers(2 * (size_t)n);
    double *a = numbers(4 * (size_t)n * (size_t)n);
    for (int k = 0; k < n; k++) {
        if (!gradient_has_meaning(w, BY_V0, k)) x[n + k] = 0;
    }
    carom_gradient direction = {0};
    direction.q0 = x;
    direction.v0 = x + n;
    const carom_state_dot dot = {10, end, end + n};
    assert_int_equal(carom_tape_tangent(t, 1, &direction, 1, &dot, NULL), CAROM_OK);
    for (int step = 0; step < 10; step++) {
        carom_gradient rows = {0};
        rows.q0 = a;
        rows.v0 = a + 2 * n * n;
        assert_int_equal(carom_tape_jacobian(t, step, &rows, NULL), CAROM_OK);
        for (int i = 0; i < 2 * n; i++) {
            y[i] = 0;
            for (int k = 0; k < n; k++) {
                y[i] += rows.q0[i * n + k] * x[k] + rows.v0[i * n + k] * x[n + k];
            }
        }
        memcpy(x, y, 2 * (size_t)n * sizeof *x);
    }
    const double tol = identity_tol(r->scene->name);
    const double size = 1 + near_norm(2 * n, end);
    assert_near_array(r->scene->name, 2 * n, x, end, tol * size);
    free(x);
    free(y);
    free(end);
    free(a);
    carom_tape_destroy(t);
    carom_world_destroy(w);
}

/* Not a step of the tape, no tape, changed parameters: said, and nothing written. */
static void refused(void **state)
{
    (void)state;
    use_map(&MAPS[1]);
    carom_world *w = gradient_scenes[0].build(&gradient_scenes[0]);
    carom_tape *t = record(w, 3);
    gradient_room x = gradient_room_make(w, 6 * carom_world_n_bodies(w));
    const carom_state_dot late = {4, x.g.q0, NULL};
    assert_int_equal(carom_tape_jacobian(t, 3, &x.g, NULL), CAROM_E_ARGUMENT);
    assert_non_null(strstr(carom_world_error(w), "3 steps"));
    assert_int_equal(carom_tape_jacobian(t, -1, &x.g, NULL), CAROM_E_ARGUMENT);
    assert_int_equal(carom_tape_jacobian(NULL, 0, &x.g, NULL), CAROM_E_ARGUMENT);
    assert_int_equal(carom_tape_tangent(t, 1, &x.g, 1, &late, NULL), CAROM_E_ARGUMENT);
    assert_int_equal(carom_tape_tangent(t, 1, NULL, 0, NULL, NULL), CAROM_E_ARGUMENT);
    assert_int_equal(carom_tape_tangent(t, -1, &x.g, 0, NULL, NULL), CAROM_E_ARGUMENT);
    assert_int_equal(carom_tape_tangent(t, 0, NULL, 0, NULL, NULL), CAROM_OK);
    const double gravity[2] = {0, -1};
    carom_parameters p = {0};
    p.gravity = gravity;
    assert_int_equal(carom_world_set_parameters(w, &p), CAROM_OK);
    assert_int_equal(carom_tape_jacobian(t, 0, &x.g, NULL), CAROM_E_STATE);
    assert_int_equal(carom_tape_tangent(t, 0, NULL, 0, NULL, NULL), CAROM_E_STATE);
    gradient_room_free(&x);
    carom_tape_destroy(t);
    carom_world_destroy(w);
}

static int add_tests(struct CMUnitTest *tests, run *runs, int n, CMUnitTestFunction test,
                     const gradient_scene *scenes, int n_scenes)
{
    for (int k = 0; k < N_MAPS * n_scenes; k++, n++) {
        assert_true(n < MAX_TESTS);
        runs[n].scene = &scenes[k / N_MAPS];
        runs[n].map = &MAPS[k % N_MAPS];
        tests[n].name = runs[n].scene->name;
        tests[n].test_func = test;
        tests[n].initial_state = &runs[n];
    }
    return n;
}

int main(void)
{
    static const CMUnitTestFunction checks[3] = {transposed, dense, chained};
    static struct CMUnitTest tests[MAX_TESTS];
    static run runs[MAX_TESTS];
    const struct CMUnitTest last = cmocka_unit_test(refused);
    int n = 0;
    for (int k = 0; k < 3; k++) {
        n = add_tests(tests, runs, n, checks[k], gradient_scenes, n_gradient_scenes);
        n = add_tests(tests, runs, n, checks[k], gradient_joint_scenes, n_gradient_joint_scenes);
    }
    tests[n++] = last;
    return _cmocka_run_group_tests("gradient_tangent", tests, (size_t)n, NULL, NULL);
}
