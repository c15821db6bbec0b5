/* rng.h: a small generator with fixed seeds (splitmix64): the same numbers on every machine. */
#ifndef SUPPORT_RNG_H
#define SUPPORT_RNG_H

#include <stdint.h>

typedef struct rng {
    uint64_t state;
} rng;

rng rng_from(uint64_t seed);
uint64_t rng_bits(rng *r);
/* Uniform in [0, 1). */
double rng_unit(rng *r);
/* Uniform in [low, high). */
double rng_uniform(rng *r, double low, double high);
/* Mean 0, variance 1: Irwin-Hall sum of twelve, no libm, hence the same bits everywhere. */
double rng_normal(rng *r);
/* Uniform in 0 .. n - 1, n >= 1. */
int rng_int(rng *r, int n);

#endif
