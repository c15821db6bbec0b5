/* kernels.h: the contact kernels on placed shapes, docs/math/equations.md (40)-(43) with a radius
 * on either side, in terms of the arms (vertices relative to their own body):
 *
 *   point-point   u = D + b - a, l = |u|, n = u / l;  gap = l - ra - rb
 *                 arm_a = a + ra n,  arm_b = b - rb n
 *   edge-point    e the edge from arm a, m its unit normal, x = D + q - a, h = m . x;
 *                 gap = h - rp - rq;  arm_p = q + D - (h - rp) m,  arm_q = q - rq m
 *   clipped       N = e . (c - i - D), w the incident edge from arm i, tau = N / (e . w);
 *                 then edge-point with q = i + tau w
 *
 * D = position of the second shape - position of the first. */
#ifndef CRM_KERNELS_H
#define CRM_KERNELS_H

#include "collide/placed.h"

/* Reference shape p, incident shape q. */
typedef struct crm_edge_point {
    carom_vec2 arm; /* the incident point, relative to q's body */
    carom_vec2 x;   /* from the start of the edge to the incident point */
    double h;
    /* clipped only */
    carom_vec2 w;   /* incident edge */
    carom_vec2 cut; /* c - i - D */
    double tau;
    double slope; /* e . w */
} crm_edge_point;

/* start: arm of the edge's start. */
static inline void crm_set_point(const crm_reference *ref, carom_vec2 d, carom_vec2 start,
                                 carom_vec2 arm, crm_edge_point *k)
{
    k->arm = arm;
    k->x = crm_add(d, crm_sub(arm, start));
    k->h = crm_dot(ref->m, k->x);
}

/* i: arm of the incident edge's start, w that edge, c: arm of the cutting end. */
static inline void crm_set_cut(const crm_reference *ref, carom_vec2 d, carom_vec2 start,
                               carom_vec2 i, carom_vec2 w, carom_vec2 c, crm_edge_point *k)
{
    k->w = w;
    k->cut = crm_sub(crm_sub(c, i), d);
    k->slope = crm_dot(ref->e, w);
    k->tau = k->slope != 0 ? crm_dot(ref->e, k->cut) / k->slope : 0.0;
    crm_set_point(ref, d, start, crm_add_scaled(i, k->tau, w), k);
}

/* All but the recipe. */
static inline void crm_put_point(const crm_reference *ref, carom_vec2 d, const crm_edge_point *k,
                                 double rp, double rq, int flipped, carom_contact_point *out)
{
    const carom_vec2 arm_p = crm_add_scaled(crm_add(k->arm, d), rp - k->h, ref->m);
    const carom_vec2 arm_q = crm_add_scaled(k->arm, -rq, ref->m);
    out->arm_a = flipped ? arm_q : arm_p;
    out->arm_b = flipped ? arm_p : arm_q;
    out->gap = k->h - (rp + rq);
}

carom_contact_point crm_contact_at(const crm_placed *a, const crm_placed *b, carom_recipe recipe,
                                   carom_vec2 *normal);

#endif
