/* distance.c: distance of two shapes, of a point, of a box. */
#include "carom/query.h"

#include "vec.h"

carom_separation carom_shape_distance(const carom_shape *a, carom_pose pose_a, const carom_shape *b,
                                      carom_pose pose_b)
{
    const carom_manifold m = carom_collide(a, pose_a, b, pose_b, HUGE_VAL);
    const int nearest = m.count == 2 && m.points[1].gap < m.points[0].gap;
    const carom_separation s = {m.distance, m.normal, m.points[nearest].arm_a,
                                m.points[nearest].arm_b};
    return s;
}

double carom_point_distance(const carom_shape *shape, carom_pose pose, carom_vec2 point,
                            carom_vec2 *normal)
{
    const carom_vec2 origin = {0, 0};
    const carom_shape dot = {0, 1, &origin};
    const carom_pose at = {0, point.x, point.y};
    const carom_manifold m = carom_collide(shape, pose, &dot, at, HUGE_VAL);
    if (normal) *normal = m.normal;
    return m.distance;
}

static int cut(double *low, double *high, double from, double to)
{
    if (*low < from) *low = from;
    if (*high > to) *high = to;
    return *low <= *high; /* NaN fails */
}

int carom_box_overlap(const carom_shape *shape, carom_pose pose, const carom_box *box)
{
    /* What is outside the shape's own box does not matter; the rest is finite. */
    const carom_box around = carom_shape_box(shape, pose);
    carom_box b = *box;
    if (!cut(&b.lower.x, &b.upper.x, around.lower.x, around.upper.x) ||
        !cut(&b.lower.y, &b.upper.y, around.lower.y, around.upper.y)) {
        return 0;
    }
    const carom_pose at = {0, b.lower.x, b.lower.y};
    const double w = b.upper.x - b.lower.x;
    const double h = b.upper.y - b.lower.y;
    const carom_vec2 corner[4] = {{0, 0}, {w, 0}, {w, h}, {0, h}};
    const carom_vec2 ends[2] = {{0, 0}, {w, h}};
    carom_shape s = {0, 4, corner};
    if (!(w > 0 && h > 0)) {
        s.count = w > 0 || h > 0 ? 2 : 1;
        s.vertices = ends;
    }
    return carom_collide(shape, pose, &s, at, HUGE_VAL).distance <= 0;
}
