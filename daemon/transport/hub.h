/* hub.h: an LCM "tcpq" hub on a thread of its own.
 *
 * Any LCM client connects with tcpq://HOST:PORT; what one publishes goes to all that subscribe to
 * the channel, and to on_message.  Sockets never block.  Every subscriber has a queue of bounded
 * size; when it is full the oldest states go first, then the oldest of the rest, and are counted.
 */
#ifndef CRM_HUB_H
#define CRM_HUB_H

#include <stddef.h>
#include <stdint.h>

typedef struct crm_hub_settings {
    const char *address; /* "127.0.0.1:7700"; port 0: a free one */
    int max_clients;
    int max_message;  /* [bytes]; larger ones are skipped */
    size_t max_queue; /* bytes waiting per subscriber */
    void *user;
    /* Called on the hub's thread. */
    void (*on_message)(void *user, const char *channel, const void *bytes, size_t size);
    /* A message larger than max_message: its first n bytes, its size. */
    void (*on_oversize)(void *user, const char *channel, const void *head, size_t n, size_t size);
    void (*log)(void *user, const char *text);
} crm_hub_settings;

typedef struct crm_hub crm_hub;

/* Listens; connections wait.  NULL: `text` (256 bytes) says why. */
crm_hub *crm_hub_create(const crm_hub_settings *settings, char *text);
/* Starts the thread.  0: there is none. */
int crm_hub_start(crm_hub *hub);
/* Ends the thread: on_message is called no more; publishing is still allowed. */
void crm_hub_stop(crm_hub *hub);
/* What is still queued for subscribers that take it at once is sent. */
void crm_hub_destroy(crm_hub *hub);
int crm_hub_port(const crm_hub *hub);

/* From any thread.  is_state: may be dropped first. */
void crm_hub_publish(crm_hub *hub, const char *channel, const void *bytes, size_t size,
                     int is_state);

int crm_hub_n_clients(crm_hub *hub);
int64_t crm_hub_dropped(crm_hub *hub);

#endif
