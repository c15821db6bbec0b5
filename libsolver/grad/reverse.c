/* reverse.c: reverse derivative of one sub-step: corrections, then the velocity problem.
 * docs/gradient.md. */
#include "grad/internal.h"

#include <math.h>

static void gather(const carom_world *w, const double *full, double *moving)
{
    for (int b = 0; b < w->n_bodies; b++) {
        const int i = crm_unknown(w, b);
        if (i >= 0) memcpy(&moving[3 * i], &full[3 * b], 3 * sizeof(double));
    }
}

/* W = 1 / m: m_bar = -W_bar / m^2. */
static void add_masses(crm_reverse *r)
{
    const carom_world *w = r->world;
    const carom_gradient *g = &r->sink.g;
    const double *W_bar = r->bars.inv_mass;
    if (!g->mass && !g->inertia) return;
    for (int b = 0; b < w->n_bodies; b++) {
        const int i = crm_unknown(w, b);
        if (w->bodies[b].type != CAROM_DYNAMIC) continue;
        const double m = w->mass[b];
        if (g->mass) g->mass[b] -= (W_bar[3 * i + 1] + W_bar[3 * i + 2]) / (m * m);
        if (g->inertia) g->inertia[b] -= W_bar[3 * i] / (w->inertia[b] * w->inertia[b]);
    }
}

/* Geometry at q of a correction: rows, gaps and joint errors. */
static void add_position_geometry(crm_reverse *r, const crm_substep *s, const double *q,
                                  double *q_bar, int with_parameters)
{
    for (int k = 0; k < s->n_contacts; k++) {
        carom_contact_bar bar = {{0, 0}, {0, 0}, {0, 0}, r->bars.cn[k]};
        crm_contact_rows_vjp(&s->moved[k], &r->bars.jn[6 * k], NULL, &bar);
        crm_geometry_vjp(r, q, &s->moved[k], &bar, q_bar, with_parameters);
    }
    for (int k = 0; k < r->world->n_joints; k++) {
        crm_joint_vjp(r, q, k, &r->bars.je[12 * k], &r->bars.ce[2 * k], q_bar, with_parameters);
    }
}

/* d = q' - q of the moving bodies. */
static void displacement(const carom_world *w, const double *after, const double *before, double *d)
{
    for (int b = 0; b < w->n_bodies; b++) {
        const int i = crm_unknown(w, b);
        for (int k = 0; i >= 0 && k < 3; k++) d[3 * i + k] = after[3 * b + k] - before[3 * b + k];
    }
}

/* q' = q + d(q): the frictionless problem of a position correction. */
static carom_status projection_vjp(crm_reverse *r, crm_substep *s, int index, double *q_bar,
                                   int with_parameters)
{
    carom_world *w = r->world;
    const crm_projection *c = &s->projection[index];
    const double *after = index + 1 < s->n_projections ? c[1].q : s->q1;
    displacement(w, after, c->q, w->rows.v);
    const carom_contact_problem p = crm_position_problem(w, s, c->q, NULL);
    const carom_contact_solution x = {w->rows.v, c->ln, s->moved_lt, c->le, c->mode};
    gather(w, q_bar, r->velocity_bar);
    carom_contact_bars bars = r->bars;
    bars.jt = NULL;
    bars.mu = NULL;
    bars.ct = NULL;
    bars.u = NULL;
    if (!with_parameters) bars.inv_mass = NULL;
    const carom_status e = carom_contact_adjoint(w->solver, &p, &x, r->velocity_bar, &bars);
    if (e < 0) return e;
    r->stats.factorizations++;
    if (with_parameters) add_masses(r);
    add_position_geometry(r, s, c->q, q_bar, with_parameters);
    return CAROM_OK;
}

/* u = v0 + h (W f + g). */
static void free_velocity_vjp(crm_reverse *r, const crm_substep *s, double *v_bar, double *h_bar,
                              int with_parameters)
{
    const carom_world *w = r->world;
    const carom_gradient *g = &r->sink.g;
    for (int b = 0; b < w->n_bodies; b++) {
        const int i = crm_unknown(w, b);
        for (int k = 0; i >= 0 && k < 3; k++) {
            const double W = w->rows.inv_mass[3 * i + k];
            const double u_bar = r->bars.u[3 * i + k];
            const int falls = w->bodies[b].type == CAROM_DYNAMIC && k > 0;
            const double gravity = falls ? w->settings.gravity[k - 1] : 0;
            v_bar[3 * b + k] += u_bar;
            *h_bar += u_bar * (W * s->force[3 * b + k] + gravity);
            if (!with_parameters) continue;
            r->bars.inv_mass[3 * i + k] += s->h * u_bar * s->force[3 * b + k];
            if (g->force) g->force[3 * b + k] += s->h * W * u_bar;
            if (r->sink.force_step) r->sink.force_step[3 * b + k] += s->h * W * u_bar;
            if (g->gravity && falls) g->gravity[k - 1] += s->h * u_bar;
        }
    }
}

