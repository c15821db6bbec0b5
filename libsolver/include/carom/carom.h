/* carom.h: everything but carom/lcp.h, which exists with CAROM_WITH_KLU only. */
#ifndef CAROM_CAROM_H
#define CAROM_CAROM_H
#include "carom/base.h"
#include "carom/broadphase.h"
#include "carom/chain.h"
#include "carom/collide.h"
#include "carom/contact.h"
#include "carom/events.h"
#include "carom/grad.h"
#include "carom/query.h"
#include "carom/shape.h"
#include "carom/snapshot.h"
#include "carom/world.h"
#include "carom/world_query.h"
#endif
