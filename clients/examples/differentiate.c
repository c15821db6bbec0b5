/* differentiate.c: a box slides to rest.  How far, and what more friction would do to that. */
#include <carom/carom.h>
#include <stdio.h>

int main(void)
{
    enum { FLOOR, BOX, STEPS = 60, X = 3 * BOX + 1 };
    carom_body_def floor = carom_body_at(CAROM_STATIC, 0, -1);
    carom_body_def box = carom_body_at(CAROM_DYNAMIC, 0, 0.25);
    box.velocity[1] = 3;
    carom_world *world = NULL;
    carom_tape *tape = NULL;
    carom_status s = carom_world_create(NULL, NULL, &world);
    if (s >= 0) s = carom_world_add_box(world, &floor, 10, 2, 0, NULL);
    if (s >= 0) s = carom_world_add_box(world, &box, 0.5, 0.5, 100, NULL);
    if (s >= 0) s = carom_tape_create(world, NULL, &tape);
    for (int k = 0; s >= 0 && k < STEPS; k++) s = carom_tape_step(tape, NULL, NULL);
    const double x_bar[6] = {[X] = 1}; /* the loss is x at the end */
    double friction[2] = {0, 0};       /* its derivative by the friction of each body */
    const carom_state_bar loss = {STEPS, x_bar, NULL};
    const carom_gradient gradient = {.friction = friction};
    if (s >= 0) s = carom_tape_gradient(tape, 1, &loss, &gradient, NULL);
    if (s >= 0) {
        printf("slid %.3f m, d x / d mu = %.3f m\n", carom_world_q(world)[X],
               friction[FLOOR] + friction[BOX]);
    }
    carom_tape_destroy(tape);
    carom_world_destroy(world);
    return s < 0;
}
