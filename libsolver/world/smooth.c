/* smooth.c: the symmetric two-stage map of second order, RATTLE with contacts.  docs/step.md. */
#include "world/internal.h"

#include <math.h>

/* Newton's method ends when no right-hand side moves a position by more than this [L]. */
static const double NEWTON_TOL = 1e-14;
/* It converges linearly, by the turn of a body per sub-step times the mass ratio of neighbors, and
 * is accelerated.  After PATIENT iterations less is asked, LOOSE [L], and said; where that is not
 * met either, where MAX_VAIN iterations were none better, or a position is thrown farther than FAR
 * [L], the sub-step is too long: there is no solution at this h. */
enum { PATIENT = 25, MAX_NEWTON = 40, MAX_VAIN = 10 };
static const double LOOSE = 1e-9;
static const double FAR = 1e2;
/* Speeds beyond this are no error of second order but another solution [what forces can give]. */
static const double GAIN = 1.5;
/* From here on it is said: the step is long for what turns in it. */
static const double GAIN_SAID = 1.1;
/* So is it where a corner that presses turns by more in a sub-step [rad]. */
static const double TURN_SAID = 1;

/* Stage 1 aims at gap 0 and joint error 0; from farther off it goes there at no more than the
 * recovery speed, not at error / h, which in a short sub-step would be a kick.  Rows at q0. */
static void set_targets(const carom_world *w, crm_substep *s)
{
    const double most = w->recovery * s->h;
    for (int k = 0; k < s->n_contacts; k++) {
        const double gap = s->contacts[k].gap;
        s->target[k] = gap < -most ? gap + most : 0;
    }
    for (int k = 0; k < w->island->n_rows; k++) {
        const double error = w->rows.error[k];
        s->joint_target[k] = error > most ? error - most : error < -most ? error + most : 0;
    }
}

double crm_newton_tolerance(const carom_world *w)
{
    return NEWTON_TOL * w->length + 0.25 * crm_rounding(w);
}

/* What makes a contact slip on in its direction: more than any slip speed. */
static double drive(const carom_world *w, const crm_substep *s, int k)
{
    return s->slips[k] ? s->slips[k] * 8 * (crm_top_speed(w, s->v0) + w->speed) : 0;
}

static void first_sides(const carom_world *w, const crm_substep *s, crm_solve *c)
{
    for (int k = 0; k < s->n_contacts; k++) {
        c->cn[k] = (s->contacts[k].gap - s->target[k]) / s->h;
        c->ct[k] = drive(w, s, k);
    }
    for (int k = 0; k < w->island->n_rows; k++) {
        c->ce[k] = (w->rows.error[k] - s->joint_target[k]) / s->h;
    }
    crm_motor_sides(w, c);
}

/* The same of a motor's row: the speed of its measure over the sub-step.  At its limit it moves
 * nothing. */
static double next_motor_side(const crm_substep *s, const crm_joint *j, int row, const crm_solve *c,
                              crm_solve *next)
{
    double je[6];
    const crm_measure m = crm_motor_measure(j->kind);
    const double before = crm_measure_at(j, m, s->q0, je);
    const double u = crm_row_dot(je, c->v, j->body_a, j->body_b);
    const double way = crm_measure_at(j, m, s->q1, je) - before;
    next->ce[row] = 0;
    if (c->motor[row] != CRM_MOTOR_HOLDS) return 0;
    next->ce[row] = way / s->h - crm_motor_speed(j) - u;
    return s->h * fabs(next->ce[row] - c->ce[row]);
}

/* Right-hand sides of joint j in the next iteration; `first` is its first row in the island. */
static double next_joint_sides(const carom_world *w, const crm_substep *s, const crm_joint *j,
                               int first, const crm_solve *c, crm_solve *next)
{
    double largest = 0;
    double je[6 * CRM_MAX_JOINT_ROWS];
    double error[CRM_MAX_JOINT_ROWS];
    crm_joint_rows(j, s->q1, je, error);
    for (int k = 0; k < j->n_held; k++) {
        const int row = first + k;
        const double u = crm_row_dot(&w->rows.je[6 * row], c->v, j->body_a, j->body_b);
        next->ce[row] = (error[k] - s->joint_target[row]) / s->h - u;
        largest = fmax(largest, s->h * fabs(next->ce[row] - c->ce[row]));
    }
    if (j->n_rows == j->n_held) return largest;
    return fmax(largest, next_motor_side(s, j, first + j->n_held, c, next));
}

/* Right-hand sides of the next iteration from the end pose of this one: the true gap, slip and
 * joint error there, less their linear part.  Returns the largest move that matters [m]. */
