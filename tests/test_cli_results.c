/* The program `carom` from outside: gradient, contact, lcp. */
#include "program.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* --- gradient */

#define BALL_HEIGHT "{\"terms\":[{\"step\":\"final\",\"body\":1,\"component\":\"y\"}]}"

/* Arrays and their lengths, and central differences that agree. */
static void gradient_has_its_arrays(void **state)
{
    (void)state;
    program_write("loss.json", BALL_HEIGHT);
    program_call c = program_run("gradient %/scenes/d_bounce_e80.json --loss loss.json --check=6");
    assert_int_equal(c.code, 0);
    json_t *all = program_line(c.out, 0);
    json_t *g = json_object_get(all, "gradient");
    const struct {
        const char *name;
        size_t length;
    } arrays[] = {{"q0", 6},       {"v0", 6},          {"mass", 2},    {"inertia", 2},
                  {"friction", 2}, {"restitution", 2}, {"gravity", 2}, {"radius", 2},
                  {"vertices", 2}, {"anchors", 0},     {"force", 6},   {"dt", 1}};
    assert_int_equal(json_object_size(g), 12);
    for (size_t k = 0; k < sizeof arrays / sizeof arrays[0]; k++) {
        const json_t *a = json_object_get(g, arrays[k].name);
        if (!json_is_array(a) || json_array_size(a) != arrays[k].length)
            fail_msg("%s", arrays[k].name);
    }
    const json_t *floor = json_array_get(json_object_get(g, "vertices"), 0);
    assert_int_equal(json_array_size(floor), 4);
    assert_int_equal(json_array_size(json_array_get(floor, 3)), 2);
    assert_true(program_number(all, "loss") > 0 && program_number(all, "degenerate") == 0);
    assert_true(program_number(all, "seconds_forward") > 0 &&
                program_number(all, "seconds_backward") > 0);
    /* differences of order h^2 = 1e-10 and rounding 1e-16/h = 1e-10, amplified by three impacts */
    json_t *largest = json_object_get(json_object_get(all, "check"), "largest");
    assert_true(program_number(largest, "disagreement") < 1e-6);
    json_decref(all);
    program_free(&c);
}

/* Loss and gradient of a free body in closed form, Euler: x_n = x0 + n h v0 + (F/m) h^2 n (n +
 * 1)/2. */
static void gradient_of_a_free_body(void **state)
{
    (void)state;
    program_write("free.json",
                  "{\"format\":\"carom-scene/1\",\"gravity\":[0,0],\"dt\":0.25,\"duration\":"
                  "1,\"settings\":{\"integrator\":\"euler\"},\"bodies\":[{\"name\":\"b\",\"mass\":"
                  "2,\"inertia\":1,\"velocity\":[3,0],"
                  "\"forces\":[0,5,0]}]}");
    program_write("free_loss.json", "{\"terms\":[{\"step\":4,\"body\":\"b\",\"component\":\"x\","
                                    "\"weight\":0.5,\"target\":1},{\"step\":0,\"body\":0,"
                                    "\"component\":\"vx\",\"weight\":7}]}");
    const double s = 0.0625 * 10;
    const double x = 3 + 5 * s / 2;
    program_call c =
        program_run("gradient free.json --loss - --wrt v0,mass,q0,force,dt <free_loss.json");
    assert_int_equal(c.code, 0);
    json_t *all = program_line(c.out, 0);
    json_t *g = json_object_get(all, "gradient");
    assert_int_equal(json_object_size(g), 5);
    /* a dozen roundings of numbers below 50 */
    assert_near(program_number(all, "loss"), 0.5 * (x - 1) * (x - 1) + 21, 1e-13);
    assert_near(program_entry(g, "q0", 1), x - 1, 1e-13);
    assert_near(program_entry(g, "v0", 1), x - 1 + 7, 1e-13);
    assert_near(program_entry(g, "mass", 0), (x - 1) * (-5 * s / 4), 1e-13);
    assert_near(program_entry(g, "force", 1), (x - 1) * s / 2, 1e-13);
    assert_near(program_entry(g, "dt", 0), (x - 1) * (4 * 3 + 2.5 * 0.25 * 20), 1e-12);
    json_decref(all);
    program_free(&c);
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
    program_write("x_loss.json", "{\"terms\":[{\"body\":1,\"component\":\"x\"}]}");
    snprintf(text, sizeof text, form, "");
    program_write("without.json", text);
    snprintf(text, sizeof text, form, "\"inertia\":0.25,");
    program_write("with.json", text);
    program_call a = program_run("gradient without.json --loss x_loss.json");
    program_call b = program_run("gradient with.json --loss x_loss.json");
    assert_int_equal(a.code | b.code, 0);
    json_t *ja = program_line(a.out, 0);
    json_t *jb = program_line(b.out, 0);
    json_t *ga = json_object_get(ja, "gradient");
    json_t *gb = json_object_get(jb, "gradient");
    assert_true(program_entry(gb, "inertia", 1) != 0);
    const double total = program_entry(gb, "mass", 1) + 0.125 * program_entry(gb, "inertia", 1);
    assert_near(program_entry(ga, "mass", 1), total, 1e-15);
    json_decref(ja);
    json_decref(jb);
    program_free(&a);
    program_free(&b);
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
        program_write("wrong.json", cases[k].text);
        program_refuses("gradient %/scenes/a_slide.json --loss wrong.json", cases[k].message);
    }
    program_write("loss.json", BALL_HEIGHT);
    program_refuses("gradient %/scenes/a_slide.json --loss loss.json --wrt mass,colour",
                    "\"colour\" is not known");
    program_refuses("gradient %/scenes/a_slide.json --loss loss.json --check=0", "--check: \"0\"");
    program_refuses("gradient %/scenes/a_slide.json --loss loss.json --wrt ''", "--wrt: \"\"");
}

