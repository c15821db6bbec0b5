/* crm_lcp_general in a build without libsolver/lcp. */
#include "lcp/file.h"

#include <stdio.h>

void crm_lcp_general(const crm_lcp *lcp, carom_contact_solution *x, carom_contact_stats *stats,
                     double *seconds)
{
    (void)x;
    fprintf(stderr,
            "%s: a row touches more than two bodies: that needs a build with CAROM_WITH_KLU=ON\n",
            lcp->name);
    stats->status = CAROM_E_NO_SOLUTION;
    *seconds = 0;
}
