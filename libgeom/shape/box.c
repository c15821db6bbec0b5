/* box.c: axis-aligned boxes around shapes. */
#include "carom/broadphase.h"
#include "vec.h"

#include <float.h>

/* Rounding of position + rotated vertex + radius, in units of the largest coordinate. */
static const double ROUNDINGS = 8 * DBL_EPSILON;

carom_box carom_shape_box(const carom_shape *shape, carom_pose pose)
{
    const double c = cos(pose.angle);
    const double s = sin(pose.angle);
    carom_vec2 low = {HUGE_VAL, HUGE_VAL};
    carom_vec2 high = {-HUGE_VAL, -HUGE_VAL};
    double reach = 0.0;
    for (int i = 0; i < shape->count; i++) {
        const carom_vec2 v = shape->vertices[i];
        const double x = c * v.x - s * v.y;
        const double y = s * v.x + c * v.y;
        const double size = fabs(v.x) + fabs(v.y);
        if (x < low.x) low.x = x;
        if (y < low.y) low.y = y;
        if (x > high.x) high.x = x;
        if (y > high.y) high.y = y;
        if (size > reach) reach = size;
    }
    const double pad =
        shape->radius + ROUNDINGS * (fabs(pose.x) + fabs(pose.y) + reach + shape->radius);
    const carom_box box = {{pose.x + low.x - pad, pose.y + low.y - pad},
                           {pose.x + high.x + pad, pose.y + high.y + pad}};
    return box;
}