/* c_n = e u_n with u_n = J_n v0, or gap / h ahead. */
static void target_vjp(crm_reverse *r, const crm_substep *s, int k, carom_contact_bar *bar,
                       double *v_bar, double *h_bar, int with_parameters)
{
    const carom_world *w = r->world;
    const crm_contact *c = &s->contacts[k];
    const double *jn = &w->rows.jn[6 * k];
    const double cn_bar = r->bars.cn[k];
    if (c->speculative) {
        bar->gap += cn_bar / s->h;
        *h_bar -= cn_bar * c->gap / (s->h * s->h);
        return;
    }
    const double un = crm_row_dot(jn, s->v0, c->body_a, c->body_b);
    if (un >= -w->rest_speed) return;
    const double ea = w->restitution[c->body_a];
    const double eb = w->restitution[c->body_b];
    const int rule = w->settings.combine_restitution;
    const double e = s->restitution * crm_combine(rule, ea, eb);
    for (int i = 0; i < 3; i++) {
        v_bar[3 * c->body_a + i] += e * cn_bar * jn[i];
        v_bar[3 * c->body_b + i] += e * cn_bar * jn[3 + i];
        r->bars.jn[6 * k + i] += e * cn_bar * s->v0[3 * c->body_a + i];
        r->bars.jn[6 * k + 3 + i] += e * cn_bar * s->v0[3 * c->body_b + i];
    }
    if (with_parameters && r->sink.g.restitution) {
        const double e_bar = s->restitution * cn_bar * un;
        r->sink.g.restitution[c->body_a] += e_bar * crm_combine_slope(rule, ea, eb);
        r->sink.g.restitution[c->body_b] += e_bar * crm_combine_slope(rule, eb, ea);
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

static void add_velocity_geometry(crm_reverse *r, const crm_substep *s, double *q_bar,
                                  double *v_bar, double *h_bar, int with_parameters)
{
    for (int k = 0; k < s->n_contacts; k++) {
        carom_contact_bar bar = {{0, 0}, {0, 0}, {0, 0}, 0};
        target_vjp(r, s, k, &bar, v_bar, h_bar, with_parameters);
        crm_contact_rows_vjp(&s->contacts[k], &r->bars.jn[6 * k], &r->bars.jt[6 * k], &bar);
        crm_geometry_vjp(r, s->q0, &s->contacts[k], &bar, q_bar, with_parameters);
        if (with_parameters) add_friction(r, &s->contacts[k], r->bars.mu[k]);
    }
    for (int k = 0; k < r->world->n_joints; k++) {
        crm_joint_vjp(r, s->q0, k, &r->bars.je[12 * k], NULL, q_bar, with_parameters);
    }
}

/* v1 = v+(q0, v0, h), q1 = q0 + h v1. */
static carom_status velocity_vjp(crm_reverse *r, crm_substep *s, double *q_bar, double *v_bar,
                                 int with_parameters, double *h_bar)
{
    carom_world *w = r->world;
    const int n = 3 * w->n_bodies;
    const carom_contact_problem p = crm_velocity_problem(w, s);
    gather(w, s->v1, w->rows.v);
    const carom_contact_solution x = {w->rows.v, s->ln, s->lt, s->le, s->mode};
    *h_bar = 0;
    for (int b = 0; b < w->n_bodies; b++) {
        if (crm_unknown(w, b) < 0) continue;
        for (int k = 3 * b; k < 3 * b + 3; k++) {
            v_bar[k] += s->h * q_bar[k];
            *h_bar += q_bar[k] * s->v1[k];
        }
    }
    gather(w, v_bar, r->velocity_bar);
    const carom_status e = carom_contact_adjoint(w->solver, &p, &x, r->velocity_bar, &r->bars);
    if (e < 0) return e;
    r->stats.factorizations++;
    memset(v_bar, 0, (size_t)n * sizeof *v_bar);
    free_velocity_vjp(r, s, v_bar, h_bar, with_parameters);
    if (with_parameters) add_masses(r);
    add_velocity_geometry(r, s, q_bar, v_bar, h_bar, with_parameters);
    return CAROM_OK;
}

carom_status crm_substep_vjp(crm_reverse *r, const crm_substep *recorded, double *q_bar,
                             double *v_bar, int with_parameters, double *h_bar)
{
    crm_substep s = *recorded;
    s.moved = r->moved;
    s.moved_lt = r->moved_lt;
    for (int k = s.n_projections - 1; k >= 0; k--) {
        const carom_status e = projection_vjp(r, &s, k, q_bar, with_parameters);
        if (e < 0) return e;
    }
    return velocity_vjp(r, &s, q_bar, v_bar, with_parameters, h_bar);
}
