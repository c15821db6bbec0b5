/* lcp_file.h: a contact problem file (format of tests/data/lcp) as a carom_contact_problem. */
#ifndef CRM_LCP_FILE_H
#define CRM_LCP_FILE_H

#include "carom/contact.h"
#include "clients/c/scene_json.h"

typedef struct crm_lcp {
    char *name;
    carom_contact_problem problem;   /* views of the arrays below */
    carom_contact_solution solution; /* sized, zero */
    double *numbers;                 /* owns all arrays of numbers */
    int *bodies;                     /* owns all arrays of indices */
} crm_lcp;

/* 1, or 0 with the faults noted; free in any case.  In the file M v - J' lam + q = 0, so that
 * u = -q/M; a row of J touches two bodies at most. */
int crm_lcp_read(crm_problems *problems, crm_lcp *lcp);
void crm_lcp_free(crm_lcp *lcp);

#endif
