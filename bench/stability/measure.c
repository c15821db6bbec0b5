/* measure.c: what poses and velocities say by themselves.  Distances are found by separating axes,
 * so that an error of carom's own geometry would show. */
#include "trial.h"

#include <math.h>
#include <stdlib.h>

/* Corners of a body in the world; a disc: its center, with a radius. */
typedef struct outline {
    int n;
    double radius;
    double x[MAX_CORNERS], y[MAX_CORNERS];
    double low[2], high[2]; /* box around it */
} outline;

static void corner_of(const scene *s, int k, int i, double *x, double *y)
{
    const scene_body *b = &s->bodies[k];
    *x = *y = 0;
    if (b->shape == SHAPE_BOX) {
        *x = i == 0 || i == 3 ? -b->hx : b->hx;
        *y = i < 2 ? -b->hy : b->hy;
    } else if (b->shape == SHAPE_POLYGON) {
        *x = s->polygons[k].corners[i][0];
        *y = s->polygons[k].corners[i][1];
    }
}

static int count_of(const scene *s, int k)
{
    switch (s->bodies[k].shape) {
    case SHAPE_NONE: return 0;
    case SHAPE_DISC: return 1;
    case SHAPE_BOX: return 4;
    default: return s->polygons[k].n;
    }
}

/* Relative to (x0, y0), so that a far scene loses nothing more. */
static void place(const scene *s, const double *q, int k, double x0, double y0, outline *o)
{
    const double c = cos(q[3 * k]);
    const double d = sin(q[3 * k]);
    o->n = count_of(s, k);
    o->radius = s->bodies[k].shape == SHAPE_DISC ? s->bodies[k].hx : 0;
    o->low[0] = o->low[1] = HUGE_VAL;
    o->high[0] = o->high[1] = -HUGE_VAL;
    for (int i = 0; i < o->n; i++) {
        double x;
        double y;
        corner_of(s, k, i, &x, &y);
        o->x[i] = q[3 * k + 1] - x0 + c * x - d * y;
        o->y[i] = q[3 * k + 2] - y0 + d * x + c * y;
        o->low[0] = fmin(o->low[0], o->x[i] - o->radius);
        o->low[1] = fmin(o->low[1], o->y[i] - o->radius);
        o->high[0] = fmax(o->high[0], o->x[i] + o->radius);
        o->high[1] = fmax(o->high[1], o->y[i] + o->radius);
    }
}

/* Largest distance of all of b before an edge of a: negative, minus the depth, where they overlap
 * and no edge of b separates better. */
static double beyond_edges(const outline *a, const outline *b)
{
    double best = -HUGE_VAL;
    for (int i = 0; i < a->n && a->n > 1; i++) {
        const int j = (i + 1) % a->n;
        const double ex = a->x[j] - a->x[i];
        const double ey = a->y[j] - a->y[i];
        const double length = hypot(ex, ey);
        double least = HUGE_VAL;
        for (int k = 0; k < b->n; k++) {
            least = fmin(least, (ey * (b->x[k] - a->x[i]) - ex * (b->y[k] - a->y[i])) / length);
        }
        best = fmax(best, least);
    }
    return best;
}

/* Distance of the nearest corners: discs, and a disc beside a corner. */
static double between_corners(const outline *a, const outline *b)
{
    double least = HUGE_VAL;
    for (int i = 0; i < a->n; i++) {
        for (int k = 0; k < b->n; k++) {
            least = fmin(least, hypot(a->x[i] - b->x[k], a->y[i] - b->y[k]));
        }
    }
    return least;
}

/* Depth of the overlap of two outlines, <= 0: none.  A disc beside an edge is nearest to the edge,
 * beside a corner to the corner: a separating axis less for the former would say too much only. */
static double depth_of(const outline *a, const outline *b)
{
    double apart = fmax(beyond_edges(a, b), beyond_edges(b, a));
    if (a->n == 1 && b->n == 1) {
        apart = between_corners(a, b);
    } else if (a->n == 1 || b->n == 1) {
        const outline *disc = a->n == 1 ? a : b;
        const outline *other = a->n == 1 ? b : a;
        const double near = between_corners(a, b);
        if (apart > 0 && near > apart) {
            /* Is the foot on an edge?  Else the corner is the nearest point. */
            int foot = 0;
            for (int i = 0; i < other->n; i++) {
                const int j = (i + 1) % other->n;
                const double ex = other->x[j] - other->x[i];
                const double ey = other->y[j] - other->y[i];
                const double dx = disc->x[0] - other->x[i];
                const double dy = disc->y[0] - other->y[i];
                const double along = (ex * dx + ey * dy) / (ex * ex + ey * ey);
                foot |= ey * dx - ex * dy > 0 && along >= 0 && along <= 1;
            }
            if (!foot) apart = near;
        }
    }
    return a->radius + b->radius - apart;
}

