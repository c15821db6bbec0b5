/* snapshot.h: the state of a world as bytes, and copies of worlds.
 *
 * A snapshot holds all that the next step depends on and that a scene does not say: state,
 * parameters, steps taken, and the solver's guesses.  A world that takes it up repeats the steps
 * of the other bit for bit.  It fits worlds of the same scene: the same bodies, shapes, joints and
 * exclusions added in the same order, the same settings but gravity. */
#ifndef CAROM_SNAPSHOT_H
#define CAROM_SNAPSHOT_H

#include "carom/world.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Of the layout of the bytes: 1.  Another one is refused. */
#define CAROM_SNAPSHOT_FORMAT 3

/* Writes the snapshot to bytes[capacity]; *size is what it needs.  Seals the world when the caller
 * has not.  capacity 0 and bytes NULL: only *size.  CAROM_E_CAPACITY: more is needed; nothing was
 * written.  The bytes are the same on every machine. */
CAROM_API carom_status carom_world_snapshot(carom_world *world, size_t capacity, void *bytes,
                                            size_t *size);

/* Takes up a snapshot[size].  CAROM_E_ARGUMENT, and words in carom_world_error, for bytes that are
 * no snapshot, of another format or another scene, cut off, or damaged (each number is checked
 * against its range, all bytes against a checksum).  CAROM_E_MEMORY.  On an error the world is as
 * it was, but sealed.  A tape of this world starts anew. */
CAROM_API carom_status carom_world_restore(carom_world *world, size_t size, const void *bytes);

/* Another world like this one, its steps the same bits.  allocator: NULL for the default.
 * CAROM_E_ARGUMENT, CAROM_E_MEMORY. */
CAROM_API carom_status carom_world_copy(const carom_world *world, const carom_allocator *allocator,
                                        carom_world **out);

#ifdef __cplusplus
}
#endif
#endif
