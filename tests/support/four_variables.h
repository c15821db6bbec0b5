/* four_variables.h: a contact problem as the mixed LCP of docs/math/equations.md (7)-(8):
 * z = (l_n, l+ and l- of each contact, g), G = -[J_n; J_f; 0], m = (c, 0, 0),
 * F = -[[0,0,0], [0,0,E], [mu,-E',0]], y = -l_e. */
#ifndef SUPPORT_FOUR_VARIABLES_H
#define SUPPORT_FOUR_VARIABLES_H

#include "carom/lcp.h"
#include "problem_file.h"

typedef struct four_variables {
    carom_lcp_problem problem; /* a view of the arrays below */
    int *ints;
    double *reals;
} four_variables;

/* 0, or -1 without memory. */
int four_variables_make(const problem_file *p, four_variables *f);
void four_variables_free(four_variables *f);

#endif
