/* smooth.c: the two-stage map backward.  Stage 1 ends at the fixed point v = G(v) of a
 * Newton iteration with fixed rows.  Its adjoint is that of one iteration with the cotangent
 * l + G'l + G'G'l + ..., a sum that converges as the iteration did; G' needs a transposed solve and
 * the rows at the end of the sub-step.  Where that is slow or diverges, the sum m = l + G'm is
 * found by Anderson's method, for a linear map as good as GMRES over the last iterates. */
#include "grad/internal.h"

#include <math.h>

/* Further passes need fewer digits, of which so many are spare [1]. */
static const double SPARE = 1e-2;

static void add_row(double *v_bar, int body_a, int body_b, const double row[6], double scale)
{
    for (int i = 0; i < 3; i++) {
        v_bar[3 * body_a + i] += scale * row[i];
        v_bar[3 * body_b + i] += scale * row[3 + i];
    }
}

static void add_outer(double row_bar[6], int body_a, int body_b, const double *v, double scale)
{
    for (int i = 0; i < 3; i++) {
        row_bar[i] += scale * v[3 * body_a + i];
        row_bar[3 + i] += scale * v[3 * body_b + i];
    }
}

/* Of a contact at gap 0 the slip's row is that of J_t; from this gap on they differ [L]. */
static const double CLOSED = 1e-14;

/* d slip / dq1 of contact x at q, whose row of J_t is jt. */
static void slip_row(const carom_world *w, const crm_contact *x, const double *q, const double *jt,
                     double *row)
{
    if (fabs(x->gap) > CLOSED * w->length) {
        crm_slip_row(w, x, q, row);
    } else {
        memcpy(row, jt, 6 * sizeof *row);
    }
}

/* gap(p) and slip(q0, p) at the end of stage 1, by the poses and what shapes are made of. */
static void end_of_contact_vjp(crm_reverse *r, const crm_substep *s, int k, double gap_bar,
                               double slip_bar, double *q0_bar)
{
    const crm_contact *x = &s->contacts[k];
    const carom_contact_bar bar = {{0, 0}, {0, 0}, {0, 0}, gap_bar};
    crm_geometry_vjp(r, r->pose, x, &bar, r->pose_bar);
    if (slip_bar != 0) crm_slip_vjp(r, x, s->q0, r->pose, slip_bar, q0_bar, r->pose_bar);
}

/* The same by the poses alone: rows at both ends. */
static void end_of_rows_vjp(crm_reverse *r, const crm_substep *s, int k, double gap_bar,
                            double slip_bar, double *q0_bar)
{
    const crm_rows *rows = &r->world->rows;
    const crm_contact *x = &s->contacts[k];
    double row[6];
    for (int i = 0; i < 6; i++) {
        row[i] = gap_bar * (rows->jn[6 * k + i] + r->turn.n[6 * k + i]) +
                 slip_bar * (rows->jt[6 * k + i] + r->turn.t[6 * k + i]);
    }
    add_row(r->pose_bar, x->body_a, x->body_b, row, 1);
    if (slip_bar == 0) return;
    slip_row(r->world, x, s->q0, &rows->jt[6 * k], row);
    add_row(q0_bar, x->body_a, x->body_b, row, -slip_bar);
}

/* c_n = (gap(p) - target) / h - J_n v, c_t = slip(q0, p) / h - J_t v of one contact, at the fixed
 * point, which ends at p = q0 + h v and where rows that hold miss nothing: gap(p) = target and slip
 * = 0, so that 1 / h has no part.  Adds to rows, r->pose_bar, q0_bar, h_bar, gap_bar. */
static void contact_side_vjp(crm_reverse *r, const crm_substep *s, int k, double *q0_bar,
                             double *h_bar)
{
    const carom_world *w = r->world;
    const double *v = s->solve[0].v;
    const double h = s->h;
    const double cn_bar = r->bars.cn[k];
    const double ct_bar = w->rows.mu[k] > 0 ? r->bars.ct[k] : 0;
    crm_contact x = s->contacts[k];
    if (cn_bar == 0 && ct_bar == 0) return;
    add_outer(&r->bars.jn[6 * k], x.body_a, x.body_b, v, -cn_bar);
    add_outer(&r->bars.jt[6 * k], x.body_a, x.body_b, v, -ct_bar);
    if (x.limit || r->wants_shapes) {
        end_of_contact_vjp(r, s, k, cn_bar / h, ct_bar / h, q0_bar);
    } else {
        end_of_rows_vjp(r, s, k, cn_bar / h, ct_bar / h, q0_bar);
    }
    if (s->target[k] != 0) {
        r->gap_bar[k] -= cn_bar / h;
        *h_bar -= cn_bar * w->recovery / h;
    }
}

