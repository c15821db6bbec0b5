/* Questions about a world: against trying every shape, against closed forms; worlds without
 * anything. */
#include "alloc_fail.h"
#include "near.h"
#include "rng.h"
#include "scenes.h"

#include "carom/world_query.h"

#include <float.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_BODIES = 400, MAX_SHAPES = 3, MAX_VERTICES = 6 };

/* What the test knows of a world, without asking it. */
typedef struct body {
    carom_body_def def;
    carom_shape shapes[MAX_SHAPES];
    carom_vec2 v[MAX_SHAPES][MAX_VERTICES];
} body;

typedef struct scene {
    carom_world *world;
    carom_query *query;
    int n;
    double half; /* bodies are in [-half, half]^2 */
    body bodies[MAX_BODIES];
} scene;

static scene *the_scene; /* too large for a stack */

static void random_shape(rng *r, double size, carom_shape *s, carom_vec2 *v)
{
    const double start = rng_uniform(r, 0, 6);
    const double cx = rng_uniform(r, -size, size);
    s->vertices = v;
    s->count = 1 + rng_int(r, MAX_VERTICES);
    s->radius = s->count == 1 || rng_int(r, 2) ? 0.3 * size : 0;
    for (int i = 0; i < s->count; i++) {
        const double t = start + 6.28 * (i + rng_uniform(r, -0.3, 0.3)) / s->count;
        v[i].x = cx + size * cos(t);
        v[i].y = size * sin(t);
    }
}

static void random_body(rng *r, double half, body *b)
{
    /* Most are small, some as large as the world. */
    const double size = rng_int(r, 20) ? rng_uniform(r, 0.1, 1) : half;
    b->def = carom_body_defaults();
    b->def.type = rng_int(r, 2) ? CAROM_KINEMATIC : CAROM_STATIC; /* may overlap at the start */
    b->def.n_shapes = rng_int(r, MAX_SHAPES + 1);
    b->def.shapes = b->shapes;
    b->def.collide = rng_int(r, 8) != 0;
    b->def.sensor = rng_int(r, 4) == 0;
    b->def.filter.category = 1U << rng_int(r, 3);
    b->def.filter.mask = (unsigned)rng_int(r, 8);
    b->def.filter.group = rng_int(r, 5) - 2;
    b->def.pose.angle = rng_uniform(r, -4, 4);
    b->def.pose.x = rng_uniform(r, -half, half);
    b->def.pose.y = rng_uniform(r, -half, half);
    for (int k = 0; k < b->def.n_shapes; k++) random_shape(r, size, &b->shapes[k], b->v[k]);
}

static scene *random_scene(rng *r, int n, double half)
{
    scene *s = the_scene;
    s->world = scene_world(0, 0.01);
    s->n = n;
    s->half = half;
    for (int k = 0; k < n; k++) {
        random_body(r, half, &s->bodies[k]);
        assert_int_equal(carom_world_add_body(s->world, &s->bodies[k].def, NULL), CAROM_OK);
    }
    assert_int_equal(carom_query_create(s->world, NULL, &s->query), CAROM_OK);
    assert_int_equal(carom_query_refresh(s->query), CAROM_OK);
    return s;
}

static void free_scene(scene *s)
{
    carom_query_destroy(s->query);
    carom_world_destroy(s->world);
}

/* Moves all bodies by up to `by`. */
static void shake(rng *r, scene *s, double by)
{
    double q[3 * MAX_BODIES];
    for (int k = 0; k < s->n; k++) {
        carom_pose *p = &s->bodies[k].def.pose;
        q[3 * k] = p->angle += rng_uniform(r, -1, 1);
        q[3 * k + 1] = p->x += rng_uniform(r, -by, by);
        q[3 * k + 2] = p->y += rng_uniform(r, -by, by);
    }
    assert_int_equal(carom_world_set_state(s->world, q, NULL), CAROM_OK);
    assert_int_equal(carom_query_refresh(s->query), CAROM_OK);
}

static int meet(const carom_filter *a, const carom_filter *b)
{
    if (a->group != 0 && a->group == b->group) return a->group > 0;
    return (a->category & b->mask) != 0 && (b->category & a->mask) != 0;
}

