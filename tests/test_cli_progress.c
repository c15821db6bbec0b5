/* Long runs of `carom` on a terminal: the bar, and Ctrl-C in the middle. */
#include "program.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

enum { PATIENCE = 60000 /* for a bar, which comes after one second [ms] */ };

/* The program with a terminal for its errors; what is written there. */
typedef struct session {
    pid_t pid;
    int terminal;
    char shown[65536];
    size_t n_shown;
} session;

static session start(const char *arguments)
{
    char line[1024];
    session s;
    memset(&s, 0, sizeof s);
    s.terminal = posix_openpt(O_RDWR | O_NOCTTY);
    assert_true(s.terminal >= 0);
    assert_int_equal(grantpt(s.terminal) | unlockpt(s.terminal), 0);
    snprintf(line, sizeof line, "cd '%s' && exec '%s' %s >out 2>'%s'", program_folder(),
             CAROM_PROGRAM, arguments, ptsname(s.terminal));
    s.pid = fork();
    assert_true(s.pid >= 0);
    if (s.pid == 0) {
        execl("/bin/sh", "sh", "-c", line, (char *)NULL);
        _exit(99);
    }
    return s;
}

/* Reads the terminal until the text is there; 0: the program ended before, or it takes too long. */
static int shows(session *s, const char *text)
{
    struct pollfd ready = {s->terminal, POLLIN, 0};
    while (!strstr(s->shown, text)) {
        if (s->n_shown + 1 >= sizeof s->shown || poll(&ready, 1, PATIENCE) <= 0) return 0;
        const ssize_t n =
            read(s->terminal, s->shown + s->n_shown, sizeof s->shown - s->n_shown - 1);
        if (n <= 0) return 0;
        s->n_shown += (size_t)n;
        s->shown[s->n_shown] = '\0';
    }
    return 1;
}

/* Ctrl-C; the exit code. */
static int interrupt(session *s, const char *remark)
{
    int status = 0;
    kill(s->pid, SIGINT);
    const int said = shows(s, remark);
    assert_int_equal(waitpid(s->pid, &status, 0), s->pid);
    close(s->terminal);
    if (!said) fail_msg("no \"%s\" in\n%s", remark, s->shown);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

static void run_shows_how_far_it_is(void **state)
{
    (void)state;
    session s = start("run " TEST_DATA "/scenes/a_slide.json --duration 1e6 --out run.jsonl");
    if (!shows(&s, "run [")) fail_msg("no bar: %s", s.shown);
    if (!shows(&s, "s left")) fail_msg("no time: %s", s.shown);
    assert_int_equal(interrupt(&s, "interrupted after step"), 2);
    char *out = program_read("run.jsonl");
    assert_non_null(strstr(out, "{\"summary\":"));
    free(out);
}

/* Nothing in two seconds, where another run shows its bar after one. */
static void quiet_runs_show_nothing(void **state)
{
    (void)state;
    session s = start("run " TEST_DATA "/scenes/a_slide.json --duration 1e6 --quiet --out quiet");
    struct pollfd ready = {s.terminal, POLLIN, 0};
    assert_int_equal(poll(&ready, 1, 2000), 0);
    assert_int_equal(interrupt(&s, "interrupted after step"), 2);
    assert_null(strstr(s.shown, "run ["));
}

/* Ctrl-C while entries are checked: the gradient and the entries so far are written. */
static void checks_can_be_interrupted(void **state)
{
    (void)state;
    program_write("loss.json", "{\"terms\":[{\"body\":1,\"component\":\"x\"}]}");
    session s = start("gradient " TEST_DATA "/scenes/a_slide.json --loss loss.json --duration 400 "
                      "--wrt q0,v0,vertices,force --check=1000");
    if (!shows(&s, "check [")) fail_msg("no bar: %s", s.shown);
    assert_int_equal(interrupt(&s, "check interrupted"), 2);
    char *out = program_read("out");
    json_t *all = program_line(out, 0);
    const json_t *check = json_object_get(all, "check");
    assert_true(json_is_true(json_object_get(check, "interrupted")));
    assert_int_equal(json_array_size(json_object_get(json_object_get(all, "gradient"), "v0")), 6);
    json_decref(all);
    free(out);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(run_shows_how_far_it_is),
        cmocka_unit_test(quiet_runs_show_nothing),
        cmocka_unit_test(checks_can_be_interrupted),
    };
    return cmocka_run_group_tests(tests, program_make_folder, program_remove_folder);
}
