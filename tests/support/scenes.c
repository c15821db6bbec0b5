#include "scenes.h"

#include "near.h"

#include <stdlib.h>
#include <string.h>

carom_integrator scene_integrator = CAROM_EULER;
int scene_order = 2;
int scene_events = 0;
double scene_tolerance = 0;

static void must(carom_world *w, carom_status e)
{
    if (e < 0) fail_msg("%s: %s", carom_status_name(e), carom_world_error(w));
}

static int worlds_with(carom_integrator integrator, int order)
{
    scene_integrator = integrator;
    scene_order = order;
    return 0;
}

int scene_euler(void **state)
{
    (void)state;
    return worlds_with(CAROM_EULER, 2);
}

int scene_located(void **state)
{
    (void)state;
    return worlds_with(CAROM_LOCATED, 2);
}

int scene_fixed(void **state)
{
    (void)state;
    return worlds_with(CAROM_FIXED, 2);
}

int scene_order_4(void **state)
{
    (void)state;
    return worlds_with(CAROM_LOCATED, 4);
}

carom_world *scene_world(double g, double dt)
{
    carom_world_settings s = carom_world_defaults();
    carom_world *w = NULL;
    s.gravity[1] = -g;
    s.dt = dt;
    s.integrator = (int)scene_integrator;
    s.order = scene_order;
    s.tolerance = scene_tolerance;
    s.events = scene_events;
    assert_int_equal(carom_world_create(&s, NULL, &w), CAROM_OK);
    return w;
}

static int add_box(carom_world *w, carom_body_def *d, double hx, double hy)
{
    const carom_vec2 corners[4] = {{-hx, -hy}, {hx, -hy}, {hx, hy}, {-hx, hy}};
    const carom_shape shape = {0, 4, corners};
    int index = -1;
    d->n_shapes = 1;
    d->shapes = &shape;
    must(w, carom_world_add_body(w, d, &index));
    return index;
}

int scene_floor(carom_world *w, double friction, double restitution)
{
    carom_body_def d = carom_body_defaults();
    d.type = CAROM_STATIC;
    d.pose.y = -1;
    d.friction = friction;
    d.restitution = restitution;
    return add_box(w, &d, 20, 1);
}

int scene_belt(carom_world *w, double speed, double friction)
{
    carom_body_def d = carom_body_at(CAROM_KINEMATIC, 0, -1);
    d.velocity[1] = speed;
    d.friction = friction;
    return add_box(w, &d, 20, 1);
}

int scene_box(carom_world *w, double mass, double hx, double hy, carom_pose pose, double friction,
              double restitution)
{
    carom_body_def d = carom_body_defaults();
    d.mass = mass;
    d.inertia = mass * (hx * hx + hy * hy) / 3;
    d.pose = pose;
    d.friction = friction;
    d.restitution = restitution;
    return add_box(w, &d, hx, hy);
}

int scene_disc(carom_world *w, double mass, double radius, double x, double y, double friction,
               double restitution)
{
    const carom_vec2 center = {0, 0};
    const carom_shape shape = {radius, 1, &center};
    carom_body_def d = carom_body_defaults();
    int index = -1;
    d.mass = mass;
    d.inertia = 0.5 * mass * radius * radius;
    d.pose.x = x;
    d.pose.y = y;
    d.friction = friction;
    d.restitution = restitution;
    d.n_shapes = 1;
    d.shapes = &shape;
    must(w, carom_world_add_body(w, &d, &index));
    return index;
}

int scene_anchor(carom_world *w)
{
    carom_body_def d = carom_body_defaults();
    int index = -1;
    d.type = CAROM_STATIC;
    must(w, carom_world_add_body(w, &d, &index));
    return index;
}

void scene_push(carom_world *w, int body, double omega, double vx, double vy)
{
    const int n = 3 * carom_world_n_bodies(w);
    double *v = malloc((size_t)n * sizeof *v);
    assert_non_null(v);
    memcpy(v, carom_world_v(w), (size_t)n * sizeof *v);
    v[3 * body] = omega;
    v[3 * body + 1] = vx;
    v[3 * body + 2] = vy;
    must(w, carom_world_set_state(w, NULL, v));
    free(v);
}

int scene_ladder(carom_world *w)
{
    const carom_vec2 wall[4] = {{-1, -5}, {0, -5}, {0, 5}, {-1, 5}};
    const carom_shape shape = {0, 4, wall};
    const double a = 0.5;
    const double c = 1e-3;
    carom_body_def d = carom_body_defaults();
    d.type = CAROM_STATIC;
    d.shapes = &shape;
    d.n_shapes = 1;
    d.friction = 0;
    assert_int_equal(carom_world_add_body(w, &d, NULL), CAROM_OK);
    scene_floor(w, 0, 0);
    /* its lowest corner on the floor, its leftmost on the wall */
    const carom_pose pose = {a, c * cos(a) + sin(a), c * sin(a) + cos(a)};
    return scene_box(w, 1, c, 1, pose, 0, 0);
}

int scene_roll_off(carom_world *w)
{
    const carom_vec2 center = {0, 0};
    const carom_shape round = {1, 1, &center};
    carom_body_def d = carom_body_defaults();
    d.type = CAROM_STATIC;
    d.shapes = &round;
    d.n_shapes = 1;
    d.friction = 0.9;
    assert_int_equal(carom_world_add_body(w, &d, NULL), CAROM_OK);
    return scene_disc(w, 1, 0.3, 1.3 * sin(0.3), 1.3 * cos(0.3), 0.9, 0);
}

int scene_rocking(carom_world *w)
{
    scene_floor(w, 0.9, 0);
    const carom_pose pose = {0.15, 0, 0.2 * sin(0.15) + 0.5 * cos(0.15)};
    return scene_box(w, 1, 0.2, 0.5, pose, 0.9, 0);
}

int scene_landing(carom_world *w)
{
    static const double angles[2] = {1.2, 1.5};
    carom_vec2 pin = {0, 1.3};
    scene_floor(w, 0.3, 0.5);
    int last = scene_anchor(w);
    for (int k = 0; k < 2; k++) {
        const double a = angles[k];
        const carom_pose pose = {a, pin.x + 0.5 * sin(a), pin.y - 0.5 * cos(a)};
        const int b = scene_box(w, 1, 0.05, 0.5, pose, 0.3, 0.5);
        assert_int_equal(carom_world_add_revolute(w, last, b, pin, NULL), CAROM_OK);
        pin.x += sin(a);
        pin.y -= cos(a);
        last = b;
    }
    return last;
}

int scene_links(carom_world *w, int n)
{
    carom_vec2 pin = {0, 0};
    int last = scene_anchor(w);
    for (int k = 0; k < n; k++) {
        const double a = 1 + 0.2 * k;
        const carom_pose pose = {a, pin.x + 0.5 * sin(a), pin.y - 0.5 * cos(a)};
        const int b = scene_box(w, 1, 0.05, 0.5, pose, 0, 0);
        assert_int_equal(carom_world_add_revolute(w, last, b, pin, NULL), CAROM_OK);
        pin.x += sin(a);
        pin.y -= cos(a);
        last = b;
    }
    return last;
}

void scene_run(carom_world *w, int n, carom_step_stats *last)
{
    carom_step_stats s = {0};
    for (int k = 0; k < n; k++) must(w, carom_world_step(w, NULL, &s));
    if (last) *last = s;
}