static double next_sides(const carom_world *w, const crm_substep *s, const crm_solve *c,
                         crm_solve *next)
{
    double largest = 0;
    for (int k = 0; k < s->n_contacts; k++) {
        crm_contact x = s->contacts[k];
        const double un = crm_row_dot(&w->rows.jn[6 * k], c->v, x.body_a, x.body_b);
        const double ut = crm_row_dot(&w->rows.jt[6 * k], c->v, x.body_a, x.body_b);
        crm_contact_refresh(w, s->q1, &x);
        const double miss = x.gap - s->target[k];
        next->cn[k] = miss / s->h - un;
        next->ct[k] = drive(w, s, k);
        if (w->rows.mu[k] > 0 && !s->slips[k])
            next->ct[k] = crm_slip(w, &x, s->q0, s->q1) / s->h - ut;
        if (c->mode[k] == CAROM_SEPARATED) {
            if (!s->keep) largest = fmax(largest, -miss);
            continue;
        }
        largest = fmax(largest, s->h * fabs(next->cn[k] - c->cn[k]));
        if (c->mode[k] == CAROM_STICK) {
            largest = fmax(largest, s->h * fabs(next->ct[k] - c->ct[k]));
        }
    }
    int row = 0;
    for (int k = 0; k < w->island->n_joints; k++) {
        const crm_joint *j = &w->joints[w->island->joints[k]];
        largest = fmax(largest, next_joint_sides(w, s, j, row, c, next));
        row += j->n_rows;
    }
    return largest;
}

void crm_end_pose(const carom_world *w, crm_substep *s, const crm_solve *c)
{
    crm_copy(w, s->q1, s->q0);
    crm_move(w, s->q1, c->v, s->h);
}

/* Lengths that the iteration works on: right-hand sides of the rows that hold, times h; 0 for the
 * others.  Rows of zeros, of motors at their limits, ask for exactly 0. */
static void pack_sides(const carom_world *w, const crm_substep *s, const crm_solve *c,
                       const crm_solve *asked, double *x)
{
    const int n = s->n_contacts;
    for (int k = 0; k < n; k++) {
        x[k] = asked->mode[k] == CAROM_SEPARATED ? 0 : s->h * c->cn[k];
        x[n + k] = asked->mode[k] == CAROM_STICK ? s->h * c->ct[k] : 0;
    }
    for (int k = 0; k < w->island->n_rows; k++) {
        x[2 * n + k] = asked->ce[k] == 0 ? 0 : s->h * c->ce[k];
    }
}

/* Right-hand sides of the next iteration: those of `from`, and of the rows that hold `x`. */
static void take_sides(const carom_world *w, const crm_substep *s, const crm_solve *from,
                       const double *x, crm_solve *to)
{
    const int n = s->n_contacts;
    for (int k = 0; k < n; k++) {
        to->cn[k] = to->mode[k] == CAROM_SEPARATED ? from->cn[k] : x[k] / s->h;
        to->ct[k] = to->mode[k] == CAROM_STICK ? x[n + k] / s->h : from->ct[k];
    }
    for (int k = 0; k < w->island->n_rows; k++) {
        to->ce[k] = from->ce[k] == 0 ? 0 : x[2 * n + k] / s->h;
    }
}

/* From the sides of c and those that its end pose asks for to those of the next iteration. */
static void next_iterate(carom_world *w, const crm_substep *s, crm_solve *c, crm_solve *asked)
{
    crm_anderson *a = &w->anderson;
    const size_t n = (size_t)s->n_contacts;
    if (n) { /* without contacts there are no arrays of modes */
        if (memcmp(asked->mode, c->mode, n) != 0) crm_anderson_forget(a);
        memcpy(asked->mode, c->mode, n);
    }
    pack_sides(w, s, c, asked, a->point);
    pack_sides(w, s, asked, asked, a->value);
    crm_anderson_next(a);
    take_sides(w, s, asked, a->point, c);
}

/* The iteration of stage 1, rows and first right-hand sides in place. */
static carom_status iterate(carom_world *w, crm_substep *s, crm_solve *c)
{
    const double tol = crm_newton_tolerance(w);
    double best = HUGE_VAL;
    int vain = 0;
    for (int k = 0; k < MAX_NEWTON && vain <= MAX_VAIN && w->effort < CRM_WORN; k++) {
        const carom_status e = crm_solve_run(w, s, c, 1);
        if (e < 0) return e;
        crm_end_pose(w, s, c);
        if (!s->n_contacts && !w->island->n_rows) return CAROM_OK;
        const double moved = next_sides(w, s, c, &s->solve[1]);
        if (moved <= tol) return CAROM_OK;
        if (k >= PATIENT && moved <= LOOSE * w->length) return CAROM_INEXACT;
        if (!(moved < FAR * w->length)) return CAROM_E_NO_SOLUTION;
        vain = moved < best ? 0 : vain + 1;
        best = fmin(best, moved);
        next_iterate(w, s, c, &s->solve[1]);
    }
    return CAROM_E_NO_SOLUTION;
}

