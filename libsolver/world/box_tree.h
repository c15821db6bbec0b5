/* box_tree.h: a binary tree of boxes, for searches from near to far.
 *
 * Nodes are in preorder and halves are by number, so the shape of the tree follows from n alone: a
 * subtree of m leaves has 2 m - 1 nodes, its left half m / 2 leaves. */
#ifndef CRM_BOX_TREE_H
#define CRM_BOX_TREE_H

#include "base/memory.h"
#include "carom/broadphase.h"

typedef struct crm_box_tree {
    int n;
    int max_items;
    int max_nodes;
    int max_order;
    carom_box *items; /* n: filled by the caller before crm_box_tree_update */
    carom_box *nodes; /* 2 n - 1 */
    int *order;       /* n: items from the leftmost leaf on */
    int n_built;      /* n at the last build */
    double built;     /* sum of the nodes' half perimeters at the last build [m] */
} crm_box_tree;

/* Room for n items; on failure the tree is empty. */
carom_status crm_box_tree_resize(crm_memory *m, crm_box_tree *t, int n);
/* After items changed: the boxes of the nodes; a new tree when the old has become loose. */
void crm_box_tree_update(crm_box_tree *t);
void crm_box_tree_free(crm_memory *m, crm_box_tree *t);

typedef struct crm_search crm_search;
struct crm_search {
    /* Nothing inside the box comes before this; HUGE_VAL: nothing to find there. */
    double (*least)(const crm_search *s, const carom_box *box);
    /* May lower the bound.  Negative: the search ends. */
    carom_status (*visit)(crm_search *s, int item);
    double bound; /* boxes with a least above it are passed over */
    void *user;
};

carom_status crm_box_tree_search(const crm_box_tree *t, crm_search *s);

#endif
