/* What every source must do, held against every driver of the table. A driver without a row here
 * fails. Recordings are written by the test; those of $FOVEA_DATA are played too where they are. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "common/datasets.h"
#include "common/fake_camera.h"
#include "drivers/table.h"
#include "fovea/source.h"

/* ---- heap calls of one thread, and pieces not given back ------------------------------------- */

static _Thread_local volatile unsigned long *watched_calls;

#ifndef FOVEA_SANITIZED
static _Atomic long pieces;
void *__libc_malloc(size_t bytes);
void *__libc_calloc(size_t count, size_t bytes);
void *__libc_realloc(void *old, size_t bytes);
void *__libc_memalign(size_t alignment, size_t bytes);
void __libc_free(void *memory);
static const bool can_watch = true;

static void *note(void *piece)
{
    if (watched_calls != NULL) *watched_calls += 1;
    if (piece != NULL) atomic_fetch_add_explicit(&pieces, 1, memory_order_relaxed);
    return piece;
}

void *malloc(size_t bytes)
{
    return note(__libc_malloc(bytes));
}

void *calloc(size_t count, size_t bytes)
{
    return note(__libc_calloc(count, bytes));
}

void *realloc(void *old, size_t bytes)
{
    if (old != NULL) atomic_fetch_sub_explicit(&pieces, 1, memory_order_relaxed);
    return note(__libc_realloc(old, bytes));
}

int posix_memalign(void **piece, size_t alignment, size_t bytes)
{
    *piece = note(__libc_memalign(alignment, bytes));
    return *piece == NULL;
}

void *aligned_alloc(size_t alignment, size_t bytes)
{
    return note(__libc_memalign(alignment, bytes));
}

void free(void *memory)
{
    if (watched_calls != NULL) *watched_calls += 1;
    if (memory != NULL) atomic_fetch_sub_explicit(&pieces, 1, memory_order_relaxed);
    __libc_free(memory);
}

static long pieces_now(void)
{
    return atomic_load(&pieces);
}
#else
static const bool can_watch = false;
static long pieces_now(void)
{
    return 0;
}
#endif

/* ---- the drivers ----------------------------------------------------------------------------- */

static char folder[FV_TEST_PATH_BYTES];

struct row {
    const char *name;
    const char *(*make)(const char *folder); /* writes the recording; NULL: `address` stands */
    const char *address;
    bool live;            /* stamps are of the clock; only a number of frames can be chosen */
    bool in_order_only;   /* cannot be played in reverse as a whole, finds out its end on the way */
    bool length_unknown;  /* before it has been played */
    const char *wrong[4]; /* addresses that must be refused */
    char made[FV_TEST_PATH_BYTES];
};

static struct row rows[] = {
    {.name = "sim",
     .address = "orbit?width=96&height=64",
     .wrong = {"orbits", "orbit?widht=3", "orbit?width=x"}},
    {.name = "euroc", .make = fv_test_euroc, .wrong = {"/nonexistent", "/", ""}},
    {.name = "tum", .make = fv_test_tum, .wrong = {"/nonexistent", "/", ""}},
    {.name = "kitti", .make = fv_test_kitti, .wrong = {"/nonexistent", "/", ""}},
    {.name = "images",
     .make = fv_test_images,
     .wrong = {"/nonexistent/*.png", "/", "", "/dev/null"}},
    {.name = "lcmlog", .make = fv_test_lcmlog, .wrong = {"/nonexistent", "/", "", "/dev/null"}},
    {.name = "video",
     .make = fv_test_video,
     .length_unknown = true,
     .wrong = {"/nonexistent", "/", "", "/dev/null"}},
    {.name = "pair",
     .address = "sim:orbit?width=96&height=64 and sim:orbit?width=64&height=80",
     .wrong = {"", "sim:", "sim: and ", "sim: and sim: within 0"}},
    {.name = "sequence",
     .address =
         "sim:orbit?width=96&height=64&frames=5 then sim:orbit?width=96&height=64&fov=70&frames=40[start=9,step=2,frames=16,reverse]",
     .in_order_only = true,
     .length_unknown = true,
     .wrong = {"", "sim:orbit then ", "sim:orbit[steps=2]", "sequence:sim:"}},
    {.name = "fault", /* in each selection the same pictures are spoilt, in the same way */
     .address = "sim:orbit?width=96&height=64?kind=black,noise,blur&first=3&shortest=2&longest=4",
     .wrong = {"sim:orbit?width=96&height=64", "sim:orbit?kind=blue", "sim:orbits?kind=blur",
               "sim:orbit?kind=blur&longest=2"}},
    {.name = "libcamera",
     .live = true,
     .address = "0",
     .wrong = {"", "0?widht=3", "no such camera"}},
    {.name = "v4l2", /* the fake device, set up below */
     .live = true,
     .address = "/dev/video0?format=GREY",
     .wrong = {"/dev/video9", "video0", "/dev/video0?widht=3", "/dev/video0?control.gain=1000"}},
};

