/* chain.c: one link of a chain against a shape.
 *
 * The link is collided as a segment of two edges, and its answer is kept when its normal is the
 * link's to give: the link's own, or at a convex joint one between the two links' normals.  Where
 * the chain is convex, any other normal is the neighbor's business.  Where it is straight or
 * concave there is no corner to hit: the link answers along its own normal with what is over it. */
#include "carom/chain.h"

#include "collide/kernels.h"
#include "collide/manifold.h"

/* Angles below this are rounding [rad]. */
static const double ANGLE_TOL = 1e-12;

int carom_chain_links(const carom_chain *chain)
{
    return chain->closed ? chain->count : chain->count - 1;
}

carom_shape carom_chain_shape(const carom_chain *chain)
{
    const carom_shape s = {chain->radius, chain->count, chain->vertices};
    return s;
}

typedef struct link_view {
    crm_placed p; /* two vertices: v */
    carom_vec2 v[2];
    int index[2];         /* of them in the chain */
    int joined[2];        /* a link ends at vertex 0, one starts at vertex 1 */
    carom_vec2 normal;    /* pair frame, as long as the link */
    carom_vec2 border[2]; /* of the normals at the vertex: clockwise of `normal` at 0, else at 1 */
    int convex[2];        /* the chain turns left there, or ends */
} link_view;

/* Direction of the link from vertex i to the next, pair frame. */
static carom_vec2 direction(const carom_chain *chain, const crm_placed *p, int i)
{
    const int n = chain->count;
    const int j = (i + n) % n;
    return crm_turn(p, crm_sub(chain->vertices[(j + 1) % n], chain->vertices[j]));
}

static int turns_left(carom_vec2 from, carom_vec2 to)
{
    return crm_cross(from, to) > ANGLE_TOL * crm_length(from) * crm_length(to);
}

static void view_link(const carom_chain *chain, int link, const carom_frame *f, link_view *k)
{
    const int n = chain->count;
    const carom_shape whole = carom_chain_shape(chain);
    k->index[0] = link;
    k->index[1] = (link + 1) % n;
    k->v[0] = chain->vertices[k->index[0]];
    k->v[1] = chain->vertices[k->index[1]];
    k->p = crm_place(&whole, f, crm_vec(0, 0));
    k->joined[0] = chain->closed || link > 0;
    k->joined[1] = chain->closed || link + 2 < n;
    k->p.v = k->v;
    k->p.n = 2;
    const carom_vec2 e = crm_edge(&k->p, 0);
    const carom_vec2 before = direction(chain, &k->p, link - 1);
    const carom_vec2 after = direction(chain, &k->p, link + 1);
    k->normal = crm_right(e);
    /* At an end of the chain the normals go on to a right angle. */
    k->border[0] = k->joined[0] ? crm_right(before) : crm_neg(e);
    k->border[1] = k->joined[1] ? crm_right(after) : e;
    k->convex[0] = !k->joined[0] || turns_left(before, e);
    k->convex[1] = !k->joined[1] || turns_left(e, after);
}

/* n (unit) lies between low and high, counterclockwise. */
static int between(carom_vec2 low, carom_vec2 n, carom_vec2 high)
{
    return crm_cross(low, n) >= -ANGLE_TOL * crm_length(low) &&
           crm_cross(n, high) >= -ANGLE_TOL * crm_length(high);
}

static int may_give(const link_view *k, int vertex, carom_vec2 n)
{
    return vertex ? between(k->normal, n, k->border[1]) : between(k->border[0], n, k->normal);
}

static carom_vec2 mean_of(const crm_placed *b)
{
    carom_vec2 sum = {0, 0};
    for (int i = 0; i < b->n; i++) sum = crm_add(sum, b->v[i]);
    return crm_add(b->at, crm_turn(b, crm_scale(1.0 / b->n, sum)));
}

/* The mean of b's vertices is behind the line across u through the link's start. */
static int is_behind(const link_view *k, const crm_placed *b, carom_vec2 u)
{
    return crm_dot(u, crm_sub(mean_of(b), crm_arm(&k->p, 0))) < 0;
}

static void drop_point(carom_manifold *m, int i)
{
    m->points[i] = m->points[m->count - 1];
    m->count--;
}

/* The point at a joint is reported by the link that starts there. */
static void drop_joint(const link_view *k, carom_manifold *m)
{
    for (int i = m->count - 1; i >= 0; i--) {
        const carom_recipe r = m->points[i].recipe;
        const int at_1 = r.kernel == CAROM_POINT_POINT
                             ? r.ref == 1
                             : r.flipped && r.kernel == CAROM_EDGE_VERTEX && r.inc == 1;
        if (at_1 && k->joined[1]) drop_point(m, i);
    }
}

