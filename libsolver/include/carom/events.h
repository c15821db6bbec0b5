/* events.h: which contacts began, ended and hit in the last step of a world.
 *
 * Nothing is recorded unless asked for.  Impacts come first, island by island (that of the lowest
 * body first) and in each as time goes; then begins and ends by shape pair, then breaks by joint.
 * `fixed` may take one impact in two steps.  A step that fails has no events; after it, and after
 * carom_world_set_state, all contacts begin anew. */
#ifndef CAROM_EVENTS_H
#define CAROM_EVENTS_H

#include "carom/world.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum carom_event_kind {
    CAROM_CONTACT_IMPACT, /* a contact point is met faster than v_rest, or passes such an impact on
                           */
    CAROM_CONTACT_BEGIN,  /* two shapes touch at the end of the step, and did not at its start */
    CAROM_CONTACT_END,    /* the other way round; a bounce within a step has neither */
    CAROM_JOINT_BREAK     /* a joint breaks at the end of the step */
} carom_event_kind;

typedef struct carom_contact_event {
    carom_event_kind kind;
    int body_a, body_b;
    int shape_a, shape_b; /* in the order of adding, of all bodies together; of a break -1 */
    double time;          /* since the step began [s]; dt for begin, end and break */
    double approach;      /* of an impact: speed of closing before it [m/s] */
    double ln, lt;        /* its impulses along normal and tangent [N s]; else 0 */
    carom_vec2 point;     /* on A, world [m]; of an end where it last was */
    carom_vec2 normal;    /* from A to B; of a break 0 */
    int joint;            /* that breaks; else -1 */
} carom_contact_event;

/* From the next step on, or no longer.  Limits of joints make no events. */
CAROM_API carom_status carom_world_record_events(carom_world *world, int record);
/* Those of the last step; owned by the world, valid until its next call.  *n: how many. */
CAROM_API const carom_contact_event *carom_world_events(const carom_world *world, int *n);

#ifdef __cplusplus
}
#endif
#endif
