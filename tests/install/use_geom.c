/* carom::geom alone: the gap between a unit square and a disc, and the square's mass. */
#include <carom/collide.h>
#include <carom/shape.h>

#include <math.h>
#include <stdio.h>

int main(void)
{
    const carom_vec2 corners[4] = {{-0.5, -0.5}, {0.5, -0.5}, {0.5, 0.5}, {-0.5, 0.5}};
    const carom_vec2 center[1] = {{0.0, 0.0}};
    const carom_shape square = {0.0, 4, corners};
    const carom_shape disc = {0.25, 1, center};
    const carom_pose at_origin = {0.0, 0.0, 0.0};
    const carom_pose to_the_right = {0.0, 1.0, 0.0};
    const carom_manifold m = carom_collide(&square, at_origin, &disc, to_the_right, HUGE_VAL);
    const carom_mass_properties mass = carom_shape_mass(&square, 6.0);

    if (carom_shape_check(&square, NULL) != CAROM_OK) return 1;
    printf("gap %.17g, normal (%g, %g), inertia %.17g\n", m.distance, m.normal.x, m.normal.y,
           mass.inertia);
    /* gap = 1 - 0.5 - 0.25; inertia of a square of side s: m s^2 / 6.  A few roundings. */
    return !(fabs(m.distance - 0.25) < 1e-14 && fabs(m.normal.x - 1.0) < 1e-14 &&
             fabs(mass.inertia - 1.0) < 1e-14);
}
