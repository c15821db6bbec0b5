/* quad.h: four doubles at a time: with AVX2 in one piece, without in two.  Each is computed as in
 * plain C, so the bits are the same. */
#ifndef CRM_QUAD_H
#define CRM_QUAD_H

#include "collide/few/lanes.h"

#ifdef __AVX2__
#include <immintrin.h>

typedef __m256d crm_quad;

static inline crm_quad crm_quad_all(double a)
{
    return _mm256_set1_pd(a);
}

static inline crm_quad crm_quad_join(crm_lanes u, crm_lanes v)
{
    return _mm256_insertf128_pd(_mm256_castpd128_pd256(u), v, 1);
}

static inline crm_lanes crm_quad_low(crm_quad u)
{
    return _mm256_castpd256_pd128(u);
}

static inline crm_lanes crm_quad_high(crm_quad u)
{
    return _mm256_extractf128_pd(u, 1);
}

static inline crm_quad crm_quad_add(crm_quad u, crm_quad v)
{
    return _mm256_add_pd(u, v);
}

static inline crm_quad crm_quad_sub(crm_quad u, crm_quad v)
{
    return _mm256_sub_pd(u, v);
}

static inline crm_quad crm_quad_mul(crm_quad u, crm_quad v)
{
    return _mm256_mul_pd(u, v);
}

static inline crm_quad crm_quad_div(crm_quad u, crm_quad v)
{
    return _mm256_div_pd(u, v);
}

static inline crm_quad crm_quad_min(crm_quad u, crm_quad v)
{
    return _mm256_min_pd(u, v);
}

static inline crm_quad crm_quad_max(crm_quad u, crm_quad v)
{
    return _mm256_max_pd(u, v);
}

static inline crm_quad crm_quad_abs(crm_quad u)
{
    return _mm256_andnot_pd(_mm256_set1_pd(-0.0), u);
}

/* Bit i: u_i < v_i, u_i == v_i. */
static inline int crm_quad_less(crm_quad u, crm_quad v)
{
    return _mm256_movemask_pd(_mm256_cmp_pd(u, v, _CMP_LT_OQ));
}

static inline int crm_quad_equal(crm_quad u, crm_quad v)
{
    return _mm256_movemask_pd(_mm256_cmp_pd(u, v, _CMP_EQ_OQ));
}

/* (u1, u2, u3, v0) */
static inline crm_quad crm_quad_shift(crm_quad u, crm_quad v)
{
    return _mm256_permute4x64_pd(_mm256_blend_pd(u, v, 1), 0x39);
}

/* u_j four times. */
static inline crm_quad crm_quad_repeat(crm_quad u, int j)
{
    switch (j) {
    case 0: return _mm256_permute4x64_pd(u, 0x00);
    case 1: return _mm256_permute4x64_pd(u, 0x55);
    case 2: return _mm256_permute4x64_pd(u, 0xaa);
    default: return _mm256_permute4x64_pd(u, 0xff);
    }
}

#else
typedef struct crm_quad {
    crm_lanes low;
    crm_lanes high;
} crm_quad;

static inline crm_quad crm_quad_join(crm_lanes u, crm_lanes v)
{
    const crm_quad q = {u, v};
    return q;
}

static inline crm_quad crm_quad_all(double a)
{
    return crm_quad_join(crm_lanes_both(a), crm_lanes_both(a));
}

static inline crm_lanes crm_quad_low(crm_quad u)
{
    return u.low;
}

static inline crm_lanes crm_quad_high(crm_quad u)
{
    return u.high;
}

static inline crm_quad crm_quad_add(crm_quad u, crm_quad v)
{
    return crm_quad_join(crm_lanes_add(u.low, v.low), crm_lanes_add(u.high, v.high));
}

static inline crm_quad crm_quad_sub(crm_quad u, crm_quad v)
{
    return crm_quad_join(crm_lanes_sub(u.low, v.low), crm_lanes_sub(u.high, v.high));
}

static inline crm_quad crm_quad_mul(crm_quad u, crm_quad v)
{
    return crm_quad_join(crm_lanes_mul(u.low, v.low), crm_lanes_mul(u.high, v.high));
}

static inline crm_quad crm_quad_div(crm_quad u, crm_quad v)
{
    return crm_quad_join(crm_lanes_div(u.low, v.low), crm_lanes_div(u.high, v.high));
}

static inline crm_quad crm_quad_min(crm_quad u, crm_quad v)
{
    return crm_quad_join(crm_lanes_min(u.low, v.low), crm_lanes_min(u.high, v.high));
}

static inline crm_quad crm_quad_max(crm_quad u, crm_quad v)
{
    return crm_quad_join(crm_lanes_max(u.low, v.low), crm_lanes_max(u.high, v.high));
}

static inline crm_quad crm_quad_abs(crm_quad u)
{
    return crm_quad_join(crm_lanes_abs(u.low), crm_lanes_abs(u.high));
}

static inline int crm_quad_less(crm_quad u, crm_quad v)
{
    return crm_lanes_less(u.low, v.low) | crm_lanes_less(u.high, v.high) << 2;
}

static inline int crm_quad_equal(crm_quad u, crm_quad v)
{
    return crm_lanes_equal(u.low, v.low) | crm_lanes_equal(u.high, v.high) << 2;
}

static inline crm_quad crm_quad_shift(crm_quad u, crm_quad v)
{
    return crm_quad_join(crm_lanes_across(u.low, u.high), crm_lanes_across(u.high, v.low));
}

static inline crm_quad crm_quad_repeat(crm_quad u, int j)
{
    const crm_lanes half = j < 2 ? u.low : u.high;
    const crm_lanes x = j & 1 ? crm_lanes_seconds(half, half) : crm_lanes_firsts(half, half);
    return crm_quad_join(x, x);
}
#endif

static inline crm_quad crm_quad_dot(crm_quad ux, crm_quad uy, crm_quad vx, crm_quad vy)
{
    return crm_quad_add(crm_quad_mul(ux, vx), crm_quad_mul(uy, vy));
}

#endif
