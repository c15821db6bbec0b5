/* Scene files: what is read, every kind of fault with its place, masses from shapes. */
#include "near.h"

#include "clients/c/scene/scene.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static const char *const SCENES[] = {
    "a_slide",         "b_incline_stick", "c_slide_roll",      "d_bounce_e80", "e_cradle",
    "f_double",        "f_pendulum",      "g_stack10",         "g_stack30",    "h_ratio1e3",
    "h_tower4",        "i_pyramid10",     "i_pyramid50",       "j_pile100",    "j_pile1000",
    "k_oblique_stick", "l_arch12",        "n_chain_heavy_hang"};

/* Writes text to a file of its own and reads it as a scene. */
static crm_scene *read_text(const char *text, crm_problems *problems)
{
    static char name[64];
    snprintf(name, sizeof name, "/tmp/carom_test_scene_%ld.json", (long)getpid());
    FILE *f = fopen(name, "w");
    assert_non_null(f);
    fputs(text, f);
    fclose(f);
    *problems = crm_problems_of(name);
    crm_scene *scene = crm_scene_read(problems);
    remove(name);
    return scene;
}

static void expect_valid(crm_scene *scene, const crm_problems *problems)
{
    if (!scene) fail_msg("%s", problems->count ? problems->text[0] : "no scene, no fault");
}

/* A scene with one body, whose members follow "type". */
static const char *with_body(const char *members)
{
    static char text[2048];
    snprintf(text, sizeof text,
             "{\"format\":\"carom-scene/1\",\"duration\":1,\"bodies\":[{\"type\":\"dynamic\",%s}]}",
             members);
    return text;
}

static void scenes_of_the_data_are_read(void **state)
{
    (void)state;
    for (size_t k = 0; k < sizeof SCENES / sizeof SCENES[0]; k++) {
        char name[256];
        snprintf(name, sizeof name, "%s/scenes/%s.json", TEST_DATA, SCENES[k]);
        crm_problems problems = crm_problems_of(name);
        crm_scene *scene = crm_scene_read(&problems);
        expect_valid(scene, &problems);
        assert_string_equal(scene->name, SCENES[k]);
        assert_true(scene->duration > 0 && scene->sample > 0);
        crm_scene_free(scene);
    }
}

typedef struct fault {
    const char *name;
    const char *text;  /* a whole file */
    const char *place; /* what follows the file's name: place and the start of the sentence */
} fault;

#define HEAD           "{\"format\":\"carom-scene/1\","
#define BALL           "\"mass\":1,\"shape\":{\"type\":\"circle\",\"radius\":1}"
#define ONE(members)   HEAD "\"bodies\":[{" members "}]}"
#define HULL(vertices) ONE("\"mass\":1,\"shape\":{\"type\":\"hull\",\"vertices\":" vertices "}")
#define JOINT(members)                                                                             \
    HEAD "\"bodies\":[{\"name\":\"a\",\"type\":\"static\"},{\"name\":\"b\"," BALL                  \
         "},{\"name\":\"b\"," BALL "},{\"type\":\"static\"}],\"joints\":[{" members "}]}"

