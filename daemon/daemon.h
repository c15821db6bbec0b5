/* daemon.h: a service behind its transports: the hub, an LCM network, or both. */
#ifndef CRM_DAEMON_H
#define CRM_DAEMON_H

#include "session/server.h"

enum { CRM_DAEMON_TEXT = 512 };

typedef struct crm_daemon_settings {
    crm_server_settings server; /* name, limits, n_workers; the rest is filled in */
    const char *hub;            /* ADDRESS:PORT, NULL: none */
    const char *lcm_url;        /* NULL: none */
    void *lcm;                  /* an lcm_t of the caller instead of lcm_url; may be NULL */
    int max_clients;            /* of the hub */
    int max_queue;              /* [MB] waiting per subscriber of the hub */
    void (*log)(const char *text);
} crm_daemon_settings;

typedef struct crm_daemon crm_daemon;

/* Starts to serve.  NULL: `text` (CRM_DAEMON_TEXT bytes) says why. */
crm_daemon *crm_daemon_create(const crm_daemon_settings *settings, char *text);
void crm_daemon_destroy(crm_daemon *daemon);
/* Where clients connect. */
const char *crm_daemon_url(const crm_daemon *daemon);
/* To be called twice a second: ends sessions, publishes the status, logs what was refused. */
void crm_daemon_tick(crm_daemon *daemon);

#endif
