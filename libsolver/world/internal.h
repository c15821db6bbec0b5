/* internal.h: the data of a world and the parts of its step, shared by world/ and grad/. */
#ifndef CRM_WORLD_INTERNAL_H
#define CRM_WORLD_INTERNAL_H

#include "base/memory.h"
#include "carom/broadphase.h"
#include "carom/collide.h"
#include "carom/events.h"
#include "carom/world.h"
#include "world/anderson.h"

#include <math.h>

/* Position corrections of a sub-step: four reach rounding level from 1e-2; a light link between
 * heavy ones that turns far needs more. */
#define CRM_MAX_CORRECTIONS 8
/* Of a sub-step the first one or two are the map's, the rest corrections. */
#define CRM_MAX_SOLVES (2 + CRM_MAX_CORRECTIONS)
/* A pair whose gap is below this touches [L]. */
#define CRM_HIT_TOL 1e-12
/* An event sooner than that [dt] is none: what it waits for was so at the start. */
#define CRM_NO_TIME 1e-13
/* Factorizations of an island in a frame from which on a solve is left early where another map or a
 * shorter sub-step may do, and from which on the rest of the frame is one Euler sub-step. */
enum { CRM_BRIEF = 1000, CRM_WORN = 5000 };
/* New overlap that is worth another solve, or said [L]. */
#define CRM_DEEP 1e-4
/* Approach below this is rest [fastest point of the world]. */
#define CRM_REST_TOL 1e-9

typedef struct crm_body {
    carom_body_type type;
    int first_shape;
    int n_shapes;
    int collide;
    int sensor;
    int unknown;   /* index in the island under way, -1: static */
    int n_springs; /* springs and motors on it; set by seal */
    double reach;  /* farthest point of its shapes from the position [m]; set by seal */
    carom_filter filter;
} crm_body;

typedef struct crm_shape {
    carom_shape view; /* its vertices live in carom_world.vertices */
    int body;
    int first_vertex;
    double reach;     /* farthest point from the body's position [m]; set by seal */
    double thickness; /* smallest width over the edge normals [m]; set by seal */
} crm_shape;

/* Anchors and axis are in the frames of the bodies. */
typedef struct crm_joint {
    carom_joint_kind kind;
    int body_a;
    int body_b;
    carom_vec2 local_a;
    carom_vec2 local_b;
    double axis;        /* direction in the frame of A [rad] */
    double angle;       /* held turn of B against A [rad] */
    double length;      /* held distance [m] */
    double lever;       /* makes an angle a length: L [m]; set by seal */
    double lower;       /* limits of what crm_limit_measure says [m, rad]; -HUGE_VAL: none */
    double upper;       /* HUGE_VAL: none */
    double restitution; /* at its limits */
    double stiffness;   /* spring on what crm_spring_measures says [N/m, N m/rad] */
    double damping;     /* [N s/m, N m s/rad] */
    double rest;        /* where the spring is at rest [m, rad] */
    double motor_speed; /* of what crm_motor_measure says [m/s, rad/s] */
    double motor_limit; /* largest force or torque of the motor [N, N m]; 0: no motor */
    int collide;
    int first_row; /* among the rows of all joints */
    int n_rows;    /* held, then that of the motor */
    int n_held;
} crm_joint;

/* What a row of a joint measures, with d from the anchor of A to that of B. */
typedef enum crm_measure {
    CRM_ACROSS_X, /* d . (1, 0) */
    CRM_ACROSS_Y, /* d . (0, 1) */
    CRM_ALONG,    /* d . axis, the axis turning with A */
    CRM_ASIDE,    /* d . perp(axis) */
    CRM_APART,    /* |d| - length */
    CRM_TURN      /* lever (angle of B - angle of A - angle) */
} crm_measure;
enum { CRM_MAX_JOINT_ROWS = 3 };

