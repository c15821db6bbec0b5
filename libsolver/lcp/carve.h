/* carve.h: arrays cut out of one block, sized by a first pass without a block. */
#ifndef CRM_LCP_CARVE_H
#define CRM_LCP_CARVE_H

#include <stddef.h>

typedef struct crm_carver {
    char *base;  /* NULL: only counts */
    size_t size; /* of an element */
    size_t used; /* elements */
} crm_carver;

static inline crm_carver crm_carver_at(void *block, size_t size)
{
    const crm_carver c = {(char *)block, size, 0};
    return c;
}

/* The next n elements; NULL while counting. */
static inline void *crm_carve(crm_carver *c, size_t n)
{
    void *p = c->base ? c->base + c->used * c->size : NULL;
    c->used += n;
    return p;
}

#endif
