/* broadphase.c: the object, all pairs of a few boxes, and the order of the pairs. */
#include "broadphase/internal.h"

#include <limits.h>

/* Up to this many boxes all pairs are tested: a setting of speed. */
enum { ALL_PAIRS_MAX = 64 };

carom_status carom_broadphase_create(const carom_allocator *allocator, carom_broadphase **out)
{
    if (!out) return CAROM_E_ARGUMENT;
    crm_memory memory = crm_memory_from(allocator);
    carom_broadphase *bp = crm_new(&memory, 1, sizeof *bp);
    if (!bp) return CAROM_E_MEMORY;
    bp->memory = memory;
    *out = bp;
    return CAROM_OK;
}

void carom_broadphase_destroy(carom_broadphase *bp)
{
    if (!bp) return;
    crm_memory memory = bp->memory;
    crm_free(&memory, bp->pairs, (size_t)bp->pairs_max, sizeof *bp->pairs);
    crm_free(&memory, bp->scratch, (size_t)bp->scratch_max, sizeof *bp->scratch);
    crm_free(&memory, bp->order.at, (size_t)bp->order.n_max, sizeof *bp->order.at);
    crm_free(&memory, bp->other.at, (size_t)bp->other.n_max, sizeof *bp->other.at);
    crm_free(&memory, bp->large.at, (size_t)bp->large.n_max, sizeof *bp->large.at);
    crm_free(&memory, bp->key.at, (size_t)bp->key.n_max, sizeof *bp->key.at);
    crm_free(&memory, bp->other_key.at, (size_t)bp->other_key.n_max, sizeof *bp->other_key.at);
    crm_free(&memory, bp->sorted.at, (size_t)bp->sorted.n_max, sizeof *bp->sorted.at);
    crm_free(&memory, bp, 1, sizeof *bp);
}

void carom_broadphase_memory(const carom_broadphase *bp, size_t *bytes, long *calls)
{
    *bytes = bp->memory.live;
    *calls = bp->memory.n_calls;
}

carom_broadphase_stats carom_broadphase_statistics(const carom_broadphase *bp)
{
    return bp->stats;
}

carom_status crm_ints_reserve(carom_broadphase *bp, crm_ints *p, int need)
{
    void *at = p->at;
    const carom_status e = crm_reserve(&bp->memory, &at, &p->n_max, need, sizeof *p->at);
    p->at = at;
    return e;
}

carom_status crm_keys_reserve(carom_broadphase *bp, crm_keys *p, int need)
{
    void *at = p->at;
    const carom_status e = crm_reserve(&bp->memory, &at, &p->n_max, need, sizeof *p->at);
    p->at = at;
    return e;
}

carom_status crm_boxes_reserve(carom_broadphase *bp, crm_boxes *p, int need)
{
    void *at = p->at;
    const carom_status e = crm_reserve(&bp->memory, &at, &p->n_max, need, sizeof *p->at);
    p->at = at;
    return e;
}

static carom_status grow_pairs(carom_broadphase *bp)
{
    if (bp->n_pairs == INT_MAX) return CAROM_E_CAPACITY;
    void *p = bp->pairs;
    const carom_status e =
        crm_reserve(&bp->memory, &p, &bp->pairs_max, bp->n_pairs + 1, sizeof *bp->pairs);
    bp->pairs = p;
    return e;
}

carom_status crm_pair_add(carom_broadphase *bp, int i, int j)
{
    if (bp->n_pairs == bp->pairs_max) {
        const carom_status e = grow_pairs(bp);
        if (e) return e;
    }
    carom_pair *pair = &bp->pairs[bp->n_pairs++];
    pair->a = i < j ? i : j;
    pair->b = i < j ? j : i;
    return CAROM_OK;
}

static carom_status all_pairs(carom_broadphase *bp, int n, const carom_box *boxes)
{
    bp->stats.method = CAROM_ALL_PAIRS;
    for (int i = 0; i < n; i++) {
        if (crm_box_is_empty(&boxes[i])) continue;
        for (int j = i + 1; j < n; j++) {
            bp->stats.n_tests++;
            if (!crm_box_overlaps(&boxes[i], &boxes[j]) || crm_box_is_empty(&boxes[j])) continue;
            const carom_status e = crm_pair_add(bp, i, j);
            if (e) return e;
        }
    }
    return CAROM_OK;
}

/* Stable counting sort of n_pairs pairs by one of their indices, below n. */
static void sort_by(int by_b, int n, int n_pairs, const carom_pair *from, carom_pair *to,
                    int *count)
{
    memset(count, 0, ((size_t)n + 1) * sizeof *count);
    for (int k = 0; k < n_pairs; k++) count[(by_b ? from[k].b : from[k].a) + 1]++;
    for (int i = 0; i < n; i++) count[i + 1] += count[i];
    for (int k = 0; k < n_pairs; k++) to[count[by_b ? from[k].b : from[k].a]++] = from[k];
}

static carom_status sort_pairs(carom_broadphase *bp, int n)
{
    void *p = bp->scratch;
    carom_status e =
        crm_reserve(&bp->memory, &p, &bp->scratch_max, bp->n_pairs, sizeof *bp->scratch);
    bp->scratch = p;
    if (!e) e = crm_ints_reserve(bp, &bp->other, n + 1);
    if (e) return e;
    sort_by(1, n, bp->n_pairs, bp->pairs, bp->scratch, bp->other.at);
    sort_by(0, n, bp->n_pairs, bp->scratch, bp->pairs, bp->other.at);
    return CAROM_OK;
}

static carom_status find_pairs(carom_broadphase *bp, int n, const carom_box *boxes)
{
    if (n <= ALL_PAIRS_MAX) return all_pairs(bp, n, boxes);
    int done = 0;
    carom_status e = crm_grid_pairs(bp, n, boxes, &done);
    if (!e && !done) {
        bp->n_pairs = 0;
        e = crm_sweep_pairs(bp, n, boxes);
    }
    return e ? e : sort_pairs(bp, n);
}

carom_status carom_broadphase_pairs(carom_broadphase *bp, int n, const carom_box *boxes,
                                    int *n_pairs, const carom_pair **pairs)
{
    if (!bp || n < 0 || n == INT_MAX || (n && !boxes) || !n_pairs || !pairs) {
        return CAROM_E_ARGUMENT;
    }
    const carom_broadphase_stats none = {CAROM_ALL_PAIRS, 0, 0};
    bp->stats = none;
    bp->n_pairs = 0;
    const carom_status e = find_pairs(bp, n, boxes);
    if (e) return e;
    *n_pairs = bp->n_pairs;
    *pairs = bp->pairs;
    return CAROM_OK;
}
