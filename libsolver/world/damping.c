/* damping.c: damping of bodies, solved exactly in time.  docs/step.md, section "Damping". */
#include "world/damping.h"

#include <math.h>

/* Below this the slope is its series, whose next term is 7 x^6 / 8! < 1e-14 [1]. */
static const double SMALL = 0.02;

/* d/dx sum (-x)^k / (k + 1)! */
static double series(double x)
{
    return -1.0 / 2 + x * (1.0 / 3 + x * (-1.0 / 8 + x * (1.0 / 30 + x * (-1.0 / 144 + x / 840))));
}

crm_decay crm_decay_in(double damping, double h)
{
    const double x = damping * h;
    crm_decay d = {1, 1, -0.5};
    if (!(x > 0)) return d;
    d.keep = exp(-x);
    d.mean = -expm1(-x) / x;
    d.slope = x < SMALL ? series(x) : (d.keep - d.mean) / x;
    return d;
}
