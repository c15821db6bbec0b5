/* add_joint.c: adding joints.  docs/joint.md. */
#include "world/internal.h"

#include <math.h>

/* Points nearer to each other than this have no direction [largest coordinate]. */
static const double NO_DIRECTION = 1e-12;

const char *carom_joint_kind_name(carom_joint_kind kind)
{
    static const char *const names[CAROM_N_JOINT_KINDS] = {
        [CAROM_REVOLUTE] = "revolute", [CAROM_PRISMATIC] = "prismatic",
        [CAROM_WELD] = "weld",         [CAROM_WHEEL] = "wheel",
        [CAROM_DISTANCE] = "distance", [CAROM_ROPE] = "rope",
        [CAROM_TARGET] = "target",     [CAROM_LOCK_X] = "lock_x",
        [CAROM_LOCK_Y] = "lock_y",     [CAROM_LOCK_ANGLE] = "lock_angle",
    };
    const int k = (int)kind;
    return k >= 0 && k < CAROM_N_JOINT_KINDS ? names[k] : NULL;
}

carom_joint_def carom_joint_defaults(carom_joint_kind kind)
{
    carom_joint_def d = {0};
    d.kind = kind;
    d.body_a = d.body_b = -1;
    d.axis.x = 1;
    d.lower = -HUGE_VAL;
    d.upper = HUGE_VAL;
    d.break_force = HUGE_VAL;
    d.break_torque = HUGE_VAL;
    d.collide = kind == CAROM_DISTANCE || kind == CAROM_ROPE || kind == CAROM_TARGET ||
                kind == CAROM_LOCK_X || kind == CAROM_LOCK_Y || kind == CAROM_LOCK_ANGLE;
    return d;
}

static int finite2(carom_vec2 v)
{
    return isfinite(v.x) && isfinite(v.y);
}

static carom_status check_bodies(carom_world *w, const carom_joint_def *d)
{
    const int id = w->n_joints;
    const int a = d->body_a;
    const int b = d->body_b;
    if (w->sealed) {
        return crm_world_fail(w, CAROM_E_STATE, "joints are added before the world is sealed");
    }
    if (!carom_joint_kind_name(d->kind)) {
        return crm_world_fail(w, CAROM_E_ARGUMENT, "joint %d: there is no kind %d", id,
                              (int)d->kind);
    }
    if (a < 0 || a >= w->n_bodies || b < 0 || b >= w->n_bodies) {
        return crm_world_fail(w, CAROM_E_ARGUMENT, "joint %d: there is no body %d", id,
                              a < 0 || a >= w->n_bodies ? a : b);
    }
    if (a == b) return crm_world_fail(w, CAROM_E_ARGUMENT, "joint %d: one body twice", id);
    if (w->bodies[a].type != CAROM_DYNAMIC && w->bodies[b].type != CAROM_DYNAMIC) {
        return crm_world_fail(w, CAROM_E_ARGUMENT, "joint %d: neither body %d nor %d is dynamic",
                              id, a, b);
    }
    return CAROM_OK;
}

/* Joints between two points of their own. */
static int has_two_points(const carom_joint_def *d)
{
    return d->kind == CAROM_DISTANCE || d->kind == CAROM_ROPE;
}

static carom_status check_places(carom_world *w, const carom_joint_def *d)
{
    const int id = w->n_joints;
    const carom_vec2 a = d->anchor;
    const carom_vec2 b = d->anchor_b;
    if (!finite2(a) || (has_two_points(d) && !finite2(b))) {
        return crm_world_fail(w, CAROM_E_ARGUMENT, "joint %d: anchor not finite", id);
    }
    if (d->kind == CAROM_DISTANCE) {
        const double size = fmax(fmax(fabs(a.x), fabs(a.y)), fmax(fabs(b.x), fabs(b.y)));
        if (hypot(b.x - a.x, b.y - a.y) > NO_DIRECTION * size) return CAROM_OK;
        return crm_world_fail(w, CAROM_E_ARGUMENT,
                              "joint %d: the points of a distance joint meet; set them apart, or "
                              "use a revolute joint",
                              id);
    }
    if (d->kind != CAROM_PRISMATIC && d->kind != CAROM_WHEEL) return CAROM_OK;
    if (finite2(d->axis) && hypot(d->axis.x, d->axis.y) > 0) return CAROM_OK;
    return crm_world_fail(w, CAROM_E_ARGUMENT,
                          "joint %d: axis (%g, %g) of a %s joint is no direction; give one", id,
                          d->axis.x, d->axis.y, carom_joint_kind_name(d->kind));
}

