/* The nearest obstacle by sector, against a search by unit vectors over scans that are drawn. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdlib.h>

#include "fovea/grid.h"

enum { RAYS = 360, SECTORS = 72 };
static const double turn = 6.283185307179586;
static float ranges[RAYS], nearest[SECTORS];

static struct fovea_scan scan_of(double first, double step, uint32_t count)
{
    return (struct fovea_scan){first, step, count, ranges};
}

static void all_rays(float range)
{
    for (int i = 0; i < RAYS; i++)
        ranges[i] = range;
}

/* Sectors of 5 degrees, clockwise from ahead, of a scan that goes the other way. */
static void an_obstacle_is_in_its_sector(void **state)
{
    (void)state;
    const struct fovea_scan scan = scan_of(0, turn / RAYS, RAYS);
    const struct fovea_scan_sectors clockwise = {0, -turn / SECTORS, SECTORS};
    all_rays(INFINITY);
    ranges[10] = 2;
    ranges[12] = 1.5f; /* 12 degrees to the left: -10 is sector 70 */
    ranges[13] = 4;    /* -15: sector 69 */
    ranges[358] = 3;   /* 2 degrees to the right */
    assert_int_equal(fovea_scan_nearest(&scan, &clockwise, nearest), FOVEA_OK);
    for (int k = 0; k < SECTORS; k++) {
        const float expected = k == 70 ? 1.5f : k == 69 ? 4 : k == 0 ? 3 : INFINITY;
        assert_true(nearest[k] == expected);
    }
}

/* One ray that is not known makes its sector so, but where another shows an obstacle; no ray too.
 */
static void what_is_not_known_stays_so(void **state)
{
    (void)state;
    const struct fovea_scan_sectors sectors = {0, turn / SECTORS, SECTORS};
    struct fovea_scan scan = scan_of(0, turn / RAYS, RAYS);
    all_rays(INFINITY);
    ranges[9] = NAN;
    ranges[19] = NAN;
    ranges[20] = 1;
    ranges[25] = 2;
    ranges[26] = NAN;
    ranges[30] = -1;
    assert_int_equal(fovea_scan_nearest(&scan, &sectors, nearest), FOVEA_OK);
    for (int k = 0; k < SECTORS; k++) {
        if (k == 2 || k == 6)
            assert_true(isnan(nearest[k]));
        else
            assert_true(nearest[k] == (k == 4 ? 1 : k == 5 ? 2 : INFINITY));
    }
    scan = scan_of(0, turn / 36, 36); /* every second sector has a ray */
    all_rays(INFINITY);
    assert_int_equal(fovea_scan_nearest(&scan, &sectors, nearest), FOVEA_OK);
    for (int k = 0; k < SECTORS; k++)
        assert_true(k % 2 == 0 ? isinf(nearest[k]) : isnan(nearest[k]));
    scan.count = 0;
    assert_int_equal(fovea_scan_nearest(&scan, &sectors, nearest), FOVEA_OK);
    for (int k = 0; k < SECTORS; k++)
        assert_true(isnan(nearest[k]));
}

static double drawn(double least, double most)
{
    return least + (most - least) * (rand() % 65536) / 65536;
}

/* A ray is in the sector whose middle is within half a sector of it. */
static float expected(const struct fovea_scan *scan, double middle, double width)
{
    float least = INFINITY;
    int inside = 0, unknown = 0;
    for (uint32_t i = 0; i < scan->count; i++) {
        const double angle = scan->first_rad + i * scan->step_rad;
        if (cos(angle - middle) <= cos(width / 2)) continue;
        inside++;
        if (isnan(scan->ranges_m[i]))
            unknown++;
        else
            least = fminf(least, scan->ranges_m[i]);
    }
    return isfinite(least) || (inside > 0 && unknown == 0) ? least : NAN;
}

static void scans_of_all_kinds(void **state)
{
    (void)state;
    srand(1);
    int known = 0, unknown = 0;
    for (int time = 0; time < 300; time++) {
        const uint32_t rays = 1 + (uint32_t)rand() % RAYS, count = 1 + (uint32_t)rand() % SECTORS;
        const double side = rand() % 2 ? 1 : -1, width = drawn(0.3, 1) * turn / count;
        const struct fovea_scan scan = scan_of(drawn(-4, 4), drawn(-1, 1) * turn / rays, rays);
        const struct fovea_scan_sectors sectors = {drawn(-4, 4), side * width, count};
        for (uint32_t i = 0; i < rays; i++)
            ranges[i] = rand() % 9 == 0 ? NAN : rand() % 3 == 0 ? (float)drawn(0, 5) : INFINITY;
        assert_int_equal(fovea_scan_nearest(&scan, &sectors, nearest), FOVEA_OK);
        for (uint32_t k = 0; k < count; k++) {
            const float right = expected(&scan, sectors.first_rad + k * sectors.step_rad, width);
            assert_true(isnan(right) ? isnan(nearest[k]) : nearest[k] == right);
            known += !isnan(right);
            unknown += isnan(right);
        }
    }
    assert_true(known > 1000 && unknown > 1000);
}

static void impossible_numbers_are_refused(void **state)
{
    (void)state;
    const struct fovea_scan good = scan_of(0, turn / RAYS, RAYS);
    const struct fovea_scan_sectors whole = {0, turn / SECTORS, SECTORS};
    const struct fovea_scan scans[] = {scan_of(NAN, 0.1, RAYS),
                                       scan_of(1e9, 0.1, RAYS),
                                       scan_of(0, INFINITY, RAYS),
                                       scan_of(0, 0.1, 65537),
                                       {0, 0.1, RAYS, NULL}};
    const struct fovea_scan_sectors wrong[] = {{NAN, 0.1, 10}, {0, NAN, 10},  {0, 0, 10},
                                               {0, 0.1, 63},   {0, -0.1, 63}, {0, 7, 1}};
    nearest[0] = 42;
    for (size_t i = 0; i < sizeof scans / sizeof *scans; i++)
        assert_int_equal(fovea_scan_nearest(&scans[i], &whole, nearest), FOVEA_ERROR_ARGUMENT);
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++)
        assert_int_equal(fovea_scan_nearest(&good, &wrong[i], nearest), FOVEA_ERROR_ARGUMENT);
    assert_true(nearest[0] == 42);
    assert_int_equal(fovea_scan_nearest(&good, &whole, nearest), FOVEA_OK);
}

/* A width as a message rounds it: the rest of a turn behind the last sector is the first one's. */
static void the_rest_of_a_turn_is_the_first_sectors(void **state)
{
    (void)state;
    const double width = turn / SECTORS * (1 - 1e-7);
    const struct fovea_scan_sectors sectors = {0, width, SECTORS};
    const struct fovea_scan scan = scan_of(-0.5 * width - 1e-8, turn, 1);
    for (int k = 0; k < SECTORS; k++)
        nearest[k] = 7;
    ranges[0] = 2;
    assert_int_equal(fovea_scan_nearest(&scan, &sectors, nearest), FOVEA_OK);
    assert_true(nearest[0] == 2);
    for (int k = 1; k < SECTORS; k++)
        assert_true(isnan(nearest[k]));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_obstacle_is_in_its_sector),
        cmocka_unit_test(what_is_not_known_stays_so),
        cmocka_unit_test(scans_of_all_kinds),
        cmocka_unit_test(impossible_numbers_are_refused),
        cmocka_unit_test(the_rest_of_a_turn_is_the_first_sectors),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
