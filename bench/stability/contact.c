/* contact.c: one to a few bodies with closed forms. */
#include "trial.h"

#include <float.h>
#include <math.h>

#define COUNT(list) ((int)(sizeof(list) / sizeof *(list)))

static const double G = 9.81;
static const double DT = 1.0 / 60;

static const double RATIOS[] = {1, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8};
static const double STEPS[] = {1e-5, 1e-4, 1e-3, 1e-2, 1.0 / 60, 1.0 / 30, 0.1};
static const double FRICTIONS[] = {0, 1e-3, 0.01, 0.1, 0.3, 1, 10, 100, 1e3};
static const double BOUNCES[] = {0, 0.1, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 0.99, 1};
static const double SIZES[] = {1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1, 10, 100, 1e3, 1e4};
static const double SPEEDS[] = {0.01, 0.1, 1, 10, 100, 1e3, 1e4};
static const double FAR[] = {0, 1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7};
static const double ANGLES[] = {0.01, 0.05, 0.2, 0.4, 0.6, 0.8, 1, 1.2, 1.3};
static const double HALF_ANGLES[] = {1e-3, 1e-2, 0.05, 0.1, 0.3, 0.6, 1, 1.3, 1.5};
static const double CORNERS[] = {3, 4, 5, 6, 8, 16, 32, 64};
static const double ASPECTS[] = {1, 2, 10, 1e2, 1e3, 1e4};

/* Nothing should move: the largest move [L]. */
static double moved(const trial *t, double time, const double *q, const double *v)
{
    (void)time;
    (void)v;
    return measure_move(&t->s, q) / measure_length(&t->s);
}

/* As many steps as make 1 s, 400 at least and 4000 at most. */
static double some_time(double dt)
{
    return fmin(fmax(1, 400 * dt), 4000 * dt);
}

/* A box on a box: ratio of masses, step. */
static void two_boxes(trial *t, double ratio, double dt)
{
    *t = trial_new(G, dt, some_time(dt));
    trial_floor(t, 10, 0.5, 0);
    trial_box(t, 0, 0.5, 0, 0.5, 0.5, 0.5);
    trial_weigh(t, trial_box(t, 0.1, 1.5, 0, 0.5, 0.5, 0.5), ratio);
    t->error = moved;
}

/* A box slides to rest: p = (v, mu). */
static double slid(const trial *t, double time, const double *q, const double *v)
{
    (void)v;
    const double speed = t->p[0];
    const double slowing = t->p[1] * G;
    const double stop = slowing > 0 ? fmin(time, speed / slowing) : time;
    const double x = speed * stop - 0.5 * slowing * stop * stop;
    return hypot(q[4] - x, q[5] - 0.1);
}

static void sliding(trial *t, double mu, double dt)
{
    *t = trial_new(G, dt, some_time(dt));
    trial_floor(t, 1000, mu, 0);
    const int b = trial_box(t, 0, 0.1, 0, 1, 0.1, mu); /* does not tip before mu = 10 */
    t->s.bodies[b].v[1] = 3;
    t->p[0] = 3;
    t->p[1] = mu;
    t->error = mu < 10 ? slid : NULL;
    t->rough = 0.05 + 3 * dt; /* order one */
    t->probe = b;
}

/* A disc slides, then rolls: p = (v, mu). */
static double rolled(const trial *t, double time, const double *q, const double *v)
{
    (void)v;
    const double speed = t->p[0];
    const double slowing = t->p[1] * G;
    const double until = slowing > 0 ? fmin(time, speed / (3 * slowing)) : time;
    const double slide = speed * until - 0.5 * slowing * until * until;
    const double x = slide + 2.0 / 3 * speed * (time - until);
    return hypot(q[4] - x, q[5] - 0.5);
}

static void rolling(trial *t, double mu, double dt)
{
    *t = trial_new(G, dt, some_time(dt));
    trial_floor(t, 1000, mu, 0);
    const int b = trial_disc(t, 0, 0.5, 0.5, mu, 0);
    t->s.bodies[b].v[1] = 3;
    t->p[0] = 3;
    t->p[1] = mu;
    t->error = rolled;
    t->rough = 0.05 + 3 * dt;
    t->probe = b;
}

