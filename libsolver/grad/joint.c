/* joint.c: reverse derivatives of what joints measure and of its rows.  docs/joint.md. */
#include "grad/internal.h"

#include <math.h>

static double cross(carom_vec2 a, carom_vec2 b)
{
    return a.x * b.y - a.y * b.x;
}

static void add(carom_vec2 *to, carom_vec2 x, double scale)
{
    to->x += scale * x.x;
    to->y += scale * x.y;
}

void crm_arm_vjp(double angle, carom_vec2 local, carom_vec2 arm_bar, double *angle_bar,
                 carom_vec2 *local_bar)
{
    const double c = cos(angle);
    const double s = sin(angle);
    const carom_vec2 arm = {c * local.x - s * local.y, s * local.x + c * local.y};
    *angle_bar += cross(arm, arm_bar);
    if (!local_bar) return;
    local_bar->x += c * arm_bar.x + s * arm_bar.y;
    local_bar->y += -s * arm_bar.x + c * arm_bar.y;
}

/* Cotangents of what a measure and its row are made of; arm_a is the measure's arm on A. */
typedef struct frame_bar {
    carom_vec2 arm_a, arm_b, d, u;
} frame_bar;

/* Of row(u) = (-cross(arm, u), -u, cross(arm_b, u), u) with the measure's arm on A. */
static void row_vjp(crm_measure m, const crm_joint_frame *f, carom_vec2 u, const double g[6],
                    frame_bar *bar)
{
    const carom_vec2 a = crm_measure_arm(m, f);
    const carom_vec2 b = f->arm_b;
    bar->arm_a.x -= g[0] * u.y;
    bar->arm_a.y += g[0] * u.x;
    bar->arm_b.x += g[3] * u.y;
    bar->arm_b.y -= g[3] * u.x;
    bar->u.x += g[0] * a.y - g[1] - g[3] * b.y + g[4];
    bar->u.y += -g[0] * a.x - g[2] + g[3] * b.x + g[5];
}

/* Of the unit vector: turning with A, or along d; *turn_bar is the cotangent of its angle. */
static void direction_vjp(crm_measure m, const crm_joint_frame *f, carom_vec2 u, frame_bar *bar,
                          double *turn_bar)
{
    *turn_bar = 0;
    if (m == CRM_ALONG || m == CRM_ASIDE) *turn_bar = cross(u, bar->u);
    const double length = hypot(f->d.x, f->d.y);
    if (m != CRM_APART || !(length > 0)) return;
    const carom_vec2 normal = {-u.y, u.x};
    add(&bar->d, normal, cross(u, bar->u) / length);
}

/* d = x_b - x_a with x = p + arm. */
static void frame_vjp(const crm_joint *j, const double *q, const frame_bar *bar, double *q_bar,
                      carom_vec2 *anchor_bar)
{
    carom_vec2 a_bar = bar->arm_a;
    carom_vec2 b_bar = bar->arm_b;
    double *qa = q_bar + 3 * j->body_a;
    double *qb = q_bar + 3 * j->body_b;
    add(&a_bar, bar->d, -1);
    add(&b_bar, bar->d, 1);
    qa[1] -= bar->d.x;
    qa[2] -= bar->d.y;
    qb[1] += bar->d.x;
    qb[2] += bar->d.y;
    crm_arm_vjp(q[3 * j->body_a], j->local_a, a_bar, qa, anchor_bar);
    crm_arm_vjp(q[3 * j->body_b], j->local_b, b_bar, qb, anchor_bar ? anchor_bar + 1 : NULL);
}

/* x holds the cotangent of the row; value_bar is that of the measure. */
static void made_vjp(const crm_joint *j, crm_measure m, const double *q, const crm_joint_frame *f,
                     frame_bar *x, double value_bar, double *q_bar, crm_joint_bar *bar)
{
    const carom_vec2 u = crm_measure_direction(j, m, q, f);
    double turn_bar;
    if (m == CRM_ALONG || m == CRM_ASIDE) add(&x->d, x->arm_a, 1); /* its arm is arm_a + d */
    add(&x->d, u, value_bar);
    if (m == CRM_APART) {
        bar->length -= value_bar;
    } else {
        add(&x->u, f->d, value_bar);
    }
    direction_vjp(m, f, u, x, &turn_bar);
    q_bar[3 * j->body_a] += turn_bar;
    bar->axis += turn_bar;
    frame_vjp(j, q, x, q_bar, bar->anchor);
}

