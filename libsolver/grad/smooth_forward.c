/* smooth_forward.c: the two-stage map forward: the transposes of smooth.c. */
#include "grad/internal.h"

#include <math.h>

/* Of c_n and c_t of one contact in an iteration. */
static void contact_side_jvp(crm_forward *f, const crm_substep *s, int k, const crm_line *line,
                             const double *v)
{
    const carom_world *w = f->world;
    const double h = s->h;
    const crm_contact *c = &s->contacts[k];
    const int a = c->body_a;
    const int b = c->body_b;
    const double un = crm_row_dot(&f->dot.jn[6 * k], v, a, b);
    const double start = s->target[k] != 0 ? f->gap[k] + w->recovery * line->h : 0;
    const carom_contact_dot end = crm_geometry_jvp(w, f->pose, c, f->pose_dot, line->by);
    f->dot.cn[k] = (end.gap - start) / h - un;
    f->dot.ct[k] = 0;
    if (!(w->rows.mu[k] > 0)) return;
    const double ut = crm_row_dot(&f->dot.jt[6 * k], v, a, b);
    f->dot.ct[k] = crm_slip_jvp(w, c, s->q0, f->pose, line->q, f->pose_dot, line->by) / h - ut;
}

/* Of c_e of one joint, whose first row in the island is `first`. */
static void joint_side_jvp(crm_forward *f, const crm_substep *s, int joint, int first,
                           const crm_line *line, const double *v)
{
    const carom_world *w = f->world;
    const crm_joint *j = &w->joints[joint];
    const crm_measure *measures;
    const double h = s->h;
    double row_dot[6];
    const int held = crm_joint_measures(j->kind, &measures);
    for (int i = 0; i < held; i++) {
        const int row = first + i;
        const double target = s->joint_target[row];
        const double start =
            target != 0 ? f->error[row] - copysign(w->recovery, target) * line->h : 0;
        const double end =
            crm_measure_jvp(w, joint, measures[i], f->pose, f->pose_dot, line->by, row_dot);
        f->dot.ce[row] =
            (end - start) / h - crm_row_dot(&f->dot.je[6 * row], v, j->body_a, j->body_b);
    }
}

/* Right-hand sides along the line, at no change of the velocity v of the fixed point. */
static void sides_jvp(crm_forward *f, const crm_substep *s, const crm_line *line)
{
    const carom_world *w = f->world;
    const double *v = s->solve[0].v;
    memcpy(f->pose_dot, line->q, 3 * (size_t)w->n_bodies * sizeof *v);
    for (int i = 0; i < w->island->n_bodies; i++) {
        const int b = 3 * w->island->bodies[i];
        for (int k = b; k < b + 3; k++) f->pose_dot[k] += line->h * v[k];
    }
    for (int k = 0; k < s->n_contacts; k++) contact_side_jvp(f, s, k, line, v);
    int row = 0;
    for (int k = 0; k < w->island->n_joints; k++) {
        const int joint = w->island->joints[k];
        const crm_joint *j = &w->joints[joint];
        joint_side_jvp(f, s, joint, row, line, v);
        row += j->n_rows;
        if (j->n_rows == j->n_held) continue;
        f->dot.ce[row - 1] += crm_motor_side_jvp(f, s, joint, row - 1, line);
    }
}

/* One pass: what the change x of the velocity gives to it, the data at rest. */
static carom_status pass_jvp(crm_forward *f, const crm_substep *s, const double *x, double *to)
{
    const carom_world *w = f->world;
    for (int k = 0; k < s->n_contacts; k++) {
        const crm_contact *c = &s->contacts[k];
        f->dot.cn[k] = crm_row_dot(&f->turn.n[6 * k], x, c->body_a, c->body_b);
        f->dot.ct[k] = crm_row_dot(&f->turn.t[6 * k], x, c->body_a, c->body_b);
    }
    int row = 0;
    for (int k = 0; k < w->island->n_joints; k++) {
        const crm_joint *j = &w->joints[w->island->joints[k]];
        for (int i = 0; i < j->n_rows; i++, row++) {
            f->dot.ce[row] = crm_row_dot(&f->turn.e[6 * row], x, j->body_a, j->body_b);
        }
    }
    return crm_sides_jvp(f, to);
}

