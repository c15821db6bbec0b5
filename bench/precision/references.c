/* Minimal coordinates, the classical method of order 4 in long double, events by bisection. */
#include "references.h"
#include "billiard.h"

#include <math.h>
#include <string.h>

typedef long double real;

enum { MAX_LINKS = 10, MAX_STATE = 2 * MAX_LINKS, N_STEPS = 8000, N_HALVINGS = 70 };
static const real G = 9.81L;

/* y' = rate(y); a phase ends where event(y) falls below 0. */
typedef struct motion {
    int n; /* numbers in y */
    void (*rate)(const problem *p, int n, const real *y, real *f);
    real (*event)(const problem *p, const real *y);
    const problem *p;
} motion;

static void add(int n, const real *y, real h, const real *f, real *out)
{
    for (int k = 0; k < n; k++) out[k] = y[k] + h * f[k];
}

static void advance(const motion *m, real h, real *y)
{
    real f[4][MAX_STATE];
    real z[MAX_STATE];
    m->rate(m->p, m->n, y, f[0]);
    add(m->n, y, h / 2, f[0], z);
    m->rate(m->p, m->n, z, f[1]);
    add(m->n, y, h / 2, f[1], z);
    m->rate(m->p, m->n, z, f[2]);
    add(m->n, y, h, f[2], z);
    m->rate(m->p, m->n, z, f[3]);
    for (int k = 0; k < m->n; k++) {
        y[k] += h / 6 * (f[0][k] + 2 * (f[1][k] + f[2][k]) + f[3][k]);
    }
}

/* To the event inside a step of h from y; the time that it took. */
static real advance_to_event(const motion *m, real h, real *y)
{
    real before = 0;
    real after = h;
    real z[MAX_STATE];
    for (int k = 0; k < N_HALVINGS; k++) {
        const real middle = (before + after) / 2;
        memcpy(z, y, sizeof z);
        advance(m, middle, z);
        if (m->event(m->p, z) < 0) {
            after = middle;
        } else {
            before = middle;
        }
    }
    advance(m, after, y);
    return after;
}

/* Steps of h until the event or for the time left; returns what is left after. */
static real follow(const motion *m, real h, real left, real *y)
{
    while (left > 0) {
        const real step = fminl(h, left);
        real z[MAX_STATE];
        memcpy(z, y, sizeof z);
        advance(m, step, z);
        if (m->event && m->event(m->p, z) < 0) return left - advance_to_event(m, step, y);
        memcpy(y, z, sizeof z);
        /* a remainder of rounding alone is no step */
        left = left - step < 1e-6L * h ? 0 : left - step;
    }
    return 0;
}

/* --- n equal links of 1 m, pinned at their ends: angles from where they hang, then their rates */

/* Sum over the bodies of m b_i b_j: b is 1 for links above a body, 1/2 for its own. */
static real shared_mass(const problem *p, int n, int i, int j)
{
    const real mass = p->s.bodies[p->body].mass;
    const real inertia = p->s.bodies[p->body].inertia;
    const int below = n - 1 - (i > j ? i : j);
    return mass * (below + (i == j ? 0.25L : 0.5L)) + (i == j ? inertia : 0);
}

/* x <- A^-1 x, A symmetric and definite: elimination without pivots. */
static void eliminate(int n, real a[MAX_LINKS][MAX_LINKS], real *x)
{
    for (int k = 0; k < n; k++) {
        for (int i = k + 1; i < n; i++) {
            const real f = a[i][k] / a[k][k];
            for (int j = k; j < n; j++) a[i][j] -= f * a[k][j];
            x[i] -= f * x[k];
        }
    }
    for (int k = n - 1; k >= 0; k--) {
        for (int j = k + 1; j < n; j++) x[k] -= a[k][j] * x[j];
        x[k] /= a[k][k];
    }
}

/* sum_j M_ij cos(a_i - a_j) a_j'' = -sum_j M_ij sin(a_i - a_j) a_j'^2 - g m (n - i - 1/2) sin a_i,
 * i from 0. */
static void links_rate(const problem *p, int n_state, const real *y, real *f)
{
    const int n = n_state / 2;
    const real mass = p->s.bodies[p->body].mass;
    real a[MAX_LINKS][MAX_LINKS];
    real c[MAX_LINKS];
    real s[MAX_LINKS];
    for (int i = 0; i < n; i++) {
        c[i] = cosl(y[i]);
        s[i] = sinl(y[i]);
        f[i] = y[n + i];
    }
    for (int i = 0; i < n; i++) {
        f[n + i] = -G * mass * (n - i - 0.5L) * s[i];
        for (int j = 0; j < n; j++) {
            const real m = shared_mass(p, n, i, j);
            a[i][j] = m * (c[i] * c[j] + s[i] * s[j]);
            f[n + i] -= m * (s[i] * c[j] - c[i] * s[j]) * y[n + j] * y[n + j];
        }
    }
    eliminate(n, a, f + n);
}

