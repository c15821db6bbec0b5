/* drive.c: springs and motors of joints, backward.  docs/joint.md. */
#include "grad/internal.h"

#include <math.h>

/* u += b W J' of one row: b's cotangent; adds to row_bar and W_bar. */
static double push_vjp(crm_reverse *r, const crm_joint *j, const double row[6], double b,
                       double row_bar[6])
{
    const carom_world *w = r->world;
    const int ends[2] = {j->body_a, j->body_b};
    double b_bar = 0;
    for (int k = 0; k < 6; k++) {
        const int i = crm_unknown(w, ends[k / 3]);
        if (i < 0) continue;
        const int at = 3 * i + k % 3;
        const double W = w->rows.inv_mass[at];
        const double u_bar = r->bars.u[at];
        b_bar += u_bar * W * row[k];
        row_bar[k] += b * W * u_bar;
        r->bars.inv_mass[at] += b * row[k] * u_bar;
    }
    return b_bar;
}

/* weight = n J W J'. */
static void weight_vjp(crm_reverse *r, const crm_joint *j, const double row[6], double weight_bar,
                       double row_bar[6])
{
    const carom_world *w = r->world;
    const int ends[2] = {j->body_a, j->body_b};
    for (int k = 0; k < 6; k++) {
        const int i = crm_unknown(w, ends[k / 3]);
        if (i < 0) continue;
        const int at = 3 * i + k % 3;
        const double n = w->bodies[ends[k / 3]].n_springs;
        row_bar[k] += weight_bar * 2 * n * w->rows.inv_mass[at] * row[k];
        r->bars.inv_mass[at] += weight_bar * n * row[k] * row[k];
    }
}

/* speed = J v with the velocity that the spring sees. */
static void speed_vjp(crm_reverse *r, const crm_substep *s, const crm_solve *c, const crm_joint *j,
                      const double row[6], double speed_bar, double *v_bar, double row_bar[6])
{
    const int late = c->kind == CRM_STAGE_2;
    for (int k = 0; j->damping > 0 && k < 6; k++) {
        const int at = 3 * (k < 3 ? j->body_a : j->body_b) + k % 3;
        row_bar[k] += speed_bar * crm_seen_velocity(s, c, at);
        *(late ? &r->late_bar[at] : &v_bar[at]) += speed_bar * row[k];
    }
}

static void add_to(double *array, int joint, double x)
{
    if (array) array[joint] += x;
}

/* - d crm_soften(x, t) / dt */
static double by_times(double x, double t)
{
    return pow(x, 5) * t * t * t * crm_soften_slope(x, t);
}

/* One spring: force = -(k way + d speed) with k, d softened by h and weight. */
static void spring_vjp(crm_reverse *r, const crm_substep *s, const crm_solve *c, int joint,
                       crm_measure m, double *v_bar, double *q_bar, double *h_bar)
{
    const crm_joint *j = &r->world->joints[joint];
    const double lever = m == CRM_TURN ? j->lever : 1;
    const crm_push p = crm_spring_push(r->world, s, c, j, m);
    crm_joint_bar bar = {{{0, 0}, {0, 0}}, 0, 0, 0};
    double row_bar[6] = {0};
    const double b_bar = push_vjp(r, j, p.row, p.share * p.h * p.force, row_bar);
    const double f_bar = p.share * p.h * b_bar;
    const double k_bar = -p.way * f_bar;
    const double d_bar = -p.speed * f_bar;
    const double dt = r->world->settings.dt;
    const double kt = 0.5 * dt * dt * p.weight;
    const double kt_bar = -k_bar * by_times(p.stiffness, kt);
    const double wt_bar = -d_bar * by_times(p.damping, dt * p.weight);
    *h_bar += p.share * p.force * b_bar;
    weight_vjp(r, j, p.row, kt_bar * 0.5 * dt * dt + wt_bar * dt, row_bar);
    speed_vjp(r, s, c, j, p.row, -p.d * f_bar, v_bar, row_bar);
    crm_measure_vjp(j, m, c->q, row_bar, -p.k * f_bar, q_bar, &bar);
    add_to(r->sink.g.dt, 0, kt_bar * dt * p.weight + wt_bar * p.weight);
    add_to(r->sink.g.stiffness, joint, k_bar * crm_soften_slope(p.stiffness, kt) / (lever * lever));
    add_to(r->sink.g.damping, joint,
           d_bar * crm_soften_slope(p.damping, dt * p.weight) / (lever * lever));
    add_to(r->sink.g.rest, joint, p.k * f_bar * lever);
    crm_joint_give(r, joint, &bar);
}

