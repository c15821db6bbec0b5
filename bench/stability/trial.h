/* trial.h: one cell of the atlas: a scene, what must hold in it, and what came of it. */
#ifndef BENCH_STABILITY_TRIAL_H
#define BENCH_STABILITY_TRIAL_H

#include "bench/step/scene.h"

#include "carom/world.h"

enum { MAX_TRIAL_JOINTS = 64, N_TRIAL_NUMBERS = 6 };

typedef struct trial trial;

/* What the poses say after some time [s]: the distance from what is known of the scene, in units
 * of `tolerance`'s scale. */
typedef double (*trial_error)(const trial *t, double time, const double *q, const double *v);

struct trial {
    scene s; /* s.n_steps steps of s.dt */
    int n_joints;
    carom_joint_def joints[MAX_TRIAL_JOINTS]; /* which only carom runs */
    double energy_of_springs;                 /* stiffness of the one spring to the origin [N/m] */
    int passive;                              /* 1: nothing gives energy */
    trial_error error;                        /* NULL: nothing is known */
    double tolerance;                         /* of the error, [1] */
    double rough;                             /* of methods of order one, and of peers */
    double late;                              /* the error counts from this time on [s] */
    int probe;                 /* body whose velocity the gradient check moves; -1: none */
    double p[N_TRIAL_NUMBERS]; /* for `error` */
};

/* --- parts.c: scenes from parts; memory exhausted ends the program */
trial trial_new(double gravity, double dt, double duration);
void trial_free(trial *t);
/* Density 1.  Indices of bodies. */
int trial_disc(trial *t, double x, double y, double r, double friction, double restitution);
int trial_box(trial *t, double x, double y, double angle, double hx, double hy, double friction);
/* Its centroid is at (x, y). */
int trial_polygon(trial *t, double x, double y, double angle, int n, const carom_vec2 *corners,
                  double friction);
/* Static box whose top is y = 0, half as deep as it is wide. */
int trial_floor(trial *t, double half, double friction, double restitution);
int trial_anchor(trial *t);
void trial_fix(trial *t, int body);
/* Mass and inertia times `times`. */
void trial_weigh(trial *t, int body, double times);
void trial_pin(trial *t, int a, int b, double x, double y);
carom_joint_def *trial_joint(trial *t, carom_joint_kind kind, int a, int b, double x, double y);
/* All bodies moved by (x, y). */
void trial_shift(trial *t, double x, double y);

/* --- measure.c: from the poses alone; nothing of carom's geometry */
/* Largest diameter of a moving body [m]; 1 when none has a shape. */
double measure_length(const scene *s);
/* Largest coordinate [m]: 8 eps of it is what poses can say. */
double measure_reach(const scene *s, const double *q);
/* Of bodies that no joint keeps from touching [m]. */
double measure_overlap(const trial *t, const double *q);
double measure_drift(const scene *s, const double *q);
/* Kinetic, and with gravity (heights from the start) and the spring. */
double measure_kinetic(const scene *s, const double *v);
double measure_energy(const trial *t, const double *q, const double *v);
/* Largest move of a moving body's corners from the start [m]. */
double measure_move(const scene *s, const double *q);

/* --- outcome */
typedef enum color { GREEN, YELLOW, RED, BLACK, NOT_RUN } color;

typedef struct outcome {
    color color;
    int worst;       /* status: negative when a step failed, else the largest */
    int n_steps;     /* done */
    int n_said;      /* steps with a positive status */
    int cut;         /* 1: the time was over */
    double residual; /* largest reported [1] */
    double overlap;  /* [L] */
    double drift;    /* of joints [L] */
    double gain;     /* of energy above its least before [of the largest kinetic energy] */
    double error;    /* of what is known [1]; -1: nothing is */
    double gradient; /* relative error against differences; -1: not compared */
    double seconds;
    char why[96]; /* which criterion is not met, or which words the library had */
} outcome;

typedef struct engine {
    const char *name;
    const contender *peer; /* NULL: carom */
    carom_integrator integrator;
    int order;
} engine;

/* Runs until the end or for `limit` seconds, and judges. */
outcome trial_run(const trial *t, const engine *e, double limit);
/* Relative error of the gradient of a step's end by the probe's velocity against differences; -1
 * where differences do not agree among themselves or contacts are at kinks. */
double trial_gradient(const trial *t, const engine *e, double limit);

/* --- families */
typedef struct family {
    const char *name, *x_name, *y_name;
    int nx, ny;
    const double *x, *y;
    void (*build)(trial *t, double x, double y); /* t: not yet made */
    const char *known;                           /* what `error` compares with; NULL */
    const char *hard;                            /* why a cell may fail; NULL */
} family;

extern const family CONTACT_FAMILIES[];
extern const int N_CONTACT_FAMILIES;
extern const family JOINT_FAMILIES[];
extern const int N_JOINT_FAMILIES;
extern const family STRUCTURE_FAMILIES[];
extern const int N_STRUCTURE_FAMILIES;

#endif