/* c_e = (error(p) - target) / h - J_e v of one joint, whose first row in the island is `first`;
 * target = error(q0) -+ recovery h, or 0. */
static void joint_side_vjp(crm_reverse *r, const crm_substep *s, int joint, int first,
                           double *q0_bar, double *h_bar)
{
    const carom_world *w = r->world;
    const crm_joint *j = &w->joints[joint];
    const double *v = s->solve[0].v;
    const double h = s->h;
    double error_bar[CRM_MAX_JOINT_ROWS];
    double start_bar[CRM_MAX_JOINT_ROWS];
    int targets = 0;
    for (int i = 0; i < j->n_held; i++) {
        const int row = first + i;
        const double ce_bar = r->bars.ce[row];
        add_outer(&r->bars.je[6 * row], j->body_a, j->body_b, v, -ce_bar);
        const double target = s->joint_target[row];
        error_bar[i] = ce_bar / h;
        start_bar[i] = target != 0 ? -ce_bar / h : 0;
        targets |= target != 0;
        if (target != 0) *h_bar += ce_bar * copysign(w->recovery, target) / h;
        if (r->wants_joints) continue;
        add_row(r->pose_bar, j->body_a, j->body_b, &w->rows.je[6 * row], error_bar[i]);
        add_row(r->pose_bar, j->body_a, j->body_b, &r->turn.e[6 * row], error_bar[i]);
    }
    if (r->wants_joints) {
        crm_joint_vjp(r, r->pose, joint, NULL, error_bar, r->pose_bar);
    }
    if (targets) crm_joint_vjp(r, s->q0, joint, NULL, start_bar, q0_bar);
    if (j->n_rows > j->n_held) {
        crm_motor_side_vjp(r, s, joint, first + j->n_held, q0_bar, h_bar);
    }
}

void crm_turn_end(const carom_world *w, const crm_substep *s, const double *p, crm_turn *turn)
{
    const crm_rows *rows = &w->rows;
    for (int k = 0; k < s->n_contacts; k++) {
        memcpy(&turn->n[6 * k], &rows->jn[6 * k], 6 * sizeof(double));
        if (!(rows->mu[k] > 0)) continue;
        slip_row(w, &s->moved[k], p, &rows->jt[6 * k], &turn->t[6 * k]);
    }
    int row = 0;
    for (int k = 0; k < w->island->n_joints; k++) {
        const crm_joint *j = &w->joints[w->island->joints[k]];
        double *e = &turn->e[6 * row];
        memcpy(e, &rows->je[6 * row], 6 * (size_t)j->n_rows * sizeof *e);
        row += j->n_rows;
        if (j->n_rows == j->n_held) continue;
        const int holds = s->solve[0].motor[row - 1] == CRM_MOTOR_HOLDS;
        e += 6 * j->n_held;
        if (holds) crm_measure_at(j, crm_motor_measure(j->kind), p, e);
        if (!holds) memset(e, 0, 6 * sizeof *e);
    }
}

void crm_turn_start(const carom_world *w, const crm_substep *s, crm_turn *turn)
{
    const crm_rows *rows = &w->rows;
    for (int k = 0; k < s->n_contacts; k++) {
        const int rough = rows->mu[k] > 0;
        for (int i = 6 * k; i < 6 * k + 6; i++) {
            turn->n[i] -= rows->jn[i];
            turn->t[i] = rough ? turn->t[i] - rows->jt[i] : 0;
        }
    }
    for (int i = 0; i < 6 * w->island->n_rows; i++) turn->e[i] -= rows->je[i];
}

