/* clock.h: time. */
#ifndef CRM_CLOCK_H
#define CRM_CLOCK_H

#include <stdint.h>
#include <time.h>

/* Monotonic time [s]. */
static inline double crm_clock_now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* Time of day [us since 1970]. */
static inline int64_t crm_clock_utime(void)
{
    struct timespec t;
    clock_gettime(CLOCK_REALTIME, &t);
    return (int64_t)t.tv_sec * 1000000 + t.tv_nsec / 1000;
}

#endif
