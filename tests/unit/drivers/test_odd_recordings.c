/* Recordings that are odd and yet to be played: stamps that leap, names
 * that look like patterns, a calibration that is not needed, a video backwards. */
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

enum { W = FV_TEST_WIDTH, H = FV_TEST_HEIGHT };

static char *const folder = fv_test_place;

/* ---- stamps ---------------------------------------------------------------------------------- */

/* Stamps of a recording, ended by END. */
enum { END = -1, FAR = 1000000 };

static enum fovea_status fetch_stamp(void *recording, uint64_t index, struct fv_slot *slot,
                                     struct fovea_error *error)
{
    (void)error;
    memset(slot->pixels[0], 0, W);
    slot->frame.stamp_ns = ((const int64_t *)recording)[index];
    slot->frame.sequence = index;
    return FOVEA_OK;
}

static enum fovea_status stamp(void *recording, uint64_t index, int64_t *stamp_ns)
{
    *stamp_ns = ((const int64_t *)recording)[index];
    return FOVEA_OK;
}

static void close_nothing(void *recording)
{
    (void)recording;
}

static void play_stamps(const int64_t *stamps, const struct fovea_source_selection *selection,
                        struct played *played)
{
    static const struct fv_recording_ops ops = {
        .fetch = fetch_stamp, .stamp = stamp, .close = close_nothing};
    static const struct fovea_source_ops source_ops = FV_PLAYER_OPS("stamps", "", NULL);
    const struct fovea_source_info info = {.cameras[0] = {.width = W, .height = 1},
                                           .format = FOVEA_PIXEL_GREY8};
    int64_t memory[PLAYED_MAX];
    struct fovea_source *source;
    struct fovea_error error;
    uint64_t count = 0;
    for (; stamps[count] != END; count++)
        memory[count] = stamps[count];
    assert_int_equal(
        fv_player_open(&ops, memory, count, NULL, "stamps.txt", selection, &info, &source, &error),
        FOVEA_OK);
    played_source(&source_ops, source, played);
    assert_int_equal(played->counts.delivered + played->counts.damaged, count);
}

/* A frame whose stamp leaps ahead would make the loop refuse all that follow; one that goes back or
 * repeats is the loop's, and so is a clock that was set back. */
static void test_leaping_stamps(void **state)
{
    static const struct {
        int64_t stamps[20];
        uint64_t left_out[3]; /* indices, ended by 0; frame 0 is written as 100 */
    } cases[] = {
        {{1, 2, 3, FAR, 5, 6, 7, 8, END}, {3}},
        {{1, 2, 3, FAR, 5, 6, END}, {3}},
        {{1, 2, 3, FAR, FAR + 1, 5, 6, 7, 8, 9, END}, {3, 4}},
        {{1, 2, 3, FAR, 5, 6, FAR, 8, 9, END}, {3, 6}},
        {{FAR, 2, 3, 4, 5, END}, {100}},
        {{1, 2, 3, INT64_MAX, 5, INT64_MIN, 7, 8, END}, {3}},
        {{1, 2, 3, FAR, FAR + 1, FAR + 2, FAR + 3, END}, {0}},                /* a gap */
        {{1, 2, 3, FAR, FAR + 1, 4, 5, FAR + 4, FAR + 5, FAR + 6, END}, {0}}, /* two that go back */
        {{1, 2, 3, FAR, 5, END}, {0}},                                        /* one against one */
        {{1, 2, 3, FAR, 4, 5, FAR + 1, FAR + 2, END}, {0}},                   /* two against two */
        {{1, 2, 3, FAR, END}, {0}},
        {{10, 20, 30, 40, 35, 50, 60, END}, {0}}, /* 35 goes back */
        {{10, 20, 20, 20, 30, 40, END}, {0}},
        {{10, 20, 30, 40, 5, 30, 8, 9, 50, END}, {0}}, /* 5, 30, 8 and 9 go back */
        {{10, 20, 30, 1, 2, 3, 4, 5, 6, 7, 8, 9, END},
         {100, 1, 2}}, /* begun by three of another clock */
        {{10, 20, 30, 40, 50, 60, 70, 80, 90, 91, 1, 2, 3, 4, 5, 6, 7, 8, 9, END},
         {0}}, /* set back */
        {{9, 8, 7, 6, 5, 4, 3, 2, 1, END}, {0}},
    };
    const struct fovea_source_selection everything = {.step = 1};
    struct played played;
    (void)state;
    for (size_t c = 0; c < sizeof cases / sizeof cases[0]; c++) {
        bool out[20] = {false};
        size_t at = 0;
        for (int i = 0; i < 3 && cases[c].left_out[i] != 0; i++)
            out[cases[c].left_out[i] % 100] = true;
        play_stamps(cases[c].stamps, &everything, &played);
        for (uint64_t i = 0; cases[c].stamps[i] != END; i++) {
            if (out[i]) continue;
            if (at == played.count || played.sequence[at++] != i)
                fail_msg("case %zu: frame %u is missing", c, (unsigned)i);
        }
        if (at != played.count)
            fail_msg("case %zu: %zu frames came, expected %zu", c, played.count, at);
    }
    play_stamps(cases[0].stamps, &everything, &played);
    assert_string_equal(
        played.complaint.text,
        "stamps.txt: frame 3: timestamp: found 1000000 ns, expected one before the next frames' 5 ns");
}