/* Right-hand sides at the fixed point, from r->bars. */
static void sides_vjp(crm_reverse *r, const crm_substep *s, double *q0_bar, double *h_bar)
{
    const carom_world *w = r->world;
    memset(r->pose_bar, 0, 3 * (size_t)w->n_bodies * sizeof(double));
    for (int k = 0; k < s->n_contacts; k++) {
        r->gap_bar[k] = 0;
        contact_side_vjp(r, s, k, q0_bar, h_bar);
    }
    int row = 0;
    for (int k = 0; k < w->island->n_joints; k++) {
        const int joint = w->island->joints[k];
        joint_side_vjp(r, s, joint, row, q0_bar, h_bar);
        row += w->joints[joint].n_rows;
    }
    for (int k = 0; k < 3 * w->n_bodies; k++) {
        *h_bar += r->pose_bar[k] * s->solve[0].v[k];
        q0_bar[k] += r->pose_bar[k];
    }
}

/* One pass: the cotangent x of the velocity of an iteration, through the next right-hand sides to
 * that of the velocity before it, to.  tol: as in crm_sides_vjp. */
static carom_status pass_vjp(crm_reverse *r, const crm_substep *s, const double *x, double *to,
                             double tol)
{
    const carom_world *w = r->world;
    const carom_status e = crm_sides_vjp(r, x, tol);
    if (e < 0) return e;
    crm_zero(w, to);
    for (int k = 0; k < s->n_contacts; k++) {
        const crm_contact *c = &s->contacts[k];
        add_row(to, c->body_a, c->body_b, &r->turn.n[6 * k], r->bars.cn[k]);
        add_row(to, c->body_a, c->body_b, &r->turn.t[6 * k], r->bars.ct[k]);
    }
    int row = 0;
    for (int k = 0; k < w->island->n_joints; k++) {
        const crm_joint *j = &w->joints[w->island->joints[k]];
        for (int i = 0; i < j->n_rows; i++, row++) {
            add_row(to, j->body_a, j->body_b, &r->turn.e[6 * row], r->bars.ce[row]);
        }
    }
    return CAROM_OK;
}

static void add_to_total(crm_reverse *r)
{
    for (size_t i = 0; i < r->n_sides; i++) r->total.u[i] += r->bars.u[i];
}

double crm_largest(const carom_world *w, const double *x)
{
    double top = 0;
    for (int i = 0; i < w->island->n_bodies; i++) {
        const double *y = x + 3 * w->island->bodies[i];
        top = fmax(top, fmax(fabs(y[0]), fmax(fabs(y[1]), fabs(y[2]))));
    }
    return top;
}

/* r->rest = m with m = v_bar + S'm, S what a change of the velocity that forces see gives to v1. */
static carom_status close_seen(crm_reverse *r, crm_substep *s, const double *v_bar)
{
    carom_world *w = r->world;
    crm_anderson *a = &w->anderson;
    const crm_solve *c = &s->solve[1];
    const int n = 3 * w->island->n_bodies;
    const double first = crm_largest(w, v_bar);
    double error = HUGE_VAL;
    crm_pose_solve(r, s, c);
    carom_status e = crm_anderson_start(&w->memory, a, n);
    if (e < 0) return e;
    crm_gather(w, v_bar, a->point);
    for (int k = 0; k < CRM_MAX_PASSES && error > CRM_PASS_TOL * first; k++) {
        crm_scatter(w, a->point, r->rest);
        e = crm_sides_vjp(r, r->rest, 0);
        if (e < 0) return e;
        crm_zero(w, r->solve_bar);
        crm_seen_vjp(r, s, c, r->solve_bar);
        crm_gather(w, r->solve_bar, a->value);
        error = 0;
        for (int i = 0; i < n; i++) {
            a->value[i] += v_bar[3 * w->island->bodies[i / 3] + i % 3];
            error = fmax(error, fabs(a->value[i] - a->point[i]));
        }
        if (!(error < HUGE_VAL)) return CAROM_E_NO_SOLUTION;
        crm_anderson_next(a);
    }
    crm_scatter(w, a->point, r->rest);
    return error <= CRM_PASS_LOOSE * first ? CAROM_OK : CAROM_E_NO_SOLUTION;
}

