/* The contact kernels: values against the formulas written once more, reverse derivatives against
 * complex step and central differences, invariance identities, degenerate points. */
#include "carom/collide.h"
#include "contact_ref.h"
#include "fdiff.h"
#include "near.h"
#include "rng.h"

#include <float.h>
#include <string.h>

enum { MAX_N = CONTACT_REF_MAX, N_PARAMETERS = 2 * (4 + 2 * MAX_N) };

typedef struct posed {
    carom_shape shape;
    carom_pose pose;
    carom_vec2 v[MAX_N];
} posed;

typedef struct scene {
    posed s[2];
    carom_recipe recipe;
    carom_contact_bar bar;
} scene;

typedef struct gradient {
    carom_shape_bar bar;
    carom_vec2 v[MAX_N];
} gradient;

static carom_vec2 random_vec(rng *r)
{
    const double x = rng_uniform(r, -1, 1);
    const carom_vec2 v = {x, rng_uniform(r, -1, 1)};
    return v;
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

/* Any vertices will do: a recipe's formulas do not ask for a convex shape. */
static void random_posed(rng *r, int n, posed *p)
{
    p->shape.count = n;
    p->shape.vertices = p->v;
    p->shape.radius = n == 1 || rng_int(r, 2) ? rng_uniform(r, 0.1, 1) : 0;
    for (int i = 0; i < n; i++) p->v[i] = random_vec(r);
    p->pose.angle = rng_uniform(r, -7, 7);
    p->pose.x = rng_uniform(r, -2, 2);
    p->pose.y = rng_uniform(r, -2, 2);
}

static carom_vec2 world(const posed *p, int i)
{
    const carom_vec2 v = p->v[i % p->shape.count];
    const double c = cos(p->pose.angle);
    const double s = sin(p->pose.angle);
    const carom_vec2 x = {p->pose.x + c * v.x - s * v.y, p->pose.y + s * v.x + c * v.y};
    return x;
}

static carom_vec2 minus(carom_vec2 a, carom_vec2 b)
{
    const carom_vec2 d = {a.x - b.x, a.y - b.y};
    return d;
}

static double dot(carom_vec2 a, carom_vec2 b)
{
    return a.x * b.x + a.y * b.y;
}

static double cross(carom_vec2 a, carom_vec2 b)
{
    return a.x * b.y - a.y * b.x;
}

/* Away from the kernels' singular points: lengths above 0.2, slopes of the clip above 1/2. */
static int is_tame(const scene *k)
{
    const carom_recipe r = k->recipe;
    const posed *p = &k->s[r.flipped];
    const posed *q = &k->s[1 - r.flipped];
    const carom_vec2 a = world(p, r.ref);
    const carom_vec2 x = world(q, r.inc);
    if (r.kernel == CAROM_POINT_POINT) return hypot(x.x - a.x, x.y - a.y) > 0.2;
    const carom_vec2 e = minus(world(p, r.ref + 1), a);
    const double l = hypot(e.x, e.y);
    if (l < 0.2) return 0;
    if (r.kernel == CAROM_EDGE_VERTEX) return 1;
    const carom_vec2 w = minus(world(q, r.inc + 1), x);
    const double m = hypot(w.x, w.y);
    return m > 0.2 && fabs(dot(e, w)) > 0.5 * l * m;
}

static void random_scene(rng *r, carom_kernel kernel, scene *k)
{
    do {
        memset(k, 0, sizeof *k);
        const int edges_p = kernel != CAROM_POINT_POINT;
        const int edges_q = kernel == CAROM_EDGE_CLIPPED;
        k->recipe.kernel = (unsigned char)kernel;
        k->recipe.flipped = (unsigned char)(kernel != CAROM_POINT_POINT && rng_int(r, 2));
        k->recipe.at_end = (unsigned char)(kernel == CAROM_EDGE_CLIPPED && rng_int(r, 2));
        posed *p = &k->s[k->recipe.flipped];
        posed *q = &k->s[1 - k->recipe.flipped];
        random_posed(r, 1 + edges_p + rng_int(r, MAX_N - 1), p);
        random_posed(r, 1 + edges_q + rng_int(r, MAX_N - 1), q);
        k->recipe.ref = rng_int(r, p->shape.count);
        k->recipe.inc = rng_int(r, q->shape.count);
        k->bar = random_bar(r);
    } while (!is_tame(k));
}

static carom_contact_point eval(const scene *k, carom_vec2 *n)
{
    return carom_contact_eval(&k->s[0].shape, k->s[0].pose, &k->s[1].shape, k->s[1].pose, k->recipe,
                              n);
}

static void vjp(const scene *k, gradient g[2])
{
    memset(g, 0, 2 * sizeof *g);
    g[0].bar.vertices = g[0].v;
    g[1].bar.vertices = g[1].v;
    carom_contact_vjp(&k->s[0].shape, k->s[0].pose, &k->s[1].shape, k->s[1].pose, k->recipe,
                      &k->bar, &g[0].bar, &g[1].bar);
}

static double inner(const scene *k)
{
    carom_vec2 n;
    const carom_contact_point p = eval(k, &n);
    return dot(k->bar.normal, n) + dot(k->bar.arm_a, p.arm_a) + dot(k->bar.arm_b, p.arm_b) +
           k->bar.gap * p.gap;
}

static double inner_of_scene(void *user)
{
    return inner(user);
}

/* Entries of a gradient and of the parameters in one order. */
static int gradient_entries(gradient *g, double **out)
{
    int n = 0;
    for (int s = 0; s < 2; s++) {
        out[n++] = &g[s].bar.pose.angle;
        out[n++] = &g[s].bar.pose.x;
        out[n++] = &g[s].bar.pose.y;
        out[n++] = &g[s].bar.radius;
        for (int i = 0; i < MAX_N; i++) {
            out[n++] = &g[s].v[i].x;
            out[n++] = &g[s].v[i].y;
        }
    }
    return n;
}

static int parameter_entries(scene *k, double **out)
{
    int n = 0;
    for (int s = 0; s < 2; s++) {
        out[n++] = &k->s[s].pose.angle;
        out[n++] = &k->s[s].pose.x;
        out[n++] = &k->s[s].pose.y;
        out[n++] = &k->s[s].shape.radius;
        for (int i = 0; i < MAX_N; i++) {
            out[n++] = &k->s[s].v[i].x;
            out[n++] = &k->s[s].v[i].y;
        }
    }
    return n;
}

static int complex_entries(contact_ref_shape s[2], double complex **out)
{
    int n = 0;
    for (int k = 0; k < 2; k++) {
        for (int i = 0; i < 3; i++) out[n++] = &s[k].pose[i];
        out[n++] = &s[k].radius;
        for (int i = 0; i < MAX_N; i++) {
            out[n++] = &s[k].v[i][0];
            out[n++] = &s[k].v[i][1];
        }
    }
    return n;
}

static double complex inner_ref(const scene *k, const contact_ref_shape s[2])
{
    const carom_contact_bar *g = &k->bar;
    const double bar[CONTACT_REF_OUTPUTS] = {g->normal.x, g->normal.y, g->arm_a.x, g->arm_a.y,
                                             g->arm_b.x,  g->arm_b.y,  g->gap};
    double complex out[CONTACT_REF_OUTPUTS];
    double complex sum = 0;
    contact_ref_eval(&s[0], &s[1], k->recipe, out);
    for (int i = 0; i < CONTACT_REF_OUTPUTS; i++) sum += bar[i] * out[i];
    return sum;
}

static void check_values(const char *name, const scene *k)
{
    const contact_ref_shape s[2] = {contact_ref_from(&k->s[0].shape, k->s[0].pose),
                                    contact_ref_from(&k->s[1].shape, k->s[1].pose)};
    double complex out[CONTACT_REF_OUTPUTS];
    carom_vec2 n;
    const carom_contact_point p = eval(k, &n);
    const double actual[CONTACT_REF_OUTPUTS] = {n.x,       n.y,       p.arm_a.x, p.arm_a.y,
                                                p.arm_b.x, p.arm_b.y, p.gap};
    contact_ref_eval(&s[0], &s[1], k->recipe, out);
    for (int i = 0; i < CONTACT_REF_OUTPUTS; i++) {
        /* Coordinates up to 4, amplified up to 10 by 1 / |e| and by the slope of the clip. */
        assert_near_case(name, i, actual[i], creal(out[i]), 200 * DBL_EPSILON);
    }
}

/* Complex step has no truncation error: what remains is rounding, on gradients up to about 100. */
static void check_complex_step(const char *name, const scene *k, gradient g[2])
{
    contact_ref_shape s[2] = {contact_ref_from(&k->s[0].shape, k->s[0].pose),
                              contact_ref_from(&k->s[1].shape, k->s[1].pose)};
    double complex *entry[N_PARAMETERS];
    double *actual[N_PARAMETERS];
    const int n = complex_entries(s, entry);
    assert_int_equal(gradient_entries(g, actual), n);
    for (int i = 0; i < n; i++) {
        const double complex kept = *entry[i];
        const double step = 1e-30;
        *entry[i] = kept + step * I;
        const double expected = cimag(inner_ref(k, s)) / step;
        *entry[i] = kept;
        assert_near_case(name, i, *actual[i], expected, 1e-12 * fmax(1, fabs(expected)));
    }
}

static void check_differences(const char *name, scene *k, gradient g[2])
{
    double *entry[N_PARAMETERS];
    double *actual[N_PARAMETERS];
    const int n = parameter_entries(k, entry);
    gradient_entries(g, actual);
    for (int i = 0; i < n; i++) {
        const double expected = fdiff_entry(inner_of_scene, k, entry[i], 1e-3, NULL);
        /* Step 1e-3 at scale 0.2: truncation (1/200)^4 of the fifth derivative's weight. */
        assert_near_case(name, i, *actual[i], expected, 1e-7 * fmax(1, fabs(expected)));
    }
}

/* A common translation changes nothing; a common rotation turns normal and arms:
 *   angle_a_bar + angle_b_bar + cross(D, b_bar) = sum of cross(y, y_bar) over y = n, arm_a, arm_b.
 */
static void check_motions(const char *name, const scene *k, const gradient g[2])
{
    const carom_pose a = g[0].bar.pose;
    const carom_pose b = g[1].bar.pose;
    const double size = 1 + fabs(a.x) + fabs(a.y) + fabs(a.angle) + fabs(b.angle);
    assert_near_case(name, 0, a.x + b.x, 0, 16 * DBL_EPSILON * size);
    assert_near_case(name, 1, a.y + b.y, 0, 16 * DBL_EPSILON * size);
    carom_vec2 n;
    const carom_contact_point p = eval(k, &n);
    const carom_vec2 d = {k->s[1].pose.x - k->s[0].pose.x, k->s[1].pose.y - k->s[0].pose.y};
    const carom_vec2 d_bar = {b.x, b.y};
    const double turned =
        cross(n, k->bar.normal) + cross(p.arm_a, k->bar.arm_a) + cross(p.arm_b, k->bar.arm_b);
    assert_near_case(name, 2, a.angle + b.angle + cross(d, d_bar), turned, 1e-13 * size);
}

/* All lengths times k: n stays, gap and arms scale: Euler's identity for degree 0 and 1. */
static void check_scaling(const char *name, scene *k, gradient g[2])
{
    double *entry[N_PARAMETERS];
    double *bar[N_PARAMETERS];
    const int n = parameter_entries(k, entry);
    gradient_entries(g, bar);
    double sum = 0;
    double size = 1;
    for (int i = 0; i < n; i++) {
        if (entry[i] == &k->s[0].pose.angle || entry[i] == &k->s[1].pose.angle) continue;
        sum += *entry[i] * *bar[i];
        size += fabs(*entry[i] * *bar[i]);
    }
    carom_vec2 normal;
    const carom_contact_point p = eval(k, &normal);
    const double expected =
        dot(k->bar.arm_a, p.arm_a) + dot(k->bar.arm_b, p.arm_b) + k->bar.gap * p.gap;
    assert_near_case(name, 0, sum, expected, 1e-13 * size);
}

/* <bar, J dot> = <J' bar, dot> for a random tangent. */
static void check_forward(const char *name, scene *k, gradient g[2])
{
    rng r = rng_from(1 + (uint64_t)k->recipe.ref);
    gradient t[2];
    double *dot_entry[N_PARAMETERS];
    double *bar_entry[N_PARAMETERS];
    const int n = gradient_entries(t, dot_entry);
    gradient_entries(g, bar_entry);
    double expected = 0;
    double size = 1;
    for (int i = 0; i < n; i++) {
        *dot_entry[i] = rng_uniform(&r, -1, 1);
        expected += *dot_entry[i] * *bar_entry[i];
        size += fabs(*dot_entry[i] * *bar_entry[i]);
    }
    carom_shape_dot dots[2];
    for (int s = 0; s < 2; s++) {
        dots[s].pose = t[s].bar.pose;
        dots[s].radius = t[s].bar.radius;
        dots[s].vertices = t[s].v;
    }
    const carom_contact_dot d = carom_contact_jvp(&k->s[0].shape, k->s[0].pose, &k->s[1].shape,
                                                  k->s[1].pose, k->recipe, &dots[0], &dots[1]);
    const double actual = dot(k->bar.normal, d.normal) + dot(k->bar.arm_a, d.arm_a) +
                          dot(k->bar.arm_b, d.arm_b) + k->bar.gap * d.gap;
    assert_near_case(name, 0, actual, expected, 1e-13 * size);
}

static void check_all(const char *name, scene *k, int differences)
{
    gradient g[2];
    vjp(k, g);
    check_forward(name, k, g);
    check_values(name, k);
    check_complex_step(name, k, g);
    check_motions(name, k, g);
    check_scaling(name, k, g);
    if (differences) check_differences(name, k, g);
}

static void kernels_and_derivatives(void **state)
{
    static const char *const name[] = {"point-point", "edge-vertex", "edge-clipped"};
    (void)state;
    for (int kernel = CAROM_POINT_POINT; kernel <= CAROM_EDGE_CLIPPED; kernel++) {
        rng r = rng_from(100 + (uint64_t)kernel);
        for (int i = 0; i < 4000; i++) {
            scene k;
            random_scene(&r, (carom_kernel)kernel, &k);
            check_all(name[kernel], &k, i < 400);
        }
    }
}

/* A regular hull of n vertices, jittered: what carom_collide gets. */
static void convex_posed(rng *r, int n, posed *p)
{
    random_posed(r, n, p);
    for (int i = 0; i < n; i++) {
        const double t = 6.283185307179586 * (i + rng_uniform(r, -0.2, 0.2)) / n;
        p->v[i].x = cos(t);
        p->v[i].y = 0.7 * sin(t);
    }
}

/* The recipes that carom_collide gives, on all pairs of kinds, apart and overlapping. */
static void recipes_of_manifolds(void **state)
{
    (void)state;
    rng r = rng_from(7);
    int seen[3][2] = {{0}};
    for (int i = 0; i < 6000; i++) {
        scene k = {0}; /* vertices that a shape has not are read, times a gradient of zero */
        convex_posed(&r, 1 + rng_int(&r, 6), &k.s[0]);
        convex_posed(&r, 1 + rng_int(&r, 6), &k.s[1]);
        const carom_manifold m =
            carom_collide(&k.s[0].shape, k.s[0].pose, &k.s[1].shape, k.s[1].pose, HUGE_VAL);
        for (int j = 0; j < m.count; j++) {
            k.recipe = m.points[j].recipe;
            k.bar = random_bar(&r);
            carom_vec2 n;
            const carom_contact_point p = eval(&k, &n);
            assert_memory_equal(&n, &m.normal, sizeof n);
            assert_memory_equal(&p.arm_a, &m.points[j].arm_a, sizeof p.arm_a);
            assert_memory_equal(&p.arm_b, &m.points[j].arm_b, sizeof p.arm_b);
            assert_true(p.gap == m.points[j].gap);
            if (!is_tame(&k)) continue;
            check_all("manifold", &k, 0);
            seen[k.recipe.kernel][k.recipe.flipped]++;
        }
    }
    assert_true(seen[CAROM_POINT_POINT][0] > 200);
    for (int flipped = 0; flipped < 2; flipped++) {
        assert_true(seen[CAROM_EDGE_VERTEX][flipped] > 200);
        assert_true(seen[CAROM_EDGE_CLIPPED][flipped] > 200);
    }
}

/* Cotangents are added to, and vertices that nobody wants are skipped. */
static void cotangents_accumulate(void **state)
{
    (void)state;
    rng r = rng_from(9);
    for (int kernel = CAROM_POINT_POINT; kernel <= CAROM_EDGE_CLIPPED; kernel++) {
        scene k;
        gradient once[2];
        random_scene(&r, (carom_kernel)kernel, &k);
        vjp(&k, once);
        gradient twice[2];
        memcpy(twice, once, sizeof twice);
        twice[0].bar.vertices = twice[0].v;
        twice[1].bar.vertices = NULL;
        carom_contact_vjp(&k.s[0].shape, k.s[0].pose, &k.s[1].shape, k.s[1].pose, k.recipe, &k.bar,
                          &twice[0].bar, &twice[1].bar);
        for (int s = 0; s < 2; s++) {
            const carom_shape_bar *a = &once[s].bar;
            const carom_shape_bar *b = &twice[s].bar;
            const double tol = 1e-13 * (1 + fabs(a->pose.angle) + fabs(a->pose.x));
            assert_near(b->pose.angle, 2 * a->pose.angle, tol);
            assert_near(b->pose.x, 2 * a->pose.x, tol);
            assert_near(b->radius, 2 * a->radius, tol);
        }
        for (int i = 0; i < MAX_N; i++) {
            assert_near(twice[0].v[i].x, 2 * once[0].v[i].x, 1e-13 * (1 + fabs(once[0].v[i].x)));
            assert_true(twice[1].v[i].x == once[1].v[i].x);
        }
    }
}

/* The gap of a face contact, closed form: d gap / d(poses, radii) of a disc over a level edge. */
static void disc_over_edge(void **state)
{
    (void)state;
    scene k;
    memset(&k, 0, sizeof k);
    k.s[0].shape = (carom_shape){0.25, 2, k.s[0].v};
    k.s[1].shape = (carom_shape){0.5, 1, k.s[1].v};
    k.s[0].v[0].x = 2;
    k.s[0].v[1].x = -2;
    k.s[1].pose.x = 0.75;
    k.s[1].pose.y = 3;
    k.recipe.kernel = CAROM_EDGE_VERTEX;
    k.bar.gap = 1;
    carom_vec2 n;
    gradient g[2];
    assert_near(eval(&k, &n).gap, 2.25, 4 * DBL_EPSILON);
    vjp(&k, g);
    assert_near(g[0].bar.pose.angle, -0.75, 4 * DBL_EPSILON); /* the edge rises by x dangle */
    assert_near(g[0].bar.pose.y, -1, 4 * DBL_EPSILON);
    assert_near(g[1].bar.pose.y, 1, 4 * DBL_EPSILON);
    assert_near(g[1].bar.pose.x, 0, 4 * DBL_EPSILON);
    assert_near(g[1].bar.pose.angle, 0, 4 * DBL_EPSILON);
    assert_near(g[0].bar.radius, -1, 4 * DBL_EPSILON);
    assert_near(g[1].bar.radius, -1, 4 * DBL_EPSILON);
}

/* Two vertices at one place: the normal is (1, 0) and held fixed, the gap's slope is along it. */
static void coincident_points(void **state)
{
    (void)state;
    scene k;
    memset(&k, 0, sizeof k);
    k.s[0].shape = (carom_shape){0.25, 1, k.s[0].v};
    k.s[1].shape = (carom_shape){0.5, 1, k.s[1].v};
    k.bar = (carom_contact_bar){{1, 2}, {3, 4}, {5, 6}, 7};
    carom_vec2 n;
    gradient g[2];
    const carom_contact_point p = eval(&k, &n);
    assert_true(n.x == 1 && n.y == 0 && p.gap == -0.75);
    vjp(&k, g);
    assert_true(g[0].bar.pose.x == -7 && g[0].bar.pose.y == 0);
    assert_true(g[1].bar.pose.x == 7 && g[1].bar.pose.y == 0);
    assert_true(g[0].bar.radius == 3 - 7 && g[1].bar.radius == -5 - 7);
    check_forward("coincident", &k, g);
}

/* Vertices that rest: the tangent of the poses alone, a disc rising over a level edge. */
static void forward_without_vertices(void **state)
{
    (void)state;
    scene k;
    memset(&k, 0, sizeof k);
    k.s[0].shape = (carom_shape){0.25, 2, k.s[0].v};
    k.s[1].shape = (carom_shape){0.5, 1, k.s[1].v};
    k.s[0].v[0].x = 2;
    k.s[0].v[1].x = -2;
    k.s[1].pose.x = 0.75;
    k.s[1].pose.y = 3;
    k.recipe.kernel = CAROM_EDGE_VERTEX;
    const carom_shape_dot a = {{1, 0, 0}, 0, NULL};
    const carom_shape_dot b = {{0, 0, 2}, 0.5, NULL};
    const carom_contact_dot d =
        carom_contact_jvp(&k.s[0].shape, k.s[0].pose, &k.s[1].shape, k.s[1].pose, k.recipe, &a, &b);
    assert_near(d.gap, 2 - 0.75 - 0.5, 8 * DBL_EPSILON);
    assert_near(d.normal.x, -1, 8 * DBL_EPSILON);
    assert_near(d.normal.y, 0, 8 * DBL_EPSILON);
}

/* An incident edge square to the reference edge is not cut by its side plane. */
static void square_incident_edge(void **state)
{
    (void)state;
    scene k;
    memset(&k, 0, sizeof k);
    k.s[0].shape = (carom_shape){0, 2, k.s[0].v};
    k.s[1].shape = (carom_shape){0, 2, k.s[1].v};
    k.s[0].v[0].x = 1;
    k.s[1].v[1].y = 1;
    k.recipe.kernel = CAROM_EDGE_CLIPPED;
    k.bar = (carom_contact_bar){{1, 2}, {3, 4}, {5, 6}, 7};
    carom_vec2 n;
    gradient g[2];
    const carom_contact_point p = eval(&k, &n);
    assert_true(p.gap == 0 && p.arm_b.x == 0 && p.arm_b.y == 0);
    vjp(&k, g);
    double *entry[N_PARAMETERS];
    const int count = gradient_entries(g, entry);
    for (int i = 0; i < count; i++) assert_true(isfinite(*entry[i]));
    check_forward("square", &k, g);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(kernels_and_derivatives), cmocka_unit_test(recipes_of_manifolds),
        cmocka_unit_test(cotangents_accumulate),   cmocka_unit_test(disc_over_edge),
        cmocka_unit_test(coincident_points),       cmocka_unit_test(forward_without_vertices),
        cmocka_unit_test(square_incident_edge),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
