#include "cmd.h"
#include "io/load.h"
#include "io/memory.h"
#include "io/output.h"
#include "io/progress.h"
#include "io/trajectory.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void put_present(crm_output *out, const carom_world *w)
{
    crm_put_state(out, carom_world_steps(w), carom_world_time(w), carom_world_n_bodies(w),
                  carom_world_q(w), carom_world_v(w));
}

/* One step with the forces of its time; the statistics go to the summary. */
static carom_status step_once(const crm_run *run, carom_world *w, double *force,
                              crm_summary *summary)
{
    carom_step_stats stats;
    memset(&stats, 0, sizeof stats);
    const double dt = run->scene->settings.dt;
    const int forced = crm_scene_force(run->scene, carom_world_time(w), dt, force);
    const double start = crm_clock();
    const carom_status s = carom_world_step(w, forced ? force : NULL, &stats);
    stats.status = s;
    crm_summary_add(summary, &stats, crm_clock() - start);
    return s;
}

/* Steps to the end, a failure or an interruption; writes samples and the last state.  Returns the
 * status of the last step. */
static carom_status run_steps(const crm_run *run, carom_world *w, int quiet, crm_output *out,
                              crm_summary *summary)
{
    double *force = crm_resize(NULL, 3 * (size_t)run->scene->n_bodies, sizeof *force);
    crm_progress bar = crm_progress_start("run", quiet);
    carom_status s = CAROM_OK;
    long written = 0;
    put_present(out, w);
    while (s >= 0 && carom_world_steps(w) < run->n_steps && !crm_interrupted()) {
        s = step_once(run, w, force, summary);
        const long k = carom_world_steps(w);
        if (s >= 0 && k % run->stride == 0) {
            put_present(out, w);
            written = k;
        }
        crm_progress_show(&bar, (double)k, (double)run->n_steps);
    }
    if (carom_world_steps(w) != written) put_present(out, w);
    crm_progress_end(&bar);
    free(force);
    return s;
}

/* What ended the run, in words. */
static int report_end(const crm_run *run, const carom_world *w, carom_status s)
{
    const long k = carom_world_steps(w);
    if (s < 0) {
        fprintf(stderr, "%s: step %ld (t = %.9g s) failed: %s: %s %s\n", run->file, k + 1,
                carom_world_time(w), carom_status_name(s), carom_status_text(s),
                carom_world_error(w));
        return CRM_FAILED;
    }
    if (k < run->n_steps) {
        fprintf(stderr, "%s: interrupted after step %ld of %ld; what was computed is written\n",
                run->file, k, run->n_steps);
        return CRM_FAILED;
    }
    return CRM_DONE;
}

static int write_run(const crm_arguments *a, const crm_run *run)
{
    crm_output out;
    carom_world *w = crm_run_world(run);
    if (!w) return CRM_USAGE;
    if (!crm_output_open(&out, crm_argument(a, "--out"))) {
        carom_world_destroy(w);
        return CRM_USAGE;
    }
    crm_summary summary;
    memset(&summary, 0, sizeof summary);
    crm_catch_interrupts();
    crm_put_header(&out, crm_run_name(run), run->scene->n_bodies, run->scene->settings.dt);
    const carom_status s = run_steps(run, w, crm_argument_given(a, "--quiet"), &out, &summary);
    crm_put_summary(&out, &summary);
    int code = report_end(run, w, s);
    if (!crm_output_close(&out)) code = CRM_FAILED;
    carom_world_destroy(w);
    return code;
}

static int run(const crm_arguments *a)
{
    crm_run plan;
    int code = crm_load(a, &plan);
    if (code != CRM_DONE) return code;
    code = write_run(a, &plan);
    crm_unload(&plan);
    return code;
}

static const crm_option options[] = {CRM_LOAD_OPTIONS, {"--out", CRM_TAKES_VALUE}, {NULL, 0}};

const crm_command crm_command_run = {
    "run",
    "run SCENE [--dt H] [--duration T] [--integrator NAME] [--set KEY=VALUE]... [--out FILE] "
    "[--quiet]",
    "steps a scene and writes its trajectory as JSON lines",
    CRM_LOAD_HELP "  --out FILE         where the trajectory goes, standard output otherwise\n",
    options,
    1,
    1,
    run};