static int joined(const trial *t, int a, int b)
{
    const scene *s = &t->s;
    for (int k = 0; k < t->n_joints; k++) {
        const carom_joint_def *d = &t->joints[k];
        const int same = (d->body_a == a && d->body_b == b) || (d->body_a == b && d->body_b == a);
        if (same && !d->collide) return 1;
    }
    for (int k = 0; k < s->n_pins; k++) {
        const scene_pin *p = &s->pins[k];
        if ((p->a == a && p->b == b) || (p->a == b && p->b == a)) return 1;
    }
    return 0;
}

static int boxes_meet(const outline *a, const outline *b)
{
    return a->low[0] < b->high[0] && b->low[0] < a->high[0] && a->low[1] < b->high[1] &&
           b->low[1] < a->high[1];
}

double measure_overlap(const trial *t, const double *q)
{
    const scene *s = &t->s;
    outline *all = calloc((size_t)s->n_bodies + 1, sizeof *all);
    double worst = 0;
    if (!all) abort();
    for (int k = 0; k < s->n_bodies; k++) place(s, q, k, q[1], q[2], &all[k]);
    for (int a = 0; a < s->n_bodies; a++) {
        for (int b = a + 1; b < s->n_bodies; b++) {
            if (!s->bodies[a].moves && !s->bodies[b].moves) continue;
            if (!boxes_meet(&all[a], &all[b]) || joined(t, a, b)) continue;
            worst = fmax(worst, depth_of(&all[a], &all[b]));
        }
    }
    free(all);
    return worst;
}

/* Anchor of a pin as body k has it now. */
static void anchor_of(const scene *s, const double *q, int k, const scene_pin *p, double at[2])
{
    const double *q0 = s->bodies[k].q;
    const double turn = q[3 * k] - q0[0];
    const double x = p->x - q0[1];
    const double y = p->y - q0[2];
    at[0] = q[3 * k + 1] + cos(turn) * x - sin(turn) * y;
    at[1] = q[3 * k + 2] + sin(turn) * x + cos(turn) * y;
}

double measure_drift(const scene *s, const double *q)
{
    double worst = 0;
    for (int k = 0; k < s->n_pins; k++) {
        double a[2];
        double b[2];
        anchor_of(s, q, s->pins[k].a, &s->pins[k], a);
        anchor_of(s, q, s->pins[k].b, &s->pins[k], b);
        worst = fmax(worst, hypot(a[0] - b[0], a[1] - b[1]));
    }
    return worst;
}

static double reach_of(const scene *s, int k)
{
    const scene_body *b = &s->bodies[k];
    if (b->shape == SHAPE_NONE) return 0;
    return b->shape == SHAPE_BOX ? hypot(b->hx, b->hy) : b->hx;
}

double measure_length(const scene *s)
{
    double most = 0;
    for (int k = 0; k < s->n_bodies; k++) {
        if (s->bodies[k].moves == SCENE_DYNAMIC) most = fmax(most, 2 * reach_of(s, k));
    }
    return most > 0 ? most : 1;
}

double measure_reach(const scene *s, const double *q)
{
    double most = 0;
    for (int k = 0; k < s->n_bodies; k++) {
        const double far = fmax(fabs(q[3 * k + 1]), fabs(q[3 * k + 2]));
        most = fmax(most, far + reach_of(s, k));
    }
    return most;
}

double measure_kinetic(const scene *s, const double *v)
{
    double sum = 0;
    for (int k = 0; k < s->n_bodies; k++) {
        const scene_body *b = &s->bodies[k];
        const double *u = &v[3 * k];
        if (b->moves != SCENE_DYNAMIC) continue;
        sum += 0.5 * b->inertia * u[0] * u[0] + 0.5 * b->mass * (u[1] * u[1] + u[2] * u[2]);
    }
    return sum;
}

double measure_energy(const trial *t, const double *q, const double *v)
{
    double sum = measure_kinetic(&t->s, v);
    for (int k = 0; k < t->s.n_bodies; k++) {
        const scene_body *b = &t->s.bodies[k];
        if (b->moves != SCENE_DYNAMIC) continue;
        sum += b->mass * t->s.gravity * (q[3 * k + 2] - b->q[2]);
        const double r = hypot(q[3 * k + 1], q[3 * k + 2]);
        sum += 0.5 * t->energy_of_springs * r * r;
    }
    return sum;
}

double measure_move(const scene *s, const double *q)
{
    double worst = 0;
    for (int k = 0; k < s->n_bodies; k++) {
        const scene_body *b = &s->bodies[k];
        if (b->moves != SCENE_DYNAMIC) continue;
        const double move = hypot(q[3 * k + 1] - b->q[1], q[3 * k + 2] - b->q[2]);
        worst = fmax(worst, fmax(move, reach_of(s, k) * fabs(q[3 * k] - b->q[0])));
    }
    return worst;
}
