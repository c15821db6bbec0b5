/* arena.h: one block of memory, handed out front to back.  An arena without a block only measures:
 * a layout function runs twice, first to learn the size, then to place its arrays. */
#ifndef CRM_CONTACT_ARENA_H
#define CRM_CONTACT_ARENA_H

#include "libgeom/base/memory.h"

typedef struct crm_arena {
    char *base;
    size_t size;
    size_t used;
} crm_arena;

/* Room for n elements, aligned to 16 bytes, not cleared; NULL from an arena without a block. */
static inline void *crm_arena_take(crm_arena *a, size_t n, size_t size)
{
    const size_t at = a->used;
    a->used += (n * size + 15) / 16 * 16;
    return a->base ? a->base + at : NULL;
}

static inline double *crm_arena_doubles(crm_arena *a, int n)
{
    return crm_arena_take(a, (size_t)n, sizeof(double));
}

static inline int *crm_arena_ints(crm_arena *a, int n)
{
    return crm_arena_take(a, (size_t)n, sizeof(int));
}

/* Empties the arena and makes it hold `bytes`, growing by half; what it held is lost. */
static inline carom_status crm_arena_reserve(crm_memory *m, crm_arena *a, size_t bytes)
{
    a->used = 0;
    if (bytes <= a->size && a->base) return CAROM_OK;
    size_t to = a->size + a->size / 2;
    if (to < bytes) to = bytes;
    char *p = crm_new(m, to, 1);
    if (!p) return CAROM_E_MEMORY;
    crm_free(m, a->base, a->size, 1);
    a->base = p;
    a->size = to;
    return CAROM_OK;
}

static inline void crm_arena_free(crm_memory *m, crm_arena *a)
{
    crm_free(m, a->base, a->size, 1);
    a->base = NULL;
    a->size = 0;
    a->used = 0;
}

#endif
