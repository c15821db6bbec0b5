/* lossy.h: sendmsg that forgets datagrams.  Compiled into a program, or preloaded into one
 * (LD_PRELOAD), where $LOSSY_PERCENT says how many of a hundred. */
#ifndef TEST_DAEMON_LOSSY_H
#define TEST_DAEMON_LOSSY_H

extern int lossy_percent; /* -1: $LOSSY_PERCENT */
extern long lossy_sent;
extern long lossy_lost;

#endif
