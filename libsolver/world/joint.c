/* joint.c: what joints measure, and the rows of the contact problem that hold it.  docs/joint.md.
 */
#include "world/internal.h"

#include <math.h>

typedef struct row_list {
    int n;
    crm_measure measure[CRM_MAX_JOINT_ROWS];
} row_list;

static const row_list HELD[CAROM_N_JOINT_KINDS] = {
    [CAROM_REVOLUTE] = {2, {CRM_ACROSS_X, CRM_ACROSS_Y}},
    [CAROM_PRISMATIC] = {2, {CRM_ASIDE, CRM_TURN}},
    [CAROM_WELD] = {3, {CRM_ACROSS_X, CRM_ACROSS_Y, CRM_TURN}},
    [CAROM_WHEEL] = {1, {CRM_ASIDE}},
    [CAROM_DISTANCE] = {1, {CRM_APART}},
    [CAROM_ROPE] = {0, {CRM_APART}},
    [CAROM_TARGET] = {0, {CRM_APART}},
    [CAROM_LOCK_X] = {1, {CRM_ACROSS_X}},
    [CAROM_LOCK_Y] = {1, {CRM_ACROSS_Y}},
    [CAROM_LOCK_ANGLE] = {1, {CRM_TURN}},
};

int crm_joint_measures(carom_joint_kind kind, const crm_measure **measures)
{
    *measures = HELD[kind].measure;
    return HELD[kind].n;
}

crm_joint_frame crm_joint_frame_at(const crm_joint *j, const double *q)
{
    const carom_pose a = crm_pose(q, j->body_a);
    const carom_pose b = crm_pose(q, j->body_b);
    crm_joint_frame f;
    f.arm_a = crm_rotate(a.angle, j->local_a);
    f.arm_b = crm_rotate(b.angle, j->local_b);
    f.d.x = (b.x - a.x) + (f.arm_b.x - f.arm_a.x);
    f.d.y = (b.y - a.y) + (f.arm_b.y - f.arm_a.y);
    return f;
}

carom_vec2 crm_measure_direction(const crm_joint *j, crm_measure m, const double *q,
                                 const crm_joint_frame *f)
{
    const double axis = q[3 * j->body_a] + j->axis;
    carom_vec2 u = {0, 0};
    switch (m) {
    case CRM_ACROSS_X: u.x = 1; break;
    case CRM_ACROSS_Y: u.y = 1; break;
    case CRM_ALONG:
        u.x = cos(axis);
        u.y = sin(axis);
        break;
    case CRM_ASIDE:
        u.x = -sin(axis);
        u.y = cos(axis);
        break;
    case CRM_APART: {
        const double length = hypot(f->d.x, f->d.y);
        if (length > 0) {
            u.x = f->d.x / length;
            u.y = f->d.y / length;
        } else {
            u.x = 1; /* points that meet: any direction leads apart */
        }
        break;
    }
    case CRM_TURN: break;
    }
    return u;
}

/* The turn of a direction with A moves the arm on A to the anchor of B. */
carom_vec2 crm_measure_arm(crm_measure m, const crm_joint_frame *f)
{
    const int turns = m == CRM_ALONG || m == CRM_ASIDE;
    const carom_vec2 arm = {f->arm_a.x + (turns ? f->d.x : 0), f->arm_a.y + (turns ? f->d.y : 0)};
    return arm;
}

static void direction_row(crm_measure m, const crm_joint_frame *f, carom_vec2 u, double row[6])
{
    const carom_vec2 arm = crm_measure_arm(m, f);
    row[0] = -(arm.x * u.y - arm.y * u.x);
    row[1] = -u.x;
    row[2] = -u.y;
    row[3] = f->arm_b.x * u.y - f->arm_b.y * u.x;
    row[4] = u.x;
    row[5] = u.y;
}

/* The frame f at q is not read by a turn. */
static double measure_in(const crm_joint *j, crm_measure m, const double *q,
                         const crm_joint_frame *f, double row[6])
{
    if (m == CRM_TURN) {
        const double l = j->lever;
        const double turn[6] = {-l, 0, 0, l, 0, 0};
        memcpy(row, turn, sizeof turn);
        return l * ((q[3 * j->body_b] - q[3 * j->body_a]) - j->angle);
    }
    const carom_vec2 u = crm_measure_direction(j, m, q, f);
    direction_row(m, f, u, row);
    if (m == CRM_APART) return hypot(f->d.x, f->d.y) - j->length;
    return u.x * f->d.x + u.y * f->d.y;
}

double crm_measure_at(const crm_joint *j, crm_measure m, const double *q, double row[6])
{
    const crm_joint_frame f = crm_joint_frame_at(j, q);
    return measure_in(j, m, q, &f, row);
}

void crm_joint_rows(const crm_joint *j, const double *q, double *je, double *error)
{
    const crm_joint_frame f = crm_joint_frame_at(j, q);
    for (int k = 0; k < j->n_held; k++) {
        error[k] = measure_in(j, HELD[j->kind].measure[k], q, &f, &je[6 * k]);
    }
    if (j->n_rows == j->n_held) return;
    memset(&je[6 * j->n_held], 0, 6 * sizeof *je);
    error[j->n_held] = 0;
}

double crm_joint_drift(const carom_world *w, const double *q)
{
    double largest = 0;
    for (int k = 0; k < w->n_joints; k++) {
        double je[6 * CRM_MAX_JOINT_ROWS];
        double e[CRM_MAX_JOINT_ROWS] = {0, 0, 0};
        if (w->joints[k].broken) continue;
        crm_joint_rows(&w->joints[k], q, je, e);
        largest = fmax(largest, sqrt(e[0] * e[0] + e[1] * e[1] + e[2] * e[2]));
        for (int side = 1; crm_joint_has_limits(&w->joints[k]) && side <= 2; side++) {
            largest = fmax(largest, -crm_limit_at(w, 2 * k + side, q).gap);
        }
    }
    return largest;
}

/* A measure's multiplier f acts on B along the direction that it sees, or as a torque. */
static void add_measure(const carom_world *w, const crm_joint *j, crm_measure m, double f,
                        carom_joint_force *to)
{
    const crm_joint_frame at = crm_joint_frame_at(j, w->q);
    const carom_vec2 u = crm_measure_direction(j, m, w->q, &at);
    to->force.x += f * u.x;
    to->force.y += f * u.y;
    if (m == CRM_TURN) to->torque += f * j->lever;
}

carom_joint_force carom_world_joint_force(const carom_world *world, int joint)
{
    const carom_world *w = world;
    carom_joint_force total = {{0, 0}, 0};
    if (joint < 0 || joint >= w->n_joints || !w->joint_total) return total;
    const crm_joint *j = &w->joints[joint];
    if (j->broken) return total;
    for (int k = 0; k < j->n_rows; k++) {
        const crm_measure m = k < j->n_held ? HELD[j->kind].measure[k] : crm_motor_measure(j->kind);
        add_measure(w, j, m, w->joint_total[j->first_row + k], &total);
    }
    for (int k = carom_world_n_contacts(w); k < w->touches.n; k++) {
        const crm_touch *t = &w->touches.list[k];
        if (crm_limit_joint(t->contact.limit) != joint) continue;
        const double f = crm_limit_sign(t->contact.limit) * (t->force_n[0] + t->force_n[1]);
        add_measure(w, j, crm_limit_measure(j->kind), f, &total);
    }
    return total;
}
