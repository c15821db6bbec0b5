/* locate.c: the time at which a watched pair of shapes closes within a sub-step.
 * docs/step.md, section "Impacts are located". */
#include "world/internal.h"

#include <math.h>

/* The root of a gap is found to this [L]; rounding of far coordinates is added. */
static const double ROOT_TOL = 1e-13;
/* Overlap that counts as passing through [thickness of both]. */
static const double DEEP = 0.1;
/* Illinois steps for one root, rounds over several roots, halvings of a failed sub-step. */
enum { MAX_ROOT_STEPS = 60, MAX_ROUNDS = 20, MAX_HALVINGS = 4, MAX_SAMPLES = 64 };
/* A sub-step that is too long for the tolerance is tried at this share of what would do, so often.
 */
static const double SAFE = 0.8;
enum { MAX_SHRINKS = 12 };

/* A gap that was positive at q0 and is watched: of a whole pair (its signed distance), or of one
 * feature of a pair that touches elsewhere. */
typedef struct watch {
    carom_pair pair;
    int limit; /* of a joint, in place of a pair; or 0 */
    int by_recipe;
    carom_recipe recipe;
    int opened;  /* 1: touching at q0 and opening; g is then (gap - base) / h, without root at 0 */
    double base; /* of an opened pair the overlap at q0, <= 0 [m] */
    double g0;   /* at q0, > 0; of an opened pair its speed */
    double g1;   /* at q1 */
    double at;   /* fraction of the sub-step where g1 was found: 1, or less after a tunnel */
    int touches; /* 1: closes exactly at the end rather than overlaps */
} watch;

static const carom_pair NO_PAIR = {0, 0};

static watch watch_of(carom_pair pair)
{
    watch x = {0};
    x.pair = pair;
    x.at = 1;
    return x;
}

static double watch_gap(const carom_world *w, const watch *x, const double *q)
{
    if (x->limit) return crm_limit_at(w, x->limit, q).gap;
    if (!x->by_recipe) return crm_collide(w, x->pair, q, HUGE_VAL).distance;
    crm_contact c = {0};
    c.shape_a = x->pair.a;
    c.shape_b = x->pair.b;
    c.body_a = w->shapes[x->pair.a].body;
    c.body_b = w->shapes[x->pair.b].body;
    c.recipe = x->recipe;
    crm_contact_refresh(w, q, &c);
    return c.gap;
}

/* What is located: the gap, or (gap - base) / h of a pair that opened at h = 0. */
static double watch_value(const carom_world *w, const watch *x, const double *q, double h)
{
    const double gap = watch_gap(w, x, q);
    return x->opened ? (gap - x->base) / h : gap;
}

static double opening_speed(const crm_contact *c, const double *v)
{
    double jn[6];
    double jt[6];
    crm_contact_rows(c, jn, jt);
    return crm_row_dot(jn, v, c->body_a, c->body_b);
}

/* Slowest opening of the points of a closed watch at q0; HUGE_VAL without any. */
static double opening_of(const carom_world *w, const watch *x, double hit)
{
    const crm_substep *s = &w->sub;
    double opening = HUGE_VAL;
    if (x->limit) {
        const crm_contact c = crm_limit_at(w, x->limit, s->q0);
        return opening_speed(&c, s->v0);
    }
    const carom_manifold m = crm_collide(w, x->pair, s->q0, hit);
    for (int k = 0; k < m.count; k++) {
        const crm_contact c = crm_contact_of(w, x->pair, &m, k, s->q0);
        if (x->by_recipe && !crm_recipe_same(c.recipe, x->recipe)) continue;
        opening = fmin(opening, opening_speed(&c, s->v0));
    }
    return opening;
}

/* Fills g0 from q0: the gap, or of a closed pair that opens its speed. */
static void watch_start(const carom_world *w, watch *x)
{
    const crm_substep *s = &w->sub;
    const double hit = CRM_HIT_TOL * w->length + crm_rounding(w);
    x->g0 = watch_gap(w, x, s->q0);
    if (x->g0 > hit) return;
    const double opening = opening_of(w, x, hit);
    if (!(opening > 0 && opening < HUGE_VAL)) {
        /* A feature of a pair that touches there already is held by its other points. */
        if (x->by_recipe) x->g0 = 0;
        return;
    }
    x->opened = 1;
    x->base = fmin(x->g0, 0);
    x->g0 = opening;
    x->g1 = (x->g1 - x->base) / (s->h * x->at);
}

