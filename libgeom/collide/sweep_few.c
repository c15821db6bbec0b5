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

static void apart_by(double gap, crm_closest *out)
{
    out->kind = CRM_APART;
    out->a = out->b = out->tied = 0;
    out->gap = gap;
}

/* The first of n keys that is not below `least`; *tied: there is another. */
static int first_of(int n, const double *key, double least, int *tied)
{
    int first = 0;
    int count = 0;
    for (int k = n - 1; k >= 0; k--) {
        const int in = key[k] >= least;
        first = in ? k : first;
        count += in;
    }
    *tied = count > 1;
    return first;
}

void crm_sweep_few(const crm_placed *a, const crm_placed *b, double reach, crm_closest *out)
{
    few fa;
    few fb;
    double key[2 * CRM_FEW];
    gather(a, &fa);
    gather_seen(a, b, &fb);
    const double top_a = keys_of(&fa, &fb, key);
    if (top_a > reach * reach) {
        apart_by(sqrt(top_a), out);
        return;
    }
    const int n_a = a->n > 1 ? a->n : 0;
    const int n = n_a + (b->n > 1 ? b->n : 0);
    const double top_b = keys_of(&fb, &fa, key + n_a);
    const double top = top_a > top_b ? top_a : top_b;
    const double height = height_of(top);
    if (height > reach) {
        apart_by(height, out);
        return;
    }
    const double least = height - crm_tie(a, b);
    const double least_key = least * fabs(least);
    int tied;
    /* The root's rounding may lift the key over the top. */
    const int k = first_of(n, key, least_key < top ? least_key : top, &tied);
    if (k >= n_a) {
        crm_face_at(b, k - n_a, a, lowest_over(&fb, k - n_a, &fa), 1, out);
    } else {
        crm_face_at(a, k, b, lowest_over(&fa, k, &fb), 0, out);
    }
    out->tied = tied;
}
