/* direct.h: the world of a scene message, built on the public API alone. */
#ifndef TEST_DAEMON_DIRECT_H
#define TEST_DAEMON_DIRECT_H

#include "carom/grad.h"
#include "carom_scene_t.h"

/* The setting "dt" is the only one that is read. */
carom_world *direct_world(const carom_scene_t *scene);

#endif
