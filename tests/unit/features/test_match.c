/* Matching by the public functions: against plain loops, ratio test and cross check, homography,
 * essential and fundamental matrix of known views, equal results on every kernel set, refusals. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/elementary.h"
#include "fovea/match.h"

enum { COUNT = 203, BYTES_MAX = 128 };

static struct fovea_local_feature features[2][COUNT];
static _Alignas(64) uint8_t descriptors[2][COUNT * BYTES_MAX];
static uint8_t *memory;

static struct fovea_extracted set_of(int k, uint32_t count, uint32_t bytes)
{
    return (struct fovea_extracted){count, features[k], descriptors[k], bytes};
}

/* Descriptors of b are those of a in reverse order, changed by noise; the first tenth are
 * strangers, and some are the same as the one before. */
static void fill(uint32_t bytes, uint32_t noise)
{
    struct fv_random random;
    fv_random_seed(&random, 4);
    for (uint32_t i = 0; i < COUNT * bytes; i++)
        descriptors[0][i] = (uint8_t)fv_random_below(&random, 256);
    for (uint32_t i = 0; i < COUNT; i++)
        for (uint32_t k = 0; k < bytes; k++) {
            const uint8_t value = descriptors[0][(COUNT - 1 - i) * bytes + k];
            const uint32_t other = value + fv_random_below(&random, noise);
            descriptors[1][i * bytes + k] = i < COUNT / 10 ? (uint8_t)fv_random_below(&random, 256)
                                            : other > 255  ? 255
                                                           : (uint8_t)other;
        }
    for (uint32_t i = 49; i < COUNT; i += 50)
        memcpy(descriptors[1] + i * bytes, descriptors[1] + (i - 1) * bytes, bytes);
}

static struct fovea_matched run(const struct fovea_match_config *config,
                                const struct fovea_extracted *a, const struct fovea_extracted *b)
{
    struct fovea_matcher *matcher = NULL;
    struct fovea_matched matched[2];
    const size_t bytes = fovea_match_size(config, NULL);
    assert_true(bytes > 0);
    free(memory);
    memory = aligned_alloc(64, (bytes + 127) / 64 * 64);
    assert_non_null(memory);
    memset(memory, 0xee, bytes + 1);
    assert_int_equal(fovea_match_init(&matcher, config, memory, bytes, NULL), FOVEA_OK);
    for (int i = 0; i < 2; i++)
        assert_int_equal(fovea_match_run(matcher, a, b, &matched[i]), FOVEA_OK);
    assert_int_equal(matched[0].count, matched[1].count);
    assert_memory_equal(matched[0].model, matched[1].model, sizeof matched[0].model);
    assert_int_equal(memory[bytes], 0xee);
    return matched[1];
}

static uint32_t difference(const uint8_t *a, const uint8_t *b, uint32_t bytes, bool binary)
{
    uint32_t sum = 0;
    for (uint32_t i = 0; i < bytes; i++)
        sum += binary ? (uint32_t)__builtin_popcount(a[i] ^ b[i])
                      : (uint32_t)((a[i] - b[i]) * (a[i] - b[i]));
    return sum;
}

/* The nearest and second nearest of descriptor i of set k in the other one. */
static uint32_t plain(int k, uint32_t i, uint32_t bytes, bool binary, uint32_t best[2])
{
    uint32_t index = 0;
    best[0] = best[1] = UINT32_MAX;
    for (uint32_t j = 0; j < COUNT; j++) {
        const uint32_t d =
            difference(descriptors[k] + i * bytes, descriptors[1 - k] + j * bytes, bytes, binary);
        if (d < best[0]) {
            best[1] = best[0];
            best[0] = d;
            index = j;
        } else if (d < best[1]) {
            best[1] = d;
        }
    }
    return index;
}

