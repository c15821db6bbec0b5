#include "gradient/check.h"

#include "clients/c/scene/mass.h"
#include "io/memory.h"
#include "io/progress.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Relative step sizes: a truncation error of h^2 against a rounding error of eps/h. */
static const double relative_step[CRM_CHECK_STEPS] = {1e-5, 1e-6};

enum { RUNS = 2 * CRM_CHECK_STEPS /* of one entry: two for each step size */ };

/* Sides that differ by more than this, relative, belong to a kink; their own error is of first
 * order in the step. */
#define KINK_TOL 1e-3

typedef struct checker {
    const crm_gradient *g;
    const crm_run *run;
    const crm_loss *loss;
    double *q, *v; /* initial state of the sealed scene */
    double *p[4];  /* mass, inertia, friction, restitution of the scene */
    double *force; /* scratch, 3 n_bodies */
    double length; /* scale of the scene [m] */
    double weight; /* largest weight [N] */
    crm_progress bar;
    double n_done, n_all; /* steps of all runs */
} checker;

/* Where an entry of a shape array lies. */
typedef struct shape_place {
    int body;
    int shape;  /* of the body */
    int vertex; /* of the shape */
} shape_place;

/* The place of shape `index` (vertices = 0) or of vertex `index`. */
static shape_place find_place(const crm_scene *s, int index, int vertices)
{
    shape_place at = {0, 0, 0};
    for (at.body = 0; at.body < s->n_bodies; at.body++) {
        const carom_body_def *def = &s->bodies[at.body].def;
        for (at.shape = 0; at.shape < def->n_shapes; at.shape++) {
            const int n = vertices ? def->shapes[at.shape].count : 1;
            at.vertex = index;
            if (index < n) return at;
            index -= n;
        }
    }
    return at;
}

/* The number of a shape that entry `index` of radius or vertices stands for. */
static double *shape_number(const crm_scene *s, crm_wrt array, int index, int *body)
{
    const int of_vertices = array == CRM_VERTICES;
    const shape_place at = find_place(s, of_vertices ? index / 2 : index, of_vertices);
    carom_shape *shape = (carom_shape *)&s->bodies[at.body].def.shapes[at.shape]; /* scene's own */
    *body = at.body;
    if (!of_vertices) return &shape->radius;
    carom_vec2 *v = (carom_vec2 *)&shape->vertices[at.vertex];
    return index % 2 ? &v->y : &v->x;
}

/* A world whose shape, anchor or step, if the array is one of these, is changed by delta. */
static carom_world *perturbed_world(const checker *c, crm_wrt array, int index, double delta)
{
    carom_world *w = NULL;
    char why[256];
    crm_anchor_shift shift = {index / 4, (index / 2) % 2, {0, 0}};
    *(index % 2 ? &shift.by.y : &shift.by.x) = delta;
    const int of_shape = array == CRM_RADIUS || array == CRM_VERTICES;
    int body = 0;
    double *x = of_shape ? shape_number(c->run->scene, array, index, &body) : NULL;
    if (array == CRM_DT) x = &c->run->scene->settings.dt;
    const double kept = x ? *x : 0;
    crm_scene_body *b = &c->run->scene->bodies[body];
    const carom_body_def def = b->def;
    if (x) *x += delta;
    if (of_shape && b->def.type == CAROM_DYNAMIC) crm_body_follow(b);
    crm_scene_world(c->run->scene, array == CRM_ANCHORS ? &shift : NULL, &w, why, sizeof why);
    if (x) *x = kept;
    if (of_shape) b->def = def;
    if (w && carom_world_seal(w) >= 0) return w;
    carom_world_destroy(w);
    return NULL;
}

