/* manifold.c: contact points and their recipes at the closest features. */
#include "collide/manifold.h"

#include "collide/kernels.h"

#include <string.h>

/* Cosine of the angle between an incident edge and the reference edge below which a cut is steep.
 */
static const double STEEP = 1e-3;

/* A candidate for a contact point. */
typedef struct candidate {
    crm_edge_point at;
    int inc;
    int kernel;
    int at_end;
} candidate;

/* cos(m, u) |cos(m, u)| times |u|^2 |v|^2: in the order of the cosines, without a root. */
static double cosine_key(carom_vec2 m, carom_vec2 u, carom_vec2 v)
{
    const double c = crm_dot(m, u);
    return c * fabs(c) * crm_dot(v, v);
}

/* The edge of q at its vertex j that looks most against the normal m; of equal ones the first. */
static int opposite_edge(const crm_placed *q, int j, carom_vec2 m)
{
    const int before = crm_prev(q, j);
    const carom_vec2 u = crm_normal(q, before);
    const carom_vec2 v = crm_normal(q, j);
    const double cos_u = cosine_key(m, u, v);
    const double cos_v = cosine_key(m, v, u);
    if (cos_u == cos_v) return before < j ? before : j;
    return cos_u < cos_v ? before : j;
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

static void take_vertex(const face *f, int j, carom_vec2 arm, candidate *out)
{
    out->inc = j;
    out->kernel = CAROM_EDGE_VERTEX;
    out->at_end = 0;
    crm_set_point(f->ref, f->d, f->start, arm, &out->at);
}

static void take_cut(const face *f, int i, carom_vec2 arm, int at_end, candidate *out)
{
    const carom_vec2 c = at_end ? crm_arm(f->p, crm_next(f->p, f->k)) : f->start;
    out->inc = i;
    out->kernel = CAROM_EDGE_CLIPPED;
    out->at_end = at_end;
    crm_set_cut(f->ref, f->d, f->start, arm, crm_edge(f->q, i), c, &out->at);
}

/* Vertex j of q is closest to the face.  Let the incident edge of q, which runs against k, reach
 * from `low` to `high` along k.  A steep one that only grazes the plane through an end of k is not
 * cut: the cut would be anywhere on it.  Nor is the closest vertex cut off for being past that
 * plane by rounding. One or two candidates. */
static int clip(const face *f, int j, candidate out[2])
{
    const crm_placed *q = f->q;
    if (q->n == 1) {
        take_vertex(f, 0, crm_arm(q, 0), &out[0]);
        return 1;
    }
    const int i = opposite_edge(q, j, f->ref->m);
    const int i1 = crm_next(q, i);
    const carom_vec2 arm = crm_arm(q, i);
    const carom_vec2 arm1 = crm_arm(q, i1);
    take_vertex(f, i1, arm1, &out[0]);
    take_vertex(f, i, arm, &out[1]);
    const double low = crm_dot(f->ref->t, out[0].at.x);
    const double high = crm_dot(f->ref->t, out[1].at.x);
    const double length = f->ref->length;
    const carom_vec2 w = crm_sub(q->v[i1], q->v[i]);
    const double tol = crm_noise(f->p, f->k, q, j);
    const double run = high - low;
    const double slack = run < 0 || run * run < STEEP * STEEP * crm_dot(w, w) ? tol : 0;
    const int low_inside = low >= -(i1 == j ? tol : slack);
    const int high_inside = high <= length + (i == j ? tol : slack);
    if ((!low_inside && high < slack) || (!high_inside && low > length - slack)) {
        /* Nothing but a vertex over k: of an incident edge along the face the nearer one. */
        const int flat = fabs(out[1].at.h - out[0].at.h) <= tol;
        if (flat ? !low_inside : i == j) out[0] = out[1];
        return 1;
    }
    if (!low_inside) take_cut(f, i, arm, 0, &out[0]);
    if (!high_inside) take_cut(f, i, arm, 1, &out[1]);
    return 2;
}

static void put(const face *f, const candidate *c, int flipped, carom_contact_point *out)
{
    crm_put_point(f->ref, f->d, &c->at, f->p->radius, f->q->radius, flipped, out);
    out->recipe.ref = f->k;
    out->recipe.inc = c->inc;
    out->recipe.kernel = (unsigned char)c->kernel;
    out->recipe.flipped = (unsigned char)flipped;
    out->recipe.at_end = (unsigned char)c->at_end;
}

static void face_points(const crm_placed *p, int k, const crm_placed *q, int j,
                        const crm_closest *c, int flipped, double margin, carom_manifold *out)
{
    const face f = {&c->ref, p, q, k, crm_sub(q->at, p->at), crm_arm(p, k)};
    const double radii = p->radius + q->radius;
    candidate at[2];
    const int n = clip(&f, j, at);
    const int deepest = n == 2 && at[1].at.h < at[0].at.h;
    out->normal = flipped ? crm_neg(c->ref.m) : c->ref.m;
    out->count = 1;
    if (n == 2 && at[1 - deepest].at.h - radii <= margin) {
        put(&f, &at[0], flipped, &out->points[0]);
        put(&f, &at[1], flipped, &out->points[1]);
        out->count = 2;
    } else {
        put(&f, &at[deepest], flipped, &out->points[0]);
    }
}

carom_manifold crm_no_contact(double distance)
{
    carom_manifold m;
    memset(&m, 0, sizeof m);
    m.distance = distance;
    return m;
}

void crm_manifold_of(const crm_placed *a, const crm_placed *b, const crm_closest *c, double margin,
                     carom_manifold *out)
{
    memset(out, 0, sizeof *out);
    out->distance = c->gap - (a->radius + b->radius);
    if (!(out->distance <= margin)) return;
    out->ambiguous = c->tied;
    if (c->kind == CRM_FACE_A) {
        face_points(a, c->a, b, c->b, c, 0, margin, out);
    } else if (c->kind == CRM_FACE_B) {
        face_points(b, c->b, a, c->a, c, 1, margin, out);
    } else {
        const carom_recipe r = {c->a, c->b, CAROM_POINT_POINT, 0, 0};
        out->count = 1;
        out->points[0] = crm_contact_at(a, b, r, &out->normal);
    }
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
