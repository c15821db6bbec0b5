/* fuzz_wire.c: one message of any bytes, as a client could send it.
 *
 * Byte 0 chooses the type, byte 1 whether the header is made valid (fingerprint, client, session,
 * the next seq); the rest is the message.  What the validator passes must decode, and encode to the
 * same bytes; whatever comes, a server takes it without harm. */
#include "fuzz_wire.h"

#include "../daemon/messages.h"

#include <stdlib.h>
#include <string.h>

#define ROUND_TRIP(message)                                                                        \
    {                                                                                              \
        message m;                                                                                 \
        if (message##_decode(data, 0, size, &m) != size) abort();                                  \
        if (message##_encoded_size(&m) != size) abort();                                           \
        if (message##_encode(again, 0, size, &m) != size) abort();                                 \
        message##_decode_cleanup(&m);                                                              \
    }

/* Aborts when a message that passed the check does not survive decoding and encoding. */
static void round_trip(crm_wire_type type, const unsigned char *data, int size)
{
    unsigned char *again = malloc((size_t)size);
    if (!again) abort();
    switch (type) {
    case CRM_WIRE_SCENE:
    case CRM_WIRE_SCENE_UPDATED: ROUND_TRIP(carom_scene_t) break;
    case CRM_WIRE_SCENE_CHUNK: ROUND_TRIP(carom_scene_chunk_t) break;
    case CRM_WIRE_STEP: ROUND_TRIP(carom_step_request_t) break;
    case CRM_WIRE_LOSS_GRADIENT: ROUND_TRIP(carom_loss_gradient_t) break;
    case CRM_WIRE_DESCEND:
    case CRM_WIRE_PARAMETER_GRADIENT: ROUND_TRIP(carom_parameter_gradient_t) break;
    case CRM_WIRE_SESSION: ROUND_TRIP(carom_session_request_t) break;
    case CRM_WIRE_STATE: ROUND_TRIP(carom_state_t) break;
    case CRM_WIRE_REPLY: ROUND_TRIP(carom_reply_t) break;
    case CRM_WIRE_STATUS: ROUND_TRIP(carom_status_t) break;
    case CRM_WIRE_N_TYPES: abort();
    }
    if (memcmp(data, again, (size_t)size) != 0) abort();
    free(again);
}

static void put(unsigned char *b, int n, uint64_t x)
{
    for (int i = 0; i < n; i++) b[i] = (unsigned char)(x >> 8 * (n - 1 - i));
}

static void make_header(crm_wire_type type, unsigned char *b, uint64_t seq)
{
    put(b, 8, (uint64_t)crm_wire_fingerprint(type));
    put(b + 16, 8, 7);
    put(b + 24, 4, 1);
    put(b + 28, 8, seq);
}

/* A session that has a scene and a tape: the message finds all that it can damage. */
static bench *prepared(void)
{
    crm_server_settings set = crm_server_defaults();
    set.max_steps = 20;
    set.max_sessions = 4;
    set.session_memory = 16;
    set.max_answer = 1;
    bench *b = bench_create(&set);
    const carom_scene_t scene = scene_of(7, 1, 1);
    carom_step_request_t steps = steps_of(7, 1, 2, 0, 3, 1);
    steps.record = CAROM_STEP_REQUEST_T_RECORD_ON;
    bench_do(b, pack_scene(&scene));
    bench_do(b, pack_step(&steps));
    return b;
}

int fuzz_one(const unsigned char *data, size_t size)
{
    const crm_wire_limits limits = crm_wire_default_limits();
    char text[256];
    if (size < 2) return 0;
    const crm_wire_type type = (crm_wire_type)(data[0] % CRM_WIRE_N_TYPES);
    const int valid_header = data[1] % 4;
    bytes m = {type, (int)size - 2, malloc(size)};
    if (!m.data) abort();
    memcpy(m.data, data + 2, size - 2);
    if (valid_header && m.size >= CRM_WIRE_HEADER_BYTES) {
        make_header(type, m.data, valid_header == 1 ? 1 : 3);
    }
    const int passed = crm_wire_check(type, &limits, m.data, (size_t)m.size, text, sizeof text);
    if (passed) round_trip(type, m.data, m.size);
    if (type < CRM_WIRE_N_REQUESTS) {
        bench *b = prepared();
        bench_do(b, m);
        bench_destroy(b);
    } else {
        free(m.data);
    }
    return passed;
}

size_t fuzz_seed(int k, unsigned char *data, size_t size)
{
    bytes m = pack_sample((crm_wire_type)(k % CRM_WIRE_N_TYPES));
    const size_t n = (size_t)m.size + 2;
    if (n > size) abort();
    data[0] = (unsigned char)(k % CRM_WIRE_N_TYPES);
    data[1] = (unsigned char)(k / CRM_WIRE_N_TYPES);
    memcpy(data + 2, m.data, (size_t)m.size);
    free(m.data);
    return n;
}
