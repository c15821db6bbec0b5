/* `carom send` and `carom watch` with a real caromd: the same numbers as `carom run`. */
#include "program.h"

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

/* A caromd of this test. */
typedef struct server {
    pid_t pid;
    char url[64];
} server;

static server start_server(void)
{
    int ends[2];
    server s;
    assert_int_equal(pipe(ends), 0);
    s.pid = fork();
    assert_true(s.pid >= 0);
    if (s.pid == 0) {
        prctl(PR_SET_PDEATHSIG, SIGKILL); /* a test that fails leaves no server behind */
        dup2(ends[1], STDOUT_FILENO);
        close(ends[0]);
        close(ends[1]);
        execl(CAROM_DAEMON, "caromd", "--hub", "127.0.0.1:0", (char *)NULL);
        _exit(99);
    }
    close(ends[1]);
    FILE *f = fdopen(ends[0], "r");
    assert_non_null(f);
    if (fscanf(f, "ready %63s", s.url) != 1) fail_msg("caromd did not get ready");
    fclose(f);
    return s;
}

static void stop_server(server *s)
{
    int status = 0;
    kill(s->pid, SIGTERM);
    assert_int_equal(waitpid(s->pid, &status, 0), s->pid);
    assert_true(WIFEXITED(status) && WEXITSTATUS(status) == 0);
}

/* Everything before the summary, whose times differ. */
static void cut_summary(char *text)
{
    char *summary = strstr(text, "{\"summary\"");
    assert_non_null(summary);
    *summary = '\0';
}

static void compare_with_run(const server *s, const char *arguments)
{
    char line[512];
    snprintf(line, sizeof line, "run %s", arguments);
    program_call local = program_run(line);
    snprintf(line, sizeof line, "send %s --url %s", arguments, s->url);
    program_call remote = program_run(line);
    if (local.code != 0 || remote.code != 0) fail_msg("%s: %s", arguments, remote.err);
    json_t *a = program_line(local.out, program_count_lines(local.out) - 1);
    json_t *b = program_line(remote.out, program_count_lines(remote.out) - 1);
    const json_t *sa = json_object_get(a, "summary");
    const json_t *sb = json_object_get(b, "summary");
    const char *const same[] = {"steps",           "residual_max", "penetration_max",
                                "joint_drift_max", "events",       "factorizations"};
    for (size_t k = 0; k < sizeof same / sizeof same[0]; k++) {
        assert_true(program_number(sa, same[k]) == program_number(sb, same[k]));
    }
    cut_summary(local.out);
    cut_summary(remote.out);
    assert_string_equal(local.out, remote.out);
    json_decref(a);
    json_decref(b);
    program_free(&local);
    program_free(&remote);
}

static void send_gives_what_run_gives(void **state)
{
    (void)state;
    server s = start_server();
    compare_with_run(&s, "%/scenes/e_cradle.json");
    compare_with_run(&s, "%/scenes/g_stack10.json --dt 0.01 --set combine_friction=max --quiet");
    program_write(
        "push.json",
        "{\"format\":\"carom-scene/1\",\"dt\":0.01,\"duration\":6,\"sample\":0.1,"
        "\"bodies\":[{\"mass\":2,\"inertia\":1,\"forces\":[[0.255,0,3,0],[5.5,1,0,2]]}]}");
    compare_with_run(&s, "push.json");
    stop_server(&s);
}

/* All scenes of the tests, the large ones for some steps. */
static void every_scene_travels(void **state)
{
    (void)state;
    static const char *const scenes[] = {
        "a_slide",  "b_incline_stick",   "c_slide_roll", "d_bounce_e80", "e_cradle",
        "f_double", "f_pendulum",        "g_stack10",    "g_stack30",    "h_ratio1e3",
        "h_tower4", "i_pyramid10",       "i_pyramid50",  "j_pile100",    "k_oblique_stick",
        "l_arch12", "n_chain_heavy_hang"};
    server s = start_server();
    for (size_t k = 0; k < sizeof scenes / sizeof scenes[0]; k++) {
        char arguments[96];
        const int large = strncmp(scenes[k], "i_pyramid50", 11) == 0;
        snprintf(arguments, sizeof arguments, "%%/scenes/%s.json --duration %s", scenes[k],
                 large ? "0.1" : "0.5");
        compare_with_run(&s, arguments);
    }
    stop_server(&s);
}

