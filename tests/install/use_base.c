/* carom::base alone: texts, version, allocator. */
#include <carom/base.h>

#include <stdio.h>
#include <string.h>

int main(void)
{
    const carom_allocator a = carom_allocator_default();
    void *p = a.allocate(a.user, 100);
    a.release(a.user, p, 100);
    printf("carom %s: %s\n", carom_version(), carom_status_text(CAROM_OK));
    return !p || strcmp(carom_status_name(CAROM_E_MEMORY), "CAROM_E_MEMORY") != 0;
}
