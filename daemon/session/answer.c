/* answer.c: encoding, and answers that are kept. */
#include "parts.h"

#include <stdlib.h>

#define DEFINE_PACK(function, message, wire_type)                                                  \
    int function(const message *x, crm_message *m)                                                 \
    {                                                                                              \
        m->type = wire_type;                                                                       \
        m->size = message##_encoded_size(x);                                                       \
        m->bytes = malloc((size_t)m->size);                                                        \
        return m->bytes && message##_encode(m->bytes, 0, m->size, x) == m->size;                   \
    }

DEFINE_PACK(crm_pack_state, carom_state_t, CRM_WIRE_STATE)
DEFINE_PACK(crm_pack_gradient, carom_parameter_gradient_t, CRM_WIRE_PARAMETER_GRADIENT)
DEFINE_PACK(crm_pack_scene_updated, carom_scene_t, CRM_WIRE_SCENE_UPDATED)
DEFINE_PACK(crm_pack_reply, carom_reply_t, CRM_WIRE_REPLY)
DEFINE_PACK(crm_pack_status, carom_status_t, CRM_WIRE_STATUS)

static int reserve_messages(crm_answer *a)
{
    if (a->n < a->n_max) return 1;
    const int n_max = a->n_max ? 2 * a->n_max : 2;
    crm_message *m = realloc(a->messages, (size_t)n_max * sizeof *m);
    if (!m) return 0;
    a->messages = m;
    a->n_max = n_max;
    return 1;
}

int crm_answer_add(crm_answer *a, crm_budget *budget, crm_message m)
{
    const size_t bytes = (size_t)m.size + 2 * sizeof m;
    if (!crm_budget_take(budget, bytes)) {
        free(m.bytes);
        return 0;
    }
    if (!reserve_messages(a)) {
        crm_budget_give(budget, bytes);
        free(m.bytes);
        return 0;
    }
    a->messages[a->n++] = m;
    a->bytes += bytes;
    if (m.type == CRM_WIRE_STATE) a->n_states++;
    return 1;
}

void crm_answer_clear(crm_answer *a, crm_budget *budget)
{
    for (int i = 0; i < a->n; i++) free(a->messages[i].bytes);
    free(a->messages);
    crm_budget_give(budget, a->bytes);
    *a = (crm_answer){0};
}

/* The field `step` of an encoded state_t follows the header. */
static int64_t step_of(const crm_message *m)
{
    uint64_t x = 0;
    for (int i = 0; i < 8; i++) x = x << 8 | m->bytes[CRM_WIRE_HEADER_BYTES + i];
    return (int64_t)x;
}

/* Index of the state with this step, -1: none. */
static int find_state(const crm_answer *a, int64_t step)
{
    int low = 0, high = a->n_states;
    while (low < high) {
        const int middle = low + (high - low) / 2;
        if (step_of(&a->messages[middle]) < step) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return low < a->n_states && step_of(&a->messages[low]) == step ? low : -1;
}

void crm_answer_repeat(const crm_answer *a, const crm_server_settings *set, int n_steps,
                       const int64_t *steps)
{
    for (int i = 0; i < n_steps; i++) {
        const int k = find_state(a, steps[i]);
        if (k < 0) continue;
        set->emit(set->user, CRM_WIRE_STATE, a->messages[k].bytes, a->messages[k].size);
    }
    for (int i = n_steps > 0 ? a->n_states : 0; i < a->n; i++) {
        set->emit(set->user, a->messages[i].type, a->messages[i].bytes, a->messages[i].size);
    }
}
