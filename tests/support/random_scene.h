/* random_scene.h: worlds of 2 to 30 bodies drawn from a seed: every kind of shape, chains, stacks,
 * masses 1e-3 to 1e3 kg, speeds to 100 m/s, in a box of static walls. */
#ifndef SUPPORT_RANDOM_SCENE_H
#define SUPPORT_RANDOM_SCENE_H

#include "carom/world.h"

#include <stdint.h>

enum {
    RANDOM_SCENE_BODIES = 48,
    RANDOM_SCENE_SHAPES = 64,
    RANDOM_SCENE_VERTICES = 512,
    RANDOM_SCENE_JOINTS = 32
};

typedef struct random_scene_part {
    carom_shape shape;
    int body;
} random_scene_part;

/* A world and what it was made from, for checks that do not ask the world. */
typedef struct random_scene {
    carom_world *world;
    int n_bodies; /* walls, pegs and rotors included */
    carom_body_type type[RANDOM_SCENE_BODIES];
    double mass[RANDOM_SCENE_BODIES];
    int n_parts;
    random_scene_part parts[RANDOM_SCENE_SHAPES];
    int n_vertices;
    carom_vec2 vertices[RANDOM_SCENE_VERTICES];
    int n_joints;
    int joined[RANDOM_SCENE_JOINTS][2];
    double half_width; /* the room: |x| <= half_width, 0 <= y <= height [m] */
    double height;     /* no lid below 300 m: HUGE_VAL */
    int has_kinematic;
    double gravity;
} random_scene;

/* Builds scene `seed`; what a world refuses fails the test.  The caller destroys s->world. */
void random_scene_make(uint64_t seed, const carom_world_settings *settings, random_scene *s);

/* Largest overlap of two bodies that collide, at the world's state; *a and *b are those [m]. */
double random_scene_overlap(const random_scene *s, int *a, int *b);
/* A dynamic body whose center is half a meter or more outside the room, -1: none. */
int random_scene_escaped(const random_scene *s);

#endif
