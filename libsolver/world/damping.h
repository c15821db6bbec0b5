/* damping.h: what damping does to a velocity in a time h. */
#ifndef CRM_WORLD_DAMPING_H
#define CRM_WORLD_DAMPING_H

/* v' = a - d v at constant a has the solution v(h) = keep v + h mean a, with x = d h:
 * keep = exp(-x), mean = (1 - exp(-x)) / x. */
typedef struct crm_decay {
    double keep;
    double mean;
    double slope; /* d mean / dx */
} crm_decay;
/* damping [1/s] >= 0, h [s] >= 0. */
crm_decay crm_decay_in(double damping, double h);

#endif
