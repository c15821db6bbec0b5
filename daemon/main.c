/* main.c: caromd. */
#include "carom/base.h"
#include "options.h"

#include <errno.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <time.h>

static void log_line(const char *text)
{
    char stamp[32] = "";
    struct tm tm;
    const time_t t = time(NULL);
    if (localtime_r(&t, &tm)) strftime(stamp, sizeof stamp, "%Y-%m-%d %H:%M:%S", &tm);
    fprintf(stderr, "%s caromd: %s\n", stamp, text);
}

/* Every client of the hub is a file. */
static void raise_file_limit(void)
{
    struct rlimit r;
    if (getrlimit(RLIMIT_NOFILE, &r) < 0) return;
    r.rlim_cur = r.rlim_max;
    setrlimit(RLIMIT_NOFILE, &r);
}

/* The signals that end the daemon are waited for, not caught; threads inherit the mask. */
static sigset_t block_signals(void)
{
    sigset_t ends;
    sigemptyset(&ends);
    sigaddset(&ends, SIGTERM);
    sigaddset(&ends, SIGINT);
    pthread_sigmask(SIG_BLOCK, &ends, NULL);
    signal(SIGPIPE, SIG_IGN);
    return ends;
}

static int serve(const crm_daemon_settings *set)
{
    char text[CRM_DAEMON_TEXT];
    const struct timespec half_second = {0, 500000000};
    const sigset_t ends = block_signals();
    raise_file_limit();
    crm_daemon *d = crm_daemon_create(set, text);
    if (!d) {
        log_line(text);
        return 1;
    }
    printf("ready %s\n", crm_daemon_url(d));
    fflush(stdout);
    int signal_number = -1;
    do {
        crm_daemon_tick(d);
        signal_number = sigtimedwait(&ends, NULL, &half_second);
    } while (signal_number < 0 && (errno == EAGAIN || errno == EINTR));
    crm_daemon_tick(d);
    crm_daemon_destroy(d);
    return 0;
}

int main(int argc, char **argv)
{
    crm_options options;
    char text[CRM_DAEMON_TEXT];
    if (!crm_options_parse(argc, argv, &options, text)) {
        fprintf(stderr, "caromd: %s\n", text);
        return 1;
    }
    if (options.help) {
        char *help = crm_options_help();
        if (help) fputs(help, stdout);
        free(help);
        return help ? 0 : 1;
    }
    if (options.version) {
        printf("caromd %s\n", carom_version());
        return 0;
    }
    options.daemon.log = log_line;
    return serve(&options.daemon);
}
