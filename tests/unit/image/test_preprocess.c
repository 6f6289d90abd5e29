/* The preprocessing chain by its public functions: memory, order, in place, refusals, white
 * balance, and equal results on every kernel set. tests/oracle holds the operations against OpenCV.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/elementary.h"
#include "fovea/preprocess.h"
#include "kernels/cpu.h"

enum { WIDTH = 131, HEIGHT = 77, STRIDE = 140, PAINT = 0xa5, SIDE = 64 };

static uint8_t pixels[HEIGHT * STRIDE], out[HEIGHT * STRIDE], other[HEIGHT * STRIDE];
static _Alignas(64) uint8_t memory[1 << 18];

static struct fovea_image image(const uint8_t *data)
{
    return (struct fovea_image){data, WIDTH, HEIGHT, STRIDE, FOVEA_PIXEL_GREY8, HEIGHT * STRIDE};
}

static int fill(void **state)
{
    (void)state;
    struct fv_random random;
    fv_random_seed(&random, 5);
    for (int i = 0; i < HEIGHT * STRIDE; i++)
        pixels[i] = (uint8_t)(40 + i % STRIDE / 2 + (int)fv_random_below(&random, 90));
    memset(out, PAINT, sizeof out);
    memset(other, PAINT, sizeof other);
    return 0;
}

static struct fovea_preprocess_config list(uint32_t count, const enum fovea_operation *operations)
{
    struct fovea_preprocess_config config;
    fovea_preprocess_config_default(&config);
    config.operations.count = count;
    config.gamma = 0.6;
    for (uint32_t i = 0; i < count; i++)
        config.operations.items[i] = operations[i];
    return config;
}
#define LIST(...)                                                                                  \
    list(sizeof((enum fovea_operation[]){__VA_ARGS__}) / sizeof(enum fovea_operation),             \
         (const enum fovea_operation[]){__VA_ARGS__})

static struct fovea_preprocess *make(const struct fovea_preprocess_config *config)
{
    struct fovea_error error;
    struct fovea_preprocess *chain = NULL;
    const size_t bytes = fovea_preprocess_size(config, WIDTH, HEIGHT, &error);
    assert_in_range(bytes, 1, sizeof memory - 1);
    memset(memory, 0xee, sizeof memory);
    assert_int_equal(fovea_preprocess_init(&chain, config, WIDTH, HEIGHT, memory, bytes, &error),
                     FOVEA_OK);
    memory[bytes] = 0x77; /* the first byte beyond must stay */
    return chain;
}

static void run(const struct fovea_preprocess_config *config, const uint8_t *from, uint8_t *to)
{
    const struct fovea_image in = image(from);
    assert_int_equal(fovea_preprocess_run(make(config), &in, to, STRIDE), FOVEA_OK);
    assert_int_equal(memory[fovea_preprocess_size(config, WIDTH, HEIGHT, NULL)], 0x77);
}

static void same_pixels(const uint8_t *a, const uint8_t *b)
{
    for (int y = 0; y < HEIGHT; y++)
        assert_memory_equal(a + y * STRIDE, b + y * STRIDE, WIDTH);
}

static void an_empty_chain_copies_and_touches_nothing_beside_the_rows(void **state)
{
    (void)state;
    const struct fovea_preprocess_config none = list(0, NULL);
    run(&none, pixels, out);
    same_pixels(pixels, out);
    for (int y = 0; y < HEIGHT; y++)
        for (int x = WIDTH; x < STRIDE; x++)
            assert_int_equal(out[y * STRIDE + x], PAINT);
}

static void each_operation_gives_the_same_in_place_and_on_every_kernel_set(void **state)
{
    (void)state;
    for (int i = 0; i < FOVEA_OPERATION_WHITE_BALANCE; i++)
        for (int method = 0; method < 3; method++) {
            struct fovea_preprocess_config config = LIST((enum fovea_operation)i);
            config.denoise_method = (enum fovea_denoise_method)method;
            config.denoise_size = 7;
            config.normalize_method = (enum fovea_normalize_method)(method % 2);
            setenv("FOVEA_CPU", "c", 1);
            run(&config, pixels, out);
            assert_memory_not_equal(pixels, out, WIDTH);
            unsetenv("FOVEA_CPU");
            run(&config, pixels, other);
            same_pixels(out, other);
            memcpy(other, pixels, sizeof other);
            run(&config, other, other);
            same_pixels(out, other);
            for (int y = 0; y < HEIGHT; y++)
                assert_int_equal(out[y * STRIDE + WIDTH], PAINT);
        }
}

/* A square picture of all levels from `low` to `high`, normalized on one kernel set. False: of
 * another architecture. */
