/* structures.c: many bodies that stand, or fall at a known threshold. */
#include "trial.h"

#include <math.h>

#define COUNT(list) ((int)(sizeof(list) / sizeof *(list)))

static const double G = 9.81;
static const double DT = 1.0 / 60;
static const double PI = 3.14159265358979323846;

static const double RATIOS[] = {1, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8};
static const double STEPS[] = {1e-5, 1e-4, 1e-3, 1e-2, 1.0 / 60, 1.0 / 30, 0.1};
static const double FRICTIONS[] = {0, 1e-3, 0.01, 0.1, 0.3, 1, 10, 100, 1e3};
static const double HEIGHTS[] = {2, 3, 5, 10, 20, 50, 100};
static const double COUNTS[] = {3, 6, 10, 20, 40};
static const double BLOCKS[] = {2, 3, 5, 10, 20};
static const double FACTORS[] = {0.5, 0.9, 0.98, 0.999, 1.001, 1.02, 1.1};
static const double VOUSSOIRS[] = {7, 11, 15, 25, 51};
static const double LEANS[] = {0.05, 0.1, 0.2, 0.3, 0.5};
static const double HOUSE_FACTORS[] = {0.5, 0.9, 0.99, 1.01, 1.1, 2, 100};
static const double LEVELS[] = {1, 2, 3, 4};
static const double GAPS[] = {0.1, 0.2, 0.4, 0.6, 0.8};
static const double BOUNCES[] = {0, 0.3, 0.6, 0.9};
static const double LONG[] = {1e3, 1e4, 1e5, 1e6};
static const double SCENES[] = {1, 2, 3, 4, 5, 6};

static double moved(const trial *t, double time, const double *q, const double *v)
{
    (void)time;
    (void)v;
    return measure_move(&t->s, q) / measure_length(&t->s);
}

static double some_time(double dt)
{
    return fmin(fmax(1, 60 * dt), 2000 * dt);
}

static void stack_of(trial *t, int n)
{
    trial_floor(t, 10, 0.5, 0);
    for (int k = 0; k < n; k++) trial_box(t, 0, k + 0.5, 0, 0.5, 0.5, 0.5);
    t->error = moved;
}

static void stack(trial *t, double n, double dt)
{
    *t = trial_new(G, dt, some_time(dt));
    stack_of(t, (int)n);
}

static void heavy_top(trial *t, double n, double ratio)
{
    *t = trial_new(G, DT, 2);
    stack_of(t, (int)n);
    trial_weigh(t, (int)n, ratio);
}

/* Boxes with gaps fall on each other. */
static void stack_falls(trial *t, double n, double ratio)
{
    *t = trial_new(G, DT, 2);
    trial_floor(t, 10, 0.5, 0);
    for (int k = 0; k < (int)n; k++)
        trial_box(t, 0.02 * (k % 2), 1.01 * k + 0.52, 0, 0.5, 0.5, 0.5);
    trial_weigh(t, (int)n, ratio);
}

static void pyramid(trial *t, double base, double mu)
{
    *t = trial_new(G, DT, 1);
    trial_floor(t, 60, mu, 0);
    for (int row = 0; row < (int)base; row++) {
        for (int k = 0; k < (int)base - row; k++) {
            trial_box(t, k - 0.5 * (base - row - 1), row + 0.5, 0, 0.45, 0.5, mu);
        }
    }
    t->error = moved;
}

/* Discs fall into a pit. */
static void pile(trial *t, int n, double mu, double restitution, double ratio)
{
    const double r = 0.1;
    const double half = 0.33 * sqrt(n * 0.1);
    trial_floor(t, 4, mu, restitution);
    for (int k = 0; k < 2; k++)
        trial_fix(t, trial_box(t, k ? half + 1 : -half - 1, 4, 0, 1, 5, mu));
    const int row = (int)fmax(1, floor(2 * half / (2.2 * r)));
    for (int k = 0; k < n; k++) {
        const double x = -half + r * 1.1 + 2.2 * r * (k % row) + 0.03 * r * sin(12.9898 * k);
        const double y = r * (1.2 + 2.2 * (k / row));
        const double own = r * (0.9 + 0.1 * cos(78.233 * k));
        const int b = trial_disc(t, x, y, own, mu, restitution);
        if (k % 5 == 4) trial_weigh(t, b, ratio);
    }
}

static void pile_friction(trial *t, double n, double mu)
{
    *t = trial_new(G, DT, 1);
    pile(t, (int)n, mu, 0, 1);
}

static void pile_restitution(trial *t, double n, double e)
{
    *t = trial_new(G, DT, 1);
    pile(t, (int)n, 0.5, e, 1);
}

static void pile_ratio(trial *t, double n, double ratio)
{
    *t = trial_new(G, DT, 1);
    pile(t, (int)n, 0.5, 0, ratio);
}

