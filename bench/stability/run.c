/* run.c: runs a cell and judges it. */
#include "trial.h"

#include "bench/solver/clock.h"
#include "bench/step/own.h"

#include "carom/grad.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* What a step that says CAROM_OK promises [L]; poses far from the origin add their rounding. */
static const double OVERLAP = 1e-6;
static const double DRIFT = 1e-8;
/* Of energy, relative to what moves or has been lost; to it adds what a symmetric method of order
 * two lets it swing by, (h w)^2 with the fastest turn w, one at most. */
static const double GAIN = 0.02;
/* Overlap, drift and energy of methods of order one and of peers [L], [L], [1]; a bounce at the end
 * of a step comes h v g too high. */
static const double ROUGH = 0.05;

/* A run under way. */
typedef struct running {
    const trial *t;
    const engine *e;
    void *self;
    double *q, *v;
    double length;
    double least_energy, most_kinetic, most_rise, most_lost; /* [J] */
    double most_turn;                                        /* [rad/s] */
    double first_energy, mass;
    double last_energy, most_silent; /* largest rise in a step that said nothing [J] */
    int said;                        /* status of the last step */
    outcome o;
} running;

static int own_add_joints(const trial *t, carom_world *w)
{
    for (int k = 0; k < t->n_joints; k++) {
        const carom_status s = carom_world_add_joint(w, &t->joints[k], NULL);
        if (s < 0) return (int)s;
    }
    return (int)carom_world_seal(w);
}

static void say(outcome *o, const char *why)
{
    if (!o->why[0]) snprintf(o->why, sizeof o->why, "%s", why);
    for (char *c = o->why; *c; c++) {
        if (*c == ',' || *c == '\n') *c = ';';
    }
}

static void note(running *r, carom_status s)
{
    outcome *o = &r->o;
    if (s > 0) o->n_said++;
    r->said = (int)s;
    if (s < 0) say(o, carom_world_error(r->self));
    if (o->worst >= 0 && (s < 0 || (int)s > o->worst)) o->worst = (int)s;
}

static void start(running *r, const trial *t, const engine *e)
{
    const size_t n = 3 * (size_t)t->s.n_bodies;
    memset(r, 0, sizeof *r);
    r->t = t;
    r->e = e;
    r->q = calloc(n, sizeof *r->q);
    r->v = calloc(n, sizeof *r->v);
    if (!r->q || !r->v) abort();
    r->length = measure_length(&t->s);
    r->o.error = r->o.gradient = -1;
    if (e->peer) {
        r->self = e->peer->create(&t->s);
        return;
    }
    carom_world *w = own_build(&t->s, e->integrator, e->order);
    r->self = w;
    note(r, (carom_status)own_add_joints(t, w));
}

static void finish(running *r)
{
    if (r->e->peer) {
        r->e->peer->destroy(r->self);
    } else {
        carom_world_destroy(r->self);
    }
    free(r->q);
    free(r->v);
}

/* 0 when the step failed. */
static int advance(running *r)
{
    if (r->e->peer) {
        counters c = {0};
        r->e->peer->step(r->self, &c);
        return 1;
    }
    carom_step_stats s;
    memset(&s, 0, sizeof s);
    const carom_status status = carom_world_step(r->self, NULL, &s);
    note(r, status);
    r->o.residual = fmax(r->o.residual, s.residual);
    return status >= 0;
}

static void look(running *r)
{
    const scene *s = &r->t->s;
    if (!r->e->peer) {
        memcpy(r->q, carom_world_q(r->self), 3 * (size_t)s->n_bodies * sizeof *r->q);
        memcpy(r->v, carom_world_v(r->self), 3 * (size_t)s->n_bodies * sizeof *r->v);
        return;
    }
    for (int k = 0; k < s->n_bodies; k++) {
        r->e->peer->place(r->self, k, &r->q[3 * k]);
        r->e->peer->speed(r->self, k, &r->v[3 * k]);
    }
}

static void look_at_energy(running *r)
{
    const double kinetic = measure_kinetic(&r->t->s, r->v);
    const double energy = measure_energy(r->t, r->q, r->v);
    r->most_kinetic = fmax(r->most_kinetic, kinetic);
    r->most_rise = fmax(r->most_rise, energy - r->least_energy);
    r->least_energy = fmin(r->least_energy, energy);
    r->most_lost = fmax(r->most_lost, r->first_energy - energy);
    if (!r->said) r->most_silent = fmax(r->most_silent, energy - r->last_energy);
    r->last_energy = energy;
    for (int k = 0; k < r->t->s.n_bodies; k++) {
        if (r->t->s.bodies[k].moves != SCENE_DYNAMIC) continue;
        r->most_turn = fmax(r->most_turn, fabs(r->v[3 * k]));
    }
}

