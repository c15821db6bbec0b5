/* extrapolate.c: maps of order 4, 6 and 8 from the symmetric one of order 2.  docs/step.md, section
 * "Higher orders". */
#include "world/internal.h"

#include <math.h>

/* Position errors below this are left alone [L], and holds of a position that are tried. */
static const double HOLD_TOL = 1e-14;

/* Columns of the table: n = first .. last sub-steps of h / n.  The error of S expands in h^2, so
 * the values T_n combine as polynomials in (h / n)^2 at 0 (Gragg, Bulirsch and Stoer; Aitken and
 * Neville): c_n = prod over j != n of n^2 / (n^2 - j^2). */
static double weight(int n, int first, int last)
{
    double c = 1;
    for (int j = first; j <= last; j++) {
        if (j != n) c *= (double)(n * n) / (n * n - j * j);
    }
    return c;
}

/* The inner sub-step takes the place of w->sub and gives it back: all parts work on w->sub. */
static void exchange(carom_world *w, int inner)
{
    const crm_substep s = w->sub;
    w->sub = w->inner[inner];
    w->inner[inner] = s;
}

/* Contacts, forces and guesses of inner sub-step i, which starts at (q, v). */
static carom_status prepare(carom_world *w, int i, const double *q, const double *v, double h,
                            double since)
{
    const crm_substep *outer = &w->sub;
    crm_substep *s = &w->inner[i];
    s->n_contacts = 0;
    const carom_status e = crm_substep_reserve(w, s, outer->n_contacts);
    if (e) return e;
    crm_copy(w, s->q0, q);
    crm_copy(w, s->v0, v);
    s->force = outer->force;
    s->time = outer->time + since;
    s->n_contacts = outer->n_contacts;
    s->ahead = 0;
    s->keep = outer->keep;
    s->end = CRM_END_FRAME;
    for (int k = 0; k < s->n_contacts; k++) {
        s->contacts[k] = outer->contacts[k];
        crm_contact_refresh(w, s->q0, &s->contacts[k]);
        s->slips[k] = outer->slips[k];
    }
    crm_guess_copy(w, outer, s, h / outer->h);
    return CAROM_OK;
}

static carom_status run_inner(carom_world *w, int i, const double *q, const double *v, double h,
                              double since)
{
    const carom_status e = prepare(w, i, q, v, h, since);
    if (e) return e;
    exchange(w, i);
    const carom_status s = crm_smooth(w, h);
    exchange(w, i);
    return s;
}

/* Column n: inner sub-steps first .. first + n - 1. */
static carom_status run_column(carom_world *w, int n, int first, double h)
{
    const double *q = w->sub.q0;
    const double *v = w->sub.v0;
    carom_status worst = CAROM_OK;
    for (int j = first; j < first + n; j++) {
        const carom_status e = run_inner(w, j, q, v, h / n, (j - first) * h / n);
        if (e < 0) return e;
        if (e > worst) worst = e;
        q = w->inner[j].q1;
        v = w->inner[j].v1;
    }
    return worst;
}

/* Whether all inner sub-steps went the same way: the same contacts closed, sticking or slipping,
 * and the same motors at their limits. */
static int one_mode(const carom_world *w, int n_inner)
{
    const crm_substep *a = &w->inner[0];
    for (int i = 0; i < n_inner; i++) {
        const crm_substep *b = &w->inner[i];
        if (b->n_solves != 2 || b->solve[1].kind != CRM_STAGE_2) return 0;
        for (int k = 0; k < a->n_contacts; k++) {
            for (int stage = 0; stage < 2; stage++) {
                if (b->solve[stage].mode[k] != a->solve[0].mode[k]) return 0;
            }
        }
        for (int k = 0; w->island->n_driven && k < w->island->n_rows; k++) {
            if (b->solve[0].motor[k] != a->solve[0].motor[k]) return 0;
            if (b->solve[1].motor[k] != a->solve[0].motor[k]) return 0;
        }
    }
    return 1;
}

/* Its last sub-step ends at T_n. */
static const crm_substep *end_of_column(const carom_world *w, int n)
{
    return &w->inner[n * (n + 1) / 2 - 1];
}

/* to += c (value - finest) */
static void add_difference(const carom_world *w, double *to, double c, const double *value,
                           const double *finest)
{
    for (int i = 0; i < w->island->n_bodies; i++) {
        const int at = 3 * w->island->bodies[i];
        for (int k = at; k < at + 3; k++) to[k] += c * (value[k] - finest[k]);
    }
}

/* q1, v1 = sum over columns of c_n T_n, as T_N + sum of c_n (T_n - T_N): the c_n, up to 60, then
 * magnify the rounding of what columns differ by, not of where the bodies are. */
