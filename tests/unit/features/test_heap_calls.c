/* No call of the heap after set-up: features by every method, matching, operations on images, edges
 * and line segments, each alone on memory of the caller. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/elementary.h"
#include "fovea/edges.h"
#include "fovea/extract.h"
#include "fovea/match.h"
#include "fovea/preprocess.h"
#include "fovea/segments.h"

static volatile int calls; /* compilers hold that malloc() changes no variable */
static volatile bool counting;
#ifndef FOVEA_SANITIZED
#include "common/heap_calls.h"

static void on_heap_call(void)
{
    if (counting) calls = calls + 1;
}
static void on_heap_free(void)
{
    if (counting) calls = calls + 1;
}
#endif

enum { WIDTH = 317, HEIGHT = 241, SQUARES = 150 };

static uint8_t pixels[HEIGHT * WIDTH], out[HEIGHT * WIDTH];
static const struct fovea_image image = {pixels,       WIDTH, HEIGHT, WIDTH, FOVEA_PIXEL_GREY8,
                                         sizeof pixels};

/* Squares of many sizes, one over the other, and noise. */
static int draw(void **state)
{
    (void)state;
    struct fv_random random;
    fv_random_seed(&random, 4);
    memset(pixels, 90, sizeof pixels);
    for (int i = 0; i < SQUARES; i++) {
        const uint32_t side = 6 + fv_random_below(&random, 40);
        const uint32_t x0 = fv_random_below(&random, WIDTH - side);
        const uint32_t y0 = fv_random_below(&random, HEIGHT - side);
        const int grey = (int)fv_random_below(&random, 240);
        for (uint32_t y = y0; y < y0 + side; y++)
            memset(pixels + (size_t)y * WIDTH + x0, grey, side);
    }
    for (size_t i = 0; i < sizeof pixels; i++)
        pixels[i] = (uint8_t)(pixels[i] + fv_random_below(&random, 12));
    return 0;
}

static void *take(size_t bytes)
{
    assert_int_not_equal(bytes, 0);
    void *memory = aligned_alloc(64, (bytes + 63) / 64 * 64);
    assert_non_null(memory);
    return memory;
}

static void begin(void)
{
    calls = 0;
    counting = true;
}

static void expect_none(void)
{
    counting = false;
    assert_int_equal(calls, 0);
}

/* What the other tests trust. */
static void calls_are_counted(void **state)
{
    (void)state;
#ifdef FOVEA_SANITIZED
    skip();
#else
    begin();
    void *volatile piece = malloc(1);
    free(piece);
    counting = false;
    assert_int_equal(calls, 2);
#endif
}

static void match_with(const struct fovea_extracted *found, enum fovea_descriptor descriptor,
                       enum fovea_match_geometry geometry)
{
    struct fovea_match_config config;
    struct fovea_matcher *matcher;
    struct fovea_matched matched;
    fovea_match_config_default(&config, descriptor);
    config.descriptor_bytes = found->descriptor_bytes;
    config.geometry = geometry;
    const size_t bytes = fovea_match_size(&config, NULL);
    void *memory = take(bytes);
    assert_int_equal(fovea_match_init(&matcher, &config, memory, bytes, NULL), FOVEA_OK);
    begin();
    const enum fovea_status status = fovea_match_run(matcher, found, found, &matched);
    expect_none();
    assert_int_equal(status, FOVEA_OK);
    assert_in_range(matched.count, 1, found->count);
    free(memory);
}

static void extract_with(const struct fovea_extract_config *config)
{
    struct fovea_extract *extract;
    struct fovea_extracted found;
    struct fovea_error error;
    const size_t bytes = fovea_extract_size(config, WIDTH, HEIGHT, &error);
    if (bytes == 0 && config->method == FOVEA_FEATURES_SURF) return; /* left out of this build */
    void *memory = take(bytes);
    assert_int_equal(fovea_extract_init(&extract, config, WIDTH, HEIGHT, memory, bytes, NULL),
                     FOVEA_OK);
    begin();
    enum fovea_status status = fovea_extract_run(extract, &image, NULL, &found);
    if (status == FOVEA_OK) status = fovea_extract_run(extract, &image, &image, &found);
    expect_none();
    assert_int_equal(status, FOVEA_OK);
    assert_in_range(found.count, 20, config->count_max);
    for (int geometry = 0; geometry < FOVEA_MATCH_GEOMETRY_COUNT; geometry++)
        match_with(&found, config->descriptor, (enum fovea_match_geometry)geometry);
    free(memory);
}

static void features_and_matching_call_no_heap(void **state)
{
    (void)state;
    for (int method = 0; method < FOVEA_FEATURE_METHOD_COUNT; method++) {
        struct fovea_extract_config config;
        fovea_extract_config_default(&config, (enum fovea_feature_method)method);
        for (uint32_t upright = 0; upright < 2; upright++) {
            config.upright = upright;
            extract_with(&config);
        }
        if (config.descriptor == FOVEA_DESCRIPTOR_FLOAT) continue;
        config.descriptor = FOVEA_DESCRIPTOR_PATCH;
        extract_with(&config);
    }
}

