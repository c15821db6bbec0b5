/* collide.c: from the closest features to the contact points. */
#include "carom/collide.h"

#include "collide/closest.h"
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

/* Edge k of p, vertex j of q closest to it.  Writes one or two recipes.  Let the incident edge of
 * q, which runs against k, reach from `low` to `high` along k.  A vertex within rounding of the
 * plane through an end of k counts as inside: where the incident edge is square to k, the cut would
 * be anywhere on it. */
static int clip_recipes(const crm_placed *p, int k, const crm_placed *q, int j, int flipped,
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

static int recipes_of(const crm_placed *a, const crm_placed *b, const crm_closest *c,
                      carom_recipe out[2])
{
    if (c->kind == CRM_FACE_A) return clip_recipes(a, c->a, b, c->b, 0, out);
    if (c->kind == CRM_FACE_B) return clip_recipes(b, c->b, a, c->a, 1, out);
    out[0] = recipe_of(CAROM_POINT_POINT, c->a, c->b, 0);
    return 1;
}

/* Keeps the points within the margin; the deepest one whenever the distance itself is within. */
static void keep_points(carom_manifold *m, int n, double margin)
{
    if (n == 2) {
        const int deepest = m->points[1].gap < m->points[0].gap;
        const int other = 1 - deepest;
        if (!(m->points[other].gap <= margin)) {
            m->points[0] = m->points[deepest];
            n = 1;
        }
    }
    m->count = m->distance <= margin ? n : 0;
}

static crm_closest closest_points(const crm_placed *a, const crm_placed *b)
{
    const double l = crm_length(crm_between(a, 0, b, 0));
    const crm_closest c = {CRM_VERTICES, 0, 0, !(l > 0), l};
    return c;
}

carom_manifold carom_collide(const carom_shape *a, carom_pose pose_a, const carom_shape *b,
                             carom_pose pose_b, double margin)
{
    const crm_placed pa = crm_place(a, pose_a.angle, crm_vec(0, 0));
    const crm_placed pb =
        crm_place(b, pose_b.angle, crm_vec(pose_b.x - pose_a.x, pose_b.y - pose_a.y));
    const double radii = a->radius + b->radius;
    const crm_closest c = pa.n == 1 && pb.n == 1 ? closest_points(&pa, &pb)
                                                 : crm_closest_features(&pa, &pb, margin + radii,
                                                                        CRM_GJK_MIN_VERTICES);
    carom_manifold m = {{0, 0}, c.gap - radii, 0, c.tied, {{{0, 0}, {0, 0}, 0, {0, 0, 0, 0, 0}}}};
    if (c.kind == CRM_APART) {
        return m;
    }
    carom_recipe recipes[2];
    const int n = recipes_of(&pa, &pb, &c, recipes);
    for (int i = 0; i < n; i++) m.points[i] = crm_contact_at(&pa, &pb, recipes[i], &m.normal);
    keep_points(&m, n, margin);
    return m;
}