static bool normalize_levels(const struct fovea_preprocess_config *config, const char *set, int low,
                             int high, uint8_t *to)
{
    static uint8_t levels[SIDE * SIDE];
    struct fovea_error error;
    struct fovea_preprocess *chain = NULL;
    for (int i = 0; i < SIDE * SIDE; i++)
        levels[i] = (uint8_t)(low + i % (high - low + 1));
    const struct fovea_image in = {levels, SIDE, SIDE, SIDE, FOVEA_PIXEL_GREY8, sizeof levels};
    setenv("FOVEA_CPU", set, 1);
    const bool made = fovea_preprocess_init(&chain, config, SIDE, SIDE, memory, sizeof memory,
                                            &error) == FOVEA_OK;
    unsetenv("FOVEA_CPU");
    if (made) assert_int_equal(fovea_preprocess_run(chain, &in, to, SIDE), FOVEA_OK);
    return made;
}

/* Where the kernel of a line would round a level the other way, its offset is moved or the table is
 * looked up: for about one of 30 lines drawn. */
static void normalizing_rounds_the_same_on_every_kernel_set(void **state)
{
    (void)state;
    enum { LINES = 1000 };
    static const char *const sets[] = {"avx2", "avx512", "neon"};
    struct fovea_preprocess_config config = LIST(FOVEA_OPERATION_NORMALIZE);
    struct fv_random random;
    fv_random_seed(&random, 17);
    for (int n = 0; n < LINES; n++) {
        const uint32_t low = fv_random_below(&random, 255);
        const uint32_t high = low + 1 + fv_random_below(&random, 255 - low);
        config.normalize_low = fv_random_below(&random, 255);
        config.normalize_high =
            config.normalize_low + 1 + fv_random_below(&random, 255 - config.normalize_low);
        config.normalize_mean = fv_random_below(&random, 256);
        config.normalize_deviation = 1 + fv_random_below(&random, 128);
        config.normalize_method = n % 4 == 3 ? FOVEA_NORMALIZE_DEVIATION : FOVEA_NORMALIZE_RANGE;
        assert_true(normalize_levels(&config, "c", (int)low, (int)high, out));
        for (size_t k = 0; k < sizeof sets / sizeof sets[0]; k++)
            if (normalize_levels(&config, sets[k], (int)low, (int)high, other))
                assert_memory_equal(out, other, SIDE * SIDE);
    }
}

static void operations_run_in_their_order(void **state)
{
    (void)state;
    const struct fovea_preprocess_config both =
        LIST(FOVEA_OPERATION_SHARPEN, FOVEA_OPERATION_GAMMA, FOVEA_OPERATION_DENOISE);
    const struct fovea_preprocess_config first = LIST(FOVEA_OPERATION_SHARPEN),
                                         second = LIST(FOVEA_OPERATION_GAMMA),
                                         third = LIST(FOVEA_OPERATION_DENOISE);
    run(&both, pixels, out);
    run(&first, pixels, other);
    run(&second, other, other);
    run(&third, other, other);
    same_pixels(out, other);
    run(&third, pixels, other);
    run(&second, other, other);
    run(&first, other, other);
    assert_memory_not_equal(out, other, WIDTH);
}

static void wrong_parameters_are_refused_by_name(void **state)
{
    (void)state;
    struct fovea_error error;
    struct fovea_preprocess_config config = LIST(FOVEA_OPERATION_DENOISE);
    config.denoise_size = 4;
    assert_int_equal(fovea_preprocess_size(&config, WIDTH, HEIGHT, &error), 0);
    assert_string_equal(error.text, "denoise_size: found 4, expected 3, 5 or 7");
    config = LIST(FOVEA_OPERATION_GAMMA);
    config.gamma = 0;
    assert_int_equal(fovea_preprocess_size(&config, WIDTH, HEIGHT, &error), 0);
    assert_string_equal(error.text, "gamma: found 0, expected 0.1 to 10");
    config = LIST(FOVEA_OPERATION_NORMALIZE);
    config.normalize_low = 255;
    assert_int_equal(fovea_preprocess_size(&config, WIDTH, HEIGHT, &error), 0);
    assert_non_null(strstr(error.text, "normalize_low"));
    config = LIST((enum fovea_operation)FOVEA_OPERATION_COUNT);
    assert_int_equal(fovea_preprocess_size(&config, WIDTH, HEIGHT, &error), 0);
    assert_non_null(strstr(error.text, "operations"));
    config = LIST(FOVEA_OPERATION_WHITE_BALANCE);
    assert_int_equal(fovea_preprocess_size(&config, WIDTH, HEIGHT, &error), 0);
    assert_non_null(strstr(error.text, "fovea_white_balance"));
    config = LIST(FOVEA_OPERATION_GAMMA);
    assert_int_equal(fovea_preprocess_size(&config, 63, HEIGHT, &error), 0);
    assert_string_equal(error.text, "width: found 63, expected 64 to 4096");
}

