/* contact_ref.h: the contact kernels once more, on complex numbers, for derivatives by complex
 * step.
 *
 * Written from docs/math/equations.md (40)-(43) in world coordinates: positions are not subtracted
 * first, nothing is shared with the library but the recipe. */
#ifndef SUPPORT_CONTACT_REF_H
#define SUPPORT_CONTACT_REF_H

#include "carom/collide.h"

#include <complex.h>

enum { CONTACT_REF_MAX = 8, CONTACT_REF_OUTPUTS = 7 };

typedef struct contact_ref_shape {
    int n;
    double complex pose[3]; /* angle, x, y */
    double complex radius;
    double complex v[CONTACT_REF_MAX][2]; /* body frame */
} contact_ref_shape;

contact_ref_shape contact_ref_from(const carom_shape *shape, carom_pose pose);

/* out: normal, arm_a, arm_b, gap. */
void contact_ref_eval(const contact_ref_shape *a, const contact_ref_shape *b, carom_recipe recipe,
                      double complex out[CONTACT_REF_OUTPUTS]);

#endif
