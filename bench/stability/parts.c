/* parts.c: scenes from parts. */
#include "trial.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double PI = 3.14159265358979323846;

trial trial_new(double gravity, double dt, double duration)
{
    trial t;
    memset(&t, 0, sizeof t);
    t.s.gravity = gravity;
    t.s.dt = dt;
    t.s.n_steps = (int)(duration / dt + 0.5);
    t.passive = 1;
    t.tolerance = 1e-6;
    t.rough = 0.05;
    t.probe = -1;
    return t;
}

void trial_free(trial *t)
{
    free_scene(&t->s);
}

static int add(trial *t, scene_body b)
{
    scene *s = &t->s;
    if (s->n_bodies == s->max_bodies) {
        s->max_bodies = 2 * s->max_bodies + 16;
        s->bodies = realloc(s->bodies, (size_t)s->max_bodies * sizeof *s->bodies);
        s->polygons = realloc(s->polygons, (size_t)s->max_bodies * sizeof *s->polygons);
        if (!s->bodies || !s->polygons) abort();
    }
    s->bodies[s->n_bodies] = b;
    memset(&s->polygons[s->n_bodies], 0, sizeof *s->polygons);
    return s->n_bodies++;
}

int trial_disc(trial *t, double x, double y, double r, double friction, double restitution)
{
    const double m = PI * r * r;
    const scene_body b = {SCENE_DYNAMIC,   SHAPE_DISC, r,          r, {0, x, y}, {0, 0, 0}, m,
                          0.5 * m * r * r, friction,   restitution};
    return add(t, b);
}

int trial_box(trial *t, double x, double y, double angle, double hx, double hy, double friction)
{
    const double m = 4 * hx * hy;
    const scene_body b = {SCENE_DYNAMIC, SHAPE_BOX, hx, hy,
                          {angle, x, y}, {0, 0, 0}, m,  m * (hx * hx + hy * hy) / 3,
                          friction,      0};
    return add(t, b);
}

static void set_corners(trial *t, int k, int n, const carom_vec2 *corners, carom_vec2 center)
{
    scene_polygon *p = &t->s.polygons[k];
    p->n = n;
    p->corners = calloc((size_t)n, sizeof *p->corners);
    if (!p->corners) abort();
    for (int i = 0; i < n; i++) {
        p->corners[i][0] = corners[i].x - center.x;
        p->corners[i][1] = corners[i].y - center.y;
        const double reach = hypot(p->corners[i][0], p->corners[i][1]);
        if (reach > t->s.bodies[k].hx) t->s.bodies[k].hx = reach;
    }
}

int trial_polygon(trial *t, double x, double y, double angle, int n, const carom_vec2 *corners,
                  double friction)
{
    const carom_shape shape = {0, n, corners};
    const carom_mass_properties m = carom_shape_mass(&shape, 1);
    const scene_body b = {SCENE_DYNAMIC, SHAPE_POLYGON, 0,         0,        {angle, x, y},
                          {0, 0, 0},     m.mass,        m.inertia, friction, 0};
    const int k = add(t, b);
    set_corners(t, k, n, corners, m.centroid);
    return k;
}

int trial_floor(trial *t, double half, double friction, double restitution)
{
    const int k = trial_box(t, 0, -half / 2, 0, half, half / 2, friction);
    trial_fix(t, k);
    t->s.bodies[k].restitution = restitution;
    return k;
}

int trial_anchor(trial *t)
{
    const int k = trial_box(t, 0, 0, 0, 1, 1, 0);
    trial_fix(t, k);
    t->s.bodies[k].shape = SHAPE_NONE;
    return k;
}

void trial_fix(trial *t, int body)
{
    t->s.bodies[body].moves = SCENE_STATIC;
}

void trial_weigh(trial *t, int body, double times)
{
    t->s.bodies[body].mass *= times;
    t->s.bodies[body].inertia *= times;
}

void trial_pin(trial *t, int a, int b, double x, double y)
{
    add_pin(&t->s, a, b, x, y);
}

carom_joint_def *trial_joint(trial *t, carom_joint_kind kind, int a, int b, double x, double y)
{
    if (t->n_joints == MAX_TRIAL_JOINTS) abort();
    carom_joint_def *d = &t->joints[t->n_joints++];
    *d = carom_joint_defaults(kind);
    d->body_a = a;
    d->body_b = b;
    d->anchor.x = x;
    d->anchor.y = y;
    return d;
}

void trial_shift(trial *t, double x, double y)
{
    for (int k = 0; k < t->s.n_bodies; k++) {
        t->s.bodies[k].q[1] += x;
        t->s.bodies[k].q[2] += y;
    }
    for (int k = 0; k < t->s.n_pins; k++) {
        t->s.pins[k].x += x;
        t->s.pins[k].y += y;
    }
}
