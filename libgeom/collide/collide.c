/* collide.c: the contact manifold of two shapes. */
#include "carom/collide.h"

#include "collide/cache.h"
#include "collide/manifold.h"

carom_frame carom_frame_at(carom_pose pose)
{
    const carom_frame f = {pose.x, pose.y, cos(pose.angle), sin(pose.angle)};
    return f;
}

carom_manifold carom_collide_frames(const carom_shape *a, const carom_frame *frame_a,
                                    const carom_shape *b, const carom_frame *frame_b, double margin,
                                    carom_pair_cache *cache)
{
    const double radii = a->radius + b->radius;
    double gap;
    if (cache && crm_still_beyond(frame_a, frame_b, margin + radii, cache, &gap)) {
        return crm_no_contact(gap - radii);
    }
    const crm_placed pa = crm_place(a, frame_a, crm_vec(0, 0));
    const crm_placed pb =
        crm_place(b, frame_b, crm_vec(frame_b->x - frame_a->x, frame_b->y - frame_a->y));
    crm_closest c;
    if (cache && pa.n + pb.n > 2) {
        crm_closest_cached(&pa, &pb, margin + radii, cache, &c);
    } else {
        crm_features(&pa, &pb, margin + radii, 0, &c);
    }
    if (c.kind == CRM_APART) return crm_no_contact(c.gap - radii);
    return crm_manifold_of(&pa, &pb, &c, margin);
}

carom_manifold carom_collide(const carom_shape *a, carom_pose pose_a, const carom_shape *b,
                             carom_pose pose_b, double margin)
{
    const carom_frame fa = carom_frame_at(pose_a);
    const carom_frame fb = carom_frame_at(pose_b);
    return carom_collide_frames(a, &fa, b, &fb, margin, NULL);
}
