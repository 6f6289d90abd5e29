/* Recordings: pictures to the last grey level, truth at the frames' stamps, and damage that is
 * counted, named and skipped. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <semaphore.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "drivers/table.h"
#include "support/decode.h"
#include "../../../drivers/recorded/lines.h"
#include "../../../drivers/recorded/player.h"
#include "../../../drivers/recorded/poses.h"
#include "common/datasets.h"

static char *const folder = fv_test_place;
static const struct fovea_source_selection everything = {.step = 1};

/* ---- pictures -------------------------------------------------------------------------------- */

enum { W = FV_TEST_WIDTH, H = FV_TEST_HEIGHT, STRIDE = 128 };

static void decode(const char *path, uint8_t *grey)
{
    size_t bytes;
    uint8_t *file = fv_test_read(path, &bytes);
    const struct fv_decode_image image = {
        .pixels = grey, .width = W, .height = H, .stride_bytes = STRIDE};
    struct fovea_error reason = {.text = ""};
    int32_t width = 0, height = 0;
    assert_int_equal(fv_decode_probe(file, bytes, &width, &height, &reason), FOVEA_OK);
    assert_int_equal(width, W);
    assert_int_equal(height, H);
    if (fv_decode(file, bytes, &image, &reason) != FOVEA_OK) fail_msg("%s", reason.text);
    free(file);
}

static uint8_t weighted(const uint8_t *rgb)
{
    return (uint8_t)((9798 * rgb[0] + 19235 * rgb[1] + 3735 * rgb[2] + 16384) >> 15);
}

static void test_png_kinds(void **state)
{
    (void)state;
    const char *path = fv_test_path(folder, "kind.png");
    static uint8_t samples[W * H * 8], picture[W * H * 4], grey[STRIDE * H];
    for (int kind = 0; kind < 16; kind++) {
        const struct fv_test_png form = {.width = W,
                                         .height = H,
                                         .channels = 1 + kind % 4,
                                         .depth = kind / 4 % 2 == 0 ? 8 : 16,
                                         .interlaced = kind / 8 == 1};
        fv_test_picture((uint32_t)kind, W, H, form.channels, picture);
        for (int i = 0; i < W * H * form.channels; i++) {
            if (form.depth == 8) {
                samples[i] = picture[i];
            } else { /* the low byte must not matter */
                samples[2 * i] = picture[i];
                samples[2 * i + 1] = (uint8_t)(i * 37);
            }
        }
        fv_test_write_png(path, &form, samples);
        memset(grey, 0xEE, sizeof grey);
        decode(path, grey);
        for (int i = 0; i < W * H; i++) {
            const uint8_t *sample = &picture[i * form.channels];
            assert_int_equal(grey[i / W * STRIDE + i % W],
                             form.channels < 3 ? sample[0] : weighted(sample));
        }
        assert_int_equal(grey[W], 0xEE); /* nothing past the row */
    }
}

static void test_jpeg_kinds(void **state)
{
    (void)state;
    const char *path = fv_test_path(folder, "kind.jpg");
    static uint8_t picture[W * H * 3], grey[STRIDE * H];
    for (int kind = 0; kind < 6; kind++) {
        const int channels = kind < 2 ? 1 : 3;
        for (int y = 0; y < H; y++) /* smooth, so that compression changes little */
            for (int x = 0; x < W; x++)
                for (int c = 0; c < channels; c++)
                    picture[(y * W + x) * channels + c] = (uint8_t)(x + y + 30 * c);
        fv_test_write_jpeg(path, W, H, channels, kind % 2 == 1, kind >= 4, picture);
        decode(path, grey);
        for (int i = 0; i < W * H; i++) {
            const uint8_t *sample = &picture[i * channels];
            const int expected = channels == 1 ? sample[0] : weighted(sample);
            assert_true(abs(grey[i / W * STRIDE + i % W] - expected) <= 4);
        }
    }
}

/* Whatever is cut off, a picture is whole or refused. Marked in an end of 2 bytes, JPEG's is the
 * only one that may lack. */
