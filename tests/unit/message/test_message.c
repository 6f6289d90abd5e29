/* Encoders: their output decodes to their input, fits the promised bound, and is refused a byte
 * short. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "support/lcmlog.h"
#include "message/fields.h"
#include "message/message.h"
#include "message/recorded.h"

#include "fovea_camera_status_t.h"
#include "fovea_features_t.h"
#include "fovea_preview_t.h"
#include "fovea_statistics_t.h"

static const struct fovea_frame frame = {.stamp_ns = 1234567890123456789,
                                         .clock = FOVEA_CLOCK_BOOTTIME,
                                         .stamp_meaning = FOVEA_STAMP_EXPOSURE_MIDDLE,
                                         .sequence = 77};

static void assert_well_formed(const char *type, const uint8_t *data, uint32_t bytes)
{
    const char *why = NULL;
    size_t at = 0;
    if (!fv_message_check(type, data, bytes, &why, &at))
        fail_msg("%s: byte %zu: %s", type, at, why);
}

static void assert_stamp(const fovea_stamp_t *stamp)
{
    assert_true(stamp->time_ns == frame.stamp_ns && stamp->clock == 1 && stamp->meaning == 2);
    assert_true(stamp->utc_offset_ns == -5 && stamp->sequence == 77);
}

static void test_channels(void **state)
{
    (void)state;
    char name[FV_MESSAGE_CHANNEL_BYTES];
    fv_message_channel("FOVEA", FV_MESSAGE_FEATURES, name);
    assert_string_equal(name, "FOVEA_FEATURES");
    fv_message_channel("", FV_MESSAGE_COMMAND, name);
    assert_string_equal(name, "COMMAND");
    fv_message_channel("0123456789012345678901234567890", FV_MESSAGE_CAMERA_STATUS, name);
    assert_string_equal(name, "0123456789012345678901234567890_CAMERA_STATUS");
    fovea_stamp_t none = fv_message_stamp(NULL, 3);
    assert_true(none.sequence == -1 && none.time_ns == 0 && none.utc_offset_ns == 3);
}

static void test_features(void **state)
{
    (void)state;
    for (uint32_t count = 0; count <= FOVEA_FEATURES_T_COUNT_MAX; count += 500) {
        struct fovea_feature *features = calloc(count + 1, sizeof *features);
        for (uint32_t i = 0; i < count; i++)
            features[i] = (struct fovea_feature){.x_px = (float)i + 0.25f,
                                                 .y_px = -(float)i,
                                                 .size_px = 31.0f,
                                                 .level = (uint8_t)(i % 8),
                                                 .score = (uint8_t)i};
        struct fv_message_features in = {.stamp = fv_message_stamp(&frame, -5),
                                         .reset_counter = 3,
                                         .width = 752,
                                         .height = 480,
                                         .asked = 1000,
                                         .count = count,
                                         .features = features};
        size_t bound = fv_message_features_size_max(count);
        uint8_t *buffer = malloc(bound);
        void *scratch = malloc(fv_message_features_scratch_bytes(count) + 1);
        assert_int_equal(fv_message_features_encode(&in, scratch, buffer, bound - 1), 0);
        uint32_t bytes = fv_message_features_encode(&in, scratch, buffer, bound);
        assert_int_equal(bytes, bound);
        assert_well_formed("fovea.features_t", buffer, bytes);
        fovea_features_t out;
        assert_int_equal(fovea_features_t_decode(buffer, 0, (int)bytes, &out), bytes);
        assert_stamp(&out.stamp);
        assert_true(out.reset_counter == 3 && out.width == 752 && out.height == 480 &&
                    out.asked == 1000);
        assert_true(out.count == (int32_t)count && out.total == out.count && out.first == 0);
        assert_string_equal(out.method, "fast");
        for (uint32_t i = 0; i < count; i++)
            assert_true(out.p_px[i][0] == features[i].x_px && out.p_px[i][1] == features[i].y_px &&
                        out.size_px[i] == 31.0f && out.level[i] == features[i].level &&
                        isnan(out.orientation[i]) && out.response[i] == features[i].score);
        fovea_features_t_decode_cleanup(&out);
        free(scratch);
        free(buffer);
        free(features);
    }
}

/* More features than one message holds: two of one packet each, which fill the buffer. */
static void test_features_in_pieces(void **state)
{
    (void)state;
    static struct fovea_feature features[FOVEA_FEATURES_MAX];
    for (int i = 0; i < FOVEA_FEATURES_MAX; i++)
        features[i] = (struct fovea_feature){.x_px = (float)i, .level = (uint8_t)(i % 8)};
    struct fv_message_features in = {
        .stamp = fv_message_stamp(&frame, -5), .count = FOVEA_FEATURES_MAX, .features = features};
    const size_t bound = fv_message_features_size_max(FOVEA_FEATURES_MAX);
    uint8_t *buffer = malloc(bound);
    void *scratch = malloc(fv_message_features_scratch_bytes(FOVEA_FEATURES_MAX));
    size_t at = 0;
    for (int piece = 0; piece < 2; piece++) {
        const uint32_t bytes = fv_message_features_encode(&in, scratch, buffer + at, bound - at);
        fovea_features_t out;
        assert_in_range(bytes, 1, FV_MESSAGE_PACKET_BYTES - FV_MESSAGE_CHANNEL_BYTES);
        assert_well_formed("fovea.features_t", buffer + at, bytes);
        assert_int_equal(fovea_features_t_decode(buffer + at, 0, (int)bytes, &out), bytes);
        assert_true(out.total == FOVEA_FEATURES_MAX && out.first == (int32_t)in.first);
        assert_int_equal(out.count, piece == 0 ? FOVEA_FEATURES_T_COUNT_MAX
                                               : FOVEA_FEATURES_MAX - FOVEA_FEATURES_T_COUNT_MAX);
        for (int i = 0; i < out.count; i++)
            assert_true(out.p_px[i][0] == (float)(out.first + i) &&
                        out.level[i] == (out.first + i) % 8);
        in.first += (uint32_t)out.count;
        at += bytes;
        fovea_features_t_decode_cleanup(&out);
    }
    assert_int_equal(at, bound);
    assert_int_equal(in.first, in.count);
    free(scratch);
    free(buffer);
}

