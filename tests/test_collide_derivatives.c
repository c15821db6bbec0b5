/* Derivatives of what carom_collide finds, for every pair of kinds and every case: with respect to
 * poses, radii, the shapes' own vertices and their offsets in the bodies' frames.
 *
 * Against complex step, through the search by central differences, as each other's transpose; at
 * ties, where they are one-sided, and as gaps go to 0. */
#include "carom/collide.h"
#include "contact_ref.h"
#include "near.h"
#include "rng.h"

#include <float.h>
#include <stdio.h>
#include <string.h>

enum { MAX_N = 6, N_ENTRIES = 2 * (7 + 2 * MAX_N) };

/* Parameters of one shape, in a fixed order: pose, offset, radius, vertices. */
typedef struct part {
    carom_pose pose;
    carom_pose offset;
    double radius;
    int n;
    carom_vec2 v[MAX_N]; /* before the offset */
} part;

typedef enum kind { CIRCLE, CAPSULE, SEGMENT, HULL, ROUNDED, N_KINDS } kind;
typedef enum situation { AWAY, TOUCHING, OVERLAPPING, INSIDE, N_SITUATIONS } situation;

static const char *const KINDS[] = {"circle", "capsule", "segment", "hull", "rounded hull"};
static const char *const SITUATIONS[] = {"apart", "touching", "overlapping", "center inside"};

static carom_vec2 random_vec(rng *r)
{
    const double x = rng_uniform(r, -1, 1);
    const carom_vec2 v = {x, rng_uniform(r, -1, 1)};
    return v;
}

static carom_pose random_pose(rng *r, double by)
{
    const double angle = rng_uniform(r, -3, 3);
    const carom_vec2 v = random_vec(r);
    const carom_pose p = {angle, by * v.x, by * v.y};
    return p;
}

static void random_part(rng *r, kind k, part *p)
{
    memset(p, 0, sizeof *p);
    p->n = k == CIRCLE ? 1 : k == CAPSULE || k == SEGMENT ? 2 : 3 + rng_int(r, MAX_N - 2);
    p->radius = k == SEGMENT || k == HULL ? 0 : rng_uniform(r, 0.1, 0.5);
    const double start = rng_uniform(r, 0, 6);
    for (int i = 0; i < p->n; i++) {
        const double t = start + 6.283185307179586 * (i + rng_uniform(r, -0.2, 0.2)) / p->n;
        p->v[i].x = cos(t);
        p->v[i].y = 0.7 * sin(t);
    }
    p->offset = random_pose(r, 0.5);
    p->pose = random_pose(r, 1);
}

/* The shape of a body: its vertices, with the offset, go to v. */
static carom_shape shape_of(const part *p, carom_vec2 *v)
{
    carom_vertices_place(p->n, p->v, p->offset, v);
    const carom_shape s = {p->radius, p->n, v};
    return s;
}

static carom_manifold collide(const part p[2])
{
    carom_vec2 v[2][MAX_N];
    const carom_shape a = shape_of(&p[0], v[0]);
    const carom_shape b = shape_of(&p[1], v[1]);
    return carom_collide(&a, p[0].pose, &b, p[1].pose, HUGE_VAL);
}

/* Moves B along the normal to the wanted gap, or its middle into A. */
static void move_to(rng *r, situation s, part p[2])
{
    if (s == INSIDE) {
        p[1].pose = p[0].pose;
        p[1].pose.angle += rng_uniform(r, -3, 3);
        p[1].offset = p[0].offset;
        p[1].offset.x += rng_uniform(r, -0.05, 0.05);
        p[1].offset.y += rng_uniform(r, -0.05, 0.05);
        return;
    }
    const double gap = s == AWAY ? rng_uniform(r, 0.1, 1) : s == TOUCHING ? 1e-9 : -0.05;
    for (int k = 0; k < 4; k++) {
        const carom_manifold m = collide(p);
        p[1].pose.x += (gap - m.distance) * m.normal.x;
        p[1].pose.y += (gap - m.distance) * m.normal.y;
    }
}