static void combine(carom_world *w, int columns)
{
    crm_substep *s = &w->sub;
    const crm_substep *finest = end_of_column(w, columns);
    crm_copy(w, s->q1, finest->q1);
    crm_copy(w, s->v1, finest->v1);
    for (int n = 1; n < columns; n++) {
        const crm_substep *end = end_of_column(w, n);
        add_difference(w, s->q1, s->weight[n - 1], end->q1, finest->q1);
        add_difference(w, s->v1, s->weight[n - 1], end->v1, finest->v1);
    }
}

/* Largest way of a point of a body that the value of `columns` columns is apart from that without
 * the first one, which is the map of the next lower order [m]. */
static double apart(const carom_world *w, int columns)
{
    double largest = 0;
    for (int i = 0; i < w->island->n_bodies; i++) {
        const int b = w->island->bodies[i];
        const double *finest = &end_of_column(w, columns)->q1[3 * b];
        double d[3] = {0, 0, 0};
        for (int n = 1; n < columns; n++) {
            const double *q = &end_of_column(w, n)->q1[3 * b];
            const double c = weight(n, 1, columns) - (n > 1 ? weight(n, 2, columns) : 0);
            for (int k = 0; k < 3; k++) d[k] += c * (q[k] - finest[k]);
        }
        const double reach = w->bodies[b].reach;
        largest = fmax(largest, hypot(d[1], d[2]) + reach * fabs(d[0]));
    }
    return largest;
}

/* Of the value of k columns.  With the error E_m h^2m / prod n^2 of a value that m columns n give,
 * the difference e_k to that of columns 2 .. k is E_(k-1) h^(2k-2) / k!^2; as E_m go on as they
 * did, E_k = E_(k-1)^2 / E_(k-2), the error is k^2 e_k^2 / e_(k-1).  Of two columns e_2 is known
 * alone, which is above it. */
static double estimate(const carom_world *w, int k)
{
    const double e = apart(w, k);
    const double before = k > 2 ? apart(w, k - 1) : 0;
    return before > 0 ? fmin(e, k * k * e * (e / before)) : e;
}

/* The outer solves 0 and 1 show the modes and impulses of the finest column, for those who look. */
static void show(carom_world *w, int columns)
{
    crm_substep *s = &w->sub;
    const crm_substep *last = end_of_column(w, columns);
    for (int i = 0; i < 2; i++) {
        s->solve[i].kind = last->solve[i].kind;
        for (int k = 0; k < s->n_contacts; k++) s->solve[i].mode[k] = last->solve[i].mode[k];
    }
    crm_guess_copy(w, last, s, s->h / last->h);
    s->degenerate = last->degenerate;
    s->restitution = last->restitution;
    s->n_solves = 2;
}

int crm_holds_tangent(const carom_world *w, const crm_substep *s, int k)
{
    const unsigned char *mode = s->solve[1].mode;
    const crm_contact *c = &s->contacts[k];
    if (mode[k] != CAROM_STICK || !(w->rows.mu[k] > 0)) return 0;
    /* Two sticking contacts of a pair hold it with one tangent; the other would be redundant, and
     * in a curved motion at odds with it. */
    const crm_contact *before = &s->contacts[k > 0 ? k - 1 : 0];
    return k == 0 || mode[k - 1] != CAROM_STICK || before->shape_a != c->shape_a ||
           before->shape_b != c->shape_b;
}

/* The equations at the active set with reactions along their own rows: closed contacts and joints,
 * and the tangents of those that stick. */
carom_contact_problem crm_hold_problem(carom_world *w, const crm_substep *s, const crm_solve *c)
{
    carom_contact_problem p = crm_problem(w, s, c);
    for (int k = s->n_contacts - 1; k >= 0; k--) w->rows.mu[k] = crm_holds_tangent(w, s, k) ? 1 : 0;
    return p;
}

static carom_status solve_hold(carom_world *w, crm_substep *s, crm_solve *c)
{
    const carom_contact_problem p = crm_hold_problem(w, s, c);
    carom_contact_solution x = {w->rows.v, c->ln, c->lt, c->le, c->mode};
    const carom_status e = carom_contact_modes(crm_solver(w), &p, &x);
    w->stats->factorizations++;
    for (int i = 0; e >= 0 && i < w->island->n_bodies; i++) {
        memcpy(&c->v[3 * w->island->bodies[i]], &w->rows.v[3 * i], 3 * sizeof *c->v);
    }
    return e;
}

static crm_solve *begin_hold(carom_world *w, crm_solve_kind kind)
{
    crm_substep *s = &w->sub;
    crm_solve *c = &s->solve[s->n_solves];
    c->kind = kind;
    c->share = 1;
    crm_copy(w, c->q, s->q1);
    crm_rows_at(w, s, s->q1);
    for (int k = 0; k < s->n_contacts; k++) {
        const int closed = s->solve[1].mode[k] != CAROM_SEPARATED;
        c->mode[k] = closed ? CAROM_STICK : CAROM_SEPARATED;
        c->cn[k] = c->ct[k] = 0;
    }
    for (int k = 0; k < w->island->n_rows; k++) c->ce[k] = 0;
    return c;
}

