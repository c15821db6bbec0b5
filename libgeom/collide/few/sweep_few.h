/* sweep_few.h: crm_sweep for cores of few vertices, to be compiled for more than one machine: every
 * face against every vertex, four faces at a time, in the frame of A's body.
 *
 * A face's height s / |u| is compared by its key s |s| / u.u, which is in the same order.  Cores
 * are filled up to one or two quads by copies of the first vertex: loops have constant lengths, and
 * a face without length gets the least key. */
#ifndef CRM_SWEEP_FEW_H
#define CRM_SWEEP_FEW_H

#include "collide/closest.h"
#include "collide/few/quad.h"

enum { MAX_QUADS = CRM_FEW / 4 };

/* Vertices, and outward normals of the edges from them, as long as these. */
typedef struct few {
    crm_quad x[MAX_QUADS];
    crm_quad y[MAX_QUADS];
    crm_quad ux[MAX_QUADS];
    crm_quad uy[MAX_QUADS];
} few;

static inline crm_lanes vertex(const crm_placed *p, int i)
{
    return crm_lanes_load(&p->v[i < p->n ? i : 0].x);
}

/* In p's frame: the differences are taken before anything is turned, as in crm_edge. */
static inline void gather(const crm_placed *p, int quads, few *f)
{
    for (int i = 0; i < quads; i++) {
        const crm_lanes v0 = vertex(p, 4 * i);
        const crm_lanes v1 = vertex(p, 4 * i + 1);
        const crm_lanes v2 = vertex(p, 4 * i + 2);
        const crm_lanes v3 = vertex(p, 4 * i + 3);
        f->x[i] = crm_quad_join(crm_lanes_firsts(v0, v1), crm_lanes_firsts(v2, v3));
        f->y[i] = crm_quad_join(crm_lanes_seconds(v0, v1), crm_lanes_seconds(v2, v3));
    }
    for (int i = 0; i < quads; i++) {
        const int next = i + 1 < quads ? i + 1 : 0;
        f->ux[i] = crm_quad_sub(crm_quad_shift(f->y[i], f->y[next]), f->y[i]);
        f->uy[i] = crm_quad_sub(f->x[i], crm_quad_shift(f->x[i], f->x[next]));
    }
}

static inline void rotate(crm_quad c, crm_quad s, crm_quad *x, crm_quad *y)
{
    const crm_quad u = *x;
    const crm_quad v = *y;
    *x = crm_quad_sub(crm_quad_mul(c, u), crm_quad_mul(s, v));
    *y = crm_quad_add(crm_quad_mul(s, u), crm_quad_mul(c, v));
}

/* From b's frame into a's, still from b's position. */
static inline void turn(const crm_placed *a, const crm_placed *b, int quads, few *f)
{
    const crm_quad c = crm_quad_all(a->cos * b->cos + a->sin * b->sin);
    const crm_quad s = crm_quad_all(a->cos * b->sin - a->sin * b->cos);
    for (int i = 0; i < quads; i++) {
        rotate(c, s, &f->x[i], &f->y[i]);
        rotate(c, s, &f->ux[i], &f->uy[i]);
    }
}

/* Lowest of four vertices along four normals. */
static inline crm_quad low_of_four(crm_quad ux, crm_quad uy, crm_quad x, crm_quad y, int *lowest)
{
    const crm_quad s0 = crm_quad_dot(ux, uy, crm_quad_repeat(x, 0), crm_quad_repeat(y, 0));
    const crm_quad s1 = crm_quad_dot(ux, uy, crm_quad_repeat(x, 1), crm_quad_repeat(y, 1));
    const crm_quad s2 = crm_quad_dot(ux, uy, crm_quad_repeat(x, 2), crm_quad_repeat(y, 2));
    const crm_quad s3 = crm_quad_dot(ux, uy, crm_quad_repeat(x, 3), crm_quad_repeat(y, 3));
    const crm_quad first = crm_quad_min(s1, s0);
    const crm_quad last = crm_quad_min(s3, s2);
    *lowest = crm_quad_less(s1, s0) | crm_quad_less(s3, s2) << 4 | crm_quad_less(last, first) << 8;
    return crm_quad_min(last, first);
}

/* Which of four it is for normal k: three bits in low_of_four's word. */
static inline int lowest_for(int lowest, int k)
{
    const int bits = lowest >> k;
    return bits & 0x100 ? 2 + (bits >> 4 & 1) : bits & 1;
}

/* Faces of p over the vertices of q: what a search among tied ones needs. */
typedef struct faces {
    crm_quad key[MAX_QUADS];
    crm_quad low[MAX_QUADS][MAX_QUADS]; /* of each four faces over each four vertices */
    int lowest[MAX_QUADS][MAX_QUADS];
} faces;

/* The vertex under face k. */
static inline int vertex_under(int quads, const faces *f, int k)
{
    if (quads == 1) return lowest_for(f->lowest[0][0], k);
    const int i = k >> 2;
    const int on_last = crm_quad_less(f->low[i][1], f->low[i][0]) >> (k & 3) & 1;
    return 4 * on_last + lowest_for(f->lowest[i][on_last], k & 3);
}

static inline double larger(double x, double y)
{
    return x > y ? x : y;
}

static inline double smaller(double x, double y)
{
    return x < y ? x : y;
}

/* The two largest keys, and a face that has the largest. */
typedef struct top {
    double key;
    double second;
    int at;
} top;

