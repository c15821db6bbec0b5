/* kinks.c: where the derivative of a run is one-sided.  docs/gradient.md, section "Kinks". */
#include "grad/internal.h"

#include <math.h>

/* Speeds below this are none, as a contact problem counts its degenerate contacts [largest]. */
static const double NONE = 1e-9;

const char *carom_kink_name(carom_kink_kind kind)
{
    static const char *const names[] = {"weak",    "slip",   "simultaneous",
                                        "grazing", "border", "features"};
    return kind >= CAROM_KINK_WEAK && kind <= CAROM_KINK_FEATURES ? names[kind] : NULL;
}

carom_status crm_kinks_add(crm_memory *m, crm_kinks *to, int step, const crm_contact *c,
                           carom_kink_kind kind)
{
    const carom_kink x = {step, c->body_a, c->body_b, kind};
    for (int k = to->n - 1; k >= 0 && to->list[k].step == step; k--) {
        const carom_kink *y = &to->list[k];
        if (y->body_a == x.body_a && y->body_b == x.body_b && y->kind == kind) return CAROM_OK;
    }
    void *list = to->list;
    const carom_status e = crm_reserve(m, &list, &to->max, to->n + 1, sizeof x);
    to->list = list;
    if (e) return e;
    to->list[to->n++] = x;
    return CAROM_OK;
}

void crm_kinks_free(crm_memory *m, crm_kinks *x)
{
    crm_free(m, x->list, (size_t)x->max, sizeof *x->list);
    memset(x, 0, sizeof *x);
}

/* A row and what it sees. */
static double row_times(const double *row, const int *body, const double *v)
{
    double sum = 0;
    for (int i = 0; i < 6; i++) {
        if (body[i / 3] >= 0) sum += row[i] * v[3 * body[i / 3] + i % 3];
    }
    return sum;
}

/* J W J': impulse to speed. */
static double row_weight(const double *row, const int *body, const double *W)
{
    double sum = 0;
    for (int i = 0; i < 6; i++) {
        if (body[i / 3] >= 0) sum += row[i] * row[i] * W[3 * body[i / 3] + i % 3];
    }
    return sum;
}

/* Largest speed that a contact gives or would meet. */
static double speed_of(const carom_contact_problem *p, const crm_solve *c)
{
    double top = 0;
    for (int k = 0; k < p->n_contacts; k++) {
        const int *body = &p->contact_body[2 * k];
        const double *row = &p->jn[6 * k];
        const double given = row_weight(row, body, p->inv_mass) * c->ln[k];
        top = fmax(top, fmax(given, fabs(row_times(row, body, p->u) + p->cn[k])));
    }
    return top;
}

/* Both speeds of a contact, that which it leaves and that which it gives, are none. */
static int is_weak(const carom_contact_problem *p, const crm_solve *c, const double *v, int k,
                   double none)
{
    const int *body = &p->contact_body[2 * k];
    const double *row = &p->jn[6 * k];
    if (row_weight(row, body, p->inv_mass) * fabs(c->ln[k]) > none) return 0;
    return fabs(row_times(row, body, v) + p->cn[k]) <= none;
}

/* It does not slip, and friction is at its limit. */
static int is_border(const carom_contact_problem *p, const crm_solve *c, const double *v, int k,
                     double none)
{
    const int *body = &p->contact_body[2 * k];
    const double *row = &p->jt[6 * k];
    if (!(p->mu[k] > 0) || c->mode[k] == CAROM_SEPARATED) return 0;
    const double spare = p->mu[k] * c->ln[k] - fabs(c->lt[k]);
    if (row_weight(row, body, p->inv_mass) * fabs(spare) > none) return 0;
    return fabs(row_times(row, body, v) + (p->ct ? p->ct[k] : 0)) <= none;
}

/* Whether a body that moves is in both contacts. */
static int share_body(const carom_world *w, const crm_contact *x, const crm_contact *y)
{
    const int a = x->body_a;
    const int b = x->body_b;
    const int via_a = a == y->body_a || a == y->body_b;
    const int via_b = b == y->body_a || b == y->body_b;
    return (via_a && w->bodies[a].type == CAROM_DYNAMIC) ||
           (via_b && w->bodies[b].type == CAROM_DYNAMIC);
}

static int closes(const carom_world *w, const crm_substep *s, int k)
{
    const crm_contact *x = &s->contacts[k];
    return crm_row_dot(&w->rows.jn[6 * k], s->v0, x->body_a, x->body_b) < -w->rest_speed;
}

/* An impact in which a body closes several contacts: a little earlier or later they would come one
 * after the other. */
static carom_status kinks_of_impact(const carom_world *w, crm_memory *m, crm_kinks *to, int step,
                                    const crm_substep *s)
{
    for (int k = 0; k < s->n_contacts; k++) {
        int others = 0;
        if (!closes(w, s, k)) continue;
        for (int i = 0; i < s->n_contacts && !others; i++) {
            others = i != k && closes(w, s, i) && share_body(w, &s->contacts[k], &s->contacts[i]);
        }
        if (!others) continue;
        const carom_status e = crm_kinks_add(m, to, step, &s->contacts[k], CAROM_KINK_SIMULTANEOUS);
        if (e) return e;
    }
    return CAROM_OK;
}

