/* reverse.c: the pieces of a sub-step, backward.  docs/gradient.md. */
#include "grad/internal.h"

#include <math.h>

void crm_pose_solve(crm_reverse *r, crm_substep *s, const crm_solve *c)
{
    carom_world *w = r->world;
    r->problem = crm_solve_problem(w, s, c);
    crm_gather(w, c->v, w->rows.v);
    const carom_contact_solution x = {w->rows.v, c->ln, c->lt, c->le, c->mode};
    r->solution = x;
    const carom_status e =
        crm_kinks_of_solve(w, &r->tape->memory, &r->kinks, r->frame + 1, s, c, &r->problem);
    const carom_status smoothed =
        crm_smooth_solution(r->tape, &r->problem, c->kind, &r->smoothed, &r->solution, &r->stats);
    if (e < 0) r->failure = e;
    if (smoothed < 0) r->failure = smoothed;
}

carom_status crm_sides_vjp(crm_reverse *r, const double *v_bar, double tol)
{
    carom_contact_solver *solver = r->world->solver;
    carom_contact_bars sides = {0};
    sides.u = r->bars.u;
    sides.cn = r->bars.cn;
    sides.ct = r->bars.ct;
    sides.ce = r->bars.ce;
    if (!r->problem.n_contacts && !r->problem.n_joint_rows) {
        crm_gather(r->world, v_bar, r->bars.u);
        return CAROM_OK;
    }
    crm_gather(r->world, v_bar, r->velocity_bar);
    r->stats.solves++;
    if (tol > 0) {
        return carom_contact_adjoint_again(solver, &r->problem, r->velocity_bar, tol, &sides);
    }
    return carom_contact_adjoint(solver, &r->problem, &r->solution, r->velocity_bar, &sides);
}

carom_status crm_rest_vjp(crm_reverse *r)
{
    return carom_contact_adjoint_rest(r->world->solver, &r->problem, &r->solution, &r->bars);
}

carom_status crm_solve_vjp(crm_reverse *r, crm_substep *s, const crm_solve *c, const double *v_bar)
{
    crm_pose_solve(r, s, c);
    const carom_status e = crm_sides_vjp(r, v_bar, 0);
    return e < 0 ? e : crm_rest_vjp(r);
}

/* Of number k of a body's velocity. */
static void give_damping(const crm_reverse *r, int body, int k, double d_bar)
{
    double *g = k ? r->sink.g.linear_damping : r->sink.g.angular_damping;
    if (g && crm_is_damped(r->world, body, k)) g[body] += d_bar;
}

/* W = mean / m: mean_bar = W_bar / m to h and damping; W_bar becomes that of 1 / m. */
static void damped_mass_vjp(crm_reverse *r, const crm_substep *s, const crm_solve *c, double *h_bar)
{
    const carom_world *w = r->world;
    const double share = crm_share(c);
    const double h = share * s->h;
    for (int i = 0; i < 3 * w->island->n_bodies; i++) {
        const int b = w->island->bodies[i / 3];
        const double d = w->bodies[b].damping[i % 3 > 0];
        if (w->bodies[b].type != CAROM_DYNAMIC) continue;
        const crm_decay x = crm_decay_in(d, h);
        const double W = 1 / (i % 3 ? w->mass[b] : w->inertia[b]);
        const double x_bar = r->bars.inv_mass[i] * W * x.slope;
        *h_bar += share * x_bar * d;
        r->bars.inv_mass[i] *= x.mean;
        give_damping(r, b, i % 3, x_bar * h);
    }
}

