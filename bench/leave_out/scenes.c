#include "scenes.h"

#include "carom/events.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

/* A number that is there and does nothing. */
static const double NEXT_TO_NOTHING = 1e-12;

static void must(const carom_world *w, carom_status e)
{
    if (e >= 0) return;
    fprintf(stderr, "bench_leave_out: %s: %s\n", carom_status_name(e), carom_world_error(w));
    exit(1);
}

static carom_world *world_of(carom_integrator integrator, int order)
{
    carom_world_settings s = carom_world_defaults();
    carom_world *w = NULL;
    s.integrator = (int)integrator;
    s.order = order;
    must(NULL, carom_world_create(&s, NULL, &w));
    return w;
}

static carom_world *sealed(carom_world *w)
{
    must(w, carom_world_seal(w));
    return w;
}

static int disc(carom_world *w, double x, double y, double r, double mu, double e)
{
    carom_body_def d = carom_body_at(CAROM_DYNAMIC, x, y);
    int b;
    d.friction = mu;
    d.restitution = e;
    must(w, carom_world_add_circle(w, &d, r, 1, &b));
    return b;
}

static int box(carom_world *w, carom_body_type type, double x, double y, double hx, double hy,
               double mu)
{
    carom_body_def d = carom_body_at(type, x, y);
    int b;
    d.friction = mu;
    must(w, carom_world_add_box(w, &d, 2 * hx, 2 * hy, 1, &b));
    return b;
}

static int ground(carom_world *w, double mu, double e)
{
    carom_body_def d = carom_body_at(CAROM_STATIC, 0, -1);
    int b;
    d.friction = mu;
    d.restitution = e;
    must(w, carom_world_add_box(w, &d, 60, 2, 1, &b));
    return b;
}

static int anchor(carom_world *w)
{
    const carom_body_def d = carom_body_at(CAROM_STATIC, 0, 0);
    int b;
    must(w, carom_world_add_body(w, &d, &b));
    return b;
}

static carom_world *free_body(int kept)
{
    carom_world *w = world_of(CAROM_LOCATED, 2);
    const carom_body_def d = carom_body_at(CAROM_DYNAMIC, 0, 0);
    if (kept) {
        disc(w, 0, 0, 0.5, 0.5, 0.5);
        disc(w, 3, 0, 0.5, 0.5, 0.5);
    } else {
        must(w, carom_world_add_body(w, &d, NULL));
        must(w, carom_world_add_body(w, &d, NULL));
    }
    return sealed(w);
}

static carom_world *filtered(int kept)
{
    carom_world *w = world_of(CAROM_LOCATED, 2);
    for (int k = 0; k < 50; k++) {
        carom_body_def d = carom_body_at(CAROM_DYNAMIC, 3 * (k % 10), 3 * (k / 10));
        d.filter.group = kept ? 0 : -1;
        must(w, carom_world_add_circle(w, &d, 0.5, 1, NULL));
    }
    return sealed(w);
}

static carom_world *resting_disc(double mu, double e, carom_integrator integrator)
{
    carom_world *w = world_of(integrator, 2);
    ground(w, mu, e);
    disc(w, 0, 0.5, 0.5, mu, e);
    return sealed(w);
}

static carom_world *smooth_disc(int kept)
{
    return resting_disc(kept ? NEXT_TO_NOTHING : 0, 0, CAROM_LOCATED);
}

static carom_world *dull_disc(int kept)
{
    return resting_disc(0.5, kept ? 0.5 : 0, CAROM_LOCATED);
}

static carom_world *fixed_disc(int kept)
{
    return resting_disc(0.5, 0, kept ? CAROM_LOCATED : CAROM_FIXED);
}

/* n links; `shaped`: they have shapes that may meet others than their neighbors. */
static carom_world *chain(int n, int shaped, int order)
{
    carom_world *w = world_of(CAROM_LOCATED, order);
    int last = anchor(w);
    for (int k = 0; k < n; k++) {
        int b;
        if (shaped) {
            b = box(w, CAROM_DYNAMIC, k + 0.5, 0, 0.5, 0.05, 0.5);
        } else {
            carom_body_def d = carom_body_at(CAROM_DYNAMIC, k + 0.5, 0);
            d.mass = 0.1;
            d.inertia = 0.1 * (1 + 0.01) / 12;
            must(w, carom_world_add_body(w, &d, &b));
        }
        const carom_vec2 at = {k, 0};
        must(w, carom_world_add_revolute(w, last, b, at, NULL));
        last = b;
    }
    return sealed(w);
}

