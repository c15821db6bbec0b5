/* kernels.c: contact points from their recipes; reverse and forward derivatives. */
#include "collide/kernels.h"

#include <assert.h>
#include <string.h>

typedef struct point_point {
    carom_vec2 n;
    double l;
} point_point;

static point_point point_point_at(carom_vec2 u)
{
    const double l = crm_length(u);
    const point_point k = {l > 0 ? crm_scale(1.0 / l, u) : crm_vec(1, 0), l};
    return k;
}

/* Reference shape p, incident shape q, and their point. */
typedef struct edge_point {
    const crm_placed *p;
    const crm_placed *q;
    carom_vec2 d; /* position of q - position of p */
    crm_reference ref;
    crm_edge_point at;
} edge_point;

static void see_edge_point(const crm_placed *p, const crm_placed *q, carom_recipe r, edge_point *k)
{
    const carom_vec2 start = crm_arm(p, r.ref);
    const carom_vec2 i = crm_arm(q, r.inc);
    memset(k, 0, sizeof *k);
    k->p = p;
    k->q = q;
    k->d = crm_sub(q->at, p->at);
    k->ref = crm_reference_at(p, r.ref);
    if (r.kernel == CAROM_EDGE_CLIPPED) {
        const carom_vec2 c = r.at_end ? crm_arm(p, crm_next(p, r.ref)) : start;
        crm_set_cut(&k->ref, k->d, start, i, crm_edge(q, r.inc), c, &k->at);
    } else {
        crm_set_point(&k->ref, k->d, start, i, &k->at);
    }
}

static carom_contact_point eval_point_point(const crm_placed *a, const crm_placed *b,
                                            carom_recipe r, carom_vec2 *normal)
{
    const point_point k = point_point_at(crm_between(a, r.ref, b, r.inc));
    carom_contact_point out;
    *normal = k.n;
    out.arm_a = crm_add_scaled(crm_arm(a, r.ref), a->radius, k.n);
    out.arm_b = crm_add_scaled(crm_arm(b, r.inc), -b->radius, k.n);
    out.gap = k.l - (a->radius + b->radius);
    out.recipe = r;
    return out;
}

carom_contact_point crm_contact_at(const crm_placed *a, const crm_placed *b, carom_recipe r,
                                   carom_vec2 *normal)
{
    assert(r.ref >= 0 && r.ref < (r.flipped ? b->n : a->n));
    assert(r.inc >= 0 && r.inc < (r.flipped ? a->n : b->n));
    if (r.kernel == CAROM_POINT_POINT) return eval_point_point(a, b, r, normal);
    edge_point k;
    carom_contact_point out;
    see_edge_point(r.flipped ? b : a, r.flipped ? a : b, r, &k);
    crm_put_point(&k.ref, k.d, &k.at, k.p->radius, k.q->radius, r.flipped, &out);
    out.recipe = r;
    *normal = r.flipped ? crm_neg(k.ref.m) : k.ref.m;
    return out;
}

/* x = R v for a vertex or an edge: adds x_bar to the cotangents of the angle and of v. */
static void turn_vjp(const crm_placed *p, carom_vec2 x, carom_vec2 x_bar, double *angle_bar,
                     carom_vec2 *v_bar)
{
    *angle_bar += crm_cross(x, x_bar);
    if (v_bar) *v_bar = crm_add(*v_bar, crm_turn_back(p, x_bar));
}

static void arm_vjp(const crm_placed *p, int i, carom_vec2 x_bar, carom_shape_bar *bar)
{
    turn_vjp(p, crm_arm(p, i), x_bar, &bar->pose.angle, bar->vertices ? bar->vertices + i : NULL);
}

static void edge_vjp(const crm_placed *p, int k, carom_vec2 e_bar, carom_shape_bar *bar)
{
    turn_vjp(p, crm_edge(p, k), e_bar, &bar->pose.angle,
             bar->vertices ? bar->vertices + crm_next(p, k) : NULL);
    if (bar->vertices) {
        bar->vertices[k] = crm_sub(bar->vertices[k], crm_turn_back(p, e_bar));
    }
}

/* D = position of the second - position of the first. */
static void offset_vjp(carom_vec2 d_bar, carom_shape_bar *first, carom_shape_bar *second)
{
    first->pose.x -= d_bar.x;
    first->pose.y -= d_bar.y;
    second->pose.x += d_bar.x;
    second->pose.y += d_bar.y;
}

