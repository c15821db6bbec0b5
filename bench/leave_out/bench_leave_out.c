/* What was left out: scenes as they are, and once more with what they leave out kept alive though
 * the motion needs none of it.  Instructions per step and functions entered are callgrind's
 * (without valgrind: left empty), microseconds are the least of several rounds in one run, bytes of
 * messages those of the scene and of a state as caromd exchanges them.
 *
 * Usage: bench_leave_out [--quick]    CSV to standard output, progress to standard error.
 *        bench_leave_out CASE KEPT STEPS    runs one form: what callgrind looks at. */
#include "bench/solver/clock.h"
#include "profile.h"
#include "scenes.h"

#ifdef WITH_MESSAGES
#include "carom_scene_t.h"
#include "carom_state_t.h"
#endif

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { ROUNDS = 7, FEW = 5 };

typedef struct form {
    double microseconds, instructions; /* per step */
    double factorizations;             /* per step */
    size_t bytes;                      /* of the world */
    int scene_bytes, state_bytes;      /* of messages; -1: not known */
    profile profile;
    carom_plan plan;
} form;

static void run_steps(const case_scene *c, carom_world *w, int kept, int n, form *f)
{
    carom_tape *tape = NULL;
    if (c->taped && kept && carom_tape_create(w, NULL, &tape)) abort();
    for (int k = 0; k < n; k++) {
        carom_step_stats s;
        const carom_status e =
            tape ? carom_tape_step(tape, NULL, &s) : carom_world_step(w, NULL, &s);
        if (e < 0) abort();
        if (f) f->factorizations += (double)s.factorizations / n;
    }
    if (f && tape) f->bytes += carom_tape_bytes(tape);
    carom_tape_destroy(tape);
}

#ifdef WITH_MESSAGES
static void message_bytes(const carom_world *w, form *f)
{
    const carom_world_size z = carom_world_measure(w);
    carom_scene_t scene;
    carom_state_t state;
    char none[1] = "";
    memset(&scene, 0, sizeof scene);
    memset(&state, 0, sizeof state);
    const int n = carom_world_n_bodies(w);
    char **no_names = malloc(((size_t)n + 1) * sizeof *no_names);
    if (!no_names) abort();
    for (int k = 0; k < n; k++) no_names[k] = none;
    scene.scene_name = none;
    scene.body_name = no_names;
    scene.num_bodies = n;
    scene.num_coords = 3 * n;
    scene.num_shapes = z.n_shapes;
    scene.num_vertex_coords = 2 * z.n_vertices;
    scene.num_joints = z.n_joints;
    scene.num_anchor_coords = 2 * z.n_joints;
    state.num_bodies = n;
    state.num_q = state.num_v = 3 * n;
    state.num_contacts = carom_world_n_contacts(w);
    state.num_contact_coords = 2 * state.num_contacts;
    f->scene_bytes = carom_scene_t_encoded_size(&scene);
    f->state_bytes = carom_state_t_encoded_size(&state);
    free(no_names);
}
#else
static void message_bytes(const carom_world *w, form *f)
{
    (void)w;
    f->scene_bytes = f->state_bytes = -1;
}
#endif

static form measure(const case_scene *c, int kept)
{
    form f;
    memset(&f, 0, sizeof f);
    carom_world *w = c->build(kept);
    f.plan = carom_world_plan(w);
    run_steps(c, w, kept, c->n_steps, &f);
    f.bytes += carom_world_measure(w).bytes;
    message_bytes(w, &f);
    carom_world_destroy(w);
    f.microseconds = HUGE_VAL;
    return f;
}

static void time_round(const case_scene *c, int kept, form *f)
{
    carom_world *w = c->build(kept);
    const double from = cpu_seconds();
    run_steps(c, w, kept, c->n_steps, NULL);
    f->microseconds = fmin(f->microseconds, 1e6 * (cpu_seconds() - from) / c->n_steps);
    carom_world_destroy(w);
}

