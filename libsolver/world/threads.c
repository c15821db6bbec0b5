/* threads.c: islands shared among threads.  docs/step.md, section "Threads". */
#include "world/internal.h"

#ifdef CRM_THREADS
#include <pthread.h>
#endif

/* A thread pays from so many bodies on that contacts or joints hold. */
enum { BODIES_PER_THREAD = 32 };
/* Each thread comes back for islands so often. */
enum { SHARES = 8 };

/* What came of an island, to be put together in the order of islands. */
typedef struct outcome {
    carom_status status;
    const carom_world *by;
    int first_touch, n_touches; /* in its lists */
    int first_event, n_events;
    int n_substeps;
    carom_step_stats stats;
} outcome;

void crm_stats_add(carom_step_stats *sum, const carom_step_stats *part)
{
    if (part->status > sum->status) sum->status = part->status;
    if (part->stage > sum->stage) sum->stage = part->stage;
    if (part->n_substeps > sum->n_substeps) sum->n_substeps = part->n_substeps;
    sum->residual = fmax(sum->residual, part->residual);
    sum->penetration = fmax(sum->penetration, part->penetration);
    sum->estimate += part->estimate;
    sum->n_contacts += part->n_contacts;
    sum->n_events += part->n_events;
    sum->factorizations += part->factorizations;
    sum->iterations += part->iterations;
    sum->degenerate += part->degenerate;
    sum->n_asleep += part->n_asleep;
    sum->n_still += part->n_still;
}

#ifdef CRM_THREADS

/* The world as one thread sees it: the same bodies, joints and islands, and what a sub-step writes
 * of its own. */
static carom_status create_worker(const carom_world *w, carom_world *x)
{
    memset(x, 0, sizeof *x);
    x->memory = crm_memory_from(&w->memory.from);
    x->settings = w->settings;
    x->n_bodies = w->n_bodies;
    x->n_moving = w->n_moving;
    x->n_joint_rows = w->n_joint_rows;
    x->plan = w->plan;
    x->n_solves = w->n_solves;
    carom_status e = crm_solver_create(x, &x->solver);
    if (!e) e = crm_rows_create(x);
    if (!e) e = crm_substeps_create(x);
    if (e || !w->plan.changes) return e;
    x->probe = crm_new(&x->memory, 3 * (size_t)w->n_bodies, sizeof *x->probe);
    return x->probe ? CAROM_OK : CAROM_E_MEMORY;
}

static void free_worker(carom_world *x)
{
    carom_contact_destroy(x->solver);
    crm_rows_free(x);
    crm_anderson_free(&x->memory, &x->anderson);
    crm_substep_free(x, &x->sub);
    for (int k = 0; k < CRM_MAX_INNER; k++) crm_substep_free(x, &x->inner[k]);
    if (x->probe) crm_free(&x->memory, x->probe, 3 * (size_t)x->n_bodies, sizeof *x->probe);
    crm_free(&x->memory, x->next.list, (size_t)x->next.max, sizeof *x->next.list);
    crm_events_free(x);
}

/* Brings the shared part up to date. */
static void begin_frame(const carom_world *w, carom_world *x)
{
    const carom_world own = *x;
    *x = *w;
    x->memory = own.memory;
    x->solver = own.solver;
    x->rows = own.rows;
    x->sub = own.sub;
    memcpy(x->inner, own.inner, sizeof own.inner);
    x->anderson = own.anderson;
    x->probe = own.probe;
    x->next = own.next;
    x->next.n = 0;
    x->events = own.events;
    x->events.on = w->events.on;
    x->events.n = 0;
    x->n_workers = 0;
    x->workers = NULL;
    x->statics_placed = 0;
    crm_put_statics(x);
}

typedef struct job {
    carom_world *w;
    crm_advance *advance;
    outcome *outcomes;
    int next; /* island to take */
    int share;
    pthread_mutex_t mutex;
} job;

typedef struct worker {
    job *j;
    carom_world *x;
} worker;

static void advance_one(const job *j, carom_world *x, int island)
{
    outcome *o = &j->outcomes[island];
    memset(o, 0, sizeof *o);
    o->by = x;
    o->first_touch = x->next.n;
    o->first_event = x->events.n;
    x->stats = &o->stats;
    o->status = j->advance(x, &j->w->islands.list[island]);
    o->n_touches = x->next.n - o->first_touch;
    o->n_events = x->events.n - o->first_event;
    o->n_substeps = x->n_substeps;
}

/* Takes islands until none is left. */
static void *work(void *user)
{
    const worker *me = user;
    job *j = me->j;
    for (;;) {
        pthread_mutex_lock(&j->mutex);
        const int from = j->next;
        j->next += j->share;
        pthread_mutex_unlock(&j->mutex);
        if (from >= j->w->islands.n) return NULL;
        const int to = from + j->share < j->w->islands.n ? from + j->share : j->w->islands.n;
        for (int i = from; i < to; i++) advance_one(j, me->x, i);
    }
}