static const fault FAULTS[] = {
    {"syntax", "{\"format\":\"carom-scene/1\",\n \"bodies\": [,]}", "line 2, column 13: "},
    {"not finished", "{\"format\":\"carom-scene/1\"", "line 1, column "},
    {"NaN", ONE("\"mass\":NaN"), "line 1, column "},
    {"not an object", "[1]", "must be an object {...}, is an array"},
    {"duplicate", ONE(BALL ",\"mass\":2"), "bodies[0].mass: the key stands twice"},
    {"duplicate, deep",
     HEAD "\"bodies\":[{" BALL
          "},{\"mass\":1,\"shape\":{\"type\":\"circle\",\"radius\":1,\"radius\":1}}]}",
     "bodies[1].shape.radius: the key stands twice"},
    {"duplicate, top", HEAD "\"dt\":1,\"dt\":2,\"bodies\":[]}", "dt: the key stands twice"},
    {"duplicate by escape", HEAD "\"dt\":1,\"d\\u0074\":2,\"bodies\":[]}", "line 1: duplicate"},
    {"unknown key, top", HEAD "\"bodys\":[],\"bodies\":[]}", "bodys: unknown key"},
    {"unknown key, body", ONE(BALL ",\"masss\":1"), "bodies[0].masss: unknown key"},
    {"unknown key, shape",
     ONE("\"mass\":1,\"shape\":{\"type\":\"circle\",\"radius\":1,\"vertices\":[]}"),
     "bodies[0].shape.vertices: unknown key"},
    {"unknown key, filter", ONE(BALL ",\"filter\":{\"bits\":1}"), "bodies[0].filter.bits: unknown"},
    {"no format", "{\"bodies\":[]}", "format: must be given"},
    {"other format", "{\"format\":\"carom-scene/2\",\"bodies\":[]}",
     "format: is \"carom-scene/2\""},
    {"no bodies", HEAD "\"dt\":1}", "bodies: must be an array"},
    {"bodies no array", HEAD "\"bodies\":{}}", "bodies: must be an array"},
    {"dt zero", HEAD "\"dt\":0,\"bodies\":[]}", "dt: must be > 0 [s], is 0"},
    {"dt text", HEAD "\"dt\":\"a\",\"bodies\":[]}", "dt: must be a number, is \"a\""},
    {"duration negative", HEAD "\"duration\":-1,\"bodies\":[]}",
     "duration: must be >= 0 [s], is -1"},
    {"sample zero", HEAD "\"sample\":0,\"bodies\":[]}", "sample: must be > 0 [s], is 0"},
    {"gravity short", HEAD "\"gravity\":[1],\"bodies\":[]}",
     "gravity: must be an array of 2 numbers"},
    {"gravity text", HEAD "\"gravity\":[1,\"a\"],\"bodies\":[]}", "gravity[1]: must be a number"},
    {"setting unknown", HEAD "\"settings\":{\"margn\":1},\"bodies\":[]}", "settings.margn: "},
    {"setting word", HEAD "\"settings\":{\"integrator\":\"magic\"},\"bodies\":[]}",
     "settings.integrator: "},
    {"setting kind", HEAD "\"settings\":{\"margin\":[1]},\"bodies\":[]}",
     "settings.margin: must be a number or a word"},
    {"setting gravity", HEAD "\"settings\":{\"gravity\":1},\"bodies\":[]}",
     "settings.gravity: gravity stands at the top"},
    {"dt twice", HEAD "\"dt\":1,\"settings\":{\"dt\":1},\"bodies\":[]}",
     "settings.dt: dt also stands"},
    {"body no object", HEAD "\"bodies\":[1]}", "bodies[0]: must be an object"},
    {"type", ONE("\"type\":\"fixed\""), "bodies[0].type: \"fixed\" is not known; one of: dynamic"},
    {"no mass", ONE("\"shape\":{\"type\":\"circle\",\"radius\":1}"),
     "bodies[0].mass: a dynamic body needs a mass"},
    {"mass negative", ONE("\"mass\":-1,\"inertia\":1"), "bodies[0].mass: must be > 0 [kg], is -1"},
    {"inertia zero", ONE("\"mass\":1,\"inertia\":0"), "bodies[0].inertia: must be > 0"},
    {"inertia needed", ONE("\"mass\":1"), "bodies[0].inertia: must be given"},
    {"density and mass", ONE(BALL ",\"density\":1"), "bodies[0].density: mass and inertia follow"},
    {"density negative", ONE("\"density\":-1,\"shape\":{\"type\":\"circle\",\"radius\":1}"),
     "bodies[0].density: must be > 0"},
    {"density, no area", ONE("\"density\":1"), "bodies[0].density: the body has no area"},
    {"density, centroid",
     ONE("\"density\":1,\"shape\":{\"type\":\"hull\",\"vertices\":[[0,0],[2,0],[2,2],[0,2]]}"),
     "bodies[0].density: the centroid of the shape is at (1, 1)"},
    {"friction", ONE(BALL ",\"friction\":-0.5"), "bodies[0].friction: must be >= 0, is -0.5"},
    {"restitution", ONE(BALL ",\"restitution\":1.5"), "bodies[0].restitution: must be from 0 to 1"},
    {"collide", ONE(BALL ",\"collide\":1"), "bodies[0].collide: must be true or false, is 1"},
    {"position", ONE(BALL ",\"position\":[0]"), "bodies[0].position: must be an array of 2"},
    {"static moves", ONE("\"type\":\"static\",\"velocity\":[1,0]"),
     "bodies[0].velocity: a static body does not move"},
    {"static spins", ONE("\"type\":\"static\",\"angular_velocity\":1"),
     "bodies[0].angular_velocity: a static body does not move"},
    {"category", ONE(BALL ",\"filter\":{\"category\":-1}"),
     "bodies[0].filter.category: must be a whole"},
    {"group", ONE(BALL ",\"filter\":{\"group\":0.5}"), "bodies[0].filter.group: must be a whole"},
    {"forces", ONE(BALL ",\"forces\":[1,2]"), "bodies[0].forces: must be [torque, fx, fy]"},
    {"force row", ONE(BALL ",\"forces\":[[0,0,0]]"), "bodies[0].forces[0]: must be an array of 4"},
    {"force times", ONE(BALL ",\"forces\":[[0,0,0,0],[0,0,0,0]]"),
     "bodies[0].forces[1][0]: times must increase"},
    {"two shapes keys", ONE(BALL ",\"shapes\":[]"), "bodies[0].shapes: stands beside shape"},
    {"shapes kind", ONE("\"mass\":1,\"inertia\":1,\"shapes\":{}"),
     "bodies[0].shapes: must be an array"},
    {"no shape type", ONE("\"mass\":1,\"shape\":{\"radius\":1}"),
     "bodies[0].shape.type: must be given"},
    {"shape type", ONE("\"mass\":1,\"shape\":{\"type\":\"box\"}"),
     "bodies[0].shape.type: \"box\" is not"},
    {"no radius", ONE("\"mass\":1,\"shape\":{\"type\":\"circle\"}"),
     "bodies[0].shape.radius: must be given"},
    {"radius zero", ONE("\"mass\":1,\"shape\":{\"type\":\"circle\",\"radius\":0}"),
     "bodies[0].shape.radius: "},
    {"no vertices", ONE("\"mass\":1,\"shape\":{\"type\":\"hull\"}"),
     "bodies[0].shape.vertices: must be an array of points"},
    {"empty vertices", HULL("[]"), "bodies[0].shape.vertices: must be an array of points"},
    {"two vertices", HULL("[[0,0],[1,0]]"), "bodies[0].shape.vertices: a hull has three"},
    {"vertex kind", HULL("[[0,0],[1,0],[1]]"),
     "bodies[0].shape.vertices[2]: must be an array of 2"},
    {"clockwise", HULL("[[-1,-1],[-1,1],[1,1],[1,-1]]"), "bodies[0].shape"},
    {"reflex", HULL("[[-1,-1],[1,-1],[0,0],[1,1],[-1,1]]"), "bodies[0].shape.vertices[2]: "},
    {"duplicate vertex", HULL("[[-1,-1],[1,-1],[1,-1],[0,1]]"), "bodies[0].shape.vertices["},
    {"capsule radius",
     ONE("\"mass\":1,\"shape\":{\"type\":\"capsule\",\"vertices\":[[0,0],[1,0]]}"),
     "bodies[0].shape.radius: must be given"},
    {"capsule thin",
     ONE("\"mass\":1,\"shape\":{\"type\":\"capsule\",\"vertices\":[[0,0],[1,0]],\"radius\":0}"),
     "bodies[0].shape.radius: must be > 0 for a capsule"},
    {"second shape",
     ONE("\"mass\":1,\"shapes\":[{\"type\":\"circle\",\"radius\":1},{\"type\":\"circle\","
         "\"radius\":-1}]"),
     "bodies[0].shapes[1].radius: "},
    {"joint type", JOINT("\"type\":\"glue\""),
     "joints[0].type: \"glue\" is not known; one of: revolute, prismatic, weld"},
    {"axis of a weld",
     JOINT("\"type\":\"weld\",\"body_a\":0,\"body_b\":1,\"anchor\":[0,0],\"axis\":[1,0]"),
     "joints[0].axis: unknown key"},
    {"no axis", JOINT("\"type\":\"prismatic\",\"body_a\":0,\"body_b\":1,\"anchor\":[0,0]"),
     "joints[0].axis: must be given"},
    {"no anchor_b", JOINT("\"type\":\"distance\",\"body_a\":0,\"body_b\":1,\"anchor\":[0,0]"),
     "joints[0].anchor_b: must be given"},
    {"limits crossed",
     JOINT("\"type\":\"revolute\",\"body_a\":0,\"body_b\":1,\"anchor\":[0,0],\"lower\":1,"
           "\"upper\":0"),
     "joints[0].lower: must be below upper"},
    {"slack for ever",
     JOINT("\"type\":\"rope\",\"body_a\":0,\"body_b\":1,\"anchor\":[0,0],\"anchor_b\":[1,0]"),
     "joints[0].upper: must be given"},
    {"target without pull", JOINT("\"type\":\"target\",\"body_a\":0,\"body_b\":1,\"anchor\":[0,0]"),
     "joints[0].stiffness: must be given"},
    {"motor without limit",
     JOINT("\"type\":\"revolute\",\"body_a\":0,\"body_b\":1,\"anchor\":[0,0],\"motor_speed\":1"),
     "joints[0].motor_limit: must be given"},
    {"negative damping",
     JOINT("\"type\":\"revolute\",\"body_a\":0,\"body_b\":1,\"anchor\":[0,0],\"damping\":-1"),
     "joints[0].damping: must be >= 0"},
    {"no joint type", JOINT("\"body_a\":0"), "joints[0].type: must be given"},
    {"joint key",
     JOINT("\"type\":\"revolute\",\"body_a\":0,\"body_b\":1,\"anchor\":[0,0],\"limit\":1"),
     "joints[0].limit: unknown key"},
    {"no body_b", JOINT("\"type\":\"revolute\",\"body_a\":0,\"anchor\":[0,0]"),
     "joints[0].body_b: must be given"},
    {"body range", JOINT("\"type\":\"revolute\",\"body_a\":0,\"body_b\":4,\"anchor\":[0,0]"),
     "joints[0].body_b: must be a whole number from 0 to 3, is 4"},
    {"body name", JOINT("\"type\":\"revolute\",\"body_a\":\"z\",\"body_b\":1,\"anchor\":[0,0]"),
     "joints[0].body_a: no body is named \"z\""},
    {"name twice",
     JOINT("\"type\":\"revolute\",\"body_a\":\"a\",\"body_b\":\"b\",\"anchor\":[0,0]"),
     "joints[0].body_b: bodies[1] and bodies[2] are both named \"b\""},
    {"same body", JOINT("\"type\":\"revolute\",\"body_a\":1,\"body_b\":1,\"anchor\":[0,0]"),
     "joints[0].body_b: joins the body to itself"},
    {"both static", JOINT("\"type\":\"revolute\",\"body_a\":0,\"body_b\":3,\"anchor\":[0,0]"),
     "joints[0]: neither body is dynamic"},
    {"no anchor", JOINT("\"type\":\"revolute\",\"body_a\":0,\"body_b\":1"),
     "joints[0].anchor: must be given"},
};

