/* mass.c: area, centroid and moment of inertia of rounded hulls, and their reverse derivatives.
 *
 * The solid is the core polygon, a strip of the radius' width along each edge and a sector at each
 * vertex, from the normal before to the normal after.  Each part adds to the moments about vertex
 * 0: S = area,  F = int x,  J = int |x|^2 triangle (0, a, b)   c = cross(a, b): S += c/2, F += c (a
 * + b)/6, J += c (a.a + a.b + b.b)/12 strip on a -> b      center p = (a + b)/2 + r m/2, s = L r: S
 * += s, F += s p, J += s (p.p + (L^2 + r^2)/12) sector at p          angle k, W = (n1.y - n0.y,
 * n0.x - n1.x), s = r^2 k/2: S += s, F += s p + r^3 W/3, J += s p.p + 2 r^3 p.W/3 + r^4 k/4 Then
 * centroid = F/S and inertia = density (J - F.F/S). */
#include "carom/shape.h"

#include "vec.h"

static const double PI = 3.14159265358979323846;

typedef struct moments {
    double s;
    carom_vec2 f;
    double j;
} moments;

/* One edge a -> b of the core and what it spans. */
typedef struct side {
    carom_vec2 a;
    carom_vec2 b;
    carom_vec2 e;
    double length;
    carom_vec2 t;
    carom_vec2 m;
} side;

static side side_of(const carom_shape *shape, int i)
{
    const int k = i + 1 < shape->count ? i + 1 : 0;
    side s;
    s.a = crm_sub(shape->vertices[i], shape->vertices[0]);
    s.b = crm_sub(shape->vertices[k], shape->vertices[0]);
    s.e = crm_sub(shape->vertices[k], shape->vertices[i]);
    s.length = crm_length(s.e);
    s.t = crm_scale(1.0 / s.length, s.e);
    s.m = crm_right(s.t);
    return s;
}

static side side_before(const carom_shape *shape, int i)
{
    return side_of(shape, i ? i - 1 : shape->count - 1);
}

/* Exterior angle, 0 .. pi.  The absolute value decides for capsules, where it is pi. */
static double angle_between(const side *before, const side *after)
{
    return atan2(fabs(crm_cross(before->t, after->t)), crm_dot(before->t, after->t));
}

static void add_triangle(const side *k, moments *sum)
{
    const double c = crm_cross(k->a, k->b);
    const double q = crm_dot(k->a, k->a) + crm_dot(k->a, k->b) + crm_dot(k->b, k->b);
    sum->s += c / 2;
    sum->f = crm_add_scaled(sum->f, c / 6, crm_add(k->a, k->b));
    sum->j += c * q / 12;
}

static carom_vec2 strip_center(const side *k, double r)
{
    return crm_add_scaled(crm_scale(0.5, crm_add(k->a, k->b)), 0.5 * r, k->m);
}

static void add_strip(const side *k, double r, moments *sum)
{
    const carom_vec2 p = strip_center(k, r);
    const double s = k->length * r;
    sum->s += s;
    sum->f = crm_add_scaled(sum->f, s, p);
    sum->j += s * (crm_dot(p, p) + (k->length * k->length + r * r) / 12);
}

static carom_vec2 sector_chord(const side *before, const side *after)
{
    return crm_vec(after->m.y - before->m.y, before->m.x - after->m.x);
}

static void add_sector(const side *before, const side *after, double r, moments *sum)
{
    const carom_vec2 p = after->a;
    const carom_vec2 w = sector_chord(before, after);
    const double k = angle_between(before, after);
    const double s = r * r * k / 2;
    const double r3 = r * r * r;
    sum->s += s;
    sum->f = crm_add_scaled(crm_add_scaled(sum->f, s, p), r3 / 3, w);
    sum->j += s * crm_dot(p, p) + 2 * r3 * crm_dot(p, w) / 3 + r3 * r * k / 4;
}

/* About vertex 0. */
static moments moments_of(const carom_shape *shape)
{
    const double r = shape->radius;
    moments sum = {0, {0, 0}, 0};
    if (shape->count == 1) {
        sum.s = PI * r * r;
        sum.j = sum.s * r * r / 2;
        return sum;
    }
    for (int i = 0; i < shape->count; i++) {
        const side k = side_of(shape, i);
        if (shape->count > 2) add_triangle(&k, &sum);
        if (r > 0) {
            const side before = side_before(shape, i);
            add_strip(&k, r, &sum);
            add_sector(&before, &k, r, &sum);
        }
    }
    return sum;
}

