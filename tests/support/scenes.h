/* scenes.h: small worlds for tests.  Every function fails the test when a call fails. */
#ifndef SUPPORT_SCENES_H
#define SUPPORT_SCENES_H

#include "carom/world.h"

/* Of the worlds made from now on; Euler at the start. */
extern carom_integrator scene_integrator;
/* ... and their order; 2 at the start. */
extern int scene_order;
/* ... whether all events are sought at order 2; 0 at the start. */
extern int scene_events;
/* ... and their tolerance; 0 at the start. */
extern double scene_tolerance;
/* Set-ups of tests: worlds with that integrator from now on. */
int scene_euler(void **state);
int scene_located(void **state);
int scene_fixed(void **state);
int scene_order_4(void **state);
/* Gravity (0, -g), step dt. */
carom_world *scene_world(double g, double dt);
/* Static box 40 x 2 whose top is y = 0; index of the body. */
int scene_floor(carom_world *w, double friction, double restitution);
/* The same, moving at `speed` along x. */
int scene_belt(carom_world *w, double speed, double friction);
/* Dynamic box with half sides hx, hy, uniform density, at (x, y, angle), at rest. */
int scene_box(carom_world *w, double mass, double hx, double hy, carom_pose pose, double friction,
              double restitution);
/* Dynamic disc, uniform density. */
int scene_disc(carom_world *w, double mass, double radius, double x, double y, double friction,
               double restitution);
/* Static body without shape at the origin. */
int scene_anchor(carom_world *w);
/* n links of 1 kg and 1 m, pinned to the origin and let go from a bent rest; the last. */
int scene_links(carom_world *w, int n);
/* A thin ladder, 2 m long, slides down a smooth wall, without friction, and leaves it. */
int scene_ladder(carom_world *w);
/* A disc rolls off a disc: it sticks, begins to slip, and leaves. */
int scene_roll_off(carom_world *w);
/* A tall block rocks from foot to foot. */
int scene_rocking(carom_world *w);
/* A double pendulum whose end hits the floor, slides on it and leaves it. */
int scene_landing(carom_world *w);
/* Velocity of one body; the rest is kept. */
void scene_push(carom_world *w, int body, double omega, double vx, double vy);
/* n steps; every status must be 0 or positive.  *last (may be NULL): statistics of the last. */
void scene_run(carom_world *w, int n, carom_step_stats *last);

#endif
