/* The program `carom` from outside: exit codes, formats, messages.  CAROM_PROGRAM is its path. */
#include "near.h"

#include "clients/c/scene.h"

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

/* What one call of the program gave. */
typedef struct call {
    int code;
    char *out;
    char *err;
} call;

static char folder[64]; /* of this process, for all files below */

static char *path_of(const char *name, char *path)
{
    snprintf(path, 128, "%s/%s", folder, name);
    return path;
}

static char *read_whole(const char *name)
{
    char path[128];
    FILE *f = fopen(path_of(name, path), "rb");
    if (!f) return NULL;
    fseek(f, 0, SEEK_END);
    const size_t size = (size_t)ftell(f);
    rewind(f);
    char *text = malloc(size + 1);
    assert_non_null(text);
    assert_int_equal(fread(text, 1, size, f), size);
    text[size] = '\0';
    fclose(f);
    return text;
}

static void write_text(const char *name, const char *text)
{
    char path[128];
    FILE *f = fopen(path_of(name, path), "wb");
    assert_non_null(f);
    fputs(text, f);
    assert_int_equal(fclose(f), 0);
}

/* Runs "carom ARGUMENTS"; @ in them is the folder of this test, % that of the data. */
static call run(const char *arguments)
{
    char command[2048] = "";
    snprintf(command, sizeof command, "cd %s && %s ", folder, CAROM_PROGRAM);
    for (const char *c = arguments; *c; c++) {
        const char one[2] = {*c, '\0'};
        const char *part = *c == '@' ? folder : *c == '%' ? TEST_DATA : one;
        strcat(command, part);
    }
    strcat(command, " >out 2>err");
    const int status = system(command);
    assert_true(WIFEXITED(status));
    const call c = {WEXITSTATUS(status), read_whole("out"), read_whole("err")};
    return c;
}

static void call_free(call *c)
{
    free(c->out);
    free(c->err);
}

/* Exit code, empty standard output (code 1) and a message with this text. */
static void expect_refusal(const char *arguments, const char *message)
{
    call c = run(arguments);
    if (c.code != 1 || c.out[0] || !strstr(c.err, message)) {
        fail_msg("carom %s\n exit %d, stdout \"%s\"\n stderr: %s wanted: %s", arguments, c.code,
                 c.out, c.err, message);
    }
    call_free(&c);
}

/* Line k of a text of JSON lines, parsed; NULL past the end. */
static json_t *json_line(const char *text, int k)
{
    for (; k > 0 && text; k--) {
        text = strchr(text, '\n');
        if (text) text++;
    }
    if (!text || !*text) return NULL;
    json_error_t error;
    json_t *json = json_loads(text, JSON_DISABLE_EOF_CHECK, &error);
    if (!json) fail_msg("not JSON: %s in %.200s", error.text, text);
    return json;
}

static int count_lines(const char *text)
{
    int n = 0;
    for (; *text; text++) n += *text == '\n';
    return n;
}

static double number(const json_t *object, const char *key)
{
    const json_t *x = json_object_get(object, key);
    if (!json_is_number(x)) fail_msg("no number \"%s\"", key);
    return json_number_value(x);
}

static double entry(const json_t *object, const char *key, size_t i)
{
    const json_t *x = json_array_get(json_object_get(object, key), i);
    if (!json_is_number(x)) fail_msg("no number %s[%zu]", key, i);
    return json_number_value(x);
}

/* --- usage */

static void wrong_usage(void **state)
{
    (void)state;
    expect_refusal("", "carom run SCENE");
    expect_refusal("fly", "no command \"fly\"");
    expect_refusal("run", "needs a file");
    expect_refusal("run a.json b.json", "one argument too many: b.json");
    expect_refusal("run %/scenes/a_slide.json --speed 3", "unknown option --speed");
    expect_refusal("run %/scenes/a_slide.json --dt", "--dt needs a value");
    expect_refusal("run %/scenes/a_slide.json --dt x", "--dt: \"x\" is not a number");
    expect_refusal("run %/scenes/a_slide.json --dt 0", "dt must be > 0");
    expect_refusal("run %/scenes/a_slide.json --duration -1", "--duration: \"-1\" is not a number");
    expect_refusal("run %/scenes/a_slide.json --quiet=1", "--quiet takes no value");
    expect_refusal("run %/scenes/a_slide.json --set margin", "--set wants KEY=VALUE");
    expect_refusal("run %/scenes/a_slide.json --set magic=1", "--set magic=1: ");
    expect_refusal("run %/scenes/a_slide.json --integrator magic", "--integrator magic: ");
    expect_refusal("run %/scenes/a_slide.json --out /nonexistent/x", "/nonexistent/x: cannot be");
    expect_refusal("run none.json", "none.json: cannot be read");
    expect_refusal("gradient %/scenes/a_slide.json", "needs --loss");
    expect_refusal("help fly", "no command \"fly\"");
}

