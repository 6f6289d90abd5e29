/* Hashes of two runs that are heard: they are compared in the order of iterations however far one
 * run is behind, and nothing is called the first difference where earlier iterations are unknown.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "app/watch/pairs.h"

#include "fovea_lockstep_t.h"

enum { LEFT, RIGHT, PLENTY = 1 << 20 };

static char left[] = "LEFT", right[] = "RIGHT";
static char *const names[2] = {left, right};
static struct fv_pairs *pairs;
static size_t message_bytes;

/* What iteration n of a run sends; `inputs` and `state` are numbers of its own. */
static void take(int run, int64_t n, int64_t inputs, int64_t state)
{
    static char features[] = "features", odometry[] = "odometry", pose[] = "POSE";
    uint8_t data[512];
    fovea_named_hash_t stages[] = {{features, n}, {odometry, state}}, messages[] = {{pose, state}};
    const fovea_lockstep_t message = {.stamp = {.time_ns = 1000 * n, .sequence = n},
                                      .iteration = n,
                                      .inputs_hash = inputs,
                                      .state_hash = state,
                                      .stage_count = 2,
                                      .stages = stages,
                                      .message_count = 1,
                                      .messages = messages};
    const int bytes = fovea_lockstep_t_encode(data, 0, sizeof data, &message);
    assert_true(bytes > 0);
    message_bytes = (size_t)bytes;
    fv_pairs_take(pairs, run, data, (size_t)bytes);
}

static void take_equal(int run, int64_t from, int64_t to)
{
    for (int64_t n = from; n < to; n++)
        take(run, n, 10 + n, 20 + n);
}

/* Other inputs from `from` on, and what follows from them. */
static void take_other(int run, int64_t from, int64_t to)
{
    for (int64_t n = from; n < to; n++)
        take(run, n, n == from ? 1 : 10 + n, 2);
}

static void open_pairs(size_t bytes_max, uint64_t iterations)
{
    pairs = fv_pairs_open(bytes_max, iterations);
    assert_non_null(pairs);
}

static struct fv_compared found(bool silent)
{
    return fv_pairs_found(pairs, names, silent);
}

static int close_pairs(void **state)
{
    (void)state;
    fv_pairs_close(pairs);
    pairs = NULL;
    return 0;
}

static void a_run_far_behind_is_compared_from_its_start(void **state)
{
    (void)state;
    open_pairs(PLENTY, 0);
    take_equal(LEFT, 0, 3000);
    take_equal(RIGHT, 0, 10);
    assert_int_equal(found(false).iterations, 10);
    take_other(RIGHT, 10, 3000);
    const struct fv_compared compared = found(false);
    assert_true(compared.different);
    assert_int_equal(compared.iteration, 10);
    assert_int_equal(compared.iterations, 10);
    assert_int_equal(compared.unseen, 0);
    assert_string_equal(compared.inputs, "by their hash");
    assert_string_equal(compared.stage, "");
}

static void what_follows_unseen_iterations_is_not_the_first(void **state)
{
    (void)state;
    open_pairs(PLENTY, 0);
    take_equal(LEFT, 0, 80);
    take_equal(RIGHT, 0, 10);
    take(RIGHT, 74, 84, 3); /* 10 to 73 were lost on their way */
    const struct fv_compared compared = found(false);
    assert_true(compared.different);
    assert_int_equal(compared.iteration, 74);
    assert_int_equal(compared.iterations, 10);
    assert_int_equal(compared.unseen, 64);
    assert_string_equal(compared.stage, "odometry");
}

static void both_may_lack_the_same(void **state)
{
    (void)state;
    open_pairs(PLENTY, 0);
    for (int run = LEFT; run <= RIGHT; run++)
        take_equal(run, 100, 103); /* heard from then on */
    assert_int_equal(found(true).iterations, 3);
    assert_false(found(true).incomplete);
    take(LEFT, 105, 115, 1);
    take(RIGHT, 105, 115, 2);
    assert_int_equal(found(true).unseen, 2);
    assert_true(found(true).different);
}

static void a_first_one_heard_late_is_not_the_first(void **state)
{
    (void)state;
    open_pairs(PLENTY, 0);
    take(LEFT, 100, 110, 1);
    take(RIGHT, 100, 110, 2);
    assert_int_equal(found(false).unseen, 100);
}

