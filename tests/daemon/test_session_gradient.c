/* test_session_gradient.c: tapes, gradients and descents of a session. */
#include "near.h"

#include "direct.h"
#include "requests.h"

#include <stddef.h>

static void gradient_is_that_of_the_library(void **state)
{
    enum { STEPS = 60, COORD = 4, N = 4 };
    (void)state;
    bench *b = do_open();
    const int wanted = CAROM_PARAMETER_GRADIENT_T_Q0 | CAROM_PARAMETER_GRADIENT_T_MASS |
                       CAROM_PARAMETER_GRADIENT_T_FRICTION |
                       CAROM_PARAMETER_GRADIENT_T_FORCE_STEPS | CAROM_PARAMETER_GRADIENT_T_ANCHORS |
                       CAROM_PARAMETER_GRADIENT_T_DT;
    do_recorded(b, 2, 0, STEPS);
    assert_int_equal(bench_reply(b).recorded_steps, STEPS);
    const carom_loss_gradient_t loss = loss_of(CLIENT, SESSION, 3, STEPS, COORD, wanted);
    bench_do(b, pack_loss(&loss));
    expect_reply(b, CAROM_REPLY_T_OK, 3, 4, "");
    carom_parameter_gradient_t *m = bench_gradient(b);

    const carom_scene_t scene = scene_of(CLIENT, SESSION, 1);
    carom_world *w = direct_world(&scene);
    carom_tape *tape = NULL;
    assert_true(carom_tape_create(w, NULL, &tape) >= 0);
    for (int k = 0; k < STEPS; k++) assert_true(carom_tape_step(tape, NULL, NULL) >= 0);
    double q_bar[3 * N] = {0}, q0[3 * N], mass[N], friction[N], steps[3 * N * STEPS];
    carom_vec2 anchors[2];
    double dt = 0;
    q_bar[COORD] = 1;
    const carom_state_bar bar = {STEPS, q_bar, NULL};
    carom_gradient g = {0};
    g.q0 = q0;
    g.mass = mass;
    g.friction = friction;
    g.force_steps = steps;
    g.anchors = anchors;
    g.dt = &dt;
    assert_true(carom_tape_gradient(tape, 1, &bar, &g, NULL) >= 0);

    assert_int_equal(m->wanted, wanted);
    assert_int_equal(m->num_v0, 0);
    assert_int_equal(m->num_q0, 3 * N);
    assert_memory_equal(m->q0, q0, sizeof q0);
    assert_memory_equal(m->mass, mass, sizeof mass);
    assert_memory_equal(m->friction, friction, sizeof friction);
    assert_int_equal(m->num_force_steps, 3 * N * STEPS);
    assert_memory_equal(m->force_steps, steps, sizeof steps);
    assert_int_equal(m->num_anchors, 4);
    assert_memory_equal(m->anchors, anchors, sizeof anchors);
    assert_int_equal(m->num_dt, 1);
    assert_memory_equal(m->dt, &dt, sizeof dt);
    assert_true(near_norm(N, friction) > 0); /* the disc rubs on the floor */
    assert_near(m->cost, 1.5, 0);
    carom_parameter_gradient_t_destroy(m);
    carom_tape_destroy(tape);
    carom_world_destroy(w);
    bench_destroy(b);
}

/* The arrays of a gradient by their bits. */
typedef struct part {
    int bit;
    size_t count, values; /* where in the message */
} part;
#define PART(bit, name)                                                                            \
    {                                                                                              \
        CAROM_PARAMETER_GRADIENT_T_##bit, offsetof(carom_parameter_gradient_t, num_##name),        \
            offsetof(carom_parameter_gradient_t, name)                                             \
    }
static const part PARTS[] = {
    PART(Q0, q0),
    PART(V0, v0),
    PART(MASS, mass),
    PART(INERTIA, inertia),
    PART(FRICTION, friction),
    PART(RESTITUTION, restitution),
    PART(GRAVITY, gravity),
    PART(FORCE, force),
    PART(FORCE_STEPS, force_steps),
    PART(RADIUS, radius),
    PART(VERTICES, vertices),
    PART(ANCHORS, anchors),
    PART(DT, dt),
};
#undef PART
enum { N_PARTS = sizeof PARTS / sizeof PARTS[0], ALL = (1 << N_PARTS) - 1 };

