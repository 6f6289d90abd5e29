/* A network without a decoder in the loop: its raw outputs leave as messages that equal what the
 * network gives by itself for the same frame; outputs of any size are cut into whole packets. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "fovea/fovea.h"
#include "fovea/network.h"
#include "message/fields.h"
#include "nn/model.h"
#include "runtime/tensors.h"

#include "fovea_tensors_t.h"

enum { WIDTH = 320, HEIGHT = 240, MODEL_MAX = 1 << 16, PLENTY = 100000 };

static _Alignas(64) uint8_t model[MODEL_MAX];
static size_t model_bytes;
static uint8_t picture[WIDTH * HEIGHT];
static struct fovea_error error;

/* The golden network, without its decoder. */
static int setup(void **state)
{
    (void)state;
    FILE *file = fopen("tests/golden/detector.fvm", "rb");
    if (file == NULL) return -1;
    model_bytes = fread(model, 1, MODEL_MAX - 64, file);
    fclose(file);
    struct fv_model_header *header = (struct fv_model_header *)(void *)model;
    header->decode.kind = FV_DECODER_NONE;
    header->checksum = fv_model_checksum(model + 16, model_bytes - 16);
    for (int k = 0; k < WIDTH * HEIGHT; k++)
        picture[k] = (uint8_t)((k % WIDTH / 20 * 37 + k / WIDTH / 15 * 91) ^ (k * 7 & 15));
    return 0;
}

static struct fovea_image image(void)
{
    return (struct fovea_image){.data = picture,
                                .width = WIDTH,
                                .height = HEIGHT,
                                .stride_bytes = WIDTH,
                                .format = FOVEA_PIXEL_GREY8,
                                .size_bytes = sizeof picture};
}

static void *memory_of(size_t bytes)
{
    void *memory = aligned_alloc(64, (bytes + 63) / 64 * 64);
    assert_non_null(memory);
    return memory;
}

/* What the network gives by itself; to be given to free(). */
static void *alone(struct fovea_tensor *out)
{
    size_t bytes;
    struct fovea_network *network;
    const struct fovea_image seen = image();
    assert_int_equal(fovea_network_size(model, model_bytes, &bytes, &error), FOVEA_OK);
    void *memory = memory_of(bytes);
    assert_int_equal(fovea_network_init(memory, bytes, model, model_bytes, &network, &error),
                     FOVEA_OK);
    assert_int_equal(fovea_network_set_image(network, &seen), FOVEA_OK);
    assert_int_equal(fovea_network_run(network, 0), FOVEA_OK);
    assert_int_equal(fovea_network_output(network, 0, out), FOVEA_OK);
    return memory;
}

/* Checked and decoded. */
static void read_message(const uint8_t *data, uint32_t bytes, fovea_tensors_t *message)
{
    const char *why = NULL;
    size_t at = 0;
    assert_in_range(bytes, 1, FV_MESSAGE_PACKET_BYTES - 8 - FV_MESSAGE_CHANNEL_BYTES);
    if (!fv_message_check("fovea.tensors_t", data, bytes, &why, &at))
        fail_msg("byte %zu: %s", at, why);
    assert_int_equal(fovea_tensors_t_decode(data, 0, (int)bytes, message), bytes);
}

static void assert_as_alone(const struct fovea_message *sent, int64_t stamp_ns)
{
    fovea_tensors_t message;
    struct fovea_tensor expected;
    void *memory = alone(&expected);
    read_message(sent->data, sent->bytes, &message);
    assert_int_equal(message.stamp.time_ns, stamp_ns);
    assert_string_equal(message.model, "detector");
    assert_int_equal(message.count, 1);
    const fovea_tensor_t *t = &message.tensors[0];
    assert_int_equal(t->type, FOVEA_TENSOR_T_TYPE_INT8);
    assert_int_equal(t->dimension_count, expected.axis_count);
    assert_memory_equal(t->shape, expected.shape, (size_t)t->dimension_count * sizeof *t->shape);
    assert_true(t->scale == expected.scale);
    assert_int_equal(t->zero_point, expected.zero_point);
    assert_int_equal(t->whole_bytes, expected.bytes);
    assert_int_equal(t->first_byte, 0);
    assert_int_equal(t->size_bytes, expected.bytes);
    assert_memory_equal(t->data, expected.data, expected.bytes);
    fovea_tensors_t_decode_cleanup(&message);
    free(memory);
}

