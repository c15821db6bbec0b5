/* engine_gradient.c: gradients of the tape, and descent steps on the scene. */
#include "engine_parts.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>

/* One kind of parameter: its bit, and how many numbers it has. */
typedef struct parameter {
    const char *name;
    int bit;
    size_t (*count)(const crm_engine *e);
    size_t message; /* offset of the array, and of its count, in parameter_gradient_t */
    size_t message_count;
} parameter;

static size_t three_per_body(const crm_engine *e)
{
    return 3 * (size_t)e->scene->num_bodies;
}

static size_t one_per_body(const crm_engine *e)
{
    return (size_t)e->scene->num_bodies;
}

static size_t one(const crm_engine *e)
{
    (void)e;
    return 1;
}

static size_t two(const crm_engine *e)
{
    (void)e;
    return 2;
}

static size_t per_step(const crm_engine *e)
{
    return three_per_body(e) * (size_t)crm_engine_recorded(e);
}

static size_t one_per_shape(const crm_engine *e)
{
    return (size_t)e->scene->num_shapes;
}

static size_t two_per_vertex(const crm_engine *e)
{
    return (size_t)e->scene->num_vertex_coords;
}

static size_t one_per_joint(const crm_engine *e)
{
    return (size_t)e->scene->num_joints;
}

static size_t four_per_joint(const crm_engine *e)
{
    return 4 * (size_t)e->scene->num_joints;
}

