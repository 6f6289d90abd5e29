/* Frames: features sorted into the grid without losing any, where they were to half a unit, with
 * the bearings of the lens model; searches find what a scan of all features finds. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
/* cmocka needs the above */
#include <cmocka.h>

#include "common/carved.h"
#include "base/elementary.h"
#include "geometry/vec.h"
#include "map/map.h"

enum { FEATURES = 700 };

static struct {
    struct fovea_camera camera;
    struct fv_bearing_table bearings;
    struct fv_map map;
    struct fv_kernels kernels;
    struct fovea_feature feature[FEATURES];
    uint8_t descriptor[FEATURES * FV_MAP_DESCRIPTOR_BYTES];
    uint16_t from[FEATURES];
    float bearing[FEATURES][3];
} t;

static void carve(void *context, struct fv_arena *arena)
{
    (void)context;
    const struct fv_map_limits limits = {4, 100, FEATURES, t.camera.width, t.camera.height, false};
    fv_bearing_carve(&t.bearings, t.camera.width, t.camera.height, arena);
    fv_map_carve(&t.map, &limits, &t.camera, &t.bearings, arena);
}

/* A frame of random features; those of a lens that folds are beyond what it knows in the corners.
 */
static void *make(int32_t width, int32_t height, double k1, uint64_t seed)
{
    struct fv_random random;
    fv_random_seed(&random, seed);
    memset(&t, 0, sizeof t);
    t.camera = (struct fovea_camera){.width = width,
                                     .height = height,
                                     .fx = 0.7 * width,
                                     .fy = 0.7 * width,
                                     .cx = 0.5 * width,
                                     .cy = 0.5 * height,
                                     .k = {k1}};
    assert_int_equal(fovea_camera_prepare(&t.camera, NULL), FOVEA_OK);
    fv_kernels_init(&t.kernels, FV_CPU_C);
    void *memory = carved(carve, NULL);
    fv_bearing_init(&t.bearings, &t.camera);
    fv_map_reset(&t.map);
    for (int i = 0; i < FEATURES; i++) {
        t.feature[i].x_px = (float)((width - 1) * fv_random_unit(&random));
        t.feature[i].y_px = (float)((height - 1) * fv_random_unit(&random));
        t.feature[i].level = (uint8_t)fv_random_below(&random, 8);
    }
    for (size_t i = 0; i < sizeof t.descriptor; i++)
        t.descriptor[i] = (uint8_t)fv_random_u32(&random);
    fv_map_fill_frame(&t.map, fv_map_current(&t.map), t.feature, t.descriptor, FEATURES, t.from);
    return memory;
}

static void test_features_stay_what_they_are(void **state)
{
    (void)state;
    static const struct {
        int32_t width, height;
        double k1, px;
    } cases[] = {{752, 480, -0.15, 1.0 / 64},
                 {1024, 700, 0, 1.0 / 64},
                 {1241, 376, 0, 1.0 / 32},
                 {4096, 3000, 0.05, 1.0 / 16}};
    for (size_t n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        void *memory = make(cases[n].width, cases[n].height, cases[n].k1, n + 1);
        const struct fv_map_frame frame = fv_map_frame_at(&t.map, fv_map_current(&t.map));
        bool seen[FEATURES] = {false};
        assert_true(t.map.pixel_px == cases[n].px);
        assert_int_equal(frame.keyframe->features, FEATURES);
        fv_map_bearings(&t.map, fv_map_current(&t.map), t.bearing);
        for (uint32_t f = 0; f < FEATURES; f++) {
            const struct fovea_feature *o = &t.feature[t.from[f]];
            struct fv_keypoint k;
            assert_false(seen[t.from[f]]);
            seen[t.from[f]] = true;
            const double x = frame.points[f].x * t.map.pixel_px,
                         y = frame.points[f].y * t.map.pixel_px;
            assert_true(fv_abs(x - (double)o->x_px) <= t.map.pixel_px / 2 &&
                        fv_abs(y - (double)o->y_px) <= t.map.pixel_px / 2);
            assert_int_equal(frame.points[f].level, o->level);
            assert_memory_equal(frame.descriptors + 32 * (size_t)f,
                                t.descriptor + 32 * (size_t)t.from[f], 32);
            assert_true(fv_map_keypoint(&t.map, &frame.points[f], &k));
            assert_memory_equal(&k, &frame.keypoints[f], sizeof k);
            assert_memory_equal(k.bearing, t.bearing[f], sizeof k.bearing);
            const double q[3] = {(double)k.bearing[0], (double)k.bearing[1], (double)k.bearing[2]};
            double pixel[2];
            assert_int_equal(fovea_camera_project(&t.camera, q, pixel, NULL), FOVEA_OK);
            assert_true(fv_abs(pixel[0] - x) < 2e-3 && fv_abs(pixel[1] - y) < 2e-3);
            assert_true(fv_map_error2(&t.map, &frame.points[f], q) < 1e-5);
        }
        free(memory);
    }
}

