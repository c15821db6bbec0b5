/* test_session.c: sessions as a function of bytes: what is executed, once, and what is answered. */
#include "near.h"

#include "direct.h"
#include "messages.h"

#include <stdlib.h>
#include <string.h>

enum { CLIENT = 7, SESSION = 1 };

static void do_scene(bench *b, int64_t seq)
{
    const carom_scene_t m = scene_of(CLIENT, SESSION, seq);
    bench_do(b, pack_scene(&m));
}

static void do_steps(bench *b, int64_t seq, int64_t from, int n, int every)
{
    const carom_step_request_t m = steps_of(CLIENT, SESSION, seq, from, n, every);
    bench_do(b, pack_step(&m));
}

static void do_recorded(bench *b, int64_t seq, int64_t from, int n)
{
    carom_step_request_t m = steps_of(CLIENT, SESSION, seq, from, n, 0);
    m.record = CAROM_STEP_REQUEST_T_RECORD_ON;
    bench_do(b, pack_step(&m));
}

static void do_action(bench *b, int64_t seq, int action, int snapshot)
{
    carom_session_request_t m = action_of(CLIENT, SESSION, seq, action);
    m.snapshot = snapshot;
    bench_do(b, pack_action(&m));
}

static void expect(const bench *b, int code, int64_t seq, int64_t next_seq, const char *says)
{
    const carom_reply_t r = bench_reply(b);
    if (r.reply_code != code || !strstr(r.reply_text, says)) {
        fail_msg("seq %d: code %d '%s', expected %d '%s'", (int)seq, r.reply_code, r.reply_text,
                 code, says);
    }
    assert_int_equal(r.client_id, CLIENT);
    assert_int_equal(r.seq, seq);
    assert_int_equal(r.next_seq, next_seq);
    assert_int_equal(r.boot_id, 99);
}

static bench *with_scene(void)
{
    bench *b = bench_create(NULL);
    do_scene(b, 1);
    expect(b, CAROM_REPLY_T_OK, 1, 2, "");
    return b;
}

/* --- steps */

/* The published states are those of the library on the same scene, bit for bit. */
static void states_are_those_of_the_library(void **state)
{
    (void)state;
    bench *b = with_scene();
    const carom_scene_t scene = scene_of(CLIENT, SESSION, 1);
    carom_world *w = direct_world(&scene);
    do_steps(b, 2, 0, 100, 1);
    expect(b, CAROM_REPLY_T_OK, 2, 3, "");
    assert_int_equal(bench_count(b, CRM_WIRE_STATE), 100);
    int contacts = 0;
    for (int k = 0; k < 100; k++) {
        carom_step_stats stats;
        assert_true(carom_world_step(w, NULL, &stats) >= 0);
        carom_state_t *m = bench_state(b, k);
        assert_int_equal(m->step, k + 1);
        assert_int_equal(m->num_q, 12);
        assert_memory_equal(m->q, carom_world_q(w), 12 * sizeof(double));
        assert_memory_equal(m->v, carom_world_v(w), 12 * sizeof(double));
        assert_memory_equal(&m->energy, &stats.energy, sizeof(double));
        assert_near(m->sim_time, carom_world_time(w), 1e-12); /* 100 roundings of 1 s */
        contacts += stats.n_contacts;
        carom_state_t_destroy(m);
    }
    assert_true(contacts > 0);
    carom_world_destroy(w);
    bench_destroy(b);
}

static void publishes_what_was_asked_for(void **state)
{
    static const struct {
        int n, every, n_states;
        int64_t steps[4];
    } cases[] = {{10, 4, 3, {4, 8, 10}}, {10, 5, 2, {5, 10}}, {10, 0, 1, {10}}, {0, 1, 1, {0}}};
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        bench *b = with_scene();
        do_steps(b, 2, 0, cases[i].n, cases[i].every);
        assert_int_equal(bench_count(b, CRM_WIRE_STATE), cases[i].n_states);
        assert_int_equal(bench_reply(b).num_states, cases[i].n_states);
        assert_int_equal(bench_reply(b).step, cases[i].n);
        for (int k = 0; k < cases[i].n_states; k++) {
            carom_state_t *m = bench_state(b, k);
            assert_int_equal(m->step, cases[i].steps[k]);
            carom_state_t_destroy(m);
        }
        bench_destroy(b);
    }
}