static void test_truncated(void **state)
{
    (void)state;
    static uint8_t picture[W * H], grey[STRIDE * H];
    const struct fv_test_png form = {.width = W, .height = H, .channels = 1, .depth = 8};
    const struct fv_decode_image image = {
        .pixels = grey, .width = W, .height = H, .stride_bytes = STRIDE};
    fv_test_picture(3, W, H, 1, picture);
    for (int kind = 0; kind < 3; kind++) {
        const char *path = fv_test_path(folder, "cut");
        size_t bytes;
        if (kind == 0)
            fv_test_write_png(path, &form, picture);
        else
            fv_test_write_jpeg(path, W, H, 1, kind == 2, false, picture);
        uint8_t *file = fv_test_read(path, &bytes);
        for (size_t kept = 0; kept < bytes; kept += kept + 64 < bytes ? 7 : 1) {
            struct fovea_error reason = {.text = ""};
            uint8_t *part = malloc(kept + 1); /* of this size, so that reading past it is seen */
            assert_non_null(part);
            memcpy(part, file, kept);
            const enum fovea_status status = fv_decode(part, kept, &image, &reason);
            free(part);
            if (status == FOVEA_OK)
                fail_msg("kind %d: %zu of %zu bytes made a picture", kind, kept, bytes);
            assert_true(strlen(reason.text) > 5 && strchr(reason.text, '\n') == NULL);
        }
        free(file);
    }
}

static void test_size_limits(void **state)
{
    (void)state;
    static uint8_t picture[4160 * 65];
    const struct fv_test_png narrow = {.width = 63, .height = 65, .channels = 1, .depth = 8};
    const struct fv_test_png wide = {.width = 4160, .height = 65, .channels = 1, .depth = 8};
    const char *path = fv_test_path(folder, "size.png");
    struct fovea_error reason;
    int32_t width, height;
    size_t bytes;
    fv_test_write_png(path, &narrow, picture);
    uint8_t *file = fv_test_read(path, &bytes);
    assert_int_equal(fv_decode_probe(file, bytes, &width, &height, &reason), FOVEA_ERROR_INPUT);
    assert_string_equal(reason.text, "found 63 x 65 pixels, expected 64 x 64 to 4096 x 4096");
    free(file);
    fv_test_write_png(path, &wide, picture);
    file = fv_test_read(path, &bytes);
    assert_int_equal(fv_decode_probe(file, bytes, &width, &height, &reason), FOVEA_ERROR_INPUT);
    memset(file + 16, 0xFF, 8); /* 4294967295 x 4294967295 */
    assert_int_equal(fv_decode_probe(file, bytes, &width, &height, &reason), FOVEA_ERROR_INPUT);
    assert_non_null(strstr(reason.text, "found 4294967295 x 4294967295 pixels"));
    free(file);
}

/* ---- playing --------------------------------------------------------------------------------- */

static struct fovea_source *open_uri(const char *uri,
                                     const struct fovea_source_selection *selection,
                                     const struct fovea_source_ops **ops)
{
    const char *address;
    struct fovea_source *source = NULL;
    struct fovea_error error = {.text = ""};
    if (fv_source_find(uri, ops, &address, &error) != FOVEA_OK ||
        (*ops)->open(address, selection, &source, &error) != FOVEA_OK ||
        (*ops)->start(source, &error) != FOVEA_OK)
        fail_msg("%s", error.text);
    return source;
}

static const char *uri_of(const char *scheme, const char *address)
{
    static char uri[FV_TEST_PATH_BYTES + 16];
    snprintf(uri, sizeof uri, "%s:%s", scheme, address);
    return uri;
}

