/* memory.h: memory of the command line. */
#ifndef CRM_CLI_MEMORY_H
#define CRM_CLI_MEMORY_H

#include <stddef.h>

/* Says that memory ran out and ends with exit code 2. */
void crm_no_memory(void);
/* realloc to n elements; or crm_no_memory. */
void *crm_resize(void *old, size_t n, size_t size);

#endif
