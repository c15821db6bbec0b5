/* bridge.h: a daemon on an LCM network. */
#ifndef CRM_BRIDGE_H
#define CRM_BRIDGE_H

#include "wire.h"

typedef struct crm_bridge_settings {
    const char *suffix; /* of the channels, "" for none */
    int max_message;    /* [bytes] */
    void *user;
    /* A message on a request channel; on the thread that handles the LCM network. */
    void (*on_message)(void *user, crm_wire_type type, const void *bytes, size_t size);
    /* Larger than max_message. */
    void (*on_oversize)(void *user, crm_wire_type type, const void *head, size_t n, size_t size);
} crm_bridge_settings;

typedef struct crm_bridge crm_bridge;

/* NULL: `text` (512 bytes) says why. */
crm_bridge *crm_bridge_create(const char *url, const crm_bridge_settings *settings, char *text);
/* On an lcm_t of the caller, who handles its messages and destroys it after the bridge. */
crm_bridge *crm_bridge_attach(void *lcm, const crm_bridge_settings *settings);
void crm_bridge_destroy(crm_bridge *bridge);

/* Listens for a daemon with the same suffix; 1: there is one. */
int crm_bridge_hears_daemon(crm_bridge *bridge, double seconds);
/* Subscribes to the request channels; the bridge of a URL gets a thread that handles them.  0: no
 * memory or thread. */
int crm_bridge_start(crm_bridge *bridge);
/* Ends the thread: on_message is called no more; publishing is still allowed. */
void crm_bridge_stop(crm_bridge *bridge);

/* From any thread. */
void crm_bridge_publish(crm_bridge *bridge, crm_wire_type type, const void *bytes, size_t size);

#endif