/* Changes one entry of an array of the run's start; parameters of the scene stay as they are. */
static carom_status perturb_start(checker *c, carom_world *w, crm_wrt array, int index,
                                  double delta)
{
    double *x = NULL;
    double gravity[2];
    memcpy(gravity, c->run->scene->settings.gravity, sizeof gravity);
    if (array == CRM_Q0) x = &c->q[index];
    if (array == CRM_V0) x = &c->v[index];
    if (array >= CRM_MASS && array <= CRM_RESTITUTION) x = &c->p[array - CRM_MASS][index];
    if (array == CRM_GRAVITY) x = &gravity[index];
    const double kept = x ? *x : 0;
    if (x) *x += delta;
    /* an inertia that follows from the shape moves with the mass */
    const crm_scene_body *b = &c->run->scene->bodies[array == CRM_MASS ? index : 0];
    double *inertia = array == CRM_MASS && !b->has_inertia ? &c->p[1][index] : NULL;
    if (inertia) *inertia = b->def.inertia * (1 + delta / kept);
    carom_parameters p = {0};
    p.mass = array == CRM_MASS ? c->p[0] : NULL;
    p.inertia = inertia || array == CRM_INERTIA ? c->p[1] : NULL;
    p.friction = array == CRM_FRICTION ? c->p[2] : NULL;
    p.restitution = array == CRM_RESTITUTION ? c->p[3] : NULL;
    p.gravity = array == CRM_GRAVITY ? gravity : NULL;
    carom_status s = carom_world_set_state(w, c->q, c->v);
    if (s >= 0 && array >= CRM_MASS && array <= CRM_GRAVITY) s = carom_world_set_parameters(w, &p);
    if (x) *x = kept;
    if (inertia) *inertia = b->def.inertia;
    return s;
}

/* Loss of the run with one entry changed by delta; NaN when it cannot be computed, or the user does
 * not want it any more. */
static double perturbed_loss(checker *c, crm_wrt array, int index, double delta)
{
    const crm_scene *scene = c->run->scene;
    const double dt = scene->settings.dt;
    carom_world *w = perturbed_world(c, array, index, delta);
    if (!w) return NAN;
    carom_status s = perturb_start(c, w, array, index, delta);
    double loss = crm_loss_at(c->loss, 0, carom_world_q(w), carom_world_v(w));
    long k = 1;
    for (; s >= 0 && k <= c->run->n_steps && !crm_interrupted(); k++) {
        int forced = crm_scene_force(scene, (double)(k - 1) * dt, dt, c->force);
        if (array == CRM_FORCE) {
            if (!forced) memset(c->force, 0, 3 * (size_t)scene->n_bodies * sizeof(double));
            c->force[index] += delta;
            forced = 1;
        }
        s = carom_world_step(w, forced ? c->force : NULL, NULL);
        if (s >= 0) loss += crm_loss_at(c->loss, k, carom_world_q(w), carom_world_v(w));
        crm_progress_show(&c->bar, c->n_done + (double)k, c->n_all);
    }
    c->n_done += (double)c->run->n_steps;
    carom_world_destroy(w);
    return s < 0 || k <= c->run->n_steps ? NAN : loss;
}

/* Difference quotients with step h.  side 0: the central one, and those of both sides; +1 or -1: of
 * second order into that side only. */
static double difference(checker *c, const crm_check_entry *e, double h, int side, double *sides)
{
    const double here = c->g->loss;
    if (side == 0) {
        const double right = perturbed_loss(c, e->array, e->index, h);
        const double left = perturbed_loss(c, e->array, e->index, -h);
        sides[0] = (here - left) / h;
        sides[1] = (right - here) / h;
        return (right - left) / (2 * h);
    }
    const double k = side * h;
    const double once = perturbed_loss(c, e->array, e->index, k);
    const double twice = perturbed_loss(c, e->array, e->index, 2 * k);
    sides[0] = sides[1] = (once - here) / k;
    return (4 * once - twice - 3 * here) / (2 * k);
}

