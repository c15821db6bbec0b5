#include "libsolver/contact/residual.h"

#include "libgeom/base/memory.h"

#include <math.h>

/* The larger one; NaN counts as larger than everything. */
static double worst(double a, double b)
{
    return b <= a ? a : b;
}

double crm_row_speed(const double *row, const int *body, const double *u, double c)
{
    double terms = 0;
    for (int e = 0; e < 2; e++) {
        for (int i = 0; body[e] >= 0 && i < 3; i++)
            terms += fabs(row[3 * e + i] * u[3 * body[e] + i]);
    }
    const double speed = fabs(crm_row_times(row, body, u));
    return fmax(fmax(speed, fabs(c)), CRM_VELOCITY_FLOOR * terms);
}

double crm_contact_speed(const carom_contact_problem *p)
{
    double speed = 0;
    for (int k = 0; k < p->n_contacts; k++) {
        const int *body = p->contact_body + 2 * k;
        speed = fmax(speed, crm_row_speed(p->jn + 6 * k, body, p->u, p->cn[k]));
        if (crm_has_friction(p, k)) {
            const double c = p->ct ? p->ct[k] : 0;
            speed = fmax(speed, crm_row_speed(p->jt + 6 * k, body, p->u, c));
        }
    }
    for (int r = 0; r < p->n_joint_rows; r++) {
        const double c = p->ce ? p->ce[r] : 0;
        speed = fmax(speed, crm_row_speed(p->je + 6 * r, p->joint_body + 2 * r, p->u, c));
    }
    return speed < CRM_VELOCITY_NONE ? 1 : speed;
}

/* s += J' l, size += |J|' |l| of one row. */
static void add_row(const double *row, const int *body, double l, double *s, double *size)
{
    for (int e = 0; e < 2; e++) {
        if (body[e] < 0) continue;
        for (int i = 0; i < 3; i++) {
            const double term = row[3 * e + i] * l;
            s[3 * body[e] + i] += term;
            size[3 * body[e] + i] += fabs(term);
        }
    }
}

static void add_rows(const carom_contact_problem *p, const carom_contact_solution *x, double *s,
                     double *size)
{
    for (int k = 0; k < p->n_contacts; k++) {
        const int *body = p->contact_body + 2 * k;
        add_row(p->jn + 6 * k, body, x->ln[k], s, size);
        if (crm_has_friction(p, k)) add_row(p->jt + 6 * k, body, x->lt[k], s, size);
    }
    for (int r = 0; r < p->n_joint_rows; r++)
        add_row(p->je + 6 * r, p->joint_body + 2 * r, x->le[r], s, size);
}

/* Componentwise backward error of v = u + W J' l.  Terms compare in the mass metric, v / sqrt(W).
 */
static double motion_error(const carom_contact_problem *p, const carom_contact_solution *x,
                           double *s, double *size)
{
    const int n = 3 * p->n_bodies;
    memset(s, 0, (size_t)n * sizeof *s);
    memset(size, 0, (size_t)n * sizeof *size);
    add_rows(p, x, s, size);
    double largest = 0;
    for (int i = 0; i < n; i++) {
        const double w = p->inv_mass[i];
        s[i] = x->v[i] - p->u[i] - w * s[i];
        size[i] = fabs(x->v[i]) + fabs(p->u[i]) + w * size[i];
        if (w > 0) largest = worst(largest, size[i] / sqrt(w));
    }
    double error = 0;
    for (int i = 0; i < n; i++) {
        const double w = p->inv_mass[i];
        const double floor = w > 0 ? CRM_TERM_FLOOR * largest * sqrt(w) : 0;
        if (!(size[i] <= floor)) error = worst(error, fabs(s[i]) / size[i]);
    }
    return error;
}

double crm_friction_error(double bound, double lt, double u, double w)
{
    const double t = lt - u / w;
    if (t > bound) return w * fabs(lt - bound);
    if (t < -bound) return w * fabs(lt + bound);
    return isnan(t) ? t : fabs(u);
}

static double contact_error(const carom_contact_problem *p, const carom_contact_solution *x, int k)
{
    const int *body = p->contact_body + 2 * k;
    const double *jn = p->jn + 6 * k;
    const double a = crm_row_times(jn, body, x->v) + p->cn[k];
    const double wn = crm_row_weight(jn, body, p->inv_mass);
    double error = isnan(a) ? a : fabs(fmin(a, wn * x->ln[k]));
    if (!crm_has_friction(p, k)) return error;
    const double *jt = p->jt + 6 * k;
    const double wt = crm_row_weight(jt, body, p->inv_mass);
    if (!(wt > 0)) return error; /* nothing that l_t does can be felt */
    const double u = crm_row_times(jt, body, x->v) + (p->ct ? p->ct[k] : 0);
    return worst(error, crm_friction_error(p->mu[k] * fmax(x->ln[k], 0), x->lt[k], u, wt));
}

double crm_contact_residual(const carom_contact_problem *p, const carom_contact_solution *x,
                            double speed, double *scratch)
{
    double rows = 0;
    for (int k = 0; k < p->n_contacts; k++) {
        if (isnan(x->ln[k]) || isnan(x->lt[k])) return HUGE_VAL;
        rows = worst(rows, contact_error(p, x, k));
    }
    for (int r = 0; r < p->n_joint_rows; r++) {
        const double c = p->ce ? p->ce[r] : 0;
        rows = worst(rows, fabs(crm_row_times(p->je + 6 * r, p->joint_body + 2 * r, x->v) + c));
    }
    const double motion = motion_error(p, x, scratch, scratch + 3 * p->n_bodies);
    const double error = worst(motion, rows / speed);
    return error <= HUGE_VAL ? error : HUGE_VAL;
}

double carom_contact_residual(const carom_contact_problem *problem, const carom_contact_solution *x)
{
    crm_memory m = crm_memory_from(NULL);
    const size_t n = 6 * (size_t)problem->n_bodies;
    double *scratch = crm_new(&m, n, sizeof *scratch);
    if (!scratch) return HUGE_VAL;
    const double error = crm_contact_residual(problem, x, crm_contact_speed(problem), scratch);
    crm_free(&m, scratch, n, sizeof *scratch);
    return error;
}