/* A disc slides to a stop after v^2 / (2 mu g): smoothed, d/dv is off by a little. */
static void gradient_is_smoothed(void **state)
{
    (void)state;
    double by_speed[2];
    program_write("loss.json", "{\"terms\":[{\"step\":\"final\",\"body\":1,\"component\":\"x\"}]}");
    for (int k = 0; k < 2; k++) {
        program_call c =
            program_run(k ? "gradient %/scenes/a_slide.json --loss loss.json --smoothing 1e-6"
                          : "gradient %/scenes/a_slide.json --loss loss.json");
        assert_int_equal(c.code, 0);
        json_t *all = program_line(c.out, 0);
        const json_t *v0 = json_object_get(json_object_get(all, "gradient"), "v0");
        by_speed[k] = json_number_value(json_array_get(v0, 4));
        assert_true(!k == !json_object_get(all, "unsmoothed"));
        if (k) assert_true(program_number(all, "unsmoothed") == 0);
        json_decref(all);
        program_free(&c);
    }
    assert_true(by_speed[0] != by_speed[1]);
    assert_near(by_speed[1], by_speed[0], 1e-3);
    program_refuses("gradient %/scenes/a_slide.json --loss loss.json --smoothing -1",
                    "--smoothing: \"-1\"");
}

/* --- contact, lcp */

/* Circle at (0, 0) and box at (3, 0): distance, normal and points known without computing. */
static void contact_of_given_pairs(void **state)
{
    (void)state;
    program_write(
        "pairs.json",
        "{\"vectors\":[{\"id\":\"one\",\"note\":1,\"A\":{\"type\":\"circle\",\"radius\":1},"
        "\"poseA\":[0.5,10,20],\"B\":{\"type\":\"hull\",\"vertices\":[[-1,-1],[1,-1],[1,1],"
        "[-1,1]]},\"poseB\":[0,13,20]}]}");
    program_call c = program_run("contact pairs.json");
    assert_int_equal(c.code, 0);
    assert_int_equal(program_count_lines(c.out), 1);
    json_t *p = program_line(c.out, 0);
    assert_string_equal(json_string_value(json_object_get(p, "id")), "one");
    assert_string_equal(json_string_value(json_object_get(p, "feature")), "edge");
    assert_near(program_number(p, "distance"), 1, 1e-14);
    assert_near(program_entry(p, "normal", 0), 1, 1e-15);
    assert_near(program_entry(p, "normal", 1), 0, 1e-15);
    json_t *points = json_object_get(p, "points");
    assert_int_equal(json_array_size(points), 1);
    json_t *point = json_array_get(points, 0);
    assert_near(program_entry(point, "pA", 0), 11, 1e-14);
    assert_near(program_entry(point, "pA", 1), 20, 1e-14);
    assert_near(program_entry(point, "pB", 0), 12, 1e-14);
    assert_near(program_number(point, "gap"), 1, 1e-14);
    json_decref(p);
    program_free(&c);
    program_refuses("contact %/scenes/a_slide.json", "vectors: must be an array of pairs");
    program_write("pairs.json",
                  "[{\"id\":1,\"A\":{\"type\":\"circle\",\"radius\":-1},\"poseA\":[0,0,0]}]");
    program_refuses("contact pairs.json", "pairs.json: [0].A.radius: ");
}

