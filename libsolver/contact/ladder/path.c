#include "libsolver/contact/ladder/path.h"

#include <math.h>

/* Passes of refinement stop when the defect, relative to the solution, is below this [1]. */
#define DEFECT_DONE 1e-12
/* A slope that counts as zero, of the largest d [1]. */
#define SLOPE_ZERO 1e-14
/* A pivot of the small system below this share of its column counts as zero [1]. */
#define PIVOT_ZERO 1e-14

/* Rows whose equation may differ from the one factored, before everything is factored anew. */
enum { PASSES = 6, MAX_SLOTS = CRM_PATH_COLUMNS };

/* The factors are those of the modes at the last refresh, the base.  A contact whose mode has
 * changed since leaves its base equation e by an unknown amount y, e = y, such that its new
 * equation holds: a small dense system over such rows, the slots, instead of new factors.
 *
 * A solution of the base equations with right-hand sides in one row is a column.  It is kept as two
 * numbers per contact, from which the rest follows by the base equations:
 *   separated: J_n w, J_t w      stick: l_n, l_t      slip: l_n, J_t w */
typedef struct slot {
    int contact;
    int tangential;
} slot;

/* What conditions and equations of a contact are made of. */
typedef struct state {
    double ln;
    double lt;
    double gn; /* J_n w */
    double gt;
} state;

typedef struct work {
    crm_path *p;
    double *rate; /* 2 nc: derivative by t of the base equations alone, packed as a column */
    double *sum;  /* 2 nc: with the slots' share */
    double *ln;   /* nc each: derivatives by t along the present modes */
    double *lt;
    double *an;
    double *ut;
    slot slots[MAX_SLOTS];
    double y[MAX_SLOTS]; /* 0: the row has its base equation again */
    int n_slots;
    double direction;
    double flat; /* slopes up to this are zero */
} work;

static double row_n(const crm_island *s, int k, const double *z)
{
    const crm_contact *c = &s->contact[k];
    return crm_dot(c->n, c->a, c->b, z);
}

static double row_t(const crm_island *s, int k, const double *z)
{
    const crm_contact *c = &s->contact[k];
    return c->mu > 0 ? crm_dot(c->t, c->a, c->b, z) : 0;
}

static int has_stick_row(const crm_island *s, int k, unsigned char mode)
{
    return mode == CAROM_STICK && s->contact[k].mu > 0;
}

/* s->rhs <- r - (left sides of the base equations at x); returns its largest entry. */
static double find_defect(const crm_path *p, crm_vec r, crm_vec x)
{
    crm_island *s = p->s;
    double e = 0;
    crm_island_defect(s, x, s->rhs.z);
    for (int q = 0; q < s->ng; q++) {
        for (int i = 0; i < CRM_GROUP_ROWS; i++) {
            const int at = 3 * (s->nb + q) + i;
            s->rhs.z[at] += s->group[q].c[i] - p->compliance * x.z[at];
        }
    }
    for (int i = 0; i < 3 * (s->nb + s->ng); i++) {
        s->rhs.z[i] += r.z[i];
        e = fmax(e, fabs(s->rhs.z[i]));
    }
    for (int k = 0; k < s->nc; k++) {
        s->rhs.n[k] = 0;
        s->rhs.t[k] = 0;
        if (s->mode[k] == CAROM_SEPARATED) continue;
        s->rhs.n[k] = r.n[k] - row_n(s, k, x.z) - p->compliance * x.n[k];
        if (has_stick_row(s, k, s->mode[k]))
            s->rhs.t[k] = r.t[k] - row_t(s, k, x.z) - p->compliance * x.t[k];
        e = fmax(e, fmax(fabs(s->rhs.n[k]), fabs(s->rhs.t[k])));
    }
    return e;
}

static double size_of(const crm_island *s, crm_vec x)
{
    double m = 0;
    for (int i = 0; i < 3 * s->nb; i++) m = fmax(m, fabs(x.z[i]));
    return m;
}

