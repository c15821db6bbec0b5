/* carom::carom: one body falls for a second.  The default step is exact under constant force:
 * y = -g t^2 / 2. */
#include <carom/carom.h>

#include <math.h>
#include <stdio.h>

int main(void)
{
    const int n = 60;
    carom_world_settings settings = carom_world_defaults();
    const carom_body_def body = carom_body_defaults();
    carom_world *world = NULL;
    double y;

    settings.gravity[1] = -10.0;
    settings.dt = 1.0 / 60.0;
    if (carom_world_create(&settings, NULL, &world) != CAROM_OK) return 1;
    if (carom_world_add_body(world, &body, NULL) != CAROM_OK) return 1;
    for (int i = 0; i < n; i++)
        if (carom_world_step(world, NULL, NULL) != CAROM_OK) return 1;
    y = carom_world_q(world)[2];
    carom_world_destroy(world);
    printf("y = %.17g\n", y);
    return !(fabs(y + 5.0) < 1e-12); /* 60 additions of numbers below 6 */
}
