/* problems.h: scenes whose end is known. */
#ifndef BENCH_PRECISION_PROBLEMS_H
#define BENCH_PRECISION_PROBLEMS_H

#include "bench/step/scene.h"

/* What gives the end of a scene: a closed form, or equations of motion of its own. */
typedef enum motion_kind { MOTION_CLOSED, MOTION_LINKS, MOTION_DISC, MOTION_ROCK } motion_kind;

typedef struct problem {
    const char *name;
    scene s;
    double duration; /* [s] */
    int body;        /* whose pose at the end counts */
    double reach;    /* its size: an angle counts as a way [m] */
    motion_kind motion;
    double exact[3]; /* (angle, x, y) */
    double resolved; /* errors below this say nothing [m] */
    int rests;       /* 1: the error is the largest over time, not that of the end */
} problem;

enum { N_PROBLEMS = 20 };
/* Scene k, 0 <= k < N_PROBLEMS; memory exhausted ends the program. */
problem make_problem(int k);
void free_problem(problem *p);
#endif
