/* test_hub.c: the hub against LCM's own client, and against what no client should send. */
#include "near.h"

#include "socket_peer.h"
#include "transport/hub.h"

#include <lcm/lcm.h>
#include <poll.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

typedef struct seen {
    pthread_mutex_t lock;
    int messages;
    int oversize;
    size_t last_size;
    char last_log[256];
} seen;

static void on_message(void *user, const char *channel, const void *bytes, size_t size)
{
    seen *s = user;
    (void)channel;
    (void)bytes;
    pthread_mutex_lock(&s->lock);
    s->messages++;
    s->last_size = size;
    pthread_mutex_unlock(&s->lock);
}

static void on_oversize(void *user, const char *channel, const void *head, size_t n, size_t size)
{
    seen *s = user;
    (void)channel;
    pthread_mutex_lock(&s->lock);
    s->oversize += n == 64 && ((const char *)head)[63] == 'x';
    s->last_size = size;
    pthread_mutex_unlock(&s->lock);
}

static void on_log(void *user, const char *text)
{
    seen *s = user;
    pthread_mutex_lock(&s->lock);
    snprintf(s->last_log, sizeof s->last_log, "%s", text);
    pthread_mutex_unlock(&s->lock);
}

static seen record = {.lock = PTHREAD_MUTEX_INITIALIZER};

static crm_hub *start(int max_clients, size_t max_queue)
{
    char text[256];
    const crm_hub_settings set = {.address = "127.0.0.1:0",
                                  .max_clients = max_clients,
                                  .max_message = 100000,
                                  .max_queue = max_queue,
                                  .user = &record,
                                  .on_message = on_message,
                                  .on_oversize = on_oversize,
                                  .log = on_log};
    record.messages = 0;
    record.oversize = 0;
    record.last_log[0] = 0;
    crm_hub *h = crm_hub_create(&set, text);
    if (!h) fail_msg("%s", text);
    assert_true(crm_hub_start(h));
    return h;
}

/* Waits until the hub has seen n messages. */
static void wait_messages(int n)
{
    const struct timespec moment = {0, 1000000};
    for (int i = 0; i < 5000; i++) {
        pthread_mutex_lock(&record.lock);
        const int has = record.messages;
        pthread_mutex_unlock(&record.lock);
        if (has >= n) return;
        nanosleep(&moment, NULL);
    }
    fail_msg("the hub did not see %d messages", n);
}

/* --- LCM's client */

static void count(const lcm_recv_buf_t *buf, const char *channel, void *user)
{
    (void)channel;
    assert_memory_equal(buf->data, "hello", 5);
    ++*(int *)user;
}

/* 1: a message came within 200 ms. */
static int handled(lcm_t *lcm, int ms)
{
    struct pollfd p = {lcm_get_fileno(lcm), POLLIN, 0};
    return poll(&p, 1, ms) > 0 && lcm_handle(lcm) == 0;
}

static void speaks_with_lcm(void **state)
{
    static const struct {
        const char *pattern;
        const char *channel;
        int matches;
    } cases[] = {{"CAROM_STATE", "CAROM_STATE", 1},
                 {"CAROM_STATE", "CAROM_STATE_lab1", 0},
                 {"CAROM_.*", "CAROM_STATE_lab1", 1},
                 {".*", "X", 1},
                 {"(A|B)C", "BC", 1},
                 {"(A|B)C", "BCD", 0},
                 {"A", "BA", 0},
                 {"[AB]+", "ABBA", 1}};
    char url[64];
    (void)state;
    crm_hub *h = start(8, 1 << 20);
    snprintf(url, sizeof url, "tcpq://127.0.0.1:%d", crm_hub_port(h));
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        lcm_t *lcm = lcm_create(url);
        int n = 0;
        lcm_subscription_t *s = lcm_subscribe(lcm, cases[i].pattern, count, &n);
        /* Its own message comes back, as from LCM's hub; that of the daemon comes as well. */
        lcm_publish(lcm, cases[i].channel, "hello", 5);
        wait_messages((int)i + 1);
        crm_hub_publish(h, cases[i].channel, "hello", 5, 0);
        while (n < 2 && handled(lcm, cases[i].matches ? 2000 : 100)) {
        }
        if (n != 2 * cases[i].matches) {
            fail_msg("'%s' on '%s': %d messages", cases[i].channel, cases[i].pattern, n);
        }
        lcm_unsubscribe(lcm, s);
        lcm_destroy(lcm);
    }
    crm_hub_destroy(h);
}

