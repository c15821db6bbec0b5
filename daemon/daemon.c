#include "daemon.h"

#include "carom/base.h"
#include "service.h"
#include "transport/bridge.h"
#include "transport/hub.h"
#include "transport/udpm.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Longer than the half second between two statuses of another daemon. */
static const double LISTEN_SECONDS = 1.2;

struct crm_daemon {
    crm_daemon_settings set;
    char url[256];
    char channels[CRM_WIRE_N_TYPES][64];
    crm_service *service;
    crm_hub *hub;
    crm_bridge *bridge;
    int64_t refused; /* logged so far */
};

/* --- messages */

static void emit(void *user, crm_wire_type type, const void *bytes, int size)
{
    crm_daemon *d = user;
    if (d->hub) {
        crm_hub_publish(d->hub, d->channels[type], bytes, (size_t)size, type == CRM_WIRE_STATE);
    }
    if (d->bridge) crm_bridge_publish(d->bridge, type, bytes, (size_t)size);
}

static void receive(void *user, crm_wire_type type, const void *bytes, size_t size)
{
    const crm_daemon *d = user;
    crm_service_receive(d->service, type, bytes, size);
}

static void refuse_size(void *user, crm_wire_type type, const void *head, size_t n, size_t size)
{
    const crm_daemon *d = user;
    crm_service_refuse_size(d->service, type, head, n, size);
}

/* CRM_WIRE_N_REQUESTS: not a channel of requests. */
static crm_wire_type request_type(const crm_daemon *d, const char *channel)
{
    int type = 0;
    while (type < CRM_WIRE_N_REQUESTS && strcmp(channel, d->channels[type]) != 0) type++;
    return (crm_wire_type)type;
}

static void on_hub_message(void *user, const char *channel, const void *bytes, size_t size)
{
    const crm_wire_type type = request_type(user, channel);
    if (type < CRM_WIRE_N_REQUESTS) receive(user, type, bytes, size);
}

static void on_hub_oversize(void *user, const char *channel, const void *head, size_t n,
                            size_t size)
{
    const crm_wire_type type = request_type(user, channel);
    if (type < CRM_WIRE_N_REQUESTS) refuse_size(user, type, head, n, size);
}

static void on_hub_log(void *user, const char *text)
{
    const crm_daemon *d = user;
    d->set.log(text);
}

/* --- start */

static int64_t random_id(void)
{
    int64_t id = 0;
    FILE *f = fopen("/dev/urandom", "rb");
    if (!f) return 0;
    if (fread(&id, sizeof id, 1, f) != 1) id = 0;
    fclose(f);
    return id;
}

static int start_service(crm_daemon *d, char *text)
{
    crm_server_settings set = d->set.server;
    set.url = d->url;
    set.version = carom_version();
    set.boot_id = random_id();
    set.user = d;
    set.emit = emit;
    d->service = crm_service_create(&set);
    if (!d->service) snprintf(text, CRM_DAEMON_TEXT, "no memory or thread for the workers");
    return d->service != NULL;
}

static int open_hub(crm_daemon *d, char *text)
{
    const crm_hub_settings set = {
        .address = d->set.hub,
        .max_clients = d->set.max_clients,
        .max_message = d->set.server.limits.message,
        .max_queue = (size_t)d->set.max_queue << 20,
        .user = d,
        .on_message = on_hub_message,
        .on_oversize = on_hub_oversize,
        .log = on_hub_log,
    };
    char host[64];
    d->hub = crm_hub_create(&set, text);
    if (!d->hub) return 0;
    snprintf(host, sizeof host, "%.*s", (int)strcspn(d->set.hub, ":"), d->set.hub);
    snprintf(d->url, sizeof d->url, "tcpq://%s:%d", host, crm_hub_port(d->hub));
    return 1;
}

