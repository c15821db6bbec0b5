/* sleep.c: islands at rest that are not run again.  docs/step.md, section "Rest". */
#include "world/internal.h"

/* Impulses of two steps of the same rest differ by no more than this [largest of the island]. */
static const double SAME = 1e-6;

/* What put the body to rest, to be compared bit for bit. */
struct crm_rest {
    int rests;
    long step; /* the last one that left it so */
    long revision;
    int first, n_bodies, n_pairs; /* of its island */
    int n_substeps, degenerate;   /* of the step that put it to rest, to be told again */
    double residual;
    double q[3], force[3];
};

/* Free flight never rests, and keeps nothing. */
carom_status crm_sleep_create(carom_world *w)
{
    const size_t rows = 3 * (size_t)w->n_joint_rows;
    if (!w->settings.sleep && !w->plan.solver) return CAROM_OK;
    w->rest = crm_new(&w->memory, (size_t)w->n_bodies, sizeof *w->rest);
    if (w->rest && rows) w->rest_forces = crm_new(&w->memory, rows, sizeof *w->rest_forces);
    return w->rest && (w->rest_forces || !rows) ? CAROM_OK : CAROM_E_MEMORY;
}

void crm_sleep_free(carom_world *w)
{
    const size_t rows = 3 * (size_t)w->n_joint_rows;
    if (w->rest) crm_free(&w->memory, w->rest, (size_t)w->n_bodies, sizeof *w->rest);
    if (w->rest_forces) crm_free(&w->memory, w->rest_forces, rows, sizeof *w->rest_forces);
    w->rest = NULL;
    w->rest_forces = NULL;
}

void crm_sleep_forget(carom_world *w)
{
    for (int b = 0; w->rest && b < w->n_bodies; b++) w->rest[b].rests = 0;
}

static int is_still(const double *v)
{
    return v[0] == 0 && v[1] == 0 && v[2] == 0;
}

static int all_still(const carom_world *w, const double *v)
{
    for (int k = 0; k < w->island->n_bodies; k++) {
        if (!is_still(&v[3 * w->island->bodies[k]])) return 0;
    }
    return 1;
}

/* Nothing that a step depends on has changed since the last one. */
static int sleeps(const carom_world *w, int b)
{
    const crm_island *i = w->island;
    const crm_rest *r = &w->rest[b];
    return r->rests && r->step + 1 == w->n_steps && r->revision == w->revision &&
           r->first == i->bodies[0] && r->n_bodies == i->n_bodies && r->n_pairs == i->n_pairs &&
           is_still(&w->v[3 * b]) && !memcmp(r->q, &w->q[3 * b], sizeof r->q) &&
           !memcmp(r->force, &w->step_force[3 * b], sizeof r->force);
}

static void mark(carom_world *w, int rests)
{
    const crm_island *i = w->island;
    for (int k = 0; k < i->n_bodies; k++) {
        const int b = i->bodies[k];
        crm_rest *r = &w->rest[b];
        r->rests = rests;
        r->step = w->n_steps;
        if (!rests) continue;
        r->revision = w->revision;
        r->first = i->bodies[0];
        r->n_bodies = i->n_bodies;
        r->n_pairs = i->n_pairs;
        r->n_substeps = w->n_substeps;
        r->degenerate = w->stats->degenerate;
        r->residual = w->stats->residual;
        memcpy(r->q, &w->q[3 * b], sizeof r->q);
        memcpy(r->force, &w->step_force[3 * b], sizeof r->force);
    }
}

/* The touches of the last step are those of this one. */
static carom_status keep_touches(carom_world *w)
{
    for (int k = 0; k < w->island->n_pairs; k++) {
        int n;
        const crm_touch *t = crm_touches_of(w, w->island->pairs[k], &n);
        const carom_status e = n ? crm_touches_reserve(w, w->next.n + n) : CAROM_OK;
        if (e) return e;
        for (int i = 0; i < n; i++) {
            w->next.list[w->next.n++] = t[i];
            w->stats->n_contacts++;
            w->stats->penetration = fmax(w->stats->penetration, -t[i].contact.gap);
        }
    }
    return CAROM_OK;
}

/* Recorded steps know stillness alone. */
static int may_sleep(const carom_world *w)
{
    return w->settings.sleep && !w->recorder.substep;
}

/* Free flight is run as it is. */
static int may_rest(const carom_world *w)
{
    const int held = w->island->n_pairs > 0 || w->island->n_joints > 0;
    return w->rest && (held || may_sleep(w));
}

