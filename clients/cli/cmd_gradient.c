#include "cmd.h"
#include "gradient/check.h"
#include "gradient/gradient.h"
#include "io/output.h"
#include "io/progress.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { CHECK_DEFAULT = 20, CHECK_MAX = 1000000 };
static const double SMOOTHING_MAX = 1e300; /* [J] */

/* --wrt a,b,...: all when it is not given. */
static int choose_wanted(const crm_arguments *a, crm_gradient *g)
{
    const char *list = crm_argument(a, "--wrt");
    for (int k = 0; k < CRM_N_WRT; k++) g->wanted[k] = !list;
    while (list) {
        const size_t n = strcspn(list, ",");
        int k = 0;
        while (crm_wrt_names[k] &&
               (strlen(crm_wrt_names[k]) != n || strncmp(crm_wrt_names[k], list, n) != 0)) {
            k++;
        }
        if (k == CRM_N_WRT) {
            return crm_usage_error(
                a->command,
                "--wrt: \"%.*s\" is not known; known are q0, v0, mass, inertia, "
                "friction, restitution, gravity, radius, vertices, anchors, force, dt",
                (int)n, list);
        }
        g->wanted[k] = 1;
        list = list[n] ? list + n + 1 : NULL;
    }
    return CRM_DONE;
}

/* [[x, y], ...] */
static void put_points(crm_output *out, int n, const double *x)
{
    crm_put_raw(out, "[");
    for (int i = 0; i < n; i++) {
        if (i) crm_put_raw(out, ",");
        crm_put_numbers(out, 2, x + 2 * i);
    }
    crm_put_raw(out, "]");
}

/* Per body: the number of its one shape, an array for several, 0 for none. */
static void put_radius(crm_output *out, const crm_scene *scene, const double *x)
{
    crm_put_raw(out, "[");
    for (int i = 0; i < scene->n_bodies; i++) {
        const int n = scene->bodies[i].def.n_shapes;
        if (i) crm_put_raw(out, ",");
        if (n > 1) {
            crm_put_numbers(out, n, x);
        } else {
            crm_put_number(out, n ? x[0] : 0);
        }
        x += n;
    }
    crm_put_raw(out, "]");
}

/* Per body: the points of all its shapes in order. */
static void put_vertices(crm_output *out, const crm_scene *scene, const double *x)
{
    crm_put_raw(out, "[");
    for (int i = 0; i < scene->n_bodies; i++) {
        const carom_body_def *def = &scene->bodies[i].def;
        int n = 0;
        for (int k = 0; k < def->n_shapes; k++) n += def->shapes[k].count;
        if (i) crm_put_raw(out, ",");
        put_points(out, n, x);
        x += 2 * n;
    }
    crm_put_raw(out, "]");
}

/* Per joint: the anchor in the frame of body A and in that of body B. */
static void put_anchors(crm_output *out, int n_joints, const double *x)
{
    crm_put_raw(out, "[");
    for (int i = 0; i < n_joints; i++) {
        if (i) crm_put_raw(out, ",");
        put_points(out, 2, x + 4 * i);
    }
    crm_put_raw(out, "]");
}

static void put_arrays(crm_output *out, const crm_scene *scene, const crm_gradient *g)
{
    int first = 1;
    crm_put_raw(out, "{");
    for (int k = 0; k < CRM_N_WRT; k++) {
        if (!g->wanted[k]) continue;
        crm_put_key(out, first, crm_wrt_names[k]);
        first = 0;
        switch ((crm_wrt)k) {
        case CRM_RADIUS: put_radius(out, scene, g->x[k]); break;
        case CRM_VERTICES: put_vertices(out, scene, g->x[k]); break;
        case CRM_ANCHORS: put_anchors(out, scene->n_joints, g->x[k]); break;
        default: crm_put_numbers(out, g->count[k], g->x[k]); break;
        }
    }
    crm_put_raw(out, "}");
}