static void help_and_version(void **state)
{
    (void)state;
    const char *const calls[] = {"help",       "--help",        "help run",
                                 "run --help", "help settings", "--version"};
    for (size_t k = 0; k < sizeof calls / sizeof calls[0]; k++) {
        call c = run(calls[k]);
        if (c.code != 0 || strlen(c.out) < 5 || c.err[0]) fail_msg("carom %s", calls[k]);
        call_free(&c);
    }
    call c = run("help settings");
    assert_non_null(strstr(c.out, "combine_friction"));
    call_free(&c);
}

/* --- run */

/* The trajectory of the program is that of the library, bit for bit, in every printed number. */
static void run_prints_exact_numbers(void **state)
{
    (void)state;
    char name[256];
    snprintf(name, sizeof name, "%s/scenes/e_cradle.json", TEST_DATA);
    crm_problems problems = {name, 0, NULL};
    crm_scene *scene = crm_scene_read(&problems);
    assert_non_null(scene);
    carom_world *w = NULL;
    char why[256];
    assert_int_equal(crm_scene_world(scene, NULL, &w, why, sizeof why), CAROM_OK);
    for (int k = 0; k < 90; k++) assert_true(carom_world_step(w, NULL, NULL) >= 0);
    call c = run("run %/scenes/e_cradle.json");
    assert_int_equal(c.code, 0);
    assert_string_equal(c.err, "");
    assert_int_equal(count_lines(c.out),
                     1 + 46 + 1); /* samples every 2 of 90 steps, and the first */
    json_t *head = json_line(c.out, 0);
    assert_string_equal(json_string_value(json_object_get(head, "format")), "carom-trajectory/1");
    assert_string_equal(json_string_value(json_object_get(head, "scene")), "e_cradle");
    assert_true(number(head, "bodies") == 6 && number(head, "dt") == scene->settings.dt);
    json_t *second = json_line(c.out, 2);
    assert_true(number(second, "step") == 2);
    json_t *last = json_line(c.out, 46);
    assert_true(number(last, "step") == 90 && number(last, "t") == carom_world_time(w));
    for (size_t i = 0; i < 18; i++) {
        assert_true(entry(last, "q", i) == carom_world_q(w)[i]);
        assert_true(entry(last, "v", i) == carom_world_v(w)[i]);
    }
    json_decref(head);
    json_decref(second);
    json_decref(last);
    call_free(&c);
    carom_world_destroy(w);
    crm_scene_free(scene);
}

static void summary_has_its_figures(void **state)
{
    (void)state;
    call c = run("run %/scenes/g_stack10.json --duration 0.5 --out traj --quiet");
    assert_int_equal(c.code, 0);
    assert_string_equal(c.out, "");
    char *text = read_whole("traj");
    json_t *line = json_line(text, count_lines(text) - 1);
    json_t *s = json_object_get(line, "summary");
    assert_true(number(s, "steps") == 30);
    assert_true(number(s, "seconds") > 0);
    assert_near(number(s, "seconds_per_step"), number(s, "seconds") / 30, 1e-15);
    assert_true(number(s, "residual_max") <= 1e-10); /* what a solved step promises */
    assert_true(number(s, "penetration_max") >= 0 && number(s, "joint_drift_max") >= 0);
    assert_true(number(s, "events") == 0 && number(s, "factorizations") >= 1);
    assert_true(number(json_object_get(s, "status"), "CAROM_OK") == 30);
    assert_true(number(s, "allocations_steady") == 0);
    json_decref(line);
    free(text);
    call_free(&c);
}

