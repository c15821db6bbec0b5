#include "alloc_fail.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

/* Room for the size in front of each block; 32 keeps the block aligned for any type. */
enum { HEADER = 32 };

alloc_fail alloc_fail_at(long k)
{
    alloc_fail a = {0};
    a.fail_at = k;
    return a;
}

alloc_fail alloc_fail_never(void)
{
    return alloc_fail_at(-1);
}

static void *take(void *user, size_t bytes)
{
    alloc_fail *a = user;
    const long call = a->n_calls++;
    char *block = NULL;
    if ((a->fail_at < 0 || call < a->fail_at) && bytes <= SIZE_MAX - HEADER)
        block = malloc(HEADER + bytes);
    if (!block) {
        a->n_failed++;
        return NULL;
    }
    memcpy(block, &bytes, sizeof bytes);
    memset(block + HEADER, 0xA5, bytes); /* a reader of fresh memory gets garbage */
    a->n_live++;
    a->live += bytes;
    return block + HEADER;
}

static void give(void *user, void *memory, size_t bytes)
{
    alloc_fail *a = user;
    size_t requested;
    if (!memory) return;
    char *block = (char *)memory - HEADER;
    memcpy(&requested, block, sizeof requested);
    if (requested != bytes) a->n_bad_sizes++;
    a->n_live--;
    a->live -= requested;
    free(block);
}

carom_allocator alloc_fail_allocator(alloc_fail *a)
{
    const carom_allocator from = {take, give, a};
    return from;
}
