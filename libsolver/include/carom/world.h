/* world.h: bodies, joints, forces and the step.
 *
 * Arrays of a world hold three numbers per body in the order of adding, static bodies included:
 * q = (angle, x, y), v = (omega, vx, vy), force = (torque, fx, fy).  SI units, radians. */
#ifndef CAROM_WORLD_H
#define CAROM_WORLD_H

#include "carom/contact.h"
#include "carom/shape.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum carom_body_type {
    CAROM_DYNAMIC,
    CAROM_STATIC,   /* never moves; its velocity must be zero */
    CAROM_KINEMATIC /* moves with its given velocity whatever touches it, and is accelerated by what
                     * stands where others have forces */
} carom_body_type;

typedef enum carom_integrator {
    CAROM_EULER,   /* the paper's step, corrected: docs/math/equations.md (1)-(7), (12), (14) */
    CAROM_LOCATED, /* second order, impacts are located: docs/step.md */
    CAROM_FIXED    /* the same without location: one sub-step per step, for piles and real time */
} carom_integrator;

/* What `located` seeks within a step besides impacts; orders above 2 seek all, but with springs
 * only when told to. */
typedef enum carom_events {
    CAROM_EVENTS_STOPS, /* slips that stop or reverse */
    CAROM_EVENTS_ALL    /* contacts that open or begin to slip, too */
} carom_events;

typedef enum carom_combine {
    CAROM_COMBINE_MEAN, /* (a + b)/2, the paper's choice */
    CAROM_COMBINE_GEOMETRIC,
    CAROM_COMBINE_MIN,
    CAROM_COMBINE_MAX
} carom_combine;

/* Settings of a world.  The table gives name, type, default, unit and meaning; scene files and
 * `--set` use these names (carom_world_settings_set). */
#define CAROM_WORLD_SETTINGS(X)                                                                    \
    X(dt, double, 1.0 / 60, "s", "length of a step")                                               \
    X(integrator, int, CAROM_LOCATED, "", "euler, located or fixed")                               \
    X(order, int, 2, "1", "order of located where nothing begins or ends: 2, 4, 6 or 8")           \
    X(tolerance, double, 0, "m", "of located: error of position allowed in a step; 0: by order")   \
    X(events, int, CAROM_EVENTS_STOPS, "", "what located seeks besides impacts: stops or all")     \
    X(combine_friction, int, CAROM_COMBINE_MEAN, "", "mean, geometric, min or max")                \
    X(combine_restitution, int, CAROM_COMBINE_MEAN, "", "mean, geometric, min or max")             \
    X(length, double, 0, "m", "length scale L; 0: largest diameter of a dynamic body's shape")     \
    X(margin, double, 1e-6, "L", "gap below which a pair is in contact")                           \
    X(penetration, double, 1e-9, "L", "overlap below which a new contact needs no shorter step")   \
    X(rest_speed, double, 1e-3, "sqrt(g L)", "approach slower than this does not bounce")          \
    X(max_substeps, int, 32, "1",                                                                  \
      "sub-steps of an island, at most; 128/bodies held in large ones")                            \
    X(threads, int, 1, "1", "among which islands are shared, 1 to 64: the same bits")              \
    X(sleep, int, 0, "", "1: what rests is not run until something changes; not on a tape")        \
    X(max_stiff, int, 256, "1", "sub-steps that stiff joints ask for, at most; 1: none")           \
    X(project_overlap, int, 1, "", "overlap of the initial scene: 1 projected away, 0 refused")    \
    X(accept, double, 1e-10, "1", "residual of a solved contact problem")                          \
    X(inexact, double, 1e-6, "1", "residual of a usable one")

typedef struct carom_world_settings {
#define CAROM_SETTING_FIELD(name, type, value, unit, text) type name;
    CAROM_WORLD_SETTINGS(CAROM_SETTING_FIELD)
#undef CAROM_SETTING_FIELD
    double gravity[2]; /* [m/s^2], (0, -9.81) */
} carom_world_settings;

CAROM_API carom_world_settings carom_world_defaults(void);
/* Sets one field by name from text ("margin", "1e-5"; "integrator", "euler").  CAROM_E_ARGUMENT for
 * an unknown name or a value that is no such number or word; *reason (may be NULL) then says which
 * in static text. */
CAROM_API carom_status carom_world_settings_set(carom_world_settings *settings, const char *name,
                                                const char *value, const char **reason);

typedef struct carom_filter {
    unsigned category; /* bits this body is; 1 */
    unsigned mask;     /* bits it collides with; all */
    int group;         /* equal and > 0: always collide; equal and < 0: never; 0: use the bits */
} carom_filter;

