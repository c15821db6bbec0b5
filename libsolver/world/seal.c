/* seal.c: what is fixed before the first step: scales, memory, initial overlap. */
#include "world/block.h"
#include "world/internal.h"

#include <math.h>

/* Rounds of detection and projection for an overlapping initial scene. */
enum { MAX_ROUNDS = 50 };
/* Moving bodies up to which `located` runs its second-order map.  Without islands every impact and
 * every Newton iteration solves the whole world: beyond this the Euler map is used instead. */
enum { LOCATED_BODIES = 48 };

static double farthest(const carom_shape *s)
{
    double r = 0;
    for (int k = 0; k < s->count; k++) r = fmax(r, hypot(s->vertices[k].x, s->vertices[k].y));
    return r + s->radius;
}

static double diameter(const carom_shape *s)
{
    double d = 0;
    for (int i = 0; i < s->count; i++) {
        for (int k = 0; k < i; k++) {
            d = fmax(
                d, hypot(s->vertices[i].x - s->vertices[k].x, s->vertices[i].y - s->vertices[k].y));
        }
    }
    return d + 2 * s->radius;
}

/* Width along the inward normal of edge i: the farthest vertex from its line. */
static double edge_width(const carom_shape *s, int i)
{
    const carom_vec2 a = s->vertices[i];
    const carom_vec2 b = s->vertices[(i + 1) % s->count];
    const double length = hypot(b.x - a.x, b.y - a.y);
    double w = 0;
    for (int k = 0; k < s->count; k++) {
        const carom_vec2 p = s->vertices[k];
        w = fmax(w, ((b.x - a.x) * (p.y - a.y) - (b.y - a.y) * (p.x - a.x)) / length);
    }
    return w;
}

/* The width of a convex polygon is reached at an edge normal. */
static double thickness(const carom_shape *s)
{
    double w = s->count > 2 ? HUGE_VAL : 0;
    for (int i = 0; s->count > 2 && i < s->count; i++) w = fmin(w, edge_width(s, i));
    return w + 2 * s->radius;
}

static void set_scales(carom_world *w)
{
    double length = 0;
    for (int k = 0; k < w->n_shapes; k++) {
        crm_shape *s = &w->shapes[k];
        s->reach = farthest(&s->view);
        s->thickness = thickness(&s->view);
        const crm_body *b = &w->bodies[s->body];
        if (b->type == CAROM_DYNAMIC && !b->sensor) length = fmax(length, diameter(&s->view));
    }
    if (w->settings.length > 0) length = w->settings.length;
    w->length = length > 0 ? length : 1;
    const double g = hypot(w->settings.gravity[0], w->settings.gravity[1]);
    w->speed = sqrt(g * w->length);
    w->rest_speed = w->settings.rest_speed * w->speed;
}

static void number_unknowns(carom_world *w)
{
    w->n_moving = 0;
    for (int b = 0; b < w->n_bodies; b++) {
        w->bodies[b].unknown = w->bodies[b].type == CAROM_STATIC ? -1 : w->n_moving++;
    }
    w->smooth = w->settings.integrator == CAROM_LOCATED && w->n_moving <= LOCATED_BODIES;
}

static void lay_world(carom_world *w, crm_block *b)
{
    const size_t n3 = 3 * (size_t)w->n_bodies;
    w->step_force = crm_carve(b, n3, sizeof(double));
    w->q_saved = crm_carve(b, n3, sizeof(double));
    w->v_saved = crm_carve(b, n3, sizeof(double));
    w->boxes = crm_carve(b, (size_t)w->n_shapes, sizeof *w->boxes);
    w->joined = crm_carve(b, (size_t)w->n_joints, sizeof *w->joined);
}

static carom_status allocate(carom_world *w)
{
    crm_block b = {NULL, 0};
    lay_world(w, &b);
    b.base = crm_new(&w->memory, b.used, 1);
    if (!b.base) return CAROM_E_MEMORY;
    w->seal_block = b.base;
    w->seal_bytes = b.used;
    b.used = 0;
    lay_world(w, &b);
    carom_status e = crm_rows_create(w);
    if (!e) e = crm_substep_create(w, &w->sub);
    return e;
}

/* The deepest overlap among sub.contacts, or -1. */
static int deepest(const crm_substep *s)
{
    int k = -1;
    for (int i = 0; i < s->n_contacts; i++) {
        if (s->contacts[i].gap < (k < 0 ? 0 : s->contacts[k].gap)) k = i;
    }
    return k;
}

static carom_status project_once(carom_world *w)
{
    crm_substep *s = &w->sub;
    const size_t bytes = 3 * (size_t)w->n_bodies * sizeof(double);
    memcpy(s->q1, w->q, bytes);
    memset(s->pressing, 0, (size_t)s->n_contacts);
    s->map = CRM_MAP_EULER;
    s->h = 0;
    const carom_status e = crm_project(w, s);
    if (e < 0) return e;
    memcpy(w->q, s->q1, bytes);
    return CAROM_OK;
}

/* Overlap of the initial scene is projected away, or refused by setting. */
static carom_status clear_overlap(carom_world *w)
{
    const double tol = w->settings.penetration * w->length + crm_rounding(w);
    double worst = 0;
    int a = 0;
    int b = 0;
    for (int round = 0; round <= MAX_ROUNDS; round++) {
        const carom_status e = crm_detect(w, w->q, w->settings.margin * w->length);
        if (e < 0) return e;
        const int k = deepest(&w->sub);
        const double depth = k < 0 ? 0 : -w->sub.contacts[k].gap;
        if (round == 0 && depth > tol) {
            worst = depth;
            a = w->sub.contacts[k].body_a;
            b = w->sub.contacts[k].body_b;
        }
        if (depth <= tol) break;
        if (!w->settings.project_overlap || round == MAX_ROUNDS) {
            return crm_world_fail(
                w, CAROM_E_ARGUMENT,
                "bodies %d and %d overlap by %.3g m at the start; move them apart", a, b, worst);
        }
        const carom_status p = project_once(w);
        if (p < 0) return p;
    }
    if (worst > 0) {
        crm_world_fail(w, CAROM_OK, "initial overlap of %.3g m (bodies %d and %d) projected away",
                       worst, a, b);
    }
    return CAROM_OK;
}

carom_status crm_seal(carom_world *w)
{
    if (w->sealed) return CAROM_OK;
    carom_step_stats own = {0};
    carom_step_stats *stats = w->stats;
    set_scales(w);
    number_unknowns(w);
    carom_status e = allocate(w);
    if (!e) {
        crm_sort_joined(w);
        w->stats = &own;
        e = clear_overlap(w);
        w->stats = stats;
    }
    if (e) {
        crm_free_sealed(w);
        return e;
    }
    w->sub.n_contacts = 0;
    w->sealed = 1;
    return CAROM_OK;
}

carom_status carom_world_seal(carom_world *world)
{
    if (!world) return CAROM_E_ARGUMENT;
    world->error[0] = '\0';
    return crm_seal(world);
}
