/* forward.c: the pieces of a sub-step, forward; each is the transpose of one of reverse.c. */
#include "grad/internal.h"

#include <math.h>

void crm_begin_solve(crm_forward *f, crm_substep *s, const crm_solve *c)
{
    carom_world *w = f->world;
    f->problem = crm_solve_problem(w, s, c);
    crm_gather(w, c->v, w->rows.v);
    const carom_contact_solution x = {w->rows.v, c->ln, c->lt, c->le, c->mode};
    f->solution = x;
    const carom_status e =
        crm_kinks_of_solve(w, &f->tape->memory, &f->kinks, f->frame + 1, s, c, &f->problem);
    const carom_status smoothed =
        crm_smooth_solution(f->tape, &f->problem, c->kind, &f->smoothed, &f->solution, &f->stats);
    if (e < 0) f->failure = e;
    if (smoothed < 0) f->failure = smoothed;
}

/* W = 1 / m. */
static void masses_jvp(crm_forward *f, const carom_gradient *by)
{
    const carom_world *w = f->world;
    for (int i = 0; i < w->island->n_bodies; i++) {
        const int b = w->island->bodies[i];
        double *W = &f->dot.inv_mass[3 * i];
        W[0] = W[1] = W[2] = 0;
        if (w->bodies[b].type != CAROM_DYNAMIC) continue;
        W[0] = -crm_entry(by->inertia, b) / (w->inertia[b] * w->inertia[b]);
        W[1] = W[2] = -crm_entry(by->mass, b) / (w->mass[b] * w->mass[b]);
    }
}

/* Of number k of a body's velocity. */
static double damping_dot(const carom_world *w, const carom_gradient *by, int body, int k)
{
    if (!crm_is_damped(w, body, k)) return 0;
    return crm_entry(k ? by->linear_damping : by->angular_damping, body);
}

/* W = mean / m. */
static void damped_masses_jvp(crm_forward *f, const crm_substep *s, const crm_solve *c,
                              const crm_line *line)
{
    const carom_world *w = f->world;
    const double share = crm_share(c);
    const double h = share * s->h;
    for (int i = 0; i < 3 * w->island->n_bodies; i++) {
        const int b = w->island->bodies[i / 3];
        const double damping = w->bodies[b].damping[i % 3 > 0];
        if (w->bodies[b].type != CAROM_DYNAMIC) continue;
        const crm_decay d = crm_decay_in(damping, h);
        const double W = 1 / (i % 3 ? w->mass[b] : w->inertia[b]);
        const double x_dot = damping_dot(w, line->by, b, i % 3) * h + damping * share * line->h;
        f->dot.inv_mass[i] = d.mean * f->dot.inv_mass[i] + W * d.slope * x_dot;
    }
}

/* Of a combined coefficient. */
static double combined(int rule, const double *x, const double *x_dot, int a, int b)
{
    if (!x_dot) return 0;
    return x_dot[a] * crm_combine_slope(rule, x[a], x[b]) +
           x_dot[b] * crm_combine_slope(rule, x[b], x[a]);
}

double crm_restitution_jvp(const carom_world *w, const crm_substep *s, const crm_contact *c,
                           const carom_gradient *by)
{
    if (c->limit) return 0;
    return s->restitution * combined(w->settings.combine_restitution, w->restitution,
                                     by->restitution, c->body_a, c->body_b);
}

/* At mu = 0 there is no row; a first friction pushes on its own. */
static void friction_jvp(crm_forward *f, const crm_solve *c, int k, const crm_contact *x,
                         const carom_gradient *by)
{
    const carom_world *w = f->world;
    const int rule = w->settings.combine_friction;
    const double mu_dot = combined(rule, w->friction, by->friction, x->body_a, x->body_b);
    if (x->limit || mu_dot == 0) return;
    const int projects = c->kind == CRM_HOLD || c->kind == CRM_HOLD_SPEED;
    if (projects || crm_combine(rule, w->friction[x->body_a], w->friction[x->body_b]) > 0) {
        f->dot.mu[k] = projects ? 0 : mu_dot;
        return;
    }
    const double lt_dot = mu_dot * crm_first_friction(w, c, k, x);
    for (int i = 0; i < 6; i++) {
        const int body = w->rows.contact_body[2 * k + i / 3];
        if (body < 0) continue;
        const int at = 3 * body + i % 3;
        f->dot.u[at] += w->rows.inv_mass[at] * w->rows.jt[6 * k + i] * lt_dot;
    }
}

