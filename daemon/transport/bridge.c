#include "bridge.h"

#include "clock.h"
#include "udpm.h"

#include <errno.h>
#include <fcntl.h>
#include <lcm/lcm.h>
#include <poll.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { QUEUE = 1000 /* messages LCM keeps for a channel */ };

typedef struct channel {
    crm_bridge *bridge;
    crm_wire_type type;
    lcm_subscription_t *subscription;
} channel;

struct crm_bridge {
    crm_bridge_settings set;
    lcm_t *lcm;
    int own;     /* lcm is destroyed with the bridge */
    int wake[2]; /* a byte in the pipe ends the thread */
    int running;
    pthread_t thread;
    channel channels[CRM_WIRE_N_REQUESTS];
    int heard; /* a daemon of the same suffix */
};

static void on_request(const lcm_recv_buf_t *buf, const char *name, void *user)
{
    const channel *c = user;
    const crm_bridge_settings *set = &c->bridge->set;
    (void)name;
    if (buf->data_size > (uint32_t)set->max_message) {
        set->on_oversize(set->user, c->type, buf->data, CRM_WIRE_HEADER_BYTES, buf->data_size);
        return;
    }
    set->on_message(set->user, c->type, buf->data, buf->data_size);
}

static void on_status(const lcm_recv_buf_t *buf, const char *name, void *user)
{
    crm_bridge *b = user;
    char text[256];
    const crm_wire_limits limits = crm_wire_default_limits();
    (void)name;
    if (crm_wire_check(CRM_WIRE_STATUS, &limits, buf->data, buf->data_size, text, sizeof text)) {
        b->heard = 1;
    }
}

static crm_bridge *new_bridge(const crm_bridge_settings *settings)
{
    crm_bridge *b = calloc(1, sizeof *b);
    if (!b) return NULL;
    b->set = *settings;
    b->wake[0] = -1;
    b->wake[1] = -1;
    return b;
}

crm_bridge *crm_bridge_attach(void *lcm, const crm_bridge_settings *settings)
{
    crm_bridge *b = new_bridge(settings);
    if (b) b->lcm = lcm;
    return b;
}

crm_bridge *crm_bridge_create(const char *url, const crm_bridge_settings *settings, char *text)
{
    snprintf(text, CRM_UDPM_TEXT, "no memory or pipe for the LCM network");
    crm_bridge *b = new_bridge(settings);
    if (!b) return NULL;
    b->own = 1;
    if (pipe(b->wake) < 0) goto fail;
    b->lcm = lcm_create(url);
    if (!b->lcm) {
        snprintf(text, CRM_UDPM_TEXT, "LCM does not open '%.200s'", url);
        goto fail;
    }
    return b;
fail:
    crm_bridge_destroy(b);
    return NULL;
}

void crm_bridge_destroy(crm_bridge *b)
{
    if (!b) return;
    crm_bridge_stop(b);
    for (int i = 0; i < CRM_WIRE_N_REQUESTS; i++) {
        if (b->channels[i].subscription) lcm_unsubscribe(b->lcm, b->channels[i].subscription);
    }
    if (b->own && b->lcm) lcm_destroy(b->lcm);
    for (int i = 0; i < 2; i++) {
        if (b->wake[i] >= 0) close(b->wake[i]);
    }
    free(b);
}

/* Handles one message, when one comes within the time.  0: the wake pipe was written to, or the
 * network is gone. */
static int handle(crm_bridge *b, double seconds)
{
    struct pollfd p[2] = {{lcm_get_fileno(b->lcm), POLLIN, 0}, {b->wake[0], POLLIN, 0}};
    const int n = poll(p, 2, seconds < 0 ? -1 : (int)(1000 * seconds));
    if (n < 0) return errno == EINTR;
    if (p[1].revents) return 0;
    return !p[0].revents || lcm_handle(b->lcm) == 0;
}

int crm_bridge_hears_daemon(crm_bridge *b, double seconds)
{
    char name[64];
    crm_wire_channel_name(CRM_WIRE_STATUS, b->set.suffix, name);
    lcm_subscription_t *s = lcm_subscribe(b->lcm, name, on_status, b);
    const double until = crm_clock_now() + seconds;
    for (double left = seconds; left > 0 && !b->heard; left = until - crm_clock_now()) {
        if (!handle(b, left)) break;
    }
    if (s) lcm_unsubscribe(b->lcm, s);
    return b->heard;
}

static void *run(void *argument)
{
    crm_bridge *b = argument;
    while (handle(b, -1)) {
    }
    return NULL;
}

int crm_bridge_start(crm_bridge *b)
{
    for (int i = 0; i < CRM_WIRE_N_REQUESTS; i++) {
        char name[64];
        channel *c = &b->channels[i];
        c->bridge = b;
        c->type = (crm_wire_type)i;
        crm_wire_channel_name(c->type, b->set.suffix, name);
        c->subscription = lcm_subscribe(b->lcm, name, on_request, c);
        if (!c->subscription) return 0;
        lcm_subscription_set_queue_capacity(c->subscription, QUEUE);
    }
    if (!b->own) return 1;
    b->running = pthread_create(&b->thread, NULL, run, b) == 0;
    return b->running;
}

void crm_bridge_stop(crm_bridge *b)
{
    const char byte = 0;
    if (!b->running) return;
    while (write(b->wake[1], &byte, 1) < 0 && errno == EINTR) {
    }
    pthread_join(b->thread, NULL);
    b->running = 0;
}

void crm_bridge_publish(crm_bridge *b, crm_wire_type type, const void *bytes, size_t size)
{
    char name[64];
    crm_wire_channel_name(type, b->set.suffix, name);
    lcm_publish(b->lcm, name, bytes, (unsigned)size);
}