static carom_world *pendulum(int kept)
{
    return chain(1, kept, 2);
}

static carom_world *chain_of_10(int kept)
{
    return chain(10, kept, 2);
}

static carom_world *low_order(int kept)
{
    return chain(10, 0, kept ? 6 : 2);
}

static carom_world *pinned(double stiffness, double limit, double lower, double damping)
{
    carom_world *w = world_of(CAROM_LOCATED, 2);
    carom_joint_def j = carom_joint_defaults(CAROM_REVOLUTE);
    carom_body_def d = carom_body_at(CAROM_DYNAMIC, 0.5, 0);
    j.body_a = anchor(w);
    d.angular_damping = damping;
    must(w, carom_world_add_body(w, &d, &j.body_b));
    j.stiffness = stiffness;
    j.motor_limit = limit;
    if (lower < 0) {
        j.lower = lower;
        j.upper = -lower;
    }
    must(w, carom_world_add_joint(w, &j, NULL));
    return sealed(w);
}

static carom_world *no_spring(int kept)
{
    return pinned(kept ? NEXT_TO_NOTHING : 0, 0, 0, 0);
}

static carom_world *no_motor(int kept)
{
    return pinned(0, kept ? NEXT_TO_NOTHING : 0, 0, 0);
}

static carom_world *no_limits(int kept)
{
    return pinned(0, 0, kept ? -1e3 : 0, 0);
}

static carom_world *no_damping(int kept)
{
    return pinned(0, 0, 0, kept ? NEXT_TO_NOTHING : 0);
}

/* Ten bodies at rest on each other: discs that stand, or boxes. */
static carom_world *pillar(carom_integrator integrator, double mu)
{
    carom_world *w = world_of(integrator, 2);
    ground(w, mu, 0);
    for (int k = 0; k < 10; k++) box(w, CAROM_DYNAMIC, 0, k + 0.5, 0.5, 0.5, mu);
    return sealed(w);
}

static carom_world *smooth_stack(int kept)
{
    return pillar(CAROM_LOCATED, kept ? 0.5 : 0);
}

static carom_world *stack(int kept)
{
    (void)kept;
    return pillar(CAROM_LOCATED, 0.5);
}

static carom_world *fixed_stack(int kept)
{
    return pillar(kept ? CAROM_LOCATED : CAROM_FIXED, 0.5);
}

/* Discs in a row on the floor, or polygons of 16 corners with a flat foot. */
static carom_world *circles(int kept)
{
    carom_world *w = world_of(CAROM_LOCATED, 2);
    carom_vec2 v[16];
    ground(w, 0.5, 0);
    for (int k = 0; k < 16; k++) {
        const double a = 6.283185307179586 * (k + 0.5) / 16;
        v[k].x = 0.5 * cos(a);
        v[k].y = 0.5 * sin(a);
    }
    const carom_shape hull = {0, 16, v};
    for (int k = 0; k < 20; k++) {
        if (!kept) {
            disc(w, 1.2 * k - 12, 0.5, 0.5, 0.5, 0);
            continue;
        }
        carom_body_def d = carom_body_at(CAROM_DYNAMIC, 1.2 * k - 12, -v[12].y);
        d.n_shapes = 1;
        d.shapes = &hull;
        must(w, carom_world_add_solid(w, &d, 1, NULL));
    }
    return sealed(w);
}

static carom_world *bouncing(int kept)
{
    carom_world *w = world_of(CAROM_LOCATED, 2);
    ground(w, 0.5, 0.8);
    disc(w, 0, 1.5, 0.5, 0.5, 0.8);
    if (kept) must(w, carom_world_record_events(w, 1));
    return sealed(w);
}

static carom_world *no_sensor(int kept)
{
    carom_world *w = world_of(CAROM_LOCATED, 2);
    ground(w, 0.5, 0);
    disc(w, 0, 0.5, 0.5, 0.5, 0);
    carom_body_def d = carom_body_at(CAROM_STATIC, 3, 1);
    d.sensor = 1;
    if (kept) must(w, carom_world_add_box(w, &d, 1, 1, 1, NULL));
    return sealed(w);
}

