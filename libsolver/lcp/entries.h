/* entries.h: block matrices as lists of (row, column), and their compressed columns. */
#ifndef CRM_LCP_ENTRIES_H
#define CRM_LCP_ENTRIES_H

#include "carom/lcp.h"

/* In order of appearance; the caller's arrays; row NULL: entries are only counted. */
typedef struct crm_entries {
    int *row;
    int *col;
    int n;
} crm_entries;

void crm_entries_put(crm_entries *e, int row, int col);
/* The block a of n_cols columns at (row0, col0), or its transpose there. */
void crm_entries_block(crm_entries *e, const carom_sparse *a, int n_cols, int row0, int col0,
                       int transposed);
/* n entries down the diagonal from (row0, col0). */
void crm_entries_diagonal(crm_entries *e, int n, int row0, int col0);

/* Compressed columns: col of n_cols + 1, row of e->n, map[k] the place of entry k.  Entries of a
 * column keep their order; nothing is merged. */
void crm_entries_compress(const crm_entries *e, int n_cols, int *col, int *row, int *map);

#endif
