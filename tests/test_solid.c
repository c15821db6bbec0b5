/* Bodies from shapes and a density.  A world without gravity tells mass and inertia by its kinetic
 * energy (m |v|^2 + I omega^2)/2. */
#include "alloc_fail.h"
#include "near.h"

#include "carom/carom.h"

#include <string.h>

#define DENSITY 300.0 /* [kg/m^2] */

static const double pi = 3.14159265358979323846;

static carom_world *weightless(const carom_allocator *memory)
{
    carom_world_settings set = carom_world_defaults();
    set.gravity[1] = 0;
    carom_world *w = NULL;
    assert_int_equal(carom_world_create(&set, memory, &w), CAROM_OK);
    return w;
}

/* Energy of the world's only body at this velocity. */
static double energy_at(carom_world *w, double omega, double vx, double vy)
{
    const double v[3] = {omega, vx, vy};
    assert_int_equal(carom_world_set_state(w, NULL, v), CAROM_OK);
    return carom_world_energy(w);
}

/* Eight roundings of sums and products: 1e-15 each. */
static void expect_mass(carom_world *w, const char *name, double mass, double inertia)
{
    const double tol = 8e-15;
    assert_int_equal(carom_world_n_bodies(w), 1);
    assert_near_case(name, 0, energy_at(w, 0, 1, 0), mass / 2, tol * mass);
    assert_near_case(name, 1, energy_at(w, 0, 0, 1), mass / 2, tol * mass);
    assert_near_case(name, 2, energy_at(w, 1, 0, 0), inertia / 2, tol * inertia);
    carom_world_destroy(w);
}

static void circle_has_its_closed_form(void **state)
{
    (void)state;
    const carom_body_def def = carom_body_at(CAROM_DYNAMIC, 3, -4);
    const double r = 0.25;
    const double mass = DENSITY * pi * r * r;
    int index = -1;
    carom_world *w = weightless(NULL);
    assert_int_equal(carom_world_add_circle(w, &def, r, DENSITY, &index), CAROM_OK);
    assert_int_equal(index, 0);
    assert_near(carom_world_q(w)[1], 3, 0);
    assert_near(carom_world_q(w)[2], -4, 0);
    expect_mass(w, "circle", mass, mass * r * r / 2);
}

static void box_has_its_closed_form(void **state)
{
    (void)state;
    carom_body_def def = carom_body_at(CAROM_DYNAMIC, 0, 0);
    const double a = 0.6;
    const double b = 0.2;
    const double mass = DENSITY * a * b;
    carom_world *w = weightless(NULL);
    def.pose.angle = 1; /* of no account */
    def.mass = -1;      /* not read */
    assert_int_equal(carom_world_add_box(w, &def, a, b, DENSITY, NULL), CAROM_OK);
    expect_mass(w, "box", mass, mass * (a * a + b * b) / 12);
}

/* A dumbbell: the inertia is about the position, by Steiner's theorem. */
static void shapes_add_up(void **state)
{
    (void)state;
    const carom_vec2 at[2] = {{-0.5, 0}, {0.5, 0}};
    const carom_shape discs[2] = {{0.2, 1, &at[0]}, {0.2, 1, &at[1]}};
    carom_body_def def = carom_body_at(CAROM_DYNAMIC, 1, 1);
    def.n_shapes = 2;
    def.shapes = discs;
    const double one = DENSITY * pi * 0.2 * 0.2;
    carom_world *w = weightless(NULL);
    assert_int_equal(carom_world_add_solid(w, &def, DENSITY, NULL), CAROM_OK);
    expect_mass(w, "dumbbell", 2 * one, 2 * one * (0.2 * 0.2 / 2 + 0.5 * 0.5));
}

/* A ball on a box: the shapes are there, around the positions, and the floor needs no density. */
static void shapes_lie_around_the_position(void **state)
{
    (void)state;
    const carom_body_def floor = carom_body_at(CAROM_STATIC, 0, -1);
    const carom_body_def ball = carom_body_at(CAROM_DYNAMIC, 0, 0.25);
    carom_world *w = NULL;
    carom_step_stats stats;
    assert_int_equal(carom_world_create(NULL, NULL, &w), CAROM_OK);
    assert_int_equal(carom_world_add_box(w, &floor, 10, 2, 0, NULL), CAROM_OK);
    assert_int_equal(carom_world_add_circle(w, &ball, 0.25, DENSITY, NULL), CAROM_OK);
    assert_int_equal(carom_world_step(w, NULL, &stats), CAROM_OK);
    assert_int_equal(stats.n_contacts, 1);
    const carom_contact_info c = carom_world_contact(w, 0);
    assert_near(c.gap, 0, 1e-15);
    assert_near(c.point.y, 0, 1e-15);
    /* at rest the floor carries the weight of the ball for one step */
    const double weight = DENSITY * pi * 0.25 * 0.25 * 9.81;
    assert_near(c.ln, weight / 60, 1e-10 * weight); /* residual of a solved problem */
    carom_world_destroy(w);
}

typedef struct refusal {
    const char *name;
    carom_body_type type;
    double density;
    double radius; /* > 0 or NaN: a circle, else a box */
    double width, height;
    carom_status status;
    const char *said;
} refusal;