/* Stage 1: M vh = M v0 + h/2 f + J0' l with gaps, slips and joints met at q1 = q0 + h vh. */
static carom_status stage_1(carom_world *w, crm_substep *s)
{
    const int n = 2 * s->n_contacts + w->island->n_rows;
    crm_solve *c = &s->solve[0];
    c->kind = CRM_STAGE_1;
    crm_copy(w, c->q, s->q0);
    crm_rows_at(w, s, s->q0);
    crm_solve_start(w, s, c);
    set_targets(w, s);
    if (crm_has_joints_alone(w, s) && crm_close_joints(w, s, c)) return CAROM_OK;
    first_sides(w, s, c);
    const carom_status e = crm_anderson_start(&w->memory, &w->anderson, n);
    return e < 0 ? e : iterate(w, s, c);
}

/* Whether forces on the island depend on velocities that stage 2 is to find. */
int crm_sees_speed(const carom_world *w)
{
    for (int k = 0; w->island->n_driven && k < w->island->n_joints; k++) {
        if (w->joints[w->island->joints[k]].damping > 0) return 1;
    }
    return w->n_fields > 0;
}

/* Largest speed of a point of a body between two velocities [m/s]. */
static double change_of_speed(const carom_world *w, const double *packed, const double *v)
{
    double top = 0;
    for (int i = 0; i < w->island->n_bodies; i++) {
        const int b = w->island->bodies[i];
        const double *x = packed + 3 * i;
        const double *y = v + 3 * b;
        top = fmax(top, hypot(x[1] - y[1], x[2] - y[2]) + fabs(x[0] - y[0]) * w->length);
    }
    return top;
}

static void pack_speed(const carom_world *w, const double *v, double *x)
{
    for (int i = 0; i < w->island->n_bodies; i++) {
        memcpy(&x[3 * i], &v[3 * w->island->bodies[i]], 3 * sizeof *x);
    }
}

static void take_speed(const carom_world *w, const double *x, double *v)
{
    for (int i = 0; i < w->island->n_bodies; i++) {
        memcpy(&v[3 * w->island->bodies[i]], &x[3 * i], 3 * sizeof *v);
    }
}

/* v1 = vh + h/2 W f(q1, v1) + W J1'l: forces at the velocity of one iteration give the next. */
static carom_status iterate_speed(carom_world *w, crm_substep *s, crm_solve *c)
{
    crm_anderson *a = &w->anderson;
    carom_status e = crm_anderson_start(&w->memory, a, 3 * w->island->n_bodies);
    if (e < 0) return e;
    pack_speed(w, c->v, a->point);
    for (int k = 0; k < MAX_NEWTON && w->effort < CRM_WORN; k++) {
        e = crm_solve_run(w, s, c, 1);
        if (e < 0) return e;
        const double scale = crm_top_speed(w, c->v) + w->speed;
        const double moved = change_of_speed(w, a->point, c->v);
        if (moved <= NEWTON_TOL * scale) return e;
        if (k >= PATIENT && moved <= LOOSE * scale) return CAROM_INEXACT;
        if (!(moved < HUGE_VAL)) return CAROM_E_NO_SOLUTION;
        pack_speed(w, c->v, a->value);
        crm_anderson_next(a);
        take_speed(w, a->point, c->v);
        crm_solve_velocity(w, s, c);
    }
    return CAROM_E_NO_SOLUTION;
}

/* Stage 2 at q1: M v1 = M vh + h/2 f + J1' l with the contacts still closed and the joints at rest;
 * a contact that has opened may close no faster than gap / h. */
static carom_status stage_2(carom_world *w, crm_substep *s)
{
    const double slop = w->settings.margin * w->length;
    const crm_solve *last = &s->solve[0];
    crm_solve *c = &s->solve[1];
    c->kind = CRM_STAGE_2;
    crm_copy(w, c->q, s->q1);
    crm_rows_at(w, s, s->q1);
    const int sees = crm_sees_speed(w);
    if (sees) {
        crm_copy(w, c->v, s->v0);
        crm_move(w, c->v, s->v0, -2);
        crm_move(w, c->v, last->v, 2);
    }
    crm_solve_start(w, s, c);
    for (int k = 0; k < s->n_contacts; k++) {
        c->cn[k] = s->moved[k].gap > slop ? s->moved[k].gap / s->h : 0;
        c->ct[k] = drive(w, s, k);
        c->mode[k] = last->mode[k];
    }
    for (int k = 0; k < w->island->n_rows; k++) c->ce[k] = 0;
    crm_motor_sides(w, c);
    const carom_status e = sees                         ? iterate_speed(w, s, c)
                           : crm_has_joints_alone(w, s) ? crm_solve_joints(w, s, c)
                                                        : crm_solve_run(w, s, c, 1);
    if (e < 0) return e;
    crm_copy(w, s->v1, c->v);
    return sees ? e : CAROM_OK;
}