static struct row *row_of(const struct fovea_source_ops *ops)
{
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++)
        if (strcmp(rows[i].name, ops->name) == 0) return &rows[i];
    fail_msg("driver '%s' has no row in this test: add one", ops->name);
    return NULL;
}

static const struct fovea_source_selection everything = {.step = 1};
static const struct fovea_source_selection some = {.step = 1, .frames = FV_TEST_FRAMES};

static struct fovea_source *open_with(const struct fovea_source_ops *ops,
                                      const struct fovea_source_selection *selection)
{
    struct fovea_source *source = NULL;
    struct fovea_error error = {.text = ""};
    if (ops->open(row_of(ops)->address, selection, &source, &error) != FOVEA_OK)
        fail_msg("%s:%s: %s", ops->name, row_of(ops)->address, error.text);
    return source;
}

static void start(const struct fovea_source_ops *ops, struct fovea_source *source)
{
    struct fovea_error error = {.text = ""};
    if (ops->start(source, &error) != FOVEA_OK) fail_msg("%s: %s", ops->name, error.text);
}

/* Drivers to be tested: all but those whose plug-in is not built, and libcamera where it finds no
 * camera (it has its tests in the virtual machine, tests/hil). */
static const struct fovea_source_ops *next_driver(size_t *i)
{
    while (fv_source_table[*i] != NULL) {
        const struct fovea_source_ops *ops = fv_source_table[(*i)++];
        const bool camera = strcmp(ops->name, "libcamera") == 0;
        struct fovea_source *source;
        struct fovea_error error;
        if (strcmp(ops->name, "video") != 0 && !camera) return ops;
        static bool tried[2], usable[2];
        if (!tried[camera]) {
            const enum fovea_status status =
                ops->open(row_of(ops)->address, &everything, &source, &error);
            if (status == FOVEA_OK) ops->close(source);
            usable[camera] = status != FOVEA_ERROR_UNSUPPORTED && !(camera && status < 0);
            if (!usable[camera]) print_message("SKIPPED %s: %s\n", ops->name, error.text);
            tried[camera] = true;
        }
        if (usable[camera]) return ops;
    }
    return NULL;
}

