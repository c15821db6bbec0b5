/* sweep_few.c: crm_sweep_four and crm_sweep_eight for any machine. */
#include "collide/few/sweep_few.h"

void crm_sweep_four(const crm_placed *a, const crm_placed *b, double reach, int want_lead,
                    crm_closest *out)
{
    sweep_few(1, a, b, reach, want_lead, out);
}

void crm_sweep_eight(const crm_placed *a, const crm_placed *b, double reach, int want_lead,
                     crm_closest *out)
{
    sweep_few(2, a, b, reach, want_lead, out);
}
