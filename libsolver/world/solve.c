/* solve.c: running one contact problem of a sub-step; first guesses. */
#include "world/internal.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>

/* How often motors may stop or start to hold in one solve. */
enum { MAX_SETTLINGS = 20 };
/* Right-hand sides of an infeasible problem are moved by this share more than they must [1], so
 * many times. */
static const double GIVE_WAY = 1e-3;
enum { MAX_WAYS = 32 };
/* Passes from a guess are enough when they lead to a residual of some rounding [1]. */
enum { MAX_PASSES = 2 };
static const double EXACT = 1e-13;

double crm_rounding(const carom_world *w)
{
    double far = 0;
    for (int k = 0; k < w->island->n_bodies; k++) {
        const int b = w->island->bodies[k];
        far = fmax(far, fmax(fabs(w->q[3 * b + 1]), fabs(w->q[3 * b + 2])));
        far = fmax(far, w->bodies[b].reach * fabs(w->q[3 * b]));
    }
    return 8 * DBL_EPSILON * far;
}

void crm_move(const carom_world *w, double *q, const double *v, double scale)
{
    for (int i = 0; i < w->island->n_bodies; i++) {
        const int b = w->island->bodies[i];
        for (int k = 3 * b; k < 3 * b + 3; k++) q[k] += scale * v[k];
    }
}

static void add_stats(carom_world *w, const carom_contact_stats *c)
{
    carom_step_stats *s = w->stats;
    if (c->status > s->status) s->status = c->status;
    s->residual = fmax(s->residual, c->residual);
    s->iterations += c->iterations;
    if (c->stage > s->stage) s->stage = c->stage;
}

static void take_velocities(const carom_world *w, const double *v, double *to)
{
    for (int i = 0; i < w->island->n_bodies; i++) {
        const int b = w->island->bodies[i];
        for (int k = 0; k < 3; k++) to[3 * b + k] = v[3 * i + k];
    }
}

/* A stage whose modes are given. */
static carom_status run_kept(carom_world *w, crm_substep *s, crm_solve *c)
{
    const carom_contact_problem p = crm_problem(w, s, c);
    carom_contact_solution x = {w->rows.v, c->ln, c->lt, c->le, c->mode};
    memcpy(c->mode, s->keep, (size_t)s->n_contacts);
    const carom_status e = carom_contact_modes(w->solver, &p, &x);
    w->effort++;
    w->stats->factorizations++;
    if (e < 0) return e;
    s->degenerate = 0;
    take_velocities(w, w->rows.v, c->v);
    return e;
}

static carom_status run_once(carom_world *w, crm_substep *s, crm_solve *c, int use_guess)
{
    if (!s->n_contacts && !w->island->n_rows) {
        s->degenerate = 0;
        take_velocities(w, w->rows.u, c->v);
        return CAROM_OK;
    }
    if (s->keep && (c->kind == CRM_STAGE_1 || c->kind == CRM_STAGE_2)) return run_kept(w, s, c);
    carom_contact_stats stats = {0};
    const carom_contact_problem p = crm_problem(w, s, c);
    carom_contact_solution x = {w->rows.v, c->ln, c->lt, c->le, c->mode};
    const int guess = !use_guess                  ? CAROM_GUESS_NONE
                      : c->kind == CRM_CORRECTION ? CAROM_GUESS_MODES
                                                  : CAROM_GUESS_IMPULSES;
    const int pressed = s->slick && c->kind != CRM_CORRECTION;
    const int brief = w->effort >= CRM_BRIEF && !pressed ? CAROM_GUESS_BRIEF : 0;
    const carom_status e = carom_contact_solve(crm_solver(w), &p, guess | brief, &x, &stats);
    w->effort += stats.factorizations;
    w->stats->factorizations += stats.factorizations;
    if (e < 0) return e;
    add_stats(w, &stats);
    if (c->kind != CRM_CORRECTION) s->degenerate = stats.degenerate;
    take_velocities(w, w->rows.v, c->v);
    return e;
}

