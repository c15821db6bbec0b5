/* contact.h: the frictional contact problem of one step, solved to a certificate, and its adjoint.
 *
 * Unknowns: velocities v (3 per body: omega, vx, vy), per contact (l_n, l_t), per joint row l_e.
 *
 *   v = u + W (J_n' l_n + J_t' l_t + J_e' l_e)              W = diag(inverse masses)
 *   0 <= l_n  _|_  a = J_n v + c_n >= 0
 *   |l_t| <= mu l_n;  J_t v + c_t = 0 if |l_t| < mu l_n, else J_t v + c_t opposes l_t
 *   J_e v + c_e = 0
 *
 * (EQUATIONS (4)-(6), section 2.)  A body with W = 0 moves with its u whatever touches it.  Body
 * index -1 is the resting world; its coefficients are ignored.  This header knows no geometry. */
#ifndef CAROM_CONTACT_H
#define CAROM_CONTACT_H

#include "carom/base.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A view; the caller owns every array. */
typedef struct carom_contact_problem {
    int n_bodies;
    int n_contacts;
    int n_joint_rows;
    const double *inv_mass;  /* 3 n_bodies [1/(kg m^2), 1/kg, 1/kg], >= 0 */
    const double *u;         /* 3 n_bodies: velocity without contacts and joints, v + h f / m */
    const int *contact_body; /* 2 n_contacts: body A and body B of each; -1 the world */
    const double *jn;        /* 6 n_contacts: row of J_n, 3 numbers of A then 3 of B */
    const double *jt;      /* 6 n_contacts: row of J_t; a frictionless contact's row is not read */
    const double *mu;      /* n_contacts [1], >= 0 */
    const double *cn;      /* n_contacts [m/s] */
    const double *ct;      /* n_contacts [m/s], NULL: zero */
    const int *joint_body; /* 2 n_joint_rows */
    const double *je;      /* 6 n_joint_rows */
    const double *ce;      /* n_joint_rows, NULL: zero */
    const double *je_left; /* 6 n_joint_rows: rows of J_e v + c_e = 0 where they are not those along
                            * which impulses act, as in Newton's method on positions; NULL: je.
                            * For carom_contact_start, _pass, _adjoint and _tangent (a direction's
                            * je changes those that act); _solve and residuals want NULL */
} carom_contact_problem;

typedef enum carom_contact_mode {
    CAROM_SEPARATED = 0,
    CAROM_STICK = 1,      /* also: frictionless and closed */
    CAROM_SLIP_MINUS = 2, /* l_t = -mu l_n */
    CAROM_SLIP_PLUS = 3,  /* l_t = +mu l_n */
    CAROM_UNKNOWN = 4,    /* in a guess only: take the mode of the free motion */
    CAROM_SMOOTHED = 5    /* between the others: a point of carom_contact_smooth */
} carom_contact_mode;

/* The caller owns the arrays, sized by the problem. */
typedef struct carom_contact_solution {
    double *v;           /* 3 n_bodies */
    double *ln;          /* n_contacts [N s] */
    double *lt;          /* n_contacts [N s] */
    double *le;          /* n_joint_rows */
    unsigned char *mode; /* n_contacts, carom_contact_mode; on input the guess */
} carom_contact_solution;

typedef struct carom_contact_settings {
    double accept;      /* scaled natural residual of "solved" [1], 1e-10 */
    double inexact;     /* ... of "inexact" [1], 1e-6 */
    int max_iterations; /* interior point iterations per start, 60 */
    int max_restarts;   /* seeded restarts at the end of the ladder, 12; 0: nor the longer sweeps
                         * before   them, for callers that rather change the problem than wait */
    int threads; /* islands are shared among so many when there is enough of them, 1 .. 64; the
                  * result has the same bits; 1 */
} carom_contact_settings;

CAROM_API carom_contact_settings carom_contact_defaults(void);

typedef enum carom_contact_stage {
    CAROM_STAGE_NONE,           /* nothing to solve: no joint, no contact that would close */
    CAROM_STAGE_GUESS,          /* the caller's guess of modes held, or led on */
    CAROM_STAGE_FREE,           /* active set from the free motion */
    CAROM_STAGE_STICK,          /* active set from all contacts sticking */
    CAROM_STAGE_INTERIOR_POINT, /* then polished by active set */
    CAROM_STAGE_SWEEPS, /* projected Gauss-Seidel, with damped Newton steps or alone; polished */
    CAROM_STAGE_LEMKE,
    CAROM_STAGE_RESTART
} carom_contact_stage;