/* The earliest are kept, so that what is compared has nothing unseen before it. */
static void without_room_the_earliest_are_kept(void **state)
{
    struct fv_compared compared;
    (void)state;
    open_pairs(PLENTY, 0);
    take_equal(LEFT, 0, 1); /* so that the length is known */
    fv_pairs_close(pairs);
    open_pairs(100 * message_bytes, 0);
    take_equal(LEFT, 0, 330);
    take_equal(RIGHT, 0, 330);
    compared = found(true);
    assert_false(compared.different);
    assert_in_range(compared.iterations, 20, 100);
    assert_true(compared.incomplete);
    assert_non_null(strstr(compared.ended, "since LEFT was too far ahead to keep them"));
    take(LEFT, 330, 340, 1);
    take(RIGHT, 330, 340, 2);
    compared = found(true);
    assert_true(compared.different);
    assert_int_equal(compared.iteration, 330);
    assert_int_equal(compared.unseen, 330 - compared.iterations);
}

static void a_run_that_is_only_behind_is_no_fault(void **state)
{
    (void)state;
    open_pairs(PLENTY, 30);
    take_equal(RIGHT, 0, 80);
    take_equal(LEFT, 0, 29);
    assert_false(fv_pairs_done(pairs));
    assert_false(found(false).incomplete);
    assert_non_null(strstr(found(false).ended, "51 more of RIGHT, to which LEFT had not come"));
    assert_true(found(true).incomplete); /* silence: they did not come */
    assert_non_null(strstr(found(true).ended, "51 were not compared, since LEFT did not"));
    take_equal(LEFT, 29, 40);
    assert_true(fv_pairs_done(pairs));
    assert_int_equal(found(false).iterations, 30);
    assert_false(found(false).incomplete);
    assert_string_equal(found(false).ended, "");
}

static void what_one_left_out_is_said(void **state)
{
    (void)state;
    open_pairs(PLENTY, 0);
    take_equal(LEFT, 0, 5);
    take_equal(RIGHT, 0, 3);
    take_equal(RIGHT, 4, 5);
    assert_int_equal(found(false).iterations, 4);
    assert_true(found(false).incomplete);
    assert_string_equal(found(false).ended, "1 were not compared, since RIGHT did not send them");
}

static void twice_is_once_and_a_new_run_ends_it(void **state)
{
    (void)state;
    open_pairs(PLENTY, 0);
    take_equal(LEFT, 0, 5);
    take_equal(LEFT, 4, 5); /* by two interfaces */
    take_equal(RIGHT, 0, 5);
    assert_int_equal(found(false).iterations, 5);
    assert_false(fv_pairs_done(pairs));
    take_equal(LEFT, 0, 1);
    assert_true(fv_pairs_done(pairs));
    assert_true(found(false).incomplete);
    assert_string_equal(found(false).ended, "LEFT began again after its iteration 4");
}

static void nonsense_is_left(void **state)
{
    static const uint8_t nonsense[64] = {1};
    (void)state;
    open_pairs(PLENTY, 0);
    fv_pairs_take(pairs, LEFT, nonsense, sizeof nonsense);
    fv_pairs_take(pairs, RIGHT, nonsense, 0);
    take(LEFT, -1, 0, 0);
    take_equal(LEFT, 0, 1);
    take_equal(RIGHT, 0, 1);
    assert_int_equal(found(true).iterations, 1);
    assert_false(found(true).incomplete);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_teardown(a_run_far_behind_is_compared_from_its_start, close_pairs),
        cmocka_unit_test_teardown(what_follows_unseen_iterations_is_not_the_first, close_pairs),
        cmocka_unit_test_teardown(both_may_lack_the_same, close_pairs),
        cmocka_unit_test_teardown(a_first_one_heard_late_is_not_the_first, close_pairs),
        cmocka_unit_test_teardown(without_room_the_earliest_are_kept, close_pairs),
        cmocka_unit_test_teardown(a_run_that_is_only_behind_is_no_fault, close_pairs),
        cmocka_unit_test_teardown(what_one_left_out_is_said, close_pairs),
        cmocka_unit_test_teardown(twice_is_once_and_a_new_run_ends_it, close_pairs),
        cmocka_unit_test_teardown(nonsense_is_left, close_pairs),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
