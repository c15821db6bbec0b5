#include "libsolver/contact/island.h"

#include "libsolver/contact/residual.h"

#include <float.h>
#include <math.h>

void crm_vec_copy(const crm_island *s, crm_vec to, crm_vec from)
{
    memcpy(to.z, from.z, 3 * (size_t)(s->nb + s->ng) * sizeof(double));
    memcpy(to.n, from.n, (size_t)s->nc * sizeof(double));
    memcpy(to.t, from.t, (size_t)s->nc * sizeof(double));
}

void crm_vec_zero(const crm_island *s, crm_vec x)
{
    memset(x.z, 0, 3 * (size_t)(s->nb + s->ng) * sizeof(double));
    memset(x.n, 0, (size_t)s->nc * sizeof(double));
    memset(x.t, 0, (size_t)s->nc * sizeof(double));
}

void crm_vec_add(const crm_island *s, crm_vec x, double a, crm_vec y)
{
    for (int i = 0; i < 3 * (s->nb + s->ng); i++) x.z[i] += a * y.z[i];
    for (int k = 0; k < s->nc; k++) {
        x.n[k] += a * y.n[k];
        x.t[k] += a * y.t[k];
    }
}

void crm_island_defect(const crm_island *s, crm_vec x, double *z)
{
    for (int i = 0; i < 3 * s->nb; i++) z[i] = -x.z[i];
    for (int k = 0; k < s->nc; k++) {
        const crm_contact *c = &s->contact[k];
        crm_add(z, c->n, c->a, c->b, x.n[k]);
        if (c->mu > 0) crm_add(z, c->t, c->a, c->b, x.t[k]);
    }
    for (int q = 0; q < s->ng; q++) {
        const crm_group *g = &s->group[q];
        const int at = 3 * (s->nb + q);
        for (int r = 0; r < g->n; r++) {
            crm_add(z, g->j[r], g->a, g->b, x.z[at + r]);
            z[at + r] = -(crm_dot(g->left[r], g->a, g->b, x.z) + g->c[r]);
        }
        for (int r = g->n; r < CRM_GROUP_ROWS; r++) z[at + r] = 0;
    }
}

static double worst(double a, double b)
{
    return b <= a ? a : b;
}

static void add_size(double *size, const double *row, int a, int b, double l)
{
    for (int i = 0; a >= 0 && i < 3; i++) size[3 * a + i] += fabs(row[i] * l);
    for (int i = 0; b >= 0 && i < 3; i++) size[3 * b + i] += fabs(row[3 + i] * l);
}

void crm_island_term_sizes(const crm_island *s, crm_vec x, double *size)
{
    for (int i = 0; i < 3 * s->nb; i++) size[i] = fabs(s->free[i] + x.z[i]) + fabs(s->free[i]);
    for (int k = 0; k < s->nc; k++) {
        const crm_contact *c = &s->contact[k];
        add_size(size, c->n, c->a, c->b, x.n[k]);
        if (c->mu > 0) add_size(size, c->t, c->a, c->b, x.t[k]);
    }
    for (int q = 0; q < s->ng; q++) {
        const crm_group *g = &s->group[q];
        for (int r = 0; r < g->n; r++)
            add_size(size, g->j[r], g->a, g->b, x.z[3 * (s->nb + q) + r]);
    }
}

/* Componentwise backward error of (4); defects that the result will not have do not count. */
static double motion_error(const crm_island *s, crm_vec x, const double *defect)
{
    double *size = s->size;
    crm_island_term_sizes(s, x, size);
    double largest = 0;
    for (int i = 0; i < 3 * s->nb; i++) largest = worst(largest, size[i]);
    double error = 0;
    for (int b = 0; b < s->nb; b++) {
        const double *z = size + 3 * b;
        for (int i = 0; i < 3; i++) {
            const double d = fabs(defect[3 * b + i]);
            if (d <= CRM_ROUNDING || z[i] <= CRM_TERM_FLOOR * largest) continue;
            error = worst(error, d / z[i]);
        }
    }
    return error;
}

