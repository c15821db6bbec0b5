#include "cmd.h"
#include "io/load.h"
#include "io/memory.h"
#include "io/output.h"
#include "io/progress.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Pairs of bodies that the broadphase never sees, by reason. */
typedef struct pairs {
    double all;
    double silent;   /* one of them has no shape or collide = false */
    double unmoving; /* neither is dynamic */
    double joined;   /* pinned together */
    double filtered; /* by category, mask or group */
} pairs;

static double choose2(double n)
{
    return n > 1 ? n * (n - 1) / 2 : 0;
}

static int can_touch(const carom_body_def *b)
{
    return b->collide && b->n_shapes > 0;
}

/* Rule of carom_filter. */
static int filter_allows(const carom_filter *a, const carom_filter *b)
{
    if (a->group == b->group && a->group != 0) return a->group > 0;
    return (a->category & b->mask) && (b->category & a->mask);
}

static int is_filtered(const crm_scene *s, int i, int j)
{
    const carom_body_def *a = &s->bodies[i].def;
    const carom_body_def *b = &s->bodies[j].def;
    if (!can_touch(a) || !can_touch(b)) return 0;
    if (a->type != CAROM_DYNAMIC && b->type != CAROM_DYNAMIC) return 0;
    return !filter_allows(&a->filter, &b->filter);
}

/* Filters are rare: the loop over all pairs is for scenes that have one. */
static double count_filtered(const crm_scene *s)
{
    const carom_filter plain = carom_body_defaults().filter;
    int any = 0;
    for (int i = 0; i < s->n_bodies; i++) {
        any |= memcmp(&s->bodies[i].def.filter, &plain, sizeof plain) != 0;
    }
    double n = 0;
    for (int i = 0; any && i < s->n_bodies; i++) {
        for (int j = i + 1; j < s->n_bodies; j++) n += is_filtered(s, i, j);
    }
    return n;
}

static double count_joined(const crm_scene *s)
{
    double n = 0;
    for (int k = 0; k < s->n_joints; k++) {
        const carom_joint_def *j = &s->joints[k];
        n += !j->collide && can_touch(&s->bodies[j->body_a].def) &&
             can_touch(&s->bodies[j->body_b].def);
    }
    return n;
}

static pairs count_pairs(const crm_scene *s)
{
    int touching = 0;
    int unmoving = 0;
    for (int i = 0; i < s->n_bodies; i++) {
        if (!can_touch(&s->bodies[i].def)) continue;
        touching++;
        unmoving += s->bodies[i].def.type != CAROM_DYNAMIC;
    }
    pairs p;
    p.all = choose2(s->n_bodies);
    p.silent = p.all - choose2(touching);
    p.unmoving = choose2(unmoving);
    p.joined = count_joined(s);
    p.filtered = count_filtered(s);
    return p;
}

static void row(FILE *f, const char *title, double count, const char *note)
{
    fprintf(f, "  %-18s %10.0f  %s\n", title, count, note);
}

static void explain_needs(FILE *f, const carom_world_size *z, const carom_step_stats *stats)
{
    char note[160];
    snprintf(note, sizeof note, "%d dynamic, %d static, %d kinematic", z->n_dynamic, z->n_static,
             z->n_kinematic);
    row(f, "bodies", z->n_dynamic + z->n_static + z->n_kinematic, note);
    snprintf(note, sizeof note, "%d vertices", z->n_vertices);
    row(f, "shapes", z->n_shapes, note);
    snprintf(note, sizeof note, "%d rows", z->n_joint_rows);
    row(f, "joints", z->n_joints, note);
    row(f, "candidate pairs", stats->n_candidates, "boxes touch");
    row(f, "contacts", z->n_contacts, "points, in the last sub-step");
    row(f, "friction rows", z->n_friction, "contacts whose pair has friction");
    snprintf(note, sizeof note, "3 per moving body; with multipliers %d rows",
             z->n_unknowns + z->n_joint_rows + z->n_contacts + z->n_friction);
    row(f, "velocities", z->n_unknowns, note);
    if (z->factor.nonzeros > 0) {
        snprintf(note, sizeof note, "nonzeros of the islands' factors with fill; %.3g flops",
                 z->factor.flops);
        row(f, "factor", z->factor.nonzeros, note);
    }
    snprintf(note, sizeof note, "bytes held; at most %zu", z->bytes_high);
    row(f, "memory", (double)z->bytes, note);
}

static void plan_row(FILE *f, const char *title, int needed, const char *yes, const char *no)
{
    fprintf(f, "  %-18s %10s  %s\n", title, needed ? "yes" : "-", needed ? yes : no);
}

static void explain_plan(FILE *f, const carom_plan *p)
{
    fprintf(f, "\nplan\n");
    plan_row(f, "contacts", p->contacts, "bodies may meet: pairs are sought in each step",
             "no two bodies may ever meet: no boxes, no pairs");
    plan_row(f, "hulls", p->hulls, "shapes with edges may meet",
             "never two shapes with edges: no search of features, no clipping");
    plan_row(f, "friction", p->friction, "contacts get tangential rows", "no tangential rows");
    plan_row(f, "restitution", p->restitution, "contacts or limits bounce",
             "all impacts are plastic");
    plan_row(f, "joints", p->joints, "joint rows and their corrections", "no border, no drift");
    plan_row(f, "limits", p->limits, "joints have limits", "no joint has limits");
    plan_row(f, "springs, motors", p->drives, "joints have springs or motors", "no such forces");
    plan_row(f, "damping", p->damping, "bodies are damped", "no body is");
    plan_row(f, "contact solver", p->solver, "a problem is solved where something touches or holds",
             "motion is free: no solve, no matrix");
    plan_row(f, "located impacts", p->located, "times of impacts are sought",
             "nothing is sought within a step");
    plan_row(f, "located changes", p->changes, "times at which contacts open or begin to slip",
             "no such times are sought");
    plan_row(f, "higher order", p->extrapolated, "sub-steps are extrapolated", "order 2, or 1");
    plan_row(f, "sensors", p->sensors, "seen by queries alone", "none");
    plan_row(f, "sleep", p->sleep, "islands at rest are not run",
             "all islands are run in each step");
    plan_row(f, "threads", p->threads, "islands are shared among threads", "one thread");
}

