#include "collide_ref.h"

#include <math.h>

static void place(const carom_shape *s, long double angle, long double x, long double y,
                  collide_ref_shape *out)
{
    const long double c = cosl(angle);
    const long double t = sinl(angle);
    out->n = s->count;
    out->radius = s->radius;
    out->at_x = x;
    out->at_y = y;
    for (int i = 0; i < s->count; i++) {
        out->x[i] = x + c * s->vertices[i].x - t * s->vertices[i].y;
        out->y[i] = y + t * s->vertices[i].x + c * s->vertices[i].y;
    }
}

void collide_ref_place(const carom_shape *a, carom_pose pose_a, const carom_shape *b,
                       carom_pose pose_b, collide_ref_shape *ra, collide_ref_shape *rb)
{
    place(a, pose_a.angle, 0, 0, ra);
    place(b, pose_b.angle, (long double)pose_b.x - pose_a.x, (long double)pose_b.y - pose_a.y, rb);
}

static long double lowest(const collide_ref_shape *s, long double nx, long double ny)
{
    long double low = HUGE_VALL;
    for (int i = 0; i < s->n; i++) low = fminl(low, nx * s->x[i] + ny * s->y[i]);
    return low;
}

long double collide_ref_support(const collide_ref_shape *a, const collide_ref_shape *b,
                                long double nx, long double ny)
{
    return lowest(b, nx, ny) + lowest(a, -nx, -ny) - a->radius - b->radius;
}

/* Best face of p against q; sign = 1: p is A. */
static void try_faces(const collide_ref_shape *p, const collide_ref_shape *q, int sign,
                      collide_ref *best)
{
    for (int k = 0; p->n > 1 && k < p->n; k++) {
        const int l = (k + 1) % p->n;
        const long double ex = p->x[l] - p->x[k];
        const long double ey = p->y[l] - p->y[k];
        const long double length = sqrtl(ex * ex + ey * ey);
        const long double nx = ey / length;
        const long double ny = -ex / length;
        const long double s = lowest(q, nx, ny) - (nx * p->x[k] + ny * p->y[k]);
        if (s > best->gap) {
            best->second = best->gap;
            best->gap = s;
            best->nx = sign * nx;
            best->ny = sign * ny;
        } else {
            best->second = fmaxl(best->second, s);
        }
    }
}

/* Vector from the segment from (ax, ay) along e to the point q, the shortest one. */
static void to_segment(long double ax, long double ay, long double ex, long double ey,
                       long double qx, long double qy, long double *dx, long double *dy)
{
    const long double ee = ex * ex + ey * ey;
    const long double t = ee > 0 ? ((qx - ax) * ex + (qy - ay) * ey) / ee : 0;
    if (t > 0 && t < 1) {
        const long double h = ((qx - ax) * ey - (qy - ay) * ex) / ee;
        *dx = h * ey;
        *dy = -h * ex;
    } else {
        *dx = qx - ax - (t >= 1 ? ex : 0);
        *dy = qy - ay - (t >= 1 ? ey : 0);
    }
}

/* Vertices of q against the edges of p (or its single vertex). */
static void try_vertices(const collide_ref_shape *p, const collide_ref_shape *q, int sign,
                         collide_ref *best)
{
    for (int k = 0; k < p->n; k++) {
        const int l = (k + 1) % p->n;
        for (int j = 0; j < q->n; j++) {
            long double dx;
            long double dy;
            to_segment(p->x[k], p->y[k], p->x[l] - p->x[k], p->y[l] - p->y[k], q->x[j], q->y[j],
                       &dx, &dy);
            const long double d = sqrtl(dx * dx + dy * dy);
            if (d < best->gap) {
                best->gap = d;
                best->nx = sign * dx / d;
                best->ny = sign * dy / d;
            }
        }
    }
}

/* Comparing distances loses half the digits of the normal.  A face is closest when the vertices
 * lowest over it (one, or the two of a parallel edge) have a foot on it: linear, hence sharp. */
static void sharpen(const collide_ref_shape *p, const collide_ref_shape *q, int sign,
                    long double noise, collide_ref *best)
{
    for (int k = 0; p->n > 1 && k < p->n; k++) {
        const int l = (k + 1) % p->n;
        const long double ex = p->x[l] - p->x[k];
        const long double ey = p->y[l] - p->y[k];
        const long double length = sqrtl(ex * ex + ey * ey);
        const long double tx = ex / length;
        const long double ty = ey / length;
        const long double low = lowest(q, ty, -tx);
        long double first = HUGE_VALL;
        long double last = -HUGE_VALL;
        for (int j = 0; j < q->n; j++) {
            if (ty * q->x[j] - tx * q->y[j] > low + noise) continue;
            const long double foot = tx * (q->x[j] - p->x[k]) + ty * (q->y[j] - p->y[k]);
            first = fminl(first, foot);
            last = fmaxl(last, foot);
        }
        if (low - (ty * p->x[k] - tx * p->y[k]) > noise && last >= 0 && first <= length) {
            best->nx = sign * ty;
            best->ny = -sign * tx;
        }
    }
}

static long double size_of(const collide_ref_shape *s)
{
    long double size = s->radius;
    for (int i = 0; i < s->n; i++) {
        size = fmaxl(size, hypotl(s->x[i] - s->at_x, s->y[i] - s->at_y));
    }
    return size;
}

collide_ref collide_ref_solve(const collide_ref_shape *a, const collide_ref_shape *b)
{
    collide_ref face = {0, -HUGE_VALL, 1, 0, -HUGE_VALL, 0};
    collide_ref apart = {0, HUGE_VALL, 1, 0, -HUGE_VALL, 0};
    try_faces(a, b, 1, &face);
    try_faces(b, a, -1, &face);
    try_vertices(a, b, 1, &apart);
    try_vertices(b, a, -1, &apart);
    /* Points and segments in line have no face that separates: their faces' zero is exact up to
     * rounding. */
    const long double size = fmaxl(size_of(a), size_of(b));
    sharpen(a, b, 1, 1e-18L * size, &apart);
    sharpen(b, a, -1, 1e-18L * size, &apart);
    const int disjoint = (a->n == 1 && b->n == 1) || face.gap > -1e-18L * size;
    collide_ref r = disjoint ? apart : face;
    r.distance = r.gap - a->radius - b->radius;
    r.size = size;
    return r;
}

long double collide_ref_outline(const collide_ref_shape *s, long double x, long double y)
{
    long double best = HUGE_VALL;
    for (int k = 0; k < s->n; k++) {
        const int l = (k + 1) % s->n;
        long double dx;
        long double dy;
        to_segment(s->x[k], s->y[k], s->x[l] - s->x[k], s->y[l] - s->y[k], x, y, &dx, &dy);
        best = fminl(best, sqrtl(dx * dx + dy * dy));
    }
    return best;
}
