/* shared.c: what the reverse and the forward pass share. */
#include "grad/internal.h"

#include <math.h>
#include <stddef.h>

/* An event whose indicator passes zero slower than this has no usable derivative of its time [1/s
 * of L, or of the speed]. */
static const double GRAZING = 1e-9;

void crm_lay_unpacked(crm_unpacked *u, crm_block *b, size_t n3)
{
    double **const states[] = {&u->q0, &u->v0, &u->q1, &u->v1};
    for (int k = 0; k < 4; k++) *states[k] = crm_carve(b, n3, sizeof(double));
    for (int k = 0; k < CRM_MAX_SOLVES; k++) {
        u->solve_q[k] = crm_carve(b, n3, sizeof(double));
        u->solve_v[k] = crm_carve(b, n3, sizeof(double));
    }
}

void crm_place_statics(crm_unpacked *u, const double *q, size_t n3)
{
    memcpy(u->q0, q, n3 * sizeof *q);
    memcpy(u->q1, q, n3 * sizeof *q);
    for (int k = 0; k < CRM_MAX_SOLVES; k++) {
        memcpy(u->solve_q[k], q, n3 * sizeof *q);
        memset(u->solve_v[k], 0, n3 * sizeof *q);
    }
}

void crm_gather(const carom_world *w, const double *full, double *moving)
{
    for (int i = 0; i < w->island->n_bodies; i++) {
        memcpy(&moving[3 * i], &full[3 * w->island->bodies[i]], 3 * sizeof(double));
    }
}

void crm_scatter(const carom_world *w, const double *moving, double *full)
{
    for (int i = 0; i < w->island->n_bodies; i++) {
        memcpy(&full[3 * w->island->bodies[i]], &moving[3 * i], 3 * sizeof(double));
    }
}

void crm_unpack(carom_world *w, const crm_record *record, crm_contact *moved, crm_unpacked *to)
{
    crm_substep *s = &to->s;
    crm_enter(w, &record->island);
    *s = record->s;
    s->moved = moved;
    s->q0 = to->q0;
    s->v0 = to->v0;
    s->q1 = to->q1;
    s->v1 = to->v1;
    crm_scatter(w, record->s.q0, s->q0);
    crm_scatter(w, record->s.v0, s->v0);
    for (int k = 0; k < s->n_solves; k++) {
        const crm_solve *c = &record->s.solve[k];
        s->solve[k].q = c->q ? to->solve_q[k] : s->q0;
        s->solve[k].v = to->solve_v[k];
        if (c->q) crm_scatter(w, c->q, s->solve[k].q);
        crm_scatter(w, c->v, s->solve[k].v);
    }
}

void crm_lay_smoothed(const carom_tape *t, crm_smoothed *to, crm_block *b, size_t k3, size_t m,
                      size_t rows)
{
    if (!(t->kappa > 0)) return;
    to->v = crm_carve(b, k3, sizeof(double));
    to->ln = crm_carve(b, m, sizeof(double));
    to->lt = crm_carve(b, m, sizeof(double));
    to->le = crm_carve(b, rows, sizeof(double));
    to->mode = crm_carve(b, m, 1);
}

static void copy_numbers(double *to, const double *from, int n)
{
    if (n > 0) memcpy(to, from, (size_t)n * sizeof *to);
}

carom_status crm_smooth_solution(const carom_tape *t, const carom_contact_problem *p,
                                 crm_solve_kind kind, const crm_smoothed *room,
                                 carom_contact_solution *x, carom_gradient_stats *stats)
{
    if (!(t->kappa > 0) || !p->n_contacts || kind == CRM_CORRECTION) return CAROM_OK;
    carom_contact_solution y = {room->v, room->ln, room->lt, room->le, room->mode};
    copy_numbers(y.v, x->v, 3 * p->n_bodies);
    copy_numbers(y.ln, x->ln, p->n_contacts);
    copy_numbers(y.lt, x->lt, p->n_contacts);
    copy_numbers(y.le, x->le, p->n_joint_rows);
    memcpy(y.mode, x->mode, (size_t)p->n_contacts);
    const carom_status e = carom_contact_smooth(t->world->solver, p, t->kappa, &y);
    if (e == CAROM_E_NO_SOLUTION) {
        stats->unsmoothed++;
        return CAROM_OK;
    }
    if (e >= 0) *x = y;
    return e;
}

double crm_first_friction(const carom_world *w, const crm_solve *c, int k, const crm_contact *x)
{
    const double u = crm_row_dot(&w->rows.jt[6 * k], c->v, x->body_a, x->body_b);
    if (c->mode[k] == CAROM_SEPARATED || u == 0) return 0;
    return u > 0 ? -c->ln[k] : c->ln[k];
}

