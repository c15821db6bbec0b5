/* sparse.h: checks and products of compressed-column views. */
#include "near.h"

#include "libsolver/lcp/sparse.h"

#include <string.h>

/* [ 1 0 4 ]
 * [ 0 3 0 ]   with the 4 split in 1.5 + 2.5, columns 0 and 2 out of order */
static const int COL[] = {0, 2, 3, 6};
static const int ROW[] = {2, 0, 1, 0, 2, 0};
static const double VAL[] = {-2, 1, 3, 1.5, 5, 2.5};
/* the whole: [1 0 4; 0 3 0; -2 0 5] */
static const carom_sparse A = {COL, ROW, VAL};

static void multiplies(void **state)
{
    (void)state;
    const double x[] = {1, -2, 3};
    double y[] = {100, 100, 100};
    const double forward[] = {100 + 2 * 13, 100 + 2 * -6, 100 + 2 * 13};
    crm_sparse_add(&A, 3, 2.0, x, y);
    assert_memory_equal(y, forward, sizeof y); /* small integers: exact */
    double t[] = {0, 0, 0};
    const double backward[] = {-(1 - 6), -(-6), -(4 + 15)};
    crm_sparse_add_t(&A, 3, -1.0, x, t);
    assert_memory_equal(t, backward, sizeof t);
    const double one[] = {1, 1, 1};
    double rows[] = {0, 0, 0};
    double columns[] = {0, 0, 0};
    const double row_sums[] = {5, 3, 7};
    const double column_sums[] = {3, 3, 9};
    crm_sparse_add_abs(&A, 3, one, rows);
    crm_sparse_add_abs_t(&A, 3, one, columns);
    assert_memory_equal(rows, row_sums, sizeof rows);
    assert_memory_equal(columns, column_sums, sizeof columns);
}

/* col = NULL: a matrix of zeros. */
static void nothing_is_zero(void **state)
{
    (void)state;
    const carom_sparse none = {NULL, NULL, NULL};
    const double x[] = {1, 2, 3};
    const double kept[] = {7, 8, 9};
    double y[] = {7, 8, 9};
    crm_sparse_add(&none, 3, 1.0, x, y);
    crm_sparse_add_t(&none, 3, 1.0, x, y);
    crm_sparse_add_abs(&none, 3, x, y);
    crm_sparse_add_abs_t(&none, 3, x, y);
    assert_memory_equal(y, kept, sizeof y);
    assert_int_equal(crm_sparse_count(&none, 3), 0);
    assert_true(crm_sparse_valid(&none, 3, 3));
}

static void checks(void **state)
{
    (void)state;
    const int other_row[] = {2, 0, 1, 0, 2, 1};
    const carom_sparse B = {COL, other_row, VAL};
    const carom_sparse none = {NULL, NULL, NULL};
    assert_int_equal(crm_sparse_count(&A, 3), 6);
    assert_true(crm_sparse_valid(&A, 3, 3));
    assert_false(crm_sparse_valid(&A, 2, 3)); /* row 2 of 2 */
    assert_true(crm_sparse_same(&A, &A, 3));
    assert_false(crm_sparse_same(&A, &B, 3));
    assert_false(crm_sparse_same(&A, &none, 3));
    assert_true(crm_finite(6, VAL));
    const double bad[] = {1, NAN};
    const double worse[] = {-HUGE_VAL, 1};
    assert_true(crm_finite(1, bad));
    assert_false(crm_finite(2, bad));
    assert_false(crm_finite(2, worse));
    assert_true(crm_finite(0, NULL));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(multiplies),
        cmocka_unit_test(nothing_is_zero),
        cmocka_unit_test(checks),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
