/* base.h: what every part of carom shares: status, allocator, vectors, poses. No dependencies. */
#ifndef CAROM_BASE_H
#define CAROM_BASE_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

#ifdef __GNUC__
#define CAROM_API __attribute__((visibility("default")))
#else
#define CAROM_API
#endif

/* Every fallible function returns a carom_status.  Zero: done.  Positive: a usable result with a
 * caveat.  Negative: no result; outputs are untouched and objects are as they were before. */
#define CAROM_STATUS_TABLE(X)                                                                      \
    X(CAROM_OK, 0, "done")                                                                         \
    X(CAROM_INEXACT, 1, "solved to the relaxed tolerance only (residual <= 1e-6, not 1e-10)")      \
    X(CAROM_LIMIT, 2, "a limit on iterations or sub-steps was reached; the result is usable")      \
    X(CAROM_RELAXED, 3,                                                                            \
      "restitution was relaxed: with it an impact has no solution or gives energy")                \
    X(CAROM_E_ARGUMENT, -1, "an argument is out of its range, not finite or NULL")                 \
    X(CAROM_E_MEMORY, -2, "the allocator returned NULL")                                           \
    X(CAROM_E_CAPACITY, -3, "a capacity fixed by the caller is exceeded")                          \
    X(CAROM_E_SHAPE, -4, "a shape is not valid")                                                   \
    X(CAROM_E_INFEASIBLE, -5, "the contact problem is infeasible")                                 \
    X(CAROM_E_NO_SOLUTION, -6, "no solution was found within the limits")                          \
    X(CAROM_E_SINGULAR, -7, "a matrix is singular")                                                \
    X(CAROM_E_STATE, -8, "the call does not fit the state of the object")

typedef enum carom_status {
#define CAROM_STATUS_ENUM(name, value, text) name = value,
    CAROM_STATUS_TABLE(CAROM_STATUS_ENUM)
#undef CAROM_STATUS_ENUM
} carom_status;

/* English text of a status, never NULL. */
CAROM_API const char *carom_status_text(carom_status status);
/* Name of the constant, like "CAROM_E_MEMORY"; "unknown" for other numbers. */
CAROM_API const char *carom_status_name(carom_status status);

/* Version of the library, "MAJOR.MINOR.PATCH". */
CAROM_API const char *carom_version(void);

/* Source of memory.  allocate returns memory aligned for any type, or NULL.  release gets the size
 * that was requested; release(user, NULL, 0) does nothing.  An object copies its allocator. */
typedef struct carom_allocator {
    void *(*allocate)(void *user, size_t bytes);
    void (*release)(void *user, void *memory, size_t bytes);
    void *user;
} carom_allocator;

/* malloc and free. */
CAROM_API carom_allocator carom_allocator_default(void);

typedef struct carom_vec2 {
    double x; /* [m] unless said otherwise */
    double y; /* [m] */
} carom_vec2;

/* Pose of a body: world = R(angle) body + (x, y).  In arrays: (angle, x, y). */
typedef struct carom_pose {
    double angle; /* [rad] */
    double x;     /* [m] */
    double y;     /* [m] */
} carom_pose;

#ifdef __cplusplus
}
#endif
#endif