/* Discs in a funnel whose mouth is `factor` diameters wide: they jam or run out. */
static void funnel(trial *t, double n, double mouth)
{
    *t = trial_new(G, DT, 1.5);
    const double r = 0.1;
    for (int k = 0; k < 2; k++) {
        const double side = k ? 1 : -1;
        const double c = cos(0.8);
        const double s = sin(0.8);
        /* The inner face begins at the mouth and rises outward. */
        const double x = side * (mouth * r + 3 * c + 0.5 * s);
        trial_fix(t, trial_box(t, x, 3 * s - 0.5 * c, side * 0.8, 3, 0.5, 0.6));
    }
    for (int k = 0; k < (int)n; k++) {
        const int row = k / 4;
        const double x = 2.2 * r * (k % 4 - 1.5) + 0.05 * r * sin(12.9898 * k);
        trial_disc(t, x, 1.2 + 2.2 * r * row, r * (1 - 0.05 * (k % 3)), 0.6, 0);
    }
    trial_floor(t, 10, 0.6, 0);
    t->s.bodies[t->s.n_bodies - 1].q[2] -= 2;
}

/* Stands or falls: p[0] = 1 stands. */
static double stands(const trial *t, double time, const double *q, const double *v)
{
    const double move = moved(t, time, q, v);
    if (t->p[0] > 0) return move;
    return move > t->p[1] ? 0 : 1;
}

/* Blocks of length 2, each farther out by 1 / k of half a length. */
static void overhang(trial *t, double n, double factor)
{
    *t = trial_new(G, DT, 2);
    trial_box(t, -5, -1, 0, 5, 1, 0.5); /* a table that ends at x = 0 */
    trial_fix(t, 0);
    double x = 0; /* right end of the block below */
    for (int k = (int)n; k >= 1; k--) {
        x += factor / k;
        trial_box(t, x - 1, (n - k) * 0.2 + 0.1, 0, 1, 0.1, 0.5);
    }
    t->p[0] = factor <= 1;
    t->p[1] = 1e-4;
    t->error = stands;
    t->rough = 0.05;
}

/* Least t / R of a semicircular arch of straight-sided voussoirs: docs/math/equations.md, 6. */
static double arch_limit(int n)
{
    switch (n) {
    case 7: return 0.095703;
    case 11: return 0.104589;
    case 15: return 0.106068;
    case 25: return 0.106959;
    default: return 0.107357;
    }
}

static void arch(trial *t, double voussoirs, double factor)
{
    const int n = (int)voussoirs;
    const double thick = factor * arch_limit(n);
    *t = trial_new(G, DT, 2);
    trial_floor(t, 10, 1e3, 0);
    for (int k = 0; k < n; k++) {
        const double a = PI * k / n;
        const double b = PI * (k + 1) / n;
        const double in = 1 - thick / 2;
        const double out = 1 + thick / 2;
        const carom_vec2 v[4] = {{in * cos(a), in * sin(a)},
                                 {out * cos(a), out * sin(a)},
                                 {out * cos(b), out * sin(b)},
                                 {in * cos(b), in * sin(b)}};
        const int body = trial_polygon(t, 0, 0, 0, 4, v, 1e3);
        /* trial_polygon takes corners about the centroid: back to where they were. */
        t->s.bodies[body].q[1] = v[0].x - t->s.polygons[body].corners[0][0];
        t->s.bodies[body].q[2] = v[0].y - t->s.polygons[body].corners[0][1];
    }
    t->p[0] = factor > 1;
    t->p[1] = 1e-4;
    t->error = stands;
}

/* Half the thickness of a card of length 1 [m]. */
static const double CARD = 0.005;

/* Two cards lean on each other. */
static void card_pair(trial *t, double x, double y, double lean, double mu)
{
    const double s = sin(lean);
    const double c = cos(lean);
    const double h = CARD;
    for (int k = 0; k < 2; k++) {
        const double side = k ? 1 : -1;
        /* The upper inner corner is on the line of symmetry, the lower inner one on the floor. */
        const double cx = side * (0.5 * s + h * c);
        const double cy = 0.5 * c + h * s;
        trial_box(t, x + cx, y + cy, side * lean, h, 0.5, mu);
    }
}

/* A card leans on a wall, friction mu at both ends.  By moments about the foot, with d from it to
 * the center and s to the wall, it stands where mu (c + mu s) / (1 + mu^2) > d. */
static void card_on_wall(trial *t, double lean, double factor)
{
    const double s = sin(lean);
    const double c = cos(lean);
    const double d = 0.5 * s - CARD * c;
    const double least = (sqrt(c * c + 4 * d * (s - d)) - c) / (2 * (s - d));
    *t = trial_new(G, DT, 1);
    trial_floor(t, 10, factor * least, 0);
    trial_fix(t, trial_box(t, -1, 1, 0, 1, 1, factor * least));
    trial_box(t, 0.5 * s + CARD * c, 0.5 * c + CARD * s, lean, CARD, 0.5, factor * least);
    t->p[0] = factor > 1;
    t->p[1] = 1e-3;
    t->error = stands;
}

