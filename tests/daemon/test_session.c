/* test_session.c: sessions as a function of bytes: what is executed, once, and what is answered. */
#include "near.h"

#include "direct.h"
#include "requests.h"

#include <stdlib.h>
#include <string.h>

/* --- steps */

/* The published states are those of the library on the same scene, bit for bit. */
static void states_are_those_of_the_library(void **state)
{
    (void)state;
    bench *b = do_open();
    const carom_scene_t scene = scene_of(CLIENT, SESSION, 1);
    carom_world *w = direct_world(&scene);
    do_steps(b, 2, 0, 100, 1);
    expect_reply(b, CAROM_REPLY_T_OK, 2, 3, "");
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
        bench *b = do_open();
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
    bench *b = do_open();
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
    bench *b = do_open();
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
    bench *b = do_open();
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
        expect_reply(b, CAROM_REPLY_T_REFUSED, seq, seq + 1, cases[i].says);
        assert_int_equal(bench_reply(b).step, 0);
    }
    bench_destroy(b);
}

/* --- once, whatever arrives how often */

static void repeated_requests_come_from_the_cache(void **state)
{
    (void)state;
    bench *b = do_open();
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
    bench *b = do_open();
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
    expect_reply(b, CAROM_REPLY_T_OK, 2, 3, "");
    bench_destroy(b);
}

static void gaps_mismatches_and_strangers(void **state)
{
    (void)state;
    bench *b = bench_create(NULL);
    do_steps(b, 2, 0, 1, 1);
    expect_reply(b, CAROM_REPLY_T_NO_SESSION, 2, 1, "unknown");
    do_steps(b, 1, 0, 1, 1);
    expect_reply(b, CAROM_REPLY_T_NO_SESSION, 1, 1, "unknown");
    do_scene(b, 1);
    do_steps(b, 3, 0, 1, 1);
    expect_reply(b, CAROM_REPLY_T_GAP, 3, 2, "");
    do_steps(b, 2, 1, 1, 1);
    expect_reply(b, CAROM_REPLY_T_MISMATCH, 2, 3, "at step 0, not 1");
    do_steps(b, 3, 0, 1, 1);
    expect_reply(b, CAROM_REPLY_T_OK, 3, 4, "");
    assert_int_equal(bench_reply(b).step, 1);
    do_steps(b, 0, 1, 1, 1);
    expect_reply(b, CAROM_REPLY_T_MALFORMED, 0, 4, "seq");
    bench_destroy(b);
}

