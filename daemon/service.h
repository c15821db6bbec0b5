/* service.h: a server with its worker threads.  All functions may be called from any thread. */
#ifndef CRM_SERVICE_H
#define CRM_SERVICE_H

#include "session/server.h"

typedef struct crm_service crm_service;

/* Starts settings->n_workers threads; `now` and `utime` are filled in here.  NULL: no memory or no
 * thread. */
crm_service *crm_service_create(const crm_server_settings *settings);
/* Waits for the end of the slices at work. */
void crm_service_destroy(crm_service *service);

void crm_service_receive(crm_service *service, crm_wire_type type, const void *bytes, size_t size);
void crm_service_refuse_size(crm_service *service, crm_wire_type type, const void *head, size_t n,
                             size_t size);
void crm_service_tick(crm_service *service);
void crm_service_status(crm_service *service, crm_transport_figures figures);
/* See crm_server_malformed; `why` (at least 256 bytes) gets a copy. */
int64_t crm_service_malformed(crm_service *service, char *why);

#endif
