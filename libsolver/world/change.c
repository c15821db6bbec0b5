/* change.c: the time at which a contact opens or begins to slip.  docs/step.md, section "Contacts
 * that open or begin to slip". */
#include "world/internal.h"

#include <math.h>

/* Modes at the start are those of a sub-step this short [of the whole]. */
static const double SHORT = 1.0 / 256;
/* Step of the differences along v that give the rates of the rows [of L over the top speed]: an
 * error of 1e-14 by their order, 4, and one of 1e-13 by rounding. */
static const double RATE_STEP = 1e-3;
/* Force that counts as none, and to which its root is found [of those that act].  Where it is zero
 * the acceleration does not jump, so an error d of the time moves the end by d^3, but a gradient,
 * which leaves out its derivative, by d. */
static const double FORCE_TOL = 1e-9;
static const double FORCE_ROOT = 1e-12;
/* Changes that are looked for before the earliest is believed; contacts beyond which they are too
 * many to be told apart. */
enum { MAX_CHANGES = 6, MAX_CONTACTS = 32 };

/* What ends: the pressing of contact k, or its sticking on the side where l_t = sign mu l_n. */
typedef struct change {
    int k;
    int sign; /* 0: it opens */
} change;

/* The solve whose arrays hold the accelerations; no sub-step has so many. */
static crm_solve *scratch(crm_substep *s)
{
    return &s->solve[CRM_MAX_SOLVES - 1];
}

/* Number n of the list of margins at the start, three per contact at most: in arrays of the solve
 * before the scratch. */
static double *start_margin(crm_substep *s, int n)
{
    crm_solve *c = &s->solve[CRM_MAX_SOLVES - 2];
    double *const lists[3] = {c->cn, c->ct, c->ln};
    return &lists[n / s->n_contacts][n % s->n_contacts];
}

/* d(J v)/dt at constant v of all rows, by central differences over q +- tau v and q +- 2 tau v,
 * into cn, ct, ce. */
static void rates(carom_world *w, crm_substep *s, const double *q, const double *v, crm_solve *c)
{
    const double tau = RATE_STEP * w->length / (crm_top_speed(w, v) + w->speed + 1e-300);
    static const double weights[4] = {1.0 / 12, -8.0 / 12, 8.0 / 12, -1.0 / 12};
    static const double at[4] = {-2, -1, 1, 2};
    for (int i = 0; i < 4; i++) {
        const double scale = weights[i] / tau;
        crm_copy(w, w->probe, q);
        crm_move(w, w->probe, v, at[i] * tau);
        for (int k = 0; k < s->n_contacts; k++) {
            double jn[6];
            double jt[6];
            crm_contact x = s->contacts[k];
            crm_contact_refresh(w, w->probe, &x);
            crm_contact_rows(&x, jn, jt);
            if (i == 0) c->cn[k] = c->ct[k] = 0;
            c->cn[k] += scale * crm_row_dot(jn, v, x.body_a, x.body_b);
            c->ct[k] += scale * crm_row_dot(jt, v, x.body_a, x.body_b);
        }
        int row = 0;
        for (int k = 0; k < w->island->n_joints; k++) {
            double je[6 * CRM_MAX_JOINT_ROWS];
            double error[CRM_MAX_JOINT_ROWS];
            const crm_joint *j = &w->joints[w->island->joints[k]];
            crm_joint_rows(j, w->probe, je, error);
            for (int m = 0; m < j->n_rows; m++, row++) {
                if (i == 0) c->ce[row] = 0;
                c->ce[row] += scale * crm_row_dot(&je[6 * m], v, j->body_a, j->body_b);
            }
        }
    }
}

/* Forces of springs at (q, v) to the accelerations in rows.u: impulses of a unit time. */
static void springs(carom_world *w, const crm_substep *s, double *v, const crm_solve *c)
{
    crm_substep unit = *s;
    if (!w->island->n_driven) return;
    unit.h = 1;
    unit.v0 = v;
    crm_springs(w, &unit, c);
}

/* Forces at (q, v) with the modes in scratch: M a = f + J'l, J a + dJ/dt v = 0. */
static carom_status forces(carom_world *w, const double *q, double *v)
{
    crm_substep *s = &w->sub;
    crm_solve *c = scratch(s);
    c->kind = CRM_VELOCITY;
    crm_copy(w, c->q, q);
    crm_rows_at(w, s, q);
    rates(w, s, q, v, c);
    for (int i = 0; i < w->island->n_bodies; i++) {
        const int b = w->island->bodies[i];
        crm_free_acceleration(w, b, v + 3 * b, &w->rows.u[3 * i]);
    }
    springs(w, s, v, c);
    const carom_contact_problem p = crm_problem(w, s, c);
    carom_contact_solution x = {w->rows.v, c->ln, c->lt, c->le, c->mode};
    w->stats->factorizations++;
    return carom_contact_modes(crm_solver(w), &p, &x);
}

