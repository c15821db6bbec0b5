/* broadphase.h: which of many boxes overlap. */
#ifndef CAROM_BROADPHASE_H
#define CAROM_BROADPHASE_H

#include "carom/shape.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Axis-aligned box, closed: {p : lower <= p <= upper}.  Infinite sides are allowed.  A box with a
 * NaN, or with lower > upper, is empty: it overlaps nothing. */
typedef struct carom_box {
    carom_vec2 lower; /* [m] */
    carom_vec2 upper; /* [m] */
} carom_box;

/* Indices of two boxes, a < b. */
typedef struct carom_pair {
    int a;
    int b;
} carom_pair;

/* A box around a valid shape at a pose, wider than the tightest by some roundings of its largest
 * coordinate, so that the shape is inside in spite of them. */
CAROM_API carom_box carom_shape_box(const carom_shape *shape, carom_pose pose);

/* Finds pairs; keeps its memory between calls.  One object, one thread. */
typedef struct carom_broadphase carom_broadphase;

/* allocator: NULL for malloc. */
CAROM_API carom_status carom_broadphase_create(const carom_allocator *allocator,
                                               carom_broadphase **out);
CAROM_API void carom_broadphase_destroy(carom_broadphase *broadphase);

/* All pairs of boxes[n] that have a point in common, sorted by (a, b).  They depend on the boxes
 * alone, not on earlier calls.  *pairs stays valid until the next call.  Memory: O(n + pairs),
 * whatever the boxes' sizes.  CAROM_E_CAPACITY: more than INT_MAX pairs. */
CAROM_API carom_status carom_broadphase_pairs(carom_broadphase *broadphase, int n,
                                              const carom_box *boxes, int *n_pairs,
                                              const carom_pair **pairs);

/* How the pairs of the last call were found: chosen by the number of boxes and the spread of their
 * sizes; the pairs do not depend on it. */
typedef enum carom_broadphase_method {
    CAROM_ALL_PAIRS,     /* up to 64 boxes */
    CAROM_GRID,          /* cells of about the boxes' size, and a list of the few larger ones */
    CAROM_SORT_AND_SWEEP /* sizes too different for one grid */
} carom_broadphase_method;

typedef struct carom_broadphase_stats {
    carom_broadphase_method method;
    int n_large;  /* grid: boxes outside the grid */
    long n_tests; /* pairs of boxes compared */
} carom_broadphase_stats;

CAROM_API carom_broadphase_stats carom_broadphase_statistics(const carom_broadphase *broadphase);

/* Bytes held and number of allocations made so far. */
CAROM_API void carom_broadphase_memory(const carom_broadphase *broadphase, size_t *bytes,
                                       long *calls);

#ifdef __cplusplus
}
#endif
#endif
