/* Local features by the public functions: SIFT and SURF on drawn blobs whose place, size and
 * direction are known, the same on a turned image, masks, counts, equal results everywhere,
 * refusals. tests/oracle/test_features_opencv holds repeatability and matching beside OpenCV's. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/elementary.h"
#include "base/hash.h"
#include "fovea/extract.h"
#include "features/patch.h"
#include "features/ranked.h"

enum { SIDE = 161, STRIDE = 171, PAINT = 0xee };

static uint8_t pixels[SIDE * STRIDE], hidden[SIDE * STRIDE];
static uint8_t *memory;

static struct fovea_image image_of(const uint8_t *from)
{
    return (struct fovea_image){from, SIDE, SIDE, STRIDE, FOVEA_PIXEL_GREY8, SIDE * STRIDE};
}

static struct fovea_extract_config config_of(enum fovea_feature_method method, uint32_t count)
{
    struct fovea_extract_config config;
    fovea_extract_config_default(&config, method);
    config.count_max = count;
    return config;
}

/* What is found in `pixels`; a second run finds the same, and nothing beyond the memory changes. */
static struct fovea_extracted run(const struct fovea_extract_config *config,
                                  const struct fovea_image *mask)
{
    struct fovea_extract *extract = NULL;
    struct fovea_extracted found[2];
    const struct fovea_image image = image_of(pixels);
    const size_t bytes = fovea_extract_size(config, SIDE, SIDE, NULL);
    assert_true(bytes > 0);
    free(memory);
    memory = aligned_alloc(64, (bytes + 127) / 64 * 64);
    assert_non_null(memory);
    memset(memory, PAINT, bytes + 1);
    assert_int_equal(fovea_extract_init(&extract, config, SIDE, SIDE, memory, bytes, NULL),
                     FOVEA_OK);
    for (int i = 0; i < 2; i++)
        assert_int_equal(fovea_extract_run(extract, &image, mask, &found[i]), FOVEA_OK);
    assert_int_equal(found[0].count, found[1].count);
    assert_in_range(found[0].count, 0, config->count_max);
    assert_int_equal(memory[bytes], PAINT);
    return found[0];
}

struct blob {
    double x, y, sigma, height;
};

static void draw_blobs(const struct blob *blobs, int count)
{
    for (int y = 0; y < SIDE; y++)
        for (int x = 0; x < SIDE; x++) {
            double value = 60;
            for (int i = 0; i < count; i++) {
                const double dx = x - blobs[i].x, dy = y - blobs[i].y;
                value += blobs[i].height *
                         fv_exp(-(dx * dx + dy * dy) / (2 * blobs[i].sigma * blobs[i].sigma));
            }
            pixels[y * STRIDE + x] = (uint8_t)(value + .5);
        }
}

/* Squares of any size and grey level over each other, the same on every machine. */
static void draw_squares(uint32_t seed)
{
    struct fv_random random;
    fv_random_seed(&random, seed);
    memset(pixels, 90, sizeof pixels);
    for (int n = 0; n < 250; n++) {
        const uint32_t size = 5 + fv_random_below(&random, 20);
        const uint32_t x = fv_random_below(&random, SIDE - size),
                       y = fv_random_below(&random, SIDE - size);
        const uint32_t grey = fv_random_below(&random, 256);
        for (uint32_t row = y; row < y + size; row++)
            memset(pixels + row * STRIDE + x, (int)grey, size);
    }
}

/* The image turned by a quarter, clockwise as it is seen. */
static void turn_image(void)
{
    static uint8_t copy[SIDE * STRIDE];
    memcpy(copy, pixels, sizeof copy);
    for (int y = 0; y < SIDE; y++)
        for (int x = 0; x < SIDE; x++)
            pixels[x * STRIDE + SIDE - 1 - y] = copy[y * STRIDE + x];
}

/* Whether this build has a method: it may leave SURF out. */
static bool is_built(enum fovea_feature_method method)
{
    const struct fovea_extract_config config = config_of(method, 10);
    struct fovea_error error;
    if (fovea_extract_size(&config, SIDE, SIDE, &error) > 0) return true;
    assert_int_equal(method, FOVEA_FEATURES_SURF);
    assert_string_equal(error.text,
                        "method: found surf, which this build leaves out (make SURF=yes)");
    return false;
}

