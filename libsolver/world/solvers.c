/* solvers.c: a contact solver for each island, so that graphs, patterns and factors outlive the
 * step.  docs/step.md, section "Islands". */
#include "world/internal.h"

/* Solvers beyond the world's own, at most; islands beyond that share one. */
enum { MAX_KEPT = 4096 };
/* Steps after which a solver that nobody used is given up, when it is time to look. */
enum { IDLE_STEPS = 64 };

static int has_problem(const crm_island *i)
{
    return i->n_pairs || i->n_rows || i->n_limited;
}

static int count_problems(const crm_islands *s)
{
    int n = 0;
    for (int k = 0; k < s->n; k++) n += has_problem(&s->list[k]);
    return n;
}

static void give_up(crm_kept_solvers *t, crm_kept_solver *k)
{
    carom_contact_destroy(k->solver);
    k->solver = NULL;
    t->n--;
}

static void give_up_idle(carom_world *w)
{
    crm_kept_solvers *t = &w->kept;
    for (int b = 0; t->n && b < w->n_bodies; b++) {
        crm_kept_solver *k = &t->list[b];
        if (k->solver && k->used + IDLE_STEPS < w->n_steps) give_up(t, k);
    }
}

/* An island is known by its first body. */
static carom_status provide(carom_world *w, crm_island *i)
{
    crm_kept_solvers *t = &w->kept;
    crm_kept_solver *k = &t->list[i->bodies[0]];
    if (!k->solver) {
        if (t->n == MAX_KEPT) return CAROM_OK;
        const carom_status e = crm_solver_create(w, &k->solver);
        if (e) return e;
        t->n++;
    }
    k->used = w->n_steps;
    i->solver = k->solver;
    return CAROM_OK;
}

carom_status crm_solvers_assign(carom_world *w)
{
    crm_kept_solvers *t = &w->kept;
    crm_islands *s = &w->islands;
    carom_status e = CAROM_OK;
    if (w->n_steps % IDLE_STEPS == 0) give_up_idle(w);
    if (!w->plan.solver || count_problems(s) < 2) return CAROM_OK;
    if (!t->list) {
        t->list = crm_new(&w->memory, (size_t)w->n_bodies, sizeof *t->list);
        if (!t->list) return CAROM_E_MEMORY;
    }
    for (int k = 0; !e && k < s->n; k++) {
        if (has_problem(&s->list[k])) e = provide(w, &s->list[k]);
    }
    return e;
}

void crm_solvers_memory(const carom_world *w, size_t *bytes, long *calls)
{
    carom_contact_memory(w->solver, bytes, calls);
    for (int b = 0; w->kept.n && b < w->n_bodies; b++) {
        size_t more;
        long n;
        if (!w->kept.list[b].solver) continue;
        carom_contact_memory(w->kept.list[b].solver, &more, &n);
        *bytes += more;
        *calls += n;
    }
}

carom_factor_size crm_solvers_factor_size(const carom_world *w)
{
    const crm_islands *s = &w->islands;
    carom_factor_size sum = {0};
    int shared = 0;
    for (int k = 0; k < s->n; k++) {
        const crm_island *i = &s->list[k];
        if (!has_problem(i) || (!i->solver && shared)) continue;
        shared |= !i->solver;
        const carom_factor_size z = carom_contact_factor_size(i->solver ? i->solver : w->solver);
        sum.nonzeros += z.nonzeros;
        sum.flops += z.flops;
    }
    return sum;
}

void crm_solvers_free(carom_world *w)
{
    crm_kept_solvers *t = &w->kept;
    for (int b = 0; t->n && b < w->n_bodies; b++) {
        if (t->list[b].solver) give_up(t, &t->list[b]);
    }
    if (t->list) crm_free(&w->memory, t->list, (size_t)w->n_bodies, sizeof *t->list);
    t->list = NULL;
}