static void test_pictures_and_truth(void **state)
{
    (void)state;
    static const struct {
        const char *scheme;
        const char *(*make)(const char *);
        double offset_m;
        int64_t first_ns;
    } sets[] = {{"euroc", fv_test_euroc, 0.5, 1403638538577829376},
                {"tum", fv_test_tum, 0.0, 1305031102175304000},
                {"kitti", fv_test_kitti, 0.0, 0}};
    static struct fovea_truth truth;
    static uint8_t picture[W * H];
    for (size_t s = 0; s < sizeof sets / sizeof sets[0]; s++) {
        const struct fovea_source_ops *ops;
        struct fovea_source *source =
            open_uri(uri_of(sets[s].scheme, sets[s].make(folder)), &everything, &ops);
        struct fovea_frame frame;
        assert_true(ops->info(source)->has_truth && ops->info(source)->rig.cameras[0].calibrated);
        assert_true(fabs(ops->info(source)->rate_hz - 20) < 0.01);
        for (uint32_t i = 0; i < FV_TEST_FRAMES; i++) {
            assert_int_equal(ops->dequeue(source, INT64_MAX, &frame), FOVEA_OK);
            assert_int_equal(frame.sequence, i);
            assert_int_equal(frame.clock, FOVEA_CLOCK_RECORDED);
            assert_int_equal(frame.stamp_ns, sets[s].first_ns + (int64_t)i * 50000000);
            fv_test_picture(i, W, H, 1, picture);
            for (int y = 0; y < H && sets[s].make != fv_test_tum; y++)
                assert_memory_equal(frame.images[0].data + y * frame.images[0].stride_bytes,
                                    picture + y * W, W);
            assert_int_equal(ops->truth(source, &frame, &truth), FOVEA_OK);
            assert_true(truth.has_pose);
            assert_true(fabs(truth.T_world_cam[3] - (sets[s].offset_m + 0.1 * i)) < 1e-6);
            assert_true(sets[s].make != fv_test_euroc ||
                        truth.T_world_cam[2] == 1.0); /* T_BS turns the axes */
            ops->requeue(source, &frame);
        }
        ops->stop(source);
        ops->close(source);
    }
}

/* Each frame is spoilt in its own way; the rest must come through with their own numbers. */
static void test_damage_is_counted_and_named(void **state)
{
    (void)state;
    static uint8_t other[(W + 8) * H];
    const struct fv_test_png wider = {.width = W + 8, .height = H, .channels = 1, .depth = 8};
    char top[FV_TEST_PATH_BYTES], name[8][FV_TEST_PATH_BYTES];
    snprintf(top, sizeof top, "%s", fv_test_kitti(folder));
    for (int i = 0; i < 8; i++) {
        char file[32];
        snprintf(file, sizeof file, "image_0/%06d.png", 2 + i);
        snprintf(name[i], sizeof name[i], "%s", fv_test_path(top, file));
    }
    size_t bytes;
    uint8_t *whole = fv_test_read(name[1], &bytes);
    assert_int_equal(remove(name[0]), 0);
    fv_test_write(name[1], whole, bytes / 2);
    fv_test_write(name[2], "", 0);
    fv_test_write_png(name[3], &wider, other);
    assert_int_equal(remove(name[4]), 0);
    assert_int_equal(mkdir(name[4], 0755), 0);
    assert_int_equal(remove(name[5]), 0);
    assert_int_equal(mkfifo(name[5], 0644), 0);
    fv_test_write_text(name[6], "not a picture at all");
    whole[bytes / 2] ^= 0x55;
    fv_test_write(name[7], whole, bytes);
    free(whole);

    const struct fovea_source_ops *ops;
    struct fovea_source *source = open_uri(uri_of("kitti", top), &everything, &ops);
    struct fovea_source_counts counts;
    struct fovea_frame frame;
    static const uint64_t left[] = {0, 1, 10, 11};
    assert_int_equal(ops->info(source)->cameras[0].width, W);
    for (size_t i = 0; i < sizeof left / sizeof left[0]; i++) {
        assert_int_equal(ops->dequeue(source, INT64_MAX, &frame), FOVEA_OK);
        assert_int_equal(frame.sequence, left[i]);
        ops->counts(source, &counts); /* as of this frame, however far the reader is */
        assert_int_equal(counts.delivered, i + 1);
        assert_int_equal(counts.missing, i < 2 ? 0 : 1);
        assert_int_equal(counts.damaged, i < 2 ? 0 : 7);
        ops->requeue(source, &frame);
    }
    assert_int_equal(ops->dequeue(source, INT64_MAX, &frame), FOVEA_END);
    for (int i = 2; i < 10; i++) { /* each is named, in order */
        struct fovea_error error = {.text = ""};
        char file[32];
        assert_int_equal(ops->complaint(source, &error), FOVEA_OK);
        snprintf(file, sizeof file, "%06d.png: ", i);
        assert_non_null(strstr(error.text, file));
        if (i == 2)
            assert_non_null(strstr(error.text, "cannot be opened: No such file or directory"));
        if (i == 3) assert_non_null(strstr(error.text, "damaged PNG near byte"));
    }
    assert_int_equal(ops->complaint(source, NULL), FOVEA_AGAIN);
    ops->stop(source);
    ops->close(source);
    fv_test_folder_remove(top);
}