static int part_count(const carom_parameter_gradient_t *m, const part *p)
{
    return *(const int32_t *)((const char *)m + p->count);
}

static const double *part_values(const carom_parameter_gradient_t *m, const part *p)
{
    return *(double *const *)((const char *)m + p->values);
}

/* The gradient of one request; destroy it. */
static carom_parameter_gradient_t *ask(bench *b, const carom_loss_gradient_t *loss)
{
    bench_clear(b);
    bench_do(b, pack_loss(loss));
    expect_reply(b, CAROM_REPLY_T_OK, loss->seq, loss->seq + 1, "");
    return bench_gradient(b);
}

/* Any mask: the arrays of its bits, as among all, and no others. */
static void every_mask_gives_its_arrays(void **state)
{
    (void)state;
    bench *b = do_open();
    do_recorded(b, 2, 0, 40);
    const carom_loss_gradient_t whole = loss_of(CLIENT, SESSION, 3, 40, 4, ALL);
    carom_parameter_gradient_t *all = ask(b, &whole);
    for (int64_t seq = 4; seq < 4 + 2 * N_PARTS; seq++) {
        /* each alone, and each left out */
        const int bit = 1 << ((seq - 4) % N_PARTS);
        const int mask = seq < 4 + N_PARTS ? bit : ALL & ~bit;
        const carom_loss_gradient_t loss = loss_of(CLIENT, SESSION, seq, 40, 4, mask);
        carom_parameter_gradient_t *m = ask(b, &loss);
        assert_int_equal(m->wanted, mask);
        for (int k = 0; k < N_PARTS; k++) {
            const int n = part_count(m, &PARTS[k]);
            assert_int_equal(n, mask & PARTS[k].bit ? part_count(all, &PARTS[k]) : 0);
            if (!n) continue;
            const double *x = part_values(all, &PARTS[k]);
            /* what is not asked for is not computed: sums of other terms, rounded otherwise */
            assert_near_array("part", n, part_values(m, &PARTS[k]), x, 1e-13 * near_norm(n, x));
        }
        carom_parameter_gradient_t_destroy(m);
    }
    carom_parameter_gradient_t_destroy(all);
    bench_destroy(b);
}

/* Cotangents of several states, in any order and twice for one of them, the start included: their
 * gradients add up. */
static void losses_of_any_steps_add_up(void **state)
{
    enum { N_BARS = 4, N = 12 };
    int64_t bar_step[N_BARS] = {30, 0, 12, 30};
    double q_bar[N_BARS * N], v_bar[N_BARS * N];
    double sum[N_PARTS][3 * 4 * 40] = {{0}};
    (void)state;
    for (int k = 0; k < N_BARS * N; k++) {
        q_bar[k] = cos(1.7 * k);
        v_bar[k] = sin(2.3 * k);
    }
    bench *b = do_open();
    do_recorded(b, 2, 0, 40);
    for (int i = 0; i <= N_BARS; i++) {
        const int together = i == N_BARS;
        carom_loss_gradient_t loss = loss_of(CLIENT, SESSION, 3 + i, 0, 0, ALL);
        loss.num_bars = together ? N_BARS : 1;
        loss.num_bar_coords = N * loss.num_bars;
        loss.bar_step = together ? bar_step : &bar_step[i];
        loss.q_bar = together ? q_bar : &q_bar[i * N];
        loss.v_bar = together ? v_bar : &v_bar[i * N];
        carom_parameter_gradient_t *m = ask(b, &loss);
        for (int k = 0; k < N_PARTS; k++) {
            const int n = part_count(m, &PARTS[k]);
            const double *x = part_values(m, &PARTS[k]);
            assert_true(n <= 3 * 4 * 40);
            /* rounding of sums of numbers of this size */
            const double tol = 1e-12 * (1 + near_norm(n, sum[k]));
            if (together) assert_near_array("sum", n, x, sum[k], tol);
            for (int j = 0; j < n; j++) sum[k][j] += x[j];
        }
        carom_parameter_gradient_t_destroy(m);
    }
    bench_destroy(b);
}