typedef struct carom_contact_stats {
    carom_status status;
    carom_contact_stage stage;  /* the one that gave the result */
    double residual;            /* EQUATIONS (22) of the result [1] */
    double residual_unpolished; /* before the active-set polish [1] */
    int factorizations;
    int iterations; /* interior point */
    int pivots;     /* changes of one mode along a path, with few factorizations between them */
    int degenerate; /* contacts weakly active or on the slip border within 1e-9 */
    /* What there was to solve; the rest was left out. */
    int islands;    /* groups of bodies that contacts and joints connect, solved apart */
    int bodies;     /* with a free axis, touched by a contact or joint */
    int contacts;   /* with an impulse that some body feels */
    int joint_rows; /* likewise */
} carom_contact_stats;

typedef struct carom_contact_solver carom_contact_solver;

/* settings, allocator: NULL for defaults. */
CAROM_API carom_status carom_contact_create(const carom_contact_settings *settings,
                                            const carom_allocator *allocator,
                                            carom_contact_solver **out);
CAROM_API void carom_contact_destroy(carom_contact_solver *solver);
/* Bytes held and number of allocations made so far. */
CAROM_API void carom_contact_memory(const carom_contact_solver *solver, size_t *bytes, long *calls);

/* The factors that problems of the last one's graph need, one factorization of them: a block LU. */
typedef struct carom_factor_size {
    double nonzeros; /* of L, D and U in 3x3 blocks, fill included */
    double flops;    /* additions and multiplications */
} carom_factor_size;
/* Zeros before the first problem, and without rows that some body feels. */
CAROM_API carom_factor_size carom_contact_factor_size(const carom_contact_solver *solver);

/* What carom_contact_solve may take from x as its first guess. */
typedef enum carom_contact_guess {
    CAROM_GUESS_NONE = 0,
    CAROM_GUESS_MODES = 1,    /* x->mode */
    CAROM_GUESS_IMPULSES = 2, /* also x->ln, lt, le: of many impulses that give the same motion (a
                               * box on more feet than it needs) those closest to the guess */
    CAROM_GUESS_BRIEF = 8     /* or-ed to one of these: no more than active sets and one interior
                               * point, for callers that rather change the problem than wait */
} carom_contact_guess;

/* Solves the problem.  use_guess: a carom_contact_guess.  CAROM_OK: residual <= accept.
 * CAROM_INEXACT: residual <= inexact.  CAROM_E_INFEASIBLE: no v with J_e v + c_e = 0 and
 * J_n v + c_n >= 0.  CAROM_E_NO_SOLUTION: x holds the best point found, stats its residual (the one
 * exception to "outputs untouched").  stats may be NULL.  Workspace grows and is kept. */
CAROM_API carom_status carom_contact_solve(carom_contact_solver *solver,
                                           const carom_contact_problem *problem, int use_guess,
                                           carom_contact_solution *x, carom_contact_stats *stats);

/* The equations of the modes in x->mode and nothing else: closed contacts rest in J_n v + c_n = 0,
 * whatever the sign of l_n, those that stick in J_t v + c_t = 0, those that slip have l_t = +-mu
 * l_n. For those who know the modes or search where they change.  One factorization. */
CAROM_API carom_status carom_contact_modes(carom_contact_solver *solver,
                                           const carom_contact_problem *problem,
                                           carom_contact_solution *x);

/* x->v <- u + W J'l of the impulses in x, and the solver made ready for carom_contact_pass: for
 * those whose impulses and modes are near the solution.  No factorization. */
CAROM_API carom_status carom_contact_start(carom_contact_solver *solver,
                                           const carom_contact_problem *problem,
                                           carom_contact_solution *x);

/* One pass of the proximal iteration towards the equations of the modes in x->mode, from x, right
 * after a carom_contact_solve, _modes, _start or _pass with this solver, x being its result: of the
 * problem nothing may have changed but cn, ct and ce.  v, ln, lt and le move; v - u - W J'l stays.
 * Rows that hold are then met to some 1e-10 of what they missed, also where they depend on each
 * other.  For Newton's method on what moves c: neither signs nor a residual are looked at, so end
 * with carom_contact_measure or a solve.  A back-substitution; a factorization where the solve
 * needed none: stats (may be NULL) has its factorizations, and zeros.  No check but for
 * CAROM_E_ARGUMENT before the first solve. */
CAROM_API carom_status carom_contact_pass(carom_contact_solver *solver,
                                          const carom_contact_problem *problem,
                                          carom_contact_solution *x, carom_contact_stats *stats);