/* Steps FEW + 1 .. n_steps, and all functions of the run. */
static void look_inside(const char *self, int k, int kept, const names *library, form *f)
{
    char command[2048];
    const int n = CASES[k].n_steps;
    snprintf(command, sizeof command, "'%s' %d %d %d", self, k, kept, FEW);
    profile few = profile_of(command, library);
    snprintf(command, sizeof command, "'%s' %d %d %d", self, k, kept, n);
    f->profile = profile_of(command, library);
    f->instructions = (f->profile.instructions - few.instructions) / (n - FEW);
    names_free(&few.entered);
}

static void print_dropped(const carom_plan *p)
{
    const int has[] = {p->contacts, p->hulls,   p->friction,    p->restitution, p->joints,
                       p->limits,   p->drives,  p->damping,     p->solver,      p->located,
                       p->sensors,  p->threads, p->extrapolated};
    static const char *const words[] = {
        "contacts", "hulls",  "friction", "restitution", "joints",  "limits",      "drives",
        "damping",  "solver", "located",  "sensors",     "threads", "extrapolated"};
    for (size_t k = 0; k < sizeof has / sizeof has[0]; k++) {
        if (!has[k]) printf("%s ", words[k]);
    }
}

/* Functions that only the second form enters. */
static void print_spared(const form *f)
{
    int n = 0;
    for (int k = 0; k < f[1].profile.entered.n; k++) {
        const char *name = f[1].profile.entered.list[k];
        if (names_have(&f[0].profile.entered, name)) continue;
        printf(n++ ? " %s" : "%s", name);
    }
}

static void print_case(const case_scene *c, const form *f, const names *library)
{
    printf("%s,%s,", c->name, c->kept);
    print_dropped(&f[0].plan);
    for (int k = 0; k < 2; k++) {
        printf(",%.3f,", f[k].microseconds);
        if (f[k].profile.instructions > 0) {
            printf("%.0f,%d,%s%s", f[k].instructions, f[k].profile.entered.n,
                   f[k].profile.amd ? "AMD " : "", f[k].profile.ccd ? "libccd" : "");
        } else {
            printf(",,");
        }
        printf(",%.3f,%lu,%d,%d", f[k].factorizations, (unsigned long)f[k].bytes, f[k].scene_bytes,
               f[k].state_bytes);
    }
    printf(",%d,", library->n);
    print_spared(f);
    printf("\n");
    fflush(stdout);
}

static void whole_case(const char *self, int k, const names *library)
{
    const case_scene *c = &CASES[k];
    form f[2];
    for (int kept = 0; kept < 2; kept++) f[kept] = measure(c, kept);
    for (int i = 0; i < ROUNDS; i++) {
        for (int kept = 0; kept < 2; kept++) time_round(c, kept, &f[kept]);
    }
    for (int kept = 0; kept < 2; kept++) look_inside(self, k, kept, library, &f[kept]);
    print_case(c, f, library);
    for (int kept = 0; kept < 2; kept++) names_free(&f[kept].profile.entered);
}

int main(int argc, char **argv)
{
    if (argc == 4) {
        const int k = atoi(argv[1]);
        const int kept = atoi(argv[2]);
        if (k < 0 || k >= N_CASES) return 1;
        carom_world *w = CASES[k].build(kept);
        run_steps(&CASES[k], w, kept, atoi(argv[3]), NULL);
        carom_world_destroy(w);
        return 0;
    }
    const int quick = argc > 1 && !strcmp(argv[1], "--quick");
    names library = library_functions(LIBRARIES);
    printf(
        "scene,kept,dropped,us,instructions,functions,libraries,factorizations,bytes,scene_bytes,"
        "state_bytes,us_kept,instructions_kept,functions_kept,libraries_kept,factorizations_kept,"
        "bytes_kept,"
        "scene_bytes_kept,state_bytes_kept,functions_all,spared\n");
    for (int k = 0; k < N_CASES; k++) {
        if (quick && k % 3 && k != N_CASES - 1) continue;
        fprintf(stderr, "\r%-40s %2d/%d", CASES[k].name, k + 1, N_CASES);
        whole_case(argv[0], k, &library);
    }
    fprintf(stderr, "\n");
    names_free(&library);
    return 0;
}