static int64_t now_ns(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

static uint64_t hash_image(const struct fovea_image *image)
{
    uint64_t hash = 0xcbf29ce484222325u;
    const int32_t row_bytes = fovea_image_stride_min(image->format, image->width);
    for (int32_t y = 0; y < image->height; y++)
        for (int32_t x = 0; x < row_bytes; x++)
            hash = (hash ^ image->data[(size_t)y * (size_t)image->stride_bytes + (size_t)x]) *
                   0x100000001b3u;
    return hash;
}

struct played {
    size_t count;
    struct {
        uint64_t hash, sequence;
        int64_t stamp_ns;
        bool has_pose;
        double x_m;
    } frames[64];
};

/* Play to the end, or until 64 frames; heap calls made meanwhile are added to `calls`. */
static void play(const struct fovea_source_ops *ops, struct fovea_source *source,
                 struct played *played, volatile unsigned long *calls)
{
    static struct fovea_truth truth;
    double pose_alone[12];
    struct fovea_frame frame;
    struct fovea_source_counts counts;
    enum fovea_status status = FOVEA_AGAIN;
    memset(played, 0, sizeof *played); /* compared as a whole */
    for (int64_t end_ns = now_ns() + 120000000000; played->count < 64 && now_ns() < end_ns;) {
        watched_calls = calls;
        status = ops->dequeue(source, now_ns() + 1000000000, &frame);
        bool has_pose = false;
        if (status == FOVEA_OK && ops->truth != NULL && ops->info(source)->has_truth)
            has_pose = ops->truth(source, &frame, &truth) == FOVEA_OK && truth.has_pose;
        bool has_pose_alone = status == FOVEA_OK && ops->truth_pose != NULL &&
                              ops->truth_pose(source, &frame, pose_alone) == FOVEA_OK;
        if (ops->counts != NULL) ops->counts(source, &counts);
        watched_calls = NULL;
        if (status == FOVEA_AGAIN) continue;
        if (status != FOVEA_OK) break;
        assert_int_equal(has_pose_alone, has_pose);
        if (has_pose) assert_memory_equal(pose_alone, truth.T_world_cam, sizeof pose_alone);
        assert_int_equal(fovea_image_check(&frame.images[0]), FOVEA_OK);
        assert_int_equal(frame.images[0].width, ops->info(source)->cameras[0].width);
        assert_int_equal(frame.images[0].height, ops->info(source)->cameras[0].height);
        assert_int_equal(frame.images[0].format, ops->info(source)->format);
        const size_t i = played->count++;
        played->frames[i].hash = hash_image(&frame.images[0]);
        played->frames[i].sequence = frame.sequence;
        played->frames[i].stamp_ns = frame.stamp_ns;
        played->frames[i].has_pose = has_pose;
        played->frames[i].x_m = has_pose ? truth.T_world_cam[3] : 0.0;
        if (i > 0) assert_true(frame.stamp_ns > played->frames[i - 1].stamp_ns);
        watched_calls = calls;
        ops->requeue(source, &frame);
        watched_calls = NULL;
    }
    assert_true(status == FOVEA_OK || status == FOVEA_END);
    if (ops->counts != NULL) assert_int_equal(counts.delivered, played->count);
}

static void play_again(const struct fovea_source_ops *ops,
                       const struct fovea_source_selection *selection, struct played *played)
{
    struct fovea_source *source = open_with(ops, selection);
    start(ops, source);
    play(ops, source, played, NULL);
    ops->stop(source);
    ops->close(source);
    if (row_of(ops)->live)
        for (size_t i = 0; i < played->count; i++)
            played->frames[i].stamp_ns = 0; /* another time each time */
}

/* ---- tests ----------------------------------------------------------------------------------- */

static void test_table(void **state)
{
    (void)state;
    const struct fovea_source_ops *ops = NULL;
    const char *address = NULL;
    struct fovea_error error;
    for (size_t i = 0; fv_source_table[i] != NULL; i++) {
        const struct fovea_source_ops *each = fv_source_table[i];
        char uri[64];
        assert_true(each->open && each->info && each->start && each->dequeue && each->requeue &&
                    each->stop && each->close);
        assert_true(each->help != NULL && strchr(each->help, '\n') == NULL);
        snprintf(uri, sizeof uri, "%s:a:b", each->name);
        assert_int_equal(fv_source_find(uri, &ops, &address, &error), FOVEA_OK);
        assert_ptr_equal(ops, each);
        assert_string_equal(address, "a:b");
        assert_non_null(row_of(each));
    }
    ops = NULL;
    assert_int_equal(fv_source_find("euorc:x", &ops, &address, &error), FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "did you mean euroc:?"));
    assert_int_equal(fv_source_find("euroc", &ops, &address, &error), FOVEA_ERROR_INPUT);
    assert_int_equal(fv_source_find("", &ops, &address, &error), FOVEA_ERROR_INPUT);
    assert_null(ops);
}

