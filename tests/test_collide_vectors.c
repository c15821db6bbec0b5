/* carom_collide against tests/data/geometry/vectors.json: 60-digit references, printed as the
 * nearest doubles.  Distances must be within 1e-13 of the pair's size, normals within the vector's
 * own normal_tol, manifolds are compared as sets. */
#include "carom/collide.h"
#include "near.h"

#include <float.h>
#include <jansson.h>
#include <string.h>

enum { MAX_VERTICES = 64 };

typedef struct subject {
    carom_shape shape;
    carom_vec2 vertices[MAX_VERTICES];
    carom_pose pose;
} subject;

static double number(const json_t *object, const char *key)
{
    const json_t *v = json_object_get(object, key);
    if (!json_is_number(v)) fail_msg("no number '%s'", key);
    return json_number_value(v);
}

static int truth(const json_t *object, const char *key)
{
    const json_t *v = json_object_get(object, key);
    if (!json_is_boolean(v)) fail_msg("no boolean '%s'", key);
    return json_is_true(v);
}

static carom_vec2 point(const json_t *pair)
{
    const carom_vec2 p = {json_number_value(json_array_get(pair, 0)),
                          json_number_value(json_array_get(pair, 1))};
    return p;
}

static void read_subject(const json_t *shape, const json_t *pose, subject *s)
{
    const json_t *vertices = json_object_get(shape, "vertices");
    memset(s, 0, sizeof *s);
    s->shape.vertices = s->vertices;
    if (vertices) {
        s->shape.count = (int)json_array_size(vertices);
        assert_true(s->shape.count <= MAX_VERTICES);
        for (int i = 0; i < s->shape.count; i++) {
            s->vertices[i] = point(json_array_get(vertices, (size_t)i));
        }
    } else {
        s->shape.count = 1;
        s->shape.radius = number(shape, "radius");
    }
    s->pose.angle = json_number_value(json_array_get(pose, 0));
    s->pose.x = json_number_value(json_array_get(pose, 1));
    s->pose.y = json_number_value(json_array_get(pose, 2));
}

static double angle_between(carom_vec2 a, carom_vec2 b)
{
    return atan2(fabs(a.x * b.y - a.y * b.x), a.x * b.x + a.y * b.y);
}

/* The accepted normal is the vector's own, so points may be compared. */
static int check_normal(const char *name, const json_t *v, const carom_manifold *m)
{
    assert_near_case(name, -1, hypot(m->normal.x, m->normal.y), 1.0, 4 * DBL_EPSILON);
    if (!truth(v, "normal_defined")) {
        if (!m->ambiguous) fail_msg("%s: the normal is undefined but not flagged", name);
        return 0;
    }
    const double tol = number(v, "normal_tol");
    if (angle_between(m->normal, point(json_object_get(v, "normal"))) <= tol) return 1;
    const json_t *others = json_object_get(v, "normals_ok");
    for (size_t i = 0; i < json_array_size(others); i++) {
        if (angle_between(m->normal, point(json_array_get(others, i))) <= tol) return 0;
    }
    fail_msg("%s: normal (%.17g, %.17g) is off by %g, limit %g", name, m->normal.x, m->normal.y,
             angle_between(m->normal, point(json_object_get(v, "normal"))), tol);
    return 0;
}

static double distance_to(carom_vec2 arm, carom_pose pose, carom_vec2 world)
{
    return fmax(fabs(world.x - pose.x - arm.x), fabs(world.y - pose.y - arm.y));
}

/* Largest deviation of a contact point from a reference point. */
static double deviation(const subject s[2], const carom_contact_point *p, const json_t *reference)
{
    double d = distance_to(p->arm_a, s[0].pose, point(json_object_get(reference, "pA")));
    d = fmax(d, distance_to(p->arm_b, s[1].pose, point(json_object_get(reference, "pB"))));
    const json_t *gap = json_object_get(reference, "s");
    return gap ? fmax(d, fabs(p->gap - json_number_value(gap))) : d;
}

