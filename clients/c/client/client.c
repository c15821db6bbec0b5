/* client.c: connection, and one function per request. */
#include "parts.h"

#include <arpa/inet.h>
#include <netdb.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

static const crm_wire_type answers[CRM_N_ANSWERS] = {CRM_WIRE_STATE, CRM_WIRE_PARAMETER_GRADIENT,
                                                     CRM_WIRE_SCENE_UPDATED, CRM_WIRE_REPLY};

enum { LCM_QUEUE = 100000 /* messages LCM keeps for a channel: states come in bursts */ };

carom_client_code crm_client_fail(carom_client *c, carom_client_code code, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    vsnprintf(c->error, sizeof c->error, format, args);
    va_end(args);
    return code;
}

carom_client *carom_client_create(void)
{
    return calloc(1, sizeof(carom_client));
}

const char *carom_client_error(const carom_client *c)
{
    return c ? c->error : "no memory for a client";
}

carom_client_info carom_client_last(const carom_client *c)
{
    return c->info;
}

/* --- connection */

static void disconnect(carom_client *c)
{
    crm_guard g;
    crm_client_guard(&g);
    for (int i = 0; i < CRM_N_ANSWERS; i++) {
        if (c->subscriptions[i]) lcm_unsubscribe(c->lcm, c->subscriptions[i]);
        c->subscriptions[i] = NULL;
    }
    if (c->lcm && c->own) lcm_destroy(c->lcm);
    c->lcm = NULL;
    c->open = 0;
    crm_client_unguard(&g);
}

void carom_client_destroy(carom_client *c)
{
    if (!c) return;
    if (c->open) carom_client_close(c);
    disconnect(c);
    if (c->has_scene) carom_scene_t_decode_cleanup(&c->scene);
    if (c->has_gradient) carom_parameter_gradient_t_decode_cleanup(&c->gradient);
    crm_client_forget_file(c);
    free(c->numbers);
    free(c->contacts);
    free(c);
}

/* Two clients must not share an id; time and address stand in where there is no random device. */
static int64_t random_id(const carom_client *c)
{
    int64_t id = 0;
    FILE *f = fopen("/dev/urandom", "rb");
    if (f) {
        if (fread(&id, sizeof id, 1, f) != 1) id = 0;
        fclose(f);
    }
    struct timespec t;
    clock_gettime(CLOCK_REALTIME, &t);
    return id ? id : (int64_t)(t.tv_sec ^ t.tv_nsec * 4294967291 ^ (intptr_t)c ^ getpid());
}

/* 1: something listens at "tcpq://HOST:PORT".  LCM would print, and return an lcm_t all the same.
 */
static int listens(const char *url)
{
    char host[128] = "127.0.0.1", port[16] = "7700";
    struct addrinfo hints, *list = NULL;
    int found = 0;
    sscanf(url, "tcpq://%127[^:/]:%15[0-9]", host, port);
    memset(&hints, 0, sizeof hints);
    hints.ai_socktype = SOCK_STREAM;
    if (getaddrinfo(host, port, &hints, &list) != 0) return 0;
    for (const struct addrinfo *a = list; a && !found; a = a->ai_next) {
        const int s = socket(a->ai_family, a->ai_socktype, a->ai_protocol);
        if (s < 0) continue;
        found = connect(s, a->ai_addr, a->ai_addrlen) == 0;
        close(s);
    }
    freeaddrinfo(list);
    return found;
}

static carom_client_code subscribe(carom_client *c, const char *daemon)
{
    if (daemon && strlen(daemon) > 32) {
        return crm_client_fail(c, CAROM_CLIENT_E_ARGUMENT, "daemon: at most 32 characters");
    }
    for (int i = 0; i < CRM_WIRE_N_TYPES; i++) {
        crm_wire_channel_name((crm_wire_type)i, daemon, c->channels[i]);
    }
    c->fd = lcm_get_fileno(c->lcm);
    if (c->fd < 0) {
        return crm_client_fail(c, CAROM_CLIENT_E_NETWORK, "no connection to %s", c->where);
    }
    for (int i = 0; i < CRM_N_ANSWERS; i++) {
        c->subscriptions[i] =
            lcm_subscribe(c->lcm, c->channels[answers[i]], crm_client_on_message, c);
        if (!c->subscriptions[i]) {
            return crm_client_fail(c, CAROM_CLIENT_E_NETWORK, "%s takes no subscription", c->where);
        }
        lcm_subscription_set_queue_capacity(c->subscriptions[i], LCM_QUEUE);
    }
    c->client_id = random_id(c);
    return CAROM_CLIENT_OK;
}

