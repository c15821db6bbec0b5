/* files.c: scene files (carom-scene/1) as problems: hulls, circles and revolute joints, as the
 * files of tests/data/scenes have them. */
#include "problems.h"

#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double HALF_PI = 1.57079632679489661923;

static void must(int holds, const char *path, const char *what)
{
    if (holds) return;
    fprintf(stderr, "bench_precision: %s: %s\n", path, what);
    exit(1);
}

static double number(const json_t *object, const char *key)
{
    return json_number_value(json_object_get(object, key));
}

static double coordinate(const json_t *pair, size_t k)
{
    return json_number_value(json_array_get(pair, k));
}

/* A hull of the corners (+-hx, +-hy), counterclockwise from the lower left, is a box. */
static int is_box(const json_t *vertices)
{
    const double hx = -coordinate(json_array_get(vertices, 0), 0);
    const double hy = -coordinate(json_array_get(vertices, 0), 1);
    const double corners[4][2] = {{-hx, -hy}, {hx, -hy}, {hx, hy}, {-hx, hy}};
    if (json_array_size(vertices) != 4) return 0;
    for (size_t i = 0; i < 4; i++) {
        for (size_t d = 0; d < 2; d++) {
            if (coordinate(json_array_get(vertices, i), d) != corners[i][d]) return 0;
        }
    }
    return hx > 0 && hy > 0;
}

static void read_shape(scene *s, int k, const json_t *shape, const char *path)
{
    scene_body *b = &s->bodies[k];
    const json_t *vertices = json_object_get(shape, "vertices");
    if (!vertices) {
        b->shape = SHAPE_DISC;
        b->hx = b->hy = number(shape, "radius");
        must(b->hx > 0, path, "a shape is neither a hull nor a circle");
        return;
    }
    const size_t n = json_array_size(vertices);
    must(n >= 3 && n <= MAX_CORNERS, path, "a hull has too few or too many vertices");
    b->shape = is_box(vertices) ? SHAPE_BOX : SHAPE_POLYGON;
    b->hx = -coordinate(json_array_get(vertices, 0), 0);
    b->hy = -coordinate(json_array_get(vertices, 0), 1);
    scene_polygon *p = &s->polygons[k];
    p->n = (int)n;
    p->corners = malloc(n * sizeof *p->corners);
    must(p->corners != NULL, path, "out of memory");
    for (size_t i = 0; i < n; i++) {
        for (size_t d = 0; d < 2; d++) {
            p->corners[i][d] = coordinate(json_array_get(vertices, i), d);
        }
    }
}

static void read_body(scene *s, const json_t *body, const char *path)
{
    scene_body *b = &s->bodies[s->n_bodies];
    const json_t *position = json_object_get(body, "position");
    const json_t *velocity = json_object_get(body, "velocity");
    const char *type = json_string_value(json_object_get(body, "type"));
    b->moves = !type || strcmp(type, "static") != 0;
    b->q[0] = number(body, "angle");
    b->v[0] = number(body, "angular_velocity");
    for (size_t d = 0; d < 2; d++) {
        b->q[1 + d] = coordinate(position, d);
        b->v[1 + d] = coordinate(velocity, d);
    }
    b->mass = number(body, "mass");
    b->inertia = number(body, "inertia");
    must(!b->moves || (b->mass > 0 && b->inertia > 0), path, "a body needs mass and inertia");
    b->friction = number(body, "friction");
    b->restitution = number(body, "restitution");
    read_shape(s, s->n_bodies, json_object_get(body, "shape"), path);
    if (json_is_false(json_object_get(body, "collide"))) b->shape = SHAPE_NONE;
    s->n_bodies++;
}

static void read_joint(scene *s, const json_t *joint, const char *path)
{
    const json_t *anchor = json_object_get(joint, "anchor");
    const char *type = json_string_value(json_object_get(joint, "type"));
    must(type && strcmp(type, "revolute") == 0, path, "a joint is not revolute");
    add_pin(s, (int)number(joint, "body_a"), (int)number(joint, "body_b"), coordinate(anchor, 0),
            coordinate(anchor, 1));
}

/* --- ends ----------------------------------------------------------------------------------- */

static void ends_at(problem *p, double angle, double x, double y)
{
    p->exact[0] = angle;
    p->exact[1] = x;
    p->exact[2] = y;
}