/* A motor at its limit gives a known impulse; one that holds has a row and c_e = - speed. */
static void motor_vjp(crm_reverse *r, const crm_substep *s, const crm_solve *c, int joint, int row,
                      double *q_bar, double *h_bar)
{
    const crm_joint *j = &r->world->joints[joint];
    const crm_measure m = crm_motor_measure(j->kind);
    const double lever = m == CRM_TURN ? j->lever : 1;
    crm_joint_bar bar = {{{0, 0}, {0, 0}}, 0, 0, 0};
    double je[6];
    double row_bar[6] = {0};
    if (c->motor[row] == CRM_MOTOR_HOLDS) {
        memcpy(row_bar, &r->bars.je[6 * row], sizeof row_bar);
        add_to(r->sink.g.motor_speed, joint, -lever * r->bars.ce[row]);
    } else {
        const double b = crm_motor_impulse(s, c, j, row);
        crm_measure_at(j, m, c->q, je);
        const double b_bar = push_vjp(r, j, je, b, row_bar);
        *h_bar += b_bar * b / s->h;
        add_to(r->sink.g.motor_limit, joint, b_bar * b / j->motor_limit);
    }
    crm_measure_vjp(j, m, c->q, row_bar, 0, q_bar, &bar);
    crm_joint_give(r, joint, &bar);
}

/* b_bar of a push along row. */
static double pushed(const crm_reverse *r, const crm_joint *j, const double row[6])
{
    const carom_world *w = r->world;
    double sum = 0;
    for (int k = 0; k < 6; k++) {
        const int i = crm_unknown(w, k < 3 ? j->body_a : j->body_b);
        if (i < 0) continue;
        sum += w->rows.inv_mass[3 * i + k % 3] * r->bars.u[3 * i + k % 3] * row[k];
    }
    return sum;
}

void crm_seen_vjp(crm_reverse *r, const crm_substep *s, const crm_solve *c, double *seen_bar)
{
    const carom_world *w = r->world;
    crm_fields_seen_vjp(r, s, c, seen_bar);
    for (int k = 0; w->island->n_driven && k < w->island->n_joints; k++) {
        const crm_joint *j = &w->joints[w->island->joints[k]];
        crm_measure measures[2];
        const int n = j->damping > 0 ? crm_spring_measures(j->kind, measures) : 0;
        for (int i = 0; i < n; i++) {
            const crm_push p = crm_spring_push(w, s, c, j, measures[i]);
            const double speed_bar = -p.d * p.share * p.h * pushed(r, j, p.row);
            for (int m = 0; m < 6; m++) {
                seen_bar[3 * (m < 3 ? j->body_a : j->body_b) + m % 3] += speed_bar * p.row[m];
            }
        }
    }
}

void crm_drive_vjp(crm_reverse *r, const crm_substep *s, const crm_solve *c, double *v_bar,
                   double *q_bar, double *h_bar)
{
    const carom_world *w = r->world;
    int first = 0;
    if (w->n_fields) crm_fields_vjp(r, s, c, v_bar, q_bar, h_bar);
    for (int k = 0; w->island->n_driven && k < w->island->n_joints; k++) {
        const int joint = w->island->joints[k];
        const crm_joint *j = &w->joints[joint];
        crm_measure measures[2];
        const int springs = j->stiffness > 0 || j->damping > 0;
        const int n = springs ? crm_spring_measures(j->kind, measures) : 0;
        for (int i = 0; i < n; i++) {
            spring_vjp(r, s, c, joint, measures[i], v_bar, q_bar, h_bar);
        }
        if (j->n_rows > j->n_held) {
            motor_vjp(r, s, c, joint, first + j->n_held, q_bar, h_bar);
        }
        first += j->n_rows;
    }
}

