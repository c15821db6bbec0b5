#include "hub.h"

#include "hub_peer.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <poll.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

struct crm_hub {
    crm_hub_settings set;
    int listener;
    int port;
    int wake[2]; /* a byte in the pipe ends the poll */
    pthread_t thread;
    int running;
    /* Only the hub's thread adds and removes peers, and reads from them.  The lock covers the list,
     * subscriptions and output queues. */
    pthread_mutex_t lock;
    int n_peers;
    crm_peer **peers; /* max_clients */
    int64_t dropped;
    int stop;
    struct pollfd *polls; /* max_clients + 2, of the thread */
};

/* --- from any thread */

static void wake_up(crm_hub *h)
{
    const char byte = 0;
    /* A full pipe wakes as well. */
    const ssize_t n = write(h->wake[1], &byte, 1);
    (void)n;
}

/* With the lock. */
static void distribute(crm_hub *h, const char *channel, crm_packet *packet)
{
    int waiting = 0;
    for (int i = 0; i < h->n_peers; i++) {
        crm_peer *p = h->peers[i];
        if (p->send_failed || !crm_peer_wants(p, channel)) continue;
        h->dropped += crm_peer_push(p, packet, h->set.max_queue);
        crm_peer_flush(p);
        waiting |= p->first != NULL || p->send_failed;
    }
    if (waiting) wake_up(h);
}

void crm_hub_publish(crm_hub *h, const char *channel, const void *bytes, size_t size, int is_state)
{
    crm_packet *packet = crm_packet_create(channel, bytes, size, is_state);
    if (!packet) return;
    pthread_mutex_lock(&h->lock);
    distribute(h, channel, packet);
    crm_packet_release(packet);
    pthread_mutex_unlock(&h->lock);
}

int crm_hub_n_clients(crm_hub *h)
{
    pthread_mutex_lock(&h->lock);
    const int n = h->n_peers;
    pthread_mutex_unlock(&h->lock);
    return n;
}

int64_t crm_hub_dropped(crm_hub *h)
{
    pthread_mutex_lock(&h->lock);
    const int64_t n = h->dropped;
    pthread_mutex_unlock(&h->lock);
    return n;
}

int crm_hub_port(const crm_hub *h)
{
    return h->port;
}

/* --- on the hub's thread */

static void accept_peer(crm_hub *h)
{
    const int socket = accept(h->listener, NULL, NULL);
    if (socket < 0) return;
    if (h->n_peers == h->set.max_clients) {
        h->set.log(h->set.user, "a connection was refused: too many clients (--max-clients)");
        close(socket);
        return;
    }
    crm_peer *p = crm_peer_create(socket);
    if (!p) {
        close(socket);
        return;
    }
    pthread_mutex_lock(&h->lock);
    h->peers[h->n_peers++] = p;
    pthread_mutex_unlock(&h->lock);
}

static void subscribe(crm_hub *h, crm_peer *p, const crm_frame *f)
{
    char text[256];
    pthread_mutex_lock(&h->lock);
    const int done = f->type == CRM_FRAME_UNSUBSCRIBE || crm_peer_subscribe(p, f->channel, text);
    if (f->type == CRM_FRAME_UNSUBSCRIBE) crm_peer_unsubscribe(p, f->channel);
    pthread_mutex_unlock(&h->lock);
    if (!done) h->set.log(h->set.user, text);
}

static void take_frame(crm_hub *h, crm_peer *p, const crm_frame *f)
{
    if (f->type != CRM_FRAME_PUBLISH) {
        subscribe(h, p, f);
    } else if (f->n_data < f->size) {
        h->set.on_oversize(h->set.user, f->channel, f->data, f->n_data, f->size);
    } else {
        crm_hub_publish(h, f->channel, f->data, f->size, 0);
        h->set.on_message(h->set.user, f->channel, f->data, f->size);
    }
}

static void read_peer(crm_hub *h, crm_peer *p)
{
    crm_frame f;
    crm_peer_fill(p);
    while (crm_peer_next(p, (size_t)h->set.max_message, &f) > 0) take_frame(h, p, &f);
}

static void remove_ended(crm_hub *h)
{
    pthread_mutex_lock(&h->lock);
    for (int i = h->n_peers - 1; i >= 0; i--) {
        if (!h->peers[i]->ended && !h->peers[i]->send_failed) continue;
        crm_peer_free(h->peers[i]);
        h->peers[i] = h->peers[--h->n_peers];
    }
    pthread_mutex_unlock(&h->lock);
}

/* What to wait for; returns the number of peers.  1 in *stop: the hub ends. */
static int list_polls(crm_hub *h, int *stop)
{
    h->polls[0] = (struct pollfd){h->wake[0], POLLIN, 0};
    h->polls[1] = (struct pollfd){h->listener, POLLIN, 0};
    pthread_mutex_lock(&h->lock);
    *stop = h->stop;
    for (int i = 0; i < h->n_peers; i++) {
        const crm_peer *p = h->peers[i];
        const short events = (short)(p->first ? POLLIN | POLLOUT : POLLIN);
        h->polls[2 + i] = (struct pollfd){p->socket, events, 0};
    }
    const int n = h->n_peers;
    pthread_mutex_unlock(&h->lock);
    return n;
}

