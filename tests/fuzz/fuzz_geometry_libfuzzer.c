/* fuzz_geometry_libfuzzer.c: the entry of clang's libFuzzer (CMake: CC=clang, target
 * fuzz_geometry_long). */
#include "fuzz_geometry.h"

#include <stdint.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    fuzz_geometry_one(data, size);
    return 0;
}
