/* islands.c: what can touch within a frame, and the groups of bodies that it connects.
 * docs/step.md, section "Islands". */
#include "world/block.h"
#include "world/internal.h"

#include <math.h>

/* A body may leave its foreseen path by this much before pairs are looked for again: a share of the
 * way, and of what gravity does in a frame. */
static const double WAY_SHARE = 0.25;
static const double FALL_SHARE = 2;

static void lay(carom_world *w, crm_block *b)
{
    crm_islands *s = &w->islands;
    const size_t n = (size_t)w->n_bodies;
    s->list = crm_carve(b, n + 1, sizeof *s->list);
    s->root = crm_carve(b, n, sizeof(int));
    s->label = crm_carve(b, n, sizeof(int));
    s->linked = crm_carve(b, n, 1);
    s->bodies = crm_carve(b, n, sizeof(int));
    s->joints = crm_carve(b, (size_t)w->n_joints, sizeof(int));
    s->ahead = crm_carve(b, 3 * n, sizeof(double));
    s->slack = crm_carve(b, n, sizeof(double));
    s->excess = crm_carve(b, n, sizeof(double));
    s->boxes = crm_carve(b, w->plan.contacts ? (size_t)w->n_shapes : 0, sizeof *s->boxes);
}

carom_status crm_islands_create(carom_world *w)
{
    crm_block b = {NULL, 0};
    lay(w, &b);
    b.base = crm_new(&w->memory, b.used, 1);
    if (!b.base) return CAROM_E_MEMORY;
    w->islands.block = b.base;
    w->islands.bytes = b.used;
    b.used = 0;
    lay(w, &b);
    return CAROM_OK;
}

void crm_islands_free(carom_world *w)
{
    crm_islands *s = &w->islands;
    crm_free(&w->memory, s->block, s->bytes, 1);
    crm_free(&w->memory, s->found, (size_t)s->max_found, sizeof *s->found);
    crm_free(&w->memory, s->pairs, (size_t)s->max_pairs, sizeof *s->pairs);
    memset(s, 0, sizeof *s);
}

/* The way of a body through the frame when nothing touches it, and the room around it. */
static void foresee(carom_world *w, int b, double dt)
{
    crm_islands *s = &w->islands;
    double a[3];
    double *d = &s->ahead[3 * b];
    crm_free_acceleration(w, b, NULL, a);
    if (w->n_fields) crm_field_acceleration(w, b, carom_world_time(w), w->q, w->v, a);
    for (int k = 0; k < 3; k++) {
        const double step = dt * w->v[3 * b + k];
        const double fall = dt * dt * a[k];
        /* Between half (the smooth map) and all (Euler) of the fall. */
        d[k] = step + (step * fall > 0 ? fall : 0.5 * fall);
    }
    const double fall = hypot(a[1], a[2]) + w->bodies[b].reach * fabs(a[0]);
    const double way = hypot(d[1], d[2]) + w->bodies[b].reach * fabs(d[0]);
    s->slack[b] = w->settings.margin * w->length + WAY_SHARE * way + FALL_SHARE * dt * dt * fall;
}

/* Overlaps nothing: no step pays for a sensor. */
static carom_box no_box(void)
{
    const carom_box none = {{HUGE_VAL, HUGE_VAL}, {-HUGE_VAL, -HUGE_VAL}};
    return none;
}

static void sweep_box(const carom_world *w, int shape, carom_box *box)
{
    const crm_islands *s = &w->islands;
    const crm_shape *x = &w->shapes[shape];
    *box = carom_shape_box(&x->view, crm_pose(w->q, x->body));
    if (w->bodies[x->body].type == CAROM_STATIC) return;
    const double *d = &s->ahead[3 * x->body];
    const double turn = x->reach * fmin(fabs(d[0]), 2);
    const double room = turn + s->slack[x->body] + s->excess[x->body];
    box->lower.x += fmin(d[1], 0) - room;
    box->lower.y += fmin(d[2], 0) - room;
    box->upper.x += fmax(d[1], 0) + room;
    box->upper.y += fmax(d[2], 0) + room;
}

