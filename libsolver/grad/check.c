/* check.c: a gradient beside central differences of whole runs.  docs/gradient.md. */
#include "carom/snapshot.h"
#include "grad/internal.h"

#include <math.h>

/* A contact that an impact elsewhere does not reach has an impulse of rounding [largest]. */
static const double NO_IMPULSE = 1e-11;
/* Entries below this part of the largest of their array are measured against that. */
static const double SMALL = 1e-3;
/* ... and those that would change the loss by less of it than this, doubling the number, by that.
 */
static const double NOTHING = 1e-4;
enum { N_SIZES = 2 };

/* --- the active set of a run: all that decides which smooth map it is ---------------------------
 */

static void mix(unsigned long long *hash, unsigned long long x)
{
    *hash = (*hash ^ x) * 0x100000001B3ULL;
    *hash ^= *hash >> 29;
}

static void mix_contact(unsigned long long *hash, const crm_contact *c)
{
    mix(hash, (unsigned long long)(c->shape_a + 1) << 32 | (unsigned long long)(c->shape_b + 1));
    mix(hash,
        (unsigned long long)(c->recipe.ref + 1) << 32 | (unsigned long long)(c->recipe.inc + 1));
    mix(hash, (unsigned long long)c->recipe.kernel << 16 |
                  (unsigned long long)c->recipe.flipped << 8 |
                  (unsigned long long)c->recipe.at_end);
    mix(hash, (unsigned long long)c->limit);
}

static void mix_solve(unsigned long long *hash, const crm_record *r, const crm_solve *c)
{
    const crm_substep *s = &r->s;
    double most = 0;
    mix(hash, (unsigned long long)c->kind);
    for (int k = 0; k < s->n_contacts; k++) most = fmax(most, fabs(c->ln[k]));
    for (int k = 0; k < s->n_contacts; k++) {
        if (c->mode[k] == CAROM_SEPARATED || fabs(c->ln[k]) <= NO_IMPULSE * most) continue;
        mix_contact(hash, &s->contacts[k]);
        mix(hash, c->mode[k]);
    }
    for (int k = 0; k < r->island.n_rows; k++) mix(hash, c->motor[k]);
}

static void mix_substep(unsigned long long *hash, const crm_record *r)
{
    const crm_substep *s = &r->s;
    mix(hash, (unsigned long long)s->map << 32 | (unsigned long long)s->end);
    mix(hash, (unsigned long long)s->n_solves << 32 | (unsigned long long)s->finest << 1 |
                  (unsigned long long)s->slick);
    for (int k = 0; k < r->island.n_bodies; k++) {
        mix(hash, (unsigned long long)r->island.bodies[k]);
    }
    for (int i = 0; i < s->n_solves; i++) mix_solve(hash, r, &s->solve[i]);
    if (s->end == CRM_END_EVENT || s->end == CRM_END_STOP) mix_contact(hash, &s->event);
}

unsigned long long crm_branch_of(const carom_tape *t)
{
    unsigned long long hash = 0xCBF29CE484222325ULL;
    for (int k = 0; k < t->n_records; k++) mix_substep(&hash, &t->records[k]);
    return hash;
}

/* --- numbers of a world, in the order of the members of carom_gradient --------------------------
 */

enum {
    Q0,
    V0,
    MASS,
    INERTIA,
    FRICTION,
    RESTITUTION,
    GRAVITY_SCALE,
    LINEAR_DAMPING,
    ANGULAR_DAMPING,
    GRAVITY,
    FORCE,
    FORCE_STEPS,
    DT,
    RADIUS,
    VERTICES,
    ANCHORS,
    AXES,
    ANGLES,
    LENGTHS,
    LOWER,
    UPPER,
    STIFFNESS,
    DAMPING,
    REST,
    MOTOR_SPEED,
    MOTOR_LIMIT
};

static const char *const NAMES[CRM_N_ARRAYS] = {"q0",
                                                "v0",
                                                "mass",
                                                "inertia",
                                                "friction",
                                                "restitution",
                                                "gravity_scale",
                                                "linear_damping",
                                                "angular_damping",
                                                "gravity",
                                                "force",
                                                "force_steps",
                                                "dt",
                                                "radius",
                                                "vertices",
                                                "anchors",
                                                "axes",
                                                "angles",
                                                "lengths",
                                                "lower",
                                                "upper",
                                                "stiffness",
                                                "damping",
                                                "rest",
                                                "motor_speed",
                                                "motor_limit"};