static inline top top_of_four(crm_quad key)
{
    const crm_lanes u = crm_quad_low(key);
    const crm_lanes v = crm_quad_high(key);
    const crm_lanes high = crm_lanes_max(v, u);
    const crm_lanes rest = crm_lanes_min(v, u);
    const double even = crm_lanes_first(high);
    const double odd = crm_lanes_second(high);
    const int is_odd = odd > even;
    top t;
    t.key = larger(even, odd);
    t.second = larger(smaller(even, odd), larger(crm_lanes_first(rest), crm_lanes_second(rest)));
    t.at = is_odd + 2 * (crm_lanes_less(u, v) >> is_odd & 1);
    return t;
}

static inline top higher_of(top t, top u)
{
    top both;
    both.key = larger(t.key, u.key);
    both.second = larger(smaller(t.key, u.key), larger(t.second, u.second));
    both.at = u.key > t.key ? 4 + u.at : t.at;
    return both;
}

/* Faces i ... i + 3; d: from p's position to q's. */
static inline crm_quad see_four(int quads, int i, const few *p, const few *q, carom_vec2 d,
                                faces *f)
{
    const crm_quad ux = p->ux[i];
    const crm_quad uy = p->uy[i];
    crm_quad low = low_of_four(ux, uy, q->x[0], q->y[0], &f->lowest[i][0]);
    if (quads == 2) {
        f->low[i][0] = low;
        f->low[i][1] = low_of_four(ux, uy, q->x[1], q->y[1], &f->lowest[i][1]);
        low = crm_quad_min(f->low[i][1], low);
    }
    const crm_quad to_x = crm_quad_sub(crm_quad_all(d.x), p->x[i]);
    const crm_quad to_y = crm_quad_sub(crm_quad_all(d.y), p->y[i]);
    const crm_quad s = crm_quad_add(low, crm_quad_dot(ux, uy, to_x, to_y));
    const crm_quad key =
        crm_quad_div(crm_quad_mul(s, crm_quad_abs(s)), crm_quad_dot(ux, uy, ux, uy));
    return crm_quad_max(key, crm_quad_all(-HUGE_VAL)); /* 0 / 0 */
}

static inline top see_faces(int quads, const few *p, const few *q, carom_vec2 d, faces *f)
{
    f->key[0] = see_four(quads, 0, p, q, d, f);
    top t = top_of_four(f->key[0]);
    if (quads == 2) {
        f->key[1] = see_four(quads, 1, p, q, d, f);
        t = higher_of(t, top_of_four(f->key[1]));
    }
    return t;
}

static inline void apart_by(double gap, crm_closest *out)
{
    out->kind = CRM_APART;
    out->a = out->b = out->tied = 0;
    out->lead = 0;
    out->gap = gap;
}

static inline double height_of(double key)
{
    return key < 0 ? -sqrt(-key) : sqrt(key);
}

static inline double key_at(const faces *f, int k)
{
    const crm_quad q = f->key[k >> 2];
    const crm_lanes half = k & 2 ? crm_quad_high(q) : crm_quad_low(q);
    return k & 1 ? crm_lanes_second(half) : crm_lanes_first(half);
}

/* Of p's tied faces the first with a foot on it; 0: none has one. */
static int first_with_foot(int quads, const crm_placed *p, const crm_placed *q, const faces *f,
                           int on_b, double least, crm_closest *out)
{
    for (int k = 0; p->n > 1 && k < p->n; k++) {
        if (!(key_at(f, k) >= least)) continue;
        const int j = vertex_under(quads, f, k);
        if (!crm_foot_is_on(p, k, q, j, crm_noise(p, k, q, j))) continue;
        crm_face_at(p, k, q, j, on_b, out);
        return 1;
    }
    return 0;
}

/* For cores of at most 4 quads vertices, quads a constant. */
static inline void sweep_few(int quads, const crm_placed *a, const crm_placed *b, double tie,
                             const crm_search *how, crm_closest *out)
{
    few at_a;
    few at_b;
    faces on_a;
    faces on_b;
    gather(a, quads, &at_a);
    gather(b, quads, &at_b);
    turn(a, b, quads, &at_b);
    const carom_vec2 d = crm_turn_back(a, crm_sub(b->at, a->at));
    const double beyond = crm_beyond(how->reach, tie);
    const double far = beyond * beyond;
    const top top_a = see_faces(quads, &at_a, &at_b, d, &on_a);
    if (top_a.key > far) {
        apart_by(sqrt(top_a.key), out);
        return;
    }
    const top top_b = see_faces(quads, &at_b, &at_a, crm_neg(d), &on_b);
    if (top_b.key > far) {
        apart_by(sqrt(top_b.key), out);
        return;
    }
    if (top_b.key > top_a.key) {
        crm_face_at(b, top_b.at, a, vertex_under(quads, &on_b, top_b.at), 1, out);
    } else {
        crm_face_at(a, top_a.at, b, vertex_under(quads, &on_a, top_a.at), 0, out);
    }
    const double second = larger(smaller(top_a.key, top_b.key), larger(top_a.second, top_b.second));
    const double least = out->gap - tie;
    const double least_key = least * fabs(least);
    if (second >= least_key) {
        /* Without a foot the top stays: tied faces side by side are almost parallel. */
        if (!first_with_foot(quads, a, b, &on_a, 0, least_key, out)) {
            first_with_foot(quads, b, a, &on_b, 1, least_key, out);
        }
        out->tied = 1;
    } else if (how->slack > 0) {
        out->lead = out->gap - height_of(second);
    }
}

#endif
