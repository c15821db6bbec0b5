#include "process.h"

#include "near.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

process process_start(const char *const *argv)
{
    int out[2], err[2];
    assert_int_equal(pipe(out), 0);
    assert_int_equal(pipe(err), 0);
    for (int i = 0; i < 2; i++) {
        fcntl(out[i], F_SETFD, FD_CLOEXEC);
        fcntl(err[i], F_SETFD, FD_CLOEXEC);
    }
    const pid_t pid = fork();
    assert_true(pid >= 0);
    if (pid == 0) {
        prctl(PR_SET_PDEATHSIG, SIGKILL); /* a test that fails leaves nothing running */
        dup2(out[1], 1);
        dup2(err[1], 2);
        execv(argv[0], (char *const *)argv);
        _exit(127);
    }
    close(out[1]);
    close(err[1]);
    const process p = {pid, out[0], err[0]};
    return p;
}

int process_line(process *p, char *line, int size)
{
    struct pollfd f = {p->out, POLLIN, 0};
    int n = 0;
    while (n < size - 1) {
        if (poll(&f, 1, 10000) <= 0 || read(p->out, line + n, 1) != 1) break;
        if (line[n] == '\n') {
            line[n] = 0;
            return 1;
        }
        n++;
    }
    line[n] = 0;
    return 0;
}

static int read_end(int fd, char *text, int size)
{
    int n = 0;
    for (ssize_t k = 1; k > 0 && n < size - 1; n += (int)k) {
        k = read(fd, text + n, (size_t)(size - 1 - n));
        if (k < 0) k = 0;
    }
    text[n] = 0;
    close(fd);
    return n;
}

int process_wait(process *p, double seconds, char *out, int out_size, char *err, int err_size)
{
    const struct timespec moment = {0, 5000000};
    int status = 0, late = 0;
    pid_t done = 0;
    for (double t = 0; t < seconds && done == 0; t += 0.005) {
        done = waitpid(p->pid, &status, WNOHANG);
        if (done == 0) nanosleep(&moment, NULL);
    }
    if (done == 0) {
        late = 1;
        kill(p->pid, SIGKILL);
        waitpid(p->pid, &status, 0);
    }
    read_end(p->out, out, out_size);
    read_end(p->err, err, err_size);
    if (late) return -1000;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

process caromd_start(const char *const *more, char url[64])
{
    const char *argv[32] = {CAROMD, "--hub", "127.0.0.1:0"};
    char line[128], out[64], err[1024];
    int n = 3;
    while (more && *more && n < 31) argv[n++] = *more++;
    process p = process_start(argv);
    if (!process_line(&p, line, sizeof line) || sscanf(line, "ready %63s", url) != 1) {
        process_wait(&p, 1, out, sizeof out, err, sizeof err);
        fail_msg("caromd is not ready: '%s' %s", line, err);
    }
    return p;
}

void caromd_stop(process *p)
{
    char out[64], err[4096];
    kill(p->pid, SIGTERM);
    const int status = process_wait(p, 10, out, sizeof out, err, sizeof err);
    if (status != 0) fail_msg("caromd ended with %d: %s", status, err);
}