/* A contact point between two shapes at the pose where it was evaluated. */
typedef struct crm_contact {
    int shape_a;
    int shape_b;
    int body_a;
    int body_b;
    carom_recipe recipe;
    carom_vec2 normal;
    carom_vec2 arm_a;
    carom_vec2 arm_b;
    double gap;
    double turn;     /* of a limit: added to the row of the turn of B against A */
    int limit;       /* 0; else the limit of a joint that this is */
    int speculative; /* 1: not touching; constrained by J_n v + gap/h >= 0 */
} crm_contact;

typedef enum crm_end {
    CRM_END_FRAME,    /* h is all the time that was left */
    CRM_END_FRACTION, /* h = fraction * left, fraction constant */
    CRM_END_IMPACT,   /* no time passes */
    CRM_END_EVENT,    /* h is the root of the gap of `event` */
    CRM_END_STOP      /* h is the root of the slip speed of `event` */
} crm_end;

/* One contact problem of a sub-step and its solution; docs/step.md.  Row data not used by a kind
 * are zero.  Of a correction the multipliers are those of d = W (Jn' ln + Je' le): what is added to
 * the step's own. */
typedef enum crm_solve_kind {
    CRM_VELOCITY,   /* Euler: v1 from rows at q0 */
    CRM_CORRECTION, /* displacement v from rows at q, frictionless */
    CRM_IMPACT,     /* v1 from v0, no time passes */
    CRM_STAGE_1,   /* smooth: velocity over the sub-step, rows at q0, right-hand sides at its end */
    CRM_STAGE_2,   /* smooth: v1 from rows at q1 */
    CRM_BOUNCE,    /* in place of stage 2: v1 from v0 and all of h, with restitution */
    CRM_HOLD,      /* displacement v onto the active constraints at q, equations of the modes */
    CRM_HOLD_SPEED /* v1 onto the active constraints at q1 */
} crm_solve_kind;

typedef struct crm_solve {
    crm_solve_kind kind;
    double *q;            /* 3 n_bodies: where the rows are */
    double *v;            /* 3 n_bodies: the solution, zero for static bodies */
    double share;         /* of a correction: how much of it was taken, 1 or less */
    double *cn;           /* per contact */
    double *ct;           /* per contact */
    double *ln;           /* per contact */
    double *lt;           /* per contact */
    double *ce;           /* per joint row */
    double *le;           /* per joint row */
    unsigned char *mode;  /* per contact */
    unsigned char *motor; /* per joint row: crm_motor_state */
} crm_solve;

/* How a motor's row is in a solve. */
typedef enum crm_motor_state {
    CRM_MOTOR_OFF,   /* no motor, or none here: a row of zeros */
    CRM_MOTOR_HOLDS, /* its speed is met */
    CRM_MOTOR_MINUS, /* at its limit, against the measure: a row of zeros and a given impulse */
    CRM_MOTOR_PLUS
} crm_motor_state;

/* The maps that a sub-step can be. */
typedef enum crm_map {
    CRM_MAP_EULER,
    CRM_MAP_SMOOTH,
    CRM_MAP_IMPACT,
    CRM_MAP_EXTRAPOLATED /* a combination of chains of smooth ones */
} crm_map;
enum { CRM_MAX_COLUMNS = 4, CRM_MAX_INNER = 10, CRM_MAX_HOLDS = 4 };

