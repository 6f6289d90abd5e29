/* A network by itself (fovea/network.h): outputs in the types of the file, the same in units as at
 * once; inputs that were not set, blocks too small and tensors that are not there are refused. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fovea/network.h"
#include "nn/model.h"
#include "nn/tensor.h"

enum { WIDTH = 64, HEIGHT = 48, FILE_BYTES_MAX = 1 << 16 };

static _Alignas(64) uint8_t file[FILE_BYTES_MAX];
static size_t file_bytes;
static void *memory;
static size_t memory_bytes;

static int set_up(void **state)
{
    (void)state;
    struct fovea_error error;
    FILE *stream = fopen("tests/golden/detector.fvm", "rb");
    if (stream == NULL) return -1;
    file_bytes = fread(file, 1, sizeof file - 64, stream);
    fclose(stream);
    if (fovea_network_size(file, file_bytes, &memory_bytes, &error) != FOVEA_OK) return -1;
    memory = aligned_alloc(64, (memory_bytes + 63) / 64 * 64);
    return memory == NULL;
}

static int tear_down(void **state)
{
    (void)state;
    free(memory);
    return 0;
}

static struct fovea_network *made(void)
{
    struct fovea_network *network = NULL;
    struct fovea_error error;
    if (fovea_network_init(memory, memory_bytes, file, file_bytes, &network, &error) != FOVEA_OK)
        fail_msg("%s", error.text);
    return network;
}

static void fill(uint8_t *input, size_t bytes)
{
    for (size_t i = 0; i < bytes; i++)
        input[i] = (uint8_t)(i * 37 + i / 191);
}

static void tensors_are_described_as_in_the_file(void **state)
{
    (void)state;
    struct fovea_network *network = made();
    struct fovea_tensor t;
    assert_int_equal(fovea_network_input_count(network), 1);
    assert_int_equal(fovea_network_output_count(network), 1);
    assert_int_equal(fovea_network_input(network, 0, &t), FOVEA_OK);
    assert_int_equal(t.type, FOVEA_TENSOR_INT8);
    assert_int_equal(t.axis_count, 4);
    assert_int_equal(t.shape[1], HEIGHT);
    assert_int_equal(t.shape[2], WIDTH);
    assert_int_equal(t.bytes, HEIGHT * WIDTH * t.shape[3]);
    assert_int_equal(fovea_network_output(network, 0, &t), FOVEA_OK);
    assert_int_equal(t.type, FOVEA_TENSOR_INT8);
    assert_int_equal(t.zero_point, -128);
    assert_true(t.scale == 1.0f / 256);
    assert_string_equal(t.name, "t10");
    assert_null(t.data);
    assert_int_equal(fovea_network_output(network, 1, &t), FOVEA_ERROR_ARGUMENT);
    assert_int_equal(fovea_network_input(network, 1, &t), FOVEA_ERROR_ARGUMENT);
}

/* Files that hold no names of outputs. */
static void outputs_without_names_are_numbered(void **state)
{
    (void)state;
    struct fv_model_header *header = (struct fv_model_header *)(void *)file, kept = *header;
    header->output_names = header->output_name_bytes = 0;
    header->checksum = fv_model_checksum(file + 16, file_bytes - 16);
    struct fovea_tensor t;
    assert_int_equal(fovea_network_output(made(), 0, &t), FOVEA_OK);
    assert_string_equal(t.name, "output0");
    *header = kept;
}

static void outputs_are_the_same_in_units_and_sum_to_one(void **state)
{
    (void)state;
    static uint8_t input[HEIGHT * WIDTH * 3];
    static int8_t first[4096];
    struct fovea_network *network = made();
    struct fovea_tensor in, out;
    (void)fovea_network_input(network, 0, &in);
    assert_true(in.bytes <= sizeof input);
    fill(input, in.bytes);
    assert_int_equal(fovea_network_set(network, 0, input, in.bytes), FOVEA_OK);
    assert_int_equal(fovea_network_run(network, 0), FOVEA_OK);
    (void)fovea_network_output(network, 0, &out);
    assert_true(out.bytes <= sizeof first);
    memcpy(first, out.data, out.bytes);
    const int32_t classes = out.shape[out.axis_count - 1];
    for (size_t i = 0; i < out.bytes; i += (size_t)classes) { /* a SOFTMAX: 256 steps in all */
        int sum = 0;
        for (int32_t c = 0; c < classes; c++)
            sum += first[i + (size_t)c] - out.zero_point;
        assert_in_range(sum, 253, 259);
    }
    assert_int_equal(fovea_network_set(network, 0, input, in.bytes), FOVEA_OK);
    int calls = 1;
    while (fovea_network_run(network, 1) == FOVEA_AGAIN) {
        assert_int_equal(fovea_network_set(network, 0, input, in.bytes), FOVEA_ERROR_ARGUMENT);
        calls++;
    }
    assert_true(calls > 2);
    (void)fovea_network_output(network, 0, &out);
    assert_memory_equal(out.data, first, out.bytes);
}

