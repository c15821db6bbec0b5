#include "load.h"

#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

/* A sample interval or duration counts as a whole number of steps within this. */
#define WHOLE_TOL 1e-4

void crm_print_problems(const crm_problems *problems)
{
    for (int i = 0; i < problems->count; i++) fprintf(stderr, "%s\n", problems->text[i]);
    if (problems->no_memory) fprintf(stderr, "%s: out of memory\n", problems->file);
}

/* --set KEY=VALUE */
static int apply_setting(const crm_arguments *a, const char *text, carom_world_settings *settings)
{
    char key[64];
    const char *equals = text ? strchr(text, '=') : NULL;
    const char *reason = NULL;
    if (!equals || equals == text || equals - text >= (long)sizeof key) {
        return crm_usage_error(a->command, "--set wants KEY=VALUE, got \"%s\"", text ? text : "");
    }
    memcpy(key, text, (size_t)(equals - text));
    key[equals - text] = '\0';
    if (carom_world_settings_set(settings, key, equals + 1, &reason) >= 0) return CRM_DONE;
    return crm_usage_error(a->command, "--set %s: %s", text, reason ? reason : "not accepted");
}

static int apply_options(const crm_arguments *a, crm_scene *scene)
{
    for (int i = 0; i < a->n_given; i++) {
        const char *value = a->given[i].value;
        if (strcmp(a->given[i].name, "--set") == 0) {
            if (apply_setting(a, value, &scene->settings) != CRM_DONE) return CRM_USAGE;
        } else if (strcmp(a->given[i].name, "--integrator") == 0) {
            const char *reason = NULL;
            if (carom_world_settings_set(&scene->settings, "integrator", value, &reason) < 0) {
                return crm_usage_error(a->command, "--integrator %s: %s", value,
                                       reason ? reason : "not accepted");
            }
        }
    }
    if (!crm_argument_number(a, "--dt", 0, HUGE_VAL, &scene->settings.dt) ||
        !crm_argument_number(a, "--duration", 0, HUGE_VAL, &scene->duration)) {
        return CRM_USAGE;
    }
    if (scene->settings.dt > 0 && scene->settings.dt < HUGE_VAL) return CRM_DONE;
    return crm_usage_error(a->command, "dt must be > 0 [s], is %g", scene->settings.dt);
}

/* Whole number of steps nearest to `time`, at least `least`; a remark when it is none. */
static long whole_steps(const crm_arguments *a, const char *what, double time, double dt,
                        long least)
{
    const double ratio = time / dt;
    const double whole = fmax(floor(ratio + 0.5), (double)least);
    if (fabs(ratio - whole) > WHOLE_TOL * fmax(1, whole) && !crm_argument_given(a, "--quiet")) {
        fprintf(stderr, "carom: %s %.9g s is %.6g steps of %.9g s; taken as %.0f\n", what, time,
                ratio, dt, whole);
    }
    return (long)whole;
}

static int plan_times(const crm_arguments *a, crm_run *run)
{
    const crm_scene *s = run->scene;
    const double dt = s->settings.dt;
    if (s->duration < 0) {
        return crm_usage_error(a->command, "%s: duration: the scene gives none; use --duration T",
                               run->file);
    }
    if (!(s->duration / dt < INT_MAX) || !(s->sample / dt < INT_MAX)) {
        return crm_usage_error(a->command, "%s: more than %d steps of %g s", run->file, INT_MAX,
                               dt);
    }
    run->n_steps = whole_steps(a, "duration", s->duration, dt, 0);
    run->stride = s->sample > 0 ? whole_steps(a, "sample", s->sample, dt, 1) : 1;
    return CRM_DONE;
}

int crm_load(const crm_arguments *arguments, crm_run *run)
{
    crm_problems problems = crm_problems_of(arguments->files[0]);
    memset(run, 0, sizeof *run);
    run->scene = crm_scene_read(&problems);
    run->file = problems.file;
    crm_print_problems(&problems);
    crm_problems_free(&problems);
    if (!run->scene) return CRM_USAGE;
    int code = apply_options(arguments, run->scene);
    if (code == CRM_DONE) code = plan_times(arguments, run);
    if (code != CRM_DONE) crm_unload(run);
    return code;
}

void crm_unload(crm_run *run)
{
    crm_scene_free(run->scene);
    run->scene = NULL;
}

const char *crm_run_name(const crm_run *run)
{
    return run->scene->name ? run->scene->name : run->file;
}

carom_world *crm_run_world(const crm_run *run)
{
    carom_world *world = NULL;
    char why[512];
    carom_status s = crm_scene_world(run->scene, NULL, &world, why, sizeof why);
    if (s >= 0) {
        s = carom_world_seal(world);
        if (s >= 0) return world;
        snprintf(why, sizeof why, "%s", carom_world_error(world));
        carom_world_destroy(world);
    }
    fprintf(stderr, "%s: %s\n", run->file, why[0] ? why : carom_status_text(s));
    return NULL;
}
