/* carom_tape_check: right gradients pass, wrong numbers are named, kinks are said. */
#include "carom/grad.h"
#include "gradient_numbers.h"
#include "gradient_scenes.h"
#include "near.h"
#include "scenes.h"

#include <stdlib.h>
#include <string.h>

enum { MOST = 256, CAPACITY = 512 };

/* A run, a loss of its end, and its gradient. */
typedef struct run {
    carom_world *w;
    carom_tape *t;
    double q[MOST];
    carom_state_bar bar;
    gradient_room x;
    carom_checked entry[CAPACITY];
    int n;
} run;

static void begin(run *r, carom_world *w, int n_steps)
{
    r->w = w;
    assert_int_equal(carom_tape_create(w, NULL, &r->t), CAROM_OK);
    for (int k = 0; k < n_steps; k++) assert_true(carom_tape_step(r->t, NULL, NULL) >= 0);
    const int n = 3 * carom_world_n_bodies(w);
    assert_true(n <= MOST);
    for (int k = 0; k < n; k++) r->q[k] = 1 + 0.1 * k;
    const carom_state_bar bar = {n_steps, r->q, NULL};
    r->bar = bar;
    r->x = gradient_room_make(w, 1);
    assert_int_equal(carom_tape_gradient(r->t, 1, &r->bar, &r->x.g, NULL), CAROM_OK);
}

static void end(run *r)
{
    gradient_room_free(&r->x);
    carom_tape_destroy(r->t);
    carom_world_destroy(r->w);
}

static void check(run *r, const carom_check_settings *set)
{
    assert_int_equal(carom_tape_check(r->t, 1, &r->bar, &r->x.g, set, CAPACITY, r->entry, &r->n),
                     CAROM_OK);
}

static void right_gradients_pass(void **state)
{
    (void)state;
    carom_check_settings set = carom_check_defaults();
    set.per_array = 2;
    for (int k = 0; k < n_gradient_scenes; k++) {
        const gradient_scene *s = &gradient_scenes[k];
        static run r;
        int excused = 0;
        begin(&r, s->build(s), s->n_steps);
        check(&r, &set);
        assert_true(r.n > 10);
        for (int i = 0; i < r.n; i++) {
            const carom_checked *e = &r.entry[i];
            /* the bound of test_gradient, whose steps are chosen for each scene, tenfold */
            if (e->disagreement <= 1e-5) continue;
            excused += e->kink;
            if (e->kink) continue;
            fail_msg("%s: %s[%d] is %.12g, differences %.12g and %.12g", s->name,
                     carom_gradient_name(e->array), e->index, e->gradient, e->difference[0],
                     e->difference[1]);
        }
        assert_true(10 * excused <= r.n);
        end(&r);
    }
}

/* <w, J e_k> for every number k of an array: a gradient by columns of the forward pass. */
static void by_columns(run *r, int array, double *g)
{
    const int n = gradient_count(r->w, array);
    const int n3 = 3 * carom_world_n_bodies(r->w);
    static double dot[MOST];
    gradient_room d = gradient_room_make(r->w, 1);
    const carom_state_dot state = {r->bar.step, dot, NULL};
    for (int k = 0; k < n; k++) {
        d.array[array][k] = 1;
        assert_int_equal(carom_tape_tangent(r->t, 1, &d.g, 1, &state, NULL), CAROM_OK);
        d.array[array][k] = 0;
        g[k] = 0;
        for (int i = 0; i < n3; i++) g[k] += r->q[i] * dot[i];
    }
    gradient_room_free(&d);
}

/* Forward products against differences of their own, with every integrator. */
static void forward_products_pass(void **state)
{
    (void)state;
    carom_check_settings set = carom_check_defaults();
    set.per_array = 1;
    for (int m = 0; m < 4; m++) {
        scene_integrator = m == 0 ? CAROM_EULER : m == 1 ? CAROM_FIXED : CAROM_LOCATED;
        scene_order = m == 3 ? 6 : 2;
        for (int k = 0; k < n_gradient_scenes; k += 3) {
            const gradient_scene *s = &gradient_scenes[k];
            static run r;
            begin(&r, s->build(s), s->n_steps / 2);
            for (int a = 0; a < N_GRADIENT_ARRAYS; a++) by_columns(&r, a, r.x.array[a]);
            check(&r, &set);
            assert_true(r.n > 5);
            for (int i = 0; i < r.n; i++) {
                const carom_checked *e = &r.entry[i];
                if (e->disagreement <= 1e-5 || e->kink) continue;
                fail_msg("%s: %s[%d] is %.12g, differences %.12g and %.12g", s->name,
                         carom_gradient_name(e->array), e->index, e->gradient, e->difference[0],
                         e->difference[1]);
            }
            end(&r);
        }
    }
    scene_integrator = CAROM_LOCATED;
    scene_order = 2;
}

