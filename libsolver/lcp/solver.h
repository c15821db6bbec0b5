/* solver.h: what a carom_lcp holds; shared by the files of lcp/. */
#ifndef CRM_LCP_SOLVER_H
#define CRM_LCP_SOLVER_H

#include "libgeom/base/memory.h"
#include "libsolver/lcp/certify.h"
#include "libsolver/lcp/kkt.h"
#include "libsolver/lcp/residual.h"
#include "libsolver/lcp/scale.h"

/* A point in scaled coordinates: u = (x, z, y) in one array, and s. */
typedef struct crm_iterate {
    double *u; /* n */
    double *s; /* n_ineq */
} crm_iterate;

struct carom_lcp {
    crm_memory memory;
    carom_lcp_settings settings;
    int *ints;
    size_t n_ints;
    double *reals;
    size_t n_reals;

    carom_lcp_problem scaled;  /* pattern and scaled numbers, both ours */
    carom_lcp_gradient number; /* the numbers of `scaled`, writable */
    crm_scale scale;
    crm_kkt kkt;
    crm_certifier certifier; /* zero unless settings.certify */

    const carom_lcp_problem *problem; /* the caller's, during a call */
    crm_iterate now;
    crm_iterate best;     /* of all that was offered */
    double best_residual; /* in the caller's numbers; HUGE_VAL: none yet */
    crm_iterate lead;     /* best of the present start, where polishing begins */
    double lead_residual;
    carom_lcp_stats stats;

    carom_lcp_point plain; /* a point in the caller's coordinates */
    crm_residual_work work;
    double *w;      /* n_ineq: row weights of kkt.h */
    double *v;      /* n_ineq */
    double *rhs;    /* n */
    double *res;    /* n: (r_x, r_z, r_y) */
    double *du;     /* n: direction; scratch of polish and derivatives */
    double *ds;     /* n_ineq */
    double *target; /* n_ineq: s z - sigma mu + corrector */
};

/* The parts of an iterate as a point. */
carom_lcp_point crm_iterate_point(const carom_lcp *l, crm_iterate it);
void crm_iterate_copy(const carom_lcp *l, crm_iterate from, crm_iterate to);
/* Natural residual of an iterate in the caller's numbers; keeps it as `best` and as `lead` when it
 * is better than those. */
double crm_offer(carom_lcp *l, crm_iterate it);

/* Predictor-corrector interior point from start number `start` (0: Mattingley and Boyd); offers
 * every iterate and leaves the last in l->now.  docs/math/equations.md (9). */
carom_status crm_interior_run(carom_lcp *l, int start);
int crm_interior_starts(void);

/* Active sets from l->lead: solves with s = 0 or z = 0 per pair, exchanges what is violated. */
carom_status crm_polish_run(carom_lcp *l);

/* CAROM_OK when p fits the pattern of l, its numbers are finite and M is symmetric; else the status
 * to return. */
carom_status crm_lcp_check(carom_lcp *l, const carom_lcp_problem *p);
/* 1 when `at` has the arrays that p needs. */
int crm_point_given(const carom_lcp_problem *p, const carom_lcp_point *at);
/* Scales p into l->scaled and makes it l->problem. */
void crm_lcp_load(carom_lcp *l, const carom_lcp_problem *p);

#endif