static int seen(const scene *s, const carom_who *who, int k)
{
    const carom_body_def *d = &s->bodies[k].def;
    if (k == who->except) return 0;
    if (d->sensor && !who->sensors) return 0;
    if (!d->collide && !who->idle) return 0;
    return meet(&who->filter, &d->filter);
}

static carom_who random_who(rng *r, int n)
{
    carom_who who = carom_who_defaults();
    who.sensors = rng_int(r, 2);
    who.idle = rng_int(r, 2);
    who.except = rng_int(r, n + 1) - 1;
    if (rng_int(r, 2)) {
        who.filter.category = 1U << rng_int(r, 3);
        who.filter.group = rng_int(r, 5) - 2;
    } else {
        who.filter.category = 7;
    }
    return who;
}

/* The next shape that is seen after (body, shape); start from (0, -1). */
static int next_shape(const scene *s, const carom_who *who, carom_found *f)
{
    for (f->shape++; f->body < s->n; f->body++, f->shape = 0) {
        if (f->shape < s->bodies[f->body].def.n_shapes && seen(s, who, f->body)) return 1;
    }
    return 0;
}

static const carom_found START = {0, -1};

static const carom_shape *shape_of(const scene *s, carom_found f)
{
    return &s->bodies[f.body].shapes[f.shape];
}

static carom_pose pose_of(const scene *s, carom_found f)
{
    return s->bodies[f.body].def.pose;
}

static void assert_found(const char *what, int k, carom_found a, carom_found b)
{
    if (a.body == b.body && a.shape == b.shape) return;
    fail_msg("%s, question %d: body %d, shape %d; of all shapes %d, %d", what, k, a.body, a.shape,
             b.body, b.shape);
}

static carom_vec2 random_point(rng *r, double half)
{
    const carom_vec2 p = {rng_uniform(r, -1.3 * half, 1.3 * half),
                          rng_uniform(r, -1.3 * half, 1.3 * half)};
    return p;
}

/* A shape to ask with: sometimes a point. */
static void random_asker(rng *r, const scene *s, body *b)
{
    random_body(r, s->half, b);
    random_shape(r, rng_uniform(r, 0.1, 1), &b->shapes[0], b->v[0]);
    if (rng_int(r, 4) == 0) {
        b->shapes[0].count = 1;
        b->shapes[0].radius = 0;
    }
}

static int check_nearest(rng *r, scene *s, int k)
{
    body b;
    random_asker(r, s, &b);
    const carom_who who = random_who(r, s->n);
    const double within = rng_int(r, 2) ? HUGE_VAL : rng_uniform(r, 0, 3);
    carom_near best = {{-1, -1}, {0, {0, 0}, {0, 0}, {0, 0}}};
    for (carom_found f = START; next_shape(s, &who, &f);) {
        const carom_separation at =
            carom_shape_distance(b.shapes, b.def.pose, shape_of(s, f), pose_of(s, f));
        if (!(at.distance <= within)) continue;
        if (best.who.body >= 0 && !(at.distance < best.at.distance)) continue;
        best.who = f;
        best.at = at;
    }
    carom_near got;
    assert_int_equal(carom_query_nearest(s->query, &who, b.shapes, b.def.pose, within, &got),
                     CAROM_OK);
    assert_found("nearest", k, got.who, best.who);
    assert_memory_equal(&got.at, &best.at, sizeof got.at);
    return got.who.body >= 0;
}

static int check_point(rng *r, scene *s, int k)
{
    const carom_vec2 p = random_point(r, s->half);
    const carom_who who = random_who(r, s->n);
    int n = -1;
    int m = 0;
    const carom_found *list;
    assert_int_equal(carom_query_point(s->query, &who, p, &n, &list), CAROM_OK);
    for (carom_found f = START; next_shape(s, &who, &f);) {
        if (carom_point_distance(shape_of(s, f), pose_of(s, f), p, NULL) > 0) continue;
        assert_true(m < n);
        assert_found("point", k, list[m++], f);
    }
    assert_int_equal(m, n);
    return n;
}

