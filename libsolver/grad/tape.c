/* tape.c: recording of a run. */
#include "grad/internal.h"
#include "world/block.h"

static size_t n3(const carom_tape *t)
{
    return 3 * (size_t)t->n_bodies;
}

static void *keep(crm_block *b, const void *from, size_t n, size_t size)
{
    void *to = crm_carve(b, n, size);
    if (to && n) memcpy(to, from, n * size);
    return to;
}

/* Three numbers per body of the island. */
static double *keep_state(const crm_island *i, const double *full, crm_block *b)
{
    double *to = crm_carve(b, 3 * (size_t)i->n_bodies, sizeof *to);
    for (int k = 0; to && k < i->n_bodies; k++) {
        memcpy(&to[3 * k], &full[3 * i->bodies[k]], 3 * sizeof *to);
    }
    return to;
}

static void keep_solve(const crm_island *i, const crm_substep *s, int index, crm_block *b,
                       crm_solve *to)
{
    const crm_solve *c = &s->solve[index];
    const size_t m = (size_t)s->n_contacts;
    const size_t rows = (size_t)i->n_rows;
    const int own_pose = c->kind != CRM_VELOCITY && c->kind != CRM_IMPACT && c->kind != CRM_STAGE_1;
    to->q = own_pose ? keep_state(i, c->q, b) : NULL;
    to->v = keep_state(i, c->v, b);
    to->cn = keep(b, c->cn, m, sizeof(double));
    to->ct = keep(b, c->ct, m, sizeof(double));
    to->ln = keep(b, c->ln, m, sizeof(double));
    to->lt = keep(b, c->lt, m, sizeof(double));
    to->mode = keep(b, c->mode, m, 1);
    to->ce = keep(b, c->ce, rows, sizeof(double));
    to->le = keep(b, c->le, rows, sizeof(double));
    to->motor = keep(b, c->motor, rows, 1);
}

/* Copies what the reverse pass needs of a sub-step into a block; measures when b->base is NULL. */
static void pack(const crm_island *i, const crm_substep *s, crm_block *b, crm_record *to)
{
    const size_t m = (size_t)s->n_contacts;
    to->s = *s;
    to->s.moved = NULL;
    to->s.pressing = NULL;
    to->s.state_block = NULL;
    to->s.contact_block = NULL;
    to->island = *i;
    to->island.n_pairs = 0;
    to->island.pairs = NULL;
    to->island.bodies = keep(b, i->bodies, (size_t)i->n_bodies, sizeof(int));
    to->island.joints = keep(b, i->joints, (size_t)i->n_joints, sizeof(int));
    to->s.q0 = keep_state(i, s->q0, b);
    to->s.v0 = keep_state(i, s->v0, b);
    to->s.q1 = NULL;
    to->s.v1 = NULL;
    to->s.contacts = keep(b, s->contacts, m, sizeof *s->contacts);
    to->s.target = keep(b, s->target, m, sizeof(double));
    to->s.joint_target = keep(b, s->joint_target, (size_t)i->n_rows, sizeof(double));
    for (int k = 0; k < s->n_solves; k++) keep_solve(i, s, k, b, &to->s.solve[k]);
}

static carom_status reserve_record(carom_tape *t)
{
    void *records = t->records;
    const carom_status e =
        crm_reserve(&t->memory, &records, &t->max_records, t->n_records + 1, sizeof *t->records);
    t->records = records;
    return e;
}

static carom_status record_substep(void *user, const crm_substep *s)
{
    carom_tape *t = user;
    const crm_island *island = t->source->island;
    if (s->n_contacts > t->most_contacts) t->most_contacts = s->n_contacts;
    if (t->source == t->world && !crm_records_kept(t)) return CAROM_OK;
    const carom_status e = reserve_record(t);
    if (e) return e;
    crm_record *r = &t->records[t->n_records];
    crm_block b = {NULL, 0};
    pack(island, s, &b, r);
    r->bytes = b.used;
    r->block = crm_new(&t->memory, b.used, 1);
    if (!r->block) return CAROM_E_MEMORY;
    b.base = r->block;
    b.used = 0;
    pack(island, s, &b, r);
    r->s.force = t->frames[t->frame].force;
    r->which = (int)(island - t->source->islands.list);
    r->inner = s != &t->source->sub;
    t->n_records++;
    return CAROM_OK;
}