static void links_end(const problem *p, real h, real q[3])
{
    const int n = p->s.n_pins;
    const motion m = {2 * n, links_rate, NULL, p};
    real y[MAX_STATE] = {0};
    for (int k = 0; k < n; k++) y[k] = (real)p->s.bodies[k + 1].q[0] - p->hangs;
    follow(&m, h, p->duration, y);
    q[0] = y[n - 1] + p->hangs;
    q[1] = q[2] = 0;
    for (int k = 0; k < n; k++) {
        const real length = k + 1 < n ? 1 : 0.5L;
        q[1] += length * sinl(y[k]);
        q[2] -= length * cosl(y[k]);
    }
}

/* --- a disc (radius 0.3) that leaves a fixed one (radius 1), friction 0.9 -------------------- *
 * y: angle of the line of centers from the vertical, angle of the disc, and their rates. */

static const real ACROSS = 1.3L;
static const real RADIUS = 0.3L;
static const real FRICTION = 0.9L;

/* Of the normal force over the mass. */
static real push(const real *y)
{
    return G * cosl(y[0]) - ACROSS * y[2] * y[2];
}

static void roll_rate(const problem *p, int n, const real *y, real *f)
{
    (void)p;
    (void)n;
    f[0] = y[2];
    f[1] = y[3];
    f[2] = 2 * G * sinl(y[0]) / (3 * ACROSS);
    f[3] = -ACROSS / RADIUS * f[2];
}

/* Rolling takes a third of the weight along the slope as friction. */
static real roll_holds(const problem *p, const real *y)
{
    (void)p;
    return FRICTION * push(y) - G * sinl(y[0]) / 3;
}

/* The disc touches. */
static real slide_holds(const problem *p, const real *y)
{
    (void)p;
    return push(y);
}

static void slide_rate(const problem *p, int n, const real *y, real *f)
{
    (void)p;
    (void)n;
    f[0] = y[2];
    f[1] = y[3];
    f[2] = (G * sinl(y[0]) - FRICTION * push(y)) / ACROSS;
    f[3] = -2 * FRICTION * push(y) / RADIUS;
}

static void disc_end(const problem *p, real h, real q[3])
{
    const motion rolls = {4, roll_rate, roll_holds, p};
    const motion slides = {4, slide_rate, slide_holds, p};
    real y[MAX_STATE] = {0.3L, 0, 0, 0};
    real left = follow(&rolls, h, p->duration, y);
    left = follow(&slides, h, left, y);
    const real s = sinl(y[0]);
    const real c = cosl(y[0]);
    q[0] = y[1] + y[3] * left;
    q[1] = ACROSS * (s + c * y[2] * left);
    q[2] = ACROSS * (c - s * y[2] * left) - G * left * left / 2;
}

/* --- a block (0.4 x 1 m) that rocks: its angle and rate -------------------------------------- *
 * About a foot a'' = -(3 / 4) g (b cos a - h sin |a|) / (b^2 + h^2) toward the upright; at a = 0
 * the foot changes and the rate falls to 1 - (3/2) b^2 / (b^2 + h^2) of itself (Housner). */

static const real HALF_WIDTH = 0.2L;
static const real HALF_HEIGHT = 0.5L;

static void rock_rate(const problem *p, int n, const real *y, real *f)
{
    (void)p;
    (void)n;
    const real square = HALF_WIDTH * HALF_WIDTH + HALF_HEIGHT * HALF_HEIGHT;
    f[0] = y[1];
    f[1] = -0.75L * G * (HALF_WIDTH * cosl(y[0]) - HALF_HEIGHT * sinl(y[0])) / square;
}

static real is_tilted(const problem *p, const real *y)
{
    (void)p;
    return y[0];
}

/* The angle is counted away from the foot that stands: side is 1 over the left one. */
static void rock_end(const problem *p, real h, real q[3])
{
    const motion rocks = {2, rock_rate, is_tilted, p};
    const real square = HALF_WIDTH * HALF_WIDTH + HALF_HEIGHT * HALF_HEIGHT;
    const real keeps = 1 - 1.5L * HALF_WIDTH * HALF_WIDTH / square;
    real y[MAX_STATE] = {0.15L, 0};
    real side = 1;
    real foot = -HALF_WIDTH * cosl(y[0]) + HALF_HEIGHT * sinl(y[0]);
    real left = follow(&rocks, h, p->duration, y);
    while (left > 0) {
        foot += side * 2 * HALF_WIDTH;
        side = -side;
        y[0] = 0;
        y[1] = -keeps * y[1];
        left = follow(&rocks, h, left, y);
    }
    q[0] = side * y[0];
    q[1] = foot + side * (HALF_WIDTH * cosl(y[0]) - HALF_HEIGHT * sinl(y[0]));
    q[2] = HALF_WIDTH * sinl(y[0]) + HALF_HEIGHT * cosl(y[0]);
}

