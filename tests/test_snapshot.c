/* A world that takes up a snapshot, and a copy, repeat the steps bit for bit; what is no snapshot
 * of this scene is refused with words and changes nothing. */
#include "alloc_fail.h"
#include "carom/snapshot.h"
#include "near.h"
#include "random_scene.h"
#include "rng.h"
#include "scenes.h"

#include <stdlib.h>
#include <string.h>

typedef struct blob {
    size_t size;
    unsigned char *bytes;
} blob;

static blob snapshot_of(carom_world *w)
{
    blob b = {0, NULL};
    assert_int_equal(carom_world_snapshot(w, 0, NULL, &b.size), CAROM_OK);
    b.bytes = malloc(b.size);
    assert_non_null(b.bytes);
    size_t again = 0;
    assert_int_equal(carom_world_snapshot(w, b.size, b.bytes, &again), CAROM_OK);
    assert_int_equal(again, b.size);
    return b;
}

static void same_state(const carom_world *a, const carom_world *b, const char *name)
{
    const size_t bytes = 3 * (size_t)carom_world_n_bodies(a) * sizeof(double);
    if (memcmp(carom_world_q(a), carom_world_q(b), bytes) != 0 ||
        memcmp(carom_world_v(a), carom_world_v(b), bytes) != 0 ||
        carom_world_steps(a) != carom_world_steps(b)) {
        fail_msg("%s: the states differ", name);
    }
}

static void same_snapshots(carom_world *a, carom_world *b)
{
    blob x = snapshot_of(a);
    blob y = snapshot_of(b);
    assert_int_equal(x.size, y.size);
    assert_memory_equal(x.bytes, y.bytes, x.size);
    free(x.bytes);
    free(y.bytes);
}

/* Both worlds n steps on: the same statistics, states and snapshots. */
static void same_future(carom_world *a, carom_world *b, int n, const char *name)
{
    for (int k = 0; k < n; k++) {
        carom_step_stats sa, sb;
        const carom_status ea = carom_world_step(a, NULL, &sa);
        const carom_status eb = carom_world_step(b, NULL, &sb);
        assert_int_equal(ea, eb);
        assert_int_equal(sa.n_substeps, sb.n_substeps);
        same_state(a, b, name);
    }
    same_snapshots(a, b);
}

/* A stack hit by a ball, a pendulum of three links with a stop, and a ball that bounces. */
static carom_world *busy_world(carom_integrator integrator)
{
    scene_integrator = integrator;
    carom_world *w = scene_world(9.81, 1.0 / 60);
    scene_floor(w, 0.5, 0.3);
    for (int k = 0; k < 4; k++) {
        const carom_pose at = {0, 0, 0.5 + k};
        scene_box(w, 1 + k, 0.5, 0.5, at, 0.5, 0.2);
    }
    const int ball = scene_disc(w, 2, 0.3, -6, 2, 0.3, 0.6);
    scene_disc(w, 0.1, 0.2, 6, 1.5, 0.3, 0.9);
    const int anchor = scene_anchor(w);
    int last = anchor;
    for (int k = 0; k < 3; k++) {
        const carom_pose at = {0, 9.5 + k, 6};
        carom_joint_def j = carom_joint_defaults(CAROM_REVOLUTE);
        j.body_a = last;
        j.body_b = scene_box(w, 1, 0.5, 0.1, at, 0.5, 0);
        j.anchor.x = 9 + k;
        j.anchor.y = 6;
        if (k) {
            j.lower = -0.4;
            j.upper = 0.4;
            j.stiffness = 2;
        }
        if (k == 2) j.motor_limit = 0.5;
        assert_int_equal(carom_world_add_joint(w, &j, NULL), CAROM_OK);
        last = j.body_b;
    }
    scene_push(w, ball, 0, 9, 1);
    return w;
}

static const char *const NAMES[3] = {"euler", "located", "fixed"};

/* At every step of two seconds with impacts, sliding and stops: another world takes up the snapshot
 * and goes on alike. */
