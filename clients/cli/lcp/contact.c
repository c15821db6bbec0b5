/* A problem file as a carom_contact_problem: rows of two bodies, u = -q/M. */
#include "io/memory.h"
#include "io/progress.h"
#include "lcp/file.h"

#include <stdlib.h>
#include <string.h>

typedef struct arrays {
    double *numbers; /* owns inv_mass, u, jn, jt, je */
    double *inv_mass, *u, *jn, *jt, *je;
    int *contact_body, *joint_body; /* contact_body owns both */
} arrays;

/* Which half of a row (0: A, 1: B) belongs to the body; -1: both are taken. */
static int find_half(int *pair, int body)
{
    for (int h = 0; h < 2; h++) {
        if (pair[h] == body) return h;
    }
    for (int h = 0; h < 2; h++) {
        if (pair[h] >= 0) continue;
        pair[h] = body;
        return h;
    }
    return -1;
}

/* Triplets into rows of 6; 0: a row touches more than two bodies. */
static int place_rows(const crm_triplets *m, int *pairs, double *rows)
{
    for (int k = 0; k < m->count; k++) {
        const int i = m->i[k];
        const int half = find_half(&pairs[2 * i], m->j[k] / 3);
        if (half < 0) return 0;
        rows[6 * i + 3 * half + m->j[k] % 3] += m->x[k];
    }
    return 1;
}

static arrays make_arrays(const crm_lcp *lcp)
{
    const size_t nb = 3 * (size_t)lcp->n_bodies;
    const size_t nc = (size_t)lcp->n_contacts;
    const size_t ne = (size_t)lcp->n_joint_rows;
    const size_t n = 2 * nb + 12 * nc + 6 * ne;
    arrays a;
    a.numbers = crm_resize(NULL, n, sizeof(double));
    memset(a.numbers, 0, n * sizeof(double));
    a.inv_mass = a.numbers;
    a.u = a.inv_mass + nb;
    a.jn = a.u + nb;
    a.jt = a.jn + 6 * nc;
    a.je = a.jt + 6 * nc;
    a.contact_body = crm_resize(NULL, 2 * (nc + ne), sizeof(int));
    for (size_t k = 0; k < 2 * (nc + ne); k++) a.contact_body[k] = -1;
    a.joint_body = a.contact_body + 2 * nc;
    for (size_t k = 0; k < nb; k++) {
        a.inv_mass[k] = 1 / lcp->mass[k];
        a.u[k] = -lcp->q[k] / lcp->mass[k];
    }
    return a;
}

int crm_lcp_contact(const crm_lcp *lcp, carom_contact_solver *solver, carom_contact_solution *x,
                    carom_contact_stats *stats, double *seconds)
{
    arrays a = make_arrays(lcp);
    const int fits = place_rows(&lcp->jn, a.contact_body, a.jn) &&
                     place_rows(&lcp->jt, a.contact_body, a.jt) &&
                     place_rows(&lcp->je, a.joint_body, a.je);
    if (fits) {
        carom_contact_problem p;
        memset(&p, 0, sizeof p);
        p.n_bodies = lcp->n_bodies;
        p.n_contacts = lcp->n_contacts;
        p.n_joint_rows = lcp->n_joint_rows;
        p.inv_mass = a.inv_mass;
        p.u = a.u;
        p.contact_body = a.contact_body;
        p.jn = a.jn;
        p.jt = a.jt;
        p.mu = lcp->mu;
        p.cn = lcp->c;
        p.joint_body = a.joint_body;
        p.je = a.je;
        const double start = crm_clock();
        stats->status = carom_contact_solve(solver, &p, 0, x, stats);
        *seconds = crm_clock() - start;
    }
    free(a.numbers);
    free(a.contact_body);
    return fits;
}
