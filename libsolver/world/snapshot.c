/* snapshot.c: all that the next step depends on, as bytes.
 *
 *     0   "caromsnp"
 *     8   format, bytes in all, scene: 8 bytes each, lowest first
 *     32  the state
 *     -8  FNV-1a of all before
 */
#include "carom/snapshot.h"
#include "world/coder.h"
#include "world/internal.h"

#include <float.h>

static const char MAGIC[8] = {'c', 'a', 'r', 'o', 'm', 's', 'n', 'p'};
enum { FORMAT_AT = 8, SIZE_AT = 16, SCENE_AT = 24, STATE_AT = 32, CHECKSUM_BYTES = 8 };
/* Steps that a world can have taken: 2^31 and more fit a double, and any long. */
static const long MAX_STEPS = 2147483647L;

static void hash_vec(crm_coder *c, carom_vec2 x)
{
    crm_code_number(c, &x.x, 0, 0);
    crm_code_number(c, &x.y, 0, 0);
}

static void hash_whole(crm_coder *c, long x)
{
    crm_code_whole(c, &x, 0, 0);
}

static void hash_number(crm_coder *c, double x)
{
    crm_code_number(c, &x, 0, 0);
}

/* How many threads there are changes nothing. */
static void hash_settings(crm_coder *c, const carom_world_settings *settings)
{
    carom_world_settings own = *settings;
    const carom_world_settings *s = &own;
    own.threads = 1;
#define HASH_SETTING(name, type, value, unit, text) hash_number(c, (double)s->name);
    CAROM_WORLD_SETTINGS(HASH_SETTING)
#undef HASH_SETTING
}

static void hash_bodies(crm_coder *c, const carom_world *w)
{
    hash_whole(c, w->n_bodies);
    for (int k = 0; k < w->n_bodies; k++) {
        const crm_body *b = &w->bodies[k];
        hash_whole(c, b->type);
        hash_whole(c, b->n_shapes);
        hash_whole(c, b->collide != 0);
        hash_whole(c, b->sensor != 0);
        hash_number(c, b->filter.category);
        hash_number(c, b->filter.mask);
        hash_whole(c, b->filter.group);
    }
    for (int k = 0; k < 3 * w->n_bodies; k++) hash_number(c, w->force[k]);
    for (int k = 0; k < w->n_shapes; k++) {
        const carom_shape *s = &w->shapes[k].view;
        hash_number(c, s->radius);
        hash_whole(c, s->count);
        for (int i = 0; i < s->count; i++) hash_vec(c, s->vertices[i]);
    }
}

static void hash_joints(crm_coder *c, const carom_world *w)
{
    hash_whole(c, w->n_joints);
    for (int k = 0; k < w->n_joints; k++) {
        const crm_joint *j = &w->joints[k];
        hash_whole(c, j->kind);
        hash_whole(c, j->body_a);
        hash_whole(c, j->body_b);
        hash_whole(c, j->collide != 0);
        hash_vec(c, j->local_a);
        hash_vec(c, j->local_b);
        const double numbers[] = {j->axis,        j->angle,       j->length,      j->lower,
                                  j->upper,       j->stiffness,   j->damping,     j->rest,
                                  j->restitution, j->motor_speed, j->motor_limit, j->break_force,
                                  j->break_torque};
        for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) hash_number(c, numbers[i]);
    }
    hash_whole(c, w->n_fields);
    hash_whole(c, w->n_excluded);
    for (int k = 0; k < w->n_excluded; k++) {
        hash_whole(c, w->excluded[k].a);
        hash_whole(c, w->excluded[k].b);
    }
}

/* What the caller built: a snapshot of one scene does not fit another. */
static uint64_t scene_of(const carom_world *w)
{
    crm_coder c = {CRM_HASH, NULL, NULL, 0, 0, 0, CRM_HASH_START};
    hash_settings(&c, &w->settings);
    hash_bodies(&c, w);
    hash_joints(&c, w);
    return c.hash;
}

static void code_body(crm_coder *c, carom_world *w, int b)
{
    const carom_body_type type = w->bodies[b].type;
    const double fastest = type == CAROM_STATIC ? 0 : DBL_MAX;
    const double lightest = DBL_MIN * DBL_EPSILON;
    crm_code_places(c, 3, &w->q[3 * b]);
    for (int k = 3 * b; k < 3 * b + 3; k++) crm_code_place(c, &w->v[k], -fastest, fastest);
    if (type == CAROM_DYNAMIC) { /* others have none, whatever stands there */
        crm_code_place(c, &w->mass[b], lightest, DBL_MAX);
        crm_code_place(c, &w->inertia[b], lightest, HUGE_VAL);
    }
    crm_code_place(c, &w->bodies[b].gravity_scale, -DBL_MAX, DBL_MAX);
    for (int k = 0; k < 2; k++) crm_code_place(c, &w->bodies[b].damping[k], 0, DBL_MAX);
    crm_code_place(c, &w->friction[b], 0, DBL_MAX);
    crm_code_place(c, &w->restitution[b], 0, 1);
    crm_code_place(c, &w->carry[b], -w->settings.dt, w->settings.dt);
    unsigned char owes = w->owes[b];
    crm_code_byte(c, &owes, 1);
    if (c->how == CRM_READ) w->owes[b] = owes;
}

