/* build.c: adding bodies, and the parameters that may change later. */
#include "world/block.h"
#include "world/internal.h"

#include <math.h>
#include <stdio.h>

carom_body_def carom_body_defaults(void)
{
    carom_body_def d = {0};
    d.type = CAROM_DYNAMIC;
    d.mass = 1;
    d.inertia = 1;
    d.friction = 0.5;
    d.collide = 1;
    d.filter.category = 1;
    d.filter.mask = ~0U;
    d.gravity_scale = 1;
    return d;
}

static int finite3(const double *x)
{
    return isfinite(x[0]) && isfinite(x[1]) && isfinite(x[2]);
}

static int positive(double x)
{
    return x > 0 && x < HUGE_VAL;
}

static carom_status check_motion(carom_world *w, const carom_body_def *d)
{
    const int id = w->n_bodies;
    const double pose[3] = {d->pose.angle, d->pose.x, d->pose.y};
    if (!finite3(pose)) return crm_world_fail(w, CAROM_E_ARGUMENT, "body %d: pose not finite", id);
    if (!finite3(d->velocity)) {
        return crm_world_fail(w, CAROM_E_ARGUMENT, "body %d: velocity not finite", id);
    }
    if (!finite3(d->force)) {
        return crm_world_fail(w, CAROM_E_ARGUMENT, "body %d: force not finite", id);
    }
    if (d->type == CAROM_STATIC &&
        (d->velocity[0] != 0 || d->velocity[1] != 0 || d->velocity[2] != 0)) {
        return crm_world_fail(w, CAROM_E_ARGUMENT,
                              "body %d: static but has a velocity; make it kinematic", id);
    }
    return CAROM_OK;
}

static carom_status check_matter(carom_world *w, int id, carom_body_type type, double mass,
                                 double inertia, double friction, double restitution)
{
    const int locked = inertia == HUGE_VAL;
    if (type == CAROM_DYNAMIC && !positive(mass)) {
        return crm_world_fail(w, CAROM_E_ARGUMENT, "body %d: mass %g must be positive", id, mass);
    }
    if (type == CAROM_DYNAMIC && !positive(inertia) && !locked) {
        return crm_world_fail(w, CAROM_E_ARGUMENT,
                              "body %d: inertia %g must be positive (infinite: no rotation)", id,
                              inertia);
    }
    if (!(friction >= 0 && friction < HUGE_VAL)) {
        return crm_world_fail(w, CAROM_E_ARGUMENT, "body %d: friction %g must be 0 or more", id,
                              friction);
    }
    if (!(restitution >= 0 && restitution <= 1)) {
        return crm_world_fail(w, CAROM_E_ARGUMENT, "body %d: restitution %g is not in [0, 1]", id,
                              restitution);
    }
    return CAROM_OK;
}

static carom_status check_weight(carom_world *w, int id, double gravity_scale, double linear,
                                 double angular)
{
    if (!isfinite(gravity_scale)) {
        return crm_world_fail(w, CAROM_E_ARGUMENT, "body %d: gravity scale not finite", id);
    }
    if (linear >= 0 && linear < HUGE_VAL && angular >= 0 && angular < HUGE_VAL) return CAROM_OK;
    return crm_world_fail(w, CAROM_E_ARGUMENT,
                          "body %d: damping %g, angular %g: must be finite and 0 or more", id,
                          linear, angular);
}

static carom_status check_shapes(carom_world *w, const carom_body_def *d)
{
    if (d->n_shapes < 0 || (d->n_shapes > 0 && !d->shapes)) {
        return crm_world_fail(w, CAROM_E_ARGUMENT, "body %d: no shapes given", w->n_bodies);
    }
    for (int k = 0; k < d->n_shapes; k++) {
        carom_shape_error error;
        char text[128];
        if (carom_shape_check(&d->shapes[k], &error) == CAROM_OK) continue;
        carom_shape_error_text(error, text, sizeof text);
        return crm_world_fail(w, CAROM_E_SHAPE, "body %d, shape %d: %s", w->n_bodies, k, text);
    }
    return CAROM_OK;
}