/* Why the last solve ended in CAROM_E_INFEASIBLE (Farkas): yn >= 0 (n_contacts) and ye
 * (n_joint_rows) with W (J_n' yn + J_e' ye) = 0 and yn . (J_n u + c_n) + ye . (J_e u + c_e) < 0, so
 * that no impulses help.  CAROM_E_STATE after any other end. */
CAROM_API carom_status carom_contact_certificate(const carom_contact_solver *solver, double *yn,
                                                 double *ye);

/* The scaled natural residual, EQUATIONS (22), of any point: NaN in x gives HUGE_VAL, as does
 * memory exhausted (two numbers per velocity are taken from malloc for the call). */
CAROM_API double carom_contact_residual(const carom_contact_problem *problem,
                                        const carom_contact_solution *x);

/* The same with the solver's memory. */
CAROM_API double carom_contact_measure(carom_contact_solver *solver,
                                       const carom_contact_problem *problem,
                                       const carom_contact_solution *x);

/* The point of the central path at kappa [J], EQUATIONS (31), near the solution x, which it
 * replaces; modes become CAROM_SMOOTHED.  In place of complementarity, with a = J_n v + c_n and J_t
 * v + c_t = w+ - w-, l_n a = (mu l_n + l_t) w+ = (mu l_n - l_t) w- = kappa,   all six positive: v
 * is then a smooth function of the data, within O(kappa) of the solution where that has no kinks.
 * carom_contact_adjoint and _tangent at such an x, with this solver before its next
 * carom_contact_smooth, are the derivative of that function.
 * CAROM_E_NO_SOLUTION: kappa is too small (or large) for the digits of this problem; x is kept. */
CAROM_API carom_status carom_contact_smooth(carom_contact_solver *solver,
                                            const carom_contact_problem *problem, double kappa,
                                            carom_contact_solution *x);

/* Cotangents of the problem's data: same shapes as in carom_contact_problem; NULL: not wanted. */
typedef struct carom_contact_bars {
    double *inv_mass; /* u held fixed */
    double *u;
    double *jn;
    double *jt;
    double *mu;
    double *cn;
    double *ct;
    double *je;
    double *ce;
} carom_contact_bars;

/* Adjoint at a solution and its modes, EQUATIONS (30): OVERWRITES the wanted arrays of `bars` with
 * the gradient of <v_bar, v>.  One factorization and one transposed solve, with refinement, so that
 * redundant rows give the right limit.  v_bar: 3 n_bodies, may alias no output. */
CAROM_API carom_status carom_contact_adjoint(carom_contact_solver *solver,
                                             const carom_contact_problem *problem,
                                             const carom_contact_solution *x, const double *v_bar,
                                             carom_contact_bars *bars);

/* Another v_bar right after a carom_contact_adjoint, at the same problem and x, of which nothing
 * has changed, to within tol of its largest entry (at least to 1e-15): only bars->u, cn, ct and ce
 * are written.  No check, no factorization. */
CAROM_API carom_status carom_contact_adjoint_again(carom_contact_solver *solver,
                                                   const carom_contact_problem *problem,
                                                   const double *v_bar, double tol,
                                                   carom_contact_bars *bars);
/* The other bars, of W, J and mu, from bars->u, cn, ct and ce, which are not NULL and may be sums
 * of those of several v_bar: all are linear in it. */
CAROM_API carom_status carom_contact_adjoint_rest(carom_contact_solver *solver,
                                                  const carom_contact_problem *problem,
                                                  const carom_contact_solution *x,
                                                  carom_contact_bars *bars);

/* Directions of the problem's data, shapes as in carom_contact_problem; NULL: zero. */
typedef struct carom_contact_direction {
    const double *inv_mass;
    const double *u;
    const double *jn;
    const double *jt;
    const double *mu;
    const double *cn;
    const double *ct;
    const double *je;
    const double *ce;
} carom_contact_direction;

/* Forward derivative at a solution and its modes: dv (3 n_bodies) is the change of v along the
 * direction, the transpose of carom_contact_adjoint. */
CAROM_API carom_status carom_contact_tangent(carom_contact_solver *solver,
                                             const carom_contact_problem *problem,
                                             const carom_contact_solution *x,
                                             const carom_contact_direction *direction, double *dv);
/* Another direction right after a carom_contact_tangent, at the same problem and x, of which
 * nothing has changed.  No check, no factorization. */
CAROM_API carom_status carom_contact_tangent_again(carom_contact_solver *solver,
                                                   const carom_contact_problem *problem,
                                                   const carom_contact_solution *x,
                                                   const carom_contact_direction *direction,
                                                   double *dv);

#ifdef __cplusplus
}
#endif
#endif