static void put_entry(crm_output *out, const crm_gradient *g, const crm_check_entry *e)
{
    crm_put_raw(out, "{");
    crm_put_field(out, 1, "index", e->index);
    crm_put_field(out, 0, "gradient", g->x[e->array][e->index]);
    crm_put_key(out, 0, "steps");
    crm_put_numbers(out, CRM_CHECK_STEPS, e->step);
    crm_put_key(out, 0, "differences");
    crm_put_numbers(out, CRM_CHECK_STEPS, e->difference);
    crm_put_key(out, 0, "sides");
    crm_put_numbers(out, 2, e->side);
    crm_put_field(out, 0, "disagreement", e->disagreement);
    if (e->kink) crm_put_raw(out, ",\"kink\":true");
    if (e->one_sided) crm_put_raw(out, ",\"one_sided\":true");
    crm_put_raw(out, "}");
}

static void put_worst(crm_output *out, const crm_check *c)
{
    if (c->worst < 0) {
        crm_put_raw(out, ",\"largest\":null");
        return;
    }
    const crm_check_entry *e = &c->entries[c->worst];
    crm_put_raw(out, ",\"largest\":{");
    crm_put_field(out, 1, "disagreement", e->disagreement);
    crm_put_key(out, 0, "array");
    crm_put_text(out, crm_wrt_names[e->array]);
    crm_put_field(out, 0, "index", e->index);
    crm_put_raw(out, "}");
}

static void put_check(crm_output *out, const crm_gradient *g, const crm_check *c)
{
    int first = 1;
    int last = -1;
    crm_put_raw(out, ",\"check\":{\"arrays\":{");
    for (int i = 0; i < c->count; i++) {
        if ((int)c->entries[i].array != last) {
            if (!first) crm_put_raw(out, "]");
            crm_put_key(out, first, crm_wrt_names[c->entries[i].array]);
            crm_put_raw(out, "[");
            first = 0;
        } else {
            crm_put_raw(out, ",");
        }
        last = (int)c->entries[i].array;
        put_entry(out, g, &c->entries[i]);
    }
    crm_put_raw(out, first ? "}" : "]}");
    put_worst(out, c);
    crm_put_raw(out, c->interrupted ? ",\"interrupted\":true}" : "}");
}

/* The check in words: the largest disagreement of each array. */
static void print_check(const crm_check *c)
{
    for (int i = 0; i < c->count;) {
        const crm_wrt array = c->entries[i].array;
        int worst = i;
        int n = 0;
        int kinks = 0;
        for (; i < c->count && c->entries[i].array == array; i++, n++) {
            kinks += c->entries[i].kink;
            if (c->entries[i].disagreement > c->entries[worst].disagreement) worst = i;
        }
        fprintf(stderr,
                "check %-12s %3d entries, largest disagreement %.2e at [%d], %d at a kink\n",
                crm_wrt_names[array], n, c->entries[worst].disagreement, c->entries[worst].index,
                kinks);
    }
    if (c->interrupted) fputs("check interrupted; the entries above were checked\n", stderr);
}

static void put_kinks(crm_output *out, const crm_gradient *g)
{
    crm_put_raw(out, ",\"kinks\":[");
    for (int k = 0; k < g->n_kinks; k++) {
        const carom_kink *x = &g->kinks[k];
        const double bodies[2] = {x->body_a, x->body_b};
        crm_put_raw(out, k ? ",{" : "{");
        crm_put_field(out, 1, "step", x->step);
        crm_put_key(out, 0, "bodies");
        crm_put_numbers(out, 2, bodies);
        crm_put_key(out, 0, "kind");
        crm_put_text(out, carom_kink_name(x->kind));
        crm_put_raw(out, "}");
    }
    crm_put_raw(out, "]");
}

