/* progress.h: time, interruption and the bar of a long run. */
#ifndef CRM_PROGRESS_H
#define CRM_PROGRESS_H

/* Seconds of a clock that only goes forward. */
double crm_clock(void);

/* From now on the first SIGINT or SIGTERM is kept for crm_interrupted; the second ends the program.
 */
void crm_catch_interrupts(void);
int crm_interrupted(void);

/* A bar on stderr: only on a terminal, not before one second, ten times a second at most. */
typedef struct crm_progress {
    const char *title;
    int silent;
    int shown;
    double start; /* [s] */
    double last;  /* [s] */
} crm_progress;

crm_progress crm_progress_start(const char *title, int silent);
void crm_progress_show(crm_progress *progress, double done, double total);
/* Wipes the bar. */
void crm_progress_end(crm_progress *progress);

#endif
