/* Kinks are named: step, bodies, kind; and what is asked for is what is counted. */
#include "gradient_numbers.h"
#include "near.h"
#include "scenes.h"

#include <stdlib.h>
#include <string.h>

enum { ROOM = 256 };

typedef struct found {
    int n;
    carom_kink list[ROOM];
} found;

static found kinks_of(carom_tape *t)
{
    found x;
    assert_int_equal(carom_tape_kinks(t, ROOM, x.list, &x.n), CAROM_OK);
    assert_in_range(x.n, 0, ROOM);
    return x;
}

static int count_kind(const found *x, carom_kink_kind kind)
{
    int n = 0;
    for (int k = 0; k < x->n; k++) n += x->list[k].kind == kind;
    return n;
}

static carom_tape *record(carom_world *w, int n)
{
    carom_tape *t;
    assert_int_equal(carom_tape_create(w, NULL, &t), CAROM_OK);
    for (int k = 0; k < n; k++) assert_true(carom_tape_step(t, NULL, NULL) >= 0);
    return t;
}

static void close_run(carom_tape *t, carom_world *w)
{
    carom_tape_destroy(t);
    carom_world_destroy(w);
}

static int same(const carom_kink *x, int step, int a, int b, carom_kink_kind kind)
{
    return x->step == step && x->body_a == a && x->body_b == b && x->kind == kind;
}

/* Statistics of the gradient of the last state. */
static carom_gradient_stats stats_of(carom_tape *t, const carom_world *w)
{
    double *ones = calloc(6 * (size_t)carom_world_n_bodies(w), sizeof *ones);
    assert_non_null(ones);
    for (int k = 0; k < 3 * carom_world_n_bodies(w); k++) ones[k] = 1;
    const carom_state_bar bar = {carom_tape_steps(t), ones, NULL};
    carom_gradient g = {0};
    carom_gradient_stats stats;
    g.q0 = ones + 3 * carom_world_n_bodies(w);
    assert_int_equal(carom_tape_gradient(t, 1, &bar, &g, &stats), CAROM_OK);
    free(ones);
    return stats;
}

/* A ball that flies and bounces is smooth everywhere. */
static void none_in_a_bounce(void **state)
{
    (void)state;
    scene_integrator = CAROM_LOCATED;
    carom_world *w = scene_world(9.81, 1.0 / 60);
    scene_floor(w, 0.3, 0.7);
    scene_push(w, scene_disc(w, 1, 0.2, 0, 0.913, 0.3, 0.7), 0.1, 0.3, 0);
    carom_tape *t = record(w, 60);
    assert_int_equal(kinks_of(t).n, 0);
    assert_int_equal(stats_of(t, w).degenerate, 0);
    assert_int_equal(stats_of(t, w).first_degenerate_step, -1);
    close_run(t, w);
}

/* Two balls touch and nothing presses them together: in every step, by name. */
static void a_touch_without_force(void **state)
{
    (void)state;
    static const carom_integrator maps[3] = {CAROM_LOCATED, CAROM_FIXED, CAROM_EULER};
    for (int i = 0; i < 3; i++) {
        scene_integrator = maps[i];
        carom_world *w = scene_world(0, 1.0 / 60);
        scene_disc(w, 1, 0.5, -0.5, 0, 0.3, 0);
        scene_disc(w, 1, 0.5, 0.5, 0, 0.3, 0);
        scene_push(w, 0, 0, 0, 1);
        scene_push(w, 1, 0, 0, 1);
        carom_tape *t = record(w, 5);
        const found x = kinks_of(t);
        assert_int_equal(count_kind(&x, CAROM_KINK_WEAK), 5);
        for (int k = 0; k < 5; k++) assert_true(same(&x.list[k], k + 1, 0, 1, CAROM_KINK_WEAK));
        assert_int_equal(stats_of(t, w).degenerate, 5);
        assert_int_equal(stats_of(t, w).first_degenerate_step, 1);
        close_run(t, w);
    }
}

/* A box pushed with just mu m g: it sticks at the limit of friction. */
static void friction_at_its_limit(void **state)
{
    (void)state;
    scene_integrator = CAROM_LOCATED;
    carom_world *w = scene_world(8, 1.0 / 64);
    scene_floor(w, 0.5, 0);
    const int b = scene_box(w, 1, 1, 0.25, (carom_pose){0, 0, 0.25}, 0.5, 0);
    *gradient_number(w, BY_FORCE, 3 * b) = -0.25 * 4; /* the push acts on the floor's level */
    *gradient_number(w, BY_FORCE, 3 * b + 1) = 4;
    carom_tape *t = record(w, 3);
    const found x = kinks_of(t);
    assert_int_equal(count_kind(&x, CAROM_KINK_SLIP), 3);
    close_run(t, w);
}