/* The socket of an LCM network that is not there yet is explained before LCM tries. */
static int check_udpm(const crm_daemon *d, char *text)
{
    char found[CRM_UDPM_TEXT] = "";
    if (strncmp(d->set.lcm_url, "udpm://", 7) != 0) return 1;
    const crm_udpm_answer answer = crm_udpm_check(d->set.lcm_url, found);
    if (answer == CRM_UDPM_NO) snprintf(text, CRM_DAEMON_TEXT, "%s", found);
    if (answer == CRM_UDPM_LOSSY) d->set.log(found);
    return answer != CRM_UDPM_NO;
}

static int open_bridge(crm_daemon *d, char *text)
{
    const crm_bridge_settings set = {d->set.server.name, d->set.server.limits.message, d, receive,
                                     refuse_size};
    if (d->set.lcm) {
        d->bridge = crm_bridge_attach(d->set.lcm, &set);
        if (!d->bridge) snprintf(text, CRM_DAEMON_TEXT, "no memory for the LCM network");
        snprintf(d->url, sizeof d->url, "memq://");
        return d->bridge != NULL;
    }
    if (!check_udpm(d, text)) return 0;
    d->bridge = crm_bridge_create(d->set.lcm_url, &set, text);
    if (!d->bridge) return 0;
    snprintf(d->url, sizeof d->url, "%s", d->set.lcm_url);
    if (!crm_bridge_hears_daemon(d->bridge, LISTEN_SECONDS)) return 1;
    snprintf(text, CRM_DAEMON_TEXT,
             "another caromd %s%s%s is on %.200s: give this one another --name",
             d->set.server.name[0] ? "named '" : "without a name", d->set.server.name,
             d->set.server.name[0] ? "'" : "", d->set.lcm_url);
    return 0;
}

static int start_transports(crm_daemon *d, char *text)
{
    snprintf(text, CRM_DAEMON_TEXT, "no memory or thread for the transports");
    if (d->hub && !crm_hub_start(d->hub)) return 0;
    return !d->bridge || crm_bridge_start(d->bridge);
}

crm_daemon *crm_daemon_create(const crm_daemon_settings *settings, char *text)
{
    crm_daemon *d = calloc(1, sizeof *d);
    snprintf(text, CRM_DAEMON_TEXT, "no memory");
    if (!d) return NULL;
    d->set = *settings;
    for (int i = 0; i < CRM_WIRE_N_TYPES; i++) {
        crm_wire_channel_name((crm_wire_type)i, settings->server.name, d->channels[i]);
    }
    const int network = settings->lcm_url || settings->lcm;
    if (network && !open_bridge(d, text)) goto fail;
    if (settings->hub && !open_hub(d, text)) goto fail;
    /* Transports exist before the service that publishes, and the service before the threads that
     * hand it messages. */
    if (!start_service(d, text) || !start_transports(d, text)) goto fail;
    return d;
fail:
    crm_daemon_destroy(d);
    return NULL;
}

void crm_daemon_destroy(crm_daemon *d)
{
    if (!d) return;
    /* First nothing comes in, then nothing is at work, then nothing goes out. */
    if (d->hub) crm_hub_stop(d->hub);
    if (d->bridge) crm_bridge_stop(d->bridge);
    crm_service_destroy(d->service);
    crm_hub_destroy(d->hub);
    crm_bridge_destroy(d->bridge);
    free(d);
}

const char *crm_daemon_url(const crm_daemon *d)
{
    return d->url;
}

void crm_daemon_tick(crm_daemon *d)
{
    char why[256], line[400];
    crm_transport_figures figures = {0, 0};
    if (d->hub) {
        figures.n_clients = crm_hub_n_clients(d->hub);
        figures.states_dropped = crm_hub_dropped(d->hub);
    }
    crm_service_tick(d->service);
    crm_service_status(d->service, figures);
    const int64_t refused = crm_service_malformed(d->service, why);
    if (refused > d->refused) {
        snprintf(line, sizeof line, "%" PRId64 " messages refused, the last one: %s",
                 refused - d->refused, why);
        d->set.log(line);
    }
    d->refused = refused;
}
