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
    jn[0] -= c->turn;
    jn[3] += c->turn;
    direction_row(c->arm_a, c->arm_b, t, jt);
}

/* A pair of sharp vertices has no tangent that slips: no friction in smooth motion. */
static int sharp(const carom_world *w, const crm_contact *c)
{
    return c->recipe.kernel == CAROM_POINT_POINT &&
           w->shapes[c->shape_a].view.radius + w->shapes[c->shape_b].view.radius <= 0;
}

static void fill_contacts(carom_world *w, const crm_substep *s)
{
    crm_rows *r = &w->rows;
    for (int k = 0; k < s->n_contacts; k++) {
        const crm_contact *c = &s->moved[k];
        r->contact_body[2 * k] = crm_unknown(w, c->body_a);
        r->contact_body[2 * k + 1] = crm_unknown(w, c->body_b);
        crm_contact_rows(c, &r->jn[6 * k], &r->jt[6 * k]);
        r->mu[k] = crm_combine(w->settings.combine_friction, w->friction[c->body_a],
                               w->friction[c->body_b]);
        if (c->limit ||
            ((s->map == CRM_MAP_SMOOTH || s->map == CRM_MAP_EXTRAPOLATED) && sharp(w, c)))
            r->mu[k] = 0;
    }
}

static void fill_joints(carom_world *w, const double *q)
{
    crm_rows *r = &w->rows;
    int row = 0;
    for (int k = 0; k < w->island->n_joints; k++) {
        const crm_joint *j = &w->joints[w->island->joints[k]];
        crm_joint_rows(j, q, &r->je[6 * row], &r->error[row]);
        for (int i = 0; i < j->n_rows; i++, row++) {
            r->joint_body[2 * row] = crm_unknown(w, j->body_a);
            r->joint_body[2 * row + 1] = crm_unknown(w, j->body_b);
        }
    }
}

/* Damping makes every push within h act times the mean of what is kept of it until its end. */
static void damp_masses(carom_world *w, double h)
{
    for (int i = 0; i < w->island->n_bodies; i++) {
        const crm_body *b = &w->bodies[w->island->bodies[i]];
        for (int k = 0; k < 3; k++) {
            w->rows.inv_mass[3 * i + k] *= crm_decay_in(b->damping[k > 0], h).mean;
        }
    }
}

static void fill_inverse_masses(carom_world *w)
{
    for (int i = 0; i < w->island->n_bodies; i++) {
        const int b = w->island->bodies[i];
        const int moves = w->bodies[b].type == CAROM_DYNAMIC;
        w->rows.inv_mass[3 * i] = moves ? 1 / w->inertia[b] : 0;
        w->rows.inv_mass[3 * i + 1] = moves ? 1 / w->mass[b] : 0;
        w->rows.inv_mass[3 * i + 2] = w->rows.inv_mass[3 * i + 1];
    }
}

void crm_rows_at(carom_world *w, crm_substep *s, const double *q)
{
    for (int k = 0; k < s->n_contacts; k++) {
        s->moved[k] = s->contacts[k];
        if (q != s->q0) crm_contact_refresh(w, q, &s->moved[k]);
    }
    fill_inverse_masses(w);
    fill_contacts(w, s);
    fill_joints(w, q);
}

int crm_world_is_damped(const carom_world *w)
{
    for (int b = 0; b < w->n_bodies; b++) {
        if (crm_is_damped(w, b, 0) || crm_is_damped(w, b, 1)) return 1;
    }
    return 0;
}

double crm_gravity(const carom_world *w, int body, int k)
{
    const crm_body *b = &w->bodies[body];
    return b->type == CAROM_DYNAMIC && k > 0 ? b->gravity_scale * w->settings.gravity[k - 1] : 0;
}

double crm_force_gain(const carom_world *w, int i)
{
    const int kinematic = w->bodies[w->island->bodies[i / 3]].type == CAROM_KINEMATIC;
    return kinematic ? 1 : w->rows.inv_mass[i];
}

void crm_free_acceleration(const carom_world *w, int body, const double *v, double a[3])
{
    const double *f = &w->step_force[3 * body];
    const carom_body_type type = w->bodies[body].type;
    for (int k = 0; k < 3; k++) a[k] = type == CAROM_KINEMATIC ? f[k] : 0;
    if (type != CAROM_DYNAMIC) return;
    for (int k = 0; k < 3; k++) {
        const double m = k ? w->mass[body] : w->inertia[body];
        a[k] = f[k] / m + crm_gravity(w, body, k);
        if (v && w->damped) a[k] -= w->bodies[body].damping[k > 0] * v[k];
    }
}

