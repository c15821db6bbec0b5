/* test_process.c: caromd as its users meet it: a program on loopback TCP. */
#include "near.h"

#include "client_case.h"
#include "messages.h"
#include "process.h"
#include "socket_peer.h"

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static carom_client *connected(const char *url, const char *name)
{
    carom_client *c = carom_client_create();
    const carom_client_code code = carom_client_connect(c, url, name);
    if (code < 0) fail_msg("%s", carom_client_error(c));
    return c;
}

static int port_of(const char *url)
{
    return (int)strtol(strrchr(url, ':') + 1, NULL, 10);
}

/* --- a session */

static void trajectory(void **state)
{
    static double direct[CASE_STEPS][3 * CASE_BODIES], through[CASE_STEPS][3 * CASE_BODIES];
    char url[64];
    (void)state;
    process p = caromd_start(NULL, url);
    carom_client *c = connected(url, NULL);
    case_direct(direct);
    for (int per_request = 1; per_request <= CASE_STEPS; per_request += CASE_STEPS - 1) {
        memset(through, 0, sizeof through);
        const carom_client_code code = case_through(c, per_request, through);
        if (code < 0) fail_msg("%s", carom_client_error(c));
        assert_memory_equal(direct, through, sizeof direct);
    }
    case_gradient(c);
    case_session(c);
    case_large(c);
    assert_int_equal(carom_client_last(c).resent, 0); /* nothing is lost on the way */
    carom_client_destroy(c);
    caromd_stop(&p);
}

static void names_keep_daemons_apart(void **state)
{
    const char *const more[] = {"--name", "lab1", NULL};
    char url[64];
    (void)state;
    process p = caromd_start(more, url);
    carom_client *c = connected(url, "lab1");
    case_session(c);
    carom_client_destroy(c);
    caromd_stop(&p);
}

/* One step a request, one request after the other: the time a message takes there and back. */
static void round_trip(void **state)
{
    enum { TRIPS = 2000 };
    char url[64];
    carom_client_run run;
    (void)state;
    process p = caromd_start(NULL, url);
    carom_client *c = connected(url, NULL);
    const carom_client_scene s = case_scene();
    memset(&run, 0, sizeof run);
    run.n_steps = 1;
    assert_int_equal(carom_client_open(c, &s), CAROM_CLIENT_OK);
    double computing = 0;
    const double start = now();
    for (int k = 0; k < TRIPS; k++) {
        if (carom_client_step(c, &run) < 0) fail_msg("%s", carom_client_error(c));
        computing += carom_client_last(c).seconds;
    }
    const double trip = (now() - start) / TRIPS;
    print_message("%.0f us per request of one step, %.0f us of them for the step\n", 1e6 * trip,
                  1e6 * computing / TRIPS);
    /* Without NODELAY and QUICKACK a message costs 40 ms; slow machines and sanitizers get ten. */
    assert_true(trip < 10e-3);
    carom_client_destroy(c);
    caromd_stop(&p);
}

