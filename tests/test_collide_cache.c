/* The pair cache changes nothing: the same bits with and without it, along paths of poses. */
#include "carom/collide.h"
#include "near.h"
#include "rng.h"

#include <float.h>
#include <string.h>

enum { MAX_N = 64, N_STEPS = 100000 };

static const double PI = 3.14159265358979323846;

typedef struct body {
    carom_shape shape;
    carom_vec2 v[MAX_N];
} body;

static void random_body(rng *r, body *b)
{
    const int few = rng_int(r, 3);
    b->shape.vertices = b->v;
    b->shape.count = 1 + rng_int(r, few ? 6 : MAX_N);
    b->shape.radius = b->shape.count == 1 || rng_int(r, 2) ? rng_uniform(r, 0.05, 0.5) : 0;
    const double start = rng_uniform(r, 0, 6);
    const double thin = rng_int(r, 4) ? rng_uniform(r, 0.2, 1) : 1e-3;
    for (int i = 0; i < b->shape.count; i++) {
        const double t = start + 2 * PI * (i + rng_uniform(r, -0.3, 0.3)) / b->shape.count;
        b->v[i].x = 0.3 + cos(t);
        b->v[i].y = thin * sin(t);
    }
}

static int same_vec(carom_vec2 a, carom_vec2 b)
{
    return a.x == b.x && a.y == b.y;
}

static int same_recipe(carom_recipe a, carom_recipe b)
{
    return a.ref == b.ref && a.inc == b.inc && a.kernel == b.kernel && a.flipped == b.flipped &&
           a.at_end == b.at_end;
}

static int same(const carom_manifold *m, const carom_manifold *n)
{
    int equal = m->count == n->count && m->ambiguous == n->ambiguous &&
                m->distance == n->distance && same_vec(m->normal, n->normal);
    for (int i = 0; equal && i < m->count; i++) {
        const carom_contact_point *p = &m->points[i];
        const carom_contact_point *q = &n->points[i];
        equal = p->gap == q->gap && same_vec(p->arm_a, q->arm_a) && same_vec(p->arm_b, q->arm_b) &&
                same_recipe(p->recipe, q->recipe);
    }
    return equal;
}

/* How often it mattered. */
typedef struct tally {
    long n;
    long contacts;
    long overlaps;
    long beyond;
} tally;

static void compare(const char *name, long step, const body *a, carom_pose qa, const body *b,
                    carom_pose qb, double margin, carom_pair_cache *cache, tally *t)
{
    const carom_frame fa = carom_frame_at(qa);
    const carom_frame fb = carom_frame_at(qb);
    const carom_manifold m = carom_collide(&a->shape, qa, &b->shape, qb, margin);
    const carom_manifold c = carom_collide_frames(&a->shape, &fa, &b->shape, &fb, margin, cache);
    t->n++;
    t->contacts += m.count > 0;
    t->overlaps += m.count > 0 && m.distance < 0;
    t->beyond += m.count == 0;
    if (m.count) {
        if (!same(&m, &c)) {
            fail_msg("%s, step %ld: distance %.17g, %d points; without the cache %.17g, %d", name,
                     step, c.distance, c.count, m.distance, m.count);
        }
        return;
    }
    assert_int_equal(c.count, 0);
    if (c.distance > margin * (1 - 4 * DBL_EPSILON)) {
        /* A lower bound of the true distance. */
        const carom_manifold far = carom_collide(&a->shape, qa, &b->shape, qb, HUGE_VAL);
        assert_true(c.distance <= far.distance + 1e-13);
        return;
    }
    fail_msg("%s, step %ld: apart, but only by %g", name, step, c.distance);
}

/* B wanders around A: a random walk with steps of every size, pulled back, with a jump now and
 * then. */
static void wander(rng *r, double size, carom_pose *q)
{
    const double step = size * pow(10, rng_uniform(r, -9, -1));
    q->x += step * rng_uniform(r, -1, 1) - 1e-3 * step * q->x;
    q->y += step * rng_uniform(r, -1, 1) - 1e-3 * step * q->y;
    q->angle += step * rng_uniform(r, -1, 1);
    if (rng_int(r, 500)) return;
    q->x = rng_uniform(r, -2, 2);
    q->y = rng_uniform(r, -2, 2);
    q->angle = rng_uniform(r, -4, 4);
}

