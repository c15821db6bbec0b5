/* hub_peer.h: one connection of the hub: subscriptions, output queue, input frames.  Not
 * synchronized.
 *
 * A frame is  type, channel length, channel [, data length, data]  with 32-bit big-endian numbers;
 * type 1 publishes, 2 subscribes to all channels that match a regular expression, 3 takes that
 * back. Before the first one both sides send a magic number and a version. */
#ifndef CRM_HUB_PEER_H
#define CRM_HUB_PEER_H

#include <regex.h>
#include <stddef.h>
#include <stdint.h>

enum {
    CRM_PEER_MAX_CHANNEL = 63,
    CRM_PEER_MAX_PATTERN = 128,
    CRM_PEER_MAX_SUBSCRIPTIONS = 256,
    CRM_PEER_HEAD = 64 /* bytes kept of a message that is too large */
};

typedef enum crm_frame_type {
    CRM_FRAME_PUBLISH = 1,
    CRM_FRAME_SUBSCRIBE = 2,
    CRM_FRAME_UNSUBSCRIBE = 3
} crm_frame_type;

/* A published message as it goes over the wire, shared by the queues it is in. */
typedef struct crm_packet {
    int n_users;
    int is_state;
    size_t size;
    unsigned char bytes[];
} crm_packet;

/* One user, the caller.  NULL: no memory. */
crm_packet *crm_packet_create(const char *channel, const void *bytes, size_t size, int is_state);
void crm_packet_release(crm_packet *packet);

typedef struct crm_subscription {
    char pattern[CRM_PEER_MAX_PATTERN + 1];
    int literal; /* no special character: compared, not matched */
    regex_t regex;
} crm_subscription;

typedef struct crm_queued {
    struct crm_queued *next;
    crm_packet *packet;
} crm_queued;

typedef struct crm_peer {
    int socket;
    int ended;       /* noticed while reading */
    int send_failed; /* ... while sending */
    int greeted;
    int n_subscriptions;
    crm_subscription *subscriptions;
    /* Output. */
    crm_queued *first;
    crm_queued *last;
    size_t queued; /* bytes */
    size_t sent;   /* of the first packet */
    /* Input. */
    unsigned char *input;
    size_t at; /* start of what is not taken yet */
    size_t n_input;
    size_t input_size;
    size_t skip; /* bytes of a message that is too large, still to come */
} crm_peer;

/* Takes over the socket.  NULL: no memory. */
crm_peer *crm_peer_create(int socket);
/* Closes the socket. */
void crm_peer_free(crm_peer *peer);

/* 0: not such a pattern, or too many; `text` (256 bytes) says why. */
int crm_peer_subscribe(crm_peer *peer, const char *pattern, char *text);
void crm_peer_unsubscribe(crm_peer *peer, const char *pattern);
int crm_peer_wants(const crm_peer *peer, const char *channel);

/* Queues the packet, one user more; returns how many others were dropped to make room. */
int crm_peer_push(crm_peer *peer, crm_packet *packet, size_t max_queue);
/* Sends what the socket takes. */
void crm_peer_flush(crm_peer *peer);

/* Reads what is there, up to the room of its buffer. */
void crm_peer_fill(crm_peer *peer);

typedef struct crm_frame {
    crm_frame_type type;
    char channel[CRM_PEER_MAX_PATTERN + 1];
    const unsigned char *data; /* view into the input, until the next fill */
    size_t n_data;             /* there; the head only when the message is too large */
    size_t size;               /* of the message */
} crm_frame;

/* 1: *frame is the next one, taken from the input.  0: not complete yet.  -1: not LCM; the peer
 * has ended. */
int crm_peer_next(crm_peer *peer, size_t max_message, crm_frame *frame);

#endif