static double mass_of(const scene *s)
{
    double mass = 0;
    for (int k = 0; k < s->n_bodies; k++) {
        if (s->bodies[k].moves == SCENE_DYNAMIC) mass += s->bodies[k].mass;
    }
    return mass;
}

static int is_rough(const engine *e)
{
    return e->peer || e->integrator != CAROM_LOCATED;
}

/* What a rise of energy is measured by; all mass falling L / 1000 is next to nothing, of a rough
 * method what its overlaps may store [J]. */
static double energy_scale(const running *r)
{
    const double fall = (is_rough(r->e) ? ROUGH : 1e-3) * r->length;
    const double little = fall * r->mass * r->t->s.gravity;
    return fmax(fmax(r->most_kinetic, r->most_lost), little) + DBL_MIN;
}

static double gain_allowed(const running *r)
{
    const double h = r->t->s.dt;
    const double turn = h * r->most_turn;
    const double swing = fmin(1, turn * turn);
    const double speed = sqrt(2 * energy_scale(r) / r->mass);
    return is_rough(r->e) ? fmin(1, ROUGH + swing + 2 * h * r->t->s.gravity / speed) : GAIN + swing;
}

static void look_at_places(running *r)
{
    r->o.overlap = fmax(r->o.overlap, measure_overlap(r->t, r->q) / r->length);
    r->o.drift = fmax(r->o.drift, measure_drift(&r->t->s, r->q) / r->length);
}

static int all_finite(const running *r)
{
    for (int k = 0; k < 3 * r->t->s.n_bodies; k++) {
        if (!isfinite(r->q[k]) || !isfinite(r->v[k])) return 0;
    }
    return 1;
}

static void steps(running *r, double limit)
{
    const int n = r->t->s.n_steps;
    const int every = n / 50 + 1;
    const double from = cpu_seconds();
    look(r);
    r->least_energy = HUGE_VAL;
    r->first_energy = r->last_energy = measure_energy(r->t, r->q, r->v);
    r->mass = mass_of(&r->t->s);
    look_at_energy(r);
    for (int k = 0; k < n; k++) {
        if (k > 0 && cpu_seconds() - from > limit) {
            r->o.cut = 1;
            break;
        }
        if (!advance(r)) break;
        r->o.n_steps++;
        look(r);
        if (!all_finite(r)) break;
        look_at_energy(r);
        if (k < 10 || k % every == 0 || k == n - 1) look_at_places(r);
    }
    if (r->o.cut && all_finite(r)) look_at_places(r);
    r->o.seconds = cpu_seconds() - from;
}

static void exceeds(outcome *o, const char *what, double value, double limit)
{
    char text[80];
    if (value <= limit) return; /* NaN exceeds */
    snprintf(text, sizeof text, "%s %.1e > %.1e", what, value, limit);
    say(o, text);
}

static void judge(running *r)
{
    const trial *t = r->t;
    outcome *o = &r->o;
    char words[96];
    const int rough = is_rough(r->e);
    const double rounding = 64 * DBL_EPSILON * measure_reach(&t->s, r->q) / r->length;
    snprintf(words, sizeof words, "%s", o->why);
    o->why[0] = 0;
    if (!all_finite(r)) say(o, "not finite");
    exceeds(o, "overlap", o->overlap, (rough ? ROUGH : OVERLAP) + rounding);
    exceeds(o, "drift", o->drift, (rough ? ROUGH : DRIFT) + rounding);
    if (t->passive) exceeds(o, "energy gained", o->gain, gain_allowed(r));
    if (o->error >= 0 || o->error != o->error) {
        exceeds(o, "error", o->error, rough ? t->rough : t->tolerance);
    }
    const int wrong = o->why[0] != 0;
    if (o->worst < 0) {
        o->color = RED;
        o->why[0] = 0;
        say(o, carom_status_name((carom_status)o->worst));
        if (words[0]) snprintf(o->why, sizeof o->why, "%s", words);
    } else if (wrong) {
        /* what one step gave in silence others do not excuse */
        const double silent = t->passive ? r->most_silent / energy_scale(r) : 0;
        o->color = o->worst > 0 && silent <= gain_allowed(r) ? RED : BLACK;
    } else {
        o->color = o->worst > 0 ? YELLOW : GREEN;
    }
}