/* Relative to vertex 0. */
static carom_vec2 centroid_of(const carom_shape *shape, const moments *m)
{
    if (m->s > 0) return crm_scale(1.0 / m->s, m->f);
    return crm_scale(0.5, crm_sub(shape->vertices[1], shape->vertices[0]));
}

carom_mass_properties carom_shape_mass(const carom_shape *shape, double density)
{
    const moments m = moments_of(shape);
    const carom_vec2 c = centroid_of(shape, &m);
    carom_mass_properties out;
    out.area = m.s;
    out.centroid = crm_add(shape->vertices[0], c);
    out.mass = density * m.s;
    out.inertia = density * (m.j - crm_dot(c, m.f));
    return out;
}

static void add_to(carom_vec2 *sum, carom_vec2 v)
{
    *sum = crm_add(*sum, v);
}

/* Cotangents of one side: of a, b, the edge vector and the outward normal, and of its direction. */
typedef struct side_bar {
    carom_vec2 a;
    carom_vec2 b;
    carom_vec2 m;
    double length;
    double direction;
} side_bar;

static void triangle_vjp(const side *k, const moments *g, side_bar *bar)
{
    const double c = crm_cross(k->a, k->b);
    const double q = crm_dot(k->a, k->a) + crm_dot(k->a, k->b) + crm_dot(k->b, k->b);
    const carom_vec2 sum = crm_add(k->a, k->b);
    const double c_bar = g->s / 2 + crm_dot(g->f, sum) / 6 + g->j * q / 12;
    const double q_bar = g->j * c / 12;
    add_to(&bar->a, crm_add_scaled(crm_scale(c / 6, g->f), -c_bar, crm_left(k->b)));
    add_to(&bar->a, crm_scale(q_bar, crm_add(k->a, sum)));
    add_to(&bar->b, crm_add_scaled(crm_scale(c / 6, g->f), c_bar, crm_left(k->a)));
    add_to(&bar->b, crm_scale(q_bar, crm_add(k->b, sum)));
}

/* Returns the radius' share. */
static double strip_vjp(const side *k, double r, const moments *g, side_bar *bar)
{
    const carom_vec2 p = strip_center(k, r);
    const double s = k->length * r;
    const double inner = crm_dot(p, p) + (k->length * k->length + r * r) / 12;
    const double s_bar = g->s + crm_dot(g->f, p) + g->j * inner;
    const carom_vec2 p_bar = crm_scale(s, crm_add_scaled(g->f, 2 * g->j, p));
    add_to(&bar->a, crm_scale(0.5, p_bar));
    add_to(&bar->b, crm_scale(0.5, p_bar));
    add_to(&bar->m, crm_scale(0.5 * r, p_bar));
    bar->length += s_bar * r + g->j * s * k->length / 6;
    return s_bar * k->length + g->j * s * r / 6 + 0.5 * crm_dot(p_bar, k->m);
}

static double sector_vjp(const side *before, const side *after, double r, const moments *g,
                         side_bar *before_bar, side_bar *after_bar)
{
    const carom_vec2 p = after->a;
    const carom_vec2 w = sector_chord(before, after);
    const double k = angle_between(before, after);
    const double r3 = r * r * r;
    const carom_vec2 slope = crm_add_scaled(g->f, 2 * g->j, p); /* d(F_bar.x + J_bar x.x) at p */
    const double at_p = g->s + crm_dot(g->f, p) + g->j * crm_dot(p, p);
    const double k_bar = r * r * at_p / 2 + g->j * r3 * r / 4;
    const carom_vec2 w_bar = crm_scale(r3 / 3, slope);
    add_to(&after_bar->a, crm_scale(r * r * k / 2, slope));
    add_to(&after_bar->a, crm_scale(2 * r3 * g->j / 3, w));
    add_to(&after_bar->m, crm_left(w_bar));
    add_to(&before_bar->m, crm_right(w_bar));
    after_bar->direction += k_bar;
    before_bar->direction -= k_bar;
    return r * k * at_p + r * r * crm_dot(w, slope) + r3 * k * g->j;
}