/* The seven arrays with one row per body, in one block. */
static void lay_bodies(carom_world *w, crm_block *b, size_t n, double **arrays[7])
{
    static const size_t width[7] = {3, 3, 3, 1, 1, 1, 1};
    (void)w;
    for (int k = 0; k < 7; k++) {
        double *p = crm_carve(b, width[k] * n, sizeof(double));
        if (!b->base) continue;
        const double *old = *arrays[k];
        if (old) memcpy(p, old, width[k] * (size_t)w->n_bodies * sizeof(double));
        *arrays[k] = p;
    }
}

carom_status crm_reserve_bodies(carom_world *w)
{
    double **arrays[7] = {&w->q,       &w->v,        &w->force,      &w->mass,
                          &w->inertia, &w->friction, &w->restitution};
    if (w->n_bodies < w->max_bodies) return CAROM_OK;
    const int n = w->max_bodies + w->max_bodies / 2 + 8;
    crm_body *bodies = crm_new(&w->memory, (size_t)n, sizeof *bodies);
    crm_block measure = {NULL, 0};
    lay_bodies(w, &measure, (size_t)n, arrays);
    crm_block b = {bodies ? crm_new(&w->memory, measure.used, 1) : NULL, 0};
    if (!b.base) {
        crm_free(&w->memory, bodies, (size_t)n, sizeof *bodies);
        return crm_world_fail(w, CAROM_E_MEMORY, "no memory for body %d", w->n_bodies);
    }
    lay_bodies(w, &b, (size_t)n, arrays);
    if (w->bodies) memcpy(bodies, w->bodies, (size_t)w->n_bodies * sizeof *bodies);
    crm_free(&w->memory, w->bodies, (size_t)w->max_bodies, sizeof *w->bodies);
    crm_free(&w->memory, w->body_block, w->body_bytes, 1);
    w->bodies = bodies;
    w->body_block = b.base;
    w->body_bytes = measure.used;
    w->max_bodies = n;
    return CAROM_OK;
}

/* Shapes keep indices of their vertices; views are pointed at the array again when it moved. */
static carom_status reserve_shapes(carom_world *w, const carom_body_def *d)
{
    int n_vertices = w->n_vertices;
    for (int k = 0; k < d->n_shapes; k++) n_vertices += d->shapes[k].count;
    void *shapes = w->shapes;
    void *vertices = w->vertices;
    carom_status e = crm_reserve(&w->memory, &shapes, &w->max_shapes, w->n_shapes + d->n_shapes,
                                 sizeof *w->shapes);
    w->shapes = shapes;
    if (!e) {
        e = crm_reserve(&w->memory, &vertices, &w->max_vertices, n_vertices, sizeof *w->vertices);
        w->vertices = vertices;
    }
    for (int k = 0; k < w->n_shapes; k++) {
        w->shapes[k].view.vertices = w->vertices + w->shapes[k].first_vertex;
    }
    if (e) return crm_world_fail(w, e, "no memory for the shapes of body %d", w->n_bodies);
    return CAROM_OK;
}

static void add_shapes(carom_world *w, const carom_body_def *d)
{
    for (int k = 0; k < d->n_shapes; k++) {
        const carom_shape *from = &d->shapes[k];
        crm_shape *s = &w->shapes[w->n_shapes++];
        memset(s, 0, sizeof *s);
        s->view = *from;
        s->body = w->n_bodies;
        s->first_vertex = w->n_vertices;
        s->view.vertices = w->vertices + w->n_vertices;
        memcpy(w->vertices + w->n_vertices, from->vertices,
               (size_t)from->count * sizeof *from->vertices);
        w->n_vertices += from->count;
    }
}

