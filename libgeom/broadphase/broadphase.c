/* broadphase.c: pairs of overlapping boxes: all pairs when they are few, else sort and sweep. */
#include "carom/broadphase.h"

#include "base/memory.h"

#include <limits.h>

/* Below this many boxes all pairs are tested: a setting of speed. */
enum { ALL_PAIRS_MAX = 64 };

struct carom_broadphase {
    crm_memory memory;
    carom_pair *pairs;
    int n_pairs;
    int pairs_max;
    carom_pair *scratch; /* pairs_max when sorting */
    int scratch_max;
    int *order; /* boxes by their lower x, ties by index */
    int order_max;
    int *merge;
    int merge_max;
    int *count; /* buckets of the pairs' sort */
    int count_max;
};

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
    crm_free(&memory, bp->order, (size_t)bp->order_max, sizeof *bp->order);
    crm_free(&memory, bp->merge, (size_t)bp->merge_max, sizeof *bp->merge);
    crm_free(&memory, bp->count, (size_t)bp->count_max, sizeof *bp->count);
    crm_free(&memory, bp, 1, sizeof *bp);
}

void carom_broadphase_memory(const carom_broadphase *bp, size_t *bytes, long *calls)
{
    *bytes = bp->memory.live;
    *calls = bp->memory.n_calls;
}

static int overlap_x(const carom_box *a, const carom_box *b)
{
    return a->lower.x <= b->upper.x && b->lower.x <= a->upper.x;
}

static int overlap_y(const carom_box *a, const carom_box *b)
{
    return a->lower.y <= b->upper.y && b->lower.y <= a->upper.y;
}

/* NaN anywhere makes it empty. */
static int is_empty(const carom_box *a)
{
    return !(a->lower.x <= a->upper.x && a->lower.y <= a->upper.y);
}

static carom_status add_pair(carom_broadphase *bp, int i, int j)
{
    if (bp->n_pairs == INT_MAX) return CAROM_E_CAPACITY;
    void *p = bp->pairs;
    const carom_status e =
        crm_reserve(&bp->memory, &p, &bp->pairs_max, bp->n_pairs + 1, sizeof *bp->pairs);
    bp->pairs = p;
    if (e) return e;
    carom_pair *pair = &bp->pairs[bp->n_pairs++];
    pair->a = i < j ? i : j;
    pair->b = i < j ? j : i;
    return CAROM_OK;
}

static carom_status all_pairs(carom_broadphase *bp, int n, const carom_box *boxes)
{
    for (int i = 0; i < n; i++) {
        if (is_empty(&boxes[i])) continue;
        for (int j = i + 1; j < n; j++) {
            if (is_empty(&boxes[j]) || !overlap_x(&boxes[i], &boxes[j])) continue;
            if (!overlap_y(&boxes[i], &boxes[j])) continue;
            const carom_status e = add_pair(bp, i, j);
            if (e) return e;
        }
    }
    return CAROM_OK;
}

static carom_status reserve_ints(carom_broadphase *bp, int **p, int *n_max, int need)
{
    void *q = *p;
    const carom_status e = crm_reserve(&bp->memory, &q, n_max, need, sizeof **p);
    *p = q;
    return e;
}

static int starts_before(const carom_box *boxes, int i, int j)
{
    return boxes[i].lower.x < boxes[j].lower.x || (boxes[i].lower.x == boxes[j].lower.x && i < j);
}

/* Merges from[low..mid) and from[mid..high) into `to`. */
static void merge_runs(const carom_box *boxes, const int *from, int low, int mid, int high, int *to)
{
    int i = low;
    int j = mid;
    for (int k = low; k < high; k++) {
        const int left = i < mid && (j >= high || starts_before(boxes, from[i], from[j]));
        to[k] = left ? from[i++] : from[j++];
    }
}

/* Merge sort of the boxes that are not empty; returns their number. */
static int sort_boxes(carom_broadphase *bp, int n, const carom_box *boxes)
{
    int m = 0;
    for (int i = 0; i < n; i++) {
        if (!is_empty(&boxes[i])) bp->order[m++] = i;
    }
    for (int width = 1; width<m; width = width> m / 2 ? m : 2 * width) {
        for (int low = 0; low < m;) {
            const int mid = width < m - low ? low + width : m;
            const int high = width < m - mid ? mid + width : m;
            merge_runs(boxes, bp->order, low, mid, high, bp->merge);
            low = high;
        }
        memcpy(bp->order, bp->merge, (size_t)m * sizeof *bp->order);
    }
    return m;
}

static carom_status sweep(carom_broadphase *bp, int m, const carom_box *boxes)
{
    for (int i = 0; i < m; i++) {
        const carom_box *a = &boxes[bp->order[i]];
        for (int j = i + 1; j < m && boxes[bp->order[j]].lower.x <= a->upper.x; j++) {
            if (!overlap_y(a, &boxes[bp->order[j]])) continue;
            const carom_status e = add_pair(bp, bp->order[i], bp->order[j]);
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
    if (!e) e = reserve_ints(bp, &bp->count, &bp->count_max, n + 1);
    if (e) return e;
    sort_by(1, n, bp->n_pairs, bp->pairs, bp->scratch, bp->count);
    sort_by(0, n, bp->n_pairs, bp->scratch, bp->pairs, bp->count);
    return CAROM_OK;
}

static carom_status sort_and_sweep(carom_broadphase *bp, int n, const carom_box *boxes)
{
    carom_status e = reserve_ints(bp, &bp->order, &bp->order_max, n);
    if (!e) e = reserve_ints(bp, &bp->merge, &bp->merge_max, n);
    if (e) return e;
    e = sweep(bp, sort_boxes(bp, n, boxes), boxes);
    return e ? e : sort_pairs(bp, n);
}

carom_status carom_broadphase_pairs(carom_broadphase *bp, int n, const carom_box *boxes,
                                    int *n_pairs, const carom_pair **pairs)
{
    if (!bp || n < 0 || n == INT_MAX || (n && !boxes) || !n_pairs || !pairs) {
        return CAROM_E_ARGUMENT;
    }
    bp->n_pairs = 0;
    const carom_status e =
        n <= ALL_PAIRS_MAX ? all_pairs(bp, n, boxes) : sort_and_sweep(bp, n, boxes);
    if (e) return e;
    *n_pairs = bp->n_pairs;
    *pairs = bp->pairs;
    return CAROM_OK;
}
