/* internal.h: the parts of a world's step, shared by world/ and grad/. */
#ifndef CRM_WORLD_INTERNAL_H
#define CRM_WORLD_INTERNAL_H

#include "world/damping.h"
#include "world/types.h"

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
/* further.c: overlap of a pair that counts as deep [m]. */
double crm_deep(const carom_world *w, carom_pair pair, double rounding);
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
/* What number i of the island's velocity gains by a force on it, per time: W; of a kinematic body,
 * whose force is an acceleration, 1. */
double crm_force_gain(const carom_world *w, int i);
/* W f + g - d v of a body at the forces of this step; v NULL: at rest. */
void crm_free_acceleration(const carom_world *w, int body, const double *v, double a[3]);
/* Gravity on number k = 0, 1, 2 of a body's velocity [m/s^2]. */
double crm_gravity(const carom_world *w, int body, int k);
/* Whether number k of a body's velocity is damped. */
static inline int crm_is_damped(const carom_world *w, int body, int k)
{
    return w->bodies[body].type == CAROM_DYNAMIC && w->bodies[body].damping[k > 0] > 0;
}
int crm_world_is_damped(const carom_world *w);
/* rows.u of a solve from the velocities before it, with its springs; rows at c->q in place, where
 * its motors get theirs as c->motor says, and inverse masses what damping makes of them. */
void crm_solve_velocity(carom_world *w, const crm_substep *s, const crm_solve *c);
/* The same with all motors that can act holding their speeds. */
void crm_solve_start(carom_world *w, const crm_substep *s, crm_solve *c);
/* The problem of the rows in place with the right-hand sides of one solve. */
carom_contact_problem crm_problem(carom_world *w, const crm_substep *s, const crm_solve *c);
/* c->cn: restitution e u_n of an approach of v0 faster than v_rest, equations.md (3); gap / h for
 * speculative contacts.  1 when a contact bounces. */
int crm_velocity_targets(carom_world *w, crm_substep *s, crm_solve *c);
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
/* Velocity of a body, as its springs see it in a solve: before it, in stage 2 after it. */
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
/* sub, and where the order asks for them the inner ones. */
carom_status crm_substeps_create(carom_world *w);
carom_status crm_substep_reserve(carom_world *w, crm_substep *s, int n_contacts);
void crm_substep_free(carom_world *w, crm_substep *s);
carom_status crm_rows_create(carom_world *w);
carom_status crm_rows_reserve(carom_world *w, int n_contacts);
void crm_rows_free(carom_world *w);

/* solve.c */
/* Solves c, whose right-hand sides and pose are set; the result and modes go to c. */
carom_status crm_solve_run(carom_world *w, crm_substep *s, crm_solve *c, int use_guess);
/* Of joints alone, without motors.  c->v: what the guessed impulses give. */
void crm_guess_velocity(carom_world *w, const crm_substep *s, crm_solve *c);
/* The solver ready for passes from the guessed impulses, and c->v; left: the rows that shall hold,
 * NULL: those of the pose. */
carom_status crm_passes_begin(carom_world *w, crm_substep *s, crm_solve *c, const double *left);
/* A pass towards c's right-hand sides, with the same left. */
carom_status crm_pass(carom_world *w, const crm_substep *s, crm_solve *c, const double *left);
/* Whether c is a solution: its residual is at most `most`. */
int crm_passes_hold(carom_world *w, const crm_substep *s, crm_solve *c, double most);
/* crm_solve_run by passes from the guess where these suffice. */
carom_status crm_solve_joints(carom_world *w, crm_substep *s, crm_solve *c);
/* The same for a problem with restitution, unless plastic; where that leaves no solution, without,
 * then without friction, then with as much approach as must be. */
carom_status crm_solve_bounce(carom_world *w, crm_substep *s, crm_solve *c, int plastic);

/* plan.c */
carom_plan crm_plan(const carom_world *w);

/* step.c: the static bodies of all states that a sub-step works with. */
void crm_put_statics(carom_world *w);

