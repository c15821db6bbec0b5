#include "udpm.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

static const char *const DEFAULT_ADDRESS = "239.255.76.67";
enum { DEFAULT_PORT = 7667, WANTED_BUFFER = 4 << 20, COMES_BACK_MS = 500 };

static int parse(const char *url, struct sockaddr_in *to, long *buffer, char *text)
{
    char host[64] = "";
    int port = DEFAULT_PORT;
    const char *rest = url + strlen("udpm://");
    const char *option = strstr(rest, "recv_buf_size=");
    *buffer = option ? strtol(option + strlen("recv_buf_size="), NULL, 10) : 0;
    if (sscanf(rest, "%63[0-9.]:%d", host, &port) < 1) snprintf(host, 64, "%s", DEFAULT_ADDRESS);
    memset(to, 0, sizeof *to);
    to->sin_family = AF_INET;
    to->sin_port = htons((uint16_t)port);
    if (inet_pton(AF_INET, host, &to->sin_addr) == 1 && IN_MULTICAST(ntohl(to->sin_addr.s_addr)) &&
        port > 0 && port < 65536) {
        return 1;
    }
    snprintf(text, CRM_UDPM_TEXT, "%.100s: not a multicast address and port, like udpm://%s:%d",
             url, DEFAULT_ADDRESS, DEFAULT_PORT);
    return 0;
}

static int has_route(const struct sockaddr_in *to)
{
    const int s = socket(AF_INET, SOCK_DGRAM, 0);
    const int routed = s >= 0 && connect(s, (const struct sockaddr *)to, sizeof *to) == 0;
    if (s >= 0) close(s);
    return routed;
}

/* Opens a socket on a free port that has joined the group; *at is where it listens. */
static int join(const struct sockaddr_in *group, struct sockaddr_in *at)
{
    struct ip_mreq request;
    socklen_t length = sizeof *at;
    const int s = socket(AF_INET, SOCK_DGRAM, 0);
    if (s < 0) return -1;
    *at = *group;
    at->sin_port = 0;
    request.imr_multiaddr = group->sin_addr;
    request.imr_interface.s_addr = htonl(INADDR_ANY);
    if (bind(s, (struct sockaddr *)at, sizeof *at) == 0 &&
        setsockopt(s, IPPROTO_IP, IP_ADD_MEMBERSHIP, &request, sizeof request) == 0 &&
        getsockname(s, (struct sockaddr *)at, &length) == 0) {
        return s;
    }
    close(s);
    return -1;
}

/* 1: a datagram sent to the group, on another port, comes back. */
static int comes_back(const struct sockaddr_in *group)
{
    struct sockaddr_in at;
    const unsigned char ttl = 0;
    const char question[] = "carom";
    char answer[sizeof question] = "";
    const int s = join(group, &at);
    struct pollfd p = {s, POLLIN, 0};
    if (s < 0) return 0;
    setsockopt(s, IPPROTO_IP, IP_MULTICAST_TTL, &ttl, sizeof ttl);
    const ssize_t sent =
        sendto(s, question, sizeof question, 0, (const struct sockaddr *)&at, sizeof at);
    const int came = sent == (ssize_t)sizeof question && poll(&p, 1, COMES_BACK_MS) > 0 &&
                     recv(s, answer, sizeof answer, 0) == sent &&
                     memcmp(answer, question, sizeof question) == 0;
    close(s);
    return came;
}

static int check_route(const struct sockaddr_in *to, char *text)
{
    const int routed = has_route(to);
    if (routed && comes_back(to)) return 1;
    snprintf(text, CRM_UDPM_TEXT,
             "%s.  For this machine alone:\n"
             "  sudo ip link set lo multicast on\n"
             "  sudo ip route %s 224.0.0.0/4 dev lo",
             routed ? "multicast datagrams do not come back: a firewall, or an interface without "
                      "multicast"
                    : "no route to multicast addresses",
             routed ? "replace" : "add");
    return 0;
}

static long kernel_number(const char *path)
{
    long n = 0;
    FILE *f = fopen(path, "r");
    if (!f) return 0;
    if (fscanf(f, "%ld", &n) != 1) n = 0;
    fclose(f);
    return n;
}

crm_udpm_answer crm_udpm_check(const char *url, char text[CRM_UDPM_TEXT])
{
    struct sockaddr_in to;
    long buffer = 0;
    text[0] = 0;
    if (!parse(url, &to, &buffer, text) || !check_route(&to, text)) return CRM_UDPM_NO;
    const long most = kernel_number("/proc/sys/net/core/rmem_max");
    if (buffer >= WANTED_BUFFER && most >= buffer) return CRM_UDPM_YES;
    const int too_much = buffer > most;
    snprintf(text, CRM_UDPM_TEXT,
             "messages above about 100 KB will be lost: %s.  Repair:\n"
             "  sudo sysctl -w net.core.rmem_max=%d\n"
             "  and ?recv_buf_size=%d in the URL",
             too_much ? "the kernel does not allow that recv_buf_size"
                      : "the URL asks for no recv_buf_size of 4 MB",
             WANTED_BUFFER, WANTED_BUFFER);
    return CRM_UDPM_LOSSY;
}