/* Impulses of motors at their limits, in place of those of their rows. */
static void take_motors(const carom_world *w, const crm_substep *s, crm_solve *c)
{
    int row = 0;
    for (int k = 0; k < w->island->n_joints; k++) {
        const crm_joint *j = &w->joints[w->island->joints[k]];
        row += j->n_rows;
        if (j->n_rows > j->n_held && c->motor[row - 1] != CRM_MOTOR_HOLDS) {
            c->le[row - 1] = crm_motor_impulse(s, c, j, row - 1);
        }
    }
}

carom_status crm_solve_run(carom_world *w, crm_substep *s, crm_solve *c, int use_guess)
{
    carom_status e = run_once(w, s, c, use_guess);
    if (!w->island->n_driven || !(crm_share(c) > 0)) return e;
    if ((e == CAROM_E_INFEASIBLE || e == CAROM_E_NO_SOLUTION) && crm_motors_stall(w, s, c)) {
        crm_solve_velocity(w, s, c);
        e = run_once(w, s, c, 0);
        if (e >= 0) take_motors(w, s, c);
        return e;
    }
    for (int k = 0; e >= 0 && crm_motors_settle(w, s, c); k++) {
        if (k == MAX_SETTLINGS) return CAROM_E_NO_SOLUTION;
        crm_solve_velocity(w, s, c);
        e = run_once(w, s, c, 1);
    }
    if (e >= 0) take_motors(w, s, c);
    return e;
}

void crm_guess_velocity(carom_world *w, const crm_substep *s, crm_solve *c)
{
    const carom_contact_problem p = crm_problem(w, s, c);
    double *v = w->rows.v;
    memset(v, 0, 3 * (size_t)p.n_bodies * sizeof *v);
    for (int r = 0; r < p.n_joint_rows; r++) {
        for (int i = 0; i < 6; i++) {
            const int body = p.joint_body[2 * r + i / 3];
            if (body >= 0) v[3 * body + i % 3] += p.je[6 * r + i] * c->le[r];
        }
    }
    for (int i = 0; i < 3 * p.n_bodies; i++) v[i] = p.u[i] + p.inv_mass[i] * v[i];
    take_velocities(w, v, c->v);
}

carom_status crm_passes_begin(carom_world *w, crm_substep *s, crm_solve *c, const double *left)
{
    carom_contact_problem p = crm_problem(w, s, c);
    carom_contact_solution x = {w->rows.v, c->ln, c->lt, c->le, c->mode};
    p.je_left = left;
    s->degenerate = 0;
    const carom_status e = carom_contact_start(crm_solver(w), &p, &x);
    if (e >= 0) take_velocities(w, w->rows.v, c->v);
    return e;
}

carom_status crm_pass(carom_world *w, const crm_substep *s, crm_solve *c, const double *left)
{
    carom_contact_problem p = crm_problem(w, s, c);
    carom_contact_solution x = {w->rows.v, c->ln, c->lt, c->le, c->mode};
    carom_contact_stats stats = {0};
    p.je_left = left;
    const carom_status e = carom_contact_pass(crm_solver(w), &p, &x, &stats);
    w->effort += stats.factorizations;
    w->stats->factorizations += stats.factorizations;
    take_velocities(w, w->rows.v, c->v);
    return e;
}

int crm_passes_hold(carom_world *w, const crm_substep *s, crm_solve *c, double most)
{
    const carom_contact_problem p = crm_problem(w, s, c);
    const carom_contact_solution x = {w->rows.v, c->ln, c->lt, c->le, c->mode};
    const double r = carom_contact_measure(crm_solver(w), &p, &x);
    if (!(r <= most)) return 0;
    w->stats->residual = fmax(w->stats->residual, r);
    return 1;
}

carom_status crm_solve_joints(carom_world *w, crm_substep *s, crm_solve *c)
{
    carom_status e = crm_passes_begin(w, s, c, NULL);
    for (int k = 0; e >= 0 && k < MAX_PASSES; k++) e = crm_pass(w, s, c, NULL);
    if (e < 0 || crm_passes_hold(w, s, c, EXACT)) return e;
    return crm_solve_run(w, s, c, 1);
}