static enum fovea_status fetch_nothing(void *recording, uint64_t index, struct fv_slot *slot,
                                       struct fovea_error *error)
{
    (void)recording;
    (void)slot;
    return fovea_error_set(error, FOVEA_GONE,
                           "frame %04d of a folder with rather a long name: not there", (int)index);
}

static void close_missing(void *recording)
{
    (void)recording;
}

/* Thousands of missing frames: all named where somebody asks; where nobody does, the reader goes on
 * and counts. */
static void test_many_missing(void **state)
{
    (void)state;
    enum { MANY = 3000 };
    static const struct fv_recording_ops nothing = {.fetch = fetch_nothing, .close = close_missing};
    const struct fovea_source_info info = {.cameras[0] = {.width = W, .height = 1},
                                           .format = FOVEA_PIXEL_GREY8};
    for (int asked = 0; asked < 2; asked++) {
        struct fovea_source *source;
        struct fovea_error error;
        struct fovea_frame frame;
        unsigned named = 0, unnamed = 0;
        assert_int_equal(fv_player_open(&nothing, NULL, MANY, NULL, "nothing", &everything, &info,
                                        &source, &error),
                         FOVEA_OK);
        assert_int_equal(fv_player_start(source, &error), FOVEA_OK);
        while (asked && fv_player_dequeue(source, 0, &frame) == FOVEA_AGAIN)
            for (; fv_player_complaint(source, &error) == FOVEA_OK; named++)
                assert_int_equal(strtol(error.text + strlen("frame "), NULL, 10), named);
        assert_int_equal(fv_player_dequeue(source, INT64_MAX, &frame), FOVEA_END);
        for (; fv_player_complaint(source, &error) == FOVEA_OK; named++)
            if (strstr(error.text, "more frames") != NULL)
                unnamed = (unsigned)strtoul(error.text, NULL, 10) - 1;
        assert_int_equal(named + unnamed, MANY);
        assert_true(asked ? unnamed == 0 : unnamed > 0);
        fv_player_close(source);
    }
}

