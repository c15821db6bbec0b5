/* calls.c: steps, gradients and descents. */
#include "parts.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

static carom_client_code needs_scene(carom_client *c)
{
    if (c->open && c->has_scene) return CAROM_CLIENT_OK;
    return crm_client_fail(c, CAROM_CLIENT_E_SESSION, "no session is open: open a scene first");
}

static carom_client_code no_memory(carom_client *c)
{
    return crm_client_fail(c, CAROM_CLIENT_E_MEMORY, "no memory for the request");
}

/* --- steps */

static carom_client_code check_run(carom_client *c, const carom_client_run *run)
{
    if (run->n_steps < 0 || run->publish_every < 0 || run->n_forces < 0) {
        return crm_client_fail(c, CAROM_CLIENT_E_ARGUMENT,
                               "n_steps, publish_every and n_forces must be >= 0");
    }
    return CAROM_CLIENT_OK;
}

static void put_force(carom_step_request_t *m, int k, const carom_client_force *f)
{
    m->force_step[k] = f->step;
    m->force_body[k] = f->body;
    memcpy(m->step_force + 3 * k, f->force, sizeof f->force);
}

/* Arrays of the forces: step and body, and three numbers each; one block.  Those of the run and
 * those of the file's tables, each in the order of steps. */
static int place_forces(const carom_client_run *run, const carom_client_force *table, int n_table,
                        carom_step_request_t *m)
{
    const size_t n = (size_t)run->n_forces + (size_t)n_table;
    double *block = malloc(n * (3 * sizeof(double) + 2 * sizeof(int32_t)) + 1);
    if (!block) return 0;
    m->num_forces = (int32_t)n;
    m->num_force_values = (int32_t)(3 * n);
    m->step_force = block;
    m->force_step = (int32_t *)(void *)(block + 3 * n);
    m->force_body = m->force_step + n;
    int at = 0;
    for (int i = 0; i < run->n_forces; i++) {
        while (at < n_table && table[at].step <= run->forces[i].step) {
            put_force(m, i + at, &table[at]);
            at++;
        }
        put_force(m, i + at, &run->forces[i]);
    }
    for (; at < n_table; at++) put_force(m, run->n_forces + at, &table[at]);
    return 1;
}

static int encode_step(crm_exchange *x, const carom_step_request_t *m)
{
    x->size = carom_step_request_t_encoded_size(m);
    x->bytes = malloc((size_t)x->size);
    return x->bytes && carom_step_request_t_encode(x->bytes, 0, x->size, m) == x->size;
}

carom_client_code carom_client_step(carom_client *c, const carom_client_run *run)
{
    crm_exchange x = {0};
    carom_step_request_t m = {0};
    carom_client_force *table = NULL;
    int n_table = 0;
    carom_client_code code = needs_scene(c);
    if (code >= 0) code = check_run(c, run);
    if (code < 0) return code;
    if (!crm_client_file_forces(c, run->n_steps, &table, &n_table)) return no_memory(c);
    const crm_wire_header h = crm_client_next_header(c);
    m.utime = h.utime;
    m.client_id = h.client_id;
    m.session = h.session;
    m.seq = h.seq;
    m.from_step = c->info.step;
    m.num_steps = run->n_steps;
    m.publish_every = run->publish_every;
    m.want = CAROM_STEP_REQUEST_T_WANT_Q | CAROM_STEP_REQUEST_T_WANT_V |
             (run->contacts ? CAROM_STEP_REQUEST_T_WANT_CONTACTS : 0);
    m.record = (int8_t)run->record;
    const int placed = place_forces(run, table, n_table, &m);
    free(table);
    if (!placed) return no_memory(c);
    x.type = CRM_WIRE_STEP;
    x.step = &m;
    x.run = run;
    x.n_regular = run->publish_every > 0 ? run->n_steps / run->publish_every : 0;
    code = encode_step(&x, &m) ? crm_client_exchange(c, &x) : no_memory(c);
    free(m.step_force);
    return code;
}

const carom_client_state *carom_client_get_state(const carom_client *c)
{
    return c->has_state ? &c->state : NULL;
}

/* --- gradients */

/* The cotangents of all states, one after the other. */
static int place_bars(const carom_client *c, int n_bars, const carom_state_bar *bars,
                      carom_loss_gradient_t *m)
{
    const size_t n = (size_t)n_bars, width = 3 * (size_t)c->scene.num_bodies;
    double *block = calloc(n * (2 * width + 1) + 1, sizeof *block);
    if (!block) return 0;
    m->num_bars = n_bars;
    m->num_bar_coords = (int32_t)(n * width);
    m->q_bar = block;
    m->v_bar = block + n * width;
    m->bar_step = (int64_t *)(void *)(block + 2 * n * width);
    for (size_t k = 0; k < n; k++) {
        m->bar_step[k] = bars[k].step;
        if (bars[k].q && width) memcpy(m->q_bar + k * width, bars[k].q, width * sizeof *block);
        if (bars[k].v && width) memcpy(m->v_bar + k * width, bars[k].v, width * sizeof *block);
    }
    return 1;
}