static carom_status take_touches(carom_world *w, const outcome *o)
{
    const carom_status e = crm_touches_reserve(w, w->next.n + o->n_touches);
    if (e || !o->n_touches) return e;
    memcpy(&w->next.list[w->next.n], &o->by->next.list[o->first_touch],
           (size_t)o->n_touches * sizeof *w->next.list);
    w->next.n += o->n_touches;
    return CAROM_OK;
}

/* From the first n workers, in the order of islands, so that who took which leaves no trace. */
static carom_status collect(carom_world *w, const outcome *o, int n)
{
    for (int i = 0; i < w->islands.n; i++, o++) {
        w->n_substeps = o->n_substeps;
        if (o->status < 0) return o->status;
        crm_stats_add(w->stats, &o->stats);
        carom_status e = take_touches(w, o);
        if (!e && o->n_events) {
            e = crm_events_append(w, &o->by->events.list[o->first_event], o->n_events);
        }
        if (e) return e;
    }
    for (int k = 0; k < n; k++) { /* others are of an earlier frame */
        w->islands.escaped |= w->workers[k].islands.escaped;
        w->islands.looked_ahead |= w->workers[k].islands.looked_ahead;
    }
    return CAROM_OK;
}

static carom_status reserve_workers(carom_world *w, int n)
{
    if (!w->workers) {
        w->workers = crm_new(&w->memory, (size_t)w->settings.threads, sizeof *w->workers);
        if (!w->workers) return CAROM_E_MEMORY;
    }
    while (w->n_workers < n) {
        const carom_status e = create_worker(w, &w->workers[w->n_workers]);
        if (e) {
            free_worker(&w->workers[w->n_workers]);
            return e;
        }
        w->n_workers++;
    }
    return CAROM_OK;
}

/* Threads that cannot be had are done without: the others take their islands. */
static carom_status run(carom_world *w, job *j, int n)
{
    pthread_t thread[CRM_MAX_THREADS];
    worker workers[CRM_MAX_THREADS];
    int started = 1;
    if (pthread_mutex_init(&j->mutex, NULL)) return CAROM_E_MEMORY;
    for (int k = 0; k < n; k++) {
        begin_frame(w, &w->workers[k]);
        workers[k].j = j;
        workers[k].x = &w->workers[k];
    }
    while (started < n && !pthread_create(&thread[started], NULL, work, &workers[started])) {
        started++;
    }
    work(&workers[0]);
    for (int k = 1; k < started; k++) pthread_join(thread[k], NULL);
    pthread_mutex_destroy(&j->mutex);
    return CAROM_OK;
}

int crm_threads_that_pay(const carom_world *w)
{
    int bound = 0;
    if (w->settings.threads < 2 || w->recorder.substep || w->islands.n < 2) return 1;
    for (int i = 0; i < w->islands.n; i++) {
        const crm_island *x = &w->islands.list[i];
        if (x->n_pairs || x->n_joints) bound += x->n_bodies;
    }
    int n = w->settings.threads;
    if (n > w->islands.n) n = w->islands.n;
    return n > 1 + bound / BODIES_PER_THREAD ? 1 + bound / BODIES_PER_THREAD : n;
}

carom_status crm_advance_shared(carom_world *w, int n, crm_advance *advance)
{
    carom_status e = reserve_workers(w, n);
    if (!e) {
        e = crm_reserve(&w->memory, &w->outcomes, &w->max_outcomes, w->islands.n, sizeof(outcome));
    }
    if (e) return e;
    job j = {.w = w, .advance = advance, .outcomes = w->outcomes};
    j.share = 1 + w->islands.n / (SHARES * n);
    e = run(w, &j, n);
    return e ? e : collect(w, w->outcomes, n);
}

void crm_threads_free(carom_world *w)
{
    for (int k = 0; k < w->n_workers; k++) free_worker(&w->workers[k]);
    if (w->workers)
        crm_free(&w->memory, w->workers, (size_t)w->settings.threads, sizeof *w->workers);
    crm_free(&w->memory, w->outcomes, (size_t)w->max_outcomes, sizeof(outcome));
    w->workers = NULL;
    w->n_workers = 0;
}

#else

int crm_threads_that_pay(const carom_world *w)
{
    (void)w;
    return 1;
}

carom_status crm_advance_shared(carom_world *w, int n, crm_advance *advance)
{
    (void)w;
    (void)n;
    (void)advance;
    return CAROM_E_STATE;
}

void crm_threads_free(carom_world *w)
{
    (void)w;
}

#endif
