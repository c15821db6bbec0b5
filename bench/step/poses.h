/* poses.h: what the poses of any contender show, measured alike for all with carom_collide. */
#ifndef BENCH_STEP_POSES_H
#define BENCH_STEP_POSES_H

#include "scene.h"

/* [m]; bodies that a pin holds together do not count, nor do two that stand. */
double largest_overlap(const scene *s, const contender *c, void *self);
/* Of any body from where it began [m]. */
double largest_move(const scene *s, const contender *c, void *self);
/* Of the two ends of any pin [m]. */
double largest_gap(const scene *s, const contender *c, void *self);
/* Kinetic and of weight [J]. */
double energy_of(const scene *s, const contender *c, void *self);
#endif