static void check_against_plain_loops(const struct fovea_match_config *config)
{
    const uint32_t bytes = config->descriptor_bytes;
    const bool binary = config->descriptor == FOVEA_DESCRIPTOR_BINARY;
    const struct fovea_extracted a = set_of(0, COUNT, bytes), b = set_of(1, COUNT, bytes);
    const struct fovea_matched matched = run(config, &a, &b);
    uint32_t expected = 0;
    for (uint32_t i = 0; i < COUNT; i++) {
        uint32_t best[2], back[2];
        const uint32_t index = plain(0, i, bytes, binary, best);
        const double nearest = binary ? best[0] : __builtin_sqrt(best[0]);
        const double second = binary ? best[1] : __builtin_sqrt(best[1]);
        if (config->ratio < 1 && !(nearest < (double)config->ratio * second)) continue;
        if (config->cross_check && plain(1, index, bytes, binary, back) != i) continue;
        assert_true(expected < matched.count);
        const struct fovea_match *match = &matched.matches[expected++];
        assert_int_equal(match->a, i);
        assert_int_equal(match->b, index);
        assert_true((double)match->distance > nearest - 1e-3 &&
                    (double)match->distance < nearest + 1e-3);
        assert_true((double)match->second > second - 1e-3 && (double)match->second < second + 1e-3);
        assert_int_equal(match->inlier, 1);
    }
    assert_int_equal(matched.count, expected);
    assert_true(expected > COUNT / 2);
}

/* On every kernel set, with and without ratio test and cross check. */
static void check_sets(struct fovea_match_config *config)
{
    static const char *const sets[] = {"c", "sse4", "avx2", "avx512", "neon", "dotprod"};
    for (uint32_t k = 0; k < sizeof sets / sizeof sets[0]; k++) {
        struct fovea_error error;
        struct fovea_matcher *matcher;
        setenv("FOVEA_CPU", sets[k], 1);
        if (fovea_match_init(&matcher, config, NULL, 0, &error) == FOVEA_ERROR_ARGUMENT)
            continue; /* a set of another processor */
        for (uint32_t i = 0; i < 2; i++) {
            config->ratio = i == 0 ? .8f : 1;
            config->cross_check = (i + k) % 2;
            check_against_plain_loops(config);
        }
    }
    unsetenv("FOVEA_CPU");
}

static void matches_are_those_of_plain_loops(void **state)
{
    (void)state;
    static const struct {
        enum fovea_descriptor descriptor;
        uint32_t bytes, noise;
    } cases[] = {{FOVEA_DESCRIPTOR_BINARY, 32, 4},
                 {FOVEA_DESCRIPTOR_PATCH, 81, 60},
                 {FOVEA_DESCRIPTOR_FLOAT, 128, 90},
                 {FOVEA_DESCRIPTOR_FLOAT, 64, 90},
                 {FOVEA_DESCRIPTOR_FLOAT, 32, 90}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct fovea_match_config config;
        fovea_match_config_default(&config, cases[i].descriptor);
        config.count_max = COUNT;
        config.descriptor_bytes = cases[i].bytes;
        fill(cases[i].bytes, cases[i].noise);
        check_sets(&config);
    }
}

/* One descriptor is so far from the others that no step of the bounds' values fits 16 bits
 * (features/bounded.h; test_bounded sees the refusal). */
static void matches_are_the_same_without_bounds(void **state)
{
    (void)state;
    struct fovea_match_config config;
    fovea_match_config_default(&config, FOVEA_DESCRIPTOR_FLOAT);
    config.count_max = COUNT;
    config.descriptor_bytes = BYTES_MAX;
    fill(BYTES_MAX, 60);
    for (int k = 0; k < 2; k++)
        for (size_t i = 0; i < sizeof descriptors[k]; i++)
            descriptors[k][i] /= 16;
    memset(descriptors[0], 255, BYTES_MAX);
    memset(descriptors[1] + (COUNT - 1) * BYTES_MAX, 255, BYTES_MAX);
    check_sets(&config);
}

/* Features of a at random places; b sees them where `see` says, every fifth one anywhere. */
static void place(void (*see)(double x, double y, double z, double *u, double *v))
{
    struct fv_random random;
    fv_random_seed(&random, 9);
    fill(32, 3);
    for (uint32_t i = 0; i < COUNT; i++) {
        const double x = 640 * fv_random_unit(&random), y = 480 * fv_random_unit(&random);
        const double z = 4 + 4 * fv_random_unit(&random);
        double u = 640 * fv_random_unit(&random), v = 480 * fv_random_unit(&random);
        if (i % 5 != 0) see(x, y, z, &u, &v);
        features[0][i] = (struct fovea_local_feature){.x_px = (float)x, .y_px = (float)y};
        features[1][COUNT - 1 - i] =
            (struct fovea_local_feature){.x_px = (float)u, .y_px = (float)v};
    }
}