/* Joint forces of the island before the step, for crm_sleep_settle. */
static void save_forces(carom_world *w)
{
    const double *all[3] = {w->joint_force[0], w->joint_force[1], w->joint_total};
    for (int k = 0; k < w->island->n_joints; k++) {
        const crm_joint *j = &w->joints[w->island->joints[k]];
        for (int i = 0; i < 3; i++) {
            memcpy(&w->rest_forces[i * w->n_joint_rows + j->first_row], &all[i][j->first_row],
                   (size_t)j->n_rows * sizeof(double));
        }
    }
}

/* The figures of the step that put the island to rest, which would be those of this one. */
static void tell_again(carom_world *w)
{
    const crm_island *i = w->island;
    const crm_rest *r = &w->rest[i->bodies[0]];
    carom_step_stats *t = w->stats;
    w->n_substeps = r->n_substeps;
    t->n_substeps = r->n_substeps;
    t->degenerate = r->degenerate;
    t->residual = r->residual;
    *(may_sleep(w) ? &t->n_asleep : &t->n_still) += i->n_bodies;
}

carom_status crm_sleep_on(carom_world *w, int *asleep)
{
    const crm_island *i = w->island;
    *asleep = 0;
    if (!may_rest(w)) return CAROM_OK;
    if (i->n_rows) save_forces(w);
    for (int k = 0; k < i->n_bodies; k++) {
        if (!sleeps(w, i->bodies[k])) return CAROM_OK;
    }
    if (w->recorder.again) {
        int known;
        const carom_status e = w->recorder.again(w->recorder.user, &known);
        if (e || !known) return e;
    }
    *asleep = 1;
    tell_again(w);
    mark(w, 1);
    return keep_touches(w);
}

/* Of body b from the start of the step to its end. */
static int barely_moves(const carom_world *w, int b, double slow)
{
    const double *v0 = &w->v_saved[3 * b];
    const double *v1 = &w->v[3 * b];
    const double *q0 = &w->q_saved[3 * b];
    const double *q1 = &w->q[3 * b];
    const double reach = w->bodies[b].reach;
    const double way = hypot(q1[1] - q0[1], q1[2] - q0[2]) + reach * fabs(q1[0] - q0[0]);
    const int kept = w->bodies[b].type == CAROM_DYNAMIC || is_still(v0);
    return kept && w->carry[b] == 0 && !w->owes[b] && way <= w->settings.dt * slow &&
           hypot(v0[1], v0[2]) + reach * fabs(v0[0]) <= slow &&
           hypot(v1[1], v1[2]) + reach * fabs(v1[0]) <= slow;
}

/* Steps from here would differ by nothing but the state. */
static int may_settle(const carom_world *w)
{
    const crm_island *i = w->island;
    return w->stats->status == CAROM_OK && !i->n_limited && !i->n_driven && !w->n_fields;
}

static int rests(const carom_world *w)
{
    const crm_island *i = w->island;
    const double slow = CRM_REST_TOL * w->speed;
    if (!may_settle(w)) return 0;
    for (int k = 0; k < i->n_bodies; k++) {
        if (!barely_moves(w, i->bodies[k], slow)) return 0;
    }
    return 1;
}

/* Largest force that the joints of the island had before the step or have, and largest change. */
static void compare_forces(const carom_world *w, double *largest, double *change)
{
    for (int k = 0; k < w->island->n_joints; k++) {
        const crm_joint *j = &w->joints[w->island->joints[k]];
        for (int r = j->first_row; r < j->first_row + j->n_rows; r++) {
            const double old = w->rest_forces[2 * w->n_joint_rows + r];
            *largest = fmax(*largest, fmax(fabs(old), fabs(w->joint_total[r])));
            *change = fmax(*change, fabs(old - w->joint_total[r]));
        }
    }
}

/* A step from rest to rest gives the same impulses but for rounding; those of the last step stay,
 * so that to run it or not makes no difference. */
static void keep_forces(carom_world *w)
{
    double *all[3] = {w->joint_force[0], w->joint_force[1], w->joint_total};
    double largest = 0;
    double change = 0;
    compare_forces(w, &largest, &change);
    if (change > SAME * largest) return;
    for (int k = 0; k < w->island->n_joints; k++) {
        const crm_joint *j = &w->joints[w->island->joints[k]];
        for (int i = 0; i < 3; i++) {
            memcpy(&all[i][j->first_row], &w->rest_forces[i * w->n_joint_rows + j->first_row],
                   (size_t)j->n_rows * sizeof(double));
        }
    }
}

