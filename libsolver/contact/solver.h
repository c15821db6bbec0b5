/* solver.h: the state of a carom_contact_solver. */
#ifndef CRM_CONTACT_SOLVER_H
#define CRM_CONTACT_SOLVER_H

#include "libsolver/contact/system.h"

struct carom_contact_solver {
    crm_memory memory;
    carom_contact_settings settings;
    crm_graph graph;
    crm_block_pattern pattern;
    int pattern_valid;
    int system_valid; /* laid out for the pattern */
    crm_system system;
    double kappa;    /* of the last carom_contact_smooth [J] */
    double *scratch; /* solve: 6 per body; adjoint: see adjoint.c */
    int scratch_max;
    double *certificate; /* y_n, then y_e */
    int certificate_max;
    int certificate_valid;
};

/* Graph, pattern and room for the problem. */
carom_status crm_solver_prepare(carom_contact_solver *c, const carom_contact_problem *p);
/* The same after a check of the problem and of a solution with its modes. */
carom_status crm_solver_open(carom_contact_solver *c, const carom_contact_problem *p,
                             const carom_contact_solution *x);
/* The best point of every island, and what no island owns. */
void crm_solver_write(carom_contact_solver *c, const carom_contact_problem *p,
                      carom_contact_solution *x);
/* Island i as it begins, with the modes of x, and the responses of those on the central path. */
void crm_take_modes(carom_contact_solver *c, int island, const carom_contact_solution *x);
/* Room in scratch for the residual (22). */
carom_status crm_reserve_residual(carom_contact_solver *c, const carom_contact_problem *p);

#endif
