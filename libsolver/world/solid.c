/* solid.c: bodies whose mass and inertia follow from their shapes and a density. */
#include "world/internal.h"

/* A centroid this close to the position, relative to the extent, is rounding of the vertices. */
#define CENTROID_TOL 1e-6

carom_body_def carom_body_at(carom_body_type type, double x, double y)
{
    carom_body_def def = carom_body_defaults();
    def.type = type;
    def.pose.x = x;
    def.pose.y = y;
    return def;
}

static carom_status check_moments(carom_world *w, const carom_moments *m)
{
    const int id = w->n_bodies;
    if (!(m->area > 0)) {
        return crm_world_fail(w, CAROM_E_ARGUMENT,
                              "body %d: no area to take the mass from; give mass and inertia", id);
    }
    const double x = m->centroid.x;
    const double y = m->centroid.y;
    if (hypot(x, y) <= CENTROID_TOL * m->extent) return CAROM_OK;
    return crm_world_fail(w, CAROM_E_ARGUMENT,
                          "body %d: the centroid of its shapes is (%.9g, %.9g), not the position: "
                          "subtract it from the vertices, or give mass and inertia",
                          id, x, y);
}

static int are_valid(const carom_body_def *def)
{
    if (def->n_shapes < 0 || (def->n_shapes > 0 && !def->shapes)) return 0;
    for (int k = 0; k < def->n_shapes; k++) {
        if (carom_shape_check(&def->shapes[k], NULL) < 0) return 0;
    }
    return 1;
}

carom_status carom_world_add_solid(carom_world *world, const carom_body_def *def, double density,
                                   int *index)
{
    if (!world || !def) return CAROM_E_ARGUMENT;
    if (def->type != CAROM_DYNAMIC) return carom_world_add_body(world, def, index);
    if (!(density > 0 && density < HUGE_VAL)) {
        return crm_world_fail(world, CAROM_E_ARGUMENT, "body %d: density %g must be positive",
                              world->n_bodies, density);
    }
    carom_body_def solid = *def;
    solid.mass = 1;
    solid.inertia = 1;
    if (!are_valid(def)) return carom_world_add_body(world, &solid, index); /* names the shape */
    const carom_moments m = carom_shapes_moments(def->n_shapes, def->shapes);
    const carom_status e = check_moments(world, &m);
    if (e) return e;
    solid.mass = density * m.area;
    solid.inertia = density * m.second;
    return carom_world_add_body(world, &solid, index);
}

static carom_status add_shape(carom_world *w, const carom_body_def *def, const carom_shape *shape,
                              double density, int *index)
{
    carom_body_def one = *def;
    one.n_shapes = 1;
    one.shapes = shape;
    return carom_world_add_solid(w, &one, density, index);
}

carom_status carom_world_add_circle(carom_world *world, const carom_body_def *def, double radius,
                                    double density, int *index)
{
    if (!world || !def) return CAROM_E_ARGUMENT;
    const carom_vec2 center = {0, 0};
    const carom_shape circle = {radius, 1, &center};
    return add_shape(world, def, &circle, density, index);
}

carom_status carom_world_add_box(carom_world *world, const carom_body_def *def, double width,
                                 double height, double density, int *index)
{
    if (!world || !def) return CAROM_E_ARGUMENT;
    if (!(width > 0 && height > 0)) { /* else the sentence is about vertices nobody gave */
        return crm_world_fail(world, CAROM_E_SHAPE,
                              "body %d: the sides of a box must be positive, not %g by %g",
                              world->n_bodies, width, height);
    }
    const double x = width / 2;
    const double y = height / 2;
    const carom_vec2 corners[4] = {{-x, -y}, {x, -y}, {x, y}, {-x, y}};
    const carom_shape box = {0, 4, corners};
    return add_shape(world, def, &box, density, index);
}
