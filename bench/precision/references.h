/* references.h: ends of scenes by equations of motion of their own, without carom. */
#ifndef BENCH_PRECISION_REFERENCES_H
#define BENCH_PRECISION_REFERENCES_H

#include "problems.h"

/* The pose at the end in p->exact, and p->resolved: a thousand times what two refinements differ
 * by.  Nothing where exact is a closed form. */
void find_reference(problem *p);
#endif
