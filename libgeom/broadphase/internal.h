/* internal.h: the broadphase object, shared by its methods. */
#ifndef CRM_BROADPHASE_INTERNAL_H
#define CRM_BROADPHASE_INTERNAL_H

#include "base/memory.h"
#include "carom/broadphase.h"

typedef struct crm_ints {
    int *at;
    int n_max;
} crm_ints;

typedef struct crm_keys {
    uint64_t *at;
    int n_max;
} crm_keys;

typedef struct crm_boxes {
    carom_box *at;
    int n_max;
} crm_boxes;

struct carom_broadphase {
    crm_memory memory;
    carom_broadphase_stats stats;
    carom_pair *pairs;
    int n_pairs;
    int pairs_max;
    carom_pair *scratch; /* of the pairs' sort */
    int scratch_max;
    crm_ints order; /* of the boxes, and the scratch of its sort */
    crm_ints other;
    crm_ints large;
    crm_keys key;
    crm_keys other_key;
    crm_boxes sorted;
};

/* Makes room; contents are kept. */
carom_status crm_ints_reserve(carom_broadphase *bp, crm_ints *p, int need);
carom_status crm_keys_reserve(carom_broadphase *bp, crm_keys *p, int need);
carom_status crm_boxes_reserve(carom_broadphase *bp, crm_boxes *p, int need);

/* Appends the pair (i, j) in the order of the indices. */
carom_status crm_pair_add(carom_broadphase *bp, int i, int j);

static inline int crm_box_overlaps(const carom_box *a, const carom_box *b)
{
    return (a->lower.x <= b->upper.x) & (b->lower.x <= a->upper.x) & (a->lower.y <= b->upper.y) &
           (b->lower.y <= a->upper.y);
}

/* NaN anywhere makes it empty. */
static inline int crm_box_is_empty(const carom_box *a)
{
    return !(a->lower.x <= a->upper.x && a->lower.y <= a->upper.y);
}

/* The pairs, in any order.  Grid: *done = 0 when it does not fit the boxes; no pairs then. */
carom_status crm_grid_pairs(carom_broadphase *bp, int n, const carom_box *boxes, int *done);
carom_status crm_sweep_pairs(carom_broadphase *bp, int n, const carom_box *boxes);

#endif
