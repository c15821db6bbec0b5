/* problems.h: scenes whose end is known. */
#ifndef BENCH_PRECISION_PROBLEMS_H
#define BENCH_PRECISION_PROBLEMS_H

#include "bench/step/scene.h"

typedef struct problem {
    const char *name;
    scene s;
    double duration; /* [s] */
    int body;        /* whose pose at the end counts */
    double reach;    /* its size: an angle counts as a way [m] */
    int closed;      /* 1: exact is a closed form; 0: it is to be found by refinement */
    double exact[3]; /* (angle, x, y) */
} problem;

enum { N_PROBLEMS = 17 };
problem make_problem(int k);
#endif