static double distance_of(const struct fovea_local_feature *feature, double x, double y)
{
    const double dx = (double)feature->x_px - x, dy = (double)feature->y_px - y;
    return __builtin_sqrt(dx * dx + dy * dy);
}

static void sift_finds_blobs_where_they_are_and_as_large_as_they_are(void **state)
{
    (void)state;
    static const struct blob blobs[] = {
        {40.3, 50.7, 3, 100}, {110.6, 45.2, 5, 120}, {80, 118.4, 8, 150}};
    draw_blobs(blobs, 3);
    for (uint32_t doubled = 0; doubled < 2; doubled++) {
        struct fovea_extract_config config = config_of(FOVEA_FEATURES_SIFT, 50);
        config.doubled = doubled;
        const struct fovea_extracted found = run(&config, NULL);
        for (int b = 0; b < 3; b++) {
            uint32_t near = 0;
            for (uint32_t i = 0; i < found.count; i++) {
                const struct fovea_local_feature *f = &found.features[i];
                if (distance_of(f, blobs[b].x, blobs[b].y) > .1) continue;
                /* The difference of Gaussians sigma and 2^(1/3) sigma is largest for the blob of
                 * their geometric mean. */
                const double sigma = (double)f->size_px / 2 * 1.1225;
                assert_true(sigma > .93 * blobs[b].sigma && sigma < 1.07 * blobs[b].sigma);
                near++;
            }
            assert_true(near > 0);
        }
    }
}

/* The determinant of the Hessian is largest at the sigma of the blob as it is smoothed before
 * (FV_SURF_SMOOTH, 2 pixels of the image or of its double); boxes answer most at .72 of that, by
 * the sigma that the paper gives them. Ends of octaves overlap: one blob may be found twice. */
static void surf_finds_blobs_where_they_are_and_as_large_as_they_are(void **state)
{
    (void)state;
    static const struct blob blobs[] = {
        {40.3, 50.7, 3, 100}, {110.6, 45.2, 5, -50}, {80, 110.4, 8, 150}};
    if (!is_built(FOVEA_FEATURES_SURF)) return;
    draw_blobs(blobs, 3);
    for (uint32_t doubled = 0; doubled < 2; doubled++) {
        struct fovea_extract_config config = config_of(FOVEA_FEATURES_SURF, 50);
        config.doubled = doubled;
        const struct fovea_extracted found = run(&config, NULL);
        const double smooth = doubled != 0 ? 1 : 2;
        for (int b = 0; b < 3; b++) {
            const double blob = __builtin_sqrt(blobs[b].sigma * blobs[b].sigma + smooth * smooth);
            uint32_t near = 0;
            for (uint32_t i = 0; i < found.count; i++) {
                const struct fovea_local_feature *f = &found.features[i];
                const double sigma = (double)f->size_px / 2;
                near += distance_of(f, blobs[b].x, blobs[b].y) < .3 && f->response > 50 &&
                        sigma > .65 * blob && sigma < .8 * blob;
            }
            assert_in_range(near, 1, 2);
        }
    }
}

static uint32_t descriptor_distance(const uint8_t *a, const uint8_t *b, uint32_t bytes)
{
    uint32_t sum = 0;
    for (uint32_t i = 0; i < bytes; i++)
        sum += (uint32_t)((a[i] - b[i]) * (a[i] - b[i]));
    return sum;
}

/* At least 95 of 100 features are found on the turned image, where they should be, turned, with
 * descriptors within `nearest`. */
