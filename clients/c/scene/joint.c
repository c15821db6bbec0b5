#include "joint.h"

#include <string.h>

/* Names of a joint's keys that only some types have. */
enum { AXIS = 1, ANCHOR_B = 2, LIMITS = 4, SPRING = 8, MOTOR = 16, MAX_KEYS = 24 };

static int keys_of(carom_joint_kind kind)
{
    switch (kind) {
    case CAROM_REVOLUTE: return LIMITS | SPRING | MOTOR;
    case CAROM_PRISMATIC:
    case CAROM_WHEEL: return AXIS | LIMITS | SPRING | MOTOR;
    case CAROM_DISTANCE: return ANCHOR_B;
    case CAROM_ROPE: return ANCHOR_B | LIMITS | SPRING;
    case CAROM_TARGET: return SPRING;
    default: return 0;
    }
}

/* The keys that a joint of these has, NULL-terminated. */
static void list_keys(int has, const char *keys[MAX_KEYS])
{
    static const struct {
        int of; /* 0: every joint has it */
        const char *key;
    } all[] = {
        {0, "type"},         {0, "body_a"},     {0, "body_b"},           {0, "anchor"},
        {0, "collide"},      {0, "name"},       {AXIS, "axis"},          {ANCHOR_B, "anchor_b"},
        {LIMITS, "lower"},   {LIMITS, "upper"}, {LIMITS, "restitution"}, {SPRING, "stiffness"},
        {SPRING, "damping"}, {SPRING, "rest"},  {MOTOR, "motor_speed"},  {MOTOR, "motor_limit"}};
    int n = 0;
    for (size_t k = 0; k < sizeof all / sizeof *all; k++) {
        if (!all[k].of || (has & all[k].of)) keys[n++] = all[k].key;
    }
    keys[n] = NULL;
}

/* Index of the one body with this name; -1 with a fault. */
static int find_body(crm_problems *problems, const crm_node *node, const crm_scene *scene,
                     const char *name)
{
    int found = -1;
    for (int i = 0; i < scene->n_bodies; i++) {
        if (!scene->bodies[i].name || strcmp(scene->bodies[i].name, name) != 0) continue;
        if (found >= 0) {
            crm_fault(problems, node,
                      "bodies[%d] and bodies[%d] are both named \"%.40s\"; use an index", found, i,
                      name);
            return -1;
        }
        found = i;
    }
    if (found < 0) crm_fault(problems, node, "no body is named \"%.40s\"", name);
    return found;
}

static int read_reference(crm_problems *problems, const crm_node *node, const crm_scene *scene)
{
    json_int_t index = -1;
    if (!node->json) {
        crm_fault(problems, node, "must be given: index or name of a body");
        return -1;
    }
    if (json_is_string(node->json)) {
        return find_body(problems, node, scene, json_string_value(node->json));
    }
    if (!crm_get_integer(problems, node, 0, scene->n_bodies - 1, &index)) return -1;
    return (int)index;
}

static void read_bodies(crm_problems *problems, const crm_node *node, const crm_scene *scene,
                        carom_joint_def *def)
{
    const crm_node a = crm_member(node, "body_a");
    const crm_node b = crm_member(node, "body_b");
    def->body_a = read_reference(problems, &a, scene);
    def->body_b = read_reference(problems, &b, scene);
    if (def->body_a < 0 || def->body_b < 0) return;
    if (def->body_a == def->body_b) {
        crm_fault(problems, &b, "joins the body to itself; name another body");
    } else if (scene->bodies[def->body_a].def.type != CAROM_DYNAMIC &&
               scene->bodies[def->body_b].def.type != CAROM_DYNAMIC) {
        crm_fault(problems, node, "neither body is dynamic; one of them must be");
    }
}

static void read_vector(crm_problems *problems, const crm_node *node, const char *key,
                        const char *what, carom_vec2 *to)
{
    const crm_node at = crm_member(node, key);
    double xy[2] = {0, 0};
    if (!at.json) crm_fault(problems, &at, "must be given: %s [x, y]", what);
    if (!crm_get_numbers(problems, &at, 2, xy)) return;
    to->x = xy[0];
    to->y = xy[1];
}

