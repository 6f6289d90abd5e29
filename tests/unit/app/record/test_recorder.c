/* Recording: what is read back is what went in; a full, limited or slow disk ends the recording and
 * nothing else. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include <cmocka.h>
#include <lcm/lcm.h>

#include "app/record/recorder.h"
#include "app/record/recording_end.h"
#include "app/record/recording_header.h"
#include "support/lcmlog.h"
#include "message/recorded.h"
#include "runtime/lockstep.h"

enum { WIDTH = 640, HEIGHT = 480, IMAGE_BYTES = WIDTH * HEIGHT, WIDTH2 = 320, HEIGHT2 = 200 };

static uint8_t pixels[IMAGE_BYTES], mask[IMAGE_BYTES], mask2[WIDTH2 * HEIGHT2];
static char folder[] = "/tmp/fovea-test-XXXXXX";
static char path[96];
static bool masked = true;

static void make_settings(struct fv_settings *settings)
{
    fv_settings_default(settings);
    struct fovea_camera camera = {.width = WIDTH,
                                  .height = HEIGHT,
                                  .lens = FOVEA_LENS_RADTAN,
                                  .fx = 458.654,
                                  .fy = 457.296,
                                  .cx = 367.215,
                                  .cy = 248.375,
                                  .k = {-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05}};
    assert_int_equal(fovea_camera_prepare(&camera, NULL), FOVEA_OK);
    settings->runtime.rig.cameras[0].camera = camera;
    settings->runtime.rig.cameras[0].mask = masked ? mask : NULL;
    settings->runtime.seed = 1234567890123456789u;
    settings->runtime.rig.cameras[0].T_body_cam[3] = 0.1;
    settings->runtime.preview.level = 0;
    snprintf(settings->runtime.channel_prefix, sizeof settings->runtime.channel_prefix,
             "ROBOT/LEFT");
    for (int i = 0; i < IMAGE_BYTES; i++)
        mask[i] = i % 3 == 0;
    for (int i = 0; i < WIDTH2 * HEIGHT2; i++)
        mask2[i] = i % 5 == 0;
}

/* A second camera of another size, a third that is not calibrated, and an inertial sensor. */
static void add_rig(struct fovea_rig *rig)
{
    rig->camera_count = 3;
    rig->cameras[0].has_readout = true;
    rig->cameras[0].readout_ns = 15000000;
    rig->cameras[1] = rig->cameras[0];
    rig->cameras[1].readout_ns = 0;
    rig->cameras[1].camera.width = WIDTH2;
    rig->cameras[1].camera.height = HEIGHT2;
    rig->cameras[1].camera.k[2] = 0;
    rig->cameras[1].T_body_cam[7] = -1.0 / 3;
    rig->cameras[1].mask = mask2;
    assert_int_equal(fovea_camera_prepare(&rig->cameras[1].camera, NULL), FOVEA_OK);
    rig->cameras[2] = (struct fovea_rig_camera){.camera = {.width = 64, .height = 80}};
    rig->has_imu = true;
    rig->imu =
        (struct fovea_rig_imu){.T_body_imu = {0, 0, 1, 0.1, 1, 0, 0, 0.2, 0, 1, 0, 0.3},
                               .rate_hz = 200,
                               .gyro_noise = 1e-4,
                               .gyro_walk = 2e-5,
                               .acceleration_noise = 3e-3,
                               .acceleration_walk = 4e-3,
                               .gyro_range = 8.7,
                               .acceleration_range = 78.5,
                               .gyro_correction = {1.01, 0, 0, 1e-3, 0, 1, 0.02},
                               .acceleration_correction = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2, -1},
                               .time_offset_ns = -12345};
}

static struct fv_recorder *open_recorder(size_t ring_bytes)
{
    struct fv_settings *settings = malloc(sizeof *settings);
    make_settings(settings);
    struct fv_recorder_setup setup = {.path = path,
                                      .settings = settings,
                                      .kernel_set = "c",
                                      .frame_bytes = IMAGE_BYTES,
                                      .ring_bytes = ring_bytes};
    struct fv_recorder *recorder = NULL;
    struct fovea_error error;
    if (fv_recorder_open(&setup, &recorder, &error) != FOVEA_OK) fail_msg("%s", error.text);
    free(settings);
    return recorder;
}