/* sum += m with m = rest + A m, A one pass, known to within tol. */
static carom_status sum_passes_jvp(crm_forward *f, const crm_substep *s, double *sum, double tol,
                                   double loose)
{
    carom_world *w = f->world;
    crm_anderson *a = &w->anderson;
    const int n = 3 * w->island->n_bodies;
    double error = HUGE_VAL;
    carom_status e = crm_anderson_start(&w->memory, a, n);
    if (e < 0) return e;
    crm_gather(w, f->rest, a->point);
    for (int k = 0; k < CRM_MAX_PASSES && error > tol; k++) {
        crm_scatter(w, a->point, f->trial);
        e = pass_jvp(f, s, f->trial, f->trial);
        if (e < 0) return e;
        error = 0;
        crm_gather(w, f->trial, a->value);
        for (int i = 0; i < n; i++) {
            a->value[i] += f->rest[3 * w->island->bodies[i / 3] + i % 3];
            error = fmax(error, fabs(a->value[i] - a->point[i]));
        }
        if (!(error < HUGE_VAL)) return CAROM_E_NO_SOLUTION;
        crm_anderson_next(a);
    }
    crm_scatter(w, a->point, f->trial);
    crm_move(w, sum, f->trial, 1);
    return error <= loose ? CAROM_OK : CAROM_E_NO_SOLUTION;
}

/* The change of the fixed point, sum = rest + A rest + A A rest + ..., from its first term. */
static carom_status close_jvp(crm_forward *f, const crm_substep *s, double *sum)
{
    const carom_world *w = f->world;
    const double first = crm_largest(w, f->rest);
    double last = HUGE_VAL;
    crm_zero(w, sum);
    if (!s->n_contacts && !w->island->n_rows) {
        crm_copy(w, sum, f->rest);
        return CAROM_OK;
    }
    for (int k = 0; k < CRM_MAX_PASSES; k++) {
        const double rest = crm_largest(w, f->rest);
        if (rest <= CRM_PASS_TOL * first) return CAROM_OK;
        if (!(rest < HUGE_VAL)) return CAROM_E_NO_SOLUTION;
        if (k > 1 && rest > CRM_SLOW * last) {
            return sum_passes_jvp(f, s, sum, CRM_PASS_TOL * first,
                                  CRM_PASS_LOOSE * fmax(first, rest));
        }
        crm_move(w, sum, f->rest, 1);
        const carom_status e = pass_jvp(f, s, f->rest, f->rest);
        if (e < 0) return e;
        last = rest;
    }
    return crm_largest(w, f->rest) <= CRM_PASS_LOOSE * first ? CAROM_OK : CAROM_E_NO_SOLUTION;
}

static carom_status stage_1_jvp(crm_forward *f, crm_substep *s, int n)
{
    const crm_solve *c = &s->solve[0];
    carom_world *w = f->world;
    crm_copy(w, f->pose, s->q0);
    crm_move(w, f->pose, c->v, s->h);
    crm_rows_at(w, s, f->pose);
    crm_turn_end(w, s, f->pose, &f->turn);
    crm_begin_solve(f, s, c);
    crm_turn_start(w, s, &f->turn);
    /* joints alone need no passes: at the fixed point their rows at the end of the stage hold */
    const int at_once = !s->n_contacts && w->island->n_rows;
    for (int k = 0; at_once && k < 6 * w->island->n_rows; k++) {
        f->left[k] = w->rows.je[k] + f->turn.e[k];
    }
    f->problem.je_left = at_once ? f->left : NULL;
    for (int i = 0; i < n; i++) {
        crm_line *line = &f->lines[i];
        crm_copy(w, line->v0, line->v);
        crm_rows_jvp(f, s, c, line);
        crm_free_velocity_jvp(f, s, c, line, line->v0);
        crm_drive_jvp(f, s, c, line);
        sides_jvp(f, s, line);
        carom_status e = crm_solve_jvp(f, at_once ? line->v : f->rest);
        if (e >= 0 && !at_once) e = close_jvp(f, s, line->v);
        if (e < 0) return e;
        crm_move_jvp(w, s, c->v, line->h, line->v, line->q);
    }
    return CAROM_OK;
}

/* x becomes x + S (x + S (x + ...)), S what a change of the velocity that forces see gives to v1.
 */
