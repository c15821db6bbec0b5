/* Event by event in long double: no gravity, no friction, e = 1, impacts one at a time. */
#include "billiard.h"

#include <math.h>

typedef long double real;

enum { MAX_DISCS = 32 };

typedef struct disc {
    real x, y, vx, vy;
} disc;

/* Time to the impact of two discs whose centers meet at the distance d: the smaller root of
 * |x + t v|^2 = d^2, if they approach. */
static real time_to_impact(const disc *a, const disc *b, real d)
{
    const real x = b->x - a->x;
    const real y = b->y - a->y;
    const real vx = b->vx - a->vx;
    const real vy = b->vy - a->vy;
    const real approach = x * vx + y * vy;
    const real speed = vx * vx + vy * vy;
    const real under = approach * approach - speed * (x * x + y * y - d * d);
    if (approach >= 0 || under < 0) return HUGE_VALL;
    return fmaxl((x * x + y * y - d * d) / (-approach + sqrtl(under)), 0);
}

/* The component of the relative velocity along the centers turns round. */
static void strike(disc *a, disc *b, real ma, real mb)
{
    const real x = b->x - a->x;
    const real y = b->y - a->y;
    const real along = ((b->vx - a->vx) * x + (b->vy - a->vy) * y) / (x * x + y * y);
    const real of_a = 2 * mb / (ma + mb) * along;
    const real of_b = 2 * ma / (ma + mb) * along;
    a->vx += of_a * x;
    a->vy += of_a * y;
    b->vx -= of_b * x;
    b->vy -= of_b * y;
}

/* The first impact; returns its time, HUGE_VALL: none. */
static real next_impact(const problem *p, const disc *d, int *i, int *j)
{
    const scene *s = &p->s;
    real first = HUGE_VALL;
    for (int a = 0; a < s->n_bodies; a++) {
        for (int b = a + 1; b < s->n_bodies; b++) {
            const real t = time_to_impact(&d[a], &d[b], (real)s->bodies[a].hx + s->bodies[b].hx);
            if (t >= first) continue;
            first = t;
            *i = a;
            *j = b;
        }
    }
    return first;
}

void billiard_end(const problem *p, int moved, long double q[3])
{
    const scene *s = &p->s;
    disc d[MAX_DISCS];
    for (int k = 0; k < s->n_bodies; k++) {
        const scene_body *b = &s->bodies[k];
        const disc start = {b->q[1], b->q[2], b->v[1], b->v[2]};
        d[k] = start;
    }
    if (moved) d[0].y += 1e-18L;
    int i = 0;
    int j = 0;
    for (real left = p->duration; left > 0;) {
        const real t = next_impact(p, d, &i, &j);
        const real step = fminl(t, left);
        for (int k = 0; k < s->n_bodies; k++) {
            d[k].x += step * d[k].vx;
            d[k].y += step * d[k].vy;
        }
        if (t < left) strike(&d[i], &d[j], s->bodies[i].mass, s->bodies[j].mass);
        left -= step;
    }
    q[0] = s->bodies[p->body].q[0];
    q[1] = d[p->body].x;
    q[2] = d[p->body].y;
}
