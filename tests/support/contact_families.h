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

/* Discs in hexagonal layers between walls, a fifth of the contacts missing, a fifth of the discs
 * heavy half of the time; friction log-uniform in [low, high]. */
contact_case contact_discs(rng *r, int n, double low, double high);

#endif