static int check_box(rng *r, scene *s, int k)
{
    const carom_vec2 p = random_point(r, s->half);
    const double w = rng_int(r, 5) ? rng_uniform(r, 0, 3) : HUGE_VAL;
    const carom_box box = {p, {p.x + w, p.y + rng_uniform(r, 0, 3)}};
    const carom_who who = random_who(r, s->n);
    int n = -1;
    int m = 0;
    const carom_found *list;
    assert_int_equal(carom_query_box(s->query, &who, &box, &n, &list), CAROM_OK);
    for (carom_found f = START; next_shape(s, &who, &f);) {
        if (!carom_box_overlap(shape_of(s, f), pose_of(s, f), &box)) continue;
        assert_true(m < n);
        assert_found("box", k, list[m++], f);
    }
    assert_int_equal(m, n);
    return n;
}

static int check_overlaps(rng *r, scene *s, int k)
{
    body b;
    random_asker(r, s, &b);
    const carom_who who = random_who(r, s->n);
    int n = -1;
    int m = 0;
    const carom_found *list;
    assert_int_equal(carom_query_overlaps(s->query, &who, b.shapes, b.def.pose, &n, &list),
                     CAROM_OK);
    for (carom_found f = START; next_shape(s, &who, &f);) {
        const carom_separation at =
            carom_shape_distance(b.shapes, b.def.pose, shape_of(s, f), pose_of(s, f));
        if (at.distance > 0) continue;
        assert_true(m < n);
        assert_found("overlap", k, list[m++], f);
    }
    assert_int_equal(m, n);
    return n;
}

static int check_rays(rng *r, scene *s, int k)
{
    const carom_vec2 o = random_point(r, s->half);
    const carom_vec2 d = random_point(r, rng_int(r, 2) ? s->half : 1);
    const carom_who who = random_who(r, s->n);
    int n = -1;
    int m = 0;
    const carom_ray_found *list;
    carom_ray_found first;
    assert_int_equal(carom_query_ray_all(s->query, &who, o, d, &n, &list), CAROM_OK);
    for (carom_found f = START; next_shape(s, &who, &f);) {
        carom_ray_hit hit;
        if (!carom_ray_cast(shape_of(s, f), pose_of(s, f), o, d, &hit)) continue;
        int at = 0;
        while (at < n && (list[at].who.body != f.body || list[at].who.shape != f.shape)) at++;
        assert_true(at < n);
        assert_memory_equal(&list[at].at, &hit, sizeof hit);
        m++;
    }
    assert_int_equal(m, n);
    for (int i = 1; i < n; i++) {
        const carom_ray_found *a = &list[i - 1];
        const carom_ray_found *b = &list[i];
        assert_true(a->at.enter <= b->at.enter);
        if (a->at.enter < b->at.enter) continue;
        assert_true(a->who.body < b->who.body ||
                    (a->who.body == b->who.body && a->who.shape < b->who.shape));
    }
    assert_int_equal(carom_query_ray(s->query, &who, o, d, &first), CAROM_OK);
    const carom_found none = {-1, -1};
    assert_found("ray", k, first.who, n ? list[0].who : none);
    if (n) assert_memory_equal(&first.at, &list[0].at, sizeof first.at);
    return n;
}

static int check_cast(rng *r, scene *s, int k)
{
    body b;
    random_asker(r, s, &b);
    const carom_who who = random_who(r, s->n);
    const double target = rng_int(r, 2) ? 0 : 0.1;
    const carom_vec2 by = random_point(r, s->half);
    carom_sweep motion = {b.def.pose, b.def.pose};
    motion.to.x += by.x;
    motion.to.y += by.y;
    motion.to.angle += rng_uniform(r, -2, 2);
    carom_cast_found best = {{-1, -1}, {0, 1, {0, {0, 0}, {0, 0}, {0, 0}}, 0}};
    for (carom_found f = START; next_shape(s, &who, &f);) {
        const carom_sweep still = {pose_of(s, f), pose_of(s, f)};
        carom_cast_hit hit;
        assert_int_equal(carom_shape_cast(b.shapes, motion, shape_of(s, f), still, target, &hit),
                         CAROM_OK);
        if (!hit.hit || (best.who.body >= 0 && !(hit.t < best.at.t))) continue;
        best.who = f;
        best.at = hit;
    }
    carom_cast_found got;
    assert_int_equal(carom_query_cast(s->query, &who, b.shapes, motion, target, &got), CAROM_OK);
    assert_found("cast", k, got.who, best.who);
    assert_true(got.at.t == best.at.t && got.at.hit == best.at.hit);
    assert_memory_equal(&got.at.at, &best.at.at, sizeof got.at.at);
    return got.at.hit;
}

