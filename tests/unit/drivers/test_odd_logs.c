/* LCM logs that are odd and yet to be played: damage inside, heads among other messages, cameras
 * that are absent. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "../../../drivers/recorded/player.h"
#include "common/datasets.h"
#include "common/played.h"
#include "fovea_recording_t.h"
#include "message/message.h"
#include "message/recorded.h"

enum { W = FV_TEST_WIDTH, H = FV_TEST_HEIGHT };

static char *const folder = fv_test_place;

/* The header of one event is spoilt: that frame is lost, all others come. */
static void test_log_goes_on_after_damage(void **state)
{
    struct played played;
    char path[FV_TEST_PATH_BYTES];
    size_t bytes;
    (void)state;
    snprintf(path, sizeof path, "%s", fv_test_lcmlog(folder));
    uint8_t *whole = fv_test_read(path, &bytes);
    const size_t event = bytes / FV_TEST_FRAMES;
    played_fine("lcmlog", path, &played);
    assert_int_equal(played.count, FV_TEST_FRAMES);
    assert_true(played.rate_hz > 19.99 && played.rate_hz < 20.01);
    for (size_t at = 0; at < 28; at++) {
        if (at >= 4 && at < 20) continue; /* number and time, which nobody needs */
        uint8_t *byte = &whole[5 * event + at];
        *byte = (uint8_t) ~*byte;
        fv_test_write(path, whole, bytes);
        *byte = (uint8_t) ~*byte;
        played_fine("lcmlog", path, &played);
        /* A length may swallow a neighbour. */
        if (played.count + 2 < FV_TEST_FRAMES || played.count == FV_TEST_FRAMES)
            fail_msg("byte %zu: %zu frames", at, played.count);
        assert_true(played.counts.damaged > 0);
        assert_int_equal(played.sequence[played.count - 1], FV_TEST_FRAMES - 1);
        if (at < 4) {
            char place[64];
            assert_int_equal(played.count, FV_TEST_FRAMES - 1);
            assert_int_equal(played.counts.damaged, 1);
            snprintf(place, sizeof place, ": byte %zu: found ", 5 * event);
            assert_non_null(strstr(played.complaint.text, place));
        }
    }
    /* A piece of a header gone, one from inside a frame, whose length then swallows the next one's
     * head, and the end of the file; in reverse too. */
    const struct fovea_source_selection reverse = {.step = 1, .reverse = true};
    struct fovea_error error;
    memmove(whole + 7 * event + 50, whole + 7 * event + 150, bytes - 7 * event - 150);
    memmove(whole + 3 * event + 10, whole + 3 * event + 90, bytes - 3 * event - 90);
    fv_test_write(path, whole, bytes - 180 - 40);
    played_fine("lcmlog", path, &played);
    assert_int_equal(played.count, FV_TEST_FRAMES - 4);
    assert_int_equal(played.counts.damaged, 4);
    assert_int_equal(played_uri("lcmlog", path, &reverse, &played, &error), FOVEA_OK);
    assert_int_equal(played.count, FV_TEST_FRAMES - 4);
    for (size_t i = 1; i < played.count; i++)
        assert_true(played.stamp_ns[i] > played.stamp_ns[i - 1] &&
                    played.sequence[i] < played.sequence[i - 1]);
    free(whole);
}

static void put_number(FILE *file, uint64_t number, int bytes)
{
    while (bytes-- > 0)
        assert_true(fputc((int)(number >> (8 * bytes) & 0xff), file) != EOF);
}

static void put_event(FILE *file, const char *channel, const void *data, size_t bytes)
{
    put_number(file, 0xEDA1DA01, 4);
    put_number(file, 0, 8);
    put_number(file, 0, 8);
    put_number(file, strlen(channel), 4);
    put_number(file, bytes, 4);
    assert_int_equal(fwrite(channel, 1, strlen(channel), file), strlen(channel));
    assert_int_equal(fwrite(data, 1, bytes, file), bytes);
}