/* A lone vertex of b past an end of the link. */
static int is_off(const link_view *k, const crm_placed *b, const carom_manifold *m)
{
    if (m->count != 1 || m->points[0].recipe.kernel != CAROM_EDGE_VERTEX) return 0;
    const int j = m->points[0].recipe.inc;
    const carom_vec2 e = crm_edge(&k->p, 0);
    const double u = crm_dot(e, crm_between(&k->p, 0, b, j));
    const double tol = crm_noise(&k->p, 0, b, j) * crm_length(e);
    return u < -tol || u > crm_dot(e, e) + tol;
}

/* Along the link's own normal: what of b is over it. */
static void over_face(const link_view *k, const crm_placed *b, carom_manifold *out)
{
    crm_closest c;
    crm_face_at(&k->p, 0, b, crm_support(b, crm_neg(k->normal)), 0, &c);
    *out = crm_manifold_of(&k->p, b, &c, HUGE_VAL);
    if (is_off(k, b, out)) out->count = 0;
}

static void answer(const link_view *k, const crm_placed *b, const crm_closest *c,
                   carom_manifold *out)
{
    const int behind = is_behind(k, b, k->normal);
    if (behind) {
        /* At a sharp convex start it may still be in front of the link before. */
        const int beside = c->kind != CRM_FACE_A && c->a == 0 && k->joined[0] && k->convex[0];
        if (!beside || is_behind(k, b, k->border[0])) return;
    }
    const int straight = c->kind != CRM_FACE_A && !k->convex[c->a];
    if (straight || (c->kind == CRM_FACE_A && c->a == 1)) {
        over_face(k, b, out);
        return;
    }
    *out = crm_manifold_of(&k->p, b, c, HUGE_VAL);
    if (c->kind == CRM_FACE_A) return;
    if (!may_give(k, c->a, out->normal)) out->count = 0;
    drop_joint(k, out);
}

/* Recipes of the link become recipes of the chain. */
static carom_recipe of_chain(const link_view *k, carom_recipe r)
{
    int *on_link = r.flipped ? &r.inc : &r.ref;
    const int is_vertex = r.flipped ? r.kernel == CAROM_EDGE_VERTEX : r.kernel == CAROM_POINT_POINT;
    /* Edge 1 is edge 0 from behind: the same line, cut at the same point. */
    *on_link = is_vertex ? k->index[*on_link] : k->index[0];
    return r;
}

/* Recipes and points of the whole chain, within the margin. */
static void move_to_chain(const carom_chain *chain, const link_view *k, const carom_frame *frame,
                          const crm_placed *b, double margin, carom_manifold *m)
{
    const carom_shape whole = carom_chain_shape(chain);
    const crm_placed a = crm_place(&whole, frame, crm_vec(0, 0));
    const int n = m->count;
    m->count = 0;
    m->distance = HUGE_VAL;
    for (int i = 0; i < n; i++) {
        const carom_recipe r = of_chain(k, m->points[i].recipe);
        const carom_contact_point p = crm_contact_at(&a, b, r, &m->normal);
        if (p.gap < m->distance) m->distance = p.gap;
        if (p.gap <= margin) m->points[m->count++] = p;
    }
}

carom_box carom_chain_box(const carom_chain *chain, int link, carom_pose pose)
{
    const carom_vec2 v[2] = {chain->vertices[link], chain->vertices[(link + 1) % chain->count]};
    const carom_shape segment = {chain->radius, 2, v};
    return carom_shape_box(&segment, pose);
}

carom_manifold carom_collide_chain(const carom_chain *chain, int link, carom_pose pose_a,
                                   const carom_shape *b, carom_pose pose_b, double margin)
{
    link_view k;
    const carom_frame fa = carom_frame_at(pose_a);
    const carom_frame fb = carom_frame_at(pose_b);
    view_link(chain, link, &fa, &k);
    const crm_placed pb = crm_place(b, &fb, crm_vec(fb.x - fa.x, fb.y - fa.y));
    const double radii = chain->radius + b->radius;
    crm_closest c;
    crm_features(&k.p, &pb, margin + radii, 0, &c);
    if (c.kind == CRM_APART) return crm_no_contact(c.gap - radii);
    carom_manifold m = crm_no_contact(HUGE_VAL);
    answer(&k, &pb, &c, &m);
    move_to_chain(chain, &k, &fa, &pb, margin, &m);
    return m;
}
