/* test_udpm.c: caromd on UDP multicast.  namespace.sh gives it a network of its own; the argument
 * says which one. */
#include "near.h"

#include "client_case.h"
#include "lossy.h"
#include "process.h"

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char *const URL = "udpm://239.255.76.67:7667?ttl=0&recv_buf_size=4194304";

static void without_route(void **state)
{
    const char *const argv[] = {CAROMD, "--lcm-url", URL, NULL};
    char out[256], err[2048];
    (void)state;
    process p = process_start(argv);
    assert_int_equal(process_wait(&p, 10, out, sizeof out, err, sizeof err), 1);
    assert_non_null(strstr(err, "no route to multicast addresses"));
    assert_non_null(strstr(err, "sudo ip route add 224.0.0.0/4 dev lo"));
}

static process start(const char *name)
{
    const char *const argv[] = {CAROMD, "--lcm-url", URL, "--name", name, NULL};
    char line[256];
    process p = process_start(argv);
    if (!process_line(&p, line, sizeof line)) {
        char out[64], err[2048];
        process_wait(&p, 1, out, sizeof out, err, sizeof err);
        fail_msg("caromd is not ready: %s", err);
    }
    assert_non_null(strstr(line, URL));
    return p;
}

static carom_client *connected(const char *name)
{
    carom_client *c = carom_client_create();
    if (carom_client_connect(c, URL, name) < 0) fail_msg("%s", carom_client_error(c));
    return c;
}

static void sessions(void **state)
{
    (void)state;
    process p = start("a");
    carom_client *c = connected("a");
    case_session(c);
    case_gradient(c);
    case_large(c);
    carom_client_destroy(c);
    caromd_stop(&p);
}

static void names_are_taken_once(void **state)
{
    const char *const argv[] = {CAROMD, "--lcm-url", URL, "--name", "a", NULL};
    char out[64], err[2048];
    (void)state;
    process p = start("a");
    process second = process_start(argv);
    assert_int_equal(process_wait(&second, 10, out, sizeof out, err, sizeof err), 1);
    assert_non_null(strstr(err, "another caromd named 'a'"));
    process other = start("b");
    carom_client *c = connected("b");
    case_session(c);
    carom_client_destroy(c);
    caromd_stop(&other);
    caromd_stop(&p);
}

/* One datagram in five is lost, of the client's and of the daemon's: the same bits arrive. */
static void lost_datagrams_change_nothing(void **state)
{
    static const int per_request[] = {1, 6, CASE_STEPS};
    static double direct[CASE_STEPS][3 * CASE_BODIES], through[CASE_STEPS][3 * CASE_BODIES];
    (void)state;
    setenv("LD_PRELOAD", LOSSY, 1);
    setenv("LOSSY_PERCENT", "20", 1);
    setenv("ASAN_OPTIONS", "verify_asan_link_order=0", 1);
    process p = start("a");
    unsetenv("LD_PRELOAD");
    carom_client *c = connected("a");
    lossy_percent = 20;
    case_direct(direct);
    for (size_t i = 0; i < sizeof per_request / sizeof per_request[0]; i++) {
        memset(through, 0, sizeof through);
        if (case_through(c, per_request[i], through) < 0) fail_msg("%s", carom_client_error(c));
        assert_memory_equal(direct, through, sizeof direct);
    }
    case_gradient(c);
    case_large(c);
    const carom_client_info info = carom_client_last(c);
    print_message("lost %ld of %ld datagrams sent; %ld requests repeated, %ld states asked for "
                  "again\n",
                  lossy_lost, lossy_sent, info.repeated, info.resent);
    assert_true(lossy_lost > lossy_sent / 10);
    assert_true(info.resent > 0); /* the daemon's are lost as well */
    lossy_percent = 0;
    carom_client_destroy(c);
    caromd_stop(&p);
}

static void silence_is_noticed(void **state)
{
    (void)state;
    carom_client *c = connected("nobody");
    const carom_client_scene s = case_scene();
    assert_int_equal(carom_client_open(c, &s), CAROM_CLIENT_E_TIMEOUT);
    assert_non_null(strstr(carom_client_error(c), "no answer"));
    carom_client_destroy(c);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest unrouted[] = {cmocka_unit_test(without_route)};
    const struct CMUnitTest routed[] = {
        cmocka_unit_test(sessions),
        cmocka_unit_test(names_are_taken_once),
        cmocka_unit_test(lost_datagrams_change_nothing),
        cmocka_unit_test(silence_is_noticed),
    };
    const char *network = argc > 1 ? argv[1] : "";
    if (strcmp(network, "unrouted") == 0) return cmocka_run_group_tests(unrouted, NULL, NULL);
    if (strcmp(network, "routed") == 0) return cmocka_run_group_tests(routed, NULL, NULL);
    fprintf(stderr, "usage: namespace.sh test_daemon_udpm\n");
    return 1;
}