static void unsubscribed_is_unsubscribed(void **state)
{
    char channel[64], data[8];
    (void)state;
    crm_hub *h = start(8, 1 << 20);
    const int s = peer_connect(crm_hub_port(h), 1);
    peer_frame(s, 2, "A", NULL, 0);
    peer_frame(s, 2, "B.*", NULL, 0);
    peer_frame(s, 3, "A", NULL, 0);
    peer_frame(s, 1, "A", "1", 1);
    peer_frame(s, 1, "B1", "22", 2);
    assert_int_equal(peer_read(s, 5, channel, data, sizeof data), 2);
    assert_string_equal(channel, "B1");
    assert_memory_equal(data, "22", 2);
    close(s);
    crm_hub_destroy(h);
}

/* --- slow subscribers */

/* A subscriber that reads nothing holds max_queue bytes at most; the newest state survives, and so
 * does the reply before it; publishing never blocks. */
static void slow_subscribers_lose_the_oldest_states(void **state)
{
    enum { STATES = 2000, SIZE = 20000 };
    char channel[64];
    int first = -1, last = -1, n = 0, replies = 0;
    (void)state;
    crm_hub *h = start(8, 1 << 20);
    const int slow = peer_connect(crm_hub_port(h), 1), quick = peer_connect(crm_hub_port(h), 1);
    int *data = calloc(1, SIZE);
    assert_non_null(data);
    peer_frame(slow, 2, ".*", NULL, 0);
    peer_frame(slow, 1, "BEGIN", "1", 1);
    wait_messages(1);
    for (int k = 0; k < STATES; k++) {
        data[0] = k;
        crm_hub_publish(h, "CAROM_STATE", data, SIZE, 1);
        if (k == STATES / 2) crm_hub_publish(h, "CAROM_REPLY", data, 4, 0);
    }
    const int64_t dropped = crm_hub_dropped(h);
    /* Others are served meanwhile. */
    peer_frame(quick, 2, "X", NULL, 0);
    peer_frame(quick, 1, "X", "1", 1);
    assert_int_equal(peer_read(quick, 5, channel, data, 1), 1);
    for (;;) {
        int k = -1;
        if (peer_read(slow, 0.5, channel, &k, sizeof k) < 0) break;
        replies += strcmp(channel, "CAROM_REPLY") == 0;
        if (strcmp(channel, "CAROM_STATE") != 0) continue;
        assert_true(k > last);
        if (first < 0) first = k;
        last = k;
        n++;
    }
    assert_int_equal(last, STATES - 1);
    assert_int_equal(replies, 1);
    assert_true(dropped > 0);
    assert_int_equal(dropped + n, STATES);
    close(slow);
    close(quick);
    free(data);
    crm_hub_destroy(h);
}

/* --- what no client should send */

static void still_serves(crm_hub *h)
{
    char channel[64], data[4];
    const int s = peer_connect(crm_hub_port(h), 1);
    peer_frame(s, 2, "OK", NULL, 0);
    peer_frame(s, 1, "OK", "ok", 2);
    assert_int_equal(peer_read(s, 5, channel, data, sizeof data), 2);
    close(s);
}

static void closes_on_nonsense(void **state)
{
    static const struct {
        const char *name;
        int greet;
        size_t n;
        const char *bytes;
    } cases[] = {
        {"not LCM", 0, 18, "GET / HTTP/1.1\r\n\r\n"},
        {"the magic of a server", 0, 8, "\x28\x76\x17\xfa\0\0\1\0"},
        {"type 0", 1, 8, "\0\0\0\0\0\0\0\1"},
        {"type 4", 1, 8, "\0\0\0\4\0\0\0\1"},
        {"channel of length 0", 1, 8, "\0\0\0\1\0\0\0\0"},
        {"channel of length 64", 1, 8, "\0\0\0\1\0\0\0\100"},
        {"channel of length -1", 1, 8, "\0\0\0\1\377\377\377\377"},
        {"pattern of length 129", 1, 8, "\0\0\0\2\0\0\0\201"},
        {"terminator in a channel", 1, 10, "\0\0\0\1\0\0\0\2a\0"},
    };
    (void)state;
    crm_hub *h = start(4, 1 << 20);
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const int s = peer_connect(crm_hub_port(h), cases[i].greet);
        peer_send(s, cases[i].bytes, cases[i].n);
        if (!peer_closed(s, 5)) fail_msg("%s: the connection stays open", cases[i].name);
        close(s);
        still_serves(h);
    }
    crm_hub_destroy(h);
}