/* Every vector: as many lines, ids in order, distances within 1e-13 of the pair's size. */
static void contact_of_the_vectors(void **state)
{
    (void)state;
    json_t *file = json_load_file(TEST_DATA "/geometry/vectors.json", 0, NULL);
    json_t *vectors = json_object_get(file, "vectors");
    program_call c = program_run("contact %/geometry/vectors.json");
    assert_int_equal(c.code, 0);
    assert_int_equal((size_t)program_count_lines(c.out), json_array_size(vectors));
    for (int k = 0; k < program_count_lines(c.out); k++) {
        json_t *line = program_line(c.out, k);
        const json_t *v = json_array_get(vectors, (size_t)k);
        assert_true(program_number(line, "id") == program_number(v, "id"));
        assert_near_case("distance", k, program_number(line, "distance"),
                         program_number(v, "distance"), program_number(v, "tol_relative_frame"));
        json_decref(line);
    }
    program_free(&c);
    json_decref(file);
}

/* One contact by hand: mass 2 falls on a floor, q = -(M v + h f) = 3: l_n = 3, v = 0. */
static void lcp_solves_by_hand(void **state)
{
    (void)state;
    program_write(
        "one.json",
        "{\"name\":\"one\",\"M\":[1,2,2],\"J_e\":{\"rows\":0,\"cols\":3,\"i\":[],\"j\":[],"
        "\"x\":[]},"
        "\"J_c\":{\"rows\":1,\"cols\":3,\"i\":[0],\"j\":[2],\"x\":[1]},\"J_t\":{\"rows\":1,"
        "\"cols\":3,\"i\":[0],\"j\":[1],\"x\":[-1]},\"mu\":[0.5],\"c\":[0],\"q\":[0,-4,3],"
        "\"v\":[NaN,-Infinity,Infinity]}");
    program_call c = program_run("lcp one.json");
    if (c.code != 0) fail_msg("exit %d: %s", c.code, c.err);
    json_t *p = program_line(c.out, 0);
    assert_string_equal(json_string_value(json_object_get(p, "name")), "one");
    assert_string_equal(json_string_value(json_object_get(p, "status")), "solved");
    /* slip: |l_t| = 0.5 * 3; 2 vx = 4 - 1.5 */
    assert_near(program_entry(p, "lam_n", 0), 3, 1e-9);
    assert_near(program_entry(p, "lam_t", 0), 1.5, 1e-9);
    assert_near(program_entry(p, "v", 1), 1.25, 1e-9);
    assert_near(program_entry(p, "v", 2), 0, 1e-9);
    assert_int_equal(json_array_size(json_object_get(p, "lam_e")), 0);
    assert_true(program_number(p, "residual") <= 1e-10 && program_number(p, "seconds") > 0);
    assert_true(program_number(p, "factorizations") >= 1);
    assert_true(json_is_string(json_object_get(p, "stage")));
    json_decref(p);
    program_free(&c);
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
        program_call c = program_run(arguments);
        json_t *p = program_line(c.out, 0);
        assert_non_null(p);
        assert_string_equal(json_string_value(json_object_get(p, "name")), cases[k].file);
        assert_string_equal(json_string_value(json_object_get(p, "status")), cases[k].status);
        assert_int_equal(c.code, strcmp(cases[k].status, "failed") == 0 ? 2 : 0);
        json_decref(p);
        program_free(&c);
    }
    /* a wrong file does not keep the others from being solved */
    program_write("none.json", "{\"M\":[1,1,0]}");
    program_call c = program_run("lcp none.json %/lcp/000_stack2_top1_mu0.5_push0.0.json");
    assert_int_equal(c.code, 1);
    assert_int_equal(program_count_lines(c.out), 1);
    assert_non_null(strstr(c.err, "none.json: J_c.rows: must be given"));
    program_free(&c);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(gradient_has_its_arrays),
        cmocka_unit_test(gradient_of_a_free_body),
        cmocka_unit_test(gradient_is_smoothed),
        cmocka_unit_test(mass_carries_its_inertia),
        cmocka_unit_test(wrong_losses),
        cmocka_unit_test(contact_of_given_pairs),
        cmocka_unit_test(contact_of_the_vectors),
        cmocka_unit_test(lcp_solves_by_hand),
        cmocka_unit_test(lcp_of_the_data),
    };
    return cmocka_run_group_tests(tests, program_make_folder, program_remove_folder);
}
