/* drive.c: springs and motors of joints.  docs/joint.md. */
#include "world/internal.h"

#include <math.h>

int crm_spring_measures(carom_joint_kind kind, crm_measure measures[2])
{
    switch (kind) {
    case CAROM_REVOLUTE: measures[0] = CRM_TURN; return 1;
    case CAROM_ROPE: measures[0] = CRM_APART; return 1;
    case CAROM_TARGET:
        measures[0] = CRM_ACROSS_X;
        measures[1] = CRM_ACROSS_Y;
        return 2;
    default: measures[0] = CRM_ALONG; return 1;
    }
}

crm_measure crm_motor_measure(carom_joint_kind kind)
{
    return kind == CAROM_PRISMATIC ? CRM_ALONG : CRM_TURN;
}

static int has_spring(const crm_joint *j)
{
    return j->stiffness > 0 || j->damping > 0;
}

int crm_joint_is_driven(const crm_joint *j)
{
    return has_spring(j) || j->motor_limit > 0;
}

double crm_share(const crm_solve *c)
{
    switch (c->kind) {
    case CRM_VELOCITY:
    case CRM_BOUNCE: return 1;
    case CRM_STAGE_1:
    case CRM_STAGE_2: return 0.5;
    default: return 0;
    }
}

/* Stage 2 ends the sub-step: with the velocity there it is the reverse of stage 1. */
double crm_seen_velocity(const crm_substep *s, const crm_solve *c, int k)
{
    return c->kind == CRM_STAGE_2 ? c->v[k] : s->v0[k];
}

/* J x for a world array x, and n J W J'. */
static double weight_of(const carom_world *w, const crm_joint *j, const double row[6])
{
    const int ends[2] = {j->body_a, j->body_b};
    double sum = 0;
    for (int side = 0; side < 2; side++) {
        const int i = crm_unknown(w, ends[side]);
        const double *r = row + 3 * side;
        const double *W = w->rows.inv_mass + 3 * i;
        if (i < 0) continue;
        sum += w->bodies[ends[side]].n_springs *
               (W[0] * r[0] * r[0] + W[1] * r[1] * r[1] + W[2] * r[2] * r[2]);
    }
    return sum;
}

/* A stiffness is stable while h^2 k weight <= 4, a damping while h d weight <= 2: softened, they
 * stay at a half of that for h = dt, and differ from what is given by order dt^8 and dt^4.  A
 * sub-step that is shorter has the same, or it would set free what a spring does not hold.
 * Counting springs in the weight keeps several on one body from adding up. */
double crm_soften(double x, double times)
{
    const double y = x * times;
    return x / sqrt(sqrt(1 + y * y * y * y));
}

double crm_soften_slope(double x, double times)
{
    const double y = x * times;
    return pow(1 + y * y * y * y, -1.25);
}

crm_push crm_spring_push(const carom_world *w, const crm_substep *s, const crm_solve *c,
                         const crm_joint *j, crm_measure m)
{
    const double lever = m == CRM_TURN ? j->lever : 1;
    const double dt = w->settings.dt;
    crm_push p;
    p.h = s->h;
    p.share = crm_share(c);
    p.way = crm_measure_at(j, m, c->q, p.row) - lever * j->rest;
    p.speed = 0;
    for (int i = 0; j->damping > 0 && i < 6; i++) {
        const int body = i < 3 ? j->body_a : j->body_b;
        p.speed += p.row[i] * crm_seen_velocity(s, c, 3 * body + i % 3);
    }
    p.weight = weight_of(w, j, p.row);
    p.stiffness = j->stiffness / (lever * lever);
    p.damping = j->damping / (lever * lever);
    p.k = crm_soften(p.stiffness, 0.5 * dt * dt * p.weight);
    p.d = crm_soften(p.damping, dt * p.weight);
    p.force = -(p.k * p.way + p.d * p.speed);
    return p;
}

/* rows.u += b W J'. */
static void push(carom_world *w, const crm_joint *j, const double row[6], double b)
{
    const int ends[2] = {j->body_a, j->body_b};
    for (int side = 0; side < 2; side++) {
        const int i = crm_unknown(w, ends[side]);
        if (i < 0) continue;
        for (int k = 0; k < 3; k++) {
            w->rows.u[3 * i + k] += b * w->rows.inv_mass[3 * i + k] * row[3 * side + k];
        }
    }
}

void crm_springs(carom_world *w, const crm_substep *s, const crm_solve *c)
{
    for (int k = 0; k < w->island->n_joints; k++) {
        const crm_joint *j = &w->joints[w->island->joints[k]];
        crm_measure measures[2];
        const int n = has_spring(j) ? crm_spring_measures(j->kind, measures) : 0;
        for (int i = 0; i < n; i++) {
            const crm_push p = crm_spring_push(w, s, c, j, measures[i]);
            push(w, j, p.row, p.share * p.h * p.force);
        }
    }
}

static double motor_lever(const crm_joint *j)
{
    return crm_motor_measure(j->kind) == CRM_TURN ? j->lever : 1;
}

double crm_motor_speed(const crm_joint *j)
{
    return motor_lever(j) * j->motor_speed;
}