static int unsolved(carom_status e)
{
    return e == CAROM_E_INFEASIBLE || e == CAROM_E_NO_SOLUTION;
}

/* J u + c of one row, u in the order of the island. */
static double row_value(const double row[6], const int body[2], const double *u, double c)
{
    for (int side = 0; side < 2; side++) {
        if (body[side] < 0) continue;
        for (int i = 0; i < 3; i++) c += row[3 * side + i] * u[3 * body[side] + i];
    }
    return c;
}

/* The last solve was infeasible by y: moves its right-hand sides by the least that y allows; 0
 * where no contact is to blame. */
static int give_way(carom_world *w, const crm_substep *s, crm_solve *c)
{
    const crm_rows *r = &w->rows;
    const carom_contact_problem p = crm_problem(w, s, c);
    if (carom_contact_certificate(crm_solver(w), r->yn, r->ye)) return 0;
    double square = 0;
    double value = 0;
    double pressed = 0;
    for (int k = 0; k < p.n_contacts; k++) {
        pressed += r->yn[k];
        square += r->yn[k] * r->yn[k];
        value += r->yn[k] * row_value(&p.jn[6 * k], &p.contact_body[2 * k], p.u, c->cn[k]);
    }
    for (int k = 0; k < p.n_joint_rows; k++) {
        square += r->ye[k] * r->ye[k];
        value += r->ye[k] * row_value(&p.je[6 * k], &p.joint_body[2 * k], p.u, c->ce[k]);
    }
    if (!(value < 0 && pressed > 0)) return 0;
    const double by = -(1 + GIVE_WAY) * value / square;
    for (int k = 0; k < p.n_contacts; k++) c->cn[k] += by * r->yn[k];
    for (int k = 0; k < p.n_joint_rows; k++) c->ce[k] += by * r->ye[k];
    return 1;
}

carom_status crm_solve_bounce(carom_world *w, crm_substep *s, crm_solve *c, int plastic)
{
    s->restitution = !plastic;
    s->slick = 0;
    const int bounces = crm_velocity_targets(w, s, c);
    carom_status e = crm_solve_run(w, s, c, 1);
    if (e >= 0 && bounces) e = crm_bound_bounce(w, s, c, crm_velocity_targets, e);
    if (!unsolved(e)) return e;
    s->restitution = 0;
    crm_velocity_targets(w, s, c);
    e = crm_solve_run(w, s, c, 0);
    if (unsolved(e)) {
        s->slick = 1;
        e = crm_solve_run(w, s, c, 0);
    }
    for (int k = 0; k < MAX_WAYS && e == CAROM_E_INFEASIBLE && give_way(w, s, c); k++) {
        e = crm_solve_run(w, s, c, 0);
    }
    if (e >= 0 && w->stats->status < CAROM_RELAXED) w->stats->status = CAROM_RELAXED;
    return e;
}

static int before(const crm_touch *t, const crm_contact *c)
{
    const crm_contact *x = &t->contact;
    return x->shape_a < c->shape_a || (x->shape_a == c->shape_a && x->shape_b < c->shape_b);
}

