#include "hub_peer.h"

#include <arpa/inet.h>
#include <errno.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

static const uint32_t MAGIC_CLIENT = 0x287617fb;
static const uint32_t MAGIC_SERVER = 0x287617fa;
static const uint32_t PROTOCOL_VERSION = 0x0100;
enum { READ_BYTES = 1 << 16 };

static uint32_t get_u32(const unsigned char *b)
{
    return (uint32_t)b[0] << 24 | (uint32_t)b[1] << 16 | (uint32_t)b[2] << 8 | b[3];
}

static void put_u32(unsigned char *b, uint32_t x)
{
    for (int i = 0; i < 4; i++) b[i] = (unsigned char)(x >> (24 - 8 * i));
}

static unsigned char *put_bytes(unsigned char *to, const void *from, size_t n)
{
    if (n) memcpy(to, from, n);
    return to + n;
}

/* --- packets */

crm_packet *crm_packet_create(const char *channel, const void *bytes, size_t size, int is_state)
{
    const size_t n = strlen(channel), total = 12 + n + size;
    crm_packet *p = malloc(sizeof *p + total);
    if (!p) return NULL;
    p->n_users = 1;
    p->is_state = is_state;
    p->size = total;
    put_u32(p->bytes, CRM_FRAME_PUBLISH);
    put_u32(p->bytes + 4, (uint32_t)n);
    unsigned char *after = put_bytes(p->bytes + 8, channel, n);
    put_u32(after, (uint32_t)size);
    put_bytes(after + 4, bytes, size);
    return p;
}

void crm_packet_release(crm_packet *p)
{
    if (p && --p->n_users == 0) free(p);
}

/* --- a peer */

/* LCM clients write a message in five pieces without TCP_NODELAY: unless every piece is
 * acknowledged at once (QUICKACK, which the kernel forgets after a while) each message costs 40 ms.
 */
static void acknowledge_quickly(int socket)
{
    const int on = 1;
    setsockopt(socket, IPPROTO_TCP, TCP_QUICKACK, &on, sizeof on);
}

crm_peer *crm_peer_create(int socket)
{
    const int on = 1;
    crm_peer *p = calloc(1, sizeof *p);
    if (!p) return NULL;
    p->socket = socket;
    setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    acknowledge_quickly(socket);
    return p;
}

static void pop(crm_peer *p, crm_queued *before)
{
    crm_queued *q = before ? before->next : p->first;
    if (before) {
        before->next = q->next;
    } else {
        p->first = q->next;
        p->sent = 0;
    }
    if (p->last == q) p->last = before;
    p->queued -= q->packet->size;
    crm_packet_release(q->packet);
    free(q);
}

static void free_subscription(crm_subscription *s)
{
    if (!s->literal) regfree(&s->regex);
}

void crm_peer_free(crm_peer *p)
{
    while (p->first) pop(p, NULL);
    for (int i = 0; i < p->n_subscriptions; i++) free_subscription(&p->subscriptions[i]);
    free(p->subscriptions);
    free(p->input);
    close(p->socket);
    free(p);
}

/* --- subscriptions */

static int is_literal(const char *pattern)
{
    for (const char *c = pattern; *c; c++) {
        if (strchr(".*+?[](){}|^$\\", *c)) return 0;
    }
    return 1;
}

/* Repetition counts and references back cost unbounded time and memory in POSIX matchers. */
static int is_bounded(const char *pattern)
{
    for (const char *c = pattern; *c; c++) {
        if (*c == '{') return 0;
        if (*c == '\\' && c[1] >= '0' && c[1] <= '9') return 0;
    }
    return 1;
}

static int compile(crm_subscription *s, const char *pattern, char *text)
{
    char whole[CRM_PEER_MAX_PATTERN + 8];
    snprintf(s->pattern, sizeof s->pattern, "%s", pattern);
    s->literal = is_literal(pattern);
    if (s->literal) return 1;
    snprintf(whole, sizeof whole, "^(%s)$", pattern);
    if (is_bounded(pattern) && regcomp(&s->regex, whole, REG_EXTENDED | REG_NOSUB) == 0) return 1;
    snprintf(text, 256, "subscription to '%.100s' refused: not a plain regular expression",
             pattern);
    return 0;
}

int crm_peer_subscribe(crm_peer *p, const char *pattern, char *text)
{
    if (p->n_subscriptions == CRM_PEER_MAX_SUBSCRIPTIONS) {
        snprintf(text, 256, "subscription to '%.100s' refused: a client has %d at most", pattern,
                 CRM_PEER_MAX_SUBSCRIPTIONS);
        return 0;
    }
    const size_t n = (size_t)p->n_subscriptions + 1;
    crm_subscription *s = realloc(p->subscriptions, n * sizeof *s);
    if (!s) {
        snprintf(text, 256, "no memory for a subscription");
        return 0;
    }
    p->subscriptions = s;
    if (!compile(&s[n - 1], pattern, text)) return 0;
    p->n_subscriptions++;
    return 1;
}

void crm_peer_unsubscribe(crm_peer *p, const char *pattern)
{
    for (int i = 0; i < p->n_subscriptions; i++) {
        if (strcmp(p->subscriptions[i].pattern, pattern) != 0) continue;
        free_subscription(&p->subscriptions[i]);
        p->subscriptions[i] = p->subscriptions[--p->n_subscriptions];
        return;
    }
}

int crm_peer_wants(const crm_peer *p, const char *channel)
{
    for (int i = 0; i < p->n_subscriptions; i++) {
        const crm_subscription *s = &p->subscriptions[i];
        const int match = s->literal ? strcmp(s->pattern, channel) == 0
                                     : regexec(&s->regex, channel, 0, NULL, 0) == 0;
        if (match) return 1;
    }
    return 0;
}

