#include "problems.h"

#include <stdio.h>
#include <stdlib.h>

/* Shared with peers.py: a disc of 1 kg, radius 0.5 m, above a floor at y = 0. */
static const double G = 9.81;
static const double R = 0.5;
enum { FLOOR, DISC, ANGLE = 0, X = 1, Y = 2 };

typedef struct start {
    double gravity, y, vx, vy, friction, restitution;
    int turns; /* 0: the disc is held upright */
} start;

static void must(carom_world *w, carom_status e)
{
    if (e >= 0) return;
    fprintf(stderr, "bench_gradient: %s: %s\n", carom_status_name(e), carom_world_error(w));
    exit(1);
}

static void hold_upright(carom_world *w)
{
    carom_joint_def j = carom_joint_defaults(CAROM_LOCK_ANGLE);
    j.body_a = FLOOR;
    j.body_b = DISC;
    j.collide = 1;
    must(w, carom_world_add_joint(w, &j, NULL));
}

static carom_world *build(double dt, const start *s)
{
    carom_world_settings set = carom_world_defaults();
    carom_world *w = NULL;
    carom_body_def floor = carom_body_at(CAROM_STATIC, 0, -1);
    carom_body_def disc = carom_body_at(CAROM_DYNAMIC, 0, s->y);
    const carom_vec2 corners[4] = {{-50, -1}, {50, -1}, {50, 1}, {-50, 1}};
    const carom_vec2 center = {0, 0};
    const carom_shape box = {0, 4, corners};
    const carom_shape circle = {R, 1, &center};
    set.dt = dt;
    set.gravity[1] = -s->gravity;
    must(NULL, carom_world_create(&set, NULL, &w));
    floor.n_shapes = disc.n_shapes = 1;
    floor.shapes = &box;
    disc.shapes = &circle;
    disc.mass = 1;
    disc.inertia = 0.5 * R * R;
    disc.velocity[1] = s->vx;
    disc.velocity[2] = s->vy;
    floor.friction = disc.friction = s->friction;
    floor.restitution = disc.restitution = s->restitution;
    must(w, carom_world_add_body(w, &floor, NULL));
    must(w, carom_world_add_body(w, &disc, NULL));
    if (!s->turns) hold_upright(w);
    must(w, carom_world_seal(w));
    return w;
}

/* Slides to a stop: x = v0^2/(2 mu g). */
static carom_world *stop(double dt)
{
    const start s = {G, R, 3, 0, 0.5, 0, 0};
    return build(dt, &s);
}

/* Falls by h, hits with v_n = sqrt(2 g h), slides on with v0 - mu v_n to a stop:
 * x = v0 v_n/g + (v0 - mu v_n)^2/(2 mu g), so that dx/dh = mu. */
static carom_world *drop(double dt)
{
    const start s = {G, R + 0.3, 4, 0, 0.5, 0, 0};
    return build(dt, &s);
}

/* No gravity, e = 0; sticks at the floor, so that its spin takes a third of its speed:
 * x = v T - (v/3) (T - t1), t1 = (y0 - r)/v_n. */
static carom_world *oblique(double dt)
{
    const start s = {0, R + 0.6, 1, -2, 0.8, 0, 1};
    return build(dt, &s);
}

/* No gravity: y(T) = r + e v T - e (y0 - r). */
static carom_world *bounce(double dt)
{
    const start s = {0, R + 0.6, 0, -2, 0, 0.7, 1};
    return build(dt, &s);
}

const problem problems[N_PROBLEMS] = {
    {"sliding stop", "v0", stop, 1, X, -1, X, 0, 0, 0, 3 / (0.5 * 9.81)},
    {"sliding stop", "mu", stop, 1, X, -1, -1, 1, 0, 0.5, -9 / (2 * 0.25 * 9.81)},
    {"drop and slide", "h", drop, 1.5, X, Y, -1, 0, 0, 0, 0.5},
    {"oblique impact", "h", oblique, 1, X, Y, -1, 0, 0, 0, 1.0 / 3 / 2},
    {"oblique impact", "v0", oblique, 1, X, -1, X, 0, 0, 0, 1 - 0.7 / 3},
    {"wall bounce", "h", bounce, 1, Y, Y, -1, 0, 0, 0, -0.7},
    {"wall bounce", "e", bounce, 1, Y, -1, -1, 0, 1, 0.7, 2 - 0.6},
};
