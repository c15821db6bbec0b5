/* scene.h: scenes for carom's step and its peers, and what a peer must be able to do. */
#ifndef BENCH_STEP_SCENE_H
#define BENCH_STEP_SCENE_H

#ifdef __cplusplus
extern "C" {
#endif

typedef enum body_shape { SHAPE_NONE, SHAPE_DISC, SHAPE_BOX, SHAPE_POLYGON } body_shape;

enum { SCENE_STATIC, SCENE_DYNAMIC, SCENE_KINEMATIC };

typedef struct scene_body {
    int moves; /* one of the three */
    body_shape shape;
    double hx, hy; /* half sides; radius = hx [m] */
    double q[3];   /* (angle, x, y) */
    double v[3];
    double mass, inertia;
    double friction, restitution;
} scene_body;

typedef struct scene_pin {
    int a, b;
    double x, y;
} scene_pin;

/* Counterclockwise, in the body's frame. */
typedef struct scene_polygon {
    int n;
    double (*corners)[2];
} scene_polygon;

enum { MAX_CORNERS = 64 };

typedef struct scene {
    const char *name;
    int n_bodies, max_bodies;
    scene_body *bodies;
    scene_polygon *polygons; /* one per body, read of SHAPE_POLYGON; NULL: there is none */
    int n_pins, max_pins;
    scene_pin *pins;
    double gravity, dt;
    int rests;   /* 1: nothing should move */
    int warm_up; /* steps before the clock runs */
    int n_steps; /* steps on the clock */
} scene;

enum { N_SCENES = 12 };
/* Scene k, 0 <= k < N_SCENES; memory exhausted ends the program. */
scene make_scene(int k);
void add_pin(scene *s, int a, int b, double x, double y);
void free_scene(scene *s);

/* Scenes that grow: free bodies, chain, stack and pyramid that bear a pendulum, pile, islands
 * (stacks of three, each with its pendulum), rest (stacks of four), hub (arms pinned to one heavy
 * disc). */
enum { N_FAMILIES = 8 };
extern const char *const FAMILY_NAMES[N_FAMILIES];
/* Family k of about n bodies. */
scene make_family(int k, int n);

/* What a step was, where the contender says so. */
typedef struct counters {
    long factorizations, allocations;
    int n_contacts, n_substeps; /* most in a step */
    int worst;                  /* status: negative when a step failed, else the largest */
} counters;

typedef struct contender {
    const char *name;
    void *(*create)(const scene *s);
    void (*step)(void *self, counters *c);
    void (*place)(void *self, int body, double q[3]);
    void (*destroy)(void *self);
    void (*speed)(void *self, int body, double v[3]); /* (omega, vx, vy) */
} contender;

extern const contender CAROM_CONTENDERS[3];
/* With the iterations that they come with, and 4 and 16 times as many. */
extern const contender BOX2D[3];
extern const contender CHIPMUNK[3];

#ifdef __cplusplus
}
#endif
#endif