/* c_e = (measure(p) - measure(q0)) / h - speed - J v; the speed and J are in motor_vjp. */
void crm_motor_side_vjp(crm_reverse *r, const crm_substep *s, int joint, int row, double *q0_bar,
                        double *h_bar)
{
    const crm_joint *j = &r->world->joints[joint];
    const crm_measure m = crm_motor_measure(j->kind);
    const double ce_bar = r->bars.ce[row];
    crm_joint_bar bar = {{{0, 0}, {0, 0}}, 0, 0, 0};
    double je[6];
    double row_bar[6];
    if (s->solve[0].motor[row] != CRM_MOTOR_HOLDS) return;
    const double before = crm_measure_at(j, m, s->q0, je);
    const double way = crm_measure_at(j, m, r->pose, je) - before;
    for (int k = 0; k < 6; k++) {
        const int at = 3 * (k < 3 ? j->body_a : j->body_b) + k % 3;
        row_bar[k] = -ce_bar * s->solve[0].v[at];
    }
    *h_bar -= ce_bar * way / (s->h * s->h);
    crm_measure_vjp(j, m, r->pose, NULL, ce_bar / s->h, r->pose_bar, &bar);
    crm_measure_vjp(j, m, s->q0, row_bar, -ce_bar / s->h, q0_bar, &bar);
    crm_joint_give(r, joint, &bar);
}

/* --- forward: the transposes of the above ------------------------------------------------------
 */

/* Of u += b W J' of one row. */
static void push_jvp(crm_forward *f, const crm_joint *j, const double row[6],
                     const double row_dot[6], double b, double b_dot)
{
    const carom_world *w = f->world;
    const int ends[2] = {j->body_a, j->body_b};
    for (int k = 0; k < 6; k++) {
        const int i = crm_unknown(w, ends[k / 3]);
        if (i < 0) continue;
        const int at = 3 * i + k % 3;
        const double W = w->rows.inv_mass[at];
        f->dot.u[at] += b * (f->dot.inv_mass[at] * row[k] + W * row_dot[k]) + b_dot * W * row[k];
    }
}

/* Of weight = n J W J'. */
static double weight_jvp(const crm_forward *f, const crm_joint *j, const double row[6],
                         const double row_dot[6])
{
    const carom_world *w = f->world;
    const int ends[2] = {j->body_a, j->body_b};
    double sum = 0;
    for (int k = 0; k < 6; k++) {
        const int i = crm_unknown(w, ends[k / 3]);
        if (i < 0) continue;
        const int at = 3 * i + k % 3;
        const double n = w->bodies[ends[k / 3]].n_springs;
        sum += n * row[k] * (2 * w->rows.inv_mass[at] * row_dot[k] + f->dot.inv_mass[at] * row[k]);
    }
    return sum;
}

/* Of speed = J v with the velocity that the spring sees. */
static double speed_jvp(const crm_substep *s, const crm_solve *c, const crm_joint *j,
                        const double row[6], const double row_dot[6], const crm_line *line)
{
    const int late = c->kind == CRM_STAGE_2;
    double sum = 0;
    for (int k = 0; j->damping > 0 && k < 6; k++) {
        const int at = 3 * (k < 3 ? j->body_a : j->body_b) + k % 3;
        const double seen = late ? 0 : line->v0[at]; /* of stage 2: crm_seen_jvp */
        sum += row_dot[k] * crm_seen_velocity(s, c, at) + row[k] * seen;
    }
    return sum;
}

static void spring_jvp(crm_forward *f, const crm_substep *s, const crm_solve *c, int joint,
                       crm_measure m, const crm_line *line)
{
    const crm_joint *j = &f->world->joints[joint];
    const carom_gradient *by = line->by;
    const double lever = m == CRM_TURN ? j->lever : 1;
    const double dt = f->world->settings.dt;
    const double dt_dot = crm_entry(by->dt, 0);
    const crm_push p = crm_spring_push(f->world, s, c, j, m);
    double row[6];
    const double way = crm_measure_jvp(f->world, joint, m, c->q, line->q, by, row) -
                       lever * crm_entry(by->rest, joint);
    const double weight = weight_jvp(f, j, p.row, row);
    const double speed = speed_jvp(s, c, j, p.row, row, line);
    const double kt = 0.5 * dt * dt * p.weight;
    const double kt_dot = dt * dt_dot * p.weight + 0.5 * dt * dt * weight;
    const double wt_dot = dt_dot * p.weight + dt * weight;
    const double k =
        crm_soften_slope(p.stiffness, kt) * crm_entry(by->stiffness, joint) / (lever * lever) -
        by_times(p.stiffness, kt) * kt_dot;
    const double d = crm_soften_slope(p.damping, dt * p.weight) * crm_entry(by->damping, joint) /
                         (lever * lever) -
                     by_times(p.damping, dt * p.weight) * wt_dot;
    const double force = -(k * p.way + p.k * way + d * p.speed + p.d * speed);
    push_jvp(f, j, p.row, row, p.share * p.h * p.force,
             p.share * (line->h * p.force + p.h * force));
}

