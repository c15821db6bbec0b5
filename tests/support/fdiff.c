#include "fdiff.h"

#include <math.h>
#include <stddef.h>

double fdiff(double (*f)(double t, void *user), void *user, double h, double *error)
{
    const double wide = (f(h, user) - f(-h, user)) / (2.0 * h);
    const double narrow = (f(0.5 * h, user) - f(-0.5 * h, user)) / h;
    const double best = (4.0 * narrow - wide) / 3.0;
    if (error) *error = fabs(best - narrow);
    return best;
}

typedef struct entry_context {
    double (*f)(void *user);
    void *user;
    double *entry;
    double at;
} entry_context;

static double entry_value(double t, void *user)
{
    entry_context *c = user;
    *c->entry = c->at + t;
    return c->f(c->user);
}

double fdiff_entry(double (*f)(void *user), void *user, double *entry, double h, double *error)
{
    entry_context c = {f, user, entry, *entry};
    const double d = fdiff(entry_value, &c, h, error);
    *entry = c.at;
    return d;
}
