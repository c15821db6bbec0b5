/* anderson.c: Anderson acceleration, type II; Walker and Ni, SIAM J. Numer. Anal. 49 (2011). */
#include "world/anderson.h"

#include <math.h>

/* A difference that others explain to within this tells nothing new [1]. */
static const double DEPENDENT = 1e-8;
enum { ARRAYS = 4 + 3 * CRM_ANDERSON_DEPTH };

carom_status crm_anderson_start(crm_memory *m, crm_anderson *a, int n)
{
    if (n > a->max) {
        const int max = n + n / 2;
        double *block = crm_new(m, (size_t)max, ARRAYS * sizeof *block);
        if (!block) return CAROM_E_MEMORY;
        crm_free(m, a->block, (size_t)a->max, ARRAYS * sizeof *block);
        a->block = block;
        a->max = max;
        const size_t step = (size_t)max;
        a->x = block;
        a->f = block + step;
        a->point = block + 2 * step;
        a->value = block + 3 * step;
        for (int k = 0; k < CRM_ANDERSON_DEPTH; k++) {
            a->dx[k] = block + (size_t)(4 + 3 * k) * step;
            a->df[k] = a->dx[k] + step;
            a->base[k] = a->df[k] + step;
        }
    }
    a->n = n;
    crm_anderson_forget(a);
    return CAROM_OK;
}

void crm_anderson_free(crm_memory *m, crm_anderson *a)
{
    crm_free(m, a->block, (size_t)a->max, ARRAYS * sizeof *a->block);
    memset(a, 0, sizeof *a);
}

void crm_anderson_forget(crm_anderson *a)
{
    a->filled = 0;
    a->at = 0;
    a->begun = 0;
}

static double dot(int n, const double *x, const double *y)
{
    double sum = 0;
    for (int i = 0; i < n; i++) sum += x[i] * y[i];
    return sum;
}

static void add(int n, double *x, double a, const double *y)
{
    for (int i = 0; i < n; i++) x[i] += a * y[i];
}

/* Differences to the last iteration, then this one in its place. */
static void take(crm_anderson *a)
{
    double *dx = a->dx[a->at];
    double *df = a->df[a->at];
    for (int i = 0; i < a->n; i++) {
        const double f = a->value[i] - a->point[i];
        dx[i] = a->point[i] - a->x[i];
        df[i] = f - a->f[i];
        a->x[i] = a->point[i];
        a->f[i] = f;
    }
    if (a->begun) {
        a->at = (a->at + 1) % CRM_ANDERSON_DEPTH;
        if (a->filled < CRM_ANDERSON_DEPTH) a->filled++;
    }
    a->begun = 1;
}

/* The k-th newest difference. */
static int newest(const crm_anderson *a, int k)
{
    return (a->at + CRM_ANDERSON_DEPTH - 1 - k) % CRM_ANDERSON_DEPTH;
}

/* df of the k-th newest, less its parts along the newer ones, into base[k], normalized; r[j] are
 * those parts and r[k] what is left, 0 when that is nothing. */
static void orthogonalize(const crm_anderson *a, int k, double *r)
{
    const double *df = a->df[newest(a, k)];
    double *y = a->base[k];
    const double all = sqrt(dot(a->n, df, df));
    memcpy(y, df, (size_t)a->n * sizeof *y);
    for (int j = 0; j < k; j++) {
        r[j] = dot(a->n, a->base[j], y);
        add(a->n, y, -r[j], a->base[j]);
    }
    const double left = sqrt(dot(a->n, y, y));
    r[k] = left > DEPENDENT * all && left < HUGE_VAL ? left : 0;
    for (int i = 0; i < a->n; i++) y[i] = r[k] > 0 ? y[i] / r[k] : 0;
}

void crm_anderson_next(crm_anderson *a)
{
    double r[CRM_ANDERSON_DEPTH][CRM_ANDERSON_DEPTH];
    double share[CRM_ANDERSON_DEPTH];
    take(a);
    for (int k = 0; k < a->filled; k++) {
        orthogonalize(a, k, r[k]);
        share[k] = dot(a->n, a->base[k], a->f);
    }
    memcpy(a->point, a->value, (size_t)a->n * sizeof *a->point);
    for (int k = a->filled - 1; k >= 0; k--) {
        if (r[k][k] <= 0) continue;
        double g = share[k];
        for (int j = k + 1; j < a->filled; j++) {
            if (r[j][j] > 0) g -= r[j][k] * share[j];
        }
        share[k] = g / r[k][k];
        add(a->n, a->point, -share[k], a->dx[newest(a, k)]);
        add(a->n, a->point, -share[k], a->df[newest(a, k)]);
    }
}
