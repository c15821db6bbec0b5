/* block.h: several arrays in one allocation: measure with base = NULL, then carve. */
#ifndef CRM_BLOCK_H
#define CRM_BLOCK_H

#include "base/memory.h"

typedef struct crm_block {
    char *base; /* NULL: measuring */
    size_t used;
} crm_block;

/* n elements of `size` bytes, aligned for doubles and pointers; NULL while measuring. */
static inline void *crm_carve(crm_block *b, size_t n, size_t size)
{
    const size_t at = b->used;
    b->used += (n * size + 15) / 16 * 16;
    return b->base ? b->base + at : NULL;
}

#endif
