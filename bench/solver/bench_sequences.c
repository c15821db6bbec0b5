/* Factorizations per step while scenes come to rest: one contact problem per step of 1/60 s, solved
 * from the solution of the step before.  Time stepping of its own, so that nothing but the solver
 * is measured: gaps close within the step at most, joint errors do, overlap stays; x += h v.
 * Usage: bench_sequences [largest pile, 1000] */
#include "carom/contact.h"
#include "clock.h"
#include "contact_case.h"
#include "rng.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double H = 1.0 / 60;
static const double GRAVITY = 9.81;
static const double FRICTION = 0.5;

enum { N_STEPS = 300, PER_BODY = 6 };

/* What touches: -1 the floor, -2 and -3 the walls; two feet count apart. */
typedef struct touch {
    int a;
    int b;
    int foot;
    double ln;
    double lt;
    unsigned char mode;
} touch;

typedef struct scene {
    int n;
    double *x; /* 3 n: angle, x, y */
    double *v; /* 3 n */
    double *radius;
    double *le;  /* 2 n */
    double half; /* of the distance of the walls */
    touch *now;
    touch *before;
    int n_now;
    int n_before;
} scene;

static scene scene_new(int n)
{
    scene s = {.n = n};
    const size_t m = (size_t)n;
    s.x = calloc(9 * m, sizeof(double));
    s.now = calloc(2 * PER_BODY * m, sizeof(touch));
    if (!s.x || !s.now) exit(1);
    s.v = s.x + 3 * n;
    s.radius = s.v + 3 * n;
    s.le = s.radius + n;
    s.before = s.now + PER_BODY * m;
    return s;
}

static void scene_free(scene *s)
{
    free(s->x);
    free(s->now < s->before ? s->now : s->before);
}

/* A contact of body b with a (or the world) along n, found at offsets ra and rb. */
static void add_contact(scene *s, contact_case *c, touch t, const double *ra, const double *rb,
                        const double *n, double gap)
{
    static const double zero[2] = {0, 0};
    for (int q = 0; q < s->n_before; q++) {
        const touch *old = &s->before[q];
        if (old->a == t.a && old->b == t.b && old->foot == t.foot) t = *old;
    }
    const int k = contact_case_contact(c, t.a < 0 ? -1 : t.a, t.b, ra ? ra : zero, rb, n, FRICTION,
                                       fmax(gap, 0) / H);
    c->x.ln[k] = t.ln;
    c->x.lt[k] = t.lt;
    c->x.mode[k] = t.mode;
    s->now[s->n_now++] = t;
}

/* Touching within a step is possible. */
static int is_close(const scene *s, int a, int b, double gap)
{
    double speed = 2 * GRAVITY * H;
    for (int i = 1; i < 3; i++)
        speed += fabs(s->v[3 * b + i]) + (a < 0 ? 0 : fabs(s->v[3 * a + i]));
    return gap < H * speed;
}

static void touch_plane(scene *s, contact_case *c, int plane, int b, const double *n, double gap)
{
    const double rb[2] = {-s->radius[b] * n[0], -s->radius[b] * n[1]};
    const touch t = {plane, b, 0, 0, 0, CAROM_UNKNOWN};
    if (is_close(s, -1, b, gap)) add_contact(s, c, t, NULL, rb, n, gap);
}

static void touch_disc(scene *s, contact_case *c, int a, int b)
{
    const double dx = s->x[3 * b + 1] - s->x[3 * a + 1];
    const double dy = s->x[3 * b + 2] - s->x[3 * a + 2];
    const double distance = hypot(dx, dy);
    const double gap = distance - s->radius[a] - s->radius[b];
    if (!is_close(s, a, b, gap)) return;
    const double n[2] = {dx / distance, dy / distance};
    const double ra[2] = {s->radius[a] * n[0], s->radius[a] * n[1]};
    const double rb[2] = {-s->radius[b] * n[0], -s->radius[b] * n[1]};
    add_contact(s, c, (touch){a, b, 0, 0, 0, CAROM_UNKNOWN}, ra, rb, n, gap);
}

static void find_pile(scene *s, contact_case *c)
{
    static const double up[2] = {0, 1};
    static const double right[2] = {1, 0};
    static const double left[2] = {-1, 0};
    for (int b = 0; b < s->n; b++) {
        touch_plane(s, c, -1, b, up, s->x[3 * b + 2] - s->radius[b]);
        touch_plane(s, c, -2, b, right, s->x[3 * b + 1] + s->half - s->radius[b]);
        touch_plane(s, c, -3, b, left, s->half - s->x[3 * b + 1] - s->radius[b]);
        for (int a = 0; a < b; a++) {
            if (fabs(s->x[3 * a + 1] - s->x[3 * b + 1]) < 1) touch_disc(s, c, a, b);
        }
    }
}

/* Unit boxes: the feet of each on the top of the one below. */
static void find_stack(scene *s, contact_case *c)
{
    for (int b = 0; b < s->n; b++) {
        const double *x = s->x + 3 * b;
        const double *below = b ? x - 3 : NULL;
        const double angle = below ? below[0] : 0;
        const double n[2] = {-sin(angle), cos(angle)};
        for (int e = 0; e < 2; e++) {
            const double foot = e - 0.5;
            const double rb[2] = {foot * cos(x[0]) + 0.5 * sin(x[0]),
                                  foot * sin(x[0]) - 0.5 * cos(x[0])};
            double ra[2] = {x[1] + rb[0], x[2] + rb[1]};
            if (below) ra[0] -= below[1];
            if (below) ra[1] -= below[2];
            const double gap = ra[0] * n[0] + ra[1] * n[1] - (below ? 0.5 : 0);
            const touch t = {b - 1, b, e, 0, 0, CAROM_UNKNOWN};
            if (is_close(s, b - 1, b, gap)) add_contact(s, c, t, ra, rb, n, gap);
        }
    }
}

