/* test_wire.c: the validator: accepts what the generated encoders write, refuses everything else,
 * and never looks beyond the bytes it is given. */
#include "near.h"

#include "messages.h"

#include <stdlib.h>
#include <string.h>

static int passes(const bytes *m)
{
    char text[256];
    const crm_wire_limits limits = crm_wire_default_limits();
    /* A copy of the exact size: the address sanitizer sees any byte read too much. */
    unsigned char *copy = malloc(m->size > 0 ? (size_t)m->size : 1);
    memcpy(copy, m->data, (size_t)m->size);
    text[0] = 0;
    const int done = crm_wire_check(m->type, &limits, copy, (size_t)m->size, text, sizeof text);
    free(copy);
    if (!done) assert_true(text[0]);
    return done;
}

static void accepts_what_encoders_write(void **state)
{
    (void)state;
    for (int t = 0; t < CRM_WIRE_N_TYPES; t++) {
        bytes m = pack_sample((crm_wire_type)t);
        crm_wire_header h;
        if (!passes(&m)) fail_msg("%s was refused", crm_wire_type_name((crm_wire_type)t));
        assert_true(crm_wire_read_header(m.type, m.data, (size_t)m.size, &h));
        free(m.data);
    }
}

static void refuses_every_truncation(void **state)
{
    (void)state;
    for (int t = 0; t < CRM_WIRE_N_TYPES; t++) {
        bytes m = pack_sample((crm_wire_type)t);
        for (const int size = m.size; m.size > 0;) {
            m.size--;
            if (passes(&m)) {
                fail_msg("%s: %d of %d bytes passed", crm_wire_type_name(m.type), m.size, size);
            }
        }
        free(m.data);
    }
}

static void refuses_trailing_bytes(void **state)
{
    (void)state;
    for (int t = 0; t < CRM_WIRE_N_TYPES; t++) {
        bytes m = pack_sample((crm_wire_type)t);
        m.data = realloc(m.data, (size_t)m.size + 1);
        m.data[m.size++] = 0;
        if (passes(&m)) fail_msg("%s with a byte more passed", crm_wire_type_name(m.type));
        free(m.data);
    }
}

static void refuses_other_fingerprints(void **state)
{
    (void)state;
    for (int t = 0; t < CRM_WIRE_N_TYPES; t++) {
        bytes m = pack_sample((crm_wire_type)t);
        m.data[3] ^= 1;
        assert_false(passes(&m));
        free(m.data);
        for (int u = 0; u < CRM_WIRE_N_TYPES; u++) {
            const int same = strcmp(crm_wire_type_name((crm_wire_type)t),
                                    crm_wire_type_name((crm_wire_type)u)) == 0;
            const int64_t a = crm_wire_fingerprint((crm_wire_type)t);
            const int64_t b = crm_wire_fingerprint((crm_wire_type)u);
            assert_int_equal(a == b, same);
        }
    }
}

static void put_i32(unsigned char *b, int64_t x)
{
    for (int i = 0; i < 4; i++) b[i] = (unsigned char)((uint64_t)x >> (24 - 8 * i));
}

/* Every four bytes are replaced in turn, and so every count and length.  (What passes although it
 * was changed is decoded by tests/fuzz.) */
static void refuses_bad_counts(void **state)
{
    static const int64_t bad[] = {-1, INT32_MIN, INT32_MAX, 1000000, 0x10000};
    (void)state;
    for (int t = 0; t < CRM_WIRE_N_TYPES; t++) {
        bytes m = pack_sample((crm_wire_type)t);
        int refused = 0;
        for (int at = 8; at + 4 <= m.size; at++) {
            unsigned char keep[4];
            memcpy(keep, m.data + at, 4);
            for (size_t k = 0; k < sizeof bad / sizeof bad[0]; k++) {
                put_i32(m.data + at, bad[k]);
                refused += !passes(&m);
            }
            memcpy(m.data + at, keep, 4);
        }
        /* Session requests have no count. */
        if (t != CRM_WIRE_SESSION) assert_true(refused > 0);
        assert_true(passes(&m));
        free(m.data);
    }
}

