/* Sub-steps and orders chosen by the error that is allowed: docs/step.md, section "Tolerance". */
#include "near.h"
#include "scenes.h"

typedef struct smooth_case {
    const char *name;
    int (*build)(carom_world *);
    double duration; /* [s] */
} smooth_case;

static int pendulum(carom_world *w)
{
    return scene_links(w, 1);
}

static int double_pendulum(carom_world *w)
{
    return scene_links(w, 2);
}

/* The disc is followed until it has left, the others for 2 s. */
static const smooth_case CASES[] = {{"pendulum", pendulum, 2},
                                    {"double pendulum", double_pendulum, 2},
                                    {"disc on disc", scene_roll_off, 1},
                                    {"ladder", scene_ladder, 2}};
enum { N_CASES = sizeof CASES / sizeof CASES[0] };

static carom_world *make(const smooth_case *c, int order, double tolerance, double dt)
{
    scene_integrator = CAROM_LOCATED;
    scene_order = order;
    scene_tolerance = tolerance;
    carom_world *w = scene_world(9.81, dt);
    scene_order = 2;
    scene_tolerance = 0;
    c->build(w);
    return w;
}

/* Largest way between two poses of a body of half a meter, all bodies. */
static double difference(const carom_world *a, const carom_world *b)
{
    double largest = 0;
    for (int k = 0; k < carom_world_n_bodies(a); k++) {
        const double *p = carom_world_q(a) + 3 * k;
        const double *q = carom_world_q(b) + 3 * k;
        const double way = hypot(p[1] - q[1], p[2] - q[2]) + 0.5 * fabs(p[0] - q[0]);
        largest = fmax(largest, way);
    }
    return largest;
}

/* At 1e-8 m a step the end is within 1e-6 m.  Reference: order 8 at sixteen times the steps, whose
 * errors are below 1e-11 (test located). */
static void end_is_within(void **state)
{
    (void)state;
    static const double dts[] = {1.0 / 60, 1.0 / 15};
    for (int k = 0; k < 2 * N_CASES; k++) {
        const smooth_case *c = &CASES[k / 2];
        const double dt = dts[k % 2];
        const int n = (int)(c->duration / dt + 0.5);
        carom_world *w = make(c, 2, 1e-8, dt);
        carom_world *exact = make(c, 8, 0, dt / 16);
        scene_run(w, n, NULL);
        scene_run(exact, 16 * n, NULL);
        assert_at_most(c->name, difference(w, exact), 1e-6);
        carom_world_destroy(w);
        carom_world_destroy(exact);
    }
}

/* The estimates of all steps without impact together are within a factor of 5 of the true errors
 * together: each step's is found by eight of order 8 from the same state.  A single one may cross
 * zero. */
static void estimate_is_the_error(void **state)
{
    (void)state;
    for (int k = 0; k < N_CASES; k++) {
        const smooth_case *c = &CASES[k];
        const double dt = 1.0 / 15;
        const int n = (int)(c->duration / dt + 0.5);
        carom_world *w = make(c, 2, 1e-6, dt);
        carom_world *exact = make(c, 8, 0, dt / 8);
        double estimated = 0;
        double true_error = 0;
        for (int i = 0; i < n; i++) {
            carom_step_stats s;
            assert_int_equal(carom_world_set_state(exact, carom_world_q(w), carom_world_v(w)),
                             CAROM_OK);
            scene_run(w, 1, &s);
            scene_run(exact, 8, NULL);
            if (s.n_events) continue;
            estimated += s.estimate;
            true_error += difference(w, exact);
            assert_at_most(c->name, s.estimate, 1e-6);
        }
        if (!(estimated > true_error / 5 && estimated < 5 * true_error)) {
            fail_msg("%s: estimated %g, true %g", c->name, estimated, true_error);
        }
        carom_world_destroy(w);
        carom_world_destroy(exact);
    }
}

/* What asks for less does less: sub-steps and factorizations grow as the tolerance falls. */
static void work_follows_the_tolerance(void **state)
{
    (void)state;
    long before = 0;
    for (double tolerance = 1e-3; tolerance > 1e-13; tolerance *= 1e-3) {
        carom_world *w = make(&CASES[1], 2, tolerance, 1.0 / 15);
        long work = 0;
        for (int i = 0; i < 30; i++) {
            carom_step_stats s;
            scene_run(w, 1, &s);
            assert_int_equal(s.status, CAROM_OK);
            work += s.factorizations;
        }
        assert_true(work > before);
        before = work;
        carom_world_destroy(w);
    }
}

/* A tolerance below rounding cannot be met: the step ends, and says so. */
static void below_rounding(void **state)
{
    (void)state;
    carom_world *w = make(&CASES[1], 2, 1e-30, 1.0 / 15);
    carom_step_stats s;
    scene_run(w, 1, &s);
    assert_int_equal(s.status, CAROM_LIMIT);
    carom_world_destroy(w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(end_is_within),
        cmocka_unit_test(estimate_is_the_error),
        cmocka_unit_test(work_follows_the_tolerance),
        cmocka_unit_test(below_rounding),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