static const double *given(const carom_parameter_gradient_t *m, int bit, const double *x)
{
    return m->wanted & bit ? x : NULL;
}

/* Of what not every scene has. */
static void view_more(const carom_parameter_gradient_t *m, carom_client_gradient *g)
{
    g->gravity_scale = given(m, CAROM_WRT_GRAVITY_SCALE, m->gravity_scale);
    g->linear_damping = given(m, CAROM_WRT_LINEAR_DAMPING, m->linear_damping);
    g->angular_damping = given(m, CAROM_WRT_ANGULAR_DAMPING, m->angular_damping);
    g->axes = given(m, CAROM_WRT_AXES, m->axes);
    g->angles = given(m, CAROM_WRT_ANGLES, m->angles);
    g->lengths = given(m, CAROM_WRT_LENGTHS, m->lengths);
    g->lower = given(m, CAROM_WRT_LOWER, m->lower);
    g->upper = given(m, CAROM_WRT_UPPER, m->upper);
    g->stiffness = given(m, CAROM_WRT_STIFFNESS, m->stiffness);
    g->damping = given(m, CAROM_WRT_DAMPING, m->damping);
    g->rest = given(m, CAROM_WRT_REST, m->rest);
    g->motor_speed = given(m, CAROM_WRT_MOTOR_SPEED, m->motor_speed);
    g->motor_limit = given(m, CAROM_WRT_MOTOR_LIMIT, m->motor_limit);
}

static void view_gradient(const carom_client *c, carom_client_gradient *g)
{
    const carom_parameter_gradient_t *m = &c->gradient;
    g->wanted = (unsigned)m->wanted;
    g->cost = m->cost;
    g->first_step = m->first_step;
    g->recorded_steps = m->recorded_steps;
    g->degenerate = m->degenerate;
    g->first_degenerate_step = m->first_degenerate_step;
    g->n_bodies = c->scene.num_bodies;
    g->n_shapes = c->scene.num_shapes;
    g->n_vertices = c->scene.num_vertex_coords / 2;
    g->n_joints = c->scene.num_joints;
    g->q0 = given(m, CAROM_WRT_Q0, m->q0);
    g->v0 = given(m, CAROM_WRT_V0, m->v0);
    g->mass = given(m, CAROM_WRT_MASS, m->mass);
    g->inertia = given(m, CAROM_WRT_INERTIA, m->inertia);
    g->friction = given(m, CAROM_WRT_FRICTION, m->friction);
    g->restitution = given(m, CAROM_WRT_RESTITUTION, m->restitution);
    g->gravity = given(m, CAROM_WRT_GRAVITY, m->gravity);
    g->force = given(m, CAROM_WRT_FORCE, m->force);
    g->force_steps = given(m, CAROM_WRT_FORCE_STEPS, m->force_steps);
    g->radius = given(m, CAROM_WRT_RADIUS, m->radius);
    g->vertices = given(m, CAROM_WRT_VERTICES, m->vertices);
    g->anchors = given(m, CAROM_WRT_ANCHORS, m->anchors);
    g->dt = given(m, CAROM_WRT_DT, m->dt);
    view_more(m, g);
}

