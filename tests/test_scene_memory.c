/* Scene files while memory runs out: the k-th request of the reader fails for k = 0, 1, ... until
 * the scene is there.  The linker puts the functions below in place of the allocator (--wrap). */
#include "near.h"

#include "clients/c/scene/remote.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* The allocator is one of the whole program: so are these. */
static long countdown = -1; /* requests until the one that fails; < 0: none fails */
static long n_failed;

void *__real_malloc(size_t size);
void *__real_calloc(size_t n, size_t size);
void *__real_realloc(void *old, size_t size);
void *__wrap_malloc(size_t size);
void *__wrap_calloc(size_t n, size_t size);
void *__wrap_realloc(void *old, size_t size);

static int fails(void)
{
    if (countdown < 0 || countdown-- > 0) return 0;
    n_failed++;
    return 1;
}

void *__wrap_malloc(size_t size)
{
    return fails() ? NULL : __real_malloc(size);
}

void *__wrap_calloc(size_t n, size_t size)
{
    return fails() ? NULL : __real_calloc(n, size);
}

void *__wrap_realloc(void *old, size_t size)
{
    return fails() ? NULL : __real_realloc(old, size);
}

static const char *write_file(const char *text)
{
    static char name[64];
    snprintf(name, sizeof name, "/tmp/carom_test_memory_%ld.json", (long)getpid());
    FILE *f = fopen(name, "w");
    assert_non_null(f);
    fputs(text, f);
    fclose(f);
    return name;
}

/* Reads the file with request k failing.  1: no request was left to fail. */
static int read_with_failure(const char *name, long k, int valid)
{
    crm_problems problems = crm_problems_of(name);
    n_failed = 0;
    countdown = k;
    crm_scene *scene = crm_scene_read(&problems);
    countdown = -1;
    const int whole = n_failed == 0;
    if (whole) {
        assert_true((scene != NULL) == valid);
        assert_true(crm_faulty(&problems) == !valid);
        assert_int_equal(problems.no_memory, 0);
    } else {
        assert_null(scene);
        assert_int_equal(problems.no_memory, 1);
    }
    crm_scene_free(scene);
    crm_problems_free(&problems);
    return whole;
}

static void read_until_it_succeeds(const char *text, int valid, long least)
{
    const char *name = write_file(text);
    long k = 0;
    while (!read_with_failure(name, k, valid)) k++;
    remove(name);
    print_message("%ld requests\n", k);
    assert_true(k >= least); /* the text makes at least so many: the test does inject */
}

static void good_files(void **state)
{
    (void)state;
    read_until_it_succeeds(
        "{\"format\":\"carom-scene/1\",\"bodies\":["
        "{\"name\":\"a\",\"type\":\"static\",\"shapes\":[{\"type\":\"circle\",\"radius\":1},"
        "{\"type\":\"hull\",\"vertices\":[[0,0],[1,0],[0,1]]}]},"
        "{\"mass\":1,\"inertia\":1,\"forces\":[[0,1,2,3],[1,0,0,0]]}],"
        "\"joints\":[{\"type\":\"revolute\",\"body_a\":\"a\",\"body_b\":1,\"anchor\":[0,0]}]}",
        1, 10);
}

static void wrong_files(void **state)
{
    (void)state;
    read_until_it_succeeds(
        "{\"format\":\"carom-scene/1\",\"format\":\"x\",\"bodies\":[{\"mas\":1}]}", 0, 6);
}

/* What goes to a server, and the forces of tables. */
static void remote_scenes(void **state)
{
    (void)state;
    const char *name = write_file("{\"format\":\"carom-scene/1\",\"bodies\":[{\"mass\":1,"
                                  "\"inertia\":1,\"forces\":[[0,1,2,3]]}]}");
    crm_problems problems = crm_problems_of(name);
    crm_scene *scene = crm_scene_read(&problems);
    assert_non_null(scene);
    long k = 0;
    for (int made = 0; !made; k++) {
        carom_client_scene remote;
        countdown = k;
        made = crm_scene_client(scene, &remote);
        countdown = -1;
        assert_int_equal(remote.n_bodies, made);
        crm_scene_client_free(&remote);
    }
    assert_true(k > 5);
    int n = 0;
    k = 0;
    for (int made = 0; !made; k++) {
        carom_client_force *forces = NULL;
        countdown = k;
        made = crm_scene_forces(scene, 0, 3, &forces, &n);
        countdown = -1;
        assert_true((forces != NULL) == made);
        free(forces);
    }
    assert_int_equal(n, 3);
    assert_int_equal(k, 3);
    crm_scene_free(scene);
    crm_problems_free(&problems);
    remove(name);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(good_files),
        cmocka_unit_test(wrong_files),
        cmocka_unit_test(remote_scenes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