/* The first record of the last frame that is of the island, and starts where its bodies are; none:
 * -1. */
static int find_last(const carom_tape *t, const crm_island *i)
{
    const int end = t->frames[t->frame].first_record;
    const int from = t->frame > 0 ? t->frames[t->frame - 1].first_record : end;
    const int start = t->next_known > from && t->next_known < end ? t->next_known : from;
    const size_t bytes = (size_t)i->n_bodies * sizeof *i->bodies;
    for (int n = 0; n < end - from; n++) {
        const int k = from + (start - from + n) % (end - from); /* islands keep their order */
        const crm_record *r = &t->records[k];
        if (r->island.n_bodies != i->n_bodies || memcmp(r->island.bodies, i->bodies, bytes)) {
            continue;
        }
        for (int b = 0; b < i->n_bodies; b++) {
            if (memcmp(&r->s.q0[3 * b], &t->source->q[3 * i->bodies[b]], 3 * sizeof(double)))
                return -1;
        }
        return k;
    }
    return -1;
}

/* As of a record of the last frame, whose block it shares: the last records are dropped first. */
static carom_status repeat_record(carom_tape *t, int k)
{
    const carom_status e = reserve_record(t);
    if (e) return e;
    crm_record *r = &t->records[t->n_records++];
    *r = t->records[k];
    r->block = NULL;
    r->bytes = 0;
    r->s.force = t->frames[t->frame].force;
    r->s.time = carom_world_time(t->source);
    r->which = (int)(t->source->island - t->source->islands.list);
    return CAROM_OK;
}

static carom_status record_again(void *user, int *known)
{
    carom_tape *t = user;
    carom_status e = CAROM_OK;
    *known = 1;
    if (t->source == t->world && !crm_records_kept(t)) return CAROM_OK;
    const int first = find_last(t, t->source->island);
    *known = first >= 0;
    if (!*known) return CAROM_OK;
    const int which = t->records[first].which;
    const int end = t->frames[t->frame].first_record;
    int k = first;
    while (!e && k < end && t->records[k].which == which) e = repeat_record(t, k++);
    t->next_known = k;
    return e;
}

/* Drops records down to n. */
void crm_drop_records(carom_tape *t, int n)
{
    while (t->n_records > n) {
        crm_record *r = &t->records[--t->n_records];
        crm_free(&t->memory, r->block, r->bytes, 1);
    }
}

/* The frame under way is run again. */
static void restart_frame(void *user)
{
    carom_tape *t = user;
    crm_drop_records(t, t->frames[t->frame].first_record);
}

static void keep_end(carom_tape *t)
{
    memcpy(t->q_end, t->world->q, n3(t) * sizeof(double));
    memcpy(t->v_end, t->world->v, n3(t) * sizeof(double));
}

/* All arrays of a frame. */
static void drop_frame(carom_tape *t, int frame)
{
    crm_frame *f = &t->frames[frame];
    const crm_frame none = {0};
    if (f->lean) {
        crm_drop_states(t, frame);
        if (f->force != t->rest_force) crm_free(&t->memory, f->force, n3(t), sizeof(double));
    } else {
        crm_free(&t->memory, f->force, 3 * n3(t), sizeof(double));
    }
    *f = none;
}