/* Every question on worlds of several sizes, at first, after small moves (the tree is refitted) and
 * after large ones (it is built anew). */
static void against_all_shapes(void **state)
{
    (void)state;
    static int (*const checks[])(rng *, scene *, int) = {check_nearest,  check_point, check_box,
                                                         check_overlaps, check_rays,  check_cast};
    static const int sizes[] = {1, 2, 3, 17, MAX_BODIES};
    rng r = rng_from(11);
    long found[6] = {0};
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        scene *s = random_scene(&r, sizes[i], 1 + 0.6 * sqrt(sizes[i]));
        for (int k = 0; k < 300; k++) {
            if (k % 30 == 10) shake(&r, s, 0.05);
            if (k % 30 == 20) shake(&r, s, s->half);
            for (int c = 0; c < 6; c++) found[c] += checks[c](&r, s, k);
        }
        free_scene(s);
    }
    /* Of 1500 questions each. */
    for (int c = 0; c < 6; c++) assert_true(found[c] > 300);
}

static void sees_as_of_refresh(void **state)
{
    (void)state;
    carom_world *w = scene_world(0, 0.01);
    carom_query *q;
    int n = -1;
    const carom_found *list;
    const carom_vec2 origin = {0, 0};
    scene_disc(w, 1, 1, 0, 0, 0, 0);
    assert_int_equal(carom_query_create(w, NULL, &q), CAROM_OK);
    assert_int_equal(carom_query_point(q, NULL, origin, &n, &list), CAROM_OK);
    assert_int_equal(n, 0); /* nothing before the first refresh */
    assert_int_equal(carom_query_refresh(q), CAROM_OK);
    const double away[3] = {0, 5, 0};
    assert_int_equal(carom_world_set_state(w, away, NULL), CAROM_OK);
    assert_int_equal(carom_query_point(q, NULL, origin, &n, &list), CAROM_OK);
    assert_int_equal(n, 1);
    assert_int_equal(carom_query_refresh(q), CAROM_OK);
    assert_int_equal(carom_query_point(q, NULL, origin, &n, &list), CAROM_OK);
    assert_int_equal(n, 0);
    /* A body more: seen from the next refresh on. */
    scene_disc(w, 1, 1, 0, 0, 0, 0);
    assert_int_equal(carom_query_refresh(q), CAROM_OK);
    assert_int_equal(carom_query_point(q, NULL, origin, &n, &list), CAROM_OK);
    assert_int_equal(n, 1);
    assert_int_equal(list[0].body, 1);
    carom_query_destroy(q);
    carom_world_destroy(w);
}

static void ask_everything(carom_query *q, int expected)
{
    const carom_vec2 v = {0, 0};
    const carom_shape disc = {1, 1, &v};
    const carom_pose at = {0, 0, 0};
    const carom_sweep motion = {at, {0, 9, 0}};
    const carom_box box = {{-1, -1}, {1, 1}};
    const carom_vec2 d = {1, 0};
    carom_near near;
    carom_ray_found ray;
    carom_cast_found cast;
    const carom_found *list;
    const carom_ray_found *rays;
    const carom_sensor_overlap *overlaps;
    int n = -1;
    assert_int_equal(carom_query_refresh(q), CAROM_OK);
    assert_int_equal(carom_query_nearest(q, NULL, &disc, at, HUGE_VAL, &near), CAROM_OK);
    assert_int_equal(near.who.body, expected - 1);
    assert_int_equal(carom_query_point(q, NULL, v, &n, &list), CAROM_OK);
    assert_int_equal(n, expected);
    assert_int_equal(carom_query_box(q, NULL, &box, &n, &list), CAROM_OK);
    assert_int_equal(n, expected);
    assert_int_equal(carom_query_overlaps(q, NULL, &disc, at, &n, &list), CAROM_OK);
    assert_int_equal(n, expected);
    assert_int_equal(carom_query_ray(q, NULL, v, d, &ray), CAROM_OK);
    assert_int_equal(ray.who.body, expected - 1);
    assert_int_equal(carom_query_ray_all(q, NULL, v, d, &n, &rays), CAROM_OK);
    assert_int_equal(n, expected);
    assert_int_equal(carom_query_cast(q, NULL, &disc, motion, 0, &cast), CAROM_OK);
    assert_int_equal(cast.who.body, expected - 1);
    assert_true(cast.at.hit == expected && cast.at.t == (expected ? 0 : 1));
    assert_int_equal(carom_query_sensors(q, &n, &overlaps), CAROM_OK);
    assert_int_equal(n, 0);
}