static void contacts_on_request(void **state)
{
    (void)state;
    bench *b = with_scene();
    carom_step_request_t m = steps_of(CLIENT, SESSION, 2, 0, 100, 0);
    m.want = CAROM_STEP_REQUEST_T_WANT_CONTACTS;
    bench_do(b, pack_step(&m));
    carom_state_t *s = bench_state(b, 0);
    assert_int_equal(s->num_q, 0);
    assert_int_equal(s->num_v, 0);
    assert_true(s->num_contacts > 0);
    double up = 0;
    for (int k = 0; k < s->num_contacts; k++) {
        assert_true(s->contact_body_a[k] >= 0 && s->contact_body_b[k] < 4);
        assert_true(s->impulse_normal[k] >= 0);
        const double *n = s->contact_normal + 2 * k;
        assert_near(n[0] * n[0] + n[1] * n[1], 1, 1e-14);
        if (s->contact_body_a[k] == 0) up += n[1];
    }
    assert_true(up > 0.9); /* a disc lies on the floor */
    carom_state_t_destroy(s);
    bench_destroy(b);
}

/* Momentum: with a constant force F in the steps 2 and 3 of 5 a free body gains 2 h F / m. */
static void forces_act_in_their_steps(void **state)
{
    static int32_t step[] = {1, 2}, body[] = {1, 1};
    static double force[] = {0, 0, 40, 0, 0, 40};
    (void)state;
    bench *b = with_scene();
    carom_step_request_t m = steps_of(CLIENT, SESSION, 2, 0, 4, 1);
    m.num_forces = 2;
    m.force_step = step;
    m.force_body = body;
    m.num_force_values = 6;
    m.step_force = force;
    bench_do(b, pack_step(&m));
    double vy[5] = {0};
    for (int k = 0; k < 4; k++) {
        carom_state_t *s = bench_state(b, k);
        vy[k + 1] = s->v[5];
        carom_state_t_destroy(s);
    }
    /* h (F/m - g) = 0.01 (20 - 9.81); discs are in the air, 0.05 m and 0.15 m above the floor. */
    assert_near(vy[2] - vy[1], 0.1019, 1e-12);
    assert_near(vy[3] - vy[2], 0.1019, 1e-12);
    assert_near(vy[4] - vy[3], -0.0981, 1e-12);
    bench_destroy(b);
}

static void bad_forces_are_refused(void **state)
{
    static const struct {
        int32_t step, body;
        double f;
        const char *says;
    } cases[] = {{3, 1, 1, "in step 3"},
                 {-1, 1, 1, "in step -1"},
                 {0, 4, 1, "on body 4"},
                 {0, -1, 1, "on body -1"},
                 {0, 1, NAN, "not finite"}};
    (void)state;
    bench *b = with_scene();
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        int32_t step = cases[i].step, body = cases[i].body;
        double force[3] = {0, cases[i].f, 0};
        const int64_t seq = 2 + (int64_t)i;
        carom_step_request_t m = steps_of(CLIENT, SESSION, seq, 0, 3, 1);
        m.num_forces = 1;
        m.force_step = &step;
        m.force_body = &body;
        m.num_force_values = 3;
        m.step_force = force;
        bench_do(b, pack_step(&m));
        expect(b, CAROM_REPLY_T_REFUSED, seq, seq + 1, cases[i].says);
        assert_int_equal(bench_reply(b).step, 0);
    }
    bench_destroy(b);
}

/* --- once, whatever arrives how often */

static void repeated_requests_come_from_the_cache(void **state)
{
    (void)state;
    bench *b = with_scene();
    do_steps(b, 2, 0, 5, 1);
    const int n = b->n;
    bytes *first = malloc((size_t)n * sizeof *first);
    memcpy(first, b->out, (size_t)n * sizeof *first);
    b->n = 0;
    do_steps(b, 2, 0, 5, 1);
    /* The scene's reply was the first message. */
    assert_int_equal(b->n, n - 1);
    for (int i = 0; i < b->n; i++) {
        assert_int_equal(b->out[i].size, first[i + 1].size);
        assert_memory_equal(b->out[i].data, first[i + 1].data, (size_t)first[i + 1].size);
    }
    assert_int_equal(bench_reply(b).step, 5);
    for (int i = 0; i < n; i++) free(first[i].data);
    free(first);
    bench_destroy(b);
}

