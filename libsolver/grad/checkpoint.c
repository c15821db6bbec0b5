/* checkpoint.c: long runs in little memory: snapshots of the world, sub-steps run again from them.
 * docs/gradient.md, section "Long runs". */
#include "carom/snapshot.h"
#include "grad/internal.h"

/* First distance of snapshots where memory is bounded [steps]; it doubles as they fill their share.
 */
enum { FIRST_EVERY = 16 };

static carom_status unused(const carom_tape *t)
{
    if (t->n_frames == 0) return CAROM_OK;
    return crm_world_fail(t->world, CAROM_E_STATE,
                          "checkpoints are set before the first step of a recording");
}

carom_status carom_tape_checkpoint(carom_tape *tape, int every)
{
    if (!tape || every < 0) return CAROM_E_ARGUMENT;
    const carom_status e = unused(tape);
    if (e) return e;
    tape->every = every;
    tape->limit = 0;
    return CAROM_OK;
}

carom_status carom_tape_memory(carom_tape *tape, size_t bytes)
{
    if (!tape) return CAROM_E_ARGUMENT;
    const carom_status e = unused(tape);
    if (e) return e;
    tape->every = bytes ? FIRST_EVERY : 0;
    tape->limit = bytes;
    return CAROM_OK;
}

/* --- the list of snapshots, in the order of steps ------------------------------------------------
 */

static void free_snapshot(carom_tape *t, int k)
{
    crm_snapshot *s = &t->snapshots[k];
    const crm_snapshot none = {0};
    crm_free(&t->memory, s->bytes, s->size, 1);
    *s = none;
}

/* Of the world `of`, before the frame `step`; behind all others. */
static carom_status take_snapshot(carom_tape *t, carom_world *of, int step, int for_good)
{
    void *list = t->snapshots;
    size_t size = 0;
    carom_status e =
        crm_reserve(&t->memory, &list, &t->max_snapshots, t->n_snapshots + 1, sizeof *t->snapshots);
    t->snapshots = list;
    if (!e) e = carom_world_snapshot(of, 0, NULL, &size);
    if (e < 0 && e != CAROM_E_CAPACITY) return e;
    crm_snapshot *s = &t->snapshots[t->n_snapshots];
    s->bytes = crm_new(&t->memory, size, 1);
    if (!s->bytes) return CAROM_E_MEMORY;
    s->size = size;
    s->step = step;
    s->for_good = for_good;
    t->n_snapshots++;
    return carom_world_snapshot(of, size, s->bytes, &size) < 0 ? CAROM_E_STATE : CAROM_OK;
}

static void drop_last(carom_tape *t)
{
    free_snapshot(t, --t->n_snapshots);
}

/* Those that only a pass has taken. */
static void drop_temporary(carom_tape *t, int from)
{
    int n = 0;
    for (int k = 0; k < t->n_snapshots; k++) {
        if (!t->snapshots[k].for_good && t->snapshots[k].step >= from) {
            free_snapshot(t, k);
        } else {
            t->snapshots[n++] = t->snapshots[k];
        }
    }
    for (int k = n; k < t->n_snapshots; k++) memset(&t->snapshots[k], 0, sizeof *t->snapshots);
    t->n_snapshots = n;
}

/* Half of the snapshots, at twice the distance. */
static void thin(carom_tape *t)
{
    int n = 0;
    t->every *= 2;
    for (int k = 0; k < t->n_snapshots; k++) {
        if (t->snapshots[k].step % t->every) {
            free_snapshot(t, k);
        } else {
            t->snapshots[n++] = t->snapshots[k];
        }
    }
    for (int k = n; k < t->n_snapshots; k++) memset(&t->snapshots[k], 0, sizeof *t->snapshots);
    t->n_snapshots = n;
}

/* The last snapshot at or before a frame. */
static const crm_snapshot *before(const carom_tape *t, int frame)
{
    int k = t->n_snapshots - 1;
    while (t->snapshots[k].step > frame) k--;
    return &t->snapshots[k];
}