static void code_scales(crm_coder *c, carom_world *w)
{
    crm_code_place(c, &w->settings.gravity[0], -DBL_MAX, DBL_MAX);
    crm_code_place(c, &w->settings.gravity[1], -DBL_MAX, DBL_MAX);
    crm_code_place(c, &w->length, DBL_MIN, DBL_MAX);
    crm_code_place(c, &w->speed, 0, DBL_MAX);
    crm_code_place(c, &w->rest_speed, 0, DBL_MAX);
    crm_code_place(c, &w->recovery, 0, DBL_MAX);
    long n_steps = w->n_steps;
    crm_code_whole(c, &n_steps, 0, MAX_STEPS);
    if (c->how == CRM_READ) w->n_steps = n_steps;
}

static void code_vec(crm_coder *c, carom_vec2 *x)
{
    crm_code_number(c, &x->x, -DBL_MAX, DBL_MAX);
    crm_code_number(c, &x->y, -DBL_MAX, DBL_MAX);
}

/* Last vertex of a shape of this world; 0 for the shapes that limits of joints pretend to have. */
static int last_vertex(const carom_world *w, int shape)
{
    return shape >= 0 && shape < w->n_shapes ? w->shapes[shape].view.count - 1 : 0;
}

static void code_recipe(crm_coder *c, const carom_world *w, crm_contact *x)
{
    const int a = last_vertex(w, x->shape_a);
    const int b = x->limit ? 0 : last_vertex(w, x->shape_b);
    carom_recipe *r = &x->recipe;
    crm_code_byte(c, &r->kernel, CAROM_EDGE_CLIPPED);
    crm_code_byte(c, &r->flipped, 1);
    crm_code_byte(c, &r->at_end, 1);
    crm_code_int(c, &r->ref, 0, r->flipped ? b : a);
    crm_code_int(c, &r->inc, 0, r->flipped ? a : b);
}

static void code_contact(crm_coder *c, const carom_world *w, crm_contact *x)
{
    crm_code_int(c, &x->limit, 0, 2 * w->n_joints);
    if (x->limit) {
        crm_code_int(c, &x->shape_a, w->n_shapes, w->n_shapes + w->n_joints);
        crm_code_int(c, &x->shape_b, 0, 1);
    } else {
        crm_code_int(c, &x->shape_a, 0, w->n_shapes - 1);
        crm_code_int(c, &x->shape_b, 0, w->n_shapes - 1);
    }
    crm_code_int(c, &x->body_a, 0, w->n_bodies - 1);
    crm_code_int(c, &x->body_b, 0, w->n_bodies - 1);
    code_recipe(c, w, x);
    code_vec(c, &x->normal);
    code_vec(c, &x->arm_a);
    code_vec(c, &x->arm_b);
    crm_code_number(c, &x->gap, -DBL_MAX, DBL_MAX);
    crm_code_number(c, &x->turn, -DBL_MAX, DBL_MAX);
    crm_code_int(c, &x->speculative, 0, 1);
}

static void code_touch(crm_coder *c, const carom_world *w, crm_touch *t)
{
    code_contact(c, w, &t->contact);
    code_vec(c, &t->point);
    crm_code_number(c, &t->ln, -DBL_MAX, DBL_MAX);
    crm_code_number(c, &t->lt, -DBL_MAX, DBL_MAX);
    for (int i = 0; i < 2; i++) {
        crm_code_number(c, &t->force_n[i], -DBL_MAX, DBL_MAX);
        crm_code_number(c, &t->force_t[i], -DBL_MAX, DBL_MAX);
    }
    crm_code_byte(c, &t->mode, CAROM_SLIP_PLUS);
}

/* All of the state; *n_touches: how many there are, also while checking. */
static void code_state(crm_coder *c, carom_world *w, int *n_touches)
{
    code_scales(c, w);
    for (int b = 0; b < w->n_bodies; b++) code_body(c, w, b);
    for (int i = 0; i < 2; i++) crm_code_places(c, (size_t)w->n_joint_rows, w->joint_force[i]);
    crm_code_places(c, (size_t)w->n_joint_rows, w->joint_total);
    for (int k = 0; k < w->n_joints; k++) {
        unsigned char broken = (unsigned char)w->joints[k].broken;
        crm_code_byte(c, &broken, 1);
        if (c->how == CRM_READ) w->joints[k].broken = broken;
    }
    *n_touches = w->touches.n;
    crm_code_int(c, n_touches, 0, INT_MAX);
    for (int k = 0; k < *n_touches && !c->bad; k++) {
        crm_touch t = {0};
        if (!crm_coder_reads(c)) t = w->touches.list[k];
        code_touch(c, w, &t);
        if (c->how == CRM_READ) w->touches.list[k] = t;
    }
}

