#include "scene.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static carom_status add_bodies(const crm_scene *scene, carom_world *w, char *why, size_t size)
{
    for (int i = 0; i < scene->n_bodies; i++) {
        const carom_status s = carom_world_add_body(w, &scene->bodies[i].def, NULL);
        if (s >= 0) continue;
        snprintf(why, size, "bodies[%d]: %s", i, carom_world_error(w));
        return s;
    }
    return CAROM_OK;
}

/* Moves a body by R(angle) d, in the state alone. */
static carom_status move_body(carom_world *w, int body, double dx, double dy)
{
    const size_t n = 3 * (size_t)carom_world_n_bodies(w);
    double *q = malloc(n * sizeof *q);
    if (!q) return CAROM_E_MEMORY;
    memcpy(q, carom_world_q(w), n * sizeof *q);
    const double c = cos(q[3 * body]);
    const double s = sin(q[3 * body]);
    q[3 * body + 1] += c * dx - s * dy;
    q[3 * body + 2] += s * dx + c * dy;
    const carom_status status = carom_world_set_state(w, q, NULL);
    free(q);
    return status;
}

/* The joint is made while its body stands moved by -by: its anchor then lies at +by in the frame.
 */
static carom_status add_shifted(const carom_joint_def *j, const crm_anchor_shift *shift,
                                carom_world *w)
{
    const int body = shift->of_body_b ? j->body_b : j->body_a;
    carom_status s = move_body(w, body, -shift->by.x, -shift->by.y);
    if (s >= 0) s = carom_world_add_joint(w, j, NULL);
    if (s >= 0) s = move_body(w, body, shift->by.x, shift->by.y);
    return s;
}

static carom_status add_joints(const crm_scene *scene, const crm_anchor_shift *shift,
                               carom_world *w, char *why, size_t size)
{
    for (int k = 0; k < scene->n_joints; k++) {
        const carom_joint_def *j = &scene->joints[k];
        const int moved = shift && shift->joint == k;
        const carom_status s = moved ? add_shifted(j, shift, w) : carom_world_add_joint(w, j, NULL);
        if (s >= 0) continue;
        snprintf(why, size, "joints[%d]: %s", k, carom_world_error(w));
        return s;
    }
    return CAROM_OK;
}

static int is_accepted(const carom_world_settings *settings)
{
    carom_world *w = NULL;
    const carom_status s = carom_world_create(settings, NULL, &w);
    carom_world_destroy(w);
    return s != CAROM_E_ARGUMENT;
}

/* The setting that is out of its range by itself; NULL: only their combination is. */
static const char *find_culprit(const carom_world_settings *settings)
{
#define TRY(name, type, value, unit, text)                                                         \
    {                                                                                              \
        carom_world_settings one = carom_world_defaults();                                         \
        one.name = settings->name;                                                                 \
        if (!is_accepted(&one)) return #name;                                                      \
    }
    CAROM_WORLD_SETTINGS(TRY)
#undef TRY
    return NULL;
}

static void explain_settings(const carom_world_settings *settings, char *why, size_t size)
{
    const char *culprit = find_culprit(settings);
    if (culprit) {
        snprintf(why, size, "settings.%s: out of its range; see `carom help settings`", culprit);
    } else {
        snprintf(why, size, "settings: do not fit each other; see `carom help settings`");
    }
}

carom_status crm_scene_world(const crm_scene *scene, const crm_anchor_shift *shift,
                             carom_world **out, char *why, size_t size)
{
    *out = NULL;
    why[0] = '\0';
    carom_world *w = NULL;
    carom_status s = carom_world_create(&scene->settings, NULL, &w);
    if (s < 0) {
        snprintf(why, size, "%s", carom_status_text(s));
        if (s == CAROM_E_ARGUMENT) explain_settings(&scene->settings, why, size);
        return s;
    }
    s = add_bodies(scene, w, why, size);
    if (s >= 0) s = add_joints(scene, shift, w, why, size);
    if (s < 0) {
        carom_world_destroy(w);
        return s;
    }
    *out = w;
    return CAROM_OK;
}

/* Adds the mean over [t0, t1] of the table: row i acts from its time to the next row's. */
static void mean_force(const crm_scene_body *body, double t0, double t1, double *force)
{
    for (int i = 0; i < body->n_rows; i++) {
        const double from = fmax(t0, body->rows[i].time);
        const double to = i + 1 < body->n_rows ? fmin(t1, body->rows[i + 1].time) : t1;
        if (!(to > from)) continue;
        for (int k = 0; k < 3; k++) force[k] += body->rows[i].force[k] * ((to - from) / (t1 - t0));
    }
}

int crm_scene_force(const crm_scene *scene, double t, double dt, double *force)
{
    int any = 0;
    for (int i = 0; i < scene->n_bodies; i++) any |= scene->bodies[i].n_rows > 0;
    if (!any) return 0;
    memset(force, 0, 3 * (size_t)scene->n_bodies * sizeof *force);
    for (int i = 0; i < scene->n_bodies; i++) {
        mean_force(&scene->bodies[i], t, t + dt, &force[3 * i]);
    }
    return 1;
}
