/* check.c: validation of shapes and chains.  Vertices are differentiable parameters, so nothing is
 * repaired. */
#include "carom/chain.h"

#include "vec.h"

#include <stdio.h>

/* Lengths below this are zero [1], times the extent [m]; areas, times its square. */
static const double SHAPE_TOL = 1e-12;

/* Lengths whose sixth powers, and those of edges 1e-12 of them, neither overflow nor underflow. */
static const double SIZE_MAX_M = 1e40;
static const double SIZE_MIN_M = 1e-40;

static const double PI = 3.14159265358979323846;

static carom_shape_error fault(carom_shape_fault what, int vertex)
{
    const carom_shape_error e = {what, vertex};
    return e;
}

static carom_shape_error valid(void)
{
    return fault(CAROM_SHAPE_VALID, -1);
}

static int is_finite(double x)
{
    return x - x == 0.0;
}

static carom_vec2 vertex(const carom_shape *s, int i)
{
    if (i < 0) i += s->count;
    if (i >= s->count) i -= s->count;
    return s->vertices[i];
}

/* The edge that leaves vertex i. */
static carom_vec2 edge(const carom_shape *s, int i)
{
    return crm_sub(vertex(s, i + 1), vertex(s, i));
}

static double extent_of(const carom_shape *s)
{
    carom_vec2 low = s->vertices[0];
    carom_vec2 high = s->vertices[0];
    for (int i = 1; i < s->count; i++) {
        low.x = fmin(low.x, s->vertices[i].x);
        low.y = fmin(low.y, s->vertices[i].y);
        high.x = fmax(high.x, s->vertices[i].x);
        high.y = fmax(high.y, s->vertices[i].y);
    }
    return fmax(high.x - low.x, high.y - low.y);
}

static carom_shape_error check_numbers(const carom_shape *s)
{
    if (!(s->radius >= 0) || !is_finite(s->radius)) return fault(CAROM_SHAPE_RADIUS, -1);
    if (s->count == 1 && !(s->radius > 0)) return fault(CAROM_SHAPE_RADIUS, -1);
    for (int i = 0; i < s->count; i++) {
        const carom_vec2 v = s->vertices[i];
        if (!is_finite(v.x) || !is_finite(v.y)) return fault(CAROM_SHAPE_NOT_FINITE, i);
        if (!(fmax(fabs(v.x), fabs(v.y)) <= SIZE_MAX_M)) return fault(CAROM_SHAPE_SIZE, i);
    }
    const int too_small = s->radius > 0 && s->radius < SIZE_MIN_M;
    if (too_small || s->radius > SIZE_MAX_M) return fault(CAROM_SHAPE_SIZE, -1);
    return valid();
}

static carom_shape_error check_duplicates(const carom_shape *s, int n_edges, double extent)
{
    for (int i = 0; i < n_edges; i++) {
        const carom_vec2 e = edge(s, i);
        /* Not the squares: they underflow for extents the next test refuses. */
        if (fmax(fabs(e.x), fabs(e.y)) <= SHAPE_TOL * extent) {
            return fault(CAROM_SHAPE_DUPLICATE, i);
        }
    }
    if (s->count > 1 && extent < SIZE_MIN_M) return fault(CAROM_SHAPE_SIZE, -1);
    return valid();
}

/* Distance of a vertex from the line of its neighbors, |cross(before, after)| / |before + after|.
 */
static carom_shape_error check_collinear(const carom_shape *s, double extent)
{
    for (int i = 0; i < s->count; i++) {
        const carom_vec2 before = edge(s, i - 1);
        const carom_vec2 after = edge(s, i);
        const double height = fabs(crm_cross(before, after));
        if (height <= SHAPE_TOL * extent * crm_length(crm_add(before, after))) {
            return fault(CAROM_SHAPE_COLLINEAR, i);
        }
    }
    return valid();
}

/* The outline's exterior angles add up to 2 pi times its turning number: 1 for a simple
 * counterclockwise outline, and convex when moreover no angle is negative. */
static carom_shape_error check_turning(const carom_shape *s)
{
    double sum = 0;
    int first_right = -1;
    int beyond = -1; /* where a second turn begins */
    for (int i = 0; i < s->count; i++) {
        const carom_vec2 before = edge(s, i - 1);
        const carom_vec2 after = edge(s, i);
        const double angle = atan2(crm_cross(before, after), crm_dot(before, after));
        if (angle < 0 && first_right < 0) first_right = i;
        sum += angle;
        if (fabs(sum) > 3 * PI && beyond < 0) beyond = i;
    }
    const double turns = floor(sum / (2 * PI) + 0.5);
    if (turns == -1) return fault(CAROM_SHAPE_CLOCKWISE, -1);
    if (turns != 1) return fault(CAROM_SHAPE_CROSSING, beyond >= 0 ? beyond : first_right);
    if (first_right >= 0) return fault(CAROM_SHAPE_REFLEX, first_right);
    return valid();
}