/* Both networks are raw; each is heard on a channel of its own, whatever the grant. */
static void outputs_leave_as_messages_whatever_the_grant(void **state)
{
    (void)state;
    static const uint32_t grants[] = {PLENTY, 3, 2};
    for (int g = 0; g < 3; g++) {
        struct fovea_config config;
        struct fovea *rt;
        size_t bytes;
        fovea_config_default(&config);
        config.rig.cameras[0].camera = (struct fovea_camera){
            .width = WIDTH, .height = HEIGHT, .fx = 200, .fy = 205, .cx = 161, .cy = 118};
        config.odometry.enabled = false;
        assert_int_equal(fovea_camera_prepare(&config.rig.cameras[0].camera, &error), FOVEA_OK);
        config.detect.model = config.detect2.model = model;
        config.detect.model_bytes = config.detect2.model_bytes = model_bytes;
        if (fovea_size(&config, &bytes, &error) != FOVEA_OK) fail_msg("%s", error.text);
        void *memory = memory_of(bytes);
        assert_int_equal(fovea_init(memory, bytes, &config, &rt, &error), FOVEA_OK);
        int heard[2] = {0, 0}, others = 0;
        for (int i = 0; i < 60; i++) {
            const struct fovea_frame frame = {.image_count = 1,
                                              .images[0] = image(),
                                              .stamp_ns = (i + 1) * 1000,
                                              .sequence = (uint64_t)i};
            struct fovea_inputs inputs = {.frame = &frame, .now_ns = frame.stamp_ns};
            struct fovea_outputs outputs;
            fovea_grants_fixed(&config, &inputs.grants);
            fovea_step(rt, &inputs, &outputs);
            inputs.grants.units[FOVEA_JOB_DETECT] = grants[g];
            fovea_work(rt, &inputs.grants, &outputs);
            assert_true(outputs.units_done[FOVEA_JOB_DETECT] <= grants[g]);
            for (uint32_t m = 0; m < outputs.message_count; m++) {
                const struct fovea_message *sent = &outputs.messages[m];
                const int second = strcmp(sent->channel, "FOVEA_TENSORS2") == 0;
                others += strstr(sent->channel, "DETECTIONS") != NULL ||
                          strstr(sent->channel, "OBJECTS") != NULL;
                if (!second && strcmp(sent->channel, "FOVEA_TENSORS") != 0) continue;
                heard[second]++;
                if (grants[g] == PLENTY) assert_as_alone(sent, frame.stamp_ns);
            }
        }
        struct fovea_detections found;
        fovea_detections_get(rt, &found);
        assert_int_equal(found.inferences, heard[0]);
        assert_int_equal(found.count, 0);
        assert_int_equal(others, 0);
        assert_true(heard[0] >= 1 && heard[1] >= 1);
        if (grants[g] == PLENTY) assert_true(heard[0] == 60 && heard[1] == 60);
        free(memory);
    }
}

/* Two outputs of 90,001 bytes and of 20,000 64-bit integers: pieces follow each other without gap
 * or overlap, and integers beyond 32 bits are cut to them. */
static void large_outputs_are_cut_into_packets(void **state)
{
    (void)state;
    enum { BYTES = 90001, WIDE = 20000, WIDE_AT = 90048, ARENA = WIDE_AT + WIDE * 8 };
    static _Alignas(64) uint8_t arena[ARENA];
    static uint8_t whole[BYTES + WIDE * 4], scratch[FV_MESSAGE_TENSOR_BYTES_MAX],
        buffer[FV_MESSAGE_PACKET_BYTES];
    static const struct fv_model_tensor tensors[2] = {
        {.type = FV_TYPE_U8, .rank = 1, .dims = {BYTES}, .pixel_stride = BYTES, .scale = 0.5f},
        {.type = FV_TYPE_I64,
         .rank = 2,
         .dims = {100, WIDE / 100},
         .offset = WIDE_AT,
         .pixel_stride = WIDE / 100 * 8}};
    static const int32_t outputs[2] = {0, 1};
    static struct fv_model_header header = {.output_count = 2, .name = "large"};
    const struct fv_model large = {.header = &header, .tensors = tensors, .outputs = outputs};
    const fovea_stamp_t stamp = {.time_ns = 5};
    for (int i = 0; i < BYTES; i++)
        arena[i] = (uint8_t)(i * 31 + i / 251);
    for (int64_t i = 0; i < WIDE; i++) {
        const int64_t value = i == 7 ? INT64_MIN : i == 9 ? INT64_MAX : i * 100000 - 1000000000;
        memcpy(arena + WIDE_AT + i * 8, &value, 8);
    }
    uint32_t sent = 0;
    int count = 0;
    assert_int_equal(fv_tensors_bytes(&large), sizeof whole);
    for (; sent < sizeof whole; count++) {
        fovea_tensors_t message;
        uint32_t at = sent;
        const uint32_t bytes =
            fv_tensors_encode(&large, arena, &stamp, &sent, scratch, buffer, sizeof buffer);
        read_message(buffer, bytes, &message);
        for (int32_t i = 0; i < message.count; i++) {
            const fovea_tensor_t *t = &message.tensors[i];
            const int wide = strcmp(t->name, "output1") == 0;
            assert_int_equal(t->type, wide ? FOVEA_TENSOR_T_TYPE_INT32 : FOVEA_TENSOR_T_TYPE_UINT8);
            assert_int_equal(t->whole_bytes, wide ? WIDE * 4 : BYTES);
            assert_int_equal((wide ? BYTES : 0) + t->first_byte, at);
            memcpy(whole + at, t->data, (size_t)t->size_bytes);
            at += (uint32_t)t->size_bytes;
        }
        assert_int_equal(at, sent);
        fovea_tensors_t_decode_cleanup(&message);
    }
    assert_int_equal(count, 4);
    assert_memory_equal(whole, arena, BYTES);
    for (int64_t i = 0; i < WIDE; i++) {
        int32_t found;
        memcpy(&found, whole + BYTES + i * 4, 4);
        assert_int_equal(found, i == 7 ? INT32_MIN : i == 9 ? INT32_MAX : i * 100000 - 1000000000);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(outputs_leave_as_messages_whatever_the_grant),
        cmocka_unit_test(large_outputs_are_cut_into_packets)};
    return cmocka_run_group_tests(tests, setup, NULL);
}
