/* contact_case.h: contact problems that own their arrays: built by hand, from files, by a seed; and
 * their residual, docs/contact.md, written apart from the library in long double. */
#ifndef SUPPORT_CONTACT_CASE_H
#define SUPPORT_CONTACT_CASE_H

#include "carom/contact.h"
#include "problem_file.h"

typedef struct contact_case {
    carom_contact_problem p; /* a view of the arrays below */
    carom_contact_solution x;
    double *inv_mass;
    double *u;
    int *contact_body;
    double *jn;
    double *jt;
    double *mu;
    double *cn;
    double *ct;
    int *joint_body;
    double *je;
    double *ce;
    void *block;
    int max_contacts;
    int max_rows;
} contact_case;

/* Bodies with zeroed numbers, room for so many contacts and joint rows.  Ends the test program when
 * memory is exhausted. */
contact_case contact_case_new(int n_bodies, int max_contacts, int max_rows);
void contact_case_free(contact_case *c);
contact_case contact_case_copy(const contact_case *c);

void contact_case_body(contact_case *c, int body, double mass, double inertia, double omega,
                       double vx, double vy);
/* Contact with lever arms ra, rb and normal n from A to B; returns its index. */
int contact_case_contact(contact_case *c, int a, int b, const double *ra, const double *rb,
                         const double *n, double mu, double cn);
/* Hinge: two rows; returns the first. */
int contact_case_hinge(contact_case *c, int a, int b, const double *ra, const double *rb);

/* -1 when a row of the file involves more than two bodies. */
int contact_case_from_file(const problem_file *f, contact_case *c);

/* The same problem in the form of a file, c_t = c_e = 0 and W > 0 required; free it with
 * contact_case_free_file (problem_file.c needs jansson, this does not). */
problem_file contact_case_to_file(const contact_case *c);
void contact_case_free_file(problem_file *f);

/* The residual of x: the four parts of docs/math/equations.md (22), largest first. */
double contact_case_residual(const contact_case *c);

#endif
