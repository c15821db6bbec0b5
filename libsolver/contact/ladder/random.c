#include "libsolver/contact/ladder/ladder.h"

#include <math.h>

/* splitmix64, the 53 high bits. */
double crm_uniform(unsigned long long *state)
{
    unsigned long long z = (*state += 0x9E3779B97F4A7C15ULL);
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL;
    z ^= z >> 31;
    return ((double)(z >> 11) + 0.5) * 0x1p-53;
}

/* Box-Muller. */
double crm_normal(unsigned long long *state)
{
    const double two_pi = 6.283185307179586;
    const double r = sqrt(-2 * log(crm_uniform(state)));
    return r * cos(two_pi * crm_uniform(state));
}
