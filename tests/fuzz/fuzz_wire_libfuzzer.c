/* fuzz_wire_libfuzzer.c: the entry of clang's libFuzzer (CMake: CC=clang, target fuzz_wire_long).
 */
#include "fuzz_wire.h"

#include <stdint.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    fuzz_one(data, size);
    return 0;
}
