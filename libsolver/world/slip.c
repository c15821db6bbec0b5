/* slip.c: slip as an arc length.  In the plane rolling and sticking are holonomic: they can be held
 * at the level of positions.  docs/step.md. */
#include "world/internal.h"

#include <math.h>

static double dot(carom_vec2 a, carom_vec2 b)
{
    return a.x * b.x + a.y * b.y;
}

/* Center of a round vertex in the world. */
static carom_vec2 center(carom_pose p, carom_vec2 v)
{
    const carom_vec2 r = crm_rotate(p.angle, v);
    const carom_vec2 x = {p.x + r.x, p.y + r.y};
    return x;
}

crm_slide crm_slide_of(const carom_world *w, const crm_contact *c)
{
    const int face_on_b = c->recipe.flipped;
    crm_slide s;
    s.face_shape = face_on_b ? c->shape_b : c->shape_a;
    s.point_shape = face_on_b ? c->shape_a : c->shape_b;
    s.face_body = w->shapes[s.face_shape].body;
    s.point_body = w->shapes[s.point_shape].body;
    const carom_shape *face = &w->shapes[s.face_shape].view;
    s.a = face->vertices[c->recipe.ref];
    s.b = face->vertices[(c->recipe.ref + 1) % face->count];
    s.v = w->shapes[s.point_shape].view.vertices[c->recipe.inc];
    s.radius = w->shapes[s.point_shape].view.radius;
    const double length = hypot(s.b.x - s.a.x, s.b.y - s.a.y);
    s.t.x = (s.b.x - s.a.x) / length;
    s.t.y = (s.b.y - s.a.y) / length;
    return s;
}

carom_vec2 crm_slide_point(const crm_slide *s, const double *q)
{
    const carom_pose k = crm_pose(q, s->face_body);
    const carom_vec2 x = center(crm_pose(q, s->point_body), s->v);
    const carom_vec2 d = {x.x - k.x, x.y - k.y};
    return crm_rotate(-k.angle, d);
}

/* A vertex of body i, rounded by r, on a face of body k: y its place in the frame of k,
 * slip = t . (y1 - y0) - r (turn of i - turn of k). */
static double slide(const carom_world *w, const crm_contact *c, const double *q0, const double *q1)
{
    const crm_slide s = crm_slide_of(w, c);
    const carom_vec2 y0 = crm_slide_point(&s, q0);
    const carom_vec2 y1 = crm_slide_point(&s, q1);
    const carom_vec2 d = {y1.x - y0.x, y1.y - y0.y};
    const double turn =
        (q1[3 * s.point_body] - q0[3 * s.point_body]) - (q1[3 * s.face_body] - q0[3 * s.face_body]);
    return dot(s.t, d) - s.radius * turn;
}

carom_vec2 crm_centers(const carom_world *w, const crm_contact *c, const double *q)
{
    const carom_shape *a = &w->shapes[c->shape_a].view;
    const carom_shape *b = &w->shapes[c->shape_b].view;
    const carom_vec2 xa = center(crm_pose(q, c->body_a), a->vertices[c->recipe.ref]);
    const carom_vec2 xb = center(crm_pose(q, c->body_b), b->vertices[c->recipe.inc]);
    const carom_vec2 u = {xb.x - xa.x, xb.y - xa.y};
    return u;
}

/* Two circles: slip = (ra + rb) angle(n0 -> n1) - ra turn of A - rb turn of B. */
static double roll(const carom_world *w, const crm_contact *c, const double *q0, const double *q1)
{
    const double ra = w->shapes[c->shape_a].view.radius;
    const double rb = w->shapes[c->shape_b].view.radius;
    const carom_vec2 u0 = crm_centers(w, c, q0);
    const carom_vec2 u1 = crm_centers(w, c, q1);
    const double angle = atan2(u0.x * u1.y - u0.y * u1.x, dot(u0, u1));
    return (ra + rb) * angle - ra * (q1[3 * c->body_a] - q0[3 * c->body_a]) -
           rb * (q1[3 * c->body_b] - q0[3 * c->body_b]);
}

double crm_slip(const carom_world *w, const crm_contact *c, const double *q0, const double *q1)
{
    return c->recipe.kernel == CAROM_POINT_POINT ? roll(w, c, q0, q1) : slide(w, c, q0, q1);
}
