/* cart_pole.c: a pole that hangs from a cart is swung up and balanced.  Iterative LQR: every round
 * runs the steps, asks for the Jacobian of each, finds the best linear feedback backward and runs
 * again with it.  Prints CSV: the rounds, then the motion.  cart_pole.py draws it. */
#include <carom/carom.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

enum { RAIL, CART, POLE, N_BODIES };
enum { STEPS = 180, ROUNDS = 200, N = 4, COORDS = 3 * N_BODIES };
static const double DT = 1.0 / 60; /* [s] */
static const double HALF = 0.4;    /* of the pole [m] */
static const double UP = 3.14159265358979323846;

/* What is paid: for force in each step, and at the end for being anything but upright and still at
 * x = 0.  In the order of a state (x, angle, speed of the cart, speed of the pole). */
static const double FORCE_PRICE = 1e-4;
static const double END_PRICE[N] = {1000, 1000, 100, 100};
static const double FAR_PRICE = 0.02; /* of x^2 in each step: the rail is short */

typedef struct plan {
    double s[STEPS + 1][N];
    double u[STEPS]; /* force on the cart [N] */
    double cost;
} plan;

typedef struct feedback {
    double k[STEPS], gain[STEPS][N];
} feedback;

/* A step to first order: ds1 = A ds + B du. */
typedef struct model {
    double a[N][N], b[N];
} model;

static carom_status build(carom_world **world)
{
    carom_body_def rail = carom_body_at(CAROM_STATIC, 0, 0);
    carom_body_def cart = carom_body_at(CAROM_DYNAMIC, 0, 0);
    carom_body_def pole = carom_body_at(CAROM_DYNAMIC, 0, -HALF);
    carom_joint_def slide = carom_joint_defaults(CAROM_PRISMATIC);
    const carom_vec2 hinge = {0, 0};
    carom_world_settings set = carom_world_defaults();
    set.dt = DT;
    rail.collide = cart.collide = pole.collide = 0;
    slide.body_a = RAIL;
    slide.body_b = CART;
    carom_status s = carom_world_create(&set, NULL, world);
    if (s >= 0) s = carom_world_add_body(*world, &rail, NULL);
    if (s >= 0) s = carom_world_add_box(*world, &cart, 0.4, 0.2, 12.5, NULL);    /* 1 kg */
    if (s >= 0) s = carom_world_add_box(*world, &pole, 0.05, 2 * HALF, 5, NULL); /* 0.2 kg */
    if (s >= 0) s = carom_world_add_joint(*world, &slide, NULL);
    if (s >= 0) s = carom_world_add_revolute(*world, CART, POLE, hinge, NULL);
    if (s >= 0) s = carom_world_seal(*world);
    return s;
}

/* Poses and velocities that a state stands for, and their derivative by it: x goes to both bodies,
 * the angle turns the pole's center about the hinge. */
static void place(const double s[N], double q[COORDS], double v[COORDS])
{
    const double x = HALF * sin(s[1]);
    const double y = -HALF * cos(s[1]);
    memset(q, 0, COORDS * sizeof *q);
    memset(v, 0, COORDS * sizeof *v);
    q[3 * CART + 1] = s[0];
    v[3 * CART + 1] = s[2];
    q[3 * POLE] = s[1];
    q[3 * POLE + 1] = s[0] + x;
    q[3 * POLE + 2] = y;
    v[3 * POLE] = s[3];
    v[3 * POLE + 1] = s[2] - s[3] * y;
    v[3 * POLE + 2] = s[3] * x;
}

static void place_derivative(const double s[N], double d[2 * COORDS][N])
{
    const double x = HALF * sin(s[1]);
    const double y = -HALF * cos(s[1]);
    memset(d, 0, 2 * COORDS * sizeof *d);
    for (int half = 0; half < 2; half++) { /* of q by (x, angle), of v by their speeds: alike */
        const int at = half * COORDS;
        d[at + 3 * CART + 1][2 * half] = d[at + 3 * POLE + 1][2 * half] = 1;
        d[at + 3 * POLE][2 * half + 1] = 1;
        d[at + 3 * POLE + 1][2 * half + 1] = -y;
        d[at + 3 * POLE + 2][2 * half + 1] = x;
    }
    d[COORDS + 3 * POLE + 1][1] = -s[3] * x;
    d[COORDS + 3 * POLE + 2][1] = -s[3] * y;
}

/* Where the numbers of a state are among the 2 COORDS of (q, v). */
static const int AT[N] = {3 * CART + 1, 3 * POLE, COORDS + 3 * CART + 1, COORDS + 3 * POLE};

static double step_cost(const double s[N], double u)
{
    return 0.5 * (FORCE_PRICE * u * u + FAR_PRICE * s[0] * s[0]);
}

static double miss(const double s[N], int i)
{
    return s[i] - (i == 1 ? UP : 0);
}

/* Runs the steps with the forces of `old`, moved by alpha and fed back; into `p`. */
static carom_status run(carom_world *w, carom_tape *t, const plan *old, const feedback *f,
                        double alpha, plan *p)
{
    double q[COORDS], v[COORDS], force[COORDS] = {0};
    place(old->s[0], q, v);
    memcpy(p->s[0], old->s[0], sizeof p->s[0]);
    carom_status e = carom_world_set_state(w, q, v);
    carom_tape_rewind(t);
    p->cost = 0;
    for (int k = 0; e >= 0 && k < STEPS; k++) {
        p->u[k] = old->u[k] + alpha * f->k[k];
        for (int i = 0; i < N; i++) p->u[k] += f->gain[k][i] * (p->s[k][i] - old->s[k][i]);
        p->cost += step_cost(p->s[k], p->u[k]);
        force[3 * CART + 1] = p->u[k];
        e = carom_tape_step(t, force, NULL);
        for (int i = 0; i < N; i++) {
            p->s[k + 1][i] =
                AT[i] < COORDS ? carom_world_q(w)[AT[i]] : carom_world_v(w)[AT[i] - COORDS];
        }
    }
    for (int i = 0; i < N; i++) p->cost += 0.5 * END_PRICE[i] * pow(miss(p->s[STEPS], i), 2);
    return e;
}

