#include "io/memory.h"

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

void crm_no_memory(void)
{
    fputs("carom: out of memory\n", stderr);
    exit(2);
}

void *crm_resize(void *old, size_t n, size_t size)
{
    const size_t bytes = n > 0 && size > 0 ? n * size : 1;
    void *p = size > 0 && n > SIZE_MAX / 2 / size ? NULL : realloc(old, bytes);
    if (!p) crm_no_memory();
    return p;
}
