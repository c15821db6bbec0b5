/* Building, refusing, and worlds that lack something. */
#include "alloc_fail.h"
#include "near.h"
#include "scenes.h"

#include "carom/carom.h"

#include <string.h>

static const carom_vec2 SQUARE[4] = {{-0.5, -0.5}, {0.5, -0.5}, {0.5, 0.5}, {-0.5, 0.5}};

static carom_body_def box_def(void)
{
    static const carom_shape shape = {0, 4, SQUARE};
    carom_body_def d = carom_body_defaults();
    d.n_shapes = 1;
    d.shapes = &shape;
    return d;
}

static void no_body(void **state)
{
    (void)state;
    carom_world *w = scene_world(9.81, 0.01);
    carom_step_stats s;
    scene_run(w, 3, &s);
    assert_int_equal(s.status, CAROM_OK);
    assert_int_equal(s.n_contacts, 0);
    assert_int_equal(s.factorizations, 0);
    assert_near(carom_world_time(w), 0.03, 1e-15);
    carom_world_destroy(w);
}

static void no_contact_no_joint(void **state)
{
    (void)state;
    carom_world *w = scene_world(9.81, 0.01);
    carom_step_stats s;
    scene_disc(w, 1, 0.1, 0, 0, 0.5, 0.5);
    scene_disc(w, 1, 0.1, 9, 0, 0.5, 0.5);
    scene_run(w, 3, &s);
    assert_int_equal(s.factorizations, 0);
    assert_int_equal(s.stage, CAROM_STAGE_NONE);
    carom_world_destroy(w);
}

static void only_static(void **state)
{
    (void)state;
    carom_world *w = scene_world(9.81, 0.01);
    carom_step_stats s;
    scene_floor(w, 0.5, 0);
    scene_floor(w, 0.5, 0); /* two static bodies overlap: nobody cares */
    scene_run(w, 2, &s);
    assert_int_equal(s.status, CAROM_OK);
    assert_int_equal(s.n_contacts, 0);
    carom_world_destroy(w);
}

static void refuses_bodies(void **state)
{
    (void)state;
    static const carom_vec2 clockwise[3] = {{0, 0}, {0, 1}, {1, 0}};
    static const carom_shape bad = {0, 3, clockwise};
    carom_world *w = scene_world(9.81, 0.01);
    carom_body_def d[8];
    static const char *const words[8] = {"mass", "inertia", "friction", "restitution",
                                         "pose", "static",  "velocity", "clockwise"};
    for (int k = 0; k < 8; k++) d[k] = box_def();
    d[0].mass = 0;
    d[1].inertia = -1;
    d[2].friction = -0.1;
    d[3].restitution = 1.5;
    d[4].pose.x = NAN;
    d[5].type = CAROM_STATIC;
    d[5].velocity[1] = 1;
    d[6].velocity[0] = HUGE_VAL;
    d[7].shapes = &bad;
    for (int k = 0; k < 8; k++) {
        int index = -7;
        const carom_status e = carom_world_add_body(w, &d[k], &index);
        assert_int_equal(e, k == 7 ? CAROM_E_SHAPE : CAROM_E_ARGUMENT);
        assert_int_equal(index, -7);
        if (!strstr(carom_world_error(w), words[k])) {
            fail_msg("case %d: '%s' does not say %s", k, carom_world_error(w), words[k]);
        }
        assert_non_null(strstr(carom_world_error(w), "body 0"));
    }
    assert_int_equal(carom_world_n_bodies(w), 0);
    carom_world_destroy(w);
}

static void refuses_joints(void **state)
{
    (void)state;
    carom_world *w = scene_world(9.81, 0.01);
    const carom_vec2 o = {0, 0};
    const carom_vec2 nan = {NAN, 0};
    const int a = scene_anchor(w);
    const int b = scene_anchor(w);
    const int c = scene_disc(w, 1, 0.1, 0, 0, 0, 0);
    assert_int_equal(carom_world_add_revolute(w, a, b, o, NULL), CAROM_E_ARGUMENT);
    assert_int_equal(carom_world_add_revolute(w, c, c, o, NULL), CAROM_E_ARGUMENT);
    assert_int_equal(carom_world_add_revolute(w, a, 99, o, NULL), CAROM_E_ARGUMENT);
    assert_int_equal(carom_world_add_revolute(w, a, c, nan, NULL), CAROM_E_ARGUMENT);
    assert_int_equal(carom_world_n_joints(w), 0);
    assert_int_equal(carom_world_add_revolute(w, a, c, o, NULL), CAROM_OK);
    carom_world_destroy(w);
}

