/* near.h: comparisons of reals for cmocka; a failure prints case, index, both numbers and the
 * limit. Includes cmocka and what cmocka wants before it. */
#ifndef SUPPORT_NEAR_H
#define SUPPORT_NEAR_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>

/* max |x_i|; 0 for n = 0; NaN when an entry is NaN. */
static inline double near_norm(int n, const double *x)
{
    double top = 0.0;
    for (int i = 0; i < n; i++) {
        if (isnan(x[i])) return x[i];
        top = fmax(top, fabs(x[i]));
    }
    return top;
}

static inline void near_check(const char *name, int i, double actual, double expected, double tol,
                              const char *file, int line)
{
    if (fabs(actual - expected) <= tol) return; /* NaN fails */
    print_error("%s:%d: %s [%d]: %.17g, expected %.17g, off by %.3g, limit %.3g\n", file, line,
                name, i, actual, expected, fabs(actual - expected), tol);
    _fail(file, line);
}

/* |actual - expected| <= tol, absolute. */
#define assert_near(actual, expected, tol)                                                         \
    near_check(#actual, 0, (actual), (expected), (tol), __FILE__, __LINE__)

/* The same, for entry i of the case `name`. */
#define assert_near_case(name, i, actual, expected, tol)                                           \
    near_check((name), (i), (actual), (expected), (tol), __FILE__, __LINE__)

/* Every |a_i - b_i| <= tol, absolute. */
#define assert_near_array(name, n, a, b, tol)                                                      \
    do {                                                                                           \
        for (int near_i = 0; near_i < (n); near_i++)                                               \
            near_check((name), near_i, (a)[near_i], (b)[near_i], (tol), __FILE__, __LINE__);       \
    } while (0)

/* actual <= limit; NaN fails. */
#define assert_at_most(name, actual, limit)                                                        \
    do {                                                                                           \
        const double near_a = (actual), near_l = (limit);                                          \
        if (!(near_a <= near_l)) {                                                                 \
            print_error("%s:%d: %s: %.6g, limit %.6g\n", __FILE__, __LINE__, (name), near_a,       \
                        near_l);                                                                   \
            _fail(__FILE__, __LINE__);                                                             \
        }                                                                                          \
    } while (0)

#endif