static int same_recipe(carom_recipe x, carom_recipe y)
{
    return x.ref == y.ref && x.inc == y.inc && x.kernel == y.kernel && x.flipped == y.flipped &&
           x.at_end == y.at_end;
}

static int entries(part p[2], double **out)
{
    int n = 0;
    for (int s = 0; s < 2; s++) {
        double *const own[7] = {&p[s].pose.angle, &p[s].pose.x,   &p[s].pose.y, &p[s].offset.angle,
                                &p[s].offset.x,   &p[s].offset.y, &p[s].radius};
        for (int i = 0; i < 7; i++) out[n++] = own[i];
        for (int i = 0; i < MAX_N; i++) {
            out[n++] = &p[s].v[i].x;
            out[n++] = &p[s].v[i].y;
        }
    }
    return n;
}

/* The gradient of <bar, point> in the same order; a part holds the cotangents. */
static void gradient(const part p[2], carom_recipe recipe, const carom_contact_bar *bar,
                     part out[2])
{
    carom_vec2 v[2][MAX_N];
    carom_vec2 v_bar[2][MAX_N];
    carom_shape_bar g[2];
    const carom_shape a = shape_of(&p[0], v[0]);
    const carom_shape b = shape_of(&p[1], v[1]);
    memset(g, 0, sizeof g);
    memset(v_bar, 0, sizeof v_bar);
    memset(out, 0, 2 * sizeof *out);
    g[0].vertices = v_bar[0];
    g[1].vertices = v_bar[1];
    carom_contact_vjp(&a, p[0].pose, &b, p[1].pose, recipe, bar, &g[0], &g[1]);
    for (int s = 0; s < 2; s++) {
        out[s].pose = g[s].pose;
        out[s].radius = g[s].radius;
        carom_vertices_place_vjp(p[s].n, p[s].v, p[s].offset, v_bar[s], &out[s].offset, out[s].v);
    }
}

static double inner(const carom_contact_bar *bar, carom_vec2 n, const carom_contact_point *c)
{
    return bar->normal.x * n.x + bar->normal.y * n.y + bar->arm_a.x * c->arm_a.x +
           bar->arm_a.y * c->arm_a.y + bar->arm_b.x * c->arm_b.x + bar->arm_b.y * c->arm_b.y +
           bar->gap * c->gap;
}

/* --- complex step ----------------------------------------------------------------------------- */

typedef struct complex_part {
    double complex pose[3];
    double complex offset[3];
    double complex radius;
    double complex v[MAX_N][2];
} complex_part;

static contact_ref_shape placed(const part *p, const complex_part *c)
{
    contact_ref_shape s = {0};
    s.n = p->n;
    s.radius = c->radius;
    memcpy(s.pose, c->pose, sizeof s.pose);
    const double complex cosine = ccos(c->offset[0]);
    const double complex sine = csin(c->offset[0]);
    for (int i = 0; i < p->n; i++) {
        s.v[i][0] = c->offset[1] + cosine * c->v[i][0] - sine * c->v[i][1];
        s.v[i][1] = c->offset[2] + sine * c->v[i][0] + cosine * c->v[i][1];
    }
    return s;
}

static void make_complex(part p[2], complex_part c[2], double complex **out)
{
    double *in[N_ENTRIES];
    int n = 0;
    for (int s = 0; s < 2; s++) {
        for (int i = 0; i < 3; i++) out[n++] = &c[s].pose[i];
        for (int i = 0; i < 3; i++) out[n++] = &c[s].offset[i];
        out[n++] = &c[s].radius;
        for (int i = 0; i < MAX_N; i++) {
            out[n++] = &c[s].v[i][0];
            out[n++] = &c[s].v[i][1];
        }
    }
    assert_int_equal(entries(p, in), n);
    for (int i = 0; i < n; i++) *out[i] = *in[i];
}