/* Overlap and joint errors beyond the margin at q1, which events that nobody located and sub-steps
 * without a solution have left, are projected away: that costs height but gives no speed. */
static carom_status clear_errors(carom_world *w, crm_substep *s)
{
    const double slop = w->settings.margin * w->length;
    double worst = 0;
    s->n_solves = 2;
    for (int k = 0; k < s->n_contacts; k++) {
        crm_contact c = s->contacts[k];
        crm_contact_refresh(w, s->q1, &c);
        worst = fmax(worst, -c.gap);
    }
    for (int k = 0; k < w->island->n_rows; k++) {
        worst = fmax(worst, fabs(s->joint_target[k]));
    }
    if (worst <= slop) return CAROM_OK;
    if (s->n_contacts) memset(s->pressing, 0, (size_t)s->n_contacts);
    return crm_project(w, s, 2);
}

/* Fastest point of a body of the island [m/s]. */
double crm_top_speed(const carom_world *w, const double *v)
{
    double top = 0;
    for (int k = 0; k < w->island->n_bodies; k++) {
        const int b = w->island->bodies[k];
        const double *vb = v + 3 * b;
        top = fmax(top, hypot(vb[1], vb[2]) + fabs(vb[0]) * w->bodies[b].reach);
    }
    return top;
}

/* What holds at rest does no work: |v| <= |v0| + h |W f + g| in the mass metric,
 * with f also of springs and motors.  Far beyond that
 * a sub-step has turned joints so far that Newton's method found another of their poses. */
static double gain_of(const carom_world *w, const crm_substep *s, const double *v)
{
    double a[3];
    double push = 0;
    double mass = 0;
    if (w->n_fields) return 0;
    for (int k = 0; k < w->island->n_bodies; k++) {
        const int b = w->island->bodies[k];
        if (w->bodies[b].type != CAROM_DYNAMIC) return 0;
        crm_free_acceleration(w, b, NULL, a);
        push += crm_mass_square(w, b, a);
        mass += w->mass[b];
    }
    const double most = crm_mass_speed(w, s->v0) + s->h * sqrt(push) + w->recovery * sqrt(mass) +
                        crm_drive_gain(w, s);
    return most > 0 ? crm_mass_speed(w, v) / most : 0;
}

int crm_gains(const carom_world *w, const crm_substep *s)
{
    return gain_of(w, s, s->v1) > GAIN_SAID;
}

/* 1: contacts are made to slip on, perhaps far beyond their stop, which friction drives there. */
static int forced(const crm_substep *s)
{
    for (int k = 0; k < s->n_contacts; k++) {
        if (s->slips[k]) return 1;
    }
    return 0;
}

/* The shape presses with another corner than it did for most of the sub-step. */
static int turns_far(const carom_world *w, const crm_substep *s, int shape, int body)
{
    return fabs(s->q1[3 * body] - s->q0[3 * body]) > TURN_SAID && w->shapes[shape].view.count > 1;
}

static int turns_on_contact(const carom_world *w, const crm_substep *s)
{
    for (int k = 0; k < s->n_contacts; k++) {
        const crm_contact *c = &s->contacts[k];
        const int presses = s->solve[0].ln[k] > 0 || s->solve[1].ln[k] > 0;
        if (c->limit || !presses) continue;
        if (turns_far(w, s, c->shape_a, c->body_a) || turns_far(w, s, c->shape_b, c->body_b)) {
            return 1;
        }
    }
    return 0;
}

static carom_status worse(carom_status a, carom_status b)
{
    return a > b ? a : b;
}

carom_status crm_smooth(carom_world *w, double h)
{
    crm_substep *s = &w->sub;
    s->map = CRM_MAP_SMOOTH;
    s->h = h;
    s->restitution = 1;
    s->slick = 0;
    int done = 0;
    const carom_status met = stage_1(w, s);
    if (met < 0) return met;
    const carom_status cleared = clear_errors(w, s);
    if (cleared < 0) return cleared;
    carom_status e = CAROM_OK;
    if (s->ahead) e = crm_bounce(w, s, &done);
    if (e >= 0 && !done) e = stage_2(w, s);
    if (e < 0) return e;
    const double gain = done || forced(s) ? 0 : gain_of(w, s, s->v1);
    if (gain > GAIN) return CAROM_E_NO_SOLUTION;
    if (gain > GAIN_SAID || turns_on_contact(w, s)) e = worse(e, CAROM_INEXACT);
    return worse(e, worse(met, cleared));
}
