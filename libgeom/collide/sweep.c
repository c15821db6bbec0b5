/* sweep.c: separating axes, all face normals of both cores, with the support vertex carried along.
 *
 * Turning the normal counterclockwise turns the support vertex counterclockwise, so one trip around
 * each core costs O(n_a + n_b). */
#include "collide/closest.h"

/* Faces whose separations differ by less are tied [1], times the pair's extent [m]. */
static const double TIE_TOL = 1e-14;

static double extent_of(const crm_placed *p)
{
    carom_vec2 low = p->v[0];
    carom_vec2 high = p->v[0];
    for (int i = 1; i < p->n; i++) {
        low.x = fmin(low.x, p->v[i].x);
        low.y = fmin(low.y, p->v[i].y);
        high.x = fmax(high.x, p->v[i].x);
        high.y = fmax(high.y, p->v[i].y);
    }
    return fmax(fmax(high.x - low.x, high.y - low.y), p->radius);
}

/* Corners that turn less than 84 degrees are blunt: squared cosine.  At 90 degrees a rounding of
 * the normal decides whether an edge of the other core lies flat at the top. */
static const double BLUNT = 0.01;

typedef struct best_face {
    double height;
    double second; /* of the other faces, A's and B's */
    int edge;
    int vertex;
    int on_b;
} best_face;

static void offer(best_face *best, double height, double tie, int edge, int vertex, int on_b)
{
    if (height > best->height + tie) {
        best->second = fmax(best->second, best->height);
        best->height = height;
        best->edge = edge;
        best->vertex = vertex;
        best->on_b = on_b;
    } else {
        best->second = fmax(best->second, height);
    }
}

/* The lowest vertex of q along u (frame of q's body), climbing counterclockwise from j. */
static int climb(const crm_placed *q, carom_vec2 u, int j)
{
    double s = crm_dot(u, q->v[j]);
    for (int steps = 0; steps < q->n; steps++) {
        const int k = crm_next(q, j);
        const double t = crm_dot(u, q->v[k]);
        if (!(t < s)) break;
        s = t;
        j = k;
    }
    return j;
}

/* All faces of p against q.  Returns 1 when one separates by more than reach. */
static int sweep_faces(const crm_placed *p, const crm_placed *q, int on_b, double tie, double reach,
                       best_face *best)
{
    carom_vec2 before = {0, 0};
    int j = 0;
    for (int k = 0; p->n > 1 && k < p->n; k++) {
        const carom_vec2 u = crm_normal(p, k);
        /* Past a sharp corner the climb would start near the top, where it could stall. */
        const double turn = crm_dot(before, u);
        if (turn > 0 && turn * turn > BLUNT * crm_dot(before, before) * crm_dot(u, u)) {
            j = climb(q, crm_turn_back(q, u), j);
        } else {
            j = crm_support(q, crm_neg(u));
        }
        before = u;
        const double height = crm_dot(u, crm_between(p, k, q, j)) / crm_length(u);
        offer(best, height, tie, k, j, on_b);
        if (height > reach) return 1;
    }
    return 0;
}

crm_closest crm_sweep(const crm_placed *a, const crm_placed *b, double reach)
{
    const double tie = TIE_TOL * fmax(extent_of(a), extent_of(b));
    best_face best = {-HUGE_VAL, -HUGE_VAL, 0, 0, 0};
    crm_closest r = {CRM_APART, 0, 0, 0, 0};
    if (!sweep_faces(a, b, 0, tie, reach, &best) && !sweep_faces(b, a, 1, tie, reach, &best)) {
        r.kind = best.on_b ? CRM_FACE_B : CRM_FACE_A;
    }
    r.a = best.on_b ? best.vertex : best.edge;
    r.b = best.on_b ? best.edge : best.vertex;
    r.tied = best.second >= best.height - tie;
    r.gap = best.height;
    if (r.kind == CRM_FACE_A) r.gap = crm_height(a, r.a, b, r.b);
    if (r.kind == CRM_FACE_B) r.gap = crm_height(b, r.b, a, r.a);
    return r;
}
