/* field.c: forces that the caller computes.  docs/step.md, section "Force fields". */
#include "world/internal.h"

carom_status carom_world_add_field(carom_world *world, const carom_field *field)
{
    if (!world || !field || !field->force) return CAROM_E_ARGUMENT;
    carom_world *w = world;
    if (w->sealed) {
        return crm_world_fail(w, CAROM_E_STATE, "fields are added before the world is sealed");
    }
    void *fields = w->fields;
    const carom_status e =
        crm_reserve(&w->memory, &fields, &w->max_fields, w->n_fields + 1, sizeof *w->fields);
    w->fields = fields;
    if (e) return crm_world_fail(w, e, "no memory for field %d", w->n_fields);
    w->fields[w->n_fields++] = *field;
    return CAROM_OK;
}

void crm_field_force(const carom_world *w, int body, double t, const double *q, const double *v,
                     double f[3])
{
    f[0] = f[1] = f[2] = 0;
    for (int k = 0; k < w->n_fields; k++) {
        const carom_field *x = &w->fields[k];
        double one[3] = {0, 0, 0};
        x->force(x->user, body, t, q + 3 * body, v + 3 * body, one);
        for (int i = 0; i < 3; i++) f[i] += one[i];
    }
}

void crm_field_slopes(const carom_world *w, int body, double t, const double *q, const double *v,
                      double by_q[9], double by_v[9])
{
    for (int i = 0; i < 9; i++) by_q[i] = by_v[i] = 0;
    for (int k = 0; k < w->n_fields; k++) {
        const carom_field *x = &w->fields[k];
        double A[9] = {0};
        double B[9] = {0};
        x->derivative(x->user, body, t, q + 3 * body, v + 3 * body, A, B);
        for (int i = 0; i < 9; i++) {
            by_q[i] += A[i];
            by_v[i] += B[i];
        }
    }
}

void crm_field_rate(const carom_world *w, int body, double t, const double *q, const double *v,
                    double by_t[3])
{
    by_t[0] = by_t[1] = by_t[2] = 0;
    for (int k = 0; k < w->n_fields; k++) {
        const carom_field *x = &w->fields[k];
        double one[3] = {0, 0, 0};
        if (!x->rate) continue;
        x->rate(x->user, body, t, q + 3 * body, v + 3 * body, one);
        for (int i = 0; i < 3; i++) by_t[i] += one[i];
    }
}

int crm_fields_have_slopes(const carom_world *w)
{
    for (int k = 0; k < w->n_fields; k++) {
        if (!w->fields[k].derivative) return 0;
    }
    return 1;
}

int crm_field_is_late(const crm_substep *s, const crm_solve *c)
{
    return c->q != s->q0 && c->kind != CRM_VELOCITY && c->kind != CRM_STAGE_1;
}

double crm_field_time(const crm_substep *s, const crm_solve *c)
{
    return crm_field_is_late(s, c) ? s->time + s->h : s->time;
}

const double *crm_field_velocity(const crm_substep *s, const crm_solve *c)
{
    return c->kind == CRM_STAGE_2 ? c->v : s->v0;
}

void crm_fields(carom_world *w, const crm_substep *s, const crm_solve *c)
{
    const double t = crm_field_time(s, c);
    const double h = crm_share(c) * s->h;
    for (int i = 0; h > 0 && i < w->island->n_bodies; i++) {
        const int b = w->island->bodies[i];
        double f[3];
        if (w->bodies[b].type != CAROM_DYNAMIC) continue;
        crm_field_force(w, b, t, c->q, crm_field_velocity(s, c), f);
        for (int k = 0; k < 3; k++) {
            w->rows.u[3 * i + k] += h * w->rows.inv_mass[3 * i + k] * f[k];
        }
    }
}

void crm_field_acceleration(const carom_world *w, int body, double t, const double *q,
                            const double *v, double a[3])
{
    double f[3];
    if (w->bodies[body].type != CAROM_DYNAMIC) return;
    crm_field_force(w, body, t, q, v, f);
    for (int k = 0; k < 3; k++) a[k] += f[k] / (k ? w->mass[body] : w->inertia[body]);
}