/* The head of a recording of ours, with a focal length. */
static void put_head(FILE *file, const char *channel, int focal)
{
    static char none[] = "", name[] = "rig";
    uint8_t bytes[2048], rig_bytes[2048];
    const struct fovea_rig rig = {
        .camera_count = 1,
        .cameras[0] = {
            .calibrated = true,
            .camera = {.width = W, .height = H, .fx = focal, .fy = focal, .cx = 48, .cy = 32}}};
    fovea_recording_part_t part = {
        .name = name,
        .origin = none,
        .size_bytes = (int32_t)fv_message_rig_encode(&rig, rig_bytes, sizeof rig_bytes),
        .data = rig_bytes};
    fovea_recording_t head = {.format = FOVEA_RECORDING_T_FORMAT,
                              .version = none,
                              .machine = none,
                              .kernel_set = none,
                              .source = none,
                              .channel_prefix = none,
                              .part_count = 1,
                              .parts = &part};
    const int size = fovea_recording_t_encode(bytes, 0, sizeof bytes, &head);
    assert_true(size > 0);
    put_event(file, channel, bytes, (size_t)size);
}

/* A logger that hears all: other messages come first, and the head of another camera. */
static void test_log_head_among_others(void **state)
{
    const struct fovea_source_selection everything = {.step = 1};
    char path[FV_TEST_PATH_BYTES];
    size_t bytes;
    (void)state;
    snprintf(path, sizeof path, "%s", fv_test_lcmlog(folder));
    uint8_t *frames = fv_test_read(path, &bytes);
    for (int ours = 0; ours < 2; ours++) {
        struct fovea_source *source;
        struct fovea_error error;
        FILE *file = fopen(path, "wb");
        assert_non_null(file);
        put_event(file, "BASE_POSE", "anything", 8);
        put_head(file, "LEFT_RECORDING", 70);
        put_head(file, "FOVEA_2_RECORDING", 75);
        if (ours) put_head(file, "FOVEA_RECORDING", 90);
        for (int i = 0; i < 12; i++) { /* more than are looked at */
            char channel[32];
            snprintf(channel, sizeof channel, "OTHER%d_RECORDING", i);
            put_head(file, channel, 80);
        }
        assert_int_equal(fwrite(frames, 1, bytes, file), bytes);
        assert_int_equal(fclose(file), 0);
        assert_int_equal(fv_source_lcmlog.open(path, &everything, &source, &error), FOVEA_OK);
        const struct fovea_source_info *info = fv_source_lcmlog.info(source);
        assert_int_equal(info->rig.cameras[0].calibrated, ours);
        if (ours) assert_true(info->rig.cameras[0].camera.fx == 90);
        fv_source_lcmlog.close(source);
    }
    free(frames);
}

/* Two cameras: an absent image stays absent, and a frame with another number of images is damaged.
 */
static void test_log_of_two_cameras(void **state)
{
    const struct fovea_source_selection everything = {.step = 1};
    static const uint32_t counts[] = {2, 2, 1, 2};
    const char *path = fv_test_path(folder, "two.lcmlog");
    static uint8_t pixels[W * H], bytes[3 * W * H];
    struct fovea_source *source;
    struct fovea_frame frame;
    struct fovea_error error;
    (void)state;
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    fv_message_prepare();
    for (uint32_t i = 0; i < 4; i++) {
        const struct fovea_image image = {pixels, W, H, W, FOVEA_PIXEL_GREY8, sizeof pixels},
                                 other = {pixels,
                                          W - 32,
                                          H + 8,
                                          W - 32,
                                          FOVEA_PIXEL_GREY8,
                                          (W - 32) * (H + 8)};
        frame = (struct fovea_frame){.image_count = counts[i], .stamp_ns = i, .sequence = i};
        if (i > 0) frame.images[0] = image; /* of the first frame the first camera's is absent */
        if (i == 0 || i == 3) frame.images[1] = other;
        put_event(file, "FOVEA_FRAME", bytes,
                  fv_message_frame_encode(&frame, 0, bytes, sizeof bytes));
    }
    assert_int_equal(fclose(file), 0);
    assert_int_equal(fv_source_lcmlog.open(path, &everything, &source, &error), FOVEA_OK);
    const struct fovea_source_info *info = fv_source_lcmlog.info(source);
    assert_int_equal(info->rig.camera_count, 2);
    assert_true(info->cameras[0].width == W && info->cameras[0].height == H);
    assert_true(info->cameras[1].width == W - 32 && info->cameras[1].height == H + 8);
    assert_int_equal(fv_source_lcmlog.start(source, &error), FOVEA_OK);
    for (uint32_t i = 0; i < 4; i++) {
        if (counts[i] != 2) continue;
        assert_int_equal(fv_source_lcmlog.dequeue(source, INT64_MAX, &frame), FOVEA_OK);
        assert_int_equal(frame.sequence, i);
        assert_int_equal(frame.image_count, 2);
        assert_int_equal(frame.images[0].data == NULL, i == 0);
        assert_int_equal(frame.images[1].data == NULL, i == 1);
        assert_int_equal(frame.images[0].width, i == 0 ? 0 : W);
        assert_int_equal(frame.images[1].width, i == 1 ? 0 : W - 32);
        fv_source_lcmlog.requeue(source, &frame);
    }
    assert_int_equal(fv_source_lcmlog.dequeue(source, INT64_MAX, &frame), FOVEA_END);
    assert_int_equal(fv_source_lcmlog.complaint(source, &error), FOVEA_OK);
    assert_non_null(strstr(error.text, "frame 2: image_count: found 1, expected 2"));
    fv_source_lcmlog.close(source);
}

