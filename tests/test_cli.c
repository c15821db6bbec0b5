/* The program `carom` from outside: usage, run, validate, explain. */
#include "program.h"

#include "clients/c/scene/scene.h"

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

/* --- usage */

static void wrong_usage(void **state)
{
    (void)state;
    program_refuses("", "carom run SCENE");
    program_refuses("fly", "no command \"fly\"");
    program_refuses("run", "needs a file");
    program_refuses("run a.json b.json", "one argument too many: b.json");
    program_refuses("run %/scenes/a_slide.json --speed 3", "unknown option --speed");
    program_refuses("run %/scenes/a_slide.json --dt", "--dt needs a value");
    program_refuses("run %/scenes/a_slide.json --dt x", "--dt: \"x\" is not a number");
    program_refuses("run %/scenes/a_slide.json --dt 0", "dt must be > 0");
    program_refuses("run %/scenes/a_slide.json --duration -1",
                    "--duration: \"-1\" is not a number");
    program_refuses("run %/scenes/a_slide.json --quiet=1", "--quiet takes no value");
    program_refuses("run %/scenes/a_slide.json --set margin", "--set wants KEY=VALUE");
    program_refuses("run %/scenes/a_slide.json --set magic=1", "--set magic=1: ");
    program_refuses("run %/scenes/a_slide.json --integrator magic", "--integrator magic: ");
    program_refuses("run %/scenes/a_slide.json --out /nonexistent/x", "/nonexistent/x: cannot be");
    program_refuses("run none.json", "none.json: cannot be read");
    program_refuses("gradient %/scenes/a_slide.json", "needs --loss");
    program_refuses("help fly", "no command \"fly\"");
}

static void help_and_version(void **state)
{
    (void)state;
    const char *const calls[] = {"help",       "--help",        "help run",
                                 "run --help", "help settings", "--version"};
    for (size_t k = 0; k < sizeof calls / sizeof calls[0]; k++) {
        program_call c = program_run(calls[k]);
        if (c.code != 0 || strlen(c.out) < 5 || c.err[0]) fail_msg("carom %s", calls[k]);
        program_free(&c);
    }
    program_call c = program_run("help settings");
    assert_non_null(strstr(c.out, "combine_friction"));
    program_free(&c);
}

/* --- run */

/* The trajectory of the program is that of the library, bit for bit, in every printed number. */
static void run_prints_exact_numbers(void **state)
{
    (void)state;
    char name[256];
    snprintf(name, sizeof name, "%s/scenes/e_cradle.json", TEST_DATA);
    crm_problems problems = crm_problems_of(name);
    crm_scene *scene = crm_scene_read(&problems);
    assert_non_null(scene);
    carom_world *w = NULL;
    char why[256];
    assert_int_equal(crm_scene_world(scene, NULL, &w, why, sizeof why), CAROM_OK);
    for (int k = 0; k < 90; k++) assert_true(carom_world_step(w, NULL, NULL) >= 0);
    program_call c = program_run("run %/scenes/e_cradle.json");
    assert_int_equal(c.code, 0);
    assert_string_equal(c.err, "");
    assert_int_equal(program_count_lines(c.out),
                     1 + 46 + 1); /* samples every 2 of 90 steps, and the first */
    json_t *head = program_line(c.out, 0);
    assert_string_equal(json_string_value(json_object_get(head, "format")), "carom-trajectory/1");
    assert_string_equal(json_string_value(json_object_get(head, "scene")), "e_cradle");
    assert_true(program_number(head, "bodies") == 6 &&
                program_number(head, "dt") == scene->settings.dt);
    json_t *second = program_line(c.out, 2);
    assert_true(program_number(second, "step") == 2);
    json_t *last = program_line(c.out, 46);
    assert_true(program_number(last, "step") == 90 &&
                program_number(last, "t") == carom_world_time(w));
    for (size_t i = 0; i < 18; i++) {
        assert_true(program_entry(last, "q", i) == carom_world_q(w)[i]);
        assert_true(program_entry(last, "v", i) == carom_world_v(w)[i]);
    }
    json_decref(head);
    json_decref(second);
    json_decref(last);
    program_free(&c);
    carom_world_destroy(w);
    crm_scene_free(scene);
}

static void summary_has_its_figures(void **state)
{
    (void)state;
    program_call c = program_run("run %/scenes/g_stack10.json --duration 0.5 --out traj --quiet");
    assert_int_equal(c.code, 0);
    assert_string_equal(c.out, "");
    char *text = program_read("traj");
    json_t *line = program_line(text, program_count_lines(text) - 1);
    json_t *s = json_object_get(line, "summary");
    assert_true(program_number(s, "steps") == 30);
    assert_true(program_number(s, "seconds") > 0);
    assert_near(program_number(s, "seconds_per_step"), program_number(s, "seconds") / 30, 1e-15);
    assert_true(program_number(s, "residual_max") <= 1e-10); /* what a solved step promises */
    assert_true(program_number(s, "penetration_max") >= 0 &&
                program_number(s, "joint_drift_max") >= 0);
    assert_true(program_number(s, "events") == 0 && program_number(s, "factorizations") >= 1);
    assert_true(program_number(json_object_get(s, "status"), "CAROM_OK") == 30);
    assert_true(program_number(s, "allocations_steady") == 0);
    json_decref(line);
    free(text);
    program_free(&c);
}

