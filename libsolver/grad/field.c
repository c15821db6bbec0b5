/* field.c: forces that the caller computes, backward and forward. */
#include "grad/internal.h"

/* g = h W u_bar of body i of the island. */
static void push_bar(const crm_reverse *r, const crm_substep *s, const crm_solve *c, int i,
                     double g[3])
{
    const double h = crm_share(c) * s->h;
    for (int k = 0; k < 3; k++) {
        g[k] = h * r->world->rows.inv_mass[3 * i + k] * r->bars.u[3 * i + k];
    }
}

/* to += A' g */
static void add_transposed(const double A[9], const double g[3], double *to)
{
    for (int j = 0; j < 3; j++) to[j] += A[j] * g[0] + A[3 + j] * g[1] + A[6 + j] * g[2];
}

/* <d f / dt, g> of body b to the time of the sub-step's start, and to h where it acts at its end.
 */
static void rate_vjp(crm_reverse *r, const crm_substep *s, const crm_solve *c, int b,
                     const double g[3], double *h_bar)
{
    double rate[3];
    crm_field_rate(r->world, b, crm_field_time(s, c), c->q, crm_field_velocity(s, c), rate);
    const double t_bar = rate[0] * g[0] + rate[1] * g[1] + rate[2] * g[2];
    r->time_bar += t_bar;
    if (crm_field_is_late(s, c)) *h_bar += t_bar;
}

void crm_fields_vjp(crm_reverse *r, const crm_substep *s, const crm_solve *c, double *v_bar,
                    double *q_bar, double *h_bar)
{
    const carom_world *w = r->world;
    const double t = crm_field_time(s, c);
    const double *v = crm_field_velocity(s, c);
    const double share = crm_share(c);
    double *seen_bar = c->kind == CRM_STAGE_2 ? r->late_bar : v_bar;
    for (int i = 0; i < w->island->n_bodies; i++) {
        const int b = w->island->bodies[i];
        double f[3], g[3], A[9], B[9];
        if (w->bodies[b].type != CAROM_DYNAMIC) continue;
        crm_field_force(w, b, t, c->q, v, f);
        crm_field_slopes(w, b, t, c->q, v, A, B);
        push_bar(r, s, c, i, g);
        add_transposed(A, g, q_bar + 3 * b);
        add_transposed(B, g, seen_bar + 3 * b);
        rate_vjp(r, s, c, b, g, h_bar);
        for (int k = 3 * i; k < 3 * i + 3; k++) {
            r->bars.inv_mass[k] += share * s->h * f[k % 3] * r->bars.u[k];
            *h_bar += share * w->rows.inv_mass[k] * f[k % 3] * r->bars.u[k];
        }
    }
}

void crm_fields_seen_vjp(crm_reverse *r, const crm_substep *s, const crm_solve *c, double *seen_bar)
{
    const carom_world *w = r->world;
    const double t = crm_field_time(s, c);
    for (int i = 0; w->n_fields && i < w->island->n_bodies; i++) {
        const int b = w->island->bodies[i];
        double g[3], A[9], B[9];
        if (w->bodies[b].type != CAROM_DYNAMIC) continue;
        crm_field_slopes(w, b, t, c->q, crm_field_velocity(s, c), A, B);
        push_bar(r, s, c, i, g);
        add_transposed(B, g, seen_bar + 3 * b);
    }
}

static double row_times(const double A[9], int i, const double *x)
{
    return A[3 * i] * x[0] + A[3 * i + 1] * x[1] + A[3 * i + 2] * x[2];
}

void crm_fields_jvp(crm_forward *f, const crm_substep *s, const crm_solve *c, const crm_line *line)
{
    const carom_world *w = f->world;
    const double t = crm_field_time(s, c);
    const double *v = crm_field_velocity(s, c);
    const double share = crm_share(c);
    const int late = c->kind == CRM_STAGE_2;
    const double t_dot = line->time + (crm_field_is_late(s, c) ? line->h : 0);
    for (int i = 0; i < w->island->n_bodies; i++) {
        const int b = w->island->bodies[i];
        double force[3], rate[3], A[9], B[9];
        if (w->bodies[b].type != CAROM_DYNAMIC) continue;
        crm_field_force(w, b, t, c->q, v, force);
        crm_field_slopes(w, b, t, c->q, v, A, B);
        crm_field_rate(w, b, t, c->q, v, rate);
        for (int k = 0; k < 3; k++) {
            const double W = w->rows.inv_mass[3 * i + k];
            double dot = row_times(A, k, line->q + 3 * b) + rate[k] * t_dot;
            if (!late) dot += row_times(B, k, line->v0 + 3 * b);
            f->dot.u[3 * i + k] +=
                share *
                (line->h * W * force[k] + s->h * (f->dot.inv_mass[3 * i + k] * force[k] + W * dot));
        }
    }
}

void crm_fields_seen_jvp(crm_forward *f, const crm_substep *s, const crm_solve *c, const double *x)
{
    const carom_world *w = f->world;
    const double t = crm_field_time(s, c);
    const double h = crm_share(c) * s->h;
    for (int i = 0; w->n_fields && i < w->island->n_bodies; i++) {
        const int b = w->island->bodies[i];
        double A[9], B[9];
        if (w->bodies[b].type != CAROM_DYNAMIC) continue;
        crm_field_slopes(w, b, t, c->q, crm_field_velocity(s, c), A, B);
        for (int k = 0; k < 3; k++) {
            f->dot.u[3 * i + k] += h * w->rows.inv_mass[3 * i + k] * row_times(B, k, x + 3 * b);
        }
    }
}
