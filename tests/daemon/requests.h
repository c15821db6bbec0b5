/* requests.h: requests of one client in one session, and the replies that are expected. */
#ifndef TEST_DAEMON_REQUESTS_H
#define TEST_DAEMON_REQUESTS_H

#include "messages.h"

enum { CLIENT = 7, SESSION = 1 };

/* The scene of scene_of. */
void do_scene(bench *b, int64_t seq);
/* A bench whose session has that scene. */
bench *do_open(void);
void do_steps(bench *b, int64_t seq, int64_t from, int n, int every);
/* Steps on the tape; the last state is published. */
void do_recorded(bench *b, int64_t seq, int64_t from, int n);
void do_action(bench *b, int64_t seq, int action, int snapshot);

/* Fails unless the last reply has this code and these numbers, and says the text. */
void expect_reply(const bench *b, int code, int64_t seq, int64_t next_seq, const char *says);

#endif
