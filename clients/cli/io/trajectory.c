#include "trajectory.h"

#include <math.h>

static int status_row(carom_status status)
{
    int row = 0;
#define MATCH(name, value, text)                                                                   \
    if (status == name) return row;                                                                \
    row++;
    CAROM_STATUS_TABLE(MATCH)
#undef MATCH
    return CRM_STATUS_KINDS - 1;
}

void crm_summary_add(crm_summary *summary, const carom_step_stats *stats, double seconds)
{
    summary->status[status_row(stats->status)]++;
    summary->seconds += seconds;
    if (stats->status < 0) return;
    summary->steps++;
    summary->residual_max = fmax(summary->residual_max, stats->residual);
    summary->penetration_max = fmax(summary->penetration_max, stats->penetration);
    summary->joint_drift_max = fmax(summary->joint_drift_max, stats->joint_drift);
    summary->events += stats->n_events;
    summary->factorizations += stats->factorizations;
    if (summary->allocations_steady < 0) return;
    const int record = summary->steps == 1 || stats->n_contacts > summary->contacts_max ||
                       stats->n_candidates > summary->candidates_max;
    if (!record) summary->allocations_steady += stats->allocations;
    if (stats->n_contacts > summary->contacts_max) summary->contacts_max = stats->n_contacts;
    if (stats->n_candidates > summary->candidates_max) {
        summary->candidates_max = stats->n_candidates;
    }
}

void crm_put_header(crm_output *out, const char *scene, int n_bodies, double dt)
{
    crm_put_raw(out, "{\"format\":\"carom-trajectory/1\",\"scene\":");
    crm_put_text(out, scene);
    crm_put_field(out, 0, "bodies", n_bodies);
    crm_put_field(out, 0, "dt", dt);
    crm_put_raw(out, "}\n");
}

void crm_put_state(crm_output *out, long step, double t, int n_bodies, const double *q,
                   const double *v)
{
    crm_put_raw(out, "{");
    crm_put_field(out, 1, "step", (double)step);
    crm_put_field(out, 0, "t", t);
    crm_put_key(out, 0, "q");
    crm_put_numbers(out, 3 * n_bodies, q);
    crm_put_key(out, 0, "v");
    crm_put_numbers(out, 3 * n_bodies, v);
    crm_put_raw(out, "}\n");
}

static void put_statuses(crm_output *out, const crm_summary *summary)
{
    int row = 0;
    int first = 1;
    crm_put_raw(out, "{");
#define PUT(name, value, text)                                                                     \
    if (summary->status[row]) {                                                                    \
        crm_put_field(out, first, #name, (double)summary->status[row]);                            \
        first = 0;                                                                                 \
    }                                                                                              \
    row++;
    CAROM_STATUS_TABLE(PUT)
#undef PUT
    crm_put_raw(out, "}");
}

void crm_put_summary(crm_output *out, const crm_summary *summary)
{
    const double n = summary->steps > 0 ? (double)summary->steps : 1;
    crm_put_raw(out, "{\"summary\":{");
    crm_put_field(out, 1, "steps", (double)summary->steps);
    crm_put_field(out, 0, "seconds", summary->seconds);
    crm_put_field(out, 0, "seconds_per_step", summary->seconds / n);
    crm_put_field(out, 0, "residual_max", summary->residual_max);
    crm_put_field(out, 0, "penetration_max", summary->penetration_max);
    crm_put_field(out, 0, "joint_drift_max", summary->joint_drift_max);
    crm_put_field(out, 0, "events", (double)summary->events);
    crm_put_field(out, 0, "factorizations", (double)summary->factorizations);
    crm_put_key(out, 0, "status");
    put_statuses(out, summary);
    const long allocations = summary->allocations_steady;
    crm_put_field(out, 0, "allocations_steady", allocations < 0 ? HUGE_VAL : (double)allocations);
    crm_put_raw(out, "}}\n");
}
