#include "contact_ref.h"

typedef double complex number;

contact_ref_shape contact_ref_from(const carom_shape *shape, carom_pose pose)
{
    contact_ref_shape s = {0};
    s.n = shape->count;
    s.pose[0] = pose.angle;
    s.pose[1] = pose.x;
    s.pose[2] = pose.y;
    s.radius = shape->radius;
    for (int i = 0; i < s.n; i++) {
        s.v[i][0] = shape->vertices[i].x;
        s.v[i][1] = shape->vertices[i].y;
    }
    return s;
}

/* (40), i modulo n */
static void world_vertex(const contact_ref_shape *s, int i, number x[2])
{
    const number c = ccos(s->pose[0]);
    const number t = csin(s->pose[0]);
    const number *v = s->v[i % s->n];
    x[0] = s->pose[1] + c * v[0] - t * v[1];
    x[1] = s->pose[2] + t * v[0] + c * v[1];
}

/* Points on the boundary of the reference (p) and of the other shape (q), normal from p to q. */
typedef struct points {
    number n[2];
    number p[2];
    number q[2];
    number gap;
} points;

/* (41) */
static points point_point(const number a[2], number ra, const number b[2], number rb)
{
    points o;
    const number u[2] = {b[0] - a[0], b[1] - a[1]};
    const number l = csqrt(u[0] * u[0] + u[1] * u[1]);
    for (int i = 0; i < 2; i++) {
        o.n[i] = u[i] / l;
        o.p[i] = a[i] + ra * o.n[i];
        o.q[i] = b[i] - rb * o.n[i];
    }
    o.gap = l - ra - rb;
    return o;
}

/* (42) with a radius on either side */
static points edge_point(const number a[2], const number b[2], number rp, const number x[2],
                         number rq)
{
    points o;
    const number e[2] = {b[0] - a[0], b[1] - a[1]};
    const number l = csqrt(e[0] * e[0] + e[1] * e[1]);
    o.n[0] = e[1] / l;
    o.n[1] = -e[0] / l;
    const number h = o.n[0] * (x[0] - a[0]) + o.n[1] * (x[1] - a[1]);
    for (int i = 0; i < 2; i++) {
        o.p[i] = x[i] - h * o.n[i] + rp * o.n[i];
        o.q[i] = x[i] - rq * o.n[i];
    }
    o.gap = h - rp - rq;
    return o;
}

/* (43) */
static void clip(const number a[2], const number b[2], const number c[2], const number i1[2],
                 const number i2[2], number x[2])
{
    const number e[2] = {b[0] - a[0], b[1] - a[1]};
    const number tau = (e[0] * (c[0] - i1[0]) + e[1] * (c[1] - i1[1])) /
                       (e[0] * (i2[0] - i1[0]) + e[1] * (i2[1] - i1[1]));
    for (int i = 0; i < 2; i++) x[i] = i1[i] + tau * (i2[i] - i1[i]);
}

static points eval(const contact_ref_shape *p, const contact_ref_shape *q, carom_recipe r)
{
    number a[2];
    number b[2];
    number x[2];
    world_vertex(p, r.ref, a);
    world_vertex(q, r.inc, x);
    if (r.kernel == CAROM_POINT_POINT) return point_point(a, p->radius, x, q->radius);
    world_vertex(p, r.ref + 1, b);
    if (r.kernel == CAROM_EDGE_CLIPPED) {
        number i2[2];
        number i1[2] = {x[0], x[1]};
        world_vertex(q, r.inc + 1, i2);
        clip(a, b, r.at_end ? b : a, i1, i2, x);
    }
    return edge_point(a, b, p->radius, x, q->radius);
}

void contact_ref_eval(const contact_ref_shape *a, const contact_ref_shape *b, carom_recipe r,
                      number out[CONTACT_REF_OUTPUTS])
{
    const points o = r.flipped ? eval(b, a, r) : eval(a, b, r);
    for (int i = 0; i < 2; i++) {
        out[i] = r.flipped ? -o.n[i] : o.n[i];
        out[2 + i] = (r.flipped ? o.q[i] : o.p[i]) - a->pose[1 + i];
        out[4 + i] = (r.flipped ? o.p[i] : o.q[i]) - b->pose[1 + i];
    }
    out[6] = o.gap;
}