/* The mark that some editors put in front. */
static void a_byte_order_mark_is_no_fault(void **state)
{
    (void)state;
    crm_problems problems;
    crm_scene *scene = read_text("\xEF\xBB\xBF" HEAD "\"bodies\":[]}", &problems);
    expect_valid(scene, &problems);
    crm_scene_free(scene);
    crm_problems_free(&problems);
}

static void files_without_text(void **state)
{
    static const char *const texts[] = {"", " \n\t\n", "\xEF\xBB\xBF"};
    (void)state;
    for (size_t k = 0; k < sizeof texts / sizeof texts[0]; k++) {
        crm_problems problems;
        assert_null(read_text(texts[k], &problems));
        assert_int_equal(problems.count, 1);
        assert_non_null(strstr(problems.text[0], ": the file is empty"));
        crm_problems_free(&problems);
    }
    crm_problems problems = crm_problems_of("/tmp"); /* a folder */
    assert_null(crm_scene_read(&problems));
    assert_non_null(strstr(problems.text[0], "/tmp: cannot be read: "));
    crm_problems_free(&problems);
}

static void faults_name_their_place(void **state)
{
    (void)state;
    for (size_t k = 0; k < sizeof FAULTS / sizeof FAULTS[0]; k++) {
        crm_problems problems;
        crm_scene *scene = read_text(FAULTS[k].text, &problems);
        if (scene) fail_msg("%s: was read", FAULTS[k].name);
        char start[512];
        snprintf(start, sizeof start, "%s: %s", problems.file, FAULTS[k].place);
        if (problems.count != 1 || strncmp(problems.text[0], start, strlen(start)) != 0) {
            fail_msg("%s: %d faults, the first: %s\n wanted: %s", FAULTS[k].name, problems.count,
                     problems.count ? problems.text[0] : "", start);
        }
        crm_problems_free(&problems);
    }
}

