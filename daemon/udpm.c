#include "udpm.h"

#include <arpa/inet.h>
#include <errno.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

static const char *const DEFAULT_ADDRESS = "239.255.76.67";
enum { DEFAULT_PORT = 7667, WANTED_BUFFER = 4 << 20 };

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

/* Flags and name of the interface with this address; 0: there is none. */
static unsigned interface_flags(struct in_addr address, char *name, size_t size)
{
    struct ifaddrs *list = NULL;
    unsigned flags = 0;
    if (getifaddrs(&list) < 0) return 0;
    for (const struct ifaddrs *i = list; i && !flags; i = i->ifa_next) {
        if (!i->ifa_addr || i->ifa_addr->sa_family != AF_INET) continue;
        const struct sockaddr_in *a = (const struct sockaddr_in *)(const void *)i->ifa_addr;
        if (a->sin_addr.s_addr != address.s_addr) continue;
        flags = i->ifa_flags;
        snprintf(name, size, "%s", i->ifa_name);
    }
    freeifaddrs(list);
    return flags;
}

static int check_route(const struct sockaddr_in *to, char *text)
{
    struct sockaddr_in from;
    socklen_t length = sizeof from;
    char name[IF_NAMESIZE + 1] = "";
    const int s = socket(AF_INET, SOCK_DGRAM, 0);
    const int routed = s >= 0 && connect(s, (const struct sockaddr *)to, sizeof *to) == 0 &&
                       getsockname(s, (struct sockaddr *)&from, &length) == 0;
    if (s >= 0) close(s);
    if (!routed) {
        snprintf(text, CRM_UDPM_TEXT,
                 "no route to multicast addresses.  For this machine alone:\n"
                 "  sudo ip link set lo multicast on\n"
                 "  sudo ip route add 224.0.0.0/4 dev lo");
        return 0;
    }
    const unsigned flags = interface_flags(from.sin_addr, name, sizeof name);
    if (flags & IFF_MULTICAST) return 1;
    if (!flags) return 1; /* an address of no interface: let LCM try */
    snprintf(text, CRM_UDPM_TEXT,
             "the route to multicast addresses leads to %s, which has multicast off:\n"
             "  sudo ip link set %s multicast on",
             name, name);
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