double crm_island_residual(crm_island *s, crm_vec x)
{
    double error = 0;
    s->fresh = 0;
    for (int k = 0; k < s->nc; k++) {
        const crm_contact *c = &s->contact[k];
        const double a = crm_dot(c->n, c->a, c->b, x.z) + c->cn;
        s->an[k] = a;
        if (isnan(a) || isnan(x.n[k])) return HUGE_VAL;
        error = worst(error, fabs(fmin(a, x.n[k])) * c->residual_n);
        s->ut[k] = 0;
        if (!(c->mu > 0)) continue;
        const double u = crm_dot(c->t, c->a, c->b, x.z) + c->ct;
        s->ut[k] = u;
        const double e = crm_friction_error(c->mu * fmax(x.n[k], 0), x.t[k], u, 1);
        error = worst(error, e * c->residual_t);
    }
    double *defect = s->rest.z;
    crm_island_defect(s, x, defect);
    for (int q = 0; q < s->ng; q++) {
        for (int r = 0; r < CRM_GROUP_ROWS; r++)
            error = worst(error, fabs(defect[3 * (s->nb + q) + r]) * s->group[q].residual[r]);
    }
    error = worst(error, motion_error(s, x, defect));
    return error <= HUGE_VAL ? error : HUGE_VAL;
}

carom_contact_mode crm_contact_mode_of(const crm_contact *c, double ln, double lt, double a,
                                       double u)
{
    if (!(ln > a)) return CAROM_SEPARATED;
    if (!(c->mu > 0)) return CAROM_STICK;
    const double bound = c->mu * fmax(ln, 0);
    if (lt - u < -bound) return CAROM_SLIP_MINUS;
    return lt - u > bound ? CAROM_SLIP_PLUS : CAROM_STICK;
}

int crm_island_offer(crm_island *s, crm_vec x, double r)
{
    if (r < s->best_residual) {
        s->best_residual = r;
        s->fresh = 1; /* callers measure, then offer */
        crm_vec_copy(s, s->best, x);
        memcpy(s->best_mode, s->mode, (size_t)s->nc);
    }
    return s->best_residual <= s->accept;
}

/* block += J_1' W J_2, with J_1, J_2 the rows' parts of two nodes. */
static inline void add_block(double *block, const double *n1, const double *t1, const double *n2,
                             const double *t2, const crm_response *w)
{
    for (int c = 0; c < 3; c++) {
        const double fn = w->nn * n2[c];
        const double ft = w->tn * n2[c] + w->tt * t2[c];
        for (int r = 0; r < 3; r++) block[3 * r + c] += n1[r] * fn + t1[r] * ft;
    }
}

static void assemble_contact(crm_island *s, int k)
{
    const crm_contact *c = &s->contact[k];
    const crm_response *w = &s->response[k];
    const crm_block_lu *f = &s->lu;
    if (w->nn == 0 && w->tt == 0) return; /* exact: a separated contact */
    const double *nb = c->n + 3;
    const double *tb = c->t + 3;
    if (c->a >= 0) add_block(f->d + 9 * (size_t)f->place[c->a], c->n, c->t, c->n, c->t, w);
    if (c->b >= 0) add_block(f->d + 9 * (size_t)f->place[c->b], nb, tb, nb, tb, w);
    if (c->a < 0 || c->b < 0) return;
    const int m = s->contact_target[k];
    double *ab = m >= 0 ? f->l + 9 * (size_t)m : f->u + 9 * (size_t)(-1 - m);
    double *ba = m >= 0 ? f->u + 9 * (size_t)m : f->l + 9 * (size_t)(-1 - m);
    add_block(ab, c->n, c->t, nb, tb, w);
    add_block(ba, nb, tb, c->n, c->t, w);
}

static void assemble_group(crm_island *s, int q, double delta)
{
    const crm_group *g = &s->group[q];
    const crm_block_lu *f = &s->lu;
    double *d = f->d + 9 * (size_t)f->place[s->nb + q];
    for (int r = 0; r < CRM_GROUP_ROWS; r++) d[4 * r] = -delta;
    for (int e = 0; e < 2; e++) {
        if ((e ? g->b : g->a) < 0) continue;
        const int m = s->group_target[2 * q + e];
        double *jb = m >= 0 ? f->l + 9 * (size_t)m : f->u + 9 * (size_t)(-1 - m);
        double *bj = m >= 0 ? f->u + 9 * (size_t)m : f->l + 9 * (size_t)(-1 - m);
        for (int r = 0; r < CRM_GROUP_ROWS; r++) {
            for (int i = 0; i < 3; i++) {
                jb[3 * r + i] = g->left[r][3 * e + i];
                bj[3 * i + r] = g->j[r][3 * e + i];
            }
        }
    }
}

