/* socket_peer.h: a raw connection to a hub, for what LCM's library would never send. */
#ifndef TEST_DAEMON_SOCKET_PEER_H
#define TEST_DAEMON_SOCKET_PEER_H

#include <stddef.h>

/* Connected to 127.0.0.1; with greet, the magic numbers are exchanged. */
int peer_connect(int port, int greet);
void peer_send(int socket, const void *bytes, size_t n);
/* A whole frame: type 1 publish, 2 subscribe, 3 unsubscribe (data not used). */
void peer_frame(int socket, int type, const char *channel, const void *data, size_t n);
/* Reads one published message within the time: returns its size, the first n bytes of its data in
 * `data`, the channel (64 bytes); -1: none came, or the hub closed the connection. */
long peer_read(int socket, double seconds, char *channel, void *data, size_t n);
/* 1: the hub closed the connection within the time. */
int peer_closed(int socket, double seconds);

#endif