/* One of each kind of joint, with all that it can have; what it says of itself must count. */
static void every_joint_travels(void **state)
{
    (void)state;
    static const char *const joints[] = {
        "\"type\":\"revolute\",\"lower\":-0.2,\"upper\":0.3,\"restitution\":0.5",
        "\"type\":\"revolute\",\"stiffness\":30,\"damping\":0.7,\"rest\":0.4",
        "\"type\":\"revolute\",\"motor_speed\":3,\"motor_limit\":40,\"collide\":true",
        "\"type\":\"prismatic\",\"axis\":[1,0.4],\"lower\":-0.1,\"upper\":0.2",
        "\"type\":\"weld\"",
        "\"type\":\"wheel\",\"axis\":[0.2,1],\"stiffness\":400,\"damping\":5",
        "\"type\":\"distance\",\"anchor_b\":[1.4,0.2]",
        "\"type\":\"rope\",\"anchor_b\":[1.4,0.2],\"upper\":2,\"restitution\":0.3",
        "\"type\":\"target\",\"stiffness\":50,\"damping\":2",
        "\"type\":\"lock_x\"",
        "\"type\":\"lock_y\"",
        "\"type\":\"lock_angle\""};
    server s = start_server();
    for (size_t k = 0; k < sizeof joints / sizeof joints[0]; k++) {
        char text[1024];
        snprintf(text, sizeof text,
                 "{\"format\":\"carom-scene/1\",\"dt\":0.01,\"duration\":1,\"sample\":0.1,"
                 "\"bodies\":[{\"mass\":2,\"inertia\":1,\"velocity\":[0.3,1]},"
                 "{\"mass\":1,\"inertia\":0.3,\"position\":[1.2,0],\"angular_velocity\":2}],"
                 "\"joints\":[{%s,\"body_a\":0,\"body_b\":1,\"anchor\":[0.7,0.1]}]}",
                 joints[k]);
        program_write("joint.json", text);
        compare_with_run(&s, "joint.json");
    }
    stop_server(&s);
}

static void send_tells_what_went_wrong(void **state)
{
    (void)state;
    server s = start_server();
    char line[512];
    snprintf(line, sizeof line,
             "send %%/scenes/a_slide.json --set accept=1e-300 --set inexact=1e-300 --url %s",
             s.url);
    program_call c = program_run(line);
    assert_int_equal(c.code, 2);
    assert_non_null(strstr(c.err, "a_slide.json: "));
    assert_non_null(strstr(c.err, "step 1"));
    program_free(&c);
    stop_server(&s);
    snprintf(line, sizeof line, "send %%/scenes/a_slide.json --url %s", s.url);
    c = program_run(line);
    assert_int_equal(c.code, 2);
    assert_non_null(strstr(c.err, "nothing listens at"));
    program_free(&c);
    snprintf(line, sizeof line, "watch --url %s", s.url);
    c = program_run(line);
    assert_int_equal(c.code, 2);
    assert_non_null(strstr(c.err, "nothing listens at"));
    program_free(&c);
    program_refuses("watch here", "one argument too many");
    program_refuses("watch --for x", "--for: \"x\" is not a number");
}

/* Ctrl-C: the last state is written, though a request of 256 steps does not end at a sample. */
static void interrupted_runs_keep_their_last_state(void **state)
{
    (void)state;
    server s = start_server();
    char line[512];
    snprintf(line, sizeof line,
             "send %%/scenes/e_cradle.json --dt 0.01 --duration 1e5 --url %s >sent 2>said & p=$!; "
             "sleep 1; "
             "kill -INT $p; wait $p",
             s.url);
    program_call c = program_run(line);
    assert_int_equal(c.code, 2);
    char *said = program_read("said");
    assert_non_null(strstr(said, "interrupted after step"));
    free(said);
    char *sent = program_read("sent");
    const int n = program_count_lines(sent);
    json_t *end = program_line(sent, n - 1);
    json_t *last = program_line(sent, n - 2);
    const double steps = program_number(json_object_get(end, "summary"), "steps");
    assert_true(steps > 0);
    assert_true(program_number(last, "step") == steps);
    json_decref(end);
    json_decref(last);
    free(sent);
    program_free(&c);
    stop_server(&s);
}

/* Heartbeats come twice a second; a run beside it is heard. */
static void watch_hears_the_bus(void **state)
{
    (void)state;
    server s = start_server();
    char line[512];
    snprintf(line, sizeof line, "watch --url %s --count 2", s.url);
    program_call c = program_run(line);
    assert_int_equal(c.code, 0);
    assert_int_equal(program_count_lines(c.out), 2);
    json_t *first = program_line(c.out, 0);
    const json_t *status = json_object_get(first, "status");
    assert_string_equal(json_string_value(json_object_get(status, "url")), s.url);
    json_decref(first);
    program_free(&c);
    snprintf(line, sizeof line,
             "watch --url %s --for 1.5 --out heard & sleep 0.5; %s send %%/scenes/f_pendulum.json "
             "--url %s --out sent; wait",
             s.url, CAROM_PROGRAM, s.url);
    c = program_run(line);
    assert_int_equal(c.code, 0);
    char *heard = program_read("heard");
    assert_non_null(strstr(heard, "{\"state\":{\"client_id\":"));
    assert_non_null(strstr(heard, "\"step\":300,"));
    assert_non_null(strstr(heard, "{\"reply\":{\"client_id\":"));
    free(heard);
    program_free(&c);
    stop_server(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(send_gives_what_run_gives),
        cmocka_unit_test(every_scene_travels),
        cmocka_unit_test(every_joint_travels),
        cmocka_unit_test(send_tells_what_went_wrong),
        cmocka_unit_test(interrupted_runs_keep_their_last_state),
        cmocka_unit_test(watch_hears_the_bus),
    };
    return cmocka_run_group_tests(tests, program_make_folder, program_remove_folder);
}