/* Played backwards, what leaps ahead is what lay far behind; and only frames that are played count.
 */
static void test_leaps_as_they_are_played(void **state)
{
    static const int64_t behind[] = {101, 102, 103, 4, 105, 106, 107, END},
                         ahead[] = {1, 2, 3, FAR, 5, 6, 7, 8, 9, END};
    const struct fovea_source_selection reverse = {.step = 1, .reverse = true},
                                        second = {.step = 2}, odd = {.start = 1, .step = 2};
    struct played played;
    (void)state;
    play_stamps(behind, &reverse, &played);
    assert_int_equal(played.count, 6);
    assert_int_equal(played.counts.damaged, 1);
    assert_string_equal(
        played.complaint.text,
        "stamps.txt: frame 3: timestamp: found 4 ns, expected one before the next frames' 103 ns");
    for (size_t i = 1; i < played.count; i++)
        assert_true(played.stamp_ns[i] > played.stamp_ns[i - 1]);
    assert_true(played.stamp_ns[0] == 101 && played.stamp_ns[5] == 107);
    play_stamps(ahead, &reverse, &played); /* goes back: the loop's */
    assert_int_equal(played.count, 9);
    const struct fovea_source_info info = {.cameras[0] = {.width = W, .height = 1},
                                           .format = FOVEA_PIXEL_GREY8};
    static const struct fv_recording_ops ops = {
        .fetch = fetch_stamp, .stamp = stamp, .close = close_nothing};
    static const struct fovea_source_ops source_ops = FV_PLAYER_OPS("stamps", "", NULL);
    int64_t memory[9];
    struct fovea_source *source;
    struct fovea_error error;
    memcpy(memory, ahead, sizeof memory);
    assert_int_equal(fv_player_open(&ops, memory, 9, NULL, "x", &second, &info, &source, &error),
                     FOVEA_OK);
    played_source(&source_ops, source, &played);
    assert_int_equal(played.count, 5);
    assert_int_equal(fv_player_open(&ops, memory, 9, NULL, "x", &odd, &info, &source, &error),
                     FOVEA_OK);
    played_source(&source_ops, source, &played);
    assert_int_equal(played.count, 3);
    assert_int_equal(played.counts.damaged, 1);
}

/* ---- names ----------------------------------------------------------------------------------- */

/* Folders and files are themselves, whatever is in their names and whatever else those would fit.
 */
static void test_names_that_look_like_patterns(void **state)
{
    static const char *const names[] = {"run [1]", "a*b", "what?", "back\\slash", "all of *[?]\\"};
    struct played played;
    (void)state;
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
        char from[FV_TEST_PATH_BYTES], to[FV_TEST_PATH_BYTES], file[FV_TEST_PATH_BYTES];
        snprintf(from, sizeof from, "%s", fv_test_images(folder));
        char *pattern = strrchr(from, '/');
        assert_non_null(pattern);
        if (strchr(pattern, '*') != NULL) *pattern = '\0'; /* its folder */
        snprintf(to, sizeof to, "%s", fv_test_path(folder, names[i]));
        assert_int_equal(rename(from, to), 0);
        played_fine("images", to, &played);
        assert_int_equal(played.count, FV_TEST_FRAMES);
        static const char *const odd[] = {"[0-9]?*.png", "[0-9]x*.png", "[0-9]?x.png", "1?*.png"};
        for (size_t k = 0; k < sizeof odd / sizeof odd[0]; k++) {
            char name[16];
            snprintf(name, sizeof name, "img%zu.png", 2 * k);
            assert_int_equal(rename(fv_test_path(to, name), fv_test_path(to, odd[k])), 0);
        }
        snprintf(file, sizeof file, "%s", fv_test_path(to, odd[0]));
        played_fine("images", file, &played);
        assert_int_equal(played.count, 1);
        fv_test_folder_remove(to);
    }
}