static void tapes_follow_the_requests(void **state)
{
    (void)state;
    bench *b = do_open();
    const carom_loss_gradient_t early = loss_of(CLIENT, SESSION, 2, 1, 4, 1);
    bench_do(b, pack_loss(&early));
    expect_reply(b, CAROM_REPLY_T_REFUSED, 2, 3, "nothing is recorded");
    do_steps(b, 3, 0, 5, 0);
    do_recorded(b, 4, 5, 5);
    do_recorded(b, 5, 10, 5);
    assert_int_equal(bench_reply(b).first_step, 5);
    assert_int_equal(bench_reply(b).recorded_steps, 10);
    const carom_loss_gradient_t before = loss_of(CLIENT, SESSION, 6, 4, 4, 1);
    bench_do(b, pack_loss(&before));
    expect_reply(b, CAROM_REPLY_T_REFUSED, 6, 7, "steps 5 to 15 are recorded");
    const carom_loss_gradient_t inside = loss_of(CLIENT, SESSION, 7, 5, 4, 1);
    bench_do(b, pack_loss(&inside));
    carom_parameter_gradient_t *m = bench_gradient(b);
    assert_int_equal(m->first_step, 5);
    /* d q0 / d q0: the state at the start of the tape is its own. */
    for (int i = 0; i < 12; i++) assert_near(m->q0[i], i == 4, 0);
    carom_parameter_gradient_t_destroy(m);
    do_steps(b, 8, 15, 1, 0);
    assert_int_equal(bench_reply(b).recorded_steps, 0);
    bench_destroy(b);
}

static carom_parameter_gradient_t descent_of(int64_t seq, int wanted, double rate)
{
    carom_parameter_gradient_t m = {0};
    m.client_id = CLIENT;
    m.session = SESSION;
    m.seq = seq;
    m.wanted = wanted;
    m.rate = rate;
    return m;
}

/* parameter - rate * gradient, projected: mass and radius stay positive, 0 <= e <= 1, mu >= 0. */
static void descent_changes_the_scene(void **state)
{
    double mass[] = {9, 1, -2, 1e6}, friction[] = {1, 9, 0.1, 0}, restitution[] = {-9, 9, 0.5, 0};
    double gravity[] = {1, 2}, radius[] = {0, 0.1, 1e6, 0};
    (void)state;
    bench *b = do_open();
    do_steps(b, 2, 0, 10, 0);
    carom_parameter_gradient_t d =
        descent_of(3,
                   CAROM_PARAMETER_GRADIENT_T_MASS | CAROM_PARAMETER_GRADIENT_T_FRICTION |
                       CAROM_PARAMETER_GRADIENT_T_RESTITUTION | CAROM_PARAMETER_GRADIENT_T_GRAVITY |
                       CAROM_PARAMETER_GRADIENT_T_RADIUS,
                   0.5);
    d.num_mass = d.num_friction = d.num_restitution = d.num_radius = 4;
    d.num_gravity = 2;
    d.mass = mass;
    d.friction = friction;
    d.restitution = restitution;
    d.gravity = gravity;
    d.radius = radius;
    bench_do(b, pack_descent(&d));
    expect_reply(b, CAROM_REPLY_T_OK, 3, 4, "");
    assert_int_equal(bench_reply(b).step, 0);
    carom_scene_t *s = bench_scene(b);
    const double new_mass[] = {1, 1.5, 4, 0.01}, new_friction[] = {0, 0, 0.25, 0};
    const double new_restitution[] = {1, 0, 0.25, 0}, new_gravity[] = {-0.5, -10.81};
    const double new_radius[] = {0, 0.2, 0.0025, 0.05};
    assert_near_array("mass", 4, s->mass, new_mass, 1e-15);
    assert_near_array("friction", 4, s->friction, new_friction, 1e-15);
    assert_near_array("restitution", 4, s->restitution, new_restitution, 1e-15);
    assert_near_array("gravity", 2, s->gravity, new_gravity, 2e-15);
    assert_near_array("radius", 4, s->radius, new_radius, 1e-15);
    assert_int_equal(s->seq, 3);
    carom_scene_t_destroy(s);
    bench_destroy(b);
}

/* Of q0, v0, inertia, force and vertices: static bodies keep their velocity, inertia stays
 * positive.
 */
