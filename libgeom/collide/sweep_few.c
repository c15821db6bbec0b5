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
    int i = 0;
    do {
        f->x[i] = p->v[i].x;
        f->y[i] = p->v[i].y;
    } while (++i < p->n);
    f->x[f->n] = f->x[0];
    f->y[f->n] = f->y[0];
}

/* b's vertices turned into a's frame, still from b's position. */
static void gather_turned(const crm_placed *a, const crm_placed *b, few *f)
{
    const double c = a->cos * b->cos + a->sin * b->sin;
    const double s = a->cos * b->sin - a->sin * b->cos;
    f->n = b->n;
    int i = 0;
    do {
        const carom_vec2 v = b->v[i];
        f->x[i] = c * v.x - s * v.y;
        f->y[i] = s * v.x + c * v.y;
    } while (++i < b->n);
    f->x[f->n] = f->x[0];
    f->y[f->n] = f->y[0];
}

/* Keys of p's faces, d from p's position to q's; the index of the largest, and of that the first. A
 * point has one, lower than any. */
static int keys_of(const few *p, const few *q, carom_vec2 d, double *key)
{
    double top = -HUGE_VAL;
    int at = 0;
    key[0] = -HUGE_VAL;
    for (int k = 0; p->n > 1 && k < p->n; k++) {
        const double ux = p->y[k + 1] - p->y[k];
        const double uy = p->x[k] - p->x[k + 1];
        double low = ux * q->x[0] + uy * q->y[0];
        for (int j = 1; j < q->n; j++) {
            const double s = ux * q->x[j] + uy * q->y[j];
            low = s < low ? s : low;
        }
        const double s = low + (ux * (d.x - p->x[k]) + uy * (d.y - p->y[k]));
        key[k] = s * fabs(s) / (ux * ux + uy * uy);
        at = key[k] > top ? k : at;
        top = key[k] > top ? key[k] : top;
    }
    return at;
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
    out->lead = 0;
    out->gap = gap;
}

/* The next largest key but that of `at`. */
static double second_of(int n, const double *key, int at)
{
    double second = -HUGE_VAL;
    for (int k = 0; k < n; k++) {
        const double x = k == at ? -HUGE_VAL : key[k];
        second = x > second ? x : second;
    }
    return second;
}

/* Face k of both cores' faces, A's first. */
static void take_face(const crm_placed *a, const few *fa, const crm_placed *b, const few *fb, int k,
                      crm_closest *out)
{
    if (k >= a->n) {
        crm_face_at(b, k - a->n, a, lowest_over(fb, k - a->n, fa), 1, out);
    } else {
        crm_face_at(a, k, b, lowest_over(fa, k, fb), 0, out);
    }
}

static int has_foot(const crm_placed *a, const crm_placed *b, const crm_closest *c)
{
    const double tol = crm_noise(a, c->a, b, c->b);
    return c->kind == CRM_FACE_A ? crm_foot_is_on(a, c->a, b, c->b, tol)
                                 : crm_foot_is_on(b, c->b, a, c->a, tol);
}

/* Of tied faces the first with a foot on it.  Without one the top stays: tied faces side by side
 * are almost parallel. */
static void take_first(const crm_placed *a, const few *fa, const crm_placed *b, const few *fb,
                       const double *key, double least, crm_closest *out)
{
    for (int k = 0; k < a->n + b->n; k++) {
        crm_closest c;
        if (!(key[k] >= least)) continue;
        take_face(a, fa, b, fb, k, &c);
        if (!has_foot(a, b, &c)) continue;
        *out = c;
        return;
    }
}

void crm_sweep_few(const crm_placed *a, const crm_placed *b, double reach, crm_closest *out)
{
    few fa;
    few fb;
    double key[2 * CRM_FEW];
    gather(a, &fa);
    gather_turned(a, b, &fb);
    const carom_vec2 d = crm_turn_back(a, crm_sub(b->at, a->at));
    /* Clearly farther: what is just within reach is for the distance itself to decide. */
    const double tie = crm_tie(a, b);
    const double far = (reach + tie) * (reach + tie);
    const int n = a->n + b->n;
    const int top_a = keys_of(&fa, &fb, d, key);
    if (key[top_a] > far) {
        apart_by(sqrt(key[top_a]), out);
        return;
    }
    const int top_b = a->n + keys_of(&fb, &fa, crm_neg(d), key + a->n);
    /* Which is unpredictable: no branch. */
    const int top = top_a + (key[top_b] > key[top_a]) * (top_b - top_a);
    if (key[top] > far) {
        apart_by(sqrt(key[top]), out);
        return;
    }
    take_face(a, &fa, b, &fb, top, out);
    const double second = second_of(n, key, top);
    const double least = out->gap - tie;
    if (second >= least * fabs(least)) {
        take_first(a, &fa, b, &fb, key, least * fabs(least), out);
        out->tied = 1;
    } else {
        out->lead = out->gap - height_of(second);
    }
}
