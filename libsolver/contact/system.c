#include "libsolver/contact/system.h"

#include "libsolver/contact/ladder/ladder.h"
#include "libsolver/contact/residual.h"

#include <float.h>
#include <math.h>

/* Share of what is accepted that a velocity set to 0 may take [1]. */
#define UNSEEN 0.01

static void layout(crm_arena *a, crm_system *y, const crm_graph *g, const crm_block_pattern *s)
{
    const int nz = s->lp[s->n];
    const int nn = g->n_nodes;
    const int nc = g->n_live;
    const int ng = g->n_groups;
    y->contact = crm_arena_take(a, (size_t)nc, sizeof(crm_contact));
    y->group = crm_arena_take(a, (size_t)ng, sizeof(crm_group));
    y->scale_n = crm_arena_doubles(a, nc);
    y->scale_t = crm_arena_doubles(a, nc);
    y->scale_e = crm_arena_doubles(a, 3 * ng);
    y->root = crm_arena_doubles(a, 3 * nn);
    y->free = crm_arena_doubles(a, 3 * nn);
    y->speed = crm_arena_doubles(a, g->n_islands);
    y->outcome = crm_arena_take(a, (size_t)g->n_islands, sizeof(crm_outcome));
    y->island = crm_arena_take(a, (size_t)g->n_islands, sizeof(crm_island));
    y->response = crm_arena_take(a, (size_t)nc, sizeof(crm_response));
    y->key = crm_arena_take(a, (size_t)g->n_islands, sizeof(crm_factor_key));
    y->key_row = crm_arena_doubles(a, CRM_KEY_ROW * nc);
    y->key_response = crm_arena_take(a, (size_t)nc, sizeof(crm_response));
    y->key_group = crm_arena_doubles(a, CRM_KEY_GROUP * ng);
    for (int i = 0; i < CRM_N_VECTORS; i++) {
        y->vec[i].z = crm_arena_doubles(a, 3 * (nn + ng));
        y->vec[i].n = crm_arena_doubles(a, nc);
        y->vec[i].t = crm_arena_doubles(a, nc);
    }
    y->an = crm_arena_doubles(a, nc);
    y->ut = crm_arena_doubles(a, nc);
    for (int i = 0; i < CRM_N_SLACKS; i++) y->slack[i] = crm_arena_doubles(a, nc);
    y->size = crm_arena_doubles(a, 3 * nn);
    y->column = crm_arena_doubles(a, CRM_PATH_WORK * nc);
    y->base_mode = crm_arena_take(a, (size_t)nc, 1);
    y->mode = crm_arena_take(a, (size_t)nc, 1);
    y->best_mode = crm_arena_take(a, (size_t)nc, 1);
    y->l = crm_arena_take(a, 9 * (size_t)nz, sizeof(double));
    y->u = crm_arena_take(a, 9 * (size_t)nz, sizeof(double));
    y->d = crm_arena_take(a, 9 * (size_t)s->n, sizeof(double));
    y->pivot = crm_arena_ints(a, 2 * s->n);
    y->lu_work = crm_arena_ints(a, 5 * s->n);
    y->lu_x = crm_arena_doubles(a, 3 * s->n);
}

void crm_system_free(crm_memory *m, crm_system *y)
{
    crm_arena_free(m, &y->arena);
}

/* Scale of a row, 1 / |J sqrt(W)|, or 0. */
static double row_scale(const carom_contact_problem *p, const double *row, const int *body)
{
    const double w = crm_row_weight(row, body, p->inv_mass);
    return w > 0 ? 1 / sqrt(w) : 0;
}

/* What a row sees at w = 0. */
static double row_start(const carom_contact_problem *p, const double *row, const int *body,
                        double c)
{
    return crm_row_times(row, body, p->u) + c;
}

/* to = scale row sqrt(W); a node whose axis has W = 0 gets 0. */
static void scale_row(const double *root, const int *node, double scale, const double *row,
                      double *to)
{
    for (int e = 0; e < 2; e++) {
        for (int i = 0; i < 3; i++) {
            to[3 * e + i] = node[e] < 0 ? 0 : scale * row[3 * e + i] * root[3 * node[e] + i];
        }
    }
}

