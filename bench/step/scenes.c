#include "scene.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static int add(scene *s, scene_body b)
{
    if (s->n_bodies == s->max_bodies) {
        s->max_bodies = 2 * s->max_bodies + 16;
        s->bodies = realloc(s->bodies, (size_t)s->max_bodies * sizeof *s->bodies);
        if (!s->bodies) abort();
    }
    s->bodies[s->n_bodies] = b;
    return s->n_bodies++;
}

static scene_body disc(double x, double y, double radius, double restitution)
{
    const double mass = 3.14159265358979323846 * radius * radius;
    const scene_body b = {1,         SHAPE_DISC, radius, radius,
                          {0, x, y}, {0, 0, 0},  mass,   0.5 * mass * radius * radius,
                          0.5,       restitution};
    return b;
}

static scene_body box(double x, double y, double hx, double hy)
{
    const double mass = 4 * hx * hy;
    const scene_body b = {
        1, SHAPE_BOX, hx, hy, {0, x, y}, {0, 0, 0}, mass, mass * (hx * hx + hy * hy) / 3, 0.5, 0};
    return b;
}

/* A static box. */
static scene_body slab(double x, double y, double hx, double hy, double restitution)
{
    scene_body b = box(x, y, hx, hy);
    b.moves = 0;
    b.restitution = restitution;
    return b;
}

static scene_body anchor(void)
{
    scene_body b = box(0, 0, 1, 1);
    b.moves = 0;
    b.shape = SHAPE_NONE;
    return b;
}

static scene empty(const char *name, int rests, int warm_up, int n_steps)
{
    scene s;
    memset(&s, 0, sizeof s);
    s.name = name;
    s.gravity = 9.81;
    s.dt = 1.0 / 60;
    s.rests = rests;
    s.warm_up = warm_up;
    s.n_steps = n_steps;
    return s;
}

static scene free_body(void)
{
    scene s = empty("free body", 0, 0, 240);
    const int b = add(&s, disc(0, 0, 0.5, 0));
    s.bodies[b].v[0] = 3;
    s.bodies[b].v[2] = 20;
    return s;
}

static scene bouncing_ball(void)
{
    scene s = empty("bouncing ball", 0, 0, 240);
    add(&s, slab(0, -1, 20, 1, 0.8));
    add(&s, disc(0, 1.5, 0.5, 0.8));
    return s;
}

static scene two_bodies(void)
{
    scene s = empty("two bodies: a disc rolls on a box", 0, 0, 240);
    add(&s, slab(0, -1, 20, 1, 0));
    add(&s, box(0, 0.5, 2, 0.5));
    const int b = add(&s, disc(-1.5, 1.25, 0.25, 0));
    s.bodies[b].v[0] = -2;
    s.bodies[b].v[1] = 0.5;
    return s;
}

static scene chain(const char *name, int n)
{
    scene s = empty(name, 0, 0, 240);
    int last = add(&s, anchor());
    for (int k = 0; k < n; k++) {
        const int link = add(&s, box(k + 0.5, 0, 0.5, 0.05));
        add_pin(&s, last, link, k, 0);
        last = link;
    }
    return s;
}

static scene stack(const char *name, int n)
{
    scene s = empty(name, 1, 60, 240);
    add(&s, slab(0, -1, 20, 1, 0));
    for (int k = 0; k < n; k++) add(&s, box(0, k + 0.5, 0.5, 0.5));
    return s;
}

static scene pyramid(const char *name, int base, int n_steps)
{
    scene s = empty(name, 1, n_steps, n_steps);
    add(&s, slab(0, -1, base + 10, 1, 0));
    for (int row = 0; row < base; row++) {
        for (int k = 0; k < base - row; k++) {
            add(&s, box(k - 0.5 * (base - row - 1), row + 0.5, 0.45, 0.5));
        }
    }
    return s;
}

/* A pendulum swings at the center of a box: what bears it is pressed anew in every step. */
static void hang_pendulum(scene *s, int from)
{
    const double *q = s->bodies[from].q;
    scene_body bob = box(q[1] + 0.3, q[2] - 0.4, 0.1, 0.1);
    bob.shape = SHAPE_NONE;
    const double x = q[1];
    const double y = q[2];
    add_pin(s, from, add(s, bob), x, y);
    s->rests = 0;
}

