/* problems.h: scenes whose end is known. */
#ifndef BENCH_PRECISION_PROBLEMS_H
#define BENCH_PRECISION_PROBLEMS_H

#include "bench/step/scene.h"

/* What gives the end of a scene: a closed form, or equations of motion of its own. */
typedef enum motion_kind {
    MOTION_CLOSED,
    MOTION_LINKS,
    MOTION_DISC,
    MOTION_ROCK,
    MOTION_CRADLE,
    MOTION_BILLIARD
} motion_kind;

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
    double hangs;    /* of links: the angle of one that hangs */
} problem;

enum { N_PROBLEMS = 21 };
/* Scene k, 0 <= k < N_PROBLEMS; memory exhausted ends the program. */
problem make_problem(int k);
/* That of a scene file of tests/data/scenes (files.c): the body that moves last in the file, its
 * end by the closed form or the equations of motion that the file's `reference` names, or where it
 * began.  What cannot be read ends the program. */
problem read_problem(const char *path);
void free_problem(problem *p);

/* Closed forms that several scenes share; body p->body ends there. */
void ends_rolling(problem *p, double friction); /* a disc that slides along x on a floor at 0 */
void ends_bouncing(problem *p);                 /* a disc let go above a floor at 0 */
void rests(problem *p);                         /* where it is: the error is how far it moves */
#endif