/* Impulses as s->mode demands, exactly. */
static void fit(const crm_island *s, crm_vec x)
{
    for (int k = 0; k < s->nc; k++) {
        const double mu = s->contact[k].mu;
        if (s->mode[k] == CAROM_SEPARATED) x.n[k] = x.t[k] = 0;
        if (!(mu > 0)) x.t[k] = 0;
        if (s->mode[k] > CAROM_STICK) x.t[k] = crm_slip_sign(s->mode[k]) * mu * x.n[k];
    }
}

/* Solves the base equations, starting from x.  r.z: forces on bodies, right sides of joint rows. */
static void solve(const crm_path *p, crm_vec r, crm_vec x)
{
    crm_island *s = p->s;
    for (int i = 0; i < PASSES; i++) {
        if (find_defect(p, r, x) <= DEFECT_DONE * (1 + size_of(s, x)) && i) break;
        crm_island_reduce(s, s->rhs, s->step);
        crm_vec_add(s, x, 1, s->step);
    }
}

/* The two numbers per contact of a solution of the base equations. */
static void pack(const work *w, crm_vec x, double *to)
{
    const crm_island *s = w->p->s;
    for (int k = 0; k < s->nc; k++) {
        const unsigned char mode = w->p->s->base_mode[k];
        to[2 * k] = mode == CAROM_SEPARATED ? row_n(s, k, x.z) : x.n[k];
        to[2 * k + 1] = has_stick_row(s, k, mode) ? x.t[k] : row_t(s, k, x.z);
    }
}

/* The rest of them: of a column pair q whose right-hand sides at this contact are rn and rt. */
static state unpack(const work *w, int k, const double *q, double rn, double rt)
{
    const crm_island *s = w->p->s;
    const double e = w->p->compliance;
    const unsigned char mode = w->p->s->base_mode[k];
    if (mode == CAROM_SEPARATED) return (state){rn, rt, q[0], q[1]};
    if (mode == CAROM_STICK)
        return (state){q[0], has_stick_row(s, k, mode) ? q[1] : 0, rn - e * q[0],
                       has_stick_row(s, k, mode) ? rt - e * q[1] : 0};
    const double lt = crm_slip_sign(mode) * s->contact[k].mu * q[0] + rt;
    return (state){q[0], lt, rn - e * q[0], q[1]};
}

/* Right-hand sides of the base equations of contact k for the derivative by t. */
static state unpack_rate(const work *w, int k, const double *q, double yn, double yt)
{
    const crm_path *p = w->p;
    const unsigned char mode = w->p->s->base_mode[k];
    const double rn = mode == CAROM_SEPARATED ? 0 : -p->d.n[k];
    const double rt = has_stick_row(p->s, k, mode) ? -p->d.t[k] : 0;
    return unpack(w, k, q, rn + yn, rt + yt);
}

/* Whether the row of contact k, normal or tangential, has another equation in mode a than in b. */
static int row_differs(const crm_island *s, int k, int tangential, unsigned char a, unsigned char b)
{
    if (!tangential) return (a == CAROM_SEPARATED) != (b == CAROM_SEPARATED);
    return s->contact[k].mu > 0 && a != b;
}

/* Left side of the row's present equation; *d: its right side for the derivative by t. */
static double equation(const work *w, slot r, state x, double *d)
{
    const crm_path *p = w->p;
    const int k = r.contact;
    const unsigned char mode = p->s->mode[k];
    *d = 0;
    if (mode == CAROM_SEPARATED) return r.tangential ? x.lt : x.ln;
    if (!r.tangential) {
        *d = -p->d.n[k];
        return x.gn + p->compliance * x.ln;
    }
    if (mode > CAROM_STICK) return x.lt - crm_slip_sign(mode) * p->s->contact[k].mu * x.ln;
    *d = -p->d.t[k];
    return x.gt + p->compliance * x.lt;
}