/* What is not dynamic keeps its velocity. */
static void set_damping(crm_body *body, double linear, double angular)
{
    const int moves = body->type == CAROM_DYNAMIC;
    body->damping[0] = moves ? angular : 0;
    body->damping[1] = moves ? linear : 0;
}

static void add_body(carom_world *w, const carom_body_def *d)
{
    const int b = w->n_bodies;
    crm_body *body = &w->bodies[b];
    memset(body, 0, sizeof *body);
    body->type = d->type;
    body->first_shape = w->n_shapes;
    body->n_shapes = d->n_shapes;
    body->collide = d->collide;
    body->sensor = d->sensor;
    body->filter = d->filter;
    body->gravity_scale = d->gravity_scale;
    set_damping(body, d->linear_damping, d->angular_damping);
    w->q[3 * b] = d->pose.angle;
    w->q[3 * b + 1] = d->pose.x;
    w->q[3 * b + 2] = d->pose.y;
    memcpy(&w->v[3 * b], d->velocity, sizeof d->velocity);
    memcpy(&w->force[3 * b], d->force, sizeof d->force);
    w->mass[b] = d->mass;
    w->inertia[b] = d->inertia;
    w->friction[b] = d->friction;
    w->restitution[b] = d->restitution;
    add_shapes(w, d);
    w->n_bodies++;
}

carom_status carom_world_add_body(carom_world *world, const carom_body_def *def, int *index)
{
    if (!world || !def) return CAROM_E_ARGUMENT;
    carom_world *w = world;
    if (w->sealed) {
        return crm_world_fail(w, CAROM_E_STATE, "bodies are added before the world is sealed");
    }
    if (def->type != CAROM_DYNAMIC && def->type != CAROM_STATIC && def->type != CAROM_KINEMATIC) {
        return crm_world_fail(w, CAROM_E_ARGUMENT, "body %d: unknown type", w->n_bodies);
    }
    carom_status e = check_motion(w, def);
    if (!e) {
        e = check_matter(w, w->n_bodies, def->type, def->mass, def->inertia, def->friction,
                         def->restitution);
    }
    if (!e) {
        e = check_weight(w, w->n_bodies, def->gravity_scale, def->linear_damping,
                         def->angular_damping);
    }
    if (!e) e = check_shapes(w, def);
    if (!e) e = crm_reserve_bodies(w);
    if (!e) e = reserve_shapes(w, def);
    if (e) return e;
    if (index) *index = w->n_bodies;
    add_body(w, def);
    return CAROM_OK;
}

/* Where the pair is in the sorted list, or belongs. */
static int excluded_at(const carom_world *w, carom_pair p)
{
    int low = 0;
    int high = w->n_excluded;
    while (low < high) {
        const int mid = low + (high - low) / 2;
        const carom_pair m = w->excluded[mid];
        if (m.a < p.a || (m.a == p.a && m.b < p.b)) {
            low = mid + 1;
        } else {
            high = mid;
        }
    }
    return low;
}

static carom_pair ordered(int a, int b)
{
    const carom_pair p = {a < b ? a : b, a < b ? b : a};
    return p;
}

static int is_excluded(const carom_world *w, int at, carom_pair p)
{
    return at < w->n_excluded && w->excluded[at].a == p.a && w->excluded[at].b == p.b;
}

int crm_excluded(const carom_world *w, int body_a, int body_b)
{
    if (!w->n_excluded) return 0;
    const carom_pair p = ordered(body_a, body_b);
    return is_excluded(w, excluded_at(w, p), p);
}

