#include "random_scene.h"

#include "carom/collide.h"
#include "near.h"
#include "rng.h"

#include <string.h>

static const double PI = 3.14159265358979323846;
/* Cells are this wide [m]; a body starts inside one, so that nothing overlaps. */
static const double CELL = 1;
/* Walls reach this high where there is no lid: 2 s at 100 m/s, and some more [m]. */
static const double WALL = 300;
/* A center that far inside a wall has gone through its face [m]. */
static const double THROUGH = 0.5;

/* The draw under way. */
typedef struct draw {
    rng r;
    random_scene *s;
    double speed; /* of the scene, at most [m/s] */
} draw;

static double log_uniform(rng *r, double low, double high)
{
    return low * pow(high / low, rng_unit(r));
}

static int chance(rng *r, double probability)
{
    return rng_unit(r) < probability;
}

static carom_vec2 *take_vertices(random_scene *s, int n)
{
    assert_true(s->n_vertices + n <= RANDOM_SCENE_VERTICES);
    carom_vec2 *v = s->vertices + s->n_vertices;
    s->n_vertices += n;
    return v;
}

static carom_shape circle(draw *d, double radius, double x)
{
    carom_vec2 *v = take_vertices(d->s, 1);
    v[0].x = x;
    v[0].y = 0;
    const carom_shape c = {radius, 1, v};
    return c;
}

static carom_shape box(draw *d, double hx, double hy, double radius)
{
    carom_vec2 *v = take_vertices(d->s, 4);
    const carom_vec2 corners[4] = {{-hx, -hy}, {hx, -hy}, {hx, hy}, {-hx, hy}};
    memcpy(v, corners, sizeof corners);
    const carom_shape b = {radius, 4, v};
    return b;
}

static carom_shape capsule(draw *d, double half, double radius)
{
    carom_vec2 *v = take_vertices(d->s, 2);
    v[0].x = -half;
    v[1].x = half;
    v[0].y = v[1].y = 0;
    const carom_shape c = {radius, 2, v};
    return c;
}

/* Vertices on an ellipse at jittered angles, moved so that the centroid is the origin. */
static carom_shape polygon(draw *d, double reach, double aspect, double radius)
{
    const int n = 3 + rng_int(&d->r, 6);
    carom_vec2 *v = take_vertices(d->s, n);
    const double core = reach - radius;
    for (int i = 0; i < n; i++) {
        const double t = 2 * PI * (i + rng_uniform(&d->r, -0.3, 0.3)) / n;
        v[i].x = 0.6 * core * cos(t);
        v[i].y = 0.6 * core * aspect * sin(t);
    }
    const carom_shape s = {radius, n, v};
    const carom_vec2 c = carom_shape_mass(&s, 1).centroid;
    for (int i = 0; i < n; i++) {
        v[i].x -= c.x;
        v[i].y -= c.y;
    }
    return s;
}

/* One or two shapes inside a circle of radius reach. */
static int random_shapes(draw *d, double reach, carom_shape shapes[2])
{
    rng *r = &d->r;
    switch (rng_int(r, 7)) {
    case 0: shapes[0] = circle(d, reach, 0); return 1;
    case 1: {
        const double t = rng_uniform(r, 0.05, 1.5);
        shapes[0] = box(d, reach * cos(t), reach * sin(t), 0);
        return 1;
    }
    case 2: {
        const double radius = reach * rng_uniform(r, 0.02, 0.5);
        shapes[0] = capsule(d, reach - radius, radius);
        return 1;
    }
    case 3: shapes[0] = polygon(d, reach, rng_uniform(r, 0.2, 1), 0); return 1;
    case 4: shapes[0] = polygon(d, reach, log_uniform(r, 1e-3, 1e-1), 0); return 1; /* sliver */
    case 5:
        shapes[0] = polygon(d, reach, rng_uniform(r, 0.2, 1), reach * rng_uniform(r, 0.01, 0.4));
        return 1;
    default: /* two discs */
        shapes[0] = circle(d, 0.4 * reach, -0.6 * reach);
        shapes[1] = circle(d, 0.4 * reach, 0.6 * reach);
        return 2;
    }
}

/* Mass from 1e-3 to 1e3 kg; inertia as of uniform density. */
static void set_mass(rng *r, carom_body_def *b)
{
    double area = 0;
    double second = 0;
    for (int k = 0; k < b->n_shapes; k++) {
        const carom_mass_properties m = carom_shape_mass(&b->shapes[k], 1);
        area += m.area;
        second += m.inertia + m.area * (m.centroid.x * m.centroid.x + m.centroid.y * m.centroid.y);
    }
    b->mass = log_uniform(r, 1e-3, 1e3);
    b->inertia = b->mass * second / area;
}

