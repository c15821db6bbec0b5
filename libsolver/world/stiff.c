/* stiff.c: how long a sub-step may be where joints pull hard at light bodies.  docs/step.md,
 * section "Stiff joints". */
#include "world/internal.h"

#include <math.h>

/* S(h) takes the directions of joints at its ends: explicit in their turn, and so stable for
 * h w < 2, with w the frequency at which forces turn a body.  Neighbors swing together, faster than
 * the one body that is looked at here.  An extrapolated map, whose other columns are finer, may go
 * on where its first one is at that limit. */
static const double MOST_TURN = 1.25;
static const double EXTRAPOLATED = 1.5; /* as much */
/* A mass that does not move [mass of the body beside it]. */
static const double UNMOVED = 1e12;

int crm_joint_takes_along(const crm_joint *j)
{
    return j->kind == CAROM_REVOLUTE || j->kind == CAROM_WELD;
}

static double inverse(const carom_world *w, const double *of, int body)
{
    return w->bodies[body].type == CAROM_DYNAMIC ? 1 / of[body] : 0;
}

/* What the joints of a body are to its turn, with masses M at arms r: in the room of its speeds,
 * which is free between two solves. */
typedef struct swing {
    double *first;  /* sum M r (2), sum M |r|^2 */
    double *zeroth; /* sum M, stiffness sum F . r */
} swing;

static swing swing_of(const carom_world *w, int body)
{
    const int k = 3 * crm_unknown(w, body);
    const swing x = {&w->rows.u[k], &w->rows.v[k]};
    return x;
}

/* Force on body B. */
static carom_vec2 force_of(const carom_world *w, const crm_joint *j, const crm_joint_frame *f)
{
    const crm_measure *measures;
    const int n = crm_joint_measures(j->kind, &measures);
    carom_vec2 force = {0, 0};
    for (int k = 0; k < n; k++) {
        const double l = w->joint_total[j->first_row + k];
        const carom_vec2 u = crm_measure_direction(j, measures[k], w->q, f);
        force.x += l * u.x;
        force.y += l * u.y;
    }
    return force;
}

/* Joint j seen from body b, with its arm r, the force on it and what is at the other end.  A joint
 * that holds a point takes the other body along, by at least the mass that it has there; several
 * joints of the same two bodies take along one. */
static void add_side(const carom_world *w, const crm_joint *j, int b, carom_vec2 r,
                     carom_vec2 force, int other, carom_vec2 arm)
{
    if (w->bodies[b].type != CAROM_DYNAMIC) return;
    const swing x = swing_of(w, b);
    x.zeroth[1] += force.x * r.x + force.y * r.y;
    if (!crm_joint_takes_along(j)) return;
    const double give = inverse(w, w->mass, other) +
                        inverse(w, w->inertia, other) * (arm.x * arm.x + arm.y * arm.y);
    const double most = UNMOVED * w->mass[b];
    const double m = (give * most > 1 ? 1 / give : most) / j->n_twins;
    x.zeroth[0] += m;
    x.first[0] += m * r.x;
    x.first[1] += m * r.y;
    x.first[2] += m * (r.x * r.x + r.y * r.y);
}

/* w^2 of a body: its inertia with that of what it takes along, where it moves as suits it best. */
static double square_of(const carom_world *w, int b)
{
    const swing x = swing_of(w, b);
    const double moved = x.first[0] * x.first[0] + x.first[1] * x.first[1];
    const double inertia = w->inertia[b] + x.first[2] - moved / (w->mass[b] + x.zeroth[0]);
    return fabs(x.zeroth[1]) / fmax(inertia, w->inertia[b]);
}

/* Largest w^2 in the island. */
static double largest_square(const carom_world *w)
{
    const crm_island *island = w->island;
    double most = 0;
    memset(w->rows.u, 0, 3 * (size_t)island->n_bodies * sizeof(double));
    memset(w->rows.v, 0, 3 * (size_t)island->n_bodies * sizeof(double));
    for (int k = 0; k < island->n_joints; k++) {
        const crm_joint *j = &w->joints[island->joints[k]];
        const crm_joint_frame f = crm_joint_frame_at(j, w->q);
        const carom_vec2 on_b = force_of(w, j, &f);
        const carom_vec2 on_a = {-on_b.x, -on_b.y};
        add_side(w, j, j->body_a, f.arm_a, on_a, j->body_b, f.arm_b);
        add_side(w, j, j->body_b, f.arm_b, on_b, j->body_a, f.arm_a);
        /* a rod's own direction turns with its ends */
        if (j->kind == CAROM_DISTANCE) {
            const double m = inverse(w, w->mass, j->body_a) + inverse(w, w->mass, j->body_b);
            most = fmax(most, hypot(on_b.x, on_b.y) / j->length * m);
        }
    }
    for (int k = 0; k < island->n_bodies; k++) {
        const int b = island->bodies[k];
        if (w->bodies[b].type == CAROM_DYNAMIC) most = fmax(most, square_of(w, b));
    }
    return most;
}

/* Sub-steps of a frame that the forces of joints ask for [1]. */
static double asked(const carom_world *w)
{
    const double n = w->settings.dt * sqrt(largest_square(w)) / MOST_TURN;
    return w->settings.order > 2 && n <= EXTRAPOLATED ? 1 : n;
}

/* A number that followed each change of a force would make the motion jump with it: a power of two,
 * that only grows while the frame lasts. */
double crm_stiff_span(carom_world *w, double left, int look)
{
    if (!w->island->n_joints) return left;
    const double n = look || !w->n_parts ? asked(w) : 0;
    if (n > w->n_parts || !w->n_parts) {
        if (!w->n_parts) w->n_parts = 1;
        while (w->n_parts < n && 2 * w->n_parts <= w->settings.max_stiff) w->n_parts *= 2;
        if (w->n_parts < n && w->stats->status < CAROM_LIMIT) w->stats->status = CAROM_LIMIT;
    }
    return left / fmax(1, ceil(left / w->settings.dt * w->n_parts - CRM_NO_TIME));
}