static int peer_can(const trial *t, const engine *e)
{
    if (t->n_joints) return 0;
    if (strncmp(e->name, "Box2D", 5)) return 1;
    for (int k = 0; k < t->s.n_bodies; k++) {
        if (t->s.polygons[k].n > 8) return 0; /* b2_maxPolygonVertices */
    }
    return 1;
}

outcome trial_run(const trial *t, const engine *e, double limit)
{
    running r;
    if (e->peer && !peer_can(t, e)) {
        memset(&r.o, 0, sizeof r.o);
        r.o.color = NOT_RUN;
        return r.o;
    }
    start(&r, t, e);
    if (r.o.worst >= 0) steps(&r, limit);
    r.o.gain = r.most_rise / energy_scale(&r);
    const double time = r.o.n_steps * t->s.dt;
    if (t->error && r.o.worst >= 0 && time >= t->late) r.o.error = t->error(t, time, r.q, r.v);
    judge(&r);
    finish(&r);
    return r.o;
}

/* --- gradient */

enum { GRADIENT_STEPS = 60 };

static carom_world *own_world(const trial *t, const engine *e)
{
    carom_world *w = own_build(&t->s, e->integrator, e->order);
    if (own_add_joints(t, w) >= 0) return w;
    carom_world_destroy(w);
    return NULL;
}

/* <weight, q of the probe> after the steps; NaN: failed or said something. */
static double value_at(const trial *t, const engine *e, const double push[3], double by, int n,
                       const double weight[3])
{
    trial moved = *t;
    double value = 0;
    carom_world *w = own_world(&moved, e);
    if (!w) return NAN;
    double *v = calloc(3 * (size_t)t->s.n_bodies, sizeof *v);
    if (!v) abort();
    memcpy(v, carom_world_v(w), 3 * (size_t)t->s.n_bodies * sizeof *v);
    for (int k = 0; k < 3; k++) v[3 * t->probe + k] += by * push[k];
    if (carom_world_set_state(w, NULL, v)) value = NAN;
    for (int k = 0; k < n; k++) {
        if (carom_world_step(w, NULL, NULL)) value = NAN;
    }
    for (int k = 0; k < 3; k++) value += weight[k] * carom_world_q(w)[3 * t->probe + k];
    carom_world_destroy(w);
    free(v);
    return value;
}

/* Along the push; NaN: failed, or contacts at kinks. */
static double exact_slope(const trial *t, const engine *e, const double push[3], int n,
                          const double weight[3])
{
    carom_tape *tape = NULL;
    double slope = 0;
    const size_t size = 3 * (size_t)t->s.n_bodies;
    carom_world *w = own_world(t, e);
    if (!w) return NAN;
    double *bar = calloc(2 * size, sizeof *bar);
    if (!bar || carom_tape_create(w, NULL, &tape)) abort();
    for (int k = 0; k < n; k++) {
        if (carom_tape_step(tape, NULL, NULL)) slope = NAN;
    }
    for (int k = 0; k < 3; k++) bar[3 * t->probe + k] = weight[k];
    const carom_state_bar end = {carom_tape_steps(tape), bar, NULL};
    carom_gradient g = {0};
    carom_gradient_stats stats;
    g.v0 = bar + size;
    if (slope == 0 && !carom_tape_gradient(tape, 1, &end, &g, &stats) && !stats.degenerate) {
        for (int k = 0; k < 3; k++) slope += push[k] * g.v0[3 * t->probe + k];
    } else {
        slope = NAN;
    }
    carom_tape_destroy(tape);
    carom_world_destroy(w);
    free(bar);
    return slope;
}

double trial_gradient(const trial *t, const engine *e, double limit)
{
    const double length = measure_length(&t->s);
    const int n = t->s.n_steps < GRADIENT_STEPS ? t->s.n_steps : GRADIENT_STEPS;
    const double time = n * t->s.dt;
    const double push[3] = {0.4 / time, 0.8 * length / time, 0.6 * length / time};
    const double weight[3] = {0.5 * length, 1, -0.7};
    if (t->probe < 0 || limit <= 0) return -1;
    const double slope = exact_slope(t, e, push, n, weight);
    const double by = 1e-5;
    const double here = value_at(t, e, push, 0, n, weight);
    const double up = (value_at(t, e, push, by, n, weight) - here) / by;
    const double down = (here - value_at(t, e, push, -by, n, weight)) / by;
    /* The scale of a slope is that of free flight. */
    const double scale = fmax(fabs(up), 0.1 * length);
    if (!(fabs(up - down) <= 1e-3 * scale) || slope != slope) return -1;
    return fabs(slope - 0.5 * (up + down)) / scale;
}