/* Of two watched gaps the one whose straight line meets zero first. */
static int earlier(const watch *x, const watch *best)
{
    if (x->touches != best->touches) return best->touches;
    const double tx = x->at * x->g0 / (x->g0 - x->g1);
    const double tb = best->at * best->g0 / (best->g0 - best->g1);
    return tx < tb;
}

typedef struct search {
    carom_world *w;
    double tol; /* overlap that counts [m] */
    double hit; /* gap that touches [m] */
    int any;    /* how many */
    watch best;
    int deep; /* 1: an overlap is new that no event explains */
} search;

/* Overlap at q1 that the pair did not have at q0. */
static int is_new(const carom_world *w, const watch *x)
{
    if (x->limit) return 0;
    const double deep = crm_deep(w, x->pair, crm_rounding(w));
    if (x->g1 > -deep) return 0;
    return x->g1 < crm_collide(w, x->pair, w->sub.q0, HUGE_VAL).distance - deep;
}

/* x->g1 is the gap at x->at. */
static void consider(search *f, const watch *x)
{
    if (x->g1 > f->hit) return;
    watch y = *x;
    y.touches = x->g1 >= -f->tol;
    watch_start(f->w, &y);
    if (!(y.g0 > 0) || !(y.g1 <= f->hit) || (y.touches && y.opened)) {
        f->deep |= x->at >= 1 && is_new(f->w, x);
        return;
    }
    if (!f->any || earlier(&y, &f->best)) f->best = y;
    f->any++;
}

/* First contact of sub with this pair, or -1; contacts and pairs run in the same order. */
static int held(const crm_substep *s, carom_pair pair, int *cursor)
{
    while (*cursor < s->n_contacts &&
           (s->contacts[*cursor].shape_a < pair.a ||
            (s->contacts[*cursor].shape_a == pair.a && s->contacts[*cursor].shape_b < pair.b))) {
        (*cursor)++;
    }
    const int k = *cursor;
    if (k >= s->n_contacts) return -1;
    return s->contacts[k].shape_a == pair.a && s->contacts[k].shape_b == pair.b ? k : -1;
}

static int held_recipe(const crm_substep *s, int k, carom_pair pair, carom_recipe r)
{
    for (;
         k < s->n_contacts && s->contacts[k].shape_a == pair.a && s->contacts[k].shape_b == pair.b;
         k++) {
        if (crm_recipe_same(s->contacts[k].recipe, r)) return 1;
    }
    return 0;
}

/* New features of a pair that already touches: another corner comes down. */
static void consider_features(search *f, carom_pair pair, int k)
{
    const crm_substep *s = &f->w->sub;
    const carom_manifold m = crm_collide(f->w, pair, s->q1, f->hit);
    for (int i = 0; i < m.count; i++) {
        const crm_contact c = crm_contact_of(f->w, pair, &m, i, s->q1);
        if (held_recipe(s, k, pair, c.recipe)) continue;
        watch x = watch_of(pair);
        x.by_recipe = 1;
        x.recipe = c.recipe;
        x.g1 = c.gap;
        consider(f, &x);
    }
}

/* How many poses between q0 and q1 must be looked at so that no pair passes through unseen. */
static int samples(const carom_world *w, carom_pair pair)
{
    const crm_substep *s = &w->sub;
    const crm_shape *a = &w->shapes[pair.a];
    const crm_shape *b = &w->shapes[pair.b];
    double d[3];
    for (int k = 0; k < 3; k++) {
        d[k] = (s->q1[3 * b->body + k] - s->q0[3 * b->body + k]) -
               (s->q1[3 * a->body + k] - s->q0[3 * a->body + k]);
    }
    const double turn_a = s->q1[3 * a->body] - s->q0[3 * a->body];
    const double turn_b = s->q1[3 * b->body] - s->q0[3 * b->body];
    const double travel = hypot(d[1], d[2]) + fabs(turn_a) * a->reach + fabs(turn_b) * b->reach;
    const double n = ceil(2 * travel / (a->thickness + b->thickness));
    return n < MAX_SAMPLES ? (int)n : MAX_SAMPLES;
}

