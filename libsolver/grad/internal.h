/* internal.h: what the reverse pass works with. */
#ifndef CRM_GRAD_INTERNAL_H
#define CRM_GRAD_INTERNAL_H

#include "carom/grad.h"
#include "world/block.h"
#include "world/internal.h"

/* One recorded sub-step: a crm_substep whose arrays lie in one block of exact size, states as three
 * numbers per body of its island. */
typedef struct crm_record {
    crm_substep s;
    crm_island island; /* without pairs */
    int which;         /* number of the island in its frame */
    int inner;         /* 1: of the extrapolated sub-step that follows */
    void *block;
    size_t bytes;
} crm_record;

/* One recorded step. */
typedef struct crm_frame {
    int first_record; /* of this step */
    int lean;         /* 1: its force is its own or rest_force, and its states come and go */
    double *force;    /* 3 n_bodies */
    double *q, *v;    /* 3 n_bodies: state before this step */
} crm_frame;

/* A world as bytes, before the frame `step`. */
typedef struct crm_snapshot {
    void *bytes;
    size_t size;
    int step;
    int for_good; /* 0: taken by a pass, to be dropped by it */
} crm_snapshot;

struct carom_tape {
    crm_memory memory;
    carom_world *world;
    long revision; /* the world's when the recording began */
    int n_records, max_records;
    crm_record *records;
    int n_frames, max_frames;
    crm_frame *frames;
    long first_step;       /* of the world: its steps before the recording */
    double *q_end, *v_end; /* 3 n_bodies: state after the last recorded step */
    double *rest_force;    /* 3 n_bodies: of steps that were given none, where memory is bounded */
    int n_bodies;
    int most_contacts;   /* of all sub-steps recorded */
    int frame;           /* under way */
    int next_known;      /* record of the frame before it at which to look for the next island */
    carom_world *source; /* of the sub-steps under way: world, or replay */
    /* Checkpoints: only the frames held_from .. held_to - 1 have records; others are run again. */
    int held_from, held_to; /* -1: none */
    double *block_end;      /* 6 n_bodies: state after the held ones, where states are not kept */
    double kappa;           /* of smoothing [J]; 0: none */
    int every;              /* distance of snapshots; 0: none, all frames are held */
    size_t limit;      /* of the memory of the tape; 0: none, and states of all steps are kept */
    size_t step_bytes; /* most that a step run again has taken */
    int ascending;     /* 1: a pass goes forward */
    int n_snapshots, max_snapshots;
    crm_snapshot *snapshots;
    carom_world *replay; /* a copy of the world that runs again */
    int replay_at;       /* the step it has come to; -1: not known */
    long n_replayed;     /* steps run again so far */
};

/* tape.c */
/* Records the step `frame` of t->source, whose force is in the frame. */
carom_status crm_record_step(carom_tape *t, int frame, const double *force,
                             carom_step_stats *stats);
void crm_drop_records(carom_tape *t, int n);
/* The state of a world as that before a frame, which has none; and dropped again. */
carom_status crm_keep_states(carom_tape *t, int frame, const carom_world *w);
void crm_drop_states(carom_tape *t, int frame);
/* CAROM_E_STATE where a world is not in the state before a frame, to the bit: the derivative would
 * be that of another run. */
carom_status crm_same_states(const carom_tape *t, int frame, const carom_world *w);
/* The state of a world as that after the held frames. */
void crm_keep_block_end(carom_tape *t, const carom_world *w);

/* checkpoint.c */
/* Before frame is run: a snapshot when it is time for one. */
carom_status crm_checkpoint(carom_tape *t, int frame);
/* Whether sub-steps are recorded as the run goes. */
int crm_records_kept(const carom_tape *t);
/* The records of a frame, run again when they are gone. */
carom_status crm_hold_segment(carom_tape *t, int frame);
void crm_forget_checkpoints(carom_tape *t);
void crm_free_checkpoints(carom_tape *t);

/* shared.c: the arrays of a gradient one by one: where array k is, NULL when not wanted, and how
 * many numbers it has for so many steps. */