static void refuses_late_building(void **state)
{
    (void)state;
    carom_world *w = scene_world(9.81, 0.01);
    const carom_vec2 o = {0, 0};
    const carom_body_def d = box_def();
    const int a = scene_anchor(w);
    const int c = scene_disc(w, 1, 0.1, 0, 0, 0, 0);
    scene_run(w, 1, NULL);
    assert_int_equal(carom_world_add_body(w, &d, NULL), CAROM_E_STATE);
    assert_int_equal(carom_world_add_revolute(w, a, c, o, NULL), CAROM_E_STATE);
    carom_world_destroy(w);
}

static void refuses_forces_and_states(void **state)
{
    (void)state;
    carom_world *w = scene_world(9.81, 0.01);
    scene_floor(w, 0, 0);
    scene_disc(w, 1, 0.1, 0, 3, 0, 0);
    const double force[6] = {0, 0, 0, 0, NAN, 0};
    const double moving_floor[6] = {0, 1, 0, 0, 0, 0};
    assert_int_equal(carom_world_step(w, force, NULL), CAROM_E_ARGUMENT);
    assert_near(carom_world_q(w)[5], 3, 0);
    assert_int_equal(carom_world_steps(w), 0);
    assert_int_equal(carom_world_set_state(w, force, NULL), CAROM_E_ARGUMENT);
    assert_int_equal(carom_world_set_state(w, NULL, moving_floor), CAROM_E_ARGUMENT);
    const double restitution[2] = {0, -1};
    carom_parameters p = {0};
    p.restitution = restitution;
    assert_int_equal(carom_world_set_parameters(w, &p), CAROM_E_ARGUMENT);
    carom_world_destroy(w);
}

static void settings_by_name(void **state)
{
    (void)state;
    carom_world_settings s = carom_world_defaults();
    const char *why = NULL;
    assert_int_equal(carom_world_settings_set(&s, "dt", "0.025", &why), CAROM_OK);
    assert_near(s.dt, 0.025, 0);
    assert_int_equal(carom_world_settings_set(&s, "combine_friction", "max", &why), CAROM_OK);
    assert_int_equal(s.combine_friction, CAROM_COMBINE_MAX);
    assert_int_equal(carom_world_settings_set(&s, "max_substeps", "7", &why), CAROM_OK);
    assert_int_equal(s.max_substeps, 7);
    assert_int_equal(carom_world_settings_set(&s, "max_substeps", "7.5", &why), CAROM_E_ARGUMENT);
    assert_int_equal(carom_world_settings_set(&s, "dt", "fast", &why), CAROM_E_ARGUMENT);
    assert_non_null(strstr(why, "number"));
    assert_int_equal(carom_world_settings_set(&s, "integrator", "magic", &why), CAROM_E_ARGUMENT);
    assert_int_equal(carom_world_settings_set(&s, "gravitas", "1", &why), CAROM_E_ARGUMENT);
    assert_non_null(strstr(why, "setting"));
    assert_int_equal(s.max_substeps, 7);
    carom_world *w = NULL;
    s.dt = -1;
    assert_int_equal(carom_world_create(&s, NULL, &w), CAROM_E_ARGUMENT);
    assert_null(w);
}

static void initial_overlap(void **state)
{
    (void)state;
    carom_world *w = scene_world(9.81, 0.01);
    scene_floor(w, 0.5, 0);
    const int b = scene_disc(w, 1, 0.5, 0, 0.45, 0.5, 0);
    assert_int_equal(carom_world_seal(w), CAROM_OK);
    assert_non_null(strstr(carom_world_error(w), "overlap"));
    assert_near(carom_world_q(w)[3 * b + 2], 0.5, 1e-12);
    carom_world_destroy(w);
    carom_world_settings s = carom_world_defaults();
    s.project_overlap = 0;
    assert_int_equal(carom_world_create(&s, NULL, &w), CAROM_OK);
    scene_floor(w, 0.5, 0);
    scene_disc(w, 1, 0.5, 0, 0.45, 0.5, 0);
    assert_int_equal(carom_world_step(w, NULL, NULL), CAROM_E_ARGUMENT);
    assert_non_null(strstr(carom_world_error(w), "overlap"));
    assert_near(carom_world_q(w)[3 * b + 2], 0.45, 0);
    carom_world_destroy(w);
}