static void repeats_bit_for_bit(void **state)
{
    (void)state;
    for (int i = CAROM_EULER; i <= CAROM_FIXED; i++) {
        carom_world *a = busy_world((carom_integrator)i);
        int contacts = 0;
        for (int k = 0; k < 120; k++) {
            blob s = snapshot_of(a);
            carom_world *b = busy_world((carom_integrator)i);
            scene_run(b, k % 5, NULL); /* sealed or not, with guesses of its own or none */
            assert_int_equal(carom_world_restore(b, s.size, s.bytes), CAROM_OK);
            same_snapshots(a, b);
            assert_int_equal(carom_world_n_contacts(a), carom_world_n_contacts(b));
            for (int m = 0; m < carom_world_n_joints(a); m++) {
                assert_near(carom_world_joint_force(b, m).torque,
                            carom_world_joint_force(a, m).torque, 0);
                assert_near(carom_world_joint_force(b, m).force.y,
                            carom_world_joint_force(a, m).force.y, 0);
            }
            contacts += carom_world_n_contacts(b);
            if (k % 12 == 7) same_future(a, b, 6, NAMES[i]);
            scene_run(a, 1, NULL);
            carom_world_destroy(b);
            free(s.bytes);
        }
        assert_true(contacts > 0);
        carom_world_destroy(a);
    }
}

/* A ball that arrives exactly when a step ends owes its impact to the next one. */
static void debts_come_along(void **state)
{
    (void)state;
    scene_integrator = CAROM_LOCATED;
    carom_world *a = scene_world(0, 0.0625);
    scene_floor(a, 0, 1);
    const int ball = scene_disc(a, 1, 0.5, 0, 1, 0, 1);
    scene_disc(a, 1, 0.5, 9, 9, 0, 1);
    scene_push(a, ball, 0, 0, -8); /* 0.5 m in one step: numbers without rounding */
    carom_world *b = NULL;
    assert_int_equal(carom_world_copy(a, NULL, &b), CAROM_OK);
    scene_run(a, 1, NULL);
    blob s = snapshot_of(a);
    assert_int_equal(carom_world_restore(b, s.size, s.bytes), CAROM_OK);
    same_snapshots(a, b);
    same_future(a, b, 2, "debt");
    assert_near(carom_world_q(b)[3 * ball + 2], 1.5, 1e-12); /* as fast up as down */
    free(s.bytes);
    carom_world_destroy(a);
    carom_world_destroy(b);
}

/* Back to an earlier state of the same world, any number of times. */
static void goes_back(void **state)
{
    (void)state;
    for (int i = CAROM_EULER; i <= CAROM_FIXED; i++) {
        double end[2][60];
        carom_world *w = busy_world((carom_integrator)i);
        const size_t bytes = 3 * (size_t)carom_world_n_bodies(w) * sizeof(double);
        assert_true(bytes <= sizeof end[0]);
        scene_run(w, 40, NULL);
        blob s = snapshot_of(w);
        for (int run = 0; run < 2; run++) {
            assert_int_equal(carom_world_restore(w, s.size, s.bytes), CAROM_OK);
            scene_run(w, 50, NULL);
            memcpy(end[run], carom_world_q(w), bytes);
        }
        assert_memory_equal(end[0], end[1], bytes);
        free(s.bytes);
        carom_world_destroy(w);
    }
}

/* Taking up a snapshot asks for no memory where there is room for its contacts. */
static void restoring_does_not_allocate(void **state)
{
    (void)state;
    alloc_fail f = alloc_fail_never();
    const carom_allocator from = alloc_fail_allocator(&f);
    carom_world *a = busy_world(CAROM_LOCATED);
    carom_world *b = NULL;
    scene_run(a, 60, NULL);
    blob s = snapshot_of(a);
    assert_int_equal(carom_world_copy(a, &from, &b), CAROM_OK);
    const long before = f.n_calls;
    for (int k = 0; k < 3; k++) {
        assert_int_equal(carom_world_restore(b, s.size, s.bytes), CAROM_OK);
    }
    assert_int_equal(f.n_calls, before);
    free(s.bytes);
    carom_world_destroy(a);
    carom_world_destroy(b);
}

