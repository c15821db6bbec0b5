/* seal.c: what is fixed before the first step: scales, memory, initial overlap. */
#include "world/block.h"
#include "world/internal.h"

#include <math.h>

/* Rounds of detection and projection for an overlapping initial scene. */
enum { MAX_ROUNDS = 50 };

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
    for (int b = 0; b < w->n_bodies; b++) w->bodies[b].reach = 0;
    for (int k = 0; k < w->n_shapes; k++) {
        crm_shape *s = &w->shapes[k];
        s->reach = farthest(&s->view);
        s->thickness = thickness(&s->view);
        crm_body *b = &w->bodies[s->body];
        b->reach = fmax(b->reach, s->reach);
        if (b->type == CAROM_DYNAMIC && !b->sensor) length = fmax(length, diameter(&s->view));
    }
    if (w->settings.length > 0) length = w->settings.length;
    w->length = length > 0 ? length : 1;
    for (int k = 0; k < w->n_joints; k++) w->joints[k].lever = w->length;
    const double g = hypot(w->settings.gravity[0], w->settings.gravity[1]);
    w->speed = sqrt(g * w->length);
    w->rest_speed = w->settings.rest_speed * w->speed;
    w->recovery = fmax(w->rest_speed, w->settings.margin * w->length / w->settings.dt);
}

/* Springs and motors on each body; a target pulls in two directions. */
static void count_springs(carom_world *w)
{
    for (int b = 0; b < w->n_bodies; b++) w->bodies[b].n_springs = 0;
    for (int k = 0; k < w->n_joints; k++) {
        const crm_joint *j = &w->joints[k];
        if (!crm_joint_is_driven(j)) continue;
        const int n = j->kind == CAROM_TARGET ? 2 : 1;
        w->bodies[j->body_a].n_springs += n;
        w->bodies[j->body_b].n_springs += n;
    }
}

static void count_moving(carom_world *w)
{
    w->n_moving = 0;
    for (int b = 0; b < w->n_bodies; b++) {
        w->bodies[b].unknown = -1;
        w->n_moving += w->bodies[b].type != CAROM_STATIC;
    }
    w->smooth = w->settings.integrator != CAROM_EULER;
}

static void lay_world(carom_world *w, crm_block *b)
{
    const size_t n3 = 3 * (size_t)w->n_bodies;
    w->step_force = crm_carve(b, n3, sizeof(double));
    w->q_saved = crm_carve(b, n3, sizeof(double));
    w->v_saved = crm_carve(b, n3, sizeof(double));
    w->probe = crm_carve(b, w->plan.changes ? n3 : 0, sizeof(double));
    w->carry = crm_carve(b, (size_t)w->n_bodies, sizeof(double));
    w->carry_saved = crm_carve(b, (size_t)w->n_bodies, sizeof(double));
    for (int k = 0; k < 2; k++) {
        w->joint_force[k] = crm_carve(b, (size_t)w->n_joint_rows, sizeof(double));
    }
    w->joint_total = crm_carve(b, (size_t)w->n_joint_rows, sizeof(double));
    w->owes = crm_carve(b, (size_t)w->n_bodies, 1);
    w->owes_saved = crm_carve(b, (size_t)w->n_bodies, 1);
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
    if (!e) e = crm_islands_create(w);
    if (!e) e = crm_sleep_create(w);
    return e ? e : crm_substeps_create(w);
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

static carom_status project_island(carom_world *w)
{
    crm_substep *s = &w->sub;
    crm_copy(w, s->q1, w->q);
    memset(s->pressing, 0, (size_t)s->n_contacts);
    s->map = CRM_MAP_EULER;
    s->h = 0;
    const carom_status e = crm_project(w, s, 1);
    if (e >= 0) crm_copy(w, w->q, s->q1);
    return e;
}

/* The overlap of the initial scene. */
typedef struct overlap {
    double tol, worst;
    int a, b; /* bodies of the worst */
} overlap;

/* One round over all islands; *any: there was an overlap. */
static carom_status clear_islands(carom_world *w, int round, overlap *o, int *any)
{
    *any = 0;
    carom_status e = crm_islands_find(w, 0);
    for (int i = 0; e >= 0 && i < w->islands.n; i++) {
        crm_enter(w, &w->islands.list[i]);
        o->tol = w->settings.penetration * w->length + crm_rounding(w);
        e = crm_detect(w, w->q, w->settings.margin * w->length);
        const int k = deepest(&w->sub);
        if (e < 0 || k < 0 || -w->sub.contacts[k].gap <= o->tol) continue;
        *any = 1;
        if (round == 0 && -w->sub.contacts[k].gap > o->worst) {
            o->worst = -w->sub.contacts[k].gap;
            o->a = w->sub.contacts[k].body_a;
            o->b = w->sub.contacts[k].body_b;
        }
        if (w->settings.project_overlap) e = project_island(w);
    }
    return e;
}

static carom_status clear_rounds(carom_world *w, overlap *o)
{
    for (int round = 0; round <= MAX_ROUNDS; round++) {
        int any;
        const carom_status e = clear_islands(w, round, o, &any);
        if (e < 0 || !any) return e;
        if (!w->settings.project_overlap) break;
    }
    return crm_world_fail(w, CAROM_E_ARGUMENT,
                          "bodies %d and %d overlap by %.3g m at the start; move them apart", o->a,
                          o->b, o->worst);
}

/* Overlap of the initial scene is projected away, or refused by setting. */
static carom_status clear_overlap(carom_world *w)
{
    overlap o = {0, 0, 0, 0};
    const size_t bytes = 3 * (size_t)w->n_bodies * sizeof(double);
    memcpy(w->q_saved, w->q, bytes);
    memcpy(w->sub.q1, w->q, bytes);
    for (int k = 0; k < w->n_solves; k++) memcpy(w->sub.solve[k].q, w->q, bytes);
    const carom_status e = clear_rounds(w, &o);
    if (e < 0) {
        memcpy(w->q, w->q_saved, bytes);
        return e;
    }
    if (o.worst > 0) {
        crm_world_fail(w, CAROM_OK, "initial overlap of %.3g m (bodies %d and %d) projected away",
                       o.worst, o.a, o.b);
    }
    return CAROM_OK;
}

static carom_status seal(carom_world *w, int as_is)
{
    if (w->sealed) return CAROM_OK;
    carom_step_stats own = {0};
    carom_step_stats *stats = w->stats;
    set_scales(w);
    count_moving(w);
    count_springs(w);
    w->damped = crm_world_is_damped(w);
    w->plan = crm_plan(w);
    w->n_solves = w->plan.solver ? CRM_MAX_SOLVES : 2;
    carom_status e = allocate(w);
    if (!e) {
        crm_sort_joined(w);
        w->stats = &own;
        e = as_is ? CAROM_OK : clear_overlap(w);
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

carom_status crm_seal(carom_world *w)
{
    return seal(w, 0);
}

carom_status crm_seal_as_is(carom_world *w)
{
    return seal(w, 1);
}

carom_status carom_world_seal(carom_world *world)
{
    if (!world) return CAROM_E_ARGUMENT;
    world->error[0] = '\0';
    return crm_seal(world);
}