const char *carom_gradient_name(int array)
{
    return array >= 0 && array < CRM_N_ARRAYS ? NAMES[array] : NULL;
}

static double *joint_number(crm_joint *j, int array)
{
    switch (array) {
    case AXES: return &j->axis;
    case ANGLES: return &j->angle;
    case LENGTHS: return &j->length;
    case LOWER: return &j->lower;
    case UPPER: return &j->upper;
    case STIFFNESS: return &j->stiffness;
    case DAMPING: return &j->damping;
    case REST: return &j->rest;
    case MOTOR_SPEED: return &j->motor_speed;
    default: return &j->motor_limit;
    }
}

static double *anchor_number(crm_joint *j, int k)
{
    double *const anchors[4] = {&j->local_a.x, &j->local_a.y, &j->local_b.x, &j->local_b.y};
    return anchors[k];
}

double *crm_number(carom_world *w, int array, size_t k)
{
    switch (array) {
    case Q0: return &w->q[k];
    case V0: return &w->v[k];
    case MASS: return &w->mass[k];
    case INERTIA: return &w->inertia[k];
    case FRICTION: return &w->friction[k];
    case RESTITUTION: return &w->restitution[k];
    case GRAVITY_SCALE: return &w->bodies[k].gravity_scale;
    case LINEAR_DAMPING: return &w->bodies[k].damping[1];
    case ANGULAR_DAMPING: return &w->bodies[k].damping[0];
    case GRAVITY: return &w->settings.gravity[k];
    case FORCE: return &w->force[k];
    case FORCE_STEPS: return NULL;
    case DT: return &w->settings.dt;
    case RADIUS: return &w->shapes[k].view.radius;
    case VERTICES: return k % 2 ? &w->vertices[k / 2].y : &w->vertices[k / 2].x;
    case ANCHORS: return anchor_number(&w->joints[k / 4], (int)(k % 4));
    default: return joint_number(&w->joints[k], array);
    }
}

static int joint_has(const crm_joint *j, int array)
{
    switch (array) {
    case LOWER: return j->lower > -HUGE_VAL;
    case UPPER: return j->upper < HUGE_VAL;
    case STIFFNESS: return j->stiffness > 0;
    case DAMPING: return j->damping > 0;
    case MOTOR_LIMIT: return j->motor_limit > 0;
    default: return 1;
    }
}

int crm_number_means(const carom_world *w, int array, size_t k)
{
    const size_t n = 3 * (size_t)w->n_bodies;
    switch (array) {
    case MASS:
    case GRAVITY_SCALE: return w->bodies[k].type == CAROM_DYNAMIC;
    case INERTIA: return w->bodies[k].type == CAROM_DYNAMIC && w->inertia[k] < HUGE_VAL;
    case LINEAR_DAMPING: return crm_is_damped(w, (int)k, 1);
    case ANGULAR_DAMPING: return crm_is_damped(w, (int)k, 0);
    case FORCE:
    case FORCE_STEPS: return w->bodies[k % n / 3].type != CAROM_STATIC;
    case V0: return w->bodies[k / 3].type != CAROM_STATIC;
    default: return array <= ANCHORS || joint_has(&w->joints[k], array);
    }
}

/* What a relative change of the number refers to. */
static double size_of(const carom_world *w, int array, size_t k)
{
    switch (array) {
    case MASS:
    case INERTIA:
    case DT:
    case STIFFNESS:
    case DAMPING:
    case MOTOR_LIMIT: return fabs(*crm_number((carom_world *)w, array, k));
    case RADIUS: return fmax(*crm_number((carom_world *)w, array, k), 0.1 * w->length);
    case VERTICES:
    case ANCHORS: return w->length;
    case Q0: return k % 3 ? w->length : 1;
    default: return 1;
    }
}

/* The side on which a number at the bound of its range may be moved; 0: both. */
static int side_of(const carom_world *w, int array, size_t k, double step)
{
    const int bounded = array == FRICTION || array == RESTITUTION || array == RADIUS;
    const double x = bounded ? *crm_number((carom_world *)w, array, k) : 0;
    if (bounded && x < step) return 1;
    return array == RESTITUTION && x > 1 - step ? -1 : 0;
}

