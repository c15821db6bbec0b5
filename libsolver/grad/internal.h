/* internal.h: what the reverse pass works with. */
#ifndef CRM_GRAD_INTERNAL_H
#define CRM_GRAD_INTERNAL_H

#include "carom/grad.h"
#include "world/internal.h"

/* One recorded sub-step: a crm_substep whose arrays lie in one block of exact size, states as three
 * numbers per body of its island. */
typedef struct crm_record {
    crm_substep s;
    crm_island island; /* without pairs */
    int which;         /* number of the island in its frame */
    void *block;
    size_t bytes;
} crm_record;

/* One recorded step. */
typedef struct crm_frame {
    int first_record; /* of this step */
    double *force;    /* 3 n_bodies */
    double *q, *v;    /* 3 n_bodies: state before this step */
} crm_frame;

/* A world as bytes. */
typedef struct crm_snapshot {
    void *bytes;
    size_t size, capacity;
} crm_snapshot;

struct carom_tape {
    crm_memory memory;
    carom_world *world;
    long revision; /* the world's when the recording began */
    int n_records, max_records;
    crm_record *records;
    int n_frames, max_frames;
    crm_frame *frames;
    double *q_end, *v_end; /* 3 n_bodies: state after the last recorded step */
    int n_bodies;
    int most_contacts;   /* of all sub-steps recorded */
    int frame;           /* under way */
    carom_world *source; /* of the sub-steps under way: world, or replay */
    /* Checkpoints: only one segment of `every` frames has records; the others are run again. */
    int every; /* 0: all frames are one segment */
    int held;  /* the segment that has them, from its start; -1: none */
    int max_snapshots;
    crm_snapshot *snapshots; /* per segment: of the world before it */
    carom_world *replay;     /* during a gradient: a copy of the world that runs again */
};

/* tape.c */
/* Records the step `frame` of t->source, whose force is in the frame. */
carom_status crm_record_step(carom_tape *t, int frame, const double *force,
                             carom_step_stats *stats);
void crm_drop_records(carom_tape *t, int n);

/* checkpoint.c */
int crm_segment(const carom_tape *t, int frame);
/* Before frame is run: a snapshot when a segment begins. */
carom_status crm_checkpoint(carom_tape *t, int frame);
/* The records of the segment of frame, run again when they are gone. */
carom_status crm_hold_segment(carom_tape *t, int frame);
void crm_free_checkpoints(carom_tape *t);

/* Cotangents of the parameters; NULL where not wanted. */
typedef struct crm_sink {
    carom_gradient g;
    double *force_step; /* 3 n_bodies: row of g.force_steps for the step under way */
} crm_sink;

/* A recorded sub-step with states of world size. */
typedef struct crm_unpacked {
    crm_substep s;
    double *q0, *v0, *q1, *v1; /* 3 n_bodies, like all below */
    double *solve_q[CRM_MAX_SOLVES], *solve_v[CRM_MAX_SOLVES];
} crm_unpacked;

/* Workspace of a reverse pass. */
typedef struct crm_reverse {
    carom_tape *tape;
    carom_world *world;
    crm_sink sink;
    double scale;          /* largest seed so far */
    double *q_bar, *v_bar; /* 3 n_bodies: state under way */
    double *q_seed, *v_seed;
    double *velocity_bar; /* 3 per body of the island */
    double *gap_bar;      /* per contact */
    carom_contact_bars bars;
    double *solve_bar;           /* 3 n_bodies: cotangent of the velocity of the solve under way */
    double *late_bar;            /* 3 n_bodies: of v0, through the springs of stage 2 */
    double *pose;                /* 3 n_bodies: end of an iteration of stage 1 */
    double *pose_bar;            /* 3 n_bodies: its cotangent */
    double *rest;                /* 3 n_bodies: what the passes of stage 1 have left to do */
    double *spare_q, *spare_v;   /* 3 n_bodies: for cotangents that do not count */
    crm_contact *moved;          /* contacts at the pose of the problem under way */
    int record;                  /* under way */
    crm_unpacked work, inner;    /* the sub-step under way, and one within it */
    double *column_q, *column_v; /* 3 n_bodies: cotangents within a column of an extrapolated map */
    double *start_q, *start_v;   /* ... and at the start of all */
    double *q_after, *v_after;   /* 3 n_bodies: state after it */
    double *clock_bar, *clock_old; /* per body: cotangent of the time owed to the next step, of the
                                    * frame under way and of the one after it */
    void *block;
    size_t bytes;
    carom_gradient_stats stats;
} crm_reverse;

/* gradient.c: the recorded sub-step into `to`; its island is entered. */
void crm_unpack(crm_reverse *r, const crm_record *record, crm_unpacked *to);

/* geometry.c: reverse derivatives of rows and gaps; each adds. */
void crm_contact_rows_vjp(const crm_contact *c, const double jn_bar[6], const double jt_bar[6],
                          carom_contact_bar *bar);
void crm_geometry_vjp(crm_reverse *r, const double *q, const crm_contact *c,
                      const carom_contact_bar *bar, double *q_bar, int with_parameters);
