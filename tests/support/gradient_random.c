#include "gradient_random.h"

#include "near.h"
#include "rng.h"

static const double PI = 3.14159265358979323846;
/* Bodies start in cells of this width, in a row that is at most this wide [m]. */
static const double CELL = 1;
enum { MOST_BODIES = 5, MOST_CORNERS = 7 };

typedef struct draw {
    rng r;
    carom_world *w;
    int n, first; /* dynamic bodies, and the number of the first of them */
    carom_vec2 place[MOST_BODIES];
    double mass[MOST_BODIES];
} draw;

static double log_uniform(rng *r, double low, double high)
{
    return low * pow(high / low, rng_unit(r));
}

static int chance(rng *r, double probability)
{
    return rng_unit(r) < probability;
}

static void must(draw *d, carom_status e)
{
    if (e < 0) fail_msg("%s: %s", carom_status_name(e), carom_world_error(d->w));
}

static void set_surface(draw *d, carom_body_def *b)
{
    b->friction = chance(&d->r, 0.15) ? 0 : rng_uniform(&d->r, 0.05, 1.2);
    b->restitution = chance(&d->r, 0.3) ? 0 : rng_uniform(&d->r, 0.05, 0.95);
}

static void add_box(draw *d, carom_pose pose, double hx, double hy)
{
    const carom_vec2 corners[4] = {{-hx, -hy}, {hx, -hy}, {hx, hy}, {-hx, hy}};
    const carom_shape shape = {0, 4, corners};
    carom_body_def b = carom_body_at(CAROM_STATIC, pose.x, pose.y);
    b.pose.angle = pose.angle;
    set_surface(d, &b);
    b.n_shapes = 1;
    b.shapes = &shape;
    must(d, carom_world_add_body(d->w, &b, NULL));
}

/* A disc, box, capsule, hull or rounded hull within `reach` around the center of mass. */
static carom_shape random_shape(draw *d, double reach, carom_vec2 corners[MOST_CORNERS])
{
    rng *r = &d->r;
    carom_shape s = {0, 0, corners};
    const int kind = rng_int(r, 5);
    if (kind == 0) {
        s.radius = reach;
        s.count = 1;
    } else if (kind == 1) {
        s.radius = reach * rng_uniform(r, 0.15, 0.5);
        s.count = 2;
    } else {
        s.count = kind == 2 ? 4 : 3 + rng_int(r, MOST_CORNERS - 2);
        s.radius = kind == 4 ? reach * rng_uniform(r, 0.05, 0.3) : 0;
    }
    const double core = s.count == 1 ? 0 : reach - s.radius;
    const double aspect = kind == 1 ? 0 : rng_uniform(r, 0.3, 1);
    for (int i = 0; i < s.count; i++) {
        const double jitter = kind > 2 ? rng_uniform(r, -0.25, 0.25) : 0;
        const double t = 2 * PI * (i + jitter + (kind == 2 ? 0.5 : 0)) / s.count;
        corners[i].x = 0.8 * core * cos(t);
        corners[i].y = kind == 1 ? 0 : 0.8 * core * aspect * sin(t);
    }
    const carom_vec2 c = carom_shape_mass(&s, 1).centroid;
    for (int i = 0; i < s.count; i++) {
        corners[i].x -= c.x;
        corners[i].y -= c.y;
    }
    return s;
}

static void add_one(draw *d, int k)
{
    rng *r = &d->r;
    carom_vec2 corners[MOST_CORNERS] = {{0, 0}};
    const carom_shape shape = random_shape(d, 0.5 * CELL * rng_uniform(r, 0.4, 0.95), corners);
    const carom_vec2 at = {(k - 0.5 * (d->n - 1)) * CELL, CELL * rng_uniform(r, 0.55, 1.2)};
    carom_body_def b = carom_body_at(CAROM_DYNAMIC, at.x, at.y);
    const carom_mass_properties m = carom_shape_mass(&shape, 1);
    b.pose.angle = rng_uniform(r, -3, 3);
    b.n_shapes = 1;
    b.shapes = &shape;
    set_surface(d, &b);
    b.mass = log_uniform(r, 1e-2, 1e2);
    b.inertia = b.mass * m.inertia / m.area;
    b.velocity[0] = rng_uniform(r, -4, 4);
    b.velocity[1] = rng_uniform(r, -3, 3);
    b.velocity[2] = rng_uniform(r, -4, 1);
    must(d, carom_world_add_body(d->w, &b, k ? NULL : &d->first));
    d->place[k] = at;
    d->mass[k] = b.mass;
}