/* A flat box on a slope: p = (angle, mu). */
static double slipped(const trial *t, double time, const double *q, const double *v)
{
    (void)v;
    const double a = t->p[0];
    const double pull = fmax(0, sin(a) - t->p[1] * cos(a)) * G;
    const double way = 0.5 * pull * time * time;
    const double *q0 = t->s.bodies[1].q;
    return hypot(q[4] - q0[1] - way * cos(a), q[5] - q0[2] + way * sin(a)) / (1 + way);
}

static void slope(trial *t, double angle, double mu)
{
    *t = trial_new(G, DT, 1);
    const double c = cos(angle);
    const double s = sin(angle);
    trial_box(t, -50 * s, -50 * c, -angle, 50, 50, mu);
    trial_fix(t, 0);
    trial_box(t, 0.1 * s, 0.1 * c, -angle, 1, 0.1, mu);
    t->p[0] = angle;
    t->p[1] = mu;
    t->error = slipped;
    t->tolerance = 1e-8; /* 50 m from the slope's center: 1e-14 of rounding */
    t->probe = 1;
}

/* On the brink: friction is a factor times tan(angle). */
static void brink(trial *t, double angle, double factor)
{
    slope(t, angle, factor * tan(angle));
}

/* A ball bounces: p = (e, height). */
static double bounced(const trial *t, double time, const double *q, const double *v)
{
    (void)v;
    double height = t->p[1];
    double left = time - sqrt(2 * height / G);
    double speed = sqrt(2 * G * height);
    if (left < 0) return fabs(q[5] - 0.5 - height + 0.5 * G * time * time);
    for (speed *= t->p[0]; left > 2 * speed / G && speed > 1e-4; speed *= t->p[0]) {
        left -= 2 * speed / G;
    }
    height = speed > 1e-4 ? speed * left - 0.5 * G * left * left : 0;
    return fabs(q[5] - 0.5 - height);
}

static void bouncing(trial *t, double e, double dt)
{
    *t = trial_new(G, dt, fmax(2, 40 * dt));
    if (dt < 1e-4) t->s.n_steps = 100000;
    trial_floor(t, 20, 0.3, e);
    const int b = trial_disc(t, 0, 1.5, 0.5, 0.3, e);
    t->p[0] = e;
    t->p[1] = 1;
    t->error = bounced;
    t->tolerance = 1e-5; /* below rest_speed nothing bounces: 1e-6 m */
    t->rough = 1;        /* order one at impacts: the phase is lost, not the height */
    t->probe = b;
}

/* A disc shot at a wall, e = 1: p = (distance, speed). */
static double rebounded(const trial *t, double time, const double *q, const double *v)
{
    (void)v;
    const double way = t->p[1] * time;
    const double x = way < t->p[0] ? way : 2 * t->p[0] - way;
    return hypot(q[4] - x, q[5]) / fmax(way, t->p[0]);
}

/* Wall a tenth as thick as the disc. */
static void shot(trial *t, double size, double speed)
{
    *t = trial_new(0, DT, 10 * DT);
    const double r = size / 2;
    const double distance = fmax(0.37 * size * speed * 10 * DT, 0.01 * size);
    const int wall = trial_box(t, distance + r + 0.05 * size, 0, 0, 0.05 * size, 3 * size, 0);
    trial_fix(t, wall);
    t->s.bodies[wall].restitution = 1;
    const int b = trial_disc(t, 0, 0, r, 0, 1);
    t->s.bodies[b].v[1] = size * speed;
    t->p[0] = distance;
    t->p[1] = size * speed;
    t->error = rebounded;
    t->tolerance = 1e-9;
    t->probe = b;
}

/* A bar that spins and is shot at a wall: nothing but energy is known. */
static void spinning(trial *t, double size, double speed)
{
    *t = trial_new(0, DT, 20 * DT);
    const double distance = fmax(0.37 * size * speed * 10 * DT, 0.8 * size);
    const int wall = trial_box(t, distance + size, 0, 0, 0.5 * size, 50 * size, 0.3);
    trial_fix(t, wall);
    t->s.bodies[wall].restitution = 0.5;
    const int b = trial_box(t, 0, 0, 0.3, 0.5 * size, 0.1 * size, 0.3);
    t->s.bodies[b].restitution = 0.5;
    t->s.bodies[b].v[0] = fmin(speed, 100);
    t->s.bodies[b].v[1] = size * speed;
    t->probe = b;
}

