#include "libsolver/contact/check.h"

#include "libsolver/contact/residual.h"

/* 0 x is 0 for finite x and NaN for all others: the sum tells them apart without branches. */
static int all_finite(const double *x, int n)
{
    double s = 0;
    for (int i = 0; i < n; i++) s += 0 * x[i];
    return s == 0;
}

static int all_nonnegative(const double *x, int n)
{
    int ok = 1;
    for (int i = 0; i < n; i++) ok &= x[i] >= 0;
    return ok && all_finite(x, n);
}

/* Two bodies, or the world; never one body twice. */
static int pairs_valid(const int *body, int n, int n_bodies)
{
    for (int i = 0; i < n; i++) {
        const int a = body[2 * i];
        const int b = body[2 * i + 1];
        if (a < -1 || a >= n_bodies || b < -1 || b >= n_bodies || (a == b && a >= 0)) return 0;
    }
    return 1;
}

/* The world's coefficients are not read. */
static int row_finite(const double *row, const int *body)
{
    return (body[0] < 0 || all_finite(row, 3)) && (body[1] < 0 || all_finite(row + 3, 3));
}

static int contacts_valid(const carom_contact_problem *p)
{
    const int n = p->n_contacts;
    if (!n) return 1;
    if (!p->contact_body || !p->jn || !p->mu || !p->cn) return 0;
    if (!pairs_valid(p->contact_body, n, p->n_bodies) || !all_nonnegative(p->mu, n) ||
        !all_finite(p->cn, n) || (p->ct && !all_finite(p->ct, n)))
        return 0;
    for (int k = 0; k < n; k++) {
        const int *body = p->contact_body + 2 * k;
        if (!row_finite(p->jn + 6 * k, body)) return 0;
        if (!crm_has_friction(p, k)) continue;
        if (!p->jt || !row_finite(p->jt + 6 * k, body)) return 0;
    }
    return 1;
}

static int joints_valid(const carom_contact_problem *p)
{
    const int n = p->n_joint_rows;
    if (!n) return 1;
    if (!p->joint_body || !p->je || !pairs_valid(p->joint_body, n, p->n_bodies) ||
        (p->ce && !all_finite(p->ce, n)))
        return 0;
    for (int r = 0; r < n; r++) {
        if (!row_finite(p->je + 6 * r, p->joint_body + 2 * r)) return 0;
        if (p->je_left && !row_finite(p->je_left + 6 * r, p->joint_body + 2 * r)) return 0;
    }
    return 1;
}

carom_status crm_contact_check(const carom_contact_problem *p)
{
    if (!p || p->n_bodies < 0 || p->n_contacts < 0 || p->n_joint_rows < 0) return CAROM_E_ARGUMENT;
    if (p->n_bodies && (!p->inv_mass || !p->u)) return CAROM_E_ARGUMENT;
    if (p->n_bodies > CRM_MAX_COUNT || p->n_contacts > CRM_MAX_COUNT ||
        p->n_joint_rows > CRM_MAX_COUNT)
        return CAROM_E_CAPACITY;
    if (!all_nonnegative(p->inv_mass, 3 * p->n_bodies) || !all_finite(p->u, 3 * p->n_bodies) ||
        !contacts_valid(p) || !joints_valid(p))
        return CAROM_E_ARGUMENT;
    return CAROM_OK;
}

carom_status crm_solution_check(const carom_contact_problem *p, const carom_contact_solution *x)
{
    if (!x || (p->n_bodies && !x->v) || (p->n_joint_rows && !x->le) ||
        (p->n_contacts && (!x->ln || !x->lt || !x->mode)))
        return CAROM_E_ARGUMENT;
    return CAROM_OK;
}

int crm_modes_valid(const carom_contact_problem *p, const unsigned char *mode)
{
    for (int k = 0; k < p->n_contacts; k++) {
        if (mode[k] > CAROM_SLIP_PLUS && mode[k] != CAROM_SMOOTHED) return 0;
    }
    return 1;
}