static void nothing_to_find(void **state)
{
    (void)state;
    for (int n_anchors = 0; n_anchors < 3; n_anchors++) {
        carom_world *w = scene_world(0, 0.01);
        carom_query *q;
        for (int k = 0; k < n_anchors; k++) scene_anchor(w); /* bodies without shapes */
        assert_int_equal(carom_world_seal(w), CAROM_OK);
        assert_int_equal(carom_query_create(w, NULL, &q), CAROM_OK);
        ask_everything(q, 0);
        carom_query_destroy(q);
        carom_world_destroy(w);
    }
    carom_world *w = scene_world(0, 0.01);
    carom_query *q;
    scene_disc(w, 1, 1, 0, 0, 0, 0);
    assert_int_equal(carom_world_seal(w), CAROM_OK);
    assert_int_equal(carom_query_create(w, NULL, &q), CAROM_OK);
    ask_everything(q, 1);
    carom_query_destroy(q);
    carom_world_destroy(w);
}

/* Discs of radius 1 at x = 0, 4, 8, 12, 16. */
static void closed_forms(void **state)
{
    (void)state;
    carom_world *w = scene_world(0, 0.01);
    carom_query *q;
    for (int k = 0; k < 5; k++) scene_disc(w, 1, 1, 4.0 * k, 0, 0, 0);
    assert_int_equal(carom_query_create(w, NULL, &q), CAROM_OK);
    assert_int_equal(carom_query_refresh(q), CAROM_OK);
    const carom_vec2 v = {0, 0};
    const carom_shape dot = {0, 1, &v};
    const carom_shape disc = {1, 1, &v};
    const carom_pose at = {0, 7, 4}; /* 3-4-5 and 1-4 */
    carom_near near;
    assert_int_equal(carom_query_nearest(q, NULL, &dot, at, HUGE_VAL, &near), CAROM_OK);
    assert_int_equal(near.who.body, 2);
    assert_near(near.at.distance, sqrt(17) - 1, 4 * DBL_EPSILON);
    assert_near(near.at.normal.x, 1 / sqrt(17), 4 * DBL_EPSILON);
    assert_int_equal(carom_query_nearest(q, NULL, &dot, at, 3.1, &near), CAROM_OK);
    assert_int_equal(near.who.body, -1);
    /* Through all, from outside: enters disc k at 4 k + 1 of 20. */
    const carom_vec2 o = {-2, 0};
    const carom_vec2 d = {20, 0};
    const carom_ray_found *rays;
    int n;
    assert_int_equal(carom_query_ray_all(q, NULL, o, d, &n, &rays), CAROM_OK);
    assert_int_equal(n, 5);
    for (int k = 0; k < 5; k++) {
        assert_int_equal(rays[k].who.body, k);
        assert_near_case("enter", k, rays[k].at.enter, (4 * k + 1) / 20.0, 4 * DBL_EPSILON);
        assert_near_case("leave", k, rays[k].at.leave, (4 * k + 3) / 20.0, 4 * DBL_EPSILON);
    }
    /* A disc falls onto disc 3 from (13, 10), off center by 1: stops at y = sqrt(4 - 1). */
    const carom_sweep fall = {{0, 13, 10}, {0, 13, 0}};
    carom_cast_found cast;
    assert_int_equal(carom_query_cast(q, NULL, &disc, fall, 0, &cast), CAROM_OK);
    assert_int_equal(cast.who.body, 3);
    assert_near(cast.at.t, (10 - sqrt(3)) / 10, 1e-11);
    carom_query_destroy(q);
    carom_world_destroy(w);
}

