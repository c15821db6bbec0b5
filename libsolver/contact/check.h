/* check.h: is a contact problem well formed? */
#ifndef CRM_CONTACT_CHECK_H
#define CRM_CONTACT_CHECK_H

#include "carom/contact.h"

/* Largest count, so that 6 numbers per item stay within int. */
#define CRM_MAX_COUNT (1 << 27)

/* CAROM_E_ARGUMENT: a count, body index or number out of range, or an array missing;
 * CAROM_E_CAPACITY: a count above CRM_MAX_COUNT. */
carom_status crm_contact_check(const carom_contact_problem *p);

/* CAROM_E_ARGUMENT: an array of the solution is missing. */
carom_status crm_solution_check(const carom_contact_problem *p, const carom_contact_solution *x);

/* No mode of a solution is out of range. */
int crm_modes_valid(const carom_contact_problem *p, const unsigned char *mode);

#endif
