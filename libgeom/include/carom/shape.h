/* shape.h: convex shapes, their validation and mass properties.
 *
 * A shape is a view: the caller owns the vertices and keeps them alive while the view is used.
 * One vertex: circle.  Two: capsule (or segment when radius = 0).  Three or more: convex hull,
 * rounded when radius > 0.  The solid is the convex hull of the vertices grown by radius.
 * Vertices are in the body frame; the vertices of a hull run counterclockwise. */
#ifndef CAROM_SHAPE_H
#define CAROM_SHAPE_H

#include "carom/base.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct carom_shape {
    double radius;              /* rounding [m], >= 0; > 0 when count = 1 */
    int count;                  /* number of vertices, >= 1 */
    const carom_vec2 *vertices; /* count vertices, body frame [m] */
} carom_shape;

/* What is wrong with a shape. */
typedef enum carom_shape_fault {
    CAROM_SHAPE_VALID = 0,
    CAROM_SHAPE_COUNT,      /* no vertices */
    CAROM_SHAPE_RADIUS,     /* negative or not finite; or zero for a circle */
    CAROM_SHAPE_NOT_FINITE, /* a coordinate is NaN or infinite */
    CAROM_SHAPE_DUPLICATE,  /* a vertex equals the next one within 1e-12 of the extent */
    CAROM_SHAPE_CLOCKWISE,  /* reverse the order */
    CAROM_SHAPE_REFLEX,     /* the interior angle at a vertex exceeds 180 degrees */
    CAROM_SHAPE_COLLINEAR,  /* a vertex lies on the line of its neighbors within 1e-12 of the extent
                             */
    CAROM_SHAPE_CROSSING,   /* the outline crosses itself, or winds around more than once */
    CAROM_SHAPE_AREA,       /* area below 1e-12 of the squared extent */
    CAROM_SHAPE_SIZE, /* a length outside 1e-40 .. 1e40 m: products of squares could overflow */
    CAROM_SHAPE_FOLD  /* chains: at a vertex the chain turns back onto itself */
} carom_shape_fault;

typedef struct carom_shape_error {
    carom_shape_fault fault;
    int vertex; /* index of the offending vertex, -1: the shape as a whole */
} carom_shape_error;

/* CAROM_OK, or CAROM_E_SHAPE with *error filled (may be NULL).  Nothing is repaired.  The extent is
 * the larger side of the box around the vertices.  Orientation is judged by the whole outline. */
CAROM_API carom_status carom_shape_check(const carom_shape *shape, carom_shape_error *error);
/* Writes one sentence with the remedy, as "vertex 3: equal to the next vertex; remove one of the
 * two", cut to size and always terminated. */
CAROM_API void carom_shape_error_text(carom_shape_error error, char *text, size_t size);

/* Convex hull of points[n], n >= 1: writes to index[n] the indices of its vertices,
 * counterclockwise from the leftmost (of these the lowest) point, and their number to *count.
 * Points within 4e-12 of the extent of the line through their neighbors are left out, so the hull
 * passes carom_shape_check when *count >= 3; 2: all points are on a line, 1: at one place (within
 * 1e-40).  Of equal points one is taken.  With v[i] = points[index[i]] the reverse derivative is
 * points_bar[index[i]] += v_bar[i]. CAROM_E_ARGUMENT: a coordinate is not finite or exceeds 1e40.
 */
CAROM_API carom_status carom_hull_from_points(int n, const carom_vec2 *points, int *index,
                                              int *count);

typedef struct carom_mass_properties {
    double area;         /* [m^2]; 0 for a segment without radius */
    carom_vec2 centroid; /* body frame [m]; of a segment without radius its middle */
    double mass;         /* density * area [kg] */
    double inertia;      /* about the centroid [kg m^2] */
} carom_mass_properties;

/* Mass properties of a valid shape from its density [kg/m^2].  Rounded hulls and capsules include
 * the rounding exactly (hull + edge strips + corner sectors). */
CAROM_API carom_mass_properties carom_shape_mass(const carom_shape *shape, double density);

/* Reverse derivative of carom_shape_mass: adds to *density_bar, *radius_bar and vertices_bar[count]
 * (each may be NULL) the gradient of <bar, properties>. */
CAROM_API void carom_shape_mass_vjp(const carom_shape *shape, double density,
                                    carom_mass_properties bar, double *density_bar,
                                    double *radius_bar, carom_vec2 *vertices_bar);

/* Moments of n valid shapes about the origin of their frame, at density 1; overlaps count twice. */
typedef struct carom_moments {
    double area;         /* [m^2] */
    carom_vec2 centroid; /* [m]; the origin where there is no area */
    double second;       /* int |x|^2 dA [m^4] */
    double extent;       /* no point of them is farther from the origin [m] */
} carom_moments;
CAROM_API carom_moments carom_shapes_moments(int n, const carom_shape *shapes);

/* A shape of a body that has several: out[i] = R(offset.angle) in[i] + (offset.x, offset.y), n of
 * them; out may be in. */
CAROM_API void carom_vertices_place(int n, const carom_vec2 *in, carom_pose offset,
                                    carom_vec2 *out);

/* Reverse derivative: adds the gradient of <out_bar, out> to *offset_bar and in_bar[n] (each may be
 * NULL; in_bar must not be out_bar). */
CAROM_API void carom_vertices_place_vjp(int n, const carom_vec2 *in, carom_pose offset,
                                        const carom_vec2 *out_bar, carom_pose *offset_bar,
                                        carom_vec2 *in_bar);

/* Forward derivative: out_dot[n]; in_dot[n] may be NULL: the shape itself rests; out_dot may be
 * in_dot. */
CAROM_API void carom_vertices_place_jvp(int n, const carom_vec2 *in, carom_pose offset,
                                        carom_pose offset_dot, const carom_vec2 *in_dot,
                                        carom_vec2 *out_dot);

#ifdef __cplusplus
}
#endif
#endif
