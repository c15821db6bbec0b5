#include "messages.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

carom_scene_t scene_of(int64_t client_id, int32_t session, int64_t seq)
{
    static char *names[] = {"floor", "left", "right", "link"};
    static char *setting_names[] = {"dt"}, *setting_values[] = {"0.01"};
    static int8_t types[] = {CAROM_SCENE_T_STATIC, 0, 0, 0}, collide[] = {1, 1, 1, 0};
    static double mass[] = {1, 2, 3, 1}, inertia[] = {1, 0.0625, 0.09375, 0.1};
    static double friction[] = {0.5, 0.4, 0.3, 0}, restitution[] = {0.2, 0.3, 0.5, 0};
    static int32_t category[] = {1, 1, 1, 1}, mask[] = {-1, -1, -1, -1}, group[] = {0, 0, 0, 0};
    static double q[] = {0, 0, -1, 0, 0, 0.3, 0, 0.6, 0.4, 0.2, 3, 2};
    static double v[] = {0, 0, 0, 0, -3, 0, 0, 1, 0, 1, 0, 0};
    static double force[] = {0, 0, 0, 0, 0.1, 0, 0, 0, 0, 0, 0, 0};
    static int32_t shape_body[] = {0, 1, 2, 3}, shape_vertices[] = {4, 1, 1, 2};
    static double radius[] = {0, 0.25, 0.25, 0.05};
    static double vertices[] = {-9, -1, 9, -1, 9, 1, -9, 1, 0, 0, 0, 0, -0.5, 0, 0.5, 0};
    static int8_t joint_type[] = {CAROM_SCENE_T_REVOLUTE};
    static int32_t joint_a[] = {0}, joint_b[] = {3};
    static double anchor[] = {2.5, 2}, axis[] = {1, 0};
    static double scale[] = {1, 1, 1, 1}, none[] = {0, 0, 0, 0};
    static int8_t no[] = {0, 0, 0, 0};
    static double low[] = {-HUGE_VAL}, high[] = {HUGE_VAL};
    carom_scene_t m = {0};
    m.client_id = client_id;
    m.session = session;
    m.seq = seq;
    m.scene_name = (char *)"test";
    m.gravity[1] = -9.81;
    m.num_settings = 1;
    m.setting_name = setting_names;
    m.setting_value = setting_values;
    m.num_bodies = 4;
    m.body_name = names;
    m.body_type = types;
    m.collide = collide;
    m.mass = mass;
    m.inertia = inertia;
    m.friction = friction;
    m.restitution = restitution;
    m.gravity_scale = scale;
    m.linear_damping = none;
    m.angular_damping = none;
    m.sensor = no;
    m.filter_category = category;
    m.filter_mask = mask;
    m.filter_group = group;
    m.num_coords = 12;
    m.q = q;
    m.v = v;
    m.force = force;
    m.num_shapes = 4;
    m.shape_body = shape_body;
    m.shape_num_vertices = shape_vertices;
    m.radius = radius;
    m.num_vertex_coords = 16;
    m.vertices = vertices;
    m.num_joints = 1;
    m.joint_type = joint_type;
    m.joint_body_a = joint_a;
    m.joint_body_b = joint_b;
    m.num_anchor_coords = 2;
    m.anchor = anchor;
    m.anchor_b = anchor;
    m.axis = axis;
    m.joint_collide = no;
    m.joint_lower = low;
    m.joint_upper = high;
    m.joint_restitution = m.stiffness = m.joint_damping = m.rest = none;
    m.motor_speed = m.motor_limit = none;
    m.break_force = m.break_torque = high;
    return m;
}

/* Zeroed memory of the row's message, freed together. */
static void *zeros(void **list, int *n, size_t count, size_t size)
{
    void *p = calloc(count, size);
    list[(*n)++] = p;
    return p;
}

