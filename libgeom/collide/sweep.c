/* sweep.c: separating axes: the face of either core over which the other core is highest.
 *
 * The height of q over face k of p is min over q of m_k . (q - v_k), so at any one point x of q it
 * is at most m_k . (x - v_k): a face for which that is below a height already found is passed over.
 * The bound is sharp where it matters, with x the vertex lowest over a good first face. */
#include "collide/closest.h"

/* One core's faces against the other core, in the frame of the first one's body. */
typedef struct faces {
    const crm_placed *p;
    const crm_placed *q;
    double cos; /* from q's frame to p's */
    double sin;
    carom_vec2 at; /* q's position */
    int edge;      /* the face tried first, */
    int vertex;    /* q's vertex lowest over it */
    double height; /* and its height */
} faces;

static carom_vec2 turn_back(const faces *f, carom_vec2 v)
{
    return crm_vec(f->cos * v.x + f->sin * v.y, f->cos * v.y - f->sin * v.x);
}

/* A point of q's body in p's frame. */
static carom_vec2 seen(const faces *f, carom_vec2 v)
{
    return crm_vec(f->at.x + (f->cos * v.x - f->sin * v.y),
                   f->at.y + (f->sin * v.x + f->cos * v.y));
}

/* Outward normal of edge k, as long as the edge. */
static carom_vec2 normal(const faces *f, int k)
{
    return crm_right(crm_sub(f->p->v[crm_next(f->p, k)], f->p->v[k]));
}

static double height(const faces *f, int k, int *vertex)
{
    const carom_vec2 u = normal(f, k);
    if (f->q->n > 1) *vertex = crm_climb(f->q, turn_back(f, crm_neg(u)), *vertex);
    const carom_vec2 x = crm_sub(seen(f, f->q->v[*vertex]), f->p->v[k]);
    return crm_dot(u, x) / crm_length(u);
}

/* b |b|, in the order of b. */
static double signed_square(double b)
{
    return b * fabs(b);
}

/* Of the two faces at vertex i of p the one that looks more toward x. */
static int facing(const faces *f, int i, carom_vec2 x)
{
    const int before = crm_prev(f->p, i);
    const carom_vec2 u = normal(f, before);
    const carom_vec2 v = normal(f, i);
    const carom_vec2 y = crm_sub(x, f->p->v[i]);
    const double ku = signed_square(crm_dot(u, y)) * crm_dot(v, v);
    const double kv = signed_square(crm_dot(v, y)) * crm_dot(u, u);
    return ku > kv ? before : i;
}

/* To the neighboring face while that is higher: a good first face makes good bounds. */
static void climb_faces(faces *f)
{
    int ahead = 1;
    for (int steps = 0; steps < 2 * f->p->n; steps++) {
        const int k = ahead ? crm_next(f->p, f->edge) : crm_prev(f->p, f->edge);
        int j = f->vertex;
        const double h = height(f, k, &j);
        if (h > f->height) {
            f->edge = k;
            f->vertex = j;
            f->height = h;
        } else if (ahead && steps == 0) {
            ahead = 0;
        } else {
            return;
        }
    }
}

static faces faces_of(const crm_placed *p, const crm_placed *q, int i, int j)
{
    faces f;
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
        climb_faces(&f);
    }
    return f;
}

typedef struct top {
    double height;
    double second; /* of the other faces, when it is within the slack */
    double slack;
    int edge;
    int vertex;
    int on_b;
} top;

/* Offers the faces of f, but for those that are surely lower by more than the slack than the top or
 * than at_least, a height known to be reached. */
static void offer_faces(const faces *f, int on_b, double at_least, top *t)
{
    const crm_placed *p = f->p;
    if (p->n == 1) return;
    const carom_vec2 x = seen(f, f->q->v[f->vertex]);
    double least = (at_least > t->height ? at_least : t->height) - t->slack;
    double key = signed_square(least);
    carom_vec2 v = p->v[p->n - 1];
    int low = f->vertex; /* follows the normal around: the climbs of one trip add up to one trip */
    for (int i = 0; i < p->n; i++) {
        const carom_vec2 w = p->v[i];
        const carom_vec2 u = crm_right(crm_sub(w, v));
        const double bound = crm_dot(u, crm_sub(x, v));
        v = w;
        if (signed_square(bound) < key * crm_dot(u, u)) continue;
        const int k = crm_prev(p, i);
        const double h = height(f, k, &low);
        if (h > t->height) {
            t->second = t->height;
            t->height = h;
            t->edge = k;
            t->vertex = low;
            t->on_b = on_b;
            if (h - t->slack > least) least = h - t->slack;
            key = signed_square(least);
        } else if (h > t->second) {
            t->second = h;
        }
    }
}

/* Of tied faces the first with a foot on it: the lowest index on A, else on B.  Without one the top
 * stays: tied faces side by side are almost parallel. */
static void first_of_tied(const faces *f, int on_b, double least, int *found, top *t)
{
    const crm_placed *p = f->p;
    int low = f->vertex;
    for (int k = 0; p->n > 1 && !*found && k < p->n; k++) {
        if (!(height(f, k, &low) >= least)) continue;
        if (!crm_foot_is_on(p, k, f->q, low, crm_noise(p, k, f->q, low))) continue;
        *found = 1;
        t->edge = k;
        t->vertex = low;
        t->on_b = on_b;
    }
}

void crm_sweep(const crm_placed *a, const crm_placed *b, const crm_axis *x, double reach,
               double slack, crm_closest *out)
{
    const faces fa = faces_of(a, b, x->a, x->b);
    const faces fb = faces_of(b, a, x->b, x->a);
    const double tie = crm_tie(a, b);
    const double known = fa.height > fb.height ? fa.height : fb.height;
    top t = {-HUGE_VAL, -HUGE_VAL, slack > 2 * tie ? slack : 2 * tie, 0, 0, 0};
    offer_faces(&fa, 0, known, &t);
    offer_faces(&fb, 1, known, &t);
    const double lead = t.height - t.second;
    const int tied = lead <= tie;
    if (tied) {
        int found = 0;
        first_of_tied(&fa, 0, t.height - tie, &found, &t);
        first_of_tied(&fb, 1, t.height - tie, &found, &t);
    }
    crm_face_at(t.on_b ? b : a, t.edge, t.on_b ? a : b, t.vertex, t.on_b, out);
    out->tied = tied;
    out->lead = lead < t.slack ? lead : t.slack;
    if (out->gap > crm_beyond(reach, tie)) out->kind = CRM_APART;
}
