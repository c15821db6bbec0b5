#include "poses.h"

#include "carom/broadphase.h"
#include "carom/collide.h"

#include <math.h>
#include <stdlib.h>

/* Poses of a world as carom's shapes. */
typedef struct snapshot {
    const scene *s;
    double *q;
    carom_vec2 (*corners)[MAX_CORNERS];
    carom_shape *shapes;
    carom_box *boxes;
} snapshot;

static void *room(int n, size_t size)
{
    void *p = calloc((size_t)n + 1, size);
    if (!p) abort();
    return p;
}

static carom_pose pose_of(const snapshot *t, int k)
{
    const carom_pose p = {t->q[3 * k], t->q[3 * k + 1], t->q[3 * k + 2]};
    return p;
}

static carom_box no_box(void)
{
    const carom_box none = {{HUGE_VAL, HUGE_VAL}, {-HUGE_VAL, -HUGE_VAL}};
    return none;
}

/* Of body k in its frame; its number of corners. */
static int corners_of(const scene *s, int k, carom_vec2 *corners)
{
    const scene_body *b = &s->bodies[k];
    const carom_vec2 box[4] = {{-b->hx, -b->hy}, {b->hx, -b->hy}, {b->hx, b->hy}, {-b->hx, b->hy}};
    const int n = b->shape == SHAPE_DISC ? 1 : b->shape == SHAPE_POLYGON ? s->polygons[k].n : 4;
    for (int i = 0; i < n && b->shape == SHAPE_POLYGON; i++) {
        corners[i].x = s->polygons[k].corners[i][0];
        corners[i].y = s->polygons[k].corners[i][1];
    }
    for (int i = 0; i < n && b->shape == SHAPE_BOX; i++) corners[i] = box[i];
    return n;
}

static snapshot take(const scene *s, const contender *c, void *self)
{
    snapshot t = {s, room(3 * s->n_bodies, sizeof(double)),
                  room(s->n_bodies, MAX_CORNERS * sizeof(carom_vec2)),
                  room(s->n_bodies, sizeof(carom_shape)), room(s->n_bodies, sizeof(carom_box))};
    for (int k = 0; k < s->n_bodies; k++) {
        const scene_body *b = &s->bodies[k];
        const int n = corners_of(s, k, t.corners[k]);
        const carom_shape shape = {b->shape == SHAPE_DISC ? b->hx : 0, n, t.corners[k]};
        t.shapes[k] = shape;
        c->place(self, k, &t.q[3 * k]);
        t.boxes[k] = b->shape == SHAPE_NONE ? no_box() : carom_shape_box(&shape, pose_of(&t, k));
    }
    return t;
}

static void release(snapshot *t)
{
    free(t->q);
    free(t->corners);
    free(t->shapes);
    free(t->boxes);
}

static int pinned(const scene *s, int a, int b)
{
    for (int k = 0; k < s->n_pins; k++) {
        const scene_pin *p = &s->pins[k];
        if ((p->a == a && p->b == b) || (p->a == b && p->b == a)) return 1;
    }
    return 0;
}

static double overlap_of(const snapshot *t)
{
    carom_broadphase *broadphase = NULL;
    const carom_pair *pairs;
    int n;
    double worst = 0;
    if (carom_broadphase_create(NULL, &broadphase)) abort();
    if (carom_broadphase_pairs(broadphase, t->s->n_bodies, t->boxes, &n, &pairs)) abort();
    for (int k = 0; k < n; k++) {
        const int a = pairs[k].a;
        const int b = pairs[k].b;
        if (pinned(t->s, a, b) || !(t->s->bodies[a].moves || t->s->bodies[b].moves)) continue;
        const carom_manifold m =
            carom_collide(&t->shapes[a], pose_of(t, a), &t->shapes[b], pose_of(t, b), 0);
        if (m.count) worst = fmax(worst, -m.distance);
    }
    carom_broadphase_destroy(broadphase);
    return worst;
}

double largest_overlap(const scene *s, const contender *c, void *self)
{
    snapshot t = take(s, c, self);
    const double worst = overlap_of(&t);
    release(&t);
    return worst;
}

double largest_move(const scene *s, const contender *c, void *self)
{
    double worst = 0;
    for (int k = 0; k < s->n_bodies; k++) {
        const double *from = s->bodies[k].q;
        double q[3];
        c->place(self, k, q);
        worst = fmax(worst, hypot(q[1] - from[1], q[2] - from[2]));
    }
    return worst;
}

/* Where the point (x, y) of the scene's beginning is now, carried by body k. */
static void carried(const scene *s, const contender *c, void *self, int k, double x, double y,
                    double out[2])
{
    const double *from = s->bodies[k].q;
    double q[3];
    c->place(self, k, q);
    const double turn = q[0] - from[0];
    const double dx = x - from[1];
    const double dy = y - from[2];
    out[0] = q[1] + cos(turn) * dx - sin(turn) * dy;
    out[1] = q[2] + sin(turn) * dx + cos(turn) * dy;
}

double largest_gap(const scene *s, const contender *c, void *self)
{
    double worst = 0;
    for (int k = 0; k < s->n_pins; k++) {
        const scene_pin *p = &s->pins[k];
        double a[2];
        double b[2];
        carried(s, c, self, p->a, p->x, p->y, a);
        carried(s, c, self, p->b, p->x, p->y, b);
        worst = fmax(worst, hypot(a[0] - b[0], a[1] - b[1]));
    }
    return worst;
}

double energy_of(const scene *s, const contender *c, void *self)
{
    double sum = 0;
    for (int k = 0; k < s->n_bodies; k++) {
        const scene_body *b = &s->bodies[k];
        double q[3];
        double v[3];
        if (b->moves != SCENE_DYNAMIC) continue;
        c->place(self, k, q);
        c->speed(self, k, v);
        sum += 0.5 * (b->inertia * v[0] * v[0] + b->mass * (v[1] * v[1] + v[2] * v[2])) +
               b->mass * s->gravity * q[2];
    }
    return sum;
}