static const char longest_name[] = "a name of 23 characters";

/* That every field has the value that test_statistics gave it. */
static void assert_statistics(const fovea_statistics_t *out)
{
    assert_stamp(&out->stamp);
    assert_string_equal(out->version, FOVEA_VERSION);
    assert_string_equal(out->kernel_set, "avx512");
    assert_true(out->frames_in == 9 && out->frames_processed == 8 && out->frames_refused == 7 &&
                out->refused_stamp == 5 && out->refused_format == 4 && out->refused_paused == 3 &&
                out->steps_without_frame == 6 && out->reset_counter == 2 && out->features == 1 &&
                out->features_granted == 950);
    assert_true(out->frames_late == 13 && out->source_missing == 101 &&
                out->source_damaged == 102 && out->source_dropped == 103 &&
                out->source_recovered == 104);
    assert_true(out->latency_ns == 11 && out->temperature_c == 41.5f && out->resident_bytes == 12);
    assert_true(out->memory_persistent_bytes == 1000 && out->memory_job_bytes == 2000 &&
                out->memory_frame_bytes == 3000);
    assert_true(out->stage_count == FOVEA_STAGE_COUNT && out->job_count == FOVEA_JOB_COUNT);
    assert_true(out->stages[1].cpu_ns == 1001 && out->stages[1].wall_ns == 2001 &&
                strcmp(out->stages[1].name, longest_name) == 0);
    assert_true(out->jobs[0].units_granted == 20 && out->jobs[0].units_done == 10 &&
                out->jobs[0].waiting == 1 && out->jobs[1].waiting == 0);
}

static void test_statistics(void **state)
{
    (void)state;
    assert_int_equal(sizeof longest_name, FV_MESSAGE_NAME_BYTES_MAX);
    const char *stages[FOVEA_STAGE_COUNT], *jobs[FOVEA_JOB_COUNT];
    struct fovea_stats stats = {.frames_in = 9,
                                .frames_processed = 8,
                                .frames_refused = 7,
                                .steps_without_frame = 6,
                                .refused_stamp = 5,
                                .refused_format = 4,
                                .refused_paused = 3,
                                .reset_counter = 2,
                                .features = 1};
    struct fovea_inputs inputs = {.latency_ns = 11,
                                  .temperature_c = 41.5f,
                                  .resident_bytes = 12,
                                  .frames_late = 13,
                                  .source_counts = {100, 101, 102, 103, 104}};
    struct fovea_grants grants = {.features = 900};
    inputs.grants.features = 950;
    uint32_t done[FOVEA_JOB_COUNT];
    size_t memory[FOVEA_MEMORY_PART_COUNT] = {1000, 2000, 3000};
    for (int i = 0; i < FOVEA_STAGE_COUNT; i++) {
        stages[i] = longest_name;
        stats.stage_cpu_ns[i] = 1000 + i;
        stats.stage_wall_ns[i] = 2000 + i;
    }
    for (int i = 0; i < FOVEA_JOB_COUNT; i++) {
        jobs[i] = longest_name;
        grants.units[i] = (uint32_t)(20 + i);
        done[i] = (uint32_t)(10 + i);
    }
    struct fv_message_statistics in = {.stamp = fv_message_stamp(&frame, -5),
                                       .kernel_set = "avx512",
                                       .stats = &stats,
                                       .inputs = &inputs,
                                       .work_grants = &grants,
                                       .units_done = done,
                                       .jobs_waiting = 1,
                                       .memory_bytes = memory,
                                       .stage_names = stages,
                                       .job_names = jobs};
    uint8_t buffer[4096];
    size_t bound = fv_message_statistics_size_max();
    uint32_t bytes = fv_message_statistics_encode(&in, buffer, bound);
    assert_in_range(bytes, 1, bound);
    assert_true(
        bound - bytes <
        2 * FV_MESSAGE_NAME_BYTES_MAX); /* version and kernel set are shorter than allowed */
    assert_int_equal(fv_message_statistics_encode(&in, buffer, bytes - 1), 0);
    assert_int_equal(fv_message_statistics_encode(&in, buffer, bytes), bytes);
    assert_well_formed("fovea.statistics_t", buffer, bytes);
    fovea_statistics_t out;
    assert_int_equal(fovea_statistics_t_decode(buffer, 0, (int)bytes, &out), bytes);
    assert_statistics(&out);
    fovea_statistics_t_decode_cleanup(&out);
}

