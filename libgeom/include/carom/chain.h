/* chain.h: floors and walls: polylines of one-sided links that know their neighbors, so that
 * nothing stumbles at their joints.
 *
 * The solid side is on the left, as of a counterclockwise hull: link k runs from vertex k to k + 1
 * and its normal is on the right.  A floor runs from right to left.  A closed counterclockwise
 * chain is a solid outline, a closed clockwise one a cavity.  A shape behind a link does not touch
 * it. */
#ifndef CAROM_CHAIN_H
#define CAROM_CHAIN_H

#include "carom/broadphase.h"
#include "carom/collide.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A view; the caller keeps the vertices alive. */
typedef struct carom_chain {
    double radius; /* rounding [m], >= 0 */
    int count;     /* vertices: >= 2, closed >= 3 */
    const carom_vec2 *vertices;
    int closed; /* 1: a link also runs from the last vertex to the first */
} carom_chain;

/* CAROM_OK, or CAROM_E_SHAPE with *error filled (may be NULL): COUNT, RADIUS, NOT_FINITE, SIZE,
 * DUPLICATE (within 1e-12 of the extent), FOLD (a turn within 1e-12 of 180 degrees). */
CAROM_API carom_status carom_chain_check(const carom_chain *chain, carom_shape_error *error);

CAROM_API int carom_chain_links(const carom_chain *chain);

/* The chain as a shape: what carom_contact_eval and carom_contact_vjp take as A for the recipes of
 * carom_collide_chain.  Not a convex shape: for nothing else. */
CAROM_API carom_shape carom_chain_shape(const carom_chain *chain);

/* A box around one link. */
CAROM_API carom_box carom_chain_box(const carom_chain *chain, int link, carom_pose pose);

/* What one link adds to the contacts of a valid chain (A) and a valid shape (B): points within
 * margin [m] with one normal that is the link's own or, at a vertex where the chain is convex, lies
 * between the normals of its links.  The point at a vertex belongs to the link that starts there.
 * distance: of the nearest of the link's points, HUGE_VAL when it has none; for points beyond the
 * margin a lower bound.  A shape the mean of whose vertices is behind the link's line does not
 * touch it. */
CAROM_API carom_manifold carom_collide_chain(const carom_chain *chain, int link, carom_pose pose_a,
                                             const carom_shape *b, carom_pose pose_b,
                                             double margin);

#ifdef __cplusplus
}
#endif
#endif
