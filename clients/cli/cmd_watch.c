#include "carom/client.h"
#include "carom_reply_t.h"
#include "carom_state_t.h"
#include "carom_status_t.h"
#include "cmd.h"
#include "io/memory.h"
#include "io/output.h"
#include "io/progress.h"
#include "wire.h"

#include <inttypes.h>
#include <lcm/lcm.h>
#include <math.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>

typedef struct watching {
    crm_output out;
    crm_wire_limits limits;
    long seen;
    int n_subscriptions;
    lcm_subscription_t *subscriptions[3];
} watching;

/* What the command line asks for. */
typedef struct plan {
    const char *url;
    const char *name;
    double seconds;
    double count;
} plan;

static void put_integer(crm_output *out, const char *key, int64_t x)
{
    fprintf(out->file, ",\"%s\":%" PRId64, key, x);
}

/* {"KIND":{"client_id":..,"session":..,"seq":.. */
static void put_head(crm_output *out, const char *kind, int64_t client_id, int session, int64_t seq)
{
    fprintf(out->file, "{\"%s\":{\"client_id\":%" PRId64, kind, client_id);
    put_integer(out, "session", session);
    put_integer(out, "seq", seq);
}

static void put_state(crm_output *out, const carom_state_t *m)
{
    put_head(out, "state", m->client_id, m->session, m->seq);
    put_integer(out, "step", m->step);
    crm_put_field(out, 0, "t", m->sim_time);
    crm_put_key(out, 0, "q");
    crm_put_numbers(out, m->num_q, m->q);
    crm_put_key(out, 0, "v");
    crm_put_numbers(out, m->num_v, m->v);
    crm_put_key(out, 0, "status");
    crm_put_text(out, carom_status_name((carom_status)m->status));
    crm_put_field(out, 0, "residual", m->residual);
    crm_put_field(out, 0, "penetration", m->penetration);
    crm_put_field(out, 0, "joint_drift", m->joint_drift);
    crm_put_field(out, 0, "energy", m->energy);
    crm_put_raw(out, "}}\n");
}

static void put_reply(crm_output *out, const carom_reply_t *m)
{
    put_head(out, "reply", m->client_id, m->session, m->seq);
    put_integer(out, "code", m->reply_code);
    crm_put_key(out, 0, "text");
    crm_put_text(out, m->reply_text);
    put_integer(out, "step", m->step);
    crm_put_field(out, 0, "seconds", m->seconds);
    crm_put_raw(out, "}}\n");
}

static void put_status(crm_output *out, const carom_status_t *m)
{
    put_head(out, "status", m->client_id, m->session, m->seq);
    crm_put_key(out, 0, "name");
    crm_put_text(out, m->daemon_name);
    crm_put_key(out, 0, "version");
    crm_put_text(out, m->daemon_version);
    crm_put_key(out, 0, "url");
    crm_put_text(out, m->url);
    crm_put_field(out, 0, "uptime", m->uptime);
    put_integer(out, "sessions", m->num_sessions);
    put_integer(out, "clients", m->num_clients);
    put_integer(out, "queue", m->queue_depth);
    put_integer(out, "steps", m->steps_total);
    put_integer(out, "dropped", m->states_dropped);
    put_integer(out, "malformed", m->malformed);
    crm_put_field(out, 0, "busy", m->busy);
    crm_put_raw(out, "}}\n");
}

/* Decodes and writes a message that the validator passed. */
static void put_message(crm_output *out, crm_wire_type type, const void *bytes, int size)
{
    carom_state_t state;
    carom_reply_t reply;
    carom_status_t status;
    if (type == CRM_WIRE_STATE && carom_state_t_decode(bytes, 0, size, &state) == size) {
        put_state(out, &state);
        carom_state_t_decode_cleanup(&state);
    } else if (type == CRM_WIRE_REPLY && carom_reply_t_decode(bytes, 0, size, &reply) == size) {
        put_reply(out, &reply);
        carom_reply_t_decode_cleanup(&reply);
    } else if (type == CRM_WIRE_STATUS && carom_status_t_decode(bytes, 0, size, &status) == size) {
        put_status(out, &status);
        carom_status_t_decode_cleanup(&status);
    }
    fflush(out->file);
}

static void on_message(const lcm_recv_buf_t *buffer, crm_wire_type type, void *user)
{
    watching *w = user;
    char why[160];
    if (!crm_wire_check(type, &w->limits, buffer->data, buffer->data_size, why, sizeof why)) {
        fprintf(stderr, "carom watch: a %s that is none: %s\n", crm_wire_type_name(type), why);
        return;
    }
    put_message(&w->out, type, buffer->data, (int)buffer->data_size);
    w->seen++;
}

static void on_state(const lcm_recv_buf_t *buffer, const char *channel, void *user)
{
    (void)channel;
    on_message(buffer, CRM_WIRE_STATE, user);
}

static void on_reply(const lcm_recv_buf_t *buffer, const char *channel, void *user)
{
    (void)channel;
    on_message(buffer, CRM_WIRE_REPLY, user);
}

