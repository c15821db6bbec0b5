/* joints_alone.c: stage 1 where joints alone act: their modes are known, no signs, no friction, no
 * motors.  docs/step.md. */
#include "world/internal.h"

#include <math.h>

/* Newton's method goes on while it gains by this [1], and begins from a guess: one that leaves
 * joints farther open [L], or turns a body by more than without forces [1], may lead to another
 * solution. */
enum { MAX_NEWTON = 40 };
static const double HALF = 0.5;
static const double GUESS_OPEN = 1e-1;
static const double GUESS_TURN = 0.3;
/* What passes led to may miss this share of what is accepted: a solve would do better. */
static const double HOLDS = 0.1;

int crm_has_joints_alone(const carom_world *w, const crm_substep *s)
{
    return !s->n_contacts && w->island->n_rows && !w->island->n_driven;
}

/* The right-hand sides whose solution c->v is. */
static void sides_of_velocity(const carom_world *w, crm_solve *c)
{
    int row = 0;
    for (int k = 0; k < w->island->n_joints; k++) {
        const crm_joint *j = &w->joints[w->island->joints[k]];
        for (int i = 0; i < j->n_rows; i++, row++) {
            c->ce[row] = -crm_row_dot(&w->rows.je[6 * row], c->v, j->body_a, j->body_b);
        }
    }
}

/* Whether the pose at the end of the guess is one that Newton's method may begin from. */
static int guess_is_near(const carom_world *w, const crm_substep *s, const crm_solve *c,
                         double open)
{
    double turn = 0;
    for (int k = 0; k < w->island->n_bodies; k++) {
        const int b = w->island->bodies[k];
        turn = fmax(turn, s->h * fabs(c->v[3 * b] - s->v0[3 * b]));
    }
    return open <= GUESS_OPEN * w->length && turn <= GUESS_TURN;
}

/* Right-hand sides from the errors at s->q1, with the rows `left`, which with `renew` become those
 * there; returns the largest error [m]. */
static double joint_sides(carom_world *w, const crm_substep *s, crm_solve *c, int renew)
{
    double *left = w->rows.left;
    double largest = 0;
    int row = 0;
    for (int k = 0; k < w->island->n_joints; k++) {
        const crm_joint *j = &w->joints[w->island->joints[k]];
        double je[6 * CRM_MAX_JOINT_ROWS];
        double error[CRM_MAX_JOINT_ROWS];
        crm_joint_rows(j, s->q1, je, error);
        if (renew) memcpy(&left[6 * row], je, 6 * (size_t)j->n_rows * sizeof *je);
        for (int i = 0; i < j->n_rows; i++, row++) {
            const double miss = error[i] - s->joint_target[row];
            const double u = crm_row_dot(&left[6 * row], c->v, j->body_a, j->body_b);
            c->ce[row] = miss / s->h - u;
            largest = fmax(largest, fabs(miss));
        }
    }
    return largest;
}

int crm_close_joints(carom_world *w, crm_substep *s, crm_solve *c)
{
    const double tol = crm_newton_tolerance(w);
    double last = HUGE_VAL;
    crm_guess_velocity(w, s, c);
    for (int k = 0; k < MAX_NEWTON; k++) {
        crm_end_pose(w, s, c);
        const double open = joint_sides(w, s, c, k == 0);
        if (k == 0 && !guess_is_near(w, s, c, open)) return 0;
        if (open <= tol) {
            sides_of_velocity(w, c);
            return crm_passes_hold(w, s, c, HOLDS * w->settings.accept);
        }
        if (!(open < HALF * last)) return 0;
        last = open;
        if (k == 0 && crm_passes_begin(w, s, c, w->rows.left) < 0) return 0;
        if (crm_pass(w, s, c, w->rows.left) < 0) return 0;
    }
    return 0;
}
