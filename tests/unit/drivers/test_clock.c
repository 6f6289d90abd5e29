/* The distance of two clocks, when other programs take the processor between their readings. The
 * clocks here are the test's: what is read moves both on. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "drivers/clock.h"

enum { READS_MAX = 64 }; /* cmocka reads the time of tests as well */

static const int64_t ahead_ns = 5 * FV_SECOND_NS;
static int64_t monotonic_ns, takes_ns[READS_MAX]; /* after each reading */
static int reads;

int clock_gettime(clockid_t clock, struct timespec *time)
{
    const int64_t ns = monotonic_ns + (clock == CLOCK_BOOTTIME ? ahead_ns : 0);
    assert_true(reads < READS_MAX);
    *time = (struct timespec){.tv_sec = ns / FV_SECOND_NS, .tv_nsec = ns % FV_SECOND_NS};
    monotonic_ns += takes_ns[reads++];
    return 0;
}

/* The distance found where readings take so long, in microseconds, which is all that there is. */
static int64_t found(const int us[READS_MAX])
{
    monotonic_ns = 100 * FV_SECOND_NS;
    reads = 0;
    for (int i = 0; i < READS_MAX; i++)
        takes_ns[i] = us[i] * INT64_C(1000);
    return fv_clock_ahead_ns(CLOCK_BOOTTIME);
}

static void readings_close_together_count_at_once(void **state)
{
    (void)state;
    assert_int_equal(found((const int[READS_MAX]){8, 8}), ahead_ns);
    assert_int_equal(reads, 3);
}

static void interrupted_readings_are_made_again(void **state)
{
    (void)state;
    assert_int_equal(found((const int[READS_MAX]){50000, 1, 0, 1, 1}), ahead_ns);
    assert_int_equal(reads, 6);
    assert_int_equal(found((const int[READS_MAX]){1, 50000, 0, 9, 9}), ahead_ns);
    assert_int_equal(reads, 6);
}

/* On a machine that interrupts each: the shortest of four, whose middle is taken. */
static void the_shortest_of_four_counts(void **state)
{
    (void)state;
    const int us[READS_MAX] = {900, 0, 0, 60, 40, 0, 0, 700, 0, 800, 0};
    assert_int_equal(found(us), ahead_ns + 10000);
    assert_int_equal(reads, 12);
}

static void a_clock_is_not_ahead_of_itself(void **state)
{
    (void)state;
    reads = 0;
    assert_int_equal(fv_clock_ahead_ns(CLOCK_MONOTONIC), 0);
    assert_int_equal(reads, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(readings_close_together_count_at_once),
        cmocka_unit_test(interrupted_readings_are_made_again),
        cmocka_unit_test(the_shortest_of_four_counts),
        cmocka_unit_test(a_clock_is_not_ahead_of_itself),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