/* --- output */

/* Drops the oldest state, without one the oldest packet; never one that is half sent.  0: there is
 * none to drop. */
static int drop_one(crm_peer *p)
{
    crm_queued *start = p->sent > 0 ? p->first : NULL;
    crm_queued *before = start;
    for (crm_queued *q = before ? before->next : p->first; q; q = q->next) {
        if (q->packet->is_state) {
            pop(p, before);
            return 1;
        }
        before = q;
    }
    if (start ? !start->next : !p->first) return 0;
    pop(p, start);
    return 1;
}

int crm_peer_push(crm_peer *p, crm_packet *packet, size_t max_queue)
{
    int dropped = 0;
    while (p->queued + packet->size > max_queue && drop_one(p)) dropped++;
    crm_queued *q = malloc(sizeof *q);
    if (!q) return dropped + 1;
    q->next = NULL;
    q->packet = packet;
    packet->n_users++;
    if (p->last) {
        p->last->next = q;
    } else {
        p->first = q;
    }
    p->last = q;
    p->queued += packet->size;
    return dropped;
}

void crm_peer_flush(crm_peer *p)
{
    while (p->first && !p->send_failed) {
        const crm_packet *k = p->first->packet;
        const ssize_t n =
            send(p->socket, k->bytes + p->sent, k->size - p->sent, MSG_NOSIGNAL | MSG_DONTWAIT);
        if (n < 0 && errno == EINTR) continue;
        if (n < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) return;
        if (n < 0) {
            p->send_failed = 1;
            return;
        }
        p->sent += (size_t)n;
        if (p->sent == k->size) pop(p, NULL);
    }
}

/* --- input */

/* Room for n bytes of input in all. */
static int reserve_input(crm_peer *p, size_t n)
{
    if (n <= p->input_size) return 1;
    const size_t to = n > 2 * p->input_size ? n : 2 * p->input_size;
    unsigned char *input = realloc(p->input, to);
    if (!input) return 0;
    p->input = input;
    p->input_size = to;
    return 1;
}

void crm_peer_fill(crm_peer *p)
{
    p->n_input -= p->at;
    if (p->n_input) memmove(p->input, p->input + p->at, p->n_input);
    p->at = 0;
    if (!reserve_input(p, p->n_input + READ_BYTES)) {
        p->ended = 1;
        return;
    }
    const ssize_t n =
        recv(p->socket, p->input + p->n_input, p->input_size - p->n_input, MSG_DONTWAIT);
    if (n < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR)) return;
    if (n <= 0) {
        p->ended = 1;
        return;
    }
    acknowledge_quickly(p->socket);
    p->n_input += (size_t)n;
}

static int broken(crm_peer *p)
{
    p->ended = 1;
    return -1;
}

static int greet(crm_peer *p)
{
    unsigned char answer[8];
    if (p->n_input - p->at < 8) return 0;
    if (get_u32(p->input + p->at) != MAGIC_CLIENT) return broken(p);
    p->at += 8;
    put_u32(answer, MAGIC_SERVER);
    put_u32(answer + 4, PROTOCOL_VERSION);
    if (send(p->socket, answer, 8, MSG_NOSIGNAL | MSG_DONTWAIT) != 8) return broken(p);
    p->greeted = 1;
    return 1;
}

/* Type and channel; returns their bytes, 0: not complete, -1: not LCM. */
static int read_channel(crm_peer *p, crm_frame *f)
{
    const size_t there = p->n_input - p->at;
    const unsigned char *b = p->input + p->at;
    if (there < 8) return 0;
    const uint32_t type = get_u32(b), n = get_u32(b + 4);
    const uint32_t longest =
        type == CRM_FRAME_PUBLISH ? CRM_PEER_MAX_CHANNEL : CRM_PEER_MAX_PATTERN;
    if (type < CRM_FRAME_PUBLISH || type > CRM_FRAME_UNSUBSCRIBE || n < 1 || n > longest) {
        return broken(p);
    }
    if (there < 8 + n) return 0;
    if (memchr(b + 8, 0, n)) return broken(p);
    f->type = (crm_frame_type)type;
    memcpy(f->channel, b + 8, n);
    f->channel[n] = 0;
    return (int)(8 + n);
}

/* Takes from the input what is left of a message that is too large.  0: more is to come. */
static int skip_rest(crm_peer *p)
{
    const size_t there = p->n_input - p->at;
    const size_t n = p->skip < there ? p->skip : there;
    p->skip -= n;
    p->at += n;
    return p->skip == 0;
}

int crm_peer_next(crm_peer *p, size_t max_message, crm_frame *f)
{
    if (!skip_rest(p)) return 0;
    if (!p->greeted) {
        const int done = greet(p);
        if (done <= 0) return done;
    }
    const int n = read_channel(p, f);
    if (n <= 0) return n;
    if (f->type != CRM_FRAME_PUBLISH) {
        p->at += (size_t)n;
        return 1;
    }
    const size_t there = p->n_input - p->at, head = (size_t)n + 4;
    if (there < head) return 0;
    f->size = get_u32(p->input + p->at + n);
    f->n_data = f->size <= max_message || f->size <= CRM_PEER_HEAD ? f->size : CRM_PEER_HEAD;
    if (there < head + f->n_data) return 0;
    f->data = p->input + p->at + head;
    p->at += head + f->n_data;
    p->skip = f->size - f->n_data;
    return 1;
}
