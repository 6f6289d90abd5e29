/* Edges by the public functions: Canny on drawn shapes, hysteresis against a plain flood, layout of
 * the bitmap, equal results on every kernel set, refusals. tests/oracle holds them against OpenCV.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/elementary.h"
#include "fovea/edges.h"
#include "image/hysteresis.h"

enum { WIDTH = 131, HEIGHT = 77, STRIDE = 140, BIT_BYTES = 17, BIT_STRIDE = 20, PAINT = 0xa5 };

static uint8_t pixels[HEIGHT * STRIDE], bits[HEIGHT * BIT_STRIDE], other[HEIGHT * BIT_STRIDE];
static _Alignas(64) uint8_t memory[1 << 18];

static struct fovea_image image(void)
{
    return (struct fovea_image){pixels, WIDTH, HEIGHT, STRIDE, FOVEA_PIXEL_GREY8, HEIGHT * STRIDE};
}

static struct fovea_edges_config canny(double low, double high)
{
    struct fovea_edges_config config;
    fovea_edges_config_default(&config);
    config.low = low;
    config.high = high;
    return config;
}

static struct fovea_edges *make(const struct fovea_edges_config *config)
{
    struct fovea_edges *edges = NULL;
    const size_t bytes = fovea_edges_size(config, WIDTH, HEIGHT, NULL);
    assert_in_range(bytes, 1, sizeof memory - 1);
    memset(memory, 0xee, sizeof memory);
    assert_int_equal(fovea_edges_init(&edges, config, WIDTH, HEIGHT, memory, bytes, NULL),
                     FOVEA_OK);
    return edges;
}

static void run(const struct fovea_edges_config *config, uint8_t *to)
{
    const struct fovea_image in = image();
    struct fovea_edges *edges = make(config);
    memset(to, PAINT, HEIGHT * BIT_STRIDE);
    for (int i = 0; i < 2; i++) /* the second run finds nothing of the first */
        assert_int_equal(fovea_edges_run(edges, &in, to, BIT_STRIDE), FOVEA_OK);
    assert_int_equal(memory[fovea_edges_size(config, WIDTH, HEIGHT, NULL)], 0xee);
}

static int bit(const uint8_t *from, int x, int y)
{
    return from[y * BIT_STRIDE + x / 8] >> (7 - x % 8) & 1;
}

static void a_step_is_one_line_of_edges(void **state)
{
    (void)state;
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < STRIDE; x++)
            pixels[y * STRIDE + x] = x < 70 ? 40 : 200;
    const struct fovea_edges_config config = canny(50, 150);
    run(&config, bits);
    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++)
            assert_int_equal(bit(bits, x, y), x == 69);
        assert_int_equal(bits[y * BIT_STRIDE + BIT_BYTES - 1] & 0x1f, 0);
        for (int i = BIT_BYTES; i < BIT_STRIDE; i++)
            assert_int_equal(bits[y * BIT_STRIDE + i], PAINT);
    }
}

/* A step that fades from top to bottom: strong above, weak below, and nothing at the end. Alone,
 * the weak part is no edge. */
static void weak_edges_need_a_strong_one(void **state)
{
    (void)state;
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < STRIDE; x++)
            pixels[y * STRIDE + x] = (uint8_t)(x < 70 ? 100 : 100 + (HEIGHT - y));
    struct fovea_edges_config config = canny(100, 250);
    run(&config, bits);
    assert_int_equal(bit(bits, 70, 5), 1);
    assert_int_equal(bit(bits, 70, 45), 1); /* gradient 4 x 32: between the thresholds */
    assert_int_equal(bit(bits, 70, 60), 0); /* 4 x 17: below both */
    config = canny(100, 400);
    run(&config, bits);
    for (int y = 0; y < HEIGHT; y++)
        assert_int_equal(bit(bits, 70, y), 0);
}

static void fill_random(uint64_t seed)
{
    struct fv_random random;
    fv_random_seed(&random, seed);
    for (int i = 0; i < HEIGHT * STRIDE; i++)
        pixels[i] = (uint8_t)(i % STRIDE + (int)fv_random_below(&random, 100));
}

static void every_method_is_equal_on_every_kernel_set(void **state)
{
    (void)state;
    fill_random(3);
    for (int method = 0; method < FOVEA_EDGE_METHOD_COUNT; method++)
        for (int norm = 0; norm < 2; norm++) {
            struct fovea_edges_config config = canny(100, 250);
            config.method = (enum fovea_edge_method)method;
            config.norm = (enum fovea_gradient_norm)norm;
            setenv("FOVEA_CPU", "c", 1);
            run(&config, bits);
            unsetenv("FOVEA_CPU");
            run(&config, other);
            assert_memory_equal(bits, other, sizeof bits);
            int count = 0;
            for (int y = 0; y < HEIGHT; y++)
                for (int x = 0; x < WIDTH; x++)
                    count += bit(bits, x, y);
            assert_in_range(count, 50, WIDTH * HEIGHT - 50);
        }
}

/* Edges grown pixel by pixel until nothing changes. */
static void flood(uint8_t *edges, const uint8_t *weak)
{
    for (int changed = 1; changed;) {
        changed = 0;
        for (int y = 0; y < HEIGHT; y++)
            for (int x = 0; x < WIDTH; x++) {
                if (!weak[y * WIDTH + x] || edges[y * WIDTH + x]) continue;
                int near = 0;
                for (int v = y > 0 ? y - 1 : 0; v <= y + 1 && v < HEIGHT; v++)
                    for (int u = x > 0 ? x - 1 : 0; u <= x + 1 && u < WIDTH; u++)
                        near |= edges[v * WIDTH + u];
                edges[y * WIDTH + x] = (uint8_t)near;
                changed |= near;
            }
    }
}

