/* events.c: contacts that began, ended or hit, read from the touches of sub-steps. */
#include "world/internal.h"

#include <math.h>

carom_status carom_world_record_events(carom_world *world, int record)
{
    if (!world) return CAROM_E_ARGUMENT;
    world->events.on = record != 0;
    world->events.n = 0;
    return CAROM_OK;
}

const carom_contact_event *carom_world_events(const carom_world *world, int *n)
{
    *n = world->events.n;
    return world->events.list;
}

void crm_events_free(carom_world *w)
{
    crm_events *s = &w->events;
    crm_free(&w->memory, s->list, (size_t)s->max, sizeof *s->list);
}

static carom_status reserve(carom_world *w, int more)
{
    crm_events *s = &w->events;
    void *list = s->list;
    const carom_status e = crm_reserve(&w->memory, &list, &s->max, s->n + more, sizeof *s->list);
    s->list = list;
    return e;
}

carom_status crm_events_append(carom_world *w, const carom_contact_event *list, int n)
{
    crm_events *s = &w->events;
    const carom_status e = reserve(w, n);
    if (e) return e;
    memcpy(&s->list[s->n], list, (size_t)n * sizeof *list);
    s->n += n;
    return CAROM_OK;
}

/* There is room for it. */
static carom_contact_event *put(carom_world *w, carom_event_kind kind, const crm_touch *t,
                                double time)
{
    crm_events *s = &w->events;
    const crm_contact *c = &t->contact;
    const carom_contact_event event = {kind, c->body_a, c->body_b, c->shape_a, c->shape_b, time,
                                       0,    0,         0,         t->point,   c->normal,  -1};
    s->list[s->n++] = event;
    return &s->list[s->n - 1];
}

static double speed(const carom_world *w, const double *v, int body)
{
    const double *vb = v + 3 * body;
    return hypot(vb[1], vb[2]) + fabs(vb[0]) * w->bodies[body].reach;
}

/* An approach that is no rounding of the bodies' speeds, nor rest. */
static int hits(const carom_world *w, const crm_contact *c, double approach)
{
    const double *v = w->sub.v0;
    return approach >
           fmax(w->rest_speed, CRM_REST_TOL * (speed(w, v, c->body_a) + speed(w, v, c->body_b)));
}

carom_status crm_events_note(carom_world *w, double time)
{
    const crm_substep *s = &w->sub;
    const carom_status e = reserve(w, s->n_contacts);
    if (e) return e;
    for (int k = 0; k < s->n_contacts; k++) {
        double jn[6];
        double jt[6];
        const crm_contact *c = &s->contacts[k];
        const crm_touch *t = &w->next.list[w->first_touch + k];
        if (c->limit || !(t->ln > 0)) continue;
        crm_contact_rows(c, jn, jt);
        const double approach = -crm_row_dot(jn, s->v0, c->body_a, c->body_b);
        if (s->map != CRM_MAP_IMPACT && !hits(w, c, approach)) continue;
        carom_contact_event *event = put(w, CAROM_CONTACT_IMPACT, t, time);
        event->approach = approach;
        event->ln = t->ln;
        event->lt = t->lt;
    }
    return CAROM_OK;
}

/* The next pair of shapes from t[*k] on that touches, as its first closed point; NULL: none.  *k
 * moves behind the pair. */
static const crm_touch *next_touching(int n, const crm_touch *t, int *k)
{
    const crm_touch *found = NULL;
    while (*k < n) {
        const crm_touch *x = &t[*k];
        const crm_contact *c = &x->contact;
        if (found && (c->shape_a != found->contact.shape_a || c->shape_b != found->contact.shape_b))
            break;
        (*k)++;
        if (found || c->limit || (c->speculative && x->mode == CAROM_SEPARATED)) continue;
        found = x;
    }
    return found;
}

/* < 0: a comes first; an end of the list comes last. */
static int order(const crm_touch *a, const crm_touch *b)
{
    if (!a || !b) return !a - !b;
    const crm_contact *x = &a->contact;
    const crm_contact *y = &b->contact;
    const int first = (x->shape_a > y->shape_a) - (x->shape_a < y->shape_a);
    return first ? first : (x->shape_b > y->shape_b) - (x->shape_b < y->shape_b);
}

carom_status crm_events_reserve(carom_world *w)
{
    return reserve(w, w->touches.n + w->next.n + w->n_breakable);
}

void crm_events_break(carom_world *w, int joint)
{
    crm_events *s = &w->events;
    const crm_joint *j = &w->joints[joint];
    const crm_joint_frame f = crm_joint_frame_at(j, w->q);
    carom_contact_event event = {0};
    event.kind = CAROM_JOINT_BREAK;
    event.body_a = j->body_a;
    event.body_b = j->body_b;
    event.shape_a = event.shape_b = -1;
    event.time = w->settings.dt;
    event.point.x = w->q[3 * j->body_a + 1] + f.arm_a.x;
    event.point.y = w->q[3 * j->body_a + 2] + f.arm_a.y;
    event.joint = joint;
    s->list[s->n++] = event;
}

void crm_events_compare(carom_world *w, int n_before)
{
    const double dt = w->settings.dt;
    const crm_touches *touches = &w->touches;
    const crm_touch *before = w->next.list; /* the lists take turns */
    int now = 0;
    int then = 0;
    const crm_touch *a = next_touching(touches->n, touches->list, &now);
    const crm_touch *b = next_touching(n_before, before, &then);
    while (a || b) {
        const int o = order(a, b);
        if (o < 0) put(w, CAROM_CONTACT_BEGIN, a, dt);
        if (o > 0) put(w, CAROM_CONTACT_END, b, dt);
        if (o <= 0) a = next_touching(touches->n, touches->list, &now);
        if (o >= 0) b = next_touching(n_before, before, &then);
    }
}
