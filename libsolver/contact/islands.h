/* islands.h: all islands of a problem, one after the other or in threads: the same bits. */
#ifndef CRM_CONTACT_ISLANDS_H
#define CRM_CONTACT_ISLANDS_H

#include "libsolver/contact/solver.h"

enum { CRM_MAX_THREADS = 64 };

/* Solves every island, leaving its best point in the system; adds to the statistics.
 * CAROM_E_INFEASIBLE: one has no solution, the certificate is given. */
carom_status crm_islands_solve(carom_contact_solver *c, const carom_contact_problem *p,
                               int use_guess, const carom_contact_solution *x,
                               carom_contact_stats *stats);

/* Certificate y of one violated prescribed row (contacts, then joint rows), in the direction of its
 * violation.  Returns CAROM_E_INFEASIBLE, or CAROM_E_MEMORY. */
carom_status crm_give_row(carom_contact_solver *c, const carom_contact_problem *p, int row,
                          double y);

#endif