static double complex inner_ref(const part p[2], const complex_part c[2], carom_recipe recipe,
                                const carom_contact_bar *g)
{
    const contact_ref_shape a = placed(&p[0], &c[0]);
    const contact_ref_shape b = placed(&p[1], &c[1]);
    const double bar[CONTACT_REF_OUTPUTS] = {g->normal.x, g->normal.y, g->arm_a.x, g->arm_a.y,
                                             g->arm_b.x,  g->arm_b.y,  g->gap};
    double complex out[CONTACT_REF_OUTPUTS];
    double complex sum = 0;
    contact_ref_eval(&a, &b, recipe, out);
    for (int i = 0; i < CONTACT_REF_OUTPUTS; i++) sum += bar[i] * out[i];
    return sum;
}

/* Complex step has no truncation error: rounding, times a gradient's size. */
static void check_complex_step(const char *name, part p[2], carom_recipe recipe,
                               const carom_contact_bar *bar, part g[2])
{
    complex_part c[2];
    double complex *entry[N_ENTRIES];
    double *actual[N_ENTRIES];
    const double step = 1e-30;
    double size = 1;
    double expected[N_ENTRIES];
    make_complex(p, c, entry);
    const int n = entries(g, actual);
    for (int i = 0; i < n; i++) {
        const double complex kept = *entry[i];
        *entry[i] = kept + step * I;
        expected[i] = cimag(inner_ref(p, c, recipe, bar)) / step;
        *entry[i] = kept;
        size = fmax(size, fabs(expected[i]));
    }
    for (int i = 0; i < n; i++) {
        assert_near_case(name, i, *actual[i], expected[i], 1e-12 * size);
    }
}

/* <bar, J dot> = <J' bar, dot> */
static void check_forward(const char *name, rng *r, part p[2], carom_recipe recipe,
                          const carom_contact_bar *bar, part g[2])
{
    part dot[2];
    double *d[N_ENTRIES];
    double *x[N_ENTRIES];
    memset(dot, 0, sizeof dot);
    const int n = entries(dot, d);
    entries(g, x);
    double expected = 0;
    double size = 1;
    for (int i = 0; i < n; i++) {
        *d[i] = rng_uniform(r, -1, 1);
        expected += *d[i] * *x[i];
        size += fabs(*d[i] * *x[i]);
    }
    carom_vec2 v[2][MAX_N];
    carom_vec2 v_dot[2][MAX_N];
    carom_shape_dot s[2];
    const carom_shape a = shape_of(&p[0], v[0]);
    const carom_shape b = shape_of(&p[1], v[1]);
    for (int k = 0; k < 2; k++) {
        carom_vertices_place_jvp(p[k].n, p[k].v, p[k].offset, dot[k].offset, dot[k].v, v_dot[k]);
        s[k].pose = dot[k].pose;
        s[k].radius = dot[k].radius;
        s[k].vertices = v_dot[k];
    }
    const carom_contact_dot t =
        carom_contact_jvp(&a, p[0].pose, &b, p[1].pose, recipe, &s[0], &s[1]);
    const carom_contact_point moved = {t.arm_a, t.arm_b, t.gap, recipe};
    assert_near_case(name, 0, inner(bar, t.normal, &moved), expected, 1e-13 * size);
}

/* --- through the search ----------------------------------------------------------------------- */

/* <bar, point k> with one parameter moved; 0: another recipe. */
static int moved(part p[2], double *entry, double by, int k, carom_recipe recipe,
                 const carom_contact_bar *bar, double *out)
{
    const double kept = *entry;
    *entry = kept + by;
    const carom_manifold m = collide(p);
    *entry = kept;
    if (k >= m.count || !same_recipe(m.points[k].recipe, recipe)) return 0;
    *out = inner(bar, m.normal, &m.points[k]);
    return 1;
}

