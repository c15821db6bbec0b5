/* receive.c: what arrives.  Only messages of this client's present request count, and none is
 * decoded before it is checked. */
#include "parts.h"

#include <stdlib.h>
#include <string.h>

static carom_client_state view_state(const carom_state_t *m, const carom_contact_info *contacts)
{
    carom_client_state s;
    memset(&s, 0, sizeof s);
    s.step = m->step;
    s.time = m->sim_time;
    s.n_bodies = m->num_bodies;
    s.q = m->q;
    s.v = m->v;
    s.stats.status = (carom_status)m->status;
    s.stats.residual = m->residual;
    s.stats.penetration = m->penetration;
    s.stats.joint_drift = m->joint_drift;
    s.stats.energy = m->energy;
    s.stats.n_contacts = m->num_contacts;
    s.stats.n_substeps = m->substeps;
    s.stats.n_events = m->events;
    s.stats.factorizations = m->factorizations;
    s.stats.iterations = m->iterations;
    s.stats.degenerate = m->degenerate;
    s.n_contacts = m->num_contacts;
    s.contacts = contacts;
    return s;
}

static carom_contact_info contact_of(const carom_state_t *m, int k)
{
    carom_contact_info c;
    c.body_a = m->contact_body_a[k];
    c.body_b = m->contact_body_b[k];
    c.point.x = m->contact_point[2 * k];
    c.point.y = m->contact_point[2 * k + 1];
    c.normal.x = m->contact_normal[2 * k];
    c.normal.y = m->contact_normal[2 * k + 1];
    c.gap = m->contact_gap[k];
    c.ln = m->impulse_normal[k];
    c.lt = m->impulse_tangent[k];
    c.mode = (carom_contact_mode)m->contact_mode[k];
    return c;
}

/* Room for the arrays of the state; 0: no memory. */
static int reserve_state(carom_client *c, const carom_state_t *m)
{
    const int n = m->num_contacts;
    const int n_numbers = 2 * m->num_q + 1; /* never none */
    if (n > c->n_contacts_max) {
        carom_contact_info *more = realloc(c->contacts, (size_t)n * sizeof *more);
        if (!more) return 0;
        c->contacts = more;
        c->n_contacts_max = n;
    }
    if (n_numbers > c->n_numbers_max) {
        double *more = realloc(c->numbers, (size_t)n_numbers * sizeof *more);
        if (!more) return 0;
        c->numbers = more;
        c->n_numbers_max = n_numbers;
    }
    return 1;
}

/* Keeps the state, and hands it to the caller. */
static void call_back(carom_client *c, const carom_state_t *m)
{
    const crm_exchange *x = c->exchange;
    const size_t width = (size_t)m->num_q;
    c->has_state = reserve_state(c, m);
    if (!c->has_state) return;
    for (int k = 0; k < m->num_contacts; k++) c->contacts[k] = contact_of(m, k);
    c->state = view_state(m, c->contacts);
    c->state.q = c->numbers;
    c->state.v = c->numbers + width;
    if (width) memcpy(c->numbers, m->q, width * sizeof *c->numbers);
    if (width) memcpy(c->numbers + width, m->v, width * sizeof *c->numbers);
    if (x->run->on_state) x->run->on_state(x->run->user, &c->state);
}

static void release(crm_exchange *x, carom_state_t **m)
{
    if (!*m) return;
    carom_state_t_destroy(*m);
    *m = NULL;
    x->n_held--;
}

static void deliver_regular(carom_client *c)
{
    crm_exchange *x = c->exchange;
    while (x->held && x->n_delivered < x->n_regular && x->held[x->n_delivered]) {
        call_back(c, x->held[x->n_delivered]);
        release(x, &x->held[x->n_delivered]);
        x->n_delivered++;
    }
}