/* A box falls half its height and lies: p = (x, height of the middle). */
static double lies(const trial *t, double time, const double *q, const double *v)
{
    (void)time;
    (void)v;
    const double reach = measure_reach(&t->s, q);
    const double error = hypot(q[4] - t->p[0], q[5] - t->p[1]) - 64 * DBL_EPSILON * reach;
    return fmax(0, error) / measure_length(&t->s);
}

static void dropped_far(trial *t, double size, double far)
{
    const double dt = 0.1 * sqrt(size / G);
    *t = trial_new(G, dt, 60 * dt);
    trial_floor(t, 20 * size, 0.5, 0);
    trial_box(t, 0, size, 0, 0.5 * size, 0.5 * size, 0.5);
    trial_shift(t, far, far);
    t->p[0] = far;
    t->p[1] = far + 0.5 * size;
    t->late = 30 * dt;
    t->error = lies;
}

/* A tilted box falls on the floor, at a step that may be long beside sqrt(size / g). */
static void dropped_small(trial *t, double size, double dt)
{
    *t = trial_new(G, dt, 200 * dt);
    trial_floor(t, 20 * size, 0.5, 0);
    trial_box(t, 0, size, 0.4, 0.5 * size, 0.3 * size, 0.5);
}

/* Two discs head on: p = (ratio, e). */
static double exchanged(const trial *t, double time, const double *q, const double *v)
{
    const double m = t->p[0];
    const double e = t->p[1];
    const double v0 = (m - e) / (1 + m); /* of the heavy one, in units of its speed */
    const double v1 = m * (1 + e) / (1 + m);
    const double hit = 0.125; /* gap 0.5, speed 4 */
    const double x0 = 0.5 + 4 * v0 * (time - hit);
    const double x1 = 1.5 + 4 * v1 * (time - hit);
    (void)v;
    return fmax(fabs(q[1] - x0), fabs(q[4] - x1));
}

static void head_on(trial *t, double ratio, double e)
{
    *t = trial_new(0, DT, 1);
    const int a = trial_disc(t, 0, 0, 0.5, 0, e);
    trial_weigh(t, a, ratio);
    trial_disc(t, 1.5, 0, 0.5, 0, e);
    t->s.bodies[a].v[1] = 4; /* Box2D lets nothing bounce below 1 m/s */
    t->p[0] = ratio;
    t->p[1] = e;
    t->error = exchanged;
    t->rough = 0.15; /* an impact late by a step */
    t->tolerance = 1e-9;
    t->probe = 1;
}

/* A disc between two slopes, at rest: half angle of the wedge, friction. */
static void wedge(trial *t, double half, double mu)
{
    *t = trial_new(G, DT, 1);
    const double c = cos(half);
    const double s = sin(half);
    const double up = 0.5 / s; /* of the disc above the apex */
    const double far = fmax(4, 2 * up);
    for (int k = 0; k < 2; k++) {
        const double side = k ? -1 : 1;
        /* A wall whose inner face goes through the apex, (s, c) along it. */
        const double x = side * (up * s + far * c);
        const double y = up * c - far * s;
        trial_box(t, x, y, side * (1.5707963267948966 - half), far + up, far, mu);
        trial_fix(t, k);
    }
    trial_disc(t, 0, up, 0.5, mu, 0);
    t->error = moved;
    t->tolerance = 1e-6;
}

/* The same disc falls in, and bounces. */
static void into_wedge(trial *t, double half, double mu)
{
    wedge(t, half, mu);
    t->s.bodies[2].q[2] += 0.3 / sin(half) * fmin(1, half + 0.3);
    for (int k = 0; k < 3; k++) t->s.bodies[k].restitution = 0.5;
    t->error = NULL;
}

/* Regular n-gon, flattened, tilted, dropped. */
static void polygon(trial *t, double corners, double aspect)
{
    carom_vec2 v[MAX_CORNERS];
    const int n = (int)corners;
    *t = trial_new(G, DT, 1);
    for (int k = 0; k < n; k++) {
        v[k].x = 0.5 * cos(6.283185307179586 * (k + 0.25) / n);
        v[k].y = 0.5 / aspect * sin(6.283185307179586 * (k + 0.25) / n);
    }
    trial_floor(t, 10, 0.5, 0);
    trial_polygon(t, 0, 0.8, 0.3, n, v, 0.5);
    trial_polygon(t, 0.2, 1.9, -0.2, n, v, 0.5);
}