/* rows.u = v + h (W f + g), after damping: keep v + h mean (W f + g), with `mean` in rows.inv_mass
 * already. */
static void free_velocity(carom_world *w, const crm_substep *s, const double *v, double h)
{
    for (int i = 0; i < w->island->n_bodies; i++) {
        const int b = w->island->bodies[i];
        for (int k = 0; k < 3; k++) {
            const double push = crm_force_gain(w, 3 * i + k) * s->force[3 * b + k];
            const double g = crm_gravity(w, b, k);
            double *u = &w->rows.u[3 * i + k];
            *u = v[3 * b + k] + h * (push + g);
            if (!w->damped) continue;
            const crm_decay d = crm_decay_in(w->bodies[b].damping[k > 0], h);
            *u = d.keep * v[3 * b + k] + h * (push + d.mean * g);
        }
    }
}

carom_contact_problem crm_problem(carom_world *w, const crm_substep *s, const crm_solve *c)
{
    const crm_rows *r = &w->rows;
    carom_contact_problem p = {0};
    p.n_bodies = w->island->n_bodies;
    p.n_contacts = s->n_contacts;
    p.n_joint_rows = w->island->n_rows;
    p.inv_mass = r->inv_mass;
    p.u = r->u;
    p.contact_body = r->contact_body;
    p.jn = r->jn;
    p.jt = r->jt;
    p.mu = c->kind == CRM_CORRECTION || s->slick ? r->zero : r->mu;
    p.cn = c->cn;
    p.ct = c->ct;
    p.joint_body = r->joint_body;
    p.je = r->je;
    p.ce = c->ce;
    return p;
}

int crm_velocity_targets(carom_world *w, crm_substep *s, crm_solve *c)
{
    int any = 0;
    for (int k = 0; k < s->n_contacts; k++) {
        const crm_contact *x = &s->contacts[k];
        const double un = crm_row_dot(&w->rows.jn[6 * k], s->v0, x->body_a, x->body_b);
        const double e = crm_restitution(w, x);
        c->cn[k] = 0;
        c->ct[k] = 0;
        if (x->speculative) {
            c->cn[k] = x->gap / s->h;
        } else if (un < -w->rest_speed) {
            c->cn[k] = s->restitution * e * un;
        }
        any |= c->cn[k] < 0;
    }
    for (int k = 0; k < w->island->n_rows; k++) c->ce[k] = 0;
    crm_motor_sides(w, c);
    return any;
}

void crm_solve_velocity(carom_world *w, const crm_substep *s, const crm_solve *c)
{
    const double h = crm_share(c) * s->h;
    if (c->kind == CRM_CORRECTION || c->kind == CRM_HOLD || c->kind == CRM_HOLD_SPEED) {
        /* The velocity before it is not known here, and no derivative asks for it. */
        memset(w->rows.u, 0, 3 * (size_t)w->island->n_bodies * sizeof(double));
        return;
    }
    if (w->damped) {
        fill_inverse_masses(w);
        damp_masses(w, h);
    }
    free_velocity(w, s, c->kind == CRM_STAGE_2 ? c[-1].v : s->v0, h);
    if (w->n_fields) crm_fields(w, s, c);
    if (!w->island->n_driven || !(crm_share(c) > 0)) return;
    crm_springs(w, s, c);
    crm_motors(w, s, c);
}

void crm_solve_start(carom_world *w, const crm_substep *s, crm_solve *c)
{
    const unsigned char state = crm_share(c) > 0 ? CRM_MOTOR_HOLDS : CRM_MOTOR_OFF;
    int row = 0;
    for (int k = 0; k < w->island->n_joints; k++) {
        const crm_joint *j = &w->joints[w->island->joints[k]];
        for (int i = 0; i < j->n_rows; i++) {
            c->motor[row++] = i < j->n_held ? CRM_MOTOR_OFF : state;
        }
    }
    crm_solve_velocity(w, s, c);
}

carom_contact_problem crm_solve_problem(carom_world *w, crm_substep *s, const crm_solve *c)
{
    crm_rows_at(w, s, c->q);
    crm_solve_velocity(w, s, c);
    const int holds = c->kind == CRM_HOLD || c->kind == CRM_HOLD_SPEED;
    return holds ? crm_hold_problem(w, s, c) : crm_problem(w, s, c);
}
