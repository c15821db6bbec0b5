/* gradient_random.h: small worlds drawn from a seed, for derivatives: every kind of shape and
 * joint, limits, springs and motors, masses 1e-2 to 1e2 kg, that fall on a floor between walls. */
#ifndef SUPPORT_GRADIENT_RANDOM_H
#define SUPPORT_GRADIENT_RANDOM_H

#include "carom/world.h"

#include <stdint.h>

/* A sealed world of 1 to 5 dynamic bodies; the caller destroys it.  Settings but for gravity and dt
 * are read from `settings`. */
carom_world *gradient_random_world(uint64_t seed, const carom_world_settings *settings);

#endif
