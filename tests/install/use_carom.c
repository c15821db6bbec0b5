/* carom::carom: one body falls.  Euler's step: v <- v - g h, then y <- y + h v: after n steps
 * y = -g h^2 n (n + 1) / 2.  The located step is exact under constant force: y = -g t^2 / 2. */
#include <carom/carom.h>

#include <math.h>
#include <stdio.h>

static double fall(carom_integrator integrator, double h, int n)
{
    const carom_body_def body = carom_body_defaults();
    carom_world_settings settings = carom_world_defaults();
    carom_world *world = NULL;
    double y;

    settings.gravity[1] = -10.0;
    settings.dt = h;
    settings.integrator = integrator;
    if (carom_world_create(&settings, NULL, &world) != CAROM_OK) return HUGE_VAL;
    if (carom_world_add_body(world, &body, NULL) != CAROM_OK) return HUGE_VAL;
    for (int i = 0; i < n; i++)
        if (carom_world_step(world, NULL, NULL) != CAROM_OK) return HUGE_VAL;
    y = carom_world_q(world)[2];
    carom_world_destroy(world);
    return y;
}

int main(void)
{
    const double h = 1.0 / 60.0;
    const int n = 60;
    const double euler = fall(CAROM_EULER, h, n);
    const double located = fall(CAROM_LOCATED, h, n);

    printf("y = %.17g and %.17g\n", euler, located);
    /* 60 additions of numbers below 6. */
    return !(fabs(euler + 5.0 * h * h * n * (n + 1)) < 1e-12 && fabs(located + 5.0) < 1e-12);
}