static void only_the_missing_states_come_again(void **state)
{
    static int64_t missing[] = {5, 2, 77};
    (void)state;
    bench *b = with_scene();
    do_steps(b, 2, 0, 6, 1);
    bench_clear(b);
    carom_step_request_t m = steps_of(CLIENT, SESSION, 2, 0, 6, 1);
    m.num_resend = 3;
    m.resend_step = missing;
    bench_do(b, pack_step(&m));
    assert_int_equal(bench_count(b, CRM_WIRE_STATE), 2);
    for (int k = 0; k < 2; k++) {
        carom_state_t *s = bench_state(b, k);
        assert_int_equal(s->step, missing[k]);
        carom_state_t_destroy(s);
    }
    expect(b, CAROM_REPLY_T_OK, 2, 3, "");
    bench_destroy(b);
}

static void gaps_mismatches_and_strangers(void **state)
{
    (void)state;
    bench *b = bench_create(NULL);
    do_steps(b, 2, 0, 1, 1);
    expect(b, CAROM_REPLY_T_NO_SESSION, 2, 1, "unknown");
    do_steps(b, 1, 0, 1, 1);
    expect(b, CAROM_REPLY_T_NO_SESSION, 1, 1, "unknown");
    do_scene(b, 1);
    do_steps(b, 3, 0, 1, 1);
    expect(b, CAROM_REPLY_T_GAP, 3, 2, "");
    do_steps(b, 2, 1, 1, 1);
    expect(b, CAROM_REPLY_T_MISMATCH, 2, 3, "at step 0, not 1");
    do_steps(b, 3, 0, 1, 1);
    expect(b, CAROM_REPLY_T_OK, 3, 4, "");
    assert_int_equal(bench_reply(b).step, 1);
    do_steps(b, 0, 1, 1, 1);
    expect(b, CAROM_REPLY_T_MALFORMED, 0, 4, "seq");
    bench_destroy(b);
}

static void pending_busy_and_forgotten(void **state)
{
    (void)state;
    bench *b = with_scene();
    for (int k = 0; k < 8; k++) {
        const carom_step_request_t m = steps_of(CLIENT, SESSION, 2 + k, k, 1, 1);
        bench_receive(b, pack_step(&m));
    }
    const int before = bench_count(b, CRM_WIRE_REPLY);
    const carom_step_request_t again = steps_of(CLIENT, SESSION, 5, 3, 1, 1);
    bench_receive(b, pack_step(&again));
    expect(b, CAROM_REPLY_T_PENDING, 5, 10, "");
    const carom_step_request_t ninth = steps_of(CLIENT, SESSION, 10, 8, 1, 1);
    bench_receive(b, pack_step(&ninth));
    expect(b, CAROM_REPLY_T_BUSY, 10, 10, "queue");
    assert_int_equal(bench_count(b, CRM_WIRE_REPLY), before + 2);
    while (bench_slice(b)) {
    }
    expect(b, CAROM_REPLY_T_OK, 9, 10, "");
    assert_int_equal(bench_reply(b).step, 8);
    assert_int_equal(bench_reply(b).window, 8);
    do_steps(b, 1, 0, 1, 1);
    expect(b, CAROM_REPLY_T_FORGOTTEN, 1, 10, "");
    bench_destroy(b);
}

/* Two sessions with long requests advance in turn, and a third is answered in between. */
static void sessions_take_turns(void **state)
{
    (void)state;
    bench *b = bench_create(NULL);
    for (int s = 1; s <= 3; s++) {
        const carom_scene_t m = scene_of(CLIENT, s, 1);
        bench_do(b, pack_scene(&m));
    }
    bench_clear(b);
    b->tick = 1e-3; /* a step takes 1 ms on the bench's clock, a slice 5 ms */
    for (int s = 1; s <= 2; s++) {
        const carom_step_request_t m = steps_of(CLIENT, s, 2, 0, 40, 1);
        bench_receive(b, pack_step(&m));
    }
    assert_true(bench_slice(b));
    assert_true(bench_slice(b));
    const carom_step_request_t third = steps_of(CLIENT, 3, 2, 0, 1, 1);
    bench_receive(b, pack_step(&third));
    int turns = 2;
    while (bench_count(b, CRM_WIRE_REPLY) == 0) {
        assert_true(bench_slice(b));
        turns++;
    }
    assert_int_equal(bench_reply(b).session, 3);
    assert_int_equal(turns, 5);
    while (bench_slice(b)) turns++;
    assert_true(turns >= 16); /* 80 steps, at most 5 or 6 in a slice */
    int longest = 0, run = 0, last = 0;
    for (int i = 0; i < b->n; i++) {
        crm_wire_header h;
        if (b->out[i].type != CRM_WIRE_STATE) continue;
        assert_true(
            crm_wire_read_header(CRM_WIRE_STATE, b->out[i].data, (size_t)b->out[i].size, &h));
        run = h.session == last ? run + 1 : 1;
        last = h.session;
        if (run > longest) longest = run;
    }
    assert_true(longest <= 6);
    bench_destroy(b);
}