/* A turn has a constant row. */
static void turn_vjp(const crm_joint *j, double value_bar, double *q_bar, crm_joint_bar *bar)
{
    q_bar[3 * j->body_a] -= j->lever * value_bar;
    q_bar[3 * j->body_b] += j->lever * value_bar;
    bar->angle -= j->lever * value_bar;
}

void crm_measure_vjp(const crm_joint *j, crm_measure m, const double *q, const double row_bar[6],
                     double value_bar, double *q_bar, crm_joint_bar *bar)
{
    if (m == CRM_TURN) {
        turn_vjp(j, value_bar, q_bar, bar);
        return;
    }
    const crm_joint_frame f = crm_joint_frame_at(j, q);
    frame_bar x = {{0, 0}, {0, 0}, {0, 0}, {0, 0}};
    if (row_bar) row_vjp(m, &f, crm_measure_direction(j, m, q, &f), row_bar, &x);
    made_vjp(j, m, q, &f, &x, value_bar, q_bar, bar);
}

void crm_joint_give(const crm_reverse *r, int joint, const crm_joint_bar *bar)
{
    const carom_gradient *g = &r->sink.g;
    for (int i = 0; g->anchors && i < 2; i++) add(&g->anchors[2 * joint + i], bar->anchor[i], 1);
    if (g->axes) g->axes[joint] += bar->axis;
    if (g->angles) g->angles[joint] += bar->angle;
    if (g->lengths) g->lengths[joint] += bar->length;
}

void crm_joint_vjp(crm_reverse *r, const double *q, int joint, const double *je_bar,
                   const double *error_bar, double *q_bar)
{
    const crm_joint *j = &r->world->joints[joint];
    const crm_measure *measures;
    r->stats.joints++;
    const int n = crm_joint_measures(j->kind, &measures);
    crm_joint_bar bar = {{{0, 0}, {0, 0}}, 0, 0, 0};
    for (int k = 0; k < n; k++) {
        crm_measure_vjp(j, measures[k], q, je_bar ? &je_bar[6 * k] : NULL,
                        error_bar ? error_bar[k] : 0, q_bar, &bar);
    }
    crm_joint_give(r, joint, &bar);
}

/* gap = sign (measure - bound), normal = sign u. */
void crm_limit_vjp(crm_reverse *r, const double *q, int limit, const carom_contact_bar *bar,
                   double *q_bar)
{
    const int joint = crm_limit_joint(limit);
    const crm_joint *j = &r->world->joints[joint];
    const crm_measure m = crm_limit_measure(j->kind);
    const double sign = crm_limit_sign(limit);
    const double value_bar = sign * bar->gap;
    crm_joint_bar to = {{{0, 0}, {0, 0}}, 0, 0, 0};
    if (m == CRM_TURN) {
        turn_vjp(j, value_bar, q_bar, &to);
    } else {
        const crm_joint_frame f = crm_joint_frame_at(j, q);
        frame_bar x = {bar->arm_a, bar->arm_b, {0, 0}, {0, 0}};
        add(&x.u, bar->normal, sign);
        made_vjp(j, m, q, &f, &x, value_bar, q_bar, &to);
    }
    double *bound = sign > 0 ? r->sink.g.lower : r->sink.g.upper;
    if (bound) bound[joint] -= value_bar * (m == CRM_TURN ? j->lever : 1);
    crm_joint_give(r, joint, &to);
}

/* --- forward: the transposes of the above ------------------------------------------------------
 */

carom_vec2 crm_arm_jvp(double angle, carom_vec2 local, double angle_dot,
                       const carom_vec2 *local_dot)
{
    const carom_vec2 arm = crm_rotate(angle, local);
    carom_vec2 dot = {-angle_dot * arm.y, angle_dot * arm.x};
    if (local_dot) add(&dot, crm_rotate(angle, *local_dot), 1);
    return dot;
}

/* Changes of what a measure and its row are made of; arm_a is the measure's arm on A. */
typedef struct frame_dot {
    carom_vec2 arm_a, arm_b, d, u;
} frame_dot;

