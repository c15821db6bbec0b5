/* carom.h: everything. */
#ifndef CAROM_CAROM_H
#define CAROM_CAROM_H
#include "carom/base.h"
#include "carom/collide.h"
#include "carom/contact.h"
#include "carom/grad.h"
#include "carom/shape.h"
#include "carom/world.h"
#endif
