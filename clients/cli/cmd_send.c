#include "clients/c/scene/remote.h"
#include "cmd.h"
#include "io/load.h"
#include "io/memory.h"
#include "io/output.h"
#include "io/progress.h"
#include "io/trajectory.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { BATCH = 256 /* steps of one request: what an interruption waits for */ };

/* The run through a server, as its states arrive. */
typedef struct sending {
    const crm_run *run;
    crm_output *out;
    crm_summary summary;
    long written; /* last step in the output, -1: none */
} sending;

static void on_state(void *user, const carom_client_state *state)
{
    sending *s = user;
    const long k = (long)state->step;
    if (k > 0 && k > s->summary.steps) crm_summary_add(&s->summary, &state->stats, 0);
    if (k <= s->written || (k % s->run->stride != 0 && k != s->run->n_steps)) return;
    crm_put_state(s->out, k, state->time, state->n_bodies, state->q, state->v);
    s->written = k;
}

/* Where a run ends early, its last state is no sample. */
static void put_last(sending *s, const carom_client_state *state)
{
    if (!state || state->step <= s->written) return;
    const long k = (long)state->step;
    crm_put_state(s->out, k, state->time, state->n_bodies, state->q, state->v);
    s->written = k;
}

/* One request of `count` steps (0: only the present state). */
static carom_client_code send_steps(carom_client *client, sending *s, long start, int count)
{
    carom_client_run request;
    memset(&request, 0, sizeof request);
    carom_client_force *forces = NULL;
    if (!crm_scene_forces(s->run->scene, start, count, &forces, &request.n_forces)) {
        crm_no_memory();
    }
    request.n_steps = count;
    request.publish_every = 1; /* the summary counts every step */
    request.forces = forces;
    request.on_state = on_state;
    request.user = s;
    const carom_client_code code = carom_client_step(client, &request);
    s->summary.seconds += carom_client_last(client).seconds;
    free(forces);
    return code;
}

static carom_client_code send_all(carom_client *client, sending *s, int quiet)
{
    crm_progress bar = crm_progress_start("send", quiet);
    carom_client_code code = send_steps(client, s, 0, 0);
    for (long k = 0; code >= 0 && k < s->run->n_steps && !crm_interrupted(); k += BATCH) {
        const long left = s->run->n_steps - k;
        code = send_steps(client, s, k, left < BATCH ? (int)left : BATCH);
        crm_progress_show(&bar, (double)k, (double)s->run->n_steps);
    }
    crm_progress_end(&bar);
    return code;
}

static int report_end(const crm_run *run, const carom_client *client, carom_client_code code,
                      long steps)
{
    if (code < 0) {
        fprintf(stderr, "%s: %s\n", run->file, carom_client_error(client));
        return code == CAROM_CLIENT_E_REFUSED ? CRM_USAGE : CRM_FAILED;
    }
    if (steps < run->n_steps) {
        fprintf(stderr, "%s: interrupted after step %ld of %ld; what was computed is written\n",
                run->file, steps, run->n_steps);
        return CRM_FAILED;
    }
    return CRM_DONE;
}

static int send_scene(const crm_arguments *a, const crm_run *run, carom_client *client)
{
    crm_output out;
    carom_client_scene scene;
    if (!crm_scene_client(run->scene, &scene)) crm_no_memory();
    carom_client_code code = carom_client_open(client, &scene);
    crm_scene_client_free(&scene);
    if (code < 0) return report_end(run, client, code, 0);
    if (!crm_output_open(&out, crm_argument(a, "--out"))) return CRM_USAGE;
    sending s;
    memset(&s, 0, sizeof s);
    s.run = run;
    s.out = &out;
    s.written = -1;
    s.summary.allocations_steady = -1; /* not transmitted */
    crm_catch_interrupts();
    crm_put_header(&out, crm_run_name(run), run->scene->n_bodies, run->scene->settings.dt);
    code = send_all(client, &s, crm_argument_given(a, "--quiet"));
    put_last(&s, carom_client_get_state(client));
    crm_put_summary(&out, &s.summary);
    int result = report_end(run, client, code, s.summary.steps);
    if (!crm_output_close(&out)) result = CRM_FAILED;
    return result;
}

static int run(const crm_arguments *a)
{
    crm_run plan;
    int code = crm_load(a, &plan);
    if (code != CRM_DONE) return code;
    carom_client *client = carom_client_create();
    code = CRM_FAILED;
    if (!client) {
        fputs("carom send: out of memory\n", stderr);
    } else if (carom_client_connect(client, crm_argument(a, "--url"), crm_argument(a, "--name")) <
               0) {
        fprintf(stderr, "carom send: %s\n", carom_client_error(client));
    } else {
        code = send_scene(a, &plan, client);
    }
    carom_client_destroy(client);
    crm_unload(&plan);
    return code;
}

static const crm_option options[] = {CRM_LOAD_OPTIONS,
                                     {"--url", CRM_TAKES_VALUE},
                                     {"--name", CRM_TAKES_VALUE},
                                     {"--out", CRM_TAKES_VALUE},
                                     {NULL, 0}};

const crm_command crm_command_send = {
    "send",
    "send SCENE [--url URL] [--name NAME] [--dt H] [--duration T] [--set KEY=VALUE]... [--out "
    "FILE] "
    "[--quiet]",
    "the same as run, computed by a step server (caromd) over LCM",
    "  --url URL          LCM network of the server, " CAROM_CLIENT_URL " otherwise\n"
    "  --name NAME        the one given to caromd with --name\n" CRM_LOAD_HELP
    "  --out FILE         where the trajectory goes, standard output otherwise\n",
    options,
    1,
    1,
    run};