enum { CRM_N_ARRAYS = 26 };
double *crm_array(const carom_gradient *g, int k);
void crm_set_array(carom_gradient *g, int k, double *p);
size_t crm_array_size(const carom_world *w, int n_frames, int k);

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

/* Kinks of the step under way, each once. */
typedef struct crm_kinks {
    int n, max;
    carom_kink *list;
} crm_kinks;

/* kinks.c */
carom_status crm_kinks_add(crm_memory *m, crm_kinks *to, int step, const crm_contact *c,
                           carom_kink_kind kind);
/* Those of a solve whose problem is in place. */
carom_status crm_kinks_of_solve(const carom_world *w, crm_memory *m, crm_kinks *to, int step,
                                const crm_substep *s, const crm_solve *c,
                                const carom_contact_problem *p);
void crm_kinks_free(crm_memory *m, crm_kinks *x);

/* What the rows at the end of a stage 1 have more than those at its start, 6 numbers each: an
 * iteration answers a change x of its velocity with right-hand sides that change by these times x.
 */
typedef struct crm_turn {
    double *n, *t; /* per contact; 0 where there is no friction */
    double *e;     /* per joint row */
} crm_turn;
/* Passes of stage 1 end when the rest is below CRM_PASS_TOL [of the first].  Where one leaves more
 * than CRM_SLOW of the rest, the sum is found by Anderson's method.  A rest above CRM_PASS_LOOSE
 * after all of them: no derivative rather than a wrong one. */
#define CRM_PASS_TOL   1e-15
#define CRM_SLOW       0.3
#define CRM_PASS_LOOSE 1e-9
enum { CRM_MAX_PASSES = 60 };
/* smooth.c: the largest number of the island. */
double crm_largest(const carom_world *w, const double *x);
/* smooth.c: first with the rows at the end p of stage 1 in place, then with those at its start. */
void crm_turn_end(const carom_world *w, const crm_substep *s, const double *p, crm_turn *turn);
void crm_turn_start(const carom_world *w, const crm_substep *s, crm_turn *turn);

/* Room for a point of the central path near a recorded solution; none when the tape does not
 * smooth.
 */
typedef struct crm_smoothed {
    double *v, *ln, *lt, *le;
    unsigned char *mode;
} crm_smoothed;
/* shared.c */
void crm_lay_smoothed(const carom_tape *t, crm_smoothed *to, crm_block *b, size_t k3, size_t m,
                      size_t rows);
/* Where the tape smooths, *x becomes the point of the path of problem p near it, kept in `room`; a
 * problem whose path has no such point, and a correction of positions, stay as they are. */
carom_status crm_smooth_solution(const carom_tape *t, const carom_contact_problem *p,
                                 crm_solve_kind kind, const crm_smoothed *room,
                                 carom_contact_solution *x, carom_gradient_stats *stats);

/* One direction on its way: changes of the state and of what else moves. */
typedef struct crm_line {
    const carom_gradient *by;  /* parameters, read only */
    double h;                  /* of the length of the sub-step */
    double left;               /* of the time left to the island */
    double time;               /* of the start of the sub-step, for forces that depend on it */
    double *q, *v;             /* 3 n_bodies, like all below: of the state under way */
    double *q0, *v0;           /* ... and of the start of the sub-step */
    double *start_q, *start_v; /* of an extrapolated one, whose columns use the others */
    double *sum_q, *sum_v;     /* of its columns, weighted */
    double *clock, *clock_old; /* per body: of the time owed to the next step and to this one */
} crm_line;

/* Changes of the data of a contact problem: a carom_contact_direction that can be written. */
typedef struct crm_problem_dot {
    double *inv_mass, *u, *jn, *jt, *mu, *cn, *ct, *je, *ce;
} crm_problem_dot;

