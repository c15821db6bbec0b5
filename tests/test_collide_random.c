/* carom_collide against a long-double reference that tries everything, on random pairs of every
 * kind in every situation.  The reference shares no code and no idea with the library.
 *
 * Usage: test_collide_random [pairs per situation (2000) [seed]]; prints the worst errors when
 * given. */
#include "carom/collide.h"
#include "collide_ref.h"
#include "near.h"
#include "rng.h"

#include <float.h>
#include <stdlib.h>

static int n_pairs = 2000;
static uint64_t seed = 20;
static int verbose = 0;

typedef struct body {
    carom_shape shape;
    carom_pose pose;
    carom_vec2 vertices[64];
} body;

typedef struct situation {
    const char *name;
    double size;    /* of the shapes [m] */
    double far;     /* of the pair from the origin [m] */
    double thin;    /* aspect ratio */
    double gap_low; /* of the shapes, log10 of its share of the size; 0: as it comes */
    double gap_high;
    int lattice; /* small integer coordinates; 2: and right angles, rounded; 3: in line */
    int n_max;   /* vertices */
} situation;

static const situation SITUATIONS[] = {
    {"generic", 1, 3, 0.2, 0, 0, 0, 64},
    {"few vertices", 1, 3, 0.2, 0, 0, 0, 5},
    {"near touching", 1, 3, 0.2, -12, -3, 0, 64},
    {"near touching, few vertices", 1, 3, 0.2, -12, -3, 0, 5},
    {"slivers", 1, 3, 1e-3, 0, 0, 0, 8},
    {"slivers near touching", 1, 3, 1e-3, -12, -3, 0, 8},
    {"needles", 1, 3, 1e-8, 0, 0, 0, 4},
    {"finest needles", 1, 3, 1e-11, 0, 0, 0, 4},
    {"lattice", 1, 0, 1, 0, 0, 1, 4},
    {"lattice, turned", 1, 0, 1, 0, 0, 2, 4},
    {"in line", 1, 0, 1, 0, 0, 3, 2},
    {"far", 1, 1e6, 0.2, 0, 0, 0, 16},
    {"small", 1e-6, 3e-6, 0.2, 0, 0, 0, 16},
    {"large", 1e6, 3e6, 0.2, 0, 0, 0, 16},
    {"tiny", 1e-8, 0, 0.2, -9, -3, 0, 16},
    {"huge", 1e8, 0, 0.2, -9, -3, 0, 16},
};

/* Vertices on an ellipse at jittered angles: convex, in any orientation, not around the origin. */
static void random_hull(rng *r, const situation *s, int n, carom_vec2 *v)
{
    const double pi = 3.14159265358979323846;
    const double tilt = rng_uniform(r, 0, 2 * pi);
    const double start = rng_uniform(r, 0, 2 * pi);
    const double width = s->size * rng_uniform(r, 0.3, 1.0);
    const double height = width * (s->thin < 0.1 ? s->thin : rng_uniform(r, s->thin, 1.0));
    const double x0 = width * rng_uniform(r, -0.3, 0.3);
    for (int i = 0; i < n; i++) {
        const double t = start + 2 * pi * (i + rng_uniform(r, -0.3, 0.3)) / n;
        const double x = x0 + width * cos(t);
        const double y = height * sin(t);
        v[i].x = cos(tilt) * x - sin(tilt) * y;
        v[i].y = sin(tilt) * x + cos(tilt) * y;
    }
}