/* Turn n: every fourth has no frame; each has one message in the step and one in the work. */
static void record_turn(struct fv_recorder *recorder, uint32_t n)
{
    struct fovea_frame frame = {.image_count = 1,
                                .images[0] = {.data = pixels,
                                              .width = WIDTH,
                                              .height = HEIGHT,
                                              .stride_bytes = WIDTH,
                                              .format = FOVEA_PIXEL_GREY8,
                                              .size_bytes = IMAGE_BYTES},
                                .stamp_ns = 1000000000LL + n * 10000000LL,
                                .exposure_ns = {777},
                                .clock = FOVEA_CLOCK_SIMULATED,
                                .stamp_meaning = FOVEA_STAMP_EXPOSURE_MIDDLE,
                                .sequence = n};
    memset(pixels, (int)n, sizeof pixels);
    struct fovea_inputs inputs = {.frame = n % 4 == 3 ? NULL : &frame,
                                  .now_ns = frame.stamp_ns,
                                  .source_state = FOVEA_SOURCE_LATE,
                                  .source_counts = {n, 1, 2, 3, 4},
                                  .commands = n % 5 == 0 ? FOVEA_COMMAND_RESET : 0,
                                  .utc_offset_ns = 50,
                                  .latency_ns = 60,
                                  .temperature_c = 61.5f,
                                  .resident_bytes = 62,
                                  .frames_late = 63};
    inputs.grants.features = 500 + n;
    inputs.grants.units[0] = n;
    uint8_t data[400] = {1, 2, 3, 4,
                         5, 6, 7, (uint8_t)n}; /* long: a log cut within it has room for its end */
    struct fovea_outputs outputs = {.message_count = 1};
    outputs.messages[0] =
        (struct fovea_message){.channel = "ROBOT/LEFT_X", .data = data, .bytes = sizeof data};
    fv_recorder_step(recorder, &inputs, &outputs);
    struct fovea_grants grants = {.features = 400, .units = {n + 7}};
    fv_recorder_work(recorder, &inputs, &grants, &outputs);
}

static void expect_event(struct fv_lcmlog *log, struct fv_lcmlog_event *event, const char *channel)
{
    struct fovea_error error = {0};
    if (fv_lcmlog_next(log, event, &error) != FOVEA_OK)
        fail_msg("expected %s: %s", channel, error.text);
    assert_string_equal(event->channel, channel);
}

static void check_header(const struct fv_lcmlog_event *event)
{
    struct fv_recording_header *header = malloc(sizeof *header);
    struct fv_settings *settings = malloc(sizeof *settings);
    struct fovea_error error;
    make_settings(settings);
    if (fv_recording_header_decode(path, event->offset, event->data, event->bytes, header,
                                   &error) != FOVEA_OK)
        fail_msg("%s", error.text);
    const struct fovea_config *found = &header->settings.runtime, *expected = &settings->runtime;
    const struct fovea_rig_camera *camera = &found->rig.cameras[0],
                                  *wanted = &expected->rig.cameras[0];
    assert_memory_equal(&camera->camera, &wanted->camera, sizeof camera->camera);
    assert_memory_equal(camera->T_body_cam, wanted->T_body_cam, sizeof camera->T_body_cam);
    assert_true(found->seed == expected->seed);
    assert_string_equal(found->channel_prefix, "ROBOT/LEFT");
    assert_memory_equal(header->masks[0], mask, sizeof mask);
    assert_ptr_equal(camera->mask, header->masks[0]);
    free(header->masks[0]);

    uint8_t *damaged = malloc(event->bytes); /* one bit of the mask: its hash tells */
    memcpy(damaged, event->data, event->bytes);
    damaged[event->bytes - 1] ^= 1;
    assert_int_equal(
        fv_recording_header_decode(path, event->offset, damaged, event->bytes, header, &error),
        FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "mask: found hash"));
    free(damaged);
    free(settings);
    free(header);
}