/* References are world points rounded to doubles; circles add the normal's error on their radius.
 */
static double point_tolerance(const json_t *v, const subject s[2])
{
    const double far = fmax(fmax(fabs(s[0].pose.x), fabs(s[0].pose.y)),
                            fmax(fabs(s[1].pose.x), fabs(s[1].pose.y)));
    return number(v, "tol_relative_frame") + DBL_EPSILON * far +
           number(v, "normal_tol") * fmax(s[0].shape.radius, s[1].shape.radius);
}

static void check_points(const char *name, const json_t *v, const subject s[2],
                         const carom_manifold *m)
{
    const json_t *points = json_object_get(v, "manifold");
    const double tol = point_tolerance(v, s);
    if (m->count != (int)json_array_size(points)) {
        fail_msg("%s: %d points, expected %d", name, m->count, (int)json_array_size(points));
    }
    const json_t *first = json_array_get(points, 0);
    const int crossed =
        m->count == 2 && deviation(s, &m->points[0], first) > deviation(s, &m->points[1], first);
    for (int i = 0; i < m->count; i++) {
        const json_t *reference = json_array_get(points, (size_t)(crossed ? 1 - i : i));
        assert_near_case(name, i, deviation(s, &m->points[i], reference), 0.0, tol);
    }
    if (!truth(v, "closest_unique") || m->count == 0) return;
    const int deepest = m->count == 2 && m->points[1].gap < m->points[0].gap;
    assert_near_case(name, 9, deviation(s, &m->points[deepest], v), 0.0, tol);
}

static carom_manifold mirrored(carom_manifold m)
{
    m.normal.x = -m.normal.x;
    m.normal.y = -m.normal.y;
    for (int i = 0; i < m.count; i++) {
        const carom_vec2 arm = m.points[i].arm_a;
        m.points[i].arm_a = m.points[i].arm_b;
        m.points[i].arm_b = arm;
    }
    return m;
}

static void check_manifold(const char *name, const json_t *v, const subject s[2],
                           const carom_manifold *m)
{
    assert_near_case(name, 0, m->distance, number(v, "distance"), number(v, "tol_relative_frame"));
    const int same_normal = check_normal(name, v, m);
    if (same_normal) check_points(name, v, s, m);
}

static void vectors_hold(void **state)
{
    const json_t *vectors = json_object_get(*state, "vectors");
    assert_int_equal(json_array_size(vectors), 183);
    for (size_t i = 0; i < json_array_size(vectors); i++) {
        const json_t *v = json_array_get(vectors, i);
        char name[120];
        subject s[2];
        snprintf(name, sizeof name, "vector %d (%s)", (int)number(v, "id"),
                 json_string_value(json_object_get(v, "category")));
        read_subject(json_object_get(v, "A"), json_object_get(v, "poseA"), &s[0]);
        read_subject(json_object_get(v, "B"), json_object_get(v, "poseB"), &s[1]);
        assert_int_equal(carom_shape_check(&s[0].shape, NULL), CAROM_OK);
        assert_int_equal(carom_shape_check(&s[1].shape, NULL), CAROM_OK);
        carom_manifold m = carom_collide(&s[0].shape, s[0].pose, &s[1].shape, s[1].pose, HUGE_VAL);
        check_manifold(name, v, s, &m);
        strcat(name, ", swapped");
        m = mirrored(carom_collide(&s[1].shape, s[1].pose, &s[0].shape, s[0].pose, HUGE_VAL));
        check_manifold(name, v, s, &m);
    }
}

static int load(void **state)
{
    json_error_t error;
    *state = json_load_file(TEST_DATA "/geometry/vectors.json", 0, &error);
    if (!*state) print_error("%s, line %d: %s\n", error.source, error.line, error.text);
    return *state ? 0 : -1;
}

static int unload(void **state)
{
    json_decref(*state);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(vectors_hold)};
    return cmocka_run_group_tests(tests, load, unload);
}
