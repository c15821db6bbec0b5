/* fuzz_geometry_main.c: a bounded number of inputs of random bytes with a fixed seed.
 * fuzz_geometry [NUMBER [SEED]] */
#include "fuzz_geometry.h"

#include "rng.h"

#include <stdlib.h>

enum { SIZE = 2048 };

int main(int argc, char **argv)
{
    const long number = argc > 1 ? atol(argv[1]) : 20000;
    rng r = rng_from(argc > 2 ? (uint64_t)atol(argv[2]) : 1);
    unsigned char data[SIZE];
    for (long k = 0; k < number; k++) {
        for (int i = 0; i < SIZE; i++) data[i] = (unsigned char)(rng_bits(&r) >> 32);
        /* Few vertices come out valid more often: bound the first count, and half the kinds. */
        data[0] = (unsigned char)rng_int(&r, rng_int(&r, 2) ? 5 : 256);
        const int tame = rng_int(&r, 2);
        for (int i = 1; tame && i < SIZE; i += 2) data[i] = (unsigned char)(data[i] % 200);
        fuzz_geometry_one(data, SIZE);
    }
    return 0;
}
