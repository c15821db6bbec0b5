/* fuzz_wire_main.c: a bounded number of messages, mutated from valid ones with a fixed seed.
 * fuzz_wire [NUMBER] */
#include "fuzz_wire.h"

#include "rng.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { SIZE = 4096 };

static const unsigned char interesting[] = {0x00, 0x01, 0x7f, 0x80, 0xff};

/* One change: a byte, a number of four bytes, a cut, a repetition, or a hole. */
static size_t mutate(rng *r, unsigned char *d, size_t n)
{
    const size_t at = 2 + (size_t)rng_int(r, (int)n - 2);
    const size_t length = 1 + (size_t)rng_int(r, 16);
    switch (rng_int(r, 6)) {
    case 0: d[at] = (unsigned char)rng_int(r, 256); break;
    case 1:
        for (size_t i = at; i < at + 4 && i < n; i++) d[i] = interesting[rng_int(r, 5)];
        break;
    case 2: d[at] ^= (unsigned char)(1 << rng_int(r, 8)); break;
    case 3: return at > 3 ? at : n;
    case 4:
        if (n + length > SIZE || at + length > n) break;
        memmove(d + at + length, d + at, n - at);
        return n + length;
    default:
        if (at + length >= n) break;
        memmove(d + at, d + at + length, n - at - length);
        return n - length;
    }
    return n;
}

int main(int argc, char **argv)
{
    const long number = argc > 1 ? strtol(argv[1], NULL, 10) : 20000;
    unsigned char d[SIZE];
    rng r = rng_from(2024);
    long passed = 0;
    for (long k = 0; k < number; k++) {
        size_t n = fuzz_seed((int)(k % 44), d, SIZE);
        for (int i = rng_int(&r, 5); i > 0 && n > 3; i--) n = mutate(&r, d, n);
        passed += fuzz_one(d, n);
    }
    printf("%ld messages, %ld passed the check\n", number, passed);
    /* Unchanged ones pass, mutated counts do not: both must happen. */
    return passed > number / 20 && passed < number ? 0 : 1;
}