static void a_header_keeps_the_whole_rig(void **state)
{
    struct fv_recording_header *header = malloc(sizeof *header);
    struct fv_settings *settings = malloc(sizeof *settings);
    struct fovea_error error;
    uint8_t *data = NULL;
    uint32_t bytes = 0;
    (void)state;
    make_settings(settings);
    add_rig(&settings->runtime.rig);
    if (fv_recording_header_encode(settings, NULL, "", false, NULL, &data, &bytes, &error) !=
            FOVEA_OK ||
        fv_recording_header_decode("x", 0, data, bytes, header, &error) != FOVEA_OK)
        fail_msg("%s", error.text);
    const struct fovea_rig *found = &header->settings.runtime.rig,
                           *expected = &settings->runtime.rig;
    assert_int_equal(found->camera_count, 3);
    for (uint32_t i = 0; i < 3; i++) {
        const struct fovea_rig_camera *a = &found->cameras[i], *b = &expected->cameras[i];
        assert_true(a->calibrated == b->calibrated && a->has_T_body_cam == b->has_T_body_cam);
        assert_true(a->has_readout == b->has_readout && a->readout_ns == b->readout_ns);
        assert_memory_equal(&a->camera, &b->camera, sizeof a->camera);
        assert_memory_equal(a->T_body_cam, b->T_body_cam, sizeof a->T_body_cam);
        assert_true((a->mask != NULL) == (b->mask != NULL) && a->mask == header->masks[i]);
    }
    assert_memory_equal(found->cameras[0].mask, mask, sizeof mask);
    assert_memory_equal(found->cameras[1].mask, mask2, sizeof mask2);
    assert_true(found->has_imu);
    assert_memory_equal(&found->imu, &expected->imu, sizeof found->imu);
    free(header->masks[0]);
    free(header->masks[1]);
    free(data);
    free(settings);
    free(header);
}

static void check_turn(struct fv_lcmlog *log, uint32_t n)
{
    struct fv_lcmlog_event event;
    struct fovea_error error;
    const char *why;
    size_t at;
    if (n % 4 != 3) {
        struct fovea_frame frame;
        expect_event(log, &event, "ROBOT/LEFT_FRAME");
        if (fv_lcmlog_frame(path, &event, &frame, &error) != FOVEA_OK) fail_msg("%s", error.text);
        assert_true(frame.stamp_ns == 1000000000LL + n * 10000000LL && frame.sequence == n &&
                    frame.exposure_ns[0] == 777);
        assert_true(frame.clock == FOVEA_CLOCK_SIMULATED &&
                    frame.stamp_meaning == FOVEA_STAMP_EXPOSURE_MIDDLE);
        assert_true(frame.images[0].width == WIDTH && frame.images[0].height == HEIGHT &&
                    frame.images[0].stride_bytes == WIDTH);
        for (int i = 0; i < IMAGE_BYTES; i += 997)
            assert_int_equal(frame.images[0].data[i], n & 255);
    }
    struct fovea_inputs inputs;
    bool has_frame;
    uint64_t hash;
    expect_event(log, &event, "ROBOT/LEFT_INPUTS");
    assert_true(
        fv_message_inputs_decode(event.data, event.bytes, &inputs, &has_frame, &hash, &why, &at));
    memset(pixels, n & 255, sizeof pixels);
    const struct fovea_frame same = {
        .image_count = 1,
        .images[0] = {pixels, WIDTH, HEIGHT, WIDTH, FOVEA_PIXEL_GREY8, IMAGE_BYTES}};
    assert_true(hash == (has_frame ? fv_lockstep_frame_hash(&same) : 0));
    pixels[IMAGE_BYTES - 7] ^= 1;
    assert_true(hash != fv_lockstep_frame_hash(&same));
    assert_true(has_frame == (n % 4 != 3) && inputs.now_ns == 1000000000LL + n * 10000000LL);
    assert_true(inputs.source_state == FOVEA_SOURCE_LATE && inputs.source_counts.delivered == n &&
                inputs.source_counts.recovered == 4 && inputs.commands == (n % 5 == 0) &&
                inputs.utc_offset_ns == 50 && inputs.latency_ns == 60 &&
                inputs.temperature_c == 61.5f && inputs.resident_bytes == 62 &&
                inputs.frames_late == 63 && inputs.grants.features == 500 + n &&
                inputs.grants.units[0] == n);
    assert_true(event.time_us == (inputs.now_ns + 50) / 1000);
    expect_event(log, &event, "ROBOT/LEFT_X");
    assert_int_equal(event.data[7], n & 255);
    struct fovea_grants grants;
    expect_event(log, &event, "ROBOT/LEFT_GRANTS");
    assert_true(fv_message_grants_decode(event.data, event.bytes, &grants, &why, &at));
    assert_true(grants.features == 400 && grants.units[0] == n + 7);
    expect_event(log, &event, "ROBOT/LEFT_X");
}

