/* Validation of shapes, fault by fault; shapes offset in their body's frame. */
#include "carom/shape.h"
#include "fdiff.h"
#include "near.h"

#include <float.h>
#include <string.h>

static const double PI = 3.14159265358979323846;

typedef struct fault_case {
    const char *name;
    double radius;
    int count;
    carom_shape_fault fault;
    int vertex;
    const char *text;
    carom_vec2 v[10];
} fault_case;

#define TEXT_DUPLICATE "equal to the next vertex; remove one of the two"
#define TEXT_LINE      "on the line through its neighbors; remove the vertex"
#define TEXT_REFLEX                                                                                \
    "the interior angle exceeds 180 degrees; remove the vertex or split the shape into convex "    \
    "ones"
#define TEXT_CROSSING                                                                              \
    "the outline crosses itself or winds around more than once; list each vertex once, "           \
    "counterclockwise"
#define TEXT_RADIUS "the radius must be finite and >= 0, and > 0 for a circle"
#define TEXT_NAN    "a coordinate is NaN or infinite; give finite numbers"
#define TEXT_SIZE   "a length is outside 1e-40 .. 1e40 m; scale the shape"
#define TEXT_AREA                                                                                  \
    "the area is nearly zero; give a segment of two vertices or move the vertices apart"

static const fault_case FAULTS[] = {
    {"no vertices",
     1,
     0,
     CAROM_SHAPE_COUNT,
     -1,
     "no vertices; give one for a circle, two for a capsule or segment, three or more for a hull",
     {{0, 0}}},
    {"negative count",
     1,
     -3,
     CAROM_SHAPE_COUNT,
     -1,
     "no vertices; give one for a circle, two for a capsule or segment, three or more for a hull",
     {{0, 0}}},
    {"circle without radius", 0, 1, CAROM_SHAPE_RADIUS, -1, TEXT_RADIUS, {{0, 0}}},
    {"negative radius", -0.1, 3, CAROM_SHAPE_RADIUS, -1, TEXT_RADIUS, {{0, 0}, {1, 0}, {0, 1}}},
    {"NaN radius", NAN, 2, CAROM_SHAPE_RADIUS, -1, TEXT_RADIUS, {{0, 0}, {1, 0}}},
    {"infinite radius", HUGE_VAL, 1, CAROM_SHAPE_RADIUS, -1, TEXT_RADIUS, {{0, 0}}},
    {"NaN x", 0, 3, CAROM_SHAPE_NOT_FINITE, 1, "vertex 1: " TEXT_NAN, {{0, 0}, {NAN, 0}, {0, 1}}},
    {"NaN y", 0, 3, CAROM_SHAPE_NOT_FINITE, 2, "vertex 2: " TEXT_NAN, {{0, 0}, {1, 0}, {0, NAN}}},
    {"infinite", 0, 2, CAROM_SHAPE_NOT_FINITE, 0, "vertex 0: " TEXT_NAN, {{-HUGE_VAL, 0}, {1, 0}}},
    {"NaN circle", 1, 1, CAROM_SHAPE_NOT_FINITE, 0, "vertex 0: " TEXT_NAN, {{0, NAN}}},
    {"segment of no length",
     1,
     2,
     CAROM_SHAPE_DUPLICATE,
     0,
     "vertex 0: " TEXT_DUPLICATE,
     {{1, 2}, {1, 2}}},
    {"duplicate",
     0,
     4,
     CAROM_SHAPE_DUPLICATE,
     1,
     "vertex 1: " TEXT_DUPLICATE,
     {{0, 0}, {1, 0}, {1, 0}, {0, 1}}},
    {"duplicate across the end",
     0,
     4,
     CAROM_SHAPE_DUPLICATE,
     3,
     "vertex 3: " TEXT_DUPLICATE,
     {{0, 0}, {1, 0}, {0, 1}, {0, 0}}},
    {"nearly duplicate",
     0,
     4,
     CAROM_SHAPE_DUPLICATE,
     1,
     "vertex 1: " TEXT_DUPLICATE,
     {{0, 0}, {1, 0}, {1, 9e-13}, {0, 1}}},
    {"all at one place",
     0,
     3,
     CAROM_SHAPE_DUPLICATE,
     0,
     "vertex 0: " TEXT_DUPLICATE,
     {{1, 1}, {1, 1}, {1, 1}}},
    {"collinear",
     0,
     4,
     CAROM_SHAPE_COLLINEAR,
     1,
     "vertex 1: " TEXT_LINE,
     {{0, 0}, {1, 0}, {2, 0}, {0, 2}}},
    {"collinear at the start",
     0,
     4,
     CAROM_SHAPE_COLLINEAR,
     0,
     "vertex 0: " TEXT_LINE,
     {{1, 0}, {2, 0}, {0, 2}, {0, 0}}},
    {"all collinear",
     0,
     3,
     CAROM_SHAPE_COLLINEAR,
     0,
     "vertex 0: " TEXT_LINE,
     {{0, 0}, {1, 1}, {2, 2}}},
    {"nearly collinear",
     0,
     4,
     CAROM_SHAPE_COLLINEAR,
     1,
     "vertex 1: " TEXT_LINE,
     {{0, 0}, {1, -1e-12}, {2, 0}, {0, 2}}},
    {"spike",
     0,
     5,
     CAROM_SHAPE_COLLINEAR,
     2,
     "vertex 2: " TEXT_LINE,
     {{0, 0}, {1, 0}, {2, 0.5}, {1, 0}, {0, 1}}},
    {"clockwise",
     0,
     3,
     CAROM_SHAPE_CLOCKWISE,
     -1,
     "the vertices run clockwise; reverse their order",
     {{0, 0}, {0, 1}, {1, 0}}},
    {"clockwise and not convex",
     0,
     4,
     CAROM_SHAPE_CLOCKWISE,
     -1,
     "the vertices run clockwise; reverse their order",
     {{0, 0}, {0, 2}, {0.5, 0.5}, {2, 0}}},
    {"reflex",
     0,
     4,
     CAROM_SHAPE_REFLEX,
     2,
     "vertex 2: " TEXT_REFLEX,
     {{0, 0}, {2, 0}, {0.5, 0.5}, {0, 2}}},
    {"barely reflex",
     0,
     4,
     CAROM_SHAPE_REFLEX,
     1,
     "vertex 1: " TEXT_REFLEX,
     {{0, 0}, {1, 1e-11}, {2, 0}, {0, 2}}},
    /* Every turn to the left, but the fifth vertex lies beyond a full turn: turning number 2. */
    {"pentagram",
     0,
     5,
     CAROM_SHAPE_CROSSING,
     3,
     "vertex 3: " TEXT_CROSSING,
     {{0, 1}, {-0.6, -0.8}, {0.95, 0.3}, {-0.95, 0.3}, {0.6, -0.8}}},
    {"pentagram clockwise",
     0,
     5,
     CAROM_SHAPE_CROSSING,
     3,
     "vertex 3: " TEXT_CROSSING,
     {{0, 1}, {0.6, -0.8}, {-0.95, 0.3}, {0.95, 0.3}, {-0.6, -0.8}}},
    {"bow tie",
     0,
     4,
     CAROM_SHAPE_CROSSING,
     1,
     "vertex 1: " TEXT_CROSSING,
     {{0, 0}, {1, 1}, {1, 0}, {0, 1}}},
    {"triangle twice around",
     0,
     6,
     CAROM_SHAPE_CROSSING,
     4,
     "vertex 4: " TEXT_CROSSING,
     {{0, 0}, {1, 0}, {0, 1}, {0, 0}, {1, 0}, {0, 1}}},
    {"thin", 0, 3, CAROM_SHAPE_AREA, -1, TEXT_AREA, {{0, 0}, {1, 0}, {0.5, 1.9e-12}}},
    {"too far out", 0, 2, CAROM_SHAPE_SIZE, 1, "vertex 1: " TEXT_SIZE, {{0, 0}, {0, -1e41}}},
    {"too small", 0, 3, CAROM_SHAPE_SIZE, -1, TEXT_SIZE, {{0, 0}, {1e-41, 0}, {0, 1e-41}}},
    {"radius too large", 1e41, 1, CAROM_SHAPE_SIZE, -1, TEXT_SIZE, {{0, 0}}},
    {"radius too small", 1e-41, 1, CAROM_SHAPE_SIZE, -1, TEXT_SIZE, {{0, 0}}},
};

