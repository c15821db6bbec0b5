#include "engine_parts.h"

#include <inttypes.h>
#include <stdlib.h>

static carom_status start_world(crm_engine *e, const carom_scene_t *scene, char *text)
{
    carom_world *world = NULL;
    const carom_status status = crm_engine_build(scene, e->memory.from, text, &world);
    if (status < 0) return status;
    crm_engine_forget_tape(e);
    carom_world_destroy(e->world);
    e->world = world;
    e->dt = carom_world_get_settings(world).dt;
    e->step = 0;
    e->first_step = 0;
    memset(&e->stats, 0, sizeof e->stats);
    e->stats.energy = carom_world_energy(world);
    return status;
}

carom_status crm_engine_create(const carom_scene_t *scene, carom_allocator allocator, char *text,
                               crm_engine **out)
{
    carom_status status = crm_engine_check_scene(scene, text);
    if (status < 0) return status;
    crm_memory memory = crm_memory_from(&allocator);
    crm_engine *e = crm_new(&memory, 1, sizeof *e);
    if (!e) return crm_engine_fault(CAROM_E_MEMORY, text, "no memory for a session");
    e->memory = memory;
    e->scene = carom_scene_t_copy(scene);
    status = start_world(e, e->scene, text);
    if (status < 0) {
        crm_engine_destroy(e);
        return status;
    }
    *out = e;
    return status;
}

void crm_engine_destroy(crm_engine *e)
{
    if (!e) return;
    crm_engine_forget_tape(e);
    const size_t n = e->world ? (size_t)crm_engine_n_bodies(e) : 0;
    for (int i = 0; i < CRM_MAX_SNAPSHOTS; i++) {
        crm_free(&e->memory, e->snapshots[i].state, 6 * n, sizeof(double));
    }
    const size_t m = (size_t)e->n_points_max;
    crm_free(&e->memory, e->point_ints, 2 * m, sizeof *e->point_ints);
    crm_free(&e->memory, e->point_modes, m, sizeof *e->point_modes);
    crm_free(&e->memory, e->point_reals, 7 * m, sizeof *e->point_reals);
    crm_free(&e->memory, e->gradient, e->n_gradient, sizeof *e->gradient);
    carom_world_destroy(e->world);
    if (e->scene) carom_scene_t_destroy(e->scene);
    crm_memory memory = e->memory;
    crm_free(&memory, e, 1, sizeof *e);
}

int crm_engine_n_bodies(const crm_engine *e)
{
    return carom_world_n_bodies(e->world);
}

int64_t crm_engine_step_count(const crm_engine *e)
{
    return e->step;
}

int64_t crm_engine_first_step(const crm_engine *e)
{
    return e->tape ? e->first_step : e->step;
}

int crm_engine_recorded(const crm_engine *e)
{
    return e->tape ? carom_tape_steps(e->tape) : 0;
}

const carom_scene_t *crm_engine_scene(const crm_engine *e)
{
    return e->scene;
}

void crm_engine_forget_tape(crm_engine *e)
{
    carom_tape_destroy(e->tape);
    e->tape = NULL;
}

carom_status crm_engine_record(crm_engine *e, crm_record record, char *text)
{
    if (record == CRM_RECORD_OFF) {
        crm_engine_forget_tape(e);
        return CAROM_OK;
    }
    if (e->tape && record == CRM_RECORD_ON) return CAROM_OK;
    if (e->tape) {
        carom_tape_rewind(e->tape);
    } else {
        const carom_status status = carom_tape_create(e->world, &e->memory.from, &e->tape);
        if (status < 0) {
            return crm_engine_fault(status, text, "tape: %s", carom_status_text(status));
        }
    }
    e->first_step = e->step;
    return CAROM_OK;
}

carom_status crm_engine_advance(crm_engine *e, const double *force, char *text)
{
    const carom_status status = e->tape ? carom_tape_step(e->tape, force, &e->stats)
                                        : carom_world_step(e->world, force, &e->stats);
    if (status >= 0) {
        e->step++;
        return status;
    }
    const char *words = carom_world_error(e->world);
    return crm_engine_fault(status, text, "step %" PRId64 ": %s", e->step + 1,
                            words[0] ? words : carom_status_text(status));
}

/* Room for n contact points; what is there now is not kept. */
static carom_status reserve_points(crm_engine *e, int n)
{
    if (n <= e->n_points_max) return CAROM_OK;
    const size_t old = (size_t)e->n_points_max, to = (size_t)n + (size_t)n / 2;
    int32_t *ints = crm_new(&e->memory, 2 * to, sizeof *ints);
    int8_t *modes = crm_new(&e->memory, to, sizeof *modes);
    double *reals = crm_new(&e->memory, 7 * to, sizeof *reals);
    if (!ints || !modes || !reals) goto fail;
    crm_free(&e->memory, e->point_ints, 2 * old, sizeof *ints);
    crm_free(&e->memory, e->point_modes, old, sizeof *modes);
    crm_free(&e->memory, e->point_reals, 7 * old, sizeof *reals);
    e->point_ints = ints;
    e->point_modes = modes;
    e->point_reals = reals;
    e->n_points_max = (int)to;
    return CAROM_OK;
fail:
    crm_free(&e->memory, reals, 7 * to, sizeof *reals);
    crm_free(&e->memory, modes, to, sizeof *modes);
    crm_free(&e->memory, ints, 2 * to, sizeof *ints);
    return CAROM_E_MEMORY;
}

