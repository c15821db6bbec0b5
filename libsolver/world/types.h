/* types.h: the data of a world. */
#ifndef CRM_WORLD_TYPES_H
#define CRM_WORLD_TYPES_H

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
/* New overlap that is worth another solve, or said [L, or thickness of a thinner shape]. */
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
    double gravity_scale;
    double damping[2]; /* of omega; of vx and vy [1/s] */
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
    double axis;   /* direction in the frame of A [rad] */
    double angle;  /* held turn of B against A [rad] */
    double length; /* held distance [m] */
    double lever;  /* makes an angle a length: L [m]; set by seal */
    int n_twins;   /* joints that take these two bodies along, this one included; set by seal */
    double lower;  /* limits of what crm_limit_measure says [m, rad]; -HUGE_VAL: none */
    double upper;  /* HUGE_VAL: none */
    double restitution; /* at its limits */
    double stiffness;   /* spring on what crm_spring_measures says [N/m, N m/rad] */
    double damping;     /* [N s/m, N m s/rad] */
    double rest;        /* where the spring is at rest [m, rad] */
    double motor_speed; /* of what crm_motor_measure says [m/s, rad/s] */
    double motor_limit; /* largest force or torque of the motor [N, N m]; 0: no motor */
    double break_force; /* [N], [N m]; HUGE_VAL: never */
    double break_torque;
    int broken; /* 1: holds nothing, belongs to no island */
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
/* Threads that islands are shared among, at most. */
enum { CRM_MAX_THREADS = 64 };
enum { CRM_MAX_COLUMNS = 4, CRM_MAX_INNER = 10, CRM_MAX_HOLDS = 4 };

/* Everything about one sub-step: what the reverse pass needs, no more. */
typedef struct crm_substep {
    crm_map map;
    double h;            /* [s], 0 for an impact */
    double time;         /* at its start, since step 0 [s] */
    double *q0, *v0;     /* 3 n_bodies */
    double *q1, *v1;     /* 3 n_bodies */
    const double *force; /* 3 n_bodies: (torque, fx, fy) of the step */
    int degenerate;      /* weakly active or stick/slip borderline contacts */
    int n_contacts;
    int max_contacts;
    crm_contact *contacts;     /* geometry at q0 */
    crm_contact *moved;        /* the same contacts at the pose of the problem under way */
    unsigned char *pressing;   /* per contact: closed by force, so held at gap 0 from both sides */
    signed char *slips;        /* per contact: the sign of the slip that it is made to keep, or 0 */
    const unsigned char *keep; /* per contact: the modes of both stages; NULL: they are found */
    double *target;            /* per contact: gap that stage 1 aims at [m] */
    double *joint_target;      /* per joint row: error that stage 1 aims at [m] */
    double restitution;        /* factor on all restitutions: 1, or 0 when relaxed */
    int slick;                 /* 1: without friction, where that left no solution */
    carom_status met;          /* of the map, when it was last run */
    int ahead;                 /* 1: contacts are all that may close; impacts are not located */
    int n_inner;               /* of an extrapolated map: its smooth sub-steps */
    double weight[CRM_MAX_COLUMNS]; /* ... of its columns */
    double estimate;                /* of its error [m] */
    int columns;                    /* ... in tolerance mode to be used; 0: to be chosen */
    int finest;                     /* 1: modes change within it, the finest column alone counts */
    int n_solves;
    crm_solve solve[CRM_MAX_SOLVES];
    crm_end end;
    double fraction;
    crm_contact event; /* the contact that closes at q1 */
    int returns;       /* 1: ... when it overlaps as much again as at q0, where it was opening */
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
    double *left;     /* 6 per joint row: rows at the end of a guess of stage 1 */
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
    int at; /* in the list, before it is ordered */
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
    carom_pair *pairs;            /* shapes; also with static bodies */
    int clock;                    /* the body whose owed time the frame takes over */
    carom_contact_solver *solver; /* its own; NULL: the world's */
} crm_island;

/* Contact solvers of islands by first body, when there is more than one island; NULL: none. */
typedef struct crm_kept_solver {
    carom_contact_solver *solver;
    long used; /* the last step that did */
} crm_kept_solver;

typedef struct crm_kept_solvers {
    int n;
    crm_kept_solver *list; /* per body; made when first needed */
} crm_kept_solvers;

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

/* Told of every accepted sub-step, of islands that would have those of the last frame again (*known
 * = 0: they must be run, for nobody has these), and when those of a frame are void. */
typedef struct crm_recorder {
    carom_status (*substep)(void *user, const crm_substep *s);
    carom_status (*again)(void *user, int *known);
    void (*restart)(void *user);
    void *user;
} crm_recorder;

typedef struct crm_rest crm_rest; /* sleep.c */

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
    int n_breakable; /* joints */
    int n_joint_rows;
    crm_joint *joints;
    int n_fields, max_fields;
    carom_field *fields;
    int n_excluded, max_excluded;
    carom_pair *excluded; /* bodies, a < b, sorted */

    /* From here on: made by seal. */
    int sealed;
    int n_moving;
    double length; /* L [m] */
    int smooth;    /* 1: two-stage map; 0: Euler */
    int damped;    /* 1: some body is */
    carom_plan plan;
    int n_solves;      /* that sub-steps have states for: those of the map, and corrections */
    double speed;      /* sqrt(g L) [m/s] */
    double rest_speed; /* v_rest [m/s] */
    double recovery;   /* errors of position are recovered no faster [m/s] */
    void *seal_block;  /* the arrays made by seal */
    size_t seal_bytes;
    double *step_force; /* 3 n_bodies: of the present step, constant + given */
    int n_joined;
    long *joined; /* sorted keys of body pairs joined so that they do not collide */
    carom_broadphase *broadphase;
    carom_contact_solver *solver; /* of what no island has its own for */
    crm_kept_solvers kept;
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
    int n_stiff;              /* sub-steps of the island that ended for stiff joints alone */
    int n_parts;              /* into which stiff joints divide its frame; 0: not known yet */
    int effort;               /* factorizations of the island in this frame */
    crm_rest *rest;           /* per body; NULL: nothing sleeps */
    double *rest_forces;      /* three per joint row: of the joints before the step */
    crm_touches touches, next;
    int first_touch;        /* of the island, in next */
    double *joint_force[2]; /* per joint row: as crm_touch.force_n [N] */
    double *joint_total;    /* per joint row: over the last sub-step that took time [N] */
    long revision;          /* counts changes of parameters */
    long n_steps;
    carom_step_stats *stats; /* of the step under way */
    int n_workers;           /* what threads work with, beyond one: threads.c */
    carom_world *workers;
    int max_outcomes;
    void *outcomes; /* of islands, in their order */
    crm_recorder recorder;
    crm_events events;
};

#endif
