/* vec.h: arithmetic of carom_vec2. */
#ifndef CRM_VEC_H
#define CRM_VEC_H

#include "carom/base.h"

#include <math.h>

static inline carom_vec2 crm_vec(double x, double y)
{
    const carom_vec2 v = {x, y};
    return v;
}

static inline carom_vec2 crm_add(carom_vec2 a, carom_vec2 b)
{
    return crm_vec(a.x + b.x, a.y + b.y);
}

static inline carom_vec2 crm_sub(carom_vec2 a, carom_vec2 b)
{
    return crm_vec(a.x - b.x, a.y - b.y);
}

static inline carom_vec2 crm_neg(carom_vec2 a)
{
    return crm_vec(-a.x, -a.y);
}

static inline carom_vec2 crm_scale(double k, carom_vec2 a)
{
    return crm_vec(k * a.x, k * a.y);
}

/* a + k b */
static inline carom_vec2 crm_add_scaled(carom_vec2 a, double k, carom_vec2 b)
{
    return crm_vec(a.x + k * b.x, a.y + k * b.y);
}

static inline double crm_dot(carom_vec2 a, carom_vec2 b)
{
    return a.x * b.x + a.y * b.y;
}

/* > 0 when b is counterclockwise of a. */
static inline double crm_cross(carom_vec2 a, carom_vec2 b)
{
    return a.x * b.y - a.y * b.x;
}

static inline double crm_length(carom_vec2 a)
{
    return sqrt(a.x * a.x + a.y * a.y);
}

/* a turned by -90 degrees: the outward normal of a counterclockwise edge a. */
static inline carom_vec2 crm_right(carom_vec2 a)
{
    return crm_vec(a.y, -a.x);
}

/* a turned by +90 degrees. */
static inline carom_vec2 crm_left(carom_vec2 a)
{
    return crm_vec(-a.y, a.x);
}

#endif