/* Of the forces in scratch: what is left until the change. */
static double margin(const carom_world *w, const change *x)
{
    const crm_solve *c = &w->sub.solve[CRM_MAX_SOLVES - 1];
    if (!x->sign) return c->ln[x->k];
    return w->rows.mu[x->k] * c->ln[x->k] - x->sign * c->lt[x->k];
}

typedef struct search {
    carom_world *w; /* not the constant one: forces need its rows */
    change x;
} search;

static double margin_left(const carom_world *w, const void *what, double h)
{
    const search *f = what;
    (void)h;
    return forces(f->w, w->sub.q1, w->sub.v1) < 0 ? 0 : margin(w, &f->x);
}

/* Modes that the forces are found with: those of a stage. */
static void take_modes(crm_substep *s, const crm_solve *stage)
{
    for (int k = 0; k < s->n_contacts; k++) scratch(s)->mode[k] = stage->mode[k];
}

/* A force below this is none: of weights, other free forces, and what bends the ways over L. */
static double least_force(const carom_world *w, const double *v)
{
    const double top = crm_top_speed(w, v);
    double largest = 0;
    for (int i = 0; i < w->island->n_bodies; i++) {
        const int b = w->island->bodies[i];
        double a[3];
        if (w->bodies[b].type != CAROM_DYNAMIC) continue;
        crm_free_acceleration(w, b, v + 3 * b, a);
        largest = fmax(largest, w->mass[b] * (hypot(a[1], a[2]) + top * top / w->length));
    }
    return FORCE_TOL * largest;
}

/* Whether a neighbor of contact k holds the same pair: of two that share a tangent either may slip.
 */
static int beside_one_that_sticks(const crm_substep *s, int k, const unsigned char *mode)
{
    for (int i = k > 0 ? k - 1 : 0; i < s->n_contacts && i <= k + 1; i++) {
        const crm_contact *c = &s->contacts[i];
        if (mode[i] != CAROM_STICK) continue;
        if (c->shape_a == s->contacts[k].shape_a && c->shape_b == s->contacts[k].shape_b) return 1;
    }
    return 0;
}

/* How contact k may have been for a little while from q0 on, where it is closed and
 * does not open: slipping as it does there, or sticking.  modes: those after. */
static unsigned char mode_before(const carom_world *w, const crm_substep *s, int k,
                                 const unsigned char *modes)
{
    const unsigned char mode = modes[k];
    const double slow = CRM_REST_TOL * (crm_top_speed(w, s->v0) + w->speed);
    const crm_contact *c = &s->contacts[k];
    double jn[6];
    double jt[6];
    crm_contact_rows(c, jn, jt);
    const double slip = crm_row_dot(jt, s->v0, c->body_a, c->body_b);
    const int moves = fabs(slip) > slow && w->rows.mu[k] > 0;
    if (mode != CAROM_SEPARATED) {
        return moves || beside_one_that_sticks(s, k, modes) ? mode : CAROM_STICK;
    }
    if (c->gap > CRM_HIT_TOL * w->length + crm_rounding(w)) return mode;
    if (fabs(crm_row_dot(jn, s->v0, c->body_a, c->body_b)) > slow) return mode;
    return !moves ? CAROM_STICK : slip > 0 ? CAROM_SLIP_MINUS : CAROM_SLIP_PLUS;
}

/* The modes in scratch, of a short while, made those before where the forces at q0 allow it: they
 * change sooner than that. */
static carom_status go_to_start(carom_world *w, double tol)
{
    crm_substep *s = &w->sub;
    crm_solve *c = scratch(s);
    unsigned char *after = s->solve[0].mode;
    int any = 0;
    for (int k = 0; k < s->n_contacts; k++) {
        after[k] = c->mode[k];
    }
    for (int k = 0; k < s->n_contacts; k++) {
        c->mode[k] = mode_before(w, s, k, after);
        any |= c->mode[k] != after[k];
    }
    if (!any) return CAROM_OK;
    const carom_status e = forces(w, s->q0, s->v0);
    for (int k = 0; k < s->n_contacts; k++) {
        const double sticks = w->rows.mu[k] * c->ln[k] - fabs(c->lt[k]);
        const int must = c->mode[k] == CAROM_STICK && w->rows.mu[k] > 0 && sticks <= tol;
        if (e < 0 || c->ln[k] <= tol || must) c->mode[k] = after[k];
    }
    return e;
}