/* Two discs at one distance: the first in the world. */
static void ties(void **state)
{
    (void)state;
    carom_world *w = scene_world(0, 0.01);
    carom_query *q;
    scene_disc(w, 1, 1, 3, 0, 0, 0);
    scene_disc(w, 1, 1, -3, 0, 0, 0);
    scene_disc(w, 1, 1, 0, 3, 0, 0);
    scene_disc(w, 1, 1, 3, 0, 0, 0);
    assert_int_equal(carom_query_create(w, NULL, &q), CAROM_OK);
    assert_int_equal(carom_query_refresh(q), CAROM_OK);
    const carom_vec2 v = {0, 0};
    const carom_vec2 d = {9, 0};
    const carom_shape dot = {0, 1, &v};
    const carom_pose at = {0, 0, 0};
    carom_near near;
    carom_ray_found ray;
    assert_int_equal(carom_query_nearest(q, NULL, &dot, at, HUGE_VAL, &near), CAROM_OK);
    assert_int_equal(near.who.body, 0);
    assert_int_equal(carom_query_ray(q, NULL, v, d, &ray), CAROM_OK);
    assert_int_equal(ray.who.body, 0);
    carom_query_destroy(q);
    carom_world_destroy(w);
}

static void refuses(void **state)
{
    (void)state;
    carom_world *w = scene_world(0, 0.01);
    carom_query *q = NULL;
    const carom_vec2 v = {0, 0};
    const carom_vec2 nan = {NAN, 0};
    const carom_shape dot = {0, 1, &v};
    const carom_shape bad = {-1, 1, &v};
    const carom_pose at = {0, 0, 0};
    const carom_pose lost = {0, HUGE_VAL, 0};
    const carom_sweep motion = {at, at};
    const carom_sweep wild = {at, lost};
    carom_near near;
    carom_ray_found ray;
    carom_cast_found cast;
    const carom_found *list;
    const carom_ray_found *rays;
    const carom_sensor_overlap *overlaps;
    int n;
    assert_int_equal(carom_query_create(NULL, NULL, &q), CAROM_E_ARGUMENT);
    assert_null(q);
    assert_int_equal(carom_query_create(w, NULL, NULL), CAROM_E_ARGUMENT);
    assert_int_equal(carom_query_create(w, NULL, &q), CAROM_OK);
    assert_int_equal(carom_query_refresh(NULL), CAROM_E_ARGUMENT);
    assert_int_equal(carom_query_nearest(q, NULL, &dot, at, NAN, &near), CAROM_E_ARGUMENT);
    assert_int_equal(carom_query_nearest(q, NULL, &dot, lost, 1, &near), CAROM_E_ARGUMENT);
    assert_int_equal(carom_query_nearest(q, NULL, &bad, at, 1, &near), CAROM_E_SHAPE);
    assert_int_equal(carom_query_point(q, NULL, nan, &n, &list), CAROM_E_ARGUMENT);
    assert_int_equal(carom_query_box(q, NULL, NULL, &n, &list), CAROM_E_ARGUMENT);
    assert_int_equal(carom_query_overlaps(q, NULL, &bad, at, &n, &list), CAROM_E_SHAPE);
    assert_int_equal(carom_query_ray(q, NULL, nan, v, &ray), CAROM_E_ARGUMENT);
    assert_int_equal(carom_query_ray_all(q, NULL, v, nan, &n, &rays), CAROM_E_ARGUMENT);
    assert_int_equal(carom_query_cast(q, NULL, &dot, wild, 0, &cast), CAROM_E_ARGUMENT);
    assert_int_equal(carom_query_cast(q, NULL, &dot, motion, -1, &cast), CAROM_E_ARGUMENT);
    assert_int_equal(carom_query_cast(q, NULL, &bad, motion, 0, &cast), CAROM_E_SHAPE);
    assert_int_equal(carom_query_sensors(q, &n, &overlaps), CAROM_E_STATE); /* not sealed */
    carom_query_destroy(q);
    carom_query_destroy(NULL);
    carom_world_destroy(w);
}

/* Every refusal of memory is told; afterwards the query works or sees nothing.  A second round of
 * questions allocates nothing. */