/* Workspace of a forward pass.  Lines share the factors of every problem. */
typedef struct crm_forward {
    carom_tape *tape;
    carom_world *world;
    int n;           /* lines */
    crm_line *lines; /* n, and one that moves by h alone */
    int from;        /* the frame that the pass begins with */
    int frame;       /* under way */
    int asked;       /* 1: for a state after it */
    int record;      /* under way */
    crm_problem_dot dot;
    crm_turn turn;
    double *left;            /* 6 per joint row: rows at the end of stage 1 */
    double *gap;             /* per contact: change of its gap at the pose of the rows */
    double *error;           /* per joint row */
    double *result;          /* 3 per body of the island: of the velocity of a solve */
    double *pose, *pose_dot; /* 3 n_bodies: end of an iteration of stage 1 */
    double *rest, *trial;    /* 3 n_bodies: what the passes of stage 1 give; 0 of static bodies */
    carom_contact_problem problem;   /* of the solve under way */
    carom_contact_solution solution; /* likewise */
    crm_smoothed smoothed;
    crm_contact *moved;
    crm_unpacked work, inner;
    void *block;
    size_t bytes;
    crm_kinks kinks;
    carom_status failure; /* of noting kinks, or of smoothing */
    carom_gradient_stats stats;
} crm_forward;

/* Workspace of a reverse pass. */
typedef struct crm_reverse {
    carom_tape *tape;
    carom_world *world;
    crm_sink sink;
    int from, to;                    /* frames from .. to - 1 */
    double scale;                    /* largest seed so far */
    double time_bar;                 /* of the start of the sub-step under way */
    crm_forward clockwork;           /* without lines of its own; opened by the first event */
    double *q_bar, *v_bar;           /* 3 n_bodies: state under way */
    double *velocity_bar;            /* 3 per body of the island */
    double *gap_bar;                 /* per contact */
    carom_contact_bars bars;         /* of the solve under way, in one block, so that they add up */
    carom_contact_bars total;        /* of all passes of stage 1: u and sides */
    size_t n_sides;                  /* numbers of u, cn, ct and ce, one behind the other */
    carom_contact_problem problem;   /* of the solve under way */
    carom_contact_solution solution; /* likewise */
    crm_smoothed smoothed;
    crm_turn turn;
    int wants_shapes, wants_joints; /* 1: radii or vertices; anchors, axes, angles or lengths */
    double *solve_bar;         /* 3 n_bodies: cotangent of the velocity of the solve under way */
    double *late_bar;          /* 3 n_bodies: of v1, as forces of stage 2 see it */
    double *pose;              /* 3 n_bodies: end of an iteration of stage 1 */
    double *pose_bar;          /* 3 n_bodies: its cotangent */
    double *rest;              /* 3 n_bodies: what the passes of stage 1 have left to do */
    double *spare_q, *spare_v; /* 3 n_bodies: for cotangents that do not count */
    crm_contact *moved;        /* contacts at the pose of the problem under way */
    int frame;                 /* under way */
    int asked;                 /* 1: for a state after it */
    crm_kinks kinks;
    carom_status failure;        /* of noting kinks, or of smoothing */
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

/* shared.c */
void crm_lay_unpacked(crm_unpacked *u, crm_block *b, size_t n3);
/* The static bodies of all states from q. */
void crm_place_statics(crm_unpacked *u, const double *q, size_t n3);
/* The recorded sub-step into `to`, but for its end; its island is entered.  moved: room for the
 * contacts at the pose of a problem. */
void crm_unpack(carom_world *w, const crm_record *record, crm_contact *moved, crm_unpacked *to);
/* Three numbers per body, from world order to that of the island under way, and back. */
void crm_gather(const carom_world *w, const double *full, double *moving);
void crm_scatter(const carom_world *w, const double *moving, double *full);
/* d l_t / d mu of a closed contact without friction, from the right: it would oppose the slip,
 * l_t = -sign(u_t) mu l_n.  0 where it does not slip; rows of the solve in place. */
double crm_first_friction(const carom_world *w, const crm_solve *c, int k, const crm_contact *x);
/* Where the time of the event that ended a sub-step has no usable derivative [of dg/dh]. */
double crm_grazing(const carom_world *w, const crm_substep *s);
/* One behind the last record of a frame, whose segment is held. */
int crm_frame_end(const carom_tape *t, int frame);
/* W f + g of number k of a state after `step` steps, along which time owed there moves it. */
double crm_border_acceleration(const carom_tape *t, int step, int k);
/* CAROM_E_STATE, with a word, when parameters have changed since the recording. */
carom_status crm_tape_current(const carom_tape *t);

/* check.c: number k of a member of carom_gradient in a world; NULL: the force of a step, which no
 * world holds. */
double *crm_number(carom_world *w, int array, size_t k);
/* 0: it means nothing for its body or joint, and its derivative is 0. */
int crm_number_means(const carom_world *w, int array, size_t k);
/* check.c: all that decides which smooth map a recorded run is, as a number. */
unsigned long long crm_branch_of(const carom_tape *t);

/* gradient.c: the reverse pass from the state after step `to` to that after step `from`; their
 * forces are force_steps. */
carom_status crm_gradient_span(carom_tape *t, int from, int to, int n_bars,
                               const carom_state_bar *bars, const carom_gradient *gradient,
                               carom_gradient_stats *stats);

/* geometry.c: reverse derivatives of rows and gaps; each adds. */
void crm_contact_rows_vjp(const crm_contact *c, const double jn_bar[6], const double jt_bar[6],
                          carom_contact_bar *bar);
void crm_geometry_vjp(crm_reverse *r, const double *q, const crm_contact *c,
                      const carom_contact_bar *bar, double *q_bar);
void crm_slip_vjp(crm_reverse *r, const crm_contact *c, const double *q0, const double *q1,
                  double slip_bar, double *q0_bar, double *q1_bar);

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
                   double *q_bar);
