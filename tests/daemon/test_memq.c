/* test_memq.c: client library and daemon in one process, on LCM's memq; and with messages lost
 * between them. */
#include "near.h"

#include "client_case.h"
#include "daemon.h"
#include "service.h"

#include <lcm/lcm.h>
#include <stdlib.h>
#include <string.h>

static void no_log(const char *text)
{
    (void)text;
}

typedef struct setup {
    lcm_t *lcm;
    crm_daemon *daemon;
    carom_client *client;
} setup;

static setup start(const char *name)
{
    char text[CRM_DAEMON_TEXT];
    setup s;
    crm_daemon_settings set;
    memset(&set, 0, sizeof set);
    set.server = crm_server_defaults();
    set.server.name = name;
    set.server.n_workers = 2;
    set.log = no_log;
    s.lcm = lcm_create("memq://");
    set.lcm = s.lcm;
    s.daemon = crm_daemon_create(&set, text);
    if (!s.daemon) fail_msg("%s", text);
    s.client = carom_client_create();
    assert_int_equal(carom_client_attach(s.client, s.lcm, name), CAROM_CLIENT_OK);
    return s;
}

static void stop(setup s)
{
    carom_client_destroy(s.client);
    crm_daemon_destroy(s.daemon);
    lcm_destroy(s.lcm);
}

static void trajectory(void **state)
{
    static double direct[CASE_STEPS][3 * CASE_BODIES], through[CASE_STEPS][3 * CASE_BODIES];
    (void)state;
    setup s = start("");
    case_direct(direct);
    for (int per_request = 1; per_request <= CASE_STEPS; per_request += CASE_STEPS - 1) {
        memset(through, 0, sizeof through);
        assert_int_equal(case_through(s.client, per_request, through), CAROM_CLIENT_OK);
        assert_memory_equal(direct, through, sizeof direct);
        assert_int_equal(carom_client_close(s.client), CAROM_CLIENT_OK);
    }
    stop(s);
}

static void gradient(void **state)
{
    (void)state;
    setup s = start("");
    case_gradient(s.client);
    stop(s);
}

static void session(void **state)
{
    (void)state;
    setup s = start("lab1");
    case_session(s.client);
    stop(s);
}

/* What a program sees that does not look at what carom_client_create returned. */
static void no_client(void **state)
{
    (void)state;
    assert_int_equal(carom_client_connect(NULL, NULL, NULL), CAROM_CLIENT_E_MEMORY);
    assert_int_equal(carom_client_attach(NULL, NULL, NULL), CAROM_CLIENT_E_MEMORY);
    assert_non_null(strstr(carom_client_error(NULL), "no memory"));
    carom_client_destroy(NULL);
}

/* A world without bodies has states, too. */
static void empty_scene(void **state)
{
    (void)state;
    setup s = start("");
    const carom_client_scene nothing = {0};
    const carom_client_run run = {0};
    assert_int_equal(carom_client_open(s.client, &nothing), CAROM_CLIENT_OK);
    assert_int_equal(carom_client_step(s.client, &run), CAROM_CLIENT_OK);
    assert_int_equal(carom_client_get_state(s.client)->n_bodies, 0);
    stop(s);
}

static void scene_file(void **state)
{
    (void)state;
    setup s = start("");
    case_file(s.client);
    stop(s);
}

static void large_scene(void **state)
{
    (void)state;
    setup s = start("");
    case_large(s.client);
    stop(s);
}

/* --- loss: a network that forgets one message in five, in both directions */

typedef struct lossy {
    lcm_t *lcm;
    crm_service *service;
    uint64_t rng;
    int percent;
    int swallow; /* a type of message that never arrives, -1: none */
    long sent, lost;
} lossy;

/* On the workers' threads and the test's. */
static int loses(lossy *l)
{
    const uint64_t x = __atomic_add_fetch(&l->rng, 0x9e3779b97f4a7c15u, __ATOMIC_RELAXED);
    const uint64_t y = (x ^ x >> 31) * 0xbf58476d1ce4e5b9u;
    const int lost = (int)((y >> 33) % 100) < l->percent;
    __atomic_add_fetch(&l->sent, 1, __ATOMIC_RELAXED);
    if (lost) __atomic_add_fetch(&l->lost, 1, __ATOMIC_RELAXED);
    return lost;
}

static void lossy_emit(void *user, crm_wire_type type, const void *bytes, int size)
{
    lossy *l = user;
    char name[64];
    crm_wire_channel_name(type, "", name);
    if ((int)type != l->swallow && !loses(l)) lcm_publish(l->lcm, name, bytes, (unsigned)size);
}