/* Regular states that the answer has: all that were published, once the reply says how many. */
static int64_t n_expected(const crm_exchange *x)
{
    const int64_t every = x->step->publish_every, made = x->reply.step - x->step->from_step;
    if (!x->has_reply) return x->n_regular;
    int64_t n = every > 0 && made > 0 ? made / every : 0;
    if (n > x->n_regular) n = x->n_regular;
    return n < x->reply.num_states ? n : x->reply.num_states;
}

/* 1: the answer has a last state that is not a regular one. */
static int expects_last(const crm_exchange *x)
{
    return x->has_reply && n_expected(x) < x->reply.num_states;
}

int crm_client_complete(const crm_exchange *x)
{
    if (!x->has_reply) return 0;
    if (x->step) {
        return x->n_delivered >= n_expected(x) && (x->has_payload || !expects_last(x));
    }
    return x->reply.reply_code != CAROM_REPLY_T_OK || x->has_payload || !x->needs_payload;
}

void crm_client_deliver(carom_client *c)
{
    crm_exchange *x = c->exchange;
    if (!x->step) return;
    deliver_regular(c);
    if (!x->last || !expects_last(x) || x->n_delivered < n_expected(x)) return;
    call_back(c, x->last);
    release(x, &x->last);
    x->has_payload = 1;
}

int crm_client_missing(const crm_exchange *x, int n_max, int64_t *steps)
{
    int n = 0;
    if (!x->step) return 0;
    const int64_t first = x->n_delivered;
    const int64_t end = x->has_reply ? n_expected(x) : first + 1;
    if (!x->has_reply && (first == 0 || first >= x->n_regular)) return 0;
    for (int64_t k = first; k < end && n < n_max; k++) {
        if (x->held && x->held[k]) continue;
        steps[n++] = x->step->from_step + (k + 1) * x->step->publish_every;
    }
    if (expects_last(x) && !x->has_payload && !x->last && n < n_max) steps[n++] = x->reply.step;
    return n;
}

/* Index of a regular state, -1: none of them. */
static int64_t regular_index(const crm_exchange *x, int64_t step)
{
    const int64_t every = x->step->publish_every, made = step - x->step->from_step;
    if (every <= 0 || made <= 0 || made % every != 0 || made / every > x->n_regular) return -1;
    return made / every - 1;
}

/* Keeps a copy until its turn. */
static void hold(crm_exchange *x, carom_state_t **place, const carom_state_t *m)
{
    if (*place) return;
    *place = carom_state_t_copy(m);
    if (*place) x->n_held++;
}

static void take_state(carom_client *c, const carom_state_t *m)
{
    crm_exchange *x = c->exchange;
    if (!x->step) return;
    const int64_t k = regular_index(x, m->step);
    if (k < 0) {
        if (!x->has_payload) hold(x, &x->last, m);
        return;
    }
    if (k < x->n_delivered) return;
    if (k == x->n_delivered) {
        call_back(c, m);
        if (x->held) release(x, &x->held[k]);
        x->n_delivered++;
        return;
    }
    if (!x->held) x->held = calloc((size_t)x->n_regular, sizeof(carom_state_t *));
    if (x->held) hold(x, &x->held[k], m);
}

static void on_state(carom_client *c, const void *bytes, int size)
{
    carom_state_t m;
    if (carom_state_t_decode(bytes, 0, size, &m) != size) return;
    if (m.num_q == 3 * (int64_t)m.num_bodies && m.num_v == m.num_q) take_state(c, &m);
    carom_state_t_decode_cleanup(&m);
    crm_client_deliver(c);
}