/* threads.c: islands shared among threads; the same bits for any number of them. */
typedef carom_status crm_advance(carom_world *w, const crm_island *island);
/* As many as settings.threads allows and the islands give work to; 1: none are made. */
int crm_threads_that_pay(const carom_world *w);
/* Advances all islands with n > 1 threads; the status of the first one that fails. */
carom_status crm_advance_shared(carom_world *w, int n, crm_advance *advance);
void crm_stats_add(carom_step_stats *sum, const carom_step_stats *part);
void crm_threads_free(carom_world *w);

/* world.c: a contact solver of the world's settings. */
carom_status crm_solver_create(const carom_world *w, carom_contact_solver **out);

/* sleep.c: what the setting needs. */
carom_status crm_sleep_create(carom_world *w);
void crm_sleep_free(carom_world *w);
/* Everything is run again. */
void crm_sleep_forget(carom_world *w);
/* *asleep: the island under way needs no step; its touches are there. */
carom_status crm_sleep_on(carom_world *w, int *asleep);
/* After a step of the island under way: puts it to rest where it barely moves. */
void crm_sleep_settle(carom_world *w);

/* solvers.c: gives each island of the frame a solver of its own, when there are several. */
carom_status crm_solvers_assign(carom_world *w);
void crm_solvers_free(carom_world *w);
/* Of the islands of the last step. */
carom_factor_size crm_solvers_factor_size(const carom_world *w);
/* Bytes of all solvers and allocations made for them, those given up left out. */
void crm_solvers_memory(const carom_world *w, size_t *bytes, long *calls);
/* Of the island under way. */
static inline carom_contact_solver *crm_solver(const carom_world *w)
{
    return w->island->solver ? w->island->solver : w->solver;
}

/* energy.c */
/* v' M v of a body; a locked rotation has no part in it. */
double crm_mass_square(const carom_world *w, int body, const double *v);
/* Speed of the island in the mass metric: sqrt(v' M v). */
double crm_mass_speed(const carom_world *w, const double *v);
/* Right-hand sides of a solve for the present s->restitution; 1 when a contact bounces. */
typedef int crm_sides(carom_world *w, crm_substep *s, crm_solve *c);
/* A solve with restitution that met status e: where it has given the island energy it is solved
 * again with less (CAROM_RELAXED). */
carom_status crm_bound_bounce(carom_world *w, crm_substep *s, crm_solve *c, crm_sides *set,
                              carom_status e);

/* solve.c */
/* q += scale v for moving bodies. */
void crm_move(const carom_world *w, double *q, const double *v, double scale);
/* Rounding error of a position difference, from the farthest body, or from the one that has turned
 * most often [m]. */
double crm_rounding(const carom_world *w);
/* Modes and impulses of the first two solves of sub, of length h, from the last accepted sub-step
 * of the island. */
void crm_guess_load(carom_world *w, double h);
/* Forces of joints over the sub-step just run, into joint_total; an impact leaves them. */
void crm_joint_totals(carom_world *w);
/* Contacts of sub as the island's touches. */
carom_status crm_touches_save(carom_world *w);
/* Room for n touches of the frame under way. */
carom_status crm_touches_reserve(carom_world *w, int n);
/* As much room in both lists, for they take turns. */
carom_status crm_touches_even(carom_world *w);
void crm_forget_guesses(carom_world *w);
/* The last step's touches of a pair of shapes. */
const crm_touch *crm_touches_of(const carom_world *w, carom_pair pair, int *n);
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
/* smooth.c: the largest error that stage 1 may leave [m]; q1 <- q0 + h v. */
double crm_newton_tolerance(const carom_world *w);
void crm_end_pose(const carom_world *w, crm_substep *s, const crm_solve *c);
/* joints_alone.c: Newton's method with the rows at the end of the guess, so that it gains some
 * digits by each back-substitution.  1: done, a solution by its residual; 0: it must be found
 * otherwise. */