/* The size that a relative step of this entry refers to. */
static double entry_scale(const checker *c, crm_wrt array, int index)
{
    const double *gravity = c->run->scene->settings.gravity;
    int body = 0;
    switch (array) {
    case CRM_Q0: return index % 3 ? c->length : 1;
    case CRM_V0: return fmax(1, fabs(c->v[index]));
    case CRM_MASS:
    case CRM_INERTIA: return c->p[array - CRM_MASS][index];
    case CRM_GRAVITY: return fmax(1, hypot(gravity[0], gravity[1]));
    case CRM_RADIUS:
        return fmax(*shape_number(c->run->scene, array, index, &body), 0.1 * c->length);
    case CRM_VERTICES:
    case CRM_ANCHORS: return c->length;
    case CRM_FORCE: return fmax(1, c->weight);
    case CRM_DT: return c->run->scene->settings.dt;
    default: return 1;
    }
}

/* At a bound of friction or restitution only one side exists. */
static int entry_side(const checker *c, crm_wrt array, int index, double h)
{
    if (array == CRM_RADIUS) {
        int body = 0;
        return *shape_number(c->run->scene, array, index, &body) < h ? 1 : 0;
    }
    if (array != CRM_FRICTION && array != CRM_RESTITUTION) return 0;
    const double x = c->p[array - CRM_MASS][index];
    if (x < h) return 1;
    return array == CRM_RESTITUTION && x > 1 - h ? -1 : 0;
}

/* Body whose type decides whether the entry is a parameter at all; -1: always one. */
static int entry_body(const crm_wrt array, int index)
{
    switch (array) {
    case CRM_V0:
    case CRM_FORCE: return index / 3;
    case CRM_MASS:
    case CRM_INERTIA: return index;
    default: return -1;
    }
}

/* Static bodies have no velocity, and only dynamic ones a mass; inertia that follows is no entry.
 */
static int is_parameter(const crm_scene *scene, crm_wrt array, int index)
{
    const int body = entry_body(array, index);
    if (body < 0) return 1;
    const crm_scene_body *b = &scene->bodies[body];
    if (array == CRM_V0) return b->def.type != CAROM_STATIC;
    if (array == CRM_INERTIA && !b->has_inertia) return 0;
    return b->def.type == CAROM_DYNAMIC;
}

static double array_largest(const crm_gradient *g, crm_wrt array)
{
    double m = 0;
    for (int i = 0; i < g->count[array]; i++) m = fmax(m, fabs(g->x[array][i]));
    return m;
}

/* The sides differ by more than rounding and truncation explain, and one of them is the gradient.
 */
static int is_kink(const crm_check_entry *e, double g, double scale)
{
    const double left = fabs(g - e->side[0]);
    const double right = fabs(g - e->side[1]);
    return fabs(e->side[0] - e->side[1]) > KINK_TOL * scale && fmin(left, right) < KINK_TOL * scale;
}

static void check_entry(checker *c, crm_check_entry *e)
{
    const double g = c->g->x[e->array][e->index];
    const double least =
        fmax(1e-3 * array_largest(c->g, e->array), 1e-4 * fmax(1, fabs(c->g->loss)));
    const double scale = entry_scale(c, e->array, e->index);
    e->disagreement = HUGE_VAL;
    for (int k = 0; k < CRM_CHECK_STEPS; k++) {
        e->step[k] = relative_step[k] * scale;
        const int side = entry_side(c, e->array, e->index, e->step[k]);
        e->one_sided |= side != 0;
        e->difference[k] = difference(c, e, e->step[k], side, e->side);
        const double d = fabs(g - e->difference[k]);
        const double relative = d / fmax(fmax(fabs(g), fabs(e->difference[k])), least);
        if (relative < e->disagreement) e->disagreement = relative;
    }
    e->kink = is_kink(e, g, fmax(fabs(g), least));
}

static uint64_t next_random(uint64_t *state)
{
    *state = *state * 6364136223846793005u + 1442695040888963407u;
    return *state >> 33;
}

static int compare_ints(const void *a, const void *b)
{
    return *(const int *)a - *(const int *)b;
}

