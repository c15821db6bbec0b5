/* gradient_numbers.h: every number that a gradient is by, one at a time. */
#ifndef SUPPORT_GRADIENT_NUMBERS_H
#define SUPPORT_GRADIENT_NUMBERS_H

#include "carom/grad.h"

typedef enum gradient_array {
    BY_Q0,
    BY_V0,
    BY_MASS,
    BY_INERTIA,
    BY_FRICTION,
    BY_RESTITUTION,
    BY_GRAVITY_SCALE,
    BY_LINEAR_DAMPING,
    BY_ANGULAR_DAMPING,
    BY_GRAVITY,
    BY_FORCE,
    BY_DT,
    BY_RADIUS,
    BY_VERTICES,
    BY_ANCHORS,
    BY_AXES,
    BY_ANGLES,
    BY_LENGTHS,
    BY_LOWER,
    BY_UPPER,
    BY_STIFFNESS,
    BY_DAMPING,
    BY_REST,
    BY_MOTOR_SPEED,
    BY_MOTOR_LIMIT,
    N_GRADIENT_ARRAYS
} gradient_array;
extern const char *const gradient_array_names[N_GRADIENT_ARRAYS];

/* How many numbers an array has, and where number k is in the world. */
int gradient_count(const carom_world *w, int array);
double *gradient_number(carom_world *w, int array, int k);
/* 0: the number means nothing for its body or joint, and its gradient is zero. */
int gradient_has_meaning(const carom_world *w, int array, int k);

/* Room for `rows` gradients of a world, one after the other in every array; zero. */
typedef struct gradient_room {
    double *array[N_GRADIENT_ARRAYS];
    carom_gradient g;
} gradient_room;
gradient_room gradient_room_make(const carom_world *w, int rows);
void gradient_room_free(gradient_room *x);

#endif
