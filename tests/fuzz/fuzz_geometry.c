/* fuzz_geometry.c: shapes, poses and boxes from any bytes.  Whatever the check lets through must
 * collide, differentiate and answer queries in finite numbers; a cache must change nothing. */
#include "fuzz_geometry.h"

#include "carom/chain.h"
#include "carom/query.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_VERTICES = 20, MAX_BOXES = 90 };

typedef struct bytes {
    const unsigned char *at;
    size_t left;
} bytes;

static unsigned take_byte(bytes *b)
{
    if (!b->left) return 0;
    b->left--;
    return *b->at++;
}

/* Small integers, fractions, any bit pattern, and numbers that hurt. */
static double take_number(bytes *b)
{
    static const double odd[] = {0,     -0.0,     1e-40, 1e40,   -1e40, 1e-12, 1 + 1e-12, 1e-300,
                                 1e300, HUGE_VAL, NAN,   5e-324, 1e-8,  1e8,   1e15,      -1};
    const unsigned kind = take_byte(b);
    if (kind < 96) return (int)(take_byte(b) % 17) - 8;
    if (kind < 200) return ((int)take_byte(b) - 128 + take_byte(b) / 256.0) / 16;
    if (kind < 232) return odd[take_byte(b) % 16];
    unsigned char raw[8];
    double x;
    for (int i = 0; i < 8; i++) raw[i] = (unsigned char)take_byte(b);
    memcpy(&x, raw, sizeof x);
    return x;
}

typedef struct body {
    carom_shape shape;
    carom_pose pose;
    carom_vec2 v[MAX_VERTICES];
} body;

static void insist(int truth)
{
    if (!truth) abort();
}

/* Vertices as they come, or their hull. */
static void take_body(bytes *b, body *out)
{
    carom_vec2 p[MAX_VERTICES];
    int index[MAX_VERTICES];
    const int n = (int)(take_byte(b) % (MAX_VERTICES + 1));
    for (int i = 0; i < n; i++) {
        p[i].x = take_number(b);
        p[i].y = take_number(b);
    }
    int count = n;
    out->shape.radius = fabs(take_number(b));
    if (take_byte(b) % 2 && n && carom_hull_from_points(n, p, index, &count) == CAROM_OK) {
        insist(count >= 1 && count <= n);
        for (int i = 0; i < count; i++) out->v[i] = p[index[i]];
        const carom_shape hull = {0, count, out->v};
        if (count > 1) insist(carom_shape_check(&hull, NULL) == CAROM_OK);
    } else {
        count = n;
        memcpy(out->v, p, sizeof p);
    }
    out->shape.count = count;
    out->shape.vertices = out->v;
    out->pose.angle = take_number(b);
    out->pose.x = take_number(b);
    out->pose.y = take_number(b);
}

static int is_usable(const body *s)
{
    carom_shape_error e;
    char text[8];
    const carom_status status = carom_shape_check(&s->shape, &e);
    insist((status == CAROM_OK) == (e.fault == CAROM_SHAPE_VALID));
    insist(e.vertex >= -1 && e.vertex < (s->shape.count > 0 ? s->shape.count : 1));
    carom_shape_error_text(e, text, sizeof text);
    insist(memchr(text, 0, sizeof text) != NULL);
    const carom_pose q = s->pose;
    return status == CAROM_OK && fabs(q.x) <= 1e40 && fabs(q.y) <= 1e40 && fabs(q.angle) <= 1e15;
}

static void check_mass(const body *s)
{
    const carom_mass_properties m = carom_shape_mass(&s->shape, 1);
    insist(m.area >= 0 && isfinite(m.inertia) && isfinite(m.centroid.x) && isfinite(m.centroid.y));
}

static void check_point(const body *a, const body *b, const carom_manifold *m, int i)
{
    const carom_contact_point *p = &m->points[i];
    const carom_recipe r = p->recipe;
    carom_vec2 n;
    const carom_contact_point e = carom_contact_eval(&a->shape, a->pose, &b->shape, b->pose, r, &n);
    insist(e.gap == p->gap && e.arm_a.x == p->arm_a.x && e.arm_b.y == p->arm_b.y);
    insist(n.x == m->normal.x && n.y == m->normal.y);
    insist(r.ref >= 0 && r.ref < (r.flipped ? b : a)->shape.count);
    insist(r.inc >= 0 && r.inc < (r.flipped ? a : b)->shape.count);
    const carom_contact_bar bar = {{1, 2}, {3, 4}, {5, 6}, 7};
    carom_vec2 va[MAX_VERTICES] = {{0, 0}};
    carom_vec2 vb[MAX_VERTICES] = {{0, 0}};
    carom_shape_bar ga = {{0, 0, 0}, 0, va};
    carom_shape_bar gb = {{0, 0, 0}, 0, vb};
    carom_contact_vjp(&a->shape, a->pose, &b->shape, b->pose, r, &bar, &ga, &gb);
    insist(isfinite(ga.radius) && isfinite(gb.radius));
}

