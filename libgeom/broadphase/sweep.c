/* sweep.c: boxes sorted by their lower sides along the axis of larger spread; each is compared with
 * those that start before it ends. */
#include "broadphase/internal.h"

#include <math.h>

/* Lower and upper side along the axis of the sweep. */
static double lower(const carom_box *b, int along_y)
{
    return along_y ? b->lower.y : b->lower.x;
}

static double upper(const carom_box *b, int along_y)
{
    return along_y ? b->upper.y : b->upper.x;
}

/* The axis with fewer overlaps expected: the larger ratio of spread to mean size, by quantities
 * that no single box can spoil: how many of the boxes overlap their successor by index. */
static int pick_axis(int n, const carom_box *boxes)
{
    long overlap_x = 0;
    long overlap_y = 0;
    const int stride = n / 2;
    for (int i = 0; i + stride < n; i++) {
        const carom_box *a = &boxes[i];
        const carom_box *b = &boxes[i + stride];
        overlap_x += a->lower.x <= b->upper.x && b->lower.x <= a->upper.x;
        overlap_y += a->lower.y <= b->upper.y && b->lower.y <= a->upper.y;
    }
    return overlap_y < overlap_x;
}

static int starts_before(const carom_box *boxes, int along_y, int i, int j)
{
    const double x = lower(&boxes[i], along_y);
    const double y = lower(&boxes[j], along_y);
    return x < y || (x == y && i < j);
}

/* Merges from[low..mid) and from[mid..high) into `to`. */
static void merge_runs(const carom_box *boxes, int along_y, const int *from, int low, int mid,
                       int high, int *to)
{
    int i = low;
    int j = mid;
    for (int k = low; k < high; k++) {
        const int left = i < mid && (j >= high || starts_before(boxes, along_y, from[i], from[j]));
        to[k] = left ? from[i++] : from[j++];
    }
}

/* Merge sort of the boxes that are not empty; returns their number. */
static int sort_boxes(carom_broadphase *bp, int n, const carom_box *boxes, int along_y)
{
    int *order = bp->order.at;
    int m = 0;
    for (int i = 0; i < n; i++) {
        if (!crm_box_is_empty(&boxes[i])) order[m++] = i;
    }
    for (int width = 1; width<m; width = width> m / 2 ? m : 2 * width) {
        for (int low = 0; low < m;) {
            const int mid = width < m - low ? low + width : m;
            const int high = width < m - mid ? mid + width : m;
            merge_runs(boxes, along_y, order, low, mid, high, bp->other.at);
            low = high;
        }
        memcpy(order, bp->other.at, (size_t)m * sizeof *order);
    }
    return m;
}

carom_status crm_sweep_pairs(carom_broadphase *bp, int n, const carom_box *boxes)
{
    carom_status e = crm_ints_reserve(bp, &bp->order, n + 1);
    if (!e) e = crm_ints_reserve(bp, &bp->other, n + 1);
    if (!e) e = crm_boxes_reserve(bp, &bp->sorted, n);
    if (e) return e;
    bp->stats.method = CAROM_SORT_AND_SWEEP;
    bp->stats.n_large = 0;
    bp->stats.n_tests = 0;
    const int along_y = pick_axis(n, boxes);
    const int m = sort_boxes(bp, n, boxes, along_y);
    carom_box *sorted = bp->sorted.at;
    for (int i = 0; i < m; i++) sorted[i] = boxes[bp->order.at[i]];
    for (int i = 0; i < m; i++) {
        const double end = upper(&sorted[i], along_y);
        int j = i + 1;
        for (; j < m && lower(&sorted[j], along_y) <= end; j++) {
            if (!crm_box_overlaps(&sorted[i], &sorted[j])) continue;
            e = crm_pair_add(bp, bp->order.at[i], bp->order.at[j]);
            if (e) return e;
        }
        bp->stats.n_tests += j - i - 1;
    }
    return CAROM_OK;
}