void crm_island_assemble(crm_island *s, double shift, double delta)
{
    const crm_block_lu *f = &s->lu;
    const size_t from = 9 * (size_t)f->lp[0];
    const size_t n = 9 * (size_t)(f->lp[f->n] - f->lp[0]);
    memset(f->l + from, 0, n * sizeof(double));
    memset(f->u + from, 0, n * sizeof(double));
    memset(f->d, 0, 9 * (size_t)f->n * sizeof(double));
    for (int b = 0; b < s->nb; b++) {
        double *d = f->d + 9 * (size_t)f->place[b];
        for (int i = 0; i < 3; i++) d[4 * i] = shift;
    }
    for (int k = 0; k < s->nc; k++) assemble_contact(s, k);
    for (int q = 0; q < s->ng; q++) assemble_group(s, q, delta);
}

/* n and t of a contact lie one behind the other, as do both rows of a group. */
static int key_holds(const crm_island *s, double shift, double delta)
{
    const crm_factor_key *key = s->key;
    if (!key->valid || key->shift != shift || key->delta != delta) return 0;
    if (s->nc && memcmp(s->key_response, s->response, (size_t)s->nc * sizeof *s->response)) {
        return 0;
    }
    for (int k = 0; k < s->nc; k++) {
        if (memcmp(s->key_row + CRM_KEY_ROW * k, s->contact[k].n, CRM_KEY_ROW * sizeof(double))) {
            return 0;
        }
    }
    for (int q = 0; q < s->ng; q++) {
        const double *row = s->key_group + CRM_KEY_GROUP * q;
        if (memcmp(row, s->group[q].j, CRM_KEY_GROUP * sizeof *row)) return 0;
    }
    return 1;
}

static void set_key(crm_island *s, double shift, double delta)
{
    const crm_factor_key key = {1, shift, delta};
    *s->key = key;
    for (int k = 0; k < s->nc; k++) {
        s->key_response[k] = s->response[k];
        memcpy(s->key_row + CRM_KEY_ROW * k, s->contact[k].n, CRM_KEY_ROW * sizeof(double));
    }
    for (int q = 0; q < s->ng; q++) {
        double *row = s->key_group + CRM_KEY_GROUP * q;
        memcpy(row, s->group[q].j, CRM_KEY_GROUP * sizeof *row);
    }
}

void crm_island_factor(crm_island *s, double shift, double delta)
{
    if (key_holds(s, shift, delta)) return;
    set_key(s, shift, delta);
    crm_island_assemble(s, shift, delta);
    crm_block_factor(&s->lu);
    s->factorizations++;
}

/* The factored matrix has J_e' and -delta: its multipliers have the other sign. */
static void negate_multipliers(const crm_island *s, double *x)
{
    for (int i = 3 * s->nb; i < 3 * (s->nb + s->ng); i++) x[i] = -x[i];
}

void crm_island_solve(crm_island *s, double *x)
{
    crm_block_solve(&s->lu, x);
    negate_multipliers(s, x);
}

void crm_island_solve_transposed(crm_island *s, double *x)
{
    negate_multipliers(s, x);
    crm_block_solve_transposed(&s->lu, x);
}

/* z += J' W r of contact k. */
static void add_response(const crm_island *s, int k, double rn, double rt, double *z)
{
    const crm_contact *c = &s->contact[k];
    const crm_response *w = &s->response[k];
    crm_add(z, c->n, c->a, c->b, w->nn * rn);
    if (c->mu > 0) crm_add(z, c->t, c->a, c->b, w->tn * rn + w->tt * rt);
}

void crm_island_reduce(crm_island *s, crm_vec r, crm_vec step)
{
    memcpy(step.z, r.z, 3 * (size_t)(s->nb + s->ng) * sizeof(double));
    for (int k = 0; k < s->nc; k++) add_response(s, k, r.n[k], r.t[k], step.z);
    crm_island_solve(s, step.z);
    for (int k = 0; k < s->nc; k++) {
        const crm_contact *c = &s->contact[k];
        const crm_response *w = &s->response[k];
        const double rn = r.n[k] - crm_dot(c->n, c->a, c->b, step.z);
        const double rt = c->mu > 0 ? r.t[k] - crm_dot(c->t, c->a, c->b, step.z) : 0;
        step.n[k] = w->nn * rn;
        step.t[k] = w->tn * rn + w->tt * rt;
    }
}
