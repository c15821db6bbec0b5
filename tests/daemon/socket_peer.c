#include "socket_peer.h"

#include "near.h"

#include <arpa/inet.h>
#include <errno.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

static void put_u32(unsigned char *b, uint32_t x)
{
    for (int i = 0; i < 4; i++) b[i] = (unsigned char)(x >> (24 - 8 * i));
}

static uint32_t get_u32(const unsigned char *b)
{
    return (uint32_t)b[0] << 24 | (uint32_t)b[1] << 16 | (uint32_t)b[2] << 8 | b[3];
}

/* 1: n bytes are there. */
static int read_all(int socket, double seconds, void *bytes, size_t n)
{
    unsigned char *at = bytes;
    struct pollfd p = {socket, POLLIN, 0};
    while (n > 0) {
        if (poll(&p, 1, (int)(1000 * seconds)) <= 0) return 0;
        const ssize_t k = recv(socket, at, n, 0);
        if (k <= 0) return 0;
        at += k;
        n -= (size_t)k;
    }
    return 1;
}

void peer_send(int socket, const void *bytes, size_t n)
{
    const unsigned char *at = bytes;
    while (n > 0) {
        const ssize_t k = send(socket, at, n, MSG_NOSIGNAL);
        if (k < 0 && errno == EINTR) continue;
        if (k <= 0) return; /* the hub hung up: the test will see */
        at += k;
        n -= (size_t)k;
    }
}

int peer_connect(int port, int greet)
{
    struct sockaddr_in a;
    unsigned char hello[8];
    memset(&a, 0, sizeof a);
    a.sin_family = AF_INET;
    a.sin_port = htons((uint16_t)port);
    a.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    const int s = socket(AF_INET, SOCK_STREAM, 0);
    assert_true(s >= 0);
    assert_int_equal(connect(s, (struct sockaddr *)&a, sizeof a), 0);
    if (!greet) return s;
    const int on = 1;
    setsockopt(s, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    put_u32(hello, 0x287617fb);
    put_u32(hello + 4, 0x0100);
    peer_send(s, hello, 8);
    assert_true(read_all(s, 5, hello, 8));
    assert_int_equal(get_u32(hello), 0x287617fa);
    assert_int_equal(get_u32(hello + 4), 0x0100);
    return s;
}

void peer_frame(int socket, int type, const char *channel, const void *data, size_t n)
{
    const size_t c = strlen(channel);
    unsigned char *b = malloc(12 + c + n);
    assert_non_null(b);
    put_u32(b, (uint32_t)type);
    put_u32(b + 4, (uint32_t)c);
    memcpy(b + 8, channel, c);
    put_u32(b + 8 + c, (uint32_t)n);
    if (n) memcpy(b + 12 + c, data, n);
    peer_send(socket, b, type == 1 ? 12 + c + n : 8 + c);
    free(b);
}

long peer_read(int socket, double seconds, char *channel, void *data, size_t n)
{
    unsigned char head[8], rest[4096];
    if (!read_all(socket, seconds, head, 8)) return -1;
    const uint32_t c = get_u32(head + 4);
    assert_int_equal(get_u32(head), 1);
    assert_true(c < 64);
    if (!read_all(socket, seconds, channel, c)) return -1;
    channel[c] = 0;
    if (!read_all(socket, seconds, head, 4)) return -1;
    const uint32_t size = get_u32(head);
    size_t left = size;
    while (left > 0) {
        const size_t part = left < sizeof rest ? left : sizeof rest;
        if (!read_all(socket, seconds, rest, part)) return -1;
        const size_t done = size - left;
        if (done < n) {
            memcpy((unsigned char *)data + done, rest, part < n - done ? part : n - done);
        }
        left -= part;
    }
    return (long)size;
}

int peer_closed(int socket, double seconds)
{
    unsigned char byte[256];
    struct pollfd p = {socket, POLLIN, 0};
    while (poll(&p, 1, (int)(1000 * seconds)) > 0) {
        if (recv(socket, byte, sizeof byte, 0) <= 0) return 1;
    }
    return 0;
}
