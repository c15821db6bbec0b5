#include "mass.h"

#include <math.h>

/* A centroid this close to the position, relative to the extent, is rounding of the file's numbers.
 */
#define CENTROID_TOL 1e-6

carom_moments crm_body_moments(const carom_body_def *def)
{
    return carom_shapes_moments(def->n_shapes, def->shapes);
}

static int is_lone_segment(const carom_body_def *def)
{
    return def->n_shapes == 1 && def->shapes[0].count == 2 && !(def->shapes[0].radius > 0);
}

/* Thin rod from a to b about the origin: int_0^1 |a + t (b - a)|^2 dt = (a.a + a.b + b.b)/3. */
static double rod_gyration(carom_vec2 a, carom_vec2 b)
{
    return (a.x * a.x + a.y * a.y + a.x * b.x + a.y * b.y + b.x * b.x + b.y * b.y) / 3;
}

double crm_body_gyration(const carom_body_def *def)
{
    if (is_lone_segment(def)) {
        const carom_vec2 *v = def->shapes[0].vertices;
        return rod_gyration(v[0], v[1]);
    }
    const carom_moments m = crm_body_moments(def);
    return m.area > 0 ? m.second / m.area : 0;
}

void crm_body_follow(crm_scene_body *body)
{
    if (body->has_density) {
        const carom_moments m = crm_body_moments(&body->def);
        body->def.mass = body->density * m.area;
        body->def.inertia = body->density * m.second;
    } else if (body->has_mass && !body->has_inertia) {
        body->def.inertia = body->def.mass * crm_body_gyration(&body->def);
    }
}

static void check_density(crm_problems *problems, const crm_node *node, const carom_body_def *def)
{
    const crm_node at = crm_member(node, "density");
    const carom_moments m = crm_body_moments(def);
    if (!(m.area > 0)) {
        crm_fault(problems, &at, "the body has no area; give mass and inertia instead");
    } else if (hypot(m.centroid.x, m.centroid.y) > CENTROID_TOL * m.extent) {
        crm_fault(problems, &at,
                  "the centroid of the shape is at (%.17g, %.17g), not at the position (0, 0): "
                  "subtract it from the vertices and add it to the position, or give mass and "
                  "inertia",
                  m.centroid.x, m.centroid.y);
    }
}

void crm_body_mass(crm_problems *problems, const crm_node *node, crm_scene_body *body)
{
    const carom_body_def *def = &body->def;
    if (body->has_density) {
        check_density(problems, node, def);
    } else if (body->has_mass && !body->has_inertia && def->type == CAROM_DYNAMIC &&
               !(crm_body_gyration(def) > 0)) {
        const crm_node at = crm_member(node, "inertia");
        crm_fault(problems, &at, "must be given: the body has no shape that it could follow from");
    }
    if (def->type == CAROM_DYNAMIC) crm_body_follow(body);
}

/* Adds the gradient of area_bar * area + second_bar * second of one shape. */
static void moments_vjp(const carom_shape *s, double area_bar, double second_bar, double *radius,
                        carom_vec2 *vertices)
{
    const carom_mass_properties p = carom_shape_mass(s, 1);
    const carom_vec2 c = p.centroid;
    carom_mass_properties bar = {0, {0, 0}, 0, 0};
    bar.area = area_bar + second_bar * (c.x * c.x + c.y * c.y);
    bar.centroid.x = second_bar * p.area * 2 * c.x;
    bar.centroid.y = second_bar * p.area * 2 * c.y;
    bar.inertia = second_bar;
    carom_shape_mass_vjp(s, 1, bar, NULL, radius, vertices);
}

/* d/da of rod_gyration is (2a + b)/3. */
static void rod_vjp(const carom_shape *s, double bar, carom_vec2 *vertices)
{
    const carom_vec2 *v = s->vertices;
    for (int i = 0; vertices && i < 2; i++) {
        vertices[i].x += bar * (2 * v[i].x + v[1 - i].x) / 3;
        vertices[i].y += bar * (2 * v[i].y + v[1 - i].y) / 3;
    }
}

/* Share of the body's shapes, from the cotangents of its mass and inertia. */
static void shapes_chain(const crm_scene_body *body, double mass_bar, double inertia_bar,
                         double *radius, carom_vec2 *vertices)
{
    const carom_body_def *def = &body->def;
    if (is_lone_segment(def)) {
        rod_vjp(&def->shapes[0], inertia_bar * def->mass, vertices);
        return;
    }
    const carom_moments m = crm_body_moments(def);
    double area_bar =
        body->density * mass_bar; /* mass = density * area, inertia = density * second */
    double second_bar = body->density * inertia_bar;
    if (!body->has_density) { /* inertia = mass * second / area */
        second_bar = inertia_bar * def->mass / m.area;
        area_bar = -second_bar * m.second / m.area;
    }
    for (int k = 0; k < def->n_shapes; k++) {
        moments_vjp(&def->shapes[k], area_bar, second_bar, radius ? &radius[k] : NULL, vertices);
        if (vertices) vertices += def->shapes[k].count;
    }
}

static int count_vertices(const carom_body_def *def)
{
    int n = 0;
    for (int k = 0; k < def->n_shapes; k++) n += def->shapes[k].count;
    return n;
}

void crm_scene_chain(const crm_scene *scene, double *mass, const double *inertia, double *radius,
                     carom_vec2 *vertices)
{
    for (int i = 0; i < scene->n_bodies; i++) {
        const crm_scene_body *b = &scene->bodies[i];
        const int follows = b->has_density || (b->has_mass && !b->has_inertia);
        if (follows && b->def.type == CAROM_DYNAMIC) {
            shapes_chain(b, mass[i], inertia[i], radius, vertices);
            mass[i] += inertia[i] * b->def.inertia / b->def.mass;
        }
        if (radius) radius += b->def.n_shapes;
        if (vertices) vertices += count_vertices(&b->def);
    }
}
