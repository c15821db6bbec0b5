#include "gradient/gradient.h"

#include "io/memory.h"
#include "io/progress.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const char *const crm_wrt_names[CRM_N_WRT + 1] = {
    "q0",     "v0",       "mass",    "inertia", "friction", "restitution", "gravity",
    "radius", "vertices", "anchors", "force",   "dt",       NULL};

void crm_gradient_prepare(crm_gradient *g, const crm_scene *scene)
{
    const int n = scene->n_bodies;
    int n_shapes = 0;
    int n_vertices = 0;
    for (int i = 0; i < n; i++) {
        const carom_body_def *def = &scene->bodies[i].def;
        n_shapes += def->n_shapes;
        for (int k = 0; k < def->n_shapes; k++) n_vertices += def->shapes[k].count;
    }
    const int count[CRM_N_WRT] = {
        3 * n, 3 * n, n, n, n, n, 2, n_shapes, 2 * n_vertices, 4 * scene->n_joints, 3 * n, 1};
    memset(g, 0, sizeof *g);
    for (int a = 0; a < CRM_N_WRT; a++) {
        g->count[a] = count[a];
        g->x[a] = crm_resize(NULL, (size_t)count[a], sizeof(double));
        memset(g->x[a], 0, (size_t)count[a] * sizeof(double));
    }
}

void crm_gradient_free(crm_gradient *g)
{
    for (int a = 0; a < CRM_N_WRT; a++) free(g->x[a]);
    free(g->kinks);
    memset(g, 0, sizeof *g);
}

/* Forward on the tape; the loss grows with the steps.  CRM_DONE, or CRM_FAILED with a message. */
static int run_forward(crm_gradient *g, const crm_run *run, const crm_loss *loss, carom_world *w,
                       carom_tape *tape, int quiet)
{
    double *force = crm_resize(NULL, 3 * (size_t)run->scene->n_bodies, sizeof *force);
    carom_status s = CAROM_OK;
    crm_progress bar = crm_progress_start("forward", quiet);
    const double start = crm_clock();
    g->loss = crm_loss_at(loss, 0, carom_world_q(w), carom_world_v(w));
    while (s >= 0 && carom_world_steps(w) < run->n_steps && !crm_interrupted()) {
        const int forced =
            crm_scene_force(run->scene, carom_world_time(w), run->scene->settings.dt, force);
        s = carom_tape_step(tape, forced ? force : NULL, NULL);
        if (s < 0) break;
        g->loss += crm_loss_at(loss, carom_world_steps(w), carom_world_q(w), carom_world_v(w));
        crm_progress_show(&bar, (double)carom_world_steps(w), (double)run->n_steps);
    }
    g->seconds_forward = crm_clock() - start;
    crm_progress_end(&bar);
    free(force);
    const long k = carom_world_steps(w);
    if (s >= 0 && k == run->n_steps) return CRM_DONE;
    if (s < 0) {
        fprintf(stderr, "%s: step %ld (t = %.9g s) failed: %s: %s %s\n", run->file, k + 1,
                carom_world_time(w), carom_status_name(s), carom_status_text(s),
                carom_world_error(w));
    } else {
        fprintf(stderr, "%s: interrupted after step %ld of %ld; there is no gradient\n", run->file,
                k, run->n_steps);
    }
    return CRM_FAILED;
}

/* Mass and inertia are always computed: the chain through the shapes needs them. */
static carom_gradient engine_arrays(const crm_gradient *g)
{
    carom_gradient out;
    memset(&out, 0, sizeof out);
    const int *w = g->wanted;
    out.q0 = w[CRM_Q0] ? g->x[CRM_Q0] : NULL;
    out.v0 = w[CRM_V0] ? g->x[CRM_V0] : NULL;
    out.mass = g->x[CRM_MASS];
    out.inertia = g->x[CRM_INERTIA];
    out.friction = w[CRM_FRICTION] ? g->x[CRM_FRICTION] : NULL;
    out.restitution = w[CRM_RESTITUTION] ? g->x[CRM_RESTITUTION] : NULL;
    out.gravity = w[CRM_GRAVITY] ? g->x[CRM_GRAVITY] : NULL;
    out.force = w[CRM_FORCE] ? g->x[CRM_FORCE] : NULL;
    out.dt = w[CRM_DT] ? g->x[CRM_DT] : NULL;
    out.radius = w[CRM_RADIUS] ? g->x[CRM_RADIUS] : NULL;
    out.vertices = w[CRM_VERTICES] ? (carom_vec2 *)(void *)g->x[CRM_VERTICES] : NULL;
    out.anchors = w[CRM_ANCHORS] ? (carom_vec2 *)(void *)g->x[CRM_ANCHORS] : NULL;
    return out;
}

static int run_backward(crm_gradient *g, const crm_run *run, const crm_loss *loss, carom_tape *tape)
{
    crm_loss_bars bars = crm_loss_cotangents(loss, tape, run->scene->n_bodies);
    const carom_gradient out = engine_arrays(g);
    carom_gradient_stats stats;
    memset(&stats, 0, sizeof stats);
    const double start = crm_clock();
    carom_tape_smooth(tape, g->smoothing);
    const carom_status s = carom_tape_gradient(tape, bars.count, bars.bars, &out, &stats);
    g->seconds_backward = crm_clock() - start;
    g->degenerate = stats.degenerate;
    g->unsmoothed = stats.unsmoothed;
    crm_loss_bars_free(&bars);
    if (s < 0) {
        fprintf(stderr, "%s: the reverse pass failed: %s: %s\n", run->file, carom_status_name(s),
                carom_status_text(s));
        return CRM_FAILED;
    }
    crm_scene_chain(run->scene, out.mass, out.inertia, out.radius, out.vertices);
    return CRM_DONE;
}

/* All kinks by name; without memory or a walk none. */
static void name_kinks(crm_gradient *g, carom_tape *tape)
{
    if (carom_tape_kinks(tape, 0, NULL, &g->n_kinks) < 0) g->n_kinks = 0;
    g->kinks = crm_resize(NULL, (size_t)g->n_kinks, sizeof *g->kinks);
    carom_tape_kinks(tape, g->n_kinks, g->kinks, &g->n_kinks);
}

int crm_gradient_compute(crm_gradient *g, const crm_run *run, const crm_loss *loss, int quiet)
{
    carom_tape *tape = NULL;
    carom_world *w = crm_run_world(run);
    if (!w) return CRM_USAGE;
    const carom_status s = carom_tape_create(w, NULL, &tape);
    int code = CRM_FAILED;
    if (s < 0) {
        fprintf(stderr, "%s: no tape: %s\n", run->file, carom_status_text(s));
    } else {
        code = run_forward(g, run, loss, w, tape, quiet);
    }
    if (code == CRM_DONE) code = run_backward(g, run, loss, tape);
    if (code == CRM_DONE && g->name_kinks) name_kinks(g, tape);
    carom_tape_destroy(tape);
    carom_world_destroy(w);
    return code;
}