static int same_touches(const crm_touch *old, const crm_touch *now, int n, double largest)
{
    for (int i = 0; i < n; i++) {
        if (!crm_recipe_same(old[i].contact.recipe, now[i].contact.recipe)) return 0;
        if (old[i].mode != now[i].mode) return 0;
        if (fabs(old[i].ln - now[i].ln) > SAME * largest) return 0;
        if (fabs(old[i].lt - now[i].lt) > SAME * largest) return 0;
    }
    return 1;
}

/* The same of touches: *n of those in `now` belong to one pair. */
static const crm_touch *old_touches(const carom_world *w, const crm_touch *now, int left,
                                    double largest, int *n)
{
    const carom_pair pair = {now->contact.shape_a, now->contact.shape_b};
    const crm_touch *t = crm_touches_of(w, pair, n);
    return *n && *n <= left && same_touches(t, now, *n, largest) ? t : NULL;
}

/* All of the island or none. */
static void keep_old_touches(carom_world *w)
{
    crm_touch *now = w->next.list + w->first_touch;
    const int n_now = w->next.n - w->first_touch;
    double largest = 0;
    int n;
    for (int k = 0; k < n_now; k++) largest = fmax(largest, now[k].ln);
    for (int k = 0; k < n_now; k += n) {
        if (!old_touches(w, &now[k], n_now - k, largest, &n)) return;
    }
    for (int k = 0; k < n_now; k += n) {
        const crm_touch *t = old_touches(w, &now[k], n_now - k, HUGE_VAL, &n);
        memcpy(&now[k], t, (size_t)n * sizeof *t);
    }
}

static int same_bits(const carom_world *w, const double *a, const double *b)
{
    for (int k = 0; k < w->island->n_bodies; k++) {
        const int at = 3 * w->island->bodies[k];
        if (memcmp(&a[at], &b[at], 3 * sizeof *a)) return 0;
    }
    return 1;
}

static int owes_time(const carom_world *w)
{
    for (int k = 0; k < w->island->n_bodies; k++) {
        const int b = w->island->bodies[k];
        if (w->carry[b] != 0 || w->owes[b]) return 1;
    }
    return 0;
}

static int same_joint_forces(const carom_world *w)
{
    const double *all[3] = {w->joint_force[0], w->joint_force[1], w->joint_total};
    for (int k = 0; k < w->island->n_joints; k++) {
        const crm_joint *j = &w->joints[w->island->joints[k]];
        for (int i = 0; i < 3; i++) {
            if (memcmp(&all[i][j->first_row], &w->rest_forces[i * w->n_joint_rows + j->first_row],
                       (size_t)j->n_rows * sizeof(double)))
                return 0;
        }
    }
    return 1;
}

/* What the next step starts from, besides the state. */
static int same_guess(const crm_touch *a, const crm_touch *b)
{
    return crm_recipe_same(a->contact.recipe, b->contact.recipe) && a->mode == b->mode &&
           !memcmp(a->force_n, b->force_n, sizeof a->force_n) &&
           !memcmp(a->force_t, b->force_t, sizeof a->force_t);
}

/* The touches of the island are the old ones, all of them, in the same order. */
static int same_guesses(const carom_world *w)
{
    const crm_touch *now = w->next.list + w->first_touch;
    int left = w->next.n - w->first_touch;
    for (int k = 0; k < w->island->n_pairs; k++) {
        int n;
        const crm_touch *old = crm_touches_of(w, w->island->pairs[k], &n);
        if (n > left) return 0;
        for (int i = 0; i < n; i++) {
            if (!same_guess(&old[i], &now[i])) return 0;
        }
        now += n;
        left -= n;
    }
    return left == 0;
}

/* The step has given the bits that it started from: the next one would do so, too. */
static int is_still_island(const carom_world *w)
{
    return may_settle(w) && all_still(w, w->v) && all_still(w, w->v_saved) &&
           same_bits(w, w->q, w->q_saved) && !owes_time(w) && same_joint_forces(w) &&
           same_guesses(w);
}

void crm_sleep_settle(carom_world *w)
{
    if (!may_rest(w)) return;
    if (!may_sleep(w)) {
        mark(w, is_still_island(w));
        return;
    }
    if (!rests(w)) {
        mark(w, 0);
        return;
    }
    const int still = all_still(w, w->v_saved);
    crm_copy(w, w->q, w->q_saved);
    crm_zero(w, w->v);
    if (still) keep_old_touches(w);
    if (still && w->island->n_rows) keep_forces(w);
    mark(w, still);
}