/* The log's last event; the iterations that it reports. */
static uint64_t check_end(struct fv_lcmlog *log, const char *reason)
{
    struct fv_lcmlog_event event;
    struct fv_recording_end end;
    const char *why;
    size_t at;
    expect_event(log, &event, "ROBOT/LEFT_RECORDING_END");
    if (!fv_recording_end_decode(event.data, event.bytes, &end, &why, &at)) fail_msg("%s", why);
    assert_string_equal(end.reason, reason);
    assert_true(end.events == (uint64_t)event.number);
    return end.iterations;
}

static void wait_for_room(struct fv_recorder *recorder)
{
    while (!fv_recorder_room(recorder))
        nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL);
}

static void test_round_trip(void **state)
{
    (void)state;
    enum { ITERATIONS = 100 };
    struct fv_recorder *recorder = open_recorder(0);
    for (uint32_t n = 0; n < ITERATIONS; n++) {
        wait_for_room(recorder);
        record_turn(recorder, n);
    }
    struct fv_recorder_summary summary;
    assert_int_equal(fv_recorder_close(recorder, &summary), FOVEA_OK);
    assert_true(summary.complete && summary.steps_lost == 0 &&
                summary.events == 1 + 4 * ITERATIONS + ITERATIONS * 3 / 4 + 1);

    struct fv_lcmlog *log;
    struct fv_lcmlog_event event;
    struct fovea_error error;
    assert_int_equal(fv_lcmlog_open(path, &log, &error), FOVEA_OK);
    expect_event(log, &event, "ROBOT/LEFT_RECORDING");
    check_header(&event);
    for (uint32_t n = 0; n < ITERATIONS; n++)
        check_turn(log, n);
    check_end(log, "");
    assert_int_equal(fv_lcmlog_next(log, &event, &error), FOVEA_END);
    fv_lcmlog_close(log);

    lcm_eventlog_t *standard = lcm_eventlog_create(path, "r"); /* LCM's own tools read it */
    uint64_t events = 0;
    for (lcm_eventlog_event_t *e; (e = lcm_eventlog_read_next_event(standard)) != NULL; events++) {
        assert_int_equal(e->eventnum, events);
        lcm_eventlog_free_event(e);
    }
    lcm_eventlog_destroy(standard);
    assert_int_equal(events, summary.events);
}

/* Every event of the file is whole, every iteration too, and the last tells why no more came;
 * returns their number. */
static uint64_t count_whole(const char *reason)
{
    struct fv_lcmlog *log;
    struct fv_lcmlog_event event;
    struct fovea_error error;
    uint64_t events = 0;
    enum fovea_status status;
    assert_int_equal(fv_lcmlog_open(path, &log, &error), FOVEA_OK);
    int64_t last = 0;
    uint64_t iterations = 0;
    while ((status = fv_lcmlog_next(log, &event, &error)) == FOVEA_OK) {
        events++;
        last = event.offset;
        iterations += strcmp(event.channel, "ROBOT/LEFT_GRANTS") == 0;
    }
    if (status != FOVEA_END) fail_msg("%s", error.text);
    assert_int_equal(fv_lcmlog_seek(log, 0, &error), FOVEA_OK);
    expect_event(log, &event, "ROBOT/LEFT_RECORDING");
    for (uint32_t n = 0; n < iterations; n++)
        check_turn(log, n);
    assert_int_equal(check_end(log, reason), iterations);
    assert_int_equal(event.offset < last, true);
    fv_lcmlog_close(log);
    return events;
}

static void record_below(rlim_t bytes_max)
{
    enum { ITERATIONS = 48 };
    struct rlimit before, limit;
    getrlimit(RLIMIT_FSIZE, &before);
    limit = before;
    limit.rlim_cur = bytes_max;
    setrlimit(RLIMIT_FSIZE, &limit);
    struct fv_recorder *recorder = open_recorder(0);
    for (uint32_t n = 0; n < ITERATIONS; n++) {
        wait_for_room(recorder);
        record_turn(recorder, n);
    }
    struct fv_recorder_summary summary;
    assert_int_equal(fv_recorder_close(recorder, &summary), FOVEA_ERROR_SYSTEM);
    setrlimit(RLIMIT_FSIZE, &before);
    struct stat info;
    stat(path, &info);
    assert_string_equal(summary.reason, "File too large");
    assert_true(summary.steps_lost > 0 && !summary.complete);
    assert_int_equal(info.st_size, summary.bytes);
    assert_true(info.st_size > (off_t)bytes_max - IMAGE_BYTES - 4096);
    assert_int_equal(count_whole("File too large"), summary.events);
}

/* Wherever in an iteration the file is full: in a frame, in what follows it, right after an
 * iteration, and in the log's own end. */
