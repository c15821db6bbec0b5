/* wire.h: checks an encoded message before its generated decoder reads it.
 *
 * The decoders of lcm-gen trust every count in the bytes: a negative or huge one crashes them or
 * makes them ask for gigabytes.  A message that passes crm_wire_check is safe to decode: right
 * fingerprint, every count within its limit, all arrays and strings inside the message, strings
 * terminated, dependent counts consistent, no trailing bytes.  No allocation, no recursion, time
 * linear in the size. */
#ifndef CRM_WIRE_H
#define CRM_WIRE_H

#include <stddef.h>
#include <stdint.h>

typedef enum crm_wire_type {
    CRM_WIRE_SCENE,
    CRM_WIRE_SCENE_CHUNK,
    CRM_WIRE_STEP,
    CRM_WIRE_LOSS_GRADIENT,
    CRM_WIRE_DESCEND,
    CRM_WIRE_SESSION,
    CRM_WIRE_N_REQUESTS, /* the ones above go from client to daemon */
    CRM_WIRE_STATE = CRM_WIRE_N_REQUESTS,
    CRM_WIRE_PARAMETER_GRADIENT,
    CRM_WIRE_SCENE_UPDATED,
    CRM_WIRE_REPLY,
    CRM_WIRE_STATUS,
    CRM_WIRE_N_TYPES
} crm_wire_type;

/* Limits on counts.  The table gives name, default and meaning; caromd has an option --max-NAME for
 * each. */
#define CRM_WIRE_LIMITS(X)                                                                         \
    X(message, 4 << 20, "bytes of one message; a scene in pieces counts as one")                   \
    X(bodies, 20000, "bodies of a scene")                                                          \
    X(shapes, 40000, "shapes of a scene")                                                          \
    X(vertices, 100000, "vertices of a scene")                                                     \
    X(joints, 40000, "joints of a scene")                                                          \
    X(contacts, 200000, "contact points in a state")                                               \
    X(forces, 100000, "single forces of a step request")                                           \
    X(states, 100000, "states in a loss gradient or asked for again")                              \
    X(settings, 64, "settings of a scene")                                                         \
    X(text, 255, "bytes of a name or text")

typedef struct crm_wire_limits {
#define CRM_WIRE_LIMIT_FIELD(name, value, text) int name;
    CRM_WIRE_LIMITS(CRM_WIRE_LIMIT_FIELD)
#undef CRM_WIRE_LIMIT_FIELD
} crm_wire_limits;

crm_wire_limits crm_wire_default_limits(void);

/* Name of the message type, like "scene_t", and of its channel without suffix, like "CAROM_SCENE".
 */
const char *crm_wire_type_name(crm_wire_type type);
const char *crm_wire_channel(crm_wire_type type);
/* The channel with its suffix; longest: 63 bytes, as LCM wants it. */
void crm_wire_channel_name(crm_wire_type type, const char *suffix, char name[64]);
int64_t crm_wire_fingerprint(crm_wire_type type);

/* The fields every message starts with. */
typedef struct crm_wire_header {
    int64_t utime;
    int64_t client_id;
    int32_t session;
    int64_t seq;
} crm_wire_header;

enum { CRM_WIRE_HEADER_BYTES = 36 }; /* with the fingerprint before it */

/* 1 and *header when the bytes begin like a message of this type. */
int crm_wire_read_header(crm_wire_type type, const void *bytes, size_t size,
                         crm_wire_header *header);

/* 1: safe to decode.  0: not; `text` (terminated) says which field, where and which limit. */
int crm_wire_check(crm_wire_type type, const crm_wire_limits *limits, const void *bytes,
                   size_t size, char *text, size_t text_size);

#endif