/* The options reach the world: free fall of the paper's step, y_n = y_0 - g dt^2 n (n + 1)/2. */
static void options_change_the_run(void **state)
{
    (void)state;
    write_text("fall.json",
               "{\"format\":\"carom-scene/1\",\"gravity\":[0,-8],\"bodies\":[{\"mass\":1,"
               "\"inertia\":1}]}");
    expect_refusal("run fall.json", "duration: the scene gives none");
    call c = run("run fall.json --dt 0.25 --duration=1 --integrator euler --set margin=1e-5");
    assert_int_equal(c.code, 0);
    assert_int_equal(count_lines(c.out), 7);
    json_t *last = json_line(c.out, 5);
    assert_near(entry(last, "q", 2), -8 * 0.0625 * 10, 1e-14); /* four roundings near 5 */
    json_decref(last);
    call_free(&c);
    /* a sample interval that is no whole number of steps is told, and nothing else is */
    c = run("run %/scenes/a_slide.json --dt 0.02 --duration 0.2");
    assert_int_equal(c.code, 0);
    assert_non_null(strstr(c.err, "sample 0.0333333333 s is 1.66667 steps"));
    assert_int_equal(count_lines(c.err), 1);
    assert_int_equal(count_lines(c.out), 1 + 6 + 1);
    call_free(&c);
    c = run("run %/scenes/a_slide.json --dt 0.02 --duration 0.2 --quiet");
    assert_string_equal(c.err, "");
    call_free(&c);
    c = run("run - --duration 0 <%/scenes/a_slide.json");
    assert_int_equal(c.code, 0);
    assert_int_equal(count_lines(c.out), 3);
    call_free(&c);
}

/* A piecewise constant force: mass 2, no gravity, 3 N along x from 0.25 to 0.625 s, step 0.5 s. */
static void force_tables_act(void **state)
{
    (void)state;
    write_text(
        "push.json",
        "{\"format\":\"carom-scene/1\",\"gravity\":[0,0],\"dt\":0.5,\"duration\":1,\"bodies\":"
        "[{\"mass\":2,\"inertia\":1,\"forces\":[[0.25,0,3,0],[0.625,0,0,0]]}]}");
    call c = run("run push.json");
    json_t *last = json_line(c.out, 3);
    assert_near(entry(last, "v", 1), 3 * 0.375 / 2, 1e-15);
    json_decref(last);
    call_free(&c);
}

/* No contact problem has a residual of 1e-300: the step fails, and what came before is written. */
static void failed_computation(void **state)
{
    (void)state;
    call c = run("run %/scenes/a_slide.json --set accept=1e-300 --set inexact=1e-300");
    if (c.code != 2) fail_msg("exit %d: %s", c.code, c.err);
    assert_non_null(strstr(c.err, "a_slide.json: step 1 (t = 0 s) failed: CAROM_E_NO_SOLUTION"));
    assert_int_equal(count_lines(c.out), 3);
    json_t *line = json_line(c.out, 2);
    json_t *s = json_object_get(line, "summary");
    assert_true(number(s, "steps") == 0);
    assert_true(number(json_object_get(s, "status"), "CAROM_E_NO_SOLUTION") == 1);
    json_decref(line);
    call_free(&c);
}

static void full_disk(void **state)
{
    (void)state;
    if (access("/dev/full", W_OK) != 0) skip();
    call c = run("run %/scenes/a_slide.json --out /dev/full");
    assert_int_equal(c.code, 2);
    assert_non_null(strstr(c.err, "/dev/full: not everything could be written"));
    call_free(&c);
}