/* W = 1 / m: m_bar = -W_bar / m^2. */
void crm_mass_vjp(crm_reverse *r, const crm_substep *s, const crm_solve *c, double *h_bar)
{
    const carom_world *w = r->world;
    const carom_gradient *g = &r->sink.g;
    const double *W_bar = r->bars.inv_mass;
    if (w->damped) damped_mass_vjp(r, s, c, h_bar);
    if (!g->mass && !g->inertia) return;
    for (int i = 0; i < w->island->n_bodies; i++) {
        const int b = w->island->bodies[i];
        if (w->bodies[b].type != CAROM_DYNAMIC) continue;
        const double m = w->mass[b];
        if (g->mass) g->mass[b] -= (W_bar[3 * i + 1] + W_bar[3 * i + 2]) / (m * m);
        if (g->inertia) g->inertia[b] -= W_bar[3 * i] / (w->inertia[b] * w->inertia[b]);
    }
}

/* keep v + h mean g of number i of the island, what damping makes of it; h mean = (1 - keep) / d.
 */
static void damped_vjp(crm_reverse *r, const crm_substep *s, const crm_solve *c, int i,
                       double *h_bar)
{
    const carom_world *w = r->world;
    const int b = w->island->bodies[i / 3];
    const double u_bar = r->bars.u[i];
    const double share = crm_share(c);
    const double h = share * s->h;
    const double damping = w->bodies[b].damping[i % 3 > 0];
    const crm_decay d = crm_decay_in(damping, h);
    const double g = crm_gravity(w, b, i % 3);
    const double v = c->kind == CRM_STAGE_2 ? c[-1].v[3 * b + i % 3] : s->v0[3 * b + i % 3];
    *h_bar += share * u_bar * d.keep * (g - damping * v);
    give_damping(r, b, i % 3, u_bar * h * (h * d.slope * g - d.keep * v));
}

static void gravity_vjp(const crm_reverse *r, int body, int k, double g_bar)
{
    const carom_world *w = r->world;
    const carom_gradient *g = &r->sink.g;
    if (w->bodies[body].type != CAROM_DYNAMIC || k == 0) return;
    if (g->gravity) g->gravity[k - 1] += w->bodies[body].gravity_scale * g_bar;
    if (g->gravity_scale) g->gravity_scale[body] += w->settings.gravity[k - 1] * g_bar;
}

void crm_free_velocity_vjp(crm_reverse *r, const crm_substep *s, const crm_solve *c, double *v_bar,
                           double *h_bar)
{
    const carom_world *w = r->world;
    const carom_gradient *g = &r->sink.g;
    const double share = crm_share(c);
    const double h = share * s->h;
    for (int i = 0; i < 3 * w->island->n_bodies; i++) {
        const int b = w->island->bodies[i / 3];
        const int at = 3 * b + i % 3;
        const double W = crm_force_gain(w, i);
        const double u_bar = r->bars.u[i];
        const crm_decay d = crm_decay_in(w->bodies[b].damping[i % 3 > 0], w->damped ? h : 0);
        v_bar[at] += d.keep * u_bar;
        *h_bar += share * u_bar * W * s->force[at];
        r->bars.inv_mass[i] += h * u_bar * s->force[at];
        if (w->damped) {
            damped_vjp(r, s, c, i, h_bar);
        } else {
            *h_bar += share * u_bar * crm_gravity(w, b, i % 3);
        }
        if (g->force) g->force[at] += h * W * u_bar;
        if (r->sink.force_step) r->sink.force_step[at] += h * W * u_bar;
        gravity_vjp(r, b, i % 3, h * d.mean * u_bar);
    }
}

void crm_restitution_vjp(crm_reverse *r, const crm_substep *s, const crm_contact *c, double e_bar)
{
    const carom_world *w = r->world;
    double *g = r->sink.g.restitution;
    const double a = w->restitution[c->body_a];
    const double b = w->restitution[c->body_b];
    const int rule = w->settings.combine_restitution;
    if (!g || c->limit) return;
    g[c->body_a] += s->restitution * e_bar * crm_combine_slope(rule, a, b);
    g[c->body_b] += s->restitution * e_bar * crm_combine_slope(rule, b, a);
}