static void serve(crm_hub *h, int n)
{
    char bytes[64];
    if (h->polls[0].revents) {
        while (read(h->wake[0], bytes, sizeof bytes) > 0) {
        }
    }
    for (int i = 0; i < n; i++) {
        crm_peer *p = h->peers[i];
        if (h->polls[2 + i].revents & POLLOUT) {
            pthread_mutex_lock(&h->lock);
            crm_peer_flush(p);
            pthread_mutex_unlock(&h->lock);
        }
        if (h->polls[2 + i].revents & (POLLIN | POLLHUP | POLLERR)) read_peer(h, p);
    }
    if (h->polls[1].revents) accept_peer(h);
    remove_ended(h);
}

static void *run(void *argument)
{
    crm_hub *h = argument;
    for (;;) {
        int stop = 0;
        const int n = list_polls(h, &stop);
        if (stop) return NULL;
        if (poll(h->polls, (nfds_t)n + 2, -1) > 0) serve(h, n);
    }
}

/* --- start and end */

/* "127.0.0.1:7700" -> address; 0: text says why. */
static int parse_address(const char *from, struct sockaddr_in *to, char *text)
{
    char host[64] = "", rest = 0;
    int port = -1;
    memset(to, 0, sizeof *to);
    to->sin_family = AF_INET;
    const int n = sscanf(from, "%63[^:]:%d%c", host, &port, &rest);
    const char *name = strcmp(host, "localhost") == 0 ? "127.0.0.1" : host;
    if (n != 2 || port < 0 || port > 65535 || inet_pton(AF_INET, name, &to->sin_addr) != 1) {
        snprintf(text, 256, "'%.100s' is not ADDRESS:PORT, like 127.0.0.1:7700", from);
        return 0;
    }
    to->sin_port = htons((uint16_t)port);
    return 1;
}

static int open_listener(crm_hub *h, char *text)
{
    struct sockaddr_in address;
    socklen_t length = sizeof address;
    const int on = 1;
    if (!parse_address(h->set.address, &address, text)) return 0;
    h->listener = socket(AF_INET, SOCK_STREAM, 0);
    if (h->listener < 0) {
        snprintf(text, 256, "no socket: %s", strerror(errno));
        return 0;
    }
    setsockopt(h->listener, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    if (bind(h->listener, (struct sockaddr *)&address, sizeof address) < 0 ||
        listen(h->listener, 128) < 0 ||
        getsockname(h->listener, (struct sockaddr *)&address, &length) < 0) {
        snprintf(text, 256, "%.100s: %s%s", h->set.address, strerror(errno),
                 errno == EADDRINUSE ? ": another caromd?  --hub 127.0.0.1:0 takes a free port"
                                     : "");
        return 0;
    }
    h->port = ntohs(address.sin_port);
    return 1;
}

static void free_hub(crm_hub *h)
{
    for (int i = 0; i < h->n_peers; i++) {
        crm_peer_flush(h->peers[i]);
        crm_peer_free(h->peers[i]);
    }
    if (h->listener >= 0) close(h->listener);
    for (int i = 0; i < 2; i++) {
        if (h->wake[i] >= 0) close(h->wake[i]);
    }
    pthread_mutex_destroy(&h->lock);
    free(h->peers);
    free(h->polls);
    free(h);
}

static int set_nonblocking(int fd)
{
    return fcntl(fd, F_SETFL, O_NONBLOCK) == 0;
}

crm_hub *crm_hub_create(const crm_hub_settings *settings, char *text)
{
    crm_hub *h = calloc(1, sizeof *h);
    snprintf(text, 256, "no memory or pipe for the hub");
    if (!h) return NULL;
    h->set = *settings;
    h->listener = -1;
    h->wake[0] = -1;
    h->wake[1] = -1;
    pthread_mutex_init(&h->lock, NULL);
    const size_t n = (size_t)settings->max_clients;
    h->peers = calloc(n, sizeof(crm_peer *));
    h->polls = calloc(n + 2, sizeof *h->polls);
    if (!h->peers || !h->polls || pipe(h->wake) < 0) goto fail;
    if (!open_listener(h, text)) goto fail;
    if (!set_nonblocking(h->wake[0]) || !set_nonblocking(h->wake[1])) goto fail;
    if (!set_nonblocking(h->listener)) goto fail;
    return h;
fail:
    free_hub(h);
    return NULL;
}

int crm_hub_start(crm_hub *h)
{
    h->running = pthread_create(&h->thread, NULL, run, h) == 0;
    return h->running;
}

void crm_hub_stop(crm_hub *h)
{
    if (!h->running) return;
    pthread_mutex_lock(&h->lock);
    h->stop = 1;
    pthread_mutex_unlock(&h->lock);
    wake_up(h);
    pthread_join(h->thread, NULL);
    h->running = 0;
}

void crm_hub_destroy(crm_hub *h)
{
    if (!h) return;
    crm_hub_stop(h);
    free_hub(h);
}
