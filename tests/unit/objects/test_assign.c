/* Optimal assignment: the least total cost, against trying everything; forbidden pairs; more rows
 * than columns; ties. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <string.h>

#include "base/elementary.h"
#include "objects/assign.h"

enum { SIDE_MAX = 7 };

static struct fv_assign_scratch scratch;

/* Most that the pairs of rows from `row` on can gain (1 - cost), with the columns not in `used`. */
static double best_gain(const float *cost, int rows, int columns, int row, unsigned used)
{
    if (row == rows) return 0;
    double best = best_gain(cost, rows, columns, row + 1, used);
    for (int c = 0; c < columns; c++) {
        if (used >> c & 1 || cost[row * columns + c] >= 1) continue;
        const double gain = 1.0 - (double)cost[row * columns + c] +
                            best_gain(cost, rows, columns, row + 1, used | 1u << c);
        best = gain > best ? gain : best;
    }
    return best;
}

static double gain_of(const float *cost, int rows, int columns, const int32_t *column_of)
{
    double gain = 0;
    unsigned used = 0;
    for (int r = 0; r < rows; r++) {
        if (column_of[r] < 0) continue;
        assert_true(column_of[r] < columns);
        assert_false(used >> column_of[r] & 1);
        used |= 1u << column_of[r];
        assert_true(cost[r * columns + column_of[r]] < 1);
        gain += 1.0 - (double)cost[r * columns + column_of[r]];
    }
    return gain;
}

static void nothing_gains_more(void **state)
{
    (void)state;
    struct fv_random random;
    fv_random_seed(&random, 4);
    for (int round = 0; round < 2000; round++) {
        const int rows = 1 + (int)fv_random_below(&random, SIDE_MAX),
                  columns = 1 + (int)fv_random_below(&random, SIDE_MAX);
        const uint32_t forbidden = fv_random_below(&random, 10),
                       coarse = fv_random_below(&random, 2) == 0 ? 4 : 1000;
        float cost[SIDE_MAX * SIDE_MAX];
        int32_t column_of[SIDE_MAX];
        for (int i = 0; i < rows * columns; i++) {
            cost[i] = fv_random_below(&random, 10) < forbidden
                          ? 1.0f
                          : (float)fv_random_below(&random, coarse) / (float)coarse;
        }
        fv_assign(cost, columns, rows, columns, &scratch, column_of);
        const double found = gain_of(cost, rows, columns, column_of),
                     best = best_gain(cost, rows, columns, 0, 0);
        if (!(found > best - 1e-6))
            fail_msg("round %d: %d x %d: gained %f of %f", round, rows, columns, found, best);
    }
}

static void a_large_one_is_solved(void **state)
{
    (void)state;
    static float cost[FV_ASSIGN_MAX * FV_ASSIGN_MAX];
    static int32_t column_of[FV_ASSIGN_MAX];
    /* The best is the mirror image: everything else costs more. */
    for (int r = 0; r < FV_ASSIGN_MAX; r++)
        for (int c = 0; c < FV_ASSIGN_MAX; c++)
            cost[r * FV_ASSIGN_MAX + c] =
                c == FV_ASSIGN_MAX - 1 - r ? 0.4f
                                           : 0.5f + 0.3f * (float)((r * 7 + c * 13) % 11) / 11.0f;
    fv_assign(cost, FV_ASSIGN_MAX, FV_ASSIGN_MAX, FV_ASSIGN_MAX, &scratch, column_of);
    for (int r = 0; r < FV_ASSIGN_MAX; r++)
        assert_int_equal(column_of[r], FV_ASSIGN_MAX - 1 - r);
}

static void empty_sides_give_nothing(void **state)
{
    (void)state;
    const float forbidden[4] = {1, 1, 1, 1};
    int32_t column_of[2] = {7, 7};
    fv_assign(forbidden, 2, 2, 2, &scratch, column_of);
    assert_true(column_of[0] == -1 && column_of[1] == -1);
    column_of[0] = 7;
    fv_assign(forbidden, 0, 1, 0, &scratch, column_of);
    assert_int_equal(column_of[0], -1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(nothing_gains_more),
        cmocka_unit_test(a_large_one_is_solved),
        cmocka_unit_test(empty_sides_give_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