static void consider_pair(search *f, carom_pair pair)
{
    const crm_substep *s = &f->w->sub;
    watch x = watch_of(pair);
    const int n = samples(f->w, pair);
    for (int i = 1; i < n; i++) {
        const double at = (double)i / n;
        x.g1 = crm_distance_between(f->w, pair, s->q0, s->q1, at);
        if (x.g1 >= -f->tol) continue;
        x.at = at;
        consider(f, &x);
        return;
    }
    if (crm_far_apart(f->w, pair, s->q1, f->hit)) return;
    const carom_manifold m = crm_collide(f->w, pair, s->q1, f->hit);
    if (!m.count) return;
    x.g1 = m.distance;
    consider(f, &x);
}

static int holds_limit(const crm_substep *s, int limit)
{
    for (int k = s->n_contacts - 1; k >= 0 && s->contacts[k].limit; k--) {
        if (s->contacts[k].limit == limit) return 1;
    }
    return 0;
}

static void consider_limits(search *f)
{
    const carom_world *w = f->w;
    const int n = crm_limit_slots(w);
    for (int slot = 0; slot < n; slot++) {
        watch x = watch_of(NO_PAIR);
        x.limit = crm_limit_in(w, slot);
        if (!x.limit || holds_limit(&w->sub, x.limit)) continue;
        x.g1 = watch_gap(w, &x, w->sub.q1);
        consider(f, &x);
    }
}

/* The earliest watched gap that has closed at q1, into *found; *any = 0 when there is none.  1 when
 * an overlap is new that no event explains. */
static int first_closed(carom_world *w, watch *found, int *any)
{
    const double noise = crm_rounding(w);
    search f = {w,
                w->settings.penetration * w->length + noise,
                CRM_HIT_TOL * w->length + noise,
                0,
                watch_of(NO_PAIR),
                0};
    int cursor = 0;
    for (int k = 0; k < w->island->n_pairs; k++) {
        const carom_pair pair = w->island->pairs[k];
        const int c = held(&w->sub, pair, &cursor);
        if (c >= 0) {
            consider_features(&f, pair, c);
        } else {
            consider_pair(&f, pair);
        }
    }
    consider_limits(&f);
    *any = f.any;
    *found = f.best;
    return f.deep;
}

carom_status crm_find_root(carom_world *w, const crm_indicator *f, double *h)
{
    double a = 0;
    double b = *h;
    double ga = f->start;
    double gb = f->end;
    int side = 0;
    for (int i = 0; i < MAX_ROOT_STEPS; i++) {
        double t = i < MAX_ROOT_STEPS / 2 ? (a * gb - b * ga) / (gb - ga) : 0.5 * (a + b);
        if (!(t > a && t < b)) t = 0.5 * (a + b);
        if (w->effort >= 2 * CRM_WORN) return CAROM_E_NO_SOLUTION;
        const carom_status e = crm_map_run(w, t);
        if (e < 0) return e;
        *h = t;
        if (t < CRM_NO_TIME * w->settings.dt) return CAROM_OK;
        const double g = f->value(w, f->what, t);
        if (fabs(g) <= f->tol || b - a <= 1e-16 * b) return CAROM_OK;
        if (g > 0) {
            a = t;
            ga = g;
            if (side == 1) gb *= 0.5;
            side = 1;
        } else {
            b = t;
            gb = g;
            if (side == -1) ga *= 0.5;
            side = -1;
        }
    }
    return CAROM_OK;
}

static double gap_value(const carom_world *w, const void *what, double h)
{
    return watch_value(w, what, w->sub.q1, h);
}

static carom_status find_root(carom_world *w, const watch *x, double *h)
{
    const double tol = ROOT_TOL * w->length + crm_rounding(w);
    /* An opened pair is searched by its mean speed: tol over the whole bracket is the sharpest. */
    const crm_indicator f = {gap_value, x, x->g0, x->g1, x->opened ? tol / *h : tol};
    return crm_find_root(w, &f, h);
}

