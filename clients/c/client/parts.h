/* parts.h: what the files of the client library share. */
#ifndef CRM_CLIENT_PARTS_H
#define CRM_CLIENT_PARTS_H

#include "carom/client.h"
#include "carom_loss_gradient_t.h"
#include "carom_parameter_gradient_t.h"
#include "carom_reply_t.h"
#include "carom_scene_chunk_t.h"
#include "carom_scene_t.h"
#include "carom_session_request_t.h"
#include "carom_state_t.h"
#include "carom_step_request_t.h"
#include "wire.h"

#include <lcm/lcm.h>
#include <signal.h>

enum {
    CRM_CHUNK_BYTES = 60000,       /* larger scenes go in pieces of this size */
    CRM_CHUNKS_UNDER_WAY = 8,      /* pieces sent and not acknowledged */
    CRM_MAX_SCENE_BYTES = 4 << 20, /* of a scene */
    CRM_MAX_RESEND = 1000,         /* states asked for again in one request */
    CRM_N_ANSWERS = 4              /* channels a client listens to */
};

/* A request under way: what repeats it, and what its answer consists of. */
typedef struct crm_exchange {
    crm_wire_type type;
    int64_t seq;
    unsigned char *bytes; /* the encoded request; malloc */
    int size;
    /* Answer so far. */
    int has_reply;
    carom_reply_t reply; /* its text is in reply_text */
    char reply_text[256];
    char busy_text[256]; /* why the server does not take the request, "": it did */
    long signs_of_life;  /* messages that brought something new, or that the server is at work */
    int needs_payload;   /* a gradient or a scene belongs to the answer */
    int has_payload;     /* that, or the last state, is there */
    /* Scene in pieces. */
    int n_chunks; /* 0: in one piece */
    int next_chunk;
    unsigned char *acknowledged;
    int n_acknowledged;
    /* States of a step request. */
    carom_step_request_t *step; /* NULL: no states */
    const carom_client_run *run;
    int64_t n_regular;    /* states at from_step + k publish_every, k = 1 to n_regular */
    int64_t n_delivered;  /* of the regular ones */
    carom_state_t **held; /* n_regular, decoded; those that came before an earlier one */
    carom_state_t *last;  /* the last state reached, when it is not a regular one */
    int64_t n_held;
} crm_exchange;

struct carom_client {
    lcm_t *lcm;
    int own; /* lcm is destroyed with the client */
    int fd;
    char where[200]; /* for errors */
    char channels[CRM_WIRE_N_TYPES][64];
    lcm_subscription_t *subscriptions[CRM_N_ANSWERS];
    int64_t client_id;
    int32_t session;
    int open;
    int64_t seq;            /* last used in the session */
    crm_exchange *exchange; /* NULL: none under way */
    carom_client_info info;
    char error[512];
    carom_scene_t scene; /* as the server holds it */
    int has_scene;
    carom_parameter_gradient_t gradient;
    int has_gradient;
    struct crm_scene *file; /* opened from a file: its force tables act */
    carom_client_state state;
    int has_state;
    double *numbers; /* of the state: q, then v */
    int n_numbers_max;
    carom_contact_info *contacts; /* of the state */
    int n_contacts_max;
};

/* Writes the sentence and returns the code. */
carom_client_code crm_client_fail(carom_client *c, carom_client_code code, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/* --- open_file.c */

/* Forgets the scene file. */
void crm_client_forget_file(carom_client *c);
/* What the tables of the file exert in `count` steps from the present one on: *n of them, in the
 * order of steps; malloc.  0: no memory. */
int crm_client_file_forces(const carom_client *c, int count, carom_client_force **forces, int *n);

/* --- exchange.c */

/* Between the two LCM may write to a connection that broke. */
typedef struct crm_guard {
    sigset_t mask;
    int was_pending;
} crm_guard;
void crm_client_guard(crm_guard *guard);
void crm_client_unguard(const crm_guard *guard);

/* Header of the next request. */
crm_wire_header crm_client_next_header(carom_client *c);
/* Sends x->bytes until the answer is complete.  Frees what x holds. */
carom_client_code crm_client_exchange(carom_client *c, crm_exchange *x);

/* --- receive.c */

/* Handler of all subscriptions. */
void crm_client_on_message(const lcm_recv_buf_t *buf, const char *channel, void *user);
/* Hands over the states whose turn it is; with the reply, the last one. */
void crm_client_deliver(carom_client *c);
/* 1: nothing is missing. */
int crm_client_complete(const crm_exchange *x);
/* Steps of the states that are missing: at most n_max of them; returns how many.  Before the reply
 * only the next one. */
int crm_client_missing(const crm_exchange *x, int n_max, int64_t *steps);

/* --- scene_message.c */

/* Encodes the scene; *bytes is malloc.  Negative: client->error says why. */
carom_client_code crm_client_pack_scene(carom_client *c, const carom_client_scene *scene,
                                        crm_wire_header header, unsigned char **bytes, int *size);

#endif