typedef struct carom_body_def {
    carom_body_type type;
    int n_shapes;              /* >= 0 */
    const carom_shape *shapes; /* copied; vertices relative to the position = center of mass */
    carom_pose pose;
    double velocity[3]; /* (omega, vx, vy) [rad/s, m/s, m/s] */
    double force[3];    /* constant (torque, fx, fy) [N m, N, N]; of a kinematic body its
                         * acceleration [rad/s^2, m/s^2, m/s^2] */
    double mass;        /* [kg], > 0 when dynamic */
    double inertia;     /* about the center of mass [kg m^2], > 0 when dynamic; INFINITY locks the
                         * rotation: omega stays what it is, whatever happens */
    double friction;    /* [1], >= 0 */
    double restitution; /* [1], 0 to 1 */
    int collide;        /* 0: no contacts at all */
    int sensor;         /* 1: touches nothing; carom_query_sensors tells what overlaps its shapes */
    carom_filter filter;
    double gravity_scale;   /* times the world's gravity [1], any finite number */
    double linear_damping;  /* d in the force -d m v [1/s], >= 0 */
    double angular_damping; /* d in the torque -d I omega [1/s], >= 0 */
} carom_body_def;

/* Dynamic, no shape, mass 1, inertia 1, friction 0.5, restitution 0, collides with all, no sensor,
 * gravity scale 1, no damping. */
CAROM_API carom_body_def carom_body_defaults(void);
/* The same of a type and at a place [m]. */
CAROM_API carom_body_def carom_body_at(carom_body_type type, double x, double y);

typedef struct carom_world carom_world;

/* settings, allocator: NULL for defaults. */
CAROM_API carom_status carom_world_create(const carom_world_settings *settings,
                                          const carom_allocator *allocator, carom_world **out);
CAROM_API void carom_world_destroy(carom_world *world);

/* The last error of this world in words: names the body, joint, shape, vertex and remedy.  Owned by
 * the world, valid until its next call; "" when there was none. */
CAROM_API const char *carom_world_error(const carom_world *world);

/* Adds a body; *index (may be NULL) is its number.  CAROM_E_ARGUMENT, CAROM_E_SHAPE,
 * CAROM_E_MEMORY; CAROM_E_STATE after the first step. */
CAROM_API carom_status carom_world_add_body(carom_world *world, const carom_body_def *def,
                                            int *index);
/* Adds a body whose mass and inertia follow from its shapes and their density [kg/m^2], > 0; mass
 * and inertia of def are not read.  Overlaps of shapes count twice.  Static and kinematic bodies
 * have no mass: density is not read.  CAROM_E_ARGUMENT also where the shapes have no area, or their
 * centroid is not the position (within 1e-6 of the extent). */
CAROM_API carom_status carom_world_add_solid(carom_world *world, const carom_body_def *def,
                                             double density, int *index);
/* The same with one shape around the position, in place of those of def. */
CAROM_API carom_status carom_world_add_circle(carom_world *world, const carom_body_def *def,
                                              double radius, double density, int *index);
CAROM_API carom_status carom_world_add_box(carom_world *world, const carom_body_def *def,
                                           double width, double height, double density, int *index);

/* What a joint holds still: docs/joint.md. */
typedef enum carom_joint_kind {
    CAROM_REVOLUTE,   /* a point: the bodies are pinned together */
    CAROM_PRISMATIC,  /* B slides along a line of A and does not turn against A */
    CAROM_WELD,       /* a point and the turn of B against A */
    CAROM_WHEEL,      /* a point of B stays on a line of A */
    CAROM_DISTANCE,   /* the distance of two points: a rod */
    CAROM_ROPE,       /* nothing; limits or a spring work on the distance of two points */
    CAROM_TARGET,     /* nothing; a spring pulls a point of B to one of A */
    CAROM_LOCK_X,     /* x of a point of B against that of A, in the world's axes */
    CAROM_LOCK_Y,     /* y, likewise */
    CAROM_LOCK_ANGLE, /* the turn of B against A */
    CAROM_N_JOINT_KINDS
} carom_joint_kind;

/* Of two bodies at their present poses, of which one at least is dynamic.  With a static body A a
 * joint holds B to the world. */
