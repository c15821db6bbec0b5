/* collide.c: the contact manifold of two shapes. */
#include "carom/collide.h"

#include "collide/manifold.h"

carom_manifold carom_collide(const carom_shape *a, carom_pose pose_a, const carom_shape *b,
                             carom_pose pose_b, double margin)
{
    const crm_placed pa = crm_place(a, pose_a.angle, crm_vec(0, 0));
    const crm_placed pb =
        crm_place(b, pose_b.angle, crm_vec(pose_b.x - pose_a.x, pose_b.y - pose_a.y));
    const double radii = a->radius + b->radius;
    const crm_closest c = crm_features(&pa, &pb, margin + radii);
    if (c.kind == CRM_APART) return crm_no_contact(c.gap - radii);
    carom_manifold m = crm_manifold_of(&pa, &pb, &c);
    crm_keep_within(&m, margin);
    return m;
}
