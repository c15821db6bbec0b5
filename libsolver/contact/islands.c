#include "libsolver/contact/islands.h"

#include "libsolver/contact/ladder/ladder.h"

#include <math.h>
#ifdef CRM_THREADS
#include <pthread.h>
#endif

/* A contact is degenerate when its complementary quantities are both below this, in the island's
 * unit scale [1]. */
#define DEGENERATE 1e-9

/* Islands smaller than this, together, are not worth a thread [contacts and joint groups]. */
#define ROWS_PER_THREAD 256

carom_status crm_give_row(carom_contact_solver *c, const carom_contact_problem *p, int row,
                          double y)
{
    const int n = p->n_contacts + p->n_joint_rows;
    const carom_status s =
        crm_reserve(&c->memory, (void **)&c->certificate, &c->certificate_max, n, sizeof(double));
    if (s < 0) return s;
    memset(c->certificate, 0, (size_t)n * sizeof(double));
    c->certificate[row] = y;
    c->certificate_valid = 1;
    return CAROM_E_INFEASIBLE;
}

/* The island's certificate, in the problem's rows and units. */
static carom_status give_certificate(carom_contact_solver *c, const carom_contact_problem *p,
                                     const crm_island *s, int island)
{
    const crm_graph *g = &c->graph;
    const crm_system *y = &c->system;
    if (crm_give_row(c, p, 0, 0) == CAROM_E_MEMORY) return CAROM_E_MEMORY;
    for (int k = 0; k < s->nc; k++) {
        const int slot = g->contact_ptr[island] + k;
        c->certificate[g->contact_of[slot]] = y->scale_n[slot] * s->x.n[k];
    }
    for (int q = 0; q < s->ng; q++) {
        const int slot = g->group_ptr[island] + q;
        for (int i = 0; i < g->group_size[slot]; i++)
            c->certificate[p->n_contacts + g->group_row[slot] + i] =
                y->scale_e[3 * slot + i] * s->x.z[3 * (s->nb + q) + i];
    }
    return CAROM_E_INFEASIBLE;
}

/* Weakly active, or on the border of slipping. */
static int count_degenerate(crm_island *s)
{
    int n = 0;
    if (!s->fresh) crm_island_residual(s, s->best); /* leaves a and u */
    for (int k = 0; k < s->nc; k++) {
        const double ln = s->best.n[k];
        const double bound = s->contact[k].mu * ln;
        const double u = fabs(s->ut[k]);
        const int weak = fmax(fabs(s->an[k]), fabs(ln)) < DEGENERATE;
        const int border = s->contact[k].mu > 0 && ln >= DEGENERATE && u < DEGENERATE &&
                           fabs(fabs(s->best.t[k]) - bound) < DEGENERATE;
        n += weak || border;
    }
    return n;
}

/* What all islands share; the counter is the only thing that is written. */
typedef struct job {
    carom_contact_solver *c;
    const carom_contact_problem *p;
    const carom_contact_solution *x;
    int use_guess;
    int next; /* island to take */
#ifdef CRM_THREADS
    pthread_mutex_t mutex;
#endif
} job;

static void solve_island(job *j, int island)
{
    carom_contact_solver *c = j->c;
    const crm_graph *g = &c->graph;
    crm_outcome *o = &c->system.outcome[island];
    crm_system_gather(&c->system, g, j->p, island);
    crm_island *s = crm_system_begin(&c->system, island);
    s->accept = c->settings.accept;
    s->inexact = c->settings.inexact;
    s->max_iterations = c->settings.max_iterations;
    s->max_restarts = c->settings.max_restarts;
    s->brief = j->use_guess & CAROM_GUESS_BRIEF;
    const int guess = j->use_guess & ~CAROM_GUESS_BRIEF;
    if (guess) crm_system_read(&c->system, g, s, island, j->x, guess);
    o->status = crm_ladder_climb(s, guess, &o->stage, &o->unpolished);
    o->factorizations = s->factorizations;
    o->iterations = s->iterations;
    o->pivots = s->pivots;
    o->degenerate = o->status == CAROM_E_INFEASIBLE ? 0 : count_degenerate(s);
}

#ifdef CRM_THREADS
/* Takes islands until none is left. */
static void *work(void *user)
{
    job *j = user;
    for (;;) {
        pthread_mutex_lock(&j->mutex);
        const int island = j->next++;
        pthread_mutex_unlock(&j->mutex);
        if (island >= j->c->graph.n_islands) return NULL;
        solve_island(j, island);
    }
}

/* Threads that pay, this one included. */
static int count_threads(const carom_contact_solver *c)
{
    const int rows = c->graph.n_live + c->graph.n_groups;
    int n = c->settings.threads;
    if (n > c->graph.n_islands) n = c->graph.n_islands;
    if (n > 1 + rows / ROWS_PER_THREAD) n = 1 + rows / ROWS_PER_THREAD;
    return n;
}

/* Threads that cannot be had are done without: the others take their islands. */
static void solve_all(job *j)
{
    pthread_t thread[CRM_MAX_THREADS];
    const int n = count_threads(j->c);
    int started = 0;
    if (n <= 1 || pthread_mutex_init(&j->mutex, NULL)) {
        for (int i = 0; i < j->c->graph.n_islands; i++) solve_island(j, i);
        return;
    }
    while (started < n - 1 && !pthread_create(&thread[started], NULL, work, j)) started++;
    work(j);
    for (int i = 0; i < started; i++) pthread_join(thread[i], NULL);
    pthread_mutex_destroy(&j->mutex);
}
#else
static void solve_all(job *j)
{
    for (int i = 0; i < j->c->graph.n_islands; i++) solve_island(j, i);
}
#endif

static void add_outcome(const crm_outcome *o, carom_contact_stats *stats)
{
    stats->factorizations += o->factorizations;
    stats->iterations += o->iterations;
    stats->pivots += o->pivots;
    stats->degenerate += o->degenerate;
    stats->residual_unpolished = fmax(stats->residual_unpolished, o->unpolished);
    if (o->stage > stats->stage) stats->stage = o->stage;
}

carom_status crm_islands_solve(carom_contact_solver *c, const carom_contact_problem *p,
                               int use_guess, const carom_contact_solution *x,
                               carom_contact_stats *stats)
{
    job j = {.c = c, .p = p, .x = x, .use_guess = use_guess};
    int infeasible = -1;
    solve_all(&j);
    for (int i = 0; i < c->graph.n_islands; i++) {
        add_outcome(&c->system.outcome[i], stats);
        if (c->system.outcome[i].status == CAROM_E_INFEASIBLE && infeasible < 0) infeasible = i;
    }
    if (infeasible < 0) return CAROM_OK;
    return give_certificate(c, p, &c->system.island[infeasible], infeasible);
}
