/* trajectory.h: the JSON lines of a run, carom-trajectory/1. */
#ifndef CRM_TRAJECTORY_H
#define CRM_TRAJECTORY_H

#include "carom/world.h"
#include "output.h"

enum { CRM_STATUS_KINDS = 16 };

/* What the last line tells. */
typedef struct crm_summary {
    long steps;
    double seconds; /* spent in steps alone */
    double residual_max;
    double penetration_max;
    double joint_drift_max;
    long events;
    long factorizations;
    long status[CRM_STATUS_KINDS]; /* steps that ended so, in the order of CAROM_STATUS_TABLE */
    long allocations_steady; /* requests in steps with no new record of contacts or candidates; < 0:
                                not counted, written as null */
    int contacts_max;
    int candidates_max;
} crm_summary;

/* Adds one step, failed ones too; seconds: what it took. */
void crm_summary_add(crm_summary *summary, const carom_step_stats *stats, double seconds);

void crm_put_header(crm_output *out, const char *scene, int n_bodies, double dt);
void crm_put_state(crm_output *out, long step, double t, int n_bodies, const double *q,
                   const double *v);
void crm_put_summary(crm_output *out, const crm_summary *summary);

#endif