/* v1 from vh at q1: leaves the cotangent of vh in r->solve_bar; q_bar gets that of the rows. */
static carom_status stage_2_vjp(crm_reverse *r, crm_substep *s, double *q_bar, const double *v_bar,
                                double *h_bar)
{
    const crm_solve *c = &s->solve[1];
    const int sees = crm_sees_speed(r->world);
    carom_status e = sees ? close_seen(r, s, v_bar) : CAROM_OK;
    if (e >= 0) e = crm_solve_vjp(r, s, c, sees ? r->rest : v_bar);
    if (e < 0) return e;
    crm_zero(r->world, r->solve_bar);
    crm_free_velocity_vjp(r, s, c, r->solve_bar, h_bar);
    crm_drive_vjp(r, s, c, r->solve_bar, q_bar, h_bar);
    crm_mass_vjp(r, s, c, h_bar);
    for (int k = 0; k < s->n_contacts; k++) {
        const int open = c->cn[k] != 0;
        r->gap_bar[k] = open ? r->bars.cn[k] / s->h : 0;
        if (open) *h_bar -= r->bars.cn[k] * c->cn[k] / s->h;
    }
    crm_rows_vjp(r, s, c, r->gap_bar, NULL, q_bar);
    return CAROM_OK;
}

/* c_n of a bounce: e J_n v0 where it is negative, gap / h where it is positive. */
static void bounce_side_vjp(crm_reverse *r, const crm_substep *s, int k, double *v0_bar,
                            double *h_bar)
{
    const carom_world *w = r->world;
    const crm_contact *x = &s->moved[k];
    const double cn = s->solve[1].cn[k];
    const double cn_bar = r->bars.cn[k];
    const int open = x->gap > w->settings.margin * w->length;
    r->gap_bar[k] = open ? cn_bar / s->h : 0;
    if (open) *h_bar -= cn_bar * cn / s->h;
    if (cn >= 0) return;
    const double *jn = &w->rows.jn[6 * k];
    const double un = crm_row_dot(jn, s->v0, x->body_a, x->body_b);
    add_row(v0_bar, x->body_a, x->body_b, jn, cn_bar * cn / un);
    add_outer(&r->bars.jn[6 * k], x->body_a, x->body_b, s->v0, cn_bar * cn / un);
    crm_restitution_vjp(r, s, x, cn_bar * un);
}

/* v1 from v0 at q1; stage 1 then only counts for the pose. */
static carom_status bounce_vjp(crm_reverse *r, crm_substep *s, double *q_bar, double *v_bar,
                               double *h_bar)
{
    const crm_solve *c = &s->solve[1];
    const carom_status e = crm_solve_vjp(r, s, c, v_bar);
    if (e < 0) return e;
    crm_zero(r->world, r->solve_bar);
    crm_zero(r->world, v_bar);
    crm_free_velocity_vjp(r, s, c, v_bar, h_bar);
    crm_drive_vjp(r, s, c, v_bar, q_bar, h_bar);
    crm_mass_vjp(r, s, c, h_bar);
    for (int k = 0; k < s->n_contacts; k++) bounce_side_vjp(r, s, k, v_bar, h_bar);
    crm_rows_vjp(r, s, c, r->gap_bar, NULL, q_bar);
    return CAROM_OK;
}

/* r->solve_bar = l becomes the solution of m = l + G'm, known to within tol. */
static carom_status sum_passes(crm_reverse *r, const crm_substep *s, double tol, double loose)
{
    carom_world *w = r->world;
    crm_anderson *a = &w->anderson;
    const int n = 3 * w->island->n_bodies;
    double error = HUGE_VAL;
    carom_status e = crm_anderson_start(&w->memory, a, n);
    if (e < 0) return e;
    crm_copy(w, r->rest, r->solve_bar);
    crm_gather(w, r->rest, a->point);
    for (int k = 0; k < CRM_MAX_PASSES && error > tol; k++) {
        crm_scatter(w, a->point, r->solve_bar);
        e = pass_vjp(r, s, r->solve_bar, r->solve_bar, CRM_PASS_TOL);
        if (e < 0) return e;
        crm_gather(w, r->solve_bar, a->value);
        error = 0;
        for (int i = 0; i < n; i++) {
            a->value[i] += r->rest[3 * w->island->bodies[i / 3] + i % 3];
            error = fmax(error, fabs(a->value[i] - a->point[i]));
        }
        if (!(error < HUGE_VAL)) return CAROM_E_NO_SOLUTION;
        crm_anderson_next(a);
    }
    crm_scatter(w, a->point, r->solve_bar);
    return error <= loose ? CAROM_OK : CAROM_E_NO_SOLUTION;
}

/* The same of joints alone, at once: at the fixed point the rows at the end of the stage hold, and
 * impulses act along those at its start. */