/* (41): N = n_bar + ra arm_a_bar - rb arm_b_bar,  u_bar = (N - n (n . N)) / l + gap_bar n. */
static void point_point_vjp(const crm_placed *a, const crm_placed *b, carom_recipe r,
                            const carom_contact_bar *g, carom_shape_bar *a_bar,
                            carom_shape_bar *b_bar)
{
    const point_point k = point_point_at(crm_between(a, r.ref, b, r.inc));
    const carom_vec2 n_bar =
        crm_add_scaled(crm_add_scaled(g->normal, a->radius, g->arm_a), -b->radius, g->arm_b);
    carom_vec2 u_bar = crm_scale(g->gap, k.n);
    if (k.l > 0) {
        const carom_vec2 across = crm_add_scaled(n_bar, -crm_dot(k.n, n_bar), k.n);
        u_bar = crm_add_scaled(u_bar, 1.0 / k.l, across);
    }
    arm_vjp(a, r.ref, crm_sub(g->arm_a, u_bar), a_bar);
    arm_vjp(b, r.inc, crm_add(g->arm_b, u_bar), b_bar);
    offset_vjp(u_bar, a_bar, b_bar);
    a_bar->radius += crm_dot(k.n, g->arm_a) - g->gap;
    b_bar->radius -= crm_dot(k.n, g->arm_b) + g->gap;
}

/* (43) in arms: q_bar is the cotangent of the clipped point.  Returns the edge's share of e_bar. */
static carom_vec2 clip_vjp(const edge_point *k, carom_recipe r, carom_vec2 q_bar,
                           carom_shape_bar *p_bar, carom_shape_bar *s_bar)
{
    const double tau_bar =
        k->at.slope != 0 ? crm_dot(q_bar, k->at.w) / k->at.slope : 0.0; /* = N_bar */
    const double slope_bar = -k->at.tau * tau_bar;
    const carom_vec2 cut_bar = crm_scale(tau_bar, k->ref.e);
    const carom_vec2 w_bar = crm_add_scaled(crm_scale(k->at.tau, q_bar), slope_bar, k->ref.e);
    arm_vjp(k->q, r.inc, crm_sub(q_bar, cut_bar), s_bar);
    edge_vjp(k->q, r.inc, w_bar, s_bar);
    arm_vjp(k->p, r.at_end ? crm_next(k->p, r.ref) : r.ref, cut_bar, p_bar);
    offset_vjp(crm_neg(cut_bar), p_bar, s_bar);
    return crm_add_scaled(crm_scale(tau_bar, k->at.cut), slope_bar, k->at.w);
}

/* (42) with both radii; g is seen from the reference shape: arm_a is on p, arm_b on q.
 *   h_bar = gap_bar - m . arm_p_bar
 *   m_bar = n_bar - (h - rp) arm_p_bar - rq arm_q_bar + h_bar x
 *   e_bar = -m (t . m_bar) / |e| */
static void edge_point_vjp(const edge_point *k, carom_recipe r, const carom_contact_bar *g,
                           carom_shape_bar *p_bar, carom_shape_bar *q_bar)
{
    const double h_bar = g->gap - crm_dot(k->ref.m, g->arm_a);
    carom_vec2 m_bar = crm_add_scaled(g->normal, k->p->radius - k->at.h, g->arm_a);
    m_bar = crm_add_scaled(m_bar, -k->q->radius, g->arm_b);
    m_bar = crm_add_scaled(m_bar, h_bar, k->at.x);
    carom_vec2 e_bar = crm_scale(-crm_dot(k->ref.t, m_bar) / k->ref.length, k->ref.m);
    const carom_vec2 d_bar = crm_add_scaled(g->arm_a, h_bar, k->ref.m);
    const carom_vec2 point_bar = crm_add(d_bar, g->arm_b);
    if (r.kernel == CAROM_EDGE_CLIPPED) {
        e_bar = crm_add(e_bar, clip_vjp(k, r, point_bar, p_bar, q_bar));
    } else {
        arm_vjp(k->q, r.inc, point_bar, q_bar);
    }
    arm_vjp(k->p, r.ref, crm_scale(-h_bar, k->ref.m), p_bar);
    edge_vjp(k->p, r.ref, e_bar, p_bar);
    offset_vjp(d_bar, p_bar, q_bar);
    p_bar->radius += crm_dot(k->ref.m, g->arm_a) - g->gap;
    q_bar->radius -= crm_dot(k->ref.m, g->arm_b) + g->gap;
}