void crm_targets_vjp(crm_reverse *r, const crm_substep *s, const double *v, double *v_bar,
                     double *gap_bar, double *h_bar)
{
    const carom_world *w = r->world;
    for (int k = 0; k < s->n_contacts; k++) {
        const crm_contact *c = &s->contacts[k];
        const double *jn = &w->rows.jn[6 * k];
        const double cn_bar = r->bars.cn[k];
        gap_bar[k] = 0;
        if (c->speculative) {
            gap_bar[k] = cn_bar / s->h;
            *h_bar -= cn_bar * c->gap / (s->h * s->h);
            continue;
        }
        const double un = crm_row_dot(jn, v, c->body_a, c->body_b);
        if (un >= -w->rest_speed) continue;
        const double e = s->restitution * crm_restitution(w, c);
        for (int i = 0; i < 3; i++) {
            v_bar[3 * c->body_a + i] += e * cn_bar * jn[i];
            v_bar[3 * c->body_b + i] += e * cn_bar * jn[3 + i];
            r->bars.jn[6 * k + i] += e * cn_bar * v[3 * c->body_a + i];
            r->bars.jn[6 * k + 3 + i] += e * cn_bar * v[3 * c->body_b + i];
        }
        crm_restitution_vjp(r, s, c, cn_bar * un);
    }
}

static void add_friction(crm_reverse *r, const crm_contact *c, double mu_bar)
{
    const carom_world *w = r->world;
    double *g = r->sink.g.friction;
    if (!g) return;
    const double a = w->friction[c->body_a];
    const double b = w->friction[c->body_b];
    const int rule = w->settings.combine_friction;
    g[c->body_a] += mu_bar * crm_combine_slope(rule, a, b);
    g[c->body_b] += mu_bar * crm_combine_slope(rule, b, a);
}

/* mu_bar = d l_t / d mu . J_t W p with p = u_bar. */
static double first_friction(const crm_reverse *r, const crm_solve *c, int k, const crm_contact *x)
{
    const crm_rows *rows = &r->world->rows;
    const double slope = crm_first_friction(r->world, c, k, x);
    double sum = 0;
    for (int i = 0; slope != 0 && i < 6; i++) {
        const int body = rows->contact_body[2 * k + i / 3];
        if (body < 0) continue;
        const int at = 3 * body + i % 3;
        sum += rows->jt[6 * k + i] * rows->inv_mass[at] * r->bars.u[at];
    }
    return slope * sum;
}

static void friction_vjp(crm_reverse *r, const crm_solve *c, int k, const crm_contact *x)
{
    const carom_world *w = r->world;
    if (!r->sink.g.friction || x->limit) return;
    const double mu =
        crm_combine(w->settings.combine_friction, w->friction[x->body_a], w->friction[x->body_b]);
    const int projects = c->kind == CRM_HOLD || c->kind == CRM_HOLD_SPEED;
    if (mu > 0 || projects) {
        add_friction(r, x, r->bars.mu[k]);
    } else {
        add_friction(r, x, first_friction(r, c, k, x));
    }
}

void crm_rows_vjp(crm_reverse *r, const crm_substep *s, const crm_solve *c, const double *gap_bar,
                  const double *error_bar, double *q_bar)
{
    const int rough = c->kind != CRM_CORRECTION && !s->slick;
    for (int k = 0; k < s->n_contacts; k++) {
        carom_contact_bar bar = {{0, 0}, {0, 0}, {0, 0}, gap_bar ? gap_bar[k] : 0};
        const double *jt_bar = rough ? &r->bars.jt[6 * k] : NULL;
        crm_contact_rows_vjp(&s->moved[k], &r->bars.jn[6 * k], jt_bar, &bar);
        crm_geometry_vjp(r, c->q, &s->moved[k], &bar, q_bar);
        if (rough) friction_vjp(r, c, k, &s->moved[k]);
    }
    int row = 0;
    for (int k = 0; k < r->world->island->n_joints; k++) {
        const int joint = r->world->island->joints[k];
        crm_joint_vjp(r, c->q, joint, &r->bars.je[6 * row], error_bar ? &error_bar[row] : NULL,
                      q_bar);
        row += r->world->joints[joint].n_rows;
    }
}