/* Of a measure and its row (may be NULL) at q. */
void crm_measure_vjp(const crm_joint *j, crm_measure m, const double *q, const double row_bar[6],
                     double value_bar, double *q_bar, crm_joint_bar *bar);
/* Of a joint's rows (6 numbers each) and errors, each may be NULL. */
void crm_joint_vjp(crm_reverse *r, const double *q, int joint, const double *je_bar,
                   const double *error_bar, double *q_bar);

void crm_joint_give(const crm_reverse *r, int joint, const crm_joint_bar *bar);

/* drive.c: springs and motors in rows.u and rows of a solve: after crm_solve_vjp, before
 * crm_mass_vjp.  v_bar: of the velocity before the solve (of stage 2: r->late_bar is that of v1).
 */
void crm_drive_vjp(crm_reverse *r, const crm_substep *s, const crm_solve *c, double *v_bar,
                   double *q_bar, double *h_bar);
/* The row of a motor that holds, in an iteration of stage 1 that ends at r->pose. */
void crm_motor_side_vjp(crm_reverse *r, const crm_substep *s, int joint, int row, double *q0_bar,
                        double *h_bar);

/* What the velocity that springs see in stage 2 has from the pushes of u_bar alone: adds. */
void crm_seen_vjp(crm_reverse *r, const crm_substep *s, const crm_solve *c, double *seen_bar);

/* field.c */
void crm_fields_vjp(crm_reverse *r, const crm_substep *s, const crm_solve *c, double *v_bar,
                    double *q_bar, double *h_bar);
void crm_fields_seen_vjp(crm_reverse *r, const crm_substep *s, const crm_solve *c,
                         double *seen_bar);

/* reverse.c: the adjoint of one solve. */
/* Problem and solution of solve c of s; rows in place. */
void crm_pose_solve(crm_reverse *r, crm_substep *s, const crm_solve *c);
/* Reverse derivative of that solve with the cotangent v_bar of its velocity: u and sides of
 * r->bars. tol > 0: another one of the same solve, to within tol of the largest entry of v_bar. */
