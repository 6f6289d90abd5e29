/* The state machine of live sources and the order of their frames: pure functions, no camera and no
 * clock. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "../../../drivers/live/order.h"
#include "../../../drivers/live/recovery.h"

static const int64_t ms = 1000000;

static struct fv_recovery started(void)
{
    struct fv_recovery_times times;
    struct fv_recovery recovery;
    fv_recovery_times_default(&times, 30);
    fv_recovery_start(&recovery, &times, 0);
    return recovery;
}

static enum fovea_source_state state_of(const struct fv_recovery *recovery, int64_t now_ns)
{
    return fv_recovery_state(&recovery->times, recovery->view, now_ns);
}

static void test_times(void **state)
{
    (void)state;
    struct fv_recovery_times t;
    fv_recovery_times_default(&t, 30);
    assert_true(t.late_ns > 83 * ms && t.late_ns < 84 * ms);
    assert_true(t.stalled_ns == 500 * ms && t.restart_ns == 1000 * ms && t.first_ns == 3000 * ms);
    fv_recovery_times_default(&t, 5);
    assert_true(t.late_ns == 500 * ms && t.stalled_ns == 2000 * ms && t.restart_ns == 4000 * ms);
    fv_recovery_times_default(&t, 0); /* not known: as with 30 */
    assert_true(t.stalled_ns == 500 * ms);
}

static void test_ages(void **state)
{
    (void)state;
    struct fv_recovery r = started();
    assert_int_equal(state_of(&r, 0), FOVEA_SOURCE_RETURNING);
    fv_recovery_tried(&r, FOVEA_OK, 10 * ms);
    assert_int_equal(state_of(&r, 20 * ms), FOVEA_SOURCE_RETURNING);
    assert_true(fv_recovery_streams(&r) && !fv_recovery_waited_enough(&r, 2000 * ms));
    assert_true(fv_recovery_waited_enough(&r, 3010 * ms)); /* the first frame never came */
    assert_int_equal(state_of(&r, 3010 * ms), FOVEA_SOURCE_STALLED);
    fv_recovery_good(&r, 100 * ms);
    assert_int_equal(state_of(&r, 100 * ms), FOVEA_SOURCE_OK);
    assert_int_equal(state_of(&r, 183 * ms), FOVEA_SOURCE_OK);
    assert_int_equal(state_of(&r, 184 * ms), FOVEA_SOURCE_LATE);
    assert_int_equal(state_of(&r, 599 * ms), FOVEA_SOURCE_LATE);
    assert_int_equal(state_of(&r, 600 * ms), FOVEA_SOURCE_STALLED);
    assert_true(!fv_recovery_waited_enough(&r, 1099 * ms) &&
                fv_recovery_waited_enough(&r, 1100 * ms));
    assert_true(r.recovered == 0);
    fv_recovery_good(&r, 700 * ms); /* it comes by itself: nothing was recovered from */
    assert_int_equal(state_of(&r, 700 * ms), FOVEA_SOURCE_OK);
    assert_true(r.recovered == 0);
}

static void test_unplugged(void **state)
{
    (void)state;
    struct fv_recovery r = started();
    fv_recovery_tried(&r, FOVEA_OK, 0);
    fv_recovery_good(&r, 10 * ms);
    fv_recovery_broken(&r, FOVEA_GONE, 20 * ms);
    assert_int_equal(state_of(&r, 20 * ms), FOVEA_SOURCE_GONE);
    assert_false(fv_recovery_streams(&r));
    for (int64_t now = 20 * ms; now < 100000 * ms;
         now += 50 * ms) { /* away for long: a look every 50 ms, always */
        assert_true(r.next_ns == now + 50 * ms);
        fv_recovery_tried(&r, FOVEA_GONE, r.next_ns);
        assert_int_equal(state_of(&r, now), FOVEA_SOURCE_GONE);
    }
    fv_recovery_tried(&r, FOVEA_OK, 200000 * ms);
    assert_int_equal(state_of(&r, 200000 * ms), FOVEA_SOURCE_RETURNING);
    fv_recovery_good(&r, 200010 * ms);
    assert_true(r.recovered == 1);
}

