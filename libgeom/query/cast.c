/* cast.c: time of impact by conservative advancement on the exact distance.
 *
 * Along a fixed normal n the supports of the shapes are at least f(t) apart, and
 *   f(t + s) >= distance(t) - s (closing + |dangle_a| reach_a + |dangle_b| reach_b),
 * closing = n . (translation of A - translation of B).  So within the s that takes f down to the
 * target nothing is hit. */
#include "carom/query.h"
#include "vec.h"

enum { MAX_EVALUATIONS = 10000 };

/* The target is reached within this share [1] of the shapes' reach [m]. */
static const double CAST_TOL = 1e-12;

static double reach_of(const carom_shape *s)
{
    double top = 0;
    for (int i = 0; i < s->count; i++) {
        const double r = crm_length(s->vertices[i]);
        if (r > top) top = r;
    }
    return top + s->radius;
}

static carom_pose pose_at(const carom_sweep *m, double t)
{
    carom_pose q;
    q.angle = m->from.angle + t * (m->to.angle - m->from.angle);
    q.x = m->from.x + t * (m->to.x - m->from.x);
    q.y = m->from.y + t * (m->to.y - m->from.y);
    return t < 1 ? q : m->to;
}

static carom_vec2 translation(const carom_sweep *m)
{
    return crm_vec(m->to.x - m->from.x, m->to.y - m->from.y);
}

carom_status carom_shape_cast(const carom_shape *a, carom_sweep motion_a, const carom_shape *b,
                              carom_sweep motion_b, double target, carom_cast_hit *out)
{
    const double reach_a = reach_of(a);
    const double reach_b = reach_of(b);
    const double turning = fabs(motion_a.to.angle - motion_a.from.angle) * reach_a +
                           fabs(motion_b.to.angle - motion_b.from.angle) * reach_b;
    const carom_vec2 closing = crm_sub(translation(&motion_a), translation(&motion_b));
    const double tol = CAST_TOL * (reach_a + reach_b);
    out->hit = 0;
    out->t = 0;
    for (out->iterations = 1; out->iterations <= MAX_EVALUATIONS; out->iterations++) {
        out->at =
            carom_shape_distance(a, pose_at(&motion_a, out->t), b, pose_at(&motion_b, out->t));
        out->hit = out->at.distance <= target + tol;
        if (out->hit || out->t >= 1) return CAROM_OK;
        const double left = out->at.distance - target;
        const double rate = crm_dot(out->at.normal, closing) + turning;
        const double next = rate * (1 - out->t) > left ? out->t + left / rate : 1;
        out->hit = next == out->t; /* as near as t can tell */
        if (out->hit) return CAROM_OK;
        out->t = next;
    }
    return CAROM_LIMIT;
}