carom_status carom_world_exclude(carom_world *world, int body_a, int body_b)
{
    if (!world) return CAROM_E_ARGUMENT;
    carom_world *w = world;
    if (w->sealed) {
        return crm_world_fail(w, CAROM_E_STATE, "pairs are excluded before the world is sealed");
    }
    const int missing = body_a < 0 || body_a >= w->n_bodies ? body_a : body_b;
    if (missing < 0 || missing >= w->n_bodies) {
        return crm_world_fail(w, CAROM_E_ARGUMENT, "exclusion: there is no body %d", missing);
    }
    if (body_a == body_b) {
        return crm_world_fail(w, CAROM_E_ARGUMENT, "exclusion: body %d twice", body_a);
    }
    const carom_pair p = ordered(body_a, body_b);
    const int at = excluded_at(w, p);
    if (is_excluded(w, at, p)) return CAROM_OK;
    void *list = w->excluded;
    const carom_status e =
        crm_reserve(&w->memory, &list, &w->max_excluded, w->n_excluded + 1, sizeof *w->excluded);
    w->excluded = list;
    if (e) return crm_world_fail(w, e, "no memory for an exclusion");
    memmove(w->excluded + at + 1, w->excluded + at,
            (size_t)(w->n_excluded - at) * sizeof *w->excluded);
    w->excluded[at] = p;
    w->n_excluded++;
    return CAROM_OK;
}

/* Damping in a world of free flight that was sealed without extrapolation. */
static int damps_late(const carom_world *w, const carom_parameters *p)
{
    int damps = 0;
    for (int b = 0; b < w->n_bodies; b++) {
        damps |= (p->linear_damping && p->linear_damping[b] > 0) ||
                 (p->angular_damping && p->angular_damping[b] > 0);
    }
    const int wants = w->settings.order > 2 && w->settings.integrator == CAROM_LOCATED;
    return w->sealed && wants && !w->plan.extrapolated && damps;
}

carom_status carom_world_set_parameters(carom_world *world, const carom_parameters *p)
{
    if (!world || !p) return CAROM_E_ARGUMENT;
    carom_world *w = world;
    const size_t bytes = (size_t)w->n_bodies * sizeof(double);
    for (int b = 0; b < w->n_bodies; b++) {
        const carom_status e =
            check_matter(w, b, w->bodies[b].type, p->mass ? p->mass[b] : w->mass[b],
                         p->inertia ? p->inertia[b] : w->inertia[b],
                         p->friction ? p->friction[b] : w->friction[b],
                         p->restitution ? p->restitution[b] : w->restitution[b]);
        if (e) return e;
        const crm_body *body = &w->bodies[b];
        const carom_status f =
            check_weight(w, b, p->gravity_scale ? p->gravity_scale[b] : body->gravity_scale,
                         p->linear_damping ? p->linear_damping[b] : body->damping[1],
                         p->angular_damping ? p->angular_damping[b] : body->damping[0]);
        if (f) return f;
    }
    if (p->gravity && !(isfinite(p->gravity[0]) && isfinite(p->gravity[1]))) {
        return crm_world_fail(w, CAROM_E_ARGUMENT, "gravity not finite");
    }
    if (damps_late(w, p)) {
        return crm_world_fail(w, CAROM_E_STATE,
                              "damping at order %d begins before the world is sealed: give a body "
                              "some, however little",
                              w->settings.order);
    }
    if (p->mass && bytes) memmove(w->mass, p->mass, bytes);
    if (p->inertia && bytes) memmove(w->inertia, p->inertia, bytes);
    if (p->friction && bytes) memmove(w->friction, p->friction, bytes);
    if (p->restitution && bytes) memmove(w->restitution, p->restitution, bytes);
    for (int b = 0; b < w->n_bodies; b++) {
        crm_body *body = &w->bodies[b];
        if (p->gravity_scale) body->gravity_scale = p->gravity_scale[b];
        set_damping(body, p->linear_damping ? p->linear_damping[b] : body->damping[1],
                    p->angular_damping ? p->angular_damping[b] : body->damping[0]);
    }
    w->damped = crm_world_is_damped(w);
    if (p->gravity) memcpy(w->settings.gravity, p->gravity, sizeof w->settings.gravity);
    w->revision++;
    return CAROM_OK;
}