static double distance(const carom_joint_def *d)
{
    return hypot(d->anchor_b.x - d->anchor.x, d->anchor_b.y - d->anchor.y);
}

/* One measure is left free: it can have limits, a spring, a motor. */
static int moves_one_way(carom_joint_kind kind)
{
    return kind == CAROM_REVOLUTE || kind == CAROM_PRISMATIC || kind == CAROM_WHEEL;
}

static int not_negative(double x)
{
    return x >= 0 && x < HUGE_VAL;
}

static carom_status check_drive(carom_world *w, const carom_joint_def *d)
{
    const int id = w->n_joints;
    const char *name = carom_joint_kind_name(d->kind);
    const int pulls = moves_one_way(d->kind) || d->kind == CAROM_ROPE || d->kind == CAROM_TARGET;
    if (!not_negative(d->stiffness) || !not_negative(d->damping) || !isfinite(d->rest)) {
        return crm_world_fail(w, CAROM_E_ARGUMENT,
                              "joint %d: spring %g, damping %g, rest %g: must be finite, the first "
                              "two 0 or more",
                              id, d->stiffness, d->damping, d->rest);
    }
    if (!not_negative(d->motor_limit) || !isfinite(d->motor_speed)) {
        return crm_world_fail(w, CAROM_E_ARGUMENT,
                              "joint %d: motor limit %g must be finite and 0 or more, its speed %g "
                              "finite",
                              id, d->motor_limit, d->motor_speed);
    }
    if ((d->stiffness > 0 || d->damping > 0) && !pulls) {
        return crm_world_fail(w, CAROM_E_ARGUMENT,
                              "joint %d: a %s joint leaves nothing to a spring; leave stiffness "
                              "and damping 0",
                              id, name);
    }
    if (d->motor_limit > 0 && !moves_one_way(d->kind)) {
        return crm_world_fail(w, CAROM_E_ARGUMENT,
                              "joint %d: a %s joint has no motor; leave motor_limit 0", id, name);
    }
    if (d->kind == CAROM_TARGET && !(d->stiffness > 0)) {
        return crm_world_fail(w, CAROM_E_ARGUMENT, "joint %d: a target pulls; give stiffness", id);
    }
    return CAROM_OK;
}

/* Limits hold at the present poses: at turn 0, way 0, or the present distance. */
static carom_status check_limits(carom_world *w, const carom_joint_def *d)
{
    const int id = w->n_joints;
    const char *name = carom_joint_kind_name(d->kind);
    const int given = d->lower > -HUGE_VAL || d->upper < HUGE_VAL;
    const int rope = d->kind == CAROM_ROPE;
    const int may =
        rope || d->kind == CAROM_REVOLUTE || d->kind == CAROM_PRISMATIC || d->kind == CAROM_WHEEL;
    const double now = rope ? distance(d) : 0;
    if (!(d->restitution >= 0 && d->restitution <= 1)) {
        return crm_world_fail(w, CAROM_E_ARGUMENT, "joint %d: restitution %g is not in [0, 1]", id,
                              d->restitution);
    }
    if (given && !may) {
        return crm_world_fail(w, CAROM_E_ARGUMENT,
                              "joint %d: a %s joint has no limits; leave them infinite", id, name);
    }
    if (rope && !given && !(d->stiffness > 0)) {
        return crm_world_fail(w, CAROM_E_ARGUMENT,
                              "joint %d: a rope needs a limit or a spring; give upper or stiffness",
                              id);
    }
    if (!(d->lower < d->upper)) {
        return crm_world_fail(w, CAROM_E_ARGUMENT, "joint %d: lower %g is not below upper %g", id,
                              d->lower, d->upper);
    }
    if (d->lower <= now && now <= d->upper) return CAROM_OK;
    return crm_world_fail(w, CAROM_E_ARGUMENT,
                          "joint %d: the %s is at %.17g, outside its limits %.17g to %.17g; widen "
                          "them or move the bodies",
                          id, name, now, d->lower, d->upper);
}

