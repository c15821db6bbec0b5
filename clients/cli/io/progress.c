#include "progress.h"

#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

enum { BAR_WIDTH = 30 };

/* What a signal handler may touch; the one variable of this program that outlives a function. */
static volatile sig_atomic_t interrupted;

double crm_clock(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void on_signal(int number)
{
    (void)number;
    interrupted = 1;
}

void crm_catch_interrupts(void)
{
    struct sigaction action;
    memset(&action, 0, sizeof action);
    action.sa_handler = on_signal;
    action.sa_flags = (int)SA_RESETHAND; /* the second signal meets the default: the end */
    sigemptyset(&action.sa_mask);
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
}

int crm_interrupted(void)
{
    return interrupted != 0;
}

crm_progress crm_progress_start(const char *title, int silent)
{
    crm_progress p;
    memset(&p, 0, sizeof p);
    p.title = title;
    p.silent = silent || !isatty(STDERR_FILENO);
    p.start = crm_clock();
    p.last = p.start;
    return p;
}

void crm_progress_show(crm_progress *progress, double done, double total)
{
    if (progress->silent || !(total > 0)) return;
    const double now = crm_clock();
    if (now - progress->start < 1 || now - progress->last < 0.1) return;
    progress->last = now;
    progress->shown = 1;
    const double part = done / total;
    char bar[BAR_WIDTH + 1];
    for (int i = 0; i < BAR_WIDTH; i++) bar[i] = (double)i < part * BAR_WIDTH ? '#' : '.';
    bar[BAR_WIDTH] = '\0';
    const double left = done > 0 ? (now - progress->start) * (1 / part - 1) : 0;
    fprintf(stderr, "\r%s [%s] %3.0f %%  %.0f of %.0f, %.0f s left \033[K", progress->title, bar,
            100 * part, done, total, left);
    fflush(stderr);
}

void crm_progress_end(crm_progress *progress)
{
    if (progress->shown) fputs("\r\033[K", stderr);
    progress->shown = 0;
}