int crm_has_joints_alone(const carom_world *w, const crm_substep *s);
int crm_close_joints(carom_world *w, crm_substep *s, crm_solve *c);
/* smooth.c: whether forces on the island depend on velocities that stage 2 is to find. */
int crm_sees_speed(const carom_world *w);
/* impact.c; plastic: without restitution, CAROM_LIMIT. */
carom_status crm_impact(carom_world *w, int plastic);
/* impact.c: stage 2 of a sub-step that located no impacts; *done = 0: nothing bounces. */
carom_status crm_bounce(carom_world *w, crm_substep *s, int *done);
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

/* smooth.c: 1 where v1 of sub is faster than v0 and all forces can make it. */
int crm_gains(const carom_world *w, const crm_substep *s);
/* stop.c: when a contact of sub that slips at q0 does not slip to the end, the sub-step ends where
 * the first one stops. */
carom_status crm_locate_stop(carom_world *w);
/* Jt v of a contact at the pose it was evaluated at. */
double crm_slip_speed(const crm_contact *c, const double *v);

/* change.c: when a contact of an extrapolated sub-step opens or begins to slip, it ends there. */
carom_status crm_locate_change(carom_world *w, double left);

/* stiff.c: whether it holds a point of both bodies. */
int crm_joint_takes_along(const crm_joint *j);
/* stiff.c: how much of the time left a stable sub-step may take, by the forces of joints (look = 0:
 * those of the frame so far will do); says CAROM_LIMIT where more of
 * them were needed than are allowed. */
double crm_stiff_span(carom_world *w, double left, int look);
/* locate.c: S(left), or S of a fraction of it when that has no solution, or the Euler map. */
carom_status crm_run_through(carom_world *w, double left);
/* A sub-step whose contacts lie ahead knows them by the features at its start, which a fast body
 * may pass: then it ends where they meet instead. */
carom_status crm_stop_passing(carom_world *w, double left);
/* Runs S on (0, left]; when a contact outside sub.contacts closes on the way, ends at the
 * first such event; when more than `allowed` do, *busy = 1 and nothing counts. */
carom_status crm_locate(carom_world *w, double left, int allowed, int *busy);
/* Whether the estimate of sub is above the tolerance; *h is then how long it may be: the error of k
 * columns grows with h^(2k + 1). */
int crm_is_too_long(const carom_world *w, double *h);

/* events.c */
void crm_events_free(carom_world *w);
/* Impacts of the sub-step just committed, which began so long after the step did. */
carom_status crm_events_note(carom_world *w, double time);
/* Events that another thread has noted. */
carom_status crm_events_append(carom_world *w, const carom_contact_event *list, int n);
/* Room for all that crm_events_compare could find. */
carom_status crm_events_reserve(carom_world *w);
/* What the touches have that the n_before of the last step had not, and the other way round. */
void crm_events_compare(carom_world *w, int n_before);

/* A joint breaks; there is room for it. */
void crm_events_break(carom_world *w, int joint);

/* field.c: sums over all fields. */
void crm_field_force(const carom_world *w, int body, double t, const double *q, const double *v,
                     double f[3]);
void crm_field_slopes(const carom_world *w, int body, double t, const double *q, const double *v,
                      double by_q[9], double by_v[9]);
void crm_field_rate(const carom_world *w, int body, double t, const double *q, const double *v,
                    double by_t[3]);
int crm_fields_have_slopes(const carom_world *w);
/* Time and velocities at which a solve takes them. */
int crm_field_is_late(const crm_substep *s, const crm_solve *c);
double crm_field_time(const crm_substep *s, const crm_solve *c);
const double *crm_field_velocity(const crm_substep *s, const crm_solve *c);
/* Their impulses to rows.u. */
void crm_fields(carom_world *w, const crm_substep *s, const crm_solve *c);
/* a += W f */
void crm_field_acceleration(const carom_world *w, int body, double t, const double *q,
                            const double *v, double a[3]);

/* break.c */
int crm_joint_breaks(const crm_joint *j);
/* At the end of a step: joints that bore too much are broken. */
void crm_break_joints(carom_world *w);

/* seal.c */
carom_status crm_seal(carom_world *w);
/* The same without a look at overlaps: for a state that a step left. */
carom_status crm_seal_as_is(carom_world *w);
void crm_free_sealed(carom_world *w);
#endif