/* Everything about one sub-step: what the reverse pass needs, no more. */
typedef struct crm_substep {
    crm_map map;
    double h;            /* [s], 0 for an impact */
    double *q0, *v0;     /* 3 n_bodies */
    double *q1, *v1;     /* 3 n_bodies */
    const double *force; /* 3 n_bodies: (torque, fx, fy) of the step */
    int degenerate;      /* weakly active or stick/slip borderline contacts */
    int n_contacts;
    int max_contacts;
    crm_contact *contacts;   /* geometry at q0 */
    crm_contact *moved;      /* the same contacts at the pose of the problem under way */
    unsigned char *pressing; /* per contact: closed by force, so held at gap 0 from both sides */
    signed char *slips;      /* per contact: the sign of the slip that it is made to keep, or 0 */
    double *target;          /* per contact: gap that stage 1 aims at [m] */
    double *joint_target;    /* per joint row: error that stage 1 aims at [m] */
    double restitution;      /* factor on all restitutions: 1, or 0 when relaxed */
    int slick;               /* 1: without friction, where that left no solution */
    carom_status met;        /* of the map, when it was last run */
    int ahead;               /* 1: contacts are all that may close; impacts are not located */
    int n_inner;             /* of an extrapolated map: its smooth sub-steps */
    double weight[CRM_MAX_COLUMNS]; /* ... of its columns */
    double estimate;                /* of its error [m] */
    int finest;                     /* 1: modes change within it, the finest column alone counts */
    int n_solves;
    crm_solve solve[CRM_MAX_SOLVES];
    crm_end end;
    double fraction;
    crm_contact event; /* the contact that closes at q1 */
    void *state_block; /* one block each: states; contacts */
    size_t state_bytes;
    void *contact_block;
    size_t contact_bytes;
} crm_substep;

/* Arrays of one contact problem, sized for the world. */
typedef struct crm_rows {
    int max_contacts;
    int *contact_body;
    double *jn, *jt, *mu;
    double *zero; /* max_contacts zeros: friction of corrections */
    double *yn;   /* per contact, and ye per joint row: why a problem is infeasible */
    double *ye;
    int *joint_body;
    double *je;
    double *error;    /* per joint row: position error at the pose of the rows [m] */
    double *u;        /* 3 n_moving */
    double *v;        /* 3 n_moving: solution */
    double *inv_mass; /* 3 n_moving */
    void *fixed_block;
    size_t fixed_bytes;
    void *contact_block;
    size_t contact_bytes;
} crm_rows;

/* A contact of an island's last sub-step and how it was: the first guess for the next one. */
typedef struct crm_touch {
    crm_contact contact; /* at the start of the sub-step */
    carom_vec2 point;    /* on A, world [m] */
    double ln, lt;
    double force_n[2], force_t[2]; /* impulses per time of the first two solves [N] */
    unsigned char mode;
} crm_touch;

/* Touches ordered by shape pair: those of the last frame, and those of the frame under way in the
 * order of islands. */
typedef struct crm_touches {
    int n, max;
    crm_touch *list;
} crm_touches;

/* Moving bodies that joints and pairs which may touch within the frame connect, ascending.  A
 * sub-step is one island's; static bodies belong to none. */
typedef struct crm_island {
    int n_bodies;
    int *bodies;
    int n_joints;
    int *joints;
    int n_rows;    /* of the joints */
    int n_limited; /* joints with limits */
    int n_driven;  /* joints with a spring or motor */
    int n_pairs;
    carom_pair *pairs; /* shapes; also with static bodies */
    int clock;         /* the body whose owed time the frame takes over */
} crm_island;

typedef struct crm_islands {
    int n;
    crm_island *list;
    int *root, *label;     /* per body */
    unsigned char *linked; /* per body: in a pair or joint */
    int *bodies, *joints;
    double *ahead;    /* 3 n_bodies: the way foreseen for the frame */
    double *slack;    /* per body: room around it [m] */
    double *excess;   /* per body: more room, after it was left [m] */
    int escaped;      /* 1: a body left its room */
    int looked_ahead; /* 1: contacts ahead were chosen by the room of the bodies */
    carom_box *boxes;
    int n_pairs, max_found, max_pairs;
    carom_pair *found; /* all that may touch within the frame */
    carom_pair *pairs; /* the same by island */
    void *block;
    size_t bytes;
} crm_islands;

/* Events of the last step; those of the step under way while there is one. */
typedef struct crm_events {
    int on;
    int n, max;
    carom_contact_event *list;
} crm_events;

/* Told of every accepted sub-step, and when those of a frame are void. */
typedef struct crm_recorder {
    carom_status (*substep)(void *user, const crm_substep *s);
    void (*restart)(void *user);
    void *user;
} crm_recorder;

