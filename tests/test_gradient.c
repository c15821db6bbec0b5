/* Gradients of whole runs against central differences. */
#include "fdiff.h"
#include "gradient_numbers.h"
#include "gradient_scenes.h"
#include "near.h"
#include "rng.h"
#include "scenes.h"

#include <stdlib.h>
#include <string.h>

/* Each number against central differences, relative to the largest entry of its array and of the
 * loss: the differences themselves are good to about 1e-8 on these runs. */
static const double DIFFERENCE_TOL = 1e-6;
enum { MAX_TESTS = 256 };

/* A loss with weights on every component of two states. */
typedef struct run {
    const gradient_scene *s;
    int n;          /* 3 n_bodies */
    double *weight; /* 4 n: q, v at the middle; q, v at the end */
    const double *force;
    int array; /* which number is moved */
    int entry;
} run;

static double dot(int n, const double *a, const double *b)
{
    double sum = 0;
    for (int k = 0; k < n; k++) sum += a[k] * b[k];
    return sum;
}

static double loss(double t, void *user)
{
    const run *r = user;
    carom_world *w = r->s->build(r->s);
    assert_true(carom_world_seal(w) >= 0);
    const double *q = carom_world_q(w);
    const double *v = carom_world_v(w);
    if (r->array >= 0) *gradient_number(w, r->array, r->entry) += t;
    scene_run(w, r->s->n_steps / 2, NULL);
    double sum = dot(r->n, r->weight, q) + dot(r->n, r->weight + r->n, v);
    scene_run(w, r->s->n_steps - r->s->n_steps / 2, NULL);
    sum += dot(r->n, r->weight + 2 * r->n, q) + dot(r->n, r->weight + 3 * r->n, v);
    carom_world_destroy(w);
    return sum;
}

static gradient_room reverse(const run *r, carom_world **world)
{
    carom_world *w = r->s->build(r->s);
    carom_tape *tape;
    carom_gradient_stats stats;
    assert_int_equal(carom_tape_create(w, NULL, &tape), CAROM_OK);
    for (int k = 0; k < r->s->n_steps; k++) assert_true(carom_tape_step(tape, NULL, NULL) >= 0);
    const carom_state_bar bars[2] = {{r->s->n_steps, r->weight + 2 * r->n, r->weight + 3 * r->n},
                                     {r->s->n_steps / 2, r->weight, r->weight + r->n}};
    gradient_room x = gradient_room_make(w, 1);
    if (carom_tape_gradient(tape, 2, bars, &x.g, &stats) < 0) {
        fail_msg("%s: %s", r->s->name, carom_world_error(w));
    }
    carom_tape_destroy(tape);
    *world = w;
    return x;
}

static void check_array(run *r, const carom_world *w, const gradient_room *x, int a)
{
    double largest = 1e-3; /* of loss weights of size one: below this an entry counts as zero */
    for (int k = 0; k < gradient_count(w, a); k++) largest = fmax(largest, fabs(x->array[a][k]));
    r->array = a;
    for (int k = 0; k < gradient_count(w, a); k++) {
        double error;
        if (!gradient_has_meaning(w, a, k)) {
            assert_true(x->array[a][k] == 0);
            continue;
        }
        r->entry = k;
        /* Rounding asks for a long step, kinks for a short one: the best of three. */
        double best = fdiff(loss, r, r->s->step, &error);
        for (int i = 0; i < 2; i++) {
            double other_error;
            if (fabs(best - x->array[a][k]) <= DIFFERENCE_TOL * largest) break;
            const double other = fdiff(loss, r, r->s->step * (i ? 0.0625 : 32), &other_error);
            if (other_error < error) best = other;
            error = fmin(error, other_error);
        }
        if (fabs(best - x->array[a][k]) > DIFFERENCE_TOL * largest) {
            fail_msg("%s: d/d %s[%d] = %.12g, differences %.12g (+- %.2g), largest %.3g",
                     r->s->name, gradient_array_names[a], k, x->array[a][k], best, error, largest);
        }
    }
}

static void check_scene(const gradient_scene *s)
{
    rng g = rng_from(12345);
    run r = {s, 0, NULL, NULL, -1, 0};
    carom_world *w = s->build(s);
    r.n = 3 * carom_world_n_bodies(w);
    carom_world_destroy(w);
    r.weight = calloc(4 * (size_t)r.n, sizeof(double));
    assert_non_null(r.weight);
    for (int k = 0; k < 4 * r.n; k++) r.weight[k] = rng_uniform(&g, -1, 1);
    gradient_room x = reverse(&r, &w);
    for (int a = 0; a < N_GRADIENT_ARRAYS; a++) check_array(&r, w, &x, a);
    gradient_room_free(&x);
    carom_world_destroy(w);
    free(r.weight);
}

static void against_differences(void **state)
{
    scene_integrator = CAROM_EULER;
    check_scene(*state);
}

static void located_against_differences(void **state)
{
    scene_integrator = CAROM_LOCATED;
    check_scene(*state);
    scene_integrator = CAROM_EULER;
}

static void sixth_order_against_differences(void **state)
{
    /* Its boxes sink in by 1e-5 so that faces meet: at this order the events of their first
     * millisecond make differences of gravity noisy by 1e-6. */
    if (strcmp(((const gradient_scene *)*state)->name, "pushed stack") == 0) skip();
    scene_integrator = CAROM_LOCATED;
    scene_order = 6;
    check_scene(*state);
    scene_integrator = CAROM_EULER;
    scene_order = 2;
}

static void fixed_against_differences(void **state)
{
    scene_integrator = CAROM_FIXED;
    check_scene(*state);
    scene_integrator = CAROM_EULER;
}

int main(void)
{
    static const CMUnitTestFunction maps[4] = {against_differences, located_against_differences,
                                               sixth_order_against_differences,
                                               fixed_against_differences};
    static struct CMUnitTest tests[MAX_TESTS];
    const int n = 4 * n_gradient_scenes;
    assert_true(n <= MAX_TESTS);
    for (int k = 0; k < n; k++) {
        const gradient_scene *s = &gradient_scenes[k % n_gradient_scenes];
        tests[k].name = s->name;
        tests[k].test_func = maps[k / n_gradient_scenes];
        tests[k].initial_state = (void *)(size_t)s;
    }
    return _cmocka_run_group_tests("gradient", tests, (size_t)n, NULL, NULL);
}