void crm_slip_vjp(crm_reverse *r, const crm_contact *c, const double *q0, const double *q1,
                  double slip_bar, double *q0_bar, double *q1_bar, int with_parameters);

/* joint.c: each adds. */
/* Of x = p + R(angle) local: the arm's cotangent to angle and local (may be NULL). */
void crm_arm_vjp(double angle, carom_vec2 local, carom_vec2 arm_bar, double *angle_bar,
                 carom_vec2 *local_bar);
typedef struct crm_joint_bar {
    carom_vec2 anchor[2];
    double axis, angle, length;
} crm_joint_bar;
/* Of a limit as a contact: bar as in carom_contact_vjp. */
void crm_limit_vjp(crm_reverse *r, const double *q, int limit, const carom_contact_bar *bar,
                   double *q_bar, int with_parameters);
/* Of a measure and its row (may be NULL) at q. */
void crm_measure_vjp(const crm_joint *j, crm_measure m, const double *q, const double row_bar[6],
                     double value_bar, double *q_bar, crm_joint_bar *bar);
/* Of a joint's rows (6 numbers each) and errors, each may be NULL. */
void crm_joint_vjp(crm_reverse *r, const double *q, int joint, const double *je_bar,
                   const double *error_bar, double *q_bar, int with_parameters);

void crm_joint_give(const crm_reverse *r, int joint, const crm_joint_bar *bar);

/* drive.c: springs and motors in rows.u and rows of a solve: after crm_solve_vjp, before
 * crm_mass_vjp.  v_bar: of the velocity before the solve (of stage 2: of vh, and r->late_bar). */
void crm_drive_vjp(crm_reverse *r, const crm_substep *s, const crm_solve *c, double *v_bar,
                   double *q_bar, double *h_bar, int with_parameters);
/* The row of a motor that holds, in an iteration of stage 1: as joint_side_vjp. */
void crm_motor_side_vjp(crm_reverse *r, const crm_substep *s, int joint, int row, const double *v,
                        const double *p, double *v_bar, double *q0_bar, double *h_bar,
                        int with_parameters);

/* reverse.c: the adjoint of one solve. */
/* Reverse derivative of solve c with the cotangent v_bar of its velocity: fills r->bars.  Masses go
 * to the sink with with_parameters, except what u depends on them. */
carom_status crm_solve_vjp(crm_reverse *r, crm_substep *s, const crm_solve *c, const double *v_bar);
/* u = v + h (W f + g): u_bar to v_bar, h_bar (times share = dh / dstep), forces, gravity, masses.
 */
void crm_free_velocity_vjp(crm_reverse *r, const crm_substep *s, double h, double share,
                           double *v_bar, double *h_bar, int with_parameters);
/* q1 = q0 + h v: v_bar += h q_bar, *h_bar += q_bar . v. */
void crm_move_vjp(const carom_world *w, const crm_substep *s, const double *v, const double *q_bar,
                  double *v_bar, double *h_bar);
/* Inverse masses in r->bars to mass and inertia. */
void crm_mass_vjp(crm_reverse *r);
/* Rows in r->bars, and gaps and joint errors when given, at q of solve c, to q_bar and parameters.
 */
void crm_rows_vjp(crm_reverse *r, const crm_substep *s, const crm_solve *c, const double *gap_bar,
                  const double *error_bar, double *q_bar, int with_parameters);
/* c_n = e u_n with u_n = J_n v, or gap / h ahead: adds to v_bar, rows, gap_bar, h_bar. */
void crm_targets_vjp(crm_reverse *r, const crm_substep *s, const double *v, double *v_bar,
                     double *gap_bar, double *h_bar, int with_parameters);

/* q' = q + d(q): the frictionless problem of a position correction. */
carom_status crm_correction_vjp(crm_reverse *r, crm_substep *s, const crm_solve *c, double *q_bar,
                                int with_parameters);
/* Restitution of a contact: e_bar to both bodies. */
void crm_restitution_vjp(crm_reverse *r, const crm_substep *s, const crm_contact *c, double e_bar);

/* The maps, from (q_bar, v_bar) at the end of a sub-step to its start, in place; parameters go to
 * the sink when with_parameters; *h_bar is the cotangent of h. */
carom_status crm_euler_vjp(crm_reverse *r, crm_substep *s, double *q_bar, double *v_bar,
                           int with_parameters, double *h_bar);
carom_status crm_smooth_vjp(crm_reverse *r, crm_substep *s, double *q_bar, double *v_bar,
                            int with_parameters, double *h_bar);
carom_status crm_extrapolated_vjp(crm_reverse *r, crm_substep *s, double *q_bar, double *v_bar,
                                  int with_parameters, double *h_bar);
carom_status crm_impact_vjp(crm_reverse *r, crm_substep *s, double *q_bar, double *v_bar,
                            int with_parameters);
carom_status crm_substep_vjp(crm_reverse *r, crm_substep *s, double *q_bar, double *v_bar,
                             int with_parameters, double *h_bar);
#endif