struct carom_world {
    crm_memory memory;
    carom_world_settings settings;
    char error[256];

    int n_bodies, max_bodies;
    crm_body *bodies;
    double *q, *v;                                   /* 3 n_bodies */
    double *force;                                   /* 3 n_bodies: constant */
    double *mass, *inertia, *friction, *restitution; /* n_bodies */
    void *body_block;                                /* holds the seven arrays above */
    size_t body_bytes;
    int n_shapes, max_shapes;
    crm_shape *shapes;
    int n_vertices, max_vertices;
    carom_vec2 *vertices;
    int n_joints, max_joints;
    int n_joint_rows;
    crm_joint *joints;
    int n_excluded, max_excluded;
    carom_pair *excluded; /* bodies, a < b, sorted */

    /* From here on: made by seal. */
    int sealed;
    int n_moving;
    double length;     /* L [m] */
    int smooth;        /* 1: two-stage map; 0: Euler */
    double speed;      /* sqrt(g L) [m/s] */
    double rest_speed; /* v_rest [m/s] */
    double recovery;   /* errors of position are recovered no faster [m/s] */
    void *seal_block;  /* the arrays made by seal */
    size_t seal_bytes;
    double *step_force; /* 3 n_bodies: of the present step, constant + given */
    int n_joined;
    long *joined; /* sorted keys of body pairs joined so that they do not collide */
    carom_broadphase *broadphase;
    carom_contact_solver *solver;
    crm_rows rows;
    crm_substep sub;
    crm_substep inner[CRM_MAX_INNER]; /* of an extrapolated map; made when order > 2 */
    double *q_saved, *v_saved;        /* 3 n_bodies: for a failed step */
    crm_anderson anderson;            /* of stage 1 and of its adjoint */
    double *carry; /* per body: time owed to the next step, 0 but for rounding and derivative */
    unsigned char *owes; /* per body: the last step ended with an event */
    double *carry_saved;
    double *probe; /* 3 n_bodies: a pose near another one; order > 2 */
    unsigned char *owes_saved;
    int statics_placed;       /* 1: the states of sub hold the static bodies */
    crm_islands islands;      /* of the frame under way */
    const crm_island *island; /* under way */
    int n_substeps;           /* of the island in this frame */
    int n_impacts;            /* of the island since time last passed */
    int effort;               /* factorizations of the island in this frame */
    crm_touches touches, next;
    int first_touch;        /* of the island, in next */
    double *joint_force[2]; /* per joint row: as crm_touch.force_n [N] */
    double *joint_total;    /* per joint row: over the last sub-step that took time [N] */
    int factor_blocks;      /* 3 x 3, of the last contact problem that was factored */
    long revision;          /* counts changes of parameters */
    long n_steps;
    carom_step_stats *stats; /* of the step under way */
    crm_recorder recorder;
    crm_events events;
};

/* world.c: sets world->error and returns status. */
#ifdef __GNUC__
__attribute__((format(printf, 3, 4)))
#endif
carom_status
crm_world_fail(carom_world *w, carom_status status, const char *format, ...);

static inline carom_pose crm_pose(const double *q, int body)
{
    const carom_pose p = {q[3 * body], q[3 * body + 1], q[3 * body + 2]};
    return p;
}

static inline carom_vec2 crm_rotate(double angle, carom_vec2 v)
{
    const double c = cos(angle);
    const double s = sin(angle);
    const carom_vec2 r = {c * v.x - s * v.y, s * v.x + c * v.y};
    return r;
}

/* Requests so far of the world and of all that it owns. */
long crm_allocations(const carom_world *w);

/* A moving body's index in the contact problems of its island; -1 for static ones. */
static inline int crm_unknown(const carom_world *w, int body)
{
    return w->bodies[body].unknown;
}

/* world.c: no body owes time to the next step. */
void crm_forget_clocks(carom_world *w);