static void all_faults_come_at_once(void **state)
{
    (void)state;
    crm_problems problems;
    crm_scene *scene =
        read_text(HEAD "\"dt\":-1,\"x\":1,\"bodies\":[{\"mass\":-1,\"mass\":0,\"friction\":-1}],"
                       "\"joints\":[{\"type\":\"glue\"}]}",
                  &problems);
    assert_null(scene);
    /* dt; x; mass twice; mass = 0; friction; joint type.  Inertia is not asked for beside them. */
    assert_int_equal(problems.count, 6);
    crm_problems_free(&problems);
}

static void ignored_keys(void **state)
{
    (void)state;
    crm_problems problems;
    crm_scene *scene = read_text(
        HEAD "\"_note\":1,\"reference\":{\"a\":[]},\"settings\":{\"_n\":1},\"bodies\":[{\"_n\":{},"
             "\"reference\":2,\"mass\":1,\"shape\":{\"type\":\"circle\",\"radius\":1,\"_c\":[]}}]}",
        &problems);
    expect_valid(scene, &problems);
    crm_scene_free(scene);
}

static void missing_file(void **state)
{
    (void)state;
    crm_problems problems = crm_problems_of("/nonexistent/scene.json");
    assert_null(crm_scene_read(&problems));
    assert_int_equal(problems.count, 1);
    assert_non_null(strstr(problems.text[0], "/nonexistent/scene.json: cannot be read"));
    crm_problems_free(&problems);
}