static carom_status check_strength(carom_world *w, const carom_joint_def *d)
{
    if (d->break_force > 0 && d->break_torque > 0) return CAROM_OK;
    return crm_world_fail(w, CAROM_E_ARGUMENT,
                          "joint %d: breaks at force %g and torque %g: must be positive; infinite: "
                          "never",
                          w->n_joints, d->break_force, d->break_torque);
}

/* R(angle)' (point - position) */
static carom_vec2 to_local(carom_pose p, carom_vec2 point)
{
    const carom_vec2 d = {point.x - p.x, point.y - p.y};
    return crm_rotate(-p.angle, d);
}

static crm_joint make_joint(const carom_world *w, const carom_joint_def *d)
{
    const carom_pose a = crm_pose(w->q, d->body_a);
    const carom_pose b = crm_pose(w->q, d->body_b);
    const carom_vec2 on_b = has_two_points(d) ? d->anchor_b : d->anchor;
    const crm_measure *measures;
    crm_joint j = {0};
    j.kind = d->kind;
    j.body_a = d->body_a;
    j.body_b = d->body_b;
    j.local_a = to_local(a, d->anchor);
    j.local_b = to_local(b, on_b);
    j.axis = atan2(d->axis.y, d->axis.x) - a.angle;
    j.angle = b.angle - a.angle;
    /* a rope measures from 0 */
    if (d->kind == CAROM_DISTANCE) j.length = distance(d);
    j.lower = d->lower;
    j.upper = d->upper;
    j.restitution = d->restitution;
    j.stiffness = d->stiffness;
    j.damping = d->damping;
    j.rest = d->rest;
    j.motor_speed = d->motor_speed;
    j.motor_limit = d->motor_limit;
    j.break_force = d->break_force;
    j.break_torque = d->break_torque;
    j.collide = d->collide != 0;
    j.first_row = w->n_joint_rows;
    j.n_held = crm_joint_measures(d->kind, &measures);
    j.n_rows = j.n_held + (d->motor_limit > 0);
    return j;
}

carom_status carom_world_add_joint(carom_world *world, const carom_joint_def *def, int *index)
{
    if (!world || !def) return CAROM_E_ARGUMENT;
    carom_world *w = world;
    carom_status e = check_bodies(w, def);
    if (!e) e = check_places(w, def);
    if (!e) e = check_limits(w, def);
    if (!e) e = check_drive(w, def);
    if (!e) e = check_strength(w, def);
    if (e) return e;
    void *joints = w->joints;
    e = crm_reserve(&w->memory, &joints, &w->max_joints, w->n_joints + 1, sizeof *w->joints);
    w->joints = joints;
    if (e) return crm_world_fail(w, e, "no memory for joint %d", w->n_joints);
    if (index) *index = w->n_joints;
    const crm_joint j = make_joint(w, def);
    w->joints[w->n_joints++] = j;
    w->n_joint_rows += j.n_rows;
    w->n_breakable += crm_joint_breaks(&j);
    return CAROM_OK;
}

carom_status carom_world_add_revolute(carom_world *world, int body_a, int body_b, carom_vec2 anchor,
                                      int *index)
{
    carom_joint_def d = carom_joint_defaults(CAROM_REVOLUTE);
    d.body_a = body_a;
    d.body_b = body_b;
    d.anchor = anchor;
    return carom_world_add_joint(world, &d, index);
}
