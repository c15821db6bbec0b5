/* pairs.h: the same pairs of polygons for carom and its peers. */
#ifndef BENCH_PAIRS_H
#define BENCH_PAIRS_H

#include "carom/collide.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { N_PAIRS = 2048, MAX_VERTICES = 64 };

/* Contacts are wanted up to this gap: Box2D's two polygon radii [m]. */
static const double MARGIN = 0.02;

typedef enum situation { DEEP, TOUCHING, WITHIN_MARGIN, APART, N_SITUATIONS } situation;

const char *situation_name(situation s);

typedef struct pairs {
    int n; /* vertices of both shapes */
    carom_vec2 vertices[MAX_VERTICES];
    carom_pose a[N_PAIRS];
    carom_pose b[N_PAIRS];
} pairs;

/* Regular polygons of radius sqrt(2), at random poses, moved along the normal to a random gap. */
void make_pairs(int n, situation s, pairs *out);

/* A way to collide: called for every pair, adds to *sum what it found so that nothing is left out.
 */
typedef struct contender {
    const char *name;
    int max_vertices;
    void *(*create)(const pairs *p);
    int (*run)(void *self, double *sum); /* points found in all pairs */
    void (*destroy)(void *self);
} contender;

extern const contender BOX2D;
extern const contender CHIPMUNK;

#ifdef __cplusplus
}
#endif
#endif