static void explain_pairs(FILE *f, const pairs *p)
{
    row(f, "pairs", p->silent, "one of the two has no shape, or collide is false");
    row(f, "pairs", p->unmoving, "neither body is dynamic");
    row(f, "pairs", p->joined, "joined bodies do not collide with each other");
    if (p->filtered > 0) row(f, "pairs", p->filtered, "excluded by their filters");
}

static void explain_left_out(FILE *f, const crm_run *run, const carom_world_size *z,
                             const carom_step_stats *stats)
{
    const pairs p = count_pairs(run->scene);
    const double seen = p.all - p.silent - p.unmoving - p.joined - p.filtered;
    fprintf(f, "\nleft out\n");
    explain_pairs(f, &p);
    row(f, "pairs", seen - stats->n_candidates, "their boxes are apart");
    row(f, "unknowns", 3.0 * (z->n_static + z->n_kinematic),
        "velocities of static and kinematic bodies are given");
    row(f, "friction rows", z->n_contacts - z->n_friction,
        z->n_contacts ? "contacts without friction have no tangential row" : "there is no contact");
    if (z->n_joints == 0) row(f, "joint rows", 0, "no joint: the matrix has no border");
    if (z->n_contacts == 0) {
        fprintf(f, "  complementarity: no contact in this step, so its motion is %s\n",
                z->n_joints ? "one linear solve" : "given without any solve");
    }
}

static void explain_cost(FILE *f, const crm_run *run, const carom_step_stats *stats, double seconds)
{
    fprintf(f, "\nfirst step\n  %s (%s), residual %.3g\n", carom_status_name(stats->status),
            carom_status_text(stats->status), stats->residual);
    fprintf(f, "  %d sub-steps, %d impacts, %d factorizations, %d iterations, %.3g ms\n",
            stats->n_substeps, stats->n_events, stats->factorizations, stats->iterations,
            1e3 * seconds);
    fprintf(f,
            "expected cost\n  %ld steps of %.9g s, about %.3g s in all if every step is like the "
            "second one;\n  contacts that form later cost more\n",
            run->n_steps, run->scene->settings.dt, (double)run->n_steps * seconds);
}

/* A first step to warm up (it allocates), a second to time: both on a world of their own. */
static carom_status dry_steps(const crm_run *run, carom_world *w, carom_step_stats *stats,
                              carom_world_size *size, double *seconds)
{
    double *force = crm_resize(NULL, 3 * (size_t)run->scene->n_bodies, sizeof *force);
    const double dt = run->scene->settings.dt;
    memset(stats, 0, sizeof *stats);
    const int forced = crm_scene_force(run->scene, 0, dt, force);
    const carom_status s = carom_world_step(w, forced ? force : NULL, stats);
    *size = carom_world_measure(w);
    const double start = crm_clock();
    if (s >= 0) carom_world_step(w, forced ? force : NULL, NULL);
    *seconds = crm_clock() - start;
    free(force);
    stats->status = s;
    return s;
}

static int explain(const crm_arguments *a, const crm_run *run)
{
    crm_output out;
    carom_plan plan;
    carom_step_stats stats;
    carom_world_size size;
    double seconds = 0;
    carom_world *w = crm_run_world(run);
    if (!w) return CRM_USAGE;
    plan = carom_world_plan(w);
    const carom_status s = dry_steps(run, w, &stats, &size, &seconds);
    if (s < 0) {
        fprintf(stderr, "%s: the first step failed: %s: %s %s\n", run->file, carom_status_name(s),
                carom_status_text(s), carom_world_error(w));
    }
    carom_world_destroy(w);
    if (!crm_output_open(&out, crm_argument(a, "--out"))) return CRM_USAGE;
    fprintf(out.file, "%s\n\nneeds\n", crm_run_name(run));
    explain_needs(out.file, &size, &stats);
    explain_plan(out.file, &plan);
    explain_left_out(out.file, run, &size, &stats);
    explain_cost(out.file, run, &stats, seconds);
    return crm_output_close(&out) && s >= 0 ? CRM_DONE : CRM_FAILED;
}

static int run(const crm_arguments *a)
{
    crm_run plan;
    int code = crm_load(a, &plan);
    if (code != CRM_DONE) return code;
    code = explain(a, &plan);
    crm_unload(&plan);
    return code;
}

static const crm_option options[] = {CRM_LOAD_OPTIONS, {"--out", CRM_TAKES_VALUE}, {NULL, 0}};

const crm_command crm_command_explain = {
    "explain",
    "explain SCENE [--dt H] [--set KEY=VALUE]... [--out FILE]",
    "what a scene needs, what is left out and why, what it will cost: counted in one dry step",
    CRM_LOAD_HELP "  --out FILE         where the text goes, standard output otherwise\n",
    options,
    1,
    1,
    run};
