#include "libsolver/contact/ladder/path.h"

/* Compliance of active rows on the path: it makes impulses unique [1]. */
#define COMPLIANCE 1e-7
/* Velocity, in units of V, at which no contact closes; a path that comes back here is a ray. */
#define TAU_MAX 1e4

int crm_lemke(crm_island *s, int max_pivots, unsigned long long seed)
{
    crm_path p = {.s = s,
                  .d = s->path[0],
                  .ref = s->path[1],
                  .compliance = COMPLIANCE,
                  .t = TAU_MAX,
                  .most = TAU_MAX};
    memset(s->mode, CAROM_SEPARATED, (size_t)s->nc);
    crm_vec_zero(s, s->x);
    crm_vec_zero(s, p.d);
    crm_vec_zero(s, p.ref);
    for (int k = 0; k < s->nc; k++) p.d.n[k] = 0.5 + crm_uniform(&seed);
    return crm_path_follow(&p, max_pivots);
}
