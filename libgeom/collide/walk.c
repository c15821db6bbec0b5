/* walk.c: from a separating direction to the closest features of two convex cores.
 *
 * h(d) = min_B d.b - max_A d.a is concave and homogeneous; where h > 0 its maximum over the unit
 * circle is the distance.  The corners of B - A in the order of their normal cones are pairs of
 * vertices; between two cones lies a border, the normal of an edge of A or the reversed normal of
 * an edge of B.  With w = b - a at a corner, the best direction is w itself     when w is in the
 * corner's cone, a border u   when w is past u at the corner before u, and short of it at the
 * corner after. Each border is tested by the same expression from either side and parallel borders
 * are one, so the answer does not depend on where the walk started. */
#include "collide/closest.h"

/* Edges whose directions differ by less are parallel [rad]: some roundings of a rotated edge. */
static const double PARALLEL_TOL = 1e-14;

typedef struct border {
    carom_vec2 u;
    int a; /* edge of A, or -1 */
    int b; /* edge of B, or -1; both: parallel edges, u is the normal of A's */
} border;

typedef struct corner {
    int a;
    int b;
    carom_vec2 w;
} corner;

static corner corner_at(const crm_placed *a, const crm_placed *b, int i, int j)
{
    const corner c = {i, j, crm_between(a, i, b, j)};
    return c;
}

static int parallel(carom_vec2 u, carom_vec2 v)
{
    return fabs(crm_cross(u, v)) <= PARALLEL_TOL * crm_dot(u, v);
}

/* w has turned past u, counterclockwise for turn = 1.  The dot product tells a border within 90
 * degrees behind w from one up to 180 degrees ahead: cones can be that wide. */
static int past(carom_vec2 w, carom_vec2 u, int turn)
{
    return turn * crm_cross(u, w) > 0 && crm_dot(u, w) > 0;
}

/* The border on the `turn` side of the corner, if w is past it. */
static int border_behind(const crm_placed *a, const crm_placed *b, const corner *c, int turn,
                         border *out)
{
    const border none = {{0, 0}, -1, -1};
    border ua = none;
    border ub = none;
    if (a->n > 1) {
        ua.a = turn > 0 ? c->a : crm_prev(a, c->a);
        ua.u = crm_normal(a, ua.a);
    }
    if (b->n > 1) {
        ub.b = turn > 0 ? c->b : crm_prev(b, c->b);
        ub.u = crm_neg(crm_normal(b, ub.b));
    }
    if (a->n > 1 && b->n > 1 && parallel(ua.u, ub.u)) {
        ua.b = ub.b;
        *out = ua;
        return past(c->w, ua.u, turn);
    }
    const int past_a = a->n > 1 && past(c->w, ua.u, turn);
    const int past_b = b->n > 1 && past(c->w, ub.u, turn);
    const int a_first = past_a && (!past_b || turn * crm_cross(ua.u, ub.u) > 0);
    *out = a_first ? ua : ub;
    return past_a || past_b;
}

/* The corner across the border. */
static corner across(const crm_placed *a, const crm_placed *b, const corner *c, const border *s,
                     int turn)
{
    int i = c->a;
    int j = c->b;
    if (s->a >= 0) i = turn > 0 ? crm_next(a, i) : crm_prev(a, i);
    if (s->b >= 0) j = turn > 0 ? crm_next(b, j) : crm_prev(b, j);
    return corner_at(a, b, i, j);
}

/* Between two parallel edges lies a corner without a cone: a start there is moved to one beside. */
static corner leave_sliver(const crm_placed *a, const crm_placed *b, int i, int j)
{
    if (a->n > 1 && b->n > 1) {
        const int i0 = crm_prev(a, i);
        const int j0 = crm_prev(b, j);
        if (parallel(crm_normal(a, i), crm_neg(crm_normal(b, j0)))) {
            j = j0;
        } else if (parallel(crm_normal(a, i0), crm_neg(crm_normal(b, j)))) {
            j = crm_next(b, j);
        }
    }
    return corner_at(a, b, i, j);
}

static crm_closest at_vertices(const corner *c)
{
    const crm_closest r = {CRM_VERTICES, c->a, c->b, 0, crm_length(c->w)};
    return r;
}

static crm_closest at_border(const crm_placed *a, const crm_placed *b, const border *s,
                             const corner *c, const corner *d)
{
    crm_closest r = {CRM_FACE_A, s->a, c->b, s->a >= 0 && s->b >= 0, 0};
    if (s->a < 0) {
        r.kind = CRM_FACE_B;
        r.a = c->a;
        r.b = s->b;
        r.gap = crm_height(b, r.b, a, r.a);
        return r;
    }
    r.gap = crm_height(a, r.a, b, r.b);
    if (s->b >= 0) {
        /* The lower end of B's edge; of equal ones the edge's first. */
        const double gap = crm_height(a, r.a, b, d->b);
        if (gap < r.gap || (gap == r.gap && d->b == s->b)) {
            r.b = d->b;
            r.gap = gap;
        }
    }
    return r;
}

int crm_walk(const crm_placed *a, const crm_placed *b, crm_axis from, crm_closest *out)
{
    const int limit = 2 * (a->n + b->n) + 4;
    corner c = leave_sliver(a, b, from.a, from.b);
    for (int step = 0; step < limit; step++) {
        border s;
        int turn = 1;
        if (!border_behind(a, b, &c, turn, &s)) {
            turn = -1;
            if (!border_behind(a, b, &c, turn, &s)) {
                *out = at_vertices(&c);
                return 1;
            }
        }
        const corner d = across(a, b, &c, &s, turn);
        if (turn * crm_cross(s.u, d.w) < 0) {
            *out = at_border(a, b, &s, &c, &d);
            return 1;
        }
        c = d;
    }
    return 0;
}