static carom_world *far_islands(int kept)
{
    carom_world *w = world_of(CAROM_LOCATED, 2);
    carom_world_settings s = carom_world_get_settings(w);
    if (kept) {
        carom_world_destroy(w);
        s.threads = 2;
        must(NULL, carom_world_create(&s, NULL, &w));
    }
    ground(w, 0.5, 0);
    for (int k = 0; k < 6; k++) disc(w, 5 * k - 12, 0.5, 0.5, 0.5, 0);
    return sealed(w);
}

/* A crank with a motor drives a piston between stops that pushes a box; a ball bounces beside it.
 */
static carom_world *machine(int kept)
{
    carom_world *w = world_of(CAROM_LOCATED, kept ? 4 : 2);
    const int base = anchor(w);
    ground(w, 0.4, 0.5);
    carom_joint_def j = carom_joint_defaults(CAROM_REVOLUTE);
    j.body_a = base;
    j.body_b = box(w, CAROM_DYNAMIC, 0.25, 2, 0.25, 0.05, 0);
    j.anchor.y = 2;
    j.motor_speed = 4;
    j.motor_limit = 20;
    must(w, carom_world_add_joint(w, &j, NULL));
    const int rod = box(w, CAROM_DYNAMIC, 1.25, 2, 0.75, 0.03, 0);
    const carom_vec2 elbow = {0.5, 2};
    must(w, carom_world_add_revolute(w, j.body_b, rod, elbow, NULL));
    carom_joint_def p = carom_joint_defaults(CAROM_PRISMATIC);
    p.body_a = base;
    p.body_b = box(w, CAROM_DYNAMIC, 2, 2, 0.1, 0.1, 0.4);
    p.anchor.x = 2;
    p.anchor.y = 2;
    p.axis.x = 1;
    p.lower = -1.2;
    p.upper = 0.5;
    p.stiffness = 5;
    must(w, carom_world_add_joint(w, &p, NULL));
    const carom_vec2 wrist = {2, 2};
    must(w, carom_world_add_revolute(w, rod, p.body_b, wrist, NULL));
    disc(w, -3, 1.5, 0.3, 0.4, 0.5);
    box(w, CAROM_DYNAMIC, 5, 0.3, 0.3, 0.3, 0.4);
    return sealed(w);
}

const case_scene CASES[] = {
    {"two free bodies", "shapes that could meet", free_body, 0, 60},
    {"50 discs that filters keep apart", "the filters let them meet", filtered, 0, 60},
    {"disc on a floor: no friction", "a friction of 1e-12", smooth_disc, 0, 60},
    {"disc on a floor: no bounce", "a restitution of 0.5", dull_disc, 0, 60},
    {"disc on a floor: fixed", "located", fixed_disc, 0, 60},
    {"pendulum without shape", "a shape", pendulum, 0, 60},
    {"chain of 10 without shapes", "shapes", chain_of_10, 0, 60},
    {"chain of 10: order 2", "order 6", low_order, 0, 30},
    {"hinge without spring", "a spring of 1e-12 N m", no_spring, 0, 60},
    {"hinge without motor", "a motor of 1e-12 N m", no_motor, 0, 60},
    {"hinge without stops", "stops a thousand turns away", no_limits, 0, 60},
    {"hinge without damping", "a damping of 1e-12", no_damping, 0, 60},
    {"stack of 10: no friction", "friction", smooth_stack, 0, 60},
    {"stack of 10: fixed", "located", fixed_stack, 0, 60},
    {"stack of 10: no gradient", "a tape", stack, 1, 60},
    {"20 discs on a floor", "polygons of 16 corners", circles, 0, 60},
    {"bouncing ball", "events are recorded", bouncing, 0, 60},
    {"disc on a floor: no sensor", "a sensor beside it", no_sensor, 0, 60},
    {"six islands: one thread", "two threads allowed", far_islands, 0, 60},
    {"machine of all parts: order 2", "order 4", machine, 0, 30},
};
const int N_CASES = sizeof CASES / sizeof CASES[0];