/* The options reach the world: free fall of the paper's step, y_n = y_0 - g dt^2 n (n + 1)/2. */
static void options_change_the_run(void **state)
{
    (void)state;
    program_write("fall.json",
                  "{\"format\":\"carom-scene/1\",\"gravity\":[0,-8],\"bodies\":[{\"mass\":1,"
                  "\"inertia\":1}]}");
    program_refuses("run fall.json", "duration: the scene gives none");
    program_call c =
        program_run("run fall.json --dt 0.25 --duration=1 --integrator euler --set margin=1e-5");
    assert_int_equal(c.code, 0);
    assert_int_equal(program_count_lines(c.out), 7);
    json_t *last = program_line(c.out, 5);
    assert_near(program_entry(last, "q", 2), -8 * 0.0625 * 10, 1e-14); /* four roundings near 5 */
    json_decref(last);
    program_free(&c);
    /* a sample interval that is no whole number of steps is told, and nothing else is */
    c = program_run("run %/scenes/a_slide.json --dt 0.02 --duration 0.2");
    assert_int_equal(c.code, 0);
    assert_non_null(strstr(c.err, "sample 0.0333333333 s is 1.66667 steps"));
    assert_int_equal(program_count_lines(c.err), 1);
    assert_int_equal(program_count_lines(c.out), 1 + 6 + 1);
    program_free(&c);
    c = program_run("run %/scenes/a_slide.json --dt 0.02 --duration 0.2 --quiet");
    assert_string_equal(c.err, "");
    program_free(&c);
    c = program_run("run - --duration 0 <%/scenes/a_slide.json");
    assert_int_equal(c.code, 0);
    assert_int_equal(program_count_lines(c.out), 3);
    program_free(&c);
}

/* A piecewise constant force: mass 2, no gravity, 3 N along x from 0.25 to 0.625 s, step 0.5 s. */
static void force_tables_act(void **state)
{
    (void)state;
    program_write(
        "push.json",
        "{\"format\":\"carom-scene/1\",\"gravity\":[0,0],\"dt\":0.5,\"duration\":1,\"bodies\":"
        "[{\"mass\":2,\"inertia\":1,\"forces\":[[0.25,0,3,0],[0.625,0,0,0]]}]}");
    program_call c = program_run("run push.json");
    json_t *last = program_line(c.out, 3);
    assert_near(program_entry(last, "v", 1), 3 * 0.375 / 2, 1e-15);
    json_decref(last);
    program_free(&c);
}

/* No contact problem has a residual of 1e-300: the step fails, and what came before is written. */
static void failed_computation(void **state)
{
    (void)state;
    program_call c =
        program_run("run %/scenes/a_slide.json --set accept=1e-300 --set inexact=1e-300");
    if (c.code != 2) fail_msg("exit %d: %s", c.code, c.err);
    assert_non_null(strstr(c.err, "a_slide.json: step 1 (t = 0 s) failed: CAROM_E_NO_SOLUTION"));
    assert_int_equal(program_count_lines(c.out), 3);
    json_t *line = program_line(c.out, 2);
    json_t *s = json_object_get(line, "summary");
    assert_true(program_number(s, "steps") == 0);
    assert_true(program_number(json_object_get(s, "status"), "CAROM_E_NO_SOLUTION") == 1);
    json_decref(line);
    program_free(&c);
}

static void full_disk(void **state)
{
    (void)state;
    if (access("/dev/full", W_OK) != 0) skip();
    program_call c = program_run("run %/scenes/a_slide.json --out /dev/full");
    assert_int_equal(c.code, 2);
    assert_non_null(strstr(c.err, "/dev/full: not everything could be written"));
    program_free(&c);
}

/* Waits until the file holds something; 0 after ten seconds. */
static int wait_for_output(const char *name)
{
    const struct timespec pause = {0, 10000000};
    for (int k = 0; k < 1000; k++) {
        char *text = program_read(name);
        const int there = text && program_count_lines(text) > 2;
        free(text);
        if (there) return 1;
        nanosleep(&pause, NULL);
    }
    return 0;
}