static carom_status close_joints(crm_reverse *r)
{
    const size_t n = 6 * (size_t)r->world->island->n_rows;
    double *left = r->bars.je; /* nothing is there yet */
    for (size_t i = 0; i < n; i++) left[i] = r->world->rows.je[i] + r->turn.e[i];
    r->problem.je_left = left;
    const carom_status e = crm_sides_vjp(r, r->solve_bar, 0);
    r->problem.je_left = NULL;
    if (e >= 0) memcpy(r->total.u, r->bars.u, r->n_sides * sizeof(double));
    return e;
}

/* Sum of the passes from the cotangent r->solve_bar = l of the velocity: r->total. */
static carom_status close_vjp(crm_reverse *r, const crm_substep *s)
{
    const carom_world *w = r->world;
    if (!s->n_contacts && w->island->n_rows) return close_joints(r);
    const double first = crm_largest(w, r->solve_bar);
    double last = HUGE_VAL;
    memset(r->total.u, 0, r->n_sides * sizeof(double));
    for (int k = 0; k < CRM_MAX_PASSES; k++) {
        const double rest = crm_largest(w, r->solve_bar);
        if (k > 0 && rest <= CRM_PASS_TOL * first) return CAROM_OK;
        if (!(rest < HUGE_VAL)) return CAROM_E_NO_SOLUTION;
        const int slow = k > 1 && rest > CRM_SLOW * last;
        /* What is left needs fewer digits; SPARE, for masses differ. */
        const double tol = k > 0 ? CRM_PASS_TOL * (slow ? 1 : SPARE * first / rest) : 0;
        carom_status e = CAROM_OK;
        if (slow) e = sum_passes(r, s, CRM_PASS_TOL * first, CRM_PASS_LOOSE * fmax(first, rest));
        if (e >= 0) e = pass_vjp(r, s, r->solve_bar, r->solve_bar, tol);
        if (e >= 0) add_to_total(r);
        if (e < 0 || slow) return e;
        last = rest;
    }
    return crm_largest(w, r->solve_bar) <= CRM_PASS_LOOSE * first ? CAROM_OK : CAROM_E_NO_SOLUTION;
}

/* Stage 1 backward from the cotangent r->solve_bar of its velocity. */
static carom_status stage_1_vjp(crm_reverse *r, crm_substep *s, double *q_bar, double *v_bar,
                                double *h_bar)
{
    const crm_solve *c = &s->solve[0];
    /* The rows in place are those at the end of stage 1, of what the sub-step did next. */
    crm_copy(r->world, r->pose, s->q0);
    crm_move(r->world, r->pose, c->v, s->h);
    crm_turn_end(r->world, s, r->pose, &r->turn);
    crm_pose_solve(r, s, c);
    crm_turn_start(r->world, s, &r->turn);
    carom_status e = close_vjp(r, s);
    if (e < 0) return e;
    memcpy(r->bars.u, r->total.u, r->n_sides * sizeof(double));
    e = crm_rest_vjp(r);
    if (e < 0) return e;
    crm_free_velocity_vjp(r, s, c, v_bar, h_bar);
    crm_drive_vjp(r, s, c, v_bar, q_bar, h_bar);
    crm_mass_vjp(r, s, c, h_bar);
    sides_vjp(r, s, q_bar, h_bar);
    crm_rows_vjp(r, s, c, r->gap_bar, NULL, q_bar);
    return CAROM_OK;
}

carom_status crm_smooth_vjp(crm_reverse *r, crm_substep *s, double *q_bar, double *v_bar,
                            double *h_bar)
{
    *h_bar = 0;
    carom_status e;
    if (s->solve[1].kind == CRM_BOUNCE) {
        e = bounce_vjp(r, s, q_bar, v_bar, h_bar);
    } else {
        crm_zero(r->world, r->late_bar);
        e = stage_2_vjp(r, s, q_bar, v_bar, h_bar);
        crm_zero(r->world, v_bar);
    }
    for (int k = s->n_solves - 1; e >= 0 && k > 1; k--) {
        e = crm_correction_vjp(r, s, &s->solve[k], q_bar);
    }
    crm_move_vjp(r->world, s, s->solve[0].v, q_bar, r->solve_bar, h_bar);
    return e < 0 ? e : stage_1_vjp(r, s, q_bar, v_bar, h_bar);
}
