/* contact_families.h: random contact problems by family: stacks, pyramids, piles, wedges, chains,
 * wide ranges of friction, restitution, and rows without geometry. */
#ifndef SUPPORT_CONTACT_FAMILIES_H
#define SUPPORT_CONTACT_FAMILIES_H

#include "contact_case.h"
#include "rng.h"

typedef struct contact_family {
    const char *name;
    contact_case (*make)(rng *r);
    int solvable; /* c = 0, so that a solution exists (Anitescu and Potra) */
} contact_family;

extern const contact_family contact_families[];
extern const int n_contact_families;

#endif
