#include "libsolver/lcp/entries.h"

#include <stddef.h>

void crm_entries_put(crm_entries *e, int row, int col)
{
    if (e->row) {
        e->row[e->n] = row;
        e->col[e->n] = col;
    }
    e->n++;
}

void crm_entries_block(crm_entries *e, const carom_sparse *a, int n_cols, int row0, int col0,
                       int transposed)
{
    for (int j = 0; a->col && j < n_cols; j++)
        for (int p = a->col[j]; p < a->col[j + 1]; p++) {
            const int i = a->row[p];
            crm_entries_put(e, row0 + (transposed ? j : i), col0 + (transposed ? i : j));
        }
}

void crm_entries_diagonal(crm_entries *e, int n, int row0, int col0)
{
    for (int i = 0; i < n; i++) crm_entries_put(e, row0 + i, col0 + i);
}

void crm_entries_compress(const crm_entries *e, int n_cols, int *col, int *row, int *map)
{
    for (int j = 0; j <= n_cols; j++) col[j] = 0;
    for (int k = 0; k < e->n; k++) col[e->col[k] + 1]++;
    for (int j = 0; j < n_cols; j++) col[j + 1] += col[j];
    for (int k = 0; k < e->n; k++) {
        map[k] = col[e->col[k]]++;
        row[map[k]] = e->row[k];
    }
    for (int j = n_cols; j > 0; j--) col[j] = col[j - 1];
    col[0] = 0;
}
