#include "wire.h"

#include "carom_loss_gradient_t.h"
#include "carom_parameter_gradient_t.h"
#include "carom_reply_t.h"
#include "carom_scene_chunk_t.h"
#include "carom_scene_t.h"
#include "carom_session_request_t.h"
#include "carom_state_t.h"
#include "carom_status_t.h"
#include "carom_step_request_t.h"

#include <inttypes.h>
#include <stdio.h>

/* What a field is on the wire. */
typedef enum kind {
    END,
    FIXED,  /* `size` bytes */
    COUNT,  /* int32 into `slot`, 0 to the limit */
    TIMES,  /* int32 that must be `size` times the count in `slot` */
    ARRAY,  /* `size` bytes times the count in `slot` */
    STRING, /* int32 length with the terminator, then bytes */
    STRINGS /* as many strings as the count in `slot` */
} kind;

typedef struct field {
    kind kind;
    const char *name;
    int slot;
    int size;
    size_t limit; /* offset into crm_wire_limits */
    const char *option;
} field;

enum { N_SLOTS = 32 };

#define LIMIT(name) offsetof(crm_wire_limits, name), "--max-" #name
#define F_FIXED(name, size)                                                                        \
    {                                                                                              \
        FIXED, name, 0, size, 0, NULL                                                              \
    }
#define F_COUNT(name, slot, at)                                                                    \
    {                                                                                              \
        COUNT, name, slot, 0, LIMIT(at)                                                            \
    }
#define F_TIMES(name, n, slot)                                                                     \
    {                                                                                              \
        TIMES, name, slot, n, 0, NULL                                                              \
    }
#define F_ARRAY(name, slot, n)                                                                     \
    {                                                                                              \
        ARRAY, name, slot, n, 0, NULL                                                              \
    }
#define F_STRING(name)                                                                             \
    {                                                                                              \
        STRING, name, 0, 0, LIMIT(text)                                                            \
    }
#define F_STRINGS(name, slot)                                                                      \
    {                                                                                              \
        STRINGS, name, slot, 0, LIMIT(text)                                                        \
    }
#define F_END                                                                                      \
    {                                                                                              \
        END, NULL, 0, 0, 0, NULL                                                                   \
    }
/* A count with a limit of its own, and `n` numbers of 8 bytes. */
#define F_DOUBLES(name, slot) F_COUNT("num_" name, slot, message), F_ARRAY(name, slot, 8)
#define F_HEADER                                                                                   \
    F_FIXED("utime", 8), F_FIXED("client_id", 8), F_FIXED("session", 4), F_FIXED("seq", 8)

static const field scene_fields[] = {
    F_HEADER,
    F_STRING("scene_name"),
    F_FIXED("gravity", 16),
    F_COUNT("num_settings", 0, settings),
    F_STRINGS("setting_name", 0),
    F_STRINGS("setting_value", 0),
    F_COUNT("num_bodies", 1, bodies),
    F_STRINGS("body_name", 1),
    F_ARRAY("body_type", 1, 1),
    F_ARRAY("collide", 1, 1),
    F_ARRAY("mass", 1, 8),
    F_ARRAY("inertia", 1, 8),
    F_ARRAY("friction", 1, 8),
    F_ARRAY("restitution", 1, 8),
    F_ARRAY("gravity_scale", 1, 8),
    F_ARRAY("linear_damping", 1, 8),
    F_ARRAY("angular_damping", 1, 8),
    F_ARRAY("sensor", 1, 1),
    F_ARRAY("filter_category", 1, 4),
    F_ARRAY("filter_mask", 1, 4),
    F_ARRAY("filter_group", 1, 4),
    F_TIMES("num_coords", 3, 1),
    F_ARRAY("q", 1, 24),
    F_ARRAY("v", 1, 24),
    F_ARRAY("force", 1, 24),
    F_COUNT("num_shapes", 2, shapes),
    F_ARRAY("shape_body", 2, 4),
    F_ARRAY("shape_num_vertices", 2, 4),
    F_ARRAY("radius", 2, 8),
    F_COUNT("num_vertex_coords", 3, message),
    F_ARRAY("vertices", 3, 8),
    F_COUNT("num_joints", 4, joints),
    F_ARRAY("joint_type", 4, 1),
    F_ARRAY("joint_body_a", 4, 4),
    F_ARRAY("joint_body_b", 4, 4),
    F_TIMES("num_anchor_coords", 2, 4),
    F_ARRAY("anchor", 4, 16),
    F_ARRAY("anchor_b", 4, 16),
    F_ARRAY("axis", 4, 16),
    F_ARRAY("joint_collide", 4, 1),
    F_ARRAY("joint_lower", 4, 8),
    F_ARRAY("joint_upper", 4, 8),
    F_ARRAY("joint_restitution", 4, 8),
    F_ARRAY("stiffness", 4, 8),
    F_ARRAY("joint_damping", 4, 8),
    F_ARRAY("rest", 4, 8),
    F_ARRAY("motor_speed", 4, 8),
    F_ARRAY("motor_limit", 4, 8),
    F_ARRAY("break_force", 4, 8),
    F_ARRAY("break_torque", 4, 8),
    F_END,
};

