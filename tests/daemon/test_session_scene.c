/* test_session_scene.c: scenes that are refused, and scenes in pieces. */
#include "near.h"

#include "requests.h"

#include <stdlib.h>

typedef struct bad_scene {
    const char *says;
    void (*spoil)(carom_scene_t *m);
} bad_scene;

static int8_t bad_types[] = {1, 0, 3, 0};
static int32_t bad_owner[] = {0, 1, 4, 3}, bad_order[] = {0, 2, 1, 3}, bad_count[] = {4, 1, 1, 3};
static int32_t none[] = {4, 0, 2, 2}, same_body[] = {3};
static int8_t bad_joint[] = {10};
static double bad_mass[] = {1, -2, 3, 1};
static char *bad_names[] = {(char *)"no_such_setting"};

static void spoil_type(carom_scene_t *m)
{
    m->body_type = bad_types;
}

static void spoil_owner(carom_scene_t *m)
{
    m->shape_body = bad_owner;
}

static void spoil_order(carom_scene_t *m)
{
    m->shape_body = bad_order;
}

static void spoil_count(carom_scene_t *m)
{
    m->shape_num_vertices = bad_count;
}

static void spoil_vertices(carom_scene_t *m)
{
    m->shape_num_vertices = none;
}

static void spoil_joint(carom_scene_t *m)
{
    m->joint_type = bad_joint;
}

static void spoil_bodies(carom_scene_t *m)
{
    m->joint_body_a = same_body;
}

static void spoil_mass(carom_scene_t *m)
{
    m->mass = bad_mass;
}

static void spoil_setting(carom_scene_t *m)
{
    m->setting_name = bad_names;
}

static const bad_scene bad_scenes[] = {
    {"body_type[2] = 3", spoil_type},
    {"shape_body[2] = 4", spoil_owner},
    {"must not decrease", spoil_order},
    {"the shapes have 9 vertices", spoil_count},
    {"shape_num_vertices[1] = 0", spoil_vertices},
    {"joint_type[0] = 10", spoil_joint},
    {"joint 0 between bodies 3 and 3", spoil_bodies},
    {"'left'", spoil_mass},
    {"'no_such_setting'", spoil_setting},
};

/* The session survives a bad scene and takes a good one. */
static void bad_scenes_are_refused(void **state)
{
    (void)state;
    bench *b = bench_create(NULL);
    int64_t seq = 1;
    for (size_t i = 0; i < sizeof bad_scenes / sizeof bad_scenes[0]; i++, seq++) {
        carom_scene_t m = scene_of(CLIENT, SESSION, seq);
        bad_scenes[i].spoil(&m);
        bench_do(b, pack_scene(&m));
        expect_reply(b, CAROM_REPLY_T_REFUSED, seq, seq + 1, bad_scenes[i].says);
    }
    do_scene(b, seq);
    expect_reply(b, CAROM_REPLY_T_OK, seq, seq + 1, "");
    bench_destroy(b);
}

static carom_scene_chunk_t chunk_of(const bytes *scene, int64_t seq, int stride, int index)
{
    carom_scene_chunk_t m = {0};
    const int rest = scene->size - index * stride;
    m.client_id = CLIENT;
    m.session = SESSION;
    m.seq = seq;
    m.scene_bytes = scene->size;
    m.chunk_stride = stride;
    m.chunk_index = index;
    m.chunk_offset = index * stride;
    m.num_bytes = rest < stride ? rest : stride;
    m.chunk_data = scene->data + m.chunk_offset;
    return m;
}

static void scenes_in_pieces(void **state)
{
    (void)state;
    bench *b = bench_create(NULL);
    bytes scene = pack_row(CLIENT, SESSION, 1, 700);
    const int stride = 10000, n = (scene.size - 1) / stride + 1;
    assert_true(n > 8);
    /* Backwards, the middle one twice. */
    for (int k = n - 1; k >= 0; k--) {
        const carom_scene_chunk_t m = chunk_of(&scene, 1, stride, k);
        bench_do(b, pack_chunk(&m));
        if (k == n / 2) bench_do(b, pack_chunk(&m));
        if (k > 0) {
            expect_reply(b, CAROM_REPLY_T_CHUNK, 1, 1, "");
            assert_int_equal(bench_reply(b).chunk_index, k);
        }
    }
    expect_reply(b, CAROM_REPLY_T_OK, 1, 2, "");
    /* A piece that comes again is answered as the scene. */
    const carom_scene_chunk_t again = chunk_of(&scene, 1, stride, 3);
    bench_do(b, pack_chunk(&again));
    expect_reply(b, CAROM_REPLY_T_OK, 1, 2, "");
    do_steps(b, 2, 0, 1, 1);
    carom_state_t *s = bench_state(b, 0);
    assert_int_equal(s->num_bodies, 700);
    carom_state_t_destroy(s);
    free(scene.data);
    bench_destroy(b);
}

static void bad_pieces_are_refused(void **state)
{
    (void)state;
    bench *b = bench_create(NULL);
    bytes scene = pack_row(CLIENT, SESSION, 2, 10);
    carom_scene_chunk_t m = chunk_of(&scene, 1, 100, 1);
    m.chunk_offset = 99;
    bench_do(b, pack_chunk(&m));
    expect_reply(b, CAROM_REPLY_T_MALFORMED, 1, 1, "chunk_offset = 99");
    m = chunk_of(&scene, 1, 100, 1);
    m.num_bytes = 99;
    bench_do(b, pack_chunk(&m));
    expect_reply(b, CAROM_REPLY_T_MALFORMED, 1, 1, "must be 100");
    m = chunk_of(&scene, 1, 100, 0);
    m.scene_bytes = (4 << 20) + 1;
    bench_do(b, pack_chunk(&m));
    expect_reply(b, CAROM_REPLY_T_MALFORMED, 1, 1, "--max-message");
    m = chunk_of(&scene, 1, 100, 0);
    m.chunk_stride = 0;
    bench_do(b, pack_chunk(&m));
    expect_reply(b, CAROM_REPLY_T_MALFORMED, 1, 1, "chunk_stride = 0");
    m = chunk_of(&scene, 1, 100, 0);
    m.chunk_index = -1;
    bench_do(b, pack_chunk(&m));
    expect_reply(b, CAROM_REPLY_T_MALFORMED, 1, 1, "chunk_index = -1");
    /* Whole, but it is the scene of another seq. */
    m = chunk_of(&scene, 1, scene.size, 0);
    bench_do(b, pack_chunk(&m));
    expect_reply(b, CAROM_REPLY_T_MALFORMED, 1, 1, "do not make a scene_t");
    free(scene.data);
    bench_destroy(b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bad_scenes_are_refused),
        cmocka_unit_test(scenes_in_pieces),
        cmocka_unit_test(bad_pieces_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