/* The contact point that closes, for the derivative of the event time. */
static int set_event(carom_world *w, const watch *x)
{
    crm_substep *s = &w->sub;
    s->end = CRM_END_EVENT;
    s->returns = x->opened && x->base < -(CRM_HIT_TOL * w->length + crm_rounding(w));
    if (x->limit) {
        s->event = crm_limit_at(w, x->limit, s->q1);
        return 1;
    }
    const double near = CRM_HIT_TOL * w->length + 4 * crm_rounding(w);
    const carom_manifold m = crm_collide(w, x->pair, s->q1, x->by_recipe ? HUGE_VAL : near);
    int best = -1;
    for (int k = 0; k < m.count; k++) {
        const crm_contact c = crm_contact_of(w, x->pair, &m, k, s->q1);
        if (x->by_recipe && !crm_recipe_same(c.recipe, x->recipe)) continue;
        if (best < 0 || m.points[k].gap < m.points[best].gap) best = k;
    }
    if (best < 0) return 0;
    s->event = crm_contact_of(w, x->pair, &m, best, s->q1);
    return 1;
}

/* Same gap: the one whose root was just found. */
static int same_watch(const watch *x, const watch *y)
{
    return x->limit == y->limit && x->pair.a == y->pair.a && x->pair.b == y->pair.b &&
           x->by_recipe == y->by_recipe && (!x->by_recipe || crm_recipe_same(x->recipe, y->recipe));
}

static void end_at_fraction(crm_substep *s, double left)
{
    s->end = CRM_END_FRACTION;
    s->fraction = s->h / left;
}

/* From a closed gap within the present sub-step to the earliest event.  With no root that can be
 * named the sub-step ends at a constant fraction of the time left. */
static carom_status go_to_event(carom_world *w, watch x, double left)
{
    crm_substep *s = &w->sub;
    double h = s->h * x.at;
    for (int round = 0; round < MAX_ROUNDS; round++) {
        watch next;
        int any;
        const carom_status e = find_root(w, &x, &h);
        if (e < 0) return e;
        first_closed(w, &next, &any);
        if (!any || next.touches || same_watch(&x, &next)) break;
        x = next;
        h *= next.at;
    }
    if (!set_event(w, &x)) end_at_fraction(s, left);
    return s->met;
}

static int unsolved(carom_status e)
{
    return e == CAROM_E_NO_SOLUTION || e == CAROM_E_INFEASIBLE;
}

/* A sub-step of length h without a solution is tried at half its length, four levels deep. */
static carom_status halve(carom_world *w, double h, double left, carom_status failed)
{
    for (int k = 0; k < MAX_HALVINGS; k++) {
        h *= 0.5;
        crm_guess_load(w, h); /* impulses that ran away are no guess */
        const carom_status e = crm_map_run(w, h);
        end_at_fraction(&w->sub, left);
        if (e >= 0) return e;
    }
    return failed;
}

/* Where the smooth map has no solution at any length that was tried, the Euler map may have one. */
static carom_status run_euler(carom_world *w, double h, double left, carom_status failed)
{
    if (w->sub.map == CRM_MAP_EULER) return failed;
    w->sub.map = CRM_MAP_EULER;
    crm_guess_load(w, h);
    const carom_status e = crm_map_run(w, h);
    if (w->sub.end == CRM_END_FRACTION) w->sub.fraction = h / left;
    return unsolved(e) ? halve(w, h, left, e) : e;
}

/* A sub-step of length h without a solution: shorter, or by the Euler map. */
static carom_status rescue(carom_world *w, double h, double left, carom_status failed)
{
    const carom_status e = halve(w, h, left, failed);
    if (!unsolved(e)) return e;
    end_at_fraction(&w->sub, left);
    return run_euler(w, h, left, e);
}

carom_status crm_run_through(carom_world *w, double left)
{
    w->sub.end = CRM_END_FRAME;
    w->sub.columns = 0;
    w->sub.map = w->smooth && w->effort < CRM_WORN ? CRM_MAP_SMOOTH : CRM_MAP_EULER;
    carom_status e = crm_map_run(w, left);
    if (unsolved(e)) e = halve(w, left, left, e);
    if (!unsolved(e)) return e;
    w->sub.end = CRM_END_FRAME;
    return run_euler(w, left, left, e);
}