/* Boxes and diamonds on integers, segments, circles of radius 1. */
static void lattice_body(rng *r, int turned, body *b)
{
    const int w = 1 + rng_int(r, 3);
    const int h = 1 + rng_int(r, 3);
    const carom_vec2 box[4] = {{-w, -h}, {w, -h}, {w, h}, {-w, h}};
    const carom_vec2 diamond[4] = {{0, -h}, {w, 0}, {0, h}, {-w, 0}};
    const int kind = rng_int(r, 4);
    b->shape.count = kind == 0 ? 1 : kind == 1 ? 2 : 4;
    for (int i = 0; i < b->shape.count; i++) {
        b->vertices[i] = kind == 3 ? diamond[i] : box[kind == 1 ? 2 * i : i];
    }
    if (kind == 0) b->vertices[0].x = b->vertices[0].y = 0;
    b->shape.radius = b->shape.count == 1 ? 1 : rng_int(r, 2);
    b->pose.angle = turned ? 1.5707963267948966 * (rng_int(r, 9) - 4) : 0;
    if (turned && rng_int(r, 2))
        b->pose.angle += rng_uniform(r, -1, 1) * pow(10, -16 + rng_int(r, 6));
    b->pose.x = rng_int(r, 9) - 4;
    b->pose.y = rng_int(r, 9) - 4;
}

static void random_body(rng *r, const situation *s, body *b)
{
    b->shape.vertices = b->vertices;
    if (s->lattice) {
        lattice_body(r, s->lattice > 1, b);
        return;
    }
    const int many = rng_int(r, 4) == 0;
    b->shape.count = 1 + rng_int(r, many ? s->n_max : 4);
    random_hull(r, s, b->shape.count, b->vertices);
    b->shape.radius = 0;
    if (b->shape.count == 1 || rng_int(r, 3) == 0) {
        b->shape.radius = s->size * rng_uniform(r, 0.01, 0.5);
    }
    b->pose.angle = rng_uniform(r, -4, 4);
    b->pose.x = s->size * rng_uniform(r, -1.5, 1.5);
    b->pose.y = s->size * rng_uniform(r, -1.5, 1.5);
}

/* Moves B along the normal so that the gap becomes the wanted one. */
static void set_gap(rng *r, const situation *s, body *a, body *b)
{
    static collide_ref_shape ra, rb;
    collide_ref_place(&a->shape, a->pose, &b->shape, b->pose, &ra, &rb);
    const collide_ref ref = collide_ref_solve(&ra, &rb);
    const double share = pow(10, rng_uniform(r, s->gap_low, s->gap_high));
    const double gap = s->size * share * (rng_int(r, 2) ? 1 : -1);
    const double move = gap - (double)ref.distance;
    b->pose.x += move * (double)ref.nx;
    b->pose.y += move * (double)ref.ny;
}

/* Circles and segments, from their body's position on, along one line of any direction within
 * rounding: end to end, apart up to 100, or over each other. */
static void pair_in_line(rng *r, body *a, body *b)
{
    body *const of[2] = {a, b};
    const double angle = rng_uniform(r, -4, 4);
    for (int k = 0; k < 2; k++) {
        body *s = of[k];
        s->shape.vertices = s->vertices;
        s->shape.count = 1 + rng_int(r, 2);
        s->shape.radius = s->shape.count == 1 || rng_int(r, 2) ? rng_uniform(r, 0.1, 0.5) : 0;
        s->vertices[0].x = s->vertices[0].y = s->vertices[1].y = 0;
        s->vertices[1].x = rng_uniform(r, 0.5, 2) * (rng_int(r, 2) ? 1 : -1);
        s->pose.angle = angle;
        s->pose.x = s->pose.y = 0;
    }
    const double d = pow(10, rng_uniform(r, -1, 2));
    b->pose.x = d * cos(angle);
    b->pose.y = d * sin(angle);
}

static void random_pair(rng *r, const situation *s, body *a, body *b)
{
    if (s->lattice == 3) {
        pair_in_line(r, a, b);
        return;
    }
    do random_body(r, s, a);
    while (carom_shape_check(&a->shape, NULL));
    do random_body(r, s, b);
    while (carom_shape_check(&b->shape, NULL));
    if (s->gap_low != 0) set_gap(r, s, a, b);
    const double x = s->far * rng_uniform(r, -1, 1);
    const double y = s->far * rng_uniform(r, -1, 1);
    a->pose.x += x;
    a->pose.y += y;
    b->pose.x += x;
    b->pose.y += y;
}

