/* What a scene does not need is neither run nor allocated: counted. */
#define _GNU_SOURCE
#include "near.h"
#include "scenes.h"

#include <ccd/ccd.h>
#include <dlfcn.h>

/* Stands before libccd's own: all calls of the library pass here. */
static long ccd_calls = 0;

int ccdGJKIntersect(const void *a, const void *b, const ccd_t *ccd)
{
    typedef int intersect(const void *a, const void *b, const ccd_t *ccd);
    intersect *next;
    *(void **)&next = dlsym(RTLD_NEXT, "ccdGJKIntersect");
    ccd_calls++;
    return next(a, b, ccd);
}

enum { N = 40, STEPS = 120 };

/* N bodies at rest in a row, 3 m apart. */
static carom_world *row(int with_shapes, double friction, double restitution)
{
    carom_world *w = scene_world(9.81, 1.0 / 60);
    for (int k = 0; k < N; k++) {
        if (with_shapes) {
            scene_disc(w, 1, 0.5, 3.0 * k, 0.6, friction, restitution);
        } else {
            const carom_body_def d = carom_body_at(CAROM_DYNAMIC, 3.0 * k, 0.6);
            assert_int_equal(carom_world_add_body(w, &d, NULL), CAROM_OK);
        }
    }
    return w;
}

static int factorizations(carom_world *w)
{
    int n = 0;
    for (int k = 0; k < STEPS; k++) {
        carom_step_stats s;
        scene_run(w, 1, &s);
        n += s.factorizations;
    }
    return n;
}

static void free_flight(void **state)
{
    (void)state;
    carom_world *w = row(0, 0, 0);
    carom_plan p = carom_world_plan(w);
    assert_true(!p.contacts && !p.solver && !p.located && !p.joints && !p.friction && !p.hulls);
    assert_int_equal(factorizations(w), 0);
    const carom_world_size z = carom_world_measure(w);
    assert_true(z.factor.nonzeros == 0 && z.factor.flops == 0);
    /* per body 6 + 3 numbers of the state, 21 of the step and islands, 24 of a sub-step with two
     * solves, and its record: below 1 KB; the world itself below 32 KB */
    assert_at_most("bytes", (double)z.bytes, 32768 + 1024.0 * N);
    carom_world_destroy(w);
}

/* The same bodies with discs that can meet hold more; those that filters keep apart do not. */
static void filtered(void **state)
{
    (void)state;
    carom_world *meeting = row(1, 0.5, 0);
    carom_world *apart = scene_world(9.81, 1.0 / 60);
    const carom_vec2 center = {0, 0};
    const carom_shape disc = {.radius = 0.5, .count = 1, .vertices = &center};
    for (int k = 0; k < N; k++) {
        carom_body_def d = carom_body_at(CAROM_DYNAMIC, 3.0 * k, 0.6);
        d.shapes = &disc;
        d.n_shapes = 1;
        d.filter.group = -1;
        assert_int_equal(carom_world_add_body(apart, &d, NULL), CAROM_OK);
    }
    assert_true(carom_world_plan(meeting).contacts);
    assert_false(carom_world_plan(apart).contacts);
    scene_run(meeting, 2, NULL);
    scene_run(apart, 2, NULL);
    assert_true(carom_world_measure(apart).bytes < carom_world_measure(meeting).bytes);
    carom_world_destroy(meeting);
    carom_world_destroy(apart);
}

static void smooth_contacts_have_no_tangent(void **state)
{
    (void)state;
    carom_world *w = row(1, 0, 0);
    scene_floor(w, 0, 0);
    const carom_plan p = carom_world_plan(w);
    assert_true(p.contacts && p.solver && !p.friction && !p.restitution && !p.joints);
    scene_run(w, STEPS, NULL);
    const carom_world_size z = carom_world_measure(w);
    assert_true(z.n_contacts > 0);
    assert_int_equal(z.n_friction, 0);
    carom_world_destroy(w);
}

