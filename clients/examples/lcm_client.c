/* lcm_client.c SCENE [URL]: steps a scene file in a step server; caromd must be running. */
#include <carom/client.h>
#include <stdio.h>

int main(int argc, char **argv)
{
    const carom_client_run run = {.n_steps = 10};
    carom_client *client = carom_client_create();
    carom_client_code code = carom_client_connect(client, argc > 2 ? argv[2] : NULL, NULL);
    if (code >= 0) code = carom_client_open_file(client, argc > 1 ? argv[1] : NULL);
    for (int k = 0; code >= 0 && k < 12; k++) {
        code = carom_client_step(client, &run);
        const carom_client_state *s = carom_client_get_state(client);
        const int last = s ? 3 * s->n_bodies - 1 : -1; /* y of the last body */
        if (last > 0) printf("t = %.2f s  y = %.4f m\n", s->time, s->q[last]);
    }
    if (code < 0) fprintf(stderr, "%s\n", carom_client_error(client));
    carom_client_destroy(client);
    return code < 0;
}