/* Differences of what the search finds, while it finds the same features. */
static int check_search(const char *name, part p[2], int k, carom_recipe recipe,
                        const carom_contact_bar *bar, part g[2])
{
    double *entry[N_ENTRIES];
    double *actual[N_ENTRIES];
    const double h = 1e-6;
    const int n = entries(p, entry);
    int n_checked = 0;
    double size = 1;
    entries(g, actual);
    for (int i = 0; i < n; i++) size = fmax(size, fabs(*actual[i]));
    for (int i = 0; i < n; i++) {
        double up;
        double down;
        if (!moved(p, entry[i], h, k, recipe, bar, &up)) continue;
        if (!moved(p, entry[i], -h, k, recipe, bar, &down)) continue;
        /* Rounding 1e-15 / h, truncation h^2 times a third derivative of about size^3. */
        assert_near_case(name, i, *actual[i], (up - down) / (2 * h),
                         1e-8 * size + h * h * size * size * size);
        n_checked++;
    }
    return n_checked == n;
}

static carom_contact_bar random_bar(rng *r)
{
    carom_contact_bar g;
    g.normal = random_vec(r);
    g.arm_a = random_vec(r);
    g.arm_b = random_vec(r);
    g.gap = rng_uniform(r, -1, 1);
    return g;
}

/* Cores closer than this make normals and their differences ill-conditioned: tested apart. */
static int is_tame(const part p[2], const carom_manifold *m, const carom_contact_point *c)
{
    const double l = c->gap + p[0].radius + p[1].radius;
    const int point = c->recipe.kernel == CAROM_POINT_POINT;
    return !m->ambiguous && (!point || fabs(l) > 0.01);
}

static void every_pair_of_kinds(void **state)
{
    (void)state;
    rng r = rng_from(1);
    for (int job = 0; job < N_KINDS * N_KINDS * N_SITUATIONS; job++) {
        const kind a = (kind)(job % N_KINDS);
        const kind b = (kind)(job / N_KINDS % N_KINDS);
        const situation s = (situation)(job / N_KINDS / N_KINDS);
        int n_complex = 0;
        int n_search = 0;
        char name[80];
        snprintf(name, sizeof name, "%s, %s, %s", KINDS[a], KINDS[b], SITUATIONS[s]);
        for (int k = 0; k < 60; k++) {
            part p[2];
            part g[2];
            random_part(&r, a, &p[0]);
            random_part(&r, b, &p[1]);
            move_to(&r, s, p);
            const carom_manifold m = collide(p);
            assert_true(m.count > 0);
            for (int i = 0; i < m.count; i++) {
                const carom_contact_bar bar = random_bar(&r);
                if (!is_tame(p, &m, &m.points[i])) continue;
                gradient(p, m.points[i].recipe, &bar, g);
                check_complex_step(name, p, m.points[i].recipe, &bar, g);
                check_forward(name, &r, p, m.points[i].recipe, &bar, g);
                n_complex++;
                n_search += check_search(name, p, i, m.points[i].recipe, &bar, g);
            }
        }
        /* Two segments that only touch are vertex on vertex, or vertex on face with l = 1e-9: the
         * former are left out. */
        if (n_complex < 10 || n_search < 5) fail_msg("%s: %d, %d", name, n_complex, n_search);
    }
}

/* --- gaps to 0 -------------------------------------------------------------------------------- */

static part box(double half, double x, double y, double angle)
{
    part p;
    memset(&p, 0, sizeof p);
    p.n = 4;
    p.v[0] = (carom_vec2){-half, -half};
    p.v[1] = (carom_vec2){half, -half};
    p.v[2] = (carom_vec2){half, half};
    p.v[3] = (carom_vec2){-half, half};
    p.pose = (carom_pose){angle, x, y};
    return p;
}

static const carom_contact_point *nearest(const carom_manifold *m)
{
    return &m->points[m->count == 2 && m->points[1].gap < m->points[0].gap];
}