static void test_back_off_is_bounded(void **state)
{
    (void)state;
    struct fv_recovery r = started();
    int64_t now = 0, longest = 0, before = 0;
    fv_recovery_tried(&r, FOVEA_OK, now);
    fv_recovery_good(&r, now);
    fv_recovery_broken(&r, FOVEA_ERROR_SYSTEM, now);
    assert_true(r.next_ns == now); /* after good frames at once */
    assert_int_equal(state_of(&r, now), FOVEA_SOURCE_RETURNING);
    for (int i = 0; i < 100; i++) {
        fv_recovery_tried(&r, FOVEA_ERROR_SYSTEM, now);
        assert_int_equal(state_of(&r, now), FOVEA_SOURCE_STALLED);
        const int64_t pause = r.next_ns - now;
        assert_true(pause >= 50 * ms && pause >= before);
        before = pause;
        if (pause > longest) longest = pause;
        now = r.next_ns;
    }
    assert_true(longest == 1000 * ms);
    for (int i = 0; i < 10; i++) { /* set up, but no frame comes: bounded too */
        fv_recovery_tried(&r, FOVEA_OK, now);
        now += 3000 * ms;
        fv_recovery_broken(&r, FOVEA_ERROR_SYSTEM, now);
        assert_true(r.next_ns - now <= 1000 * ms && r.next_ns > now);
        now = r.next_ns;
    }
    fv_recovery_tried(&r, FOVEA_GONE, now); /* having been away, it starts over */
    fv_recovery_tried(&r, FOVEA_ERROR_SYSTEM, now);
    assert_true(r.next_ns == now + 50 * ms);
}

static void test_bad_frames(void **state)
{
    (void)state;
    struct fv_recovery r = started();
    fv_recovery_tried(&r, FOVEA_OK, 0);
    for (uint32_t i = 1; i < r.times.bad_frames; i++)
        assert_false(fv_recovery_bad(&r));
    fv_recovery_good(&r, 1);
    for (uint32_t i = 1; i < r.times.bad_frames; i++)
        assert_false(fv_recovery_bad(&r));
    assert_true(fv_recovery_bad(&r));
}

/* ---- order ----------------------------------------------------------------------------------- */

static const struct fv_order_now base = {{1000000 * ms, 5000000 * ms, 1700000000000 * ms}};

static struct fv_order_now later(int64_t ns)
{
    struct fv_order_now now = base;
    for (int i = 0; i < 3; i++)
        now.clock_ns[i] += ns;
    return now;
}

static struct fv_order_stamp stamp_of(int64_t stamp_ns, uint32_t sequence)
{
    return (struct fv_order_stamp){.stamp_ns = stamp_ns,
                                   .clock_known = true,
                                   .clock = FOVEA_CLOCK_MONOTONIC,
                                   .meaning = FOVEA_STAMP_EXPOSURE_START,
                                   .sequence_known = true,
                                   .sequence = sequence};
}

static void test_numbers(void **state)
{
    (void)state;
    struct fv_order order;
    struct fovea_frame frame = {.sequence = 0};
    fv_order_start(&order, -1);
    const uint32_t numbers[] = {4294967294u, 4294967295u, 0, 1, 4, 4, 5, 2};
    const uint64_t lost[] = {0, 0, 0, 0, 2, 0, 0, 0}, expected[] = {0, 1, 2, 3, 6, 7, 8, 9};
    for (int i = 0; i < 8; i++) {
        const struct fv_order_stamp stamp = stamp_of(base.clock_ns[0] + i * ms, numbers[i]);
        const struct fv_order_now now = later(i * ms);
        assert_true(fv_order_count(&order, &stamp) == lost[i]);
        assert_int_equal(fv_order_frame(&order, &stamp, &now, &frame), FV_ORDER_GOOD);
        assert_true(frame.sequence == expected[i]);
    }
    fv_order_again(&order); /* a restart is no loss, and numbers go on */
    const struct fv_order_stamp stamp = stamp_of(base.clock_ns[0] + 20 * ms, 1000);
    const struct fv_order_now now = later(20 * ms);
    assert_true(fv_order_count(&order, &stamp) == 0);
    assert_int_equal(fv_order_frame(&order, &stamp, &now, &frame), FV_ORDER_GOOD);
    assert_true(frame.sequence == 10);
}

static void test_clock_found_out(void **state)
{
    (void)state;
    const enum fovea_clock expected[3] = {FOVEA_CLOCK_MONOTONIC, FOVEA_CLOCK_BOOTTIME,
                                          FOVEA_CLOCK_MONOTONIC};
    for (int clock = 0; clock < 3; clock++) {
        struct fv_order order;
        struct fovea_frame frame = {.sequence = 0};
        fv_order_start(&order, -1);
        struct fv_order_stamp stamp = stamp_of(base.clock_ns[clock] - 3 * ms, 0);
        stamp.clock_known = false;
        assert_int_equal(fv_order_frame(&order, &stamp, &base, &frame), FV_ORDER_GOOD);
        assert_int_equal(frame.clock, expected[clock]);
        assert_true(frame.stamp_ns == base.clock_ns[expected[clock]] - 3 * ms);
        assert_int_equal(frame.stamp_meaning, FOVEA_STAMP_EXPOSURE_START);
        /* It comes back with stamps of another clock: they are moved to the first one. */
        fv_order_again(&order);
        stamp = stamp_of(base.clock_ns[(clock + 1) % 3] + 5 * ms, 0);
        stamp.clock_known = false;
        const struct fv_order_now now = later(7 * ms);
        assert_int_equal(fv_order_frame(&order, &stamp, &now, &frame), FV_ORDER_GOOD);
        assert_int_equal(frame.clock, expected[clock]);
        assert_true(frame.stamp_ns == base.clock_ns[expected[clock]] + 5 * ms);
    }
}

