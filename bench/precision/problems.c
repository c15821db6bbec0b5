#include "problems.h"

#include <math.h>
#include <stdlib.h>

static const double PI = 3.14159265358979323846;
static const double G = 9.81;

enum { ROOM = 1300, N_VOUSSOIRS = 20 };

static scene make(const char *name)
{
    scene s = {0};
    s.name = name;
    s.gravity = G;
    s.max_bodies = ROOM;
    s.bodies = calloc(ROOM, sizeof *s.bodies);
    if (!s.bodies) abort();
    return s;
}

/* Of density 1, as the peers weigh it. */
static int disc(scene *s, double r, double x, double y, double friction, double restitution)
{
    const double m = PI * r * r;
    const scene_body b = {1, SHAPE_DISC,      r,        r,          {0, x, y}, {0, 0, 0},
                          m, 0.5 * m * r * r, friction, restitution};
    s->bodies[s->n_bodies] = b;
    return s->n_bodies++;
}

static int box(scene *s, double hx, double hy, double angle, double x, double y, double friction)
{
    const double m = 4 * hx * hy;
    const scene_body b = {
        1,        SHAPE_BOX, hx, hy, {angle, x, y}, {0, 0, 0}, m, m * (hx * hx + hy * hy) / 3,
        friction, 0};
    s->bodies[s->n_bodies] = b;
    return s->n_bodies++;
}

static void floor_at_zero(scene *s, double friction, double restitution)
{
    const int b = box(s, 20, 1, 0, 0, -1, friction);
    s->bodies[b].moves = 0;
    s->bodies[b].restitution = restitution;
}

static int links(scene *s, int n, double first, double more)
{
    double x = 0;
    double y = 0;
    int before = box(s, 1, 1, 0, 0, 0, 0);
    s->bodies[before].moves = 0;
    s->bodies[before].shape = SHAPE_NONE;
    for (int k = 0; k < n; k++) {
        const double a = first + more * k;
        add_pin(s, before, before + 1, x, y);
        before = box(s, 0.05, 0.5, a, x + 0.5 * sin(a), y - 0.5 * cos(a), 0);
        x += sin(a);
        y -= cos(a);
    }
    return before;
}

static void end_at(problem *p, double angle, double x, double y)
{
    p->exact[0] = angle;
    p->exact[1] = x;
    p->exact[2] = y;
}

/* Stops after v^2 / (2 mu g). */
static problem sliding_stop(void)
{
    problem p = {"sliding stop", make("slide"), 1.0, 1, 0.5, MOTION_CLOSED, {0}, 0, 0, 0};
    floor_at_zero(&p.s, 0.5, 0);
    box(&p.s, 0.5, 0.25, 0, 0, 0.25, 0.5);
    p.s.bodies[1].v[1] = 3;
    end_at(&p, 0, 9 / (2 * 0.5 * G), 0.25);
    return p;
}

/* Slides until v / (3 mu g), then rolls at 2 v / 3. */
void ends_rolling(problem *p, double friction)
{
    const scene_body *b = &p->s.bodies[p->body];
    const double g = p->s.gravity;
    const double slide = b->v[1] / (3 * friction * g);
    const double spin = 2 * friction * g / b->hx; /* while it slides */
    const double rolls = p->duration - slide;
    const double speed = 2 * b->v[1] / 3;
    end_at(p, b->q[0] - (0.5 * spin * slide * slide + speed / b->hx * rolls),
           b->q[1] + (b->v[1] - 0.5 * friction * g * slide) * slide + speed * rolls, b->hx);
}

static problem slide_to_roll(void)
{
    problem p = {"slide to roll", make("roll"), 1.0, 1, 0.5, MOTION_CLOSED, {0}, 0, 0, 0};
    floor_at_zero(&p.s, 0.3, 0);
    disc(&p.s, 0.5, 0, 0.5, 0.3, 0);
    p.s.bodies[1].v[1] = 3;
    ends_rolling(&p, 0.3);
    return p;
}

void ends_bouncing(problem *p)
{
    const scene_body *b = &p->s.bodies[p->body];
    const double g = p->s.gravity;
    double v = sqrt(2 * g * (b->q[2] - b->hx));
    double t = p->duration - v / g;
    for (v *= b->restitution; t > 2 * v / g; v *= b->restitution) t -= 2 * v / g;
    end_at(p, b->q[0], b->q[1], b->hx + v * t - 0.5 * g * t * t);
}

/* Three bounces of restitution 0.8. */
static problem bounce(void)
{
    problem p = {"bounce", make("bounce"), 2.0, 1, 0.25, MOTION_CLOSED, {0}, 0, 0, 0};
    floor_at_zero(&p.s, 0.5, 0.8);
    disc(&p.s, 0.25, 0, 1.25, 0.5, 0.8);
    ends_bouncing(&p);
    return p;
}

