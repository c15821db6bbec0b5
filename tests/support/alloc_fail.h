/* alloc_fail.h: an allocator that counts, checks sizes, and fails on request.
 *
 *     alloc_fail a = alloc_fail_at(k);               k-th request (from 0) and all later ones fail
 *     carom_allocator from = alloc_fail_allocator(&a);
 *     ... create with &from, destroy ...
 *     assert_int_equal(a.live, 0); assert_int_equal(a.n_bad_sizes, 0);
 */
#ifndef SUPPORT_ALLOC_FAIL_H
#define SUPPORT_ALLOC_FAIL_H

#include "carom/base.h"

typedef struct alloc_fail {
    long fail_at;     /* index of the first request that fails; negative: none fails */
    long n_calls;     /* requests so far, failed ones included */
    long n_failed;    /* requests refused */
    long n_live;      /* blocks not released */
    size_t live;      /* bytes not released */
    long n_bad_sizes; /* releases whose size differs from the request's */
} alloc_fail;

alloc_fail alloc_fail_at(long k);
/* Never fails, only counts. */
alloc_fail alloc_fail_never(void);
/* A view of *a, which must outlive it. */
carom_allocator alloc_fail_allocator(alloc_fail *a);

#endif