/* Waits until the file holds something; 0 after ten seconds. */
static int wait_for_output(const char *name)
{
    const struct timespec pause = {0, 10000000};
    for (int k = 0; k < 1000; k++) {
        char *text = read_whole(name);
        const int there = text && count_lines(text) > 2;
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
        if (chdir(folder) != 0 || !freopen("out", "w", stdout) || !freopen("err", "w", stderr)) {
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
    char *out = read_whole("out");
    char *err = read_whole("err");
    assert_non_null(strstr(err, "interrupted after step"));
    json_t *line = json_line(out, count_lines(out) - 1);
    json_t *before = json_line(out, count_lines(out) - 2);
    assert_true(number(json_object_get(line, "summary"), "steps") == number(before, "step"));
    json_decref(line);
    json_decref(before);
    free(out);
    free(err);
}

/* --- validate, explain */

static void validate_tells_everything(void **state)
{
    (void)state;
    call c = run("validate %/scenes/a_slide.json %/scenes/f_double.json");
    assert_int_equal(c.code, 0);
    assert_non_null(strstr(c.out, "f_double.json: valid, 3 bodies, 2 joints"));
    assert_string_equal(c.err, "");
    call_free(&c);
    write_text("bad.json", "{\"format\":\"carom-scene/1\",\"dt\":-1,\"bodies\":[{\"mass\":-1,"
                           "\"inertia\":1},{\"typ\":\"static\",\"mass\":1,\"inertia\":1}]}");
    c = run("validate bad.json");
    assert_int_equal(c.code, 1);
    assert_non_null(strstr(c.err, "bad.json: dt: must be > 0 [s], is -1"));
    assert_non_null(strstr(c.err, "bad.json: bodies[0].mass: must be > 0 [kg], is -1"));
    assert_non_null(strstr(c.err, "bad.json: bodies[1].typ: unknown key"));
    assert_non_null(strstr(c.err, "bad.json: 3 errors"));
    call_free(&c);
    /* what only the engine knows */
    write_text("deep.json",
               "{\"format\":\"carom-scene/1\",\"settings\":{\"project_overlap\":0},\"bodies\":["
               "{\"type\":\"static\",\"shape\":{\"type\":\"circle\",\"radius\":1}},"
               "{\"mass\":1,\"shape\":{\"type\":\"circle\",\"radius\":1},\"position\":[1,0]}]}");
    expect_refusal("validate deep.json", "deep.json: ");
    expect_refusal("run deep.json --duration 1", "deep.json: ");
    write_text("margin.json", "{\"format\":\"carom-scene/1\",\"settings\":{\"margin\":-1},"
                              "\"bodies\":[]}");
    expect_refusal("validate margin.json", "settings.margin: ");
}

/* A stack of ten boxes on a floor: ten pairs of two points each, nothing else. */
static void explain_counts(void **state)
{
    (void)state;
    call c = run("explain %/scenes/g_stack10.json");
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
    call_free(&c);
}

/* --- gradient */

#define BALL_HEIGHT "{\"terms\":[{\"step\":\"final\",\"body\":1,\"component\":\"y\"}]}"

/* Arrays and their lengths, and central differences that agree. */
static void gradient_has_its_arrays(void **state)
{
    (void)state;
    write_text("loss.json", BALL_HEIGHT);
    call c = run("gradient %/scenes/d_bounce_e80.json --loss loss.json --check=6");
    assert_int_equal(c.code, 0);
    json_t *all = json_line(c.out, 0);
    json_t *g = json_object_get(all, "gradient");
    const struct {
        const char *name;
        size_t length;
    } arrays[] = {{"q0", 6},       {"v0", 6},          {"mass", 2},    {"inertia", 2},
                  {"friction", 2}, {"restitution", 2}, {"gravity", 2}, {"radius", 2},
                  {"vertices", 2}, {"anchors", 0},     {"force", 6}};
    assert_int_equal(json_object_size(g), 11);
    for (size_t k = 0; k < sizeof arrays / sizeof arrays[0]; k++) {
        const json_t *a = json_object_get(g, arrays[k].name);
        if (!json_is_array(a) || json_array_size(a) != arrays[k].length)
            fail_msg("%s", arrays[k].name);
    }
    const json_t *floor = json_array_get(json_object_get(g, "vertices"), 0);
    assert_int_equal(json_array_size(floor), 4);
    assert_int_equal(json_array_size(json_array_get(floor, 3)), 2);
    assert_true(number(all, "loss") > 0 && number(all, "degenerate") == 0);
    assert_true(number(all, "seconds_forward") > 0 && number(all, "seconds_backward") > 0);
    /* differences of order h^2 = 1e-10 and rounding 1e-16/h = 1e-10, amplified by three impacts */
    json_t *largest = json_object_get(json_object_get(all, "check"), "largest");
    assert_true(number(largest, "disagreement") < 1e-6);
    json_decref(all);
    call_free(&c);
}

/* Loss and gradient of a free body in closed form: x_n = x0 + n h v0 + (F/m) h^2 n (n + 1)/2. */
static void gradient_of_a_free_body(void **state)
{
    (void)state;
    write_text("free.json",
               "{\"format\":\"carom-scene/1\",\"gravity\":[0,0],\"dt\":0.25,\"duration\":"
               "1,\"bodies\":[{\"name\":\"b\",\"mass\":2,\"inertia\":1,\"velocity\":[3,0],"
               "\"forces\":[0,5,0]}]}");
    write_text("free_loss.json", "{\"terms\":[{\"step\":4,\"body\":\"b\",\"component\":\"x\","
                                 "\"weight\":0.5,\"target\":1},{\"step\":0,\"body\":0,"
                                 "\"component\":\"vx\",\"weight\":7}]}");
    const double s = 0.0625 * 10;
    const double x = 3 + 5 * s / 2;
    call c = run("gradient free.json --loss - --wrt v0,mass,q0,force <free_loss.json");
    assert_int_equal(c.code, 0);
    json_t *all = json_line(c.out, 0);
    json_t *g = json_object_get(all, "gradient");
    assert_int_equal(json_object_size(g), 4);
    /* a dozen roundings of numbers below 50 */
    assert_near(number(all, "loss"), 0.5 * (x - 1) * (x - 1) + 21, 1e-13);
    assert_near(entry(g, "q0", 1), x - 1, 1e-13);
    assert_near(entry(g, "v0", 1), x - 1 + 7, 1e-13);
    assert_near(entry(g, "mass", 0), (x - 1) * (-5 * s / 4), 1e-13);
    assert_near(entry(g, "force", 1), (x - 1) * s / 2, 1e-13);
    json_decref(all);
    call_free(&c);
}

/* A disc that slides until it rolls: where the file gives no inertia, the derivative by the mass is
 * the total one, d/dm + (I/m) d/dI. */
static void mass_carries_its_inertia(void **state)
{
    (void)state;
    const char *form =
        "{\"format\":\"carom-scene/1\",\"duration\":0.5,\"bodies\":[{\"type\":\"static\",\"shape\":"
        "{\"type\":\"hull\",\"vertices\":[[-9,-1],[9,-1],[9,1],[-9,1]]},\"position\":[0,-1],"
        "\"friction\":0.3},{\"mass\":2,%s\"shape\":{\"type\":\"circle\",\"radius\":0.5},"
        "\"position\":"
        "[0,0.5],\"velocity\":[2,0],\"friction\":0.3,\"forces\":[0.3,1,0]}]}";
    char text[1024];
    write_text("x_loss.json", "{\"terms\":[{\"body\":1,\"component\":\"x\"}]}");
    snprintf(text, sizeof text, form, "");
    write_text("without.json", text);
    snprintf(text, sizeof text, form, "\"inertia\":0.25,");
    write_text("with.json", text);
    call a = run("gradient without.json --loss x_loss.json");
    call b = run("gradient with.json --loss x_loss.json");
    assert_int_equal(a.code | b.code, 0);
    json_t *ja = json_line(a.out, 0);
    json_t *jb = json_line(b.out, 0);
    json_t *ga = json_object_get(ja, "gradient");
    json_t *gb = json_object_get(jb, "gradient");
    assert_true(entry(gb, "inertia", 1) != 0);
    const double total = entry(gb, "mass", 1) + 0.125 * entry(gb, "inertia", 1);
    assert_near(entry(ga, "mass", 1), total, 1e-15);
    json_decref(ja);
    json_decref(jb);
    call_free(&a);
    call_free(&b);
}

static void wrong_losses(void **state)
{
    (void)state;
    const struct {
        const char *text;
        const char *message;
    } cases[] = {
        {"{\"terms\":1}", "wrong.json: terms: must be an array"},
        {"{\"terms\":[],\"x\":1}", "wrong.json: x: unknown key"},
        {"{\"terms\":[{\"body\":9,\"component\":\"x\"}]}", "terms[0].body: must be a whole number"},
        {"{\"terms\":[{\"body\":\"z\",\"component\":\"x\"}]}", "terms[0].body: no body"},
        {"{\"terms\":[{\"body\":1}]}", "terms[0].component: must be given"},
        {"{\"terms\":[{\"body\":1,\"component\":\"z\"}]}",
         "terms[0].component: \"z\" is not known"},
        {"{\"terms\":[{\"body\":1,\"component\":\"x\",\"step\":999}]}", "terms[0].step: must be"},
        {"{\"terms\":[{\"body\":1,\"component\":\"x\",\"step\":\"last\"}]}",
         "terms[0].step: must be"},
        {"{\"terms\":[{\"body\":1,\"component\":\"x\",\"wait\":1}]}", "terms[0].wait: unknown key"},
        {"{\"terms\":[", "wrong.json: line 1, column"}};
    for (size_t k = 0; k < sizeof cases / sizeof cases[0]; k++) {
        write_text("wrong.json", cases[k].text);
        expect_refusal("gradient %/scenes/a_slide.json --loss wrong.json", cases[k].message);
    }
    write_text("loss.json", BALL_HEIGHT);
    expect_refusal("gradient %/scenes/a_slide.json --loss loss.json --wrt mass,colour",
                   "\"colour\" is not known");
    expect_refusal("gradient %/scenes/a_slide.json --loss loss.json --check=0", "--check: \"0\"");
}

/* --- contact, lcp */

/* Circle at (0, 0) and box at (3, 0): distance, normal and points known without computing. */
static void contact_of_given_pairs(void **state)
{
    (void)state;
    write_text("pairs.json",
               "{\"vectors\":[{\"id\":\"one\",\"note\":1,\"A\":{\"type\":\"circle\",\"radius\":1},"
               "\"poseA\":[0.5,10,20],\"B\":{\"type\":\"hull\",\"vertices\":[[-1,-1],[1,-1],[1,1],"
               "[-1,1]]},\"poseB\":[0,13,20]}]}");
    call c = run("contact pairs.json");
    assert_int_equal(c.code, 0);
    assert_int_equal(count_lines(c.out), 1);
    json_t *p = json_line(c.out, 0);
    assert_string_equal(json_string_value(json_object_get(p, "id")), "one");
    assert_string_equal(json_string_value(json_object_get(p, "feature")), "edge");
    assert_near(number(p, "distance"), 1, 1e-14);
    assert_near(entry(p, "normal", 0), 1, 1e-15);
    assert_near(entry(p, "normal", 1), 0, 1e-15);
    json_t *points = json_object_get(p, "points");
    assert_int_equal(json_array_size(points), 1);
    json_t *point = json_array_get(points, 0);
    assert_near(entry(point, "pA", 0), 11, 1e-14);
    assert_near(entry(point, "pA", 1), 20, 1e-14);
    assert_near(entry(point, "pB", 0), 12, 1e-14);
    assert_near(number(point, "gap"), 1, 1e-14);
    json_decref(p);
    call_free(&c);
    expect_refusal("contact %/scenes/a_slide.json", "vectors: must be an array of pairs");
    write_text("pairs.json",
               "[{\"id\":1,\"A\":{\"type\":\"circle\",\"radius\":-1},\"poseA\":[0,0,0]}]");
    expect_refusal("contact pairs.json", "pairs.json: [0].A.radius: ");
}

/* Every vector: as many lines, ids in order, distances within 1e-13 of the pair's size. */
static void contact_of_the_vectors(void **state)
{
    (void)state;
    json_t *file = json_load_file(TEST_DATA "/geometry/vectors.json", 0, NULL);
    json_t *vectors = json_object_get(file, "vectors");
    call c = run("contact %/geometry/vectors.json");
    assert_int_equal(c.code, 0);
    assert_int_equal((size_t)count_lines(c.out), json_array_size(vectors));
    for (int k = 0; k < count_lines(c.out); k++) {
        json_t *line = json_line(c.out, k);
        const json_t *v = json_array_get(vectors, (size_t)k);
        assert_true(number(line, "id") == number(v, "id"));
        assert_near_case("distance", k, number(line, "distance"), number(v, "distance"),
                         number(v, "tol_relative_frame"));
        json_decref(line);
    }
    call_free(&c);
    json_decref(file);
}

/* One contact by hand: mass 2 falls on a floor, q = -(M v + h f) = 3: l_n = 3, v = 0. */
static void lcp_solves_by_hand(void **state)
{
    (void)state;
    write_text("one.json",
               "{\"name\":\"one\",\"M\":[1,2,2],\"J_e\":{\"rows\":0,\"cols\":3,\"i\":[],\"j\":[],"
               "\"x\":[]},"
               "\"J_c\":{\"rows\":1,\"cols\":3,\"i\":[0],\"j\":[2],\"x\":[1]},\"J_t\":{\"rows\":1,"
               "\"cols\":3,\"i\":[0],\"j\":[1],\"x\":[-1]},\"mu\":[0.5],\"c\":[0],\"q\":[0,-4,3],"
               "\"v\":[NaN,-Infinity,Infinity]}");
    call c = run("lcp one.json");
    if (c.code != 0) fail_msg("exit %d: %s", c.code, c.err);
    json_t *p = json_line(c.out, 0);
    assert_string_equal(json_string_value(json_object_get(p, "name")), "one");
    assert_string_equal(json_string_value(json_object_get(p, "status")), "solved");
    /* slip: |l_t| = 0.5 * 3; 2 vx = 4 - 1.5 */
    assert_near(entry(p, "lam_n", 0), 3, 1e-9);
    assert_near(entry(p, "lam_t", 0), 1.5, 1e-9);
    assert_near(entry(p, "v", 1), 1.25, 1e-9);
    assert_near(entry(p, "v", 2), 0, 1e-9);
    assert_int_equal(json_array_size(json_object_get(p, "lam_e")), 0);
    assert_true(number(p, "residual") <= 1e-10 && number(p, "seconds") > 0);
    assert_true(number(p, "factorizations") >= 1);
    assert_true(json_is_string(json_object_get(p, "stage")));
    json_decref(p);
    call_free(&c);
}

static void lcp_of_the_data(void **state)
{
    (void)state;
    const struct {
        const char *file;
        const char *status;
    } cases[] = {
        {"000_stack2_top1_mu0.5_push0.0", "solved"},
        {"210_chain3_10000", "solved"},
        {"477_rand3_6_1.0_0", CAROM_GENERAL ? "solved" : "failed"}, /* rows of three bodies */
        {"439_circdrop6_e0.9", "infeasible"}};
    for (size_t k = 0; k < sizeof cases / sizeof cases[0]; k++) {
        char arguments[256];
        snprintf(arguments, sizeof arguments, "lcp %%/lcp/%s.json", cases[k].file);
        call c = run(arguments);
        json_t *p = json_line(c.out, 0);
        assert_non_null(p);
        assert_string_equal(json_string_value(json_object_get(p, "name")), cases[k].file);
        assert_string_equal(json_string_value(json_object_get(p, "status")), cases[k].status);
        assert_int_equal(c.code, strcmp(cases[k].status, "failed") == 0 ? 2 : 0);
        json_decref(p);
        call_free(&c);
    }
    /* a wrong file does not keep the others from being solved */
    write_text("none.json", "{\"M\":[1,1,0]}");
    call c = run("lcp none.json %/lcp/000_stack2_top1_mu0.5_push0.0.json");
    assert_int_equal(c.code, 1);
    assert_int_equal(count_lines(c.out), 1);
    assert_non_null(strstr(c.err, "none.json: J_c.rows: must be given"));
    call_free(&c);
}

static int make_folder(void **state)
{
    (void)state;
    strcpy(folder, "/tmp/carom_test_cli_XXXXXX");
    return mkdtemp(folder) ? 0 : -1;
}

static int remove_folder(void **state)
{
    (void)state;
    char command[128];
    snprintf(command, sizeof command, "rm -r %s", folder);
    return system(command);
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
        cmocka_unit_test(gradient_has_its_arrays),
        cmocka_unit_test(gradient_of_a_free_body),
        cmocka_unit_test(mass_carries_its_inertia),
        cmocka_unit_test(wrong_losses),
        cmocka_unit_test(contact_of_given_pairs),
        cmocka_unit_test(contact_of_the_vectors),
        cmocka_unit_test(lcp_solves_by_hand),
        cmocka_unit_test(lcp_of_the_data),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