static void test_limited_file(void **state)
{
    (void)state;
    record_below(10000001);
    struct fv_lcmlog *log;
    struct fv_lcmlog_event event;
    struct fovea_error error;
    int64_t ends[64];
    int events = 0;
    assert_int_equal(fv_lcmlog_open(path, &log, &error), FOVEA_OK);
    while (events < 64 && fv_lcmlog_next(log, &event, &error) == FOVEA_OK)
        ends[events++] = event.offset;
    fv_lcmlog_close(log);
    for (int i = events - 12; i < events; i++)
        for (int more = 0; more < 3; more++)
            record_below((rlim_t)(ends[i] + (more == 2 ? 200 : 40 * more)));
}

/* Ended early, a numbered recording does not get the name of those that ended in order; without a
 * iteration it goes. */
static void test_limited_numbered(void **state)
{
    struct rlimit before, limit;
    struct fv_recorder_summary summary;
    (void)state;
    snprintf(path, sizeof path, "%s/box/", folder);
    getrlimit(RLIMIT_FSIZE, &before);
    limit = before;
    for (int iterations = 0; iterations <= 2; iterations++) { /* that there is room for, of two */
        struct fv_recorder *recorder = open_recorder(0);
        limit.rlim_cur =
            (rlim_t)(iterations * 2 + 1) * IMAGE_BYTES; /* with the mask in the header */
        setrlimit(RLIMIT_FSIZE, &limit);
        record_turn(recorder, 1);
        record_turn(recorder, 2);
        const enum fovea_status status = fv_recorder_close(recorder, &summary);
        setrlimit(RLIMIT_FSIZE, &before);
        assert_int_equal(status, iterations < 2 ? FOVEA_ERROR_SYSTEM : FOVEA_OK);
        assert_int_equal(strstr(summary.path, ".open.lcm") != NULL, iterations < 2);
        assert_int_equal(access(summary.path, F_OK), iterations > 0 ? 0 : -1);
        assert_int_equal(strstr(summary.reason, "it held no iteration") != NULL, iterations == 0);
        if (iterations > 0) unlink(summary.path);
    }
    rmdir(path);
    snprintf(path, sizeof path, "%s/log", folder);
}

/* A run that fails before its first step: in order, and yet of no use. */
static void test_nothing_numbered(void **state)
{
    struct fv_recorder_summary summary;
    (void)state;
    snprintf(path, sizeof path, "%s/box/", folder);
    assert_int_equal(fv_recorder_close(open_recorder(0), &summary), FOVEA_OK);
    assert_true(summary.removed);
    assert_int_equal(access(summary.path, F_OK), -1);
    assert_int_equal(rmdir(path), 0); /* nothing else is left either */
    snprintf(path, sizeof path, "%s/log", folder);
    assert_int_equal(fv_recorder_close(open_recorder(0), &summary), FOVEA_OK);
    assert_false(summary.removed); /* a file of the user's name is whole without any */
    assert_int_equal(access(path, F_OK), 0);
}

static void test_full_disk(void **state)
{
    (void)state;
    snprintf(path, sizeof path, "/dev/full");
    struct fv_recorder *recorder = open_recorder(0);
    for (uint32_t n = 0; n < 50; n++) {
        wait_for_room(recorder);
        record_turn(recorder, n);
    }
    struct fv_recorder_summary summary;
    assert_int_equal(fv_recorder_close(recorder, &summary), FOVEA_ERROR_SYSTEM);
    snprintf(path, sizeof path, "%s/log", folder);
    assert_non_null(strstr(summary.reason, "No space left on device"));
    assert_int_equal(summary.bytes, 0);
}

static void *drain(void *context) /* so that the writer can finish */
{
    static char buffer[65536];
    while (read(*(int *)context, buffer, sizeof buffer) > 0)
        ;
    return NULL;
}

