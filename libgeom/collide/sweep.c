/* sweep.c: separating axes: the face of either core over which the other core is highest.
 *
 * The height of q over face k of p is min over q of m_k . (q - v_k), so at any one point x of q it
 * is at most m_k . (x - v_k): a face for which that is below a height already found is passed over.
 * The bound is sharp where it matters, with x the vertex lowest over a good first face. */
#include "collide/closest.h"

/* Faces whose heights differ by less are tied [1], times the coordinates [m]. */
static const double TIE_TOL = 1e-14;

static carom_vec2 turn(const crm_side *f, carom_vec2 v)
{
    return crm_vec(f->cos * v.x - f->sin * v.y, f->sin * v.x + f->cos * v.y);
}

static carom_vec2 turn_back(const crm_side *f, carom_vec2 v)
{
    return crm_vec(f->cos * v.x + f->sin * v.y, f->cos * v.y - f->sin * v.x);
}

/* A point of q's body in p's frame. */
static carom_vec2 seen(const crm_side *f, carom_vec2 v)
{
    return crm_add(f->at, turn(f, v));
}

/* Outward normal of edge k, as long as the edge. */
static carom_vec2 normal(const crm_side *f, int k)
{
    return crm_right(crm_sub(f->p->v[crm_next(f->p, k)], f->p->v[k]));
}

static double height(const crm_side *f, int k, int *vertex)
{
    const carom_vec2 u = normal(f, k);
    *vertex = f->q->n > 1 ? crm_farthest(f->q, turn_back(f, crm_neg(u))) : 0;
    const carom_vec2 x = crm_sub(seen(f, f->q->v[*vertex]), f->p->v[k]);
    return crm_dot(u, x) / crm_length(u);
}

/* Of the two faces at vertex i of p the one that looks more toward x. */
static int facing(const crm_side *f, int i, carom_vec2 x)
{
    const int before = crm_prev(f->p, i);
    const carom_vec2 u = normal(f, before);
    const carom_vec2 v = normal(f, i);
    const carom_vec2 y = crm_sub(x, f->p->v[i]);
    const double su = crm_dot(u, y);
    const double sv = crm_dot(v, y);
    return su * fabs(su) * crm_dot(v, v) > sv * fabs(sv) * crm_dot(u, u) ? before : i;
}

static crm_side side_of(const crm_placed *p, const crm_placed *q, int i, int j)
{
    crm_side f;
    f.p = p;
    f.q = q;
    f.cos = p->cos * q->cos + p->sin * q->sin;
    f.sin = p->cos * q->sin - p->sin * q->cos;
    f.at = crm_turn_back(p, crm_sub(q->at, p->at));
    f.height = -HUGE_VAL;
    f.edge = 0;
    f.vertex = j;
    if (p->n > 1) {
        f.edge = facing(&f, i, seen(&f, q->v[j]));
        f.height = height(&f, f.edge, &f.vertex);
    }
    return f;
}

void crm_sweep_start(const crm_placed *a, const crm_placed *b, const crm_axis *x, crm_side side[2])
{
    side[0] = side_of(a, b, x->a, x->b);
    side[1] = side_of(b, a, x->b, x->a);
}

static double coordinates(const crm_placed *p)
{
    double top = p->radius;
    for (int i = 0; i < p->n; i++) {
        const double x = fabs(p->v[i].x);
        const double y = fabs(p->v[i].y);
        if (x > top) top = x;
        if (y > top) top = y;
    }
    return top;
}

typedef struct best_face {
    double height;
    double second; /* of the other faces, A's and B's: a bound from above */
    double least;  /* faces that cannot reach this are passed over */
    int edge;
    int vertex;
    int on_b;
} best_face;

static void offer(best_face *best, double h, double tie, int edge, int vertex, int on_b)
{
    if (h > best->height + tie) {
        best->second = best->second > best->height ? best->second : best->height;
        best->height = h;
        best->edge = edge;
        best->vertex = vertex;
        best->on_b = on_b;
        if (h - tie > best->least) best->least = h - tie;
    } else if (h > best->second) {
        best->second = h;
    }
}

/* b / |u| < least, for a bound b times |u|, without the root. */
static int is_below(double b, double uu, double least)
{
    if (least >= 0) return b < 0 || b * b < least * least * uu;
    return b < 0 && b * b > least * least * uu;
}

static void sweep_faces(const crm_side *f, int on_b, double tie, best_face *best)
{
    const crm_placed *p = f->p;
    if (p->n == 1) return;
    const carom_vec2 x = seen(f, f->q->v[f->vertex]);
    for (int k = 0; k < p->n; k++) {
        const carom_vec2 u = normal(f, k);
        const double bound = crm_dot(u, crm_sub(x, p->v[k]));
        int j = f->vertex;
        double h = f->height;
        if (k != f->edge) {
            if (is_below(bound, crm_dot(u, u), best->least)) continue;
            h = height(f, k, &j);
        }
        offer(best, h, tie, k, j, on_b);
    }
}

crm_closest crm_sweep(const crm_side side[2], double reach)
{
    const crm_placed *a = side[0].p;
    const crm_placed *b = side[0].q;
    const double ca = coordinates(a);
    const double cb = coordinates(b);
    const double tie = TIE_TOL * (ca > cb ? ca : cb);
    const double known = side[0].height > side[1].height ? side[0].height : side[1].height;
    best_face best = {-HUGE_VAL, -HUGE_VAL, known - 2 * tie, 0, 0, 0};
    sweep_faces(&side[0], 0, tie, &best);
    sweep_faces(&side[1], 1, tie, &best);
    crm_closest r = best.on_b ? crm_face_at(b, best.edge, a, best.vertex, 1)
                              : crm_face_at(a, best.edge, b, best.vertex, 0);
    r.tied = best.second >= best.height - tie;
    if (r.gap > reach) r.kind = CRM_APART;
    return r;
}