/* A disc meets the floor without gravity and sticks to it: v_t = 2/3 of before, v_n = -e of before.
 */
static problem oblique_impact(void)
{
    problem p = {"oblique impact", make("oblique"), 1.0, 1, 0.5, MOTION_CLOSED, {0}, 0, 0, 0};
    p.s.gravity = 0;
    floor_at_zero(&p.s, 0.6, 0.5);
    disc(&p.s, 0.5, 0, 1, 0.6, 0.5);
    p.s.bodies[1].v[1] = 1;
    p.s.bodies[1].v[2] = -1.5;
    const double t = 0.5 / 1.5;
    const double left = 1 - t;
    end_at(&p, -(2.0 / 3) / 0.5 * left, t + 2.0 / 3 * left, 0.5 + 0.75 * left);
    return p;
}

static problem swing(const char *name, int n, double duration)
{
    problem p = {name, make(name), duration, 0, 0.5, MOTION_LINKS, {0}, 0, 0, 0};
    p.body = links(&p.s, n, 1, 0.2);
    return p;
}

/* Rolls, slips and leaves. */
static problem disc_on_disc(void)
{
    problem p = {"disc off disc", make("disc"), 1.0, 1, 0.3, MOTION_DISC, {0}, 0, 0, 0};
    disc(&p.s, 1, 0, 0, 0.9, 0);
    p.s.bodies[0].moves = 0;
    disc(&p.s, 0.3, 1.3 * sin(0.3), 1.3 * cos(0.3), 0.9, 0);
    return p;
}

/* Rocks from foot to foot. */
static problem rocking(void)
{
    problem p = {"rocking block", make("rocking"), 1.0, 1, 0.5, MOTION_ROCK, {0}, 0, 0, 0};
    floor_at_zero(&p.s, 0.9, 0);
    box(&p.s, 0.2, 0.5, 0.15, 0, 0.2 * sin(0.15) + 0.5 * cos(0.15), 0.9);
    return p;
}

/* What stands stays: the error is how far one body has moved. */
static problem ground(const char *name, int body)
{
    problem p = {name, make(name), 2.0, body, 0.5, MOTION_CLOSED, {0}, 0, 0, 0};
    floor_at_zero(&p.s, 0.5, 0);
    return p;
}

void rests(problem *p)
{
    const double *q = p->s.bodies[p->body].q;
    end_at(p, q[0], q[1], q[2]);
    p->rests = 1;
}

/* A box on a slope that friction holds, at 0.98 of the angle of friction. */
static problem incline(void)
{
    problem p = ground("incline at 0.98", 1);
    const double a = atan(0.98 * 0.5);
    p.s.bodies[0].q[0] = a;
    p.s.bodies[0].q[1] = sin(a);
    p.s.bodies[0].q[2] = -cos(a);
    box(&p.s, 0.5, 0.25, a, -0.25 * sin(a), 0.25 * cos(a), 0.5);
    rests(&p);
    return p;
}

/* Five balls of one mass with small gaps, e = 1, no gravity: they exchange their speeds, so that
 * the last one ends where the first would be, had it gone through, and each stands where the one
 * behind it was when they met. */
static problem cradle(void)
{
    static const double gap = 0.01;
    problem p = {"cradle with gaps", make("cradle"), 1.0, 4, 0.25, MOTION_CLOSED, {0}, 0, 0, 0};
    p.s.gravity = 0;
    for (int k = 0; k < 5; k++) disc(&p.s, 0.25, (0.5 + gap) * k, 0, 0, 1);
    p.s.bodies[0].v[1] = 2;
    end_at(&p, 0, p.s.bodies[4].q[1] + 2 - 4 * gap, 0);
    return p;
}

static problem stack(const char *name, int n)
{
    problem p = ground(name, n);
    for (int k = 0; k < n; k++) box(&p.s, 0.5, 0.5, 0, 0, k + 0.5, 0.5);
    rests(&p);
    return p;
}

/* Each box `ratio` times as heavy as the one below. */
static problem tower(const char *name, int n, double ratio)
{
    problem p = stack(name, n);
    double m = 1;
    for (int k = 1; k <= n; k++, m *= ratio) {
        p.s.bodies[k].mass = m;
        p.s.bodies[k].inertia = m / 6;
    }
    return p;
}

static problem pyramid(const char *name, int base)
{
    problem p = ground(name, base * (base + 1) / 2);
    p.s.bodies[0].hx = fmax(p.s.bodies[0].hx, 0.5 * base + 10); /* all of it stands on the floor */
    for (int row = 0; row < base; row++) {
        for (int k = 0; k < base - row; k++) {
            box(&p.s, 0.45, 0.5, 0, k - 0.5 * (base - 1 - row), row + 0.5, 0.5);
        }
    }
    rests(&p);
    return p;
}