static void turns_with_the_image(enum fovea_feature_method method, uint32_t bytes, uint32_t nearest)
{
    enum { COUNT = 150, BYTES_MAX = 128 };
    static struct fovea_local_feature before[COUNT];
    static uint8_t described[COUNT * BYTES_MAX];
    struct fovea_extract_config config = config_of(method, COUNT);
    config.doubled = 0; /* then every octave turns to the same pixels */
    draw_squares(5);
    struct fovea_extracted found = run(&config, NULL);
    const uint32_t count = found.count;
    assert_in_range(count, 80, COUNT);
    assert_int_equal(found.descriptor_bytes, bytes);
    memcpy(before, found.features, count * sizeof *before);
    memcpy(described, found.descriptors, (size_t)count * bytes);
    turn_image();
    found = run(&config, NULL);
    uint32_t same = 0;
    for (uint32_t i = 0; i < count; i++)
        for (uint32_t k = 0; k < found.count; k++) {
            const struct fovea_local_feature *a = &before[i], *b = &found.features[k];
            const double turned = (double)a->angle_rad + FV_PI / 2 - (double)b->angle_rad;
            if (distance_of(b, SIDE - 1 - (double)a->y_px, (double)a->x_px) < .15 &&
                fv_cos(turned) > .998 &&
                descriptor_distance(described + (size_t)i * bytes,
                                    found.descriptors + (size_t)k * bytes,
                                    bytes) < nearest * nearest) {
                same++;
                break;
            }
        }
    assert_true(same * 100 >= count * 95);
}

static void sift_and_surf_turn_with_the_image(void **state)
{
    (void)state;
    turns_with_the_image(FOVEA_FEATURES_SIFT, 128, 100);
    if (is_built(FOVEA_FEATURES_SURF)) turns_with_the_image(FOVEA_FEATURES_SURF, 64, 40);
}

/* Both store a unit vector: times 512, or times 256 plus 128. */
static void descriptors_do_not_change_with_brightness_and_contrast(void **state)
{
    (void)state;
    static const struct blob blobs[] = {{50, 60, 4, 100}, {58, 63, 3, -40}, {110, 90, 6, 80}};
    static const struct {
        enum fovea_feature_method method;
        uint32_t bytes, length, within;
        int zero;
    } cases[] = {{FOVEA_FEATURES_SIFT, 128, 512, 40, 0}, {FOVEA_FEATURES_SURF, 64, 256, 12, 128}};
    for (int m = 0; m < 2; m++) {
        uint8_t before[128];
        uint32_t length = 0;
        if (!is_built(cases[m].method)) continue;
        const struct fovea_extract_config config = config_of(cases[m].method, 1);
        draw_blobs(blobs, 3);
        memcpy(before, run(&config, NULL).descriptors, cases[m].bytes);
        for (uint32_t i = 0; i < cases[m].bytes; i++)
            length += (uint32_t)((before[i] - cases[m].zero) * (before[i] - cases[m].zero));
        assert_in_range(length, cases[m].length * cases[m].length * 88 / 100,
                        cases[m].length * cases[m].length * 106 / 100);
        for (int i = 0; i < SIDE * STRIDE; i++)
            pixels[i] = (uint8_t)(pixels[i] * 3 / 4 + 40);
        assert_in_range(descriptor_distance(before, run(&config, NULL).descriptors, cases[m].bytes),
                        0, cases[m].within * cases[m].within);
    }
}