static void values_are_taken(void **state)
{
    (void)state;
    crm_problems problems;
    crm_scene *scene = read_text(
        HEAD
        "\"name\":\"n\",\"gravity\":[1,2],\"dt\":0.25,\"duration\":3,\"sample\":0.5,"
        "\"settings\":{\"margin\":1e-3,\"combine_friction\":\"max\",\"project_overlap\":false},"
        "\"bodies\":[{\"name\":\"w\",\"type\":\"static\"},{\"name\":\"m\",\"mass\":2,\"inertia\":3,"
        "\"position\":[4,5],\"angle\":6,\"velocity\":[7,8],\"angular_velocity\":9,"
        "\"friction\":0.25,\"restitution\":0.5,\"collide\":false,"
        "\"filter\":{\"category\":2,\"mask\":4294967295,\"group\":-3},\"forces\":[10,11,12],"
        "\"shapes\":[{\"type\":\"circle\",\"radius\":1,\"center\":[0.5,-1]},"
        "{\"type\":\"capsule\",\"vertices\":[[0,0],[1,0]],\"radius\":0.5}]}],"
        "\"joints\":[{\"type\":\"revolute\",\"body_a\":\"w\",\"body_b\":\"m\",\"anchor\":[1,2]},"
        "{\"type\":\"wheel\",\"body_a\":\"w\",\"body_b\":\"m\",\"anchor\":[1,2],\"axis\":[3,4],"
        "\"lower\":-0.5,\"upper\":0.25,\"restitution\":0.75,\"collide\":true,"
        "\"stiffness\":11,\"damping\":12,\"rest\":-13,\"motor_speed\":-14,\"motor_limit\":15},"
        "{\"type\":\"rope\",\"body_a\":\"w\",\"body_b\":\"m\",\"anchor\":[1,2],\"anchor_b\":[5,6],"
        "\"upper\":9}]}",
        &problems);
    expect_valid(scene, &problems);
    const carom_body_def *d = &scene->bodies[1].def;
    const carom_world_settings *s = &scene->settings;
    assert_true(s->gravity[0] == 1 && s->gravity[1] == 2 && s->dt == 0.25 && s->margin == 1e-3);
    assert_true(s->combine_friction == CAROM_COMBINE_MAX && s->project_overlap == 0);
    assert_true(scene->duration == 3 && scene->sample == 0.5);
    assert_true(d->mass == 2 && d->inertia == 3 && d->pose.x == 4 && d->pose.y == 5);
    assert_true(d->pose.angle == 6 && d->velocity[0] == 9 && d->velocity[1] == 7);
    assert_true(d->velocity[2] == 8 && d->friction == 0.25 && d->restitution == 0.5);
    assert_true(d->collide == 0 && d->filter.category == 2 && d->filter.mask == 4294967295u);
    assert_true(d->filter.group == -3 && d->force[0] == 10 && d->force[2] == 12);
    assert_true(d->n_shapes == 2 && d->shapes[0].vertices[0].y == -1 && d->shapes[1].count == 2);
    const carom_joint_def *j = scene->joints;
    assert_true(scene->n_joints == 3 && j[0].kind == CAROM_REVOLUTE && j[0].body_b == 1);
    assert_true(j[0].anchor.y == 2 && !(j[0].lower > -HUGE_VAL) && !j[0].collide);
    assert_true(j[1].kind == CAROM_WHEEL && j[1].axis.x == 3 && j[1].lower == -0.5);
    assert_true(j[1].upper == 0.25 && j[1].restitution == 0.75 && j[1].collide);
    assert_true(j[1].stiffness == 11 && j[1].damping == 12 && j[1].rest == -13);
    assert_true(j[1].motor_speed == -14 && j[1].motor_limit == 15);
    assert_true(j[2].kind == CAROM_ROPE && j[2].anchor_b.y == 6 && j[2].upper == 9);
    crm_scene_free(scene);
}

