/* joints.c: chains, redundant and conflicting joints, motors, springs. */
#include "trial.h"

#include <math.h>

#define COUNT(list) ((int)(sizeof(list) / sizeof *(list)))

static const double G = 9.81;
static const double DT = 1.0 / 60;
static const double PI = 3.14159265358979323846;

static const double RATIOS[] = {1, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8};
static const double STEPS[] = {1e-5, 1e-4, 1e-3, 1e-2, 1.0 / 60, 1.0 / 30, 0.1};
static const double LINKS[] = {1, 2, 3, 5, 10, 20, 50, 100, 200};
static const double TIMES[] = {1, 2, 3, 4, 6};
static const double SPEEDS[] = {0, 1e-6, 1e-3, 1, 100};
static const double TORQUES[] = {0.1, 1, 10, 1e3, 1e6, 1e9};
static const double STIFFNESS[] = {1, 1e2, 1e4, 1e6, 1e8, 1e10};
static const double BEATS[] = {1e-2, 1, 10, 100, 1e3, 1e4};

static double moved(const trial *t, double time, const double *q, const double *v)
{
    (void)time;
    (void)v;
    return measure_move(&t->s, q) / measure_length(&t->s);
}

static double some_time(double dt)
{
    return fmin(fmax(1, 100 * dt), 4000 * dt);
}

/* n links from the origin in a direction; the last weighs `ratio` times as much as another. */
static void links(trial *t, int n, double ratio, double angle)
{
    int last = trial_anchor(t);
    const double x = cos(angle);
    const double y = sin(angle);
    for (int k = 0; k < n; k++) {
        const int link = trial_box(t, (k + 0.5) * x, (k + 0.5) * y, angle, 0.5, 0.05, 0);
        if (k == n - 1) trial_weigh(t, link, ratio);
        trial_pin(t, last, link, k * x, k * y);
        last = link;
    }
}

static void chain_falls(trial *t, double n, double ratio)
{
    *t = trial_new(G, DT, 1);
    links(t, (int)n, ratio, -0.3);
    if (n <= 5) t->probe = (int)n;
}

static void chain_hangs(trial *t, double n, double ratio)
{
    *t = trial_new(G, DT, 1);
    links(t, (int)n, ratio, -PI / 2);
    t->error = moved;
}

static void double_pendulum(trial *t, double ratio, double dt)
{
    *t = trial_new(G, dt, some_time(dt));
    links(t, 2, ratio, 0.4);
    t->probe = 2;
}

/* Every hinge given several times, at the same place or a little beside it. */
static void redundant(trial *t, double times, double ratio)
{
    *t = trial_new(G, DT, 2);
    links(t, 3, ratio, -0.3);
    const int n = t->s.n_pins;
    for (int i = 1; i < (int)times; i++) {
        for (int k = 0; k < n; k++) {
            trial_pin(t, t->s.pins[k].a, t->s.pins[k].b, t->s.pins[k].x, t->s.pins[k].y);
        }
    }
}

/* A plate that swings on parallel rods: one more than two is redundant. */
static void parallel_rods(trial *t, double rods, double ratio)
{
    *t = trial_new(G, DT, 2);
    const int n = (int)rods + 1;
    const int anchor = trial_anchor(t);
    const double x = cos(0.6);
    const double y = -sin(0.6);
    const int plate = trial_box(t, x, y, 0, 1, 0.1, 0);
    trial_weigh(t, plate, ratio);
    for (int k = 0; k < n; k++) {
        const double at = n > 1 ? -1 + 2.0 * k / (n - 1) : 0;
        const int rod = trial_box(t, at + 0.5 * x, 0.5 * y, -0.6, 0.5, 0.02, 0);
        t->s.bodies[rod].shape = SHAPE_NONE;
        trial_pin(t, anchor, rod, at, 0);
        trial_pin(t, rod, plate, at + x, y);
    }
}

/* A body pinned to two others, one of which moves away: there is no motion. */
static void torn(trial *t, double speed, double ratio)
{
    *t = trial_new(G, DT, 0.5);
    const int still = trial_anchor(t);
    const int body = trial_box(t, 0.5, 0, 0, 0.5, 0.1, 0);
    trial_weigh(t, body, ratio);
    const int puller = trial_box(t, 2, 0, 0, 0.1, 0.1, 0);
    t->s.bodies[puller].moves = SCENE_KINEMATIC;
    t->s.bodies[puller].v[1] = speed;
    trial_pin(t, still, body, 0, 0);
    trial_pin(t, body, puller, 1, 0);
    t->passive = 0;
}

/* A plate presses a box on the floor: no motion avoids an overlap. */
static void pressed(trial *t, double speed, double ratio)
{
    *t = trial_new(G, DT, 0.5);
    trial_floor(t, 10, 0.5, 0);
    trial_weigh(t, trial_box(t, 0, 0.5, 0, 0.5, 0.5, 0.5), ratio);
    const int plate = trial_box(t, 0, 1.11, 0, 1, 0.1, 0.5);
    t->s.bodies[plate].moves = SCENE_KINEMATIC;
    t->s.bodies[plate].v[2] = -fmax(speed, 1e-9);
    t->passive = 0;
}

/* An arm driven against its stop at an angle of 0.5: p = (stop, does the motor lift it). */
static double beyond_stop(const trial *t, double time, const double *q, const double *v)
{
    (void)time;
    (void)v;
    const double past = q[3] - t->p[0];
    return t->p[1] > 0 ? fabs(past) : fmax(0, past);
}