/* Of a pair that moves by more than its thickness: whether it overlaps by a part of that on its
 * way; x is then where. */
static int passes(const carom_world *w, carom_pair pair, watch *x)
{
    const crm_substep *s = &w->sub;
    const double deep = -DEEP * (w->shapes[pair.a].thickness + w->shapes[pair.b].thickness);
    const int n = samples(w, pair);
    for (int i = 1; n > 1 && i <= n; i++) {
        x->at = (double)i / n;
        x->g1 = crm_distance_between(w, pair, s->q0, s->q1, x->at);
        if (x->g1 < deep) return 1;
    }
    return 0;
}

carom_status crm_stop_passing(carom_world *w, double left)
{
    watch first = watch_of(NO_PAIR);
    first.at = 2;
    for (int k = 0; k < w->island->n_pairs; k++) {
        watch x = watch_of(w->island->pairs[k]);
        if (!passes(w, x.pair, &x) || x.at >= first.at) continue;
        watch_start(w, &x);
        if (x.g0 > 0 && !x.opened) first = x;
    }
    if (first.at > 1) return CAROM_OK;
    double h = w->sub.h * first.at;
    const carom_status e = find_root(w, &first, &h);
    if (unsolved(e)) return rescue(w, h, left, e);
    if (e < 0) return e;
    if (!set_event(w, &first)) end_at_fraction(&w->sub, left);
    return w->sub.met;
}

/* The sub-step as it is, or up to where the first slipping contact stops, or a mode changes. */
static carom_status stopped(carom_world *w, double left, carom_status e)
{
    if (e < 0 || !w->smooth || w->effort >= CRM_BRIEF) return e;
    carom_status s = crm_locate_stop(w);
    if (s >= 0) s = crm_locate_change(w, left);
    return s < 0 || s > e ? s : e;
}

static carom_status locate(carom_world *w, double left, int allowed, int *busy)
{
    crm_substep *s = &w->sub;
    carom_status e = crm_run_through(w, left);
    *busy = 0;
    for (int k = 0; e >= 0 && k < MAX_HALVINGS; k++) {
        watch x;
        int any;
        const int deep = first_closed(w, &x, &any);
        if (deep && !any) e = e < 0 || e > CAROM_LIMIT ? e : CAROM_LIMIT;
        *busy = any > allowed;
        if (*busy) return CAROM_OK;
        double h = s->h;
        if (any && x.touches) {
            set_event(w, &x);
        } else if (any) {
            h *= x.at;
            e = go_to_event(w, x, left);
            *busy = e >= 0 && s->h < CRM_NO_TIME * w->settings.dt;
        }
        if (e >= 0 && !*busy) {
            h = s->h;
            e = stopped(w, left, e);
        }
        if (!unsolved(e)) return e;
        e = rescue(w, h, left, e);
    }
    return e;
}

int crm_is_too_long(const carom_world *w, double *h)
{
    const crm_substep *s = &w->sub;
    const double allowed = w->settings.tolerance * s->h / w->settings.dt;
    if (!(w->settings.tolerance > 0)) return 0;
    if (s->map != CRM_MAP_EXTRAPOLATED || s->finest || s->estimate <= allowed) return 0;
    const double shrink = SAFE * pow(allowed / s->estimate, 1.0 / (2 * s->columns));
    *h = s->h * fmax(shrink, 0.1);
    return 1;
}

/* The end of a sub-step that was given less than the time left. */
static void end_within(crm_substep *s, double left)
{
    if (s->end == CRM_END_FRAME || s->end == CRM_END_FRACTION) end_at_fraction(s, left);
}

carom_status crm_locate(carom_world *w, double left, int allowed, int *busy)
{
    carom_status e = locate(w, left, allowed, busy);
    double h = left;
    for (int k = 0; e >= 0 && !*busy && crm_is_too_long(w, &h); k++) {
        if (k == MAX_SHRINKS) return e < CAROM_LIMIT ? CAROM_LIMIT : e;
        crm_guess_load(w, h);
        e = locate(w, h, allowed, busy);
        if (e >= 0 && !*busy) end_within(&w->sub, left);
    }
    return e;
}
