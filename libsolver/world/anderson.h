/* anderson.h: acceleration of a fixed-point iteration x <- g(x). */
#ifndef CRM_WORLD_ANDERSON_H
#define CRM_WORLD_ANDERSON_H

#include "base/memory.h"

enum { CRM_ANDERSON_DEPTH = 8 };

/* Differences of the last iterations; zeroed before first use. */
typedef struct crm_anderson {
    int n;
    int filled; /* differences held */
    int at;     /* where the next one goes */
    int begun;  /* 1: x, f are those of the last iteration */
    double *x, *f;
    double *dx[CRM_ANDERSON_DEPTH], *df[CRM_ANDERSON_DEPTH];
    double *base[CRM_ANDERSON_DEPTH]; /* orthonormal, newest first */
    double *point, *value;            /* n each: room for the caller's x and g(x) */
    double *block;
    int max;
} crm_anderson;

/* Room for n unknowns; forgets. */
carom_status crm_anderson_start(crm_memory *m, crm_anderson *a, int n);
void crm_anderson_free(crm_memory *m, crm_anderson *a);
/* Forgets: what follows is another map. */
void crm_anderson_forget(crm_anderson *a);
/* a->value = g(a->point); moves a->point to the next iterate: the combination of the last ones
 * whose residual g(x) - x is least, were g linear, plus that residual. */
void crm_anderson_next(crm_anderson *a);

#endif