/* r <- right sides -(alpha c + beta d) + alpha compliance l_ref. */
static void set_data(const crm_path *p, crm_vec r, double alpha, double beta)
{
    const crm_island *s = p->s;
    const double e = alpha * p->compliance;
    crm_vec_zero(s, r);
    for (int k = 0; k < s->nc; k++) {
        const crm_contact *c = &s->contact[k];
        r.n[k] = e * p->ref.n[k] - alpha * c->cn - beta * p->d.n[k];
        r.t[k] = e * p->ref.t[k] - alpha * c->ct - beta * p->d.t[k];
    }
    for (int q = 0; q < s->ng; q++) {
        for (int i = 0; i < CRM_GROUP_ROWS; i++) {
            const int at = 3 * (s->nb + q) + i;
            r.z[at] = e * p->ref.z[at] - alpha * s->group[q].c[i] - beta * p->d.z[at];
        }
    }
}

/* A new base: factors of the present modes, the point and its derivative solved with them. */
static void refresh(work *w)
{
    crm_path *p = w->p;
    crm_island *s = p->s;
    const crm_vec x = s->way[0];
    const crm_vec r = s->way[1];
    memcpy(s->base_mode, s->mode, (size_t)s->nc);
    w->n_slots = 0;
    crm_set_responses(s, p->compliance);
    crm_island_factor(s, 1, p->compliance);
    set_data(p, r, 1, p->t);
    fit(s, s->x);
    solve(p, r, s->x);
    fit(s, s->x);
    for (int k = 0; k < s->nc; k++) {
        s->an[k] = row_n(s, k, s->x.z) + p->compliance * s->x.n[k] - r.n[k];
        s->ut[k] = row_t(s, k, s->x.z) + p->compliance * s->x.t[k] - r.t[k];
    }
    set_data(p, r, 0, 1);
    crm_vec_zero(s, x);
    solve(p, r, x);
    pack(w, x, w->rate);
}

/* One more slot; its column has a unit more on the right of its base equation. */
static void add_slot(work *w, int k, int tangential)
{
    crm_island *s = w->p->s;
    const crm_contact *c = &s->contact[k];
    const crm_vec x = s->way[0];
    const crm_vec r = s->way[1];
    const unsigned char base = s->base_mode[k];
    crm_vec_zero(s, x);
    crm_vec_zero(s, r);
    if (tangential) {
        r.t[k] = 1;
        if (!has_stick_row(s, k, base)) crm_add(r.z, c->t, c->a, c->b, 1);
    } else {
        r.n[k] = 1;
        if (base == CAROM_SEPARATED) crm_add(r.z, c->n, c->a, c->b, 1);
    }
    /* The base's modes, for the left sides. */
    unsigned char *present = s->mode;
    s->mode = s->base_mode;
    solve(w->p, r, x);
    s->mode = present;
    pack(w, x, s->column + 2 * (size_t)w->n_slots * (size_t)s->nc);
    w->slots[w->n_slots++] = (slot){k, tangential};
}

static int has_slot(const work *w, int k, int tangential)
{
    for (int i = 0; i < w->n_slots; i++) {
        if (w->slots[i].contact == k && w->slots[i].tangential == tangential) return 1;
    }
    return 0;
}

/* Slots for the rows of contact k whose equations have become others; 0: no room. */
static int make_slots(work *w, int k)
{
    const crm_island *s = w->p->s;
    for (int i = 0; i < 2; i++) {
        if (!row_differs(s, k, i, s->base_mode[k], s->mode[k]) || has_slot(w, k, i)) continue;
        if (w->n_slots == MAX_SLOTS) return 0;
        add_slot(w, k, i);
    }
    return 1;
}

/* a (n rows of MAX_SLOTS + 1) y = last column, by elimination with pivoting.  0: singular. */
static int solve_dense(int n, double a[][MAX_SLOTS + 1], double *y)
{
    for (int j = 0; j < n; j++) {
        int q = j;
        double most = 0;
        for (int i = 0; i < n; i++) most = fmax(most, fabs(a[i][j]));
        for (int i = j + 1; i < n; i++) q = fabs(a[i][j]) > fabs(a[q][j]) ? i : q;
        if (!(fabs(a[q][j]) > PIVOT_ZERO * most)) return 0;
        for (int c = 0; c <= n; c++) {
            const double swap = a[j][c];
            a[j][c] = a[q][c];
            a[q][c] = swap;
        }
        for (int i = j + 1; i < n; i++) {
            const double f = a[i][j] / a[j][j];
            for (int c = j; c <= n; c++) a[i][c] -= f * a[j][c];
        }
    }
    for (int j = n - 1; j >= 0; j--) {
        y[j] = a[j][n];
        for (int c = j + 1; c < n; c++) y[j] -= a[j][c] * y[c];
        y[j] /= a[j][j];
    }
    return 1;
}