static void joint_rows_jvp(crm_forward *f, const crm_solve *c, const crm_line *line)
{
    const carom_world *w = f->world;
    int row = 0;
    for (int k = 0; k < w->island->n_joints; k++) {
        const int joint = w->island->joints[k];
        const crm_joint *j = &w->joints[joint];
        const crm_measure *measures;
        const int held = crm_joint_measures(j->kind, &measures);
        for (int i = 0; i < held; i++) {
            f->error[row + i] = crm_measure_jvp(w, joint, measures[i], c->q, line->q, line->by,
                                                &f->dot.je[6 * (row + i)]);
        }
        for (int i = held; i < j->n_rows; i++) {
            memset(&f->dot.je[6 * (row + i)], 0, 6 * sizeof(double));
            f->error[row + i] = 0;
        }
        for (int i = 0; i < j->n_rows; i++) f->dot.ce[row + i] = 0;
        row += j->n_rows;
    }
}

void crm_rows_jvp(crm_forward *f, const crm_substep *s, const crm_solve *c, const crm_line *line)
{
    const carom_world *w = f->world;
    const int rough = c->kind != CRM_CORRECTION && !s->slick;
    masses_jvp(f, line->by);
    if (f->world->damped) damped_masses_jvp(f, s, c, line);
    memset(f->dot.u, 0, 3 * (size_t)w->island->n_bodies * sizeof(double));
    for (int k = 0; k < s->n_contacts; k++) {
        const crm_contact *x = &s->moved[k];
        const carom_contact_dot dot = crm_geometry_jvp(w, c->q, x, line->q, line->by);
        crm_contact_rows_jvp(x, &dot, &f->dot.jn[6 * k], &f->dot.jt[6 * k]);
        f->gap[k] = dot.gap;
        f->dot.mu[k] = f->dot.cn[k] = f->dot.ct[k] = 0;
        if (rough) friction_jvp(f, c, k, x, line->by);
    }
    joint_rows_jvp(f, c, line);
}

static double gravity_jvp(const carom_world *w, const carom_gradient *by, int body, int k)
{
    if (w->bodies[body].type != CAROM_DYNAMIC || k == 0) return 0;
    return w->bodies[body].gravity_scale * crm_entry(by->gravity, k - 1) +
           w->settings.gravity[k - 1] * crm_entry(by->gravity_scale, body);
}

/* Of keep v + h mean g, what damping makes of number i of the island, but for v_dot. */
static double damped_jvp(const carom_world *w, const crm_substep *s, const crm_solve *c, int i,
                         const crm_line *line)
{
    const int b = w->island->bodies[i / 3];
    const int at = 3 * b + i % 3;
    const double share = crm_share(c);
    const double h = share * s->h;
    const double damping = w->bodies[b].damping[i % 3 > 0];
    const crm_decay d = crm_decay_in(damping, h);
    const double g = crm_gravity(w, b, i % 3);
    const double v = c->kind == CRM_STAGE_2 ? c[-1].v[at] : s->v0[at];
    return share * line->h * d.keep * (g - damping * v) +
           damping_dot(w, line->by, b, i % 3) * h * (h * d.slope * g - d.keep * v) +
           h * d.mean * gravity_jvp(w, line->by, b, i % 3);
}

void crm_free_velocity_jvp(crm_forward *f, const crm_substep *s, const crm_solve *c,
                           const crm_line *line, const double *v_dot)
{
    const carom_world *w = f->world;
    const carom_gradient *by = line->by;
    const double share = crm_share(c);
    const double h = share * s->h;
    const double *steps = by->force_steps;
    if (steps) steps += 3 * (size_t)w->n_bodies * (size_t)(f->frame - f->from);
    for (int i = 0; i < 3 * w->island->n_bodies; i++) {
        const int b = w->island->bodies[i / 3];
        const int at = 3 * b + i % 3;
        const double W = crm_force_gain(w, i);
        const double f_dot = crm_entry(by->force, at) + crm_entry(steps, at);
        const crm_decay d = crm_decay_in(w->bodies[b].damping[i % 3 > 0], w->damped ? h : 0);
        double *u_dot = &f->dot.u[i];
        *u_dot += d.keep * v_dot[at] + share * line->h * W * s->force[at] +
                  h * (f->dot.inv_mass[i] * s->force[at] + W * f_dot);
        *u_dot += w->damped ? damped_jvp(w, s, c, i, line)
                            : share * line->h * crm_gravity(w, b, i % 3) +
                                  h * gravity_jvp(w, by, b, i % 3);
    }
}

void crm_targets_jvp(crm_forward *f, const crm_substep *s, const crm_line *line)
{
    const carom_world *w = f->world;
    for (int k = 0; k < s->n_contacts; k++) {
        const crm_contact *c = &s->contacts[k];
        const double *jn = &w->rows.jn[6 * k];
        if (c->speculative) {
            f->dot.cn[k] = f->gap[k] / s->h - c->gap * line->h / (s->h * s->h);
            continue;
        }
        const double un = crm_row_dot(jn, s->v0, c->body_a, c->body_b);
        if (un >= -w->rest_speed) continue;
        const double un_dot = crm_row_dot(&f->dot.jn[6 * k], s->v0, c->body_a, c->body_b) +
                              crm_row_dot(jn, line->v0, c->body_a, c->body_b);
        f->dot.cn[k] = s->restitution * crm_restitution(w, c) * un_dot +
                       crm_restitution_jvp(w, s, c, line->by) * un;
    }
}