static void motor_jvp(crm_forward *f, const crm_substep *s, const crm_solve *c, int joint, int at,
                      const crm_line *line)
{
    const crm_joint *j = &f->world->joints[joint];
    const crm_measure m = crm_motor_measure(j->kind);
    const double lever = m == CRM_TURN ? j->lever : 1;
    double row[6];
    double je[6];
    crm_measure_jvp(f->world, joint, m, c->q, line->q, line->by, row);
    if (c->motor[at] == CRM_MOTOR_HOLDS) {
        memcpy(&f->dot.je[6 * at], row, sizeof row);
        f->dot.ce[at] = -lever * crm_entry(line->by->motor_speed, joint);
        return;
    }
    const double b = crm_motor_impulse(s, c, j, at);
    crm_measure_at(j, m, c->q, je);
    push_jvp(f, j, je, row, b,
             b * (line->h / s->h + crm_entry(line->by->motor_limit, joint) / j->motor_limit));
}

void crm_drive_jvp(crm_forward *f, const crm_substep *s, const crm_solve *c, const crm_line *line)
{
    const carom_world *w = f->world;
    int first = 0;
    if (w->n_fields) crm_fields_jvp(f, s, c, line);
    for (int k = 0; w->island->n_driven && k < w->island->n_joints; k++) {
        const int joint = w->island->joints[k];
        const crm_joint *j = &w->joints[joint];
        crm_measure measures[2];
        const int springs = j->stiffness > 0 || j->damping > 0;
        const int n = springs ? crm_spring_measures(j->kind, measures) : 0;
        for (int i = 0; i < n; i++) spring_jvp(f, s, c, joint, measures[i], line);
        if (j->n_rows > j->n_held) motor_jvp(f, s, c, joint, first + j->n_held, line);
        first += j->n_rows;
    }
}

void crm_seen_jvp(crm_forward *f, const crm_substep *s, const crm_solve *c, const double *x)
{
    const carom_world *w = f->world;
    const double none[6] = {0};
    crm_fields_seen_jvp(f, s, c, x);
    for (int k = 0; w->island->n_driven && k < w->island->n_joints; k++) {
        const crm_joint *j = &w->joints[w->island->joints[k]];
        crm_measure measures[2];
        const int n = j->damping > 0 ? crm_spring_measures(j->kind, measures) : 0;
        for (int i = 0; i < n; i++) {
            const crm_push p = crm_spring_push(w, s, c, j, measures[i]);
            const double speed = crm_row_dot(p.row, x, j->body_a, j->body_b);
            memset(f->dot.inv_mass, 0, 3 * (size_t)w->island->n_bodies * sizeof(double));
            push_jvp(f, j, p.row, none, 0, -p.share * p.h * p.d * speed);
        }
    }
}

double crm_motor_side_jvp(const crm_forward *f, const crm_substep *s, int joint, int row,
                          const crm_line *line)
{
    const carom_world *w = f->world;
    const crm_joint *j = &w->joints[joint];
    const crm_measure m = crm_motor_measure(j->kind);
    double je[6];
    double je_dot[6];
    double end[6];
    if (s->solve[0].motor[row] != CRM_MOTOR_HOLDS) return 0;
    const double way = crm_measure_at(j, m, f->pose, end) - crm_measure_at(j, m, s->q0, je);
    const double after = crm_measure_jvp(w, joint, m, f->pose, f->pose_dot, line->by, end);
    const double before = crm_measure_jvp(w, joint, m, s->q0, line->q, line->by, je_dot);
    return (after - before) / s->h - way * line->h / (s->h * s->h) -
           crm_row_dot(je_dot, s->solve[0].v, j->body_a, j->body_b);
}
