#include "budget.h"

#include <stdlib.h>

int crm_budget_take(crm_budget *budget, size_t bytes)
{
    for (crm_budget *b = budget; b; b = b->parent) {
        const size_t held = __atomic_add_fetch(&b->held, bytes, __ATOMIC_RELAXED);
        if (held >= bytes && held <= b->limit) continue;
        for (crm_budget *undo = budget;; undo = undo->parent) {
            __atomic_sub_fetch(&undo->held, bytes, __ATOMIC_RELAXED);
            if (undo == b) return 0;
        }
    }
    return 1;
}

void crm_budget_give(crm_budget *budget, size_t bytes)
{
    for (crm_budget *b = budget; b; b = b->parent) {
        __atomic_sub_fetch(&b->held, bytes, __ATOMIC_RELAXED);
    }
}

static void *allocate(void *user, size_t bytes)
{
    if (!crm_budget_take(user, bytes)) return NULL;
    void *p = malloc(bytes ? bytes : 1);
    if (!p) crm_budget_give(user, bytes);
    return p;
}

static void release(void *user, void *memory, size_t bytes)
{
    if (!memory) return;
    crm_budget_give(user, bytes);
    free(memory);
}

carom_allocator crm_budget_allocator(crm_budget *budget)
{
    const carom_allocator a = {allocate, release, budget};
    return a;
}