static void on_reply(carom_client *c, const void *bytes, int size)
{
    crm_exchange *x = c->exchange;
    carom_reply_t m;
    if (carom_reply_t_decode(bytes, 0, size, &m) != size) return;
    if (m.reply_code == CAROM_REPLY_T_PENDING) {
        x->busy_text[0] = 0;
    } else if (m.reply_code == CAROM_REPLY_T_BUSY) {
        strncpy(x->busy_text, m.reply_text, sizeof x->busy_text - 1);
    } else if (m.reply_code == CAROM_REPLY_T_CHUNK) {
        const int k = m.chunk_index;
        if (k >= 0 && k < x->n_chunks && !x->acknowledged[k]) {
            x->acknowledged[k] = 1;
            x->n_acknowledged++;
        }
    } else {
        strncpy(x->reply_text, m.reply_text, sizeof x->reply_text - 1);
        x->reply = m;
        x->reply.reply_text = x->reply_text;
        x->has_reply = 1;
    }
    carom_reply_t_decode_cleanup(&m);
}

static void on_gradient(carom_client *c, const void *bytes, int size)
{
    crm_exchange *x = c->exchange;
    if (x->type != CRM_WIRE_LOSS_GRADIENT || x->has_payload) return;
    if (c->has_gradient) carom_parameter_gradient_t_decode_cleanup(&c->gradient);
    c->has_gradient = carom_parameter_gradient_t_decode(bytes, 0, size, &c->gradient) == size;
    x->has_payload = c->has_gradient;
}

static void on_scene(carom_client *c, const void *bytes, int size)
{
    crm_exchange *x = c->exchange;
    if (x->type != CRM_WIRE_DESCEND || x->has_payload) return;
    if (c->has_scene) carom_scene_t_decode_cleanup(&c->scene);
    c->has_scene = carom_scene_t_decode(bytes, 0, size, &c->scene) == size;
    x->has_payload = c->has_scene;
}

/* Servers may be set to larger scenes than ours; the bytes of a message bound every count. */
static crm_wire_limits wide_limits(void)
{
    const crm_wire_limits limits = {
#define WIDE(name, value, text) LCM_MAX_MESSAGE_SIZE,
        CRM_WIRE_LIMITS(WIDE)
#undef WIDE
    };
    return limits;
}

static crm_wire_type type_of(const carom_client *c, const char *channel)
{
    int type = CRM_WIRE_N_REQUESTS;
    while (type < CRM_WIRE_N_TYPES && strcmp(c->channels[type], channel) != 0) type++;
    return (crm_wire_type)type;
}

/* Counts all that an answer consists of: grows with news, not with repetitions. */
static int64_t progress(const crm_exchange *x)
{
    return x->n_delivered + x->n_held + x->n_acknowledged + x->has_reply + x->has_payload;
}

static void take(carom_client *c, crm_wire_type type, const void *bytes, int size)
{
    switch (type) {
    case CRM_WIRE_STATE: on_state(c, bytes, size); break;
    case CRM_WIRE_REPLY: on_reply(c, bytes, size); break;
    case CRM_WIRE_PARAMETER_GRADIENT: on_gradient(c, bytes, size); break;
    case CRM_WIRE_SCENE_UPDATED: on_scene(c, bytes, size); break;
    default: break;
    }
}

void crm_client_on_message(const lcm_recv_buf_t *buf, const char *channel, void *user)
{
    carom_client *c = user;
    crm_exchange *x = c->exchange;
    crm_wire_header h;
    char text[256];
    const crm_wire_limits limits = wide_limits();
    if (!x || buf->data_size > (uint32_t)limits.message) return;
    const crm_wire_type type = type_of(c, channel);
    if (type == CRM_WIRE_N_TYPES || !crm_wire_read_header(type, buf->data, buf->data_size, &h)) {
        return;
    }
    if (h.client_id != c->client_id || h.session != c->session || h.seq != x->seq) return;
    if (!crm_wire_check(type, &limits, buf->data, buf->data_size, text, sizeof text)) return;
    /* Until the reply is there the server may be at work; after it only news count. */
    const int works = !x->has_reply && type == CRM_WIRE_REPLY;
    const int64_t before = progress(x);
    take(c, type, buf->data, (int)buf->data_size);
    if (works || progress(x) != before) x->signs_of_life++;
}