static size_t size_of(carom_world *w)
{
    crm_coder c = {CRM_COUNT, NULL, NULL, 0, 0, 0, 0};
    int n;
    code_state(&c, w, &n);
    return STATE_AT + c.at + CHECKSUM_BYTES;
}

carom_status carom_world_snapshot(carom_world *world, size_t capacity, void *bytes, size_t *size)
{
    if (!world || !size || (capacity && !bytes)) return CAROM_E_ARGUMENT;
    carom_world *w = world;
    w->error[0] = '\0';
    const carom_status e = crm_seal(w);
    if (e < 0) return e;
    *size = size_of(w);
    if (!bytes) return CAROM_OK;
    if (capacity < *size) {
        return crm_world_fail(w, CAROM_E_CAPACITY, "the snapshot needs %lu bytes, not %lu",
                              (unsigned long)*size, (unsigned long)capacity);
    }
    unsigned char *to = bytes;
    const size_t checksum_at = *size - CHECKSUM_BYTES;
    memcpy(to, MAGIC, sizeof MAGIC);
    crm_put_u64(to + FORMAT_AT, CAROM_SNAPSHOT_FORMAT);
    crm_put_u64(to + SIZE_AT, *size);
    crm_put_u64(to + SCENE_AT, scene_of(w));
    crm_coder c = {CRM_WRITE, to + STATE_AT, NULL, 0, 0, 0, 0};
    int n;
    code_state(&c, w, &n);
    crm_put_u64(to + checksum_at, crm_hash_bytes(CRM_HASH_START, checksum_at, to));
    return CAROM_OK;
}

static carom_status refuse(carom_world *w, const char *why)
{
    return crm_world_fail(w, CAROM_E_ARGUMENT, "snapshot: %s", why);
}

/* Everything but the state itself. */
static carom_status check_frame(carom_world *w, size_t size, const unsigned char *from)
{
    if (size < STATE_AT + CHECKSUM_BYTES || memcmp(from, MAGIC, sizeof MAGIC) != 0) {
        return refuse(w, "these bytes are none");
    }
    const uint64_t format = crm_get_u64(from + FORMAT_AT);
    if (format != CAROM_SNAPSHOT_FORMAT) {
        return crm_world_fail(w, CAROM_E_ARGUMENT, "snapshot: of format %lu, this library reads %d",
                              (unsigned long)format, CAROM_SNAPSHOT_FORMAT);
    }
    if (crm_get_u64(from + SIZE_AT) != size) return refuse(w, "cut off, or not its own length");
    const size_t checksum_at = size - CHECKSUM_BYTES;
    if (crm_get_u64(from + checksum_at) != crm_hash_bytes(CRM_HASH_START, checksum_at, from)) {
        return refuse(w, "damaged, its checksum does not fit");
    }
    if (crm_get_u64(from + SCENE_AT) != scene_of(w)) {
        return refuse(w, "of another scene, or of other settings");
    }
    return CAROM_OK;
}

/* Both lists, for they take turns. */
static carom_status reserve_touches(carom_world *w, int n)
{
    crm_touches *lists[2] = {&w->touches, &w->next};
    for (int i = 0; i < 2; i++) {
        void *list = lists[i]->list;
        const carom_status e = crm_reserve(&w->memory, &list, &lists[i]->max, n, sizeof(crm_touch));
        lists[i]->list = list;
        if (e) return crm_world_fail(w, e, "no memory for %d contacts of the snapshot", n);
    }
    return CAROM_OK;
}

static carom_status take_up(carom_world *w, size_t size, const unsigned char *from)
{
    const size_t bytes = size - STATE_AT - CHECKSUM_BYTES;
    crm_coder c = {CRM_CHECK, NULL, from + STATE_AT, 0, bytes, 0, 0};
    int n;
    code_state(&c, w, &n);
    if (c.bad || c.at != bytes) return refuse(w, "damaged, a number is out of its range");
    const carom_status e = reserve_touches(w, n);
    if (e) return e;
    c.how = CRM_READ;
    c.at = 0;
    code_state(&c, w, &w->touches.n);
    for (int k = 0; k < w->n_joints; k++) w->joints[k].lever = w->length;
    w->damped = crm_world_is_damped(w);
    w->statics_placed = 0;
    w->revision++;
    return CAROM_OK;
}

carom_status carom_world_restore(carom_world *world, size_t size, const void *bytes)
{
    if (!world || !bytes) return CAROM_E_ARGUMENT;
    carom_world *w = world;
    w->error[0] = '\0';
    carom_status e = crm_seal_as_is(w);
    if (!e) e = check_frame(w, size, bytes);
    return e ? e : take_up(w, size, bytes);
}
