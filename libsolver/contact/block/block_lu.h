/* block_lu.h: LU of the condensed contact matrix, one island at a time, in 3x3 blocks.
 *
 *   [ K    J_e'   ]     K = shift I + sum_k J_k' W_k J_k over contacts: one block per body
 *   [ J_e  -delta ]     J_e: one block row per joint group, padded to three rows
 *
 * The pattern is symmetric and fixed; values need not be.  Pivoting stays inside diagonal blocks,
 * so the order decides: AMD on the graph, each joint group directly after a body matched to it
 * (its pivot is then -J_e K_b^-1 J_e', of full rank), unmatched (loop-closing) groups last. */
#ifndef CRM_CONTACT_BLOCK_LU_H
#define CRM_CONTACT_BLOCK_LU_H

#include "libsolver/contact/block/graph.h"

/* Order and pattern of all islands; block ids of an island: its nodes, then its groups. */
typedef struct crm_block_pattern {
    crm_arena arena;
    int n;      /* blocks */
    int *place; /* block -> position in its island's elimination */
    int *lp;    /* n + 1: column j of L is li[lp[j]] .. li[lp[j + 1] - 1] */
    int *li;    /* rows below the diagonal, ascending, numbered within the island */
    int li_max;
    /* Where off-diagonal blocks go: m >= 0 block m of L (row, column); -1 - m block m of U. */
    int *contact_target; /* per contact slot: (node a, node b); unused with one node */
    int *group_target;   /* 2 per group slot: (group, node) */
} crm_block_pattern;

carom_status crm_block_analyze(crm_memory *m, crm_block_pattern *s, const crm_graph *g);
void crm_block_pattern_free(crm_memory *m, crm_block_pattern *s);

/* Elimination order of one island with blocks 0 .. n - 1, of which the first n_nodes are bodies;
 * ap, ai: neighbors of each block, without itself, without repeats. */
typedef struct crm_block_graph {
    int n;
    int n_nodes;
    const int *ap;
    const int *ai;
    const unsigned char *full; /* per node: all three axes have W > 0 */
} crm_block_graph;

/* Ints of scratch that crm_block_order needs for n blocks and nz entries of ai. */
size_t crm_block_order_scratch(int n, int nz);
/* order[k]: the k-th block to eliminate. */
void crm_block_order(const crm_block_graph *g, int *order, int *scratch);

/* Values of one island.  Blocks are 3x3, by rows.  L holds block (i, j), U block (j, i), for each
 * entry i of column j; the factors overwrite the matrix. */
typedef struct crm_block_lu {
    int n;
    const int *place;
    const int *lp;
    const int *li;
    double *l;
    double *u;
    double *d;  /* 9 n */
    int *pivot; /* 2 n */
    int *work;  /* 5 n */
    double *x;  /* 3 n */
} crm_block_lu;

/* Returns the number of pivots that had to be replaced, being zero to rounding. */
int crm_block_factor(crm_block_lu *f);
/* x <- A^-1 x and x <- A'^-1 x; x holds three numbers per block id. */
void crm_block_solve(crm_block_lu *f, double *x);
void crm_block_solve_transposed(crm_block_lu *f, double *x);

#endif