/* The y of the slots whose equations differ from the base's; 0: singular. */
static int solve_slots(work *w)
{
    const crm_island *s = w->p->s;
    double a[MAX_SLOTS][MAX_SLOTS + 1];
    double y[MAX_SLOTS];
    int now[MAX_SLOTS];
    int n = 0;
    for (int i = 0; i < w->n_slots; i++) {
        const slot r = w->slots[i];
        w->y[i] = 0;
        if (row_differs(s, r.contact, r.tangential, s->base_mode[r.contact], s->mode[r.contact]))
            now[n++] = i;
    }
    for (int i = 0; i < n; i++) {
        const slot r = w->slots[now[i]];
        const int k = r.contact;
        for (int j = 0; j < n; j++) {
            const slot c = w->slots[now[j]];
            const double *q = s->column + 2 * ((size_t)now[j] * (size_t)s->nc + (size_t)k);
            const int own = c.contact == k;
            const state x = unpack(w, k, q, own && !c.tangential, own && c.tangential);
            double right;
            a[i][j] = equation(w, r, x, &right);
        }
        double right;
        const double left = equation(w, r, unpack_rate(w, k, w->rate + 2 * k, 0, 0), &right);
        a[i][n] = right - left;
    }
    if (!solve_dense(n, a, y)) return 0;
    for (int i = 0; i < n; i++) w->y[now[i]] = y[i];
    return 1;
}

static void set_slope(const work *w, int k, double yn, double yt)
{
    const crm_path *p = w->p;
    const state x = unpack_rate(w, k, w->sum + 2 * k, yn, yt);
    w->ln[k] = x.ln;
    w->lt[k] = x.lt;
    w->an[k] = x.gn + p->d.n[k] + p->compliance * x.ln;
    w->ut[k] = x.gt + p->d.t[k] + p->compliance * x.lt;
}

/* Derivatives by t of impulses, a and u on the present modes; 0: there is none. */
static int find_slopes(work *w)
{
    const crm_island *s = w->p->s;
    if (!solve_slots(w)) return 0;
    memcpy(w->sum, w->rate, 2 * (size_t)s->nc * sizeof(double));
    for (int i = 0; i < w->n_slots; i++) {
        const double *q = s->column + 2 * (size_t)i * (size_t)s->nc;
        const double y = w->y[i];
        if (y == 0) continue; /* exact */
        for (int k = 0; k < 2 * s->nc; k++) w->sum[k] += y * q[k];
    }
    for (int k = 0; k < s->nc; k++) set_slope(w, k, 0, 0);
    for (int i = 0; i < w->n_slots; i++) {
        double y[2] = {0, 0};
        for (int j = 0; j < w->n_slots; j++) {
            if (w->slots[j].contact == w->slots[i].contact) y[w->slots[j].tangential] = w->y[j];
        }
        set_slope(w, w->slots[i].contact, y[0], y[1]);
    }
    return 1;
}

/* Conditions of contact k's mode, all >= 0, from values or from their slopes; returns how many. */
static int conditions(const crm_island *s, int k, const double *ln, const double *lt,
                      const double *an, const double *ut, double f[2])
{
    const double mu = s->contact[k].mu;
    switch (s->mode[k]) {
    case CAROM_SEPARATED: f[0] = an[k]; return 1;
    case CAROM_STICK:
        f[0] = mu > 0 ? mu * ln[k] - lt[k] : ln[k];
        f[1] = mu * ln[k] + lt[k];
        return mu > 0 ? 2 : 1;
    default:
        f[0] = ln[k];
        f[1] = -crm_slip_sign(s->mode[k]) * ut[k];
        return 2;
    }
}

/* Mode on the other side of condition i of contact k; *now: index of the new mode's condition that
 * starts from zero. */