static void motor(trial *t, double torque, double dt)
{
    *t = trial_new(G, dt, fmax(2, 60 * dt));
    if (dt < 1e-3) t->s.n_steps = 4000;
    const int anchor = trial_anchor(t);
    const int arm = trial_box(t, 0.5, 0, 0, 0.5, 0.05, 0);
    const double weight = t->s.bodies[arm].mass * G * 0.5;
    carom_joint_def *d = trial_joint(t, CAROM_REVOLUTE, anchor, arm, 0, 0);
    d->lower = -0.5;
    d->upper = 0.5;
    d->motor_speed = 3;
    d->motor_limit = torque * weight;
    t->passive = 0;
    t->p[0] = 0.5;
    t->p[1] = torque > 2 && t->s.n_steps * dt > 1.5;
    t->error = beyond_stop;
    t->tolerance = 1e-8 + 1e-15 * torque; /* what the impulses of motor and stop round to */
    t->probe = dt >= 1e-2 ? arm : -1;
}

/* Two motors at odds on one hinge, the stronger one wins or both hold: only bounds are known. */
static void motors_at_odds(trial *t, double torque, double dt)
{
    motor(t, torque, dt);
    carom_joint_def *d = trial_joint(t, CAROM_REVOLUTE, 0, 1, 0, 0);
    d->lower = -0.5;
    d->upper = 0.5;
    d->motor_speed = -3;
    d->motor_limit = 0.5 * t->joints[0].motor_limit;
    t->p[1] = 0;
    t->probe = -1;
}

/* A mass on a spring to the origin: p = (amplitude). */
static double swings_wider(const trial *t, double time, const double *q, const double *v)
{
    (void)time;
    (void)v;
    return fmax(0, hypot(q[4], q[5]) / t->p[0] - 1);
}

static void spring(trial *t, double stiffness, double dt)
{
    *t = trial_new(0, dt, some_time(dt));
    const int anchor = trial_anchor(t);
    const int b = trial_disc(t, 1, 0, 0.1, 0, 0);
    trial_weigh(t, b, 1 / t->s.bodies[b].mass);
    carom_joint_def *d = trial_joint(t, CAROM_TARGET, anchor, b, 0, 0);
    d->anchor.x = 0;
    d->stiffness = stiffness;
    t->joints[0].anchor_b.x = 1;
    t->p[0] = 1;
    t->error = swings_wider;
    t->tolerance = 0.01;
    t->passive = 0; /* a softened spring has another energy */
}

/* A rotor spins among boxes in a pit. */
static void rotor(trial *t, double speed, double ratio)
{
    *t = trial_new(G, DT, 1);
    trial_floor(t, 3, 0.5, 0);
    for (int k = 0; k < 2; k++) {
        trial_fix(t, trial_box(t, k ? 3 : -3, 2, 0, 1, 4, 0.5));
    }
    const int blade = trial_box(t, 0, 0.8, 0.1, 0.7, 0.1, 0.5);
    t->s.bodies[blade].moves = SCENE_KINEMATIC;
    t->s.bodies[blade].v[0] = speed;
    for (int k = 0; k < 6; k++) {
        const double x = -1.25 + 0.5 * k;
        const int b = trial_box(t, x, 1.9 + 0.1 * (k % 2), 0.1 * k, 0.2, 0.15, 0.5);
        if (k % 3 == 0) trial_weigh(t, b, ratio);
    }
    t->passive = 0;
}

const family JOINT_FAMILIES[] = {
    {"chain falls", "links", "end / link mass", COUNT(LINKS), COUNT(RATIOS), LINKS, RATIOS,
     chain_falls, NULL, "h w = h sqrt(12 g ratio / l) > 512: more parts than max_stiff"},
    {"chain hangs", "links", "end / link mass", COUNT(LINKS), COUNT(RATIOS), LINKS, RATIOS,
     chain_hangs, "nothing moves", "h w = h sqrt(12 g ratio / l) > 512: more parts than max_stiff"},
    {"double pendulum", "mass ratio", "dt [s]", COUNT(RATIOS), COUNT(STEPS), RATIOS, STEPS,
     double_pendulum, NULL, "h w = h sqrt(12 g ratio / l) > 512: more parts than max_stiff"},
    {"hinges given again", "times", "mass ratio", COUNT(TIMES), COUNT(RATIOS), TIMES, RATIOS,
     redundant, NULL, "as in chain falls, of three links"},
    {"parallel rods", "rods - 1", "mass ratio", COUNT(TIMES), COUNT(RATIOS), TIMES, RATIOS,
     parallel_rods, NULL, NULL},
    {"joints at odds", "speed [m/s]", "mass ratio", COUNT(SPEEDS), COUNT(RATIOS), SPEEDS, RATIOS,
     torn, NULL, "joints at odds: there is no motion"},
    {"pressed", "speed [m/s]", "mass ratio", COUNT(SPEEDS), COUNT(RATIOS), SPEEDS, RATIOS, pressed,
     NULL, "pressed between plate and floor: no motion without overlap"},
    {"motor at its stop", "torque / weight", "dt [s]", COUNT(TORQUES), COUNT(STEPS), TORQUES, STEPS,
     motor, "ends at the stop, never beyond", NULL},
    {"motors at odds", "torque / weight", "dt [s]", COUNT(TORQUES), COUNT(STEPS), TORQUES, STEPS,
     motors_at_odds, "never beyond the stop", NULL},
    {"spring", "stiffness [N/m]", "dt [s]", COUNT(STIFFNESS), COUNT(STEPS), STIFFNESS, STEPS,
     spring, "swings no wider", NULL},
    {"rotor in a pit", "speed [rad/s]", "mass ratio", COUNT(BEATS), COUNT(RATIOS), BEATS, RATIOS,
     rotor, NULL, "a kinematic body jams others: no motion without overlap"},
};
const int N_JOINT_FAMILIES = COUNT(JOINT_FAMILIES);