static void test_wrong_addresses(void **state)
{
    (void)state;
    size_t i = 0;
    for (const struct fovea_source_ops *ops; (ops = next_driver(&i)) != NULL;) {
        for (size_t j = 0; j < 4 && row_of(ops)->wrong[j] != NULL; j++) {
            struct fovea_source *source = NULL;
            struct fovea_error error = {.text = ""};
            const enum fovea_status status =
                ops->open(row_of(ops)->wrong[j], &everything, &source, &error);
            if (status >= 0) fail_msg("%s:%s was opened", ops->name, row_of(ops)->wrong[j]);
            assert_null(source);
            assert_int_equal(error.status, status);
            assert_true(strlen(error.text) > 10 && strchr(error.text, '\n') == NULL);
        }
    }
}

static void test_info(void **state)
{
    (void)state;
    size_t i = 0;
    for (const struct fovea_source_ops *ops; (ops = next_driver(&i)) != NULL;) {
        struct fovea_source *source = open_with(ops, &some);
        const struct fovea_source_info *info = ops->info(source);
        assert_true(info->cameras[0].width >= FOVEA_IMAGE_WIDTH_MIN &&
                    info->cameras[0].width <= FOVEA_IMAGE_WIDTH_MAX);
        assert_true(info->cameras[0].height >= FOVEA_IMAGE_HEIGHT_MIN &&
                    info->cameras[0].height <= FOVEA_IMAGE_HEIGHT_MAX);
        assert_true(info->format < FOVEA_PIXEL_FORMAT_COUNT);
        assert_true(info->rate_hz > 0 && info->rate_hz < 1000);
        assert_true(info->heap_bytes > 0);
        if (!row_of(ops)->length_unknown) assert_int_equal(info->frame_count, FV_TEST_FRAMES);
        if (info->rig.cameras[0].calibrated) {
            assert_int_equal(info->rig.cameras[0].camera.width, info->cameras[0].width);
            assert_int_equal(info->rig.cameras[0].camera.height, info->cameras[0].height);
            assert_true(info->rig.cameras[0].camera.fx > 0 &&
                        info->rig.cameras[0].camera.field_max_rad > 0);
            assert_true(info->cameras[0].origin[0] != '\0');
        }
        ops->close(source);
    }
}

static void test_play_without_heap(void **state)
{
    (void)state;
    size_t i = 0;
    for (const struct fovea_source_ops *ops; (ops = next_driver(&i)) != NULL;) {
        struct played first, second;
        struct fovea_frame frame;
        volatile unsigned long calls = 0;
        struct fovea_source *source = open_with(ops, &some);
        assert_int_equal(ops->dequeue(source, 0, &frame), FOVEA_END); /* not started */
        start(ops, source);
        play(ops, source, &first, &calls);
        assert_int_equal(first.count, FV_TEST_FRAMES);
        assert_int_equal(ops->dequeue(source, INT64_MAX, &frame), FOVEA_END); /* and stays so */
        assert_int_equal(ops->dequeue(source, 0, &frame), FOVEA_END);
        if (ops->state != NULL) assert_int_equal(ops->state(source), FOVEA_SOURCE_ENDED);
        ops->stop(source);
        ops->close(source);
        if (can_watch && calls != 0)
            fail_msg("%s: %lu heap calls on the loop thread", ops->name, calls);
        play_again(ops, &some, &second);
        for (size_t j = 0; j < first.count && row_of(ops)->live; j++)
            first.frames[j].stamp_ns = 0;
        assert_memory_equal(&first, &second,
                            sizeof first.count + first.count * sizeof first.frames[0]);
    }
}

static void test_heap_watch_sees(void **state)
{
    (void)state;
    volatile unsigned long calls = 0;
    if (!can_watch) skip();
    void *(*volatile allocate)(size_t) =
        malloc; /* by address, so that the compiler does not know what it calls */
    void (*volatile give_back)(void *) = free;
    watched_calls = &calls;
    give_back(allocate(16));
    watched_calls = NULL;
    assert_true(calls >= 2);
}

