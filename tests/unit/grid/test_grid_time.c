/* How long an update of the free-space grid takes, on a drawn world. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "common/drawn_world.h"

static int64_t cpu_ns(void)
{
    struct timespec now;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return now.tv_sec * SECOND + now.tv_nsec;
}

/* The work of looking points up, to hold the update against in the same moment: what else runs on
 * the processor slows both. */
static int64_t projections_ns(int count)
{
    double sum = 0, pixel[2];
    const int64_t begin = cpu_ns();
    for (int i = 0; i < count; i++) {
        const double point[3] = {0.01 * (i % 71) - 0.35, 0.3, 1 + 0.01 * (i % 97)};
        if (fovea_camera_project(&camera, point, pixel, NULL) == FOVEA_OK)
            sum += pixel[0] + pixel[1];
    }
    const int64_t took = cpu_ns() - begin;
    assert_true(sum > 0);
    return took;
}

/* Points of two cameras on the face of a box. */
static void fill_points(struct fovea_grid_point *points, int count)
{
    for (int i = 0; i < count; i++)
        points[i] = (struct fovea_grid_point){
            .position_m = {2, -1 + 0.02f * (float)(i % 100), 0.1f + 0.03f * (float)(int)(i / 100)},
            .along_m = 0.02f,
            .across_m = 0.002f};
}

/* 0.4 ms is the bar (docs/measured.md), of an update as runs have it: with the defaults, points of
 * 1,000 features, and a floor that is uncertain. Judged is the ratio to projections, which is that
 * bar on an AMD EPYC (Zen 3), where ten thousand of them took .218 ms with derivatives that nobody
 * asked for, and take 0.75 of it without, as on an Intel Xeon. */
static void an_update_takes_at_most_0_4_ms(void **state)
{
    (void)state;
    enum { RUNS = 400, PROJECTIONS = 10000, POINTS = 1000 };
    static struct fovea_grid_point points[POINTS];
    const double ratio_max = 0.4 / (0.75 * 0.218);
    int64_t least = INT64_MAX, least_beside = INT64_MAX;
    if (getenv("FOVEA_TIMED") == NULL) {
        printf("SKIPPED time of an update: judged in the ordinary build\n");
        return;
    }
    fovea_grid_config_default(&config);
    make_grid();
    struct fovea_grid_view view = view_from(0, 0, 0, 0.3, 0);
    add_box(2, 2.4, -1, 0, 0.5, WALL);
    draw(&view);
    fill_points(points, POINTS);
    view.points = points;
    view.point_count = POINTS;
    view.floor_covariance[0] = view.floor_covariance[3] = 1e-5;
    view.floor_covariance[5] = 1e-5;
    for (int i = 0; i < RUNS; i++) {
        view.stamp_ns = i * SECOND / 5;
        const int64_t begin = cpu_ns();
        assert_int_equal(fovea_grid_update(grid, &view), FOVEA_OK);
        const int64_t took = cpu_ns() - begin, beside = projections_ns(PROJECTIONS);
        least = took < least ? took : least;
        least_beside = beside < least_beside ? beside : least_beside;
    }
    print_message("an update takes %.3f ms, %d projections %.3f ms\n", (double)least * 1e-6,
                  PROJECTIONS, (double)least_beside * 1e-6);
    assert_true((double)least <= ratio_max * (double)least_beside);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(an_update_takes_at_most_0_4_ms, setup, free_grid),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