/* Shape pairs whose swept boxes meet and that may collide, into s->found; *same: as before. */
static carom_status find_pairs(carom_world *w, int *same)
{
    crm_islands *s = &w->islands;
    int n;
    const carom_pair *pairs;
    *same = 1;
    if (!w->plan.contacts) return CAROM_OK;
    for (int k = 0; k < w->n_shapes; k++) {
        if (w->bodies[w->shapes[k].body].sensor) {
            s->boxes[k] = no_box();
        } else {
            sweep_box(w, k, &s->boxes[k]);
        }
    }
    carom_status e = carom_broadphase_pairs(w->broadphase, w->n_shapes, s->boxes, &n, &pairs);
    if (e) return e;
    void *found = s->found;
    e = crm_reserve(&w->memory, &found, &s->max_found, n, sizeof *s->found);
    s->found = found;
    if (e) return e;
    int m = 0;
    *same = 1;
    for (int k = 0; k < n; k++) {
        if (!crm_may_collide(w, pairs[k])) continue;
        if (m >= s->n_pairs || s->found[m].a != pairs[k].a || s->found[m].b != pairs[k].b)
            *same = 0;
        s->found[m++] = pairs[k];
    }
    if (m != s->n_pairs) *same = 0;
    s->n_pairs = m;
    return CAROM_OK;
}

static int root_of(const crm_islands *s, int b)
{
    while (s->root[b] != b) {
        s->root[b] = s->root[s->root[b]];
        b = s->root[b];
    }
    return b;
}

/* The smaller index becomes the root. */
static void connect(carom_world *w, int a, int b)
{
    crm_islands *s = &w->islands;
    s->linked[a] = 1;
    s->linked[b] = 1;
    if (w->bodies[a].type == CAROM_STATIC || w->bodies[b].type == CAROM_STATIC) return;
    const int ra = root_of(s, a);
    const int rb = root_of(s, b);
    if (ra < rb) s->root[rb] = ra;
    if (rb < ra) s->root[ra] = rb;
}

static int pair_body(const carom_world *w, carom_pair p)
{
    const int a = w->shapes[p.a].body;
    return w->bodies[a].type == CAROM_STATIC ? w->shapes[p.b].body : a;
}

static int joint_body(const carom_world *w, int joint)
{
    const int a = w->joints[joint].body_a;
    return w->bodies[a].type == CAROM_STATIC ? w->joints[joint].body_b : a;
}

/* Labels: bodies that nothing can touch share the first island, each other root has its own. */
static void label_bodies(carom_world *w)
{
    crm_islands *s = &w->islands;
    int free_label = -1;
    s->n = 0;
    for (int b = 0; b < w->n_bodies; b++) {
        if (w->bodies[b].type == CAROM_STATIC) continue;
        const int alone = !s->linked[b] && !w->owes[b];
        const int r = root_of(s, b);
        if (alone ? free_label < 0 : r == b) {
            const crm_island fresh = {0};
            s->list[s->n] = fresh;
            s->list[s->n].clock = b;
            s->label[b] = s->n++;
            if (alone) free_label = s->label[b];
        } else {
            s->label[b] = alone ? free_label : s->label[r];
        }
        crm_island *i = &s->list[s->label[b]];
        i->n_bodies++;
        if (w->owes[b] && !w->owes[i->clock]) i->clock = b;
    }
}

/* Counting sort by island: orders within an island stay. */
static void fill_islands(carom_world *w)
{
    crm_islands *s = &w->islands;
    for (int k = 0; k < s->n_pairs; k++) s->list[s->label[pair_body(w, s->found[k])]].n_pairs++;
    for (int k = 0; k < w->n_joints; k++) {
        if (!w->joints[k].broken) s->list[s->label[joint_body(w, k)]].n_joints++;
    }
    int bodies = 0;
    int joints = 0;
    int pairs = 0;
    for (int k = 0; k < s->n; k++) {
        crm_island *i = &s->list[k];
        i->bodies = s->bodies + bodies;
        i->joints = s->joints + joints;
        i->pairs = s->pairs ? s->pairs + pairs : NULL;
        bodies += i->n_bodies;
        joints += i->n_joints;
        pairs += i->n_pairs;
        i->n_bodies = i->n_joints = i->n_pairs = 0;
    }
    for (int b = 0; b < w->n_bodies; b++) {
        if (w->bodies[b].type == CAROM_STATIC) continue;
        crm_island *i = &s->list[s->label[b]];
        i->bodies[i->n_bodies++] = b;
    }
    for (int k = 0; k < w->n_joints; k++) {
        if (w->joints[k].broken) continue;
        crm_island *i = &s->list[s->label[joint_body(w, k)]];
        i->joints[i->n_joints++] = k;
        i->n_rows += w->joints[k].n_rows;
        i->n_limited += crm_joint_has_limits(&w->joints[k]);
        i->n_driven += crm_joint_is_driven(&w->joints[k]);
    }
    for (int k = 0; k < s->n_pairs; k++) {
        crm_island *i = &s->list[s->label[pair_body(w, s->found[k])]];
        i->pairs[i->n_pairs++] = s->found[k];
    }
}