/* The entries of one array that are checked, ascending: a seeded choice without repetition. */
static int choose(const checker *c, crm_wrt array, int wanted, int *chosen)
{
    int n = 0;
    for (int i = 0; i < c->g->count[array]; i++) {
        if (is_parameter(c->run->scene, array, i)) chosen[n++] = i;
    }
    uint64_t state = 1 + (uint64_t)array;
    const int m = wanted < n ? wanted : n;
    for (int i = 0; i < m; i++) {
        const int j = i + (int)(next_random(&state) % (uint64_t)(n - i));
        const int kept = chosen[i];
        chosen[i] = chosen[j];
        chosen[j] = kept;
    }
    qsort(chosen, (size_t)m, sizeof *chosen, compare_ints);
    return m;
}

static void choose_all(const checker *c, crm_check *check, int per_array)
{
    for (int a = 0; a < CRM_N_WRT; a++) {
        if (!c->g->wanted[a]) continue;
        int *chosen = crm_resize(NULL, (size_t)c->g->count[a], sizeof *chosen);
        const int n = choose(c, (crm_wrt)a, per_array, chosen);
        const size_t total = (size_t)check->count + (size_t)n;
        check->entries = crm_resize(check->entries, total, sizeof *check->entries);
        for (int i = 0; i < n; i++) {
            crm_check_entry *e = &check->entries[check->count++];
            memset(e, 0, sizeof *e);
            e->array = (crm_wrt)a;
            e->index = chosen[i];
        }
        free(chosen);
    }
}

/* Copies of the scene's numbers that a check changes; 0 when the scene has no world. */
static int checker_open(checker *c)
{
    const crm_scene *s = c->run->scene;
    const size_t n = (size_t)s->n_bodies;
    carom_world *w = crm_run_world(c->run);
    if (!w) return 0;
    double *numbers = crm_resize(NULL, 13 * n, sizeof *numbers);
    c->q = numbers;
    c->v = c->q + 3 * n;
    c->force = c->v + 3 * n;
    for (size_t k = 0; k < 4; k++) c->p[k] = numbers + (9 + k) * n;
    memcpy(c->q, carom_world_q(w), 3 * n * sizeof *numbers);
    memcpy(c->v, carom_world_v(w), 3 * n * sizeof *numbers);
    const double g = hypot(s->settings.gravity[0], s->settings.gravity[1]);
    for (size_t i = 0; i < n; i++) {
        const carom_body_def *def = &s->bodies[i].def;
        c->p[0][i] = def->mass;
        c->p[1][i] = def->inertia;
        c->p[2][i] = def->friction;
        c->p[3][i] = def->restitution;
        if (def->type != CAROM_DYNAMIC) continue;
        c->length = fmax(c->length, 2 * crm_body_moments(def).extent);
        c->weight = fmax(c->weight, def->mass * g);
    }
    if (!(c->length > 0)) c->length = 1;
    carom_world_destroy(w);
    return 1;
}

void crm_check_run(crm_check *check, const crm_gradient *g, const crm_run *run,
                   const crm_loss *loss, int per_array, int quiet)
{
    checker c;
    memset(&c, 0, sizeof c);
    memset(check, 0, sizeof *check);
    c.g = g;
    c.run = run;
    c.loss = loss;
    check->worst = -1;
    if (!checker_open(&c)) return;
    choose_all(&c, check, per_array);
    c.bar = crm_progress_start("check", quiet);
    c.n_all = (double)RUNS * check->count * (double)run->n_steps;
    int done = 0;
    while (done < check->count) {
        check_entry(&c, &check->entries[done]);
        if (crm_interrupted()) break; /* in the middle of an entry */
        if (check->worst < 0 ||
            check->entries[done].disagreement > check->entries[check->worst].disagreement) {
            check->worst = done;
        }
        done++;
    }
    crm_progress_end(&c.bar);
    check->interrupted = done < check->count;
    check->count = done;
    free(c.q);
}

void crm_check_free(crm_check *check)
{
    free(check->entries);
    memset(check, 0, sizeof *check);
}