static void interruption_keeps_what_was_computed(void **state)
{
    (void)state;
    char scene[256];
    snprintf(scene, sizeof scene, "%s/scenes/a_slide.json", TEST_DATA);
    const pid_t child = fork();
    if (child == 0) {
        if (chdir(program_folder()) != 0 || !freopen("out", "w", stdout) ||
            !freopen("err", "w", stderr)) {
            _exit(99);
        }
        execl(CAROM_PROGRAM, "carom", "run", scene, "--duration", "1e6", (char *)NULL);
        _exit(99);
    }
    assert_true(child > 0);
    assert_true(wait_for_output("out"));
    kill(child, SIGINT);
    int status = 0;
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFEXITED(status) && WEXITSTATUS(status) == 2);
    char *out = program_read("out");
    char *err = program_read("err");
    assert_non_null(strstr(err, "interrupted after step"));
    json_t *line = program_line(out, program_count_lines(out) - 1);
    json_t *before = program_line(out, program_count_lines(out) - 2);
    assert_true(program_number(json_object_get(line, "summary"), "steps") ==
                program_number(before, "step"));
    json_decref(line);
    json_decref(before);
    free(out);
    free(err);
}

/* --- validate, explain */

static void validate_tells_everything(void **state)
{
    (void)state;
    program_call c = program_run("validate %/scenes/a_slide.json %/scenes/f_double.json");
    assert_int_equal(c.code, 0);
    assert_non_null(strstr(c.out, "f_double.json: valid, 3 bodies, 2 joints"));
    assert_string_equal(c.err, "");
    program_free(&c);
    program_write("bad.json", "{\"format\":\"carom-scene/1\",\"dt\":-1,\"bodies\":[{\"mass\":-1,"
                              "\"inertia\":1},{\"typ\":\"static\",\"mass\":1,\"inertia\":1}]}");
    c = program_run("validate bad.json");
    assert_int_equal(c.code, 1);
    assert_non_null(strstr(c.err, "bad.json: dt: must be > 0 [s], is -1"));
    assert_non_null(strstr(c.err, "bad.json: bodies[0].mass: must be > 0 [kg], is -1"));
    assert_non_null(strstr(c.err, "bad.json: bodies[1].typ: unknown key"));
    assert_non_null(strstr(c.err, "bad.json: 3 errors"));
    program_free(&c);
    /* what only the engine knows */
    program_write("deep.json",
                  "{\"format\":\"carom-scene/1\",\"settings\":{\"project_overlap\":0},\"bodies\":["
                  "{\"type\":\"static\",\"shape\":{\"type\":\"circle\",\"radius\":1}},"
                  "{\"mass\":1,\"shape\":{\"type\":\"circle\",\"radius\":1},\"position\":[1,0]}]}");
    program_refuses("validate deep.json", "deep.json: ");
    program_refuses("run deep.json --duration 1", "deep.json: ");
    program_write("margin.json", "{\"format\":\"carom-scene/1\",\"settings\":{\"margin\":-1},"
                                 "\"bodies\":[]}");
    program_refuses("validate margin.json", "settings.margin: ");
}

/* A stack of ten boxes on a floor: ten pairs of two points each, nothing else. */
static void explain_counts(void **state)
{
    (void)state;
    program_call c = program_run("explain %/scenes/g_stack10.json");
    assert_int_equal(c.code, 0);
    const char *const wanted[] = {
        "bodies                     11  10 dynamic, 1 static, 0 kinematic",
        "candidate pairs            10",
        "contacts                   20",
        "friction rows              20",
        "velocities                 30",
        "shapes                     11  44 vertices",
        "pairs                      45  their boxes are apart",
        "300 steps of 0.0166666667 s"};
    for (size_t k = 0; k < sizeof wanted / sizeof wanted[0]; k++) {
        if (!strstr(c.out, wanted[k])) fail_msg("no \"%s\" in\n%s", wanted[k], c.out);
    }
    program_free(&c);
    /* two links and two hinges in a row: 4 blocks, and 2 for each of 3 neighbors, of 9 numbers */
    c = program_run("explain %/scenes/f_double.json");
    assert_int_equal(c.code, 0);
    assert_non_null(strstr(c.out, "factor                     90  nonzeros"));
    program_free(&c);
    /* no static body: no pair of them, without a sign */
    program_write("one.json", "{\"format\":\"carom-scene/1\",\"duration\":1,\"bodies\":["
                              "{\"mass\":1,\"shape\":{\"type\":\"circle\",\"radius\":1}}]}");
    c = program_run("explain one.json");
    assert_int_equal(c.code, 0);
    assert_non_null(strstr(c.out, "pairs                       0  neither body is dynamic"));
    assert_null(strstr(c.out, " -0 "));
    program_free(&c);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(wrong_usage),
        cmocka_unit_test(help_and_version),
        cmocka_unit_test(run_prints_exact_numbers),
        cmocka_unit_test(summary_has_its_figures),
        cmocka_unit_test(options_change_the_run),
        cmocka_unit_test(force_tables_act),
        cmocka_unit_test(failed_computation),
        cmocka_unit_test(full_disk),
        cmocka_unit_test(interruption_keeps_what_was_computed),
        cmocka_unit_test(validate_tells_everything),
        cmocka_unit_test(explain_counts),
    };
    return cmocka_run_group_tests(tests, program_make_folder, program_remove_folder);
}
