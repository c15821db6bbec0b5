#include "client_case.h"

#include "near.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

carom_client_scene case_scene(void)
{
    static const carom_vec2 floor[] = {{-9, -1}, {9, -1}, {9, 1}, {-9, 1}}, point[] = {{0, 0}};
    static const carom_vec2 square[] = {{-0.3, -0.3}, {0.3, -0.3}, {0.3, 0.3}, {-0.3, 0.3}};
    static const carom_shape shapes[CASE_BODIES] = {
        {0, 4, floor}, {0.25, 1, point}, {0.01, 4, square}, {0.1, 1, point}};
    static const double x[] = {0, -0.6, 0.5, 0.5}, y[] = {-1, 0.3, 0.35, 1.1};
    static const char *const names[] = {"dt"}, *const values[] = {"0.01"};
    static carom_body_def bodies[CASE_BODIES];
    static carom_joint_def joints[1];
    carom_client_scene s;
    memset(&s, 0, sizeof s);
    for (int i = 0; i < CASE_BODIES; i++) {
        bodies[i] = carom_body_defaults();
        bodies[i].n_shapes = 1;
        bodies[i].shapes = &shapes[i];
        bodies[i].pose.x = x[i];
        bodies[i].pose.y = y[i];
        bodies[i].inertia = 0.1;
        bodies[i].restitution = 0.3;
    }
    bodies[0].type = CAROM_STATIC;
    bodies[1].velocity[1] = 3;
    s.name = "case";
    s.gravity[1] = -9.81;
    s.n_settings = 1;
    s.setting_names = names;
    s.setting_values = values;
    s.n_bodies = CASE_BODIES;
    s.bodies = bodies;
    joints[0] = carom_joint_defaults(CAROM_REVOLUTE);
    joints[0].body_a = 2;
    joints[0].body_b = 3;
    joints[0].anchor.x = 0.5;
    joints[0].anchor.y = 0.7;
    s.n_joints = 1;
    s.joints = joints;
    return s;
}

static carom_world *direct_world(void)
{
    const carom_client_scene s = case_scene();
    carom_world_settings set = carom_world_defaults();
    carom_world *w = NULL;
    set.dt = 0.01;
    memcpy(set.gravity, s.gravity, sizeof set.gravity);
    assert_true(carom_world_create(&set, NULL, &w) >= 0);
    for (int i = 0; i < s.n_bodies; i++) {
        assert_true(carom_world_add_body(w, &s.bodies[i], NULL) >= 0);
    }
    assert_true(carom_world_add_joint(w, s.joints, NULL) >= 0);
    return w;
}

void case_direct(double q[CASE_STEPS][3 * CASE_BODIES])
{
    carom_world *w = direct_world();
    for (int k = 0; k < CASE_STEPS; k++) {
        assert_true(carom_world_step(w, NULL, NULL) >= 0);
        memcpy(q[k], carom_world_q(w), sizeof q[k]);
    }
    carom_world_destroy(w);
}

typedef struct collected {
    double (*q)[3 * CASE_BODIES];
    int64_t next;
} collected;

static void collect(void *user, const carom_client_state *s)
{
    collected *c = user;
    assert_int_equal(s->step, c->next);
    assert_int_equal(s->n_bodies, CASE_BODIES);
    memcpy(c->q[s->step - 1], s->q, 3 * CASE_BODIES * sizeof(double));
    c->next++;
}

carom_client_code case_through(carom_client *client, int per_request,
                               double q[CASE_STEPS][3 * CASE_BODIES])
{
    const carom_client_scene s = case_scene();
    collected all = {q, 1};
    carom_client_run run;
    memset(&run, 0, sizeof run);
    run.n_steps = per_request;
    run.publish_every = 1;
    run.on_state = collect;
    run.user = &all;
    carom_client_code code = carom_client_open(client, &s);
    while (code >= 0 && all.next <= CASE_STEPS) code = carom_client_step(client, &run);
    if (code >= 0) assert_int_equal(carom_client_last(client).step, CASE_STEPS);
    return code;
}

static void succeeds(carom_client *client, carom_client_code code)
{
    if (code < 0) fail_msg("code %d: %s", code, carom_client_error(client));
}

static void direct_gradient(int coord, double *v0, double *mass, double *restitution)
{
    carom_world *w = direct_world();
    carom_tape *tape = NULL;
    double q_bar[3 * CASE_BODIES] = {0};
    const carom_state_bar bar = {CASE_STEPS, q_bar, NULL};
    carom_gradient g;
    memset(&g, 0, sizeof g);
    g.v0 = v0;
    g.mass = mass;
    g.restitution = restitution;
    q_bar[coord] = 1;
    assert_true(carom_tape_create(w, NULL, &tape) >= 0);
    for (int k = 0; k < CASE_STEPS; k++) assert_true(carom_tape_step(tape, NULL, NULL) >= 0);
    assert_true(carom_tape_gradient(tape, 1, &bar, &g, NULL) >= 0);
    carom_tape_destroy(tape);
    carom_world_destroy(w);
}