static void the_strongest_come_first_and_none_where_the_mask_is_black(void **state)
{
    (void)state;
    draw_squares(7);
    memset(hidden, 255, sizeof hidden);
    const int middle = SIDE / 2;
    for (int y = 0; y < SIDE; y++)
        memset(hidden + y * STRIDE, 0, (size_t)middle);
    const struct fovea_image mask = image_of(hidden);
    for (int m = 0; m < FOVEA_FEATURE_METHOD_COUNT; m++) {
        if (!is_built((enum fovea_feature_method)m)) continue;
        const struct fovea_extract_config all = config_of((enum fovea_feature_method)m, 400);
        struct fovea_extracted found = run(&all, NULL);
        uint32_t left = 0;
        for (uint32_t i = 0; i < found.count; i++)
            left += found.features[i].x_px < (float)(middle - 1);
        assert_true(left > 5);
        found = run(&all, &mask);
        assert_true(found.count > 5);
        for (uint32_t i = 0; i < found.count; i++)
            assert_true(found.features[i].x_px > (float)(middle - 4)); /* coarse pixels */
    }
    struct fovea_extract_config sift = config_of(FOVEA_FEATURES_SIFT, 200);
    struct fovea_extracted found = run(&sift, NULL);
    for (uint32_t i = 1; i < found.count; i++)
        assert_true(found.features[i].response <= found.features[i - 1].response);
    /* Of the orientations of one place one has its whole strength, the others .64 to all of it. */
    uint32_t further = 0;
    for (uint32_t i = 0; i < found.count; i++)
        for (uint32_t k = 0; k < i; k++) {
            const struct fovea_local_feature *one = &found.features[k], *next = &found.features[i];
            if (one->x_px != next->x_px || one->y_px != next->y_px || one->size_px != next->size_px)
                continue;
            assert_true(next->response < one->response && next->response > .63f * one->response);
            further++;
        }
    assert_true(further > 0);
    const float third = found.features[2].response;
    sift.count_max = 3;
    found = run(&sift, NULL);
    assert_int_equal(found.count, 3);
    assert_true(found.features[2].response == third);
}

static uint64_t hash_of(const struct fovea_extracted *found)
{
    uint64_t hash = fv_hash(1, found->features, found->count * sizeof *found->features);
    return fv_hash(hash, found->descriptors, (size_t)found->count * found->descriptor_bytes);
}

/* The numbers are those of gcc on x86-64; clang, sanitizers and aarch64 must give them too. */
static void every_method_gives_the_same_on_every_kernel_set_and_machine(void **state)
{
    (void)state;
    static const char *const sets[] = {"c",      "sse4", "avx2",    "avxvnni",
                                       "avx512", "neon", "dotprod", "i8mm"};
    static const struct {
        enum fovea_feature_method method;
        enum fovea_descriptor descriptor;
        uint64_t hash;
    } cases[] = {
        {FOVEA_FEATURES_ORB, FOVEA_DESCRIPTOR_BINARY, 0xebdb0b834ac9476d},
        {FOVEA_FEATURES_FAST, FOVEA_DESCRIPTOR_PATCH, 0x27fa902ae65f9243},
        {FOVEA_FEATURES_SIFT, FOVEA_DESCRIPTOR_FLOAT, 0x1102fe5f9dd746d0},
        {FOVEA_FEATURES_HARRIS, FOVEA_DESCRIPTOR_BINARY, 0x9d5dc0c3b12cfcb2},
        {FOVEA_FEATURES_SHI_TOMASI, FOVEA_DESCRIPTOR_PATCH, 0x7f7d35e94a000881},
        {FOVEA_FEATURES_SURF, FOVEA_DESCRIPTOR_FLOAT, 0xf3da437b57b08a0a},
    };
    draw_squares(11);
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct fovea_extract_config config = config_of(cases[i].method, 300);
        config.descriptor = cases[i].descriptor;
        if (!is_built(config.method)) continue;
        for (size_t k = 0; k < sizeof sets / sizeof sets[0]; k++) {
            struct fovea_error error;
            struct fovea_extract *extract;
            setenv("FOVEA_CPU", sets[k], 1);
            if (fovea_extract_init(&extract, &config, SIDE, SIDE, NULL, 0, &error) ==
                FOVEA_ERROR_ARGUMENT)
                continue; /* a set of another architecture */
            const struct fovea_extracted found = run(&config, NULL);
            assert_true(found.count > 20);
            const uint64_t hash = hash_of(&found);
            if (hash != cases[i].hash)
                fail_msg("%s, kernels %s: hash 0x%016llx", fovea_feature_method_name(config.method),
                         sets[k], (unsigned long long)hash);
        }
    }
    unsetenv("FOVEA_CPU");
}

