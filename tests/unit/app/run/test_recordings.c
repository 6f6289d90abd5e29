/* Recordings by command: the disk is held up and fills, as this test's own statvfs says, and the
 * loop's side runs as fast as it can. */
#include <dirent.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <cmocka.h>

#include "app/run/recordings.h"

enum { WIDTH = 160, HEIGHT = 120 };

static char folder[] = "/tmp/fovea_recordings_XXXXXX";
static int64_t free_mb = 1000;
static struct fv_settings settings;
static struct fv_recordings recordings;
static uint8_t pixels[WIDTH * HEIGHT];
static uint32_t turns;
static struct fovea *rt;
static void *block;

/* In place of libc's. */
int statvfs(const char *restrict path, struct statvfs *restrict disk)
{
    (void)path;
    memset(disk, 0, sizeof *disk);
    disk->f_frsize = 1000;
    disk->f_bavail = (fsblkcnt_t)free_mb * 1000;
    return 0;
}

static int open_all(void **state)
{
    struct fovea_error error;
    size_t bytes;
    (void)state;
    fv_settings_default(&settings);
    struct fovea_camera *camera = &settings.runtime.rig.cameras[0].camera;
    *camera = (struct fovea_camera){
        .width = WIDTH, .height = HEIGHT, .fx = 120, .fy = 120, .cx = 79.5, .cy = 59.5};
    snprintf(settings.record_folder, sizeof settings.record_folder, "%s", folder);
    if (fovea_camera_prepare(camera, &error) != FOVEA_OK ||
        fovea_size(&settings.runtime, &bytes, &error) != FOVEA_OK)
        return -1;
    block = aligned_alloc(FOVEA_BLOCK_ALIGNMENT, (bytes + 63) / 64 * 64);
    if (block == NULL || fovea_init(block, bytes, &settings.runtime, &rt, &error) != FOVEA_OK)
        return -1;
    const struct fv_recorder_setup setup = {
        .settings = &settings, .kernel_set = "c", .real_time = true, .frame_bytes = sizeof pixels};
    free_mb = 1000;
    turns = 0;
    return fv_recordings_open(&recordings, rt, &setup, 1, &error) == FOVEA_OK ? 0 : -1;
}

static int close_all(void **state)
{
    char path[400];
    (void)state;
    fv_recordings_close(&recordings);
    free(block);
    DIR *listed = opendir(folder);
    for (struct dirent *entry; listed != NULL && (entry = readdir(listed)) != NULL;) {
        snprintf(path, sizeof path, "%s/%s", folder, entry->d_name);
        (void)unlink(path);
    }
    if (listed != NULL) closedir(listed);
    return 0;
}

/* One turn of the loop. */
static void turn(void)
{
    struct fovea_frame frame = {.image_count = 1,
                                .images[0] = {.data = pixels,
                                              .width = WIDTH,
                                              .height = HEIGHT,
                                              .stride_bytes = WIDTH,
                                              .format = FOVEA_PIXEL_GREY8,
                                              .size_bytes = sizeof pixels},
                                .stamp_ns = 1000 + turns * INT64_C(50000000),
                                .sequence = turns};
    const struct fovea_inputs inputs = {.frame = &frame, .now_ns = frame.stamp_ns};
    const struct fovea_outputs outputs = {.message_count = 0};
    const struct fovea_grants grants = {.features = 0};
    turns++;
    fv_recordings_sense(&recordings, &inputs, false);
    struct fv_recorder *recorder = fv_recordings_recorder(&recordings);
    fv_recorder_step(recorder, &inputs, &outputs);
    fv_recorder_work(recorder, &inputs, &grants, &outputs);
}

static void until_ended(uint32_t number)
{
    const char *failure;
    for (int i = 0; i < 6000 && fv_recordings_ended(&recordings, &failure) < number; i++) {
        usleep(10000);
        fv_recordings_tend(&recordings);
        turn();
    }
    assert_int_equal(fv_recordings_ended(&recordings, &failure), number);
    assert_string_equal(failure, "");
}

static void begin(void)
{
    assert_null(fv_recordings_ask(&recordings, FOVEA_COMMAND_RECORD));
    fv_recordings_tend(&recordings);
}

/* The ring of the default record_buffer holds what comes while the state is being written: here
 * half as many bytes as that has, at once. */
static void frames_wait_while_the_state_is_written(void **state)
{
    const char *failure;
    (void)state;
    begin();
    turn();
    assert_true(recordings.setup.state_bytes > 120 * sizeof pixels);
    for (size_t bytes = 0; bytes < recordings.setup.state_bytes / 2; bytes += sizeof pixels)
        turn();
    assert_int_equal(atomic_load(&recordings.stage), FV_RECORDINGS_RECORDS);
    until_ended(1);
    assert_true(fv_recorder_written(recordings.recorder) > recordings.setup.state_bytes);
    assert_null(fv_recordings_ask(&recordings, FOVEA_COMMAND_RECORD_STOP));
    assert_int_equal(fv_recordings_ended(&recordings, &failure), 1);
    until_ended(2);
    assert_string_equal(fv_recordings_ask(&recordings, FOVEA_COMMAND_RECORD_STOP),
                        "found no recording to end");
}

/* A recording ends before the disk is full, and the next command says why. */
static void the_spare_room_of_the_disk_stays_free(void **state)
{
    const char *failure;
    (void)state;
    begin();
    until_ended(1);
    free_mb = 65;
    recordings.told_ns = 0; /* a second later */
    atomic_store(&recordings.news, false);
    fv_recordings_tend(&recordings);
    turn();
    fv_recordings_tend(&recordings);
    assert_int_equal(atomic_load(&recordings.stage), FV_RECORDINGS_READY);
    assert_null(recordings.recorder);
    assert_non_null(strstr(recordings.reason, folder));
    assert_non_null(strstr(recordings.reason, "found 65 MB free, expected"));
    assert_non_null(strstr(fv_recordings_ask(&recordings, FOVEA_COMMAND_RECORD_STOP),
                           "the last one ended: the disk is almost full"));
    begin(); /* refused */
    assert_int_equal(fv_recordings_ended(&recordings, &failure), 2);
    assert_non_null(strstr(failure, folder));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(frames_wait_while_the_state_is_written, open_all,
                                        close_all),
        cmocka_unit_test_setup_teardown(the_spare_room_of_the_disk_stays_free, open_all, close_all),
    };
    if (mkdtemp(folder) == NULL) return 1;
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    rmdir(folder);
    return failed;
}
