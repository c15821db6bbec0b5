/* billiard.h: discs that fly freely and exchange their speeds, from impact to impact. */
#ifndef BENCH_PRECISION_BILLIARD_H
#define BENCH_PRECISION_BILLIARD_H

#include "problems.h"

/* The pose of p->body at the end; moved: the first disc begins 1e-18 m off, which shows how much of
 * rounding the impacts leave. */
void billiard_end(const problem *p, int moved, long double q[3]);
#endif