static frame_dot frame_jvp(const crm_joint *j, int joint, crm_measure m, const double *q,
                           const crm_joint_frame *f, carom_vec2 u, const double *q_dot,
                           const carom_gradient *by)
{
    const carom_vec2 *local = by->anchors ? &by->anchors[2 * joint] : NULL;
    const double *a = q_dot + 3 * j->body_a;
    const double *b = q_dot + 3 * j->body_b;
    const carom_vec2 normal = {-u.y, u.x};
    frame_dot x = {{0, 0}, {0, 0}, {b[1] - a[1], b[2] - a[2]}, {0, 0}};
    x.arm_a = crm_arm_jvp(q[3 * j->body_a], j->local_a, a[0], local);
    x.arm_b = crm_arm_jvp(q[3 * j->body_b], j->local_b, b[0], local ? local + 1 : NULL);
    add(&x.d, x.arm_b, 1);
    add(&x.d, x.arm_a, -1);
    const double length = hypot(f->d.x, f->d.y);
    if (m == CRM_APART && length > 0) add(&x.u, normal, cross(u, x.d) / length);
    if (m != CRM_ALONG && m != CRM_ASIDE) return x;
    add(&x.u, normal, a[0] + crm_entry(by->axes, joint));
    add(&x.arm_a, x.d, 1);
    return x;
}

/* Of the measure, as made_vjp. */
static double made_jvp(int joint, crm_measure m, const crm_joint_frame *f, carom_vec2 u,
                       const frame_dot *x, const carom_gradient *by)
{
    const double along = u.x * x->d.x + u.y * x->d.y;
    if (m == CRM_APART) return along - crm_entry(by->lengths, joint);
    return along + x->u.x * f->d.x + x->u.y * f->d.y;
}

static double turn_jvp(const crm_joint *j, int joint, const double *q_dot, const carom_gradient *by)
{
    return j->lever *
           ((q_dot[3 * j->body_b] - q_dot[3 * j->body_a]) - crm_entry(by->angles, joint));
}

double crm_measure_jvp(const carom_world *w, int joint, crm_measure m, const double *q,
                       const double *q_dot, const carom_gradient *by, double row_dot[6])
{
    const crm_joint *j = &w->joints[joint];
    memset(row_dot, 0, 6 * sizeof *row_dot);
    if (m == CRM_TURN) return turn_jvp(j, joint, q_dot, by);
    const crm_joint_frame f = crm_joint_frame_at(j, q);
    const carom_vec2 u = crm_measure_direction(j, m, q, &f);
    const carom_vec2 arm = crm_measure_arm(m, &f);
    const frame_dot x = frame_jvp(j, joint, m, q, &f, u, q_dot, by);
    row_dot[0] = -(cross(x.arm_a, u) + cross(arm, x.u));
    row_dot[1] = -x.u.x;
    row_dot[2] = -x.u.y;
    row_dot[3] = cross(x.arm_b, u) + cross(f.arm_b, x.u);
    row_dot[4] = x.u.x;
    row_dot[5] = x.u.y;
    return made_jvp(joint, m, &f, u, &x, by);
}

carom_contact_dot crm_limit_jvp(const carom_world *w, const double *q, int limit,
                                const double *q_dot, const carom_gradient *by)
{
    const int joint = crm_limit_joint(limit);
    const crm_joint *j = &w->joints[joint];
    const crm_measure m = crm_limit_measure(j->kind);
    const double sign = crm_limit_sign(limit);
    const double lever = m == CRM_TURN ? j->lever : 1;
    carom_contact_dot dot = {{0, 0}, {0, 0}, {0, 0}, 0};
    double value;
    if (m == CRM_TURN) {
        value = turn_jvp(j, joint, q_dot, by);
    } else {
        const crm_joint_frame f = crm_joint_frame_at(j, q);
        const carom_vec2 u = crm_measure_direction(j, m, q, &f);
        const frame_dot x = frame_jvp(j, joint, m, q, &f, u, q_dot, by);
        value = made_jvp(joint, m, &f, u, &x, by);
        add(&dot.normal, x.u, sign);
        dot.arm_a = x.arm_a;
        dot.arm_b = x.arm_b;
    }
    dot.gap = sign * (value - lever * crm_entry(sign > 0 ? by->lower : by->upper, joint));
    return dot;
}