/* build.c: room for one more body; also makes the arrays of an empty world. */
carom_status crm_reserve_bodies(carom_world *w);
/* build.c: whether the caller excluded this pair. */
int crm_excluded(const carom_world *w, int body_a, int body_b);

static inline int crm_filters_meet(const carom_filter *a, const carom_filter *b)
{
    if (a->group && a->group == b->group) return a->group > 0;
    return (a->category & b->mask) && (b->category & a->mask);
}

/* islands.c */
carom_status crm_islands_create(carom_world *w);
void crm_islands_free(carom_world *w);
/* Islands of what may touch within dt from the world's state; dt = 0: of what touches. */
carom_status crm_islands_find(carom_world *w, double dt);
/* The same again with more room for the bodies that left theirs; *changed: other pairs. */
carom_status crm_islands_widen(carom_world *w, int *changed);
/* Notes which bodies of the island have left their room, from the frame's start to q. */
void crm_islands_watch(carom_world *w, const double *from, const double *q);
/* From now on `island` is under way. */
void crm_enter(carom_world *w, const crm_island *island);
/* World-sized arrays, three numbers per body: only those of the island. */
void crm_copy(const carom_world *w, double *to, const double *from);
void crm_zero(const carom_world *w, double *x);

/* detect.c: in the island under way. */
/* Contacts at q with gap <= margin, ordered by shape pair, into sub.contacts. */
carom_status crm_detect(carom_world *w, const double *q, double margin);
/* The same with every contact point that velocities like v could close within h, speculative. */
carom_status crm_detect_ahead(carom_world *w, const double *q, const double *v, double h,
                              double margin);
/* further.c: *deep: some overlap at q1 is new and deep; with look, its points that were open at q0
 * become contacts of sub, to be solved again. */
carom_status crm_detect_further(carom_world *w, int look, int *added, int *deep);
/* Filters, joints and exclusions: whether two bodies can meet at all; sealed worlds. */
int crm_may_meet(const carom_world *w, int body_a, int body_b);
/* ... and types and sensors: whether the shapes of a pair collide. */
int crm_may_collide(const carom_world *w, carom_pair pair);
carom_manifold crm_collide(const carom_world *w, carom_pair pair, const double *q, double margin);
/* Whether circles around the two bodies are farther apart than margin. */
int crm_far_apart(const carom_world *w, carom_pair pair, const double *q, double margin);
/* Signed distance of the pair at q0 + at (q1 - q0). */
double crm_distance_between(const carom_world *w, carom_pair pair, const double *q0,
                            const double *q1, double at);
/* Point k of a manifold found at q.  A clipped point becomes what it is to the dynamics: the end of
 * the reference edge, a vertex, against the incident edge. */
crm_contact crm_contact_of(const carom_world *w, carom_pair pair, const carom_manifold *m, int k,
                           const double *q);
/* Geometry of the contact's recipe at q. */
void crm_contact_refresh(const carom_world *w, const double *q, crm_contact *c);
int crm_recipe_same(carom_recipe a, carom_recipe b);
void crm_sort_joined(carom_world *w);

/* rows.c */
double crm_combine(int rule, double a, double b);
/* d combine / da. */
double crm_combine_slope(int rule, double a, double b);
/* J_n v of a contact row, v in world order. */
double crm_row_dot(const double row[6], const double *v, int body_a, int body_b);
/* Rows of J_n and J_t, equations.md (2), world bodies as columns. */
void crm_contact_rows(const crm_contact *c, double jn[6], double jt[6]);
/* Rows of all contacts and joints at q into w->rows, joint errors, inverse masses; sub.moved. */
void crm_rows_at(carom_world *w, crm_substep *s, const double *q);
/* W f + g of a body at the forces of this step. */
void crm_free_acceleration(const carom_world *w, int body, double a[3]);
/* rows.u = v + h (W f + g). */
void crm_free_velocity(carom_world *w, const crm_substep *s, const double *v, double h);
/* rows.u of a solve from the velocities before it, with its springs; rows at c->q in place, where
 * its motors get theirs as c->motor says. */
