/* walk.c: from a separating direction to the closest features of two convex cores.
 *
 * h(d) = min_B d.b - max_A d.a is concave and homogeneous; where h > 0 its maximum over the unit
 * circle is the distance.  The corners of B - A in the order of their normal cones are pairs of
 * vertices; between two cones lies a border, the normal of an edge of A or the reversed normal of
 * an edge of B.  With w = b - a at a corner, the best direction is
 *     w itself     when w is in the corner's cone,
 *     a border u   when w is past u at the corner before u, and short of it at the corner after.
 * Each border is tested by the same expression from either side and parallel borders are one, so
 * the answer does not depend on where the walk started. */
#include "collide/closest.h"

/* Edges whose directions differ by less are parallel [rad]: some roundings of a rotated edge. */
static const double PARALLEL_TOL = 1e-14;

enum { CCW, CW };

/* A pair of vertices with the borders of its cone on either side: normals of A's edges, reversed
 * normals of B's.  A circle has none. */
typedef struct corner {
    int a;
    int b;
    carom_vec2 w;
    carom_vec2 ua[2];
    carom_vec2 ub[2];
} corner;

static void see_a(const crm_placed *a, corner *c)
{
    if (a->n == 1) return;
    c->ua[CCW] = crm_normal(a, c->a);
    c->ua[CW] = crm_normal(a, crm_prev(a, c->a));
}

static void see_b(const crm_placed *b, corner *c)
{
    if (b->n == 1) return;
    c->ub[CCW] = crm_neg(crm_normal(b, c->b));
    c->ub[CW] = crm_neg(crm_normal(b, crm_prev(b, c->b)));
}

static int parallel(carom_vec2 u, carom_vec2 v)
{
    return fabs(crm_cross(u, v)) <= PARALLEL_TOL * crm_dot(u, v);
}

/* w has turned past u.  The dot product tells a border within 90 degrees behind w from one up to
 * 180 degrees ahead: cones can be that wide. */
static int past(carom_vec2 w, carom_vec2 u, int side)
{
    const double turn = crm_cross(u, w);
    return (side == CCW ? turn > 0 : turn < 0) && crm_dot(u, w) > 0;
}

/* Which edges make the border that w is past on this side: bit 0 A's, bit 1 B's, both when they are
 * parallel; 0: none. */
static int border_behind(const crm_placed *a, const crm_placed *b, const corner *c, int side)
{
    const carom_vec2 ua = c->ua[side];
    const carom_vec2 ub = c->ub[side];
    if (a->n == 1) return past(c->w, ub, side) ? 2 : 0;
    if (b->n == 1) return past(c->w, ua, side) ? 1 : 0;
    if (parallel(ua, ub)) return past(c->w, ua, side) ? 3 : 0;
    const int past_a = past(c->w, ua, side);
    const int past_b = past(c->w, ub, side);
    if (!past_a || !past_b) return past_a ? 1 : past_b ? 2 : 0;
    const double turn = crm_cross(ua, ub);
    return (side == CCW ? turn > 0 : turn < 0) ? 1 : 2;
}

/* The vertices across the border, and w there. */
static corner across(const crm_placed *a, const crm_placed *b, const corner *c, int edges, int side)
{
    corner d = *c;
    if (edges & 1) d.a = side == CCW ? crm_next(a, c->a) : crm_prev(a, c->a);
    if (edges & 2) d.b = side == CCW ? crm_next(b, c->b) : crm_prev(b, c->b);
    d.w = crm_between(a, d.a, b, d.b);
    return d;
}

/* Between two parallel edges lies a corner without a cone: a start there is moved to one beside. */
static corner start_at(const crm_placed *a, const crm_placed *b, int i, int j)
{
    corner c = {i, j, {0, 0}, {{0, 0}, {0, 0}}, {{0, 0}, {0, 0}}};
    see_a(a, &c);
    see_b(b, &c);
    if (a->n > 1 && b->n > 1) {
        const int back = parallel(c.ua[CCW], c.ub[CW]);
        if (back || parallel(c.ua[CW], c.ub[CCW])) {
            c.b = back ? crm_prev(b, j) : crm_next(b, j);
            see_b(b, &c);
        }
    }
    c.w = crm_between(a, c.a, b, c.b);
    return c;
}

/* before: the corner clockwise of the border. */
static void at_border(const crm_placed *a, const crm_placed *b, const corner *before, int edges,
                      crm_closest *out)
{
    out->kind = edges & 1 ? CRM_FACE_A : CRM_FACE_B;
    out->a = before->a;
    out->b = before->b;
    out->tied = edges == 3;
    if (edges == 3) {
        /* The lower end of B's edge, which runs from before->b to the next; of equal ones its
         * start. */
        const carom_vec2 m = crm_reference_at(a, before->a).m;
        const int next = crm_next(b, before->b);
        const double start = crm_dot(m, crm_between(a, before->a, b, before->b));
        if (crm_dot(m, crm_between(a, before->a, b, next)) < start) out->b = next;
    }
}

int crm_walk(const crm_placed *a, const crm_placed *b, crm_axis from, crm_closest *out)
{
    const int limit = 2 * (a->n + b->n) + 4;
    corner c = start_at(a, b, from.a, from.b);
    for (int step = 0; step < limit; step++) {
        int side = CCW;
        int edges = border_behind(a, b, &c, CCW);
        if (!edges) {
            side = CW;
            edges = border_behind(a, b, &c, CW);
        }
        if (!edges) {
            out->kind = CRM_VERTICES;
            out->a = c.a;
            out->b = c.b;
            out->tied = 0;
            return 1;
        }
        corner d = across(a, b, &c, edges, side);
        const double turn = crm_cross(edges & 1 ? c.ua[side] : c.ub[side], d.w);
        if (side == CCW ? turn < 0 : turn > 0) {
            at_border(a, b, side == CCW ? &c : &d, edges, out);
            return 1;
        }
        if (edges & 1) see_a(a, &d);
        if (edges & 2) see_b(b, &d);
        c = d;
    }
    return 0;
}
