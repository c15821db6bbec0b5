/* checkpoint.c: long runs in little memory: states as snapshots, sub-steps run again.
 * docs/gradient.md, section "Long runs". */
#include "carom/snapshot.h"
#include "grad/internal.h"

carom_status carom_tape_checkpoint(carom_tape *tape, int every)
{
    if (!tape || every < 0) return CAROM_E_ARGUMENT;
    if (tape->n_frames > 0) {
        return crm_world_fail(tape->world, CAROM_E_STATE,
                              "checkpoints are set before the first step of a recording");
    }
    tape->every = every;
    return CAROM_OK;
}

int crm_segment(const carom_tape *t, int frame)
{
    return t->every > 0 ? frame / t->every : 0;
}

static carom_status take_snapshot(carom_tape *t, int segment)
{
    void *list = t->snapshots;
    const carom_status e =
        crm_reserve(&t->memory, &list, &t->max_snapshots, segment + 1, sizeof *t->snapshots);
    t->snapshots = list;
    if (e) return e;
    crm_snapshot *s = &t->snapshots[segment];
    carom_status taken = carom_world_snapshot(t->world, 0, NULL, &s->size);
    if (taken < 0 && taken != CAROM_E_CAPACITY) return taken;
    if (s->size > s->capacity) {
        crm_free(&t->memory, s->bytes, s->capacity, 1);
        s->capacity = 0;
        s->bytes = crm_new(&t->memory, s->size, 1);
        if (!s->bytes) return CAROM_E_MEMORY;
        s->capacity = s->size;
    }
    taken = carom_world_snapshot(t->world, s->capacity, s->bytes, &s->size);
    return taken < 0 ? taken : CAROM_OK;
}

carom_status crm_checkpoint(carom_tape *t, int frame)
{
    if (frame > 0 && (!t->every || frame % t->every)) return CAROM_OK;
    crm_drop_records(t, 0);
    const carom_status e = t->every ? take_snapshot(t, crm_segment(t, frame)) : CAROM_OK;
    if (!e) t->held = crm_segment(t, frame);
    return e;
}

/* The replay at the start of a segment.  Its constant forces are zero: a frame's force holds them.
 */
static carom_status go_back(carom_tape *t, int segment)
{
    const crm_snapshot *s = &t->snapshots[segment];
    const size_t bytes = 3 * (size_t)t->n_bodies * sizeof(double);
    if (!t->replay) {
        const carom_status e = carom_world_copy(t->world, NULL, &t->replay);
        if (e < 0) return e;
    }
    memcpy(t->replay->force, t->world->force, bytes);
    const carom_status e = carom_world_restore(t->replay, s->size, s->bytes);
    memset(t->replay->force, 0, bytes);
    return e;
}

carom_status crm_hold_segment(carom_tape *t, int frame)
{
    const int segment = crm_segment(t, frame);
    const int first = segment * t->every;
    const size_t bytes = 3 * (size_t)t->n_bodies * sizeof(double);
    if (t->held == segment) return CAROM_OK;
    crm_drop_records(t, 0);
    t->held = -1;
    carom_status e = go_back(t, segment);
    if (e < 0) return e;
    t->source = t->replay;
    for (int k = first; e >= 0 && k < t->n_frames && k < first + t->every; k++) {
        /* The same bits, or the derivative would be that of another run. */
        if (memcmp(t->replay->q, t->frames[k].q, bytes)) e = CAROM_E_STATE;
        if (e >= 0) e = crm_record_step(t, k, t->frames[k].force, NULL);
    }
    t->source = t->world;
    if (e >= 0) t->held = segment;
    return e;
}

void crm_free_checkpoints(carom_tape *t)
{
    for (int k = 0; k < t->max_snapshots; k++) {
        crm_free(&t->memory, t->snapshots[k].bytes, t->snapshots[k].capacity, 1);
    }
    crm_free(&t->memory, t->snapshots, (size_t)t->max_snapshots, sizeof *t->snapshots);
    carom_world_destroy(t->replay);
    t->replay = NULL;
}