/* A request of many steps does not hold up another session. */
static void long_requests_leave_others_alone(void **state)
{
    const char *const more[] = {"--workers", "1", NULL};
    char url[64];
    carom_client_run run;
    (void)state;
    process p = caromd_start(more, url);
    carom_client *c = connected(url, NULL);
    const int raw = peer_connect(port_of(url), 1);
    const carom_scene_t scene = scene_of(5, 1, 1);
    const carom_step_request_t steps = steps_of(5, 1, 2, 0, 1000000, 0);
    bytes m = pack_scene(&scene);
    peer_frame(raw, 1, "CAROM_SCENE", m.data, (size_t)m.size);
    free(m.data);
    m = pack_step(&steps);
    peer_frame(raw, 1, "CAROM_STEP", m.data, (size_t)m.size);
    free(m.data);
    const carom_client_scene s = case_scene();
    memset(&run, 0, sizeof run);
    run.n_steps = 1;
    assert_int_equal(carom_client_open(c, &s), CAROM_CLIENT_OK);
    double longest = 0;
    for (int k = 0; k < 50; k++) {
        const double start = now();
        if (carom_client_step(c, &run) < 0) fail_msg("%s", carom_client_error(c));
        longest = fmax(longest, now() - start);
    }
    /* A slice is 5 ms; the rest is for a loaded machine. */
    assert_true(longest < 0.5);
    /* The long request is still at work. */
    char channel[64];
    carom_reply_t r;
    unsigned char data[1024];
    peer_frame(raw, 2, "CAROM_REPLY", NULL, 0);
    const carom_session_request_t alive = action_of(5, 1, 0, CAROM_SESSION_REQUEST_T_KEEP_ALIVE);
    m = pack_action(&alive);
    peer_frame(raw, 1, "CAROM_SESSION", m.data, (size_t)m.size);
    free(m.data);
    const long size = peer_read(raw, 5, channel, data, sizeof data);
    assert_true(size > 0 && carom_reply_t_decode(data, 0, (int)size, &r) == size);
    assert_true(r.step > 0 && r.step < 1000000);
    carom_reply_t_decode_cleanup(&r);
    close(raw);
    carom_client_destroy(c);
    /* It also ends at once. */
    const double start = now();
    caromd_stop(&p);
    assert_true(now() - start < 5);
}

/* --- status */

static void status_comes_twice_a_second(void **state)
{
    char url[64], channel[64];
    unsigned char data[1024];
    carom_status_t s;
    (void)state;
    process p = caromd_start(NULL, url);
    const int raw = peer_connect(port_of(url), 1);
    peer_frame(raw, 2, "CAROM_STATUS", NULL, 0);
    double last = 0;
    for (int k = 0; k < 3; k++) {
        const long size = peer_read(raw, 2, channel, data, sizeof data);
        assert_true(size > 0 && carom_status_t_decode(data, 0, (int)size, &s) == size);
        assert_string_equal(s.url, url);
        if (k > 0) assert_int_equal(s.num_clients, 1); /* the first may be older than this client */
        const double t = now();
        if (last > 0) assert_near(t - last, 0.5, 0.3); /* a loaded machine may be late */
        last = t;
        carom_status_t_decode_cleanup(&s);
    }
    close(raw);
    caromd_stop(&p);
}

/* --- ends */

static void clients_notice_the_end(void **state)
{
    char url[64], out[64], err[1024];
    carom_client_run run;
    (void)state;
    process p = caromd_start(NULL, url);
    carom_client *c = connected(url, NULL);
    const carom_client_scene s = case_scene();
    memset(&run, 0, sizeof run);
    run.n_steps = 1;
    assert_int_equal(carom_client_open(c, &s), CAROM_CLIENT_OK);
    kill(p.pid, SIGKILL);
    assert_int_equal(process_wait(&p, 5, out, sizeof out, err, sizeof err), -SIGKILL);
    assert_int_equal(carom_client_step(c, &run), CAROM_CLIENT_E_NETWORK);
    assert_non_null(strstr(carom_client_error(c), url));
    carom_client_destroy(c);
    c = carom_client_create();
    assert_int_equal(carom_client_connect(c, url, NULL), CAROM_CLIENT_E_NETWORK);
    assert_non_null(strstr(carom_client_error(c), "is caromd running"));
    carom_client_destroy(c);
}

static void restarted_daemons_know_no_session(void **state)
{
    char url[64], out[64], err[1024];
    carom_client_run run;
    (void)state;
    process p = caromd_start(NULL, url);
    carom_client *c = connected(url, NULL);
    const carom_client_scene s = case_scene();
    memset(&run, 0, sizeof run);
    run.n_steps = 1;
    assert_int_equal(carom_client_open(c, &s), CAROM_CLIENT_OK);
    const int64_t boot = carom_client_last(c).boot_id;
    assert_int_equal(carom_client_close(c), CAROM_CLIENT_OK);
    carom_client_destroy(c);
    caromd_stop(&p);
    p = caromd_start(NULL, url);
    c = connected(url, NULL);
    assert_int_equal(carom_client_open(c, &s), CAROM_CLIENT_OK);
    assert_int_not_equal(carom_client_last(c).boot_id, boot);
    carom_client_destroy(c);
    kill(p.pid, SIGINT);
    assert_int_equal(process_wait(&p, 5, out, sizeof out, err, sizeof err), 0);
}