static carom_status fill_contacts(crm_engine *e, carom_state_t *m)
{
    const int n = carom_world_n_contacts(e->world);
    if (reserve_points(e, n) < 0) return CAROM_E_MEMORY;
    m->num_contacts = n;
    m->num_contact_coords = 2 * n;
    m->contact_body_a = e->point_ints;
    m->contact_body_b = e->point_ints + n;
    m->contact_mode = e->point_modes;
    m->contact_gap = e->point_reals;
    m->impulse_normal = e->point_reals + n;
    m->impulse_tangent = e->point_reals + 2 * n;
    m->contact_point = e->point_reals + 3 * n;
    m->contact_normal = e->point_reals + 5 * n;
    for (int k = 0; k < n; k++) {
        const carom_contact_info c = carom_world_contact(e->world, k);
        m->contact_body_a[k] = c.body_a;
        m->contact_body_b[k] = c.body_b;
        m->contact_mode[k] = (int8_t)c.mode;
        m->contact_gap[k] = c.gap;
        m->impulse_normal[k] = c.ln;
        m->impulse_tangent[k] = c.lt;
        m->contact_point[2 * k] = c.point.x;
        m->contact_point[2 * k + 1] = c.point.y;
        m->contact_normal[2 * k] = c.normal.x;
        m->contact_normal[2 * k + 1] = c.normal.y;
    }
    return CAROM_OK;
}

carom_status crm_engine_state(crm_engine *e, int want, carom_state_t *m)
{
    const int n = crm_engine_n_bodies(e);
    m->step = e->step;
    m->sim_time = (double)e->step * e->dt;
    m->num_bodies = n;
    m->num_q = want & CAROM_STEP_REQUEST_T_WANT_Q ? 3 * n : 0;
    m->num_v = want & CAROM_STEP_REQUEST_T_WANT_V ? 3 * n : 0;
    m->q = (double *)carom_world_q(e->world); /* the encoder only reads */
    m->v = (double *)carom_world_v(e->world);
    m->status = e->stats.status;
    m->residual = e->stats.residual;
    m->penetration = e->stats.penetration;
    m->joint_drift = e->stats.joint_drift;
    m->energy = e->stats.energy;
    m->substeps = e->stats.n_substeps;
    m->events = e->stats.n_events;
    m->iterations = e->stats.iterations;
    m->factorizations = e->stats.factorizations;
    m->degenerate = e->stats.degenerate;
    m->num_contacts = 0;
    m->num_contact_coords = 0;
    return want & CAROM_STEP_REQUEST_T_WANT_CONTACTS ? fill_contacts(e, m) : CAROM_OK;
}

static crm_snapshot *find_snapshot(crm_engine *e, int number)
{
    for (int i = 0; i < CRM_MAX_SNAPSHOTS; i++) {
        if (e->snapshots[i].number == number) return &e->snapshots[i];
    }
    return NULL;
}

carom_status crm_engine_snapshot(crm_engine *e, int number, char *text)
{
    if (number < 1) {
        return crm_engine_fault(CAROM_E_ARGUMENT, text, "snapshot %d: numbers start at 1", number);
    }
    crm_snapshot *s = find_snapshot(e, number);
    if (!s) s = find_snapshot(e, 0);
    if (!s) {
        return crm_engine_fault(CAROM_E_CAPACITY, text, "snapshot %d: a session holds %d", number,
                                CRM_MAX_SNAPSHOTS);
    }
    const size_t n = 3 * (size_t)crm_engine_n_bodies(e);
    if (!s->state) s->state = crm_new(&e->memory, 2 * n, sizeof(double));
    if (!s->state) {
        return crm_engine_fault(CAROM_E_MEMORY, text, "no memory for snapshot %d", number);
    }
    s->number = number;
    s->step = e->step;
    if (n) memcpy(s->state, carom_world_q(e->world), n * sizeof(double));
    if (n) memcpy(s->state + n, carom_world_v(e->world), n * sizeof(double));
    return CAROM_OK;
}

carom_status crm_engine_restore(crm_engine *e, int number, char *text)
{
    const crm_snapshot *s = number >= 1 ? find_snapshot(e, number) : NULL;
    if (!s) {
        return crm_engine_fault(CAROM_E_ARGUMENT, text, "there is no snapshot %d", number);
    }
    const int n = 3 * crm_engine_n_bodies(e);
    crm_engine_forget_tape(e);
    const carom_status status = carom_world_set_state(e->world, s->state, s->state + n);
    if (status < 0) return crm_engine_fault(status, text, "%s", carom_world_error(e->world));
    e->step = s->step;
    memset(&e->stats, 0, sizeof e->stats);
    e->stats.energy = carom_world_energy(e->world);
    return status;
}

carom_status crm_engine_reset(crm_engine *e, char *text)
{
    return start_world(e, e->scene, text);
}