static void test_strange_stamps(void **state)
{
    (void)state;
    const int64_t strange[] = {0, -1, INT64_MIN, INT64_MAX, 11000 * ms, INT64_C(1) << 62};
    for (int known = 0; known < 2; known++)
        for (size_t i = 0; i < sizeof strange / sizeof strange[0]; i++) {
            struct fv_order order;
            struct fovea_frame frame = {.sequence = 0};
            fv_order_start(&order, 10 * ms);
            struct fv_order_stamp stamp = stamp_of(strange[i], 0);
            stamp.clock_known = known;
            stamp.exposure_ns = 5 * ms;
            assert_int_equal(fv_order_frame(&order, &stamp, &base, &frame), FV_ORDER_GOOD);
            assert_int_equal(frame.clock, FOVEA_CLOCK_MONOTONIC);
            assert_true(frame.stamp_ns == base.clock_ns[0]);
            assert_int_equal(frame.stamp_meaning, FOVEA_STAMP_UNKNOWN);
            assert_true(order.replaced == 1);
        }
}

static void test_repeated_and_backward(void **state)
{
    (void)state;
    struct fv_order order;
    struct fovea_frame frame = {.sequence = 0}, before;
    fv_order_start(&order, -1);
    const int64_t at[] = {0, 10, 10, 5, 20};
    const enum fv_order_verdict verdict[] = {FV_ORDER_GOOD, FV_ORDER_GOOD, FV_ORDER_REPEATED,
                                             FV_ORDER_BACKWARD, FV_ORDER_GOOD};
    for (int i = 0; i < 5; i++) {
        const struct fv_order_stamp stamp = stamp_of(base.clock_ns[0] + at[i] * ms, (uint32_t)i);
        const struct fv_order_now now = later(30 * ms);
        before = frame;
        (void)fv_order_count(&order, &stamp);
        assert_int_equal(fv_order_frame(&order, &stamp, &now, &frame), verdict[i]);
        if (verdict[i] != FV_ORDER_GOOD) assert_memory_equal(&before, &frame, sizeof frame);
    }
    assert_true(frame.sequence == 4);
}

static void test_meaning(void **state)
{
    (void)state;
    static const struct {
        enum fovea_stamp_meaning given, expected;
        int64_t exposure, readout, shift;
    } rows[] = {
        {FOVEA_STAMP_EXPOSURE_START, FOVEA_STAMP_EXPOSURE_MIDDLE, 4, -1, 2},
        {FOVEA_STAMP_EXPOSURE_START, FOVEA_STAMP_EXPOSURE_MIDDLE, 4, 20, 12},
        {FOVEA_STAMP_EXPOSURE_START, FOVEA_STAMP_EXPOSURE_START, 0, 20, 0},
        {FOVEA_STAMP_EXPOSURE_END, FOVEA_STAMP_EXPOSURE_END, 4, -1, 0},
        {FOVEA_STAMP_EXPOSURE_END, FOVEA_STAMP_EXPOSURE_MIDDLE, 4, 20, -12},
        {FOVEA_STAMP_EXPOSURE_END, FOVEA_STAMP_EXPOSURE_MIDDLE, 4, 0, -2},
        {FOVEA_STAMP_UNKNOWN, FOVEA_STAMP_UNKNOWN, 4, 20, 0},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct fv_order order;
        struct fovea_frame frame = {.sequence = 0};
        fv_order_start(&order, rows[i].readout < 0 ? -1 : rows[i].readout * ms);
        struct fv_order_stamp stamp = stamp_of(base.clock_ns[0] - 50 * ms, 0);
        stamp.meaning = rows[i].given;
        stamp.exposure_ns = rows[i].exposure * ms;
        assert_int_equal(fv_order_frame(&order, &stamp, &base, &frame), FV_ORDER_GOOD);
        assert_int_equal(frame.stamp_meaning, rows[i].expected);
        assert_true(frame.stamp_ns == base.clock_ns[0] + (rows[i].shift - 50) * ms);
        assert_true(frame.exposure_ns[0] == rows[i].exposure * ms);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_times),
        cmocka_unit_test(test_ages),
        cmocka_unit_test(test_unplugged),
        cmocka_unit_test(test_back_off_is_bounded),
        cmocka_unit_test(test_bad_frames),
        cmocka_unit_test(test_numbers),
        cmocka_unit_test(test_clock_found_out),
        cmocka_unit_test(test_strange_stamps),
        cmocka_unit_test(test_repeated_and_backward),
        cmocka_unit_test(test_meaning),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