static void on_status(const lcm_recv_buf_t *buffer, const char *channel, void *user)
{
    (void)channel;
    on_message(buffer, CRM_WIRE_STATUS, user);
}

static int subscribe(lcm_t *lcm, const char *name, crm_wire_type type, lcm_msg_handler_t handler,
                     watching *w)
{
    char channel[64];
    crm_wire_channel_name(type, name, channel);
    lcm_subscription_t *s = lcm_subscribe(lcm, channel, handler, w);
    if (!s) return 0;
    lcm_subscription_set_queue_capacity(s, 0); /* no limit */
    w->subscriptions[w->n_subscriptions++] = s;
    return 1;
}

/* lcm_destroy alone would leak what the TCP transport keeps of each. */
static void unsubscribe(lcm_t *lcm, watching *w)
{
    while (w->n_subscriptions > 0) lcm_unsubscribe(lcm, w->subscriptions[--w->n_subscriptions]);
}

/* Until the time is up, enough was seen, or an interruption; 0: the connection broke. */
static int listen(lcm_t *lcm, watching *w, double seconds, double count)
{
    struct pollfd fd = {lcm_get_fileno(lcm), POLLIN, 0};
    const double end = crm_clock() + seconds;
    while (!crm_interrupted() && (double)w->seen < count) {
        const double left = end - crm_clock();
        if (left <= 0) break;
        const int ready = poll(&fd, 1, (int)fmin(1000, 1 + 1000 * left));
        if (ready > 0 && lcm_handle(lcm) < 0) return 0;
    }
    return 1;
}

/* 1: a client could join there; else the reason is on stderr, in fewer words than LCM's. */
static int is_there(const char *url, const char *name)
{
    carom_client *client = carom_client_create();
    if (!client) crm_no_memory();
    const carom_client_code code = carom_client_connect(client, url, name);
    if (code < 0) fprintf(stderr, "carom watch: %s\n", carom_client_error(client));
    carom_client_destroy(client);
    return code >= 0;
}

static int watch(const plan *p, lcm_t *lcm, watching *w)
{
    int good = lcm_get_fileno(lcm) >= 0 && subscribe(lcm, p->name, CRM_WIRE_STATE, on_state, w) &&
               subscribe(lcm, p->name, CRM_WIRE_REPLY, on_reply, w) &&
               subscribe(lcm, p->name, CRM_WIRE_STATUS, on_status, w);
    if (good) good = listen(lcm, w, p->seconds, p->count);
    unsubscribe(lcm, w);
    if (!good) fprintf(stderr, "carom watch: the connection to %s broke\n", p->url);
    return good ? CRM_DONE : CRM_FAILED;
}

static int watch_to_output(const crm_arguments *a, const plan *p)
{
    watching w;
    memset(&w, 0, sizeof w);
    w.limits = crm_wire_default_limits();
    lcm_t *lcm = lcm_create(p->url);
    if (!lcm) {
        fprintf(stderr, "carom watch: LCM does not open %s\n", p->url);
        return CRM_FAILED;
    }
    int code = CRM_USAGE;
    if (crm_output_open(&w.out, crm_argument(a, "--out"))) {
        crm_catch_interrupts();
        code = watch(p, lcm, &w);
        if (!crm_output_close(&w.out)) code = CRM_FAILED;
    }
    lcm_destroy(lcm);
    return code;
}

static int run(const crm_arguments *a)
{
    plan p = {crm_argument(a, "--url"), crm_argument(a, "--name"), HUGE_VAL, HUGE_VAL};
    if (!p.url) p.url = CAROM_CLIENT_URL;
    if (!crm_argument_number(a, "--for", 0, 1e9, &p.seconds) ||
        !crm_argument_number(a, "--count", 1, 1e9, &p.count)) {
        return CRM_USAGE;
    }
    if (p.name && strlen(p.name) > 32) {
        return crm_usage_error(a->command, "--name: at most 32 bytes");
    }
    signal(SIGPIPE, SIG_IGN); /* a hub that is gone is told by lcm_handle */
    return is_there(p.url, p.name) ? watch_to_output(a, &p) : CRM_FAILED;
}

static const crm_option options[] = {{"--url", CRM_TAKES_VALUE}, {"--name", CRM_TAKES_VALUE},
                                     {"--for", CRM_TAKES_VALUE}, {"--count", CRM_TAKES_VALUE},
                                     {"--out", CRM_TAKES_VALUE}, {NULL, 0}};

const crm_command crm_command_watch = {
    "watch",
    "watch [--url URL] [--name NAME] [--for SECONDS] [--count N] [--out FILE]",
    "states, replies and heartbeats heard on an LCM network, one JSON line each",
    "  --url URL          LCM network, " CAROM_CLIENT_URL " otherwise\n"
    "  --name NAME        the one given to caromd with --name\n"
    "  --for SECONDS      ends by itself; otherwise with Ctrl-C\n"
    "  --count N          ends after N messages\n"
    "  --out FILE         where the lines go, standard output otherwise\n",
    options,
    0,
    0,
    run};
