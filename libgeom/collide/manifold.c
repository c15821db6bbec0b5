/* manifold.c: contact points and their recipes at the closest features. */
#include "collide/manifold.h"

#include "collide/kernels.h"

/* Cosine of the angle between an incident edge and the reference edge below which a cut is steep.
 */
static const double STEEP = 1e-3;

/* cos(m, u) |cos(m, u)| times |u|^2 |v|^2: in the order of the cosines, without a root. */
static inline double cosine_key(carom_vec2 m, carom_vec2 u, carom_vec2 v)
{
    const double c = crm_dot(m, u);
    return c * fabs(c) * crm_dot(v, v);
}

/* The edge of q at its vertex j that looks most against the normal m; of equal ones the first. */
static inline int opposite_edge(const crm_placed *q, int j, carom_vec2 m)
{
    const int before = crm_prev(q, j);
    const carom_vec2 d = crm_turn_back(q, m);
    const carom_vec2 u = crm_right(crm_sub(q->v[j], q->v[before]));
    const carom_vec2 v = crm_right(crm_sub(q->v[crm_next(q, j)], q->v[j]));
    const double cos_u = cosine_key(d, u, v);
    const double cos_v = cosine_key(d, v, u);
    const int is_before = (cos_u < cos_v) | ((cos_u == cos_v) & (before < j));
    return is_before ? before : j;
}

/* One face: edge k of p, and what of q is over it. */
typedef struct face {
    const crm_reference *ref;
    const crm_placed *p;
    const crm_placed *q;
    int k;
    carom_vec2 d;     /* position of q - position of p */
    carom_vec2 start; /* arm of the edge's start */
} face;

/* A candidate for a contact point. */
typedef struct candidate {
    carom_vec2 arm; /* relative to q's body */
    double h;       /* height over the face */
    double along;   /* vertices: place along the face from its start */
    int inc;
    unsigned char kernel;
    unsigned char at_end;
} candidate;

static inline candidate take_vertex(const face *f, int j, carom_vec2 arm)
{
    crm_edge_point at;
    candidate c;
    crm_set_point(f->ref, f->d, f->start, arm, &at);
    c.arm = arm;
    c.h = at.h;
    c.along = crm_dot(f->ref->t, at.x);
    c.inc = j;
    c.kernel = CAROM_EDGE_VERTEX;
    c.at_end = 0;
    return c;
}

/* Edge i of q, from `arm` along w, cut at an end of the face. */
static inline candidate take_cut(const face *f, int i, carom_vec2 arm, carom_vec2 w, int at_end)
{
    const carom_vec2 end = at_end ? crm_arm(f->p, crm_next(f->p, f->k)) : f->start;
    crm_edge_point at;
    candidate c;
    crm_set_cut(f->ref, f->d, f->start, arm, crm_turn(f->q, w), end, &at);
    c.arm = at.arm;
    c.h = at.h;
    c.along = 0;
    c.inc = i;
    c.kernel = CAROM_EDGE_CLIPPED;
    c.at_end = (unsigned char)at_end;
    return c;
}

/* Vertex j of q is closest to the face.  Let the incident edge of q, which runs against k, reach
 * from `low` to `high` along k.  A steep one that only grazes the plane through an end of k is not
 * cut: the cut would be anywhere on it.  Nor is the closest vertex cut off for being past that
 * plane by rounding.  One or two candidates. */
static inline int clip(const face *f, int j, candidate *low, candidate *high)
{
    const crm_placed *q = f->q;
    const int i = opposite_edge(q, j, f->ref->m);
    const int i1 = crm_next(q, i);
    const carom_vec2 arm = crm_arm(q, i);
    *low = take_vertex(f, i1, crm_arm(q, i1));
    *high = take_vertex(f, i, arm);
    const double from = low->along;
    const double to = high->along;
    const double length = f->ref->length;
    const carom_vec2 w = crm_sub(q->v[i1], q->v[i]);
    const double tol = crm_noise(f->p, f->k, q, j);
    const double run = to - from;
    const int steep = (run < 0) | (run * run < STEEP * STEEP * crm_dot(w, w));
    const double slack = steep ? tol : 0;
    const int low_inside = from >= -(i1 == j ? tol : slack);
    const int high_inside = to <= length + (i == j ? tol : slack);
    if ((!low_inside & (to < slack)) | (!high_inside & (from > length - slack))) {
        /* Nothing but a vertex over k: of an incident edge along the face the nearer one. */
        const int flat = fabs(high->h - low->h) <= tol;
        if (flat ? !low_inside : i == j) *low = *high;
        return 1;
    }
    if (!low_inside) *low = take_cut(f, i, arm, w, 0);
    if (!high_inside) *high = take_cut(f, i, arm, w, 1);
    return 2;
}