static void test_camera_status(void **state)
{
    (void)state;
    struct fv_message_camera_status in = {.stamp = fv_message_stamp(&frame, -5),
                                          .now_ns = 99,
                                          .state = FOVEA_SOURCE_RETURNING,
                                          .width = 640,
                                          .height = 400,
                                          .pixel_format = "bayer_rggb8",
                                          .exposure_ns = 5000,
                                          .counts = {1, 2, 3, 4, 5}};
    uint8_t buffer[512];
    size_t bound = fv_message_camera_status_size_max();
    uint32_t bytes = fv_message_camera_status_encode(&in, buffer, bound);
    assert_in_range(bytes, 1, bound);
    assert_int_equal(fv_message_camera_status_encode(&in, buffer, bytes - 1), 0);
    assert_well_formed("fovea.camera_status_t", buffer, bytes);
    fovea_camera_status_t out;
    assert_int_equal(fovea_camera_status_t_decode(buffer, 0, (int)bytes, &out), bytes);
    assert_stamp(&out.stamp);
    assert_string_equal(out.pixel_format, "bayer_rggb8");
    assert_true(out.now_ns == 99 && out.state == FOVEA_CAMERA_STATUS_T_STATE_RETURNING &&
                out.width == 640 && out.height == 400 && out.exposure_ns == 5000);
    assert_true(out.delivered == 1 && out.missing == 2 && out.damaged == 3 && out.dropped == 4 &&
                out.recovered == 5);
    fovea_camera_status_t_decode_cleanup(&out);
}

static void test_preview(void **state)
{
    (void)state;
    uint8_t jpeg[1000], buffer[1200];
    for (int i = 0; i < 1000; i++)
        jpeg[i] = (uint8_t)(i * 7);
    struct fv_message_preview in = {.stamp = fv_message_stamp(&frame, -5),
                                    .width = 320,
                                    .height = 200,
                                    .scale = 1.44,
                                    .jpeg = jpeg,
                                    .jpeg_bytes = sizeof jpeg};
    size_t bound = fv_message_preview_size_max(sizeof jpeg);
    assert_int_equal(fv_message_preview_encode(&in, buffer, bound - 1), 0);
    uint32_t bytes = fv_message_preview_encode(&in, buffer, bound);
    assert_int_equal(bytes, bound);
    assert_well_formed("fovea.preview_t", buffer, bytes);
    fovea_preview_t out;
    assert_int_equal(fovea_preview_t_decode(buffer, 0, (int)bytes, &out), bytes);
    assert_stamp(&out.stamp);
    assert_true(out.width == 320 && out.height == 200 && out.scale == 1.44 &&
                out.size_bytes == 1000);
    assert_memory_equal(out.jpeg, jpeg, sizeof jpeg);
    fovea_preview_t_decode_cleanup(&out);
}

