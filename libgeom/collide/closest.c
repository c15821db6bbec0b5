/* closest.c: which way to the closest features.  Every way leads to the same ones: a walk from any
 * certified axis ends there, and whatever is too close for a certificate is left to the sweep. */
#include "collide/closest.h"

/* Distances below this are rounding [1], times the coordinates they come from [m]. */
static const double NEAR_TOL = 1e-13;

double crm_height(const crm_placed *p, int k, const crm_placed *q, int j)
{
    const carom_vec2 e = crm_edge(p, k);
    const carom_vec2 m = crm_right(crm_scale(1.0 / crm_length(e), e));
    return crm_dot(m, crm_between(p, k, q, j));
}

static double norm1(carom_vec2 a)
{
    return fabs(a.x) + fabs(a.y);
}

double crm_noise(const crm_placed *a, int i, const crm_placed *b, int j)
{
    return NEAR_TOL * (norm1(crm_arm(a, i)) + norm1(crm_arm(b, j)));
}

static double axis_height(const crm_placed *a, const crm_placed *b, crm_axis x)
{
    return crm_dot(x.d, crm_between(a, x.a, b, x.b));
}

static crm_axis axis_along(const crm_placed *a, const crm_placed *b, carom_vec2 d)
{
    const crm_axis x = {d, crm_support(a, d), crm_support(b, crm_neg(d))};
    return x;
}

/* The walk from an axis, if that is certified and the distance clears rounding. */
static int walk_clear(const crm_placed *a, const crm_placed *b, crm_axis x, double reach,
                      crm_closest *out)
{
    const double h = axis_height(a, b, x);
    const double length = crm_length(x.d);
    /* h > 0 by rounding alone is no certificate: from there a walk may end anywhere. */
    if (!(h > crm_noise(a, x.a, b, x.b) * length)) return 0;
    if (h > reach * length) {
        const crm_closest far = {CRM_APART, x.a, x.b, 0, h / length};
        *out = far;
        return 1;
    }
    return crm_walk(a, b, x, out) && out->gap > crm_noise(a, out->a, b, out->b);
}

/* Rough center of a core: halfway between vertex 0 and the one half around. */
static carom_vec2 middle(const crm_placed *p)
{
    return crm_turn(p, crm_scale(0.5, crm_add(p->v[0], p->v[p->n / 2])));
}

/* The foot of the vertex is on the face's edge, or the other shape's edge at that vertex lies along
 * the face.  Otherwise, with a height that is rounding, the shapes may be apart lengthwise: needles
 * and segments in line, end to end. */
static int foot_on_face(const crm_placed *p, int k, const crm_placed *q, int j, double tol)
{
    const carom_vec2 e = crm_edge(p, k);
    const double length = crm_length(e);
    const carom_vec2 x = crm_between(p, k, q, j);
    const double u = crm_dot(e, x);
    if (u >= 0 && u <= length * length) return 1;
    for (int side = 0; q->n > 1 && side < 2; side++) {
        const carom_vec2 y = crm_between(p, k, q, side ? crm_next(q, j) : crm_prev(q, j));
        const double along = crm_dot(e, y);
        const double rise = fabs(crm_cross(crm_sub(y, x), e));
        if (rise <= tol * length && (u < 0 ? along >= 0 : along <= length * length)) return 1;
    }
    return 0;
}

/* Needles in line: the face's own direction separates. */
static int walk_lengthwise(const crm_placed *a, const crm_placed *b, const crm_closest *face,
                           double reach, crm_closest *out)
{
    const int on_a = face->kind == CRM_FACE_A;
    const crm_placed *p = on_a ? a : b;
    const crm_placed *q = on_a ? b : a;
    const int k = on_a ? face->a : face->b;
    const int j = on_a ? face->b : face->a;
    if (foot_on_face(p, k, q, j, crm_noise(p, k, q, j))) return 0;
    const carom_vec2 e = crm_edge(p, k);
    return walk_clear(a, b, axis_along(a, b, e), reach, out) ||
           walk_clear(a, b, axis_along(a, b, crm_neg(e)), reach, out);
}

/* From the face of largest separation. */
static crm_closest from_face(const crm_placed *a, const crm_placed *b, const crm_closest *face,
                             double reach)
{
    crm_closest r;
    const double tol = crm_noise(a, face->a, b, face->b);
    if (face->gap > tol) {
        const carom_vec2 u =
            face->kind == CRM_FACE_A ? crm_normal(a, face->a) : crm_neg(crm_normal(b, face->b));
        if (walk_clear(a, b, axis_along(a, b, u), reach, &r)) return r;
    } else if (face->gap >= -tol && walk_lengthwise(a, b, face, reach, &r)) {
        return r;
    }
    return *face;
}

crm_closest crm_closest_features(const crm_placed *a, const crm_placed *b, double reach,
                                 int gjk_min_vertices)
{
    const carom_vec2 d = crm_add(crm_sub(b->at, a->at), crm_sub(middle(b), middle(a)));
    crm_closest r;
    if (walk_clear(a, b, axis_along(a, b, d), reach, &r)) return r;
    crm_axis x;
    if (a->n + b->n >= gjk_min_vertices && crm_gjk(a, b, d, &x) && walk_clear(a, b, x, reach, &r)) {
        return r;
    }
    r = crm_sweep(a, b, reach);
    return r.kind == CRM_APART ? r : from_face(a, b, &r, reach);
}