static void inputs_that_nobody_set_are_refused(void **state)
{
    (void)state;
    static uint8_t input[HEIGHT * WIDTH * 3];
    struct fovea_network *network = made();
    struct fovea_tensor in;
    (void)fovea_network_input(network, 0, &in);
    assert_int_equal(fovea_network_run(network, 0), FOVEA_ERROR_ARGUMENT);
    assert_int_equal(fovea_network_set(network, 0, input, in.bytes - 1), FOVEA_ERROR_ARGUMENT);
    assert_int_equal(fovea_network_set(network, 1, input, in.bytes), FOVEA_ERROR_ARGUMENT);
    assert_int_equal(fovea_network_set(network, 0, input, in.bytes), FOVEA_OK);
    assert_int_equal(fovea_network_run(network, 0), FOVEA_OK);
    assert_int_equal(fovea_network_run(network, 0), FOVEA_ERROR_ARGUMENT); /* it was used up */
}

static void a_picture_is_an_input(void **state)
{
    (void)state;
    static uint8_t pixels[HEIGHT * WIDTH];
    struct fovea_network *network = made();
    const struct fovea_image image = {pixels,       WIDTH, HEIGHT, WIDTH, FOVEA_PIXEL_GREY8,
                                      sizeof pixels};
    fill(pixels, sizeof pixels);
    assert_int_equal(fovea_network_set_image(network, &image), FOVEA_OK);
    assert_int_equal(fovea_network_run(network, 0), FOVEA_OK);
    struct fovea_image compressed = image;
    compressed.format = FOVEA_PIXEL_MJPEG;
    assert_int_equal(fovea_network_set_image(network, &compressed), FOVEA_ERROR_UNSUPPORTED);
}

static void a_block_that_is_too_small_is_refused(void **state)
{
    (void)state;
    struct fovea_network *network = NULL;
    struct fovea_error error;
    assert_int_equal(fovea_network_init(NULL, memory_bytes, file, file_bytes, &network, &error),
                     FOVEA_ERROR_MEMORY);
    assert_int_equal(
        fovea_network_init(memory, memory_bytes - 1, file, file_bytes, &network, &error),
        FOVEA_ERROR_MEMORY);
    assert_int_equal(
        fovea_network_init(memory, memory_bytes, file, file_bytes - 1, &network, &error),
        FOVEA_ERROR_INPUT);
    assert_null(network);
}

/* Elements with gaps between pixels, as a slice of channels has them. */
static void slices_are_read_and_written_without_their_gaps(void **state)
{
    (void)state;
    static const struct fv_model_tensor t = {.type = FV_TYPE_U8,
                                             .flags = FV_TENSOR_SIGNED,
                                             .rank = 2,
                                             .dims = {3, 2},
                                             .offset = 1,
                                             .pixel_stride = 4};
    const struct fv_model model = {.tensors = &t};
    uint8_t arena[16], found[6], expected_arena[16];
    const uint8_t packed[6] = {0, 1, 2, 3, 4, 0x85};
    memset(arena, 9, sizeof arena);
    memset(expected_arena, 9, sizeof expected_arena);
    fv_tensor_write(&model, 0, arena, packed);
    for (int i = 0; i < 6; i++)
        expected_arena[1 + i / 2 * 4 + i % 2] = packed[i] ^ 0x80;
    assert_memory_equal(arena, expected_arena, sizeof arena);
    fv_tensor_read(&model, 0, arena, found);
    assert_memory_equal(found, packed, sizeof found);
    fv_tensor_read_some(&model, 0, arena, 3, 2, found);
    assert_memory_equal(found, packed + 3, 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(tensors_are_described_as_in_the_file),
        cmocka_unit_test(outputs_without_names_are_numbered),
        cmocka_unit_test(outputs_are_the_same_in_units_and_sum_to_one),
        cmocka_unit_test(inputs_that_nobody_set_are_refused),
        cmocka_unit_test(a_picture_is_an_input),
        cmocka_unit_test(a_block_that_is_too_small_is_refused),
        cmocka_unit_test(slices_are_read_and_written_without_their_gaps)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