static void set_limits(draw *d, carom_joint_def *j)
{
    const double reach = j->kind == CAROM_REVOLUTE ? 0.6 : 0.15;
    j->lower = -reach * rng_uniform(&d->r, 0.3, 1);
    j->upper = reach * rng_uniform(&d->r, 0.3, 1);
    if (j->kind == CAROM_ROPE) {
        const double length = hypot(j->anchor_b.x - j->anchor.x, j->anchor_b.y - j->anchor.y);
        j->lower = length * rng_uniform(&d->r, 0.6, 0.95);
        j->upper = length * rng_uniform(&d->r, 1.05, 1.3);
    }
    j->restitution = chance(&d->r, 0.5) ? 0 : rng_uniform(&d->r, 0.1, 0.9);
}

static void set_spring(draw *d, carom_joint_def *j, double mass)
{
    j->stiffness = mass * log_uniform(&d->r, 3, 3e3);
    j->damping = chance(&d->r, 0.3) ? 0 : mass * log_uniform(&d->r, 0.1, 30);
    if (j->kind != CAROM_TARGET) j->rest = rng_uniform(&d->r, 0.05, 0.3);
}

static void set_motor(draw *d, carom_joint_def *j, double mass)
{
    j->motor_speed = rng_uniform(&d->r, -4, 4);
    j->motor_limit = mass * log_uniform(&d->r, 0.3, 300);
}

/* Body k to the one before it, or body 0 to the world. */
static void add_joint(draw *d, int k)
{
    rng *r = &d->r;
    const carom_joint_kind kind = (carom_joint_kind)rng_int(r, CAROM_N_JOINT_KINDS);
    carom_joint_def j = carom_joint_defaults(kind);
    const double mass = d->mass[k];
    const double t = rng_uniform(r, 0, 2 * PI);
    j.body_a = k ? d->first + k - 1 : 0;
    j.body_b = d->first + k;
    j.anchor.x = d->place[k].x - 0.5 * CELL + rng_uniform(r, -0.1, 0.1);
    j.anchor.y = d->place[k].y + rng_uniform(r, -0.1, 0.1);
    j.anchor_b.x = d->place[k].x + rng_uniform(r, -0.1, 0.1);
    j.anchor_b.y = d->place[k].y + rng_uniform(r, -0.1, 0.1);
    j.axis.x = cos(t);
    j.axis.y = sin(t);
    const int rope = kind == CAROM_ROPE;
    const int drives = kind == CAROM_REVOLUTE || kind == CAROM_PRISMATIC || kind == CAROM_WHEEL;
    const int sprung = kind == CAROM_TARGET || ((drives || rope) && chance(r, 0.4));
    const int limited = (rope && !sprung) || ((drives || rope) && chance(r, 0.5));
    if (limited) set_limits(d, &j);
    if (sprung) set_spring(d, &j, mass);
    if (drives && chance(r, 0.3)) set_motor(d, &j, mass);
    must(d, carom_world_add_joint(d->w, &j, NULL));
}

carom_world *gradient_random_world(uint64_t seed, const carom_world_settings *settings)
{
    draw d = {rng_from(seed), NULL, 0, -1, {{0, 0}}, {0}};
    rng *r = &d.r;
    carom_world_settings set = *settings;
    d.n = 1 + rng_int(r, MOST_BODIES);
    set.gravity[0] = chance(r, 0.2) ? rng_uniform(r, -2, 2) : 0;
    set.gravity[1] = chance(r, 0.15) ? 0 : -9.81;
    set.dt = 1 / rng_uniform(r, 40, 120);
    must(&d, carom_world_create(&set, NULL, &d.w));
    const carom_pose floor = {rng_uniform(r, -0.15, 0.15), 0, -1};
    const double wall = 0.5 * CELL * d.n + rng_uniform(r, 0.2, 0.6);
    const carom_pose left = {rng_uniform(r, -0.1, 0), -wall - 1, 0};
    const carom_pose right = {rng_uniform(r, 0, 0.1), wall + 1, 0};
    add_box(&d, floor, 2 * wall, 0.9);
    add_box(&d, left, 0.8, 6);
    add_box(&d, right, 0.8, 6);
    for (int k = 0; k < d.n; k++) add_one(&d, k);
    for (int k = 0; k < d.n; k++) {
        if (chance(r, k ? 0.6 : 0.2)) add_joint(&d, k);
    }
    must(&d, carom_world_seal(d.w));
    return d.w;
}
