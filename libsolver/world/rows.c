/* rows.c: Jacobian rows of contacts and joints, and the two contact problems of a sub-step. */
#include "world/internal.h"

#include <math.h>

double crm_combine(int rule, double a, double b)
{
    switch (rule) {
    case CAROM_COMBINE_GEOMETRIC: return sqrt(a * b);
    case CAROM_COMBINE_MIN: return a < b ? a : b;
    case CAROM_COMBINE_MAX: return a > b ? a : b;
    default: return 0.5 * (a + b);
    }
}

/* At a = b of min and max each side takes one half; at a = 0 the geometric mean has none. */
double crm_combine_slope(int rule, double a, double b)
{
    switch (rule) {
    case CAROM_COMBINE_GEOMETRIC: return a > 0 ? 0.5 * sqrt(b / a) : 0;
    case CAROM_COMBINE_MIN: return a < b ? 1 : a > b ? 0 : 0.5;
    case CAROM_COMBINE_MAX: return a > b ? 1 : a < b ? 0 : 0.5;
    default: return 0.5;
    }
}

double crm_row_dot(const double row[6], const double *v, int body_a, int body_b)
{
    const double *a = v + 3 * body_a;
    const double *b = v + 3 * body_b;
    return row[0] * a[0] + row[1] * a[1] + row[2] * a[2] + row[3] * b[0] + row[4] * b[1] +
           row[5] * b[2];
}

static void direction_row(carom_vec2 ra, carom_vec2 rb, carom_vec2 d, double row[6])
{
    row[0] = -(ra.x * d.y - ra.y * d.x);
    row[1] = -d.x;
    row[2] = -d.y;
    row[3] = rb.x * d.y - rb.y * d.x;
    row[4] = d.x;
    row[5] = d.y;
}

void crm_contact_rows(const crm_contact *c, double jn[6], double jt[6])
{
    const carom_vec2 t = {-c->normal.y, c->normal.x};
    direction_row(c->arm_a, c->arm_b, c->normal, jn);
    direction_row(c->arm_a, c->arm_b, t, jt);
}

static carom_vec2 rotate(double angle, carom_vec2 v)
{
    const double c = cos(angle);
    const double s = sin(angle);
    const carom_vec2 r = {c * v.x - s * v.y, s * v.x + c * v.y};
    return r;
}

void crm_joint_rows(const crm_joint *j, const double *q, double je[12], double error[2])
{
    const carom_pose a = crm_pose(q, j->body_a);
    const carom_pose b = crm_pose(q, j->body_b);
    const carom_vec2 ra = rotate(a.angle, j->local_a);
    const carom_vec2 rb = rotate(b.angle, j->local_b);
    const double rows[12] = {-ra.y, 1, 0, rb.y, -1, 0, ra.x, 0, 1, -rb.x, 0, -1};
    memcpy(je, rows, sizeof rows);
    error[0] = (a.x - b.x) + (ra.x - rb.x);
    error[1] = (a.y - b.y) + (ra.y - rb.y);
}

static void fill_contacts(carom_world *w, int n, const crm_contact *contacts)
{
    crm_rows *r = &w->rows;
    for (int k = 0; k < n; k++) {
        const crm_contact *c = &contacts[k];
        r->contact_body[2 * k] = crm_unknown(w, c->body_a);
        r->contact_body[2 * k + 1] = crm_unknown(w, c->body_b);
        crm_contact_rows(c, &r->jn[6 * k], &r->jt[6 * k]);
        r->mu[k] = crm_combine(w->settings.combine_friction, w->friction[c->body_a],
                               w->friction[c->body_b]);
    }
}

static double fill_joints(carom_world *w, const double *q)
{
    crm_rows *r = &w->rows;
    double largest = 0;
    for (int k = 0; k < w->n_joints; k++) {
        crm_joint_rows(&w->joints[k], q, &r->je[12 * k], &r->ce[2 * k]);
        largest = fmax(largest, fmax(fabs(r->ce[2 * k]), fabs(r->ce[2 * k + 1])));
        for (int i = 2 * k; i < 2 * k + 2; i++) {
            r->joint_body[2 * i] = crm_unknown(w, w->joints[k].body_a);
            r->joint_body[2 * i + 1] = crm_unknown(w, w->joints[k].body_b);
        }
    }
    return largest;
}

double crm_joint_drift(const carom_world *w, const double *q)
{
    double largest = 0;
    for (int k = 0; k < w->n_joints; k++) {
        double je[12];
        double e[2];
        crm_joint_rows(&w->joints[k], q, je, e);
        largest = fmax(largest, hypot(e[0], e[1]));
    }
    return largest;
}

/* x += scale J' for one row; x has three numbers per moving body. */
static void add_row(double *x, const int body[2], const double row[6], double scale)
{
    for (int side = 0; side < 2; side++) {
        if (body[side] < 0) continue;
        for (int i = 0; i < 3; i++) x[3 * body[side] + i] += scale * row[3 * side + i];
    }
}