static void descent_moves_states_and_forces(void **state)
{
    enum { N = 4 };
    double q0[3 * N] = {0}, v0[3 * N], force[3 * N], inertia[N], vertices[32] = {0};
    (void)state;
    bench *b = do_open();
    const carom_scene_t old = scene_of(CLIENT, SESSION, 1);
    for (int k = 0; k < 3 * N; k++) {
        v0[k] = k + 1;
        force[k] = -k;
    }
    for (int k = 0; k < N; k++) inertia[k] = k == 2 ? 1e6 : 0.01;
    q0[3 * 1 + 2] = -0.5;
    vertices[0] = 0.25;
    carom_parameter_gradient_t d =
        descent_of(2,
                   CAROM_PARAMETER_GRADIENT_T_Q0 | CAROM_PARAMETER_GRADIENT_T_V0 |
                       CAROM_PARAMETER_GRADIENT_T_INERTIA | CAROM_PARAMETER_GRADIENT_T_FORCE |
                       CAROM_PARAMETER_GRADIENT_T_VERTICES,
                   0.5);
    d.num_q0 = d.num_v0 = d.num_force = 3 * N;
    d.num_inertia = N;
    d.num_vertices = old.num_vertex_coords;
    assert_true(d.num_vertices <= 32);
    d.q0 = q0;
    d.v0 = v0;
    d.force = force;
    d.inertia = inertia;
    d.vertices = vertices;
    bench_do(b, pack_descent(&d));
    expect_reply(b, CAROM_REPLY_T_OK, 2, 3, "");
    carom_scene_t *s = bench_scene(b);
    for (int k = 0; k < 3 * N; k++) {
        const int moves = old.body_type[k / 3] == CAROM_SCENE_T_DYNAMIC;
        assert_near_case("v", k, s->v[k], moves ? old.v[k] - 0.5 * v0[k] : 0, 1e-15);
        assert_near_case("force", k, s->force[k], old.force[k] - 0.5 * force[k], 1e-15);
        assert_near_case("q", k, s->q[k], old.q[k] - 0.5 * q0[k], 1e-15);
    }
    for (int k = 0; k < N; k++) {
        const double least = 0.01 * old.inertia[k];
        if (old.body_type[k] != CAROM_SCENE_T_DYNAMIC) continue;
        assert_near_case("inertia", k, s->inertia[k],
                         fmax(old.inertia[k] - 0.5 * inertia[k], least), 1e-15);
    }
    for (int k = 0; k < old.num_vertex_coords; k++) {
        assert_near_case("vertex", k, s->vertices[k], old.vertices[k] - 0.5 * vertices[k], 1e-14);
    }
    carom_scene_t_destroy(s);
    bench_destroy(b);
}

/* A descended session steps like one that was opened with the new scene; kept, it goes on from its
 * state with the new parameters. */
static void descended_sessions_step_on(void **state)
{
    double friction[] = {0, 1, 0, 0};
    (void)state;
    for (int keep = 0; keep < 2; keep++) {
        bench *b = do_open();
        do_steps(b, 2, 0, 30, 0);
        carom_state_t *at_30 = bench_state(b, 0);
        carom_parameter_gradient_t d = descent_of(3, CAROM_PARAMETER_GRADIENT_T_FRICTION, 0.25);
        d.num_friction = 4;
        d.friction = friction;
        d.keep_state = (int8_t)keep;
        bench_do(b, pack_descent(&d));
        carom_scene_t *s = bench_scene(b);
        assert_near(s->friction[1], 0.15, 1e-15);
        carom_world *w = direct_world(s);
        if (keep) assert_true(carom_world_set_state(w, at_30->q, at_30->v) >= 0);
        bench_clear(b);
        do_steps(b, 4, keep ? 30 : 0, 40, 0);
        expect_reply(b, CAROM_REPLY_T_OK, 4, 5, "");
        carom_state_t *end = bench_state(b, 0);
        for (int k = 0; k < 40; k++) assert_true(carom_world_step(w, NULL, NULL) >= 0);
        assert_int_equal(end->step, keep ? 70 : 40);
        assert_memory_equal(end->q, carom_world_q(w), 12 * sizeof(double));
        carom_state_t_destroy(end);
        carom_state_t_destroy(at_30);
        carom_scene_t_destroy(s);
        carom_world_destroy(w);
        bench_destroy(b);
    }
}

/* A joint is one world point: with q = 0 for the floor and angle 0.2 for the link,
 * d / d w = R_a d / d a + R_b d / d b. */
