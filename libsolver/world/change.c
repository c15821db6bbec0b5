/* change.c: the time at which a contact opens or begins to slip.  docs/step.md, section "Contacts
 * that open or begin to slip". */
#include "world/internal.h"

#include <math.h>

/* Modes at the start are those of a sub-step this short [of the whole]. */
static const double SHORT = 1.0 / 256;
/* Step of the differences along v that give the rates of the rows [of L over the top speed]. */
static const double RATE_STEP = 1e-4;
/* Force that counts as none [of those that act].  Where it is zero the acceleration does
 * not jump, so an error d of the time moves the end by d^3: this is more than enough for order 8.
 */
static const double FORCE_TOL = 1e-9;
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

/* d(J v)/dt at constant v of all rows, by central differences over q +- tau v, into cn, ct, ce. */
static void rates(carom_world *w, crm_substep *s, const double *q, const double *v, crm_solve *c)
{
    const double tau = RATE_STEP * w->length / (crm_top_speed(w, v) + w->speed + 1e-300);
    for (int side = -1; side <= 1; side += 2) {
        const double scale = side / (2 * tau);
        crm_copy(w, w->probe, q);
        crm_move(w, w->probe, v, side * tau);
        for (int k = 0; k < s->n_contacts; k++) {
            double jn[6];
            double jt[6];
            crm_contact x = s->contacts[k];
            crm_contact_refresh(w, w->probe, &x);
            crm_contact_rows(&x, jn, jt);
            if (side < 0) c->cn[k] = c->ct[k] = 0;
            c->cn[k] += scale * crm_row_dot(jn, v, x.body_a, x.body_b);
            c->ct[k] += scale * crm_row_dot(jt, v, x.body_a, x.body_b);
        }
        int row = 0;
        for (int k = 0; k < w->island->n_joints; k++) {
            double je[6 * CRM_MAX_JOINT_ROWS];
            double error[CRM_MAX_JOINT_ROWS];
            const crm_joint *j = &w->joints[w->island->joints[k]];
            crm_joint_rows(j, w->probe, je, error);
            for (int i = 0; i < j->n_rows; i++, row++) {
                if (side < 0) c->ce[row] = 0;
                c->ce[row] += scale * crm_row_dot(&je[6 * i], v, j->body_a, j->body_b);
            }
        }
    }
}

/* Forces at (q, v) with the modes in scratch: M a = f + J'l, J a + dJ/dt v = 0. */
static carom_status forces(carom_world *w, const double *q, const double *v)
{
    crm_substep *s = &w->sub;
    crm_solve *c = scratch(s);
    c->kind = CRM_VELOCITY;
    crm_rows_at(w, s, q);
    rates(w, s, q, v, c);
    for (int i = 0; i < w->island->n_bodies; i++) {
        const int b = w->island->bodies[i];
        crm_free_acceleration(w, b, v + 3 * b, &w->rows.u[3 * i]);
    }
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

/* Modes at the start into scratch; 0 when they cannot be found or nothing is closed. */
static int modes_at_start(carom_world *w, double h)
{
    crm_substep *s = &w->sub;
    int any = 0;
    if (crm_smooth(w, SHORT * h) < 0) return 0;
    for (int k = 0; k < s->n_contacts; k++) {
        scratch(s)->mode[k] = s->solve[0].mode[k];
        any |= s->solve[0].mode[k] != CAROM_SEPARATED;
    }
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

/* From the end of the sub-step to the earliest change; *found = 0 when there is none. */
static carom_status find_change(carom_world *w, double h, int *found)
{
    crm_substep *s = &w->sub;
    *found = 0;
    carom_status e = forces(w, s->q0, s->v0);
    if (e < 0) return e;
    keep_margins(w);
    const double tol = least_force(w, s->v0);
    e = crm_map_run(w, h);
    for (int round = 0; e >= 0 && round < MAX_CHANGES; round++) {
        search f = {w, {0, 0}};
        crm_indicator g = {margin_left, &f, 0, 0, tol};
        e = forces(w, s->q1, s->v1);
        if (e < 0 || !first_change(w, tol, &f.x, &g.start, &g.end)) return e;
        e = crm_find_root(w, &g, &h);
        *found = e >= 0;
    }
    return e;
}

/* Whether at the end of the sub-step, all of one mode, a contact would have to pull or to slip. */
static carom_status overdue(carom_world *w, int *any)
{
    crm_substep *s = &w->sub;
    for (int k = 0; k < s->n_contacts; k++) scratch(s)->mode[k] = s->solve[0].mode[k];
    const carom_status e = forces(w, s->q1, s->v1);
    *any = 0;
    if (e < 0) return e;
    const double tol = least_force(w, s->v1);
    for (change x = {-1, 1}; next_change(w, &x);) *any |= margin(w, &x) < -tol;
    return e;
}

/* Whether a contact that rests at the start is open throughout: it may have pressed a little while.
 */
static int lets_go(const crm_substep *s)
{
    for (int k = 0; k < s->n_contacts; k++) {
        if (s->solve[0].mode[k] == CAROM_SEPARATED) return 1;
    }
    return 0;
}

/* The forces of a smooth map at its end as its two stages go on, l2 + (l2 - l1) / 2: whether
 * contact k would have to pull, or to slip.  One that differs between the stages has changed. */
static int is_suspect(const carom_world *w, const crm_substep *s, int k)
{
    const crm_solve *a = &s->solve[0];
    const crm_solve *b = &s->solve[1];
    const double n = 1.5 * b->ln[k] - 0.5 * a->ln[k];
    const double t = 1.5 * b->lt[k] - 0.5 * a->lt[k];
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

carom_status crm_locate_change(carom_world *w, double left)
{
    crm_substep *s = &w->sub;
    const double h = s->h;
    const crm_end end = s->end;
    const double fraction = s->fraction;
    const crm_contact event = s->event;
    int found = 0;
    if (!w->plan.changes || s->map == CRM_MAP_EULER || s->map == CRM_MAP_IMPACT) return CAROM_OK;
    if (!s->n_contacts || s->ahead) return CAROM_OK;
    if (s->n_contacts > MAX_CONTACTS) return CAROM_OK;
    if (w->island->n_driven) return CAROM_OK; /* springs and motors are not among its forces */
    const int opens = is_mixed(s) || lets_go(s);
    int any = 0;
    if (!opens && !may_change(w, s)) return CAROM_OK;
    carom_status e = opens ? CAROM_OK : overdue(w, &any);
    if (e < 0 || (!opens && !any)) return e;
    if (!opens || modes_at_start(w, h)) e = find_change(w, h, &found);
    if (e == CAROM_E_MEMORY) return e;
    if (e >= 0 && found) {
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