static scene loaded(scene s)
{
    hang_pendulum(&s, s.n_bodies - 1);
    return s;
}

/* 25 columns of discs with some play fall into a box. */
static scene pile(const char *name, int n)
{
    scene s = empty(name, 0, 0, 240);
    const double r = 0.1;
    const int n_columns = 25;
    const double w = n_columns * 2.2 * r;
    add(&s, slab(0, -1, w / 2 + 2, 1, 0));
    add(&s, slab(-w / 2 - 1, 10, 1, 10, 0));
    add(&s, slab(w / 2 + 1, 10, 1, 10, 0));
    for (int k = 0; k < n; k++) {
        const int column = k % n_columns;
        const int row = k / n_columns;
        const double x = (column + 0.5) * 2.2 * r - w / 2;
        const double y = r * (1 + 2.2 * row);
        add(&s, disc(x + 0.09 * r * sin(12.9898 * k), y, r * (0.9 + 0.1 * cos(78.233 * k)), 0));
    }
    return s;
}

static scene many_free(const char *name, int n)
{
    scene s = empty(name, 0, 5, 20);
    const int side = (int)sqrt(n);
    for (int k = 0; k < n; k++) {
        const int b = add(&s, disc(3 * (k % side), 3 * (k / side), 0.5, 0));
        s.bodies[b].v[1] = 0.5 * sin(12.9898 * k);
        s.bodies[b].v[2] = 0.5 * cos(78.233 * k);
    }
    return s;
}

scene make_scene(int k)
{
    switch (k) {
    case 0: return free_body();
    case 1: return bouncing_ball();
    case 2: return two_bodies();
    case 3: return chain("pendulum", 1);
    case 4: return chain("chain of 10", 10);
    case 5: return stack("stack of 10 at rest", 10);
    case 6: return pyramid("pyramid 20 at rest", 20, 60);
    case 7: return pyramid("pyramid 50 at rest", 50, 30);
    case 8: return pyramid("pyramid 100 at rest", 100, 10);
    case 9: return pile("pile of 1000 discs settling", 1000);
    case 10: return many_free("1e5 free bodies", 100000);
    default: return loaded(pyramid("pyramid 20 under a pendulum", 20, 60));
    }
}

/* Stacks of so many boxes, 3 m apart; with or without a pendulum at each. */
static scene stacks(const char *name, int n, int height, int swings)
{
    scene s = empty(name, !swings, 60, 240);
    const int size = height + swings;
    const int columns = n / size > 1 ? n / size : 1;
    add(&s, slab(1.5 * columns, -1, 1.5 * columns + 20, 1, 0));
    for (int c = 0; c < columns; c++) {
        for (int k = 0; k < height && c * size + k < n; k++) {
            add(&s, box(3 * c, k + 0.5, 0.5, 0.5));
        }
        if (swings) hang_pendulum(&s, s.n_bodies - 1);
    }
    return s;
}

/* Arms of 1 m around a disc that turns. */
static scene hub(int n)
{
    scene s = empty("hub", 0, 0, 240);
    const double radius = 1 + 0.05 * n;
    const int center = add(&s, disc(0, 0, radius, 0));
    s.gravity = 0;
    s.bodies[center].v[0] = 1;
    for (int k = 1; k < n; k++) {
        const double a = 2 * 3.14159265358979323846 * k / (n - 1);
        scene_body b = box((radius + 0.5) * cos(a), (radius + 0.5) * sin(a), 0.5, 0.02);
        b.q[0] = a;
        const int arm = add(&s, b);
        add_pin(&s, center, arm, radius * cos(a), radius * sin(a));
    }
    return s;
}

const char *const FAMILY_NAMES[N_FAMILIES] = {"free", "chain",   "stack", "pyramid",
                                              "pile", "islands", "rest",  "hub"};

scene make_family(int k, int n)
{
    const int base = (int)(0.5 * (sqrt(8.0 * n + 1) - 1) + 0.5);
    switch (k) {
    case 0: return many_free("free", n);
    case 1: return chain("chain", n);
    case 2: return loaded(stack("stack", n));
    case 3: return loaded(pyramid("pyramid", base, 60));
    case 4: return pile("pile", n);
    case 5: return stacks("islands", n, 3, 1);
    case 6: return stacks("rest", n, 4, 0);
    default: return hub(n);
    }
}