/* The island's two velocity scales of (21): of its rows as given, and scaled. */
typedef struct speeds {
    double raw;
    double scaled;
} speeds;

static void widen(speeds *v, double speed, double scale)
{
    v->raw = fmax(v->raw, speed);
    v->scaled = fmax(v->scaled, speed * scale);
}

static void gather_contact(crm_system *y, const crm_graph *g, const carom_contact_problem *p,
                           int slot, const double *root, speeds *v)
{
    const int k = g->contact_of[slot];
    const int *body = p->contact_body + 2 * k;
    const int *node = g->contact_node + 2 * slot;
    crm_contact *c = &y->contact[slot];
    const double *jn = p->jn + 6 * k;
    const double dn = row_scale(p, jn, body);
    memset(c, 0, sizeof *c);
    c->a = node[0];
    c->b = node[1];
    y->scale_n[slot] = dn;
    y->scale_t[slot] = 0;
    if (!(dn > 0)) return; /* prescribed: see finish_contact */
    scale_row(root, node, dn, jn, c->n);
    c->cn = dn * row_start(p, jn, body, p->cn[k]);
    widen(v, crm_row_speed(jn, body, p->u, p->cn[k]), dn);
    if (!crm_has_friction(p, k)) return;
    const double *jt = p->jt + 6 * k;
    const double dt = row_scale(p, jt, body);
    if (!(dt > 0)) return;
    const double ct = p->ct ? p->ct[k] : 0;
    y->scale_t[slot] = dt;
    scale_row(root, node, dt, jt, c->t);
    c->ct = dt * row_start(p, jt, body, ct);
    c->mu = p->mu[k] * dn / dt;
    widen(v, crm_row_speed(jt, body, p->u, ct), dt);
}

static void gather_group(crm_system *y, const crm_graph *g, const carom_contact_problem *p,
                         int slot, const double *root, speeds *v)
{
    crm_group *q = &y->group[slot];
    memset(q, 0, sizeof *q);
    q->a = g->group_node[2 * slot];
    q->b = g->group_node[2 * slot + 1];
    q->n = g->group_size[slot];
    for (int i = 0; i < CRM_GROUP_ROWS; i++) {
        const int r = g->group_row[slot] + i;
        double *scale = &y->scale_e[3 * slot + i];
        *scale = 0;
        if (i >= g->group_size[slot]) continue;
        const int *body = p->joint_body + 2 * r;
        const double *je = p->je + 6 * r;
        const double ce = p->ce ? p->ce[r] : 0;
        *scale = row_scale(p, je, body);
        if (!(*scale > 0)) continue;
        scale_row(root, g->group_node + 2 * slot, *scale, je, q->j[i]);
        if (p->je_left) {
            scale_row(root, g->group_node + 2 * slot, *scale, p->je_left + 6 * r, q->left[i]);
        } else {
            memcpy(q->left[i], q->j[i], sizeof q->left[i]);
        }
        q->c[i] = *scale * row_start(p, je, body, ce);
        widen(v, crm_row_speed(je, body, p->u, ce), *scale);
    }
}

/* Velocities in units of `speed`; weights turn scaled rows into the terms of (22). */
static void finish_contact(crm_system *y, int slot, double speed, double raw)
{
    crm_contact *c = &y->contact[slot];
    const double dn = y->scale_n[slot];
    const double dt = y->scale_t[slot];
    c->cn = dn > 0 ? c->cn / speed : 1;
    c->ct /= speed;
    c->residual_n = dn > 0 ? speed / (dn * raw) : 0;
    c->residual_t = dt > 0 ? speed / (dt * raw) : 0;
}

static void finish_group(crm_system *y, int slot, double speed, double raw)
{
    crm_group *q = &y->group[slot];
    for (int i = 0; i < CRM_GROUP_ROWS; i++) {
        const double d = y->scale_e[3 * slot + i];
        q->c[i] /= speed;
        q->residual[i] = d > 0 ? speed / (d * raw) : 0;
    }
}

