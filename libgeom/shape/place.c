/* place.c: shapes offset in their body's frame, docs/math/equations.md (40). */
#include "carom/shape.h"

#include "vec.h"

void carom_vertices_place(int n, const carom_vec2 *in, carom_pose offset, carom_vec2 *out)
{
    const double c = cos(offset.angle);
    const double s = sin(offset.angle);
    for (int i = 0; i < n; i++) {
        const carom_vec2 v = in[i];
        out[i] = crm_vec(offset.x + (c * v.x - s * v.y), offset.y + (s * v.x + c * v.y));
    }
}

void carom_vertices_place_vjp(int n, const carom_vec2 *in, carom_pose offset,
                              const carom_vec2 *out_bar, carom_pose *offset_bar, carom_vec2 *in_bar)
{
    const double c = cos(offset.angle);
    const double s = sin(offset.angle);
    for (int i = 0; i < n; i++) {
        const carom_vec2 turned = {c * in[i].x - s * in[i].y, s * in[i].x + c * in[i].y};
        const carom_vec2 g = out_bar[i];
        if (offset_bar) {
            offset_bar->angle += crm_cross(turned, g);
            offset_bar->x += g.x;
            offset_bar->y += g.y;
        }
        if (in_bar) {
            in_bar[i] = crm_add(in_bar[i], crm_vec(c * g.x + s * g.y, c * g.y - s * g.x));
        }
    }
}

void carom_vertices_place_jvp(int n, const carom_vec2 *in, carom_pose offset, carom_pose offset_dot,
                              const carom_vec2 *in_dot, carom_vec2 *out_dot)
{
    const double c = cos(offset.angle);
    const double s = sin(offset.angle);
    for (int i = 0; i < n; i++) {
        const carom_vec2 turned = {c * in[i].x - s * in[i].y, s * in[i].x + c * in[i].y};
        const carom_vec2 e = in_dot ? in_dot[i] : crm_vec(0, 0);
        const carom_vec2 shift =
            crm_vec(offset_dot.x + (c * e.x - s * e.y), offset_dot.y + (s * e.x + c * e.y));
        out_dot[i] = crm_add_scaled(shift, offset_dot.angle, crm_left(turned));
    }
}