static inline void put(const face *f, const candidate *c, int flipped, carom_contact_point *out)
{
    crm_edge_point at;
    at.arm = c->arm;
    at.h = c->h;
    crm_put_point(f->ref, f->d, &at, f->p->radius, f->q->radius, flipped, out);
    out->recipe.ref = f->k;
    out->recipe.inc = c->inc;
    out->recipe.kernel = c->kernel;
    out->recipe.flipped = (unsigned char)flipped;
    out->recipe.at_end = c->at_end;
}

/* A round vertex over the face, or an edge. */
static inline carom_manifold face_manifold(const crm_placed *p, int k, const crm_placed *q, int j,
                                           const crm_closest *c, int flipped, double margin)
{
    const double radii = p->radius + q->radius;
    const face f = {&c->ref, p, q, k, crm_sub(q->at, p->at), crm_arm(p, k)};
    candidate low;
    candidate high;
    int n = 1;
    if (q->n == 1) {
        low = high = take_vertex(&f, 0, crm_arm(q, 0));
    } else {
        n = clip(&f, j, &low, &high);
    }
    const int high_is_deeper = n == 2 && high.h < low.h;
    const int both = n == 2 && (high_is_deeper ? low.h : high.h) - radii <= margin;
    carom_manifold m;
    m.normal = flipped ? crm_neg(c->ref.m) : c->ref.m;
    m.distance = c->gap - radii;
    m.count = 1 + both;
    m.ambiguous = c->tied;
    if (both) {
        put(&f, &low, flipped, &m.points[0]);
        put(&f, &high, flipped, &m.points[1]);
    } else {
        if (high_is_deeper) low = high;
        put(&f, &low, flipped, &m.points[0]);
        crm_clear_point(&m.points[1]);
    }
    return m;
}

static carom_manifold vertex_manifold(const crm_placed *a, const crm_placed *b,
                                      const crm_closest *c, double distance)
{
    const carom_recipe r = {c->a, c->b, CAROM_POINT_POINT, 0, 0};
    carom_vec2 normal;
    const carom_contact_point p = crm_contact_at(a, b, r, &normal);
    carom_manifold m;
    m.normal = normal;
    m.distance = distance;
    m.count = 1;
    m.ambiguous = c->tied;
    m.points[0] = p;
    crm_clear_point(&m.points[1]);
    return m;
}

carom_manifold crm_manifold_of(const crm_placed *a, const crm_placed *b, const crm_closest *c,
                               double margin)
{
    const double distance = c->gap - (a->radius + b->radius);
    if (!(distance <= margin)) return crm_no_contact(distance);
    if (c->kind == CRM_VERTICES) return vertex_manifold(a, b, c, distance);
    const int on_b = c->kind == CRM_FACE_B;
    return face_manifold(on_b ? b : a, on_b ? c->b : c->a, on_b ? a : b, on_b ? c->a : c->b, c,
                         on_b, margin);
}

void crm_features(const crm_placed *a, const crm_placed *b, double reach, double slack,
                  crm_closest *out)
{
    if (a->n > 1 || b->n > 1) {
        const crm_search how = {reach, slack, CRM_GJK_MIN_VERTICES};
        crm_closest_features(a, b, &how, out);
        return;
    }
    out->kind = CRM_VERTICES;
    out->a = out->b = 0;
    out->gap = crm_length(crm_between(a, 0, b, 0));
    out->tied = !(out->gap > 0);
    out->lead = 0;
}
