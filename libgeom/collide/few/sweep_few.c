/* sweep_few.c: crm_sweep_four and crm_sweep_eight for any machine. */
#include "collide/few/sweep_few.h"

void crm_sweep_four(const crm_placed *a, const crm_placed *b, double tie, const crm_search *how,
                    crm_closest *out)
{
    sweep_few(1, a, b, tie, how, out);
}

void crm_sweep_eight(const crm_placed *a, const crm_placed *b, double tie, const crm_search *how,
                     crm_closest *out)
{
    sweep_few(2, a, b, tie, how, out);
}