void crm_motor_sides(const carom_world *w, crm_solve *c)
{
    int first = 0;
    const int acts = w->island->n_driven && crm_share(c) > 0;
    for (int k = 0; acts && k < w->island->n_joints; k++) {
        const crm_joint *j = &w->joints[w->island->joints[k]];
        const int row = first + j->n_held;
        first += j->n_rows;
        if (j->n_rows == j->n_held) continue;
        c->ce[row] = c->motor[row] == CRM_MOTOR_HOLDS ? -crm_motor_speed(j) : 0;
    }
}

/* The largest impulse in this solve. */
static double motor_most(const crm_substep *s, const crm_solve *c, const crm_joint *j)
{
    return crm_share(c) * s->h * j->motor_limit / motor_lever(j);
}

double crm_motor_impulse(const crm_substep *s, const crm_solve *c, const crm_joint *j, int row)
{
    if (c->motor[row] == CRM_MOTOR_PLUS) return motor_most(s, c, j);
    return c->motor[row] == CRM_MOTOR_MINUS ? -motor_most(s, c, j) : 0;
}

void crm_motors(carom_world *w, const crm_substep *s, const crm_solve *c)
{
    int first = 0;
    for (int k = 0; k < w->island->n_joints; k++) {
        const crm_joint *j = &w->joints[w->island->joints[k]];
        const int row = first + j->n_held;
        first += j->n_rows;
        if (j->n_rows == j->n_held) continue;
        double je[6];
        double *to = &w->rows.je[6 * row];
        crm_measure_at(j, crm_motor_measure(j->kind), c->q, je);
        for (int i = 0; i < 6; i++) to[i] = c->motor[row] == CRM_MOTOR_HOLDS ? je[i] : 0;
        if (c->motor[row] > CRM_MOTOR_HOLDS) push(w, j, je, crm_motor_impulse(s, c, j, row));
    }
}

/* One motor at its limit holds again when it would drive beyond its speed. */
static unsigned char settled(const crm_substep *s, const crm_solve *c, const crm_joint *j, int row)
{
    double je[6];
    const double most = motor_most(s, c, j);
    crm_measure_at(j, crm_motor_measure(j->kind), c->q, je);
    const double miss = crm_row_dot(je, c->v, j->body_a, j->body_b) - crm_motor_speed(j);
    switch (c->motor[row]) {
    case CRM_MOTOR_HOLDS:
        if (fabs(c->le[row]) <= most) return CRM_MOTOR_HOLDS;
        return c->le[row] > 0 ? CRM_MOTOR_PLUS : CRM_MOTOR_MINUS;
    case CRM_MOTOR_PLUS: return miss > 0 ? CRM_MOTOR_HOLDS : CRM_MOTOR_PLUS;
    case CRM_MOTOR_MINUS: return miss < 0 ? CRM_MOTOR_HOLDS : CRM_MOTOR_MINUS;
    default: return CRM_MOTOR_OFF;
    }
}

int crm_motors_stall(const carom_world *w, const crm_substep *s, crm_solve *c)
{
    int changes = 0;
    int first = 0;
    for (int k = 0; k < w->island->n_joints; k++) {
        const crm_joint *j = &w->joints[w->island->joints[k]];
        const int row = first + j->n_held;
        first += j->n_rows;
        if (j->n_rows == j->n_held || c->motor[row] != CRM_MOTOR_HOLDS) continue;
        double je[6];
        crm_measure_at(j, crm_motor_measure(j->kind), c->q, je);
        const double speed = crm_motor_speed(j);
        double lacks = speed - crm_row_dot(je, s->v0, j->body_a, j->body_b);
        /* at its speed to rounding: what stands in its way makes it slower */
        if (fabs(lacks) <= CRM_REST_TOL * fabs(speed)) lacks = speed;
        c->motor[row] = lacks < 0 ? CRM_MOTOR_MINUS : CRM_MOTOR_PLUS;
        c->ce[row] = 0;
        changes++;
    }
    return changes;
}

int crm_motors_settle(carom_world *w, const crm_substep *s, crm_solve *c)
{
    int changes = 0;
    int first = 0;
    for (int k = 0; k < w->island->n_joints; k++) {
        const crm_joint *j = &w->joints[w->island->joints[k]];
        const int row = first + j->n_held;
        first += j->n_rows;
        if (j->n_rows == j->n_held) continue;
        const unsigned char now = settled(s, c, j, row);
        if (now == c->motor[row]) continue;
        c->motor[row] = now;
        c->ce[row] = now == CRM_MOTOR_HOLDS ? -crm_motor_speed(j) : 0;
        changes++;
    }
    return changes;
}

double crm_drive_gain(const carom_world *w, const crm_substep *s)
{
    double sum = 0;
    for (int k = 0; w->island->n_driven && k < w->island->n_joints; k++) {
        const crm_joint *j = &w->joints[w->island->joints[k]];
        crm_measure measures[2];
        const int n = has_spring(j) ? crm_spring_measures(j->kind, measures) : 0;
        for (int i = 0; i < n; i++) {
            for (int stage = 0; stage < 2; stage++) {
                const crm_push p = crm_spring_push(w, s, &s->solve[stage], j, measures[i]);
                sum += p.share * p.h * fabs(p.force) * sqrt(p.weight);
            }
        }
        if (j->n_rows > j->n_held) {
            double row[6];
            crm_measure_at(j, crm_motor_measure(j->kind), s->q1, row);
            sum += s->h * j->motor_limit / motor_lever(j) * sqrt(weight_of(w, j, row));
        }
    }
    return sum;
}
