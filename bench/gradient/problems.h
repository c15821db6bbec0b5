/* problems.h: runs whose derivatives have closed forms. */
#ifndef BENCH_GRADIENT_PROBLEMS_H
#define BENCH_GRADIENT_PROBLEMS_H

#include "carom/grad.h"

/* The loss is one number of the ball's state at the end, by one number of the start. */
typedef struct problem {
    const char *name;
    const char *parameter;
    carom_world *(*build)(double dt); /* body 0: the floor; body 1: a disc */
    double seconds;                   /* of the run */
    int coordinate;                   /* of q of the disc: the loss */
    int by_q0;                        /* of q of the disc; -1: not by that */
    int by_v0;                        /* likewise */
    int by_friction;                  /* 1: of both bodies together */
    int by_restitution;               /* 1: likewise */
    double coefficient;               /* that of both bodies, where the derivative is by it */
    double exact;
} problem;

enum { N_PROBLEMS = 7 };
extern const problem problems[N_PROBLEMS];

#endif