bytes pack_row(int64_t client_id, int32_t session, int64_t seq, int n)
{
    void *list[32];
    int k = 0;
    const size_t u = (size_t)n;
    carom_scene_t m = scene_of(client_id, session, seq);
    m.num_bodies = n;
    m.num_coords = 3 * n;
    m.num_shapes = n;
    m.num_vertex_coords = 2 * n;
    m.num_joints = 0;
    m.num_anchor_coords = 0;
    m.body_name = zeros(list, &k, u, sizeof(char *));
    m.body_type = zeros(list, &k, u, 1);
    m.collide = zeros(list, &k, u, 1);
    m.mass = zeros(list, &k, u, sizeof(double));
    m.inertia = zeros(list, &k, u, sizeof(double));
    m.friction = zeros(list, &k, u, sizeof(double));
    m.restitution = zeros(list, &k, u, sizeof(double));
    m.gravity_scale = zeros(list, &k, u, sizeof(double));
    m.linear_damping = zeros(list, &k, u, sizeof(double));
    m.angular_damping = zeros(list, &k, u, sizeof(double));
    m.sensor = zeros(list, &k, u, 1);
    m.filter_category = zeros(list, &k, u, 4);
    m.filter_mask = zeros(list, &k, u, 4);
    m.filter_group = zeros(list, &k, u, 4);
    m.q = zeros(list, &k, 3 * u, sizeof(double));
    m.v = zeros(list, &k, 3 * u, sizeof(double));
    m.force = zeros(list, &k, 3 * u, sizeof(double));
    m.shape_body = zeros(list, &k, u, 4);
    m.shape_num_vertices = zeros(list, &k, u, 4);
    m.radius = zeros(list, &k, u, sizeof(double));
    m.vertices = zeros(list, &k, 2 * u, sizeof(double));
    for (int i = 0; i < n; i++) {
        m.body_name[i] = (char *)"disc";
        m.mass[i] = 1;
        m.inertia[i] = 0.5;
        m.q[3 * i + 1] = 3 * i;
        m.shape_body[i] = i;
        m.shape_num_vertices[i] = 1;
        m.radius[i] = 1;
    }
    const bytes b = pack_scene(&m);
    while (k > 0) free(list[--k]);
    return b;
}

carom_step_request_t steps_of(int64_t client_id, int32_t session, int64_t seq, int64_t from,
                              int n_steps, int every)
{
    carom_step_request_t m = {0};
    m.client_id = client_id;
    m.session = session;
    m.seq = seq;
    m.from_step = from;
    m.num_steps = n_steps;
    m.publish_every = every;
    m.want = CAROM_STEP_REQUEST_T_WANT_Q | CAROM_STEP_REQUEST_T_WANT_V;
    return m;
}

carom_session_request_t action_of(int64_t client_id, int32_t session, int64_t seq, int action)
{
    carom_session_request_t m = {0};
    m.client_id = client_id;
    m.session = session;
    m.seq = seq;
    m.session_action = (int8_t)action;
    m.lease = -1;
    return m;
}

carom_loss_gradient_t loss_of(int64_t client_id, int32_t session, int64_t seq, int64_t step,
                              int coord, int wanted)
{
    static int64_t bar_step[1];
    static double q_bar[12], v_bar[12];
    carom_loss_gradient_t m = {0};
    m.client_id = client_id;
    m.session = session;
    m.seq = seq;
    m.cost = 1.5;
    m.wanted = wanted;
    bar_step[0] = step;
    for (int i = 0; i < 12; i++) q_bar[i] = i == coord;
    m.num_bars = 1;
    m.bar_step = bar_step;
    m.num_bar_coords = 12;
    m.q_bar = q_bar;
    m.v_bar = v_bar;
    return m;
}

