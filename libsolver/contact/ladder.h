/* ladder.h: the methods tried on an island, docs/math/equations.md section 3.  Each improves
 * s->best and returns whether it is accepted. */
#ifndef CRM_CONTACT_LADDER_H
#define CRM_CONTACT_LADDER_H

#include "libsolver/contact/island.h"

/* Rounds of {solve at the modes, natural map}, from s->mode and s->x. */
int crm_active_set(crm_island *s, int rounds);
/* Solves the equations of s->mode, starting from s->x, in `passes` proximal passes at most. */
void crm_solve_modes(crm_island *s, int passes);
/* Responses of the equations of s->mode, with this compliance. */
void crm_set_responses(crm_island *s, double compliance);
/* Sign of the slip force of a mode, 0 when there is none. */
double crm_slip_sign(unsigned char mode);
/* s->mode <- natural map at s->x. */
void crm_modes_at(crm_island *s);

/* Start of the interior point. */
typedef struct crm_interior_start {
    double ln;       /* l_n of every contact */
    double slack;    /* a of every contact */
    double fraction; /* of the way to the boundary */
    double spread;   /* standard deviation of ln and slack in logarithm; 0: none */
    unsigned long long seed;
} crm_interior_start;

/* Condensed Mehrotra interior point; leaves its best point in s->x. */
int crm_interior_point(crm_island *s, crm_interior_start start);

/* Projected Gauss-Seidel over contacts and joint groups; leaves its point in s->x. */
void crm_sweeps(crm_island *s, int n_sweeps);

/* Memory of crm_lemke: its tableau and basis, carved from an arena (which may only measure). */
typedef struct crm_lemke_work {
    int n; /* m + 3 f for m contacts, f of them with friction */
    double *tableau;
    double *covering;
    int *basis;
    int *cone; /* contacts with friction */
} crm_lemke_work;
crm_lemke_work crm_lemke_layout(const crm_island *s, crm_arena *arena);
/* Lemke's method on the four-variable form (7) with joints eliminated; `regular` is added to the
 * diagonal, seed 0 takes the covering vector of ones.  Returns 1 when it ended in a solution, left
 * in s->x with its natural modes. */
int crm_lemke(crm_island *s, double regular, unsigned long long seed, crm_lemke_work *k);

/* Looks for multipliers y_n >= 0, y_e with J' y = 0 and c' y < 0: no motion is admissible (Farkas).
 * Returns 1 when found; y is in s->x. */
int crm_farkas(crm_island *s);

/* Allocates for Lemke when it comes to that. */
typedef struct crm_ladder {
    crm_memory *memory;
    crm_arena *arena;
    int max_restarts;
    double inexact; /* a point this good ends the restarts early */
} crm_ladder;

/* Climbs until accepted.  s->mode and s->x: the guess, when use_guess.  CAROM_OK: accepted;
 * CAROM_E_INFEASIBLE: s->x has the certificate; CAROM_E_NO_SOLUTION: s->best is not accepted;
 * CAROM_E_MEMORY. */
carom_status crm_ladder_climb(const crm_ladder *l, crm_island *s, int use_guess,
                              carom_contact_stage *stage, double *unpolished);

/* Uniform in (0, 1), and normal: splitmix64. */
double crm_uniform(unsigned long long *state);
double crm_normal(unsigned long long *state);

#endif