/* A house of several levels with plates between them. */
static void card_levels(trial *t, double levels, double mu)
{
    const double lean = 0.3;
    const double width = sin(lean) * 1.0 + 0.02;
    const double rise = cos(lean) + 0.01 * sin(lean);
    double y = 0;
    *t = trial_new(G, DT, 1);
    trial_floor(t, 20, mu, 0);
    for (int level = 0; level < (int)levels; level++) {
        const int n = (int)levels - level;
        for (int k = 0; k < n; k++)
            card_pair(t, 1.3 * width * 2 * (k - 0.5 * (n - 1)), y, lean, mu);
        y += rise;
        if (n > 1) trial_box(t, 0, y + 0.005, 0, 1.3 * width * n, 0.005, mu);
        y += 0.01;
    }
}

static void dominoes(trial *t, double gap, double dt)
{
    *t = trial_new(G, dt, fmax(1.5, 60 * dt));
    if (dt < 1e-3) t->s.n_steps = 2000;
    trial_floor(t, 20, 0.4, 0);
    for (int k = 0; k < 8; k++) trial_box(t, k * gap, 0.5, 0, 0.05, 0.5, 0.4);
    t->s.bodies[1].v[0] = -1.5;
    t->s.bodies[1].v[1] = 0.75;
}

/* Six scenes at rest, for as many steps as said. */
static void long_rest(trial *t, double which, double n_steps)
{
    *t = trial_new(G, DT, 1);
    t->s.n_steps = (int)n_steps;
    switch ((int)which) {
    case 1: stack_of(t, 1); break;
    case 2: stack_of(t, 5); break;
    case 3:
        stack_of(t, 2);
        trial_weigh(t, 2, 1e4);
        break;
    case 4:
        trial_floor(t, 10, 0.5, 0);
        trial_disc(t, 0, 0.5, 0.5, 0.5, 0);
        trial_disc(t, 1, 0.5, 0.5, 0.5, 0);
        break;
    case 5:
        trial_anchor(t);
        trial_box(t, 0, -0.5, 0, 0.05, 0.5, 0);
        trial_pin(t, 0, 1, 0, 0);
        break;
    default:
        trial_box(t, -50 * sin(0.3), -50 * cos(0.3), -0.3, 50, 50, 0.5);
        trial_fix(t, 0);
        trial_box(t, 0.1 * sin(0.3), 0.1 * cos(0.3), -0.3, 1, 0.1, 0.5);
        break;
    }
    t->error = moved;
}

const family STRUCTURE_FAMILIES[] = {
    {"stack", "boxes", "dt [s]", COUNT(HEIGHTS), COUNT(STEPS), HEIGHTS, STEPS, stack,
     "nothing moves", NULL},
    {"stack with a heavy top", "boxes", "mass ratio", COUNT(HEIGHTS), COUNT(RATIOS), HEIGHTS,
     RATIOS, heavy_top, "nothing moves", NULL},
    {"stack falls together", "boxes", "mass ratio", COUNT(HEIGHTS), COUNT(RATIOS), HEIGHTS, RATIOS,
     stack_falls, NULL, NULL},
    {"pyramid", "base", "friction", COUNT(COUNTS), COUNT(FRICTIONS), COUNTS, FRICTIONS, pyramid,
     "nothing moves", NULL},
    {"pile", "discs", "friction", COUNT(COUNTS), COUNT(FRICTIONS), COUNTS, FRICTIONS, pile_friction,
     NULL, NULL},
    {"pile with bounces", "discs", "restitution", COUNT(COUNTS), COUNT(BOUNCES), COUNTS, BOUNCES,
     pile_restitution, NULL, NULL},
    {"pile with heavy discs", "discs", "mass ratio", COUNT(COUNTS), COUNT(RATIOS), COUNTS, RATIOS,
     pile_ratio, NULL, NULL},
    {"discs in a funnel", "discs", "mouth / diameter", COUNT(COUNTS), COUNT(BLOCKS), COUNTS,
     (const double[]){0.5, 1.5, 2.0, 2.5, 4}, funnel, NULL, NULL},
    {"overhang", "blocks", "of the harmonic limit", COUNT(BLOCKS), COUNT(FACTORS), BLOCKS, FACTORS,
     overhang, "stands below 1, falls above", NULL},
    {"arch", "voussoirs", "of the least thickness", COUNT(VOUSSOIRS), COUNT(FACTORS), VOUSSOIRS,
     FACTORS, arch, "stands above 1, falls below", NULL},
    {"card on a wall", "lean [rad]", "friction / least", COUNT(LEANS), COUNT(HOUSE_FACTORS), LEANS,
     HOUSE_FACTORS, card_on_wall, "stands above 1, falls below", NULL},
    {"card house", "levels", "friction", COUNT(LEVELS), COUNT(FRICTIONS), LEVELS, FRICTIONS,
     card_levels, NULL, NULL},
    {"dominoes", "distance", "dt [s]", COUNT(GAPS), COUNT(STEPS), GAPS, STEPS, dominoes, NULL,
     NULL},
    {"long rest", "scene", "steps", COUNT(SCENES), COUNT(LONG), SCENES, LONG, long_rest,
     "nothing moves", NULL},
};
const int N_STRUCTURE_FAMILIES = COUNT(STRUCTURE_FAMILIES);
