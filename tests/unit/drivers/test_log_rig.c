/* The rig in the head of a recording, as `lcmlog:` reads it. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <stdlib.h>
#include <string.h>

#include "../../../drivers/recorded/log_rig.h"
#include "fovea_recording_t.h"
#include "message/recorded.h"

static const struct fovea_rig written_rig = {
    .camera_count = 2,
    .has_imu = true,
    .cameras = {{.calibrated = true,
                 .has_readout = true,
                 .readout_ns = 12345678,
                 .has_T_body_cam = true,
                 .camera = {.width = 96,
                            .height = 64,
                            .lens = FOVEA_LENS_EQUIDISTANT,
                            .fx = 80,
                            .fy = 81,
                            .cx = 48,
                            .cy = 32,
                            .k = {0.01}},
                 .T_body_cam = {1, 0, 0, 0.25, 0, 1, 0, 0, 0, 0, 1, 0}}},
    .imu = {.T_body_imu = {1, 0, 0, 0, 0, 1, 0, -0.5, 0, 0, 1, 0},
            .rate_hz = 200,
            .gyro_noise = 1,
            .gyro_walk = 2,
            .acceleration_noise = 3,
            .acceleration_walk = 4,
            .gyro_range = 5,
            .acceleration_range = 6,
            .gyro_correction = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12},
            .acceleration_correction = {12, 11, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1},
            .time_offset_ns = -5}};

/* A head whose part `name` is the rig above. */
static uint32_t encode_head(int32_t format, const char *name, uint8_t *rig, uint8_t *bytes,
                            int32_t capacity)
{
    const uint32_t rig_bytes = fv_message_rig_encode(&written_rig, rig, fv_message_rig_size_max());
    assert_true(rig_bytes > 0);
    fovea_recording_part_t parts[2] = {{.name = (char *)"configuration",
                                        .origin = (char *)"",
                                        .size_bytes = 3,
                                        .data = (uint8_t *)"abc"},
                                       {.name = (char *)name,
                                        .origin = (char *)"",
                                        .size_bytes = (int32_t)rig_bytes,
                                        .data = rig}};
    const fovea_recording_t head = {.format = format,
                                    .version = (char *)"0",
                                    .machine = (char *)"m",
                                    .kernel_set = (char *)"c",
                                    .source = (char *)"sim:",
                                    .channel_prefix = (char *)"FOVEA",
                                    .part_count = 2,
                                    .parts = parts};
    const int size = fovea_recording_t_encode(bytes, 0, capacity, &head);
    assert_true(size > 0);
    return (uint32_t)size;
}

static void test_log_rig(void **state)
{
    (void)state;
    uint8_t bytes[2048], rig[2048];
    struct fv_lcmlog_event event = {.channel = "FOVEA_RECORDING", .data = bytes};
    struct fovea_rig found;
    struct fovea_error error = {.text = ""};
    event.bytes = encode_head(4, "rig", rig, bytes, sizeof bytes);
    if (fv_log_rig("x.log", &event, &found, &error) != FOVEA_OK) fail_msg("%s", error.text);
    assert_true(found.camera_count == 2 && found.has_imu);
    assert_memory_equal(&found.imu, &written_rig.imu, sizeof found.imu);
    const struct fovea_rig_camera *first = &found.cameras[0];
    assert_true(first->calibrated && first->camera.fy == 81 && first->camera.field_max_rad > 0.5);
    assert_true(first->camera.lens == FOVEA_LENS_EQUIDISTANT && first->T_body_cam[3] == 0.25);
    assert_true(first->has_readout && first->readout_ns == 12345678);
    assert_false(found.cameras[1].calibrated || found.cameras[1].has_T_body_cam);

    const uint32_t size = event.bytes;
    for (uint32_t cut = 8; cut < size; cut++) { /* in memory of just that size, for sanitizers */
        uint8_t *part = malloc(cut);
        assert_non_null(part);
        memcpy(part, bytes, cut);
        event.bytes = cut;
        event.data = part;
        assert_int_equal(fv_log_rig("x.log", &event, &found, &error), FOVEA_ERROR_INPUT);
        assert_memory_equal(error.text, "x.log: byte ", 12);
        free(part);
    }
    event.data = bytes;
    event.bytes = encode_head(3, "rig", rig, bytes, sizeof bytes);
    assert_int_equal(fv_log_rig("x.log", &event, &found, &error), FOVEA_ERROR_UNSUPPORTED);
    assert_non_null(
        strstr(error.text, "found recording format 3, which Fovea 0.1 reads, expected 4"));
    event.bytes = encode_head(4, "other", rig, bytes, sizeof bytes);
    assert_int_equal(fv_log_rig("x.log", &event, &found, &error), FOVEA_AGAIN);
    event.bytes = encode_head(4, "rig", rig, bytes, sizeof bytes);
    uint8_t *inside = bytes + event.bytes - fv_message_rig_size_max() +
                      (FOVEA_CAMERAS_MAX - 2) *
                          ((fv_message_rig_size_max() - 8 - 4 - 1 - 44 * 8) / FOVEA_CAMERAS_MAX);
    assert_int_equal(inside[8 + 3], 2);
    inside[8 + 3] = 5;
    assert_int_equal(fv_log_rig("x.log", &event, &found, &error), FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "rig: camera_count: found 5, expected 1 to 4"));
    inside[8 + 3] = 2;
    memset(bytes + event.bytes - 44 * 8, 0, 8); /* T_body_imu[0] */
    assert_int_equal(fv_log_rig("x.log", &event, &found, &error), FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "rig: T_body_imu: found no rotation, expected orthonormal"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_log_rig),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
