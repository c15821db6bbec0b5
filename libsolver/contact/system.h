/* system.h: the islands of a problem with their scaled values and their work, in one arena. */
#ifndef CRM_CONTACT_SYSTEM_H
#define CRM_CONTACT_SYSTEM_H

#include "libsolver/contact/island.h"

/* How an island ended. */
typedef struct crm_outcome {
    carom_status status;
    carom_contact_stage stage;
    double unpolished;
    int factorizations;
    int iterations;
    int pivots;
    int degenerate;
} crm_outcome;

typedef struct crm_system {
    crm_arena arena;
    crm_contact *contact; /* per slot, like all below */
    crm_group *group;
    double *scale_n; /* D_n: 1 / |J_n sqrt(W)|; 0: the row is not felt */
    double *scale_t;
    double *scale_e; /* 3 per group */
    double *root;    /* 3 per node: sqrt(W) */
    double *free;
    double *speed;        /* per island: velocity unit V of its variables */
    crm_outcome *outcome; /* per island */
    crm_island *island;   /* the views of all below */
    /* Work of the islands, sliced. */
    crm_response *response;
    crm_factor_key *key; /* per island */
    double *key_row;
    crm_response *key_response;
    double *key_group;
    crm_vec vec[CRM_N_VECTORS];
    double *an;
    double *ut;
    double *slack[CRM_N_SLACKS];
    double *size;
    double *column;
    unsigned char *base_mode;
    unsigned char *mode;
    unsigned char *best_mode;
    double *l;
    double *u;
    double *d;
    int *pivot;
    int *lu_work;
    double *lu_x;
} crm_system;

/* Makes room, with no factors in it; nothing is allocated when there is room already. */
carom_status crm_system_reserve(crm_memory *m, crm_system *y, const crm_graph *g,
                                const crm_block_pattern *s);
void crm_system_free(crm_memory *m, crm_system *y);

/* Gathers and scales the values of an island. */
void crm_system_gather(crm_system *y, const crm_graph *g, const carom_contact_problem *p,
                       int island);
/* An island as it begins: nothing found, nothing counted. */
crm_island *crm_system_begin(crm_system *y, int island);

/* Takes the guess of the island's modes, and of its impulses with CAROM_GUESS_IMPULSES, into
 * s->mode and s->x; impulses that are not finite are 0. */
void crm_system_read(const crm_system *y, const crm_graph *g, crm_island *s, int island,
                     const carom_contact_solution *x, int use_guess);

/* s->mode from a solution's modes; closed frictionless contacts stick. */
void crm_system_set_modes(const crm_graph *g, crm_island *s, int island, const unsigned char *mode);

/* Writes the island's best point into the entries of the solution that belong to it. */
void crm_system_write(const crm_system *y, const crm_graph *g, const carom_contact_problem *p,
                      const crm_island *s, int island, carom_contact_solution *x);

#endif
