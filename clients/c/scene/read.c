#include "scene.h"

#include "body.h"
#include "joint.h"

#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char *const scene_keys[] = {"format", "name",     "gravity", "dt",     "duration",
                                         "sample", "settings", "bodies",  "joints", NULL};

static void check_format(crm_problems *problems, const crm_node *root)
{
    const crm_node format = crm_member(root, "format");
    const char *text = NULL;
    if (!format.json) {
        crm_fault(problems, &format, "must be given: \"carom-scene/1\"");
    } else if (crm_get_text(problems, &format, &text) && strcmp(text, "carom-scene/1") != 0) {
        crm_fault(problems, &format, "is \"%.40s\"; this program reads \"carom-scene/1\"", text);
    }
}

/* One setting by name: the value as the text that --set would get. */
static void read_setting(crm_problems *problems, const crm_node *node,
                         carom_world_settings *settings)
{
    char text[64];
    const char *reason = NULL;
    if (json_is_string(node->json)) {
        snprintf(text, sizeof text, "%s", json_string_value(node->json));
    } else if (json_is_number(node->json)) {
        snprintf(text, sizeof text, "%.17g", json_number_value(node->json));
    } else if (json_is_boolean(node->json)) {
        snprintf(text, sizeof text, "%d", json_is_true(node->json) ? 1 : 0);
    } else {
        crm_fault(problems, node, "must be a number or a word");
        return;
    }
    if (carom_world_settings_set(settings, node->key, text, &reason) < 0) {
        crm_fault(problems, node, "%s", reason ? reason : "is not accepted");
    }
}

static void read_settings(crm_problems *problems, const crm_node *root,
                          carom_world_settings *settings)
{
    const crm_node at = crm_member(root, "settings");
    const crm_node dt = crm_member(root, "dt");
    if (!at.json) return;
    if (!json_is_object(at.json)) {
        crm_fault(problems, &at, "must be an object {name: value, ...}");
        return;
    }
    const char *key;
    json_t *value;
    json_object_foreach((json_t *)at.json, key, value)
    {
        const crm_node item = {value, &at, key, 0};
        if (key[0] == '_' || strcmp(key, "reference") == 0) continue;
        if (strcmp(key, "dt") == 0 && dt.json) {
            crm_fault(problems, &item, "dt also stands at the top; keep one of them");
        } else if (strcmp(key, "gravity") == 0) {
            crm_fault(problems, &item, "gravity stands at the top of the file, not here");
        } else {
            read_setting(problems, &item, settings);
        }
    }
}

static void read_times(crm_problems *problems, const crm_node *root, crm_scene *scene)
{
    const crm_node dt = crm_member(root, "dt");
    const crm_node duration = crm_member(root, "duration");
    const crm_node sample = crm_member(root, "sample");
    crm_get_number(problems, &dt, &scene->settings.dt);
    if (!(scene->settings.dt > 0)) {
        crm_fault(problems, &dt, "must be > 0 [s], is %.17g", scene->settings.dt);
    }
    if (crm_get_number(problems, &duration, &scene->duration) && scene->duration < 0) {
        crm_fault(problems, &duration, "must be >= 0 [s], is %.17g", scene->duration);
    }
    if (crm_get_number(problems, &sample, &scene->sample) && !(scene->sample > 0)) {
        crm_fault(problems, &sample, "must be > 0 [s], is %.17g", scene->sample);
    }
}

/* The array under `key`, absent or not; NULL with a fault when it is something else. */
static int array_length(crm_problems *problems, const crm_node *array, int needed)
{
    if (json_is_array(array->json)) return crm_length(array);
    if (array->json || needed) crm_fault(problems, array, "must be an array [...]");
    return 0;
}

static void read_bodies(crm_problems *problems, const crm_node *root, crm_scene *scene)
{
    const crm_node list = crm_member(root, "bodies");
    const int n = array_length(problems, &list, 1);
    scene->bodies = crm_make(problems, (size_t)n, sizeof *scene->bodies);
    if (!scene->bodies) return;
    scene->n_bodies = n;
    for (int i = 0; i < n; i++) {
        const crm_node item = crm_item(&list, i);
        crm_body_read(problems, &item, &scene->bodies[i]);
    }
}

static void read_joints(crm_problems *problems, const crm_node *root, crm_scene *scene)
{
    const crm_node list = crm_member(root, "joints");
    const int n = array_length(problems, &list, 0);
    scene->joints = crm_make(problems, (size_t)n, sizeof *scene->joints);
    if (!scene->joints) return;
    scene->n_joints = n;
    for (int i = 0; i < n; i++) {
        const crm_node item = crm_item(&list, i);
        crm_joint_read(problems, &item, scene, &scene->joints[i]);
    }
}

static void read_all(crm_problems *problems, crm_scene *scene)
{
    const crm_node root = crm_root(scene->json);
    if (!crm_check_keys(problems, &root, scene_keys)) return;
    const crm_node name = crm_member(&root, "name");
    const crm_node gravity = crm_member(&root, "gravity");
    check_format(problems, &root);
    crm_get_text(problems, &name, &scene->name);
    crm_get_numbers(problems, &gravity, 2, scene->settings.gravity);
    read_settings(problems, &root, &scene->settings);
    read_times(problems, &root, scene);
    read_bodies(problems, &root, scene);
    read_joints(problems, &root, scene);
}

crm_scene *crm_scene_read(crm_problems *problems)
{
    json_t *json = crm_json_load(problems);
    if (!json) return NULL;
    crm_scene *scene = crm_make(problems, 1, sizeof *scene);
    if (!scene) {
        json_decref(json);
        return NULL;
    }
    scene->settings = carom_world_defaults();
    scene->duration = -1;
    scene->sample = -1;
    scene->json = json;
    read_all(problems, scene);
    if (!crm_faulty(problems)) return scene;
    crm_scene_free(scene);
    return NULL;
}

void crm_scene_free(crm_scene *scene)
{
    if (!scene) return;
    for (int i = 0; i < scene->n_bodies; i++) crm_body_free(&scene->bodies[i]);
    free(scene->bodies);
    free(scene->joints);
    json_decref(scene->json);
    free(scene);
}