/* --- recording ----------------------------------------------------------------------------------
 */

/* Half of the memory is for snapshots that stay, a quarter each for sub-steps and for snapshots on
 * the way back. */
static carom_status fit(carom_tape *t)
{
    while (t->limit && t->memory.live > t->limit / 2 && t->n_snapshots > 1) thin(t);
    if (!t->limit || t->memory.live <= t->limit / 4 * 3) return CAROM_OK;
    return crm_world_fail(t->world, CAROM_E_CAPACITY,
                          "%zu bytes are not enough for a tape of %d steps: its forces and one "
                          "snapshot take %zu; give more to carom_tape_memory",
                          t->limit, t->n_frames + 1, t->memory.live);
}

static void drop_block(carom_tape *t)
{
    crm_drop_records(t, 0);
    for (int k = t->held_from; t->limit && k < t->held_to; k++) crm_drop_states(t, k);
    t->held_from = t->held_to = -1;
}

carom_status crm_checkpoint(carom_tape *t, int frame)
{
    carom_status e = CAROM_OK;
    const int due = t->every && frame % t->every == 0;
    if (due || t->limit || t->held_to != frame) {
        drop_block(t);
        drop_temporary(t, 0);
        if (!t->limit) t->held_from = t->held_to = frame;
    }
    if (due) e = take_snapshot(t, t->world, frame, 1);
    return e < 0 ? e : fit(t);
}

int crm_records_kept(const carom_tape *t)
{
    return !t->limit;
}

/* --- running again ------------------------------------------------------------------------------
 */

/* The replay at a snapshot.  Its constant forces are zero: a frame's force holds them. */
static carom_status go_back(carom_tape *t, const crm_snapshot *s)
{
    const size_t bytes = 3 * (size_t)t->n_bodies * sizeof(double);
    if (!t->replay) {
        const carom_status e = carom_world_copy(t->world, NULL, &t->replay);
        if (e < 0) return e;
    }
    memcpy(t->replay->force, t->world->force, bytes);
    const carom_status e = carom_world_restore(t->replay, s->size, s->bytes);
    memset(t->replay->force, 0, bytes);
    t->replay_at = e < 0 ? -1 : s->step;
    return e;
}

/* The replay at `step`: on from where it is, or from the last snapshot. */
static carom_status go_to(carom_tape *t, int step)
{
    const crm_snapshot *s = before(t, step);
    carom_status e = CAROM_OK;
    if (!t->replay || t->replay_at < s->step || t->replay_at > step) e = go_back(t, s);
    while (e >= 0 && t->replay_at < step) {
        e = carom_world_step(t->replay, t->frames[t->replay_at].force, NULL);
        t->replay_at = e < 0 ? -1 : t->replay_at + 1;
        t->n_replayed++;
    }
    return e;
}

/* What the records from `first` on and a state take; the list of records grows by half. */
static void note_size(carom_tape *t, int first)
{
    size_t bytes = 6 * (size_t)t->n_bodies * sizeof(double);
    for (int k = first; k < t->n_records; k++) {
        bytes += t->records[k].bytes + 3 * sizeof *t->records / 2;
    }
    if (bytes > t->step_bytes) t->step_bytes = bytes;
}

/* Records from .. to - 1 from the replay. */
static carom_status record_block(carom_tape *t, int from, int to)
{
    carom_status e = go_to(t, from);
    t->source = t->replay;
    t->held_from = t->held_to = from;
    for (int k = from; e >= 0 && k < to; k++) {
        e = t->limit ? crm_keep_states(t, k, t->replay) : crm_same_states(t, k, t->replay);
        if (e >= 0) e = crm_record_step(t, k, t->frames[k].force, NULL);
        t->replay_at = e < 0 ? -1 : k + 1;
        t->n_replayed++;
        if (e >= 0) t->held_to = k + 1;
        note_size(t, t->frames[k].first_record);
        if (e >= 0 && t->limit && t->memory.live > t->limit) e = CAROM_E_CAPACITY;
    }
    t->source = t->world;
    if (e >= 0) crm_keep_block_end(t, t->replay);
    return e;
}

