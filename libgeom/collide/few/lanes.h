/* lanes.h: two doubles at a time.  Each lane is computed as in plain C, so the bits are the same
 * with and without SSE2. */
#ifndef CRM_LANES_H
#define CRM_LANES_H

#ifdef __SSE2__
#include <emmintrin.h>

typedef __m128d crm_lanes;

static inline crm_lanes crm_lanes_both(double a)
{
    return _mm_set1_pd(a);
}

static inline crm_lanes crm_lanes_add(crm_lanes u, crm_lanes v)
{
    return _mm_add_pd(u, v);
}

static inline crm_lanes crm_lanes_sub(crm_lanes u, crm_lanes v)
{
    return _mm_sub_pd(u, v);
}

static inline crm_lanes crm_lanes_mul(crm_lanes u, crm_lanes v)
{
    return _mm_mul_pd(u, v);
}

static inline crm_lanes crm_lanes_div(crm_lanes u, crm_lanes v)
{
    return _mm_div_pd(u, v);
}

/* u < v ? u : v and u > v ? u : v: of a NaN and v, v. */
static inline crm_lanes crm_lanes_min(crm_lanes u, crm_lanes v)
{
    return _mm_min_pd(u, v);
}

static inline crm_lanes crm_lanes_max(crm_lanes u, crm_lanes v)
{
    return _mm_max_pd(u, v);
}

static inline crm_lanes crm_lanes_abs(crm_lanes u)
{
    return _mm_andnot_pd(_mm_set1_pd(-0.0), u);
}

/* (u0, v0), (u1, v1), (u1, v0), (u0, u0), (u1, u1) */
static inline crm_lanes crm_lanes_firsts(crm_lanes u, crm_lanes v)
{
    return _mm_unpacklo_pd(u, v);
}

static inline crm_lanes crm_lanes_seconds(crm_lanes u, crm_lanes v)
{
    return _mm_unpackhi_pd(u, v);
}

static inline crm_lanes crm_lanes_across(crm_lanes u, crm_lanes v)
{
    return _mm_shuffle_pd(u, v, 1);
}

static inline double crm_lanes_first(crm_lanes u)
{
    return _mm_cvtsd_f64(u);
}

static inline double crm_lanes_second(crm_lanes u)
{
    return _mm_cvtsd_f64(_mm_unpackhi_pd(u, u));
}

/* Bit 0: u0 == v0; bit 1: u1 == v1. */
static inline int crm_lanes_equal(crm_lanes u, crm_lanes v)
{
    return _mm_movemask_pd(_mm_cmpeq_pd(u, v));
}

/* Bit 0: u0 < v0; bit 1: u1 < v1. */
static inline int crm_lanes_less(crm_lanes u, crm_lanes v)
{
    return _mm_movemask_pd(_mm_cmplt_pd(u, v));
}

/* Two doubles in memory. */
static inline crm_lanes crm_lanes_load(const double *p)
{
    return _mm_loadu_pd(p);
}

#else
#include <math.h>

typedef struct crm_lanes {
    double a;
    double b;
} crm_lanes;

static inline crm_lanes crm_lanes_of(double a, double b)
{
    const crm_lanes u = {a, b};
    return u;
}

static inline crm_lanes crm_lanes_both(double a)
{
    return crm_lanes_of(a, a);
}

static inline crm_lanes crm_lanes_add(crm_lanes u, crm_lanes v)
{
    return crm_lanes_of(u.a + v.a, u.b + v.b);
}

static inline crm_lanes crm_lanes_sub(crm_lanes u, crm_lanes v)
{
    return crm_lanes_of(u.a - v.a, u.b - v.b);
}

static inline crm_lanes crm_lanes_mul(crm_lanes u, crm_lanes v)
{
    return crm_lanes_of(u.a * v.a, u.b * v.b);
}

static inline crm_lanes crm_lanes_div(crm_lanes u, crm_lanes v)
{
    return crm_lanes_of(u.a / v.a, u.b / v.b);
}

static inline crm_lanes crm_lanes_min(crm_lanes u, crm_lanes v)
{
    return crm_lanes_of(u.a < v.a ? u.a : v.a, u.b < v.b ? u.b : v.b);
}

static inline crm_lanes crm_lanes_max(crm_lanes u, crm_lanes v)
{
    return crm_lanes_of(u.a > v.a ? u.a : v.a, u.b > v.b ? u.b : v.b);
}

static inline crm_lanes crm_lanes_abs(crm_lanes u)
{
    return crm_lanes_of(fabs(u.a), fabs(u.b));
}

static inline crm_lanes crm_lanes_firsts(crm_lanes u, crm_lanes v)
{
    return crm_lanes_of(u.a, v.a);
}

static inline crm_lanes crm_lanes_seconds(crm_lanes u, crm_lanes v)
{
    return crm_lanes_of(u.b, v.b);
}

static inline crm_lanes crm_lanes_across(crm_lanes u, crm_lanes v)
{
    return crm_lanes_of(u.b, v.a);
}

static inline double crm_lanes_first(crm_lanes u)
{
    return u.a;
}

static inline double crm_lanes_second(crm_lanes u)
{
    return u.b;
}

static inline int crm_lanes_equal(crm_lanes u, crm_lanes v)
{
    return (u.a == v.a) | (u.b == v.b) << 1;
}

static inline int crm_lanes_less(crm_lanes u, crm_lanes v)
{
    return (u.a < v.a) | (u.b < v.b) << 1;
}

static inline crm_lanes crm_lanes_load(const double *p)
{
    return crm_lanes_of(p[0], p[1]);
}
#endif

#endif