#define PARAMETER(name, BIT, count)                                                                \
    {                                                                                              \
#name, CAROM_PARAMETER_GRADIENT_T_##BIT, count,                                            \
            offsetof(carom_parameter_gradient_t, name),                                            \
            offsetof(carom_parameter_gradient_t, num_##name)                                       \
    }

static const parameter parameters[] = {
    PARAMETER(q0, Q0, three_per_body),
    PARAMETER(v0, V0, three_per_body),
    PARAMETER(mass, MASS, one_per_body),
    PARAMETER(inertia, INERTIA, one_per_body),
    PARAMETER(friction, FRICTION, one_per_body),
    PARAMETER(restitution, RESTITUTION, one_per_body),
    PARAMETER(gravity, GRAVITY, two),
    PARAMETER(force, FORCE, three_per_body),
    PARAMETER(force_steps, FORCE_STEPS, per_step),
    PARAMETER(radius, RADIUS, one_per_shape),
    PARAMETER(vertices, VERTICES, two_per_vertex),
    PARAMETER(anchors, ANCHORS, four_per_joint),
    PARAMETER(dt, DT, one),
    PARAMETER(gravity_scale, GRAVITY_SCALE, one_per_body),
    PARAMETER(linear_damping, LINEAR_DAMPING, one_per_body),
    PARAMETER(angular_damping, ANGULAR_DAMPING, one_per_body),
    PARAMETER(axes, AXES, one_per_joint),
    PARAMETER(angles, ANGLES, one_per_joint),
    PARAMETER(lengths, LENGTHS, one_per_joint),
    PARAMETER(lower, LOWER, one_per_joint),
    PARAMETER(upper, UPPER, one_per_joint),
    PARAMETER(stiffness, STIFFNESS, one_per_joint),
    PARAMETER(damping, DAMPING, one_per_joint),
    PARAMETER(rest, REST, one_per_joint),
    PARAMETER(motor_speed, MOTOR_SPEED, one_per_joint),
    PARAMETER(motor_limit, MOTOR_LIMIT, one_per_joint),
};

enum { N_PARAMETERS = sizeof parameters / sizeof parameters[0] };

static double **array_of(carom_parameter_gradient_t *m, const parameter *p)
{
    return (double **)(void *)((char *)m + p->message);
}

static int32_t *count_of(carom_parameter_gradient_t *m, const parameter *p)
{
    return (int32_t *)(void *)((char *)m + p->message_count);
}

static int unknown_bits(int32_t wanted)
{
    int32_t known = 0;
    for (int i = 0; i < N_PARAMETERS; i++) known |= parameters[i].bit;
    return wanted & ~known;
}

static carom_status unknown_wanted(int32_t wanted, char *text)
{
    return crm_engine_fault(CAROM_E_ARGUMENT, text, "wanted = %d: the bits %d name no parameter",
                            wanted, unknown_bits(wanted));
}

static carom_status check_loss(const crm_engine *e, const carom_loss_gradient_t *loss, char *text)
{
    const int64_t n = (int64_t)three_per_body(e) * loss->num_bars;
    if (!e->tape) {
        return crm_engine_fault(CAROM_E_STATE, text,
                                "nothing is recorded: step with record = RECORD_ON first");
    }
    if (unknown_bits(loss->wanted)) return unknown_wanted(loss->wanted, text);
    if (loss->num_bar_coords != n) {
        return crm_engine_fault(CAROM_E_ARGUMENT, text,
                                "num_bar_coords = %d: %d states of %d bodies need %" PRId64,
                                loss->num_bar_coords, loss->num_bars, e->scene->num_bodies, n);
    }
    const int64_t last = e->first_step + crm_engine_recorded(e);
    for (int k = 0; k < loss->num_bars; k++) {
        if (loss->bar_step[k] < e->first_step || loss->bar_step[k] > last) {
            return crm_engine_fault(CAROM_E_ARGUMENT, text,
                                    "bar_step[%d] = %" PRId64 ": steps %" PRId64 " to %" PRId64
                                    " are recorded",
                                    k, loss->bar_step[k], e->first_step, last);
        }
    }
    for (int64_t i = 0; i < n; i++) {
        if (!isfinite(loss->q_bar[i]) || !isfinite(loss->v_bar[i])) {
            return crm_engine_fault(CAROM_E_ARGUMENT, text,
                                    "a cotangent of state %" PRId64 " is not finite",
                                    i / (n / loss->num_bars));
        }
    }
    return CAROM_OK;
}

/* Room for the wanted arrays, laid out one after the other; the message points into it. */
static carom_status place_gradient(crm_engine *e, carom_parameter_gradient_t *out)
{
    size_t total = 0;
    for (int i = 0; i < N_PARAMETERS; i++) {
        const parameter *p = &parameters[i];
        const size_t n = out->wanted & p->bit ? p->count(e) : 0;
        if (n > INT32_MAX / sizeof(double)) return CAROM_E_CAPACITY;
        *count_of(out, p) = (int32_t)n;
        total += n;
    }
    crm_free(&e->memory, e->gradient, e->n_gradient, sizeof(double));
    e->gradient = crm_new(&e->memory, total, sizeof(double));
    e->n_gradient = e->gradient ? total : 0;
    if (!e->gradient) return CAROM_E_MEMORY;
    double *at = e->gradient;
    for (int i = 0; i < N_PARAMETERS; i++) {
        *array_of(out, &parameters[i]) = at;
        at += *count_of(out, &parameters[i]);
    }
    return CAROM_OK;
}

static double *wanted(double *array, int has)
{
    return has ? array : NULL;
}

static carom_gradient gradient_view(const carom_parameter_gradient_t *m)
{
    const int w = m->wanted;
    carom_gradient g = {0};
    g.q0 = wanted(m->q0, w & CAROM_PARAMETER_GRADIENT_T_Q0);
    g.v0 = wanted(m->v0, w & CAROM_PARAMETER_GRADIENT_T_V0);
    g.mass = wanted(m->mass, w & CAROM_PARAMETER_GRADIENT_T_MASS);
    g.inertia = wanted(m->inertia, w & CAROM_PARAMETER_GRADIENT_T_INERTIA);
    g.friction = wanted(m->friction, w & CAROM_PARAMETER_GRADIENT_T_FRICTION);
    g.restitution = wanted(m->restitution, w & CAROM_PARAMETER_GRADIENT_T_RESTITUTION);
    g.gravity = wanted(m->gravity, w & CAROM_PARAMETER_GRADIENT_T_GRAVITY);
    g.force = wanted(m->force, w & CAROM_PARAMETER_GRADIENT_T_FORCE);
    g.force_steps = wanted(m->force_steps, w & CAROM_PARAMETER_GRADIENT_T_FORCE_STEPS);
    g.radius = wanted(m->radius, w & CAROM_PARAMETER_GRADIENT_T_RADIUS);
    g.vertices = (carom_vec2 *)(void *)wanted(m->vertices, w & CAROM_PARAMETER_GRADIENT_T_VERTICES);
    g.anchors = (carom_vec2 *)(void *)wanted(m->anchors, w & CAROM_PARAMETER_GRADIENT_T_ANCHORS);
    g.dt = wanted(m->dt, w & CAROM_PARAMETER_GRADIENT_T_DT);
    g.gravity_scale = wanted(m->gravity_scale, w & CAROM_PARAMETER_GRADIENT_T_GRAVITY_SCALE);
    g.linear_damping = wanted(m->linear_damping, w & CAROM_PARAMETER_GRADIENT_T_LINEAR_DAMPING);
    g.angular_damping = wanted(m->angular_damping, w & CAROM_PARAMETER_GRADIENT_T_ANGULAR_DAMPING);
    g.axes = wanted(m->axes, w & CAROM_PARAMETER_GRADIENT_T_AXES);
    g.angles = wanted(m->angles, w & CAROM_PARAMETER_GRADIENT_T_ANGLES);
    g.lengths = wanted(m->lengths, w & CAROM_PARAMETER_GRADIENT_T_LENGTHS);
    g.lower = wanted(m->lower, w & CAROM_PARAMETER_GRADIENT_T_LOWER);
    g.upper = wanted(m->upper, w & CAROM_PARAMETER_GRADIENT_T_UPPER);
    g.stiffness = wanted(m->stiffness, w & CAROM_PARAMETER_GRADIENT_T_STIFFNESS);
    g.damping = wanted(m->damping, w & CAROM_PARAMETER_GRADIENT_T_DAMPING);
    g.rest = wanted(m->rest, w & CAROM_PARAMETER_GRADIENT_T_REST);
    g.motor_speed = wanted(m->motor_speed, w & CAROM_PARAMETER_GRADIENT_T_MOTOR_SPEED);
    g.motor_limit = wanted(m->motor_limit, w & CAROM_PARAMETER_GRADIENT_T_MOTOR_LIMIT);
    return g;
}

static carom_status reverse_pass(crm_engine *e, const carom_loss_gradient_t *loss,
                                 carom_parameter_gradient_t *out)
{
    const size_t n = (size_t)loss->num_bars, width = three_per_body(e);
    carom_state_bar *bars = crm_new(&e->memory, n, sizeof *bars);
    if (!bars) return CAROM_E_MEMORY;
    for (size_t k = 0; k < n; k++) {
        bars[k].step = (int)(loss->bar_step[k] - e->first_step);
        bars[k].q = loss->q_bar + k * width;
        bars[k].v = loss->v_bar + k * width;
    }
    const carom_gradient g = gradient_view(out);
    carom_gradient_stats stats = {0};
    const carom_status status = carom_tape_gradient(e->tape, (int)n, bars, &g, &stats);
    crm_free(&e->memory, bars, n, sizeof *bars);
    out->degenerate = stats.degenerate;
    out->first_degenerate_step =
        stats.first_degenerate_step < 0 ? -1 : e->first_step + stats.first_degenerate_step;
    return status;
}

carom_status crm_engine_gradient(crm_engine *e, const carom_loss_gradient_t *loss, char *text,
                                 carom_parameter_gradient_t *out)
{
    carom_status status = check_loss(e, loss, text);
    if (status < 0) return status;
    out->wanted = loss->wanted;
    out->rate = 0;
    out->keep_state = 0;
    out->cost = loss->cost;
    out->first_step = e->first_step;
    out->recorded_steps = crm_engine_recorded(e);
    status = place_gradient(e, out);
    if (status >= 0) status = reverse_pass(e, loss, out);
    if (status < 0) {
        return crm_engine_fault(status, text, "gradient: %s", carom_status_text(status));
    }
    return status;
}

static carom_status check_descent(const crm_engine *e, const carom_parameter_gradient_t *d,
                                  char *text)
{
    if (!(d->rate > 0 && d->rate < HUGE_VAL)) {
        return crm_engine_fault(CAROM_E_ARGUMENT, text, "rate = %g: must be > 0", d->rate);
    }
    if (d->wanted & (CAROM_PARAMETER_GRADIENT_T_FORCE_STEPS | CAROM_PARAMETER_GRADIENT_T_DT)) {
        return crm_engine_fault(CAROM_E_ARGUMENT, text,
                                "force_steps belong to the step requests, dt to the settings");
    }
    if (d->wanted & (CAROM_PARAMETER_GRADIENT_T_ANGLES | CAROM_PARAMETER_GRADIENT_T_LENGTHS)) {
        return crm_engine_fault(CAROM_E_ARGUMENT, text,
                                "angles and lengths of joints follow from poses and anchors");
    }
    if (unknown_bits(d->wanted)) return unknown_wanted(d->wanted, text);
    carom_parameter_gradient_t view = *d;
    for (int i = 0; i < N_PARAMETERS; i++) {
        const parameter *p = &parameters[i];
        if (!(d->wanted & p->bit)) continue;
        const size_t n = p->count(e);
        if ((size_t)*count_of(&view, p) != n) {
            return crm_engine_fault(CAROM_E_ARGUMENT, text, "num_%s = %d: this scene has %zu",
                                    p->name, *count_of(&view, p), n);
        }
        const double *g = *array_of(&view, p);
        for (size_t k = 0; k < n; k++) {
            if (!isfinite(g[k])) {
                return crm_engine_fault(CAROM_E_ARGUMENT, text, "%s[%zu] is not finite", p->name,
                                        k);
            }
        }
    }
    return CAROM_OK;
}

static void descend_array(double *x, const double *g, int n, double rate)
{
    for (int i = 0; i < n; i++) x[i] -= rate * g[i];
}

/* A number that must stay positive shrinks to a hundredth at most. */
static const double SHRINK = 0.01;

static void descend_positive(double *x, const double *g, int n, double rate)
{
    for (int i = 0; i < n; i++) x[i] = fmax(x[i] - rate * g[i], SHRINK * x[i]);
}

static void descend_clamped(double *x, const double *g, int n, double rate, double top)
{
    for (int i = 0; i < n; i++) x[i] = fmin(fmax(x[i] - rate * g[i], 0), top);
}

/* Only circles need a radius > 0. */
static void descend_radii(carom_scene_t *s, const double *g, double rate)
{
    for (int k = 0; k < s->num_shapes; k++) {
        if (s->shape_num_vertices[k] == 1) {
            descend_positive(&s->radius[k], &g[k], 1, rate);
        } else {
            descend_clamped(&s->radius[k], &g[k], 1, rate, HUGE_VAL);
        }
    }
}

/* Static bodies have no velocity, and only dynamic ones have mass. */
static void descend_bodies(carom_scene_t *s, const carom_parameter_gradient_t *d)
{
    const int w = d->wanted;
    const double rate = d->rate;
    for (int i = 0; i < s->num_bodies; i++) {
        const int dynamic = s->body_type[i] == CAROM_SCENE_T_DYNAMIC;
        if (w & CAROM_PARAMETER_GRADIENT_T_V0 && s->body_type[i] != CAROM_SCENE_T_STATIC) {
            descend_array(&s->v[3 * i], &d->v0[3 * i], 3, rate);
        }
        if (w & CAROM_PARAMETER_GRADIENT_T_MASS && dynamic) {
            descend_positive(&s->mass[i], &d->mass[i], 1, rate);
        }
        if (w & CAROM_PARAMETER_GRADIENT_T_INERTIA && dynamic) {
            descend_positive(&s->inertia[i], &d->inertia[i], 1, rate);
        }
    }
}

/* r rotated by the angle of body i. */
static carom_vec2 rotate(const double *q, int i, carom_vec2 r)
{
    const double c = cos(q[3 * i]), s = sin(q[3 * i]);
    return (carom_vec2){c * r.x - s * r.y, s * r.x + c * r.y};
}

static carom_vec2 rotate_back(const double *q, int i, carom_vec2 r)
{
    const double c = cos(q[3 * i]), s = sin(q[3 * i]);
    return (carom_vec2){c * r.x + s * r.y, -s * r.x + c * r.y};
}

/* Where body i takes, from poses q to poses p, the point w. */
static carom_vec2 carried(const double *q, const double *p, int i, carom_vec2 w)
{
    const carom_vec2 local =
        rotate_back(q, i, (carom_vec2){w.x - q[3 * i + 1], w.y - q[3 * i + 2]});
    const carom_vec2 r = rotate(p, i, local);
    return (carom_vec2){p[3 * i + 1] + r.x, p[3 * i + 2] + r.y};
}

static int has_two_points(const carom_scene_t *s, int k)
{
    return s->joint_type[k] == CAROM_SCENE_T_DISTANCE || s->joint_type[k] == CAROM_SCENE_T_ROPE;
}

/* Most joints are given by one world point w at the poses q; the anchors in the two frames follow,
 * a = R_a' (w - x_a) and b = R_b' (w - x_b), so that dl/dw = R_a dl/da + R_b dl/db.
 * Where the poses move to p, the point goes with its bodies: the mean of where the two take it. */
static void descend_anchors(carom_scene_t *s, const double *q, const carom_parameter_gradient_t *d)
{
    for (int k = 0; k < s->num_joints; k++) {
        const int a = s->joint_body_a[k], b = s->joint_body_b[k];
        if (has_two_points(s, k)) continue;
        carom_vec2 w = {s->anchor[2 * k], s->anchor[2 * k + 1]};
        if (d->wanted & CAROM_PARAMETER_GRADIENT_T_ANCHORS) {
            const double *g = d->anchors + 4 * k;
            const carom_vec2 ga = rotate(q, a, (carom_vec2){g[0], g[1]});
            const carom_vec2 gb = rotate(q, b, (carom_vec2){g[2], g[3]});
            w.x -= d->rate * (ga.x + gb.x);
            w.y -= d->rate * (ga.y + gb.y);
        }
        if (d->wanted & CAROM_PARAMETER_GRADIENT_T_Q0) {
            const carom_vec2 wa = carried(q, s->q, a, w), wb = carried(q, s->q, b, w);
            w = (carom_vec2){0.5 * (wa.x + wb.x), 0.5 * (wa.y + wb.y)};
        }
        s->anchor[2 * k] = s->anchor_b[2 * k] = w.x;
        s->anchor[2 * k + 1] = s->anchor_b[2 * k + 1] = w.y;
    }
}

/* The anchor *w in body i moves with its own gradient, and goes with its body. */
static void descend_point(const carom_scene_t *s, const double *q,
                          const carom_parameter_gradient_t *d, int i, const double *g, double *w)
{
    carom_vec2 x = {w[0], w[1]};
    if (d->wanted & CAROM_PARAMETER_GRADIENT_T_ANCHORS) {
        const carom_vec2 turned = rotate(q, i, (carom_vec2){g[0], g[1]});
        x.x -= d->rate * turned.x;
        x.y -= d->rate * turned.y;
    }
    if (d->wanted & CAROM_PARAMETER_GRADIENT_T_Q0) x = carried(q, s->q, i, x);
    w[0] = x.x;
    w[1] = x.y;
}

static void descend_two_points(carom_scene_t *s, const double *q,
                               const carom_parameter_gradient_t *d)
{
    for (int k = 0; k < s->num_joints; k++) {
        const double *g =
            d->wanted & CAROM_PARAMETER_GRADIENT_T_ANCHORS ? d->anchors + 4 * k : NULL;
        if (!has_two_points(s, k)) continue;
        descend_point(s, q, d, s->joint_body_a[k], g, &s->anchor[2 * k]);
        descend_point(s, q, d, s->joint_body_b[k], g ? g + 2 : NULL, &s->anchor_b[2 * k]);
    }
}

/* An axis turns by its own gradient, and with body A. */
static void descend_axes(carom_scene_t *s, const double *q, const carom_parameter_gradient_t *d)
{
    for (int k = 0; k < s->num_joints; k++) {
        const int a = s->joint_body_a[k];
        double turn = s->q[3 * a] - q[3 * a];
        if (d->wanted & CAROM_PARAMETER_GRADIENT_T_AXES) turn -= d->rate * d->axes[k];
        if (turn == 0) continue;
        const double x = s->axis[2 * k], y = s->axis[2 * k + 1];
        s->axis[2 * k] = cos(turn) * x - sin(turn) * y;
        s->axis[2 * k + 1] = sin(turn) * x + cos(turn) * y;
    }
}

/* Springs, limits and motors. */
static void descend_drives(carom_scene_t *s, const carom_parameter_gradient_t *d)
{
    const int w = d->wanted, n = s->num_joints;
    const double rate = d->rate;
    if (w & CAROM_PARAMETER_GRADIENT_T_LOWER) descend_array(s->joint_lower, d->lower, n, rate);
    if (w & CAROM_PARAMETER_GRADIENT_T_UPPER) descend_array(s->joint_upper, d->upper, n, rate);
    if (w & CAROM_PARAMETER_GRADIENT_T_REST) descend_array(s->rest, d->rest, n, rate);
    if (w & CAROM_PARAMETER_GRADIENT_T_MOTOR_SPEED) {
        descend_array(s->motor_speed, d->motor_speed, n, rate);
    }
    if (w & CAROM_PARAMETER_GRADIENT_T_STIFFNESS) {
        descend_positive(s->stiffness, d->stiffness, n, rate);
    }
    if (w & CAROM_PARAMETER_GRADIENT_T_DAMPING) {
        descend_clamped(s->joint_damping, d->damping, n, rate, HUGE_VAL);
    }
    if (w & CAROM_PARAMETER_GRADIENT_T_MOTOR_LIMIT) {
        descend_positive(s->motor_limit, d->motor_limit, n, rate);
    }
}

/* What acts on bodies without touching them. */
static void descend_weights(carom_scene_t *s, const carom_parameter_gradient_t *d)
{
    const int w = d->wanted, n = s->num_bodies;
    if (w & CAROM_PARAMETER_GRADIENT_T_GRAVITY) descend_array(s->gravity, d->gravity, 2, d->rate);
    if (w & CAROM_PARAMETER_GRADIENT_T_FORCE) descend_array(s->force, d->force, 3 * n, d->rate);
    if (w & CAROM_PARAMETER_GRADIENT_T_GRAVITY_SCALE) {
        descend_array(s->gravity_scale, d->gravity_scale, n, d->rate);
    }
    if (w & CAROM_PARAMETER_GRADIENT_T_LINEAR_DAMPING) {
        descend_clamped(s->linear_damping, d->linear_damping, n, d->rate, HUGE_VAL);
    }
    if (w & CAROM_PARAMETER_GRADIENT_T_ANGULAR_DAMPING) {
        descend_clamped(s->angular_damping, d->angular_damping, n, d->rate, HUGE_VAL);
    }
}

/* s: the scene to change; q: its poses before. */
static void descend_scene(carom_scene_t *s, const double *q, const carom_parameter_gradient_t *d)
{
    const int w = d->wanted, n = s->num_bodies;
    const double rate = d->rate;
    if (w & CAROM_PARAMETER_GRADIENT_T_Q0) descend_array(s->q, d->q0, 3 * n, rate);
    descend_bodies(s, d);
    if (w & CAROM_PARAMETER_GRADIENT_T_FRICTION) {
        descend_clamped(s->friction, d->friction, n, rate, HUGE_VAL);
    }
    if (w & CAROM_PARAMETER_GRADIENT_T_RESTITUTION) {
        descend_clamped(s->restitution, d->restitution, n, rate, 1);
    }
    descend_weights(s, d);
    if (w & CAROM_PARAMETER_GRADIENT_T_RADIUS) descend_radii(s, d->radius, rate);
    if (w & CAROM_PARAMETER_GRADIENT_T_VERTICES) {
        descend_array(s->vertices, d->vertices, s->num_vertex_coords, rate);
    }
    descend_anchors(s, q, d);
    descend_two_points(s, q, d);
    descend_axes(s, q, d);
    descend_drives(s, d);
}

/* The world of `scene`, in the present state when it is kept. */
static carom_status rebuild(crm_engine *e, const carom_scene_t *scene, int keep, char *text,
                            carom_world **out)
{
    carom_world *world = NULL;
    carom_status status = crm_engine_build(scene, e->memory.from, text, &world);
    if (status < 0) return status;
    if (keep) {
        const carom_status set =
            carom_world_set_state(world, carom_world_q(e->world), carom_world_v(e->world));
        if (set < 0) {
            crm_engine_fault(set, text, "%s", carom_world_error(world));
            carom_world_destroy(world);
            return set;
        }
    }
    *out = world;
    return status;
}

static carom_status check_start(const carom_parameter_gradient_t *d, char *text)
{
    const int initial = CAROM_PARAMETER_GRADIENT_T_Q0 | CAROM_PARAMETER_GRADIENT_T_V0;
    if (!(d->wanted & initial) || d->first_step == 0) return CAROM_OK;
    return crm_engine_fault(CAROM_E_STATE, text,
                            "q0 and v0 of a tape that starts at step %" PRId64
                            " are not those of the scene",
                            d->first_step);
}

carom_status crm_engine_descend(crm_engine *e, const carom_parameter_gradient_t *d, char *text)
{
    carom_status status = check_descent(e, d, text);
    if (status >= 0) status = check_start(d, text);
    if (status < 0) return status;
    carom_scene_t *scene = carom_scene_t_copy(e->scene);
    descend_scene(scene, e->scene->q, d);
    carom_world *world = NULL;
    status = rebuild(e, scene, d->keep_state, text, &world);
    if (status < 0) {
        carom_scene_t_destroy(scene);
        return status;
    }
    crm_engine_forget_tape(e);
    carom_world_destroy(e->world);
    carom_scene_t_destroy(e->scene);
    e->world = world;
    e->scene = scene;
    if (!d->keep_state) e->step = 0;
    memset(&e->stats, 0, sizeof e->stats);
    e->stats.energy = carom_world_energy(world);
    return status;
}