static int write_gradient(const crm_arguments *a, const crm_run *run, const crm_gradient *g,
                          const crm_check *check)
{
    crm_output out;
    if (!crm_output_open(&out, crm_argument(a, "--out"))) return CRM_USAGE;
    crm_put_raw(&out, "{");
    crm_put_field(&out, 1, "loss", g->loss);
    crm_put_key(&out, 0, "gradient");
    put_arrays(&out, run->scene, g);
    crm_put_field(&out, 0, "degenerate", g->degenerate);
    if (g->name_kinks) put_kinks(&out, g);
    if (g->smoothing > 0) crm_put_field(&out, 0, "unsmoothed", (double)g->unsmoothed);
    crm_put_field(&out, 0, "seconds_forward", g->seconds_forward);
    crm_put_field(&out, 0, "seconds_backward", g->seconds_backward);
    if (check) put_check(&out, g, check);
    crm_put_raw(&out, "}\n");
    return crm_output_close(&out) ? CRM_DONE : CRM_FAILED;
}

static int check_and_write(const crm_arguments *a, const crm_run *run, const crm_loss *loss,
                           const crm_gradient *g)
{
    if (!crm_argument_given(a, "--check")) return write_gradient(a, run, g, NULL);
    crm_check check;
    double per_array = CHECK_DEFAULT;
    if (!crm_argument_number(a, "--check", 1, CHECK_MAX, &per_array)) return CRM_USAGE;
    const int quiet = crm_argument_given(a, "--quiet");
    crm_check_run(&check, g, run, loss, (int)per_array, quiet);
    if (!quiet) print_check(&check);
    int code = write_gradient(a, run, g, &check);
    if (check.interrupted) code = CRM_FAILED;
    crm_check_free(&check);
    return code;
}

static int differentiate(const crm_arguments *a, const crm_run *run)
{
    crm_problems problems = crm_problems_of(crm_argument(a, "--loss"));
    if (!problems.file) return crm_usage_error(a->command, "needs --loss LOSS");
    crm_loss loss;
    crm_gradient g;
    crm_gradient_prepare(&g, run->scene);
    g.name_kinks = crm_argument_given(a, "--kinks");
    int code = choose_wanted(a, &g);
    if (!crm_argument_number(a, "--smoothing", 0, SMOOTHING_MAX, &g.smoothing)) code = CRM_USAGE;
    if (code == CRM_DONE && !crm_loss_read(&problems, run->scene, run->n_steps, &loss)) {
        code = CRM_USAGE;
        crm_loss_free(&loss);
    } else if (code == CRM_DONE) {
        crm_catch_interrupts();
        code = crm_gradient_compute(&g, run, &loss, crm_argument_given(a, "--quiet"));
        if (code == CRM_DONE) code = check_and_write(a, run, &loss, &g);
        crm_loss_free(&loss);
    }
    crm_print_problems(&problems);
    crm_problems_free(&problems);
    crm_gradient_free(&g);
    return code;
}

static int run(const crm_arguments *a)
{
    crm_run plan;
    int code = crm_load(a, &plan);
    if (code != CRM_DONE) return code;
    code = differentiate(a, &plan);
    crm_unload(&plan);
    return code;
}

static const crm_option options[] = {CRM_LOAD_OPTIONS,
                                     {"--loss", CRM_TAKES_VALUE},
                                     {"--wrt", CRM_TAKES_VALUE},
                                     {"--check", CRM_TAKES_OPTIONAL},
                                     {"--kinks", 0},
                                     {"--smoothing", CRM_TAKES_VALUE},
                                     {"--out", CRM_TAKES_VALUE},
                                     {NULL, 0}};

const crm_command crm_command_gradient = {
    "gradient",
    "gradient SCENE --loss LOSS [--wrt mass,friction,...] [--check[=N]] [--kinks] [--smoothing K] "
    "[--out "
    "FILE]",
    "a loss of the run and its exact gradient, as one JSON object",
    "  --loss LOSS        file with the terms, \"-\" for standard input\n"
    "  --wrt NAMES        of q0, v0, mass, inertia, friction, restitution, gravity, radius,\n"
    "                     vertices, anchors, force, dt; all when not given\n"
    "  --kinks            where derivatives are one-sided: step, bodies and kind\n"
    "  --smoothing K      derivatives at the central path's kappa = K [J] in place of kinks\n"
    "  --check[=N]        N entries of each array (20) beside central differences\n" CRM_LOAD_HELP
    "  --out FILE         where the result goes, standard output otherwise\n",
    options,
    1,
    1,
    run};
