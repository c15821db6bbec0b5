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

static carom_status record_substep(void *user, const crm_substep *s)
{
    carom_tape *t = user;
    const crm_island *island = t->source->island;
    void *records = t->records;
    carom_status e =
        crm_reserve(&t->memory, &records, &t->max_records, t->n_records + 1, sizeof *t->records);
    t->records = records;
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
    if (s->n_contacts > t->most_contacts) t->most_contacts = s->n_contacts;
    t->n_records++;
    return CAROM_OK;
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
    for (int k = 0; k < tape->max_frames; k++) {
        crm_free(&tape->memory, tape->frames[k].force, 3 * n3(tape), sizeof(double));
    }
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
    crm_drop_records(tape, 0);
    tape->n_frames = 0;
    tape->held = -1;
    tape->revision = tape->world->revision;
    crm_forget_clocks(tape->world);
    keep_end(tape);
}

/* The frame of the coming step; its arrays, one block, are kept for reuse after a rewind. */
static carom_status open_frame(carom_tape *t, const double *force)
{
    const carom_world *w = t->world;
    void *frames = t->frames;
    const carom_status e =
        crm_reserve(&t->memory, &frames, &t->max_frames, t->n_frames + 1, sizeof *t->frames);
    t->frames = frames;
    if (e) return e;
    crm_frame *f = &t->frames[t->n_frames];
    if (!f->force) f->force = crm_new(&t->memory, 3 * n3(t), sizeof(double));
    if (!f->force) return CAROM_E_MEMORY;
    f->q = f->force + n3(t);
    f->v = f->q + n3(t);
    memcpy(f->q, w->q, n3(t) * sizeof(double));
    memcpy(f->v, w->v, n3(t) * sizeof(double));
    for (size_t k = 0; k < n3(t); k++) f->force[k] = w->force[k] + (force ? force[k] : 0);
    return CAROM_OK;
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
    const crm_recorder recorder = {record_substep, restart_frame, t};
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
    if (e) return crm_world_fail(w, e, "no memory to record step %ld", w->n_steps + 1);
    e = crm_record_step(tape, tape->n_frames, force, stats);
    if (e < 0) return e;
    tape->n_frames++;
    keep_end(tape);
    return e;
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
    return tape->frames[step].q;
}

const double *carom_tape_v(const carom_tape *tape, int step)
{
    if (!tape || step < 0 || step > tape->n_frames) return NULL;
    if (step == tape->n_frames) return tape->v_end;
    return tape->frames[step].v;
}