/* A box falls flat: both corners meet the floor at one time. */
static void two_corners_at_once(void **state)
{
    (void)state;
    scene_integrator = CAROM_LOCATED;
    carom_world *w = scene_world(9.81, 1.0 / 60);
    scene_floor(w, 0.3, 0.5);
    scene_box(w, 1, 0.5, 0.25, (carom_pose){0, 0, 0.5}, 0.3, 0.5);
    carom_tape *t = record(w, 20);
    const found x = kinks_of(t);
    assert_true(count_kind(&x, CAROM_KINK_SIMULTANEOUS) >= 1);
    assert_int_equal(x.list[0].body_a + x.list[0].body_b, 1);
    assert_int_equal(x.list[0].step, 14); /* sqrt(2 * 0.25 / 9.81) s = 13.5 steps */
    close_run(t, w);
}

/* A disc passes above another at distance 0: the gap closes and opens at no speed. */
static void a_graze(void **state)
{
    (void)state;
    scene_integrator = CAROM_LOCATED;
    carom_world *w = scene_world(0, 1.0 / 60);
    scene_disc(w, 1, 0.5, 0, 0, 0, 1);
    const int b = scene_disc(w, 1, 0.5, -0.5, 1 - 1e-13, 0, 1);
    scene_push(w, b, 0, 1, 0);
    carom_tape *t = record(w, 60);
    const found x = kinks_of(t);
    assert_true(count_kind(&x, CAROM_KINK_GRAZING) + count_kind(&x, CAROM_KINK_WEAK) >= 1);
    assert_in_range(x.list[0].step, 28, 33);
    close_run(t, w);
}

/* An impact on the border of two steps counts where a state was asked for there. */
static void an_impact_on_a_border(void **state)
{
    (void)state;
    scene_integrator = CAROM_LOCATED;
    carom_world *w = scene_world(0, 1.0 / 16);
    scene_floor(w, 0, 0.5);
    scene_push(w, scene_disc(w, 1, 0.25, 0, 1.25, 0, 0.5), 0, 0, -2);
    carom_tape *t = record(w, 8);
    assert_int_equal(stats_of(t, w).degenerate, 1);
    assert_int_equal(stats_of(t, w).first_degenerate_step, 8);
    for (int k = 0; k < 4; k++) assert_true(carom_tape_step(t, NULL, NULL) >= 0);
    assert_int_equal(stats_of(t, w).degenerate, 0);
    const found x = kinks_of(t);
    assert_int_equal(x.n, 1);
    assert_true(same(&x.list[0], 8, 0, 1, CAROM_KINK_BORDER));
    close_run(t, w);
}

/* Flush faces: either may be the reference. */
static void flush_faces(void **state)
{
    (void)state;
    scene_integrator = CAROM_LOCATED;
    carom_world *w = scene_world(9.81, 1.0 / 60);
    scene_floor(w, 0.5, 0);
    scene_push(w, scene_box(w, 1, 0.5, 0.25, (carom_pose){0, 0, 0.25}, 0.5, 0), 0, 1, 0);
    carom_tape *t = record(w, 4);
    const found x = kinks_of(t);
    assert_int_equal(count_kind(&x, CAROM_KINK_FEATURES), 4);
    assert_int_equal(stats_of(t, w).degenerate, x.n - 4);
    close_run(t, w);
}

/* The list in pieces, names, and what is refused. */
static void how_to_ask(void **state)
{
    (void)state;
    scene_integrator = CAROM_LOCATED;
    carom_world *w = scene_world(0, 1.0 / 60);
    scene_disc(w, 1, 0.5, -0.5, 0, 0.3, 0);
    scene_disc(w, 1, 0.5, 0.5, 0, 0.3, 0);
    carom_tape *t = record(w, 4);
    carom_kink one[2] = {{-7, 0, 0, CAROM_KINK_WEAK}, {-7, 0, 0, CAROM_KINK_WEAK}};
    int n = -1;
    assert_int_equal(carom_tape_kinks(t, 0, NULL, &n), CAROM_OK);
    assert_int_equal(n, 4);
    assert_int_equal(carom_tape_kinks(t, 1, one, &n), CAROM_OK);
    assert_int_equal(n, 4);
    assert_int_equal(one[0].step, 1);
    assert_int_equal(one[1].step, -7);
    assert_int_equal(carom_tape_kinks(t, 1, NULL, &n), CAROM_E_ARGUMENT);
    assert_int_equal(carom_tape_kinks(t, -1, one, &n), CAROM_E_ARGUMENT);
    assert_int_equal(carom_tape_kinks(NULL, 0, NULL, &n), CAROM_E_ARGUMENT);
    assert_string_equal(carom_kink_name(CAROM_KINK_WEAK), "weak");
    assert_string_equal(carom_kink_name(CAROM_KINK_FEATURES), "features");
    assert_null(carom_kink_name((carom_kink_kind)99));
    close_run(t, w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(none_in_a_bounce),
                                       cmocka_unit_test(a_touch_without_force),
                                       cmocka_unit_test(friction_at_its_limit),
                                       cmocka_unit_test(two_corners_at_once),
                                       cmocka_unit_test(a_graze),
                                       cmocka_unit_test(an_impact_on_a_border),
                                       cmocka_unit_test(flush_faces),
                                       cmocka_unit_test(how_to_ask)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