static void too_little_memory_and_other_images_are_refused(void **state)
{
    (void)state;
    struct fovea_error error;
    struct fovea_preprocess *chain;
    const struct fovea_preprocess_config config = LIST(FOVEA_OPERATION_DENOISE);
    const size_t bytes = fovea_preprocess_size(&config, WIDTH, HEIGHT, &error);
    assert_int_equal(
        fovea_preprocess_init(&chain, &config, WIDTH, HEIGHT, memory, bytes - 1, &error),
        FOVEA_ERROR_MEMORY);
    assert_int_equal(
        fovea_preprocess_init(&chain, &config, WIDTH, HEIGHT, memory + 1, bytes, &error),
        FOVEA_ERROR_MEMORY);
    chain = make(&config);
    struct fovea_image in = image(pixels);
    in.width--;
    assert_int_equal(fovea_preprocess_run(chain, &in, out, STRIDE), FOVEA_ERROR_ARGUMENT);
    in = image(pixels);
    assert_int_equal(fovea_preprocess_run(chain, &in, out, WIDTH - 1), FOVEA_ERROR_ARGUMENT);
    assert_int_equal(out[0], PAINT);
}

/* Where the picture is flat but for one pixel, the median removes it, the Gaussian spreads its
 * weights, and the bilateral filter keeps it. */
static void denoising_does_what_its_names_say(void **state)
{
    (void)state;
    memset(pixels, 100, sizeof pixels);
    pixels[30 * STRIDE + 40] = 228;
    struct fovea_preprocess_config config = LIST(FOVEA_OPERATION_DENOISE);
    run(&config, pixels, out);
    assert_int_equal(out[30 * STRIDE + 40], 132);
    assert_int_equal(out[30 * STRIDE + 41], 116);
    assert_int_equal(out[31 * STRIDE + 41], 108);
    assert_int_equal(out[30 * STRIDE + 42], 100);
    config.denoise_method = FOVEA_DENOISE_MEDIAN;
    run(&config, pixels, out);
    assert_int_equal(out[30 * STRIDE + 40], 100);
    config.denoise_method = FOVEA_DENOISE_BILATERAL;
    run(&config, pixels, out);
    assert_int_equal(out[30 * STRIDE + 40], 228);
    assert_int_equal(out[30 * STRIDE + 41], 100);
}

static void white_balance_makes_the_mean_grey(void **state)
{
    (void)state;
    enum { ACROSS = 64, DOWN = 64 };
    static uint8_t rgb[3 * ACROSS * DOWN], balanced[3 * ACROSS * DOWN];
    for (int i = 0; i < ACROSS * DOWN; i++) {
        rgb[3 * i] = (uint8_t)(80 + i % 41);
        rgb[3 * i + 1] = (uint8_t)(40 + i % 21);
        rgb[3 * i + 2] = (uint8_t)(60 + i % 31);
    }
    const struct fovea_image in = {rgb, ACROSS, DOWN, 3 * ACROSS, FOVEA_PIXEL_RGB24, sizeof rgb};
    assert_int_equal(fovea_white_balance(&in, balanced, 3 * ACROSS), FOVEA_OK);
    double before[3] = {0}, after[3] = {0};
    for (int i = 0; i < 3 * ACROSS * DOWN; i++) {
        before[i % 3] += rgb[i];
        after[i % 3] += balanced[i];
    }
    const double mean = (before[0] + before[1] + before[2]) / 3;
    for (int i = 0; i < 3 * ACROSS * DOWN; i++) {
        const double exact = rgb[i] * mean / before[i % 3];
        assert_true(balanced[i] - exact <= .5 && balanced[i] - exact > -.5 - 1e-9);
    }
    for (int c = 0; c < 3; c++)
        assert_true(after[c] / mean > .99 && after[c] / mean < 1.01);
    const struct fovea_image grey = image(pixels);
    assert_int_equal(fovea_white_balance(&grey, out, STRIDE), FOVEA_ERROR_ARGUMENT);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(an_empty_chain_copies_and_touches_nothing_beside_the_rows, fill),
        cmocka_unit_test_setup(each_operation_gives_the_same_in_place_and_on_every_kernel_set,
                               fill),
        cmocka_unit_test(normalizing_rounds_the_same_on_every_kernel_set),
        cmocka_unit_test_setup(operations_run_in_their_order, fill),
        cmocka_unit_test_setup(wrong_parameters_are_refused_by_name, fill),
        cmocka_unit_test_setup(too_little_memory_and_other_images_are_refused, fill),
        cmocka_unit_test_setup(denoising_does_what_its_names_say, fill),
        cmocka_unit_test(white_balance_makes_the_mean_grey),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