/* Does a disc that falls on a floor rest on it? */
static int meets(carom_filter floor_filter, carom_filter disc_filter, int collide)
{
    static const carom_vec2 corners[4] = {{-5, -1}, {5, -1}, {5, 1}, {-5, 1}};
    static const carom_vec2 center = {0, 0};
    const carom_shape slab = {0, 4, corners};
    const carom_shape disc = {0.5, 1, &center};
    carom_world *w = scene_world(9.81, 0.01);
    carom_body_def d = carom_body_defaults();
    d.type = CAROM_STATIC;
    d.pose.y = -1;
    d.n_shapes = 1;
    d.shapes = &slab;
    d.filter = floor_filter;
    assert_int_equal(carom_world_add_body(w, &d, NULL), CAROM_OK);
    d.type = CAROM_DYNAMIC;
    d.pose.y = 0.6;
    d.shapes = &disc;
    d.filter = disc_filter;
    d.collide = collide;
    assert_int_equal(carom_world_add_body(w, &d, NULL), CAROM_OK);
    scene_run(w, 40, NULL);
    const int rests = carom_world_q(w)[5] > 0.4;
    carom_world_destroy(w);
    return rests;
}

static void filters(void **state)
{
    (void)state;
    const carom_filter all = {1, ~0U, 0};
    const carom_filter bit2 = {2, 2, 0};
    const carom_filter team = {1, ~0U, -3};
    const carom_filter always = {4, 0, 5};
    assert_int_equal(meets(all, all, 1), 1);
    assert_int_equal(meets(all, all, 0), 0);
    assert_int_equal(meets(all, bit2, 1), 0);
    assert_int_equal(meets(team, team, 1), 0);
    assert_int_equal(meets(always, always, 1), 1);
    assert_int_equal(meets(all, team, 1), 1);
}

static void joined_bodies_do_not_collide(void **state)
{
    (void)state;
    carom_world *w = scene_world(9.81, 0.01);
    const carom_vec2 pin = {0, 0};
    const int a = scene_disc(w, 1, 0.5, 0, 0, 0.5, 0);
    const int b = scene_disc(w, 1, 0.5, 0.1, 0, 0.5, 0);
    assert_int_equal(carom_world_add_revolute(w, a, b, pin, NULL), CAROM_OK);
    carom_step_stats s;
    scene_run(w, 5, &s);
    assert_int_equal(s.n_contacts, 0);
    carom_world_destroy(w);
}

/* Several shapes on one body: a dumbbell lies on two discs. */
static void two_shapes(void **state)
{
    (void)state;
    static const carom_vec2 ends[2] = {{-1, 0}, {1, 0}};
    const carom_shape discs[2] = {{0.5, 1, &ends[0]}, {0.5, 1, &ends[1]}};
    carom_world *w = scene_world(9.81, 0.01);
    scene_floor(w, 0.5, 0);
    carom_body_def d = carom_body_defaults();
    d.n_shapes = 2;
    d.shapes = discs;
    d.pose.y = 0.5;
    assert_int_equal(carom_world_add_body(w, &d, NULL), CAROM_OK);
    carom_step_stats s;
    scene_run(w, 10, &s);
    assert_int_equal(s.n_contacts, 2);
    assert_near(carom_world_q(w)[5], 0.5, 1e-10);
    carom_world_destroy(w);
}

/* A pile's memory is made once: no request after the contacts have settled. */
static void steady_state_does_not_allocate(void **state)
{
    (void)state;
    carom_world *w = scene_world(9.81, 1.0 / 60);
    const carom_pose poses[3] = {{0, 0, 0.5}, {0, 0.2, 1.5}, {0, -0.1, 2.5}};
    scene_floor(w, 0.5, 0);
    for (int k = 0; k < 3; k++) scene_box(w, 1, 0.5, 0.5, poses[k], 0.5, 0);
    scene_run(w, 10, NULL);
    for (int k = 0; k < 100; k++) {
        carom_step_stats s;
        scene_run(w, 1, &s);
        assert_int_equal(s.allocations, 0);
    }
    carom_world_destroy(w);
}

