/* piles.h: moving boxes for carom's broadphase and its peers. */
#ifndef BENCH_PILES_H
#define BENCH_PILES_H

#include "carom/broadphase.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A broadphase that is told of moved boxes and finds their pairs. */
typedef struct finder {
    const char *name;
    void *(*create)(int n, const carom_box *boxes);
    int (*step)(void *self, int n, const carom_box *boxes); /* number of pairs reported */
    void (*destroy)(void *self);
} finder;

extern const finder BOX2D_TREE;
extern const finder CHIPMUNK_TREE;

#ifdef __cplusplus
}
#endif
#endif