/* What the lens model refuses is left out, and nothing else. */
static void test_beyond_the_lens(void **state)
{
    (void)state;
    void *memory = make(752, 480, -0.6, 5);
    const struct fv_map_frame frame = fv_map_frame_at(&t.map, fv_map_current(&t.map));
    uint32_t known = 0;
    for (int i = 0; i < FEATURES; i++) {
        const double pixel[2] = {(double)t.feature[i].x_px, (double)t.feature[i].y_px};
        double bearing[3];
        known += fovea_camera_unproject(&t.camera, pixel, bearing, NULL) == FOVEA_OK;
    }
    assert_true(known > 100 && known < FEATURES);
    assert_in_range(frame.keyframe->features, known - known / 10,
                    known); /* the table's border loses a few */
    for (uint32_t f = 0; f < frame.keyframe->features; f++)
        assert_memory_equal(frame.descriptors + 32 * (size_t)f,
                            t.descriptor + 32 * (size_t)t.from[f], 32);
    free(memory);
}

static void test_search_is_a_scan(void **state)
{
    (void)state;
    void *memory = make(752, 480, -0.15, 9);
    const uint32_t slot = fv_map_current(&t.map);
    const struct fv_map_frame frame = fv_map_frame_at(&t.map, slot);
    struct fv_random random;
    fv_random_seed(&random, 2);
    for (int n = 0; n < 3000; n++) {
        const double x = 860 * fv_random_unit(&random) - 50, y = 580 * fv_random_unit(&random) - 50,
                     radius = 60 * fv_random_unit(&random);
        const int low = (int)fv_random_below(&random, 8), high = low + 2;
        const uint8_t *wanted = t.descriptor + 32 * (size_t)fv_random_below(&random, FEATURES);
        uint32_t best = 256;
        for (uint32_t f = 0; f < frame.keyframe->features; f++) {
            const double dx = frame.points[f].x * t.map.pixel_px - x,
                         dy = frame.points[f].y * t.map.pixel_px - y;
            if (dx * dx + dy * dy > radius * radius || frame.points[f].level < low ||
                frame.points[f].level > high)
                continue;
            uint32_t distance = 0;
            for (int i = 0; i < 32; i++)
                distance += (uint32_t)__builtin_popcount(
                    (unsigned)(wanted[i] ^ frame.descriptors[32 * (size_t)f + (size_t)i]));
            if (distance < best) best = distance;
        }
        const struct fv_found found =
            fv_map_search(&t.map, &t.kernels, slot, x, y, radius, low, high, wanted, false);
        assert_int_equal(found.distance, best);
        assert_int_equal(found.feature == FV_MAP_NONE, best == 256);
    }
    /* Features that do not lie cell by cell are found out. */
    assert_true(fv_map_index_frame(&t.map, slot));
    const struct fv_pixel first = frame.points[0];
    frame.points[0] = frame.points[FEATURES - 1];
    frame.points[FEATURES - 1] = first;
    assert_false(fv_map_index_frame(&t.map, slot));
    free(memory);
}

/* Six columns and four rows, numbered as one reads; what lies on the last edge is still in the last
 * of them. */
static void test_parts_of_the_image(void **state)
{
    (void)state;
    struct fv_map map = {.limits = {.width = 640, .height = 480}, .pixel_px = 0.0625};
    static const struct {
        uint16_t x_px, y_px;
        int part;
    } rows[] = {{0, 0, 0},      {106, 119, 0}, {107, 119, 1},  {106, 120, 6}, {639, 0, 5},
                {639, 239, 11}, {0, 240, 12},  {320, 250, 15}, {0, 479, 18},  {640, 480, 23}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const struct fv_pixel p = {.x = (uint16_t)(16 * rows[i].x_px),
                                   .y = (uint16_t)(16 * rows[i].y_px)};
        assert_int_equal(fv_map_part(&map, &p), rows[i].part);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_features_stay_what_they_are),
        cmocka_unit_test(test_beyond_the_lens),
        cmocka_unit_test(test_search_is_a_scan),
        cmocka_unit_test(test_parts_of_the_image),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