static void memory(void **state)
{
    (void)state;
    rng r = rng_from(12);
    scene *s = random_scene(&r, 100, 3);
    assert_int_equal(carom_world_seal(s->world), CAROM_OK);
    const carom_box all = {{-HUGE_VAL, -HUGE_VAL}, {HUGE_VAL, HUGE_VAL}};
    const carom_vec2 o = {-9, 0.5};
    const carom_vec2 d = {18, 0};
    carom_who who = carom_who_defaults();
    who.filter.category = 7;
    who.sensors = who.idle = 1;
    int failed = 1;
    for (long k = 0; failed; k++) {
        alloc_fail a = alloc_fail_at(k);
        const carom_allocator from = alloc_fail_allocator(&a);
        carom_query *q = NULL;
        const carom_found *list;
        const carom_ray_found *rays;
        const carom_sensor_overlap *overlaps;
        int n = 0;
        carom_status e = carom_query_create(s->world, &from, &q);
        if (!e) e = carom_query_refresh(q);
        if (!e) e = carom_query_box(q, &who, &all, &n, &list);
        if (!e) assert_true(n > 20);
        if (!e) e = carom_query_ray_all(q, &who, o, d, &n, &rays);
        if (!e) e = carom_query_sensors(q, &n, &overlaps);
        assert_int_equal(e, a.n_failed ? CAROM_E_MEMORY : CAROM_OK);
        failed = e < 0;
        if (!failed) {
            const long calls = a.n_calls;
            assert_int_equal(carom_query_refresh(q), CAROM_OK);
            assert_int_equal(carom_query_box(q, &who, &all, &n, &list), CAROM_OK);
            assert_int_equal(carom_query_ray_all(q, &who, o, d, &n, &rays), CAROM_OK);
            assert_int_equal(carom_query_sensors(q, &n, &overlaps), CAROM_OK);
            assert_int_equal(a.n_calls, calls);
        }
        carom_query_destroy(q);
        assert_int_equal(a.live, 0);
        assert_int_equal(a.n_bad_sizes, 0);
    }
    free_scene(s);
}

/* Against every pair of shapes. */
static void sensors_against_all_pairs(void **state)
{
    (void)state;
    rng r = rng_from(13);
    scene *s = random_scene(&r, 200, 8);
    assert_int_equal(carom_world_seal(s->world), CAROM_OK);
    const carom_sensor_overlap *list;
    int n;
    int m = 0;
    assert_int_equal(carom_query_refresh(s->query), CAROM_OK);
    assert_int_equal(carom_query_sensors(s->query, &n, &list), CAROM_OK);
    for (int i = 0; i < s->n; i++) {
        const carom_body_def *a = &s->bodies[i].def;
        for (int ia = 0; a->sensor && ia < a->n_shapes; ia++) {
            for (int j = 0; j < s->n; j++) {
                const carom_body_def *b = &s->bodies[j].def;
                if (i == j || (b->sensor && j < i) || !a->collide || !b->collide) continue;
                if (a->type == CAROM_STATIC && b->type == CAROM_STATIC) continue;
                if (!meet(&a->filter, &b->filter)) continue;
                for (int jb = 0; jb < b->n_shapes; jb++) {
                    if (carom_shape_distance(&a->shapes[ia], a->pose, &b->shapes[jb], b->pose)
                            .distance > 0) {
                        continue;
                    }
                    const carom_found f = {i, ia};
                    const carom_found g = {j, jb};
                    assert_true(m < n);
                    assert_found("sensor", m, list[m].sensor, f);
                    assert_found("sensed", m, list[m].other, g);
                    m++;
                }
            }
        }
    }
    assert_int_equal(m, n);
    assert_true(n > 50);
    free_scene(s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(against_all_shapes),
        cmocka_unit_test(sees_as_of_refresh),
        cmocka_unit_test(nothing_to_find),
        cmocka_unit_test(closed_forms),
        cmocka_unit_test(ties),
        cmocka_unit_test(refuses),
        cmocka_unit_test(memory),
        cmocka_unit_test(sensors_against_all_pairs),
    };
    the_scene = malloc(sizeof *the_scene);
    if (!the_scene) return 1;
    const int failures = cmocka_run_group_tests(tests, NULL, NULL);
    free(the_scene);
    return failures;
}