static carom_status close_seen(crm_forward *f, const crm_substep *s, const crm_solve *c, double *x)
{
    carom_world *w = f->world;
    crm_anderson *a = &w->anderson;
    const int n = 3 * w->island->n_bodies;
    const double first = crm_largest(w, x);
    double error = HUGE_VAL;
    carom_status e = crm_anderson_start(&w->memory, a, n);
    if (e < 0) return e;
    crm_copy(w, f->rest, x);
    crm_gather(w, x, a->point);
    for (int k = 0; k < CRM_MAX_PASSES && error > CRM_PASS_TOL * first; k++) {
        crm_scatter(w, a->point, f->trial);
        memset(f->dot.u, 0, (size_t)n * sizeof(double));
        crm_seen_jvp(f, s, c, f->trial);
        e = crm_push_jvp(f, f->trial);
        if (e < 0) return e;
        crm_gather(w, f->trial, a->value);
        error = 0;
        for (int i = 0; i < n; i++) {
            a->value[i] += f->rest[3 * w->island->bodies[i / 3] + i % 3];
            error = fmax(error, fabs(a->value[i] - a->point[i]));
        }
        if (!(error < HUGE_VAL)) return CAROM_E_NO_SOLUTION;
        crm_anderson_next(a);
    }
    crm_scatter(w, a->point, x);
    return error <= CRM_PASS_LOOSE * first ? CAROM_OK : CAROM_E_NO_SOLUTION;
}

/* c_n of a contact that has opened, gap / h. */
static carom_status stage_2_jvp(crm_forward *f, crm_substep *s, int n)
{
    const crm_solve *c = &s->solve[1];
    crm_begin_solve(f, s, c);
    for (int i = 0; i < n; i++) {
        crm_line *line = &f->lines[i];
        crm_rows_jvp(f, s, c, line);
        crm_free_velocity_jvp(f, s, c, line, line->v);
        crm_drive_jvp(f, s, c, line);
        for (int k = 0; k < s->n_contacts; k++) {
            if (c->cn[k] != 0) f->dot.cn[k] = (f->gap[k] - c->cn[k] * line->h) / s->h;
        }
        carom_status e = crm_solve_jvp(f, line->v);
        if (e >= 0 && crm_sees_speed(f->world)) e = close_seen(f, s, c, line->v);
        if (e < 0) return e;
    }
    return CAROM_OK;
}

/* Of c_n of a bounce. */
static double bounce_side_jvp(const crm_forward *f, const crm_substep *s, int k,
                              const crm_line *line)
{
    const carom_world *w = f->world;
    const crm_contact *x = &s->moved[k];
    const double cn = s->solve[1].cn[k];
    const double *jn = &w->rows.jn[6 * k];
    if (x->gap > w->settings.margin * w->length) return (f->gap[k] - cn * line->h) / s->h;
    if (cn >= 0) return 0;
    const double un = crm_row_dot(jn, s->v0, x->body_a, x->body_b);
    const double un_dot = crm_row_dot(&f->dot.jn[6 * k], s->v0, x->body_a, x->body_b) +
                          crm_row_dot(jn, line->v0, x->body_a, x->body_b);
    return cn / un * un_dot + crm_restitution_jvp(w, s, x, line->by) * un;
}

static carom_status bounce_jvp(crm_forward *f, crm_substep *s, int n)
{
    const crm_solve *c = &s->solve[1];
    crm_begin_solve(f, s, c);
    for (int i = 0; i < n; i++) {
        crm_line *line = &f->lines[i];
        crm_rows_jvp(f, s, c, line);
        crm_free_velocity_jvp(f, s, c, line, line->v0);
        crm_drive_jvp(f, s, c, line);
        for (int k = 0; k < s->n_contacts; k++) f->dot.cn[k] = bounce_side_jvp(f, s, k, line);
        const carom_status e = crm_solve_jvp(f, line->v);
        if (e < 0) return e;
    }
    return CAROM_OK;
}

carom_status crm_smooth_jvp(crm_forward *f, crm_substep *s, int n)
{
    carom_status e = stage_1_jvp(f, s, n);
    for (int k = 2; e >= 0 && k < s->n_solves; k++) e = crm_correction_jvp(f, s, &s->solve[k], n);
    if (e < 0) return e;
    return s->solve[1].kind == CRM_BOUNCE ? bounce_jvp(f, s, n) : stage_2_jvp(f, s, n);
}
