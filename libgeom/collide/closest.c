/* closest.c: which way to the closest features.  Every way leads to the same ones: a walk from any
 * certified axis ends there, and whatever is too close for a certificate is left to the sweep. */
#include "collide/closest.h"

static crm_axis axis_along(const crm_placed *a, const crm_placed *b, carom_vec2 d)
{
    const crm_axis x = {d, crm_support(a, d), crm_support(b, crm_neg(d))};
    return x;
}

/* Distance and reference of features that a walk found; known (may be NULL): those that it left. */
static void measure(const crm_placed *a, const crm_placed *b, const crm_closest *known,
                    crm_closest *c)
{
    const int tied = c->tied;
    if (known && known->kind == c->kind && known->a == c->a && known->b == c->b) {
        *c = *known;
    } else if (c->kind == CRM_FACE_A) {
        crm_face_at(a, c->a, b, c->b, 0, c);
    } else if (c->kind == CRM_FACE_B) {
        crm_face_at(b, c->b, a, c->a, 1, c);
    } else {
        c->gap = crm_length(crm_between(a, c->a, b, c->b));
    }
    c->tied = tied;
    c->lead = 0;
}

/* h: the height of b over a along x.d, of length `length`. */
static int walk_from(const crm_placed *a, const crm_placed *b, crm_axis x, double h, double length,
                     const crm_closest *known, crm_closest *out)
{
    crm_closest r;
    /* h > 0 by rounding alone is no certificate: from there a walk may end anywhere. */
    if (!(h > crm_noise(a, x.a, b, x.b) * length) || !crm_walk(a, b, x, &r)) return 0;
    measure(a, b, known, &r);
    if (!(r.gap > crm_noise(a, r.a, b, r.b))) return 0;
    *out = r;
    return 1;
}

int crm_closest_from(const crm_placed *a, const crm_placed *b, crm_axis x, double reach,
                     crm_closest *out)
{
    const double h = crm_dot(x.d, crm_between(a, x.a, b, x.b));
    if (!(h > 0)) return 0;
    const double length = crm_length(x.d);
    if (h > crm_beyond(reach, crm_tie(a, b)) * length) {
        out->kind = CRM_APART;
        out->a = x.a;
        out->b = x.b;
        out->tied = 0;
        out->gap = h / length;
        out->lead = 0;
        return 1;
    }
    return walk_from(a, b, x, h, length, NULL, out);
}

int crm_foot_is_on(const crm_placed *p, int k, const crm_placed *q, int j, double tol)
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
static void walk_lengthwise(const crm_placed *a, const crm_placed *b, double reach,
                            crm_closest *face)
{
    const carom_vec2 e = face->ref.e;
    if (crm_closest_from(a, b, axis_along(a, b, e), reach, face)) return;
    crm_closest_from(a, b, axis_along(a, b, crm_neg(e)), reach, face);
}

/* Beside the face: its nearer end, when that proves itself. */
static int leave_to_vertex(const crm_placed *a, const crm_placed *b, const crm_placed *p, int k,
                           int j, crm_closest *face)
{
    const double along = crm_dot(face->ref.t, face->x);
    const int end = along > 0.5 * face->ref.length ? crm_next(p, k) : k;
    crm_closest c;
    if (!crm_vertices_are_closest(a, p == a ? end : j, b, p == a ? j : end, &c)) return 0;
    *face = c;
    return 1;
}

/* From the face of largest separation to the closest features, if it separates. */
static void leave_face(const crm_placed *a, const crm_placed *b, double reach, crm_closest *face)
{
    const int on_a = face->kind == CRM_FACE_A;
    const crm_placed *p = on_a ? a : b;
    const crm_placed *q = on_a ? b : a;
    const int k = on_a ? face->a : face->b;
    const int j = on_a ? face->b : face->a;
    const double tol = crm_noise(p, k, q, j);
    if (face->gap > tol) {
        if (crm_face_is_closest(p, k, q, j, face)) {
            face->tied = 0; /* another face as high is not as close */
            return;
        }
        if (leave_to_vertex(a, b, p, k, j, face)) return;
        const carom_vec2 m = face->ref.m;
        const crm_axis x = {on_a ? m : crm_neg(m), face->a, face->b};
        const crm_closest known = *face;
        walk_from(a, b, x, face->gap, 1.0, &known, face);
    } else if (face->gap >= -tol && !crm_foot_is_on(p, k, q, j, tol)) {
        /* With a height that is rounding: needles and segments in line, end to end? */
        walk_lengthwise(a, b, reach, face);
    }
}

#ifdef CRM_AVX2
static void sweep_few(const crm_placed *a, const crm_placed *b, double tie, const crm_search *how,
                      crm_closest *out)
{
    const int four = a->n <= 4 && b->n <= 4;
    if (__builtin_cpu_supports("avx2")) {
        if (four) {
            crm_sweep_four_avx2(a, b, tie, how, out);
        } else {
            crm_sweep_eight_avx2(a, b, tie, how, out);
        }
    } else if (four) {
        crm_sweep_four(a, b, tie, how, out);
    } else {
        crm_sweep_eight(a, b, tie, how, out);
    }
}
#else
static void sweep_few(const crm_placed *a, const crm_placed *b, double tie, const crm_search *how,
                      crm_closest *out)
{
    if (a->n <= 4 && b->n <= 4) {
        crm_sweep_four(a, b, tie, how, out);
    } else {
        crm_sweep_eight(a, b, tie, how, out);
    }
}
#endif

/* So far apart [coordinates of the cores] that heights over faces, products with the distance, are
 * but rounding. */
static const double DISTANT = 1e6;

void crm_closest_features(const crm_placed *a, const crm_placed *b, const crm_search *how,
                          crm_closest *out)
{
    const double coordinates = crm_coordinates(a, b);
    const int distant = crm_spread(a, b) > DISTANT * coordinates;
    const int few = a->n <= CRM_FEW && b->n <= CRM_FEW && !distant;
    const int n = a->n + b->n;
    crm_axis x;
    if (!few || n >= how->gjk_min_vertices) {
        const carom_vec2 between = crm_sub(crm_turn(b, crm_middle(b)), crm_turn(a, crm_middle(a)));
        x = axis_along(a, b, crm_add(crm_sub(b->at, a->at), between));
        if (crm_closest_from(a, b, x, how->reach, out)) return;
    }
    if (n >= how->gjk_min_vertices) {
        crm_axis y;
        if (crm_gjk(a, b, x.d, &y) && crm_closest_from(a, b, y, how->reach, out)) return;
    }
    if (few) {
        sweep_few(a, b, CRM_TIE_TOL * coordinates, how, out);
    } else {
        crm_sweep(a, b, &x, how->reach, how->slack, out);
    }
    if (out->kind != CRM_APART) leave_face(a, b, how->reach, out);
}