/* Frames of a KITTI sequence may be JPEG files, and the first of them missing. */
static void test_first_frame_missing(void **state)
{
    struct played played;
    char top[FV_TEST_PATH_BYTES];
    (void)state;
    snprintf(top, sizeof top, "%s", fv_test_kitti(folder));
    for (int i = 0; i < FV_TEST_FRAMES; i++) { /* the first bytes say what a file holds */
        char from[64], to[64];
        snprintf(from, sizeof from, "image_0/%06d.png", i);
        snprintf(to, sizeof to, "image_0/%06d.jpg", i);
        assert_int_equal(rename(fv_test_path(top, from), fv_test_path(top, to)), 0);
    }
    assert_int_equal(unlink(fv_test_path(top, "image_0/000000.jpg")), 0);
    played_fine("kitti", top, &played);
    assert_int_equal(played.count, FV_TEST_FRAMES - 1);
    assert_int_equal(played.counts.missing, 1);
    assert_non_null(strstr(played.complaint.text, "000000.jpg: cannot be opened"));
    fv_test_folder_remove(top);
}

/* As the benchmark's own archives are laid out: sequences/07, and its poses in poses/07.txt. */
static void test_kitti_poses_beside_the_sequences(void **state)
{
    static const char *const ways[] = {"archive/sequences/07", "archive/sequences/07/",
                                       "archive/poses/../sequences/07", "archive/others/07"};
    const struct fovea_source_selection everything = {.step = 1};
    char top[FV_TEST_PATH_BYTES], from[FV_TEST_PATH_BYTES];
    (void)state;
    fv_test_make_folder(fv_test_path(folder, "archive/sequences"));
    fv_test_make_folder(fv_test_path(folder, "archive/poses"));
    snprintf(from, sizeof from, "%s", fv_test_kitti(folder));
    assert_int_equal(rename(from, fv_test_path(folder, ways[0])), 0);
    snprintf(from, sizeof from, "%s", fv_test_path(folder, "archive/sequences/07/poses.txt"));
    assert_int_equal(rename(from, fv_test_path(folder, "archive/poses/07.txt")), 0);
    for (size_t i = 0; i < sizeof ways / sizeof ways[0]; i++) {
        struct fovea_source *source;
        struct fovea_error error;
        const bool last =
            i + 1 == sizeof ways / sizeof ways[0]; /* not where the archives have it */
        if (last)
            assert_int_equal(rename(fv_test_path(folder, "archive/sequences"),
                                    fv_test_path(folder, "archive/others")),
                             0);
        assert_int_equal(
            fv_source_kitti.open(fv_test_path(folder, ways[i]), &everything, &source, &error),
            FOVEA_OK);
        assert_true(fv_source_kitti.info(source)->has_truth == !last);
        fv_source_kitti.close(source);
    }
    snprintf(top, sizeof top, "%s", fv_test_path(folder, "archive"));
    fv_test_folder_remove(top);
}

/* ---- videos ---------------------------------------------------------------------------------- */

/* In reverse a video is read in stretches, of which this one has several; the same frames come, to
 * the last bit. */