static void place_pair(const carom_shape *a, carom_pose pose_a, const carom_shape *b,
                       carom_pose pose_b, crm_placed *pa, crm_placed *pb)
{
    const carom_frame fa = carom_frame_at(pose_a);
    const carom_frame fb = carom_frame_at(pose_b);
    *pa = crm_place(a, &fa, crm_vec(0, 0));
    *pb = crm_place(b, &fb, crm_vec(fb.x - fa.x, fb.y - fa.y));
}

carom_contact_point carom_contact_eval(const carom_shape *a, carom_pose pose_a,
                                       const carom_shape *b, carom_pose pose_b, carom_recipe recipe,
                                       carom_vec2 *normal)
{
    crm_placed pa;
    crm_placed pb;
    place_pair(a, pose_a, b, pose_b, &pa, &pb);
    return crm_contact_at(&pa, &pb, recipe, normal);
}

void carom_contact_vjp(const carom_shape *a, carom_pose pose_a, const carom_shape *b,
                       carom_pose pose_b, carom_recipe recipe, const carom_contact_bar *bar,
                       carom_shape_bar *a_bar, carom_shape_bar *b_bar)
{
    crm_placed pa;
    crm_placed pb;
    place_pair(a, pose_a, b, pose_b, &pa, &pb);
    if (recipe.kernel == CAROM_POINT_POINT) {
        point_point_vjp(&pa, &pb, recipe, bar, a_bar, b_bar);
        return;
    }
    const crm_placed *p = recipe.flipped ? &pb : &pa;
    const crm_placed *q = recipe.flipped ? &pa : &pb;
    edge_point k;
    see_edge_point(p, q, recipe, &k);
    if (recipe.flipped) {
        const carom_contact_bar g = {crm_neg(bar->normal), bar->arm_b, bar->arm_a, bar->gap};
        edge_point_vjp(&k, recipe, &g, b_bar, a_bar);
    } else {
        edge_point_vjp(&k, recipe, bar, a_bar, b_bar);
    }
}

/* R v moves by angle_dot left(R v) + R v_dot. */
static carom_vec2 arm_jvp(const crm_placed *p, int i, const carom_shape_dot *dot)
{
    const carom_vec2 turn = crm_scale(dot->pose.angle, crm_left(crm_arm(p, i)));
    return dot->vertices ? crm_add(turn, crm_turn(p, dot->vertices[i])) : turn;
}

static carom_vec2 edge_jvp(const crm_placed *p, int k, const carom_shape_dot *dot)
{
    const carom_vec2 turn = crm_scale(dot->pose.angle, crm_left(crm_edge(p, k)));
    if (!dot->vertices) return turn;
    const carom_vec2 e = crm_sub(dot->vertices[crm_next(p, k)], dot->vertices[k]);
    return crm_add(turn, crm_turn(p, e));
}

static carom_vec2 offset_jvp(const carom_shape_dot *first, const carom_shape_dot *second)
{
    return crm_vec(second->pose.x - first->pose.x, second->pose.y - first->pose.y);
}

static carom_contact_dot point_point_jvp(const crm_placed *a, const crm_placed *b, carom_recipe r,
                                         const carom_shape_dot *a_dot, const carom_shape_dot *b_dot)
{
    const point_point k = point_point_at(crm_between(a, r.ref, b, r.inc));
    const carom_vec2 arm_a = arm_jvp(a, r.ref, a_dot);
    const carom_vec2 arm_b = arm_jvp(b, r.inc, b_dot);
    const carom_vec2 u = crm_add(offset_jvp(a_dot, b_dot), crm_sub(arm_b, arm_a));
    const double l = crm_dot(k.n, u);
    const carom_vec2 across = crm_add_scaled(u, -l, k.n);
    carom_contact_dot out;
    out.normal = k.l > 0 ? crm_scale(1.0 / k.l, across) : crm_vec(0, 0);
    out.arm_a = crm_add_scaled(arm_a, a_dot->radius, k.n);
    out.arm_a = crm_add_scaled(out.arm_a, a->radius, out.normal);
    out.arm_b = crm_add_scaled(arm_b, -b_dot->radius, k.n);
    out.arm_b = crm_add_scaled(out.arm_b, -b->radius, out.normal);
    out.gap = l - (a_dot->radius + b_dot->radius);
    return out;
}

