/* server.h: the sessions of a daemon.  Bytes of messages in, bytes of messages out; no LCM, no
 * threads, no clock of its own.
 *
 * The side that receives calls crm_server_receive; a side that computes claims a session that has
 * work (take), computes for one time slice (slice), and gives it back (give), until nothing is left
 * to take.  receive, take, give, tick and status must not overlap; slice may overlap with all of
 * them and with slices of other sessions. */
#ifndef CRM_SERVER_H
#define CRM_SERVER_H

#include "wire.h"

/* Limits and times.  The table gives name, default, unit and meaning; caromd has an option --NAME
 * for each (underscores as hyphens). */
#define CRM_SERVER_LIMITS(X)                                                                       \
    X(max_sessions, 1024, "", "sessions at once")                                                  \
    X(max_steps, 1000000, "", "steps of one request")                                              \
    X(max_answer, 64, "MB", "states and gradients that one request may publish")                   \
    X(session_memory, 256, "MB", "memory of one session: world, tape, answers kept, queue")        \
    X(memory, 4096, "MB", "memory of all sessions")                                                \
    X(lease, 30, "s", "a session without a sign of life ends after; 0: never")                     \
    X(slice, 5, "ms", "computing time of a session before the next one has its turn")

typedef struct crm_server_settings {
    crm_wire_limits limits;
#define CRM_SERVER_LIMIT_FIELD(name, value, unit, text) int name;
    CRM_SERVER_LIMITS(CRM_SERVER_LIMIT_FIELD)
#undef CRM_SERVER_LIMIT_FIELD
    const char *name;    /* suffix of the channels, "" for none */
    const char *url;     /* for the status */
    const char *version; /* for the status */
    int64_t boot_id;
    int n_workers; /* for the busy fraction */
    void *user;    /* handed to the functions below */
    /* Monotonic time [s] and time of day [us]. */
    double (*now)(void *user);
    int64_t (*utime)(void *user);
    /* Publishes; may be called from several threads at once. */
    void (*emit)(void *user, crm_wire_type type, const void *bytes, int size);
} crm_server_settings;

/* Limits and times; everything else is the caller's to fill. */
crm_server_settings crm_server_defaults(void);

typedef struct crm_server crm_server;
typedef struct crm_session crm_session;

/* The strings of the settings must outlive the server.  NULL: no memory. */
crm_server *crm_server_create(const crm_server_settings *settings);
void crm_server_destroy(crm_server *server);

/* A message that arrived, of any content.  Answers what needs no computation. */
void crm_server_receive(crm_server *server, crm_wire_type type, const void *bytes, size_t size);
/* The first bytes (n of them) of a message that is larger than the limit and was not read. */
void crm_server_refuse_size(crm_server *server, crm_wire_type type, const void *head, size_t n,
                            size_t size);

/* NULL: nothing to do. */
crm_session *crm_server_take(crm_server *server);
void crm_session_slice(const crm_server *server, crm_session *session);
void crm_server_give(crm_server *server, crm_session *session);

/* Ends sessions whose lease is over. */
void crm_server_tick(crm_server *server);

/* What the transport knows. */
typedef struct crm_transport_figures {
    int n_clients;
    int64_t states_dropped;
} crm_transport_figures;
/* Publishes a status_t. */
void crm_server_status(crm_server *server, crm_transport_figures figures);

int crm_server_n_sessions(const crm_server *server);
/* Messages refused before decoding, and why the last one was. */
int64_t crm_server_malformed(const crm_server *server, const char **why);

#endif
