/* residual.h: velocity scale and natural residual of a contact problem in its own units. */
#ifndef CRM_CONTACT_RESIDUAL_H
#define CRM_CONTACT_RESIDUAL_H

#include "carom/contact.h"

/* A velocity below this share of |J| |u| is rounding: J u cannot be known better, and a residual of
 * 1e-10 of it cannot be reached [1]. */
#define CRM_VELOCITY_FLOOR 1e-5

/* Below this no scale is left [m/s]. */
#define CRM_VELOCITY_NONE 1e-200

/* A term of (4) below this share of the largest, both in the mass metric, is rounding [1]. */
#define CRM_TERM_FLOOR 1e-14

/* Contact k has a tangential row. */
static inline int crm_has_friction(const carom_contact_problem *p, int k)
{
    return p->mu[k] > 0;
}

/* The two bodies' parts of a row. */
static inline double crm_row_times(const double *row, const int *body, const double *v)
{
    double s = 0;
    for (int e = 0; e < 2; e++) {
        const double *r = row + 3 * e;
        const double *x = v + 3 * body[e];
        if (body[e] >= 0) s += r[0] * x[0] + r[1] * x[1] + r[2] * x[2];
    }
    return s;
}

/* v += row' l. */
static inline void crm_row_add(double *v, const double *row, const int *body, double l)
{
    for (int e = 0; e < 2; e++) {
        for (int i = 0; body[e] >= 0 && i < 3; i++) v[3 * body[e] + i] += row[3 * e + i] * l;
    }
}

/* row diag(W) row', the inverse mass that the row feels. */
static inline double crm_row_weight(const double *row, const int *body, const double *inv_mass)
{
    double s = 0;
    for (int e = 0; e < 2; e++) {
        for (int i = 0; body[e] >= 0 && i < 3; i++)
            s += row[3 * e + i] * row[3 * e + i] * inv_mass[3 * body[e] + i];
    }
    return s;
}

/* w |l_t - clip(l_t - u / w, -bound, bound)|, without the rounding of l_t where it sticks. */
double crm_friction_error(double bound, double lt, double u, double w);

/* max(|J u|, |c|, floor |J| |u|) of one row [m/s]. */
double crm_row_speed(const double *row, const int *body, const double *u, double c);

/* V of (21) over all rows of the problem; 1 when there is no scale. */
double crm_contact_speed(const carom_contact_problem *p);

/* carom_contact_residual with V known and scratch of 6 n_bodies doubles. */
double crm_contact_residual(const carom_contact_problem *p, const carom_contact_solution *x,
                            double speed, double *scratch);

#endif