static void fill_inverse_masses(carom_world *w)
{
    for (int b = 0; b < w->n_bodies; b++) {
        const int i = crm_unknown(w, b);
        if (i < 0) continue;
        const int moves = w->bodies[b].type == CAROM_DYNAMIC;
        w->rows.inv_mass[3 * i] = moves ? 1 / w->inertia[b] : 0;
        w->rows.inv_mass[3 * i + 1] = moves ? 1 / w->mass[b] : 0;
        w->rows.inv_mass[3 * i + 2] = w->rows.inv_mass[3 * i + 1];
    }
}

/* u = v0 + h (W f + g): the velocity without contacts and joints. */
static void fill_free_velocity(carom_world *w, const crm_substep *s)
{
    for (int b = 0; b < w->n_bodies; b++) {
        const int i = crm_unknown(w, b);
        if (i < 0) continue;
        const int falls = w->bodies[b].type == CAROM_DYNAMIC;
        for (int k = 0; k < 3; k++) {
            const double g = falls && k > 0 ? w->settings.gravity[k - 1] : 0;
            const double a = w->rows.inv_mass[3 * i + k] * s->force[3 * b + k] + g;
            w->rows.u[3 * i + k] = s->v0[3 * b + k] + s->h * a;
        }
    }
}

/* c_n: restitution e u_n of an approach faster than v_rest, equations.md (3); gap / h ahead. */
static void fill_velocity_targets(carom_world *w, crm_substep *s)
{
    for (int k = 0; k < s->n_contacts; k++) {
        const crm_contact *c = &s->contacts[k];
        const double un = crm_row_dot(&w->rows.jn[6 * k], s->v0, c->body_a, c->body_b);
        const double e = crm_combine(w->settings.combine_restitution, w->restitution[c->body_a],
                                     w->restitution[c->body_b]);
        s->cn[k] = 0;
        if (c->speculative) {
            s->cn[k] = c->gap / s->h;
        } else if (un < -w->rest_speed) {
            s->cn[k] = s->restitution * e * un;
        }
    }
}

static carom_contact_problem problem_of(carom_world *w, int n_contacts)
{
    const crm_rows *r = &w->rows;
    carom_contact_problem p = {0};
    p.n_bodies = w->n_moving;
    p.n_contacts = n_contacts;
    p.n_joint_rows = 2 * w->n_joints;
    p.inv_mass = r->inv_mass;
    p.u = r->u;
    p.contact_body = r->contact_body;
    p.jn = r->jn;
    p.jt = r->jt;
    p.mu = r->mu;
    p.cn = r->cn;
    p.joint_body = r->joint_body;
    p.je = r->je;
    return p;
}

carom_contact_problem crm_velocity_problem(carom_world *w, crm_substep *s)
{
    fill_inverse_masses(w);
    fill_free_velocity(w, s);
    fill_contacts(w, s->n_contacts, s->contacts);
    fill_joints(w, s->q0);
    fill_velocity_targets(w, s);
    carom_contact_problem p = problem_of(w, s->n_contacts);
    p.cn = s->cn;
    return p;
}

/* The displacement that the pressing contacts and the joints of this sub-step gave, taken back:
 * u = -h W (Jn' ln + Je' le), rows at the pose of the correction. */
static void fill_withdrawn(carom_world *w, const crm_substep *s)
{
    crm_rows *r = &w->rows;
    memset(r->u, 0, 3 * (size_t)w->n_moving * sizeof(double));
    for (int k = 0; k < s->n_contacts; k++) {
        if (s->pressing[k]) add_row(r->u, &r->contact_body[2 * k], &r->jn[6 * k], -s->h * s->ln[k]);
    }
    for (int k = 0; k < 2 * w->n_joints; k++) {
        add_row(r->u, &r->joint_body[2 * k], &r->je[6 * k], -s->h * s->le[k]);
    }
    for (int k = 0; k < 3 * w->n_moving; k++) r->u[k] *= r->inv_mass[k];
}

carom_contact_problem crm_position_problem(carom_world *w, crm_substep *s, const double *q,
                                           double *violation)
{
    double largest = 0;
    fill_inverse_masses(w);
    for (int k = 0; k < s->n_contacts; k++) {
        s->moved[k] = s->contacts[k];
        crm_contact_refresh(w, q, &s->moved[k]);
        const double gap = s->moved[k].gap;
        w->rows.cn[k] = gap;
        largest = fmax(largest, s->pressing[k] ? fabs(gap) : -gap);
    }
    fill_contacts(w, s->n_contacts, s->moved);
    largest = fmax(largest, fill_joints(w, q));
    fill_withdrawn(w, s);
    if (violation) *violation = largest;
    carom_contact_problem p = problem_of(w, s->n_contacts);
    p.mu = w->rows.zero;
    p.ce = w->rows.ce;
    return p;
}
