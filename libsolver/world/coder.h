/* coder.h: numbers to bytes and back: one function per kind of thing says what it consists of, and
 * counts, writes, checks, reads or hashes it. */
#ifndef CRM_WORLD_CODER_H
#define CRM_WORLD_CODER_H

#include <stddef.h>
#include <stdint.h>

typedef enum crm_coding {
    CRM_COUNT, /* only the size */
    CRM_WRITE,
    CRM_CHECK, /* reads, and judges each number by its range */
    CRM_READ,  /* what was checked */
    CRM_HASH
} crm_coding;

typedef struct crm_coder {
    crm_coding how;
    unsigned char *to;         /* CRM_WRITE */
    const unsigned char *from; /* CRM_CHECK, CRM_READ */
    size_t at, size;
    int bad;       /* CRM_CHECK: a number out of its range, or no more bytes */
    uint64_t hash; /* CRM_HASH */
} crm_coder;

/* FNV-1a of bytes after what `hash` has seen; start with CRM_HASH_START. */
#define CRM_HASH_START UINT64_C(14695981039346656037)
uint64_t crm_hash_bytes(uint64_t hash, size_t n, const unsigned char *bytes);

/* Eight bytes, lowest first. */
void crm_put_u64(unsigned char *to, uint64_t x);
uint64_t crm_get_u64(const unsigned char *from);

/* Whether the coder gives values: the variable below is then set. */
static inline int crm_coder_reads(const crm_coder *c)
{
    return c->how == CRM_CHECK || c->how == CRM_READ;
}
/* One variable: taken, or set (also while checking).  In its range: low <= *x <= high. */
void crm_code_number(crm_coder *c, double *x, double low, double high);
void crm_code_whole(crm_coder *c, long *x, long low, long high);
void crm_code_int(crm_coder *c, int *x, int low, int high);
void crm_code_byte(crm_coder *c, unsigned char *x, int high);
/* Any finite numbers, n of them, at their place: set by CRM_READ alone. */
void crm_code_place(crm_coder *c, double *place, double low, double high);
void crm_code_places(crm_coder *c, size_t n, double *places);

#endif