/* 1: the arrays have the sizes that the scene implies. */
static int sizes_fit(const carom_client *c)
{
    const carom_parameter_gradient_t *m = &c->gradient;
    const carom_scene_t *s = &c->scene;
    const int64_t n = s->num_bodies, w = m->wanted;
    const struct {
        int bit;
        int64_t has, needs;
    } sizes[] = {
        {CAROM_WRT_Q0, m->num_q0, 3 * n},
        {CAROM_WRT_V0, m->num_v0, 3 * n},
        {CAROM_WRT_MASS, m->num_mass, n},
        {CAROM_WRT_INERTIA, m->num_inertia, n},
        {CAROM_WRT_FRICTION, m->num_friction, n},
        {CAROM_WRT_RESTITUTION, m->num_restitution, n},
        {CAROM_WRT_GRAVITY, m->num_gravity, 2},
        {CAROM_WRT_FORCE, m->num_force, 3 * n},
        {CAROM_WRT_FORCE_STEPS, m->num_force_steps, 3 * n * m->recorded_steps},
        {CAROM_WRT_RADIUS, m->num_radius, s->num_shapes},
        {CAROM_WRT_VERTICES, m->num_vertices, s->num_vertex_coords},
        {CAROM_WRT_ANCHORS, m->num_anchors, 4 * (int64_t)s->num_joints},
        {CAROM_WRT_DT, m->num_dt, 1},
        {CAROM_WRT_GRAVITY_SCALE, m->num_gravity_scale, n},
        {CAROM_WRT_LINEAR_DAMPING, m->num_linear_damping, n},
        {CAROM_WRT_ANGULAR_DAMPING, m->num_angular_damping, n},
        {CAROM_WRT_AXES, m->num_axes, s->num_joints},
        {CAROM_WRT_ANGLES, m->num_angles, s->num_joints},
        {CAROM_WRT_LENGTHS, m->num_lengths, s->num_joints},
        {CAROM_WRT_LOWER, m->num_lower, s->num_joints},
        {CAROM_WRT_UPPER, m->num_upper, s->num_joints},
        {CAROM_WRT_STIFFNESS, m->num_stiffness, s->num_joints},
        {CAROM_WRT_DAMPING, m->num_damping, s->num_joints},
        {CAROM_WRT_REST, m->num_rest, s->num_joints},
        {CAROM_WRT_MOTOR_SPEED, m->num_motor_speed, s->num_joints},
        {CAROM_WRT_MOTOR_LIMIT, m->num_motor_limit, s->num_joints},
    };
    for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++) {
        if (sizes[i].has != (w & sizes[i].bit ? sizes[i].needs : 0)) return 0;
    }
    return 1;
}

static int encode_loss(crm_exchange *x, const carom_loss_gradient_t *m)
{
    x->size = carom_loss_gradient_t_encoded_size(m);
    x->bytes = malloc((size_t)x->size);
    return x->bytes && carom_loss_gradient_t_encode(x->bytes, 0, x->size, m) == x->size;
}

carom_client_code carom_client_gradient_of(carom_client *c, double cost, int n_bars,
                                           const carom_state_bar *bars, unsigned wanted,
                                           carom_client_gradient *out)
{
    crm_exchange x = {0};
    carom_loss_gradient_t m = {0};
    carom_client_code code = needs_scene(c);
    if (code < 0) return code;
    if (n_bars < 0) return crm_client_fail(c, CAROM_CLIENT_E_ARGUMENT, "n_bars must be >= 0");
    const crm_wire_header h = crm_client_next_header(c);
    m.utime = h.utime;
    m.client_id = h.client_id;
    m.session = h.session;
    m.seq = h.seq;
    m.cost = cost;
    m.wanted = (int32_t)wanted;
    if (!place_bars(c, n_bars, bars, &m)) return no_memory(c);
    x.type = CRM_WIRE_LOSS_GRADIENT;
    x.needs_payload = 1;
    code = encode_loss(&x, &m) ? crm_client_exchange(c, &x) : no_memory(c);
    free(m.q_bar);
    if (code < 0) return code;
    if (!sizes_fit(c)) {
        return crm_client_fail(c, CAROM_CLIENT_E_FAILED,
                               "the gradient does not have the sizes of the scene");
    }
    view_gradient(c, out);
    return code;
}

static int encode_descent(crm_exchange *x, const carom_parameter_gradient_t *m)
{
    x->size = carom_parameter_gradient_t_encoded_size(m);
    x->bytes = malloc((size_t)x->size);
    return x->bytes && carom_parameter_gradient_t_encode(x->bytes, 0, x->size, m) == x->size;
}

/* Count and array of one kind of parameter in a descent. */
static void place(unsigned wanted, unsigned bit, const double *x, int64_t n, int32_t *count,
                  double **array)
{
    const int has = (wanted & bit) != 0 && x;
    *count = has ? (int32_t)n : 0;
    *array = (double *)(has ? x : NULL); /* the encoder only reads */
}

static void place_more(const carom_client_gradient *g, unsigned w, carom_parameter_gradient_t *m)
{
    const int64_t n = g->n_bodies;
    const int64_t j = g->n_joints;
    place(w, CAROM_WRT_GRAVITY_SCALE, g->gravity_scale, n, &m->num_gravity_scale,
          &m->gravity_scale);
    place(w, CAROM_WRT_LINEAR_DAMPING, g->linear_damping, n, &m->num_linear_damping,
          &m->linear_damping);
    place(w, CAROM_WRT_ANGULAR_DAMPING, g->angular_damping, n, &m->num_angular_damping,
          &m->angular_damping);
    place(w, CAROM_WRT_AXES, g->axes, j, &m->num_axes, &m->axes);
    place(w, CAROM_WRT_ANGLES, g->angles, j, &m->num_angles, &m->angles);
    place(w, CAROM_WRT_LENGTHS, g->lengths, j, &m->num_lengths, &m->lengths);
    place(w, CAROM_WRT_LOWER, g->lower, j, &m->num_lower, &m->lower);
    place(w, CAROM_WRT_UPPER, g->upper, j, &m->num_upper, &m->upper);
    place(w, CAROM_WRT_STIFFNESS, g->stiffness, j, &m->num_stiffness, &m->stiffness);
    place(w, CAROM_WRT_DAMPING, g->damping, j, &m->num_damping, &m->damping);
    place(w, CAROM_WRT_REST, g->rest, j, &m->num_rest, &m->rest);
    place(w, CAROM_WRT_MOTOR_SPEED, g->motor_speed, j, &m->num_motor_speed, &m->motor_speed);
    place(w, CAROM_WRT_MOTOR_LIMIT, g->motor_limit, j, &m->num_motor_limit, &m->motor_limit);
}

