/* messages.h: scenes and requests for the daemon's tests, and what a server published. */
#ifndef TEST_DAEMON_MESSAGES_H
#define TEST_DAEMON_MESSAGES_H

#include "carom_loss_gradient_t.h"
#include "carom_parameter_gradient_t.h"
#include "carom_reply_t.h"
#include "carom_scene_chunk_t.h"
#include "carom_scene_t.h"
#include "carom_session_request_t.h"
#include "carom_state_t.h"
#include "carom_status_t.h"
#include "carom_step_request_t.h"
#include "session/server.h"

/* Encoded bytes; free with free. */
typedef struct bytes {
    crm_wire_type type;
    int size;
    unsigned char *data;
} bytes;

/* A static floor (hull), two dynamic discs above it and a link pinned to the floor: contact,
 * restitution, friction and a joint.  Arrays are static and must not be freed. */
carom_scene_t scene_of(int64_t client_id, int32_t session, int64_t seq);
/* A box is pressed on by its neighbors: n dynamic discs in a row, many bytes. */
bytes pack_row(int64_t client_id, int32_t session, int64_t seq, int n);

carom_step_request_t steps_of(int64_t client_id, int32_t session, int64_t seq, int64_t from,
                              int n_steps, int every);
carom_session_request_t action_of(int64_t client_id, int32_t session, int64_t seq, int action);
/* Cotangent 1 of coordinate `coord` of q after `step` of 4 bodies. */
carom_loss_gradient_t loss_of(int64_t client_id, int32_t session, int64_t seq, int64_t step,
                              int coord, int wanted);

bytes pack_scene(const carom_scene_t *m);
bytes pack_chunk(const carom_scene_chunk_t *m);
bytes pack_step(const carom_step_request_t *m);
bytes pack_loss(const carom_loss_gradient_t *m);
bytes pack_descent(const carom_parameter_gradient_t *m);
bytes pack_action(const carom_session_request_t *m);
bytes pack_state(const carom_state_t *m);
bytes pack_reply(const carom_reply_t *m);
bytes pack_status(const carom_status_t *m);
/* One valid message of every type, not empty where it has arrays. */
bytes pack_sample(crm_wire_type type);

/* A server on one thread with a clock of the test's, and all it published. */
typedef struct bench {
    crm_server *server;
    double time; /* [s] */
    double tick; /* time that passes with every look at the clock [s] */
    int n;
    int n_max;
    bytes *out;
} bench;

/* NULL: defaults. */
bench *bench_create(const crm_server_settings *settings);
void bench_destroy(bench *b);
void bench_clear(bench *b);
/* Receives and frees the message; works until nothing is left to do. */
void bench_do(bench *b, bytes m);
/* Receives only. */
void bench_receive(bench *b, bytes m);
/* One slice; 0: there is nothing to do. */
int bench_slice(bench *b);

/* The last reply; the text lives until the next call. */
carom_reply_t bench_reply(const bench *b);
int bench_count(const bench *b, crm_wire_type type);
/* The k-th message of its type; destroy with carom_..._t_destroy. */
carom_state_t *bench_state(const bench *b, int k);
carom_parameter_gradient_t *bench_gradient(const bench *b);
carom_scene_t *bench_scene(const bench *b);

#endif