/* Random bitmaps around the density where regions grow long and winding. */
static void hysteresis_finds_what_a_flood_finds(void **state)
{
    (void)state;
    static uint8_t weak[HEIGHT * WIDTH], edges[HEIGHT * WIDTH];
    struct fv_random random;
    fv_random_seed(&random, 9);
    for (int round = 0; round < 40; round++) {
        struct fv_hysteresis hysteresis;
        struct fv_arena arena;
        fv_arena_init(&arena, memory, sizeof memory);
        fv_hysteresis_carve(&hysteresis, WIDTH, HEIGHT, &arena);
        assert_false(arena.exhausted);
        for (int i = 0; i < HEIGHT * WIDTH; i++) {
            const int y = i / WIDTH, x = i % WIDTH;
            weak[i] = fv_random_below(&random, 100) < 30u + (uint32_t)round;
            edges[i] = weak[i] && fv_random_below(&random, 300) == 0;
            const uint64_t mask = UINT64_C(1) << (63 - x % 64);
            if (weak[i]) fv_hysteresis_weak(&hysteresis, y)[x / 64] |= mask;
            if (edges[i]) fv_hysteresis_edges(&hysteresis, y)[x / 64] |= mask;
        }
        struct fv_hysteresis_state progress;
        fv_hysteresis_begin(&hysteresis, &progress);
        while (!fv_hysteresis_advance(&hysteresis, &progress, 1 + round % 5)) {
        }
        flood(edges, weak);
        for (int i = 0; i < HEIGHT * WIDTH; i++)
            assert_int_equal(fv_hysteresis_edges(&hysteresis, i / WIDTH)[i % WIDTH / 64] >>
                                     (63 - i % WIDTH % 64) &
                                 1,
                             edges[i]);
    }
}

static void derivatives_of_a_ramp_are_its_slopes(void **state)
{
    (void)state;
    static int16_t dx[HEIGHT * WIDTH], dy[HEIGHT * WIDTH];
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < STRIDE; x++)
            pixels[y * STRIDE + x] = (uint8_t)(x + y);
    struct fovea_edges_config config = canny(0, 0);
    const struct fovea_image in = image();
    config.method = FOVEA_EDGES_SCHARR;
    assert_int_equal(fovea_edges_gradient(make(&config), &in, dx, dy, WIDTH), FOVEA_OK);
    assert_int_equal(dx[30 * WIDTH + 40], 32);
    assert_int_equal(dy[30 * WIDTH + 40], 32);
    assert_int_equal(dx[30 * WIDTH], 0); /* reflected */
    config.method = FOVEA_EDGES_LAPLACIAN;
    assert_int_equal(fovea_edges_gradient(make(&config), &in, dx, NULL, WIDTH), FOVEA_OK);
    assert_int_equal(dx[30 * WIDTH + 40], 0);
    assert_int_equal(fovea_edges_gradient(make(&config), &in, dx, dy, WIDTH), FOVEA_ERROR_ARGUMENT);
}

static void wrong_parameters_memory_and_images_are_refused(void **state)
{
    (void)state;
    struct fovea_error error;
    struct fovea_edges *edges;
    struct fovea_edges_config config = canny(200, 100);
    assert_int_equal(fovea_edges_size(&config, WIDTH, HEIGHT, &error), 0);
    assert_string_equal(error.text, "low: found 200, expected at most high, which is 100");
    config = canny(-1, 100);
    assert_int_equal(fovea_edges_size(&config, WIDTH, HEIGHT, &error), 0);
    assert_string_equal(error.text, "low: found -1, expected 0 to 32767");
    config = canny(50, 100);
    config.laplacian_size = 2;
    assert_int_equal(fovea_edges_size(&config, WIDTH, HEIGHT, &error), 0);
    assert_string_equal(error.text, "laplacian_size: found 2, expected 1 or 3");
    config = canny(50, 100);
    const size_t bytes = fovea_edges_size(&config, WIDTH, HEIGHT, &error);
    assert_int_equal(fovea_edges_init(&edges, &config, WIDTH, HEIGHT, memory, bytes - 1, &error),
                     FOVEA_ERROR_MEMORY);
    struct fovea_image in = image();
    edges = make(&config);
    memset(bits, PAINT, sizeof bits);
    assert_int_equal(fovea_edges_run(edges, &in, bits, BIT_BYTES - 1), FOVEA_ERROR_ARGUMENT);
    in.height--;
    assert_int_equal(fovea_edges_run(edges, &in, bits, BIT_STRIDE), FOVEA_ERROR_ARGUMENT);
    assert_int_equal(bits[0], PAINT);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_step_is_one_line_of_edges),
        cmocka_unit_test(weak_edges_need_a_strong_one),
        cmocka_unit_test(every_method_is_equal_on_every_kernel_set),
        cmocka_unit_test(hysteresis_finds_what_a_flood_finds),
        cmocka_unit_test(derivatives_of_a_ramp_are_its_slopes),
        cmocka_unit_test(wrong_parameters_memory_and_images_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