/* An image that claims to be of another hour. */
static void test_a_frame_of_far_apart_images_is_refused(void **state)
{
    (void)state;
    static uint8_t pixels[64 * 64], buffer[64 * 64 + 256];
    struct fovea_frame in = frame, out;
    in.image_count = 1;
    in.images[0] = (struct fovea_image){pixels, 64, 64, 64, FOVEA_PIXEL_GREY8, sizeof pixels};
    const struct {
        int64_t offset_ns;
        enum fovea_status status;
    } rows[] = {{-1000000000, FOVEA_OK},
                {1000000000, FOVEA_OK},
                {1000000001, FOVEA_ERROR_INPUT},
                {INT64_MIN, FOVEA_ERROR_INPUT}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct fovea_error error = {.text = ""};
        in.offset_ns[0] = rows[i].offset_ns;
        const struct fv_lcmlog_event event = {
            .channel = "FOVEA_FRAME",
            .bytes = fv_message_frame_encode(&in, 0, buffer, sizeof buffer),
            .data = buffer};
        assert_int_equal(fv_lcmlog_frame("log", &event, &out, &error), rows[i].status);
        if (rows[i].status == FOVEA_OK)
            assert_true(out.offset_ns[0] == rows[i].offset_ns);
        else
            assert_non_null(strstr(error.text, "offset_ns: found "));
    }
}

/* Frames of recordings: every byte of every format comes back, rows with padding too, the last one
 * with and without it. */
static void test_frames_without_loss(void **state)
{
    (void)state;
    enum { W = 70, H = 66, PADDING = 6, BYTES_MAX = (3 * W + PADDING) * H };
    static uint8_t pixels[BYTES_MAX], buffer[2 * BYTES_MAX + 256];
    for (int i = 0; i < BYTES_MAX; i++)
        pixels[i] = (uint8_t)(i * 31 + i / 256);
    for (int n = 0; n < 2 * FOVEA_PIXEL_FORMAT_COUNT; n++) {
        const enum fovea_pixel_format format = (enum fovea_pixel_format)(n / 2);
        const bool compressed = format == FOVEA_PIXEL_MJPEG;
        const int32_t stride = compressed ? 0 : fovea_image_stride_min(format, W) + PADDING;
        const size_t whole = compressed ? 777 : fovea_image_bytes(format, H, stride);
        struct fovea_frame in = frame, out;
        for (int i = 0; i < FOVEA_CAMERAS_MAX; i++) {
            in.offset_ns[i] = i % 2 == 0 ? -4000000 * i : 0;
            in.exposure_ns[i] = i % 2 == 0 ? 12345678901 + i : 0;
        }
        in.images[0] =
            (struct fovea_image){pixels, W, H, stride, format, whole + (n % 2 == 0 ? 10 : 0)};
        if (n % 2 == 1 && !compressed)
            in.images[0].size_bytes = whole - (format == FOVEA_PIXEL_YU12 ? PADDING / 2 : PADDING);
        if (compressed) in.images[0].size_bytes = whole;
        assert_int_equal(fovea_image_check(&in.images[0]), FOVEA_OK);
        const size_t kept = in.images[0].size_bytes < whole ? in.images[0].size_bytes : whole;
        in.image_count = FOVEA_CAMERAS_MAX; /* the second and the fourth are absent */
        in.images[2] = in.images[0];
        in.images[2].size_bytes = compressed ? 333 : whole;
        const uint32_t bytes =
            fv_message_frame_encode(&in, -5, buffer, fv_message_frame_size_max(&in));
        assert_int_equal(bytes, fv_message_frame_size_max(&in));
        assert_well_formed("fovea.frame_t", buffer, bytes);
        const struct fv_lcmlog_event event = {
            .channel = "FOVEA_FRAME", .bytes = bytes, .data = buffer};
        struct fovea_error error;
        if (fv_lcmlog_frame("log", &event, &out, &error) != FOVEA_OK) fail_msg("%s", error.text);
        assert_int_equal(out.image_count, FOVEA_CAMERAS_MAX);
        assert_true(out.images[1].data == NULL && out.images[3].data == NULL);
        assert_int_equal(out.images[2].size_bytes, compressed ? 333 : whole);
        assert_memory_equal(out.images[2].data, pixels, out.images[2].size_bytes);
        assert_int_equal(out.images[0].size_bytes, kept);
        assert_memory_equal(out.images[0].data, pixels, kept);
        assert_true(out.images[0].width == W && out.images[0].height == H &&
                    out.images[0].stride_bytes == stride);
        assert_true(out.images[0].format == format && out.stamp_ns == in.stamp_ns);
        assert_memory_equal(out.offset_ns, in.offset_ns, sizeof out.offset_ns);
        assert_memory_equal(out.exposure_ns, in.exposure_ns, sizeof out.exposure_ns);
        assert_true(out.sequence == 77 && out.clock == in.clock &&
                    out.stamp_meaning == in.stamp_meaning);
    }
}

int main(void)
{
    fv_message_prepare();
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_channels),
        cmocka_unit_test(test_features),
        cmocka_unit_test(test_features_in_pieces),
        cmocka_unit_test(test_statistics),
        cmocka_unit_test(test_camera_status),
        cmocka_unit_test(test_preview),
        cmocka_unit_test(test_frames_without_loss),
        cmocka_unit_test(test_a_frame_of_far_apart_images_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