static void refusals_are_named(void **state)
{
    (void)state;
    const refusal cases[] = {
        {"no density", CAROM_DYNAMIC, 0, 1, 0, 0, CAROM_E_ARGUMENT, "density 0 must be positive"},
        {"negative", CAROM_DYNAMIC, -2, 1, 0, 0, CAROM_E_ARGUMENT, "density -2 must be"},
        {"NaN", CAROM_DYNAMIC, NAN, 0, 1, 1, CAROM_E_ARGUMENT, "density"},
        {"infinite", CAROM_DYNAMIC, HUGE_VAL, 0, 1, 1, CAROM_E_ARGUMENT, "density inf"},
        {"overflow", CAROM_DYNAMIC, 1e300, 1e30, 0, 0, CAROM_E_ARGUMENT, "mass inf"},
        {"radius", CAROM_DYNAMIC, 1, NAN, 0, 0, CAROM_E_SHAPE, "body 0, shape 0: "},
        {"width", CAROM_DYNAMIC, 1, 0, -1, 1, CAROM_E_SHAPE, "sides of a box must be positive"},
        {"height", CAROM_STATIC, 1, 0, 1, NAN, CAROM_E_SHAPE, "not 1 by "},
        {"size", CAROM_DYNAMIC, 1, 0, 1, 1e60, CAROM_E_SHAPE, "body 0, shape 0: "},
        {"type", (carom_body_type)9, 1, 1, 0, 0, CAROM_E_ARGUMENT, "unknown type"},
    };
    for (size_t k = 0; k < sizeof cases / sizeof cases[0]; k++) {
        const refusal *c = &cases[k];
        const carom_body_def def = carom_body_at(c->type, 0, 0);
        const int circle = !(c->radius <= 0);
        int index = -7;
        carom_world *w = weightless(NULL);
        const carom_status s =
            circle ? carom_world_add_circle(w, &def, c->radius, c->density, &index)
                   : carom_world_add_box(w, &def, c->width, c->height, c->density, &index);
        if (s != c->status || !strstr(carom_world_error(w), c->said)) {
            fail_msg("%s: %s \"%s\"", c->name, carom_status_name(s), carom_world_error(w));
        }
        assert_int_equal(index, -7);
        assert_int_equal(carom_world_n_bodies(w), 0);
        carom_world_destroy(w);
    }
}

static void expect_refused(const carom_body_def *def, const char *said)
{
    carom_world *w = weightless(NULL);
    const carom_status s = carom_world_add_solid(w, def, 1, NULL);
    if (s >= 0 || !strstr(carom_world_error(w), said)) {
        fail_msg("\"%s\", not \"%s\"", carom_world_error(w), said);
    }
    assert_int_equal(carom_world_n_bodies(w), 0);
    carom_world_destroy(w);
}

static void shapes_must_carry_the_mass(void **state)
{
    (void)state;
    const carom_vec2 ends[2] = {{-1, 0}, {1, 0}};
    const carom_vec2 aside[1] = {{0.5, -0.25}};
    const carom_vec2 twice[3] = {{0, 0}, {0, 0}, {1, 1}};
    carom_shape shape = {0, 2, ends};
    carom_body_def def = carom_body_defaults();
    expect_refused(&def, "body 0: no area");
    def.n_shapes = 1;
    expect_refused(&def, "no shapes given");
    def.shapes = &shape;
    expect_refused(&def, "body 0: no area"); /* a segment */
    shape = (carom_shape){0.1, 1, aside};
    expect_refused(&def, "centroid of its shapes is (0.5, -0.25), not the position");
    shape = (carom_shape){0, 3, twice};
    def.mass = 0; /* not read: the sentence is about the shape */
    expect_refused(&def, "body 0, shape 0: vertex 0");
}

static void no_world_no_body(void **state)
{
    (void)state;
    const carom_body_def def = carom_body_defaults();
    carom_world *w = weightless(NULL);
    assert_int_equal(carom_world_add_circle(NULL, &def, 1, 1, NULL), CAROM_E_ARGUMENT);
    assert_int_equal(carom_world_add_box(NULL, &def, 1, 1, 1, NULL), CAROM_E_ARGUMENT);
    assert_int_equal(carom_world_add_solid(NULL, &def, 1, NULL), CAROM_E_ARGUMENT);
    assert_int_equal(carom_world_add_circle(w, NULL, 1, 1, NULL), CAROM_E_ARGUMENT);
    assert_int_equal(carom_world_add_box(w, NULL, 1, 1, 1, NULL), CAROM_E_ARGUMENT);
    assert_int_equal(carom_world_add_solid(w, NULL, 1, NULL), CAROM_E_ARGUMENT);
    assert_int_equal(carom_world_seal(w), CAROM_OK);
    assert_int_equal(carom_world_add_circle(w, &def, 1, 1, NULL), CAROM_E_STATE);
    carom_world_destroy(w);
}

/* The k-th request fails for k = 0, 1, ... until the body is there. */
static void memory_may_end(void **state)
{
    (void)state;
    const carom_body_def def = carom_body_defaults();
    carom_status s = CAROM_E_MEMORY;
    for (long k = 0; s != CAROM_OK; k++) {
        alloc_fail a = alloc_fail_at(k);
        const carom_allocator memory = alloc_fail_allocator(&a);
        carom_world *w = NULL;
        assert_in_range(k, 0, 100);
        s = carom_world_create(NULL, &memory, &w);
        if (s == CAROM_OK) s = carom_world_add_box(w, &def, 1, 1, 1, NULL);
        if (s != CAROM_OK) assert_int_equal(s, CAROM_E_MEMORY);
        carom_world_destroy(w);
        assert_int_equal(a.live, 0);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(circle_has_its_closed_form),
        cmocka_unit_test(box_has_its_closed_form),
        cmocka_unit_test(shapes_add_up),
        cmocka_unit_test(shapes_lie_around_the_position),
        cmocka_unit_test(refusals_are_named),
        cmocka_unit_test(shapes_must_carry_the_mass),
        cmocka_unit_test(no_world_no_body),
        cmocka_unit_test(memory_may_end),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
