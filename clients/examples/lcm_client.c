/* lcm_client.c: a ball bounces in a step server.  Start caromd first; an argument is its URL. */
#include <carom/client.h>
#include <stdio.h>

static void print(void *user, const carom_client_state *s)
{
    (void)user;
    printf("t = %.2f s  y = %.4f m  vy = %+.3f m/s\n", s->time, s->q[5], s->v[5]);
}

int main(int argc, char **argv)
{
    const carom_vec2 floor[] = {{-5, -1}, {5, -1}, {5, 1}, {-5, 1}}, center[] = {{0, 0}};
    const carom_shape shapes[] = {{0, 4, floor}, {0.25, 1, center}};
    carom_body_def bodies[] = {carom_body_defaults(), carom_body_defaults()};
    for (int i = 0; i < 2; i++) {
        bodies[i].n_shapes = 1;
        bodies[i].shapes = &shapes[i];
        bodies[i].pose.y = i ? 1.25 : -1;
        bodies[i].restitution = 0.8;
    }
    bodies[0].type = CAROM_STATIC;
    const carom_client_scene scene = {.gravity = {0, -9.81}, .n_bodies = 2, .bodies = bodies};
    const carom_client_run run = {.n_steps = 120, .publish_every = 10, .on_state = print};
    carom_client *client = carom_client_create();
    carom_client_code code = carom_client_connect(client, argc > 1 ? argv[1] : NULL, NULL);
    if (code >= 0) code = carom_client_open(client, &scene);
    if (code >= 0) code = carom_client_step(client, &run);
    if (code < 0) fprintf(stderr, "%s\n", carom_client_error(client));
    carom_client_destroy(client);
    return code < 0;
}
