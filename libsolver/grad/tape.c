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

/* Which rows a kind of solve needs its own right-hand sides of. */
static void keep_solve(const carom_tape *t, const crm_substep *s, int index, crm_block *b,
                       crm_solve *to)
{
    const crm_solve *c = &s->solve[index];
    const size_t m = (size_t)s->n_contacts;
    const size_t rows = 2 * (size_t)t->world->n_joints;
    const int first_pose = c->kind == CRM_CORRECTION || c->kind == CRM_STAGE_2;
    to->q = first_pose ? keep(b, c->q, n3(t), sizeof(double)) : NULL;
    to->v = keep(b, c->v, n3(t), sizeof(double));
    to->cn = keep(b, c->cn, m, sizeof(double));
    to->ct = keep(b, c->ct, m, sizeof(double));
    to->ln = keep(b, c->ln, m, sizeof(double));
    to->lt = keep(b, c->lt, m, sizeof(double));
    to->mode = keep(b, c->mode, m, 1);
    to->ce = keep(b, c->ce, rows, sizeof(double));
    to->le = keep(b, c->le, rows, sizeof(double));
}

/* Copies what the reverse pass needs of a sub-step into a block; measures when b->base is NULL. */
static void pack(const carom_tape *t, const crm_substep *s, crm_block *b, crm_substep *to)
{
    const size_t m = (size_t)s->n_contacts;
    *to = *s;
    to->moved = NULL;
    to->pressing = NULL;
    to->state_block = NULL;
    to->contact_block = NULL;
    to->q0 = keep(b, s->q0, n3(t), sizeof(double));
    to->v0 = keep(b, s->v0, n3(t), sizeof(double));
    to->q1 = NULL;
    to->v1 = NULL;
    to->contacts = keep(b, s->contacts, m, sizeof *s->contacts);
    to->target = keep(b, s->target, m, sizeof(double));
    for (int k = 0; k < s->n_solves; k++) {
        keep_solve(t, s, k, b, &to->solve[k]);
        if (!to->solve[k].q) to->solve[k].q = to->q0;
    }
}

static carom_status record_substep(void *user, const crm_substep *s)
{
    carom_tape *t = user;
    void *records = t->records;
    carom_status e =
        crm_reserve(&t->memory, &records, &t->max_records, t->n_records + 1, sizeof *t->records);
    t->records = records;
    if (e) return e;
    crm_record *r = &t->records[t->n_records];
    crm_block b = {NULL, 0};
    pack(t, s, &b, &r->s);
    r->bytes = b.used;
    r->block = crm_new(&t->memory, b.used, 1);
    if (!r->block) return CAROM_E_MEMORY;
    b.base = r->block;
    b.used = 0;
    pack(t, s, &b, &r->s);
    r->s.force = t->frames[t->n_frames].force;
    t->n_records++;
    return CAROM_OK;
}

/* Drops records down to n. */
static void drop_records(carom_tape *t, int n)
{
    while (t->n_records > n) {
        crm_record *r = &t->records[--t->n_records];
        crm_free(&t->memory, r->block, r->bytes, 1);
    }
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
    drop_records(tape, 0);
    for (int k = 0; k < tape->max_frames; k++) {
        crm_free(&tape->memory, tape->frames[k].force, n3(tape), sizeof(double));
    }
    crm_free(&tape->memory, tape->records, (size_t)tape->max_records, sizeof *tape->records);
    crm_free(&tape->memory, tape->frames, (size_t)tape->max_frames, sizeof *tape->frames);
    crm_free(&tape->memory, tape->q_end, n3(tape), sizeof(double));
    crm_free(&tape->memory, tape->v_end, n3(tape), sizeof(double));
    crm_memory m = tape->memory;
    crm_free(&m, tape, 1, sizeof *tape);
}

void carom_tape_rewind(carom_tape *tape)
{
    drop_records(tape, 0);
    tape->n_frames = 0;
    tape->revision = tape->world->revision;
    tape->world->carry = 0;
    keep_end(tape);
}

/* The frame of the coming step; its force array is kept for reuse after a rewind. */
static carom_status open_frame(carom_tape *t, const double *force)
{
    const carom_world *w = t->world;
    void *frames = t->frames;
    const carom_status e =
        crm_reserve(&t->memory, &frames, &t->max_frames, t->n_frames + 1, sizeof *t->frames);
    t->frames = frames;
    if (e) return e;
    crm_frame *f = &t->frames[t->n_frames];
    if (!f->force) f->force = crm_new(&t->memory, n3(t), sizeof(double));
    if (!f->force) return CAROM_E_MEMORY;
    f->first_record = t->n_records;
    for (size_t k = 0; k < n3(t); k++) f->force[k] = w->force[k] + (force ? force[k] : 0);
    return CAROM_OK;
}

static int continues(const carom_tape *t)
{
    const size_t bytes = n3(t) * sizeof(double);
    return t->revision == t->world->revision && !memcmp(t->q_end, t->world->q, bytes) &&
           !memcmp(t->v_end, t->world->v, bytes);
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
    if (e) return crm_world_fail(w, e, "no memory to record step %ld", w->n_steps + 1);
    const int first = tape->n_records;
    const crm_recorder recorder = {record_substep, tape};
    w->recorder = recorder;
    e = carom_world_step(w, force, stats);
    memset(&w->recorder, 0, sizeof w->recorder);
    if (e < 0) {
        drop_records(tape, first);
        return e;
    }
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
    return tape->records[tape->frames[step].first_record].s.q0;
}

const double *carom_tape_v(const carom_tape *tape, int step)
{
    if (!tape || step < 0 || step > tape->n_frames) return NULL;
    if (step == tape->n_frames) return tape->v_end;
    return tape->records[tape->frames[step].first_record].s.v0;
}