typedef struct fault {
    const char *name;
    crm_wire_type type;
    int at; /* of the number that is replaced; < 0: from the end */
    int64_t value;
    const char *says;
} fault;

/* Places follow from the fields of the .lcm files: 8 fingerprint, 28 header. */
static const fault faults[] = {
    {"negative", CRM_WIRE_STEP, 57, -1, "num_forces = -1 at byte 57 is outside 0 to 100000"},
    {"huge", CRM_WIRE_STEP, 57, INT32_MAX, "(--max-forces)"},
    {"dependent", CRM_WIRE_STEP, 57 + 4 + 16, 7,
     "num_force_values = 7 at byte 77 is not 3 times 2"},
    {"beyond the end", CRM_WIRE_STEP, -20, 3, "inside resend_step"},
    {"string length 0", CRM_WIRE_SCENE, 36, 0, "scene_name of length 0"},
    {"string length", CRM_WIRE_SCENE, 36, 300, "outside 1 to 256"},
    {"string negative", CRM_WIRE_SCENE, 36, -5, "scene_name of length -5"},
    {"no terminator", CRM_WIRE_SCENE, 36, 4, "does not end at its terminator"},
    {"terminator inside", CRM_WIRE_SCENE, 36, 6, "does not end at its terminator"},
};

static void names_the_fault(void **state)
{
    (void)state;
    const crm_wire_limits limits = crm_wire_default_limits();
    for (size_t k = 0; k < sizeof faults / sizeof faults[0]; k++) {
        const fault *f = &faults[k];
        char text[256] = "";
        bytes m = pack_sample(f->type);
        put_i32(m.data + (f->at < 0 ? m.size + f->at : f->at), f->value);
        if (crm_wire_check(f->type, &limits, m.data, (size_t)m.size, text, sizeof text)) {
            fail_msg("%s passed", f->name);
        }
        if (!strstr(text, f->says)) fail_msg("%s: '%s' without '%s'", f->name, text, f->says);
        free(m.data);
    }
}

static void names_the_size(void **state)
{
    (void)state;
    char text[256];
    crm_wire_limits limits = crm_wire_default_limits();
    bytes m = pack_sample(CRM_WIRE_SCENE);
    limits.message = m.size - 1;
    assert_false(crm_wire_check(m.type, &limits, m.data, (size_t)m.size, text, sizeof text));
    assert_non_null(strstr(text, "--max-message"));
    limits.message = m.size;
    assert_true(crm_wire_check(m.type, &limits, m.data, (size_t)m.size, text, sizeof text));
    limits.bodies = 3;
    assert_false(crm_wire_check(m.type, &limits, m.data, (size_t)m.size, text, sizeof text));
    assert_non_null(strstr(text, "num_bodies = 4"));
    assert_non_null(strstr(text, "--max-bodies"));
    free(m.data);
}

static void channels(void **state)
{
    char name[64];
    (void)state;
    crm_wire_channel_name(CRM_WIRE_STATE, "", name);
    assert_string_equal(name, "CAROM_STATE");
    crm_wire_channel_name(CRM_WIRE_STATE, "lab1", name);
    assert_string_equal(name, "CAROM_STATE_lab1");
    /* The longest suffix that caromd takes: LCM's channel names end at 63 bytes. */
    crm_wire_channel_name(CRM_WIRE_PARAMETER_GRADIENT, "12345678901234567890123456789012", name);
    assert_string_equal(name, "CAROM_PARAMETER_GRADIENT_12345678901234567890123456789012");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(accepts_what_encoders_write),
        cmocka_unit_test(refuses_every_truncation),
        cmocka_unit_test(refuses_trailing_bytes),
        cmocka_unit_test(refuses_other_fingerprints),
        cmocka_unit_test(refuses_bad_counts),
        cmocka_unit_test(names_the_fault),
        cmocka_unit_test(names_the_size),
        cmocka_unit_test(channels),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
