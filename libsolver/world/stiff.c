/* stiff.c: how long a sub-step may be where joints pull hard at light bodies.  docs/step.md,
 * section "Stiff joints". */
#include "world/internal.h"

#include <math.h>

/* S(h) takes the directions of joints at its ends: explicit in their turn, and so stable for
 * h w < 2, with w the frequency at which a force turns the body it pulls at.  An extrapolated map,
 * whose other columns are finer, may go on where its first one is at that limit. */
static const double MOST_TURN = 2;
static const double EXTRAPOLATED = 1.5; /* as much */

static double inverse(const carom_world *w, const double *of, int body)
{
    return w->bodies[body].type == CAROM_DYNAMIC ? 1 / of[body] : 0;
}

/* Largest w^2 of the two bodies of a joint, with the force that it gave last.  A force F on an arm
 * r turns with it: F . r / I.  That along a line of two points, |d| apart, turns with it: F / |d|
 * by both masses. */
static double stiffness_of(const carom_world *w, const crm_joint *j)
{
    const crm_joint_frame f = crm_joint_frame_at(j, w->q);
    const crm_measure *measures;
    const int n = crm_joint_measures(j->kind, &measures);
    carom_vec2 force = {0, 0};
    double swing = 0;
    for (int k = 0; k < n; k++) {
        const double l = w->joint_total[j->first_row + k];
        const carom_vec2 u = crm_measure_direction(j, measures[k], w->q, &f);
        force.x += l * u.x;
        force.y += l * u.y;
        if (measures[k] == CRM_APART && j->length > 0) swing = fabs(l) / j->length;
    }
    const double a = fabs(force.x * f.arm_a.x + force.y * f.arm_a.y);
    const double b = fabs(force.x * f.arm_b.x + force.y * f.arm_b.y);
    const double m = inverse(w, w->mass, j->body_a) + inverse(w, w->mass, j->body_b);
    return fmax(a * inverse(w, w->inertia, j->body_a), b * inverse(w, w->inertia, j->body_b)) +
           swing * m;
}

/* Sub-steps of a frame that the forces of joints ask for [1]. */
static double asked(const carom_world *w)
{
    double square = 0;
    for (int k = 0; k < w->island->n_joints; k++) {
        square = fmax(square, stiffness_of(w, &w->joints[w->island->joints[k]]));
    }
    /* Most bodies have two joints. */
    const double n = w->settings.dt * sqrt(2 * square) / MOST_TURN;
    return w->settings.order > 2 && n <= EXTRAPOLATED ? 1 : n;
}

/* A number that followed each change of a force would make the motion jump with it: a power of two,
 * that only grows while the frame lasts. */
double crm_stiff_span(carom_world *w, double left)
{
    if (!w->island->n_joints) return left;
    const double n = asked(w);
    if (n > w->n_parts) {
        if (!w->n_parts) w->n_parts = 1;
        while (w->n_parts < n && 2 * w->n_parts <= w->settings.max_stiff) w->n_parts *= 2;
        if (w->n_parts < n && w->stats->status < CAROM_LIMIT) w->stats->status = CAROM_LIMIT;
    }
    return left / fmax(1, ceil(left / w->settings.dt * w->n_parts - CRM_NO_TIME));
}
