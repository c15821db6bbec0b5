/* parts.h: what server.c, session.c, answer.c and assembly.c share. */
#ifndef CRM_SESSION_PARTS_H
#define CRM_SESSION_PARTS_H

#include "budget.h"
#include "carom_reply_t.h"
#include "carom_scene_chunk_t.h"
#include "carom_session_request_t.h"
#include "carom_status_t.h"
#include "carom_step_request_t.h"
#include "engine.h"
#include "server.h"

enum {
    CRM_WINDOW = 8,     /* requests of a session that may wait, and answers that are kept */
    CRM_BUCKETS = 1024, /* of the table of sessions */
    CRM_DECODED = 4     /* a decoded message takes at most about so many times its bytes */
};

/* --- answer.c: messages that were published, kept to be published again */

typedef struct crm_message {
    crm_wire_type type;
    int size;
    unsigned char *bytes;
} crm_message;

/* 1: m->bytes (malloc) is the encoded message.  0: no memory. */
int crm_pack_state(const carom_state_t *state, crm_message *m);
int crm_pack_gradient(const carom_parameter_gradient_t *gradient, crm_message *m);
int crm_pack_scene_updated(const carom_scene_t *scene, crm_message *m);
int crm_pack_reply(const carom_reply_t *reply, crm_message *m);
int crm_pack_status(const carom_status_t *status, crm_message *m);

/* What was published for one request; the states first, by step, the reply last. */
typedef struct crm_answer {
    int64_t seq; /* 0: none */
    int n;
    int n_max;
    int n_states;
    crm_message *messages;
    size_t bytes; /* taken from the budget */
} crm_answer;

/* Takes over the message.  0: no room in the budget; the message is freed. */
int crm_answer_add(crm_answer *answer, crm_budget *budget, crm_message m);
void crm_answer_clear(crm_answer *answer, crm_budget *budget);
/* Publishes again: n_steps = 0: all, else the states of these steps and all that is no state. */
void crm_answer_repeat(const crm_answer *answer, const crm_server_settings *set, int n_steps,
                       const int64_t *steps);

/* --- assembly.c: a scene that arrives in pieces */

typedef struct crm_assembly {
    int64_t seq; /* 0: none */
    int size;    /* bytes of the scene */
    int stride;
    int n_chunks;
    int n_missing;
    unsigned char *bytes;
    unsigned char *has; /* n_chunks */
} crm_assembly;

/* 1: the piece is in.  0: it does not fit; text says why.  -1: no memory in the budget. */
int crm_assembly_add(crm_assembly *assembly, crm_budget *budget, const carom_scene_chunk_t *chunk,
                     int max_size, char *text);
void crm_assembly_clear(crm_assembly *assembly, crm_budget *budget);

/* --- session.c: requests and their execution */

typedef struct crm_request {
    crm_wire_type type;
    int64_t seq;
    size_t held; /* taken from the budget */
    union {
        carom_scene_t scene;
        carom_step_request_t step;
        carom_loss_gradient_t loss;
        carom_parameter_gradient_t descent;
        carom_session_request_t session;
    } as;
} crm_request;

/* 1: decoded from bytes that passed the check.  0: no memory. */
int crm_request_decode(crm_request *request, crm_wire_type type, const void *bytes, size_t size);
void crm_request_free(crm_request *request);

/* How far the request at the head of the queue is. */
typedef struct crm_progress {
    int started;
    int done;
    int closing;       /* the session ends with this request */
    int n_steps;       /* made so far */
    int at_force;      /* next of the step request's forces */
    int64_t published; /* last step published; -1: none */
    int code;          /* of reply_t */
    carom_status status;
    double seconds;
    double slice_seconds;
    int64_t steps_in_slice;
    char text[CRM_TEXT];
} crm_progress;

struct crm_session {
    crm_session *next_in_bucket;
    crm_session *next_ready;
    int working; /* claimed by a worker, who alone may touch what is marked (w) */
    int64_t client_id;
    int32_t id;
    int64_t next_seq;
    double lease; /* [s]; 0: for ever */
    double seen;  /* last sign of life [s] */
    int n_queued;
    crm_request queue[CRM_WINDOW]; /* in order of seq; the head is (w) */
    crm_answer kept[CRM_WINDOW];   /* at seq modulo CRM_WINDOW */
    crm_assembly assembly;
    crm_budget budget;
    /* What replies say; taken over from the engine at the end of a slice. */
    int64_t step;
    int64_t first_step;
    int recorded;
    crm_progress progress; /* (w) */
    crm_answer answer;     /* (w) of the request at the head */
    crm_engine *engine;    /* (w) NULL: no scene yet */
    size_t scene_held;     /* (w) taken from the budget for the engine's copy of the scene */
    double *force;         /* (w) 3 per body of the engine, zero between steps */
    int n_force;           /* (w) */
};

/* Works on the request at the head of the queue for one time slice. */
void crm_session_run(const crm_server_settings *set, crm_session *session);
/* Frees what the session holds, and itself. */
void crm_session_free(crm_session *session);

#endif