/* Parameters that changed since the scene was built come along, gravity too. */
static void parameters_come_along(void **state)
{
    (void)state;
    carom_world *a = busy_world(CAROM_LOCATED);
    carom_world *b = busy_world(CAROM_LOCATED);
    const int n = carom_world_n_bodies(a);
    double mass[20];
    double friction[20];
    for (int k = 0; k < n; k++) {
        mass[k] = 1 + 0.1 * k;
        friction[k] = 0.05 * k;
    }
    const double gravity[2] = {0.5, -8};
    const carom_parameters p = {.mass = mass, .friction = friction, .gravity = gravity};
    scene_run(a, 10, NULL);
    assert_int_equal(carom_world_set_parameters(a, &p), CAROM_OK);
    blob s = snapshot_of(a);
    assert_int_equal(carom_world_restore(b, s.size, s.bytes), CAROM_OK);
    assert_near(carom_world_get_settings(b).gravity[0], 0.5, 0);
    same_future(a, b, 60, "parameters");
    free(s.bytes);
    carom_world_destroy(a);
    carom_world_destroy(b);
}

/* The original goes on first, so that the copy cannot lean on it. */
static void copies_are_alike_and_apart(void **state)
{
    (void)state;
    for (int i = CAROM_EULER; i <= CAROM_FIXED; i++) {
        for (int n = 0; n <= 60; n += 20) {
            carom_world *a = busy_world((carom_integrator)i);
            carom_world *b = NULL;
            carom_world *c = NULL;
            scene_run(a, n, NULL);
            assert_int_equal(carom_world_copy(a, NULL, &b), CAROM_OK);
            assert_int_equal(carom_world_copy(b, NULL, &c), CAROM_OK);
            same_future(a, b, 40, NAMES[i]);
            carom_world_destroy(a);
            carom_world_destroy(b);
            scene_run(c, 40, NULL);
            carom_world_destroy(c);
        }
    }
}

/* A copy of a world that nobody has stepped can be built on. */
static void copies_can_be_built_on(void **state)
{
    (void)state;
    carom_world *a = busy_world(CAROM_LOCATED);
    carom_world *b = NULL;
    assert_int_equal(carom_world_copy(a, NULL, &b), CAROM_OK);
    carom_world_destroy(a);
    const int body = scene_disc(b, 1, 0.4, -10, 3, 0.5, 0);
    const carom_vec2 at = {-10, 3};
    assert_int_equal(carom_world_add_revolute(b, 0, body, at, NULL), CAROM_OK);
    assert_int_equal(carom_world_exclude(b, 1, body), CAROM_OK);
    scene_run(b, 30, NULL);
    assert_near(carom_world_q(b)[3 * body + 2], 3, 1e-9); /* pinned: stays within rounding */
    carom_world_destroy(b);
}

/* A failing step is the same in a copy; worlds of every shape, and no world at all. */
static void random_worlds(void **state)
{
    (void)state;
    static random_scene s;
    for (uint64_t seed = 1; seed <= 30; seed++) {
        carom_world_settings set = carom_world_defaults();
        set.integrator = (int)(seed % 3);
        random_scene_make(seed, &set, &s);
        for (int k = 0; k < 12; k++) carom_world_step(s.world, NULL, NULL);
        carom_world *b = NULL;
        assert_int_equal(carom_world_copy(s.world, NULL, &b), CAROM_OK);
        same_future(s.world, b, 6, "random");
        carom_world_destroy(b);
        carom_world_destroy(s.world);
    }
}

static void empty_world(void **state)
{
    (void)state;
    carom_world *a = scene_world(9.81, 0.01);
    carom_world *b = NULL;
    blob s = snapshot_of(a);
    assert_int_equal(carom_world_restore(a, s.size, s.bytes), CAROM_OK);
    assert_int_equal(carom_world_copy(a, NULL, &b), CAROM_OK);
    same_future(a, b, 3, "empty");
    free(s.bytes);
    carom_world_destroy(a);
    carom_world_destroy(b);
}

/* Refused with these words, and nothing is changed. */
static void refuses(carom_world *w, size_t size, const unsigned char *bytes, const char *words)
{
    blob before = snapshot_of(w);
    assert_int_equal(carom_world_restore(w, size, bytes), CAROM_E_ARGUMENT);
    if (!strstr(carom_world_error(w), words)) {
        fail_msg("'%s' says nothing of '%s'", carom_world_error(w), words);
    }
    blob after = snapshot_of(w);
    assert_int_equal(before.size, after.size);
    assert_memory_equal(before.bytes, after.bytes, before.size);
    free(before.bytes);
    free(after.bytes);
}