/* dt = m (m.de)/L, dm = -t (m.de)/L, dL = t.de, ddirection = -m.de/L (t turns toward -m). */
static void side_vjp(const carom_shape *shape, int i, const side *k, const side_bar *bar,
                     carom_vec2 *vertices_bar)
{
    const int next = i + 1 < shape->count ? i + 1 : 0;
    const double turn = -(crm_dot(k->t, bar->m) + bar->direction) / k->length;
    const carom_vec2 e_bar = crm_add_scaled(crm_scale(bar->length, k->t), turn, k->m);
    add_to(&vertices_bar[i], crm_sub(bar->a, e_bar));
    add_to(&vertices_bar[next], crm_add(bar->b, e_bar));
}

/* Gradient of <g, moments about vertex 0 held fixed>; returns the radius' share. */
static double moments_vjp(const carom_shape *shape, const moments *g, carom_vec2 *vertices_bar)
{
    const double r = shape->radius;
    if (shape->count == 1) {
        if (vertices_bar) add_to(&vertices_bar[0], crm_scale(PI * r * r, g->f));
        return 2 * PI * r * (g->s + g->j * r * r);
    }
    double r_bar = 0;
    for (int i = 0; i < shape->count; i++) {
        const side k = side_of(shape, i);
        const side before = side_before(shape, i);
        side_bar k_bar = {{0, 0}, {0, 0}, {0, 0}, 0, 0};
        side_bar before_bar = k_bar;
        if (shape->count > 2) triangle_vjp(&k, g, &k_bar);
        r_bar += strip_vjp(&k, r, g, &k_bar);
        r_bar += sector_vjp(&before, &k, r, g, &before_bar, &k_bar);
        if (!vertices_bar) continue;
        side_vjp(shape, i, &k, &k_bar, vertices_bar);
        side_vjp(shape, i ? i - 1 : shape->count - 1, &before, &before_bar, vertices_bar);
    }
    return r_bar;
}

void carom_shape_mass_vjp(const carom_shape *shape, double density, carom_mass_properties bar,
                          double *density_bar, double *radius_bar, carom_vec2 *vertices_bar)
{
    const moments m = moments_of(shape);
    const carom_vec2 c = centroid_of(shape, &m);
    /* Of S, F and J in centroid = F/S, inertia = density (J - F.F/S). */
    moments g = {bar.area + density * bar.mass, {0, 0}, density * bar.inertia};
    g.s += g.j * crm_dot(c, c);
    g.f = crm_scale(-2 * g.j, c);
    if (m.s > 0) {
        g.s -= crm_dot(bar.centroid, c) / m.s;
        g.f = crm_add_scaled(g.f, 1.0 / m.s, bar.centroid);
    } else if (vertices_bar) {
        add_to(&vertices_bar[0], crm_scale(0.5, bar.centroid));
        add_to(&vertices_bar[1], crm_scale(0.5, bar.centroid));
    }
    const double r_bar = moments_vjp(shape, &g, vertices_bar);
    if (radius_bar) *radius_bar += r_bar;
    if (density_bar) *density_bar += bar.mass * m.s + bar.inertia * (m.j - crm_dot(c, m.f));
}

carom_moments carom_shapes_moments(int n, const carom_shape *shapes)
{
    carom_moments m = {0, {0, 0}, 0, 0};
    for (int k = 0; k < n; k++) {
        const carom_shape *s = &shapes[k];
        const carom_mass_properties p = carom_shape_mass(s, 1);
        const carom_vec2 c = p.centroid;
        m.area += p.area;
        m.centroid.x += p.area * c.x;
        m.centroid.y += p.area * c.y;
        m.second += p.inertia + p.area * (c.x * c.x + c.y * c.y); /* Steiner */
        for (int i = 0; i < s->count; i++) {
            m.extent = fmax(m.extent, hypot(s->vertices[i].x, s->vertices[i].y) + s->radius);
        }
    }
    if (m.area > 0) {
        m.centroid.x /= m.area;
        m.centroid.y /= m.area;
    }
    return m;
}