typedef struct carom_joint_def {
    carom_joint_kind kind;
    int body_a;
    int body_b;
    carom_vec2 anchor; /* world point, of both bodies; of a distance or rope the point of A [m] */
    carom_vec2
        anchor_b;    /* distance, rope: the point of B; of a distance apart from the other [m] */
    carom_vec2 axis; /* prismatic, wheel: direction of the line, of any length */
    double
        lower; /* lower and upper limit of: the turn of B against A from now on [rad], revolute; */
    double upper; /* its way along the axis [m], prismatic and wheel; the distance [m], rope */
    double restitution; /* at the limits [1], 0 to 1 */
    /* A spring on what the limits are about, and on both directions of a target. */
    double stiffness; /* [N/m], [N m/rad]; 0: none */
    double damping;   /* [N s/m], [N m s/rad] */
    double rest;      /* turn or way from now on, or distance, without force [rad, m] */
    /* A motor on the turn of B (revolute, wheel) or its way along the axis (prismatic). */
    double motor_speed; /* [rad/s], [m/s] */
    double motor_limit; /* largest torque or force [N m, N]; 0: no motor */
    int collide;        /* 1: the two bodies may touch each other */
    /* A step at whose end carom_world_joint_force is above one of these breaks the joint: it holds
     * nothing from the next step on.  INFINITY: never. */
    double break_force;  /* [N], > 0 */
    double break_torque; /* [N m], > 0 */
} carom_joint_def;

/* Bodies -1 (to be given), points at the origin, axis (1, 0), no limits, spring or motor,
 * unbreakable; only bodies joined by a distance, rope, target or lock collide. */
CAROM_API carom_joint_def carom_joint_defaults(carom_joint_kind kind);
/* "revolute", "prismatic", "weld", "wheel", "distance", "rope", "target", "lock_x", "lock_y",
 * "lock_angle"; NULL for any other number. */
CAROM_API const char *carom_joint_kind_name(carom_joint_kind kind);
/* Adds a joint; *index (may be NULL) is its number.  CAROM_E_ARGUMENT, CAROM_E_MEMORY;
 * CAROM_E_STATE once the world is sealed. */
CAROM_API carom_status carom_world_add_joint(carom_world *world, const carom_joint_def *def,
                                             int *index);
/* A revolute joint at a world point.  Joined bodies do not collide with each other. */
CAROM_API carom_status carom_world_add_revolute(carom_world *world, int body_a, int body_b,
                                                carom_vec2 anchor, int *index);

/* These two never collide, whatever their filters.  Twice is once.  CAROM_E_ARGUMENT,
 * CAROM_E_MEMORY; CAROM_E_STATE after the first step. */
CAROM_API carom_status carom_world_exclude(carom_world *world, int body_a, int body_b);

/* A force that the caller computes, on every dynamic body, as a function of that body's own state
 * and the time since step 0.  It must be finite and always the same for the same arguments: it is
 * called twice or more for each body in each sub-step, for sub-steps that are tried and thrown
 * away too, and with the setting `threads` from several threads at once.  It must not call the
 * world. */
typedef struct carom_field {
    /* f: (torque, fx, fy), zero before the call. */
    void (*force)(void *user, int body, double t, const double q[3], const double v[3],
                  double f[3]);
    /* by_q[3 i + j] = d f_i / d q_j, by_v likewise; zero before the call.  NULL: gradients and
     * tangents of runs with it are refused. */
    void (*derivative)(void *user, int body, double t, const double q[3], const double v[3],
                       double by_q[9], double by_v[9]);
    void *user; /* the caller's; must outlive the world and its copies */
    /* by_t[i] = d f_i / d t; zero before the call.  NULL: the force does not depend on t. */
    void (*rate)(void *user, int body, double t, const double q[3], const double v[3],
                 double by_t[3]);
} carom_field;
/* CAROM_E_ARGUMENT without force, CAROM_E_MEMORY, CAROM_E_STATE once sealed. */
CAROM_API carom_status carom_world_add_field(carom_world *world, const carom_field *field);

/* Optional last call of building: freezes the scales L and g, checks the scene, projects or refuses
 * initial overlap, allocates.  The first step does it when the caller did not. */
CAROM_API carom_status carom_world_seal(carom_world *world);

typedef struct carom_step_stats {
    carom_status status;
    double residual;    /* largest of the step's contact problems [1] */
    double penetration; /* largest overlap at the end [m], >= 0 */
    double joint_drift; /* largest position error of a joint at the end [m] */
    double estimate;    /* of the error of position in this step, where there is one [m]; else 0 */
    double energy;      /* kinetic + gravitational at the end [J] */
    int n_islands;      /* groups of bodies that advanced alone */
    int n_asleep;       /* bodies at rest that were not run; setting sleep */
    int n_still;        /* bodies not run, whose last step has changed no bit of their island */
    int n_candidates;   /* pairs that may touch within the step */
    int n_contacts;     /* contact points of the islands' last sub-steps */
    int n_substeps;     /* of the busiest island */
    int n_events;       /* impacts: sub-steps in which restitution acted or a step was shortened */
    int factorizations;
    int iterations;
    int degenerate;            /* weakly active or stick/slip borderline contacts */
    long allocations;          /* requests to the allocator during this step */
    carom_contact_stage stage; /* deepest stage of the ladder used */
} carom_step_stats;

