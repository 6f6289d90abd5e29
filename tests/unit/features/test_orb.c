/* ORB's directions and turned patterns against sines and cosines. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <math.h>
#include <stdlib.h>

#include <cmocka.h>

#include "features/orb.h"
#include "base/elementary.h"

static void direction_is_the_nearest(void **state)
{
    (void)state;
    struct fv_random random;
    fv_random_seed(&random, 3);
    for (int i = 0; i < 200000; i++) {
        const int bits = (int)fv_random_below(&random, 22) + 1;
        const int32_t x = (int32_t)fv_random_below(&random, 2u << bits) - (1 << bits);
        const int32_t y = (int32_t)fv_random_below(&random, 2u << bits) - (1 << bits);
        if (x == 0 && y == 0) continue;
        const double off = atan2(y, x) - (double)fv_orb_angle(fv_orb_direction(x, y));
        assert_true(fabs(remainder(off, 2 * M_PI)) <= M_PI / FV_ORB_DIRECTIONS + 1e-6);
    }
    assert_int_equal(fv_orb_direction(0, 0), 0);
    for (int k = 0; k < FV_ORB_DIRECTIONS; k++) {
        const double angle = 2 * M_PI * k / FV_ORB_DIRECTIONS;
        assert_int_equal(
            fv_orb_direction((int32_t)lround(1e6 * cos(angle)), (int32_t)lround(1e6 * sin(angle))),
            k);
    }
    assert_int_equal(fv_orb_direction(INT32_MIN + 1, 0), FV_ORB_DIRECTIONS / 2);
    assert_int_equal(fv_orb_direction(0, INT32_MIN + 1), 3 * FV_ORB_QUARTER);
}

/* What describe rests on: the pattern of direction k + 64 is that of k with (x, y) taken to (-y,
 * x), for every direction. */
static void quarter_turns_swap_coordinates(void **state)
{
    (void)state;
    for (int k = 0; k < FV_ORB_DIRECTIONS; k++) {
        struct fv_orb_pattern here, next;
        fv_orb_turn(fv_orb_angle((uint8_t)k), &here);
        fv_orb_turn(fv_orb_angle((uint8_t)(k + FV_ORB_QUARTER)), &next);
        for (int i = 0; i < FV_ORB_SAMPLES; i++) {
            assert_int_equal(next.xy[2 * i], -here.xy[2 * i + 1]);
            assert_int_equal(next.xy[2 * i + 1], here.xy[2 * i]);
        }
    }
}

static void samples_stay_within_the_margin(void **state)
{
    (void)state;
    for (int k = 0; k < FV_ORB_DIRECTIONS; k++) {
        struct fv_orb_pattern turned;
        fv_orb_turn(fv_orb_angle((uint8_t)k), &turned);
        for (int i = 0; i < 2 * FV_ORB_SAMPLES; i++)
            assert_true(abs(turned.xy[i]) < FV_ORB_MARGIN_PX);
    }
}

/* The moments of a patch that is bright on one side point there, on every kernel set. */
static void moments_point_to_the_bright_side(void **state)
{
    (void)state;
    enum { SIZE = 64, MIDDLE = SIZE / 2 };
    static uint8_t image[SIZE * SIZE];
    for (int set = 0; set < FV_CPU_SET_COUNT; set++) {
        struct fv_kernels kernels;
        fv_kernels_init(&kernels, (enum fv_cpu_set)set);
        for (int k = 0; k < FV_ORB_DIRECTIONS; k += 16) {
            const double angle = 2 * M_PI * k / FV_ORB_DIRECTIONS;
            for (int y = 0; y < SIZE; y++)
                for (int x = 0; x < SIZE; x++)
                    image[y * SIZE + x] =
                        (x - MIDDLE) * cos(angle) + (y - MIDDLE) * sin(angle) > 1e-9 ? 200 : 50;
            const int32_t centre = MIDDLE * SIZE + MIDDLE;
            int32_t m[2];
            kernels.moments_u8(m, image, SIZE, &centre, 1);
            const int off = (int8_t)(fv_orb_direction(m[0], m[1]) - k);
            assert_true(abs(off) <= 3);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(direction_is_the_nearest),
        cmocka_unit_test(quarter_turns_swap_coordinates),
        cmocka_unit_test(samples_stay_within_the_margin),
        cmocka_unit_test(moments_point_to_the_bright_side),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