/* The rest of a message that is too large is skipped, the next one taken. */
static void skips_oversize(void **state)
{
    char channel[64], data[4];
    (void)state;
    crm_hub *h = start(4, 1 << 20);
    char *large = malloc(3000000);
    assert_non_null(large);
    memset(large, 'x', 3000000);
    const int s = peer_connect(crm_hub_port(h), 1);
    peer_frame(s, 2, ".*", NULL, 0);
    peer_frame(s, 1, "L", large, 3000000);
    peer_frame(s, 1, "S", "s", 1);
    assert_int_equal(peer_read(s, 5, channel, data, sizeof data), 1);
    assert_string_equal(channel, "S");
    assert_int_equal(record.oversize, 1);
    /* A size of 4 GB - 1 that never comes does no harm. */
    peer_send(s, "\0\0\0\1\0\0\0\1L\377\377\377\377", 13);
    peer_send(s, large, 1000);
    close(s);
    still_serves(h);
    free(large);
    crm_hub_destroy(h);
}

static void refuses_costly_patterns(void **state)
{
    static const char *const patterns[] = {"(a{255}){255}", "(.*)\\1", "(", "[", "a**["};
    char channel[64], data[4], open[129];
    (void)state;
    crm_hub *h = start(4, 1 << 20);
    const int s = peer_connect(crm_hub_port(h), 1);
    for (size_t i = 0; i < sizeof patterns / sizeof patterns[0]; i++) {
        record.last_log[0] = 0;
        peer_frame(s, 2, patterns[i], NULL, 0);
        peer_frame(s, 2, "GO", NULL, 0);
        peer_frame(s, 1, "GO", "1", 1);
        assert_int_equal(peer_read(s, 5, channel, data, sizeof data), 1);
        pthread_mutex_lock(&record.lock);
        if (!strstr(record.last_log, patterns[i])) fail_msg("'%s' was taken", patterns[i]);
        pthread_mutex_unlock(&record.lock);
        peer_frame(s, 3, "GO", NULL, 0);
    }
    memset(open, '(', 128);
    open[128] = 0;
    peer_frame(s, 2, open, NULL, 0);
    still_serves(h);
    /* More subscriptions than a client may have. */
    for (int k = 0; k < 300; k++) peer_frame(s, 2, "MANY", NULL, 0);
    peer_frame(s, 1, "MANY", "1", 1);
    assert_int_equal(peer_read(s, 5, channel, data, sizeof data), 1);
    assert_int_equal(peer_read(s, 0.1, channel, data, sizeof data), -1); /* once, not 256 times */
    close(s);
    crm_hub_destroy(h);
}

static void limits_clients(void **state)
{
    int s[3];
    (void)state;
    crm_hub *h = start(2, 1 << 20);
    for (int i = 0; i < 2; i++) s[i] = peer_connect(crm_hub_port(h), 1);
    s[2] = peer_connect(crm_hub_port(h), 0);
    assert_true(peer_closed(s[2], 5));
    assert_int_equal(crm_hub_n_clients(h), 2);
    for (int i = 0; i < 3; i++) close(s[i]);
    crm_hub_destroy(h);
}

static void names_bad_addresses(void **state)
{
    static const struct {
        const char *address, *says;
    } cases[] = {{"7700", "not ADDRESS:PORT"},
                 {"127.0.0.1:70000", "not ADDRESS:PORT"},
                 {"127.0.0.1:7x", "not ADDRESS:PORT"},
                 {"nowhere:1", "not ADDRESS:PORT"},
                 {"192.0.2.1:7700", "192.0.2.1:7700: "}};
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        char text[256] = "";
        crm_hub_settings set;
        memset(&set, 0, sizeof set);
        set.address = cases[i].address;
        set.max_clients = 1;
        assert_null(crm_hub_create(&set, text));
        if (!strstr(text, cases[i].says)) fail_msg("%s: '%s'", cases[i].address, text);
    }
    crm_hub *h = start(2, 1 << 20);
    char text[256] = "", address[32];
    crm_hub_settings set;
    memset(&set, 0, sizeof set);
    snprintf(address, sizeof address, "127.0.0.1:%d", crm_hub_port(h));
    set.address = address;
    set.max_clients = 1;
    assert_null(crm_hub_create(&set, text));
    assert_non_null(strstr(text, "another caromd?"));
    crm_hub_destroy(h);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(speaks_with_lcm),
        cmocka_unit_test(unsubscribed_is_unsubscribed),
        cmocka_unit_test(slow_subscribers_lose_the_oldest_states),
        cmocka_unit_test(closes_on_nonsense),
        cmocka_unit_test(skips_oversize),
        cmocka_unit_test(refuses_costly_patterns),
        cmocka_unit_test(limits_clients),
        cmocka_unit_test(names_bad_addresses),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