/* As many frames as the selection asks for, and no more. */
static void check_hold_limit(uint32_t asked, int limit)
{
    struct fovea_source_selection selection = some;
    size_t i = 0;
    selection.frames_held = asked;
    for (const struct fovea_source_ops *ops; (ops = next_driver(&i)) != NULL;) {
        struct fovea_source *source = open_with(ops, &selection);
        struct fovea_frame held[FOVEA_SOURCE_FRAMES_HELD_MAX], more;
        start(ops, source);
        for (int j = 0; j < limit; j++)
            assert_int_equal(ops->dequeue(source, INT64_MAX, &held[j]), FOVEA_OK);
        const int64_t before_ns = now_ns();
        assert_int_equal(ops->dequeue(source, INT64_MAX, &more),
                         FOVEA_AGAIN); /* at once, whatever the deadline */
        assert_true(now_ns() - before_ns < 60000000000);
        const uint64_t hash = hash_image(&held[0].images[0]);
        for (int j = 0; j < FV_TEST_FRAMES - limit; j++) { /* the rest goes through one place */
            ops->requeue(source, &held[limit - 1]);
            assert_int_equal(ops->dequeue(source, INT64_MAX, &held[limit - 1]), FOVEA_OK);
        }
        assert_true(hash == hash_image(&held[0].images[0])); /* untouched while held */
        for (int j = 0; j < limit; j++)
            ops->requeue(source, &held[j]);
        assert_int_equal(ops->dequeue(source, INT64_MAX, &more), FOVEA_END);
        ops->stop(source);
        ops->close(source);
    }
}

static void test_hold_limit(void **state)
{
    (void)state;
    check_hold_limit(0, FOVEA_SOURCE_FRAMES_HELD);
    check_hold_limit(FOVEA_SOURCE_FRAMES_HELD + 1, FOVEA_SOURCE_FRAMES_HELD + 1);
    check_hold_limit(1000, FOVEA_SOURCE_FRAMES_HELD_MAX);
}

static void test_deadlines(void **state)
{
    (void)state;
    size_t i = 0;
    for (const struct fovea_source_ops *ops; (ops = next_driver(&i)) != NULL;) {
        struct fovea_source *source = open_with(ops, &some);
        struct fovea_frame frame;
        start(ops, source);
        for (int j = 0; j < FV_TEST_FRAMES; j++) {
            const int64_t before_ns = now_ns();
            const enum fovea_status status =
                ops->dequeue(source, j % 2 == 0 ? 0 : before_ns + 2000000, &frame);
            assert_true(now_ns() - before_ns <
                        60000000000); /* a busy machine may hold the thread up */
            assert_true(status == FOVEA_OK || status == FOVEA_AGAIN);
            if (status == FOVEA_OK) ops->requeue(source, &frame);
        }
        ops->stop(source); /* in the middle */
        ops->close(source);
    }
}

static void test_selection(void **state)
{
    (void)state;
    size_t i = 0;
    for (const struct fovea_source_ops *ops; (ops = next_driver(&i)) != NULL;) {
        const struct fovea_source_selection third = {.start = 1, .step = 3, .frames = 3};
        const struct fovea_source_selection turned = {
            .start = 1, .step = 3, .frames = 3, .reverse = true};
        const struct fovea_source_selection none = {.step = 0};
        struct fovea_source *source = NULL;
        struct fovea_error error = {.text = ""};
        struct played all, chosen;
        assert_true(ops->open(row_of(ops)->address, &none, &source, &error) < 0);
        assert_true(strlen(error.text) > 0);
        if (row_of(ops)->live) {
            assert_int_equal(ops->open(row_of(ops)->address, &third, &source, &error),
                             FOVEA_ERROR_ARGUMENT);
            const struct fovea_source_selection reversed = {
                .step = 1, .frames = 3, .reverse = true};
            assert_int_equal(ops->open(row_of(ops)->address, &reversed, &source, &error),
                             FOVEA_ERROR_UNSUPPORTED);
            continue;
        }
        play_again(ops, &some, &all);
        play_again(ops, &third, &chosen);
        assert_int_equal(chosen.count, 3);
        for (size_t j = 0; j < 3; j++)
            assert_true(chosen.frames[j].hash == all.frames[1 + 3 * j].hash);
        if (row_of(ops)->in_order_only) {
            assert_int_equal(ops->open(row_of(ops)->address, &turned, &source, &error),
                             FOVEA_ERROR_UNSUPPORTED);
            continue;
        }
        play_again(ops, &turned, &chosen);
        assert_int_equal(chosen.count, 3);
        for (size_t j = 0; j < 3; j++) {
            assert_true(chosen.frames[j].hash == all.frames[7 - 3 * j].hash);
            assert_int_equal(chosen.frames[j].has_pose, all.frames[7 - 3 * j].has_pose);
            assert_true(chosen.frames[j].x_m ==
                        all.frames[7 - 3 * j].x_m); /* truth goes with the picture */
        }
    }
}