/* Change of the solution along d. */
static carom_status respond(crm_forward *f, const carom_contact_direction *d, double *v_dot)
{
    const carom_world *w = f->world;
    const carom_status e =
        carom_contact_tangent(w->solver, &f->problem, &f->solution, d, f->result);
    f->stats.solves++;
    if (e >= 0) crm_scatter(w, f->result, v_dot);
    return e;
}

carom_status crm_solve_jvp(crm_forward *f, double *v_dot)
{
    const crm_problem_dot *d = &f->dot;
    const carom_contact_direction all = {d->inv_mass, d->u,  d->jn, d->jt, d->mu,
                                         d->cn,       d->ct, d->je, d->ce};
    if (f->problem.n_contacts || f->problem.n_joint_rows) return respond(f, &all, v_dot);
    crm_scatter(f->world, d->u, v_dot);
    return CAROM_OK;
}

carom_status crm_push_jvp(crm_forward *f, double *v_dot)
{
    carom_contact_direction push = {0};
    push.u = f->dot.u;
    if (f->problem.n_contacts || f->problem.n_joint_rows) return respond(f, &push, v_dot);
    crm_scatter(f->world, f->dot.u, v_dot);
    return CAROM_OK;
}

carom_status crm_sides_jvp(crm_forward *f, double *v_dot)
{
    carom_contact_direction sides = {0};
    sides.cn = f->dot.cn;
    sides.ct = f->dot.ct;
    sides.ce = f->dot.ce;
    return respond(f, &sides, v_dot);
}

void crm_move_jvp(const carom_world *w, const crm_substep *s, const double *v, double h_dot,
                  const double *v_dot, double *q_dot)
{
    for (int i = 0; i < w->island->n_bodies; i++) {
        const int b = w->island->bodies[i];
        for (int k = 3 * b; k < 3 * b + 3; k++) q_dot[k] += s->h * v_dot[k] + h_dot * v[k];
    }
}

carom_status crm_correction_jvp(crm_forward *f, crm_substep *s, const crm_solve *c, int n)
{
    const crm_island *island = f->world->island;
    crm_begin_solve(f, s, c);
    for (int i = 0; i < n; i++) {
        double *q = f->lines[i].q;
        crm_rows_jvp(f, s, c, &f->lines[i]);
        for (int k = 0; k < s->n_contacts; k++) f->dot.cn[k] = f->gap[k];
        for (int k = 0; k < island->n_rows; k++) f->dot.ce[k] = f->error[k];
        const carom_status e = crm_solve_jvp(f, f->pose_dot);
        if (e < 0) return e;
        for (int k = 0; k < 3 * island->n_bodies; k++) {
            const int at = 3 * island->bodies[k / 3] + k % 3;
            q[at] += c->share * f->pose_dot[at];
        }
    }
    return CAROM_OK;
}

/* v1 from v0 with the targets of restitution: an impact, or the velocity of an Euler step. */
static carom_status velocity_jvp(crm_forward *f, crm_substep *s, int n)
{
    const crm_solve *c = &s->solve[0];
    crm_begin_solve(f, s, c);
    for (int i = 0; i < n; i++) {
        crm_line *line = &f->lines[i];
        crm_copy(f->world, line->v0, line->v);
        crm_rows_jvp(f, s, c, line);
        crm_free_velocity_jvp(f, s, c, line, line->v0);
        if (crm_share(c) > 0) crm_drive_jvp(f, s, c, line);
        crm_targets_jvp(f, s, line);
        const carom_status e = crm_solve_jvp(f, line->v);
        if (e < 0) return e;
    }
    return CAROM_OK;
}

static carom_status euler_jvp(crm_forward *f, crm_substep *s, int n)
{
    carom_status e = velocity_jvp(f, s, n);
    for (int i = 0; i < n; i++) {
        const crm_line *line = &f->lines[i];
        crm_move_jvp(f->world, s, s->solve[0].v, line->h, line->v, line->q);
    }
    for (int k = 1; e >= 0 && k < s->n_solves; k++) e = crm_correction_jvp(f, s, &s->solve[k], n);
    return e;
}

carom_status crm_substep_jvp(crm_forward *f, crm_substep *s, int n)
{
    switch (s->map) {
    case CRM_MAP_IMPACT: return velocity_jvp(f, s, n);
    case CRM_MAP_SMOOTH: return crm_smooth_jvp(f, s, n);
    case CRM_MAP_EXTRAPOLATED: return crm_extrapolated_jvp(f, s, n);
    case CRM_MAP_EULER: break;
    }
    return euler_jvp(f, s, n);
}