static void describe(const char *name, const body *s)
{
    print_error("%s: pose %.17g %.17g %.17g, radius %.17g\n", name, s->pose.angle, s->pose.x,
                s->pose.y, s->shape.radius);
    for (int i = 0; i < s->shape.count; i++) {
        print_error("    {%.17g, %.17g}\n", s->vertices[i].x, s->vertices[i].y);
    }
}

static long double angle_of(carom_vec2 n, const collide_ref *ref)
{
    return atan2l(fabsl(n.x * ref->ny - n.y * ref->nx), n.x * ref->nx + n.y * ref->ny);
}

/* Distances carry some roundings of the coordinates: the shapes' own and the offset between them.
 */
static double rounding(const collide_ref_shape *b, const collide_ref *ref)
{
    return 40 * DBL_EPSILON * (double)(ref->size + fabsl(b->at_x) + fabsl(b->at_y));
}

/* Worst errors over a situation, relative to the pair's size. */
typedef struct worst {
    double distance;
    double normal; /* angle times the distance of the cores, over the size */
    double points; /* off the outlines of the cores */
} worst;

static void note(double *top, long double error, const collide_ref *ref)
{
    *top = fmax(*top, (double)(error / ref->size));
}

/* What is wrong with the manifold, NULL when nothing. */
static const char *fault_in(const body *a, const body *b, const carom_manifold *m, worst *top)
{
    static collide_ref_shape ra, rb;
    collide_ref_place(&a->shape, a->pose, &b->shape, b->pose, &ra, &rb);
    const collide_ref ref = collide_ref_solve(&ra, &rb);
    /* Of faces tied within 1e-14 of the extent (<= 2 sizes) the first is taken. */
    const double tie = m->ambiguous ? 2e-14 * (double)ref.size : 0;
    const double tol = rounding(&rb, &ref) + tie;
    const carom_vec2 n = m->normal;
    note(&top->distance, fabsl(m->distance - ref.distance), &ref);
    if (!(fabsl(m->distance - ref.distance) <= tol)) return "distance";
    if (!(fabs(hypot(n.x, n.y) - 1) <= 4 * DBL_EPSILON)) return "normal is not a unit vector";
    /* Along the normal the supports are as far apart as the shapes... */
    const long double h = collide_ref_support(&ra, &rb, n.x, n.y);
    if (!(fabsl(h - ref.distance) <= 2 * tol)) return "normal does not attain the distance";
    /* ...and where it is unique, its error is rounding over the distance of the cores.  Below 2e-14
     * of the coordinates (<= 4 sizes) that is no longer told from contact. */
    const int clear = ref.gap > 8e-14L * ref.size;
    const int overlap = ref.gap < 0;
    if (clear) note(&top->normal, angle_of(n, &ref) * ref.gap, &ref);
    if (clear && !(angle_of(n, &ref) * ref.gap <= tol)) return "normal";
    if (overlap && ref.gap - ref.second > tol && !m->ambiguous &&
        !(angle_of(n, &ref) <= 1e-12L)) { /* an edge 1e-3 of the extent, rounded */
        return "normal of the overlap";
    }
    double least = HUGE_VAL;
    for (int i = 0; i < m->count; i++) {
        const carom_contact_point *p = &m->points[i];
        const double dx = (double)rb.at_x + p->arm_b.x - p->arm_a.x;
        const double dy = (double)rb.at_y + p->arm_b.y - p->arm_a.y;
        /* A clipped point lies in the middle of an edge that may be steep: the same roundings. */
        if (!(hypot(dx - p->gap * n.x, dy - p->gap * n.y) <= tol)) return "points off the normal";
        const long double ca =
            collide_ref_outline(&ra, p->arm_a.x - ra.radius * n.x, p->arm_a.y - ra.radius * n.y);
        const long double cb = collide_ref_outline(&rb, rb.at_x + p->arm_b.x + rb.radius * n.x,
                                                   rb.at_y + p->arm_b.y + rb.radius * n.y);
        note(&top->points, fmaxl(ca, cb), &ref);
        /* A vertex past the end of the face by 2e-14 of the coordinates still counts as over it. */
        const double past_end = tol + 8e-14 * (double)ref.size;
        if (!(ca <= past_end)) return "point off A";
        if (!(cb <= past_end)) return "point off B";
        least = fmin(least, p->gap);
    }
    if (!(fabs(least - m->distance) <= tol)) return "no point has the distance";
    return NULL;
}