/* Advances by dt.  force: (torque, fx, fy) per body for this step, added to the constant forces;
 * NULL: none.  For a kinematic body it is an acceleration: (w - v) / dt leads it to the velocity w
 * at the end of the step, by the mean of both velocities on the way (euler: by w).  stats may be
 * NULL.  On a negative status the world is as it was. */
CAROM_API carom_status carom_world_step(carom_world *world, const double *force,
                                        carom_step_stats *stats);

CAROM_API int carom_world_n_bodies(const carom_world *world);
CAROM_API int carom_world_n_joints(const carom_world *world);
/* What a joint, its limits and its motor do to body B, mean over the last sub-step; without its
 * spring.  Zero before the first step. */
typedef struct carom_joint_force {
    carom_vec2 force; /* at the anchor of B, in the world's axes [N]; on A the opposite */
    double torque;    /* about that anchor [N m] */
} carom_joint_force;
CAROM_API carom_joint_force carom_world_joint_force(const carom_world *world, int joint);
/* 1: it has broken. */
CAROM_API int carom_world_joint_broken(const carom_world *world, int joint);
/* Steps taken, and their time [s]. */
CAROM_API long carom_world_steps(const carom_world *world);
CAROM_API double carom_world_time(const carom_world *world);
/* State, 3 n_bodies, owned by the world, valid until it changes. */
CAROM_API const double *carom_world_q(const carom_world *world);
CAROM_API const double *carom_world_v(const carom_world *world);
/* Replaces the state (3 n_bodies each; NULL: keep); forgets guesses of the solver. */
CAROM_API carom_status carom_world_set_state(carom_world *world, const double *q, const double *v);
CAROM_API carom_world_settings carom_world_get_settings(const carom_world *world);
CAROM_API double carom_world_energy(const carom_world *world);

/* Parameters that may change between steps (and by gradient descent): arrays of n_bodies, NULL:
 * keep.  Checked as in carom_body_def; nothing changes on an error. */
typedef struct carom_parameters {
    const double *mass;
    const double *inertia;
    const double *friction;
    const double *restitution;
    const double *gravity; /* 2 */
    const double *gravity_scale;
    const double *linear_damping;
    const double *angular_damping;
} carom_parameters;
CAROM_API carom_status carom_world_set_parameters(carom_world *world, const carom_parameters *p);

/* One contact point of the last sub-step. */
typedef struct carom_contact_info {
    int body_a, body_b;
    carom_vec2 point;  /* on A, world [m] */
    carom_vec2 normal; /* from A to B */
    double gap;        /* at the start of the sub-step [m] */
    double ln, lt;     /* impulses along normal and tangent [N s] */
    carom_contact_mode mode;
} carom_contact_info;
CAROM_API int carom_world_n_contacts(const carom_world *world);
CAROM_API carom_contact_info carom_world_contact(const carom_world *world, int k);

/* What the scene needs; 0: no work and no memory for it. */
typedef struct carom_plan {
    int contacts;     /* bodies may meet: pairs are sought, contact points found */
    int hulls;        /* ... both with edges: nearest features, clipping; libccd for huge ones */
    int friction;     /* ... with friction: tangential rows */
    int restitution;  /* contacts or limits that bounce */
    int joints;       /* joint rows, corrections of position */
    int limits;       /* of joints: contacts without shapes */
    int drives;       /* springs and motors */
    int damping;      /* of bodies */
    int fields;       /* forces that the caller computes */
    int solver;       /* contact problems are solved: contacts, joint rows or limits */
    int located;      /* times of impacts are sought */
    int changes;      /* ... and those at which contacts open or begin to slip */
    int extrapolated; /* orders above 2: tables of sub-steps */
    int sensors;      /* shapes that only carom_query_sensors sees */
    int threads;      /* islands are shared among several */
    int sleep;        /* islands at rest are not run */
} carom_plan;
/* Of the scene as it is; friction and restitution follow the parameters. */
CAROM_API carom_plan carom_world_plan(const carom_world *world);

/* Size of what the world holds, for `carom explain`. */
typedef struct carom_world_size {
    int n_dynamic, n_static, n_kinematic;
    int n_shapes, n_vertices;
    int n_joints;
    int n_unknowns; /* 3 per moving body */
    int n_joint_rows;
    int n_contacts;           /* last sub-step */
    int n_friction;           /* ... of them with a tangential row */
    carom_factor_size factor; /* of the islands of the last step, one factorization of each */
    size_t bytes;             /* held now */
    size_t bytes_high;        /* high-water mark */
} carom_world_size;
CAROM_API carom_world_size carom_world_measure(const carom_world *world);

#ifdef __cplusplus
}
#endif
#endif
