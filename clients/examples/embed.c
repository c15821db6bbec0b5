/* embed.c: drop a ball, print its apex after the first bounce and how restitution moves it. */
#include <carom/carom.h>
#include <stdio.h>

int main(void)
{
    const carom_vec2 floor[] = {{-5, -1}, {5, -1}, {5, 1}, {-5, 1}}, center[] = {{0, 0}};
    const carom_shape shapes[] = {{0, 4, floor}, {0.25, 1, center}};
    carom_body_def ground = carom_body_defaults(), ball = carom_body_defaults();
    ground.type = CAROM_STATIC;
    ground.pose.y = -1;
    ball.pose.y = 1.25;
    ground.n_shapes = ball.n_shapes = 1;
    ground.shapes = &shapes[0];
    ball.shapes = &shapes[1];
    ground.restitution = ball.restitution = 0.8;
    carom_world *world = NULL;
    carom_tape *tape = NULL;
    carom_world_create(NULL, NULL, &world);
    carom_world_add_body(world, &ground, NULL);
    carom_world_add_body(world, &ball, NULL);
    if (carom_tape_create(world, NULL, &tape) < 0) return 1;
    int apex = 0;
    for (int k = 1; k <= 60; k++) {
        if (carom_tape_step(tape, NULL, NULL) < 0) return 1;
        if (k > 30 && (!apex || carom_tape_q(tape, k)[5] > carom_tape_q(tape, apex)[5])) apex = k;
    }
    double q_bar[6] = {0, 0, 0, 0, 0, 1}, restitution[2];
    const carom_state_bar loss = {apex, q_bar, NULL};
    const carom_gradient gradient = {.restitution = restitution};
    if (carom_tape_gradient(tape, 1, &loss, &gradient, NULL) < 0) return 1;
    printf("apex y = %.4f m at step %d, d y / d restitution = %.4f m\n",
           carom_tape_q(tape, apex)[5], apex, restitution[0] + restitution[1]);
    carom_tape_destroy(tape);
    carom_world_destroy(world);
    return 0;
}
