#include "scene.h"

#include <stdlib.h>

void add_pin(scene *s, int a, int b, double x, double y)
{
    const scene_pin p = {a, b, x, y};
    if (s->n_pins == s->max_pins) {
        s->max_pins = 2 * s->max_pins + 16;
        s->pins = realloc(s->pins, (size_t)s->max_pins * sizeof *s->pins);
        if (!s->pins) abort();
    }
    s->pins[s->n_pins++] = p;
}

void free_scene(scene *s)
{
    for (int k = 0; s->polygons && k < s->n_bodies; k++) free(s->polygons[k].corners);
    free(s->polygons);
    free(s->bodies);
    free(s->pins);
    s->polygons = NULL;
    s->bodies = NULL;
    s->pins = NULL;
}
