/* world.c: life and state of a world. */
#include "world/internal.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>

/* Restarts of a contact problem.  A step has other ways on: without restitution, or in halves. */
enum { WORLD_RESTARTS = 0 };

carom_status crm_world_fail(carom_world *w, carom_status status, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    vsnprintf(w->error, sizeof w->error, format, args);
    va_end(args);
    return status;
}

static carom_status check_settings(const carom_world_settings *s)
{
    const int positive = s->dt > 0 && s->margin > 0 && s->penetration > 0 && s->accept > 0 &&
                         s->inexact >= s->accept && s->length >= 0 && s->rest_speed >= 0;
    const int bounded = s->dt < HUGE_VAL && s->margin < 1 && s->penetration < 1 &&
                        s->length < HUGE_VAL && s->rest_speed < HUGE_VAL && s->tolerance >= 0 &&
                        s->tolerance < HUGE_VAL;
    const int order = s->order >= 2 && s->order <= 2 * CRM_MAX_COLUMNS && s->order % 2 == 0;
    const int finite = isfinite(s->gravity[0]) && isfinite(s->gravity[1]);
    const int words = s->integrator >= CAROM_EULER && s->integrator <= CAROM_FIXED &&
                      s->events >= 0 && s->events <= CAROM_EVENTS_ALL && s->combine_friction >= 0 &&
                      s->combine_friction <= CAROM_COMBINE_MAX && s->combine_restitution >= 0 &&
                      s->combine_restitution <= CAROM_COMBINE_MAX;
    return positive && bounded && finite && words && s->max_substeps >= 1 && order &&
                   s->max_stiff >= 1 && (s->sleep == 0 || s->sleep == 1) && s->threads >= 1 &&
                   s->threads <= CRM_MAX_THREADS
               ? CAROM_OK
               : CAROM_E_ARGUMENT;
}

carom_status crm_solver_create(const carom_world *w, carom_contact_solver **out)
{
    carom_contact_settings c = carom_contact_defaults();
    c.accept = w->settings.accept;
    c.inexact = w->settings.inexact;
    c.max_restarts = WORLD_RESTARTS;
    return carom_contact_create(&c, &w->memory.from, out);
}

carom_status carom_world_create(const carom_world_settings *settings,
                                const carom_allocator *allocator, carom_world **out)
{
    if (!out) return CAROM_E_ARGUMENT;
    *out = NULL;
    carom_world_settings chosen = settings ? *settings : carom_world_defaults();
    if (check_settings(&chosen)) return CAROM_E_ARGUMENT;
    if (chosen.tolerance > 0)
        chosen.order = 2 * CRM_MAX_COLUMNS; /* the highest that it may choose */
    crm_memory memory = crm_memory_from(allocator);
    carom_world *w = crm_new(&memory, 1, sizeof *w);
    if (!w) return CAROM_E_MEMORY;
    w->memory = memory;
    w->settings = chosen;
    carom_status e = crm_solver_create(w, &w->solver);
    if (!e) e = carom_broadphase_create(allocator, &w->broadphase);
    if (!e) e = crm_reserve_bodies(w);
    if (e) {
        carom_world_destroy(w);
        return e;
    }
    *out = w;
    return CAROM_OK;
}

static void free_built(carom_world *w)
{
    crm_memory *m = &w->memory;
    crm_free(m, w->bodies, (size_t)w->max_bodies, sizeof *w->bodies);
    crm_free(m, w->body_block, w->body_bytes, 1);
    crm_free(m, w->shapes, (size_t)w->max_shapes, sizeof *w->shapes);
    crm_free(m, w->vertices, (size_t)w->max_vertices, sizeof *w->vertices);
    crm_free(m, w->joints, (size_t)w->max_joints, sizeof *w->joints);
    crm_free(m, w->fields, (size_t)w->max_fields, sizeof *w->fields);
    crm_free(m, w->excluded, (size_t)w->max_excluded, sizeof *w->excluded);
}

void crm_free_sealed(carom_world *w)
{
    w->joint_force[0] = w->joint_force[1] = w->joint_total = NULL;
    w->carry = NULL;
    crm_free(&w->memory, w->seal_block, w->seal_bytes, 1);
    w->seal_block = NULL;
    crm_rows_free(w);
    crm_anderson_free(&w->memory, &w->anderson);
    crm_solvers_free(w);
    crm_sleep_free(w);
    crm_islands_free(w);
    crm_substep_free(w, &w->sub);
    for (int k = 0; k < CRM_MAX_INNER; k++) crm_substep_free(w, &w->inner[k]);
}

void carom_world_destroy(carom_world *world)
{
    if (!world) return;
    crm_threads_free(world);
    carom_contact_destroy(world->solver);
    carom_broadphase_destroy(world->broadphase);
    crm_free_sealed(world);
    free_built(world);
    crm_free(&world->memory, world->touches.list, (size_t)world->touches.max,
             sizeof *world->touches.list);
    crm_free(&world->memory, world->next.list, (size_t)world->next.max, sizeof *world->next.list);
    crm_events_free(world);
    crm_memory m = world->memory;
    crm_free(&m, world, 1, sizeof *world);
}

const char *carom_world_error(const carom_world *world)
{
    return world ? world->error : "";
}

int carom_world_n_bodies(const carom_world *world)
{
    return world->n_bodies;
}

int carom_world_n_joints(const carom_world *world)
{
    return world->n_joints;
}