static carom_shape_error check_area(const carom_shape *s, double extent)
{
    double twice = 0;
    for (int i = 1; i + 1 < s->count; i++) {
        twice += crm_cross(crm_sub(vertex(s, i), vertex(s, 0)), edge(s, i));
    }
    if (!(0.5 * twice >= SHAPE_TOL * extent * extent)) return fault(CAROM_SHAPE_AREA, -1);
    return valid();
}

static carom_shape_error find_fault(const carom_shape *s)
{
    if (s->count < 1) return fault(CAROM_SHAPE_COUNT, -1);
    carom_shape_error e = check_numbers(s);
    if (e.fault) return e;
    const double extent = extent_of(s);
    e = check_duplicates(s, s->count > 2 ? s->count : s->count - 1, extent);
    if (e.fault || s->count < 3) return e;
    e = check_collinear(s, extent);
    if (!e.fault) e = check_turning(s);
    if (!e.fault) e = check_area(s, extent);
    return e;
}

carom_status carom_shape_check(const carom_shape *shape, carom_shape_error *error)
{
    if (!shape || (shape->count > 0 && !shape->vertices)) return CAROM_E_ARGUMENT;
    const carom_shape_error e = find_fault(shape);
    if (error) *error = e;
    return e.fault ? CAROM_E_SHAPE : CAROM_OK;
}

static carom_shape_error check_folds(const carom_chain *chain, const carom_shape *s)
{
    const int skip = chain->closed ? 0 : 1;
    for (int i = skip; i < s->count - skip; i++) {
        const carom_vec2 before = edge(s, i - 1);
        const carom_vec2 after = edge(s, i);
        const double cos = crm_dot(before, after);
        if (cos < 0 && fabs(crm_cross(before, after)) <= -SHAPE_TOL * cos) {
            return fault(CAROM_SHAPE_FOLD, i);
        }
    }
    return valid();
}

static carom_shape_error find_chain_fault(const carom_chain *chain)
{
    const carom_shape s = carom_chain_shape(chain);
    if (s.count < (chain->closed ? 3 : 2)) return fault(CAROM_SHAPE_COUNT, -1);
    carom_shape_error e = check_numbers(&s);
    if (!e.fault) e = check_duplicates(&s, carom_chain_links(chain), extent_of(&s));
    if (!e.fault) e = check_folds(chain, &s);
    return e;
}

carom_status carom_chain_check(const carom_chain *chain, carom_shape_error *error)
{
    if (!chain || (chain->count > 0 && !chain->vertices)) return CAROM_E_ARGUMENT;
    const carom_shape_error e = find_chain_fault(chain);
    if (error) *error = e;
    return e.fault ? CAROM_E_SHAPE : CAROM_OK;
}

static const char *sentence(carom_shape_fault what)
{
    switch (what) {
    case CAROM_SHAPE_VALID: return "valid";
    case CAROM_SHAPE_COUNT:
        return "no vertices; give one for a circle, two for a capsule or "
               "segment, three or more for a hull";
    case CAROM_SHAPE_RADIUS: return "the radius must be finite and >= 0, and > 0 for a circle";
    case CAROM_SHAPE_NOT_FINITE: return "a coordinate is NaN or infinite; give finite numbers";
    case CAROM_SHAPE_DUPLICATE: return "equal to the next vertex; remove one of the two";
    case CAROM_SHAPE_CLOCKWISE: return "the vertices run clockwise; reverse their order";
    case CAROM_SHAPE_REFLEX:
        return "the interior angle exceeds 180 degrees; remove the vertex or "
               "split the shape into convex ones";
    case CAROM_SHAPE_COLLINEAR: return "on the line through its neighbors; remove the vertex";
    case CAROM_SHAPE_CROSSING:
        return "the outline crosses itself or winds around more than once; "
               "list each vertex once, counterclockwise";
    case CAROM_SHAPE_AREA:
        return "the area is nearly zero; give a segment of two vertices or move "
               "the vertices apart";
    case CAROM_SHAPE_SIZE: return "a length is outside 1e-40 .. 1e40 m; scale the shape";
    case CAROM_SHAPE_FOLD:
        return "the chain turns back onto itself; move the vertex or end the chain there";
    }
    return "unknown fault";
}

void carom_shape_error_text(carom_shape_error error, char *text, size_t size)
{
    if (error.vertex >= 0) {
        snprintf(text, size, "vertex %d: %s", error.vertex, sentence(error.fault));
    } else {
        snprintf(text, size, "%s", sentence(error.fault));
    }
}
