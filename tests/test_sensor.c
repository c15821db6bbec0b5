/* Sensors, which touch nothing and are told what overlaps them, and pairs that never collide. */
#include "near.h"
#include "scenes.h"

#include "carom/world_query.h"

#include <string.h>

static int add_disc(carom_world *w, carom_body_type type, int sensor, double radius, double x,
                    double y)
{
    const carom_vec2 v = {0, 0};
    const carom_shape disc = {radius, 1, &v};
    carom_body_def d = carom_body_defaults();
    int index = -1;
    d.type = type;
    d.sensor = sensor;
    d.n_shapes = 1;
    d.shapes = &disc;
    d.pose.x = x;
    d.pose.y = y;
    assert_int_equal(carom_world_add_body(w, &d, &index), CAROM_OK);
    return index;
}

/* A box falls through a sensor onto the floor: as if the sensor were not there, bit for bit. */
static void sensors_touch_nothing(void **state)
{
    (void)state;
    carom_world *w[2];
    const carom_pose start = {0.1, 0, 3};
    for (int k = 0; k < 2; k++) {
        w[k] = scene_world(9.81, 0.01);
        scene_floor(w[k], 0.5, 0.3);
        scene_box(w[k], 1, 0.5, 0.5, start, 0.5, 0.3);
        if (k) add_disc(w[k], CAROM_STATIC, 1, 1, 0, 2.5); /* the box starts in it */
        if (k) add_disc(w[k], CAROM_KINEMATIC, 1, 5, 0, 0);
    }
    carom_query *q;
    int n_inside = 0;
    assert_int_equal(carom_query_create(w[1], NULL, &q), CAROM_OK);
    for (int k = 0; k < 100; k++) {
        carom_step_stats s[2];
        const carom_sensor_overlap *list;
        int n;
        for (int i = 0; i < 2; i++) {
            assert_true(carom_world_step(w[i], NULL, &s[i]) >= 0);
        }
        assert_memory_equal(carom_world_q(w[0]), carom_world_q(w[1]), 6 * sizeof(double));
        assert_int_equal(s[0].n_contacts, s[1].n_contacts);
        assert_int_equal(s[0].n_candidates, s[1].n_candidates);
        assert_int_equal(carom_query_refresh(q), CAROM_OK);
        assert_int_equal(carom_query_sensors(q, &n, &list), CAROM_OK);
        /* The small sensor has the box until it is out of reach; the large one has floor and box,
         * and the small sensor, which has the smaller number: listed there. */
        const int inside = list[0].sensor.body == 2 && list[0].other.body == 1;
        n_inside += inside;
        assert_int_equal(n, inside + 3);
        assert_int_equal(list[inside].sensor.body, 2);
        assert_int_equal(list[inside].other.body, 3);
        assert_int_equal(list[inside + 1].sensor.body, 3);
        assert_int_equal(list[inside + 1].other.body, 0);
        assert_int_equal(list[inside + 2].other.body, 1);
    }
    assert_true(n_inside > 10 && n_inside < 90);
    carom_query_destroy(q);
    carom_world_destroy(w[0]);
    carom_world_destroy(w[1]);
}