double crm_grazing(const carom_world *w, const crm_substep *s)
{
    return GRAZING * (s->end == CRM_END_STOP ? w->speed : w->length);
}

int crm_frame_end(const carom_tape *t, int frame)
{
    return frame + 1 < t->held_to ? t->frames[frame + 1].first_record : t->n_records;
}

double crm_border_acceleration(const carom_tape *t, int step, int k)
{
    const carom_world *w = t->world;
    const int b = k / 3;
    if (step == 0 || w->bodies[b].type == CAROM_STATIC) return 0;
    const double f = t->frames[step - 1].force[k];
    if (w->bodies[b].type == CAROM_KINEMATIC) return f;
    const double m = k % 3 ? w->mass[b] : w->inertia[b];
    double a[3] = {0, 0, 0};
    const double *q = carom_tape_q(t, step);
    const double time = (double)(t->first_step + step) * w->settings.dt;
    if (w->n_fields) crm_field_acceleration(w, b, time, q, carom_tape_v(t, step), a);
    return a[k % 3] + f / m + crm_gravity(w, b, k % 3) -
           w->bodies[b].damping[k % 3 > 0] * carom_tape_v(t, step)[k];
}

carom_status crm_tape_current(const carom_tape *t)
{
    if (!crm_fields_have_slopes(t->world)) {
        return crm_world_fail(t->world, CAROM_E_STATE,
                              "a field has no derivative: give one, or do without gradients");
    }
    if (t->revision == t->world->revision) return CAROM_OK;
    return crm_world_fail(t->world, CAROM_E_STATE,
                          "parameters changed since the recording; rewind and run again");
}

/* What an array of a gradient has one of, or several. */
typedef enum owner { ONE, BODIES, STEPS, SHAPES, VERTICES, JOINTS } owner;

typedef struct array_kind {
    size_t at; /* in carom_gradient */
    owner of;
    size_t each; /* numbers */
} array_kind;

#define ARRAY(name, of, each)                                                                      \
    {                                                                                              \
        offsetof(carom_gradient, name), of, each                                                   \
    }
static const array_kind ARRAYS[CRM_N_ARRAYS] = {ARRAY(q0, BODIES, 3),
                                                ARRAY(v0, BODIES, 3),
                                                ARRAY(mass, BODIES, 1),
                                                ARRAY(inertia, BODIES, 1),
                                                ARRAY(friction, BODIES, 1),
                                                ARRAY(restitution, BODIES, 1),
                                                ARRAY(gravity_scale, BODIES, 1),
                                                ARRAY(linear_damping, BODIES, 1),
                                                ARRAY(angular_damping, BODIES, 1),
                                                ARRAY(gravity, ONE, 2),
                                                ARRAY(force, BODIES, 3),
                                                ARRAY(force_steps, STEPS, 3),
                                                ARRAY(dt, ONE, 1),
                                                ARRAY(radius, SHAPES, 1),
                                                ARRAY(vertices, VERTICES, 2),
                                                ARRAY(anchors, JOINTS, 4),
                                                ARRAY(axes, JOINTS, 1),
                                                ARRAY(angles, JOINTS, 1),
                                                ARRAY(lengths, JOINTS, 1),
                                                ARRAY(lower, JOINTS, 1),
                                                ARRAY(upper, JOINTS, 1),
                                                ARRAY(stiffness, JOINTS, 1),
                                                ARRAY(damping, JOINTS, 1),
                                                ARRAY(rest, JOINTS, 1),
                                                ARRAY(motor_speed, JOINTS, 1),
                                                ARRAY(motor_limit, JOINTS, 1)};
#undef ARRAY

double *crm_array(const carom_gradient *g, int k)
{
    double *p;
    memcpy(&p, (const char *)g + ARRAYS[k].at, sizeof p);
    return p;
}

void crm_set_array(carom_gradient *g, int k, double *p)
{
    memcpy((char *)g + ARRAYS[k].at, &p, sizeof p);
}

size_t crm_array_size(const carom_world *w, int n_frames, int k)
{
    const size_t each = ARRAYS[k].each;
    switch (ARRAYS[k].of) {
    case BODIES: return each * (size_t)w->n_bodies;
    case STEPS: return each * (size_t)w->n_bodies * (size_t)n_frames;
    case SHAPES: return each * (size_t)w->n_shapes;
    case VERTICES: return each * (size_t)w->n_vertices;
    case JOINTS: return each * (size_t)w->n_joints;
    case ONE: break;
    }
    return each;
}