static void preprocess_with(const struct fovea_preprocess_config *config)
{
    struct fovea_preprocess *chain;
    const size_t bytes = fovea_preprocess_size(config, WIDTH, HEIGHT, NULL);
    void *memory = take(bytes);
    assert_int_equal(fovea_preprocess_init(&chain, config, WIDTH, HEIGHT, memory, bytes, NULL),
                     FOVEA_OK);
    begin();
    const enum fovea_status status = fovea_preprocess_run(chain, &image, out, WIDTH);
    expect_none();
    assert_int_equal(status, FOVEA_OK);
    assert_memory_not_equal(out, pixels, sizeof pixels);
    free(memory);
}

static void operations_call_no_heap(void **state)
{
    (void)state;
    struct fovea_preprocess_config config;
    fovea_preprocess_config_default(&config);
    config.gamma = .5;
    config.operations.count = 1;
    for (int method = 0; method <= FOVEA_DENOISE_BILATERAL; method++) {
        config.denoise_method = (enum fovea_denoise_method)method;
        config.operations.items[0] = FOVEA_OPERATION_DENOISE;
        preprocess_with(&config);
    }
    config.normalize_method = FOVEA_NORMALIZE_DEVIATION;
    config.operations.items[0] = FOVEA_OPERATION_NORMALIZE;
    preprocess_with(&config);
    config.normalize_method = FOVEA_NORMALIZE_RANGE;
    config.normalize_low = 20;
    for (uint32_t size = 3; size <= 7; size += 2) { /* all, one after the other */
        config.denoise_method = FOVEA_DENOISE_GAUSSIAN;
        config.denoise_size = config.sharpen_size = size;
        config.operations.count = FOVEA_OPERATION_WHITE_BALANCE;
        for (int operation = 0; operation < FOVEA_OPERATION_WHITE_BALANCE; operation++)
            config.operations.items[operation] = (enum fovea_operation)operation;
        preprocess_with(&config);
    }
}

static void edges_with(const struct fovea_edges_config *config)
{
    static int16_t dx[HEIGHT * WIDTH], dy[HEIGHT * WIDTH];
    struct fovea_edges *edges;
    const int32_t stride = (WIDTH + 7) / 8;
    const size_t bytes = fovea_edges_size(config, WIDTH, HEIGHT, NULL);
    void *memory = take(bytes);
    assert_int_equal(fovea_edges_init(&edges, config, WIDTH, HEIGHT, memory, bytes, NULL),
                     FOVEA_OK);
    memset(out, 0, sizeof out);
    begin();
    enum fovea_status status = fovea_edges_run(edges, &image, out, stride);
    if (status == FOVEA_OK)
        status = fovea_edges_gradient(edges, &image, dx,
                                      config->method == FOVEA_EDGES_LAPLACIAN ? NULL : dy, WIDTH);
    expect_none();
    assert_int_equal(status, FOVEA_OK);
    size_t marked = 0;
    for (size_t i = 0; i < (size_t)HEIGHT * (size_t)stride; i++)
        marked += out[i] != 0;
    assert_int_not_equal(marked, 0);
    free(memory);
}

static void edges_call_no_heap(void **state)
{
    (void)state;
    for (int method = 0; method < FOVEA_EDGE_METHOD_COUNT; method++)
        for (int norm = 0; norm < 2; norm++) {
            struct fovea_edges_config config;
            fovea_edges_config_default(&config);
            config.method = (enum fovea_edge_method)method;
            config.norm = norm == 0 ? FOVEA_GRADIENT_L1 : FOVEA_GRADIENT_L2;
            for (uint32_t size = 1; size <= 3; size += 2) {
                config.laplacian_size = size;
                edges_with(&config);
            }
        }
}

static void segments_call_no_heap(void **state)
{
    (void)state;
    struct fovea_segments_config config;
    struct fovea_segments *segments;
    struct fovea_segments_found found;
    fovea_segments_config_default(&config);
    const size_t bytes = fovea_segments_size(&config, WIDTH, HEIGHT, NULL);
    void *memory = take(bytes);
    assert_int_equal(fovea_segments_init(&segments, &config, WIDTH, HEIGHT, memory, bytes, NULL),
                     FOVEA_OK);
    begin();
    const enum fovea_status status = fovea_segments_run(segments, &image, &found);
    expect_none();
    assert_int_equal(status, FOVEA_OK);
    assert_in_range(found.count, 20, config.count_max);
    free(memory);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(calls_are_counted),
        cmocka_unit_test(features_and_matching_call_no_heap),
        cmocka_unit_test(operations_call_no_heap),
        cmocka_unit_test(edges_call_no_heap),
        cmocka_unit_test(segments_call_no_heap),
    };
    return cmocka_run_group_tests_name("heap_calls", tests, draw, NULL);
}