static const double plane[9] = {1.1, .2, -30, -.1, .9, 25, 2e-4, -1e-4, 1};

static void see_plane(double x, double y, double z, double *u, double *v)
{
    (void)z;
    const double w = plane[6] * x + plane[7] * y + plane[8];
    *u = (plane[0] * x + plane[1] * y + plane[2]) / w;
    *v = (plane[3] * x + plane[4] * y + plane[5]) / w;
}

static void a_homography_is_found_among_wrong_matches(void **state)
{
    (void)state;
    struct fovea_match_config config;
    fovea_match_config_default(&config, FOVEA_DESCRIPTOR_BINARY);
    config.geometry = FOVEA_MATCH_HOMOGRAPHY;
    place(see_plane);
    const struct fovea_extracted a = set_of(0, COUNT, 32), b = set_of(1, COUNT, 32);
    const struct fovea_matched matched = run(&config, &a, &b);
    uint32_t inliers = 0, right = 0;
    for (uint32_t i = 0; i < matched.count; i++) {
        const struct fovea_match *match = &matched.matches[i];
        inliers += match->inlier;
        right += match->b == COUNT - 1 - match->a && match->a % 5 != 0;
    }
    assert_int_equal(inliers, matched.inlier_count);
    assert_true(right > COUNT / 2 && inliers >= right && inliers <= right + 2);
    for (int i = 0; i < 9; i++)
        assert_true(__builtin_fabs(matched.model[i] - plane[i]) <
                    1e-3 * __builtin_fabs(plane[i]) + 1e-6);
}

/* One metre to the right, camera of 500 pixels: E = [t]x. */
static void see_moved(double x, double y, double z, double *u, double *v)
{
    *u = x - 500 / z;
    *v = y;
}

static void an_essential_matrix_is_found_among_wrong_matches(void **state)
{
    (void)state;
    struct fovea_match_config config;
    fovea_match_config_default(&config, FOVEA_DESCRIPTOR_BINARY);
    config.geometry = FOVEA_MATCH_ESSENTIAL;
    config.centre_px[0] = 320;
    config.centre_px[1] = 240;
    config.threshold_px = 1;
    place(see_moved);
    const struct fovea_extracted a = set_of(0, COUNT, 32), b = set_of(1, COUNT, 32);
    const struct fovea_matched matched = run(&config, &a, &b);
    assert_true(matched.inlier_count > COUNT / 2 && matched.inlier_count < COUNT * 9 / 10);
    /* [-1 0 0]x */
    const double expected[9] = {0, 0, 0, 0, 0, 1, 0, -1, 0};
    for (int i = 0; i < 9; i++)
        assert_true(__builtin_fabs(matched.model[i] - expected[i]) < 1e-3);
}

static void a_fundamental_matrix_is_found_among_wrong_matches(void **state)
{
    (void)state;
    struct fovea_match_config config;
    fovea_match_config_default(&config, FOVEA_DESCRIPTOR_BINARY);
    config.geometry = FOVEA_MATCH_FUNDAMENTAL;
    config.threshold_px = 1;
    place(see_moved);
    const struct fovea_extracted a = set_of(0, COUNT, 32), b = set_of(1, COUNT, 32);
    const struct fovea_matched matched = run(&config, &a, &b);
    assert_true(matched.inlier_count > COUNT / 2 && matched.inlier_count < COUNT * 9 / 10);
    /* The same row: [1 0 0]x, of norm 1 and either sign. */
    const double row = matched.model[5], expected[9] = {0, 0, 0, 0, 0, row, 0, -row, 0};
    assert_true(__builtin_fabs(__builtin_fabs(row) - __builtin_sqrt(.5)) < 1e-4);
    for (int i = 0; i < 9; i++)
        assert_true(__builtin_fabs(matched.model[i] - expected[i]) < 1e-4);
}

static void see_the_same(double x, double y, double z, double *u, double *v)
{
    (void)z;
    *u = x;
    *v = y;
}

/* Pictures without motion determine no essential or fundamental matrix, but the identity; those of
 * a plane an essential matrix alone. */