carom_client_code carom_client_connect(carom_client *c, const char *url, const char *daemon)
{
    if (!c) return CAROM_CLIENT_E_MEMORY;
    if (c->lcm) return crm_client_fail(c, CAROM_CLIENT_E_ARGUMENT, "already connected");
    snprintf(c->where, sizeof c->where, "%s", url ? url : CAROM_CLIENT_URL);
    if (strncmp(c->where, "tcpq://", 7) == 0 && !listens(c->where)) {
        return crm_client_fail(c, CAROM_CLIENT_E_NETWORK,
                               "nothing listens at %s: is caromd running there?", c->where);
    }
    c->lcm = lcm_create(c->where);
    if (!c->lcm) {
        return crm_client_fail(c, CAROM_CLIENT_E_NETWORK, "LCM does not open %s", c->where);
    }
    c->own = 1;
    const carom_client_code code = subscribe(c, daemon);
    if (code < 0) disconnect(c);
    return code;
}

carom_client_code carom_client_attach(carom_client *c, void *lcm, const char *daemon)
{
    if (!c) return CAROM_CLIENT_E_MEMORY;
    if (c->lcm) return crm_client_fail(c, CAROM_CLIENT_E_ARGUMENT, "already connected");
    snprintf(c->where, sizeof c->where, "the given LCM network");
    c->lcm = lcm;
    c->own = 0;
    const carom_client_code code = subscribe(c, daemon);
    if (code < 0) disconnect(c);
    return code;
}

/* --- requests */

static carom_client_code needs_session(carom_client *c)
{
    if (c->open) return CAROM_CLIENT_OK;
    return crm_client_fail(c, CAROM_CLIENT_E_SESSION, "no session is open: open a scene first");
}

static carom_client_code no_memory(carom_client *c)
{
    return crm_client_fail(c, CAROM_CLIENT_E_MEMORY, "no memory for the request");
}

carom_client_code carom_client_open(carom_client *c, const carom_client_scene *scene)
{
    crm_exchange x = {0};
    carom_scene_t copy;
    if (!c->lcm) return crm_client_fail(c, CAROM_CLIENT_E_NETWORK, "connect first");
    if (!c->open) {
        c->session++;
        c->seq = 0;
    }
    x.type = CRM_WIRE_SCENE;
    carom_client_code code =
        crm_client_pack_scene(c, scene, crm_client_next_header(c), &x.bytes, &x.size);
    if (code < 0) return code;
    if (carom_scene_t_decode(x.bytes, 0, x.size, &copy) != x.size) {
        free(x.bytes);
        return no_memory(c);
    }
    code = crm_client_exchange(c, &x);
    /* A session whose first scene was refused is there all the same, without a scene. */
    if (c->seq > 0 && code != CAROM_CLIENT_E_SESSION) c->open = 1;
    if (code < 0) {
        carom_scene_t_decode_cleanup(&copy);
        return code;
    }
    crm_client_forget_file(c);
    c->has_state = 0;
    if (c->has_scene) carom_scene_t_decode_cleanup(&c->scene);
    c->scene = copy;
    c->has_scene = 1;
    return code;
}

static carom_client_code send_action(carom_client *c, int action, int snapshot)
{
    crm_exchange x = {0};
    carom_session_request_t m = {0};
    carom_client_code code = needs_session(c);
    if (code < 0) return code;
    const crm_wire_header h = crm_client_next_header(c);
    m.utime = h.utime;
    m.client_id = h.client_id;
    m.session = h.session;
    m.seq = h.seq;
    m.session_action = (int8_t)action;
    m.snapshot = snapshot;
    m.lease = -1;
    x.type = CRM_WIRE_SESSION;
    x.size = carom_session_request_t_encoded_size(&m);
    x.bytes = malloc((size_t)x.size);
    if (!x.bytes) return no_memory(c);
    carom_session_request_t_encode(x.bytes, 0, x.size, &m);
    const int64_t seq = c->seq;
    code = crm_client_exchange(c, &x);
    /* Keeping alive has no seq of its own. */
    if (action == CAROM_SESSION_REQUEST_T_KEEP_ALIVE) c->seq = seq;
    return code;
}

carom_client_code carom_client_close(carom_client *c)
{
    carom_client_code code = send_action(c, CAROM_SESSION_REQUEST_T_CLOSE, 0);
    /* A repeated request finds the session closed: what was asked for. */
    if (code == CAROM_CLIENT_E_SESSION && c->session > 0 && c->lcm) code = CAROM_CLIENT_OK;
    c->open = 0;
    c->has_state = 0;
    return code;
}

carom_client_code carom_client_snapshot(carom_client *c, int number)
{
    return send_action(c, CAROM_SESSION_REQUEST_T_SNAPSHOT, number);
}

carom_client_code carom_client_restore(carom_client *c, int number)
{
    return send_action(c, CAROM_SESSION_REQUEST_T_RESTORE, number);
}

carom_client_code carom_client_reset(carom_client *c)
{
    return send_action(c, CAROM_SESSION_REQUEST_T_RESET, 0);
}

carom_client_code carom_client_keep_alive(carom_client *c)
{
    return send_action(c, CAROM_SESSION_REQUEST_T_KEEP_ALIVE, 0);
}