void crm_system_gather(crm_system *y, const crm_graph *g, const carom_contact_problem *p,
                       int island)
{
    const int n0 = g->node_ptr[island];
    const int n1 = g->node_ptr[island + 1];
    double *root = y->root + 3 * n0;
    for (int i = 0; i < 3 * (n1 - n0); i++)
        root[i] = sqrt(p->inv_mass[3 * g->body_of[n0 + i / 3] + i % 3]);
    speeds v = {0, 0};
    for (int k = g->contact_ptr[island]; k < g->contact_ptr[island + 1]; k++)
        gather_contact(y, g, p, k, root, &v);
    for (int q = g->group_ptr[island]; q < g->group_ptr[island + 1]; q++)
        gather_group(y, g, p, q, root, &v);
    const double speed = v.scaled < CRM_VELOCITY_NONE ? 1 : v.scaled;
    const double raw = v.raw < CRM_VELOCITY_NONE ? 1 : v.raw;
    y->speed[island] = speed;
    for (int k = g->contact_ptr[island]; k < g->contact_ptr[island + 1]; k++)
        finish_contact(y, k, speed, raw);
    for (int q = g->group_ptr[island]; q < g->group_ptr[island + 1]; q++)
        finish_group(y, q, speed, raw);
    for (int i = 0; i < 3 * (n1 - n0); i++) {
        const double u = p->u[3 * g->body_of[n0 + i / 3] + i % 3];
        y->free[3 * n0 + i] = root[i] > 0 ? u / (root[i] * speed) : 0;
    }
}

static crm_vec slice(const crm_vec *v, int block, int contact)
{
    return (crm_vec){v->z + 3 * block, v->n + contact, v->t + contact};
}

static void set_vectors(crm_island *s, const crm_system *y, int block, int contact)
{
    s->x = slice(&y->vec[0], block, contact);
    s->best = slice(&y->vec[1], block, contact);
    s->top = slice(&y->vec[2], block, contact);
    s->rhs = slice(&y->vec[3], block, contact);
    s->rest = slice(&y->vec[4], block, contact);
    s->step = slice(&y->vec[5], block, contact);
    s->way[0] = slice(&y->vec[6], block, contact);
    s->way[1] = slice(&y->vec[7], block, contact);
    s->swept = slice(&y->vec[8], block, contact);
    s->path[0] = slice(&y->vec[9], block, contact);
    s->path[1] = slice(&y->vec[10], block, contact);
}

static crm_block_lu lu_view(const crm_system *y, const crm_block_pattern *s, int first, int n)
{
    return (crm_block_lu){.n = n,
                          .place = s->place + first,
                          .lp = s->lp + first,
                          .li = s->li,
                          .l = y->l,
                          .u = y->u,
                          .d = y->d + 9 * (size_t)first,
                          .pivot = y->pivot + 2 * first,
                          .work = y->lu_work + 5 * first,
                          .x = y->lu_x + 3 * first};
}

static crm_island view_of(const crm_system *y, const crm_graph *g, const crm_block_pattern *s,
                          int island)
{
    const int node = g->node_ptr[island];
    const int contact = g->contact_ptr[island];
    const int group = g->group_ptr[island];
    const int first = node + group;
    crm_island i = {.nb = g->node_ptr[island + 1] - node,
                    .nc = g->contact_ptr[island + 1] - contact,
                    .ng = g->group_ptr[island + 1] - group,
                    .contact = y->contact + contact,
                    .group = y->group + group,
                    .free = y->free + 3 * node,
                    .contact_target = s->contact_target + contact,
                    .group_target = s->group_target + 2 * group,
                    .response = y->response + contact,
                    .key = y->key + island,
                    .key_row = y->key_row + CRM_KEY_ROW * (size_t)contact,
                    .key_response = y->key_response + contact,
                    .key_group = y->key_group + CRM_KEY_GROUP * (size_t)group,
                    .an = y->an + contact,
                    .ut = y->ut + contact,
                    .size = y->size + 3 * node,
                    .column = y->column + CRM_PATH_WORK * (size_t)contact,
                    .base_mode = y->base_mode + contact,
                    .mode = y->mode + contact,
                    .best_mode = y->best_mode + contact};
    i.lu = lu_view(y, s, first, i.nb + i.ng);
    for (int k = 0; k < CRM_N_SLACKS; k++) i.slack[k] = y->slack[k] + contact;
    set_vectors(&i, y, first, contact);
    return i;
}