static void no_motion_is_a_homography(void **state)
{
    static const enum fovea_match_geometry asked[2] = {FOVEA_MATCH_ESSENTIAL,
                                                       FOVEA_MATCH_FUNDAMENTAL};
    (void)state;
    for (int k = 0; k < 2; k++) {
        struct fovea_match_config config;
        fovea_match_config_default(&config, FOVEA_DESCRIPTOR_BINARY);
        config.geometry = asked[k];
        config.centre_px[0] = 320;
        config.centre_px[1] = 240;
        place(see_the_same);
        const struct fovea_extracted a = set_of(0, COUNT, 32), b = set_of(1, COUNT, 32);
        struct fovea_matched matched = run(&config, &a, &b);
        assert_int_equal(matched.geometry, FOVEA_MATCH_HOMOGRAPHY);
        assert_true(matched.inlier_count > COUNT / 2);
        for (int i = 0; i < 9; i++)
            assert_true(__builtin_fabs(matched.model[i] - (i % 4 == 0)) < 1e-6);
        for (uint32_t i = 0; i < matched.count; i++) /* every fifth is wrong */
            if (matched.matches[i].b == COUNT - 1 - matched.matches[i].a)
                assert_int_equal(matched.matches[i].inlier, matched.matches[i].a % 5 != 0);
        place(see_moved);
        matched = run(&config, &a, &b);
        assert_int_equal(matched.geometry, asked[k]);
    }
}

static void few_and_none_match_without_a_model(void **state)
{
    (void)state;
    struct fovea_match_config config;
    fovea_match_config_default(&config, FOVEA_DESCRIPTOR_FLOAT);
    config.geometry = FOVEA_MATCH_HOMOGRAPHY;
    fill(128, 90);
    for (uint32_t count = 0; count < 3; count++) {
        const struct fovea_extracted a = set_of(0, COUNT, 128), b = set_of(1, count, 128);
        const struct fovea_matched matched = run(&config, &a, &b);
        assert_in_range(matched.count, 0, count);
        assert_int_equal(matched.inlier_count, 0);
        assert_true(matched.model[0] == 0 && matched.model[8] == 0);
        for (uint32_t i = 0; i < matched.count; i++)
            assert_int_equal(matched.matches[i].inlier, 0);
    }
}

static void wrong_parameters_are_named(void **state)
{
    (void)state;
    struct fovea_match_config config;
    struct fovea_error error;
    struct fovea_matcher *matcher;
    struct fovea_matched matched = {.count = 77};
    fovea_match_config_default(&config, FOVEA_DESCRIPTOR_FLOAT);
    config.ratio = 1.5f;
    assert_int_equal(fovea_match_size(&config, &error), 0);
    assert_string_equal(error.text, "ratio: found 1.5, expected 0.001 to 1");
    fovea_match_config_default(&config, FOVEA_DESCRIPTOR_BINARY);
    config.descriptor_bytes = 31;
    assert_int_equal(fovea_match_size(&config, &error), 0);
    fovea_match_config_default(&config, FOVEA_DESCRIPTOR_BINARY);
    assert_int_equal(fovea_match_init(&matcher, &config, memory, 3, &error), FOVEA_ERROR_MEMORY);
    const struct fovea_extracted a = set_of(0, COUNT, 32), wrong = set_of(1, COUNT, 128);
    (void)run(&config, &a, &a);
    assert_int_equal(
        fovea_match_init(&matcher, &config, memory, fovea_match_size(&config, NULL), NULL),
        FOVEA_OK);
    assert_int_equal(fovea_match_run(matcher, &a, &wrong, &matched), FOVEA_ERROR_ARGUMENT);
    assert_int_equal(matched.count, 77);
    assert_string_equal(fovea_match_geometry_name(FOVEA_MATCH_GEOMETRY_COUNT), "unknown");
}

static int tear_down(void **state)
{
    (void)state;
    free(memory);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(matches_are_those_of_plain_loops),
        cmocka_unit_test(matches_are_the_same_without_bounds),
        cmocka_unit_test(a_homography_is_found_among_wrong_matches),
        cmocka_unit_test(an_essential_matrix_is_found_among_wrong_matches),
        cmocka_unit_test(a_fundamental_matrix_is_found_among_wrong_matches),
        cmocka_unit_test(no_motion_is_a_homography),
        cmocka_unit_test(few_and_none_match_without_a_model),
        cmocka_unit_test(wrong_parameters_are_named),
    };
    return cmocka_run_group_tests(tests, NULL, tear_down);
}
