#include "carom/base.h"

#include <stdlib.h>

const char *carom_status_text(carom_status status)
{
    switch (status) {
#define CASE(name, value, text)                                                                    \
    case name: return text;
        CAROM_STATUS_TABLE(CASE)
#undef CASE
    }
    return "unknown status";
}

const char *carom_status_name(carom_status status)
{
    switch (status) {
#define CASE(name, value, text)                                                                    \
    case name: return #name;
        CAROM_STATUS_TABLE(CASE)
#undef CASE
    }
    return "unknown";
}

const char *carom_version(void)
{
    return CAROM_VERSION;
}

static void *heap_allocate(void *user, size_t bytes)
{
    (void)user;
    return malloc(bytes);
}

static void heap_release(void *user, void *memory, size_t bytes)
{
    (void)user;
    (void)bytes;
    free(memory);
}

carom_allocator carom_allocator_default(void)
{
    const carom_allocator a = {heap_allocate, heap_release, NULL};
    return a;
}
