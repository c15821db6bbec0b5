#include "carom/collide.h"
#include "clients/c/scene/scene.h"
#include "cmd.h"
#include "io/load.h"
#include "io/memory.h"
#include "io/output.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct pair {
    json_t *id; /* view, written back as it is; NULL: the index */
    carom_shape a, b;
    carom_pose pose_a, pose_b;
} pair;

static void read_pose(crm_problems *problems, const crm_node *node, carom_pose *pose)
{
    double x[3] = {0, 0, 0};
    if (!node->json) crm_fault(problems, node, "must be given: [angle, x, y]");
    crm_get_numbers(problems, node, 3, x);
    pose->angle = x[0];
    pose->x = x[1];
    pose->y = x[2];
}

/* The keys of a pair that carry references are not read. */
static void read_pair(crm_problems *problems, const crm_node *node, pair *p)
{
    const crm_node a = crm_member(node, "A");
    const crm_node b = crm_member(node, "B");
    const crm_node pose_a = crm_member(node, "poseA");
    const crm_node pose_b = crm_member(node, "poseB");
    memset(p, 0, sizeof *p);
    p->id = json_object_get(node->json, "id");
    crm_shape_read(problems, &a, &p->a);
    crm_shape_read(problems, &b, &p->b);
    read_pose(problems, &pose_a, &p->pose_a);
    read_pose(problems, &pose_b, &p->pose_b);
}

/* Name of the closest features, in the words of the vector file. */
static const char *feature_name(const pair *p, const carom_manifold *m)
{
    const int circle_a = p->a.count == 1;
    const int circle_b = p->b.count == 1;
    if (circle_a && circle_b) return m->ambiguous ? "coincident centres" : "circle-circle";
    const int vertices = m->count > 0 && m->points[0].recipe.kernel == CAROM_POINT_POINT;
    if (!circle_a && !circle_b) return vertices ? "vertex-vertex" : "face";
    if (vertices) return "vertex";
    const double radius = circle_a ? p->a.radius : p->b.radius;
    return m->distance + radius > 0 ? "edge" : "centre inside";
}

static void put_point(crm_output *out, const char *key, carom_pose pose, carom_vec2 arm)
{
    const double x[2] = {pose.x + arm.x, pose.y + arm.y};
    crm_put_raw(out, key);
    crm_put_numbers(out, 2, x);
}

static void put_pair(crm_output *out, int index, const pair *p)
{
    const carom_manifold m = carom_collide(&p->a, p->pose_a, &p->b, p->pose_b, HUGE_VAL);
    const double normal[2] = {m.normal.x, m.normal.y};
    char *id = p->id ? json_dumps(p->id, JSON_ENCODE_ANY | JSON_COMPACT) : NULL;
    crm_put_raw(out, "{\"id\":");
    if (id) {
        crm_put_raw(out, id);
    } else {
        crm_put_number(out, index);
    }
    free(id);
    crm_put_field(out, 0, "distance", m.distance);
    crm_put_key(out, 0, "normal");
    crm_put_numbers(out, 2, normal);
    crm_put_key(out, 0, "feature");
    crm_put_text(out, feature_name(p, &m));
    crm_put_key(out, 0, "points");
    crm_put_raw(out, "[");
    for (int k = 0; k < m.count; k++) {
        put_point(out, k ? ",{\"pA\":" : "{\"pA\":", p->pose_a, m.points[k].arm_a);
        put_point(out, ",\"pB\":", p->pose_b, m.points[k].arm_b);
        crm_put_field(out, 0, "gap", m.points[k].gap);
        crm_put_raw(out, "}");
    }
    crm_put_raw(out, "]}\n");
}

/* {"vectors": [...]}, or the array alone. */
static crm_node find_pairs(crm_problems *problems, const crm_node *root)
{
    const crm_node list = crm_member(root, "vectors");
    if (json_is_array(root->json)) return *root;
    if (!json_is_array(list.json)) crm_fault(problems, &list, "must be an array of pairs");
    return list;
}

static pair *read_pairs(crm_problems *problems, const json_t *json, int *count)
{
    const crm_node root = crm_root(json);
    const crm_node list = find_pairs(problems, &root);
    const int n = crm_length(&list);
    pair *pairs = crm_resize(NULL, (size_t)n, sizeof *pairs);
    for (int i = 0; i < n; i++) {
        const crm_node item = crm_item(&list, i);
        read_pair(problems, &item, &pairs[i]);
    }
    *count = n;
    return pairs;
}

static int write_pairs(const crm_arguments *a, const pair *pairs, int count)
{
    crm_output out;
    if (!crm_output_open(&out, crm_argument(a, "--out"))) return CRM_USAGE;
    for (int i = 0; i < count; i++) put_pair(&out, i, &pairs[i]);
    return crm_output_close(&out) ? CRM_DONE : CRM_FAILED;
}

static int run(const crm_arguments *a)
{
    crm_problems problems = crm_problems_of(a->files[0]);
    json_t *json = crm_json_load(&problems);
    int count = 0;
    pair *pairs = json ? read_pairs(&problems, json, &count) : NULL;
    const int code = crm_faulty(&problems) ? CRM_USAGE : write_pairs(a, pairs, count);
    crm_print_problems(&problems);
    for (int i = 0; i < count; i++) {
        crm_shape_free(&pairs[i].a);
        crm_shape_free(&pairs[i].b);
    }
    free(pairs);
    json_decref(json);
    crm_problems_free(&problems);
    return code;
}

static const crm_option options[] = {{"--out", CRM_TAKES_VALUE}, {NULL, 0}};

const crm_command crm_command_contact = {
    "contact",
    "contact PAIRS [--out FILE]",
    "distance, normal and contact points of pairs of shapes, one JSON line each",
    "PAIRS: {\"vectors\": [{\"id\", \"A\", \"poseA\", \"B\", \"poseB\"}, ...]}; other keys are not "
    "read.\nShapes as in a scene, poses [angle, x, y]; \"-\" reads standard input.\n",
    options,
    1,
    1,
    run};
