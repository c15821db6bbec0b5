#include "lossy.h"

#include <stdlib.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#define EXPORT __attribute__((visibility("default")))

EXPORT int lossy_percent = -1;
EXPORT long lossy_sent = 0;
EXPORT long lossy_lost = 0;

/* The same datagrams in every run, as far as the order of sending is the same. */
static int loses(void)
{
    static unsigned seed = 12345;
    if (lossy_percent < 0) {
        const char *percent = getenv("LOSSY_PERCENT");
        lossy_percent = percent ? (int)strtol(percent, NULL, 10) : 0;
    }
    const unsigned s = __atomic_add_fetch(&seed, 2654435761u, __ATOMIC_RELAXED);
    return (int)(((s ^ s >> 15) * 2246822519u >> 16) % 100) < lossy_percent;
}

EXPORT ssize_t sendmsg(int socket, const struct msghdr *m, int flags)
{
    if (m->msg_name) { /* a datagram with its address */
        __atomic_add_fetch(&lossy_sent, 1, __ATOMIC_RELAXED);
        if (loses()) {
            size_t n = 0;
            for (size_t i = 0; i < m->msg_iovlen; i++) n += m->msg_iov[i].iov_len;
            __atomic_add_fetch(&lossy_lost, 1, __ATOMIC_RELAXED);
            return (ssize_t)n;
        }
    }
    return syscall(SYS_sendmsg, socket, m, flags);
}
