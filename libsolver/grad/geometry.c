/* geometry.c: reverse derivatives of Jacobian rows, gaps and joint errors. */
#include "grad/internal.h"

#include <math.h>

/* Of row(d) = (-cross(ra, d), -d, cross(rb, d), d): d_bar and the arms' cotangents. */
static carom_vec2 direction_row_vjp(const crm_contact *c, carom_vec2 d, const double g[6],
                                    carom_contact_bar *bar)
{
    const carom_vec2 ra = c->arm_a;
    const carom_vec2 rb = c->arm_b;
    const carom_vec2 d_bar = {ra.y * g[0] - g[1] - rb.y * g[3] + g[4],
                              -ra.x * g[0] - g[2] + rb.x * g[3] + g[5]};
    bar->arm_a.x -= d.y * g[0];
    bar->arm_a.y += d.x * g[0];
    bar->arm_b.x += d.y * g[3];
    bar->arm_b.y -= d.x * g[3];
    return d_bar;
}

void crm_contact_rows_vjp(const crm_contact *c, const double jn_bar[6], const double jt_bar[6],
                          carom_contact_bar *bar)
{
    const carom_vec2 n_bar = direction_row_vjp(c, c->normal, jn_bar, bar);
    bar->normal.x += n_bar.x;
    bar->normal.y += n_bar.y;
    if (!jt_bar) return;
    const carom_vec2 t = {-c->normal.y, c->normal.x};
    const carom_vec2 t_bar = direction_row_vjp(c, t, jt_bar, bar);
    bar->normal.x += t_bar.y;
    bar->normal.y -= t_bar.x;
}

static void add_pose(double *q_bar, int body, carom_pose p)
{
    q_bar[3 * body] += p.angle;
    q_bar[3 * body + 1] += p.x;
    q_bar[3 * body + 2] += p.y;
}

void crm_geometry_vjp(crm_reverse *r, const double *q, const crm_contact *c,
                      const carom_contact_bar *bar, double *q_bar, int with_parameters)
{
    const carom_world *w = r->world;
    const crm_shape *a = &w->shapes[c->shape_a];
    const crm_shape *b = &w->shapes[c->shape_b];
    carom_vec2 *vertices = with_parameters ? r->sink.g.vertices : NULL;
    carom_shape_bar a_bar = {{0, 0, 0}, 0, vertices ? vertices + a->first_vertex : NULL};
    carom_shape_bar b_bar = {{0, 0, 0}, 0, vertices ? vertices + b->first_vertex : NULL};
    carom_contact_vjp(&a->view, crm_pose(q, c->body_a), &b->view, crm_pose(q, c->body_b), c->recipe,
                      bar, &a_bar, &b_bar);
    add_pose(q_bar, c->body_a, a_bar.pose);
    add_pose(q_bar, c->body_b, b_bar.pose);
    if (with_parameters && r->sink.g.radius) {
        r->sink.g.radius[c->shape_a] += a_bar.radius;
        r->sink.g.radius[c->shape_b] += b_bar.radius;
    }
}

/* Of x = p + R(angle) local: the arm's cotangent to angle and local. */
static void arm_vjp(double angle, carom_vec2 local, carom_vec2 arm_bar, double *angle_bar,
                    carom_vec2 *local_bar)
{
    const double c = cos(angle);
    const double s = sin(angle);
    const carom_vec2 arm = {c * local.x - s * local.y, s * local.x + c * local.y};
    *angle_bar += arm.x * arm_bar.y - arm.y * arm_bar.x;
    if (!local_bar) return;
    local_bar->x += c * arm_bar.x + s * arm_bar.y;
    local_bar->y += -s * arm_bar.x + c * arm_bar.y;
}

void crm_joint_vjp(crm_reverse *r, const double *q, int joint, const double je_bar[12],
                   const double *error_bar, double *q_bar, int with_parameters)
{
    const crm_joint *j = &r->world->joints[joint];
    carom_vec2 *anchors = with_parameters ? r->sink.g.anchors : NULL;
    const double *g = je_bar;
    carom_vec2 a_bar = {g[6], -g[0]};
    carom_vec2 b_bar = {-g[9], g[3]};
    if (error_bar) {
        a_bar.x += error_bar[0];
        a_bar.y += error_bar[1];
        b_bar.x -= error_bar[0];
        b_bar.y -= error_bar[1];
        q_bar[3 * j->body_a + 1] += error_bar[0];
        q_bar[3 * j->body_a + 2] += error_bar[1];
        q_bar[3 * j->body_b + 1] -= error_bar[0];
        q_bar[3 * j->body_b + 2] -= error_bar[1];
    }
    arm_vjp(q[3 * j->body_a], j->local_a, a_bar, &q_bar[3 * j->body_a],
            anchors ? &anchors[2 * joint] : NULL);
    arm_vjp(q[3 * j->body_b], j->local_b, b_bar, &q_bar[3 * j->body_b],
            anchors ? &anchors[2 * joint + 1] : NULL);
}