static void test_video_in_reverse(void **state)
{
    enum { FRAMES = 150 };
    static const struct fovea_source_selection reverse[] = {
        {.step = 1, .reverse = true},
        {.start = 3, .step = 2, .reverse = true},
        {.start = 20, .step = 7, .frames = 5, .reverse = true},
        {.start = 149, .step = 500, .reverse = true}};
    const struct fovea_source_selection everything = {.step = 1},
                                        late = {.start = FRAMES, .step = 1},
                                        late_reverse = {
                                            .start = FRAMES, .step = 1, .reverse = true};
    static struct played all, played;
    struct fovea_error error;
    char path[FV_TEST_PATH_BYTES];
    (void)state;
    snprintf(path, sizeof path, "%s", fv_test_long_video(folder, FRAMES));
    if (played_uri("video", path, &everything, &all, &error) == FOVEA_ERROR_UNSUPPORTED) {
        print_message("SKIPPED videos: %s\n", error.text);
        return;
    }
    assert_int_equal(all.count, FRAMES);
    for (size_t c = 0; c < sizeof reverse / sizeof reverse[0]; c++) {
        const struct fovea_source_selection *s = &reverse[c];
        const uint64_t left = (FRAMES - s->start - 1) / s->step + 1,
                       count = s->frames > 0 ? s->frames : left;
        assert_int_equal(played_uri("video", path, s, &played, &error), FOVEA_OK);
        assert_int_equal(played.count, count);
        for (size_t i = 0; i < count; i++) {
            const uint64_t index = s->start + (count - 1 - i) * s->step;
            assert_int_equal(played.sequence[i], index);
            assert_int_equal(played.picture[i], all.picture[index]);
            assert_true(i == 0 || played.stamp_ns[i] > played.stamp_ns[i - 1]);
        }
    }
    assert_int_equal(played_uri("video", path, &late, &played, &error), FOVEA_ERROR_ARGUMENT);
    assert_non_null(strstr(error.text, "start: found 150, expected less than its 150 frames"));
    assert_int_equal(played_uri("video", path, &late_reverse, &played, &error),
                     FOVEA_ERROR_ARGUMENT);
}

/* ---- text ------------------------------------------------------------------------------------ */

/* The mark with which some editors begin UTF-8 stands before a comment, or before the first stamp.
 */
static void test_byte_order_mark(void **state)
{
    struct played played;
    char top[FV_TEST_PATH_BYTES], text[9000];
    size_t bytes;
    (void)state;
    snprintf(top, sizeof top, "%s", fv_test_tum(folder));
    const char *path = fv_test_path(top, "rgb.txt");
    char *list = fv_test_read(path, &bytes);
    const char *stamps = strstr(list, "\n1305");
    assert_non_null(stamps);
    for (int comment = 0; comment < 2; comment++) {
        snprintf(text, sizeof text, "\xef\xbb\xbf%s", comment ? list : stamps + 1);
        fv_test_write_text(path, text);
        played_fine("tum", top, &played);
        assert_int_equal(played.count, FV_TEST_FRAMES);
    }
    free(list);
    fv_test_folder_remove(top);
}

/* Where the caller has a calibration, one of the recording's that cannot be read is no obstacle. */
static void test_own_calibration_not_needed(void **state)
{
    static const struct {
        const char *scheme, *file;
        const char *(*make)(const char *);
        const char *wrong;
    } sets[] = {{"euroc", "mav0/cam0/sensor.yaml", fv_test_euroc, "P0: no\n"},
                {"tum", "camera.yaml", fv_test_tum, "P0: no\n"},
                {"kitti", "calib.txt", fv_test_kitti, "P0: no\n"},
                {"kitti", "calib.txt", fv_test_kitti, "P0: 90 0 5000 0 0 90 32 0 0 0 1 0\n"}};
    const struct fovea_source_selection alone = {.step = 1},
                                        given = {.step = 1, .camera_given = true};
    (void)state;
    for (size_t i = 0; i < sizeof sets / sizeof sets[0]; i++) {
        struct played played;
        struct fovea_error error;
        char top[FV_TEST_PATH_BYTES];
        snprintf(top, sizeof top, "%s", sets[i].make(folder));
        assert_int_equal(played_uri(sets[i].scheme, top, &given, &played, &error), FOVEA_OK);
        assert_true(played.has_camera && played.camera.width == W &&
                    played.camera.field_max_rad > 0);
        fv_test_write_text(fv_test_path(top, sets[i].file), sets[i].wrong);
        assert_int_equal(played_uri(sets[i].scheme, top, &alone, &played, &error),
                         FOVEA_ERROR_INPUT);
        assert_non_null(strstr(error.text, sets[i].file));
        assert_int_equal(played_uri(sets[i].scheme, top, &given, &played, &error), FOVEA_OK);
        assert_int_equal(played.count, FV_TEST_FRAMES);
        assert_false(played.has_camera);
        fv_test_folder_remove(top);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_leaping_stamps),
        cmocka_unit_test(test_leaps_as_they_are_played),
        cmocka_unit_test(test_names_that_look_like_patterns),
        cmocka_unit_test(test_first_frame_missing),
        cmocka_unit_test(test_kitti_poses_beside_the_sequences),
        cmocka_unit_test(test_video_in_reverse),
        cmocka_unit_test(test_byte_order_mark),
        cmocka_unit_test(test_own_calibration_not_needed),
    };
    return cmocka_run_group_tests(tests, fv_test_place_set_up, fv_test_place_tear_down);
}