static int64_t now_ns(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

/* A recording whose frames come when the test lets them. */
static sem_t let_come;

static enum fovea_status fetch_when_let(void *recording, uint64_t index, struct fv_slot *slot,
                                        struct fovea_error *error)
{
    (void)recording;
    (void)error;
    while (sem_wait(&let_come) != 0)
        continue;
    memset(slot->pixels[0], (int)index, W);
    slot->frame.stamp_ns = (int64_t)index;
    slot->frame.sequence = index;
    return FOVEA_OK;
}

static void close_nothing(void *recording)
{
    (void)recording;
}

/* The second camera's images are absent in odd frames, and of the first camera's none. */
static enum fovea_status fetch_two(void *recording, uint64_t index, struct fv_slot *slot,
                                   struct fovea_error *error)
{
    (void)recording;
    (void)error;
    for (int i = 0; i < 2; i++)
        memset(slot->pixels[i], (int)(10 * index) + i, slot->capacity_bytes[i]);
    if (index % 2 == 1) slot->frame.images[1].data = NULL;
    slot->frame.stamp_ns = (int64_t)index;
    slot->frame.sequence = index;
    return FOVEA_OK;
}

/* Each frame carries the images of its rig; an absent one is empty, and the next is whole again. */
static void test_two_cameras(void **state)
{
    (void)state;
    static const struct fv_recording_ops two = {.fetch = fetch_two, .close = close_nothing};
    enum { FRAMES = 3 * FV_PLAYER_SLOTS };
    const struct fovea_source_info info = {
        .cameras = {{.width = W, .height = H}, {.width = W - 32, .height = 3 * H}},
        .format = FOVEA_PIXEL_GREY8,
        .rig.camera_count = 2};
    struct fovea_source *source = NULL;
    struct fovea_error error = {.text = ""};
    assert_int_equal(
        fv_player_open(&two, NULL, FRAMES, NULL, "two", &everything, &info, &source, &error),
        FOVEA_OK);
    assert_int_equal(fv_player_start(source, &error), FOVEA_OK);
    for (int n = 0; n < FRAMES; n++) {
        struct fovea_frame frame;
        assert_int_equal(fv_player_dequeue(source, INT64_MAX, &frame), FOVEA_OK);
        assert_int_equal(frame.image_count, 2);
        assert_int_equal(frame.images[0].data[0], 10 * n);
        assert_int_equal(fovea_image_check(&frame.images[0]), FOVEA_OK);
        if (n % 2 == 1) {
            assert_null(frame.images[1].data);
            assert_true(frame.images[1].width == 0 && frame.images[1].size_bytes == 0);
        } else {
            assert_int_equal(fovea_image_check(&frame.images[1]), FOVEA_OK);
            assert_true(frame.images[1].width == W - 32 && frame.images[1].height == 3 * H);
            assert_int_equal(frame.images[1].data[0], 10 * n + 1);
            assert_int_equal(frame.images[1].data[frame.images[1].size_bytes - 1], 10 * n + 1);
        }
        fv_player_requeue(source, &frame);
    }
    fv_player_close(source);
}

/* The loop is not kept past its deadline by a reader that is busy, and gets the frame when it is
 * there. */
static void test_deadline_passes_while_decoding(void **state)
{
    (void)state;
    static const struct fv_recording_ops slow = {.fetch = fetch_when_let, .close = close_nothing};
    const struct fovea_source_info info = {.cameras[0] = {.width = W, .height = H},
                                           .format = FOVEA_PIXEL_GREY8};
    struct fovea_source *source = NULL;
    struct fovea_error error = {.text = ""};
    struct fovea_frame frame;
    sem_init(&let_come, 0, 0);
    assert_int_equal(
        fv_player_open(&slow, NULL, 3, NULL, "slow", &everything, &info, &source, &error),
        FOVEA_OK);
    assert_int_equal(fv_player_start(source, &error), FOVEA_OK);
    assert_int_equal(fv_player_dequeue(source, 0, &frame), FOVEA_AGAIN);
    const int64_t before_ns = now_ns();
    assert_int_equal(fv_player_dequeue(source, before_ns + 20000000, &frame), FOVEA_AGAIN);
    assert_true(now_ns() - before_ns >= 20000000);
    assert_int_equal(fv_player_dequeue(source, before_ns, &frame), FOVEA_AGAIN); /* in the past */
    sem_post(&let_come);
    assert_int_equal(fv_player_dequeue(source, INT64_MAX, &frame), FOVEA_OK);
    assert_int_equal(fv_player_dequeue(source, 0, &frame), FOVEA_AGAIN);
    sem_post(&let_come);
    assert_int_equal(fv_player_dequeue(source, now_ns() + 60000000000, &frame), FOVEA_OK);
    assert_int_equal(frame.sequence, 1);
    assert_int_equal(frame.images[0].data[0], 1);
    sem_post(&let_come); /* the reader waits in fetch: let it see that it is to stop */
    fv_player_close(source);
    sem_destroy(&let_come);
}

static void test_start_again(void **state)
{
    (void)state;
    const struct fovea_source_ops *ops;
    struct fovea_source *source =
        open_uri(uri_of("images", fv_test_images(folder)), &everything, &ops);
    struct fovea_error error;
    for (int round = 0; round < 20; round++) { /* stopped after 0, 1, 2, ... frames */
        struct fovea_frame frame;
        for (uint32_t i = 0; i < (uint32_t)round && i < FV_TEST_FRAMES; i++) {
            assert_int_equal(ops->dequeue(source, INT64_MAX, &frame), FOVEA_OK);
            assert_int_equal(frame.sequence, i);
            ops->requeue(source, &frame);
            ops->requeue(source, &frame); /* twice does no harm */
        }
        ops->stop(source);
        assert_int_equal(ops->start(source, &error), FOVEA_OK);
    }
    assert_int_equal(ops->start(source, &error), FOVEA_ERROR_ARGUMENT); /* it is on */
    ops->close(source);
}

static void test_natural_order(void **state)
{
    (void)state;
    const struct fovea_source_ops *ops;
    struct fovea_source *source =
        open_uri(uri_of("images", fv_test_path(folder, "images/img*")), &everything, &ops);
    uint8_t picture[W * H];
    for (uint32_t i = 0; i < FV_TEST_FRAMES; ++i) { /* img2 before img10; even ones are PNG */
        struct fovea_frame frame;
        assert_int_equal(ops->dequeue(source, INT64_MAX, &frame), FOVEA_OK);
        fv_test_picture(i, W, H, 1, picture);
        if (i % 2 == 0)
            assert_memory_equal(frame.images[0].data + frame.images[0].stride_bytes, picture + W,
                                W);
        ops->requeue(source, &frame);
    }
    ops->close(source);
}

/* ---- text files ------------------------------------------------------------------------------ */

static void test_stamps(void **state)
{
    (void)state;
    static const struct {
        const char *text;
        int64_t ns;
    } good[] = {{"1305031102.175304", 1305031102175304000},
                {"0", 0},
                {"-1.5", -1500000000},
                {"1.0000000019", 1000000001},
                {".25", 250000000},
                {"1.037359e-01", 103735900},
                {"+3", 3000000000}};
    static const char *const bad[] = {"", "x", "1e30", "99999999999", "nan", "1.2.3"};
    int64_t ns;
    for (size_t i = 0; i < sizeof good / sizeof good[0]; i++) {
        assert_true(fv_stamp_from_seconds(good[i].text, &ns));
        assert_int_equal(ns, good[i].ns);
    }
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++)
        assert_false(fv_stamp_from_seconds(bad[i], &ns));
}

