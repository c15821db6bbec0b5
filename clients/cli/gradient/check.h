/* check.h: a gradient beside central differences of whole runs. */
#ifndef CRM_GRADIENT_CHECK_H
#define CRM_GRADIENT_CHECK_H

#include "gradient/gradient.h"

enum { CRM_CHECK_STEPS = 2 }; /* step sizes tried for each entry */

typedef struct crm_check_entry {
    crm_wrt array;
    int index;
    double step[CRM_CHECK_STEPS];
    double difference[CRM_CHECK_STEPS]; /* NaN where a run failed */
    double side[2];      /* left and right quotient of the smaller step; of first order */
    double disagreement; /* the smaller of the two, relative: see crm_check_run */
    int one_sided;       /* the parameter is at a bound: second-order one-sided differences */
    int kink;            /* the sides differ, and the gradient is that of one of them */
} crm_check_entry;

typedef struct crm_check {
    int count;
    crm_check_entry *entries; /* by array, then by index */
    int worst;                /* -1: nothing was checked */
    int interrupted;
} crm_check;

/* Checks `per_array` entries of each wanted array, chosen by a fixed seed; all when it has no more.
 * A disagreement is |gradient - difference| / max(|gradient|, |difference|, a thousandth of the
 * array's largest entry, 1e-4 max(1, |loss|)). */
void crm_check_run(crm_check *check, const crm_gradient *g, const crm_run *run,
                   const crm_loss *loss, int per_array, int quiet);
void crm_check_free(crm_check *check);

#endif
