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

/* Names and values of all settings.  0: no memory. */
static int put_settings(const carom_world_settings *settings, carom_client_scene *out)
{
#define ONE(name, type, preset, unit, text) +1
    const size_t size = 0 CAROM_WORLD_SETTINGS(ONE);
#undef ONE
    const char **names = calloc(size, sizeof *names);
    const char **values = calloc(size, sizeof *values);
    char *text = calloc(size, SETTING_BYTES); /* all of them; values[0] */
    int n = 0;
    out->setting_names = names;
    out->setting_values = values;
    if (!names || !values || !text) {
        free(text);
        return 0;
    }
#define PUT(name, type, preset, unit, words)                                                       \
    names[n] = #name;                                                                              \
    values[n] = text + n * SETTING_BYTES;                                                          \
    crm_setting_text(#name, (double)settings->name, words, text + n++ * SETTING_BYTES,             \
                     SETTING_BYTES);
    CAROM_WORLD_SETTINGS(PUT)
#undef PUT
    out->n_settings = n;
    return 1;
}

static int put_bodies(const crm_scene *scene, carom_client_scene *out)
{
    const size_t n = (size_t)scene->n_bodies;
    carom_body_def *bodies = calloc(n + 1, sizeof *bodies);
    const char **names = calloc(n + 1, sizeof *names);
    out->bodies = bodies;
    out->body_names = names;
    if (!bodies || !names) return 0;
    for (size_t i = 0; i < n; i++) {
        bodies[i] = scene->bodies[i].def;
        names[i] = scene->bodies[i].name ? scene->bodies[i].name : "";
    }
    out->n_bodies = scene->n_bodies;
    return 1;
}

int crm_scene_client(const crm_scene *scene, carom_client_scene *out)
{
    memset(out, 0, sizeof *out);
    out->name = scene->name;
    memcpy(out->gravity, scene->settings.gravity, sizeof out->gravity);
    out->joints = scene->joints;
    out->n_joints = scene->n_joints;
    if (put_settings(&scene->settings, out) && put_bodies(scene, out)) return 1;
    crm_scene_client_free(out);
    return 0;
}

void crm_scene_client_free(carom_client_scene *scene)
{
    if (scene->n_settings) free((char *)scene->setting_values[0]); /* our own, as all of these */
    free((void *)scene->setting_values);
    free((void *)scene->setting_names);
    free((void *)scene->bodies);
    free((void *)scene->body_names);
    memset(scene, 0, sizeof *scene);
}

int crm_scene_forces(const crm_scene *scene, int64_t start, int count, carom_client_force **list,
                     int *n)
{
    size_t n_tables = 0;
    *list = NULL;
    *n = 0;
    for (int i = 0; i < scene->n_bodies; i++) n_tables += scene->bodies[i].n_rows > 0;
    if (!n_tables || !count) return 1;
    double *force = malloc(3 * (size_t)scene->n_bodies * sizeof *force);
    *list = malloc(n_tables * (size_t)count * sizeof **list);
    const double dt = scene->settings.dt;
    for (int k = 0; force && *list && k < count; k++) {
        crm_scene_force(scene, (double)(start + k) * dt, dt, force);
        for (int i = 0; i < scene->n_bodies; i++) {
            if (!scene->bodies[i].n_rows) continue;
            carom_client_force *f = &(*list)[(*n)++];
            f->step = k;
            f->body = i;
            memcpy(f->force, &force[3 * i], sizeof f->force);
        }
    }
    free(force);
    if (*n) return 1;
    free(*list);
    *list = NULL;
    return 0;
}
