#include "world/coder.h"

#include <float.h>
#include <string.h>

uint64_t crm_hash_bytes(uint64_t hash, size_t n, const unsigned char *bytes)
{
    for (size_t k = 0; k < n; k++) hash = (hash ^ bytes[k]) * UINT64_C(1099511628211);
    return hash;
}

void crm_put_u64(unsigned char *to, uint64_t x)
{
    for (int k = 0; k < 8; k++) to[k] = (unsigned char)(x >> 8 * k);
}

uint64_t crm_get_u64(const unsigned char *from)
{
    uint64_t x = 0;
    for (int k = 0; k < 8; k++) x |= (uint64_t)from[k] << 8 * k;
    return x;
}

/* *x is given, or taken where there is none left: 0. */
static void code(crm_coder *c, uint64_t *x)
{
    unsigned char bytes[8];
    if (crm_coder_reads(c)) {
        const int left = c->size - c->at >= sizeof bytes;
        *x = left ? crm_get_u64(c->from + c->at) : 0;
        c->bad |= !left;
        c->at += left ? sizeof bytes : 0;
        return;
    }
    crm_put_u64(bytes, *x);
    if (c->how == CRM_WRITE) memcpy(c->to + c->at, bytes, sizeof bytes);
    if (c->how == CRM_HASH) c->hash = crm_hash_bytes(c->hash, sizeof bytes, bytes);
    c->at += sizeof bytes;
}

void crm_code_number(crm_coder *c, double *x, double low, double high)
{
    uint64_t bits;
    memcpy(&bits, x, sizeof bits);
    code(c, &bits);
    if (!crm_coder_reads(c)) return;
    memcpy(x, &bits, sizeof bits);
    if (!(*x >= low && *x <= high)) c->bad = 1;
}

void crm_code_whole(crm_coder *c, long *x, long low, long high)
{
    uint64_t bits = (uint64_t)(int64_t)*x;
    code(c, &bits);
    if (!crm_coder_reads(c)) return;
    /* two's complement without leaving the range of a type */
    const int64_t value = bits >> 63 ? -(int64_t)~bits - 1 : (int64_t)bits;
    const int fits = value >= low && value <= high;
    *x = fits ? (long)value : low;
    c->bad |= !fits;
}

void crm_code_int(crm_coder *c, int *x, int low, int high)
{
    long wide = *x;
    crm_code_whole(c, &wide, low, high);
    *x = (int)wide;
}

void crm_code_byte(crm_coder *c, unsigned char *x, int high)
{
    int wide = *x;
    crm_code_int(c, &wide, 0, high);
    *x = (unsigned char)wide;
}

void crm_code_place(crm_coder *c, double *place, double low, double high)
{
    double x = *place;
    crm_code_number(c, &x, low, high);
    if (c->how == CRM_READ) *place = x;
}

void crm_code_places(crm_coder *c, size_t n, double *places)
{
    for (size_t k = 0; k < n; k++) crm_code_place(c, &places[k], -DBL_MAX, DBL_MAX);
}