/* A thousand sessions of one client, each with its own steps. */
static void a_thousand_sessions(void **state)
{
    (void)state;
    bench *b = bench_create(NULL);
    for (int s = 1; s <= 1000; s++) {
        const carom_scene_t m = scene_of(CLIENT, s, 1);
        bench_do(b, pack_scene(&m));
    }
    assert_int_equal(crm_server_n_sessions(b->server), 1000);
    for (int s = 1; s <= 1000; s++) {
        const carom_step_request_t m = steps_of(CLIENT, s, 2, 0, 1 + s % 3, 0);
        bench_receive(b, pack_step(&m));
    }
    bench_clear(b);
    while (bench_slice(b)) {
    }
    assert_int_equal(bench_count(b, CRM_WIRE_STATE), 1000);
    for (int k = 0; k < 1000; k++) {
        carom_state_t *m = bench_state(b, k);
        assert_int_equal(m->session, k + 1); /* in the order of asking */
        assert_int_equal(m->step, 1 + m->session % 3);
        carom_state_t_destroy(m);
    }
    bench_destroy(b);
}

/* --- gradients */

static void gradient_is_that_of_the_library(void **state)
{
    enum { STEPS = 60, COORD = 4, N = 4 };
    (void)state;
    bench *b = with_scene();
    const int wanted = CAROM_PARAMETER_GRADIENT_T_Q0 | CAROM_PARAMETER_GRADIENT_T_MASS |
                       CAROM_PARAMETER_GRADIENT_T_FRICTION |
                       CAROM_PARAMETER_GRADIENT_T_FORCE_STEPS | CAROM_PARAMETER_GRADIENT_T_ANCHORS |
                       CAROM_PARAMETER_GRADIENT_T_DT;
    do_recorded(b, 2, 0, STEPS);
    assert_int_equal(bench_reply(b).recorded_steps, STEPS);
    const carom_loss_gradient_t loss = loss_of(CLIENT, SESSION, 3, STEPS, COORD, wanted);
    bench_do(b, pack_loss(&loss));
    expect(b, CAROM_REPLY_T_OK, 3, 4, "");
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

static void tapes_follow_the_requests(void **state)
{
    (void)state;
    bench *b = with_scene();
    const carom_loss_gradient_t early = loss_of(CLIENT, SESSION, 2, 1, 4, 1);
    bench_do(b, pack_loss(&early));
    expect(b, CAROM_REPLY_T_REFUSED, 2, 3, "nothing is recorded");
    do_steps(b, 3, 0, 5, 0);
    do_recorded(b, 4, 5, 5);
    do_recorded(b, 5, 10, 5);
    assert_int_equal(bench_reply(b).first_step, 5);
    assert_int_equal(bench_reply(b).recorded_steps, 10);
    const carom_loss_gradient_t before = loss_of(CLIENT, SESSION, 6, 4, 4, 1);
    bench_do(b, pack_loss(&before));
    expect(b, CAROM_REPLY_T_REFUSED, 6, 7, "steps 5 to 15 are recorded");
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
    bench *b = with_scene();
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
    expect(b, CAROM_REPLY_T_OK, 3, 4, "");
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

/* A descended session steps like one that was opened with the new scene; kept, it goes on from its
 * state with the new parameters. */
static void descended_sessions_step_on(void **state)
{
    double friction[] = {0, 1, 0, 0};
    (void)state;
    for (int keep = 0; keep < 2; keep++) {
        bench *b = with_scene();
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
        expect(b, CAROM_REPLY_T_OK, 4, 5, "");
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
    bench *b = with_scene();
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
    bench *b = with_scene();
    const int w = CAROM_PARAMETER_GRADIENT_T_MASS;
    carom_parameter_gradient_t d = descent_of(2, w, 0);
    bench_do(b, pack_descent(&d));
    expect(b, CAROM_REPLY_T_REFUSED, 2, 3, "rate");
    d = descent_of(3, w, 1);
    bench_do(b, pack_descent(&d));
    expect(b, CAROM_REPLY_T_REFUSED, 3, 4, "num_mass = 0: this scene has 4");
    d = descent_of(4, w, 1);
    d.num_mass = 4;
    d.mass = mass;
    bench_do(b, pack_descent(&d));
    expect(b, CAROM_REPLY_T_REFUSED, 4, 5, "mass[3] is not finite");
    d = descent_of(5, CAROM_PARAMETER_GRADIENT_T_FORCE_STEPS, 1);
    bench_do(b, pack_descent(&d));
    expect(b, CAROM_REPLY_T_REFUSED, 5, 6, "force_steps");
    d = descent_of(6, 1 << 20, 1);
    bench_do(b, pack_descent(&d));
    expect(b, CAROM_REPLY_T_REFUSED, 6, 7, "the bits 1048576 name no parameter");
    d = descent_of(7, CAROM_PARAMETER_GRADIENT_T_Q0, 1);
    d.num_q0 = 12;
    d.q0 = vertices;
    d.first_step = 3;
    bench_do(b, pack_descent(&d));
    expect(b, CAROM_REPLY_T_REFUSED, 7, 8, "step 3");
    /* A floor turned inside out is no hull: the scene stays as it was. */
    vertices[0] = -30;
    vertices[2] = 30;
    d = descent_of(8, CAROM_PARAMETER_GRADIENT_T_VERTICES, 1);
    d.num_vertices = 16;
    d.vertices = vertices;
    bench_do(b, pack_descent(&d));
    expect(b, CAROM_REPLY_T_REFUSED, 8, 9, "vertex");
    assert_int_equal(bench_count(b, CRM_WIRE_SCENE_UPDATED), 0);
    do_steps(b, 9, 0, 3, 0);
    expect(b, CAROM_REPLY_T_OK, 9, 10, "");
    bench_destroy(b);
}

/* --- session requests */

static void snapshots_and_reset(void **state)
{
    (void)state;
    bench *b = with_scene();
    do_steps(b, 2, 0, 20, 0);
    do_action(b, 3, CAROM_SESSION_REQUEST_T_SNAPSHOT, 5);
    carom_state_t *at_20 = bench_state(b, 0);
    bench_clear(b);
    do_steps(b, 4, 20, 30, 0);
    do_action(b, 5, CAROM_SESSION_REQUEST_T_RESTORE, 5);
    expect(b, CAROM_REPLY_T_OK, 5, 6, "");
    assert_int_equal(bench_reply(b).step, 20);
    do_steps(b, 6, 20, 0, 0);
    carom_state_t *again = bench_state(b, 1);
    assert_memory_equal(again->q, at_20->q, 12 * sizeof(double));
    assert_memory_equal(again->v, at_20->v, 12 * sizeof(double));
    assert_int_equal(again->step, 20);
    carom_state_t_destroy(again);
    do_action(b, 7, CAROM_SESSION_REQUEST_T_RESTORE, 4);
    expect(b, CAROM_REPLY_T_REFUSED, 7, 8, "no snapshot 4");
    do_action(b, 8, CAROM_SESSION_REQUEST_T_SNAPSHOT, 0);
    expect(b, CAROM_REPLY_T_REFUSED, 8, 9, "start at 1");
    bench_clear(b);
    /* Started again, the first 20 steps give the same bits. */
    do_action(b, 9, CAROM_SESSION_REQUEST_T_RESET, 0);
    assert_int_equal(bench_reply(b).step, 0);
    do_steps(b, 10, 0, 20, 0);
    again = bench_state(b, 0);
    assert_memory_equal(again->q, at_20->q, 12 * sizeof(double));
    carom_state_t_destroy(again);
    carom_state_t_destroy(at_20);
    bench_destroy(b);
}

static void snapshots_are_counted(void **state)
{
    (void)state;
    bench *b = with_scene();
    for (int k = 1; k <= 16; k++) do_action(b, 1 + k, CAROM_SESSION_REQUEST_T_SNAPSHOT, 10 * k);
    expect(b, CAROM_REPLY_T_OK, 17, 18, "");
    do_action(b, 18, CAROM_SESSION_REQUEST_T_SNAPSHOT, 1000);
    expect(b, CAROM_REPLY_T_REFUSED, 18, 19, "holds 16");
    do_action(b, 19, CAROM_SESSION_REQUEST_T_SNAPSHOT, 160);
    expect(b, CAROM_REPLY_T_OK, 19, 20, "");
    bench_destroy(b);
}

static void open_keep_alive_close(void **state)
{
    (void)state;
    bench *b = bench_create(NULL);
    do_action(b, 0, CAROM_SESSION_REQUEST_T_KEEP_ALIVE, 0);
    expect(b, CAROM_REPLY_T_NO_SESSION, 0, 1, "");
    do_action(b, 1, CAROM_SESSION_REQUEST_T_OPEN, 0);
    expect(b, CAROM_REPLY_T_OK, 1, 2, "");
    do_steps(b, 2, 0, 1, 1);
    expect(b, CAROM_REPLY_T_REFUSED, 2, 3, "no scene");
    do_scene(b, 3);
    do_action(b, 0, CAROM_SESSION_REQUEST_T_KEEP_ALIVE, 0);
    expect(b, CAROM_REPLY_T_OK, 0, 4, "");
    do_action(b, 4, 77, 0);
    expect(b, CAROM_REPLY_T_REFUSED, 4, 5, "session_action = 77");
    do_action(b, 5, CAROM_SESSION_REQUEST_T_CLOSE, 0);
    expect(b, CAROM_REPLY_T_OK, 5, 6, "");
    assert_int_equal(crm_server_n_sessions(b->server), 0);
    do_action(b, 5, CAROM_SESSION_REQUEST_T_CLOSE, 0);
    expect(b, CAROM_REPLY_T_NO_SESSION, 5, 1, "");
    bench_destroy(b);
}

static void leases_end(void **state)
{
    static const struct {
        double lease, silence;
        int lives;
    } cases[] = {{-1, 29, 1}, {-1, 31, 0}, {5, 4, 1}, {5, 6, 0}, {0, 1e6, 1}};
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        bench *b = bench_create(NULL);
        carom_session_request_t m = action_of(CLIENT, SESSION, 1, CAROM_SESSION_REQUEST_T_OPEN);
        m.lease = cases[i].lease;
        bench_do(b, pack_action(&m));
        b->time += 3;
        do_action(b, 0, CAROM_SESSION_REQUEST_T_KEEP_ALIVE, 0);
        b->time += cases[i].silence;
        crm_server_tick(b->server);
        assert_int_equal(crm_server_n_sessions(b->server), cases[i].lives);
        bench_destroy(b);
    }
}

/* --- scenes */

typedef struct bad_scene {
    const char *says;
    void (*spoil)(carom_scene_t *m);
} bad_scene;

static int8_t bad_types[] = {1, 0, 3, 0};
static int32_t bad_owner[] = {0, 1, 4, 3}, bad_order[] = {0, 2, 1, 3}, bad_count[] = {4, 1, 1, 3};
static int32_t none[] = {4, 0, 2, 2}, same_body[] = {3};
static int8_t bad_joint[] = {9};
static double bad_mass[] = {1, -2, 3, 1};
static char *bad_names[] = {(char *)"no_such_setting"};

static void spoil_type(carom_scene_t *m)
{
    m->body_type = bad_types;
}

static void spoil_owner(carom_scene_t *m)
{
    m->shape_body = bad_owner;
}

static void spoil_order(carom_scene_t *m)
{
    m->shape_body = bad_order;
}

static void spoil_count(carom_scene_t *m)
{
    m->shape_num_vertices = bad_count;
}

static void spoil_vertices(carom_scene_t *m)
{
    m->shape_num_vertices = none;
}

static void spoil_joint(carom_scene_t *m)
{
    m->joint_type = bad_joint;
}

static void spoil_bodies(carom_scene_t *m)
{
    m->joint_body_a = same_body;
}

static void spoil_mass(carom_scene_t *m)
{
    m->mass = bad_mass;
}

static void spoil_setting(carom_scene_t *m)
{
    m->setting_name = bad_names;
}

static const bad_scene bad_scenes[] = {
    {"body_type[2] = 3", spoil_type},
    {"shape_body[2] = 4", spoil_owner},
    {"must not decrease", spoil_order},
    {"the shapes have 9 vertices", spoil_count},
    {"shape_num_vertices[1] = 0", spoil_vertices},
    {"joint_type[0] = 9", spoil_joint},
    {"joint 0 between bodies 3 and 3", spoil_bodies},
    {"'left'", spoil_mass},
    {"'no_such_setting'", spoil_setting},
};

/* The session survives a bad scene and takes a good one. */
static void bad_scenes_are_refused(void **state)
{
    (void)state;
    bench *b = bench_create(NULL);
    int64_t seq = 1;
    for (size_t i = 0; i < sizeof bad_scenes / sizeof bad_scenes[0]; i++, seq++) {
        carom_scene_t m = scene_of(CLIENT, SESSION, seq);
        bad_scenes[i].spoil(&m);
        bench_do(b, pack_scene(&m));
        expect(b, CAROM_REPLY_T_REFUSED, seq, seq + 1, bad_scenes[i].says);
    }
    do_scene(b, seq);
    expect(b, CAROM_REPLY_T_OK, seq, seq + 1, "");
    bench_destroy(b);
}

static carom_scene_chunk_t chunk_of(const bytes *scene, int64_t seq, int stride, int index)
{
    carom_scene_chunk_t m = {0};
    const int rest = scene->size - index * stride;
    m.client_id = CLIENT;
    m.session = SESSION;
    m.seq = seq;
    m.scene_bytes = scene->size;
    m.chunk_stride = stride;
    m.chunk_index = index;
    m.chunk_offset = index * stride;
    m.num_bytes = rest < stride ? rest : stride;
    m.chunk_data = scene->data + m.chunk_offset;
    return m;
}

static void scenes_in_pieces(void **state)
{
    (void)state;
    bench *b = bench_create(NULL);
    bytes scene = pack_row(CLIENT, SESSION, 1, 700);
    const int stride = 10000, n = (scene.size - 1) / stride + 1;
    assert_true(n > 8);
    /* Backwards, the middle one twice. */
    for (int k = n - 1; k >= 0; k--) {
        const carom_scene_chunk_t m = chunk_of(&scene, 1, stride, k);
        bench_do(b, pack_chunk(&m));
        if (k == n / 2) bench_do(b, pack_chunk(&m));
        if (k > 0) {
            expect(b, CAROM_REPLY_T_CHUNK, 1, 1, "");
            assert_int_equal(bench_reply(b).chunk_index, k);
        }
    }
    expect(b, CAROM_REPLY_T_OK, 1, 2, "");
    /* A piece that comes again is answered as the scene. */
    const carom_scene_chunk_t again = chunk_of(&scene, 1, stride, 3);
    bench_do(b, pack_chunk(&again));
    expect(b, CAROM_REPLY_T_OK, 1, 2, "");
    do_steps(b, 2, 0, 1, 1);
    carom_state_t *s = bench_state(b, 0);
    assert_int_equal(s->num_bodies, 700);
    carom_state_t_destroy(s);
    free(scene.data);
    bench_destroy(b);
}

static void bad_pieces_are_refused(void **state)
{
    (void)state;
    bench *b = bench_create(NULL);
    bytes scene = pack_row(CLIENT, SESSION, 2, 10);
    carom_scene_chunk_t m = chunk_of(&scene, 1, 100, 1);
    m.chunk_offset = 99;
    bench_do(b, pack_chunk(&m));
    expect(b, CAROM_REPLY_T_MALFORMED, 1, 1, "chunk_offset = 99");
    m = chunk_of(&scene, 1, 100, 1);
    m.num_bytes = 99;
    bench_do(b, pack_chunk(&m));
    expect(b, CAROM_REPLY_T_MALFORMED, 1, 1, "must be 100");
    m = chunk_of(&scene, 1, 100, 0);
    m.scene_bytes = (4 << 20) + 1;
    bench_do(b, pack_chunk(&m));
    expect(b, CAROM_REPLY_T_MALFORMED, 1, 1, "--max-message");
    m = chunk_of(&scene, 1, 100, 0);
    m.chunk_stride = 0;
    bench_do(b, pack_chunk(&m));
    expect(b, CAROM_REPLY_T_MALFORMED, 1, 1, "chunk_stride = 0");
    m = chunk_of(&scene, 1, 100, 0);
    m.chunk_index = -1;
    bench_do(b, pack_chunk(&m));
    expect(b, CAROM_REPLY_T_MALFORMED, 1, 1, "chunk_index = -1");
    /* Whole, but it is the scene of another seq. */
    m = chunk_of(&scene, 1, scene.size, 0);
    bench_do(b, pack_chunk(&m));
    expect(b, CAROM_REPLY_T_MALFORMED, 1, 1, "do not make a scene_t");
    free(scene.data);
    bench_destroy(b);
}

/* --- limits */

static void limits_are_named(void **state)
{
    (void)state;
    crm_server_settings set = crm_server_defaults();
    set.max_sessions = 1;
    set.max_steps = 50;
    set.max_answer = 1;
    set.session_memory = 3;
    bench *b = bench_create(&set);
    do_scene(b, 1);
    const carom_scene_t second = scene_of(CLIENT, 2, 1);
    bench_do(b, pack_scene(&second));
    expect(b, CAROM_REPLY_T_LIMIT, 1, 1, "--max-sessions");
    do_steps(b, 2, 0, 51, 1);
    expect(b, CAROM_REPLY_T_REFUSED, 2, 3, "--max-steps");
    bytes row = pack_row(CLIENT, SESSION, 3, 500);
    bench_do(b, row);
    expect(b, CAROM_REPLY_T_OK, 3, 4, "");
    bench_clear(b);
    /* 500 bodies: 24 KB a state, so that 1 MB ends after 43 or fewer. */
    do_steps(b, 4, 0, 50, 1);
    expect(b, CAROM_REPLY_T_FAILED, 4, 5, "--max-answer");
    const carom_reply_t r = bench_reply(b);
    assert_in_range(r.num_states, 40, 43);
    assert_int_equal(bench_count(b, CRM_WIRE_STATE), r.num_states);
    assert_int_equal(r.step, r.num_states + 1);
    do_steps(b, 5, r.step, 1, 0);
    expect(b, CAROM_REPLY_T_OK, 5, 6, "");
    crm_server_refuse_size(b->server, CRM_WIRE_STEP, NULL, 0, 1 << 30);
    const char *why = NULL;
    assert_int_equal(crm_server_malformed(b->server, &why), 1);
    assert_non_null(strstr(why, "1073741824 bytes are more than 4194304 (--max-message)"));
    bench_destroy(b);
}

/* A tape that outgrows the session ends the request with the limit's name; the session goes on. */
static void memory_is_limited(void **state)
{
    (void)state;
    crm_server_settings set = crm_server_defaults();
    set.session_memory = 1;
    bench *b = bench_create(&set);
    do_scene(b, 1);
    do_recorded(b, 2, 0, 20000);
    expect(b, CAROM_REPLY_T_FAILED, 2, 3, "--session-memory");
    const int64_t step = bench_reply(b).step;
    assert_true(step > 0 && step < 20000);
    do_steps(b, 3, step, 10, 0);
    expect(b, CAROM_REPLY_T_OK, 3, 4, "");
    assert_int_equal(bench_reply(b).recorded_steps, 0);
    bench_destroy(b);
}

static void status_counts(void **state)
{
    (void)state;
    bench *b = with_scene();
    b->time = 2;
    do_steps(b, 2, 0, 7, 0);
    const carom_step_request_t m = steps_of(CLIENT, SESSION, 3, 7, 1, 1);
    bench_receive(b, pack_step(&m));
    bytes junk = pack_sample(CRM_WIRE_STEP);
    junk.size -= 5;
    bench_receive(b, junk);
    bench_clear(b);
    const crm_transport_figures figures = {4, 11};
    crm_server_status(b->server, figures);
    carom_status_t s;
    assert_int_equal(carom_status_t_decode(b->out[0].data, 0, b->out[0].size, &s), b->out[0].size);
    assert_int_equal(s.num_sessions, 1);
    assert_int_equal(s.queue_depth, 1);
    assert_int_equal(s.steps_total, 7);
    assert_int_equal(s.malformed, 1);
    assert_int_equal(s.num_clients, 4);
    assert_int_equal(s.states_dropped, 11);
    assert_int_equal(s.max_message, 4 << 20);
    assert_int_equal(s.boot_id, 99);
    assert_near(s.uptime, 2, 0);
    carom_status_t_decode_cleanup(&s);
    bench_destroy(b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(states_are_those_of_the_library),
        cmocka_unit_test(publishes_what_was_asked_for),
        cmocka_unit_test(contacts_on_request),
        cmocka_unit_test(forces_act_in_their_steps),
        cmocka_unit_test(bad_forces_are_refused),
        cmocka_unit_test(repeated_requests_come_from_the_cache),
        cmocka_unit_test(only_the_missing_states_come_again),
        cmocka_unit_test(gaps_mismatches_and_strangers),
        cmocka_unit_test(pending_busy_and_forgotten),
        cmocka_unit_test(sessions_take_turns),
        cmocka_unit_test(a_thousand_sessions),
        cmocka_unit_test(gradient_is_that_of_the_library),
        cmocka_unit_test(tapes_follow_the_requests),
        cmocka_unit_test(descent_changes_the_scene),
        cmocka_unit_test(descended_sessions_step_on),
        cmocka_unit_test(anchors_descend_along_the_chain_rule),
        cmocka_unit_test(bad_descents_are_refused),
        cmocka_unit_test(snapshots_and_reset),
        cmocka_unit_test(snapshots_are_counted),
        cmocka_unit_test(open_keep_alive_close),
        cmocka_unit_test(leases_end),
        cmocka_unit_test(bad_scenes_are_refused),
        cmocka_unit_test(scenes_in_pieces),
        cmocka_unit_test(bad_pieces_are_refused),
        cmocka_unit_test(limits_are_named),
        cmocka_unit_test(memory_is_limited),
        cmocka_unit_test(status_counts),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