carom_status crm_sides_vjp(crm_reverse *r, const double *v_bar, double tol);
/* The rest of r->bars, from u and sides. */
carom_status crm_rest_vjp(crm_reverse *r);
/* All of it. */
carom_status crm_solve_vjp(crm_reverse *r, crm_substep *s, const crm_solve *c, const double *v_bar);
/* u = v + h (W f + g) of a solve, h its share of the sub-step: u_bar to v_bar, h_bar, forces,
 * gravity, masses, damping. */
void crm_free_velocity_vjp(crm_reverse *r, const crm_substep *s, const crm_solve *c, double *v_bar,
                           double *h_bar);
/* q1 = q0 + h v: v_bar += h q_bar, *h_bar += q_bar . v. */
void crm_move_vjp(const carom_world *w, const crm_substep *s, const double *v, const double *q_bar,
                  double *v_bar, double *h_bar);
/* Inverse masses in r->bars, as damping has left them in solve c, to mass and inertia, damping and
 * h_bar. */
void crm_mass_vjp(crm_reverse *r, const crm_substep *s, const crm_solve *c, double *h_bar);
/* Rows in r->bars, and gaps and joint errors when given, at q of solve c, to q_bar and parameters.
 */
void crm_rows_vjp(crm_reverse *r, const crm_substep *s, const crm_solve *c, const double *gap_bar,
                  const double *error_bar, double *q_bar);
/* c_n = e u_n with u_n = J_n v, or gap / h ahead: adds to v_bar, rows, gap_bar, h_bar. */
void crm_targets_vjp(crm_reverse *r, const crm_substep *s, const double *v, double *v_bar,
                     double *gap_bar, double *h_bar);

/* q' = q + d(q): the frictionless problem of a position correction. */
carom_status crm_correction_vjp(crm_reverse *r, crm_substep *s, const crm_solve *c, double *q_bar);
/* Restitution of a contact: e_bar to both bodies. */
void crm_restitution_vjp(crm_reverse *r, const crm_substep *s, const crm_contact *c, double e_bar);

/* The maps, from (q_bar, v_bar) at the end of a sub-step to its start, in place; parameters go to
 * the sink; *h_bar is the cotangent of h. */
carom_status crm_euler_vjp(crm_reverse *r, crm_substep *s, double *q_bar, double *v_bar,
                           double *h_bar);
carom_status crm_smooth_vjp(crm_reverse *r, crm_substep *s, double *q_bar, double *v_bar,
                            double *h_bar);
carom_status crm_extrapolated_vjp(crm_reverse *r, crm_substep *s, double *q_bar, double *v_bar,
                                  double *h_bar);
carom_status crm_impact_vjp(crm_reverse *r, crm_substep *s, double *q_bar, double *v_bar);
carom_status crm_substep_vjp(crm_reverse *r, crm_substep *s, double *q_bar, double *v_bar,
                             double *h_bar);

/* --- forward ------------------------------------------------------------------------------------
 */

static inline double crm_entry(const double *array, int i)
{
    return array ? array[i] : 0;
}

/* Everything below changes the first n lines, or returns the change along one of them. */
/* geometry.c */
void crm_contact_rows_jvp(const crm_contact *c, const carom_contact_dot *dot, double jn[6],
                          double jt[6]);
carom_contact_dot crm_geometry_jvp(const carom_world *w, const double *q, const crm_contact *c,
                                   const double *q_dot, const carom_gradient *by);
/* Derivative of a slip by q1 of the bodies A and B. */
void crm_slip_row(const carom_world *w, const crm_contact *c, const double *q1, double row[6]);
double crm_slip_jvp(const carom_world *w, const crm_contact *c, const double *q0, const double *q1,
                    const double *q0_dot, const double *q1_dot, const carom_gradient *by);

/* joint.c */
carom_vec2 crm_arm_jvp(double angle, carom_vec2 local, double angle_dot,
                       const carom_vec2 *local_dot);
double crm_measure_jvp(const carom_world *w, int joint, crm_measure m, const double *q,
                       const double *q_dot, const carom_gradient *by, double row_dot[6]);
carom_contact_dot crm_limit_jvp(const carom_world *w, const double *q, int limit,
                                const double *q_dot, const carom_gradient *by);

