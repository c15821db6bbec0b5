/* contact_parts.h: contact problems from boxes and links, for the tests of the contact solver. */
#ifndef SUPPORT_CONTACT_PARTS_H
#define SUPPORT_CONTACT_PARTS_H

#include "carom/contact.h"
#include "contact_case.h"
#include "rng.h"

static const double GRAVITY = 9.81;
static const double STEP = 0.01;

/* Impulses follow from rows of order 1: a few units of rounding [1]. */
#define CLOSE 1e-12

/* Solves without a guess; fails unless solved, by the residual of contact_case too. */
carom_contact_stats contact_solve_ok(contact_case *c);

/* Box of unit width on two corners: contacts at +-1/2. */
void contact_feet(contact_case *c, int below, int above, double mu);

/* n boxes of mass 1 on the ground, the top one of another mass; all move at `push`. */
contact_case contact_stack(int n, double top_mass, double mu, double push);

/* Many stacks and chains, pushed at random. */
contact_case contact_mixed(uint64_t seed, int n_parts);

#endif