static void test_start_past_the_end(void **state)
{
    (void)state;
    size_t i = 0;
    for (const struct fovea_source_ops *ops; (ops = next_driver(&i)) != NULL;) {
        const struct fovea_source_selection late = {.start = 1000000, .step = 1, .frames = 1};
        struct fovea_source *source = NULL;
        struct fovea_error error = {.text = ""};
        if (row_of(ops)->make == NULL || row_of(ops)->in_order_only)
            continue; /* endless, or finds out on the way */
        assert_int_equal(ops->open(row_of(ops)->address, &late, &source, &error),
                         FOVEA_ERROR_ARGUMENT);
        assert_non_null(strstr(error.text, "start: found 1000000"));
    }
}

static void test_no_leaks(void **state)
{
    (void)state;
    size_t i = 0;
    for (const struct fovea_source_ops *ops; (ops = next_driver(&i)) != NULL;) {
        long before = 0;
        struct played played;
        struct fovea_source *source = NULL;
        struct fovea_error error;
        for (int round = 0; round < 6; round++) {
            if (round == 2) before = pieces_now(); /* libraries have set themselves up by then */
            play_again(ops, &some, &played);
            source = open_with(ops, &some); /* never started */
            ops->close(source);
            source = open_with(ops, &some); /* closed without a stop, frames held */
            start(ops, source);
            struct fovea_frame frame;
            assert_int_equal(ops->dequeue(source, INT64_MAX, &frame), FOVEA_OK);
            ops->stop(source);
            ops->close(source);
            for (size_t j = 0; j < 4 && row_of(ops)->wrong[j] != NULL; j++)
                assert_true(ops->open(row_of(ops)->wrong[j], &everything, &source, &error) < 0);
        }
        if (pieces_now() != before)
            fail_msg("%s: %ld pieces of heap lost", ops->name, pieces_now() - before);
    }
}

static int make_recordings(void **state)
{
    (void)state;
    fv_test_folder(folder);
    fake_begin();
    struct fake_camera *camera = fake_new();
    camera->rate_hz = 0;
    fake_plug(camera, "/dev/video0");
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        if (rows[i].make == NULL) continue;
        snprintf(rows[i].made, sizeof rows[i].made, "%s", rows[i].make(folder));
        rows[i].address = rows[i].made;
    }
    return 0;
}

static int remove_recordings(void **state)
{
    (void)state;
    fake_end();
    fv_test_folder_remove(folder);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_table),
        cmocka_unit_test(test_wrong_addresses),
        cmocka_unit_test(test_info),
        cmocka_unit_test(test_play_without_heap),
        cmocka_unit_test(test_heap_watch_sees),
        cmocka_unit_test(test_hold_limit),
        cmocka_unit_test(test_deadlines),
        cmocka_unit_test(test_selection),
        cmocka_unit_test(test_start_past_the_end),
        cmocka_unit_test(test_no_leaks),
    };
    return cmocka_run_group_tests(tests, make_recordings, remove_recordings);
}