carom_status crm_system_reserve(crm_memory *m, crm_system *y, const crm_graph *g,
                                const crm_block_pattern *s)
{
    crm_arena measure = {0};
    layout(&measure, y, g, s);
    const carom_status status = crm_arena_reserve(m, &y->arena, measure.used);
    if (status < 0) return status;
    layout(&y->arena, y, g, s);
    for (int i = 0; i < g->n_islands; i++) {
        y->island[i] = view_of(y, g, s, i);
        y->key[i].valid = 0;
    }
    return CAROM_OK;
}

crm_island *crm_system_begin(crm_system *y, int island)
{
    crm_island *s = &y->island[island];
    s->best_residual = HUGE_VAL;
    s->fresh = 0;
    s->compliance = CRM_COMPLIANCE;
    s->factorizations = s->iterations = s->pivots = 0;
    return s;
}

/* Impulse in the island's units: l = D V l^. */
static double scaled_impulse(double l, double scale, double speed)
{
    const double x = scale > 0 ? l / (scale * speed) : 0;
    return isfinite(x) ? x : 0;
}

void crm_system_read(const crm_system *y, const crm_graph *g, crm_island *s, int island,
                     const carom_contact_solution *x, int use_guess)
{
    const double speed = y->speed[island];
    crm_vec_zero(s, s->x);
    for (int k = 0; k < s->nc; k++) {
        const int slot = g->contact_ptr[island] + k;
        const int c = g->contact_of[slot];
        s->mode[k] = x->mode[c];
        if (use_guess != CAROM_GUESS_IMPULSES) continue;
        s->x.n[k] = scaled_impulse(x->ln[c], y->scale_n[slot], speed);
        s->x.t[k] = scaled_impulse(x->lt[c], y->scale_t[slot], speed);
    }
    if (use_guess != CAROM_GUESS_IMPULSES) return;
    for (int q = 0; q < s->ng; q++) {
        const int slot = g->group_ptr[island] + q;
        for (int i = 0; i < g->group_size[slot]; i++) {
            s->x.z[3 * (s->nb + q) + i] =
                scaled_impulse(x->le[g->group_row[slot] + i], y->scale_e[3 * slot + i], speed);
        }
    }
    crm_island_defect(s, s->x, s->rest.z); /* J' l, since w = 0 */
    memcpy(s->x.z, s->rest.z, 3 * (size_t)s->nb * sizeof(double));
}

void crm_system_set_modes(const crm_graph *g, crm_island *s, int island, const unsigned char *mode)
{
    for (int k = 0; k < s->nc; k++) {
        s->mode[k] = mode[g->contact_of[g->contact_ptr[island] + k]];
        const int slips = s->mode[k] > CAROM_STICK && s->mode[k] != CAROM_SMOOTHED;
        if (slips && !(s->contact[k].mu > 0)) s->mode[k] = CAROM_STICK;
    }
}

/* Of a body that sticks to another: its row along n is no more exact than the one along t, so that
 * its largest component sets the rounding, as far as the residual (22) does not see it: terms below
 * `floor` are not judged. */
static void share_rounding(const crm_island *s, int node, double floor, double *rounding)
{
    if (node < 0) return;
    double *r = &rounding[3 * node];
    const double *size = &s->size[3 * node];
    const double most = CRM_ROUNDING * fmax(size[0], fmax(size[1], size[2]));
    for (int i = 0; i < 3; i++) {
        r[i] = size[i] <= floor ? most : fmin(most, UNSEEN * s->accept * size[i]);
    }
}

