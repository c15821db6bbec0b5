/* limit.c: limits of joints as frictionless contacts: gap = way to the limit.  docs/joint.md. */
#include "world/internal.h"

#include <math.h>

enum { LOWER = 1, UPPER = 2 };

/* The limits of joint k are numbered 2 k + LOWER and 2 k + UPPER; 0 is a contact of shapes. */
int crm_limit_joint(int limit)
{
    return (limit - 1) / 2;
}

double crm_limit_sign(int limit)
{
    return limit % 2 == LOWER ? 1 : -1;
}

crm_measure crm_limit_measure(carom_joint_kind kind)
{
    switch (kind) {
    case CAROM_REVOLUTE: return CRM_TURN;
    case CAROM_ROPE: return CRM_APART;
    default: return CRM_ALONG;
    }
}

int crm_joint_has_limits(const crm_joint *j)
{
    return j->lower > -HUGE_VAL || j->upper < HUGE_VAL;
}

void crm_limit_refresh(const carom_world *w, const double *q, crm_contact *c)
{
    const crm_joint *j = &w->joints[crm_limit_joint(c->limit)];
    const crm_measure m = crm_limit_measure(j->kind);
    const double sign = crm_limit_sign(c->limit);
    const double bound = sign > 0 ? j->lower : j->upper;
    const crm_joint_frame f = crm_joint_frame_at(j, q);
    const carom_vec2 u = crm_measure_direction(j, m, q, &f);
    double row[6];
    const double value = crm_measure_at(j, m, q, row);
    c->normal.x = sign * u.x;
    c->normal.y = sign * u.y;
    c->arm_a = crm_measure_arm(m, &f);
    c->arm_b = f.arm_b;
    c->turn = m == CRM_TURN ? sign * j->lever : 0;
    c->gap = sign * (value - (m == CRM_TURN ? j->lever : 1) * bound);
}

crm_contact crm_limit_at(const carom_world *w, int limit, const double *q)
{
    const int joint = crm_limit_joint(limit);
    crm_contact c = {0};
    c.limit = limit;
    c.body_a = w->joints[joint].body_a;
    c.body_b = w->joints[joint].body_b;
    /* behind all pairs of shapes in their order */
    c.shape_a = w->n_shapes + joint;
    c.shape_b = limit % 2;
    crm_limit_refresh(w, q, &c);
    return c;
}

/* The limit as a contact of sub when its gap is within reach. */
static carom_status add_limit(carom_world *w, int limit, const double *q, double reach,
                              double margin)
{
    crm_substep *s = &w->sub;
    crm_contact c = crm_limit_at(w, limit, q);
    if (c.gap > reach) return CAROM_OK;
    carom_status e = crm_substep_reserve(w, s, s->n_contacts + 1);
    if (!e) e = crm_rows_reserve(w, s->n_contacts + 1);
    if (e) return e;
    c.speculative = c.gap > margin;
    s->contacts[s->n_contacts++] = c;
    return CAROM_OK;
}

int crm_limit_slots(const carom_world *w)
{
    return w->island->n_limited ? 2 * w->island->n_joints : 0;
}

int crm_limit_in(const carom_world *w, int slot)
{
    const int joint = w->island->joints[slot / 2];
    const crm_joint *j = &w->joints[joint];
    const int side = slot % 2 ? UPPER : LOWER;
    const int given = side == LOWER ? j->lower > -HUGE_VAL : j->upper < HUGE_VAL;
    return given ? 2 * joint + side : 0;
}

carom_status crm_detect_limits(carom_world *w, const double *q, double reach, double margin)
{
    const int n = crm_limit_slots(w);
    for (int slot = 0; slot < n; slot++) {
        const int limit = crm_limit_in(w, slot);
        const carom_status e = limit ? add_limit(w, limit, q, reach, margin) : CAROM_OK;
        if (e) return e;
    }
    return CAROM_OK;
}

double crm_restitution(const carom_world *w, const crm_contact *c)
{
    if (c->limit) return w->joints[crm_limit_joint(c->limit)].restitution;
    return crm_combine(w->settings.combine_restitution, w->restitution[c->body_a],
                       w->restitution[c->body_b]);
}