static void lossy_request(const lcm_recv_buf_t *buf, const char *channel, void *user)
{
    lossy *l = user;
    if (loses(l)) return;
    for (int t = 0; t < CRM_WIRE_N_REQUESTS; t++) {
        if (strcmp(channel, crm_wire_channel((crm_wire_type)t)) != 0) continue;
        crm_service_receive(l->service, (crm_wire_type)t, buf->data, buf->data_size);
    }
}

static lossy *start_lossy(int percent, carom_client **client)
{
    lossy *l = calloc(1, sizeof *l);
    assert_non_null(l);
    crm_server_settings set = crm_server_defaults();
    set.n_workers = 2;
    set.user = l;
    set.emit = lossy_emit;
    l->percent = percent;
    l->swallow = -1;
    l->lcm = lcm_create("memq://");
    l->service = crm_service_create(&set);
    for (int t = 0; t < CRM_WIRE_N_REQUESTS; t++) {
        lcm_subscribe(l->lcm, crm_wire_channel((crm_wire_type)t), lossy_request, l);
    }
    *client = carom_client_create();
    assert_int_equal(carom_client_attach(*client, l->lcm, NULL), CAROM_CLIENT_OK);
    return l;
}

static void stop_lossy(lossy *l, carom_client *client)
{
    carom_client_destroy(client);
    crm_service_destroy(l->service);
    lcm_destroy(l->lcm);
    free(l);
}

/* The same trajectory, bit for bit; every step made once, or its number would be off. */
static void lost_messages_change_nothing(void **state)
{
    static const int per_request[] = {1, 6, CASE_STEPS};
    static double direct[CASE_STEPS][3 * CASE_BODIES], through[CASE_STEPS][3 * CASE_BODIES];
    carom_client *client = NULL;
    (void)state;
    case_direct(direct);
    lossy *l = start_lossy(20, &client);
    for (size_t i = 0; i < sizeof per_request / sizeof per_request[0]; i++) {
        memset(through, 0, sizeof through);
        const carom_client_code code = case_through(client, per_request[i], through);
        if (code < 0) fail_msg("%s", carom_client_error(client));
        assert_memory_equal(direct, through, sizeof direct);
    }
    const carom_client_info info = carom_client_last(client);
    print_message("lost %ld of %ld messages; %ld requests repeated, %ld states asked for again\n",
                  l->lost, l->sent, info.repeated, info.resent);
    assert_true(l->lost > l->sent / 10);
    assert_true(info.repeated > 0);
    assert_true(info.resent > 0);
    stop_lossy(l, client);
}

static void lost_messages_and_gradients(void **state)
{
    carom_client *client = NULL;
    (void)state;
    lossy *l = start_lossy(20, &client);
    for (int k = 0; k < 3; k++) case_gradient(client);
    case_session(client);
    case_file(client);
    case_large(client);
    stop_lossy(l, client);
}

/* The reply arrives, again with every repetition, but never the gradient it speaks of: that is no
 * progress, and the call must end. */
static void a_gradient_that_never_comes(void **state)
{
    double q_bar[3 * CASE_BODIES] = {0};
    const carom_state_bar bar = {1, q_bar, NULL};
    const carom_client_scene s = case_scene();
    carom_client *client = NULL;
    carom_client_run run;
    carom_client_gradient g;
    (void)state;
    memset(&run, 0, sizeof run);
    run.n_steps = 1;
    run.record = CAROM_RECORD_ON;
    lossy *l = start_lossy(0, &client);
    l->swallow = CRM_WIRE_PARAMETER_GRADIENT;
    assert_int_equal(carom_client_open(client, &s), CAROM_CLIENT_OK);
    assert_int_equal(carom_client_step(client, &run), CAROM_CLIENT_OK);
    assert_int_equal(carom_client_gradient_of(client, 0, 1, &bar, CAROM_WRT_MASS, &g),
                     CAROM_CLIENT_E_TIMEOUT);
    stop_lossy(l, client);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(trajectory),
        cmocka_unit_test(gradient),
        cmocka_unit_test(session),
        cmocka_unit_test(no_client),
        cmocka_unit_test(empty_scene),
        cmocka_unit_test(scene_file),
        cmocka_unit_test(large_scene),
        cmocka_unit_test(lost_messages_change_nothing),
        cmocka_unit_test(lost_messages_and_gradients),
        cmocka_unit_test(a_gradient_that_never_comes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