/* The model of a step, from the dense Jacobian of the tape. */
static carom_status linearize(carom_tape *t, int step, const double s[N], model *m)
{
    static double q0[2 * COORDS][COORDS], v0[2 * COORDS][COORDS], force[2 * COORDS][COORDS];
    double d[2 * COORDS][N];
    const carom_gradient rows = {.q0 = q0[0], .v0 = v0[0], .force = force[0]};
    const carom_status e = carom_tape_jacobian(t, step, &rows, NULL);
    place_derivative(s, d);
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < N; j++) {
            m->a[i][j] = 0;
            for (int k = 0; k < COORDS; k++) {
                m->a[i][j] += q0[AT[i]][k] * d[k][j] + v0[AT[i]][k] * d[COORDS + k][j];
            }
        }
        m->b[i] = force[AT[i]][3 * CART + 1];
    }
    return e;
}

/* The feedback that is best for the models, backward: V(s) = v.s + s.V s/2.  `damping` adds to the
 * price of a change of force. */
static carom_status improve(carom_tape *t, const plan *p, double damping, feedback *f)
{
    double V[N][N] = {{0}}, v[N];
    for (int i = 0; i < N; i++) {
        V[i][i] = END_PRICE[i];
        v[i] = END_PRICE[i] * miss(p->s[STEPS], i);
    }
    for (int k = STEPS - 1; k >= 0; k--) {
        model m;
        double VA[N][N] = {{0}}, Vb[N] = {0}, qs[N] = {0}, qus[N] = {0}, Q[N][N] = {{0}};
        double qu = FORCE_PRICE * p->u[k], quu = FORCE_PRICE + damping;
        const carom_status e = linearize(t, k, p->s[k], &m);
        if (e < 0) return e;
        for (int i = 0; i < N; i++) {
            for (int j = 0; j < N; j++) {
                Vb[i] += V[i][j] * m.b[j];
                qs[i] += m.a[j][i] * v[j];
                for (int l = 0; l < N; l++) VA[i][j] += V[i][l] * m.a[l][j];
            }
            qu += m.b[i] * v[i];
            quu += m.b[i] * Vb[i];
        }
        qs[0] += FAR_PRICE * p->s[k][0];
        Q[0][0] = FAR_PRICE;
        for (int i = 0; i < N; i++) {
            for (int j = 0; j < N; j++) {
                qus[i] += m.a[j][i] * Vb[j];
                for (int l = 0; l < N; l++) Q[i][j] += m.a[l][i] * VA[l][j];
            }
        }
        f->k[k] = -qu / quu;
        for (int i = 0; i < N; i++) f->gain[k][i] = -qus[i] / quu;
        for (int i = 0; i < N; i++) {
            v[i] = qs[i] + f->k[k] * qus[i];
            for (int j = 0; j < N; j++) V[i][j] = Q[i][j] - qus[i] * qus[j] / quu;
        }
    }
    return CAROM_OK;
}

/* Rounds until nothing is gained; steps that do not lower the cost are shortened, then damped. */
static carom_status search(carom_world *w, carom_tape *t, plan *p)
{
    static feedback f;
    static plan next;
    double damping = 1e-3;
    carom_status e = run(w, t, p, &f, 0, &next);
    *p = next;
    for (int round = 0; e >= 0 && round < ROUNDS && damping < 1e6; round++) {
        printf("round,%d,%.9g\n", round, p->cost);
        e = improve(t, p, damping, &f);
        double alpha = 1;
        do {
            if (e >= 0) e = run(w, t, p, &f, alpha, &next);
            alpha /= 2;
        } while (e >= 0 && alpha > 0.02 && !(next.cost < p->cost));
        if (!(next.cost < p->cost)) {
            if (e >= 0) e = run(w, t, p, &(feedback){{0}, {{0}}}, 0, &next); /* its tape again */
            damping *= 10;
            continue;
        }
        damping = alpha >= 0.5 ? damping / 3 : damping;
        const double gained = p->cost - next.cost;
        *p = next;
        if (gained < 1e-6 * p->cost) break;
    }
    return e;
}

int main(void)
{
    static plan p; /* at rest, hanging; a small push to begin with */
    carom_world *world = NULL;
    carom_tape *tape = NULL;
    for (int k = 0; k < STEPS; k++) p.u[k] = 2 * sin(5.0 * k * DT);
    carom_status e = build(&world);
    if (e >= 0) e = carom_tape_create(world, NULL, &tape);
    if (e >= 0) e = search(world, tape, &p);
    if (e < 0)
        fprintf(stderr, "%s %s\n", carom_status_name(e), world ? carom_world_error(world) : "");
    for (int k = 0; e >= 0 && k <= STEPS; k++) {
        printf("state,%.6f,%.9g,%.9g,%.9g,%.9g,%.9g\n", k * DT, p.s[k][0], p.s[k][1], p.s[k][2],
               p.s[k][3], k < STEPS ? p.u[k] : 0.0);
    }
    carom_tape_destroy(tape);
    carom_world_destroy(world);
    return e < 0;
}
