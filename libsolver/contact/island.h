/* island.h: one island of the contact problem, scaled, docs/math/equations.md (21), as increments.
 *
 *   w = J_n' l_n + J_t' l_t + J_e' l_e           v = u + V sqrt(W) w,  rows J sqrt(W) to unit norm
 *   0 <= l_n _|_ J_n w + c_n >= 0                c: what the row sees at w = 0, J u + c, scaled
 *   |l_t| <= mu l_n,  J_t w + c_t opposes it     mu: mu D_n / D_t; 0: no tangential row
 *   J_e w + c_e = 0
 *
 * Motion with W = 0 and the motion u common to a pair are in c alone, so neither costs digits. */
#ifndef CRM_CONTACT_ISLAND_H
#define CRM_CONTACT_ISLAND_H

#include "libsolver/contact/block/block_lu.h"

#include <float.h>

/* A defect of (4) below this is rounding of the velocity scale; the result is freed of it [1]. */
#define CRM_ROUNDING (4 * DBL_EPSILON)

/* A scaled contact.  A row of zeros with c = 1 stands for a prescribed normal motion. */
typedef struct crm_contact {
    double n[6]; /* node a, then node b */
    double t[6];
    double mu;
    double cn;
    double ct;
    double residual_n; /* weight of its row in the residual (22) */
    double residual_t;
    int a; /* node or -1 */
    int b;
} crm_contact;

/* A scaled joint group; missing and prescribed rows are zero. */
typedef struct crm_group {
    double j[CRM_GROUP_ROWS][6];    /* along which impulses act */
    double left[CRM_GROUP_ROWS][6]; /* that hold; j but for Newton's method on positions */
    double c[CRM_GROUP_ROWS];
    double residual[CRM_GROUP_ROWS];
    int n; /* rows, without missing ones */
    int a;
    int b;
} crm_group;

/* A vector of the full system. */
typedef struct crm_vec {
    double *z; /* 3 (nb + ng): w per node, then multipliers l_e per group */
    double *n; /* nc: l_n */
    double *t; /* nc: l_t */
} crm_vec;

/* Response of a contact: (l_n, l_t) = W ((r_n, r_t) - (J_n, J_t) w),  W = [nn 0; tn tt]. */
typedef struct crm_response {
    double nn;
    double tn;
    double tt;
} crm_response;

/* What the factors of an island were made of.  A matrix that comes again, as when only the
 * right-hand sides of a problem change, is not factored again; the factors are the same bits. */
enum { CRM_KEY_ROW = 12, CRM_KEY_GROUP = 12 * CRM_GROUP_ROWS };
typedef struct crm_factor_key {
    int valid;
    double shift;
    double delta;
} crm_factor_key;

enum { CRM_N_VECTORS = 11, CRM_N_SLACKS = 19 };

/* Numbers per contact of a path's work: so many columns of two, and two more, ladder/path.c. */
enum { CRM_PATH_COLUMNS = 32, CRM_PATH_WORK = 2 * CRM_PATH_COLUMNS + 4 };

typedef struct crm_island {
    int nb;
    int nc;
    int ng;
    const crm_contact *contact;
    const crm_group *group;
    const double *free; /* 3 nb: u / (V sqrt(W)); 0 where W = 0 */
    const int *contact_target;
    const int *group_target;
    crm_block_lu lu;
    crm_response *response; /* nc */
    crm_factor_key *key;
    double *key_row;            /* CRM_KEY_ROW per contact: n, then t */
    crm_response *key_response; /* nc */
    double *key_group;          /* CRM_KEY_GROUP per group */
    /* Work. */
    crm_vec x;
    crm_vec best;
    crm_vec top;   /* the interior point's own best */
    crm_vec swept; /* where the sweeps ended */
    crm_vec rhs;
    crm_vec rest;
    crm_vec step;
    crm_vec way[2];
    crm_vec path[2];
    double *column;              /* CRM_PATH_WORK nc */
    unsigned char *base_mode;    /* nc: modes that a path has factored */
    double *an;                  /* nc: J_n w + c_n of the point last measured */
    double *ut;                  /* nc */
    double *slack[CRM_N_SLACKS]; /* nc each: the interior point's */
    double *size;                /* 3 nb */
    unsigned char *mode;         /* nc: carom_contact_mode */
    unsigned char *best_mode;
    double best_residual;
    int fresh;         /* an and ut belong to best */
    double compliance; /* of the last equations of modes */
    double kappa;      /* of contacts on the central path, in the island's units */
    double accept;
    double inexact; /* a point this good ends the restarts early */
    int max_iterations;
    int max_restarts;
    int brief; /* 1: no more than one interior point */
    int factorizations;
    int iterations;
    int pivots;
} crm_island;