carom_status crm_kinks_of_solve(const carom_world *w, crm_memory *m, crm_kinks *to, int step,
                                const crm_substep *s, const crm_solve *c,
                                const carom_contact_problem *p)
{
    const int holds = c->kind == CRM_HOLD || c->kind == CRM_HOLD_SPEED;
    if (!p->n_contacts || c->kind == CRM_CORRECTION || holds) return CAROM_OK;
    const double none = NONE * speed_of(p, c);
    carom_status e = CAROM_OK;
    for (int k = 0; !e && k < p->n_contacts; k++) {
        if (is_weak(p, c, w->rows.v, k, none)) {
            e = crm_kinks_add(m, to, step, &s->contacts[k], CAROM_KINK_WEAK);
        } else if (is_border(p, c, w->rows.v, k, none)) {
            e = crm_kinks_add(m, to, step, &s->contacts[k], CAROM_KINK_SLIP);
        }
    }
    return !e && c->kind == CRM_IMPACT ? kinks_of_impact(w, m, to, step, s) : e;
}

/* --- a walk over the tape ----------------------------------------------------------------------
 */

typedef struct walk {
    carom_tape *tape;
    carom_world *world;
    crm_forward f; /* for the time of events, and to unpack */
    crm_kinks kinks;
} walk;

/* Contacts that press and whose pair has another pair of features as near. */
static carom_status ties(walk *x, const crm_substep *s, int step)
{
    const carom_world *w = x->world;
    carom_status e = CAROM_OK;
    for (int k = 0; !e && k < s->n_contacts; k++) {
        const crm_contact *c = &s->contacts[k];
        const carom_pair pair = {c->shape_a, c->shape_b};
        if (c->limit || s->solve[0].mode[k] == CAROM_SEPARATED) continue;
        if (!crm_collide(w, pair, s->q0, HUGE_VAL).ambiguous) continue;
        e = crm_kinks_add(&x->tape->memory, &x->kinks, step, c, CAROM_KINK_FEATURES);
    }
    return e;
}

static carom_status walk_solves(walk *x, crm_substep *s, int step)
{
    carom_status e = CAROM_OK;
    for (int k = 0; !e && k < s->n_solves; k++) {
        const crm_solve *c = &s->solve[k];
        const carom_contact_problem p = crm_solve_problem(x->world, s, c);
        crm_gather(x->world, c->v, x->world->rows.v);
        e = crm_kinks_of_solve(x->world, &x->tape->memory, &x->kinks, step, s, c, &p);
    }
    return e ? e : ties(x, s, step);
}

/* An event whose time has no derivative. */
static carom_status walk_event(walk *x, crm_substep *s, int step)
{
    const crm_line *clock = crm_begin_clockwork(&x->f);
    const carom_status e = crm_substep_jvp(&x->f, s, 1);
    if (e < 0) return e;
    if (fabs(crm_event_jvp(&x->f, s, clock)) > crm_grazing(x->world, s)) return CAROM_OK;
    return crm_kinks_add(&x->tape->memory, &x->kinks, step, &s->event, CAROM_KINK_GRAZING);
}

static carom_status walk_record(walk *x, int record, int end, int step)
{
    const crm_record *r = &x->tape->records[record];
    crm_substep *s = &x->f.work.s;
    const int last = record + 1 == end || r[1].which != r->which;
    const int event = r->s.end == CRM_END_EVENT || r->s.end == CRM_END_STOP;
    x->f.record = record;
    crm_unpack(x->world, r, x->f.moved, &x->f.work);
    carom_status e = r->s.map == CRM_MAP_EXTRAPOLATED ? CAROM_OK : walk_solves(x, s, step);
    if (e < 0 || r->inner || !event) return e;
    crm_end_of(&x->f, record, end, s);
    e = walk_event(x, s, step);
    if (e < 0 || !last || r->s.end != CRM_END_EVENT) return e;
    return crm_kinks_add(&x->tape->memory, &x->kinks, step, &s->event, CAROM_KINK_BORDER);
}

static carom_status walk_frame(walk *x, int frame)
{
    carom_status e = crm_hold_segment(x->tape, frame);
    x->f.frame = frame;
    const int end = e < 0 ? 0 : crm_frame_end(x->tape, frame);
    for (int k = x->tape->frames[frame].first_record; e >= 0 && k < end; k++) {
        e = walk_record(x, k, end, frame + 1);
    }
    return e;
}

carom_status carom_tape_kinks(carom_tape *tape, int capacity, carom_kink *kinks, int *count)
{
    if (!tape || capacity < 0 || (capacity && !kinks) || !count) return CAROM_E_ARGUMENT;
    walk x = {tape, tape->world, {0}, {0, 0, NULL}};
    carom_status e = crm_tape_current(tape);
    if (e) return e;
    tape->ascending = 1;
    e = crm_forward_open(&x.f, tape, 0, NULL, 0);
    for (int frame = 0; e >= 0 && frame < tape->n_frames; frame++) e = walk_frame(&x, frame);
    crm_forward_close(&x.f);
    if (e >= 0) {
        const int n = x.kinks.n < capacity ? x.kinks.n : capacity;
        if (n) memcpy(kinks, x.kinks.list, (size_t)n * sizeof *kinks);
        *count = x.kinks.n;
    }
    crm_kinks_free(&tape->memory, &x.kinks);
    return e < 0 ? crm_world_fail(tape->world, e, "kinks: %s", carom_status_text(e)) : CAROM_OK;
}
