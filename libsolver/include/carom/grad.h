/* grad.h: the tape of a run and the exact gradient of a loss of its states. */
#ifndef CAROM_GRAD_H
#define CAROM_GRAD_H

#include "carom/world.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct carom_tape carom_tape;

/* A tape records the steps of one world, from the state it has now.  allocator: NULL for the heap.
 * The world must outlive the recording; bodies and joints must not be added meanwhile. */
CAROM_API carom_status carom_tape_create(carom_world *world, const carom_allocator *allocator,
                                         carom_tape **out);
CAROM_API void carom_tape_destroy(carom_tape *tape);
/* carom_world_step, recorded.  A failed step is not recorded. */
CAROM_API carom_status carom_tape_step(carom_tape *tape, const double *force,
                                       carom_step_stats *stats);
/* For long runs: keeps, of every `every` steps, a snapshot of the world and the states, and the
 * sub-steps of the last `every` only; carom_tape_gradient runs the others again, on a copy of the
 * world, and gets the same bits.  Memory is least near every = sqrt(steps).  0: keeps all, as a new
 * tape does.  Before the first step of a recording, else CAROM_E_STATE. */
CAROM_API carom_status carom_tape_checkpoint(carom_tape *tape, int every);
/* The same with a bound on what the tape holds, carom_tape_bytes, in place of `every`; 0: none.  It
 * keeps snapshots as far apart as they must be, the forces that steps are given and 40 bytes per
 * step; no sub-steps, and no states but the last.  A pass over the tape runs the steps again, from
 * snapshots that it sets by binomial checkpointing (Griewank and Walther's revolve) in the memory
 * that is left.  A step, or a pass with its workspace, that the bound is too small for:
 * CAROM_E_CAPACITY. */
CAROM_API carom_status carom_tape_memory(carom_tape *tape, size_t bytes);
/* Forgets all steps; the next recording starts at the world's present state. */
CAROM_API void carom_tape_rewind(carom_tape *tape);
CAROM_API int carom_tape_steps(const carom_tape *tape);
CAROM_API size_t carom_tape_bytes(const carom_tape *tape);
/* Recorded state after `step` steps, 0 <= step <= carom_tape_steps: 3 n_bodies, owned by the tape.
 * NULL where memory is bounded and the state is not held: only the last one always is. */
CAROM_API const double *carom_tape_q(const carom_tape *tape, int step);
CAROM_API const double *carom_tape_v(const carom_tape *tape, int step);

/* Smoothing: gradients, tangents and Jacobians of this tape differentiate, in place of each contact
 * problem of the recorded run, its point of the central path at kappa [J] (carom_contact_smooth):
 * at a kink a value between the one-sided derivatives, elsewhere an error of the order of kappa
 * over the energies that contacts exchange in a sub-step.  The run, the times of events and
 * corrections of positions stay as they are.  0, as at the start: the derivative itself. */
CAROM_API carom_status carom_tape_smooth(carom_tape *tape, double kappa);

/* Cotangent of the state after `step` steps: dl/dq, dl/dv (3 n_bodies each; NULL: zero). */
typedef struct carom_state_bar {
    int step;
    const double *q;
    const double *v;
} carom_state_bar;

/* Where the gradient goes: NULL is not computed; given arrays are overwritten.
 * Mass and inertia are partial derivatives of the stored numbers: gravity is mass * g.  What is not
 * damped, has no spring, limit or motor, has no derivative by it: 0. */
typedef struct carom_gradient {
    double *q0;              /* 3 n_bodies, state at the start of the tape */
    double *v0;              /* 3 n_bodies */
    double *mass;            /* n_bodies */
    double *inertia;         /* n_bodies */
    double *friction;        /* n_bodies */
    double *restitution;     /* n_bodies */
    double *gravity_scale;   /* n_bodies */
    double *linear_damping;  /* n_bodies */
    double *angular_damping; /* n_bodies */
    double *gravity;         /* 2 */
    double *force;           /* 3 n_bodies: a constant force on each body through all steps */
    double *force_steps;     /* 3 n_bodies x steps: the force of each step */
    double *dt;              /* 1: length of the step */
    double *radius;          /* n_shapes, in the order of adding */
    carom_vec2 *vertices;    /* n_vertices, in the order of adding; body frame */
    carom_vec2 *anchors;     /* 2 n_joints: anchor in the frame of body A, then of body B */
    double *axes;            /* n_joints: direction of the line in the frame of body A, an angle */
    double *angles;          /* n_joints: held turn of body B against body A */
    double *lengths;         /* n_joints: held distance */
    double *lower;           /* n_joints: limits */
    double *upper;           /* n_joints */
    double *stiffness;       /* n_joints: springs and motors, as in carom_joint_def */
    double *damping;         /* n_joints */
    double *rest;            /* n_joints */
    double *motor_speed;     /* n_joints */
    double *motor_limit;     /* n_joints */
} carom_gradient;

/* Where a run has two one-sided derivatives; what is said to be taken is that of the recorded
 * modes.
 */
typedef enum carom_kink_kind {
    CAROM_KINK_WEAK,         /* a contact touches without force: as recorded, closed or open */
    CAROM_KINK_SLIP,         /* it sticks at the limit of friction: as recorded */
    CAROM_KINK_SIMULTANEOUS, /* several contacts of a body close at one time: all at once */
    CAROM_KINK_GRAZING,      /* a gap closes, or a slip ends, at no speed: at a constant time */
    CAROM_KINK_BORDER,       /* the step ends with an impact: its end is the state before that */
    CAROM_KINK_FEATURES      /* two features of a pair are as near: that of the recorded contact */
} carom_kink_kind;
/* "weak", "slip", "simultaneous", "grazing", "border", "features"; NULL for any other number. */
CAROM_API const char *carom_kink_name(carom_kink_kind kind);