#define DEFINE_PACK(function, message, wire_type)                                                  \
    bytes function(const message *m)                                                               \
    {                                                                                              \
        bytes b = {wire_type, message##_encoded_size(m), NULL};                                    \
        b.data = malloc((size_t)b.size);                                                           \
        if (message##_encode(b.data, 0, b.size, m) != b.size) abort();                             \
        return b;                                                                                  \
    }

DEFINE_PACK(pack_scene, carom_scene_t, CRM_WIRE_SCENE)
DEFINE_PACK(pack_chunk, carom_scene_chunk_t, CRM_WIRE_SCENE_CHUNK)
DEFINE_PACK(pack_step, carom_step_request_t, CRM_WIRE_STEP)
DEFINE_PACK(pack_loss, carom_loss_gradient_t, CRM_WIRE_LOSS_GRADIENT)
DEFINE_PACK(pack_descent, carom_parameter_gradient_t, CRM_WIRE_DESCEND)
DEFINE_PACK(pack_action, carom_session_request_t, CRM_WIRE_SESSION)
DEFINE_PACK(pack_state, carom_state_t, CRM_WIRE_STATE)
DEFINE_PACK(pack_reply, carom_reply_t, CRM_WIRE_REPLY)
DEFINE_PACK(pack_status, carom_status_t, CRM_WIRE_STATUS)

static bytes sample_step(void)
{
    static int32_t step[] = {0, 2}, body[] = {1, 2};
    static int64_t resend[] = {3, 4};
    static double force[] = {0, 1, 2, 3, 4, 5};
    carom_step_request_t m = steps_of(7, 1, 2, 0, 5, 1);
    m.num_forces = 2;
    m.force_step = step;
    m.force_body = body;
    m.num_force_values = 6;
    m.step_force = force;
    m.num_resend = 2;
    m.resend_step = resend;
    return pack_step(&m);
}

static bytes sample_chunk(void)
{
    static uint8_t data[100];
    carom_scene_chunk_t m = {0, 7, 1, 1, 250, 100, 100, 1, 100, data};
    return pack_chunk(&m);
}

static bytes sample_gradient(void)
{
    static double g[24];
    carom_parameter_gradient_t m = {0};
    m.client_id = 7;
    m.session = 1;
    m.seq = 3;
    m.wanted = CAROM_PARAMETER_GRADIENT_T_Q0 | CAROM_PARAMETER_GRADIENT_T_MASS;
    m.rate = 0.1;
    m.num_q0 = 12;
    m.q0 = g;
    m.num_mass = 4;
    m.mass = g;
    return pack_descent(&m);
}

static bytes sample_state(void)
{
    static int32_t ints[2];
    static int8_t modes[2];
    static double reals[12];
    carom_state_t m = {0};
    m.num_bodies = 4;
    m.num_q = 12;
    m.q = reals;
    m.num_v = 12;
    m.v = reals;
    m.num_contacts = 2;
    m.contact_body_a = ints;
    m.contact_body_b = ints;
    m.contact_mode = modes;
    m.contact_gap = reals;
    m.impulse_normal = reals;
    m.impulse_tangent = reals;
    m.num_contact_coords = 4;
    m.contact_point = reals;
    m.contact_normal = reals;
    return pack_state(&m);
}

bytes pack_sample(crm_wire_type type)
{
    const carom_scene_t scene = scene_of(7, 1, 1);
    const carom_session_request_t action = action_of(7, 1, 1, CAROM_SESSION_REQUEST_T_OPEN);
    const carom_loss_gradient_t loss = loss_of(7, 1, 2, 1, 1, 1);
    carom_reply_t reply = {0};
    carom_status_t status = {0};
    bytes b = {type, 0, NULL};
    reply.reply_text = (char *)"text";
    status.daemon_name = (char *)"lab";
    status.daemon_version = (char *)"1";
    status.url = (char *)"tcpq://";
    switch (type) {
    case CRM_WIRE_SCENE:
    case CRM_WIRE_SCENE_UPDATED: b = pack_scene(&scene); break;
    case CRM_WIRE_SCENE_CHUNK: b = sample_chunk(); break;
    case CRM_WIRE_STEP: b = sample_step(); break;
    case CRM_WIRE_LOSS_GRADIENT: b = pack_loss(&loss); break;
    case CRM_WIRE_DESCEND:
    case CRM_WIRE_PARAMETER_GRADIENT: b = sample_gradient(); break;
    case CRM_WIRE_SESSION: b = pack_action(&action); break;
    case CRM_WIRE_STATE: b = sample_state(); break;
    case CRM_WIRE_REPLY: b = pack_reply(&reply); break;
    case CRM_WIRE_STATUS: b = pack_status(&status); break;
    case CRM_WIRE_N_TYPES: break;
    }
    b.type = type;
    return b;
}

/* --- bench */

static double bench_now(void *user)
{
    bench *b = user;
    b->time += b->tick;
    return b->time;
}

static int64_t bench_utime(void *user)
{
    (void)user;
    return 0;
}

static void bench_emit(void *user, crm_wire_type type, const void *data, int size)
{
    bench *b = user;
    if (b->n == b->n_max) {
        b->n_max = b->n_max ? 2 * b->n_max : 64;
        b->out = realloc(b->out, (size_t)b->n_max * sizeof *b->out);
        if (!b->out) abort();
    }
    bytes m = {type, size, malloc((size_t)size)};
    if (!m.data) abort();
    memcpy(m.data, data, (size_t)size);
    b->out[b->n++] = m;
}

bench *bench_create(const crm_server_settings *settings)
{
    bench *b = calloc(1, sizeof *b);
    if (!b) abort();
    crm_server_settings set = settings ? *settings : crm_server_defaults();
    set.boot_id = 99;
    set.user = b;
    set.now = bench_now;
    set.utime = bench_utime;
    set.emit = bench_emit;
    b->server = crm_server_create(&set);
    if (!b->server) abort();
    return b;
}

void bench_clear(bench *b)
{
    for (int i = 0; i < b->n; i++) free(b->out[i].data);
    b->n = 0;
}

void bench_destroy(bench *b)
{
    bench_clear(b);
    crm_server_destroy(b->server);
    free(b->out);
    free(b);
}

void bench_receive(bench *b, bytes m)
{
    crm_server_receive(b->server, m.type, m.data, (size_t)m.size);
    free(m.data);
}

int bench_slice(bench *b)
{
    crm_session *s = crm_server_take(b->server);
    if (!s) return 0;
    crm_session_slice(b->server, s);
    crm_server_give(b->server, s);
    return 1;
}

void bench_do(bench *b, bytes m)
{
    bench_receive(b, m);
    while (bench_slice(b)) {
    }
}

static const bytes *find(const bench *b, crm_wire_type type, int k)
{
    for (int i = 0; i < b->n; i++) {
        if (b->out[i].type == type && k-- == 0) return &b->out[i];
    }
    abort();
}

int bench_count(const bench *b, crm_wire_type type)
{
    int n = 0;
    for (int i = 0; i < b->n; i++) n += b->out[i].type == type;
    return n;
}

carom_reply_t bench_reply(const bench *b)
{
    static char text[300];
    carom_reply_t m;
    const bytes *r = find(b, CRM_WIRE_REPLY, bench_count(b, CRM_WIRE_REPLY) - 1);
    if (carom_reply_t_decode(r->data, 0, r->size, &m) != r->size) abort();
    strncpy(text, m.reply_text, sizeof text - 1);
    carom_reply_t_decode_cleanup(&m);
    m.reply_text = text;
    return m;
}

#define DEFINE_FIND(function, parameters, index, message, wire_type)                               \
    message *function parameters                                                                   \
    {                                                                                              \
        message m, *copy;                                                                          \
        const bytes *r = find(b, wire_type, index);                                                \
        if (message##_decode(r->data, 0, r->size, &m) != r->size) abort();                         \
        copy = message##_copy(&m);                                                                 \
        message##_decode_cleanup(&m);                                                              \
        return copy;                                                                               \
    }

DEFINE_FIND(bench_state, (const bench *b, int k), k, carom_state_t, CRM_WIRE_STATE)
DEFINE_FIND(bench_gradient, (const bench *b), 0, carom_parameter_gradient_t,
            CRM_WIRE_PARAMETER_GRADIENT)
DEFINE_FIND(bench_scene, (const bench *b), 0, carom_scene_t, CRM_WIRE_SCENE_UPDATED)