void case_gradient(carom_client *client)
{
    enum { COORD = 7 };
    const carom_client_scene s = case_scene();
    const unsigned wanted = CAROM_WRT_V0 | CAROM_WRT_MASS | CAROM_WRT_RESTITUTION;
    double v0[3 * CASE_BODIES], mass[CASE_BODIES], e[CASE_BODIES];
    double q_bar[3 * CASE_BODIES] = {0};
    const carom_state_bar bar = {CASE_STEPS, q_bar, NULL};
    carom_client_run run;
    carom_client_gradient g;
    memset(&run, 0, sizeof run);
    run.n_steps = CASE_STEPS;
    run.record = CAROM_RECORD_ON;
    q_bar[COORD] = 1;
    direct_gradient(COORD, v0, mass, e);
    succeeds(client, carom_client_open(client, &s));
    succeeds(client, carom_client_step(client, &run));
    succeeds(client, carom_client_gradient_of(client, 2.5, 1, &bar, wanted, &g));
    assert_int_equal(g.recorded_steps, CASE_STEPS);
    assert_near(g.cost, 2.5, 0);
    assert_null(g.friction);
    assert_memory_equal(g.v0, v0, sizeof v0);
    assert_memory_equal(g.mass, mass, sizeof mass);
    assert_memory_equal(g.restitution, e, sizeof e);
    assert_true(near_norm(3 * CASE_BODIES, v0) > 0);

    succeeds(client, carom_client_descend(client, 0.01, CAROM_WRT_V0, &g, 0));
    const carom_client_parameters p = carom_client_get_parameters(client);
    assert_int_equal(p.n_bodies, CASE_BODIES);
    assert_int_equal(carom_client_last(client).step, 0);
    for (int i = 3; i < 3 * CASE_BODIES; i++) {
        const double expected = s.bodies[i / 3].velocity[i % 3] - 0.01 * v0[i];
        assert_near_case("v0", i, p.v[i], expected, 1e-15 * (1 + fabs(expected)));
    }
    succeeds(client, carom_client_close(client));
}

void case_session(carom_client *client)
{
    const carom_client_scene s = case_scene();
    carom_client_run run;
    memset(&run, 0, sizeof run);
    run.n_steps = 5;
    assert_int_equal(carom_client_step(client, &run), CAROM_CLIENT_E_SESSION);
    assert_non_null(strstr(carom_client_error(client), "open a scene first"));
    succeeds(client, carom_client_open(client, &s));
    succeeds(client, carom_client_step(client, &run));
    succeeds(client, carom_client_snapshot(client, 1));
    succeeds(client, carom_client_step(client, &run));
    succeeds(client, carom_client_keep_alive(client));
    assert_int_equal(carom_client_last(client).step, 10);
    succeeds(client, carom_client_restore(client, 1));
    assert_int_equal(carom_client_last(client).step, 5);
    assert_int_equal(carom_client_restore(client, 2), CAROM_CLIENT_E_REFUSED);
    assert_non_null(strstr(carom_client_error(client), "no snapshot 2"));
    succeeds(client, carom_client_step(client, &run));
    assert_int_equal(carom_client_last(client).step, 10);
    succeeds(client, carom_client_reset(client));
    assert_int_equal(carom_client_last(client).step, 0);

    carom_body_def bad = carom_body_defaults();
    carom_client_scene wrong = s;
    bad.mass = -1;
    wrong.n_bodies = 1;
    wrong.n_joints = 0;
    wrong.bodies = &bad;
    assert_int_equal(carom_client_open(client, &wrong), CAROM_CLIENT_E_REFUSED);
    assert_non_null(strstr(carom_client_error(client), "mass"));
    /* The session keeps the scene it had. */
    succeeds(client, carom_client_step(client, &run));
    succeeds(client, carom_client_close(client));
    assert_int_equal(carom_client_step(client, &run), CAROM_CLIENT_E_SESSION);
}

/* Opens the text as a scene file. */
static carom_client_code open_text(carom_client *client, const char *text)
{
    char name[64];
    snprintf(name, sizeof name, "/tmp/carom_test_file_%ld.json", (long)getpid());
    FILE *f = fopen(name, "w");
    assert_non_null(f);
    fputs(text, f);
    fclose(f);
    const carom_client_code code = carom_client_open_file(client, name);
    remove(name);
    return code;
}

/* One body of 2 kg, pushed by 4 N along x for 0.05 s by the table of its file, and by 2 N along y
 * in the first step by the caller. */
