#include "requests.h"

#include "near.h"

#include <string.h>

void do_scene(bench *b, int64_t seq)
{
    const carom_scene_t m = scene_of(CLIENT, SESSION, seq);
    bench_do(b, pack_scene(&m));
}

void do_steps(bench *b, int64_t seq, int64_t from, int n, int every)
{
    const carom_step_request_t m = steps_of(CLIENT, SESSION, seq, from, n, every);
    bench_do(b, pack_step(&m));
}

void do_recorded(bench *b, int64_t seq, int64_t from, int n)
{
    carom_step_request_t m = steps_of(CLIENT, SESSION, seq, from, n, 0);
    m.record = CAROM_STEP_REQUEST_T_RECORD_ON;
    bench_do(b, pack_step(&m));
}

void do_action(bench *b, int64_t seq, int action, int snapshot)
{
    carom_session_request_t m = action_of(CLIENT, SESSION, seq, action);
    m.snapshot = snapshot;
    bench_do(b, pack_action(&m));
}

void expect_reply(const bench *b, int code, int64_t seq, int64_t next_seq, const char *says)
{
    const carom_reply_t r = bench_reply(b);
    if (r.reply_code != code || !strstr(r.reply_text, says)) {
        fail_msg("seq %d: code %d '%s', expected %d '%s'", (int)seq, r.reply_code, r.reply_text,
                 code, says);
    }
    assert_int_equal(r.client_id, CLIENT);
    assert_int_equal(r.seq, seq);
    assert_int_equal(r.next_seq, next_seq);
    assert_int_equal(r.boot_id, 99);
}

bench *do_open(void)
{
    bench *b = bench_create(NULL);
    do_scene(b, 1);
    expect_reply(b, CAROM_REPLY_T_OK, 1, 2, "");
    return b;
}