/* One voussoir between the angles a and b of a ring; of density 1, about its center. */
static void voussoir(scene *s, double inner, double outer, double a, double b)
{
    const double c[4][2] = {{inner * cos(a), inner * sin(a)},
                            {outer * cos(a), outer * sin(a)},
                            {outer * cos(b), outer * sin(b)},
                            {inner * cos(b), inner * sin(b)}};
    double m = 0;
    double about[3] = {0}; /* first moments, then the polar one */
    for (int i = 0; i < 4; i++) {
        const double *x = c[i];
        const double *y = c[(i + 1) % 4];
        const double cross = x[0] * y[1] - x[1] * y[0];
        m += cross / 2;
        for (int d = 0; d < 2; d++) {
            about[d] += cross * (x[d] + y[d]) / 6;
            about[2] += cross * (x[d] * x[d] + x[d] * y[d] + y[d] * y[d]) / 12;
        }
    }
    const double q[2] = {about[0] / m, about[1] / m};
    const scene_body body = {1,
                             SHAPE_POLYGON,
                             0,
                             0,
                             {0, q[0], q[1]},
                             {0},
                             m,
                             about[2] - m * (q[0] * q[0] + q[1] * q[1]),
                             2,
                             0};
    scene_polygon *shape = &s->polygons[s->n_bodies];
    shape->n = 4;
    shape->corners = malloc(4 * sizeof *shape->corners);
    if (!shape->corners) abort();
    for (int i = 0; i < 4; i++) {
        for (int d = 0; d < 2; d++) shape->corners[i][d] = c[i][d] - q[d];
    }
    s->bodies[s->n_bodies++] = body;
}

/* A semicircle of twenty voussoirs stands: its least t / R is .107 (docs/math/equations.md, 6). */
static problem arch(void)
{
    problem p = ground("arch t/R 0.12", N_VOUSSOIRS / 2);
    p.s.polygons = calloc(ROOM, sizeof *p.s.polygons);
    if (!p.s.polygons) abort();
    p.s.bodies[0].friction = 2;
    for (int k = 0; k < N_VOUSSOIRS; k++) {
        voussoir(&p.s, 4.7, 5.3, PI * k / N_VOUSSOIRS, PI * (k + 1) / N_VOUSSOIRS);
    }
    rests(&p);
    return p;
}

/* A ball 1e4 times as heavy as a link hangs on a hundred links. */
static problem heavy_chain(void)
{
    problem p = {
        "heavy ball on 100 links", make("heavy chain"), 1.0, 0, 0.5, MOTION_CLOSED, {0}, 0, 0, 0};
    const int last = links(&p.s, 100, 0, 0);
    p.body = disc(&p.s, 0.5, 0, -100.5, 0, 0);
    p.s.bodies[p.body].mass = 1e4 * p.s.bodies[last].mass;
    p.s.bodies[p.body].inertia = 0.125 * p.s.bodies[p.body].mass;
    add_pin(&p.s, last, p.body, 0, -100);
    rests(&p);
    return p;
}

/* A ball meets a rack of fifteen that almost touch: no friction, e = 1, no gravity.  Every impact
 * widens an error several times. */
static problem billiard_break(void)
{
    static const double r = 0.028;
    static const double pitch = 0.057; /* of centers: a gap of 1 mm */
    problem p = {"billiard break", make("break"), 0.5, 15, r, MOTION_BILLIARD, {0}, 0, 0, 0};
    p.s.gravity = 0;
    disc(&p.s, r, -0.5, 0.004, 0, 1);
    p.s.bodies[0].v[1] = 5;
    for (int row = 0; row < 5; row++) {
        for (int k = 0; k <= row; k++) {
            disc(&p.s, r, pitch * row * sqrt(0.75), pitch * (k - 0.5 * row), 0, 1);
        }
    }
    return p;
}

static problem make_rest(int k)
{
    switch (k) {
    case 0: return incline();
    case 1: return cradle();
    case 2: return stack("stack of 10", 10);
    case 3: return stack("stack of 100", 100);
    case 4: return tower("mass ratio 1e3", 2, 1e3);
    case 5: return tower("tower 1 to 1e6", 7, 10);
    case 6: return pyramid("pyramid 20", 20);
    case 7: return tower("mass ratio 1e6", 2, 1e6);
    case 8: return pyramid("pyramid 50", 50);
    case 9: return arch();
    default: return heavy_chain();
    }
}

problem make_problem(int k)
{
    if (k == N_PROBLEMS - 1) return billiard_break();
    if (k >= 9) return make_rest(k - 9);
    switch (k) {
    case 0: return sliding_stop();
    case 1: return slide_to_roll();
    case 2: return bounce();
    case 3: return oblique_impact();
    case 4: return swing("pendulum", 1, 1);
    case 5: return swing("double pendulum", 2, 1);
    case 6: return swing("chain of 10", 10, 1);
    case 7: return disc_on_disc();
    default: return rocking();
    }
}

void free_problem(problem *p)
{
    free_scene(&p->s);
}