static const field chunk_fields[] = {
    F_HEADER,
    F_FIXED("scene_bytes", 4),
    F_FIXED("chunk_offset", 4),
    F_FIXED("chunk_stride", 4),
    F_FIXED("chunk_index", 4),
    F_COUNT("num_bytes", 0, message),
    F_ARRAY("chunk_data", 0, 1),
    F_END,
};

static const field step_fields[] = {
    F_HEADER,
    F_FIXED("from_step", 8),
    F_FIXED("num_steps", 4),
    F_FIXED("publish_every", 4),
    F_FIXED("want", 4),
    F_FIXED("record", 1),
    F_COUNT("num_forces", 0, forces),
    F_ARRAY("force_step", 0, 4),
    F_ARRAY("force_body", 0, 4),
    F_TIMES("num_force_values", 3, 0),
    F_ARRAY("step_force", 0, 24),
    F_COUNT("num_resend", 1, states),
    F_ARRAY("resend_step", 1, 8),
    F_END,
};

static const field loss_fields[] = {
    F_HEADER,
    F_FIXED("cost", 8),
    F_FIXED("wanted", 4),
    F_COUNT("num_bars", 0, states),
    F_ARRAY("bar_step", 0, 8),
    F_COUNT("num_bar_coords", 1, message),
    F_ARRAY("q_bar", 1, 8),
    F_ARRAY("v_bar", 1, 8),
    F_END,
};

static const field gradient_fields[] = {
    F_HEADER,
    F_FIXED("wanted", 4),
    F_FIXED("rate", 8),
    F_FIXED("keep_state", 1),
    F_FIXED("cost", 8),
    F_FIXED("first_step", 8),
    F_FIXED("recorded_steps", 4),
    F_FIXED("degenerate", 4),
    F_FIXED("first_degenerate_step", 8),
    F_DOUBLES("q0", 0),
    F_DOUBLES("v0", 1),
    F_DOUBLES("mass", 2),
    F_DOUBLES("inertia", 3),
    F_DOUBLES("friction", 4),
    F_DOUBLES("restitution", 5),
    F_DOUBLES("gravity", 6),
    F_DOUBLES("force", 7),
    F_DOUBLES("force_steps", 8),
    F_DOUBLES("radius", 9),
    F_DOUBLES("vertices", 10),
    F_DOUBLES("anchors", 11),
    F_DOUBLES("dt", 12),
    F_DOUBLES("gravity_scale", 13),
    F_DOUBLES("linear_damping", 14),
    F_DOUBLES("angular_damping", 15),
    F_DOUBLES("axes", 16),
    F_DOUBLES("angles", 17),
    F_DOUBLES("lengths", 18),
    F_DOUBLES("lower", 19),
    F_DOUBLES("upper", 20),
    F_DOUBLES("stiffness", 21),
    F_DOUBLES("damping", 22),
    F_DOUBLES("rest", 23),
    F_DOUBLES("motor_speed", 24),
    F_DOUBLES("motor_limit", 25),
    F_END,
};

static const field session_fields[] = {
    F_HEADER, F_FIXED("session_action", 1), F_FIXED("snapshot", 4), F_FIXED("lease", 8), F_END,
};

static const field state_fields[] = {
    F_HEADER,
    F_FIXED("step", 8),
    F_FIXED("sim_time", 8),
    F_FIXED("num_bodies", 4),
    F_DOUBLES("q", 0),
    F_DOUBLES("v", 1),
    F_FIXED("status", 4),
    F_FIXED("residual", 8),
    F_FIXED("penetration", 8),
    F_FIXED("joint_drift", 8),
    F_FIXED("energy", 8),
    F_FIXED("substeps", 4),
    F_FIXED("events", 4),
    F_FIXED("iterations", 4),
    F_FIXED("factorizations", 4),
    F_FIXED("degenerate", 4),
    F_COUNT("num_contacts", 2, contacts),
    F_ARRAY("contact_body_a", 2, 4),
    F_ARRAY("contact_body_b", 2, 4),
    F_ARRAY("contact_mode", 2, 1),
    F_ARRAY("contact_gap", 2, 8),
    F_ARRAY("impulse_normal", 2, 8),
    F_ARRAY("impulse_tangent", 2, 8),
    F_TIMES("num_contact_coords", 2, 2),
    F_ARRAY("contact_point", 2, 16),
    F_ARRAY("contact_normal", 2, 16),
    F_END,
};