static void set_surface(rng *r, carom_body_def *b)
{
    b->friction = chance(r, 0.2) ? 0 : rng_uniform(r, 0, 2);
    b->restitution = chance(r, 0.3) ? 0 : chance(r, 0.1) ? 1 : rng_unit(r);
}

static void random_velocity(draw *d, double v[3])
{
    const double speed = log_uniform(&d->r, 1e-2, d->speed);
    const double t = rng_uniform(&d->r, 0, 2 * PI);
    v[0] = chance(&d->r, 0.5) ? rng_uniform(&d->r, -20, 20) : 0;
    v[1] = speed * cos(t);
    v[2] = speed * sin(t);
}

static int add_body(draw *d, const carom_body_def *b)
{
    random_scene *s = d->s;
    int index = -1;
    const carom_status e = carom_world_add_body(s->world, b, &index);
    if (e) fail_msg("%s: %s", carom_status_name(e), carom_world_error(s->world));
    assert_true(index < RANDOM_SCENE_BODIES && s->n_parts + b->n_shapes <= RANDOM_SCENE_SHAPES);
    s->n_bodies = index + 1;
    s->type[index] = b->type;
    s->mass[index] = b->mass;
    for (int k = 0; k < b->n_shapes; k++) {
        s->parts[s->n_parts].shape = b->shapes[k];
        s->parts[s->n_parts++].body = index;
    }
    return index;
}

static void add_wall(draw *d, double x, double y, double hx, double hy)
{
    const carom_shape shape = box(d, hx, hy, 0);
    carom_body_def b = carom_body_at(CAROM_STATIC, x, y);
    set_surface(&d->r, &b);
    b.n_shapes = 1;
    b.shapes = &shape;
    add_body(d, &b);
}

static void add_walls(draw *d, int lid)
{
    random_scene *s = d->s;
    const double w = s->half_width;
    const double h = lid ? s->height : WALL;
    add_wall(d, 0, -1, w + 2, 1);
    add_wall(d, -w - 1, h / 2, 1, h / 2);
    add_wall(d, w + 1, h / 2, 1, h / 2);
    if (lid) add_wall(d, 0, h + 1, w + 2, 1);
}

/* A body of any type in the cell around (x, y). */
static void add_one(draw *d, carom_body_type type, double x, double y)
{
    carom_shape shapes[2];
    carom_body_def b = carom_body_at(type, x, y);
    b.pose.angle = rng_uniform(&d->r, -4, 4);
    b.n_shapes = random_shapes(d, 0.5 * CELL * log_uniform(&d->r, 0.1, 0.99), shapes);
    b.shapes = shapes;
    set_surface(&d->r, &b);
    set_mass(&d->r, &b);
    if (type == CAROM_DYNAMIC) random_velocity(d, b.velocity);
    if (type == CAROM_KINEMATIC) {
        b.velocity[0] = rng_uniform(&d->r, -6, 6);
        b.velocity[1] = rng_uniform(&d->r, -0.1, 0.1);
        d->s->has_kinematic = 1;
    }
    add_body(d, &b);
}

static void pin(draw *d, int a, int b, double x, double y)
{
    random_scene *s = d->s;
    const carom_vec2 anchor = {x, y};
    const carom_status e = carom_world_add_revolute(s->world, a, b, anchor, NULL);
    if (e) fail_msg("%s: %s", carom_status_name(e), carom_world_error(s->world));
    assert_true(s->n_joints < RANDOM_SCENE_JOINTS);
    s->joined[s->n_joints][0] = a;
    s->joined[s->n_joints++][1] = b;
}

/* n links end to end in a row of cells from (x, y) on, sometimes pinned to the left wall. */
static void add_chain(draw *d, int n, double x, double y)
{
    rng *r = &d->r;
    const int pinned = chance(r, 0.4);
    const int boxes = chance(r, 0.5);
    const double thick = CELL * rng_uniform(r, 0.02, 0.2);
    double v[3];
    random_velocity(d, v);
    for (int k = 0; k < n; k++) {
        const carom_shape shape =
            boxes ? box(d, 0.49 * CELL, thick, 0) : capsule(d, 0.49 * CELL - thick, thick);
        carom_body_def b = carom_body_at(CAROM_DYNAMIC, x + k * CELL, y);
        b.n_shapes = 1;
        b.shapes = &shape;
        set_surface(r, &b);
        set_mass(r, &b);
        if (!pinned) memcpy(&b.velocity[1], &v[1], 2 * sizeof *v);
        const int i = add_body(d, &b);
        if (k > 0) pin(d, i - 1, i, x + (k - 0.5) * CELL, y);
        if (k == 0 && pinned) pin(d, 1, i, x - 0.5 * CELL, y);
    }
}