carom_status carom_tape_create(carom_world *world, const carom_allocator *allocator,
                               carom_tape **out)
{
    if (!out) return CAROM_E_ARGUMENT;
    *out = NULL;
    if (!world) return CAROM_E_ARGUMENT;
    const carom_status e = carom_world_seal(world);
    if (e < 0) return e;
    crm_memory memory = crm_memory_from(allocator);
    carom_tape *t = crm_new(&memory, 1, sizeof *t);
    if (!t) return CAROM_E_MEMORY;
    t->memory = memory;
    t->world = world;
    t->source = world;
    t->n_bodies = world->n_bodies;
    t->q_end = crm_new(&t->memory, n3(t), sizeof(double));
    t->v_end = crm_new(&t->memory, n3(t), sizeof(double));
    if (!t->q_end || !t->v_end) {
        carom_tape_destroy(t);
        return CAROM_E_MEMORY;
    }
    carom_tape_rewind(t);
    *out = t;
    return CAROM_OK;
}

void carom_tape_destroy(carom_tape *tape)
{
    if (!tape) return;
    crm_drop_records(tape, 0);
    for (int k = 0; k < tape->max_frames; k++) drop_frame(tape, k);
    crm_free(&tape->memory, tape->rest_force, n3(tape), sizeof(double));
    crm_free(&tape->memory, tape->block_end, 2 * n3(tape), sizeof(double));
    crm_free(&tape->memory, tape->records, (size_t)tape->max_records, sizeof *tape->records);
    crm_free(&tape->memory, tape->frames, (size_t)tape->max_frames, sizeof *tape->frames);
    crm_free(&tape->memory, tape->q_end, n3(tape), sizeof(double));
    crm_free(&tape->memory, tape->v_end, n3(tape), sizeof(double));
    crm_free_checkpoints(tape);
    crm_memory m = tape->memory;
    crm_free(&m, tape, 1, sizeof *tape);
}

void carom_tape_rewind(carom_tape *tape)
{
    crm_forget_checkpoints(tape);
    for (int k = 0; tape->limit && k < tape->n_frames; k++) drop_frame(tape, k);
    tape->n_frames = 0;
    tape->revision = tape->world->revision;
    tape->first_step = tape->world->n_steps;
    crm_forget_clocks(tape->world);
    keep_end(tape);
}

/* A frame with its force and states in one block, kept for reuse after a rewind. */
static carom_status fill_frame(carom_tape *t, crm_frame *f, const double *force)
{
    const carom_world *w = t->world;
    if (!f->force) f->force = crm_new(&t->memory, 3 * n3(t), sizeof(double));
    if (!f->force) return CAROM_E_MEMORY;
    f->q = f->force + n3(t);
    f->v = f->q + n3(t);
    memcpy(f->q, w->q, n3(t) * sizeof(double));
    memcpy(f->v, w->v, n3(t) * sizeof(double));
    for (size_t k = 0; k < n3(t); k++) f->force[k] = w->force[k] + (force ? force[k] : 0);
    return CAROM_OK;
}

/* Where memory is bounded: a force only if one is given, no states. */
static carom_status fill_lean_frame(carom_tape *t, crm_frame *f, const double *force)
{
    const size_t n = n3(t);
    if (!t->rest_force) t->rest_force = crm_new(&t->memory, n, sizeof(double));
    if (!t->block_end) t->block_end = crm_new(&t->memory, 2 * n, sizeof(double));
    if (!t->rest_force || !t->block_end) return CAROM_E_MEMORY;
    memcpy(t->rest_force, t->world->force, n * sizeof(double));
    f->force = force ? crm_new(&t->memory, n, sizeof(double)) : t->rest_force;
    if (!f->force) return CAROM_E_MEMORY;
    for (size_t k = 0; force && k < n; k++) f->force[k] = t->world->force[k] + force[k];
    return CAROM_OK;
}

/* The frame of the coming step. */
static carom_status open_frame(carom_tape *t, const double *force)
{
    void *frames = t->frames;
    const carom_status e =
        crm_reserve(&t->memory, &frames, &t->max_frames, t->n_frames + 1, sizeof *t->frames);
    t->frames = frames;
    if (e) return e;
    crm_frame *f = &t->frames[t->n_frames];
    if (f->force && (f->lean || t->limit)) drop_frame(t, t->n_frames);
    f->lean = t->limit > 0;
    return f->lean ? fill_lean_frame(t, f, force) : fill_frame(t, f, force);
}