void crm_solve_velocity(carom_world *w, const crm_substep *s, const crm_solve *c);
/* The same with all motors that can act holding their speeds. */
void crm_solve_start(carom_world *w, const crm_substep *s, crm_solve *c);
/* The problem of the rows in place with the right-hand sides of one solve. */
carom_contact_problem crm_problem(carom_world *w, const crm_substep *s, const crm_solve *c);
/* c->cn: restitution e u_n of an approach of v faster than v_rest, equations.md (3); gap / h for
 * speculative contacts. */
void crm_velocity_targets(carom_world *w, const crm_substep *s, const double *v, crm_solve *c);
/* w->rows and rows.u of a solve of this sub-step, from recorded states alone. */
carom_contact_problem crm_solve_problem(carom_world *w, crm_substep *s, const crm_solve *c);

/* joint.c */
/* Number of rows of a kind of joint, and what its rows measure. */
int crm_joint_measures(carom_joint_kind kind, const crm_measure **measures);
/* Lever arms of the anchors and the way d from one to the other, in the world. */
typedef struct crm_joint_frame {
    carom_vec2 arm_a, arm_b, d;
} crm_joint_frame;
crm_joint_frame crm_joint_frame_at(const crm_joint *j, const double *q);
/* Unit vector along which the measure sees d; 0 for a turn. */
carom_vec2 crm_measure_direction(const crm_joint *j, crm_measure m, const double *q,
                                 const crm_joint_frame *f);
/* The measure at q [m], and its row: the derivative by (q_a, q_b). */
double crm_measure_at(const crm_joint *j, crm_measure m, const double *q, double row[6]);
/* Rows of J_e (6 each) and position errors [m] of a joint; zeros for that of its motor. */
void crm_joint_rows(const crm_joint *j, const double *q, double *je, double *error);
/* Largest joint error at q [m]. */
double crm_joint_drift(const carom_world *w, const double *q);

/* Lever arm on A of the row: to the anchor of B where the direction turns with A. */
carom_vec2 crm_measure_arm(crm_measure m, const crm_joint_frame *f);

/* limit.c: a limit of a joint is a frictionless contact whose gap is the way to the limit. */
int crm_joint_has_limits(const crm_joint *j);
/* What is limited: a turn, a way along the axis, or a distance. */
crm_measure crm_limit_measure(carom_joint_kind kind);
/* Joint of a limit, and the sign of d gap / d measure. */
int crm_limit_joint(int limit);
double crm_limit_sign(int limit);
/* The limit as a contact at q. */
crm_contact crm_limit_at(const carom_world *w, int limit, const double *q);
void crm_limit_refresh(const carom_world *w, const double *q, crm_contact *c);
/* Slots for limits of the island, and the limit in each, 0 when it has none. */
int crm_limit_slots(const carom_world *w);
int crm_limit_in(const carom_world *w, int slot);
/* Limits of the island with gap <= reach, behind sub.contacts; beyond margin speculative. */
carom_status crm_detect_limits(carom_world *w, const double *q, double reach, double margin);
/* Of a contact, or of a limit. */
double crm_restitution(const carom_world *w, const crm_contact *c);

/* drive.c: springs and motors of joints. */
/* What a joint's spring works on; their number. */
int crm_spring_measures(carom_joint_kind kind, crm_measure measures[2]);
crm_measure crm_motor_measure(carom_joint_kind kind);
int crm_joint_is_driven(const crm_joint *j);
/* Impulse b = share h f along the row of a measure, and what it is made of. */
typedef struct crm_push {
    double row[6];
    double h, share;
    double way;                /* from rest [m] */
    double speed;              /* J v [m/s] */
    double weight;             /* n J W J' with the number of springs n of each body */
    double stiffness, damping; /* as given and per meter */
    double k, d;               /* softened so that no sub-step is too long for them */
    double force;
} crm_push;
/* Share of h of a solve: 1, 1/2 of a stage, 0 where no time passes. */
double crm_share(const crm_solve *c);
/* Velocity of a body before a solve, as its springs see it. */
double crm_seen_velocity(const crm_substep *s, const crm_solve *c, int k);
/* x (1 + (x times)^4)^(-1/4), which is never above 1 / times, and its derivative by x. */
double crm_soften(double x, double times);
double crm_soften_slope(double x, double times);
crm_push crm_spring_push(const carom_world *w, const crm_substep *s, const crm_solve *c,
                         const crm_joint *j, crm_measure m);