static void check_pair(const body *a, const body *b, double margin)
{
    const carom_frame fa = carom_frame_at(a->pose);
    const carom_frame fb = carom_frame_at(b->pose);
    carom_pair_cache cache = {0};
    const carom_manifold m = carom_collide(&a->shape, a->pose, &b->shape, b->pose, margin);
    insist(m.count >= 0 && m.count <= 2 && !isnan(m.distance));
    for (int i = 0; i < m.count; i++) check_point(a, b, &m, i);
    if (m.count) insist(fabs(hypot(m.normal.x, m.normal.y) - 1) < 1e-12);
    for (int pass = 0; pass < 2; pass++) {
        const carom_manifold c =
            carom_collide_frames(&a->shape, &fa, &b->shape, &fb, margin, &cache);
        insist(c.count == m.count);
        if (m.count) insist(c.distance == m.distance && c.normal.x == m.normal.x);
    }
}

static void check_queries(const body *a, const body *b, carom_vec2 p, carom_vec2 d)
{
    carom_vec2 n;
    carom_ray_hit hit;
    carom_cast_hit cast;
    insist(!isnan(carom_point_distance(&a->shape, a->pose, p, &n)));
    if (carom_ray_cast(&a->shape, a->pose, p, d, &hit)) {
        insist(hit.enter >= 0 && hit.enter <= hit.leave && hit.leave <= 1);
    }
    const carom_sweep still = {a->pose, a->pose};
    const carom_sweep moving = {b->pose, {b->pose.angle + d.x, b->pose.x + d.x, b->pose.y + d.y}};
    insist(carom_shape_cast(&a->shape, still, &b->shape, moving, 0, &cast) >= 0);
    insist(cast.t >= 0 && cast.t <= 1);
}

static void check_chain(const body *s, const body *b)
{
    const carom_chain chain = {s->shape.radius, s->shape.count, s->v, s->shape.count % 2};
    if (carom_chain_check(&chain, NULL)) return;
    for (int k = 0; k < carom_chain_links(&chain); k++) {
        const carom_manifold m = carom_collide_chain(&chain, k, s->pose, &b->shape, b->pose, 0.5);
        insist(m.count >= 0 && m.count <= 2);
    }
}

static int meet(const carom_box *a, const carom_box *b)
{
    return a->lower.x <= a->upper.x && a->lower.y <= a->upper.y && b->lower.x <= b->upper.x &&
           b->lower.y <= b->upper.y && a->lower.x <= b->upper.x && b->lower.x <= a->upper.x &&
           a->lower.y <= b->upper.y && b->lower.y <= a->upper.y;
}

static void check_boxes(bytes *b)
{
    carom_box box[MAX_BOXES];
    carom_broadphase *bp = NULL;
    int n_pairs;
    const carom_pair *pairs;
    for (int i = 0; i < MAX_BOXES; i++) {
        box[i].lower.x = take_number(b);
        box[i].lower.y = take_number(b);
        box[i].upper.x = box[i].lower.x + fabs(take_number(b));
        box[i].upper.y = box[i].lower.y + fabs(take_number(b));
    }
    if (carom_broadphase_create(NULL, &bp)) return;
    insist(carom_broadphase_pairs(bp, MAX_BOXES, box, &n_pairs, &pairs) == CAROM_OK);
    int k = 0;
    for (int i = 0; i < MAX_BOXES; i++) {
        for (int j = i + 1; j < MAX_BOXES; j++) {
            if (!meet(&box[i], &box[j])) continue;
            insist(k < n_pairs && pairs[k].a == i && pairs[k].b == j);
            k++;
        }
    }
    insist(k == n_pairs);
    carom_broadphase_destroy(bp);
}

void fuzz_geometry_one(const unsigned char *data, size_t size)
{
    bytes b = {data, size};
    body s[2];
    take_body(&b, &s[0]);
    take_body(&b, &s[1]);
    const int usable[2] = {is_usable(&s[0]), is_usable(&s[1])};
    for (int k = 0; k < 2; k++) {
        if (usable[k]) check_mass(&s[k]);
    }
    const double margin = fabs(take_number(&b));
    const carom_vec2 p = {take_number(&b), take_number(&b)};
    const carom_vec2 d = {take_number(&b), take_number(&b)};
    if (usable[0] && usable[1]) {
        if (margin >= 0) check_pair(&s[0], &s[1], margin);
        const double far = fmax(fmax(fabs(p.x), fabs(p.y)), fmax(fabs(d.x), fabs(d.y)));
        if (isfinite(p.x + p.y + d.x + d.y) && far <= 1e15) check_queries(&s[0], &s[1], p, d);
    }
    if (usable[1] && fabs(s[0].pose.x + s[0].pose.y + s[0].pose.angle) <= 1e15) {
        check_chain(&s[0], &s[1]);
    }
    if (take_byte(&b) % 8 == 0) check_boxes(&b);
}