carom_status crm_keep_states(carom_tape *t, int frame, const carom_world *w)
{
    crm_frame *f = &t->frames[frame];
    if (!f->q) f->q = crm_new(&t->memory, 2 * n3(t), sizeof(double));
    if (!f->q) return CAROM_E_MEMORY;
    f->v = f->q + n3(t);
    memcpy(f->q, w->q, n3(t) * sizeof(double));
    memcpy(f->v, w->v, n3(t) * sizeof(double));
    return CAROM_OK;
}

void crm_drop_states(carom_tape *t, int frame)
{
    crm_frame *f = &t->frames[frame];
    crm_free(&t->memory, f->q, 2 * n3(t), sizeof(double));
    f->q = f->v = NULL;
}

carom_status crm_same_states(const carom_tape *t, int frame, const carom_world *w)
{
    return memcmp(w->q, t->frames[frame].q, n3(t) * sizeof(double)) ? CAROM_E_STATE : CAROM_OK;
}

void crm_keep_block_end(carom_tape *t, const carom_world *w)
{
    if (!t->limit) return;
    memcpy(t->block_end, w->q, n3(t) * sizeof(double));
    memcpy(t->block_end + n3(t), w->v, n3(t) * sizeof(double));
}

static int continues(const carom_tape *t)
{
    const size_t bytes = n3(t) * sizeof(double);
    return t->revision == t->world->revision && !memcmp(t->q_end, t->world->q, bytes) &&
           !memcmp(t->v_end, t->world->v, bytes);
}

carom_status crm_record_step(carom_tape *t, int frame, const double *force, carom_step_stats *stats)
{
    carom_world *w = t->source;
    const crm_recorder recorder = {record_substep, record_again, restart_frame, t};
    t->frame = frame;
    t->frames[frame].first_record = t->n_records;
    w->recorder = recorder;
    const carom_status e = carom_world_step(w, force, stats);
    memset(&w->recorder, 0, sizeof w->recorder);
    if (e < 0) crm_drop_records(t, t->frames[frame].first_record);
    return e;
}

carom_status carom_tape_step(carom_tape *tape, const double *force, carom_step_stats *stats)
{
    if (!tape) return CAROM_E_ARGUMENT;
    carom_world *w = tape->world;
    if (!continues(tape)) {
        return crm_world_fail(w, CAROM_E_STATE,
                              "the world changed since the last recorded step; rewind the tape");
    }
    carom_status e = open_frame(tape, force);
    if (!e) e = crm_checkpoint(tape, tape->n_frames);
    if (e == CAROM_E_CAPACITY) return e;
    if (e) return crm_world_fail(w, e, "no memory to record step %ld", w->n_steps + 1);
    e = crm_record_step(tape, tape->n_frames, force, stats);
    if (e < 0) return e;
    tape->n_frames++;
    if (crm_records_kept(tape)) tape->held_to = tape->n_frames;
    keep_end(tape);
    return e;
}

carom_status carom_tape_smooth(carom_tape *tape, double kappa)
{
    if (!tape || !(kappa >= 0 && kappa < HUGE_VAL)) return CAROM_E_ARGUMENT;
    tape->kappa = kappa;
    return CAROM_OK;
}

int carom_tape_steps(const carom_tape *tape)
{
    return tape ? tape->n_frames : 0;
}

size_t carom_tape_bytes(const carom_tape *tape)
{
    return tape ? tape->memory.live : 0;
}

const double *carom_tape_q(const carom_tape *tape, int step)
{
    if (!tape || step < 0 || step > tape->n_frames) return NULL;
    if (step == tape->n_frames) return tape->q_end;
    if (tape->limit && step == tape->held_to) return tape->block_end;
    return tape->frames[step].q;
}

const double *carom_tape_v(const carom_tape *tape, int step)
{
    if (!tape || step < 0 || step > tape->n_frames) return NULL;
    if (step == tape->n_frames) return tape->v_end;
    if (tape->limit && step == tape->held_to) return tape->block_end + n3(tape);
    return tape->frames[step].v;
}
