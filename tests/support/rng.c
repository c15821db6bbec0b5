#include "rng.h"

rng rng_from(uint64_t seed)
{
    const rng r = {seed};
    return r;
}

uint64_t rng_bits(rng *r)
{
    uint64_t z = (r->state += UINT64_C(0x9E3779B97F4A7C15));
    z = (z ^ (z >> 30)) * UINT64_C(0xBF58476D1CE4E5B9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94D049BB133111EB);
    return z ^ (z >> 31);
}

double rng_unit(rng *r)
{
    return (double)(rng_bits(r) >> 11) * (1.0 / 9007199254740992.0);
}

double rng_uniform(rng *r, double low, double high)
{
    return low + (high - low) * rng_unit(r);
}

double rng_normal(rng *r)
{
    double sum = -6.0;
    for (int i = 0; i < 12; i++) sum += rng_unit(r);
    return sum;
}

int rng_int(rng *r, int n)
{
    return (int)(rng_unit(r) * n);
}