long carom_world_steps(const carom_world *world)
{
    return world->n_steps;
}

double carom_world_time(const carom_world *world)
{
    return (double)world->n_steps * world->settings.dt;
}

const double *carom_world_q(const carom_world *world)
{
    return world->q;
}

const double *carom_world_v(const carom_world *world)
{
    return world->v;
}

carom_world_settings carom_world_get_settings(const carom_world *world)
{
    return world->settings;
}

static int all_finite(int n, const double *x)
{
    for (int k = 0; k < n; k++) {
        if (!isfinite(x[k])) return 0;
    }
    return 1;
}

carom_status carom_world_set_state(carom_world *world, const double *q, const double *v)
{
    if (!world) return CAROM_E_ARGUMENT;
    carom_world *w = world;
    const int n = 3 * w->n_bodies;
    if ((q && !all_finite(n, q)) || (v && !all_finite(n, v))) {
        return crm_world_fail(w, CAROM_E_ARGUMENT, "a state is not finite");
    }
    for (int b = 0; v && b < w->n_bodies; b++) {
        const double *vb = v + 3 * b;
        if (w->bodies[b].type == CAROM_STATIC && (vb[0] != 0 || vb[1] != 0 || vb[2] != 0)) {
            return crm_world_fail(w, CAROM_E_ARGUMENT, "static body %d cannot have a velocity", b);
        }
    }
    if (q) memmove(w->q, q, (size_t)n * sizeof *q);
    if (v) memmove(w->v, v, (size_t)n * sizeof *v);
    crm_forget_guesses(w);
    w->statics_placed = 0;
    crm_forget_clocks(w);
    return CAROM_OK;
}

void crm_forget_clocks(carom_world *w)
{
    if (!w->carry) return;
    memset(w->carry, 0, (size_t)w->n_bodies * sizeof *w->carry);
    memset(w->owes, 0, (size_t)w->n_bodies);
}

double carom_world_energy(const carom_world *world)
{
    const carom_world *w = world;
    double energy = 0;
    for (int b = 0; b < w->n_bodies; b++) {
        if (w->bodies[b].type != CAROM_DYNAMIC) continue;
        const double *q = w->q + 3 * b;
        const double *v = w->v + 3 * b;
        energy += 0.5 * crm_mass_square(w, b, v) -
                  w->mass[b] * (crm_gravity(w, b, 1) * q[1] + crm_gravity(w, b, 2) * q[2]);
    }
    return energy;
}

int carom_world_n_contacts(const carom_world *world)
{
    int n = world->touches.n;
    while (n > 0 && world->touches.list[n - 1].contact.limit) n--; /* limits are the last */
    return n;
}

carom_contact_info carom_world_contact(const carom_world *world, int k)
{
    const crm_touch *t = &world->touches.list[k];
    const carom_contact_info i = {t->contact.body_a,
                                  t->contact.body_b,
                                  t->point,
                                  t->contact.normal,
                                  t->contact.gap,
                                  t->ln,
                                  t->lt,
                                  (carom_contact_mode)t->mode};
    return i;
}

long crm_allocations(const carom_world *w)
{
    size_t bytes;
    long solver;
    long broadphase;
    crm_solvers_memory(w, &bytes, &solver);
    carom_broadphase_memory(w->broadphase, &bytes, &broadphase);
    long sum = w->memory.n_calls + solver + broadphase;
    for (int k = 0; k < w->n_workers; k++) {
        carom_contact_memory(w->workers[k].solver, &bytes, &solver);
        sum += w->workers[k].memory.n_calls + solver;
    }
    return sum;
}

carom_world_size carom_world_measure(const carom_world *world)
{
    const carom_world *w = world;
    carom_world_size z = {0};
    size_t solver_bytes;
    size_t pair_bytes;
    long calls;
    for (int b = 0; b < w->n_bodies; b++) {
        z.n_dynamic += w->bodies[b].type == CAROM_DYNAMIC;
        z.n_static += w->bodies[b].type == CAROM_STATIC;
        z.n_kinematic += w->bodies[b].type == CAROM_KINEMATIC;
    }
    z.n_shapes = w->n_shapes;
    z.n_vertices = w->n_vertices;
    z.n_joints = w->n_joints;
    z.n_unknowns = 3 * (z.n_dynamic + z.n_kinematic);
    z.n_joint_rows = w->n_joint_rows;
    z.n_contacts = carom_world_n_contacts(w);
    for (int k = 0; k < z.n_contacts; k++) {
        const crm_contact *c = &w->touches.list[k].contact;
        z.n_friction += crm_combine(w->settings.combine_friction, w->friction[c->body_a],
                                    w->friction[c->body_b]) > 0;
    }
    z.factor = crm_solvers_factor_size(w);
    crm_solvers_memory(w, &solver_bytes, &calls);
    carom_broadphase_memory(w->broadphase, &pair_bytes, &calls);
    z.bytes = w->memory.live + solver_bytes + pair_bytes;
    z.bytes_high = w->memory.high + solver_bytes + pair_bytes;
    for (int k = 0; k < w->n_workers; k++) {
        carom_contact_memory(w->workers[k].solver, &solver_bytes, &calls);
        z.bytes += w->workers[k].memory.live + solver_bytes;
        z.bytes_high += w->workers[k].memory.high + solver_bytes;
    }
    return z;
}
