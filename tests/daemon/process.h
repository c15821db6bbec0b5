/* process.h: programs under test: started, waited for, read. */
#ifndef TEST_DAEMON_PROCESS_H
#define TEST_DAEMON_PROCESS_H

#include <sys/types.h>

typedef struct process {
    pid_t pid;
    int out; /* its stdout */
    int err; /* its stderr */
} process;

/* argv[0] is the path; the list ends with NULL. */
process process_start(const char *const *argv);
/* One line of stdout without its end, within 10 s; 0: none. */
int process_line(process *p, char *line, int size);
/* Ends of both outputs (terminated), after waiting for the end of the program; its exit status, or
 * minus the signal that ended it; -1000: still there after the time, killed. */
int process_wait(process *p, double seconds, char *out, int out_size, char *err, int err_size);

/* caromd on a free port, with further arguments (NULL: none); fails the test when it is not ready.
 */
process caromd_start(const char *const *more, char url[64]);
/* SIGTERM; fails the test unless it ends with status 0. */
void caromd_stop(process *p);

#endif