static void pending_busy_and_forgotten(void **state)
{
    (void)state;
    bench *b = do_open();
    for (int k = 0; k < 8; k++) {
        const carom_step_request_t m = steps_of(CLIENT, SESSION, 2 + k, k, 1, 1);
        bench_receive(b, pack_step(&m));
    }
    const int before = bench_count(b, CRM_WIRE_REPLY);
    const carom_step_request_t again = steps_of(CLIENT, SESSION, 5, 3, 1, 1);
    bench_receive(b, pack_step(&again));
    expect_reply(b, CAROM_REPLY_T_PENDING, 5, 10, "");
    const carom_step_request_t ninth = steps_of(CLIENT, SESSION, 10, 8, 1, 1);
    bench_receive(b, pack_step(&ninth));
    expect_reply(b, CAROM_REPLY_T_BUSY, 10, 10, "queue");
    assert_int_equal(bench_count(b, CRM_WIRE_REPLY), before + 2);
    while (bench_slice(b)) {
    }
    expect_reply(b, CAROM_REPLY_T_OK, 9, 10, "");
    assert_int_equal(bench_reply(b).step, 8);
    assert_int_equal(bench_reply(b).window, 8);
    do_steps(b, 1, 0, 1, 1);
    expect_reply(b, CAROM_REPLY_T_FORGOTTEN, 1, 10, "");
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

/* --- session requests */

static void snapshots_and_reset(void **state)
{
    (void)state;
    bench *b = do_open();
    do_steps(b, 2, 0, 20, 0);
    do_action(b, 3, CAROM_SESSION_REQUEST_T_SNAPSHOT, 5);
    carom_state_t *at_20 = bench_state(b, 0);
    bench_clear(b);
    do_steps(b, 4, 20, 30, 0);
    do_action(b, 5, CAROM_SESSION_REQUEST_T_RESTORE, 5);
    expect_reply(b, CAROM_REPLY_T_OK, 5, 6, "");
    assert_int_equal(bench_reply(b).step, 20);
    do_steps(b, 6, 20, 0, 0);
    carom_state_t *again = bench_state(b, 1);
    assert_memory_equal(again->q, at_20->q, 12 * sizeof(double));
    assert_memory_equal(again->v, at_20->v, 12 * sizeof(double));
    assert_int_equal(again->step, 20);
    carom_state_t_destroy(again);
    do_action(b, 7, CAROM_SESSION_REQUEST_T_RESTORE, 4);
    expect_reply(b, CAROM_REPLY_T_REFUSED, 7, 8, "no snapshot 4");
    do_action(b, 8, CAROM_SESSION_REQUEST_T_SNAPSHOT, 0);
    expect_reply(b, CAROM_REPLY_T_REFUSED, 8, 9, "start at 1");
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
    bench *b = do_open();
    for (int k = 1; k <= 16; k++) do_action(b, 1 + k, CAROM_SESSION_REQUEST_T_SNAPSHOT, 10 * k);
    expect_reply(b, CAROM_REPLY_T_OK, 17, 18, "");
    do_action(b, 18, CAROM_SESSION_REQUEST_T_SNAPSHOT, 1000);
    expect_reply(b, CAROM_REPLY_T_REFUSED, 18, 19, "holds 16");
    do_action(b, 19, CAROM_SESSION_REQUEST_T_SNAPSHOT, 160);
    expect_reply(b, CAROM_REPLY_T_OK, 19, 20, "");
    bench_destroy(b);
}

static void open_keep_alive_close(void **state)
{
    (void)state;
    bench *b = bench_create(NULL);
    do_action(b, 0, CAROM_SESSION_REQUEST_T_KEEP_ALIVE, 0);
    expect_reply(b, CAROM_REPLY_T_NO_SESSION, 0, 1, "");
    do_action(b, 1, CAROM_SESSION_REQUEST_T_OPEN, 0);
    expect_reply(b, CAROM_REPLY_T_OK, 1, 2, "");
    do_steps(b, 2, 0, 1, 1);
    expect_reply(b, CAROM_REPLY_T_REFUSED, 2, 3, "no scene");
    do_scene(b, 3);
    do_action(b, 0, CAROM_SESSION_REQUEST_T_KEEP_ALIVE, 0);
    expect_reply(b, CAROM_REPLY_T_OK, 0, 4, "");
    do_action(b, 4, 77, 0);
    expect_reply(b, CAROM_REPLY_T_REFUSED, 4, 5, "session_action = 77");
    do_action(b, 5, CAROM_SESSION_REQUEST_T_CLOSE, 0);
    expect_reply(b, CAROM_REPLY_T_OK, 5, 6, "");
    assert_int_equal(crm_server_n_sessions(b->server), 0);
    do_action(b, 5, CAROM_SESSION_REQUEST_T_CLOSE, 0);
    expect_reply(b, CAROM_REPLY_T_NO_SESSION, 5, 1, "");
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
    expect_reply(b, CAROM_REPLY_T_LIMIT, 1, 1, "--max-sessions");
    do_steps(b, 2, 0, 51, 1);
    expect_reply(b, CAROM_REPLY_T_REFUSED, 2, 3, "--max-steps");
    bytes row = pack_row(CLIENT, SESSION, 3, 500);
    bench_do(b, row);
    expect_reply(b, CAROM_REPLY_T_OK, 3, 4, "");
    bench_clear(b);
    /* 500 bodies: 24 KB a state, so that 1 MB ends after 43 or fewer. */
    do_steps(b, 4, 0, 50, 1);
    expect_reply(b, CAROM_REPLY_T_FAILED, 4, 5, "--max-answer");
    const carom_reply_t r = bench_reply(b);
    assert_in_range(r.num_states, 40, 43);
    assert_int_equal(bench_count(b, CRM_WIRE_STATE), r.num_states);
    assert_int_equal(r.step, r.num_states + 1);
    do_steps(b, 5, r.step, 1, 0);
    expect_reply(b, CAROM_REPLY_T_OK, 5, 6, "");
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
    expect_reply(b, CAROM_REPLY_T_FAILED, 2, 3, "--session-memory");
    const int64_t step = bench_reply(b).step;
    assert_true(step > 0 && step < 20000);
    do_steps(b, 3, step, 10, 0);
    expect_reply(b, CAROM_REPLY_T_OK, 3, 4, "");
    assert_int_equal(bench_reply(b).recorded_steps, 0);
    bench_destroy(b);
}

static void status_counts(void **state)
{
    (void)state;
    bench *b = do_open();
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
        cmocka_unit_test(snapshots_and_reset),
        cmocka_unit_test(snapshots_are_counted),
        cmocka_unit_test(open_keep_alive_close),
        cmocka_unit_test(leases_end),
        cmocka_unit_test(limits_are_named),
        cmocka_unit_test(memory_is_limited),
        cmocka_unit_test(status_counts),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