static void a_patch_is_free_of_brightness_and_contrast(void **state)
{
    (void)state;
    uint8_t before[FV_PATCH_BYTES], after[FV_PATCH_BYTES];
    const struct fv_plane plane = fv_plane_of(pixels, SIDE, SIDE, STRIDE);
    draw_squares(3);
    fv_patch_describe(&plane, 80, 80, before);
    double mean = 0, variance = 0;
    for (int i = 0; i < FV_PATCH_BYTES; i++)
        mean += before[i] / (double)FV_PATCH_BYTES;
    for (int i = 0; i < FV_PATCH_BYTES; i++)
        variance += (before[i] - mean) * (before[i] - mean) / FV_PATCH_BYTES;
    assert_true(mean > 127 && mean < 129 && variance > 31 * 31 && variance < 33 * 33);
    for (int i = 0; i < SIDE * STRIDE; i++)
        pixels[i] = (uint8_t)(pixels[i] / 2 + 100);
    fv_patch_describe(&plane, 80, 80, after);
    for (int i = 0; i < FV_PATCH_BYTES; i++)
        assert_in_range(after[i] - before[i] + 2, 0, 4);
    memset(pixels, 17, sizeof pixels);
    fv_patch_describe(&plane, 80, 80, after);
    for (int i = 0; i < FV_PATCH_BYTES; i++)
        assert_int_equal(after[i], 128);
}

static void empty_images_have_no_features(void **state)
{
    (void)state;
    for (int grey = 0; grey < 256; grey += 255) {
        memset(pixels, grey, sizeof pixels);
        for (int m = 0; m < FOVEA_FEATURE_METHOD_COUNT; m++) {
            if (!is_built((enum fovea_feature_method)m)) continue;
            const struct fovea_extract_config config = config_of((enum fovea_feature_method)m, 100);
            assert_int_equal(run(&config, NULL).count, 0);
        }
    }
}

/* Corners of a drawn square of odd size, brighter by 100 than the rest. */
static void harris_and_shi_tomasi_find_the_corners_of_a_square(void **state)
{
    (void)state;
    enum { FIRST = 50, LAST = 110 };
    memset(pixels, 60, sizeof pixels);
    for (int y = FIRST; y <= LAST; y++)
        memset(pixels + y * STRIDE + FIRST, 160, LAST - FIRST + 1);
    for (int m = FOVEA_FEATURES_HARRIS; m <= FOVEA_FEATURES_SHI_TOMASI; m++) {
        struct fovea_extract_config config = config_of((enum fovea_feature_method)m, 100);
        config.quality = .5f;
        const struct fovea_extracted found = run(&config, NULL);
        int seen = 0;
        assert_in_range(found.count, 4, 16);
        for (uint32_t i = 0; i < found.count; i++) {
            const struct fovea_local_feature *f = &found.features[i];
            assert_true(f->response > 0 && f->angle_rad == 0);
            for (int corner = 0; corner < 4; corner++)
                if (distance_of(f, corner & 1 ? LAST + .5 : FIRST - .5,
                                corner & 2 ? LAST + .5 : FIRST - .5) < 1.5)
                    seen |= 1 << corner;
        }
        assert_int_equal(seen, 15);
    }
}

static void corners_keep_their_distance(void **state)
{
    (void)state;
    draw_squares(13);
    struct fovea_extract_config config = config_of(FOVEA_FEATURES_SHI_TOMASI, 60);
    const float strongest = run(&config, NULL).features[0].response;
    config.distance_px = 12.5f;
    const struct fovea_extracted found = run(&config, NULL);
    assert_in_range(found.count, 15, 60);
    assert_true(found.features[0].response == strongest);
    for (uint32_t i = 0; i < found.count; i++)
        for (uint32_t k = 0; k < i; k++)
            assert_true(distance_of(&found.features[i], (double)found.features[k].x_px,
                                    (double)found.features[k].y_px) > 12.5 - 1.5);
}