static void test_poses(void **state)
{
    (void)state;
    static const double identity[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    const char *path = fv_test_path(folder, "poses.txt");
    struct fv_poses poses;
    struct fovea_error error = {.text = ""};
    double T[12];
    /* A turn by 20 degrees about z, the second quaternion with its sign turned; then a gap. */
    fv_test_write_text(
        path,
        "# t x y z qx qy qz qw\n0.0 0 0 0 0 0 0 1\n0.1 1 2 3 0 0 -0.17364818 -0.98480775\n9 0 0 0 0 0 0 1\n");
    if (fv_poses_read(path, FV_POSES_TUM, identity, &poses, &error) != FOVEA_OK)
        fail_msg("%s", error.text);
    assert_true(fv_poses_at(&poses, 50000000, 0, T));
    assert_true(fabs(T[0] - cos(10 * 3.14159265358979 / 180)) < 1e-6 &&
                fabs(T[4] - sin(10 * 3.14159265358979 / 180)) < 1e-6);
    assert_true(fabs(T[7] - 1.0) < 1e-12);
    assert_true(fv_poses_at(&poses, 100000000, 0, T) && fv_poses_at(&poses, 9000000000, 0, T));
    assert_false(fv_poses_at(&poses, 200000000, 0, T)); /* in the gap */
    assert_false(fv_poses_at(&poses, -1, 0, T));
    assert_false(fv_poses_at(&poses, 9000000001, 0, T));
    fv_poses_free(&poses);
    static const struct {
        const char *text, *line;
    } wrong[] = {
        {"0 0 0 0 0 0 0 1\n0 0 0 0 0 0 0 1\n",
         ":2: timestamp: found '0', expected one later than on the line before"},
        {"0 0 0 0 0 0 0 2\n", ":1: rotation: found '0', expected a unit quaternion"},
        {"0 0 0 0 0 0 1\n", ":1: pose: found 6 numbers, expected 7"},
        {"0 0 nan 0 0 0 0 1\n", ":1: pose: found 'nan', expected a finite number"},
        {"zero 0 0 0 0 0 0 1\n", ":1: timestamp: found 'zero', expected seconds"},
    };
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        fv_test_write_text(path, wrong[i].text);
        assert_int_equal(fv_poses_read(path, FV_POSES_TUM, identity, &poses, &error),
                         FOVEA_ERROR_INPUT);
        assert_string_equal(error.text + strlen(path), wrong[i].line);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_png_kinds),
        cmocka_unit_test(test_jpeg_kinds),
        cmocka_unit_test(test_truncated),
        cmocka_unit_test(test_size_limits),
        cmocka_unit_test(test_pictures_and_truth),
        cmocka_unit_test(test_damage_is_counted_and_named),
        cmocka_unit_test(test_many_missing),
        cmocka_unit_test(test_two_cameras),
        cmocka_unit_test(test_deadline_passes_while_decoding),
        cmocka_unit_test(test_start_again),
        cmocka_unit_test(test_natural_order),
        cmocka_unit_test(test_stamps),
        cmocka_unit_test(test_poses),
    };
    return cmocka_run_group_tests(tests, fv_test_place_set_up, fv_test_place_tear_down);
}