static void place_gradient(const carom_client_gradient *g, unsigned w,
                           carom_parameter_gradient_t *m)
{
    const int64_t n = g->n_bodies;
    place(w, CAROM_WRT_Q0, g->q0, 3 * n, &m->num_q0, &m->q0);
    place(w, CAROM_WRT_V0, g->v0, 3 * n, &m->num_v0, &m->v0);
    place(w, CAROM_WRT_MASS, g->mass, n, &m->num_mass, &m->mass);
    place(w, CAROM_WRT_INERTIA, g->inertia, n, &m->num_inertia, &m->inertia);
    place(w, CAROM_WRT_FRICTION, g->friction, n, &m->num_friction, &m->friction);
    place(w, CAROM_WRT_RESTITUTION, g->restitution, n, &m->num_restitution, &m->restitution);
    place(w, CAROM_WRT_GRAVITY, g->gravity, 2, &m->num_gravity, &m->gravity);
    place(w, CAROM_WRT_FORCE, g->force, 3 * n, &m->num_force, &m->force);
    place(w, CAROM_WRT_RADIUS, g->radius, g->n_shapes, &m->num_radius, &m->radius);
    place(w, CAROM_WRT_VERTICES, g->vertices, 2 * (int64_t)g->n_vertices, &m->num_vertices,
          &m->vertices);
    place(w, CAROM_WRT_ANCHORS, g->anchors, 4 * (int64_t)g->n_joints, &m->num_anchors, &m->anchors);
    place_more(g, w, m);
}

carom_client_code carom_client_descend(carom_client *c, double rate, unsigned wanted,
                                       const carom_client_gradient *gradient, int keep_state)
{
    crm_exchange x = {0};
    carom_parameter_gradient_t m = {0};
    const carom_client_code code = needs_scene(c);
    if (code < 0) return code;
    const crm_wire_header h = crm_client_next_header(c);
    m.utime = h.utime;
    m.client_id = h.client_id;
    m.session = h.session;
    m.seq = h.seq;
    m.wanted = (int32_t)wanted;
    m.rate = rate;
    m.keep_state = keep_state != 0;
    m.cost = gradient->cost;
    m.first_step = gradient->first_step;
    m.recorded_steps = gradient->recorded_steps;
    m.degenerate = gradient->degenerate;
    m.first_degenerate_step = gradient->first_degenerate_step;
    place_gradient(gradient, wanted, &m);
    x.type = CRM_WIRE_DESCEND;
    x.needs_payload = 1;
    return encode_descent(&x, &m) ? crm_client_exchange(c, &x) : no_memory(c);
}

carom_client_parameters carom_client_get_parameters(const carom_client *c)
{
    carom_client_parameters p;
    const carom_scene_t *s = &c->scene;
    memset(&p, 0, sizeof p);
    if (!c->has_scene) return p;
    p.n_bodies = s->num_bodies;
    p.n_shapes = s->num_shapes;
    p.n_vertices = s->num_vertex_coords / 2;
    p.n_joints = s->num_joints;
    p.q = s->q;
    p.v = s->v;
    p.mass = s->mass;
    p.inertia = s->inertia;
    p.friction = s->friction;
    p.restitution = s->restitution;
    p.gravity = s->gravity;
    p.force = s->force;
    p.radius = s->radius;
    p.vertices = s->vertices;
    p.anchors = s->anchor;
    p.anchors_b = s->anchor_b;
    p.axes = s->axis;
    p.gravity_scale = s->gravity_scale;
    p.linear_damping = s->linear_damping;
    p.angular_damping = s->angular_damping;
    p.lower = s->joint_lower;
    p.upper = s->joint_upper;
    p.stiffness = s->stiffness;
    p.damping = s->joint_damping;
    p.rest = s->rest;
    p.motor_speed = s->motor_speed;
    p.motor_limit = s->motor_limit;
    return p;
}
