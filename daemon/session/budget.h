/* budget.h: memory that a session, and all sessions together, may hold. */
#ifndef CRM_BUDGET_H
#define CRM_BUDGET_H

#include "carom/base.h"

typedef struct crm_budget crm_budget;

/* Counts what is held; changed by several threads at once. */
struct crm_budget {
    size_t held;
    size_t limit;
    crm_budget *parent; /* may be NULL */
};

/* 1: `bytes` more are held, here and by the parents.  0: one of them has no room; nothing changed.
 */
int crm_budget_take(crm_budget *budget, size_t bytes);
void crm_budget_give(crm_budget *budget, size_t bytes);
/* malloc and free within the budget, which must outlive what is allocated. */
carom_allocator crm_budget_allocator(crm_budget *budget);

#endif
