/* energy.c: impacts give no energy.  docs/step.md, section "Impacts and energy". */
#include "world/internal.h"

#include <math.h>

/* What rounding may give [1]. */
static const double ROUNDING = 1e-10;
/* Halvings of the interval in which the restitution that gives no energy is sought. */
enum { MAX_HALVINGS = 6 };

double crm_mass_square(const carom_world *w, int body, const double *v)
{
    const double turn = w->inertia[body] < HUGE_VAL ? w->inertia[body] * v[0] * v[0] : 0;
    return turn + w->mass[body] * (v[1] * v[1] + v[2] * v[2]);
}

double crm_mass_speed(const carom_world *w, const double *v)
{
    double sum = 0;
    for (int k = 0; k < w->island->n_bodies; k++) {
        const int b = w->island->bodies[k];
        sum += crm_mass_square(w, b, v + 3 * b);
    }
    return sqrt(sum);
}

/* Of what the solve began with, in the order of the island. */
static double free_speed(const carom_world *w)
{
    double sum = 0;
    for (int k = 0; k < w->island->n_bodies; k++) {
        sum += crm_mass_square(w, w->island->bodies[k], w->rows.u + 3 * k);
    }
    return sqrt(sum);
}

/* Only what is prescribed does work on an island: a kinematic body, or in time a motor; and a
 * damped solve has other masses than these. */
static int is_passive(const carom_world *w, const crm_substep *s)
{
    for (int k = 0; k < w->island->n_bodies; k++) {
        if (w->bodies[w->island->bodies[k]].type != CAROM_DYNAMIC) return 0;
    }
    return (!w->island->n_driven && !w->damped && !w->n_fields) || !(s->h > 0);
}

/* v = u + W J'l with J v + c complementary to l has, for c >= 0,
 *     v'M v = u'M u + 2 l.(J v) - l'J W J'l <= u'M u,   l.(J v) = -l.c <= 0 and friction opposes,
 * so that without restitution no impact gives energy; Newton's law does where contacts, friction
 * and joints are coupled. */
carom_status crm_bound_bounce(carom_world *w, crm_substep *s, crm_solve *c, crm_sides *set,
                              carom_status e)
{
    if (!is_passive(w, s)) return e;
    const double most = (1 + ROUNDING) * free_speed(w);
    if (crm_mass_speed(w, c->v) <= most) return e;
    double low = 0;
    double high = 1;
    for (int k = 0; k < MAX_HALVINGS; k++) {
        s->restitution = 0.5 * (low + high);
        set(w, s, c);
        e = crm_solve_run(w, s, c, 1);
        if (e == CAROM_E_MEMORY) return e;
        if (e >= 0 && crm_mass_speed(w, c->v) <= most) {
            low = s->restitution;
        } else {
            high = s->restitution;
        }
    }
    s->restitution = low;
    set(w, s, c);
    e = crm_solve_run(w, s, c, 1);
    if (e >= 0 && w->stats->status < CAROM_RELAXED) w->stats->status = CAROM_RELAXED;
    return e;
}