/* --- runs ---------------------------------------------------------------------------------------
 */

typedef struct checker {
    carom_tape *tape;
    int n_bars;
    const carom_state_bar *bars;
    double *force; /* 3 n_bodies */
    double loss;   /* of the run as it is */
    unsigned long long active;
} checker;

static double loss_of(const checker *c, const carom_tape *t)
{
    double sum = 0;
    for (int i = 0; i < c->n_bars; i++) {
        const carom_state_bar *b = &c->bars[i];
        const double *q = carom_tape_q(t, b->step);
        const double *v = carom_tape_v(t, b->step);
        for (int k = 0; k < 3 * t->n_bodies; k++) {
            if (b->q) sum += b->q[k] * q[k];
            if (b->v) sum += b->v[k] * v[k];
        }
    }
    return sum;
}

/* All steps of the tape on w, whose own forces are 0; number k of the forces of steps moved by
 * `by`. */
static carom_status run_all(const checker *c, carom_tape *run, size_t k, double by)
{
    const carom_tape *t = c->tape;
    const size_t n = 3 * (size_t)t->n_bodies;
    carom_status e = CAROM_OK;
    for (int step = 0; e >= 0 && step < t->n_frames; step++) {
        memcpy(c->force, t->frames[step].force, n * sizeof(double));
        if (k / n == (size_t)step) c->force[k % n] += by;
        e = carom_tape_step(run, c->force, NULL);
    }
    return e;
}

/* The loss with number k of an array moved by `by`, NaN when a step fails, and the active set of
 * that run. */
static carom_status probe(const checker *c, int array, size_t k, double by, double *loss,
                          unsigned long long *active)
{
    const carom_tape *t = c->tape;
    carom_world *w = NULL;
    carom_tape *run = NULL;
    carom_status e = carom_world_copy(t->world, NULL, &w);
    *loss = NAN;
    *active = 0;
    if (e >= 0) e = carom_world_set_state(w, carom_tape_q(t, 0), carom_tape_v(t, 0));
    if (e >= 0) {
        double *x = array < 0 ? NULL : crm_number(w, array, k);
        memset(w->force, 0, 3 * (size_t)w->n_bodies * sizeof(double));
        if (x) *x += by;
        w->n_steps = t->first_step;
        e = carom_tape_create(w, NULL, &run);
    }
    if (e >= 0 && run_all(c, run, k, array == FORCE_STEPS ? by : 0) >= 0) {
        *loss = loss_of(c, run);
        *active = crm_branch_of(run);
    }
    carom_tape_destroy(run);
    carom_world_destroy(w);
    return e;
}

/* Difference quotient of second order, and whether the active set changes on the way. */
static carom_status difference(const checker *c, carom_checked *x, double step, double *d,
                               int *changes)
{
    const int side = side_of(c->tape->world, x->array, (size_t)x->index, step);
    const double at[2] = {side ? side * step : step, side ? 2 * side * step : -step};
    double loss[2];
    unsigned long long active[2];
    for (int i = 0; i < 2; i++) {
        const carom_status e = probe(c, x->array, (size_t)x->index, at[i], &loss[i], &active[i]);
        if (e < 0) return e;
    }
    x->one_sided |= side != 0;
    *d = side ? (4 * loss[0] - loss[1] - 3 * c->loss) / at[1] : (loss[0] - loss[1]) / (2 * step);
    *changes = active[0] != c->active || active[1] != c->active;
    return CAROM_OK;
}

static carom_status check_entry(const checker *c, const carom_check_settings *set, double largest,
                                carom_checked *x)
{
    const double size = size_of(c->tape->world, x->array, (size_t)x->index);
    x->kink = 1;
    x->one_sided = 0;
    x->disagreement = HUGE_VAL;
    for (int i = 0; i < N_SIZES; i++) {
        int changes;
        x->step[i] = set->step[i] * size;
        const carom_status e = difference(c, x, x->step[i], &x->difference[i], &changes);
        if (e < 0) return e;
        const double least = fmax(SMALL * largest, NOTHING * fabs(c->loss) / size);
        const double scale = fmax(fmax(fabs(x->gradient), fabs(x->difference[i])), least);
        const double off = fabs(x->difference[i] - x->gradient);
        x->kink &= changes;
        if (off == 0) x->disagreement = 0;
        if (scale > 0 && off / scale < x->disagreement) x->disagreement = off / scale;
    }
    return CAROM_OK;
}