/* Closed forms of mass and of inertia about the position. */
typedef struct mass_case {
    const char *name;
    const char *members;
    double mass;
    double inertia;
} mass_case;

static void masses_follow_from_shapes(void **state)
{
    (void)state;
    const double pi = acos(-1);
    /* capsule 2a x 2r: rectangle + two half discs at distance a; 4r/(3 pi) to a half's centroid */
    const double a = 1;
    const double r = 0.5;
    const double rect = 4 * a * r;
    const double disc = pi * r * r;
    const double half = 4 * r / (3 * pi);
    const double second = rect * (4 * a * a + 4 * r * r) / 12 + disc * (0.5 * r * r - half * half) +
                          disc * (a + half) * (a + half);
    const mass_case cases[] = {
        {"disc, mass", "\"mass\":3,\"shape\":{\"type\":\"circle\",\"radius\":2}", 3, 3 * 0.5 * 4},
        {"disc, density", "\"density\":3,\"shape\":{\"type\":\"circle\",\"radius\":2}", 3 * pi * 4,
         3 * pi * 4 * 0.5 * 4},
        {"box, mass",
         "\"mass\":5,\"shape\":{\"type\":\"hull\",\"vertices\":[[-1,-2],[1,-2],[1,2],[-1,2]]}", 5,
         5 * (4.0 + 16.0) / 12},
        {"box, density",
         "\"density\":5,\"shape\":{\"type\":\"hull\",\"vertices\":[[-1,-2],[1,-2],[1,2],[-1,2]]}",
         40, 40 * (4.0 + 16.0) / 12},
        {"rod", "\"mass\":6,\"shape\":{\"type\":\"segment\",\"vertices\":[[-1,0],[1,0]]}", 6,
         6 * 4.0 / 12},
        {"rod by its end", "\"mass\":6,\"shape\":{\"type\":\"segment\",\"vertices\":[[0,0],[2,0]]}",
         6, 6 * 4.0 / 3},
        {"capsule",
         "\"mass\":1,\"shape\":{\"type\":\"capsule\",\"vertices\":[[-1,0],[1,0]],\"radius\":0.5}",
         1, second / (rect + disc)},
        {"two discs",
         "\"density\":1,\"shapes\":[{\"type\":\"circle\",\"radius\":1,\"center\":[-2,0]},"
         "{\"type\":\"circle\",\"radius\":1,\"center\":[2,0]}]",
         2 * pi, 2 * pi * (0.5 + 4)},
    };
    for (size_t k = 0; k < sizeof cases / sizeof cases[0]; k++) {
        crm_problems problems;
        crm_scene *scene = read_text(with_body(cases[k].members), &problems);
        expect_valid(scene, &problems);
        const carom_body_def *d = &scene->bodies[0].def;
        /* sums of at most a dozen products: 1e-14 relative is 50 units of rounding */
        if (!(fabs(d->mass - cases[k].mass) <= 1e-14 * cases[k].mass) ||
            !(fabs(d->inertia - cases[k].inertia) <= 1e-14 * cases[k].inertia)) {
            fail_msg("%s: mass %.17g inertia %.17g, wanted %.17g %.17g", cases[k].name, d->mass,
                     d->inertia, cases[k].mass, cases[k].inertia);
        }
        crm_scene_free(scene);
    }
}