/* drive.c: after crm_rows_jvp; adds to dot.u, and sets rows and sides of motors. */
void crm_drive_jvp(crm_forward *f, const crm_substep *s, const crm_solve *c, const crm_line *line);
/* dot.u += what a change x of the velocity that is seen in stage 2 gives. */
void crm_seen_jvp(crm_forward *f, const crm_substep *s, const crm_solve *c, const double *x);
/* field.c */
void crm_fields_jvp(crm_forward *f, const crm_substep *s, const crm_solve *c, const crm_line *line);
void crm_fields_seen_jvp(crm_forward *f, const crm_substep *s, const crm_solve *c, const double *x);
/* c_e of a motor that holds in an iteration of stage 1, which ends at f->pose, but for its speed.
 */
double crm_motor_side_jvp(const crm_forward *f, const crm_substep *s, int joint, int row,
                          const crm_line *line);

/* forward.c: the pieces of a sub-step. */
/* Problem and solution of solve c of s, for all lines. */
void crm_begin_solve(crm_forward *f, crm_substep *s, const crm_solve *c);
/* Changes of rows, gaps, errors, friction and inverse masses of that problem, at c->q moved by
 * line->q; right-hand sides do not change, and u by its first friction alone. */
void crm_rows_jvp(crm_forward *f, const crm_substep *s, const crm_solve *c, const crm_line *line);
/* dot.u += change of v + h (W f + g), v_dot that of v. */
void crm_free_velocity_jvp(crm_forward *f, const crm_substep *s, const crm_solve *c,
                           const crm_line *line, const double *v_dot);
/* Of c_n = e u_n, or gap / h ahead. */
void crm_targets_jvp(crm_forward *f, const crm_substep *s, const crm_line *line);
/* Change of the solution along dot, of the island, to v_dot. */
carom_status crm_solve_jvp(crm_forward *f, double *v_dot);
/* The same along dot.u alone. */
carom_status crm_push_jvp(crm_forward *f, double *v_dot);
/* The same along dot.cn, dot.ct and dot.ce alone. */
carom_status crm_sides_jvp(crm_forward *f, double *v_dot);
/* q1 = q0 + h v: q_dot += h v_dot + h_dot v. */
void crm_move_jvp(const carom_world *w, const crm_substep *s, const double *v, double h_dot,
                  const double *v_dot, double *q_dot);
carom_status crm_correction_jvp(crm_forward *f, crm_substep *s, const crm_solve *c, int n);
double crm_restitution_jvp(const carom_world *w, const crm_substep *s, const crm_contact *c,
                           const carom_gradient *by);

/* The maps, of the sub-step whose length changes by line->h. */
carom_status crm_substep_jvp(crm_forward *f, crm_substep *s, int n);
carom_status crm_smooth_jvp(crm_forward *f, crm_substep *s, int n);
carom_status crm_extrapolated_jvp(crm_forward *f, crm_substep *s, int n);

/* tangent.c: a pass from the state after `step` steps, frame by frame. */
carom_status crm_forward_open(crm_forward *f, carom_tape *tape, int n,
                              const carom_gradient *directions, int step);
carom_status crm_forward_frame(crm_forward *f, int frame);
/* The line's change of the state that the pass has come to, with what it owes to the next step,
 * which moves it along (v, W f + g). */
void crm_give_state(const crm_forward *f, const crm_line *line, const carom_state_dot *to);
void crm_forward_close(crm_forward *f);
/* The line behind the others, at rest but for h. */
crm_line *crm_begin_clockwork(const crm_forward *f);
/* (q1, v1) of a record of the frame under way, unpacked into s: where the next one of its island
 * begins, or the end of the step.  end: behind the frame's last record. */
void crm_end_of(const crm_forward *f, int record, int end, crm_substep *s);
/* Change of the indicator that ended the sub-step, at the changed (q1, v1) of the line. */
double crm_event_jvp(const crm_forward *f, const crm_substep *s, const crm_line *line);

#endif
