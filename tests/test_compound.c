/* Bodies of several shapes, each at its place in the body's frame. */
#include "near.h"
#include "scenes.h"

#include "carom/carom.h"

#include <float.h>
#include <string.h>

static const double G = 9.81;
static const double DT = 0.01;

static carom_shape box_at(double hx, double hy, carom_pose offset, carom_vec2 *v)
{
    const carom_vec2 corners[4] = {{-hx, -hy}, {hx, -hy}, {hx, hy}, {-hx, hy}};
    carom_vertices_place(4, corners, offset, v);
    const carom_shape s = {0, 4, v};
    return s;
}

/* A table: a top 4 x 0.4 around the origin and two legs 0.4 x 1 below its ends.  Its feet are 1.2
 * below the origin. */
static int add_table(carom_world *w, double mass, carom_pose pose)
{
    carom_vec2 v[3][4];
    const carom_pose middle = {0, 0, 0};
    const carom_pose left = {0, -1.8, -0.7};
    const carom_pose right = {3.14159265358979323846, 1.8, -0.7};
    const carom_shape shapes[3] = {box_at(2, 0.2, middle, v[0]), box_at(0.2, 0.5, left, v[1]),
                                   box_at(0.2, 0.5, right, v[2])};
    carom_body_def d = carom_body_defaults();
    int index = -1;
    d.mass = mass;
    d.inertia = 2 * mass;
    d.pose = pose;
    d.n_shapes = 3;
    d.shapes = shapes;
    assert_int_equal(carom_world_add_body(w, &d, &index), CAROM_OK);
    return index;
}

/* Impulses on a body over the last step [N s]. */
static carom_vec2 impulse_on(const carom_world *w, int body)
{
    carom_vec2 sum = {0, 0};
    for (int k = 0; k < carom_world_n_contacts(w); k++) {
        const carom_contact_info c = carom_world_contact(w, k);
        const double sign = (c.body_b == body) - (c.body_a == body);
        sum.x += sign * (c.ln * c.normal.x - c.lt * c.normal.y);
        sum.y += sign * (c.ln * c.normal.y + c.lt * c.normal.x);
    }
    return sum;
}

/* The table stands on its legs, a box lies on it: four feet and two corners carry the weights. */
static void table_stands(void **state)
{
    (void)state;
    carom_world *w = scene_world(G, DT);
    carom_step_stats s;
    const carom_pose at = {0, 0, 1.2};
    const carom_pose above = {0, 0.5, 1.2 + 0.2 + 0.3};
    scene_floor(w, 0.5, 0);
    const int table = add_table(w, 3, at);
    const int box = scene_box(w, 2, 0.3, 0.3, above, 0.5, 0);
    scene_run(w, 100, &s);
    assert_int_equal(s.n_contacts, 6);
    const double *q = carom_world_q(w);
    /* Overlap of the margin's share, 1e-6 L with L = 4 at most. */
    assert_near(q[3 * table + 2], 1.2, 1e-5);
    assert_near(q[3 * table], 0, 1e-5);
    assert_near(q[3 * box + 2], 1.7, 1e-5);
    assert_near(impulse_on(w, table).y, 3 * G * DT, 1e-9);
    assert_near(impulse_on(w, box).y, 2 * G * DT, 1e-9);
    carom_world_destroy(w);
}

/* Both legs of a table that falls level meet the floor at once; the shapes of one body do not
 * collide with each other though they touch. */
static void table_falls(void **state)
{
    (void)state;
    carom_world *w = scene_world(G, DT);
    const carom_pose at = {0, 0, 2.2};
    scene_floor(w, 0, 0);
    const int table = add_table(w, 1, at);
    scene_run(w, 40, NULL); /* t = 0.4: fallen by 0.78 of 1 */
    assert_int_equal(carom_world_n_contacts(w), 0);
    scene_run(w, 60, NULL);
    const double *q = carom_world_q(w);
    const double *v = carom_world_v(w);
    assert_near(q[3 * table + 2], 1.2, 1e-5);
    assert_near(q[3 * table], 0, 1e-9);
    assert_near(v[3 * table + 2], 0, 1e-9);
    carom_world_destroy(w);
}

/* A body of two discs at +-1 is in the reach of a third through either: which one, and where. */
static void dumbbell_is_found(void **state)
{
    (void)state;
    carom_world *w = scene_world(0, DT);
    const carom_vec2 v[2] = {{-1, 0}, {1, 0}};
    const carom_shape two[2] = {{0.5, 1, &v[0]}, {0.5, 1, &v[1]}};
    carom_body_def d = carom_body_defaults();
    d.n_shapes = 2;
    d.shapes = two;
    d.pose.angle = 1.5707963267948966; /* the second is above */
    int dumbbell = -1;
    assert_int_equal(carom_world_add_body(w, &d, &dumbbell), CAROM_OK);
    carom_query *q;
    const carom_vec2 origin = {-3, 1};
    const carom_vec2 along = {6, 0};
    carom_ray_found hit;
    assert_int_equal(carom_query_create(w, NULL, &q), CAROM_OK);
    assert_int_equal(carom_query_refresh(q), CAROM_OK);
    assert_int_equal(carom_query_ray(q, NULL, origin, along, &hit), CAROM_OK);
    assert_int_equal(hit.who.body, dumbbell);
    assert_int_equal(hit.who.shape, 1);
    assert_near(hit.at.enter, 2.5 / 6, 4 * DBL_EPSILON);
    carom_query_destroy(q);
    carom_world_destroy(w);
}

/* Errors name body, shape and vertex. */
static void faults_are_named(void **state)
{
    (void)state;
    carom_world *w = scene_world(0, DT);
    const carom_vec2 good[3] = {{0, 0}, {1, 0}, {0, 1}};
    const carom_vec2 bad[4] = {{0, 0}, {1, 0}, {1, 0}, {0, 1}};
    const carom_shape shapes[3] = {{0, 3, good}, {0.5, 1, good}, {0, 4, bad}};
    carom_body_def d = carom_body_defaults();
    d.n_shapes = 3;
    d.shapes = shapes;
    assert_int_equal(carom_world_add_body(w, &d, NULL), CAROM_E_SHAPE);
    assert_non_null(strstr(carom_world_error(w), "body 0, shape 2: vertex 1: equal"));
    carom_world_destroy(w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(table_stands),
        cmocka_unit_test(table_falls),
        cmocka_unit_test(dumbbell_is_found),
        cmocka_unit_test(faults_are_named),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