/* Forces act as long as their rows say, whatever the steps: impulse over [0, 1] is exact. */
static void force_table_keeps_its_impulse(void **state)
{
    (void)state;
    crm_problems problems;
    crm_scene *scene = read_text(
        with_body("\"mass\":1,\"inertia\":1,\"forces\":[[0.1,1,0,0],[0.35,0,2,0],[0.7,0,0,-3]]"),
        &problems);
    expect_valid(scene, &problems);
    const double wanted[3] = {0.25, 0.7, -0.9};
    for (int n = 1; n <= 7; n++) {
        double impulse[3] = {0, 0, 0};
        for (int k = 0; k < n; k++) {
            double force[3];
            const double dt = 1.0 / n;
            assert_int_equal(crm_scene_force(scene, k * dt, dt, force), 1);
            for (int i = 0; i < 3; i++) impulse[i] += dt * force[i];
        }
        for (int i = 0; i < 3; i++) {
            /* a handful of roundings of numbers near 1 */
            if (fabs(impulse[i] - wanted[i]) > 1e-14) fail_msg("%d steps: %g", n, impulse[i]);
        }
    }
    crm_scene_free(scene);
}

/* Loss <gm, mass> + <gi, inertia> of one body, as a function of what the file says. */
static double mass_loss(const char *members)
{
    crm_problems problems;
    crm_scene *scene = read_text(with_body(members), &problems);
    expect_valid(scene, &problems);
    const double loss = 3 * scene->bodies[0].def.mass - 7 * scene->bodies[0].def.inertia;
    crm_scene_free(scene);
    return loss;
}