/* Derivatives and weights one by one, as in the definition. */
static double measure_of(int32_t x, int32_t y, double *trace)
{
    static const double weight[7] = {1, 6, 15, 20, 15, 6, 1};
    double xx = 0, yy = 0, xy = 0;
    for (int32_t v = 0; v < 7; v++)
        for (int32_t u = 0; u < 7; u++) {
            const uint8_t *p = pixels + (y + v - 3) * STRIDE + x + u - 3;
            const double dx = p[1 - STRIDE] + 2 * p[1] + p[1 + STRIDE] - p[-1 - STRIDE] -
                              2 * p[-1] - p[-1 + STRIDE];
            const double dy = p[STRIDE - 1] + 2 * p[STRIDE] + p[STRIDE + 1] - p[-STRIDE - 1] -
                              2 * p[-STRIDE] - p[-STRIDE + 1];
            xx += weight[u] * weight[v] / 64 * dx * dx;
            yy += weight[u] * weight[v] / 64 * dy * dy;
            xy += weight[u] * weight[v] / 64 * dx * dy;
        }
    *trace = xx + yy;
    return 25 * (xx * yy - xy * xy) - (xx + yy) * (xx + yy);
}

static void the_measure_of_corners_is_that_of_harris(void **state)
{
    (void)state;
    const struct fv_plane plane = fv_plane_of(pixels, SIDE, SIDE, STRIDE);
    draw_squares(17);
    int corners = 0;
    for (int32_t y = 4; y < SIDE - 4; y += 3)
        for (int32_t x = 4; x < SIDE - 4; x++) {
            double trace;
            const double expected = measure_of(x, y, &trace);
            const double found = (double)fv_ranked_measure(&plane, x, y);
            const double within = 60 * trace + 60; /* sums are cut to whole numbers */
            assert_true(found > expected - within);
            assert_true(found < (expected > 1 ? expected : 1) + within);
            corners += expected > 1e12;
        }
    assert_true(corners > 1000);
    /* The largest derivatives there are. */
    for (int y = 0; y < SIDE; y++)
        for (int x = 0; x < SIDE; x++)
            pixels[y * STRIDE + x] = (uint8_t)((x / 2 + y / 2) % 2 * 255);
    double trace;
    assert_true((double)fv_ranked_measure(&plane, 80, 80) > measure_of(80, 80, &trace) * .999);
}

static void orb_gives_of_each_level_the_best(void **state)
{
    (void)state;
    draw_squares(19);
    struct fovea_extract_config config = config_of(FOVEA_FEATURES_ORB, 40);
    struct fovea_extracted found = run(&config, NULL);
    uint32_t on_level[FOVEA_PYRAMID_LEVELS_MAX] = {0};
    for (uint32_t i = 0; i < found.count; i++) {
        const struct fovea_local_feature *f = &found.features[i];
        on_level[f->level]++;
        if (i == 0) continue;
        assert_true(f->level <= f[-1].level);
        assert_true(f->level < f[-1].level || f->response <= f[-1].response);
    }
    assert_in_range(on_level[0], 8, 10); /* 40 / 6 / (1 - (5/6)^8) = 8.7 */
    assert_int_equal(on_level[1], 7);
    const float best = found.features[found.count - on_level[0]].response;
    config.levels = 1;
    found = run(&config, NULL);
    assert_int_equal(found.count, 40);
    assert_true(found.features[0].response == best);
}

/* Squares of little contrast: none of the threshold, and a few are found all the same. */
static void levels_bound_the_octaves_of_sift_and_surf(void **state)
{
    (void)state;
    static const enum fovea_feature_method with[] = {FOVEA_FEATURES_SIFT, FOVEA_FEATURES_SURF};
    draw_squares(5);
    for (int m = 0; m < 2; m++) {
        if (!is_built(with[m])) continue;
        for (uint32_t levels = 1; levels <= 3; levels++) {
            struct fovea_extract_config config = config_of(with[m], 500);
            uint32_t highest = 0;
            config.levels = levels;
            const struct fovea_extracted found = run(&config, NULL);
            for (uint32_t i = 0; i < found.count; i++)
                highest = found.features[i].level > highest ? found.features[i].level : highest;
            assert_int_equal(highest, levels - 1);
        }
    }
}

