/* ladder.h: the methods tried on an island, docs/contact.md.  Each improves s->best and returns
 * whether it is accepted. */
#ifndef CRM_CONTACT_LADDER_H
#define CRM_CONTACT_LADDER_H

#include "libsolver/contact/island.h"

/* Contacts from which on an island is large: its guess is followed further, and the interior point
 * crosses over. */
enum { CRM_MANY = 16 };

/* Rounds of {solve at the modes, natural map}, from s->mode and s->x. */
int crm_active_set(crm_island *s, int rounds);
/* Solves the equations of s->mode, starting from s->x, in `passes` proximal passes at most. */
void crm_solve_modes(crm_island *s, int passes);
/* Passes that leave rounding alone; after CRM_PATIENCE of them, contraction by less than CRM_SLOW
 * takes the tight compliance. */
enum { CRM_PASSES = 12, CRM_PATIENCE = 2 };
#define CRM_SLOW 0.1
/* Compliance of active rows in unit scale, the proximal term [1]. */
#define CRM_COMPLIANCE       1e-10
#define CRM_COMPLIANCE_TIGHT 1e-13
/* Responses of the equations of s->mode, with this compliance. */
crm_response crm_mode_response(const crm_island *s, int k, double compliance);
void crm_set_responses(crm_island *s, double compliance);
/* Sign of the slip force of a mode, 0 when there is none. */
double crm_slip_sign(unsigned char mode);
/* d l_t / d (mu) at fixed velocities, over l_n: that sign, and on the central path what lies
 * between. */
double crm_friction_share(unsigned char mode, double mu, double ln, double lt);
/* Responses of contacts on the central path are kept in slack[0 .. 2]: nn, tn, tt. */
enum { CRM_SMOOTH_NN, CRM_SMOOTH_TN, CRM_SMOOTH_TT };
/* ... from their impulses s->x.n, s->x.t and s->kappa. */
void crm_set_smooth_responses(crm_island *s);
/* V' q of contact k, V the inverse of such a response; and V l. */
crm_response crm_smooth_compliance(const crm_island *s, int k);
/* s->mode <- natural map at s->x. */
void crm_modes_at(crm_island *s);

/* Start of the interior point. */
typedef struct crm_interior_start {
    double fraction; /* of the way to the boundary */
    double shift;    /* positive: start from s->x, moved inside by so much; else from ... */
    double ln;       /* ... this l_n of every contact */
    double slack;    /* and this a */
    double spread;   /* standard deviation of both in logarithm; 0: none */
    unsigned long long seed;
} crm_interior_start;

/* Condensed Mehrotra interior point; leaves its best point in s->x. */
int crm_interior_point(crm_island *s, crm_interior_start start);

/* From the solution s->x to the point where all products are kappa; 1: reached. */
int crm_central_path(crm_island *s, double kappa);

/* Projected Gauss-Seidel over contacts and joint groups, from s->x (with z = J' l), where it leaves
 * its point and the natural modes. */
void crm_sweeps(crm_island *s, int n_sweeps);

/* Impulses of s->x into their cones, with the motion w = J' l that they make. */
void crm_into_cones(crm_island *s);

/* From s->x, made the exact solution of a problem with other c, to the solution of this one by
 * pivots; for points near a solution. */
int crm_crossover(crm_island *s, int max_pivots, unsigned long long seed);

/* Newton steps with damping of its own for each contact, between sweeps, from s->best. */
int crm_damped(crm_island *s, int steps);

/* Lemke's method on the natural map with sparse factors: contacts pushed apart by tau, from where
 * all are open to tau = 0.  1: reached, up to a compliance; the point and its modes are in s->x. */
int crm_lemke(crm_island *s, int max_pivots, unsigned long long seed);

/* Looks for multipliers y_n >= 0, y_e with J' y = 0 and c' y < 0: no motion is admissible (Farkas).
 * Returns 1 when found; y is in s->x. */
int crm_farkas(crm_island *s);

/* Climbs until accepted.  s->mode and s->x: the guess, when use_guess.  CAROM_OK: accepted;
 * CAROM_E_INFEASIBLE: s->x has the certificate; CAROM_E_NO_SOLUTION: s->best is not accepted. */
carom_status crm_ladder_climb(crm_island *s, int use_guess, carom_contact_stage *stage,
                              double *unpolished);

/* Uniform in (0, 1), and normal: splitmix64. */
double crm_uniform(unsigned long long *state);
double crm_normal(unsigned long long *state);

#endif