typedef struct carom_kink {
    int step;   /* 1: the first */
    int body_a; /* of the contact, or of the joint whose limit it is */
    int body_b;
    carom_kink_kind kind;
} carom_kink;

/* What a pass over the tape has met and done. */
typedef struct carom_gradient_stats {
    int degenerate;            /* kinks on the way, but for ties of features, which cost a search;
                                * borders where a state was asked for */
    int first_degenerate_step; /* -1: none */
    long solves;               /* contact problems differentiated, per direction */
    long contacts;             /* contacts whose geometry was differentiated, at one pose each */
    long joints;               /* joints, likewise */
    long unsmoothed;           /* ... as they are, where kappa is too small or large for them */
    long replayed;             /* steps run again, from checkpoints */
} carom_gradient_stats;

/* Reverse pass over the whole tape: gradient of  sum_k <q_bar_k, q_k> + <v_bar_k, v_k>.
 * bars: n_bars of them, any order, several for one step add up.  stats may be NULL.
 * A static body's q0 counts (moving the floor moves the contact); its v0 gradient is zero. */
CAROM_API carom_status carom_tape_gradient(carom_tape *tape, int n_bars,
                                           const carom_state_bar *bars,
                                           const carom_gradient *gradient,
                                           carom_gradient_stats *stats);

/* All kinks of the recorded steps, each once per step, pair and kind, in order: *count of them, the
 * first `capacity` into kinks (may be NULL when 0). */
CAROM_API carom_status carom_tape_kinks(carom_tape *tape, int capacity, carom_kink *kinks,
                                        int *count);

/* One number of a gradient beside central differences of whole runs. */
typedef struct carom_checked {
    int array; /* member of carom_gradient, from 0: carom_gradient_name */
    int index;
    double gradient;
    double step[2];       /* by which the number was moved to both sides */
    double difference[2]; /* of second order; NaN: a run failed */
    double disagreement;  /* the smaller of both, over the largest of: gradient, difference, a
                           * thousandth of the largest of the array, what changes the loss by 1e-4
                           * of itself for a change of the number's size; HUGE_VAL: no difference */
    int one_sided;        /* 1: a number at the bound of its range, moved to one side only */
    int kink; /* 1: with both steps the moved runs differ from the recorded one in contacts, modes
               * or events: a kink may lie between */
} carom_checked;

typedef struct carom_check_settings {
    int per_array;           /* numbers of each array that is given, 20; 0: all */
    unsigned long long seed; /* of the choice, 1 */
    double step[2]; /* sizes of the steps, relative to the number or its scale, 1e-5, 1e-6 */
    int (*progress)(void *user, int done, int all); /* not 0: stop; NULL: none */
    void *user;
} carom_check_settings;
CAROM_API carom_check_settings carom_check_defaults(void);
/* "q0", "v0", "mass", ...; NULL for any other number. */
CAROM_API const char *carom_gradient_name(int array);
/* Checks what carom_tape_gradient made of the same bars: each chosen number of each array of
 * `gradient` that is not NULL is moved to both sides, by two steps, on copies of the world that run
 * the tape's steps again (4 runs a number; the tape and its world stay as they are).  settings may
 * be NULL.  *count: numbers chosen; with entries the numbers checked, in order: fewer where
 * progress stopped it or capacity is less.  CAROM_E_STATE: parameters have changed since the
 * recording, or the tape's memory is bounded. */
CAROM_API carom_status carom_tape_check(carom_tape *tape, int n_bars, const carom_state_bar *bars,
                                        const carom_gradient *gradient,
                                        const carom_check_settings *settings, int capacity,
                                        carom_checked *entries, int *count);

/* Change of the state after `step` steps: 3 n_bodies each, overwritten; NULL: not wanted. */
typedef struct carom_state_dot {
    int step;
    double *q;
    double *v;
} carom_state_dot;

/* Forward pass over the whole tape: derivatives of states along directions, the transpose of
 * carom_tape_gradient.  directions: n_directions of them, arrays as in a gradient, read only; NULL:
 * that does not move.  All share the factors of every contact problem.  dots: n_dots states of
 * direction 0, then n_dots of direction 1, ...; any order. */
CAROM_API carom_status carom_tape_tangent(carom_tape *tape, int n_directions,
                                          const carom_gradient *directions, int n_dots,
                                          const carom_state_dot *dots, carom_gradient_stats *stats);

/* Dense derivative of one recorded step, `step` steps after the start, 0 <= step <
 * carom_tape_steps.  Every array of `rows` holds, for each of the 6 n_bodies components of the
 * state (q, then v) after the step, one after the other, what it holds in a gradient of that
 * component by the state before the step and the parameters: rows->q0 and rows->v0 are 6n x 3n,
 * rows->force 6n x 3n, rows->mass 6n x n, row by row, with n = n_bodies; force_steps is that of the
 * one step, as force is.  By columns (carom_tape_tangent) or by rows (carom_tape_gradient),
 * whichever is less work; the two agree to rounding.  Time that the step before owes counts as
 * spent. */
CAROM_API carom_status carom_tape_jacobian(carom_tape *tape, int step, const carom_gradient *rows,
                                           carom_gradient_stats *stats);

#ifdef __cplusplus
}
#endif
#endif