static const field reply_fields[] = {
    F_HEADER,
    F_FIXED("reply_code", 1),
    F_STRING("reply_text"),
    F_FIXED("status", 4),
    F_FIXED("next_seq", 8),
    F_FIXED("window", 4),
    F_FIXED("boot_id", 8),
    F_FIXED("step", 8),
    F_FIXED("first_step", 8),
    F_FIXED("recorded_steps", 4),
    F_FIXED("num_states", 4),
    F_FIXED("chunk_index", 4),
    F_FIXED("seconds", 8),
    F_END,
};

static const field status_fields[] = {
    F_HEADER,
    F_STRING("daemon_name"),
    F_STRING("daemon_version"),
    F_STRING("url"),
    F_FIXED("boot_id", 8),
    F_FIXED("uptime", 8),
    F_FIXED("num_sessions", 4),
    F_FIXED("num_clients", 4),
    F_FIXED("queue_depth", 4),
    F_FIXED("steps_total", 8),
    F_FIXED("states_dropped", 8),
    F_FIXED("malformed", 8),
    F_FIXED("busy", 8),
    F_FIXED("max_message", 4),
    F_END,
};

typedef struct message_type {
    const char *name;
    const char *channel;
    const field *fields;
    uint64_t (*hash)(const __lcm_hash_ptr *parents);
} message_type;

static const message_type types[CRM_WIRE_N_TYPES] = {
    {"scene_t", "CAROM_SCENE", scene_fields, __carom_scene_t_hash_recursive},
    {"scene_chunk_t", "CAROM_SCENE_CHUNK", chunk_fields, __carom_scene_chunk_t_hash_recursive},
    {"step_request_t", "CAROM_STEP", step_fields, __carom_step_request_t_hash_recursive},
    {"loss_gradient_t", "CAROM_LOSS_GRADIENT", loss_fields, __carom_loss_gradient_t_hash_recursive},
    {"parameter_gradient_t", "CAROM_DESCEND", gradient_fields,
     __carom_parameter_gradient_t_hash_recursive},
    {"session_request_t", "CAROM_SESSION", session_fields,
     __carom_session_request_t_hash_recursive},
    {"state_t", "CAROM_STATE", state_fields, __carom_state_t_hash_recursive},
    {"parameter_gradient_t", "CAROM_PARAMETER_GRADIENT", gradient_fields,
     __carom_parameter_gradient_t_hash_recursive},
    {"scene_t", "CAROM_SCENE_UPDATED", scene_fields, __carom_scene_t_hash_recursive},
    {"reply_t", "CAROM_REPLY", reply_fields, __carom_reply_t_hash_recursive},
    {"status_t", "CAROM_STATUS", status_fields, __carom_status_t_hash_recursive},
};

crm_wire_limits crm_wire_default_limits(void)
{
    const crm_wire_limits limits = {
#define CRM_WIRE_LIMIT_VALUE(name, value, text) value,
        CRM_WIRE_LIMITS(CRM_WIRE_LIMIT_VALUE)
#undef CRM_WIRE_LIMIT_VALUE
    };
    return limits;
}

const char *crm_wire_type_name(crm_wire_type type)
{
    return types[type].name;
}

const char *crm_wire_channel(crm_wire_type type)
{
    return types[type].channel;
}

void crm_wire_channel_name(crm_wire_type type, const char *suffix, char name[64])
{
    const int bare = !suffix || !suffix[0];
    snprintf(name, 64, "%s%s%s", types[type].channel, bare ? "" : "_", bare ? "" : suffix);
}

int64_t crm_wire_fingerprint(crm_wire_type type)
{
    return (int64_t)types[type].hash(NULL);
}

static uint64_t read_u64(const unsigned char *b)
{
    uint64_t x = 0;
    for (int i = 0; i < 8; i++) x = x << 8 | b[i];
    return x;
}

/* Big-endian two's complement, without the undefined shift into the sign bit. */
static int64_t read_i32(const unsigned char *b)
{
    const int64_t x = (int64_t)b[0] << 24 | (int64_t)b[1] << 16 | (int64_t)b[2] << 8 | b[3];
    return x < ((int64_t)1 << 31) ? x : x - ((int64_t)1 << 32);
}

int crm_wire_read_header(crm_wire_type type, const void *bytes, size_t size,
                         crm_wire_header *header)
{
    const unsigned char *b = bytes;
    if (size < CRM_WIRE_HEADER_BYTES) return 0;
    if (read_u64(b) != (uint64_t)crm_wire_fingerprint(type)) return 0;
    header->utime = (int64_t)read_u64(b + 8);
    header->client_id = (int64_t)read_u64(b + 16);
    header->session = (int32_t)read_i32(b + 24);
    header->seq = (int64_t)read_u64(b + 28);
    return 1;
}