/* Links of unit length between hinges. */
static void find_chain(scene *s, contact_case *c)
{
    for (int b = 0; b < s->n; b++) {
        const double *x = s->x + 3 * b;
        const double rb[2] = {-0.5 * cos(x[0]), -0.5 * sin(x[0])};
        double ra[2] = {0, 0};
        double error[2] = {-x[1] - rb[0], -x[2] - rb[1]};
        if (b) {
            ra[0] = 0.5 * cos(x[-3]);
            ra[1] = 0.5 * sin(x[-3]);
            for (int i = 0; i < 2; i++) error[i] += x[i - 2] + ra[i];
        }
        const int r = contact_case_hinge(c, b - 1, b, ra, rb);
        for (int i = 0; i < 2; i++) {
            c->ce[r + i] = error[i] / H;
            c->x.le[r + i] = s->le[r + i];
        }
    }
}

/* Step by step; per step the statistics of its problem. */
typedef void find(scene *s, contact_case *c);

static carom_contact_stats step(scene *s, find *find_contacts, carom_contact_solver *solver)
{
    contact_case c = contact_case_new(s->n, PER_BODY * s->n, 2 * s->n);
    carom_contact_stats st;
    for (int b = 0; b < s->n; b++) {
        const double *v = s->v + 3 * b;
        const double r = s->radius[b];
        contact_case_body(&c, b, 1, r > 0 ? 0.5 * r * r : 1.0 / 6, v[0], v[1], v[2] - H * GRAVITY);
    }
    s->n_now = 0;
    find_contacts(s, &c);
    carom_contact_solve(solver, &c.p, CAROM_GUESS_IMPULSES, &c.x, &st);
    for (int i = 0; st.status >= 0 && i < 3 * s->n; i++) {
        s->v[i] = c.x.v[i];
        s->x[i] += H * s->v[i];
    }
    for (int k = 0; k < s->n_now; k++) {
        s->now[k].ln = c.x.ln[k];
        s->now[k].lt = c.x.lt[k];
        s->now[k].mode = c.x.mode[k];
    }
    for (int r = 0; r < c.p.n_joint_rows; r++) s->le[r] = c.x.le[r];
    touch *swap = s->before;
    s->before = s->now;
    s->now = swap;
    s->n_before = s->n_now;
    contact_case_free(&c);
    return st;
}

static int compare_ints(const void *a, const void *b)
{
    return *(const int *)a - *(const int *)b;
}

/* One line; returns how many steps were not solved. */
static int run(const char *name, scene s, find *find_contacts)
{
    int each[N_STEPS];
    double sum = 0;
    double end = 0;
    double residual = 0;
    int failed = 0;
    carom_contact_solver *solver;
    if (carom_contact_create(NULL, NULL, &solver) < 0) exit(1);
    const double from = cpu_seconds();
    for (int i = 0; i < N_STEPS; i++) {
        const carom_contact_stats st = step(&s, find_contacts, solver);
        each[i] = st.factorizations;
        sum += each[i];
        if (i >= N_STEPS * 3 / 4) end += each[i];
        if (st.status == CAROM_OK) residual = fmax(residual, st.residual);
        failed += st.status != CAROM_OK;
    }
    const double seconds = cpu_seconds() - from;
    qsort(each, N_STEPS, sizeof *each, compare_ints);
    printf("%-6s %6d %8d %7d %7.2f %7d %7d %7d %7.2f %9.1e %9.1f\n", name, s.n, s.n_now, failed,
           sum / N_STEPS, each[N_STEPS / 2], each[N_STEPS * 95 / 100], each[N_STEPS - 1],
           end / (N_STEPS / 4), residual, 1e6 * seconds / N_STEPS);
    fflush(stdout);
    carom_contact_destroy(solver);
    scene_free(&s);
    return failed;
}

static scene stack(int n)
{
    scene s = scene_new(n);
    rng r = rng_from(1);
    for (int i = 0; i < n; i++) {
        s.x[3 * i + 1] = rng_uniform(&r, -0.02, 0.02);
        s.x[3 * i + 2] = 0.6 + 1.1 * i;
    }
    return s;
}

static scene pile(int n)
{
    scene s = scene_new(n);
    rng r = rng_from(2);
    const int columns = (int)ceil(sqrt(2.0 * n));
    s.half = 0.25 * columns + 0.05;
    for (int i = 0; i < n; i++) {
        s.radius[i] = rng_uniform(&r, 0.18, 0.22);
        s.x[3 * i + 1] = 0.5 * (i % columns) - 0.25 * (columns - 1) + rng_uniform(&r, -0.02, 0.02);
        s.x[3 * i + 2] = 0.3 + 0.5 * (i / columns);
    }
    return s;
}

static scene chain(int n)
{
    scene s = scene_new(n);
    for (int i = 0; i < n; i++) s.x[3 * i + 1] = 0.5 + i;
    return s;
}

int main(int argc, char **argv)
{
    const int most = argc > 1 ? atoi(argv[1]) : 1000;
    const int piles[] = {24, 100, 300, 1000};
    int failed = 0;
    printf("factorizations per step (of all islands together), %d steps\n"
           "scene  bodies contacts unsolved    mean  median    95 %%    most  at end  residual   "
           "us/step\n",
           N_STEPS);
    failed += run("stack", stack(20), find_stack);
    for (int i = 0; i < 4 && piles[i] <= most; i++)
        failed += run("pile", pile(piles[i]), find_pile);
    failed += run("chain", chain(50), find_chain);
    return failed != 0;
}
