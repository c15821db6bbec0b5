/* extrapolate.c: an extrapolated map backward: the holds, then every column with its weight. */
#include "grad/internal.h"

/* q' = q + d(q), with the slips from q0 among the right-hand sides. */
static carom_status hold_vjp(crm_reverse *r, crm_substep *s, const crm_solve *c, double *q_bar,
                             double *q0_bar)
{
    double none = 0;
    const carom_status e = crm_solve_vjp(r, s, c, q_bar);
    if (e < 0) return e;
    crm_mass_vjp(r, s, c, &none);
    for (int k = 0; k < s->n_contacts; k++) {
        if (!(r->world->rows.mu[k] > 0)) continue; /* crm_hold_problem has chosen */
        crm_slip_vjp(r, &s->moved[k], s->q0, c->q, r->bars.ct[k], q0_bar, q_bar);
    }
    crm_rows_vjp(r, s, c, r->bars.cn, r->bars.ce, q_bar);
    return CAROM_OK;
}

static carom_status hold_speed_vjp(crm_reverse *r, crm_substep *s, const crm_solve *c,
                                   double *q_bar, double *v_bar)
{
    const crm_island *island = r->world->island;
    double none = 0;
    const carom_status e = crm_solve_vjp(r, s, c, v_bar);
    if (e < 0) return e;
    crm_mass_vjp(r, s, c, &none);
    for (int i = 0; i < island->n_bodies; i++) {
        memcpy(&v_bar[3 * island->bodies[i]], &r->bars.u[3 * i], 3 * sizeof *v_bar);
    }
    crm_rows_vjp(r, s, c, NULL, NULL, q_bar);
    return CAROM_OK;
}

static carom_status holds_vjp(crm_reverse *r, crm_substep *s, double *q_bar, double *v_bar,
                              double *q0_bar)
{
    for (int k = s->n_solves - 1; k > 1; k--) {
        const crm_solve *c = &s->solve[k];
        const carom_status e = c->kind == CRM_HOLD ? hold_vjp(r, s, c, q_bar, q0_bar)
                                                   : hold_speed_vjp(r, s, c, q_bar, v_bar);
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
static carom_status column_vjp(crm_reverse *r, int n, int last, double *h_bar)
{
    for (int k = last; k > last - n; k--) {
        double inner_bar;
        const double before = r->time_bar;
        crm_unpack(r->world, &r->tape->records[k], r->moved, &r->inner);
        const carom_status e = crm_smooth_vjp(r, &r->inner.s, r->column_q, r->column_v, &inner_bar);
        if (e < 0) return e;
        /* It starts after so many of the column's n. */
        *h_bar += (inner_bar + (k - (last - n + 1)) * (r->time_bar - before)) / n;
    }
    return CAROM_OK;
}

/* Static bodies feel all columns alike: what they have is kept apart from what the columns give. */
carom_status crm_extrapolated_vjp(crm_reverse *r, crm_substep *s, double *q_bar, double *v_bar,
                                  double *h_bar)
{
    const carom_world *w = r->world;
    const size_t bytes = 3 * (size_t)w->n_bodies * sizeof(double);
    const int first = r->record - s->n_inner;
    memset(r->start_q, 0, bytes);
    memset(r->start_v, 0, bytes);
    *h_bar = 0;
    carom_status e = holds_vjp(r, s, q_bar, v_bar, r->start_q);
    for (int n = 1; e >= 0 && n * (n - 1) / 2 < s->n_inner; n++) {
        if (s->weight[n - 1] == 0) continue;
        memset(r->column_q, 0, bytes);
        memset(r->column_v, 0, bytes);
        add(w, r->column_q, q_bar, s->weight[n - 1]);
        add(w, r->column_v, v_bar, s->weight[n - 1]);
        e = column_vjp(r, n, first + n * (n + 1) / 2 - 1, h_bar);
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

/* --- forward: the transposes of the above ------------------------------------------------------
 */

static carom_status hold_jvp(crm_forward *f, crm_substep *s, const crm_solve *c, int n)
{
    const carom_world *w = f->world;
    const int poses = c->kind == CRM_HOLD;
    crm_begin_solve(f, s, c);
    for (int i = 0; i < n; i++) {
        crm_line *line = &f->lines[i];
        crm_rows_jvp(f, s, c, line);
        for (int k = 0; poses && k < s->n_contacts; k++) {
            f->dot.cn[k] = f->gap[k];
            if (!(w->rows.mu[k] > 0)) continue; /* crm_hold_problem has chosen */
            f->dot.ct[k] =
                crm_slip_jvp(w, &s->moved[k], s->q0, c->q, line->start_q, line->q, line->by);
        }
        for (int k = 0; poses && k < w->island->n_rows; k++) f->dot.ce[k] = f->error[k];
        if (!poses) crm_gather(w, line->v, f->dot.u);
        const carom_status e = crm_solve_jvp(f, poses ? f->pose_dot : line->v);
        if (e < 0) return e;
        if (poses) add(w, line->q, f->pose_dot, 1);
    }
    return CAROM_OK;
}

/* Column n, whose first inner record is `first`: its part of the sums. */
static carom_status column_jvp(crm_forward *f, int n, int first, double weight, int n_lines)
{
    const carom_world *w = f->world;
    for (int i = 0; i < n_lines; i++) {
        crm_line *line = &f->lines[i];
        crm_copy(w, line->q, line->start_q);
        crm_copy(w, line->v, line->start_v);
        line->h /= n;
    }
    carom_status e = CAROM_OK;
    for (int k = first; e >= 0 && k < first + n; k++) {
        crm_unpack(f->world, &f->tape->records[k], f->moved, &f->inner);
        e = crm_smooth_jvp(f, &f->inner.s, n_lines);
        for (int i = 0; i < n_lines; i++) f->lines[i].time += f->lines[i].h;
    }
    for (int i = 0; i < n_lines; i++) {
        crm_line *line = &f->lines[i];
        line->time -= n * line->h;
        add(w, line->sum_q, line->q, weight);
        add(w, line->sum_v, line->v, weight);
        line->h *= n;
    }
    return e;
}

carom_status crm_extrapolated_jvp(crm_forward *f, crm_substep *s, int n)
{
    const carom_world *w = f->world;
    const size_t bytes = 3 * (size_t)w->n_bodies * sizeof(double);
    const int first = f->record - s->n_inner;
    carom_status e = CAROM_OK;
    for (int i = 0; i < n; i++) {
        crm_line *line = &f->lines[i];
        memcpy(line->start_q, line->q, bytes);
        memcpy(line->start_v, line->v, bytes);
        crm_zero(w, line->sum_q);
        crm_zero(w, line->sum_v);
    }
    for (int k = 1; e >= 0 && k * (k - 1) / 2 < s->n_inner; k++) {
        if (s->weight[k - 1] == 0) continue;
        e = column_jvp(f, k, first + k * (k - 1) / 2, s->weight[k - 1], n);
    }
    for (int i = 0; i < n; i++) {
        crm_copy(w, f->lines[i].q, f->lines[i].sum_q);
        crm_copy(w, f->lines[i].v, f->lines[i].sum_v);
    }
    for (int k = 2; e >= 0 && k < s->n_solves; k++) e = hold_jvp(f, s, &s->solve[k], n);
    return e;
}
