/* plan.c: what a scene needs, read off when it is sealed.  docs/step.md, section "The plan". */
#include "world/internal.h"

/* Up to so many bodies with shapes every pair is asked whether it may meet. */
enum { MAX_ASKED = 64 };

static int can_touch(const crm_body *b)
{
    return b->collide && !b->sensor && b->n_shapes > 0;
}

/* Before the world is sealed: its list of joined pairs is not there yet. */
static int is_joined(const carom_world *w, int a, int b)
{
    for (int k = 0; k < w->n_joints; k++) {
        const crm_joint *j = &w->joints[k];
        const int same = (j->body_a == a && j->body_b == b) || (j->body_a == b && j->body_b == a);
        if (same && !j->collide) return 1;
    }
    return 0;
}

static int meets(const carom_world *w, int a, int b)
{
    const crm_body *x = &w->bodies[a];
    const crm_body *y = &w->bodies[b];
    if (x->type != CAROM_DYNAMIC && y->type != CAROM_DYNAMIC) return 0;
    return crm_filters_meet(&x->filter, &y->filter) && !is_joined(w, a, b) &&
           !crm_excluded(w, a, b);
}

/* Whether two bodies with shapes may ever meet, one of them moving. */
static int may_meet(const carom_world *w)
{
    int list[MAX_ASKED];
    int n = 0;
    int moving = 0;
    for (int b = 0; b < w->n_bodies; b++) {
        if (!can_touch(&w->bodies[b])) continue;
        moving |= w->bodies[b].type != CAROM_STATIC;
        if (n < MAX_ASKED) list[n] = b;
        n++;
    }
    if (n > MAX_ASKED) return moving;
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < i; j++) {
            if (meets(w, list[j], list[i])) return 1;
        }
    }
    return 0;
}

static void read_shapes(const carom_world *w, carom_plan *p)
{
    int edged = 0;
    for (int k = 0; k < w->n_shapes; k++) {
        const crm_body *b = &w->bodies[w->shapes[k].body];
        p->sensors |= b->sensor;
        if (can_touch(b) && w->shapes[k].view.count > 1) edged++;
    }
    p->hulls = p->contacts && edged > 1;
}

static void read_materials(const carom_world *w, carom_plan *p)
{
    double friction = 0;
    double restitution = 0;
    for (int b = 0; b < w->n_bodies; b++) {
        if (!can_touch(&w->bodies[b])) continue;
        friction = fmax(friction, w->friction[b]);
        restitution = fmax(restitution, w->restitution[b]);
    }
    p->friction = p->contacts && friction > 0;
    p->restitution = p->contacts && restitution > 0;
}

static void read_joints(const carom_world *w, carom_plan *p)
{
    for (int k = 0; k < w->n_joints; k++) {
        const crm_joint *j = &w->joints[k];
        const int limited = j->lower > -HUGE_VAL || j->upper < HUGE_VAL;
        p->joints = 1;
        p->limits |= limited;
        p->drives |= crm_joint_is_driven(j);
        p->restitution |= limited && j->restitution > 0;
    }
}

carom_plan crm_plan(const carom_world *w)
{
    carom_plan p = {0};
    p.contacts = may_meet(w);
    read_shapes(w, &p);
    read_materials(w, &p);
    read_joints(w, &p);
    p.damping = crm_world_is_damped(w);
    p.fields = w->n_fields > 0;
    p.solver = p.contacts || w->n_joint_rows > 0 || p.limits;
    p.located = (p.contacts || p.limits) && w->settings.integrator != CAROM_FIXED;
    p.changes = (p.contacts || p.limits) && w->settings.integrator == CAROM_LOCATED &&
                (w->settings.order > 2 || w->settings.events == CAROM_EVENTS_ALL);
    p.extrapolated = (p.solver || p.damping || p.fields) && w->settings.order > 2 &&
                     w->settings.integrator == CAROM_LOCATED;
    p.threads = w->settings.threads > 1;
    p.sleep = w->settings.sleep != 0;
    return p;
}

carom_plan carom_world_plan(const carom_world *world)
{
    return crm_plan(world);
}