/* Modes at the start into scratch; 0 when they cannot be found or nothing is closed. */
static int modes_at_start(carom_world *w, double h, double tol)
{
    crm_substep *s = &w->sub;
    int any = 0;
    if (crm_smooth(w, SHORT * h) < 0) return 0;
    take_modes(s, &s->solve[1]);
    if (go_to_start(w, tol) < 0) return 0;
    for (int k = 0; k < s->n_contacts; k++) any |= scratch(s)->mode[k] != CAROM_SEPARATED;
    return any;
}

/* The changes that contact k can make from its mode at the start, one by one. */
static int next_change(const carom_world *w, change *x)
{
    const crm_substep *s = &w->sub;
    for (;;) {
        x->sign = x->sign == 0 ? -1 : x->sign < 0 ? 1 : 0;
        if (x->sign == 0) x->k++;
        if (x->k >= s->n_contacts) return 0;
        const unsigned char mode = s->solve[CRM_MAX_SOLVES - 1].mode[x->k];
        if (mode == CAROM_SEPARATED) continue;
        if (x->sign == 0 || (mode == CAROM_STICK && w->rows.mu[x->k] > 0)) return 1;
    }
}

/* Margins in the order of next_change. */
static void keep_margins(carom_world *w)
{
    int n = 0;
    for (change x = {-1, 1}; next_change(w, &x);) *start_margin(&w->sub, n++) = margin(w, &x);
}

/* The change whose straight line meets zero first by the end; 0: none. */
static int first_change(carom_world *w, double tol, change *found, double *g0, double *g1)
{
    double soonest = HUGE_VAL;
    int n = 0;
    for (change x = {-1, 1}; next_change(w, &x); n++) {
        const double end = margin(w, &x);
        const double start = *start_margin(&w->sub, n);
        if (end >= -tol || start <= tol || start / (start - end) >= soonest) continue;
        soonest = start / (start - end);
        *found = x;
        *g0 = start;
        *g1 = end;
    }
    return soonest < HUGE_VAL;
}

/* Whether the modes kept hold to the end: what is closed presses and sticks within its limit, what
 * slips went on in its direction, what is open has not closed.  Forces at the end in place. */
static int holds(const carom_world *w, const crm_substep *s, double tol)
{
    const double hit = CRM_HIT_TOL * w->length + crm_rounding(w);
    for (change x = {-1, 1}; next_change(w, &x);) {
        if (margin(w, &x) < -tol) return 0;
    }
    for (int k = 0; k < s->n_contacts; k++) {
        const crm_contact *c = &s->moved[k];
        if (s->keep[k] == CAROM_SEPARATED && c->gap < -hit) return 0;
        if (s->keep[k] == CAROM_SLIP_MINUS && crm_slip_speed(c, s->v1) < 0) return 0;
        if (s->keep[k] == CAROM_SLIP_PLUS && crm_slip_speed(c, s->v1) > 0) return 0;
    }
    return 1;
}

typedef enum finding { NOTHING, CHANGE, ONE_MODE } finding;

/* From the end of the sub-step to the earliest change, or to knowing that there is none.  The modes
 * of the start are kept beyond it, so that what is searched is smooth in h, and what ends there is
 * of one mode. */
static carom_status find_change(carom_world *w, double h, finding *found)
{
    crm_substep *s = &w->sub;
    carom_status e = forces(w, s->q0, s->v0);
    if (e < 0) return e;
    keep_margins(w);
    const double tol = least_force(w, s->v0);
    s->keep = scratch(s)->mode;
    e = crm_map_run(w, h);
    for (int round = 0; e >= 0 && round < MAX_CHANGES; round++) {
        search f = {w, {0, 0}};
        crm_indicator g = {margin_left, &f, 0, 0, tol * FORCE_ROOT / FORCE_TOL};
        e = forces(w, s->q1, s->v1);
        if (e < 0) return e;
        if (!first_change(w, tol, &f.x, &g.start, &g.end)) {
            if (*found == NOTHING && holds(w, s, tol)) *found = ONE_MODE;
            return e;
        }
        e = crm_find_root(w, &g, &h);
        if (e >= 0) *found = CHANGE;
    }
    return e;
}

/* Whether at the end of the sub-step, all of one mode, a contact would have to pull or to slip. */
static carom_status overdue(carom_world *w, int *any)
{
    crm_substep *s = &w->sub;
    take_modes(s, &s->solve[0]);
    const carom_status e = forces(w, s->q1, s->v1);
    *any = 0;
    if (e < 0) return e;
    const double tol = least_force(w, s->v1);
    for (change x = {-1, 1}; next_change(w, &x);) *any |= margin(w, &x) < -tol;
    return e;
}