static void fast_finds_some_corners_where_all_are_weak(void **state)
{
    (void)state;
    draw_squares(23);
    for (int i = 0; i < SIDE * STRIDE; i++)
        pixels[i] = (uint8_t)(100 + pixels[i] / 13); /* 100 to 119 */
    struct fovea_extract_config config = config_of(FOVEA_FEATURES_FAST, 320);
    struct fovea_extracted found = run(&config, NULL);
    assert_int_equal(found.count, 10);
    assert_true(found.features[0].response >= 7 && found.features[0].response < 20);
    config.threshold = 7;
    const float strongest = found.features[0].response;
    found = run(&config, NULL);
    assert_in_range(found.count, 11, 320);
    assert_true(found.features[0].response == strongest);
    config = config_of(FOVEA_FEATURES_ORB, 320);
    assert_int_equal(run(&config, NULL).count, 0);
}

static void wrong_parameters_are_named(void **state)
{
    (void)state;
    static _Alignas(64) uint8_t few[256];
    struct fovea_error error;
    struct fovea_extract *extract;
    struct fovea_extract_config config = config_of(FOVEA_FEATURES_SIFT, 100);
    assert_int_equal(fovea_extract_init(&extract, &config, SIDE, SIDE, few, sizeof few, &error),
                     FOVEA_ERROR_MEMORY);
    assert_non_null(strstr(error.text, "found 256 bytes"));
    config.descriptor = FOVEA_DESCRIPTOR_BINARY;
    assert_int_equal(fovea_extract_size(&config, SIDE, SIDE, &error), 0);
    assert_string_equal(error.text, "descriptor: found binary, expected float for sift");
    config = config_of(FOVEA_FEATURES_ORB, 0);
    assert_int_equal(fovea_extract_size(&config, SIDE, SIDE, &error), 0);
    assert_string_equal(error.text, "count_max: found 0, expected 1 to 20000");
    config = config_of(FOVEA_FEATURES_SIFT, 100);
    config.contrast = __builtin_nanf("");
    assert_int_equal(fovea_extract_size(&config, SIDE, SIDE, &error), 0);
    assert_int_equal(fovea_extract_size(&config, 63, SIDE, &error), 0);
    assert_string_equal(fovea_feature_method_name(FOVEA_FEATURE_METHOD_COUNT), "unknown");
    assert_string_equal(fovea_descriptor_name(FOVEA_DESCRIPTOR_COUNT), "unknown");

    config = config_of(FOVEA_FEATURES_SIFT, 100);
    run(&config, NULL);
    struct fovea_image wrong = image_of(pixels);
    struct fovea_extracted found = {.count = 77};
    assert_int_equal(fovea_extract_init(&extract, &config, SIDE, SIDE, memory,
                                        fovea_extract_size(&config, SIDE, SIDE, NULL), NULL),
                     FOVEA_OK);
    wrong.width--;
    assert_int_equal(fovea_extract_run(extract, &wrong, NULL, &found), FOVEA_ERROR_ARGUMENT);
    assert_int_equal(found.count, 77);
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
        cmocka_unit_test(sift_finds_blobs_where_they_are_and_as_large_as_they_are),
        cmocka_unit_test(surf_finds_blobs_where_they_are_and_as_large_as_they_are),
        cmocka_unit_test(sift_and_surf_turn_with_the_image),
        cmocka_unit_test(descriptors_do_not_change_with_brightness_and_contrast),
        cmocka_unit_test(the_strongest_come_first_and_none_where_the_mask_is_black),
        cmocka_unit_test(every_method_gives_the_same_on_every_kernel_set_and_machine),
        cmocka_unit_test(a_patch_is_free_of_brightness_and_contrast),
        cmocka_unit_test(empty_images_have_no_features),
        cmocka_unit_test(harris_and_shi_tomasi_find_the_corners_of_a_square),
        cmocka_unit_test(corners_keep_their_distance),
        cmocka_unit_test(the_measure_of_corners_is_that_of_harris),
        cmocka_unit_test(orb_gives_of_each_level_the_best),
        cmocka_unit_test(levels_bound_the_octaves_of_sift_and_surf),
        cmocka_unit_test(fast_finds_some_corners_where_all_are_weak),
        cmocka_unit_test(wrong_parameters_are_named),
    };
    return cmocka_run_group_tests(tests, NULL, tear_down);
}