static void check_situation(const situation *s, uint64_t start)
{
    rng r = rng_from(start);
    worst top = {0, 0, 0};
    static body a, b;
    for (int k = 0; k < n_pairs; k++) {
        random_pair(&r, s, &a, &b);
        const carom_manifold m = carom_collide(&a.shape, a.pose, &b.shape, b.pose, HUGE_VAL);
        const char *fault = fault_in(&a, &b, &m, &top);
        if (fault) {
            describe("A", &a);
            describe("B", &b);
            fail_msg("%s, pair %d: %s; distance %.17g, normal (%.17g, %.17g), %d points", s->name,
                     k, fault, m.distance, m.normal.x, m.normal.y, m.count);
        }
    }
    if (verbose) {
        print_message("%-28s %d pairs, worst / size: distance %.1e, normal %.1e, points %.1e\n",
                      s->name, n_pairs, top.distance, top.normal, top.points);
    }
}

static void every_situation(void **state)
{
    (void)state;
    for (size_t k = 0; k < sizeof SITUATIONS / sizeof *SITUATIONS; k++) {
        check_situation(&SITUATIONS[k], seed + k);
    }
}

/* Pairs that random search found in earlier versions. */
static void pairs_of_earlier_faults(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        double radius[2];
        int n[2];
        carom_pose pose[2];
        carom_vec2 v[2][4];
    } pairs[] = {
        {"needles crossed: tied faces side by side, the foot on the second",
         {0.2971669063067256, 0},
         {3, 4},
         {{-1.3238286934156376, 1.5554901371516232, -2.3145150440098075},
          {3.8918287129382563, 1.2259162948382758, -2.6124770679368572}},
         {{{0.11672561444377559, -0.49986436372594795},
           {-0.21191156030224031, 0.90748751050136678},
           {0.077072632345587033, -0.33005491141047566}},
          {{-0.04458997493346549, -0.053116458618272654},
           {-0.25717438921403907, -0.30635121065210369},
           {-0.041967476623794062, -0.049992486858681552},
           {0.18314133961391249, 0.21816158009885001}}}},
        {"a segment square to a segment's end: the cut would be anywhere",
         {1, 0},
         {2, 2},
         {{6.2831853071795862, 3, 0}, {-4.7123889803846897, -4, 1}},
         {{{-3, -3}, {3, 3}}, {{-3, -3}, {3, 3}}}},
        {"a tip on a tip, faces parallel",
         {1, 1},
         {4, 4},
         {{0, 4, 0}, {0, -1, 0}},
         {{{0, -3}, {3, 0}, {0, 3}, {-3, 0}}, {{0, -2}, {2, 0}, {0, 2}, {-2, 0}}}},
    };
    for (size_t k = 0; k < sizeof pairs / sizeof *pairs; k++) {
        static body s[2];
        worst top = {0, 0, 0};
        for (int i = 0; i < 2; i++) {
            s[i].shape.radius = pairs[k].radius[i];
            s[i].shape.count = pairs[k].n[i];
            s[i].shape.vertices = s[i].vertices;
            s[i].pose = pairs[k].pose[i];
            for (int j = 0; j < 4; j++) s[i].vertices[j] = pairs[k].v[i][j];
        }
        const carom_manifold m =
            carom_collide(&s[0].shape, s[0].pose, &s[1].shape, s[1].pose, HUGE_VAL);
        const char *fault = fault_in(&s[0], &s[1], &m, &top);
        if (fault) fail_msg("%s: %s", pairs[k].name, fault);
    }
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(every_situation),
                                       cmocka_unit_test(pairs_of_earlier_faults)};
    if (argc > 1) n_pairs = atoi(argv[1]);
    if (argc > 2) seed = strtoull(argv[2], NULL, 10);
    verbose = argc > 1;
    return cmocka_run_group_tests(tests, NULL, NULL);
}