/* Joined, excluded, filtered, idle, static: not sensed. */
static void what_sensors_sense(void **state)
{
    (void)state;
    carom_world *w = scene_world(0, 0.01);
    const carom_vec2 origin = {0, 0};
    const int sensor = add_disc(w, CAROM_STATIC, 1, 5, 0, 0);
    const int felt = add_disc(w, CAROM_DYNAMIC, 0, 0.1, -3, 0);
    const int joint = add_disc(w, CAROM_DYNAMIC, 0, 0.1, -2, 0);
    const int excluded = add_disc(w, CAROM_DYNAMIC, 0, 0.1, -1, 0);
    add_disc(w, CAROM_STATIC, 0, 0.1, 0, 0);
    add_disc(w, CAROM_DYNAMIC, 0, 0.1, 1, 5.2); /* just outside */
    carom_body_def d = carom_body_defaults();
    const carom_vec2 v[2] = {{2, 0}, {2, 1}};
    const carom_shape two[2] = {{0.1, 1, &v[0]}, {0.1, 1, &v[1]}};
    d.n_shapes = 2;
    d.shapes = two;
    int both = -1;
    assert_int_equal(carom_world_add_body(w, &d, &both), CAROM_OK);
    d.pose.x = 1;
    d.collide = 0;
    assert_int_equal(carom_world_add_body(w, &d, NULL), CAROM_OK);
    d.pose.x = -1;
    d.collide = 1;
    d.filter.mask = 2;
    assert_int_equal(carom_world_add_body(w, &d, NULL), CAROM_OK);
    assert_int_equal(carom_world_add_revolute(w, sensor, joint, origin, NULL), CAROM_OK);
    assert_int_equal(carom_world_exclude(w, excluded, sensor), CAROM_OK);
    assert_int_equal(carom_world_seal(w), CAROM_OK);
    carom_query *q;
    const carom_sensor_overlap *list;
    int n;
    assert_int_equal(carom_query_create(w, NULL, &q), CAROM_OK);
    assert_int_equal(carom_query_refresh(q), CAROM_OK);
    assert_int_equal(carom_query_sensors(q, &n, &list), CAROM_OK);
    assert_int_equal(n, 3);
    for (int k = 0; k < 3; k++) {
        const carom_found f = {k ? both : felt, k == 2};
        assert_int_equal(list[k].sensor.body, sensor);
        assert_int_equal(list[k].other.body, f.body);
        assert_int_equal(list[k].other.shape, f.shape);
    }
    carom_query_destroy(q);
    carom_world_destroy(w);
}

/* Two discs on one line: excluded they pass through each other, both still hit the third. */
static void excluded_pairs_pass(void **state)
{
    (void)state;
    for (int excluded = 0; excluded < 2; excluded++) {
        carom_world *w = scene_world(0, 0.01);
        for (int k = 0; k < 3; k++) scene_disc(w, 1, 0.5, k == 2 ? 5 : 2 * k, 0, 0, 0);
        if (excluded) {
            assert_int_equal(carom_world_exclude(w, 1, 0), CAROM_OK);
            assert_int_equal(carom_world_exclude(w, 0, 1), CAROM_OK); /* twice is once */
        }
        scene_push(w, 0, 0, 1, 0);
        scene_run(w, 450, NULL);
        const double *v = carom_world_v(w);
        /* Inelastic: the first stops at the second, or goes through it and stops at the third. */
        assert_near(v[1], 0.5, 1e-9);
        assert_near(v[4], excluded ? 0 : 0.5, 1e-9);
        assert_near(v[7], excluded ? 0.5 : 0, 1e-9);
        carom_world_destroy(w);
    }
}

static void refuses_exclusions(void **state)
{
    (void)state;
    carom_world *w = scene_world(0, 0.01);
    for (int k = 0; k < 9; k++) scene_disc(w, 1, 0.5, 2.0 * k, 0, 0, 0);
    assert_int_equal(carom_world_exclude(NULL, 0, 1), CAROM_E_ARGUMENT);
    assert_int_equal(carom_world_exclude(w, 0, 9), CAROM_E_ARGUMENT);
    assert_non_null(strstr(carom_world_error(w), "no body 9"));
    assert_int_equal(carom_world_exclude(w, -1, 2), CAROM_E_ARGUMENT);
    assert_int_equal(carom_world_exclude(w, 3, 3), CAROM_E_ARGUMENT);
    for (int a = 8; a >= 0; a--) {
        for (int b = 0; b < a; b++) assert_int_equal(carom_world_exclude(w, a, b), CAROM_OK);
    }
    assert_int_equal(carom_world_seal(w), CAROM_OK);
    assert_int_equal(carom_world_exclude(w, 0, 1), CAROM_E_STATE);
    carom_world_destroy(w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sensors_touch_nothing),
        cmocka_unit_test(what_sensors_sense),
        cmocka_unit_test(excluded_pairs_pass),
        cmocka_unit_test(refuses_exclusions),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