static void test_slow_disk(void **state)
{
    (void)state;
    char pipe_path[64];
    snprintf(pipe_path, sizeof pipe_path, "%s/pipe", folder);
    assert_int_equal(mkfifo(pipe_path, 0600), 0);
    int reader =
        open(pipe_path, O_RDONLY | O_NONBLOCK); /* takes nothing until the recording has ended */
    assert_true(reader >= 0);
    const int writer = open(pipe_path, O_WRONLY); /* only an open pipe is taken */
    assert_true(writer >= 0);
    snprintf(path, sizeof path, "/dev/fd/%d", writer);
    struct fv_recorder *recorder = open_recorder(24 * IMAGE_BYTES);
    close(writer);
    for (uint32_t n = 0; n < 100; n++)
        record_turn(recorder, n);
    fcntl(reader, F_SETFL, 0);
    pthread_t thread;
    assert_int_equal(pthread_create(&thread, NULL, drain, &reader), 0);
    struct fv_recorder_summary summary;
    assert_int_equal(fv_recorder_close(recorder, &summary), FOVEA_ERROR_SYSTEM);
    pthread_join(thread, NULL);
    close(reader);
    snprintf(path, sizeof path, "%s/log", folder);
    assert_non_null(strstr(summary.reason, "the disk is too slow"));
    assert_in_range(summary.steps_lost, 60, 99);
    assert_true(summary.events > 5 * 10);
}

static void *drain_slowly(void *context)
{
    static char buffer[1 << 16];
    while (read(*(int *)context, buffer, sizeof buffer) > 0)
        usleep(1000);
    return NULL;
}

/* Where the loop waits for the disk, its slowness loses nothing: not in iterations with a preview
 * of the whole size either. */
static void test_paced_by_a_slow_disk(void **state)
{
    (void)state;
    static uint8_t preview[IMAGE_BYTES];
    struct fovea_outputs outputs = {.message_count = 1};
    outputs.messages[0] = (struct fovea_message){
        .channel = "ROBOT/LEFT_PREVIEW", .data = preview, .bytes = sizeof preview};
    char pipe_path[64];
    snprintf(pipe_path, sizeof pipe_path, "%s/slow", folder);
    assert_int_equal(mkfifo(pipe_path, 0600), 0);
    int reader = open(pipe_path, O_RDONLY | O_NONBLOCK);
    const int writer = open(pipe_path, O_WRONLY); /* only an open pipe is taken */
    assert_true(writer >= 0);
    snprintf(path, sizeof path, "/dev/fd/%d", writer);
    masked = false; /* the header of the log is small then, and so is the ring */
    struct fv_recorder *recorder = open_recorder(0);
    close(writer);
    masked = true;
    fcntl(reader, F_SETFL, 0);
    pthread_t thread;
    assert_int_equal(pthread_create(&thread, NULL, drain_slowly, &reader), 0);
    for (uint32_t n = 0; n < 40; n++) {
        const struct fovea_inputs inputs = {.now_ns = n};
        const struct fovea_grants grants = {0};
        wait_for_room(recorder);
        record_turn(recorder, n);
        fv_recorder_work(recorder, &inputs, &grants, &outputs);
    }
    struct fv_recorder_summary summary;
    const enum fovea_status status = fv_recorder_close(recorder, &summary);
    pthread_join(thread, NULL);
    close(reader);
    snprintf(path, sizeof path, "%s/log", folder);
    assert_int_equal(status, FOVEA_OK);
    assert_true(summary.bytes > 30 * (uint64_t)IMAGE_BYTES + 40 * sizeof preview);
}

static void test_cannot_open(void **state)
{
    (void)state;
    struct fv_settings *settings = malloc(sizeof *settings);
    make_settings(settings);
    struct fv_recorder_setup setup = {
        .path = "/nonexistent/log", .settings = settings, .kernel_set = "c"};
    struct fv_recorder *recorder = NULL;
    struct fovea_error error;
    assert_int_equal(fv_recorder_open(&setup, &recorder, &error), FOVEA_ERROR_INPUT);
    assert_string_equal(error.text,
                        "/nonexistent/log: cannot be written: No such file or directory");
    assert_null(recorder);
    free(settings);
}

int main(void)
{
    if (mkdtemp(folder) == NULL) return 1;
    snprintf(path, sizeof path, "%s/log", folder);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_header_keeps_the_whole_rig),
        cmocka_unit_test(test_round_trip),
        cmocka_unit_test(test_limited_file),
        cmocka_unit_test(test_limited_numbered),
        cmocka_unit_test(test_nothing_numbered),
        cmocka_unit_test(test_full_disk),
        cmocka_unit_test(test_slow_disk),
        cmocka_unit_test(test_paced_by_a_slow_disk),
        cmocka_unit_test(test_cannot_open),
    };
    int failed = cmocka_run_group_tests(tests, NULL, NULL);
    char command[64];
    snprintf(command, sizeof command, "rm -rf %s", folder);
    return system(command) != 0 ? 1 : failed;
}