/* Steps that may be held at once. */
static int block_length(const carom_tape *t)
{
    if (!t->limit) return t->every;
    const size_t n = t->step_bytes ? t->limit / 4 / t->step_bytes : 1;
    return n < 1 ? 1 : n < (size_t)t->every ? (int)n : t->every;
}

/* C(s + r, s), the number of blocks that s snapshots reverse when none is run more than r times;
 * INT_MAX beyond. */
static int reach(int s, int r)
{
    double n = 1;
    for (int k = 1; k <= s; k++) n = n * (r + k) / k;
    return n < 1e9 ? (int)(n + 0.5) : 1000000000;
}

/* Blocks to go on, of n of them with s > 0 snapshots left, to the next one: Griewank and Walther,
 * ACM Trans. Math. Softw. 26 (2000), algorithm 799. */
static int binomial_way(int n, int s)
{
    int r = 0;
    while (reach(s, r) < n) r++;
    const int least = n - reach(s - 1, r);
    const int most = reach(s, r - 1);
    const int m = n - reach(s - 1, r - 1);
    const int way = m < least ? least : m > most ? most : m;
    return way < 1 ? 1 : way > n - 1 ? n - 1 : way;
}

/* Snapshots that there is room for. */
static int slots(const carom_tape *t)
{
    const size_t room = t->limit / 4 * 3;
    const size_t size = t->snapshots[t->n_snapshots - 1].size + sizeof(crm_snapshot);
    if (!t->limit || t->memory.live >= room) return 0;
    const size_t n = (room - t->memory.live) / size;
    return n < 1000 ? (int)n : 1000;
}

/* On the way back: snapshots toward `frame` until a block reaches from the last one behind it. */
static carom_status approach(carom_tape *t, int frame, int length)
{
    carom_status e = CAROM_OK;
    for (;;) {
        const int from = before(t, frame)->step;
        const int n = (frame - from) / length + 1;
        const int s = slots(t);
        if (e < 0 || n <= 1 || s < 1) return e;
        const int to = from + length * binomial_way(n, s);
        e = go_to(t, to);
        if (e >= 0) e = take_snapshot(t, t->replay, to, 0);
    }
}

carom_status crm_hold_segment(carom_tape *t, int frame)
{
    if (frame >= t->held_from && frame < t->held_to) return CAROM_OK;
    drop_block(t);
    drop_temporary(t, frame + 1);
    const int length = block_length(t);
    int from = before(t, frame)->step;
    int to = from + length;
    if (frame >= to && !t->ascending) {
        const carom_status e = approach(t, frame, length);
        if (e < 0) return e;
        from = before(t, frame)->step;
        to = from + length;
    }
    if (frame >= to) { /* no room for snapshots, or forward: the replay goes to the block */
        from = t->ascending ? frame : frame + 1 - length;
        to = from + length;
    }
    if (!t->ascending && t->limit && to > frame + 1) to = frame + 1;
    return record_block(t, from, to < t->n_frames ? to : t->n_frames);
}

void crm_free_checkpoints(carom_tape *t)
{
    while (t->n_snapshots > 0) drop_last(t);
    crm_free(&t->memory, t->snapshots, (size_t)t->max_snapshots, sizeof *t->snapshots);
    t->snapshots = NULL;
    t->max_snapshots = 0;
    carom_world_destroy(t->replay);
    t->replay = NULL;
}

void crm_forget_checkpoints(carom_tape *t)
{
    drop_block(t);
    while (t->n_snapshots > 0) drop_last(t);
    t->replay_at = -1;
    if (t->limit) t->every = FIRST_EVERY;
}