/* A disc falls, bounces and flies on. */
static carom_world *falling_disc(double height)
{
    carom_world *w = scene_world(9.81, 1.0 / 60);
    scene_floor(w, 0.5, 0.5);
    scene_disc(w, 2, 0.25, 0, height, 0.5, 0.5);
    return w;
}

static void wrong_numbers_are_named(void **state)
{
    (void)state;
    static run r;
    begin(&r, falling_disc(1), 40);
    r.x.g.q0[5] *= 1.001;
    r.x.g.mass[1] += 0.1;
    carom_check_settings set = carom_check_defaults();
    set.per_array = 0;
    check(&r, &set);
    int wrong = 0;
    for (int i = 0; i < r.n; i++) {
        const carom_checked *e = &r.entry[i];
        const char *name = carom_gradient_name(e->array);
        const int meant = (!strcmp(name, "q0") && e->index == 5) || !strcmp(name, "mass");
        assert_int_equal(e->disagreement > 1e-4, meant);
        assert_false(e->kink);
        wrong += meant;
    }
    assert_int_equal(wrong, 2);
    end(&r);
}

/* A disc that touches the floor as the step ends: moved up it has not hit yet. */
static void kinks_are_said(void **state)
{
    (void)state;
    static run r;
    const double T = 20.0 / 60;
    begin(&r, falling_disc(0.25 + 0.5 * 9.81 * T * T), 20);
    carom_gradient height = {0};
    height.q0 = r.x.g.q0;
    r.x.g = height;
    carom_check_settings set = carom_check_defaults();
    set.per_array = 0;
    check(&r, &set);
    assert_int_equal(r.n, 6);
    assert_true(r.entry[5].kink);
    assert_false(r.entry[4].kink);
    end(&r);
}

static int stop_at_three(void *user, int done, int all)
{
    *(int *)user = all;
    return done == 3;
}

static void stops_when_asked(void **state)
{
    (void)state;
    static run r;
    int all = 0;
    int n = 0;
    carom_check_settings set = carom_check_defaults();
    set.progress = stop_at_three;
    set.user = &all;
    begin(&r, falling_disc(1), 10);
    check(&r, &set);
    assert_int_equal(r.n, 3);
    assert_int_equal(carom_tape_check(r.t, 1, &r.bar, &r.x.g, &set, 0, NULL, &n), CAROM_OK);
    assert_int_equal(n, all);
    end(&r);
}

static void refused(void **state)
{
    (void)state;
    static run r;
    int n;
    carom_checked e[1];
    begin(&r, falling_disc(1), 5);
    carom_check_settings set = carom_check_defaults();
    const carom_state_bar late = {6, r.q, NULL};
    assert_int_equal(carom_tape_check(NULL, 1, &r.bar, &r.x.g, NULL, 1, e, &n), CAROM_E_ARGUMENT);
    assert_int_equal(carom_tape_check(r.t, 1, &late, &r.x.g, NULL, 1, e, &n), CAROM_E_ARGUMENT);
    assert_int_equal(carom_tape_check(r.t, 1, &r.bar, &r.x.g, NULL, 1, NULL, &n), CAROM_E_ARGUMENT);
    set.step[1] = 0;
    assert_int_equal(carom_tape_check(r.t, 1, &r.bar, &r.x.g, &set, 1, e, &n), CAROM_E_ARGUMENT);
    const double friction[2] = {0.1, 0.1};
    const carom_parameters p = {.friction = friction};
    assert_int_equal(carom_world_set_parameters(r.w, &p), CAROM_OK);
    assert_int_equal(carom_tape_check(r.t, 1, &r.bar, &r.x.g, NULL, 1, e, &n), CAROM_E_STATE);
    assert_null(carom_gradient_name(-1));
    assert_null(carom_gradient_name(26));
    assert_string_equal(carom_gradient_name(25), "motor_limit");
    end(&r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(right_gradients_pass),    cmocka_unit_test(forward_products_pass),
        cmocka_unit_test(wrong_numbers_are_named), cmocka_unit_test(kinks_are_said),
        cmocka_unit_test(stops_when_asked),        cmocka_unit_test(refused)};
    scene_integrator = CAROM_LOCATED;
    return cmocka_run_group_tests(tests, NULL, NULL);
}