static void ends_straight(problem *p, double dist)
{
    const scene_body *b = &p->s.bodies[p->body];
    const double speed = hypot(b->v[1], b->v[2]);
    ends_at(p, b->q[0], b->q[1] + dist * b->v[1] / speed, b->q[2] + dist * b->v[2] / speed);
}

/* Two free discs: Newton's law along the centers, Coulomb's across; the first one's end. */
static void ends_after_impact(problem *p, double friction, double restitution)
{
    const scene_body *a = &p->s.bodies[0];
    const scene_body *b = &p->s.bodies[1];
    const double across = a->hx + b->hx;
    const double x[2] = {b->q[1] - a->q[1], b->q[2] - a->q[2]};
    const double v[2] = {b->v[1] - a->v[1], b->v[2] - a->v[2]};
    const double approach = x[0] * v[0] + x[1] * v[1];
    const double speed = v[0] * v[0] + v[1] * v[1];
    const double short_of = x[0] * x[0] + x[1] * x[1] - across * across;
    const double t = short_of / (-approach + sqrt(approach * approach - speed * short_of));
    const double n[2] = {(x[0] + t * v[0]) / across, (x[1] + t * v[1]) / across};
    const double un = v[0] * n[0] + v[1] * n[1];
    /* of the point of b beyond that of a, along (-n_y, n_x) */
    const double ut = v[1] * n[0] - v[0] * n[1] - a->v[0] * a->hx - b->v[0] * b->hx;
    const double light = 1 / a->mass + 1 / b->mass;
    const double turning = a->hx * a->hx / a->inertia + b->hx * b->hx / b->inertia;
    const double ln = -(1 + restitution) * un / light;
    const double lt = fmax(-friction * ln, fmin(friction * ln, -ut / (light + turning)));
    const double after[3] = {a->v[0] - a->hx * lt / a->inertia,
                             a->v[1] - (ln * n[0] - lt * n[1]) / a->mass,
                             a->v[2] - (ln * n[1] + lt * n[0]) / a->mass};
    p->body = 0;
    double *q = p->exact;
    for (int k = 0; k < 3; k++) q[k] = a->q[k] + t * a->v[k] + (p->duration - t) * after[k];
}

/* What the file's `reference` names; without one, or where `dist` is 0, all rests. */
static void find_end(problem *p, const json_t *reference)
{
    const double dist = number(reference, "dist");
    if (dist > 0) {
        ends_straight(p, dist);
    } else if (json_object_get(reference, "x")) {
        ends_rolling(p, p->s.bodies[p->body].friction);
    } else if (json_object_get(reference, "h")) {
        ends_bouncing(p);
    } else if (json_object_get(reference, "mu")) {
        ends_after_impact(p, number(reference, "mu"), number(reference, "e"));
    } else if (json_object_get(reference, "angle")) {
        p->motion = MOTION_CRADLE;
    } else if (json_object_get(reference, "n")) {
        p->motion = MOTION_LINKS;
        p->hangs = -HALF_PI;
    } else {
        rests(p);
    }
}

static const char *name_of(const char *path)
{
    const char *slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}

problem read_problem(const char *path)
{
    json_error_t error;
    json_t *file = json_load_file(path, 0, &error);
    must(file != NULL, path, error.text);
    const json_t *bodies = json_object_get(file, "bodies");
    const json_t *joints = json_object_get(file, "joints");
    const size_t n = json_array_size(bodies);
    problem p = {name_of(path), {0}, number(file, "duration"), 0, 0.5, MOTION_CLOSED, {0}, 0, 0, 0};
    p.s.name = p.name;
    p.s.gravity = -coordinate(json_object_get(file, "gravity"), 1);
    p.s.max_bodies = (int)n;
    p.s.bodies = calloc(n, sizeof *p.s.bodies);
    p.s.polygons = calloc(n, sizeof *p.s.polygons);
    must(n > 0 && p.s.bodies && p.s.polygons, path, "no bodies, or no memory for them");
    for (size_t k = 0; k < n; k++) read_body(&p.s, json_array_get(bodies, k), path);
    for (size_t k = 0; k < json_array_size(joints); k++) {
        read_joint(&p.s, json_array_get(joints, k), path);
    }
    for (int k = 0; k < p.s.n_bodies; k++) {
        if (p.s.bodies[k].moves) p.body = k;
    }
    const scene_body *b = &p.s.bodies[p.body];
    p.reach = b->hx > 0 ? b->hx : 0.5;
    find_end(&p, json_object_get(file, "reference"));
    json_decref(file);
    return p;
}