/* --- equal balls on rods, elastic, without friction: angles from the vertical, then rates ----- *
 * (I + m L^2) a'' = -m g L sin a.  Pin k holds ball k + 1 at the distance L. */

static real rod(const problem *p, int k)
{
    const scene_pin *pin = &p->s.pins[k];
    const double *q = p->s.bodies[k + 1].q;
    return hypotl((real)q[1] - pin->x, (real)q[2] - pin->y);
}

static real swing_inertia(const problem *p, int k)
{
    const scene_body *b = &p->s.bodies[k + 1];
    const real length = rod(p, k);
    return b->inertia + b->mass * length * length;
}

static void cradle_rate(const problem *p, int n_state, const real *y, real *f)
{
    const int n = n_state / 2;
    for (int k = 0; k < n; k++) {
        f[k] = y[n + k];
        f[n + k] = -p->s.bodies[k + 1].mass * G * rod(p, k) * sinl(y[k]) / swing_inertia(p, k);
    }
}

/* From ball k to the next one: direction of the centers, and the gap. */
static real between(const problem *p, const real *y, int k, real n[2])
{
    const real a = rod(p, k);
    const real b = rod(p, k + 1);
    n[0] = p->s.pins[k + 1].x + b * sinl(y[k + 1]) - p->s.pins[k].x - a * sinl(y[k]);
    n[1] = p->s.pins[k + 1].y - b * cosl(y[k + 1]) - p->s.pins[k].y + a * cosl(y[k]);
    const real way = hypotl(n[0], n[1]);
    n[0] /= way;
    n[1] /= way;
    return way - p->s.bodies[k + 1].hx - p->s.bodies[k + 2].hx;
}

static real least_gap(const problem *p, const real *y)
{
    real n[2];
    real least = between(p, y, 0, n);
    for (int k = 1; k + 1 < p->s.n_pins; k++) least = fminl(least, between(p, y, k, n));
    return least;
}

/* The nearest pair: arms r of the impulse about the pins, relative speed u -> -u. */
static void strike(const problem *p, real *y)
{
    const int n_balls = p->s.n_pins;
    real n[2];
    int k = 0;
    for (int j = 1; j + 1 < n_balls; j++) {
        if (between(p, y, j, n) < between(p, y, k, n)) k = j;
    }
    between(p, y, k, n);
    real r[2];
    real u = 0;
    real w = 0;
    for (int j = 0; j < 2; j++) {
        r[j] = rod(p, k + j) * (cosl(y[k + j]) * n[0] + sinl(y[k + j]) * n[1]);
        u += (j ? 1 : -1) * r[j] * y[n_balls + k + j];
        w += r[j] * r[j] / swing_inertia(p, k + j);
    }
    for (int j = 0; j < 2; j++) {
        y[n_balls + k + j] -= (j ? 1 : -1) * 2 * u / w * r[j] / swing_inertia(p, k + j);
    }
}

static void cradle_end(const problem *p, real h, real q[3])
{
    const int n = p->s.n_pins;
    const motion swings = {2 * n, cradle_rate, least_gap, p};
    real y[MAX_STATE] = {0};
    for (int k = 0; k < n; k++) {
        const double *ball = p->s.bodies[k + 1].q;
        y[k] = atan2l((real)ball[1] - p->s.pins[k].x, (real)p->s.pins[k].y - ball[2]);
    }
    const real first = y[p->body - 1];
    real left = follow(&swings, h, p->duration, y);
    while (left > 0) {
        strike(p, y);
        left = follow(&swings, h, left, y);
    }
    const int k = p->body - 1;
    q[0] = p->s.bodies[p->body].q[0] + y[k] - first;
    q[1] = p->s.pins[k].x + rod(p, k) * sinl(y[k]);
    q[2] = p->s.pins[k].y - rod(p, k) * cosl(y[k]);
}

static void end_of(const problem *p, int n_steps, real q[3])
{
    const real h = (real)p->duration / n_steps;
    switch (p->motion) {
    case MOTION_LINKS: links_end(p, h, q); break;
    case MOTION_DISC: disc_end(p, h, q); break;
    case MOTION_CRADLE: cradle_end(p, h, q); break;
    case MOTION_BILLIARD: billiard_end(p, n_steps == N_STEPS, q); break;
    default: rock_end(p, h, q); break;
    }
}

void find_reference(problem *p)
{
    real coarse[3];
    real fine[3];
    if (p->motion == MOTION_CLOSED) return;
    end_of(p, N_STEPS, coarse);
    end_of(p, 2 * N_STEPS, fine);
    const real turn = p->reach * fabsl(coarse[0] - fine[0]);
    const real way = hypotl(coarse[1] - fine[1], coarse[2] - fine[2]);
    p->resolved = (double)(1000 * fmaxl(turn, way));
    for (int k = 0; k < 3; k++) p->exact[k] = (double)fine[k];
}
