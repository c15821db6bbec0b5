/* What stands must not move, whatever its masses, and smooth motion has the order of its scheme. */
#include "near.h"
#include "scenes.h"

/* Heights of a stack of boxes of 1 m for 5 s: within 1e-9 of that size of where they began. */
static const double DRIFT = 1e-9;
static const double ORDER_TOL = 0.2;

typedef struct stack_case {
    const char *name;
    int n;
    double ratio; /* of the mass of each box to that of the one below it */
} stack_case;

static const stack_case STACKS[] = {{"stack of 10", 10, 1},   {"stack of 30", 30, 1},
                                    {"stack of 100", 100, 1}, {"tower of 1 to 1e6", 7, 10},
                                    {"1e6 on 1", 2, 1e6},     {"1 on 1e6", 2, 1e-6}};

static void stacks_stand(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof STACKS / sizeof STACKS[0]; i++) {
        const stack_case *c = &STACKS[i];
        carom_world *w = scene_world(9.81, 1.0 / 60);
        scene_floor(w, 0.5, 0);
        double mass = 1;
        for (int k = 0; k < c->n; k++, mass *= c->ratio) {
            scene_box(w, mass, 0.5, 0.5, (carom_pose){0, 0, 0.5 + k}, 0.5, 0);
        }
        scene_run(w, 300, NULL);
        for (int k = 0; k < c->n; k++) {
            const double *q = carom_world_q(w) + 3 * (k + 1);
            assert_near_case(c->name, k, q[0], 0, DRIFT);
            assert_near_case(c->name, k, q[1], 0, DRIFT);
            assert_near_case(c->name, k, q[2], 0.5 + k, DRIFT);
        }
        carom_world_destroy(w);
    }
}

static int one_link(carom_world *w)
{
    return scene_links(w, 1);
}

static int two_links(carom_world *w)
{
    return scene_links(w, 2);
}

static int ten_links(carom_world *w)
{
    return scene_links(w, 10);
}

/* Disc on disc until it slips. */
typedef struct swing_case {
    const char *name;
    int (*build)(carom_world *);
    double duration; /* [s] */
    int coarse[3];   /* steps: errors follow the power law, above rounding */
} swing_case;

static const swing_case SWINGS[] = {{"pendulum", one_link, 1, {60, 30, 15}},
                                    {"double pendulum", two_links, 1, {120, 60, 30}},
                                    {"chain of 10", ten_links, 0.5, {60, 10, 10}},
                                    {"disc on disc", scene_roll_off, 0.7, {30, 60, 12}}};

static void swing(const swing_case *c, int order, int n, double q[3])
{
    scene_order = order;
    carom_world *w = scene_world(9.81, c->duration / n);
    scene_order = 2;
    const int b = c->build(w);
    scene_run(w, n, NULL);
    for (int k = 0; k < 3; k++) q[k] = carom_world_q(w)[3 * b + k];
    carom_world_destroy(w);
}

static double apart(const double a[3], const double b[3])
{
    double d = 0;
    for (int k = 0; k < 3; k++) d = fmax(d, fabs(a[k] - b[k]));
    return d;
}

/* Reference: order 8 at 480 steps, which order 6 at 960 confirms to rounding. */
static void smooth_motion_has_its_order(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof SWINGS / sizeof SWINGS[0]; i++) {
        const swing_case *c = &SWINGS[i];
        double exact[3];
        double other[3];
        swing(c, 8, 480, exact);
        swing(c, 6, 960, other);
        assert_at_most(c->name, apart(exact, other), 1e-11);
        for (int order = 2; order <= 6; order += 2) {
            const int n = c->coarse[order / 2 - 1];
            double coarse[3];
            double fine[3];
            swing(c, order, n, coarse);
            swing(c, order, 2 * n, fine);
            const double observed = log2(apart(coarse, exact) / apart(fine, exact));
            if (fabs(observed - order) <= ORDER_TOL) continue;
            fail_msg("%s, order %d: observed order %g at errors %g and %g", c->name, order,
                     observed, apart(coarse, exact), apart(fine, exact));
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(stacks_stand),
                                       cmocka_unit_test(smooth_motion_has_its_order)};
    scene_integrator = CAROM_LOCATED;
    return cmocka_run_group_tests(tests, NULL, NULL);
}
