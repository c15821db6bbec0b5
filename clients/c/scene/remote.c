#include "remote.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { SETTING_BYTES = 32 };

/* The field as a number after the text was set; 0: the text is refused. */
static int read_back(const char *name, const char *text, double *value)
{
    carom_world_settings probe = carom_world_defaults();
    if (carom_world_settings_set(&probe, name, text, NULL) < 0) return 0;
#define READ(field, type, preset, unit, meaning)                                                   \
    if (strcmp(name, #field) == 0) *value = (double)probe.field;
    CAROM_WORLD_SETTINGS(READ)
#undef READ
    return 1;
}

void crm_setting_text(const char *name, double value, const char *words, char *text, size_t size)
{
    double back = 0;
    snprintf(text, size, "%.17g", value);
    if (read_back(name, text, &back)) return;
    while (*words) {
        const size_t n = strcspn(words, ", ");
        snprintf(text, size, "%.*s", (int)n, words);
        if (n > 0 && read_back(name, text, &back) && !(back < value) && !(back > value)) return;
        words += n + strspn(words + n, ", ");
    }
}

/* Names and values of all settings. */
static void put_settings(const carom_world_settings *settings, carom_client_scene *out)
{
    const char **names = NULL;
    char **values = NULL;
    size_t n = 0;
#define PUT(name, type, preset, unit, text)                                                        \
    names = crm_resize(names, n + 1, sizeof *names);                                               \
    values = crm_resize(values, n + 1, sizeof *values);                                            \
    names[n] = #name;                                                                              \
    values[n] = crm_resize(NULL, SETTING_BYTES, 1);                                                \
    crm_setting_text(#name, (double)settings->name, text, values[n++], SETTING_BYTES);
    CAROM_WORLD_SETTINGS(PUT)
#undef PUT
    out->n_settings = (int)n;
    out->setting_names = names;
    out->setting_values = (const char *const *)values;
}

carom_client_scene crm_scene_client(const crm_scene *scene)
{
    const size_t nb = (size_t)scene->n_bodies;
    const size_t nj = (size_t)scene->n_joints;
    carom_client_scene out;
    memset(&out, 0, sizeof out);
    carom_body_def *bodies = crm_resize(NULL, nb, sizeof *bodies);
    const char **names = crm_resize(NULL, nb, sizeof *names);
    carom_client_joint *joints = crm_resize(NULL, nj, sizeof *joints);
    for (size_t i = 0; i < nb; i++) {
        bodies[i] = scene->bodies[i].def;
        names[i] = scene->bodies[i].name ? scene->bodies[i].name : "";
    }
    for (size_t k = 0; k < nj; k++) {
        joints[k].body_a = scene->joints[k].body_a;
        joints[k].body_b = scene->joints[k].body_b;
        joints[k].anchor = scene->joints[k].anchor;
    }
    put_settings(&scene->settings, &out);
    out.name = scene->name;
    memcpy(out.gravity, scene->settings.gravity, sizeof out.gravity);
    out.n_bodies = scene->n_bodies;
    out.bodies = bodies;
    out.body_names = names;
    out.n_joints = scene->n_joints;
    out.joints = joints;
    return out;
}

void crm_scene_client_free(carom_client_scene *scene)
{
    for (int k = 0; k < scene->n_settings; k++)
        free((char *)scene->setting_values[k]); /* our own */
    free((void *)scene->setting_values);
    free((void *)scene->setting_names);
    free((void *)scene->bodies);
    free((void *)scene->body_names);
    free((void *)scene->joints);
    memset(scene, 0, sizeof *scene);
}