/* Impulses of all springs of the island to rows.u. */
void crm_springs(carom_world *w, const crm_substep *s, const crm_solve *c);
/* Impulse of a motor at its limit, from c->motor [N s, per meter]. */
double crm_motor_impulse(const crm_substep *s, const crm_solve *c, const crm_joint *j, int row);
/* Rows and given impulses of motors as c->motor says. */
void crm_motors(carom_world *w, const crm_substep *s, const crm_solve *c);
/* Motors that hold, where that has no solution, push toward their speeds.  Returns their number. */
int crm_motors_stall(const carom_world *w, const crm_substep *s, crm_solve *c);
/* After a solve: motors beyond their limit stop at it, and those at it that need less hold again.
 * Returns the number of changes. */
int crm_motors_settle(carom_world *w, const crm_substep *s, crm_solve *c);
/* Speed of a motor [m/s]. */
double crm_motor_speed(const crm_joint *j);
/* c_e of motors in a solve: their speeds are to be met. */
void crm_motor_sides(const carom_world *w, crm_solve *c);
/* Largest speed in the mass metric that springs and motors give within h. */
double crm_drive_gain(const carom_world *w, const crm_substep *s);

/* substep.c: memory of sub-steps and rows; contacts found so far are kept when it grows. */
carom_status crm_substep_create(carom_world *w, crm_substep *s);
carom_status crm_substep_reserve(carom_world *w, crm_substep *s, int n_contacts);
void crm_substep_free(carom_world *w, crm_substep *s);
carom_status crm_rows_create(carom_world *w);
carom_status crm_rows_reserve(carom_world *w, int n_contacts);
void crm_rows_free(carom_world *w);

/* solve.c */
/* Solves c, whose right-hand sides and pose are set; the result and modes go to c. */
carom_status crm_solve_run(carom_world *w, crm_substep *s, crm_solve *c, int use_guess);
/* The same for a problem with restitution, unless plastic; where that leaves no solution, without,
 * then without friction, then with as much approach as must be. */
carom_status crm_solve_bounce(carom_world *w, crm_substep *s, crm_solve *c, const double *v,
                              int plastic);
/* q += scale v for moving bodies. */
void crm_move(const carom_world *w, double *q, const double *v, double scale);
/* Rounding error of a position difference, from the farthest body [m]. */
double crm_rounding(const carom_world *w);
/* Modes and impulses of the first two solves of sub, of length h, from the last accepted sub-step
 * of the island. */
void crm_guess_load(carom_world *w, double h);
/* Contacts of sub as the island's touches. */
carom_status crm_touches_save(carom_world *w);
void crm_forget_guesses(carom_world *w);
/* The frame is done: next becomes the touches, ordered. */
void crm_touches_turn(carom_world *w);

/* Modes and impulses, times a factor, of the first two solves from one sub-step to another. */
void crm_guess_copy(const carom_world *w, const crm_substep *from, crm_substep *to, double factor);

/* extrapolate.c: of order settings.order > 2. */
carom_status crm_extrapolate(carom_world *w, double h);
/* Whether a hold keeps the tangent of contact k, rows in place. */
int crm_holds_tangent(const carom_world *w, const crm_substep *s, int k);
/* The problem of a CRM_HOLD or CRM_HOLD_SPEED, rows in place; changes rows.mu. */
carom_contact_problem crm_hold_problem(carom_world *w, const crm_substep *s, const crm_solve *c);