/* Gaps, slips and joint errors at the pose of c; returns the largest [m]. */
static double hold_sides(const carom_world *w, const crm_substep *s, crm_solve *c)
{
    double largest = 0;
    for (int k = 0; k < s->n_contacts; k++) {
        if (c->mode[k] == CAROM_SEPARATED) continue;
        c->cn[k] = s->moved[k].gap;
        if (crm_holds_tangent(w, s, k)) {
            c->ct[k] = crm_slip(w, &s->moved[k], s->q0, c->q);
        }
        largest = fmax(largest, fmax(fabs(c->cn[k]), fabs(c->ct[k])));
    }
    for (int k = 0; k < w->island->n_rows; k++) {
        c->ce[k] = w->rows.error[k];
        largest = fmax(largest, fabs(c->ce[k]));
    }
    return largest;
}

/* Extrapolation leaves the constraints by the order of its error; one projection of the position
 * and one of the velocity, in the mass metric, bring it back. */
static carom_status hold(carom_world *w)
{
    crm_substep *s = &w->sub;
    const double tol = HOLD_TOL * w->length + crm_rounding(w);
    if (!s->n_contacts && !w->island->n_rows) return CAROM_OK;
    for (int i = 0; i < CRM_MAX_HOLDS; i++) {
        crm_solve *c = begin_hold(w, CRM_HOLD);
        if (hold_sides(w, s, c) <= tol && i > 0) break;
        memset(w->rows.u, 0, 3 * (size_t)w->island->n_bodies * sizeof(double));
        const carom_status e = solve_hold(w, s, c);
        if (e < 0) return e;
        crm_move(w, s->q1, c->v, 1);
        s->n_solves++;
    }
    crm_solve *c = begin_hold(w, CRM_HOLD_SPEED);
    for (int i = 0; i < w->island->n_bodies; i++) {
        memcpy(&w->rows.u[3 * i], &s->v1[3 * w->island->bodies[i]], 3 * sizeof *s->v1);
    }
    const carom_status e = solve_hold(w, s, c);
    if (e < 0) return e;
    crm_copy(w, s->v1, c->v);
    s->n_solves++;
    return CAROM_OK;
}

/* The finest column alone: within it something begins or ends, and nothing expands in h^2. */
static void take_finest(carom_world *w, int columns)
{
    crm_substep *s = &w->sub;
    for (int n = 1; n <= columns; n++) s->weight[n - 1] = n == columns;
    combine(w, columns);
}

/* Columns first .. last; the worst status. */
static carom_status run_columns(carom_world *w, int first, int last, double h)
{
    carom_status worst = CAROM_OK;
    for (int n = first; n <= last; n++) {
        const carom_status e = run_column(w, n, n * (n - 1) / 2, h);
        if (e < 0) return e;
        if (e > worst) worst = e;
    }
    return worst;
}

/* As many columns as are given, or as the tolerance asks for; their number goes to *columns. */
static carom_status run_table(carom_world *w, double h, int *columns)
{
    const int most = w->settings.order / 2;
    const double allowed = w->settings.tolerance * h / w->settings.dt;
    const int given = w->settings.tolerance > 0 ? w->sub.columns : most;
    *columns = given > 0 ? given : 2;
    carom_status worst = run_columns(w, 1, *columns, h);
    while (worst >= 0 && given == 0 && *columns < most) {
        if (one_mode(w, *columns * (*columns + 1) / 2) && estimate(w, *columns) <= allowed) break;
        const carom_status e = run_columns(w, *columns + 1, *columns + 1, h);
        if (e < 0 || e > worst) worst = e;
        ++*columns;
    }
    return worst;
}

carom_status crm_extrapolate(carom_world *w, double h)
{
    crm_substep *s = &w->sub;
    int columns;
    s->h = h;
    const carom_status worst = run_table(w, h, &columns);
    if (worst < 0) return worst;
    for (int n = 1; n <= columns; n++) s->weight[n - 1] = weight(n, 1, columns);
    s->map = CRM_MAP_EXTRAPOLATED;
    s->columns = columns;
    s->n_inner = columns * (columns + 1) / 2;
    show(w, columns);
    s->finest = !one_mode(w, s->n_inner);
    if (s->finest) {
        take_finest(w, columns);
        return worst;
    }
    combine(w, columns);
    s->estimate = estimate(w, columns);
    const carom_status e = hold(w);
    return e < 0 ? e : worst;
}