/* A walk over the bytes of one message. */
typedef struct walk {
    const unsigned char *bytes;
    int64_t size;
    int64_t at;
    int64_t slot[N_SLOTS];
    const crm_wire_limits *limits;
    const char *type;
    char *text;
    size_t text_size;
} walk;

static int limit_of(const walk *w, const field *f)
{
    return *(const int *)(const void *)((const char *)w->limits + f->limit);
}

static int truncated(const walk *w, const field *f)
{
    snprintf(w->text, w->text_size, "%s: the message ends at byte %" PRId64 ", inside %s", w->type,
             w->size, f->name);
    return 0;
}

static int take(walk *w, const field *f, int64_t bytes)
{
    if (bytes > w->size - w->at) return truncated(w, f);
    w->at += bytes;
    return 1;
}

static int take_i32(walk *w, const field *f, int64_t *value)
{
    if (w->size - w->at < 4) return truncated(w, f);
    *value = read_i32(w->bytes + w->at);
    w->at += 4;
    return 1;
}

static int take_count(walk *w, const field *f)
{
    int64_t n = 0;
    if (!take_i32(w, f, &n)) return 0;
    if (n < 0 || n > limit_of(w, f)) {
        snprintf(w->text, w->text_size,
                 "%s: %s = %" PRId64 " at byte %" PRId64 " is outside 0 to %d (%s)", w->type,
                 f->name, n, w->at - 4, limit_of(w, f), f->option);
        return 0;
    }
    w->slot[f->slot] = n;
    return 1;
}

static int take_times(walk *w, const field *f)
{
    int64_t n = 0;
    if (!take_i32(w, f, &n)) return 0;
    if (n != f->size * w->slot[f->slot]) {
        snprintf(w->text, w->text_size,
                 "%s: %s = %" PRId64 " at byte %" PRId64 " is not %d times %" PRId64, w->type,
                 f->name, n, w->at - 4, f->size, w->slot[f->slot]);
        return 0;
    }
    return 1;
}

static int take_string(walk *w, const field *f)
{
    int64_t n = 0;
    if (!take_i32(w, f, &n)) return 0;
    if (n < 1 || n > (int64_t)limit_of(w, f) + 1) {
        snprintf(w->text, w->text_size,
                 "%s: %s of length %" PRId64 " at byte %" PRId64 " is outside 1 to %d (%s + 1)",
                 w->type, f->name, n, w->at - 4, limit_of(w, f) + 1, f->option);
        return 0;
    }
    if (n > w->size - w->at) return truncated(w, f);
    const unsigned char *s = w->bytes + w->at;
    for (int64_t i = 0; i < n; i++) {
        if ((s[i] == 0) != (i == n - 1)) {
            snprintf(w->text, w->text_size,
                     "%s: %s at byte %" PRId64 " does not end at its terminator", w->type, f->name,
                     w->at);
            return 0;
        }
    }
    w->at += n;
    return 1;
}

static int take_strings(walk *w, const field *f)
{
    for (int64_t i = 0; i < w->slot[f->slot]; i++) {
        if (!take_string(w, f)) return 0;
    }
    return 1;
}

static int take_field(walk *w, const field *f)
{
    switch (f->kind) {
    case FIXED: return take(w, f, f->size);
    case COUNT: return take_count(w, f);
    case TIMES: return take_times(w, f);
    case ARRAY: return take(w, f, f->size * w->slot[f->slot]);
    case STRING: return take_string(w, f);
    case STRINGS: return take_strings(w, f);
    case END: break;
    }
    return 0;
}

int crm_wire_check(crm_wire_type type, const crm_wire_limits *limits, const void *bytes,
                   size_t size, char *text, size_t text_size)
{
    const message_type *t = &types[type];
    if (size > (size_t)limits->message) {
        snprintf(text, text_size, "%s: %zu bytes are more than %d (--max-message)", t->name, size,
                 limits->message);
        return 0;
    }
    if (size < 8 || read_u64(bytes) != (uint64_t)crm_wire_fingerprint(type)) {
        snprintf(text, text_size, "%s: wrong fingerprint: another type or another version",
                 t->name);
        return 0;
    }
    walk w = {bytes, (int64_t)size, 8, {0}, limits, t->name, text, text_size};
    for (const field *f = t->fields; f->kind != END; f++) {
        if (!take_field(&w, f)) return 0;
    }
    if (w.at != w.size) {
        snprintf(text, text_size, "%s: %" PRId64 " bytes after the end", t->name, w.size - w.at);
        return 0;
    }
    return 1;
}
