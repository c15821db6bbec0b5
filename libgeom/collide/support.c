/* support.c: the farthest vertex of a core. */
#include "collide/placed.h"

/* From here on: a few samples, then a climb. */
enum { SCAN_MAX = 16, SAMPLES = 8 };

static int scan(const crm_placed *p, carom_vec2 u)
{
    int best = 0;
    double top = crm_dot(u, p->v[0]);
    for (int i = 1; i < p->n; i++) {
        const double s = crm_dot(u, p->v[i]);
        best = s > top ? i : best;
        top = s > top ? s : top;
    }
    return best;
}

int crm_climb(const crm_placed *p, carom_vec2 u, int i)
{
    double s = crm_dot(u, p->v[i]);
    const int ahead = crm_dot(u, p->v[crm_next(p, i)]) > s;
    for (int steps = 0; steps < p->n; steps++) {
        const int k = ahead ? crm_next(p, i) : crm_prev(p, i);
        const double t = crm_dot(u, p->v[k]);
        if (!(t > s)) {
            return t == s && k < i ? k : i;
        }
        s = t;
        i = k;
    }
    return i;
}

int crm_farthest(const crm_placed *p, carom_vec2 u)
{
    if (p->n <= SCAN_MAX) return scan(p, u);
    const int stride = p->n / SAMPLES;
    int best = 0;
    double top = crm_dot(u, p->v[0]);
    for (int i = stride; i < p->n; i += stride) {
        const double s = crm_dot(u, p->v[i]);
        if (s > top) {
            top = s;
            best = i;
        }
    }
    return crm_climb(p, u, best);
}