static carom_status group(carom_world *w)
{
    crm_islands *s = &w->islands;
    void *pairs = s->pairs;
    const carom_status e =
        crm_reserve(&w->memory, &pairs, &s->max_pairs, s->n_pairs, sizeof *s->pairs);
    s->pairs = pairs;
    if (e) return e;
    for (int b = 0; b < w->n_bodies; b++) s->root[b] = b;
    memset(s->linked, 0, (size_t)w->n_bodies);
    for (int k = 0; k < s->n_pairs; k++) {
        connect(w, w->shapes[s->found[k].a].body, w->shapes[s->found[k].b].body);
    }
    for (int k = 0; k < w->n_joints; k++) {
        if (!w->joints[k].broken) connect(w, w->joints[k].body_a, w->joints[k].body_b);
    }
    label_bodies(w);
    fill_islands(w);
    return CAROM_OK;
}

carom_status crm_islands_find(carom_world *w, double dt)
{
    crm_islands *s = &w->islands;
    int same;
    memset(s->excess, 0, (size_t)w->n_bodies * sizeof *s->excess);
    s->escaped = 0;
    s->looked_ahead = 0;
    for (int b = 0; b < w->n_bodies; b++) {
        if (w->bodies[b].type != CAROM_STATIC) foresee(w, b, dt);
    }
    const carom_status e = find_pairs(w, &same);
    return e ? e : group(w);
}

carom_status crm_islands_widen(carom_world *w, int *changed)
{
    int same;
    w->islands.escaped = 0;
    const carom_status e = find_pairs(w, &same);
    *changed = !same || w->islands.looked_ahead;
    w->islands.looked_ahead = 0;
    return e || same ? e : group(w);
}

static double outside(double x, double way)
{
    return fmax(fmax(x - fmax(way, 0), fmin(way, 0) - x), 0);
}

void crm_islands_watch(carom_world *w, const double *from, const double *q)
{
    crm_islands *s = &w->islands;
    const crm_island *i = w->island;
    for (int k = 0; k < i->n_bodies; k++) {
        const int b = i->bodies[k];
        if (!w->bodies[b].n_shapes) continue;
        const double *d = &s->ahead[3 * b];
        const double x = outside(q[3 * b + 1] - from[3 * b + 1], d[1]);
        const double y = outside(q[3 * b + 2] - from[3 * b + 2], d[2]);
        const double turn = fmax(fabs(q[3 * b] - from[3 * b]) - fabs(d[0]), 0);
        const double out = fmax(x, y) + w->bodies[b].reach * fmin(turn, 2);
        if (out <= s->slack[b] + s->excess[b]) continue;
        s->excess[b] = 2 * out;
        s->escaped = 1;
    }
}

void crm_enter(carom_world *w, const crm_island *island)
{
    w->island = island;
    for (int k = 0; k < island->n_bodies; k++) w->bodies[island->bodies[k]].unknown = k;
}

void crm_copy(const carom_world *w, double *to, const double *from)
{
    const crm_island *i = w->island;
    for (int k = 0; k < i->n_bodies; k++) {
        const int b = 3 * i->bodies[k];
        to[b] = from[b];
        to[b + 1] = from[b + 1];
        to[b + 2] = from[b + 2];
    }
}

void crm_zero(const carom_world *w, double *x)
{
    const crm_island *i = w->island;
    for (int k = 0; k < i->n_bodies; k++) memset(&x[3 * i->bodies[k]], 0, 3 * sizeof *x);
}