/* A log in which no frame can be read is refused by its first damage. */
static void test_log_of_nothing(void **state)
{
    const struct fovea_source_selection everything = {.step = 1};
    static uint8_t noise[8192];
    struct played played;
    struct fovea_error error;
    const char *path = fv_test_path(folder, "noise.lcmlog");
    (void)state;
    for (size_t i = 0; i + 4 <= sizeof noise; i += 4) /* sync words */
        memcpy(noise + i, "\xED\xA1\xDA\x01", 4);
    static const char event[] =
        "\xED\xA1\xDA\x01................\0\0\0\x04\0\0\0\0NAME"; /* and one event */
    memcpy(noise + sizeof noise / 2, event, sizeof event - 1);
    fv_test_write(path, noise, sizeof noise);
    assert_int_equal(played_uri("lcmlog", path, &everything, &played, &error), FOVEA_ERROR_INPUT);
    assert_memory_equal(error.text, path, strlen(path));
    assert_memory_equal(error.text + strlen(path), ": byte 20: channel length", 25);
}

/* The same of a log's own: the head of a recording of ours, here cut off behind the type's hash. */
static void test_own_head_not_needed(void **state)
{
    const struct fovea_source_selection alone = {.step = 1},
                                        given = {.step = 1, .camera_given = true};
    const uint64_t hash = (uint64_t)__fovea_recording_t_get_hash();
    struct played played;
    struct fovea_error error;
    char path[FV_TEST_PATH_BYTES];
    uint8_t head[8];
    size_t bytes;
    (void)state;
    snprintf(path, sizeof path, "%s", fv_test_lcmlog(folder));
    uint8_t *frames = fv_test_read(path, &bytes);
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    for (int i = 0; i < 8; i++)
        head[i] = (uint8_t)(hash >> (56 - 8 * i));
    put_event(file, "FOVEA_RECORDING", head, sizeof head);
    assert_int_equal(fwrite(frames, 1, bytes, file), bytes);
    assert_int_equal(fclose(file), 0);
    assert_int_equal(played_uri("lcmlog", path, &alone, &played, &error), FOVEA_ERROR_INPUT);
    assert_int_equal(played_uri("lcmlog", path, &given, &played, &error), FOVEA_OK);
    assert_int_equal(played.count, FV_TEST_FRAMES);
    assert_false(played.has_camera);
    free(frames);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_log_goes_on_after_damage),
        cmocka_unit_test(test_log_head_among_others),
        cmocka_unit_test(test_log_of_two_cameras),
        cmocka_unit_test(test_log_of_nothing),
        cmocka_unit_test(test_own_head_not_needed),
    };
    return cmocka_run_group_tests(tests, fv_test_place_set_up, fv_test_place_tear_down);
}