/* The first of t[n] whose pair is not before that of c. */
static int find_pair(int n, const crm_touch *t, const crm_contact *c)
{
    int low = 0;
    for (int high = n; low < high;) {
        const int middle = (low + high) / 2;
        if (before(&t[middle], c)) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return low;
}

const crm_touch *crm_touches_of(const carom_world *w, carom_pair pair, int *n)
{
    crm_contact c = {0};
    c.shape_a = pair.a;
    c.shape_b = pair.b;
    const crm_touches *t = &w->touches;
    const int first = find_pair(t->n, t->list, &c);
    int end = first;
    while (end < t->n && t->list[end].contact.shape_a == pair.a &&
           t->list[end].contact.shape_b == pair.b) {
        end++;
    }
    *n = end - first;
    return t->n ? t->list + first : NULL;
}

/* What is known of contact c: its touch, or NULL. */
static const crm_touch *recall(const carom_world *w, const crm_contact *c)
{
    const int again = w->n_substeps > 0;
    const int n = again ? w->next.n - w->first_touch : w->touches.n;
    if (!n) return NULL;
    const crm_touch *t = again ? w->next.list + w->first_touch : w->touches.list;
    for (int i = find_pair(n, t, c);
         i < n && t[i].contact.shape_a == c->shape_a && t[i].contact.shape_b == c->shape_b; i++) {
        if (crm_recipe_same(t[i].contact.recipe, c->recipe)) return &t[i];
    }
    return NULL;
}

void crm_guess_load(carom_world *w, double h)
{
    static const crm_touch none = {0};
    crm_substep *s = &w->sub;
    for (int k = 0; k < s->n_contacts; k++) {
        const crm_contact *c = &s->contacts[k];
        const crm_touch *known = recall(w, c);
        const crm_touch *t = known ? known : &none;
        const int fresh = c->speculative ? CAROM_SEPARATED : CAROM_STICK;
        s->solve[0].mode[k] = (unsigned char)(known ? known->mode : fresh);
        for (int i = 0; i < 2; i++) {
            s->solve[i].ln[k] = h * t->force_n[i];
            s->solve[i].lt[k] = h * t->force_t[i];
        }
    }
    int row = 0;
    for (int k = 0; k < w->island->n_joints; k++) {
        const crm_joint *j = &w->joints[w->island->joints[k]];
        for (int r = j->first_row; r < j->first_row + j->n_rows; r++, row++) {
            for (int i = 0; i < 2; i++) s->solve[i].le[row] = h * w->joint_force[i][r];
        }
    }
}

void crm_guess_copy(const carom_world *w, const crm_substep *from, crm_substep *to, double factor)
{
    for (int i = 0; i < 2; i++) {
        for (int k = 0; k < to->n_contacts; k++) {
            to->solve[i].mode[k] = from->solve[i].mode[k];
            to->solve[i].ln[k] = factor * from->solve[i].ln[k];
            to->solve[i].lt[k] = factor * from->solve[i].lt[k];
        }
        for (int k = 0; k < w->island->n_rows; k++) {
            to->solve[i].le[k] = factor * from->solve[i].le[k];
        }
    }
}

/* Impulses per time of solve i of sub; an impact has none. */
static double per_time(const crm_substep *s, int i)
{
    const crm_solve_kind kind = s->solve[i].kind;
    return s->h > 0 && i < s->n_solves && kind != CRM_CORRECTION ? 1 / s->h : 0;
}

/* Impulse over the whole sub-step: both stages give one half. */
static double whole(const crm_substep *s, double first, double second)
{
    if (s->map != CRM_MAP_SMOOTH && s->map != CRM_MAP_EXTRAPOLATED) return first;
    return s->solve[1].kind == CRM_BOUNCE ? second : first + second;
}

static crm_touch touch_of(const crm_substep *s, int k)
{
    const crm_contact *c = &s->contacts[k];
    const crm_solve *x = s->solve;
    crm_touch t = {*c, {0, 0}, 0, 0, {0, 0}, {0, 0}, x[0].mode[k], 0};
    t.point.x = s->q0[3 * c->body_a + 1] + c->arm_a.x;
    t.point.y = s->q0[3 * c->body_a + 2] + c->arm_a.y;
    t.ln = whole(s, x[0].ln[k], x[1].ln[k]);
    t.lt = whole(s, x[0].lt[k], x[1].lt[k]);
    for (int i = 0; i < 2; i++) {
        t.force_n[i] = per_time(s, i) * x[i].ln[k];
        t.force_t[i] = per_time(s, i) * x[i].lt[k];
    }
    return t;
}

static carom_status reserve(carom_world *w, crm_touches *t, int n)
{
    void *p = t->list;
    const carom_status e = crm_reserve(&w->memory, &p, &t->max, n, sizeof *t->list);
    t->list = p;
    return e;
}

carom_status crm_touches_reserve(carom_world *w, int n)
{
    return reserve(w, &w->next, n);
}

carom_status crm_touches_even(carom_world *w)
{
    return reserve(w, &w->touches, w->next.n);
}

void crm_joint_totals(carom_world *w)
{
    const crm_substep *s = &w->sub;
    const crm_solve *x = s->solve;
    int row = 0;
    if (!(s->h > 0)) return;
    for (int k = 0; k < w->island->n_joints; k++) {
        const crm_joint *j = &w->joints[w->island->joints[k]];
        for (int r = j->first_row; r < j->first_row + j->n_rows; r++, row++) {
            w->joint_total[r] = whole(s, x[0].le[row], x[1].le[row]) / s->h;
        }
    }
}

static void save_joint_forces(carom_world *w)
{
    const crm_substep *s = &w->sub;
    const crm_solve *x = s->solve;
    int row = 0;
    for (int k = 0; k < w->island->n_joints; k++) {
        const crm_joint *j = &w->joints[w->island->joints[k]];
        for (int r = j->first_row; r < j->first_row + j->n_rows; r++, row++) {
            for (int i = 0; i < 2; i++) w->joint_force[i][r] = per_time(s, i) * x[i].le[row];
        }
    }
}

carom_status crm_touches_save(carom_world *w)
{
    const crm_substep *s = &w->sub;
    crm_touches *t = &w->next;
    const carom_status e = crm_touches_reserve(w, w->first_touch + s->n_contacts);
    if (e) return e;
    t->n = w->first_touch + s->n_contacts;
    for (int k = 0; k < s->n_contacts; k++) t->list[w->first_touch + k] = touch_of(s, k);
    save_joint_forces(w);
    return CAROM_OK;
}

void crm_forget_guesses(carom_world *w)
{
    const size_t bytes = (size_t)w->n_joint_rows * sizeof(double);
    w->touches.n = 0;
    crm_sleep_forget(w);
    for (int i = 0; i < 2 && w->joint_force[i]; i++) memset(w->joint_force[i], 0, bytes);
    if (w->joint_total) memset(w->joint_total, 0, bytes);
}

/* By shape pair; contacts of one pair, all of one island, keep their order. */
static int compare_touches(const void *x, const void *y)
{
    const crm_touch *a = x;
    const crm_touch *b = y;
    if (before(a, &b->contact)) return -1;
    if (before(b, &a->contact)) return 1;
    return (a->at > b->at) - (a->at < b->at);
}

void crm_touches_turn(carom_world *w)
{
    const crm_touches last = w->touches;
    w->touches = w->next;
    w->next = last;
    w->next.n = 0;
    crm_touches *t = &w->touches;
    for (int k = 1; k < t->n; k++) {
        if (!before(&t->list[k], &t->list[k - 1].contact)) continue;
        for (int i = 0; i < t->n; i++) t->list[i].at = i;
        qsort(t->list, (size_t)t->n, sizeof *t->list, compare_touches);
        return;
    }
}

/* Free flight is exact as it is, without damping. */
static carom_status run_smooth(carom_world *w, double h)
{
    const int bound = w->sub.n_contacts > 0 || w->island->n_rows > 0 || w->damped || w->n_fields;
    return w->plan.extrapolated && bound && !w->sub.ahead ? crm_extrapolate(w, h)
                                                          : crm_smooth(w, h);
}

carom_status crm_map_run(carom_world *w, double h)
{
    crm_substep *s = &w->sub;
    carom_status e = w->smooth && s->map != CRM_MAP_EULER ? run_smooth(w, h) : crm_euler(w, h);
    const int fallen = w->smooth && s->map == CRM_MAP_EULER;
    if (fallen && e >= 0 && e < CAROM_LIMIT) e = CAROM_LIMIT;
    s->met = e;
    return e;
}
