/* sweep_few.c: crm_sweep for cores of few vertices: every face against every vertex, without a
 * branch that depends on the data, in the frame of A's body.
 *
 * A face's height s / |u| is compared by its key s |s| / u.u, which is in the same order. */
#include "collide/closest.h"

typedef struct few {
    int n;
    double x[CRM_FEW + 1]; /* closed: the last is the first again */
    double y[CRM_FEW + 1];
} few;

static void gather(const crm_placed *p, few *f)
{
    f->n = p->n;
    for (int i = 0; i < p->n; i++) {
        f->x[i] = p->v[i].x;
        f->y[i] = p->v[i].y;
    }
    f->x[f->n] = f->x[0];
    f->y[f->n] = f->y[0];
}

static void gather_seen(const crm_placed *a, const crm_placed *b, few *f)
{
    const double c = a->cos * b->cos + a->sin * b->sin;
    const double s = a->cos * b->sin - a->sin * b->cos;
    const carom_vec2 at = crm_turn_back(a, crm_sub(b->at, a->at));
    f->n = b->n;
    for (int i = 0; i < b->n; i++) {
        const carom_vec2 v = b->v[i];
        f->x[i] = at.x + (c * v.x - s * v.y);
        f->y[i] = at.y + (s * v.x + c * v.y);
    }
    f->x[f->n] = f->x[0];
    f->y[f->n] = f->y[0];
}

/* Keys of p's faces; returns the largest.  A point has none. */
static double keys_of(const few *p, const few *q, double *key)
{
    double top = -HUGE_VAL;
    for (int k = 0; p->n > 1 && k < p->n; k++) {
        const double ux = p->y[k + 1] - p->y[k];
        const double uy = p->x[k] - p->x[k + 1];
        double low = ux * q->x[0] + uy * q->y[0];
        for (int j = 1; j < q->n; j++) {
            const double s = ux * q->x[j] + uy * q->y[j];
            low = s < low ? s : low;
        }
        const double s = low - (ux * p->x[k] + uy * p->y[k]);
        key[k] = s * fabs(s) / (ux * ux + uy * uy);
        top = key[k] > top ? key[k] : top;
    }
    return top;
}

static double height_of(double key)
{
    return key < 0 ? -sqrt(-key) : sqrt(key);
}

static int lowest_over(const few *p, int k, const few *q)
{
    const double ux = p->y[k + 1] - p->y[k];
    const double uy = p->x[k] - p->x[k + 1];
    double low = ux * q->x[0] + uy * q->y[0];
    int j = 0;
    for (int i = 1; i < q->n; i++) {
        const double s = ux * q->x[i] + uy * q->y[i];
        j = s < low ? i : j;
        low = s < low ? s : low;
    }
    return j;
}

static crm_closest apart_by(double gap)
{
    crm_closest r;
    r.kind = CRM_APART;
    r.a = r.b = r.tied = 0;
    r.gap = gap;
    return r;
}

crm_closest crm_sweep_few(const crm_placed *a, const crm_placed *b, double reach)
{
    few fa;
    few fb;
    double key[2 * CRM_FEW];
    gather(a, &fa);
    gather_seen(a, b, &fb);
    const double top_a = keys_of(&fa, &fb, key);
    if (top_a > reach * reach) return apart_by(sqrt(top_a));
    const int n_a = a->n > 1 ? a->n : 0;
    const int n = n_a + (b->n > 1 ? b->n : 0);
    const double top_b = keys_of(&fb, &fa, key + n_a);
    const double top = top_a > top_b ? top_a : top_b;
    const double height = height_of(top);
    if (height > reach) return apart_by(height);
    const double least = height - crm_tie(a, b);
    double least_key = least * fabs(least);
    if (top < least_key) least_key = top; /* the root's rounding */
    int first = n;
    int n_tied = 0;
    for (int k = n - 1; k >= 0; k--) {
        const int tied = key[k] >= least_key;
        first = tied ? k : first;
        n_tied += tied;
    }
    if (first == n) first = 0; /* NaN */
    const int on_b = first >= n_a;
    crm_closest r = on_b ? crm_face_at(b, first - n_a, a, lowest_over(&fb, first - n_a, &fa), 1)
                         : crm_face_at(a, first, b, lowest_over(&fa, first, &fb), 0);
    r.tied = n_tied > 1;
    return r;
}