/* The maps: from (q0, v0) of w->sub to (q1, v1). */
carom_status crm_euler(carom_world *w, double h);  /* euler.c */
carom_status crm_smooth(carom_world *w, double h); /* smooth.c */
/* smooth.c; plastic: without restitution, CAROM_LIMIT. */
carom_status crm_impact(carom_world *w, int plastic);
/* The map of the sub-step under way, sub.map, over h; sub.met is its status. */
carom_status crm_map_run(carom_world *w, double h);
/* Corrects sub.q1 until no contact of sub overlaps and no joint drifts; the corrections are solves
 * `first` and on.  CAROM_LIMIT when something is left. */
carom_status crm_project(carom_world *w, crm_substep *s, int first);

/* smooth.c: the fastest point of a body of the island [m/s]. */
double crm_top_speed(const carom_world *w, const double *v);
/* Whether a contact of sub is hit now; keeps of sub.contacts those of the impact, or
 * those that stay closed in smooth motion. */
int crm_select_impact(carom_world *w);
void crm_select_contacts(carom_world *w, int for_impact);

/* A vertex v of the point body, rounded by radius, on the face a-b (unit tangent t, face frame). */
typedef struct crm_slide {
    int face_shape, point_shape;
    int face_body, point_body;
    carom_vec2 a, b, t, v;
    double radius;
} crm_slide;
crm_slide crm_slide_of(const carom_world *w, const crm_contact *c);
/* The vertex in the frame of the face's body. */
carom_vec2 crm_slide_point(const crm_slide *s, const double *q);

/* From the round vertex of A to that of B. */
carom_vec2 crm_centers(const carom_world *w, const crm_contact *c, const double *q);

/* slip.c: arc length that body B slips on body A along the tangent of a contact, from q0 to q1. */
double crm_slip(const carom_world *w, const crm_contact *c, const double *q0, const double *q1);

/* Something whose root ends a sub-step, of w->sub as evaluated for length h. */
typedef struct crm_indicator {
    double (*value)(const carom_world *w, const void *what, double h);
    const void *what;
    double start; /* > 0: at h = 0 */
    double end;   /* <= 0: at the end of the bracket */
    double tol;   /* of the value */
} crm_indicator;
/* h in (0, *h] where it is zero: Illinois, then bisection.  Leaves sub evaluated at *h. */
carom_status crm_find_root(carom_world *w, const crm_indicator *f, double *h);

/* stop.c: when a contact of sub that slips at q0 does not slip to the end, the sub-step ends where
 * the first one stops. */
carom_status crm_locate_stop(carom_world *w);
/* Jt v of a contact at the pose it was evaluated at. */
double crm_slip_speed(const crm_contact *c, const double *v);

/* change.c: when a contact of an extrapolated sub-step opens or begins to slip, it ends there. */
carom_status crm_locate_change(carom_world *w, double left);

/* locate.c: S(left), or S of a fraction of it when that has no solution, or the Euler map. */
carom_status crm_run_through(carom_world *w, double left);
/* A sub-step whose contacts lie ahead knows them by the features at its start, which a fast body
 * may pass: then it ends where they meet instead. */
carom_status crm_stop_passing(carom_world *w, double left);
/* Runs S on (0, left]; when a contact outside sub.contacts closes on the way, ends at the
 * first such event; when more than `allowed` do, *busy = 1 and nothing counts. */
carom_status crm_locate(carom_world *w, double left, int allowed, int *busy);

/* events.c */
void crm_events_free(carom_world *w);
/* Impacts of the sub-step just committed, which began so long after the step did. */
carom_status crm_events_note(carom_world *w, double time);
/* Room for all that crm_events_compare could find. */
carom_status crm_events_reserve(carom_world *w);
/* What the touches have that the n_before of the last step had not, and the other way round. */
void crm_events_compare(carom_world *w, int n_before);

/* seal.c */
carom_status crm_seal(carom_world *w);
/* The same without a look at overlaps: for a state that a step left. */
carom_status crm_seal_as_is(carom_world *w);
void crm_free_sealed(carom_world *w);
#endif
