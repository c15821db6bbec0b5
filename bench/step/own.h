/* own.h: carom as a contender. */
#ifndef BENCH_STEP_OWN_H
#define BENCH_STEP_OWN_H

#include "scene.h"

#include "carom/world.h"

/* A world of the scene that is not sealed yet; a failure ends the program. */
carom_world *own_build(const scene *s, carom_integrator integrator, int order);
/* A sealed world of the scene; a failure ends the program. */
void *own_create(const scene *s, carom_integrator integrator, int order);
/* The same with one more setting by name. */
void *own_create_with(const scene *s, carom_integrator integrator, int order, const char *name,
                      const char *value);

#endif