static void read_limits(crm_problems *problems, const crm_node *node, carom_joint_def *def)
{
    const crm_node lower = crm_member(node, "lower");
    const crm_node upper = crm_member(node, "upper");
    const crm_node restitution = crm_member(node, "restitution");
    crm_get_number(problems, &lower, &def->lower);
    crm_get_number(problems, &upper, &def->upper);
    if (crm_get_number(problems, &restitution, &def->restitution) &&
        !(def->restitution >= 0 && def->restitution <= 1)) {
        crm_fault(problems, &restitution, "must be from 0 to 1, is %.17g", def->restitution);
    }
    if (!(def->lower < def->upper)) {
        crm_fault(problems, &lower, "must be below upper, %.17g", def->upper);
    }
    const crm_node spring = crm_member(node, "stiffness");
    if (def->kind == CAROM_ROPE && !lower.json && !upper.json && !spring.json) {
        crm_fault(problems, &upper, "must be given: the length of the rope [m], or a stiffness");
    }
}

/* A number that is 0 or more. */
static void read_strength(crm_problems *problems, const crm_node *node, const char *key, double *x)
{
    const crm_node at = crm_member(node, key);
    if (!crm_get_number(problems, &at, x) || *x >= 0) return;
    crm_fault(problems, &at, "must be >= 0, is %.17g", *x);
}

static void read_spring(crm_problems *problems, const crm_node *node, carom_joint_def *def)
{
    const crm_node stiffness = crm_member(node, "stiffness");
    const crm_node rest = crm_member(node, "rest");
    read_strength(problems, node, "stiffness", &def->stiffness);
    read_strength(problems, node, "damping", &def->damping);
    crm_get_number(problems, &rest, &def->rest);
    if (def->kind == CAROM_TARGET && !stiffness.json) {
        crm_fault(problems, &stiffness, "must be given: how hard the target pulls [N/m]");
    }
}

static void read_motor(crm_problems *problems, const crm_node *node, carom_joint_def *def)
{
    const crm_node speed = crm_member(node, "motor_speed");
    const crm_node limit = crm_member(node, "motor_limit");
    crm_get_number(problems, &speed, &def->motor_speed);
    read_strength(problems, node, "motor_limit", &def->motor_limit);
    if (speed.json && !limit.json) {
        crm_fault(problems, &limit, "must be given: the motor's largest torque or force");
    }
}

/* The type's kind; 0 with a fault. */
static int read_kind(crm_problems *problems, const crm_node *node, carom_joint_kind *kind)
{
    const char *words[CAROM_N_JOINT_KINDS + 1];
    const crm_node type = crm_member(node, "type");
    for (int k = 0; k < CAROM_N_JOINT_KINDS; k++) {
        words[k] = carom_joint_kind_name((carom_joint_kind)k);
    }
    words[CAROM_N_JOINT_KINDS] = NULL;
    if (!type.json) {
        crm_fault(problems, &type, "must be given: revolute, prismatic, weld, ...");
        return 0;
    }
    const int word = crm_get_word(problems, &type, words);
    if (word >= 0) *kind = (carom_joint_kind)word;
    return word >= 0;
}

void crm_joint_read(crm_problems *problems, const crm_node *node, const crm_scene *scene,
                    carom_joint_def *def)
{
    const char *keys[MAX_KEYS];
    carom_joint_kind kind = CAROM_REVOLUTE;
    if (json_is_object(node->json) && !read_kind(problems, node, &kind)) return;
    const int has = keys_of(kind);
    list_keys(has, keys);
    if (!crm_check_keys(problems, node, keys)) return;
    *def = carom_joint_defaults(kind);
    const crm_node collide = crm_member(node, "collide");
    crm_get_flag(problems, &collide, &def->collide);
    read_bodies(problems, node, scene, def);
    read_vector(problems, node, "anchor", "a world point", &def->anchor);
    if (has & ANCHOR_B) {
        read_vector(problems, node, "anchor_b", "the point of body_b", &def->anchor_b);
    }
    if (has & AXIS) read_vector(problems, node, "axis", "a direction", &def->axis);
    if (has & LIMITS) read_limits(problems, node, def);
    if (has & SPRING) read_spring(problems, node, def);
    if (has & MOTOR) read_motor(problems, node, def);
}