/* tau = N / slope: tau_dot = (N_dot - tau slope_dot) / slope. */
static carom_vec2 clip_jvp(const edge_point *k, carom_recipe r, carom_vec2 e_dot, carom_vec2 d_dot,
                           const carom_shape_dot *p_dot, const carom_shape_dot *q_dot)
{
    const int end = r.at_end ? crm_next(k->p, r.ref) : r.ref;
    const carom_vec2 i_dot = arm_jvp(k->q, r.inc, q_dot);
    const carom_vec2 w_dot = edge_jvp(k->q, r.inc, q_dot);
    const carom_vec2 cut_dot = crm_sub(crm_sub(arm_jvp(k->p, end, p_dot), i_dot), d_dot);
    const double n_dot = crm_dot(e_dot, k->at.cut) + crm_dot(k->ref.e, cut_dot);
    const double slope_dot = crm_dot(e_dot, k->at.w) + crm_dot(k->ref.e, w_dot);
    const double tau_dot = k->at.slope != 0 ? (n_dot - k->at.tau * slope_dot) / k->at.slope : 0.0;
    return crm_add(i_dot, crm_add_scaled(crm_scale(k->at.tau, w_dot), tau_dot, k->at.w));
}

/* Seen from the reference shape: arm_a is on p, arm_b on q. */
static carom_contact_dot edge_point_jvp(const edge_point *k, carom_recipe r,
                                        const carom_shape_dot *p_dot, const carom_shape_dot *q_dot)
{
    const carom_vec2 e_dot = edge_jvp(k->p, r.ref, p_dot);
    const carom_vec2 d_dot = offset_jvp(p_dot, q_dot);
    const carom_vec2 m_dot = crm_scale(-crm_dot(k->ref.m, e_dot) / k->ref.length, k->ref.t);
    const carom_vec2 arm_dot = r.kernel == CAROM_EDGE_CLIPPED
                                   ? clip_jvp(k, r, e_dot, d_dot, p_dot, q_dot)
                                   : arm_jvp(k->q, r.inc, q_dot);
    const carom_vec2 x_dot = crm_add(d_dot, crm_sub(arm_dot, arm_jvp(k->p, r.ref, p_dot)));
    const double h_dot = crm_dot(m_dot, k->at.x) + crm_dot(k->ref.m, x_dot);
    carom_contact_dot out;
    out.normal = m_dot;
    out.arm_a = crm_add_scaled(crm_add(arm_dot, d_dot), p_dot->radius - h_dot, k->ref.m);
    out.arm_a = crm_add_scaled(out.arm_a, k->p->radius - k->at.h, m_dot);
    out.arm_b = crm_add_scaled(arm_dot, -q_dot->radius, k->ref.m);
    out.arm_b = crm_add_scaled(out.arm_b, -k->q->radius, m_dot);
    out.gap = h_dot - (p_dot->radius + q_dot->radius);
    return out;
}

carom_contact_dot carom_contact_jvp(const carom_shape *a, carom_pose pose_a, const carom_shape *b,
                                    carom_pose pose_b, carom_recipe recipe,
                                    const carom_shape_dot *a_dot, const carom_shape_dot *b_dot)
{
    crm_placed pa;
    crm_placed pb;
    place_pair(a, pose_a, b, pose_b, &pa, &pb);
    if (recipe.kernel == CAROM_POINT_POINT) {
        return point_point_jvp(&pa, &pb, recipe, a_dot, b_dot);
    }
    edge_point k;
    if (!recipe.flipped) {
        see_edge_point(&pa, &pb, recipe, &k);
        return edge_point_jvp(&k, recipe, a_dot, b_dot);
    }
    see_edge_point(&pb, &pa, recipe, &k);
    const carom_contact_dot r = edge_point_jvp(&k, recipe, b_dot, a_dot);
    const carom_contact_dot out = {crm_neg(r.normal), r.arm_b, r.arm_a, r.gap};
    return out;
}