static void faults_are_named(void **state)
{
    (void)state;
    for (size_t k = 0; k < sizeof FAULTS / sizeof *FAULTS; k++) {
        const fault_case *c = &FAULTS[k];
        const carom_shape shape = {c->radius, c->count, c->v};
        carom_shape_error e = {CAROM_SHAPE_VALID, 99};
        char text[200];
        if (carom_shape_check(&shape, NULL) != CAROM_E_SHAPE) fail_msg("%s: accepted", c->name);
        assert_int_equal(carom_shape_check(&shape, &e), CAROM_E_SHAPE);
        if (e.fault != c->fault || e.vertex != c->vertex) {
            fail_msg("%s: fault %d at %d, expected %d at %d", c->name, (int)e.fault, e.vertex,
                     (int)c->fault, c->vertex);
        }
        carom_shape_error_text(e, text, sizeof text);
        assert_string_equal(text, c->text);
    }
}

static void text_is_cut_to_size(void **state)
{
    (void)state;
    const carom_shape_error e = {CAROM_SHAPE_REFLEX, 12};
    char text[16];
    memset(text, 'x', sizeof text);
    carom_shape_error_text(e, text, 11);
    assert_string_equal(text, "vertex 12:");
    assert_int_equal(text[11], 'x');
    carom_shape_error_text(e, text, 1);
    assert_string_equal(text, "");
}