/* A vertex over a face, from above, at it, and into it: one recipe, one derivative. */
static void face_gap_to_zero(void **state)
{
    (void)state;
    const double quarter = 0.7853981633974483;
    const carom_contact_bar bar = {{1, 2}, {3, -4}, {-5, 6}, 7};
    part p[2] = {box(1, 0, 0, 0), box(0.5, 0.3, 1 + sqrt(0.5), quarter)};
    const carom_manifold at_0 = collide(p);
    const carom_recipe recipe = nearest(&at_0)->recipe;
    part first[2];
    double *expected[N_ENTRIES];
    gradient(p, recipe, &bar, first);
    const int n = entries(first, expected);
    const double gaps[] = {1e-6, 1e-9, 1e-12, 1e-15, 0, -1e-15, -1e-12, -1e-9, -1e-6};
    for (size_t k = 0; k < sizeof gaps / sizeof *gaps; k++) {
        part g[2];
        double *actual[N_ENTRIES];
        p[1].pose.y = 1 + sqrt(0.5) + gaps[k];
        const carom_manifold m = collide(p);
        assert_true(same_recipe(nearest(&m)->recipe, recipe));
        assert_near_case("gap", (int)k, m.distance, gaps[k], 4 * DBL_EPSILON);
        gradient(p, recipe, &bar, g);
        entries(g, actual);
        for (int i = 0; i < n; i++) {
            /* Linear in the height, with cotangents and coordinates below 10. */
            assert_near_case("face", i, *actual[i], *expected[i], 100 * fabs(gaps[k]) + 1e-13);
        }
        check_complex_step("face", p, recipe, &bar, g);
    }
}

/* Two round vertices: the gap's derivative is the normal at every distance l of the centers, the
 * normal's is 1 / l across it. */
static void vertex_gap_to_zero(void **state)
{
    (void)state;
    for (double l = 0.1; l > 1e-13; l *= 0.1) {
        part p[2];
        part g[2];
        memset(p, 0, sizeof p);
        p[0].n = p[1].n = 1;
        p[0].radius = p[1].radius = 0.5;
        p[1].pose.x = 0.6 * l;
        p[1].pose.y = 0.8 * l;
        const carom_manifold m = collide(p);
        assert_near(m.distance, l - 1, 2 * DBL_EPSILON);
        assert_near(m.normal.x, 0.6, 4 * DBL_EPSILON);
        const carom_contact_bar gap = {{0, 0}, {0, 0}, {0, 0}, 1};
        const carom_contact_bar normal = {{-0.8, 0.6}, {0, 0}, {0, 0}, 0};
        gradient(p, m.points[0].recipe, &gap, g);
        assert_near(g[1].pose.x, 0.6, 4 * DBL_EPSILON);
        assert_near(g[1].pose.y, 0.8, 4 * DBL_EPSILON);
        assert_near(g[1].radius, -1, 0);
        gradient(p, m.points[0].recipe, &normal, g);
        assert_near(g[1].pose.x * l, -0.8, 8 * DBL_EPSILON);
        assert_near(g[1].pose.y * l, 0.6, 8 * DBL_EPSILON);
        check_complex_step("circles", p, m.points[0].recipe, &normal, g);
    }
    /* At l = 0 the normal is (1, 0), is held, and the pair is flagged. */
    part p[2];
    part g[2];
    memset(p, 0, sizeof p);
    p[0].n = p[1].n = 1;
    p[0].radius = p[1].radius = 0.5;
    const carom_contact_bar bar = {{1, 1}, {0, 0}, {0, 0}, 1};
    const carom_manifold m = collide(p);
    assert_true(m.ambiguous && m.normal.x == 1 && m.normal.y == 0);
    gradient(p, m.points[0].recipe, &bar, g);
    assert_true(g[1].pose.x == 1 && g[1].pose.y == 0);
}

/* --- ties ------------------------------------------------------------------------------------- */

/* d distance / d(the angle of B) from one side. */
static double slope_of_distance(part p[2], double by)
{
    const double before = collide(p).distance;
    p[1].pose.angle += by;
    const double after = collide(p).distance;
    p[1].pose.angle -= by;
    return (after - before) / by;
}