static void refuses_what_does_not_fit(void **state)
{
    (void)state;
    carom_world *w = busy_world(CAROM_LOCATED);
    scene_run(w, 30, NULL);
    blob s = snapshot_of(w);
    refuses(w, 0, s.bytes, "these bytes are none");
    refuses(w, 39, s.bytes, "these bytes are none");
    for (size_t n = 40; n < s.size; n++) refuses(w, n, s.bytes, "cut off");
    s.bytes[8]++;
    refuses(w, s.size, s.bytes, "of format 4");
    s.bytes[8]--;
    s.bytes[0] = 'C';
    refuses(w, s.size, s.bytes, "these bytes are none");
    s.bytes[0] = 'c';
    for (size_t k = 24; k < s.size; k++) { /* any bit that flips */
        const unsigned char bit = (unsigned char)(1U << k % 8);
        s.bytes[k] ^= bit;
        refuses(w, s.size, s.bytes, "checksum");
        s.bytes[k] ^= bit;
    }
    assert_int_equal(carom_world_restore(w, s.size, s.bytes), CAROM_OK);
    free(s.bytes);
    carom_world_destroy(w);
}

/* Each change of the scene makes another one. */
static void refuses_other_scenes(void **state)
{
    (void)state;
    for (int change = 0; change < 10; change++) {
        carom_world_settings set = carom_world_defaults();
        carom_world *w[2] = {NULL, NULL};
        blob s = {0, NULL};
        for (int k = 0; k < 2; k++) {
            const int other = k ? change : -1;
            if (other == 0) set.dt = 0.02;
            if (other == 1) set.integrator = CAROM_FIXED;
            assert_int_equal(carom_world_create(&set, NULL, &w[k]), CAROM_OK);
            scene_floor(w[k], 0.5, 0);
            const int a = scene_disc(w[k], 1, other == 2 ? 0.6 : 0.5, 0, 2, 0.5, 0);
            const int b = scene_disc(w[k], 1, 0.5, other == 3 ? 2 : 3, 2, 0.5, 0);
            if (other == 4) scene_disc(w[k], 1, 0.5, 6, 2, 0.5, 0);
            carom_joint_def j = carom_joint_defaults(CAROM_REVOLUTE);
            j.body_a = a;
            j.body_b = b;
            j.anchor.x = 1.5;
            j.anchor.y = other == 5 ? 2.1 : 2;
            j.stiffness = other == 7 ? 2 : 1;
            j.motor_limit = other == 8 ? 2 : 1;
            j.upper = other == 9 ? 2 : 1;
            assert_int_equal(carom_world_add_joint(w[k], &j, NULL), CAROM_OK);
            if (other == 6) assert_int_equal(carom_world_exclude(w[k], 0, a), CAROM_OK);
            if (!k) s = snapshot_of(w[k]);
        }
        /* 3: the poses are state; but the joint's anchor lies elsewhere on the body */
        refuses(w[1], s.size, s.bytes, "another scene");
        free(s.bytes);
        carom_world_destroy(w[0]);
        carom_world_destroy(w[1]);
    }
}

static uint64_t fnv(size_t n, const unsigned char *x)
{
    uint64_t h = UINT64_C(14695981039346656037);
    for (size_t k = 0; k < n; k++) h = (h ^ x[k]) * UINT64_C(1099511628211);
    return h;
}

static void sign(blob *s)
{
    const uint64_t h = fnv(s->size - 8, s->bytes);
    for (int k = 0; k < 8; k++) s->bytes[s->size - 8 + (size_t)k] = (unsigned char)(h >> 8 * k);
}

/* Bytes that someone changed and signed: refused, or taken up as a state that can be stepped.
 * Sanitizers watch. */
