/* scenes.h: contact problems of the bench: stacks, pyramids, piles of discs, chains. */
#ifndef BENCH_SOLVER_SCENES_H
#define BENCH_SOLVER_SCENES_H

#include "contact_case.h"

/* Boxes of mass 1 on each other, two contacts each, at rest under gravity. */
contact_case scene_stack(int n);
/* Triangle of boxes with so many rows. */
contact_case scene_pyramid(int rows);
/* Discs in hexagonal layers between walls; some contacts are missing. */
contact_case scene_pile(int n);
/* Links hinged to each other and to the world. */
contact_case scene_chain(int n);

#endif