/* Some velocity is no rounding of its own terms, but may be of its body's largest. */
static int one_is_small(const crm_island *s, const double *w)
{
    for (int i = 0; i < 3 * s->nb; i++) {
        const double *size = &s->size[i - i % 3];
        const double v = fabs(s->free[i] + w[i]);
        const double most = fmax(size[0], fmax(size[1], size[2]));
        if (v > CRM_ROUNDING * s->size[i] && v <= CRM_ROUNDING * most) return 1;
    }
    return 0;
}

/* Below what |v| is rounding of the terms of (4), where these are known. */
static void find_rounding(const crm_island *s, const double *w, double *rounding)
{
    double largest = 0;
    for (int i = 0; i < 3 * s->nb; i++) {
        rounding[i] = s->fresh ? CRM_ROUNDING * s->size[i] : 0;
        largest = fmax(largest, s->size[i]);
    }
    if (!s->fresh || !one_is_small(s, w)) return;
    for (int k = 0; k < s->nc; k++) {
        const crm_contact *c = &s->contact[k];
        if (s->best_mode[k] != CAROM_STICK || !(c->mu > 0) || !(s->best.n[k] > 0)) continue;
        share_rounding(s, c->a, CRM_TERM_FLOOR * largest, rounding);
        share_rounding(s, c->b, CRM_TERM_FLOOR * largest, rounding);
    }
}

/* v = u + V sqrt(W) w, or 0 where that is no more than rounding: a body that nothing moves then
 * stays where it is, to the last bit.  Where w differs from J' l by rounding of the velocity scale,
 * it becomes J' l: no row can see the change, and (4) then holds for small terms too. */
static void write_motion(const crm_system *y, const crm_graph *g, const carom_contact_problem *p,
                         const crm_island *s, int island, double *v)
{
    double *w = s->rest.z;
    double *rounding = s->step.z;
    crm_island_defect(s, s->best, w);
    for (int i = 0; i < 3 * s->nb; i++) {
        w[i] = s->best.z[i] + (fabs(w[i]) <= CRM_ROUNDING ? w[i] : 0);
    }
    find_rounding(s, w, rounding);
    for (int i = 0; i < 3 * s->nb; i++) {
        const int at = 3 * g->body_of[g->node_ptr[island] + i / 3] + i % 3;
        const double root = y->root[3 * g->node_ptr[island] + i];
        const int rests = root > 0 && fabs(s->free[i] + w[i]) <= rounding[i];
        v[at] = rests ? 0 : p->u[at] + y->speed[island] * root * w[i];
    }
}

void crm_system_write(const crm_system *y, const crm_graph *g, const carom_contact_problem *p,
                      const crm_island *s, int island, carom_contact_solution *x)
{
    const double speed = y->speed[island];
    write_motion(y, g, p, s, island, x->v);
    for (int k = 0; k < s->nc; k++) {
        const int slot = g->contact_ptr[island] + k;
        const int c = g->contact_of[slot];
        x->ln[c] = y->scale_n[slot] * speed * s->best.n[k];
        x->lt[c] = s->contact[k].mu > 0 ? y->scale_t[slot] * speed * s->best.t[k] : 0;
        x->mode[c] = s->best_mode[k];
        /* On the border of the cone to the last bit: large impulses round coarsely. */
        const double sign = crm_slip_sign(x->mode[c]);
        if (sign != 0 && s->best.t[k] == sign * s->contact[k].mu * s->best.n[k])
            x->lt[c] = sign * p->mu[c] * x->ln[c];
    }
    for (int q = 0; q < s->ng; q++) {
        const int slot = g->group_ptr[island] + q;
        for (int i = 0; i < g->group_size[slot]; i++) {
            x->le[g->group_row[slot] + i] =
                y->scale_e[3 * slot + i] * speed * s->best.z[3 * (s->nb + q) + i];
        }
    }
}
