/* break.c: joints that break under the force they bear.  docs/joint.md, section "Breaking". */
#include "world/internal.h"

#include <math.h>

int crm_joint_breaks(const crm_joint *j)
{
    return j->break_force < HUGE_VAL || j->break_torque < HUGE_VAL;
}

static void drop(carom_world *w, crm_joint *j)
{
    j->broken = 1;
    crm_sleep_forget(w);
    for (int r = j->first_row; r < j->first_row + j->n_rows; r++) {
        w->joint_force[0][r] = w->joint_force[1][r] = w->joint_total[r] = 0;
    }
}

void crm_break_joints(carom_world *w)
{
    for (int k = 0; w->n_breakable && k < w->n_joints; k++) {
        crm_joint *j = &w->joints[k];
        if (j->broken || !crm_joint_breaks(j)) continue;
        const carom_joint_force f = carom_world_joint_force(w, k);
        const int holds =
            hypot(f.force.x, f.force.y) <= j->break_force && fabs(f.torque) <= j->break_torque;
        if (holds) continue;
        drop(w, j);
        if (w->events.on) crm_events_break(w, k);
    }
}

int carom_world_joint_broken(const carom_world *world, int joint)
{
    return world && joint >= 0 && joint < world->n_joints && world->joints[joint].broken;
}
