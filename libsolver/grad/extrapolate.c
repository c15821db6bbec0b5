/* extrapolate.c: an extrapolated map backward: the holds, then every column with its weight. */
#include "grad/internal.h"

/* q' = q + d(q), with the slips from q0 among the right-hand sides. */
static carom_status hold_vjp(crm_reverse *r, crm_substep *s, const crm_solve *c, double *q_bar,
                             double *q0_bar, int with_parameters)
{
    const carom_status e = crm_solve_vjp(r, s, c, q_bar);
    if (e < 0) return e;
    if (with_parameters) crm_mass_vjp(r);
    for (int k = 0; k < s->n_contacts; k++) {
        if (!(r->world->rows.mu[k] > 0)) continue; /* crm_hold_problem has chosen */
        crm_slip_vjp(r, &s->moved[k], s->q0, c->q, r->bars.ct[k], q0_bar, q_bar, with_parameters);
    }
    crm_rows_vjp(r, s, c, r->bars.cn, r->bars.ce, q_bar, with_parameters);
    return CAROM_OK;
}

static carom_status hold_speed_vjp(crm_reverse *r, crm_substep *s, const crm_solve *c,
                                   double *q_bar, double *v_bar, int with_parameters)
{
    const crm_island *island = r->world->island;
    const carom_status e = crm_solve_vjp(r, s, c, v_bar);
    if (e < 0) return e;
    if (with_parameters) crm_mass_vjp(r);
    for (int i = 0; i < island->n_bodies; i++) {
        memcpy(&v_bar[3 * island->bodies[i]], &r->bars.u[3 * i], 3 * sizeof *v_bar);
    }
    crm_rows_vjp(r, s, c, NULL, NULL, q_bar, with_parameters);
    return CAROM_OK;
}

static carom_status holds_vjp(crm_reverse *r, crm_substep *s, double *q_bar, double *v_bar,
                              double *q0_bar, int with_parameters)
{
    for (int k = s->n_solves - 1; k > 1; k--) {
        const crm_solve *c = &s->solve[k];
        const carom_status e = c->kind == CRM_HOLD
                                   ? hold_vjp(r, s, c, q_bar, q0_bar, with_parameters)
                                   : hold_speed_vjp(r, s, c, q_bar, v_bar, with_parameters);
        if (e < 0) return e;
    }
    return CAROM_OK;
}

static void add(const carom_world *w, double *to, const double *from, double scale)
{
    for (int i = 0; i < w->island->n_bodies; i++) {
        const int b = 3 * w->island->bodies[i];
        for (int k = b; k < b + 3; k++) to[k] += scale * from[k];
    }
}

/* Column n, whose last inner record is `last`, from (column_q, column_v) at its end to its start.
 */
static carom_status column_vjp(crm_reverse *r, int n, int last, int with_parameters, double *h_bar)
{
    for (int k = last; k > last - n; k--) {
        double inner_bar;
        crm_unpack(r, &r->tape->records[k], &r->inner);
        const carom_status e =
            crm_smooth_vjp(r, &r->inner.s, r->column_q, r->column_v, with_parameters, &inner_bar);
        if (e < 0) return e;
        *h_bar += inner_bar / n;
    }
    return CAROM_OK;
}

/* Static bodies feel all columns alike: what they have is kept apart from what the columns give. */
carom_status crm_extrapolated_vjp(crm_reverse *r, crm_substep *s, double *q_bar, double *v_bar,
                                  int with_parameters, double *h_bar)
{
    const carom_world *w = r->world;
    const size_t bytes = 3 * (size_t)w->n_bodies * sizeof(double);
    const int first = r->record - s->n_inner;
    memset(r->start_q, 0, bytes);
    memset(r->start_v, 0, bytes);
    *h_bar = 0;
    carom_status e = holds_vjp(r, s, q_bar, v_bar, r->start_q, with_parameters);
    for (int n = 1; e >= 0 && n * (n - 1) / 2 < s->n_inner; n++) {
        if (s->weight[n - 1] == 0) continue;
        memset(r->column_q, 0, bytes);
        memset(r->column_v, 0, bytes);
        add(w, r->column_q, q_bar, s->weight[n - 1]);
        add(w, r->column_v, v_bar, s->weight[n - 1]);
        e = column_vjp(r, n, first + n * (n + 1) / 2 - 1, with_parameters, h_bar);
        for (int k = 0; k < 3 * w->n_bodies; k++) {
            r->start_q[k] += r->column_q[k];
            r->start_v[k] += r->column_v[k];
        }
    }
    if (e < 0) return e;
    crm_zero(w, q_bar);
    crm_zero(w, v_bar);
    for (int k = 0; k < 3 * w->n_bodies; k++) {
        q_bar[k] += r->start_q[k];
        v_bar[k] += r->start_v[k];
    }
    return CAROM_OK;
}