static void anchors_descend_along_the_chain_rule(void **state)
{
    double anchors[] = {1, 0, 0, 2}, q0[12] = {0};
    (void)state;
    bench *b = do_open();
    carom_parameter_gradient_t d = descent_of(2, CAROM_PARAMETER_GRADIENT_T_ANCHORS, 0.01);
    d.num_anchors = 4;
    d.anchors = anchors;
    bench_do(b, pack_descent(&d));
    carom_scene_t *s = bench_scene(b);
    assert_near(s->anchor[0], 2.5 - 0.01 * (1 - 2 * sin(0.2)), 1e-15);
    assert_near(s->anchor[1], 2 - 0.01 * 2 * cos(0.2), 1e-15);
    carom_scene_t_destroy(s);
    bench_clear(b);
    /* The link and the floor move alike by (-0.1, 0.2): so does the joint. */
    for (int i = 0; i < 4; i++) {
        q0[3 * i + 1] = 0.1;
        q0[3 * i + 2] = -0.2;
    }
    do_scene(b, 3);
    d = descent_of(4, CAROM_PARAMETER_GRADIENT_T_Q0, 1);
    d.num_q0 = 12;
    d.q0 = q0;
    bench_do(b, pack_descent(&d));
    s = bench_scene(b);
    assert_near(s->anchor[0], 2.4, 1e-14);
    assert_near(s->anchor[1], 2.2, 1e-14);
    carom_scene_t_destroy(s);
    bench_destroy(b);
}

static void bad_descents_are_refused(void **state)
{
    double mass[] = {1, 1, 1, NAN}, vertices[16] = {0};
    (void)state;
    bench *b = do_open();
    const int w = CAROM_PARAMETER_GRADIENT_T_MASS;
    carom_parameter_gradient_t d = descent_of(2, w, 0);
    bench_do(b, pack_descent(&d));
    expect_reply(b, CAROM_REPLY_T_REFUSED, 2, 3, "rate");
    d = descent_of(3, w, 1);
    bench_do(b, pack_descent(&d));
    expect_reply(b, CAROM_REPLY_T_REFUSED, 3, 4, "num_mass = 0: this scene has 4");
    d = descent_of(4, w, 1);
    d.num_mass = 4;
    d.mass = mass;
    bench_do(b, pack_descent(&d));
    expect_reply(b, CAROM_REPLY_T_REFUSED, 4, 5, "mass[3] is not finite");
    d = descent_of(5, CAROM_PARAMETER_GRADIENT_T_FORCE_STEPS, 1);
    bench_do(b, pack_descent(&d));
    expect_reply(b, CAROM_REPLY_T_REFUSED, 5, 6, "force_steps");
    d = descent_of(6, 1 << 26, 1);
    bench_do(b, pack_descent(&d));
    expect_reply(b, CAROM_REPLY_T_REFUSED, 6, 7, "the bits 67108864 name no parameter");
    d = descent_of(7, CAROM_PARAMETER_GRADIENT_T_Q0, 1);
    d.num_q0 = 12;
    d.q0 = vertices;
    d.first_step = 3;
    bench_do(b, pack_descent(&d));
    expect_reply(b, CAROM_REPLY_T_REFUSED, 7, 8, "step 3");
    /* A floor turned inside out is no hull: the scene stays as it was. */
    vertices[0] = -30;
    vertices[2] = 30;
    d = descent_of(8, CAROM_PARAMETER_GRADIENT_T_VERTICES, 1);
    d.num_vertices = 16;
    d.vertices = vertices;
    bench_do(b, pack_descent(&d));
    expect_reply(b, CAROM_REPLY_T_REFUSED, 8, 9, "vertex");
    assert_int_equal(bench_count(b, CRM_WIRE_SCENE_UPDATED), 0);
    do_steps(b, 9, 0, 3, 0);
    expect_reply(b, CAROM_REPLY_T_OK, 9, 10, "");
    bench_destroy(b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(gradient_is_that_of_the_library),
        cmocka_unit_test(every_mask_gives_its_arrays),
        cmocka_unit_test(losses_of_any_steps_add_up),
        cmocka_unit_test(tapes_follow_the_requests),
        cmocka_unit_test(descent_changes_the_scene),
        cmocka_unit_test(descent_moves_states_and_forces),
        cmocka_unit_test(descended_sessions_step_on),
        cmocka_unit_test(anchors_descend_along_the_chain_rule),
        cmocka_unit_test(bad_descents_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
