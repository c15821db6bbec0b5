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

/* The edge of q at its vertex j that looks most against the normal m; of equal ones the first. */
static int opposite_edge(const crm_placed *q, int j, carom_vec2 m)
{
    const int before = crm_prev(q, j);
    const carom_vec2 u = crm_normal(q, before);
    const carom_vec2 v = crm_normal(q, j);
    const double cos_u = crm_dot(m, u) * crm_length(v);
    const double cos_v = crm_dot(m, v) * crm_length(u);
    if (cos_u == cos_v) return before < j ? before : j;
    return cos_u < cos_v ? before : j;
}

/* Let the incident edge of q, which runs against k, reach from `low` to `high` along k.  A steep
 * one that only grazes the plane through an end of k is not cut: the cut would be anywhere on it.
 * Nor is the closest vertex cut off for being past that plane by rounding. */
int crm_face_recipes(const crm_placed *p, int k, const crm_placed *q, int j, int flipped,
                     carom_recipe out[2])
{
    out[0] = recipe_of(CAROM_EDGE_VERTEX, k, j, flipped);
    if (q->n == 1) return 1;
    const carom_vec2 e = crm_edge(p, k);
    const double length = crm_length(e);
    const carom_vec2 t = crm_scale(1.0 / length, e);
    const int i = opposite_edge(q, j, crm_right(t));
    const int i1 = crm_next(q, i);
    const double low = crm_dot(t, crm_between(p, k, q, i1));
    const double high = crm_dot(t, crm_between(p, k, q, i));
    const double tol = crm_noise(p, k, q, j);
    const double slack = high - low < STEEP * crm_length(crm_edge(q, i)) ? tol : 0;
    const int low_inside = low >= -(i1 == j ? tol : slack);
    const int high_inside = high <= length + (i == j ? tol : slack);
    if ((!low_inside && high < slack) || (!high_inside && low > length - slack)) {
        /* Nothing but a vertex over k: of an incident edge along the face the nearer one. */
        const double rise = crm_height(p, k, q, i) - crm_height(p, k, q, i1);
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
    if (c->kind == CRM_FACE_A) {
        m.count = crm_face_recipes(a, c->a, b, c->b, 0, recipe);
    } else if (c->kind == CRM_FACE_B) {
        m.count = crm_face_recipes(b, c->b, a, c->a, 1, recipe);
    } else {
        recipe[0] = recipe_of(CAROM_POINT_POINT, c->a, c->b, 0);
    }
    for (int i = 0; i < m.count; i++) {
        m.points[i] = crm_contact_at(a, b, recipe[i], &m.normal);
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
    const double l = crm_length(crm_between(a, 0, b, 0));
    const crm_closest c = {CRM_VERTICES, 0, 0, !(l > 0), l};
    return c;
}