/* n boxes as wide as a cell, each resting on the one below. */
static void add_stack(draw *d, int n, double x)
{
    const double h = 0.5 * CELL * log_uniform(&d->r, 0.1, 0.9);
    for (int k = 0; k < n; k++) {
        const carom_shape shape = box(d, 0.45 * CELL, h, 0);
        carom_body_def b = carom_body_at(CAROM_DYNAMIC, x, h * (2 * k + 1));
        b.n_shapes = 1;
        b.shapes = &shape;
        set_surface(&d->r, &b);
        set_mass(&d->r, &b);
        add_body(d, &b);
    }
}

static carom_body_type random_type(rng *r)
{
    return chance(r, 0.04) ? CAROM_STATIC : chance(r, 0.01) ? CAROM_KINEMATIC : CAROM_DYNAMIC;
}

/* The cells of a room n_columns wide, from the floor up; column 0 is left to a stack. */
static void fill_cells(draw *d, int n, int n_columns, int stack)
{
    const double left = -0.5 * CELL * n_columns;
    double y = CELL * rng_uniform(&d->r, 0.5, 0.7);
    if (stack) add_stack(d, stack, left + 0.5 * CELL);
    for (int placed = stack; placed < n; y += CELL) {
        const int first = stack > 0;
        const int room = n - placed < n_columns - first ? n - placed : n_columns - first;
        const double x = left + (first + 0.5) * CELL;
        placed += room;
        if (room > 1 && chance(&d->r, 0.2)) {
            add_chain(d, room, x, y);
            continue;
        }
        for (int k = 0; k < room; k++) add_one(d, random_type(&d->r), x + k * CELL, y);
    }
}

void random_scene_make(uint64_t seed, const carom_world_settings *settings, random_scene *s)
{
    memset(s, 0, sizeof *s);
    draw d = {rng_from(seed), s, 0};
    rng *r = &d.r;
    carom_world_settings set = *settings;
    const int n = 2 + rng_int(r, 29);
    const int stack = chance(r, 0.15) ? 1 + rng_int(r, n < 10 ? n : 10) : 0;
    const int n_columns = 2 + rng_int(r, 6);
    d.speed = log_uniform(r, 0.1, 100);
    s->gravity = chance(r, 0.25) ? 0 : 9.81;
    const int lid = s->gravity == 0 || chance(r, 0.5);
    s->half_width = 0.5 * CELL * n_columns + log_uniform(r, 1e-3, 3);
    s->height = lid ? CELL * (n + 2) : HUGE_VAL;
    set.gravity[1] = -s->gravity;
    assert_int_equal(carom_world_create(&set, NULL, &s->world), CAROM_OK);
    add_walls(&d, lid);
    fill_cells(&d, n, n_columns, stack);
}

static int are_joined(const random_scene *s, int a, int b)
{
    for (int k = 0; k < s->n_joints; k++) {
        const int *j = s->joined[k];
        if ((j[0] == a && j[1] == b) || (j[0] == b && j[1] == a)) return 1;
    }
    return 0;
}

static carom_pose pose_of(const random_scene *s, int body)
{
    const double *q = carom_world_q(s->world) + 3 * body;
    const carom_pose p = {q[0], q[1], q[2]};
    return p;
}

double random_scene_overlap(const random_scene *s, int *a, int *b)
{
    double worst = 0;
    *a = *b = -1;
    for (int i = 0; i < s->n_parts; i++) {
        for (int k = 0; k < i; k++) {
            const random_scene_part *x = &s->parts[k];
            const random_scene_part *y = &s->parts[i];
            if (x->body == y->body || are_joined(s, x->body, y->body)) continue;
            if (s->type[x->body] != CAROM_DYNAMIC && s->type[y->body] != CAROM_DYNAMIC) continue;
            const carom_manifold m =
                carom_collide(&x->shape, pose_of(s, x->body), &y->shape, pose_of(s, y->body), 0);
            if (!m.count || -m.distance <= worst) continue;
            worst = -m.distance;
            *a = x->body;
            *b = y->body;
        }
    }
    return worst;
}

int random_scene_escaped(const random_scene *s)
{
    const double *q = carom_world_q(s->world);
    for (int b = 0; b < s->n_bodies; b++) {
        const double x = q[3 * b + 1];
        const double y = q[3 * b + 2];
        if (s->type[b] != CAROM_DYNAMIC) continue;
        const double out = fmax(fmax(fabs(x) - s->half_width, -y), y - s->height);
        if (!(out <= THROUGH)) return b;
    }
    return -1;
}