/* Same scene, same bits. */
static void repeats(void **state)
{
    (void)state;
    double end[2][12];
    for (int run = 0; run < 2; run++) {
        carom_world *w = scene_world(9.81, 1.0 / 60);
        scene_floor(w, 0.5, 0.4);
        for (int k = 0; k < 3; k++) scene_disc(w, 1, 0.3, 0.1 * k, 1 + 0.7 * k, 0.5, 0.4);
        scene_run(w, 120, NULL);
        memcpy(end[run], carom_world_q(w), sizeof end[run]);
        carom_world_destroy(w);
    }
    assert_memory_equal(end[0], end[1], sizeof end[0]);
}

/* Builds, steps and differentiates under an allocator that fails at its k-th request. */
static carom_status whole_life(const carom_allocator *a)
{
    const carom_vec2 pin = {1, 3};
    carom_body_def d = box_def();
    carom_world *w = NULL;
    carom_tape *tape = NULL;
    double seed[9] = {0, 0, 0, 0, 0, 1, 0, 0, 0};
    double q0[9];
    const carom_state_bar bar = {2, seed, NULL};
    carom_gradient g = {0};
    g.q0 = q0;
    carom_status e = carom_world_create(NULL, a, &w);
    for (int k = 0; !e && k < 3; k++) {
        d.type = k ? CAROM_DYNAMIC : CAROM_STATIC;
        d.pose.y = 1.001 * k;
        e = carom_world_add_body(w, &d, NULL);
    }
    if (!e) e = carom_world_add_revolute(w, 1, 2, pin, NULL);
    if (!e) e = carom_tape_create(w, a, &tape);
    for (int k = 0; !e && k < 2; k++) e = carom_tape_step(tape, NULL, NULL);
    if (!e) e = carom_tape_gradient(tape, 1, &bar, &g, NULL);
    carom_tape_destroy(tape);
    carom_world_destroy(w);
    return e;
}

static void every_allocation_may_fail(void **state)
{
    (void)state;
    int k = 0;
    for (;; k++) {
        alloc_fail f = alloc_fail_at(k);
        const carom_allocator a = alloc_fail_allocator(&f);
        const carom_status e = whole_life(&a);
        assert_int_equal(f.live, 0);
        assert_int_equal(f.n_bad_sizes, 0);
        if (e == CAROM_OK) break;
        assert_int_equal(e, CAROM_E_MEMORY);
    }
    assert_true(k > 10);
}

static void null_arguments(void **state)
{
    (void)state;
    carom_world_destroy(NULL);
    carom_tape_destroy(NULL);
    carom_world *w = NULL;
    assert_int_equal(carom_world_create(NULL, NULL, NULL), CAROM_E_ARGUMENT);
    assert_int_equal(carom_world_create(NULL, NULL, &w), CAROM_OK);
    assert_int_equal(carom_world_add_body(w, NULL, NULL), CAROM_E_ARGUMENT);
    assert_int_equal(carom_world_step(NULL, NULL, NULL), CAROM_E_ARGUMENT);
    assert_string_equal(carom_world_error(NULL), "");
    carom_world_destroy(w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(no_body),
        cmocka_unit_test(no_contact_no_joint),
        cmocka_unit_test(only_static),
        cmocka_unit_test(refuses_bodies),
        cmocka_unit_test(refuses_joints),
        cmocka_unit_test(refuses_late_building),
        cmocka_unit_test(refuses_forces_and_states),
        cmocka_unit_test(settings_by_name),
        cmocka_unit_test(initial_overlap),
        cmocka_unit_test(filters),
        cmocka_unit_test(joined_bodies_do_not_collide),
        cmocka_unit_test(two_shapes),
        cmocka_unit_test(steady_state_does_not_allocate),
        cmocka_unit_test(repeats),
        cmocka_unit_test(every_allocation_may_fail),
        cmocka_unit_test(null_arguments),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
