/* further.c: contacts ahead that only the end of a sub-step shows: a polygon that turns sets down
 * other corners than those that were nearest. */
#include "world/internal.h"

#include <math.h>

/* Where the contacts of a pair begin among those of sub, or would. */
static int place_of(const crm_substep *s, carom_pair pair)
{
    int k = 0;
    while (k < s->n_contacts && !s->contacts[k].limit &&
           (s->contacts[k].shape_a < pair.a ||
            (s->contacts[k].shape_a == pair.a && s->contacts[k].shape_b < pair.b))) {
        k++;
    }
    return k;
}

/* After the last contact of the pair; -1: one of them is x. */
static int place_for(const crm_substep *s, const crm_contact *x)
{
    const carom_pair pair = {x->shape_a, x->shape_b};
    int k = place_of(s, pair);
    for (; k < s->n_contacts; k++) {
        const crm_contact *c = &s->contacts[k];
        if (c->limit || c->shape_a != pair.a || c->shape_b != pair.b) break;
        if (crm_recipe_same(c->recipe, x->recipe)) return -1;
    }
    return k;
}

static carom_status insert(carom_world *w, int at, const crm_contact *c)
{
    crm_substep *s = &w->sub;
    carom_status e = crm_substep_reserve(w, s, s->n_contacts + 1);
    if (!e) e = crm_rows_reserve(w, s->n_contacts + 1);
    if (e) return e;
    for (int k = s->n_contacts; k > at; k--) s->contacts[k] = s->contacts[k - 1];
    s->contacts[at] = *c;
    s->n_contacts++;
    return CAROM_OK;
}

double crm_deep(const carom_world *w, carom_pair pair, double rounding)
{
    const double thin = fmin(w->shapes[pair.a].thickness, w->shapes[pair.b].thickness);
    return CRM_DEEP * fmin(w->length, thin) + rounding;
}

/* Deep points of a pair at q1 that are no contacts yet and were open at q0. */
static carom_status add_pair(carom_world *w, carom_pair pair, const carom_manifold *m, double deep,
                             int *added)
{
    crm_substep *s = &w->sub;
    const double slop = w->settings.margin * w->length;
    for (int i = 0; i < m->count; i++) {
        crm_contact c = crm_contact_of(w, pair, m, i, s->q1);
        if (c.gap > -deep) continue;
        const int at = place_for(s, &c);
        crm_contact_refresh(w, s->q0, &c);
        if (at < 0 || c.gap < -slop) continue;
        c.speculative = c.gap > slop;
        const carom_status e = insert(w, at, &c);
        if (e) return e;
        (*added)++;
    }
    return CAROM_OK;
}

carom_status crm_detect_further(carom_world *w, int look, int *added, int *deep)
{
    const crm_island *island = w->island;
    const double rounding = crm_rounding(w);
    *added = 0;
    *deep = 0;
    for (int k = 0; k < island->n_pairs; k++) {
        const carom_pair pair = island->pairs[k];
        if (crm_far_apart(w, pair, w->sub.q1, 0)) continue;
        const carom_manifold m = crm_collide(w, pair, w->sub.q1, 0);
        const double far = crm_deep(w, pair, rounding);
        if (!m.count || m.distance > -far) continue;
        *deep |= m.distance < crm_collide(w, pair, w->sub.q0, HUGE_VAL).distance - far;
        const carom_status e = look ? add_pair(w, pair, &m, far, added) : CAROM_OK;
        if (e) return e;
    }
    return CAROM_OK;
}
