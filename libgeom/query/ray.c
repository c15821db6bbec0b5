/* ray.c: a segment against a rounded hull.
 *
 * The solid is the union of a polygon (the edges moved out by the radius, joined by chords at the
 * corners) and a disc at each vertex, all convex.  A union that is convex meets a line in one
 * interval, from the first entry to the last exit: no seams between edges and arcs. */
#include "carom/query.h"
#include "vec.h"

typedef struct ray {
    carom_vec2 o; /* body frame */
    carom_vec2 d;
    double dd; /* d . d */
} ray;

typedef struct span {
    double enter;
    double leave;
    carom_vec2 normal; /* at the entry, any length */
} span;

/* Cuts the span by the half plane n . (x - p) <= 0. */
static void cut_plane(const ray *r, carom_vec2 n, carom_vec2 p, carom_vec2 normal, span *s)
{
    const double speed = crm_dot(n, r->d);
    const double height = crm_dot(n, crm_sub(r->o, p));
    if (speed < 0) {
        const double t = -height / speed;
        if (t > s->enter) {
            s->enter = t;
            s->normal = normal;
        }
    } else if (speed > 0) {
        const double t = -height / speed;
        if (t < s->leave) s->leave = t;
    } else if (height > 0) {
        s->leave = -HUGE_VAL;
    }
}

static carom_vec2 unit_normal(const carom_shape *s, int i)
{
    const carom_vec2 e = crm_sub(s->vertices[i + 1 < s->count ? i + 1 : 0], s->vertices[i]);
    return crm_right(crm_scale(1.0 / crm_length(e), e));
}

static span polygon_span(const carom_shape *s, const ray *r)
{
    span out = {-HUGE_VAL, HUGE_VAL, {0, 0}};
    carom_vec2 before = unit_normal(s, s->count - 1);
    for (int i = 0; i < s->count; i++) {
        const carom_vec2 m = unit_normal(s, i);
        const carom_vec2 v = s->vertices[i];
        const carom_vec2 p = crm_add_scaled(v, s->radius, m);
        /* Both sides of a segment measure from one point: they must meet. */
        const carom_vec2 side = s->count == 2 ? crm_add_scaled(s->vertices[0], s->radius, m) : p;
        cut_plane(r, m, side, m, &out);
        /* A chord is inside the vertex's disc and enters no earlier; it ends a bare segment. */
        if (s->radius > 0 || s->count == 2) {
            const carom_vec2 chord = crm_right(crm_sub(m, before));
            cut_plane(r, chord, p, chord, &out);
        }
        before = m;
    }
    return out;
}

static span disc_span(carom_vec2 center, double radius, const ray *r)
{
    span out = {HUGE_VAL, -HUGE_VAL, {0, 0}};
    const carom_vec2 c = crm_sub(r->o, center);
    const double off = crm_cross(c, r->d);
    const double h = radius * radius * r->dd - off * off; /* half chord squared times dd */
    if (!(h >= 0 && r->dd > 0)) return out;
    const double middle = -crm_dot(c, r->d) / r->dd;
    const double half = sqrt(h) / r->dd;
    out.enter = middle - half;
    out.leave = middle + half;
    out.normal = crm_add_scaled(c, out.enter, r->d);
    return out;
}

static void unite(span *sum, span s)
{
    if (!(s.enter <= s.leave)) return;
    if (s.enter < sum->enter) {
        sum->enter = s.enter;
        sum->normal = s.normal;
    }
    if (s.leave > sum->leave) sum->leave = s.leave;
}

static span whole_span(const carom_shape *s, const ray *r)
{
    span sum = {HUGE_VAL, -HUGE_VAL, {0, 0}};
    if (s->count > 1) unite(&sum, polygon_span(s, r));
    for (int i = 0; s->radius > 0 && i < s->count; i++) {
        unite(&sum, disc_span(s->vertices[i], s->radius, r));
    }
    return sum;
}

static carom_vec2 turned(carom_vec2 v, double c, double s)
{
    return crm_vec(c * v.x - s * v.y, s * v.x + c * v.y);
}

int carom_ray_cast(const carom_shape *shape, carom_pose pose, carom_vec2 origin,
                   carom_vec2 translation, carom_ray_hit *hit)
{
    const double c = cos(pose.angle);
    const double s = sin(pose.angle);
    ray r;
    r.o = turned(crm_vec(origin.x - pose.x, origin.y - pose.y), c, -s);
    r.d = turned(translation, c, -s);
    r.dd = crm_dot(r.d, r.d);
    span in = whole_span(shape, &r);
    if (!(r.dd > 0)) {
        if (!(carom_point_distance(shape, pose, origin, NULL) <= 0)) return 0;
        in.enter = 0;
        in.leave = 1;
    }
    if (!(in.enter <= 1 && in.leave >= 0 && in.enter <= in.leave)) return 0;
    hit->normal = crm_vec(0, 0);
    if (in.enter > 0) {
        hit->normal = crm_scale(1.0 / crm_length(in.normal), turned(in.normal, c, s));
    }
    hit->enter = in.enter > 0 ? in.enter : 0;
    hit->leave = in.leave < 1 ? in.leave : 1;
    return 1;
}