/* Whether a contact that rests at the start is open or slips throughout: it may have pressed, or
 * stuck, a little while. */
static int lets_go(const carom_world *w, const crm_substep *s)
{
    for (int k = 0; k < s->n_contacts; k++) {
        const unsigned char *modes = s->solve[0].mode;
        if (mode_before(w, s, k, modes) != modes[k]) return 1;
    }
    return 0;
}

/* The forces of a smooth map as its two stages go on, l1 at h/4 and l2 at 3h/4, to 7h/4, for forces
 * that bend: whether contact k would have to pull, or to slip.  One that differs between the stages
 * has changed. */
static int is_suspect(const carom_world *w, const crm_substep *s, int k)
{
    const crm_solve *a = &s->solve[0];
    const crm_solve *b = &s->solve[1];
    const double n = 3 * b->ln[k] - 2 * a->ln[k];
    const double t = 3 * b->lt[k] - 2 * a->lt[k];
    if (a->mode[k] != b->mode[k]) return 1;
    if (a->mode[k] == CAROM_SEPARATED) return 0;
    return n < 0 || (a->mode[k] == CAROM_STICK && w->rows.mu[k] > 0 && fabs(t) > w->rows.mu[k] * n);
}

/* Whether it is worth the forces at the end to know if something changes. */
static int may_change(const carom_world *w, const crm_substep *s)
{
    if (s->map == CRM_MAP_EXTRAPOLATED) return 1;
    for (int k = 0; k < s->n_contacts; k++) {
        if (is_suspect(w, s, k)) return 1;
    }
    return 0;
}

static int is_mixed(const crm_substep *s)
{
    if (s->map == CRM_MAP_EXTRAPOLATED) return s->finest;
    for (int k = 0; k < s->n_contacts; k++) {
        if (s->solve[0].mode[k] != s->solve[1].mode[k]) return 1;
    }
    return 0;
}

/* Motors reach and leave their limits at times that nobody seeks.  With springs the map at its end
 * is as far from the forces there as they are stiff, and so is a gradient that leaves out the
 * derivative of a time by them: for those who ask for it. */
static int seeks(const carom_world *w)
{
    if (!w->island->n_driven) return 1;
    for (int k = 0; k < w->island->n_joints; k++) {
        if (w->joints[w->island->joints[k]].motor_limit > 0) return 0;
    }
    return w->settings.events == CAROM_EVENTS_ALL;
}

/* Whether the sub-step begins with an overlap, which it takes back: forces are not all that moves.
 */
static int recovers(const carom_world *w, const crm_substep *s)
{
    const double most = w->settings.penetration * w->length + crm_rounding(w);
    for (int k = 0; k < s->n_contacts; k++) {
        if (s->contacts[k].gap < -most) return 1;
    }
    return 0;
}

carom_status crm_locate_change(carom_world *w, double left)
{
    crm_substep *s = &w->sub;
    const double h = s->h;
    const crm_end end = s->end;
    const double fraction = s->fraction;
    const crm_contact event = s->event;
    finding found = NOTHING;
    if (!w->plan.changes || s->map == CRM_MAP_EULER || s->map == CRM_MAP_IMPACT) return CAROM_OK;
    if (!s->n_contacts || s->ahead || recovers(w, s)) return CAROM_OK;
    if (s->n_contacts > MAX_CONTACTS || !seeks(w)) return CAROM_OK;
    if (w->n_fields) return CAROM_OK; /* fields are not among its forces */
    const int opens = is_mixed(s) || lets_go(w, s);
    int any = 0;
    if (!opens && !may_change(w, s)) return CAROM_OK;
    carom_status e = opens ? CAROM_OK : overdue(w, &any);
    if (e < 0 || (!opens && !any)) return e;
    if (!opens || modes_at_start(w, h, least_force(w, s->v0))) e = find_change(w, h, &found);
    s->keep = NULL;
    if (e == CAROM_E_MEMORY) return e;
    if (e >= 0 && found == ONE_MODE && (end == CRM_END_FRAME || end == CRM_END_FRACTION)) return e;
    if (e >= 0 && found == CHANGE) {
        /* The acceleration does not jump there, so that its time needs no derivative. */
        s->end = CRM_END_FRACTION;
        s->fraction = s->h / left;
        return CAROM_OK;
    }
    s->end = end;
    s->fraction = fraction;
    s->event = event;
    return crm_map_run(w, h);
}
