/* client.h: step and differentiate a scene in a step server (caromd) over LCM.
 *
 * Every call blocks until the server has answered.  Requests are repeated until they are answered
 * (20 ms, then 1.5 times as long each time, at most 500 ms; 10 s without anything new end in
 * CAROM_CLIENT_E_TIMEOUT), and are executed once however often they arrive.  States that did not
 * arrive are asked for again, by step.  After CAROM_CLIENT_E_TIMEOUT or CAROM_CLIENT_E_NETWORK
 * nobody knows what was executed: the session is over, open a scene again.  One client is one
 * session; one thread at a time. */
#ifndef CAROM_CLIENT_H
#define CAROM_CLIENT_H

#include "carom/grad.h"

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define CAROM_CLIENT_URL "tcpq://127.0.0.1:7700" /* where caromd listens by default */

typedef enum carom_client_code {
    CAROM_CLIENT_OK = 0,
    CAROM_CLIENT_E_ARGUMENT = -1, /* an argument is out of range; nothing was sent */
    CAROM_CLIENT_E_MEMORY = -2,
    CAROM_CLIENT_E_NETWORK = -3, /* no connection, or it broke */
    CAROM_CLIENT_E_TIMEOUT = -4, /* no answer */
    CAROM_CLIENT_E_REFUSED = -5, /* the server says the request is not valid, and why */
    CAROM_CLIENT_E_FAILED = -6,  /* the computation failed; what came before holds */
    CAROM_CLIENT_E_SESSION = -7  /* the session expired or the server was started again */
} carom_client_code;

typedef struct carom_client carom_client;

/* NULL: no memory; carom_client_connect and carom_client_error then say so. */
CAROM_API carom_client *carom_client_create(void);
/* Closes the session, when there is one and the server still answers. */
CAROM_API void carom_client_destroy(carom_client *client);
/* The last error in words; "" when there was none.  Valid until the next call. */
CAROM_API const char *carom_client_error(const carom_client *client);

/* Connects to the LCM network at `url` (NULL: CAROM_CLIENT_URL).  daemon: the name given to caromd
 * with --name; NULL for none. */
CAROM_API carom_client_code carom_client_connect(carom_client *client, const char *url,
                                                 const char *daemon);
/* The same on an lcm_t of the caller, who keeps it and destroys it after the client. */
CAROM_API carom_client_code carom_client_attach(carom_client *client, void *lcm,
                                                const char *daemon);

/* A scene: a view, all arrays are the caller's. */
typedef struct carom_client_scene {
    const char *name; /* may be NULL */
    double gravity[2];
    int n_settings; /* of carom_world_settings, by name */
    const char *const *setting_names;
    const char *const *setting_values;
    int n_bodies;
    const carom_body_def *bodies;
    const char *const *body_names; /* may be NULL */
    int n_joints;
    const carom_joint_def *joints;
} carom_client_scene;

/* Sends the scene and opens a session with it, or replaces the scene of the open session.  Scenes
 * above 60 KB go in pieces; above 4 MB they are refused. */
CAROM_API carom_client_code carom_client_open(carom_client *client,
                                              const carom_client_scene *scene);
/* The same with a scene file (docs/scene.md).  Its force tables act in every step; its duration and
 * sample interval are left to the caller.  CAROM_CLIENT_E_ARGUMENT: the file is not valid; the
 * error names file, place and remedy of the first fault.  NULL: no file. */
CAROM_API carom_client_code carom_client_open_file(carom_client *client, const char *path);
CAROM_API carom_client_code carom_client_close(carom_client *client);

/* A state as the server published it; arrays are valid during the callback. */
typedef struct carom_client_state {
    int64_t step; /* since the scene was opened */
    double time;  /* [s] */
    int n_bodies;
    const double *q;        /* 3 n_bodies */
    const double *v;        /* 3 n_bodies */
    carom_step_stats stats; /* n_candidates, allocations and stage are not transmitted */
    int n_contacts;         /* 0 unless asked for */
    const carom_contact_info *contacts;
} carom_client_state;

/* Force on one body in one step, added to its constant force. */
typedef struct carom_client_force {
    int step; /* 0: the first step of the call; forces are in the order of steps */
    int body;
    double force[3]; /* torque, fx, fy */
} carom_client_force;

typedef enum carom_client_record {
    CAROM_RECORD_OFF,    /* no tape; an older one is forgotten */
    CAROM_RECORD_ON,     /* continue the tape, or start one at the present state */
    CAROM_RECORD_RESTART /* start a new tape at the present state */
} carom_client_record;

typedef struct carom_client_run {
    int n_steps;       /* >= 0 */
    int publish_every; /* states wanted: every n-th step and the last; 0: the last only */
    int contacts;      /* with contact points */
    carom_client_record record;
    int n_forces;
    const carom_client_force *forces;
    /* Called for every state, in order; may be NULL. */
    void (*on_state)(void *user, const carom_client_state *state);
    void *user;
} carom_client_run;