static int polygon(carom_world *w, int n, double x, double y)
{
    static carom_vec2 corners[600];
    for (int k = 0; k < n; k++) {
        const double a = 2 * acos(-1) * k / n;
        corners[k].x = cos(a);
        corners[k].y = sin(a);
    }
    const carom_shape shape = {.count = n, .vertices = corners};
    carom_body_def d = carom_body_at(CAROM_DYNAMIC, x, y);
    int b;
    d.shapes = &shape;
    d.n_shapes = 1;
    assert_int_equal(carom_world_add_body(w, &d, &b), CAROM_OK);
    return b;
}

/* Circles, also fast ones, never reach libccd, nor do boxes; two hulls of 600 vertices do. */
static void circles_need_no_libccd(void **state)
{
    (void)state;
    carom_world *w = row(1, 0.5, 0.5);
    scene_floor(w, 0.5, 0.5);
    scene_push(w, scene_disc(w, 1, 0.5, -3, 0.5, 0.5, 0.5), 0, 60, 0);
    assert_false(carom_world_plan(w).hulls);
    ccd_calls = 0;
    scene_run(w, STEPS, NULL);
    assert_int_equal(ccd_calls, 0);
    carom_world_destroy(w);

    w = scene_world(0, 1.0 / 60);
    polygon(w, 600, 0, 0);
    scene_push(w, polygon(w, 600, 2.1, 0.1), 0, -10, 0);
    assert_true(carom_world_plan(w).hulls);
    scene_run(w, 1, NULL);
    assert_true(ccd_calls > 0);
    carom_world_destroy(w);
}

static void joints(void **state)
{
    (void)state;
    carom_world *w = scene_world(9.81, 1.0 / 60);
    scene_links(w, 3);
    const carom_plan p = carom_world_plan(w);
    /* neighbors are joined, but the first and the third link may meet */
    assert_true(p.joints && p.solver && p.contacts && !p.limits && !p.drives && !p.sensors);
    carom_world_destroy(w);

    w = scene_world(9.81, 1.0 / 60);
    scene_links(w, 2);
    assert_false(carom_world_plan(w).contacts);
    assert_true(factorizations(w) > 0);
    carom_world_destroy(w);
}

/* Tables of sub-steps are made for orders above 2, where something is held. */
static void orders(void **state)
{
    (void)state;
    size_t bytes[3];
    scene_integrator = CAROM_LOCATED;
    for (int k = 0; k < 3; k++) {
        scene_order = k == 1 ? 8 : 2;
        carom_world *w = scene_world(9.81, 1.0 / 60);
        scene_links(w, 2);
        assert_int_equal(carom_world_plan(w).extrapolated, k == 1);
        scene_run(w, 1, NULL);
        bytes[k] = carom_world_measure(w).bytes;
        carom_world_destroy(w);
    }
    scene_order = 2;
    /* ten inner sub-steps of four states and ten solves with two, three bodies */
    assert_true(bytes[1] - bytes[0] >= 10 * (4 + 2 * 10) * 9 * sizeof(double));
    assert_true(bytes[2] == bytes[0]);
}

static void empty_world(void **state)
{
    (void)state;
    carom_world *w = scene_world(9.81, 1.0 / 60);
    const carom_plan p = carom_world_plan(w);
    assert_true(!p.contacts && !p.solver && !p.joints && !p.threads && !p.extrapolated);
    assert_int_equal(factorizations(w), 0);
    carom_world_destroy(w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(free_flight),
        cmocka_unit_test(filtered),
        cmocka_unit_test(smooth_contacts_have_no_tangent),
        cmocka_unit_test(circles_need_no_libccd),
        cmocka_unit_test(joints),
        cmocka_unit_test(orders),
        cmocka_unit_test(empty_world),
    };
    scene_integrator = CAROM_LOCATED;
    return cmocka_run_group_tests(tests, NULL, NULL);
}
