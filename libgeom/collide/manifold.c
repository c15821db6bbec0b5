/* manifold.c: recipes of the contact points at the closest features. */
#include "collide/manifold.h"

#include "collide/kernels.h"

/* Cosine of the angle between an incident edge and the reference edge below which a cut is steep.
 */
static const double STEEP = 1e-3;

static carom_recipe recipe_of(carom_kernel kernel, int ref, int inc, int flipped)
{
    carom_recipe r;
    r.ref = ref;
    r.inc = inc;
    r.kernel = (unsigned char)kernel;
    r.flipped = (unsigned char)flipped;
    r.at_end = 0;
    return r;
}

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

/* Edge k of p with its reference, vertex j of q closest to it.  Let the incident edge of q, which
 * runs against k, reach from `low` to `high` along k.  A steep one that only grazes the plane
 * through an end of k is not cut: the cut would be anywhere on it.  Nor is the closest vertex cut
 * off for being past that plane by rounding.  Writes one or two recipes. */
static int face_recipes(const crm_reference *ref, const crm_placed *p, int k, const crm_placed *q,
                        int j, int flipped, carom_recipe out[2])
{
    out[0] = recipe_of(CAROM_EDGE_VERTEX, k, j, flipped);
    if (q->n == 1) return 1;
    const int i = opposite_edge(q, j, ref->m);
    const int i1 = crm_next(q, i);
    const carom_vec2 x1 = crm_between(p, k, q, i1);
    const carom_vec2 x = crm_between(p, k, q, i);
    const double low = crm_dot(ref->t, x1);
    const double high = crm_dot(ref->t, x);
    const carom_vec2 w = crm_sub(q->v[i1], q->v[i]);
    const double tol = crm_noise(p, k, q, j);
    const double run = high - low;
    const double slack = run < 0 || run * run < STEEP * STEEP * crm_dot(w, w) ? tol : 0;
    const int low_inside = low >= -(i1 == j ? tol : slack);
    const int high_inside = high <= ref->length + (i == j ? tol : slack);
    if ((!low_inside && high < slack) || (!high_inside && low > ref->length - slack)) {
        /* Nothing but a vertex over k: of an incident edge along the face the nearer one. */
        const double rise = crm_dot(ref->m, x) - crm_dot(ref->m, x1);
        if (fabs(rise) <= tol) out[0].inc = low_inside ? i1 : i;
        return 1;
    }
    out[0] = low_inside ? recipe_of(CAROM_EDGE_VERTEX, k, i1, flipped)
                        : recipe_of(CAROM_EDGE_CLIPPED, k, i, flipped);
    out[1] = high_inside ? recipe_of(CAROM_EDGE_VERTEX, k, i, flipped)
                         : recipe_of(CAROM_EDGE_CLIPPED, k, i, flipped);
    out[1].at_end = !high_inside;
    return 2;
}

carom_manifold crm_no_contact(double distance)
{
    const carom_manifold m = {{0, 0}, distance, 0, 0, {{{0, 0}, {0, 0}, 0, {0, 0, 0, 0, 0}}}};
    return m;
}

carom_manifold crm_manifold_of(const crm_placed *a, const crm_placed *b, const crm_closest *c)
{
    carom_manifold m = crm_no_contact(c->gap - (a->radius + b->radius));
    carom_recipe recipe[2];
    m.ambiguous = c->tied;
    m.count = 1;
    if (c->kind == CRM_VERTICES) {
        recipe[0] = recipe_of(CAROM_POINT_POINT, c->a, c->b, 0);
        m.points[0] = crm_contact_at(a, b, recipe[0], &m.normal);
        return m;
    }
    m.count = c->kind == CRM_FACE_A ? face_recipes(&c->ref, a, c->a, b, c->b, 0, recipe)
                                    : face_recipes(&c->ref, b, c->b, a, c->a, 1, recipe);
    for (int i = 0; i < m.count; i++) {
        m.points[i] = crm_contact_on(&c->ref, a, b, recipe[i], &m.normal);
    }
    return m;
}

void crm_keep_within(carom_manifold *m, double margin)
{
    if (m->count == 2) {
        const int deepest = m->points[1].gap < m->points[0].gap;
        if (!(m->points[1 - deepest].gap <= margin)) {
            m->points[0] = m->points[deepest];
            m->count = 1;
        }
    }
    if (!(m->distance <= margin)) m->count = 0;
}

crm_closest crm_features(const crm_placed *a, const crm_placed *b, double reach)
{
    if (a->n > 1 || b->n > 1) return crm_closest_features(a, b, reach, CRM_GJK_MIN_VERTICES);
    crm_closest c;
    c.kind = CRM_VERTICES;
    c.a = c.b = 0;
    c.gap = crm_length(crm_between(a, 0, b, 0));
    c.tied = !(c.gap > 0);
    return c;
}