carom_status crm_correction_vjp(crm_reverse *r, crm_substep *s, const crm_solve *c, double *q_bar)
{
    const crm_island *island = r->world->island;
    for (int i = 0; i < 3 * island->n_bodies; i++) {
        const int k = 3 * island->bodies[i / 3] + i % 3;
        r->pose_bar[k] = c->share * q_bar[k];
    }
    double none = 0;
    const carom_status e = crm_solve_vjp(r, s, c, r->pose_bar);
    if (e < 0) return e;
    crm_mass_vjp(r, s, c, &none);
    crm_rows_vjp(r, s, c, r->bars.cn, r->bars.ce, q_bar);
    return CAROM_OK;
}

void crm_move_vjp(const carom_world *w, const crm_substep *s, const double *v, const double *q_bar,
                  double *v_bar, double *h_bar)
{
    for (int i = 0; i < w->island->n_bodies; i++) {
        const int b = w->island->bodies[i];
        for (int k = 3 * b; k < 3 * b + 3; k++) {
            v_bar[k] += s->h * q_bar[k];
            *h_bar += q_bar[k] * v[k];
        }
    }
}

carom_status crm_euler_vjp(crm_reverse *r, crm_substep *s, double *q_bar, double *v_bar,
                           double *h_bar)
{
    const crm_solve *c = &s->solve[0];
    *h_bar = 0;
    for (int k = s->n_solves - 1; k > 0; k--) {
        const carom_status e = crm_correction_vjp(r, s, &s->solve[k], q_bar);
        if (e < 0) return e;
    }
    crm_move_vjp(r->world, s, c->v, q_bar, v_bar, h_bar);
    const carom_status e = crm_solve_vjp(r, s, c, v_bar);
    if (e < 0) return e;
    crm_zero(r->world, v_bar);
    crm_free_velocity_vjp(r, s, c, v_bar, h_bar);
    crm_drive_vjp(r, s, c, v_bar, q_bar, h_bar);
    crm_mass_vjp(r, s, c, h_bar);
    crm_targets_vjp(r, s, s->v0, v_bar, r->gap_bar, h_bar);
    crm_rows_vjp(r, s, c, r->gap_bar, NULL, q_bar);
    return CAROM_OK;
}

carom_status crm_impact_vjp(crm_reverse *r, crm_substep *s, double *q_bar, double *v_bar)
{
    const crm_solve *c = &s->solve[0];
    double none = 0;
    const carom_status e = crm_solve_vjp(r, s, c, v_bar);
    if (e < 0) return e;
    crm_zero(r->world, v_bar);
    crm_free_velocity_vjp(r, s, c, v_bar, &none);
    crm_mass_vjp(r, s, c, &none);
    crm_targets_vjp(r, s, s->v0, v_bar, r->gap_bar, &none);
    crm_rows_vjp(r, s, c, NULL, NULL, q_bar);
    return CAROM_OK;
}

carom_status crm_substep_vjp(crm_reverse *r, crm_substep *s, double *q_bar, double *v_bar,
                             double *h_bar)
{
    *h_bar = 0;
    switch (s->map) {
    case CRM_MAP_IMPACT: return crm_impact_vjp(r, s, q_bar, v_bar);
    case CRM_MAP_SMOOTH: return crm_smooth_vjp(r, s, q_bar, v_bar, h_bar);
    case CRM_MAP_EXTRAPOLATED: return crm_extrapolated_vjp(r, s, q_bar, v_bar, h_bar);
    case CRM_MAP_EULER: break;
    }
    return crm_euler_vjp(r, s, q_bar, v_bar, h_bar);
}