static double gap_slope(part p[2], const carom_contact_point *c)
{
    const carom_contact_bar gap = {{0, 0}, {0, 0}, {0, 0}, 1};
    part g[2];
    gradient(p, c->recipe, &gap, g);
    return g[1].pose.angle;
}

/* A box flat on a larger one: the faces are tied and flagged.  The distance has a kink in the angle
 * of the upper box; its slopes on either side are the smallest and the largest of the points'. */
static void flat_boxes(void **state)
{
    (void)state;
    const double gaps[] = {0.1, 1e-9, -0.1};
    for (int k = 0; k < 3; k++) {
        part p[2] = {box(2, 0, 0, 0), box(0.5, 0.25, 2.5 + gaps[k], 0)};
        const carom_manifold m = collide(p);
        assert_int_equal(m.count, 2);
        assert_int_equal(m.ambiguous, 1);
        const double s[2] = {gap_slope(p, &m.points[0]), gap_slope(p, &m.points[1])};
        /* The corner at +-1/2 from the middle falls or rises. */
        assert_near(fmin(s[0], s[1]), -0.5, 4 * DBL_EPSILON);
        assert_near(fmax(s[0], s[1]), 0.5, 4 * DBL_EPSILON);
        /* First order in the step. */
        assert_near(slope_of_distance(p, 1e-6), -0.5, 2e-6);
        assert_near(slope_of_distance(p, -1e-6), 0.5, 2e-6);
    }
}

/* Concentric squares: four faces are tied; A's first is taken, and its derivative is that of the
 * distance when B moves so that this face stays the highest. */
static void tied_faces(void **state)
{
    (void)state;
    const carom_contact_bar gap = {{0, 0}, {0, 0}, {0, 0}, 1};
    part p[2] = {box(1, 0, 0, 0), box(0.5, 0, 0, 0)};
    const carom_manifold m = collide(p);
    assert_int_equal(m.ambiguous, 1);
    assert_true(m.distance == -1.5 && m.normal.y == -1); /* the lower edge is the first */
    part g[2];
    gradient(p, m.points[0].recipe, &gap, g);
    assert_true(g[1].pose.x == 0 && g[1].pose.y == -1);
    p[1].pose.y = -1e-6;
    assert_near(collide(p).distance, -1.5 + 1e-6, 4 * DBL_EPSILON);
    p[1].pose.y = 1e-6; /* the upper edge now: the slope from that side */
    assert_near(collide(p).distance, -1.5 + 1e-6, 4 * DBL_EPSILON);
}

/* A corner in the Voronoi border of a vertex: point-point and point-face agree to first order. */
static void between_vertex_and_face(void **state)
{
    (void)state;
    const carom_contact_bar gap = {{0, 0}, {0, 0}, {0, 0}, 1};
    part slope[2][2];
    for (int k = 0; k < 2; k++) {
        part p[2] = {box(1, 0, 0, 0), box(0.5, 1 + (k ? 1e-9 : -1e-9), 2, 0.7853981633974483)};
        const carom_manifold m = collide(p);
        assert_int_equal(nearest(&m)->recipe.kernel, k ? CAROM_POINT_POINT : CAROM_EDGE_VERTEX);
        gradient(p, nearest(&m)->recipe, &gap, slope[k]);
    }
    double *x[N_ENTRIES];
    double *y[N_ENTRIES];
    const int n = entries(slope[0], x);
    entries(slope[1], y);
    /* 1e-9 over the distance of 0.29, vertices apart: a face's vertex is one of two that count. */
    for (int i = 0; i < n; i++) assert_near_case("border", i, *x[i], *y[i], 2e-8);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_pair_of_kinds), cmocka_unit_test(face_gap_to_zero),
        cmocka_unit_test(vertex_gap_to_zero),  cmocka_unit_test(flat_boxes),
        cmocka_unit_test(tied_faces),          cmocka_unit_test(between_vertex_and_face),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