static void hull_members(char *text, size_t size, const char *mass, double dx, double dr)
{
    /* a box: its centroid is 0, so that the density is accepted */
    snprintf(text, size,
             "%s,\"shape\":{\"type\":\"hull\",\"radius\":%.17g,"
             "\"vertices\":[[%.17g,-2],[1,-2],[1,2],[-1,2]]}",
             mass, 0.25 + dr, -1 + dx);
}

static void chain_matches_differences(void **state)
{
    (void)state;
    /* with a density the centroid may move by 1e-6 of the extent; h below that is h^2 = 1e-14
     * against a rounding error of 1e-16 / h = 1e-9 */
    const double h = 1e-7;
    const char *const masses[] = {"\"mass\":2", "\"density\":2", "\"mass\":2,\"inertia\":5"};
    for (int k = 0; k < 3; k++) {
        char text[512];
        hull_members(text, sizeof text, masses[k], 0, 0);
        crm_problems problems;
        crm_scene *scene = read_text(with_body(text), &problems);
        expect_valid(scene, &problems);
        double mass = 3;
        const double inertia = -7;
        double radius = 0;
        carom_vec2 vertices[4] = {{0, 0}, {0, 0}, {0, 0}, {0, 0}};
        crm_scene_chain(scene, &mass, &inertia, &radius, vertices);
        const carom_body_def *d = &scene->bodies[0].def;
        const double total = k == 2 ? 3 : 3 - 7 * d->inertia / d->mass;
        assert_true(mass == total);
        crm_scene_free(scene);
        double loss[4];
        for (int i = 0; i < 4; i++) {
            const double step = i % 2 ? -h : h;
            hull_members(text, sizeof text, masses[k], i < 2 ? step : 0, i < 2 ? 0 : step);
            loss[i] = mass_loss(text);
        }
        const double by_x = (loss[0] - loss[1]) / (2 * h);
        const double by_r = (loss[2] - loss[3]) / (2 * h);
        /* rounding: 1e-16 * |loss| (700) / h = 1e-6, a few times */
        if (fabs(by_x - vertices[0].x) > 1e-5 || fabs(by_r - radius) > 1e-5) {
            fail_msg("%s: vertex %g, difference %g; radius %g, difference %g", masses[k],
                     vertices[0].x, by_x, radius, by_r);
        }
    }
}

static void segment_chain_matches_differences(void **state)
{
    (void)state;
    char text[256];
    const char *form =
        "\"mass\":2,\"shape\":{\"type\":\"segment\",\"vertices\":[[%.17g,0.5],[2,-1]]}";
    snprintf(text, sizeof text, form, -1.0);
    crm_problems problems;
    crm_scene *scene = read_text(with_body(text), &problems);
    expect_valid(scene, &problems);
    double mass = 3;
    const double inertia = -7;
    carom_vec2 vertices[2] = {{0, 0}, {0, 0}};
    crm_scene_chain(scene, &mass, &inertia, NULL, vertices);
    crm_scene_free(scene);
    double loss[2];
    for (int i = 0; i < 2; i++) {
        snprintf(text, sizeof text, form, i ? -1.25 : -0.75);
        loss[i] = mass_loss(text);
    }
    /* the gyration is quadratic in a vertex: a central difference is exact but for rounding */
    assert_true(fabs((loss[0] - loss[1]) / 0.5 - vertices[0].x) < 1e-13);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(scenes_of_the_data_are_read),
        cmocka_unit_test(a_byte_order_mark_is_no_fault),
        cmocka_unit_test(files_without_text),
        cmocka_unit_test(faults_name_their_place),
        cmocka_unit_test(all_faults_come_at_once),
        cmocka_unit_test(ignored_keys),
        cmocka_unit_test(missing_file),
        cmocka_unit_test(values_are_taken),
        cmocka_unit_test(masses_follow_from_shapes),
        cmocka_unit_test(force_table_keeps_its_impulse),
        cmocka_unit_test(chain_matches_differences),
        cmocka_unit_test(segment_chain_matches_differences),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