/* Row times the bodies' parts of z; z += row' l. */
static inline double crm_dot(const double *row, int a, int b, const double *z)
{
    double s = 0;
    if (a >= 0) s = row[0] * z[3 * a] + row[1] * z[3 * a + 1] + row[2] * z[3 * a + 2];
    if (b >= 0) s += row[3] * z[3 * b] + row[4] * z[3 * b + 1] + row[5] * z[3 * b + 2];
    return s;
}

static inline void crm_add(double *z, const double *row, int a, int b, double l)
{
    for (int i = 0; a >= 0 && i < 3; i++) z[3 * a + i] += row[i] * l;
    for (int i = 0; b >= 0 && i < 3; i++) z[3 * b + i] += row[3 + i] * l;
}

void crm_vec_copy(const crm_island *s, crm_vec to, crm_vec from);
void crm_vec_zero(const crm_island *s, crm_vec x);
/* x += a y. */
void crm_vec_add(const crm_island *s, crm_vec x, double a, crm_vec y);

/* to.z (bodies) = J' l - w of x;  to.z (groups) = -(J_e w + c_e). */
void crm_island_defect(const crm_island *s, crm_vec x, double *z);

/* 3 nb: |v| + |u| + |J|' |l|, the terms of (4) in the mass metric. */
void crm_island_term_sizes(const crm_island *s, crm_vec x, double *size);
/* The residual (22) of x; leaves J w + c in an and ut.  NaN: HUGE_VAL. */
double crm_island_residual(crm_island *s, crm_vec x);

/* Natural map: the mode that (l_n, l_t, a, u) of contact k would have. */
carom_contact_mode crm_contact_mode_of(const crm_contact *c, double ln, double lt, double a,
                                       double u);

/* Keeps x, with its modes, when its residual r is the best so far.  Returns best <= accept. */
int crm_island_offer(crm_island *s, crm_vec x, double r);

/* K of the responses into the blocks: shift I on bodies, -delta on joint rows. */
void crm_island_assemble(crm_island *s, double shift, double delta);
/* Assembles and factors it. */
void crm_island_factor(crm_island *s, double shift, double delta);
/* x <- solution of [K, -J_e'; J_e, delta] x = x, and of its transpose. */
void crm_island_solve(crm_island *s, double *x);
void crm_island_solve_transposed(crm_island *s, double *x);

/* step <- solution of  z - J' l = r.z (bodies),  l = W (r - J z) per contact with the responses W
 * factored,  J_e z + delta l_e = r.z (groups). */
void crm_island_reduce(crm_island *s, crm_vec r, crm_vec step);

/* The contact has an equation along its tangent: it sticks, or is on the central path. */
static inline int crm_feels_slip(const crm_island *s, int k)
{
    return (s->mode[k] == CAROM_STICK || s->mode[k] == CAROM_SMOOTHED) && s->contact[k].mu > 0;
}

/* adjoint.c: of z - B l = 0, C z + c = 0 at s->mode: p + C' q = g, B' p = 0, with p in s->x.z and q
 * in s->x.n, s->x.t and behind the bodies, so that <g, z> = -<q, c>, to within tol of the
 * largest entry of g; `extra` passes follow the one that reached that, or rounding. */
void crm_island_adjoint(crm_island *s, const double *g, double tol, int extra);

#endif
