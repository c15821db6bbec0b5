#include "cmd.h"
#include "io/load.h"
#include "io/output.h"
#include "io/progress.h"
#include "lcp/file.h"

#include <limits.h>
#include <stdio.h>
#include <string.h>

static const char *status_word(carom_status s)
{
    if (s == CAROM_OK) return "solved";
    if (s > 0) return "inexact";
    return s == CAROM_E_INFEASIBLE ? "infeasible" : "failed";
}

static const char *stage_word(carom_contact_stage stage)
{
    switch (stage) {
    case CAROM_STAGE_NONE: return "none";
    case CAROM_STAGE_GUESS: return "guess";
    case CAROM_STAGE_FREE: return "free";
    case CAROM_STAGE_STICK: return "stick";
    case CAROM_STAGE_INTERIOR_POINT: return "interior_point";
    case CAROM_STAGE_SWEEPS: return "sweeps";
    case CAROM_STAGE_LEMKE: return "lemke";
    case CAROM_STAGE_RESTART: return "restart";
    }
    return "unknown";
}

static void put_solution(crm_output *out, const crm_lcp *lcp, const carom_contact_solution *x,
                         const carom_contact_stats *stats, const char *stage, double seconds)
{
    crm_put_raw(out, "{\"name\":");
    crm_put_text(out, lcp->name);
    crm_put_key(out, 0, "status");
    crm_put_text(out, status_word(stats->status));
    crm_put_field(out, 0, "residual", stats->residual);
    crm_put_key(out, 0, "v");
    crm_put_numbers(out, 3 * lcp->n_bodies, x->v);
    crm_put_key(out, 0, "lam_n");
    crm_put_numbers(out, lcp->n_contacts, x->ln);
    crm_put_key(out, 0, "lam_t");
    crm_put_numbers(out, lcp->n_contacts, x->lt);
    crm_put_key(out, 0, "lam_e");
    crm_put_numbers(out, lcp->n_joint_rows, x->le);
    crm_put_field(out, 0, "factorizations", stats->factorizations);
    crm_put_key(out, 0, "stage");
    crm_put_text(out, stage);
    crm_put_field(out, 0, "seconds", seconds);
    crm_put_raw(out, "}\n");
}

static int solve_problem(const crm_lcp *lcp, carom_contact_solver *solver, const char *file,
                         crm_output *out)
{
    carom_contact_solution x = crm_lcp_room(lcp);
    carom_contact_stats stats;
    double seconds = 0;
    memset(&stats, 0, sizeof stats);
    const int fits = crm_lcp_contact(lcp, solver, &x, &stats, &seconds);
    if (!fits) crm_lcp_general(lcp, &x, &stats, &seconds);
    put_solution(out, lcp, &x, &stats, fits ? stage_word(stats.stage) : "general", seconds);
    crm_lcp_room_free(&x);
    if (stats.status >= 0 || stats.status == CAROM_E_INFEASIBLE) return CRM_DONE;
    fprintf(stderr, "%s: %s: %s\n", file, carom_status_name(stats.status),
            carom_status_text(stats.status));
    return CRM_FAILED;
}

static int solve_file(const char *file, carom_contact_solver *solver, crm_output *out)
{
    crm_problems problems = crm_problems_of(file);
    crm_lcp lcp;
    int code = CRM_USAGE;
    if (crm_lcp_read(&problems, &lcp)) code = solve_problem(&lcp, solver, file, out);
    crm_print_problems(&problems);
    crm_problems_free(&problems);
    crm_lcp_free(&lcp);
    return code;
}

/* A wrong file outranks a failed problem; the others are solved all the same. */
static int solve_all(const crm_arguments *a, carom_contact_solver *solver, crm_output *out)
{
    int code = CRM_DONE;
    crm_catch_interrupts();
    crm_progress bar = crm_progress_start("lcp", 0);
    for (int i = 0; i < a->n_files && !crm_interrupted(); i++) {
        const int one = solve_file(a->files[i], solver, out);
        if (one != CRM_DONE && code != CRM_USAGE) code = one;
        crm_progress_show(&bar, i + 1, a->n_files);
        if (crm_interrupted() && i + 1 < a->n_files) {
            fprintf(stderr, "carom lcp: interrupted after %d of %d problems\n", i + 1, a->n_files);
            code = CRM_FAILED;
        }
    }
    crm_progress_end(&bar);
    return code;
}

static int run(const crm_arguments *a)
{
    carom_contact_solver *solver = NULL;
    crm_output out;
    const carom_status s = carom_contact_create(NULL, NULL, &solver);
    if (s < 0) {
        fprintf(stderr, "carom lcp: %s\n", carom_status_text(s));
        return CRM_FAILED;
    }
    int code = CRM_USAGE;
    if (crm_output_open(&out, crm_argument(a, "--out"))) {
        code = solve_all(a, solver, &out);
        if (!crm_output_close(&out)) code = CRM_FAILED;
    }
    carom_contact_destroy(solver);
    return code;
}

static const crm_option options[] = {{"--out", CRM_TAKES_VALUE}, {NULL, 0}};

const crm_command crm_command_lcp = {
    "lcp",
    "lcp PROBLEM... [--out FILE]",
    "solves contact problems, one JSON line each",
    "PROBLEM: {\"name\", \"M\", \"J_c\", \"J_t\", \"J_e\", \"mu\", \"c\", \"q\"}, convention\n"
    "M v - J_c' lam_n - J_t' lam_t - J_e' lam_e + q = 0; status is solved, inexact, infeasible or\n"
    "failed.  Rows that touch more than two bodies go to the general solver (stage general).\n"
    "Exit code 2 when one of the problems failed.\n",
    options,
    1,
    INT_MAX,
    run};
