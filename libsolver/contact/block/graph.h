/* graph.h: who touches whom: islands, joint groups, and the renumbering that puts each island's
 * bodies, contacts and joint groups in one piece.  Depends on body indices and on which axes have
 * an inverse mass, never on other values; kept while these stay the same. */
#ifndef CRM_CONTACT_GRAPH_H
#define CRM_CONTACT_GRAPH_H

#include "carom/contact.h"
#include "libsolver/contact/block/arena.h"

/* Rows of a joint group: consecutive rows of one pair of bodies. */
#define CRM_GROUP_ROWS 3

typedef struct crm_graph {
    crm_arena arena;
    /* Key: the problem analyzed; n_bodies -1 before the first. */
    int n_bodies;
    int n_contacts;
    int n_rows;
    int *contact_body;
    int *joint_body;
    unsigned char *axes; /* per body: bit i set when axis i has W > 0 */
    /* Counts of what is left to solve. */
    int n_islands;
    int n_nodes; /* bodies with a free axis that a row touches */
    int n_live;  /* contacts with at least one node */
    int n_groups;
    int n_fixed; /* rows without a node: prescribed motion, only checked */
    /* Islands: slices [i, i + 1) of nodes, contacts, groups. */
    int *node_ptr;
    int *contact_ptr;
    int *group_ptr;
    /* Renumbering.  Nodes are numbered within their island. */
    int *node_of;      /* body -> node, or -1 */
    int *body_of;      /* slot of a node -> body */
    int *contact_of;   /* slot -> contact */
    int *contact_node; /* 2 per slot: node or -1 */
    int *group_row;    /* slot -> first row */
    int *group_size;   /* slot -> 1 .. 3 rows */
    int *group_node;   /* 2 per slot */
} crm_graph;

/* *same = 1 when the graph is the one analyzed before; else analyzes. */
carom_status crm_graph_update(crm_memory *m, crm_graph *g, const carom_contact_problem *p,
                              int *same);
void crm_graph_free(crm_memory *m, crm_graph *g);

#endif