static unsigned char adjacent(const crm_island *s, int k, int i, int *now)
{
    const double mu = s->contact[k].mu;
    *now = 0;
    switch (s->mode[k]) {
    case CAROM_SEPARATED:
        if (!(mu > 0)) return CAROM_STICK;
        return s->ut[k] > 0 ? CAROM_SLIP_MINUS : CAROM_SLIP_PLUS;
    case CAROM_STICK:
        if (!(mu > 0)) return CAROM_SEPARATED;
        *now = 1;
        return i ? CAROM_SLIP_MINUS : CAROM_SLIP_PLUS;
    default:
        if (!i) return CAROM_SEPARATED;
        *now = s->mode[k] == CAROM_SLIP_PLUS ? 0 : 1;
        return CAROM_STICK;
    }
}

/* Longest step in the present direction; the contact and condition that end it, or -1. */
static double find_event(const work *w, int *contact, int *condition)
{
    const crm_path *p = w->p;
    const crm_island *s = p->s;
    double step = w->direction < 0 ? p->t : p->most - p->t;
    *contact = -1;
    for (int k = 0; k < s->nc; k++) {
        double f[2];
        double g[2];
        const int n = conditions(s, k, s->x.n, s->x.t, s->an, s->ut, f);
        conditions(s, k, w->ln, w->lt, w->an, w->ut, g);
        for (int i = 0; i < n; i++) {
            const double slope = w->direction * g[i];
            if (!(slope < -w->flat)) continue;
            const double t = fmax(f[i], 0) / -slope;
            if (t >= step) continue;
            step = t;
            *contact = k;
            *condition = i;
        }
    }
    return step;
}

static void move(work *w, double step)
{
    crm_island *s = w->p->s;
    const double by = w->direction * step;
    for (int k = 0; k < s->nc; k++) {
        s->x.n[k] += by * w->ln[k];
        s->x.t[k] += by * w->lt[k];
        s->an[k] += by * w->an[k];
        s->ut[k] += by * w->ut[k];
    }
    w->p->t += by;
}

/* The direction in which condition `now` of contact k grows; 0: it does not change. */
static int turn(work *w, int k, int now)
{
    double g[2];
    conditions(w->p->s, k, w->ln, w->lt, w->an, w->ut, g);
    if (!(fabs(g[now]) > w->flat)) return 0;
    w->direction = g[now] > 0 ? 1 : -1;
    return 1;
}

static void begin(work *w, crm_path *p)
{
    crm_island *s = p->s;
    double *after = s->column + 2 * (size_t)MAX_SLOTS * (size_t)s->nc;
    w->p = p;
    w->rate = after;
    w->sum = after + 2 * s->nc;
    w->ln = s->slack[CRM_N_SLACKS - 4];
    w->lt = s->slack[CRM_N_SLACKS - 3];
    w->an = s->slack[CRM_N_SLACKS - 2];
    w->ut = s->slack[CRM_N_SLACKS - 1];
    w->direction = -1;
    w->flat = 0;
    for (int k = 0; k < s->nc; k++)
        w->flat = fmax(w->flat, SLOPE_ZERO * fmax(fabs(p->d.n[k]), fabs(p->d.t[k])));
    refresh(w);
}

int crm_path_follow(crm_path *p, int max_pivots)
{
    crm_island *s = p->s;
    work w;
    int contact = -1;
    int condition = 0;
    int now = 0;
    begin(&w, p);
    for (int i = 0; i < max_pivots; i++) {
        if (contact >= 0 && !make_slots(&w, contact)) refresh(&w);
        if (!find_slopes(&w) || (contact >= 0 && !turn(&w, contact, now))) return 0;
        const double step = find_event(&w, &contact, &condition);
        if (!(step < HUGE_VAL)) return 0;
        move(&w, step);
        s->pivots += contact >= 0;
        if (contact >= 0) {
            s->mode[contact] = adjacent(s, contact, condition, &now);
            continue;
        }
        if (w.direction > 0) return 0;
        p->t = 0;
        refresh(&w);
        return 1;
    }
    return 0;
}