/* --- which entries ------------------------------------------------------------------------------
 */

static unsigned long long next_random(unsigned long long *state)
{
    unsigned long long z = (*state += 0x9E3779B97F4A7C15ULL);
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL;
    return z ^ (z >> 31);
}

/* Appends `most` entries of an array to the list, in order: each is taken with the probability that
 * this needs. */
static void choose(const carom_tape *t, const double *g, int array, int most,
                   unsigned long long *random, int capacity, carom_checked *list, int *count)
{
    const size_t n = crm_array_size(t->world, t->n_frames, array);
    size_t left = 0;
    for (size_t k = 0; k < n; k++) left += crm_number_means(t->world, array, k) != 0;
    size_t wanted = most > 0 && (size_t)most < left ? (size_t)most : left;
    for (size_t k = 0; k < n && wanted > 0; k++) {
        if (!crm_number_means(t->world, array, k)) continue;
        if (next_random(random) % left-- >= wanted) continue;
        wanted--;
        if (*count < capacity) {
            const carom_checked x = {.array = array, .index = (int)k, .gradient = g[k]};
            list[*count] = x;
        }
        ++*count;
    }
}

static double largest_of(const double *g, size_t n)
{
    double most = 0;
    for (size_t k = 0; k < n; k++) most = fmax(most, fabs(g[k]));
    return most;
}

static int settings_valid(const carom_check_settings *s)
{
    return s->per_array >= 0 && s->step[0] > 0 && s->step[1] > 0 && s->step[0] < 1 &&
           s->step[1] < 1;
}

carom_check_settings carom_check_defaults(void)
{
    const carom_check_settings s = {20, 1, {1e-5, 1e-6}, NULL, NULL};
    return s;
}

/* The entries of the list, one by one. */
static carom_status check_all(checker *c, const carom_gradient *g, const carom_check_settings *set,
                              carom_checked *list, int *count)
{
    const carom_tape *t = c->tape;
    const int all = *count;
    carom_status e = probe(c, -1, 0, 0, &c->loss, &c->active);
    for (int i = 0; e >= 0 && i < all; i++) {
        const int array = list[i].array;
        const double most =
            largest_of(crm_array(g, array), crm_array_size(t->world, t->n_frames, array));
        *count = i;
        if (set->progress && set->progress(set->user, i, all)) return CAROM_OK;
        e = check_entry(c, set, most, &list[i]);
        if (e >= 0) *count = i + 1;
    }
    return e;
}

carom_status carom_tape_check(carom_tape *tape, int n_bars, const carom_state_bar *bars,
                              const carom_gradient *gradient, const carom_check_settings *settings,
                              int capacity, carom_checked *entries, int *count)
{
    const carom_check_settings set = settings ? *settings : carom_check_defaults();
    if (!tape || n_bars < 0 || (n_bars && !bars) || !gradient || !count || capacity < 0 ||
        (capacity && !entries) || !settings_valid(&set)) {
        return CAROM_E_ARGUMENT;
    }
    for (int i = 0; i < n_bars; i++) {
        if (bars[i].step < 0 || bars[i].step > carom_tape_steps(tape)) return CAROM_E_ARGUMENT;
    }
    const carom_status current = crm_tape_current(tape);
    if (current < 0) return current;
    if (!carom_tape_q(tape, 0)) {
        return crm_world_fail(tape->world, CAROM_E_STATE,
                              "a tape whose memory is bounded has no start to check from");
    }
    unsigned long long random = set.seed;
    int n = 0;
    for (int a = 0; a < CRM_N_ARRAYS; a++) {
        const double *g = crm_array(gradient, a);
        if (g) choose(tape, g, a, set.per_array, &random, capacity, entries, &n);
    }
    *count = n;
    if (!capacity) return CAROM_OK;
    if (n > capacity) n = capacity;
    checker c = {tape, n_bars, bars, NULL, 0, 0};
    const size_t n3 = 3 * (size_t)tape->n_bodies;
    c.force = crm_new(&tape->memory, n3, sizeof(double));
    if (!c.force) return CAROM_E_MEMORY;
    const carom_status e = check_all(&c, gradient, &set, entries, &n);
    crm_free(&tape->memory, c.force, n3, sizeof(double));
    *count = n;
    return e;
}