void case_file(carom_client *client)
{
    static const char *const head = "{\"format\":\"carom-scene/1\",\"gravity\":[0,0],\"dt\":0.01,"
                                    "\"bodies\":[{\"mass\":2,\"inertia\":1,";
    const carom_client_force push = {0, 0, {0, 0, 2}};
    char text[512];
    carom_client_run run;
    memset(&run, 0, sizeof run);
    run.n_steps = 10;
    run.n_forces = 1;
    run.forces = &push;
    snprintf(text, sizeof text, "%s\"forces\":[[0,0,4,0],[0.05,0,0,0]]}]}", head);
    succeeds(client, open_text(client, text));
    assert_null(carom_client_get_state(client));
    succeeds(client, carom_client_step(client, &run));
    const carom_client_state *s = carom_client_get_state(client);
    assert_non_null(s);
    assert_int_equal(s->step, 10);
    assert_int_equal(s->n_bodies, 1);
    assert_near(s->time, 0.1, 1e-15);
    assert_near(s->v[1], 4 * 0.05 / 2, 1e-15); /* ten roundings below 1 */
    assert_near(s->v[2], 2 * 0.01 / 2, 1e-15);
    run.n_forces = 0;
    succeeds(client, carom_client_step(client, &run)); /* the table is over */
    assert_near(carom_client_get_state(client)->v[1], 0.1, 1e-15);
    succeeds(client, carom_client_reset(client));
    succeeds(client, carom_client_step(client, &run)); /* and starts again with the session */
    assert_near(carom_client_get_state(client)->v[1], 0.1, 1e-15);
    assert_near(carom_client_get_state(client)->v[2], 0, 0);

    const carom_client_scene other = case_scene();
    succeeds(client, carom_client_open(client, &other));
    assert_null(carom_client_get_state(client));
    run.contacts = 1;
    run.n_steps = CASE_STEPS;
    succeeds(client, carom_client_step(client, &run)); /* the table is gone: the plain trajectory */
    double direct[CASE_STEPS][3 * CASE_BODIES];
    case_direct(direct);
    s = carom_client_get_state(client);
    assert_memory_equal(s->q, direct[CASE_STEPS - 1], sizeof direct[0]);
    assert_true(s->n_contacts > 0 && s->contacts[0].body_b < CASE_BODIES);

    snprintf(text, sizeof text, "%s\"mas\":1,\"friction\":-1}]}", head);
    assert_int_equal(open_text(client, text), CAROM_CLIENT_E_ARGUMENT);
    assert_non_null(strstr(carom_client_error(client), "bodies[0].mas: unknown key"));
    assert_non_null(strstr(carom_client_error(client), "(and 1 more)"));
    assert_int_equal(open_text(client, "{"), CAROM_CLIENT_E_ARGUMENT);
    assert_non_null(strstr(carom_client_error(client), "line 1"));
    assert_int_equal(carom_client_open_file(client, "/no/such/file"), CAROM_CLIENT_E_ARGUMENT);
    assert_non_null(strstr(carom_client_error(client), "/no/such/file: cannot be read"));
    assert_int_equal(carom_client_open_file(client, NULL), CAROM_CLIENT_E_ARGUMENT);
    succeeds(client, carom_client_step(client, &run)); /* the session keeps the scene it had */
    succeeds(client, carom_client_close(client));
    assert_null(carom_client_get_state(client));
}

static void count_bodies(void *user, const carom_client_state *s)
{
    *(int *)user = s->n_bodies;
}

void case_large(carom_client *client)
{
    enum { MANY = 1500, TOO_MANY = 30000 };
    static const carom_vec2 point[] = {{0, 0}};
    static const carom_shape disc = {0.5, 1, point};
    carom_body_def *bodies = malloc(TOO_MANY * sizeof *bodies);
    carom_client_scene s;
    carom_client_run run;
    int n = 0;
    assert_non_null(bodies);
    for (int i = 0; i < TOO_MANY; i++) {
        bodies[i] = carom_body_defaults();
        bodies[i].n_shapes = 1;
        bodies[i].shapes = &disc;
        bodies[i].pose.x = 2.0 * i;
    }
    memset(&s, 0, sizeof s);
    memset(&run, 0, sizeof run);
    s.n_bodies = MANY;
    s.bodies = bodies;
    run.n_steps = 1;
    run.on_state = count_bodies;
    run.user = &n;
    succeeds(client, carom_client_open(client, &s));
    succeeds(client, carom_client_step(client, &run));
    assert_int_equal(n, MANY);
    succeeds(client, carom_client_close(client));
    s.n_bodies = TOO_MANY;
    assert_int_equal(carom_client_open(client, &s), CAROM_CLIENT_E_ARGUMENT);
    assert_non_null(strstr(carom_client_error(client), "4 MB"));
    free(bodies);
}