/* --- command line */

static void command_line(void **state)
{
    static const struct {
        const char *arguments[4];
        int status;
        const char *out, *err;
    } cases[] = {
        {{"--help"}, 0, "--max-bodies N", ""},
        {{"--version"}, 0, "caromd ", ""},
        {{"--nonsense", "1"}, 1, "", "unknown option '--nonsense'"},
        {{"nonsense"}, 1, "", "'nonsense' has no value"},
        {{"--hub"}, 1, "", "'--hub' has no value"},
        {{"--hub", "7700"}, 1, "", "not ADDRESS:PORT"},
        {{"--max-bodies", "many"}, 1, "", "whole number"},
        {{"--workers", "0"}, 1, "", "at least 1"},
        {{"--max-message", "10"}, 1, "", "at least 1024"},
        {{"--name", "a b"}, 1, "", "letters, digits"},
        {{"--lcm-url", "udpm://10.0.0.1:7667"}, 1, "", "not a multicast address"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const char *argv[6] = {CAROMD};
        char out[8192], err[2048];
        memcpy(argv + 1, cases[i].arguments, sizeof cases[i].arguments);
        process p = process_start(argv);
        const int status = process_wait(&p, 10, out, sizeof out, err, sizeof err);
        if (status != cases[i].status || !strstr(out, cases[i].out) || !strstr(err, cases[i].err)) {
            fail_msg("%s: %d '%s' '%s'", cases[i].arguments[0], status, out, err);
        }
    }
}

static void ports_are_not_shared(void **state)
{
    char url[64], address[32], out[64], err[1024];
    (void)state;
    process p = caromd_start(NULL, url);
    snprintf(address, sizeof address, "127.0.0.1:%d", port_of(url));
    const char *const argv[] = {CAROMD, "--hub", address, NULL};
    process second = process_start(argv);
    assert_int_equal(process_wait(&second, 10, out, sizeof out, err, sizeof err), 1);
    assert_string_equal(out, "");
    assert_non_null(strstr(err, "another caromd?"));
    caromd_stop(&p);
}

/* --- hostile bytes */

/* Every request type, broken in every way of its bytes' length, and random bytes, on every channel:
 * the daemon serves on, and says what it refused. */
static void hostile_messages(void **state)
{
    char url[64], out[64];
    static char err[1 << 16];
    long sent = 0;
    (void)state;
    process p = caromd_start(NULL, url);
    const int raw = peer_connect(port_of(url), 1);
    for (int t = 0; t < CRM_WIRE_N_REQUESTS; t++) {
        const char *channel = crm_wire_channel((crm_wire_type)t);
        bytes m = pack_sample((crm_wire_type)t);
        for (int n = 0; n < m.size; n += 1 + n / 40) {
            peer_frame(raw, 1, channel, m.data, (size_t)n);
            sent++;
        }
        for (int at = 0; at + 4 <= m.size; at += 2) {
            unsigned char keep[4];
            memcpy(keep, m.data + at, 4);
            memset(m.data + at, at % 4 ? 0x7f : 0xff, 4);
            peer_frame(raw, 1, channel, m.data, (size_t)m.size);
            memcpy(m.data + at, keep, 4);
            sent++;
        }
        free(m.data);
    }
    carom_client *c = connected(url, NULL);
    case_session(c);
    carom_client_destroy(c);
    close(raw);
    kill(p.pid, SIGTERM);
    assert_int_equal(process_wait(&p, 10, out, sizeof out, err, sizeof err), 0);
    assert_non_null(strstr(err, "messages refused"));
    print_message("%ld hostile messages\n", sent);
}

/* --- examples */

/* Runs a program to its end with success; its output. */
static void run_example(const char *const *argv, char *out, int size)
{
    char err[1024];
    process e = process_start(argv);
    const int status = process_wait(&e, 20, out, size, err, sizeof err);
    if (status != 0) fail_msg("%s: %d %s", argv[0], status, err);
}

/* The largest y of lines "t = ... s  y = ... m" with t in (0.5, 1.1), and their number. */
static double find_apex(const char *out, int *n)
{
    double t, y, apex = 0;
    *n = 0;
    for (const char *line = out; line && sscanf(line, "t = %lf s y = %lf m", &t, &y) == 2; ++*n) {
        line = strchr(line, '\n');
        if (line) line++;
        assert_true(y > 0.2499); /* a ball of radius 0.25 on a floor at 0, printed in 0.1 mm */
        if (t > 0.5 && t < 1.1) apex = fmax(apex, y);
    }
    return apex;
}

/* Dropped by 1 m with e = 0.8, a ball of radius 0.25 rises to 0.25 + 0.64.  Sampled every T it is
 * seen at most g (T/2)^2 / 2 lower; a step of first order adds g h. */
static void examples_run(void **state)
{
    char url[64], out[8192];
    const double first_order = 9.81 / 60;
    int n = 0;
    (void)state;
    process p = caromd_start(NULL, url);
    const char *const client[] = {LCM_CLIENT, BOUNCE, url, NULL};
    run_example(client, out, (int)sizeof out);
    assert_near(find_apex(out, &n), 0.89, 9.81 / 12 / 12 / 2 + first_order);
    assert_int_equal(n, 12);
    caromd_stop(&p);

    const char *const embed[] = {EMBED, NULL};
    run_example(embed, out, (int)sizeof out);
    assert_near(find_apex(out, &n), 0.89, 9.81 / 120 / 120 / 2 + first_order);
    assert_int_equal(n, 60);

    /* x = v^2 / (2 mu g), dx/dmu = -x/mu; a step of first order adds v h to x. */
    const char *const differentiate[] = {DIFFERENTIATE, NULL};
    const double mu = 0.5, v = 3, x = v * v / (2 * mu * 9.81);
    double slid = 0, slope = 0;
    run_example(differentiate, out, (int)sizeof out);
    assert_int_equal(sscanf(out, "slid %lf m, d x / d mu = %lf m", &slid, &slope), 2);
    assert_near(slid, x, v / 60);
    assert_near(slope, -x / mu, v / 60 / mu);
}

/* What a newcomer meets: no server, no file, a wrong file. */
static void examples_say_what_is_wrong(void **state)
{
    char url[64], out[1024], err[1024];
    (void)state;
    const char *const alone[] = {LCM_CLIENT, BOUNCE, "tcpq://127.0.0.1:1", NULL};
    process e = process_start(alone);
    assert_int_equal(process_wait(&e, 20, out, sizeof out, err, sizeof err), 1);
    assert_non_null(strstr(err, "is caromd running there?"));
    process p = caromd_start(NULL, url);
    const char *const missing[] = {LCM_CLIENT, "/no/such/scene", url, NULL};
    e = process_start(missing);
    assert_int_equal(process_wait(&e, 20, out, sizeof out, err, sizeof err), 1);
    assert_non_null(strstr(err, "/no/such/scene: cannot be read"));
    caromd_stop(&p);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(trajectory),
        cmocka_unit_test(names_keep_daemons_apart),
        cmocka_unit_test(round_trip),
        cmocka_unit_test(long_requests_leave_others_alone),
        cmocka_unit_test(status_comes_twice_a_second),
        cmocka_unit_test(clients_notice_the_end),
        cmocka_unit_test(restarted_daemons_know_no_session),
        cmocka_unit_test(command_line),
        cmocka_unit_test(ports_are_not_shared),
        cmocka_unit_test(hostile_messages),
        cmocka_unit_test(examples_run),
        cmocka_unit_test(examples_say_what_is_wrong),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