static void null_is_an_argument_error(void **state)
{
    (void)state;
    const carom_shape none = {1, 1, NULL};
    assert_int_equal(carom_shape_check(NULL, NULL), CAROM_E_ARGUMENT);
    assert_int_equal(carom_shape_check(&none, NULL), CAROM_E_ARGUMENT);
}

static void accept(const char *name, double radius, int n, const carom_vec2 *v)
{
    const carom_shape shape = {radius, n, v};
    carom_shape_error e;
    if (carom_shape_check(&shape, &e) == CAROM_OK) return;
    fail_msg("%s: fault %d at vertex %d", name, (int)e.fault, e.vertex);
}

static void good_shapes_pass(void **state)
{
    (void)state;
    const carom_vec2 box[4] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
    const carom_vec2 thin[3] = {{0, 0}, {1, 0}, {0.5, 2.1e-12}};
    const carom_vec2 nearly_flat[4] = {{0, 0}, {1, -3e-12}, {2, 0}, {0, 2}};
    accept("circle", 1, 1, box);
    accept("segment", 0, 2, box);
    accept("capsule", 1, 2, box);
    accept("box", 0, 4, box);
    accept("rounded box", 0.5, 4, box);
    accept("needle", 0, 3, thin);
    accept("nearly flat", 0, 4, nearly_flat);
    carom_vec2 v[4];
    const double sizes[] = {1e-39, 1e-8, 1e8, 1e39};
    for (int k = 0; k < 4; k++) {
        for (int i = 0; i < 4; i++) {
            v[i].x = sizes[k] * box[i].x;
            v[i].y = sizes[k] * box[i].y;
        }
        accept("scaled box", 0, 4, v);
    }
}

/* A circle of thousands of vertices: height of a vertex over its neighbors' line 5e-8 of the size.
 */
static void many_vertices_pass(void **state)
{
    (void)state;
    enum { N = 20000 };
    static carom_vec2 v[N];
    for (int i = 0; i < N; i++) {
        v[i].x = cos(2 * PI * i / N);
        v[i].y = sin(2 * PI * i / N);
    }
    accept("circle of vertices", 0, N, v);
    const carom_vec2 kept = v[777];
    v[777] = v[778];
    v[778] = kept;
    carom_shape_error e;
    const carom_shape shape = {0, N, v};
    assert_int_equal(carom_shape_check(&shape, &e), CAROM_E_SHAPE);
    /* Edges 776-777 and 778-779 cross; the first turn to the right is at 777. */
    assert_int_equal(e.fault, CAROM_SHAPE_CROSSING);
    assert_int_equal(e.vertex, 777);
}

typedef struct place_scene {
    carom_vec2 in[3];
    carom_pose offset;
    carom_vec2 bar[3];
} place_scene;

static double place_inner(void *user)
{
    const place_scene *k = user;
    carom_vec2 out[3];
    double sum = 0;
    carom_vertices_place(3, k->in, k->offset, out);
    for (int i = 0; i < 3; i++) sum += k->bar[i].x * out[i].x + k->bar[i].y * out[i].y;
    return sum;
}

static void offset_shapes(void **state)
{
    (void)state;
    place_scene k = {{{1, 0}, {0, 2}, {-1, 0.5}}, {PI / 2, 3, 4}, {{1, 2}, {-3, 0.5}, {0.25, -1}}};
    carom_vec2 out[3];
    carom_vertices_place(3, k.in, k.offset, out);
    assert_near(out[0].x, 3, 4 * DBL_EPSILON);
    assert_near(out[0].y, 5, 4 * DBL_EPSILON);
    assert_near(out[1].x, 1, 4 * DBL_EPSILON);
    carom_pose offset_bar = {1, 1, 1};
    carom_vec2 in_bar[3] = {{1, 1}, {1, 1}, {1, 1}};
    k.offset.angle = 0.7;
    carom_vertices_place_vjp(3, k.in, k.offset, k.bar, &offset_bar, in_bar);
    double *entry[9] = {&k.offset.angle, &k.offset.x, &k.offset.y};
    const double actual[9] = {offset_bar.angle, offset_bar.x, offset_bar.y,
                              in_bar[0].x,      in_bar[0].y,  in_bar[1].x,
                              in_bar[1].y,      in_bar[2].x,  in_bar[2].y};
    for (int i = 0; i < 3; i++) {
        entry[3 + 2 * i] = &k.in[i].x;
        entry[4 + 2 * i] = &k.in[i].y;
    }
    for (int i = 0; i < 9; i++) {
        /* h^4 of the differences at h = 1e-3. */
        assert_near_case("offset", i, actual[i] - 1,
                         fdiff_entry(place_inner, &k, entry[i], 1e-3, NULL), 1e-10);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(faults_are_named),          cmocka_unit_test(text_is_cut_to_size),
        cmocka_unit_test(null_is_an_argument_error), cmocka_unit_test(good_shapes_pass),
        cmocka_unit_test(many_vertices_pass),        cmocka_unit_test(offset_shapes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