CAROM_API carom_client_code carom_client_step(carom_client *client, const carom_client_run *run);
/* The last state that steps of the open scene brought; valid until the next call.  NULL: none. */
CAROM_API const carom_client_state *carom_client_get_state(const carom_client *client);

/* Parameters of a gradient: bits, the same as in parameter_gradient_t. */
enum {
    CAROM_WRT_Q0 = 1,
    CAROM_WRT_V0 = 2,
    CAROM_WRT_MASS = 4,
    CAROM_WRT_INERTIA = 8,
    CAROM_WRT_FRICTION = 16,
    CAROM_WRT_RESTITUTION = 32,
    CAROM_WRT_GRAVITY = 64,
    CAROM_WRT_FORCE = 128,
    CAROM_WRT_FORCE_STEPS = 256,
    CAROM_WRT_RADIUS = 512,
    CAROM_WRT_VERTICES = 1024,
    CAROM_WRT_ANCHORS = 2048,
    CAROM_WRT_DT = 4096,
    CAROM_WRT_GRAVITY_SCALE = 8192,
    CAROM_WRT_LINEAR_DAMPING = 16384,
    CAROM_WRT_ANGULAR_DAMPING = 32768,
    CAROM_WRT_AXES = 65536,
    CAROM_WRT_ANGLES = 131072,
    CAROM_WRT_LENGTHS = 262144,
    CAROM_WRT_LOWER = 524288,
    CAROM_WRT_UPPER = 1048576,
    CAROM_WRT_STIFFNESS = 2097152,
    CAROM_WRT_DAMPING = 4194304,
    CAROM_WRT_REST = 8388608,
    CAROM_WRT_MOTOR_SPEED = 16777216,
    CAROM_WRT_MOTOR_LIMIT = 33554432
};

/* Sizes and meaning as in carom_gradient; arrays that were not wanted are NULL. */
typedef struct carom_client_gradient {
    unsigned wanted;
    double cost;        /* as given */
    int64_t first_step; /* at which the tape starts */
    int recorded_steps;
    int degenerate;                /* contacts at a kink: a one-sided element was taken */
    int64_t first_degenerate_step; /* -1: none */
    int n_bodies, n_shapes, n_vertices, n_joints;
    const double *q0, *v0, *mass, *inertia, *friction, *restitution, *gravity, *force, *force_steps;
    const double *radius, *vertices, *anchors, *dt;
    const double *gravity_scale, *linear_damping, *angular_damping;
    const double *axes, *angles, *lengths, *lower, *upper;
    const double *stiffness, *damping, *rest, *motor_speed, *motor_limit;
} carom_client_gradient;

/* Gradient of sum_k <q_bar_k, q_k> + <v_bar_k, v_k> over recorded states; steps are counted as in
 * carom_client_state.  The arrays of *out are valid until the next gradient or close. */
CAROM_API carom_client_code carom_client_gradient_of(carom_client *client, double cost, int n_bars,
                                                     const carom_state_bar *bars, unsigned wanted,
                                                     carom_client_gradient *out);

/* The session's parameters named by `wanted` become parameter - rate * gradient, projected to
 * their valid range.  Then the session starts again at step 0, or, with keep_state, goes on. */
CAROM_API carom_client_code carom_client_descend(carom_client *client, double rate, unsigned wanted,
                                                 const carom_client_gradient *gradient,
                                                 int keep_state);

/* The parameters of the session as the server holds them: valid until the next descent or open. */
typedef struct carom_client_parameters {
    int n_bodies, n_shapes, n_vertices, n_joints;
    const double *q, *v, *mass, *inertia, *friction, *restitution, *gravity, *force;
    const double *radius;
    const double *vertices;         /* 2 n_vertices */
    const double *anchors;          /* 2 n_joints: world points at the poses q */
    const double *anchors_b, *axes; /* likewise */
    const double *gravity_scale, *linear_damping, *angular_damping;
    const double *lower, *upper, *stiffness, *damping, *rest, *motor_speed, *motor_limit;
} carom_client_parameters;
CAROM_API carom_client_parameters carom_client_get_parameters(const carom_client *client);

/* Keeps the present state under a number (>= 1), goes back to it; starts again at step 0. */
CAROM_API carom_client_code carom_client_snapshot(carom_client *client, int number);
CAROM_API carom_client_code carom_client_restore(carom_client *client, int number);
CAROM_API carom_client_code carom_client_reset(carom_client *client);
/* Renews the lease (30 s after the last sign of life) and checks that the session is there. */
CAROM_API carom_client_code carom_client_keep_alive(carom_client *client);

/* What the last answer said, and what it took to get it. */
typedef struct carom_client_info {
    int64_t boot_id;     /* of the server */
    int64_t step;        /* the session is at */
    int64_t first_step;  /* at which the tape starts */
    int recorded_steps;  /* on the tape */
    carom_status status; /* of the computation; positive: a caveat */
    double seconds;      /* the server spent on the request */
    long repeated;       /* requests sent again, all calls */
    long resent;         /* states asked for again, all calls */
} carom_client_info;
CAROM_API carom_client_info carom_client_last(const carom_client *client);

#ifdef __cplusplus
}
#endif
#endif
