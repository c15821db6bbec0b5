/* collide.c: the contact manifold of two shapes. */
#include "carom/collide.h"

#include "collide/manifold.h"

carom_frame carom_frame_at(carom_pose pose)
{
    const carom_frame f = {pose.x, pose.y, cos(pose.angle), sin(pose.angle)};
    return f;
}

/* Kinds of a cache: 0 is an empty one. */
enum { NOT_KNOWN, VERTICES, FACE_A, FACE_B };

/* The features of last time as an axis, with the support vertices of today. */
static crm_axis axis_from(const crm_placed *a, const crm_placed *b, const carom_pair_cache *cache)
{
    crm_axis x = {{0, 0}, cache->a, cache->b};
    if (cache->kind == VERTICES) {
        x.d = crm_between(a, x.a, b, x.b);
    } else if (cache->kind == FACE_A) {
        x.d = crm_normal(a, x.a);
    } else {
        x.d = crm_neg(crm_normal(b, x.b));
    }
    if (cache->kind != FACE_A) x.a = crm_climb(a, crm_turn_back(a, x.d), x.a);
    if (cache->kind != FACE_B) x.b = crm_climb(b, crm_turn_back(b, crm_neg(x.d)), x.b);
    return x;
}

static void keep_features(const crm_closest *c, carom_pair_cache *cache)
{
    cache->kind = c->kind == CRM_FACE_A ? FACE_A : c->kind == CRM_FACE_B ? FACE_B : VERTICES;
    cache->a = c->a;
    cache->b = c->b;
}

static void find_features(const crm_placed *a, const crm_placed *b, double reach,
                          carom_pair_cache *cache, crm_closest *out)
{
    if (!cache || (a->n == 1 && b->n == 1)) {
        crm_features(a, b, reach, out);
        return;
    }
    /* Indices that another pair left must not lead outside. */
    const int usable = cache->kind != NOT_KNOWN && cache->a < a->n && cache->b < b->n;
    if (!usable || !crm_closest_from(a, b, axis_from(a, b, cache), reach, out)) {
        crm_features(a, b, reach, out);
    }
    if (out->kind != CRM_APART) keep_features(out, cache);
}

carom_manifold carom_collide_frames(const carom_shape *a, const carom_frame *frame_a,
                                    const carom_shape *b, const carom_frame *frame_b, double margin,
                                    carom_pair_cache *cache)
{
    const crm_placed pa = crm_place(a, frame_a, crm_vec(0, 0));
    const crm_placed pb =
        crm_place(b, frame_b, crm_vec(frame_b->x - frame_a->x, frame_b->y - frame_a->y));
    const double radii = a->radius + b->radius;
    crm_closest c;
    carom_manifold m;
    find_features(&pa, &pb, margin + radii, cache, &c);
    if (c.kind == CRM_APART) return crm_no_contact(c.gap - radii);
    crm_manifold_of(&pa, &pb, &c, margin, &m);
    return m;
}

carom_manifold carom_collide(const carom_shape *a, carom_pose pose_a, const carom_shape *b,
                             carom_pose pose_b, double margin)
{
    const carom_frame fa = carom_frame_at(pose_a);
    const carom_frame fb = carom_frame_at(pose_b);
    return carom_collide_frames(a, &fa, b, &fb, margin, NULL);
}
