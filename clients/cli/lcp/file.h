/* file.h: a contact problem file, format of tests/data/lcp. */
#ifndef CRM_LCP_FILE_H
#define CRM_LCP_FILE_H

#include "carom/contact.h"
#include "clients/c/scene/json.h"

/* A sparse matrix as the file has it; entries that stand twice add up. */
typedef struct crm_triplets {
    int n_rows;
    int count;
    int *i;
    int *j;
    double *x;
} crm_triplets;

/* M v - jn' lam_n - jt' lam_t - je' lam_e + q = 0, M diagonal, three numbers per body. */
typedef struct crm_lcp {
    char *name;
    int n_bodies;
    int n_contacts;
    int n_joint_rows;
    double *mass; /* 3 n_bodies: diagonal of M */
    double *q;    /* 3 n_bodies */
    double *mu;   /* n_contacts */
    double *c;    /* n_contacts */
    crm_triplets jn, jt, je;
} crm_lcp;

/* 1, or 0 with the faults noted; free in any case. */
int crm_lcp_read(crm_problems *problems, crm_lcp *lcp);
void crm_lcp_free(crm_lcp *lcp);

/* Room for a solution of the problem, zero. */
carom_contact_solution crm_lcp_room(const crm_lcp *lcp);
void crm_lcp_room_free(carom_contact_solution *x);

/* Solves by carom_contact_solve.  0: a row touches more than two bodies; that solver has no such
 * rows. */
int crm_lcp_contact(const crm_lcp *lcp, carom_contact_solver *solver, carom_contact_solution *x,
                    carom_contact_stats *stats, double *seconds);

/* Solves by carom_lcp_solve, in the four-variable form of docs/math/equations.md (7)-(8): slower,
 * any rows.  The residual is carom_lcp_residual.  In a build without it (CAROM_WITH_KLU=OFF) the
 * status is CAROM_E_NO_SOLUTION. */
void crm_lcp_general(const crm_lcp *lcp, carom_contact_solution *x, carom_contact_stats *stats,
                     double *seconds);

#endif