static void random_walks(void **state)
{
    (void)state;
    rng r = rng_from(1);
    tally t = {0, 0, 0, 0};
    for (int path = 0; path < 40; path++) {
        body a;
        body b;
        carom_pair_cache cache = {0};
        random_body(&r, &a);
        random_body(&r, &b);
        carom_pose qa = {0, 0, 0};
        carom_pose qb = {0, 1.5, 0};
        for (long step = 0; step < N_STEPS / 20; step++) {
            wander(&r, 1, &qb);
            wander(&r, 0.1, &qa);
            compare("walk", step, &a, qa, &b, qb, 0.05, &cache, &t);
        }
    }
    assert_true(t.contacts > t.n / 5 && t.overlaps > t.n / 10 && t.beyond > t.n / 5);
}

/* One long path: a 64-gon rolls around a box, in and out of contact. */
static void long_roll(void **state)
{
    (void)state;
    const carom_vec2 box[4] = {{-1, -0.5}, {1, -0.5}, {1, 0.5}, {-1, 0.5}};
    body a = {{0.1, 4, NULL}, {{0, 0}}};
    body b = {{0, MAX_N, NULL}, {{0, 0}}};
    a.shape.vertices = a.v;
    b.shape.vertices = b.v;
    memcpy(a.v, box, sizeof box);
    for (int i = 0; i < MAX_N; i++) {
        b.v[i].x = cos(2 * PI * i / MAX_N);
        b.v[i].y = sin(2 * PI * i / MAX_N);
    }
    carom_pair_cache cache = {0};
    tally t = {0, 0, 0, 0};
    for (long step = 0; step < N_STEPS; step++) {
        const double s = (double)step / N_STEPS;
        const carom_pose qa = {3 * s, 1e6, 0};
        const double away = 1.9 + 0.5 * sin(300 * s);
        const carom_pose qb = {40 * s, 1e6 + away * cos(9 * s), away * sin(9 * s)};
        compare("roll", step, &a, qa, &b, qb, 0.02, &cache, &t);
    }
    assert_true(t.contacts > N_STEPS / 4 && t.overlaps > N_STEPS / 8 && t.beyond > N_STEPS / 8);
}

/* Parallel faces, exact ties, corners over corners: steps of 1/8 on a lattice, quarter turns. */
static void lattice_moves(void **state)
{
    (void)state;
    rng r = rng_from(3);
    tally t = {0, 0, 0, 0};
    for (int path = 0; path < 20; path++) {
        body a = {{0, 4, NULL}, {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}}};
        body b = {{0, 4, NULL}, {{-2, -0.5}, {2, -0.5}, {2, 0.5}, {-2, 0.5}}};
        if (path % 3 == 1) b.shape.count = 2;
        if (path % 3 == 2) a.shape.radius = 0.25;
        a.shape.vertices = a.v;
        b.shape.vertices = b.v;
        carom_pair_cache cache = {0};
        const carom_pose qa = {0, 0, 0};
        carom_pose qb = {0, 0, 2};
        for (long step = 0; step < N_STEPS / 20; step++) {
            qb.x += (rng_int(&r, 3) - 1) / 8.0;
            qb.y += (rng_int(&r, 3) - 1) / 8.0;
            if (rng_int(&r, 50) == 0) qb.angle += PI / 2;
            if (fabs(qb.x) > 4) qb.x = 0;
            if (fabs(qb.y) > 3) qb.y = 0;
            compare("lattice", step, &a, qa, &b, qb, 0.25, &cache, &t);
        }
    }
    assert_true(t.contacts > t.n / 4 && t.overlaps > t.n / 8 && t.beyond > t.n / 20);
}

/* A cache that another pair filled does no harm as long as its proofs are not of motion. */
static void foreign_indices(void **state)
{
    (void)state;
    rng r = rng_from(4);
    for (int k = 0; k < 20000; k++) {
        body a;
        body b;
        random_body(&r, &a);
        random_body(&r, &b);
        carom_pair_cache cache = {0};
        cache.kind = 1 + rng_int(&r, 3);
        cache.a = rng_int(&r, 80);
        cache.b = rng_int(&r, 80);
        const carom_pose qa = {rng_uniform(&r, -3, 3), 0, 0};
        const carom_pose qb = {rng_uniform(&r, -3, 3), rng_uniform(&r, -2, 2),
                               rng_uniform(&r, -2, 2)};
        tally t = {0, 0, 0, 0};
        compare("foreign", k, &a, qa, &b, qb, 0.3, &cache, &t);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(random_walks),
        cmocka_unit_test(long_roll),
        cmocka_unit_test(lattice_moves),
        cmocka_unit_test(foreign_indices),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
