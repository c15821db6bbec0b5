/* embed.c: a ball falls on a floor and bounces. */
#include <carom/carom.h>
#include <stdio.h>

int main(void)
{
    carom_body_def floor = carom_body_at(CAROM_STATIC, 0, -1);
    carom_body_def ball = carom_body_at(CAROM_DYNAMIC, 0, 1.25);
    floor.restitution = ball.restitution = 0.8;
    carom_world *world = NULL;
    carom_status s = carom_world_create(NULL, NULL, &world);
    if (s >= 0) s = carom_world_add_box(world, &floor, 10, 2, 0, NULL);
    if (s >= 0) s = carom_world_add_circle(world, &ball, 0.25, 100, NULL); /* of 100 kg/m^2 */
    for (; s >= 0 && carom_world_steps(world) < 60; s = carom_world_step(world, NULL, NULL))
        printf("t = %.3f s  y = %.4f m\n", carom_world_time(world), carom_world_q(world)[5]);
    if (s < 0) fprintf(stderr, "%s\n", carom_world_error(world));
    carom_world_destroy(world);
    return s < 0;
}