/* The Painleve rod slides on its lower end, leaning forward: tan(angle) = 2. */
static void painleve(trial *t, double mu, double speed)
{
    *t = trial_new(G, DT, 1);
    trial_floor(t, 1000, mu, 0);
    const double a = atan(2.0);
    const double hx = 0.5;
    const double hy = 0.001;
    /* Lower left corner on the floor; it slides to the left. */
    const double y = hx * sin(a) + hy * cos(a);
    const int b = trial_box(t, 0, y, a, hx, hy, mu);
    t->s.bodies[b].v[1] = -speed;
}

static const double BRINKS[] = {0.5, 0.9, 0.99, 0.999, 1 - 1e-6, 1 + 1e-6, 1.001, 1.01, 1.1, 2};

const family CONTACT_FAMILIES[] = {
    {"two boxes", "mass ratio", "dt [s]", COUNT(RATIOS), COUNT(STEPS), RATIOS, STEPS, two_boxes,
     "nothing moves", NULL},
    {"sliding stop", "friction", "dt [s]", COUNT(FRICTIONS), COUNT(STEPS), FRICTIONS, STEPS,
     sliding, "v t - mu g t^2 / 2 until it stands", NULL},
    {"slide to roll", "friction", "dt [s]", COUNT(FRICTIONS), COUNT(STEPS), FRICTIONS, STEPS,
     rolling, "rolls at 2 v / 3 from v / (3 mu g) on", NULL},
    {"slope", "angle [rad]", "friction", COUNT(ANGLES), COUNT(FRICTIONS), ANGLES, FRICTIONS, slope,
     "stays, or g (sin - mu cos) t^2 / 2", NULL},
    {"brink of a slope", "angle [rad]", "friction / tan", COUNT(ANGLES), COUNT(BRINKS), ANGLES,
     BRINKS, brink, "stays, or g (sin - mu cos) t^2 / 2", NULL},
    {"bouncing ball", "restitution", "dt [s]", COUNT(BOUNCES), COUNT(STEPS), BOUNCES, STEPS,
     bouncing, "parabolas, each e as fast", NULL},
    {"shot at a thin wall", "size [m]", "sizes per second", COUNT(SIZES), COUNT(SPEEDS), SIZES,
     SPEEDS, shot, "comes back as fast", NULL},
    {"bar spins into a wall", "size [m]", "sizes per second", COUNT(SIZES), COUNT(SPEEDS), SIZES,
     SPEEDS, spinning, NULL, NULL},
    {"dropped far away", "size [m]", "from the origin [m]", COUNT(SIZES), COUNT(FAR), SIZES, FAR,
     dropped_far, "lies on the floor", NULL},
    {"tilted box dropped", "size [m]", "dt [s]", COUNT(SIZES), COUNT(STEPS), SIZES, STEPS,
     dropped_small, NULL, NULL},
    {"head on", "mass ratio", "restitution", COUNT(RATIOS), COUNT(BOUNCES), RATIOS, BOUNCES,
     head_on, "Newton's law", NULL},
    {"disc in a wedge", "half angle [rad]", "friction", COUNT(HALF_ANGLES), COUNT(FRICTIONS),
     HALF_ANGLES, FRICTIONS, wedge, "nothing moves", NULL},
    {"disc into a wedge", "half angle [rad]", "friction", COUNT(HALF_ANGLES), COUNT(FRICTIONS),
     HALF_ANGLES, FRICTIONS, into_wedge, NULL, NULL},
    {"polygons and slivers", "corners", "width / height", COUNT(CORNERS), COUNT(ASPECTS), CORNERS,
     ASPECTS, polygon, NULL,
     "as thin as the way of its corners in a sub-step: some that no gap foresaw overlap at its "
     "end"},
    {"Painleve rod", "friction", "speed [m/s]", COUNT(FRICTIONS), COUNT(SPEEDS), FRICTIONS, SPEEDS,
     painleve, NULL, NULL},
};
const int N_CONTACT_FAMILIES = COUNT(CONTACT_FAMILIES);
