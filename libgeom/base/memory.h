/* memory.h: allocation through a carom_allocator, overflow checked; growable arrays. */
#ifndef CRM_MEMORY_H
#define CRM_MEMORY_H

#include "carom/base.h"

#include <limits.h>
#include <stdint.h>
#include <string.h>

/* The allocator of an object, with counters: one per object that allocates. */
typedef struct crm_memory {
    carom_allocator from;
    size_t live;  /* bytes held now */
    size_t high;  /* largest live so far */
    long n_calls; /* allocations so far: constant in steady state */
} crm_memory;

static inline crm_memory crm_memory_from(const carom_allocator *a)
{
    crm_memory m;
    m.from = a ? *a : carom_allocator_default();
    m.live = 0;
    m.high = 0;
    m.n_calls = 0;
    return m;
}

/* n * size zeroed bytes, at least one; NULL when exhausted or when the product overflows. */
static inline void *crm_new(crm_memory *m, size_t n, size_t size)
{
    if (size && n > SIZE_MAX / 2 / size) return NULL;
    const size_t bytes = n * size > 0 ? n * size : 1;
    void *p = m->from.allocate(m->from.user, bytes);
    if (!p) return NULL;
    memset(p, 0, bytes);
    m->n_calls++;
    m->live += bytes;
    if (m->live > m->high) m->high = m->live;
    return p;
}

/* Gives back what crm_new(m, n, size) gave; p may be NULL. */
static inline void crm_free(crm_memory *m, void *p, size_t n, size_t size)
{
    if (!p) return;
    const size_t bytes = n * size > 0 ? n * size : 1;
    m->live -= bytes;
    m->from.release(m->from.user, p, bytes);
}

/* Makes *p (n_max elements of `size`) hold at least `need`, growing by half; contents are kept, new
 * elements are zero.  On failure *p and *n_max are unchanged. */
static inline carom_status crm_reserve(crm_memory *m, void **p, int *n_max, int need, size_t size)
{
    if (need <= *n_max) return CAROM_OK;
    int to = need < 8 ? 8 : need;
    const int half = *n_max / 2;
    if (*n_max <= INT_MAX - half && *n_max + half > to) to = *n_max + half;
    void *q = crm_new(m, (size_t)to, size);
    if (!q) return CAROM_E_MEMORY;
    if (*p) memcpy(q, *p, (size_t)*n_max * size);
    crm_free(m, *p, (size_t)*n_max, size);
    *p = q;
    *n_max = to;
    return CAROM_OK;
}

#endif