static void survives_forged_bytes(void **state)
{
    (void)state;
    rng r = rng_from(7);
    carom_world *w = busy_world(CAROM_LOCATED);
    scene_run(w, 45, NULL);
    blob good = snapshot_of(w);
    blob s = {good.size, malloc(good.size)};
    assert_non_null(s.bytes);
    int refused = 0;
    int taken = 0;
    for (int k = 0; k < 3000; k++) {
        memcpy(s.bytes, good.bytes, good.size);
        const int n = 1 + rng_int(&r, 4);
        for (int i = 0; i < n; i++) {
            const size_t at = 32 + (size_t)rng_int(&r, (int)good.size - 40);
            s.bytes[at] = (unsigned char)rng_int(&r, 256);
        }
        sign(&s);
        const carom_status e = carom_world_restore(w, s.size, s.bytes);
        refused += e == CAROM_E_ARGUMENT;
        taken += e == CAROM_OK;
        assert_true(e == CAROM_E_ARGUMENT || e == CAROM_OK);
        if (e == CAROM_OK && k % 10 == 0) carom_world_step(w, NULL, NULL);
    }
    assert_true(refused > 300 && taken > 300);
    assert_int_equal(carom_world_restore(w, good.size, good.bytes), CAROM_OK);
    free(s.bytes);
    free(good.bytes);
    carom_world_destroy(w);
}

static void capacity(void **state)
{
    (void)state;
    unsigned char bytes[8] = {0};
    size_t size = 0;
    carom_world *w = busy_world(CAROM_LOCATED);
    assert_int_equal(carom_world_snapshot(w, sizeof bytes, bytes, &size), CAROM_E_CAPACITY);
    assert_true(size > sizeof bytes && bytes[0] == 0);
    assert_non_null(strstr(carom_world_error(w), "needs"));
    assert_int_equal(carom_world_snapshot(NULL, 0, NULL, &size), CAROM_E_ARGUMENT);
    assert_int_equal(carom_world_snapshot(w, 8, NULL, &size), CAROM_E_ARGUMENT);
    assert_int_equal(carom_world_snapshot(w, 0, NULL, NULL), CAROM_E_ARGUMENT);
    assert_int_equal(carom_world_restore(NULL, 8, bytes), CAROM_E_ARGUMENT);
    assert_int_equal(carom_world_restore(w, 8, NULL), CAROM_E_ARGUMENT);
    assert_int_equal(carom_world_copy(w, NULL, NULL), CAROM_E_ARGUMENT);
    carom_world *out = w;
    assert_int_equal(carom_world_copy(NULL, NULL, &out), CAROM_E_ARGUMENT);
    assert_null(out);
    carom_world_destroy(w);
}

/* Copies and restores under an allocator whose k-th request fails. */
static carom_status copy_and_restore(const carom_world *from, const blob *s,
                                     const carom_allocator *a)
{
    carom_world *w = NULL;
    carom_world *fresh = NULL;
    carom_status e = carom_world_copy(from, a, &w);
    if (!e) e = carom_world_restore(w, s->size, s->bytes);
    carom_world *built = e ? NULL : busy_world(CAROM_LOCATED);
    if (!e) e = carom_world_copy(built, a, &fresh); /* not sealed: restore seals it */
    if (!e) e = carom_world_restore(fresh, s->size, s->bytes);
    carom_world_destroy(built);
    carom_world_destroy(w);
    carom_world_destroy(fresh);
    return e;
}

static void every_allocation_may_fail(void **state)
{
    (void)state;
    carom_world *w = busy_world(CAROM_LOCATED);
    scene_run(w, 45, NULL);
    blob s = snapshot_of(w);
    int k = 0;
    for (;; k++) {
        alloc_fail f = alloc_fail_at(k);
        const carom_allocator a = alloc_fail_allocator(&f);
        const carom_status e = copy_and_restore(w, &s, &a);
        assert_int_equal(f.live, 0);
        assert_int_equal(f.n_bad_sizes, 0);
        if (e == CAROM_OK) break;
        assert_int_equal(e, CAROM_E_MEMORY);
    }
    assert_true(k > 20);
    free(s.bytes);
    carom_world_destroy(w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(repeats_bit_for_bit),
        cmocka_unit_test(debts_come_along),
        cmocka_unit_test(goes_back),
        cmocka_unit_test(restoring_does_not_allocate),
        cmocka_unit_test(parameters_come_along),
        cmocka_unit_test(copies_are_alike_and_apart),
        cmocka_unit_test(copies_can_be_built_on),
        cmocka_unit_test(random_worlds),
        cmocka_unit_test(empty_world),
        cmocka_unit_test(refuses_what_does_not_fit),
        cmocka_unit_test(refuses_other_scenes),
        cmocka_unit_test(survives_forged_bytes),
        cmocka_unit_test(capacity),
        cmocka_unit_test(every_allocation_may_fail),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
