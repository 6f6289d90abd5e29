#include "common/short_run.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "app/record/recorder.h"
#include "common/detector.h"

static void expect(enum fovea_status status, const struct fovea_error *error)
{
    if (status == FOVEA_OK) return;
    fprintf(stderr, "short run: %s\n", error->text);
    exit(1);
}

/* Bright squares that wander over a dark ground. */
static void paint(uint8_t *pixels, uint32_t width, uint32_t height, uint32_t n)
{
    memset(pixels, 40, (size_t)width * height);
    for (uint32_t square = 0; square < 30; square++) {
        uint32_t x0 = (square * 37 + n) % (width - 12), y0 = (square * 53 + n / 2) % (height - 12);
        for (uint32_t y = y0; y < y0 + 9; y++)
            memset(pixels + y * width + x0, (int)(120 + square * 4), 9);
    }
}

static void make_settings(const struct short_run *run, struct fv_settings *settings)
{
    struct fovea_error error;
    struct fovea_config *config = &settings->runtime;
    fv_settings_default(settings);
    config->rig.cameras[0].camera = (struct fovea_camera){.width = run->width,
                                                          .height = run->height,
                                                          .fx = run->width,
                                                          .fy = run->width,
                                                          .cx = 0.5 * run->width,
                                                          .cy = 0.5 * run->height};
    expect(fovea_camera_prepare(&config->rig.cameras[0].camera, &error), &error);
    if (run->rig) {
        static const struct fovea_rig_imu imu = {
            .T_body_imu = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}};
        config->rig.camera_count = 2;
        config->rig.has_imu = true;
        config->rig.imu = imu;
        config->rig.cameras[1].camera.width = run->width * 3 / 4;
        config->rig.cameras[1].camera.height = run->height * 3 / 4;
    }
    config->features.count_max = run->features;
    config->features.method = run->method;
    config->odometry.keyframes =
        8; /* a block of 2 MB in place of 7: clearing it takes most of a replay */
    config->odometry.landmarks = 1000;
    if (run->detect) config->detect.model = detector_model(&config->detect.model_bytes);
    config->preview.period_frames = 5;
    config->preview.level = 0;
    config->statistics_every = 4;
}

void short_run_samples(uint32_t n, struct fovea_sample *samples)
{
    const int64_t first_ns = 1000 + ((int64_t)n - 1) * 50000000 + 1;
    for (uint32_t i = 0; i < SHORT_RUN_IMU; i++) {
        const double value = 0.1 * (double)(n * 100 + i) / 3;
        samples[i] = (struct fovea_sample){.kind = FOVEA_SAMPLE_IMU};
        samples[i].imu = (struct fovea_imu_sample){.stamp_ns = first_ns + (int64_t)i * 4000000,
                                                   .gyro = {value, -value, 1 / (value + 1)},
                                                   .acceleration = {9.8, value * value, 0}};
    }
    for (uint32_t i = SHORT_RUN_IMU; i < SHORT_RUN_SAMPLES; i++) {
        const int kind = (int)i - SHORT_RUN_IMU + 1;
        samples[i] = (struct fovea_sample){.kind = (enum fovea_sample_kind)kind};
        samples[i].any.stamp_ns = first_ns + 45000000 + kind;
        for (uint32_t k = 0; k < fovea_sample_value_count(samples[i].kind); k++)
            samples[i].any.values[k] = 1.0 / (n + k + 3);
    }
}

static void record_turns(const struct short_run *run, struct fovea *rt,
                         const struct fovea_config *config, struct fv_recorder *opened)
{
    struct fv_recorder *recorder = run->begin == 0 ? opened : NULL;
    struct fovea_config changed = *config;
    changed.features.threshold = 25;
    const int32_t width2 = run->width * 3 / 4, height2 = run->height * 3 / 4;
    size_t bytes = (size_t)run->width * (size_t)run->height;
    uint8_t *pixels = malloc(bytes), *second = malloc(bytes);
    for (uint32_t n = 0; n < run->iterations; n++) {
        struct fovea_frame frame = {.image_count = 1,
                                    .images[0] = {.data = pixels,
                                                  .width = run->width,
                                                  .height = run->height,
                                                  .stride_bytes = run->width,
                                                  .format = FOVEA_PIXEL_GREY8,
                                                  .size_bytes = bytes},
                                    .stamp_ns = 1000 + n * 50000000LL,
                                    .clock = FOVEA_CLOCK_SIMULATED,
                                    .stamp_meaning = FOVEA_STAMP_EXPOSURE_MIDDLE,
                                    .sequence = n};
        struct fovea_inputs inputs = {.frame = n % 11 == 10 ? NULL : &frame,
                                      .now_ns = frame.stamp_ns,
                                      .commands = n == 20 ? FOVEA_COMMAND_RESET : 0,
                                      .utc_offset_ns = 77};
        struct fovea_outputs outputs;
        struct fovea_sample samples[SHORT_RUN_SAMPLES];
        if (run->rig) {
            short_run_samples(n, samples);
            inputs.samples = samples;
            inputs.sample_count = SHORT_RUN_SAMPLES;
        }
        paint(pixels, (uint32_t)run->width, (uint32_t)run->height, n);
        paint(second, (uint32_t)width2, (uint32_t)height2, n + 4);
        if (run->rig) frame.image_count = 2;
        if (run->rig && n % 3 != 2) {
            frame.images[1] = (struct fovea_image){.data = second,
                                                   .width = width2,
                                                   .height = height2,
                                                   .stride_bytes = width2,
                                                   .format = FOVEA_PIXEL_GREY8,
                                                   .size_bytes = (size_t)width2 * (size_t)height2};
        }
        fovea_grants_fixed(config, &inputs.grants);
        uint32_t granted = run->features - 50 + n;
        inputs.grants.features = granted < run->features ? granted : run->features;
        if (run->begin > 0 && n + 2 == run->begin) inputs.parameters = &changed;
        if (run->begin > 0 && n == run->begin) {
            recorder = opened;
            fv_recorder_begin(recorder, rt, &inputs);
        }
        while (!fv_recorder_room(recorder))
            nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL);
        fovea_step(rt, &inputs, &outputs);
        fv_recorder_step(recorder, &inputs, &outputs);
        struct fovea_grants grants = inputs.grants;
        grants.units[FOVEA_JOB_PREVIEW] = n % 3;
        grants.units[FOVEA_JOB_DETECT] = n % 5;
        fovea_work(rt, &grants, &outputs);
        fv_recorder_work(recorder, &inputs, &grants, &outputs);
    }
    free(pixels);
    free(second);
}

/* For every camera of the rig: its left eighth is black. The caller frees the one memory of all. */
static uint8_t *add_masks(struct fovea_rig *rig)
{
    const int32_t width = rig->cameras[0].camera.width, height = rig->cameras[0].camera.height;
    uint8_t *mask = malloc((size_t)width * (size_t)height);
    for (int32_t i = 0; i < width * height; i++)
        mask[i] = i % width < width / 8 ? 0 : 255;
    for (uint32_t i = 0; i < rig->camera_count; i++)
        rig->cameras[i].mask = mask;
    return mask;
}

void short_run_record(const char *path, const struct short_run *run)
{
    struct fv_settings *settings = malloc(sizeof *settings);
    struct fovea_error error;
    struct fovea *rt = NULL;
    struct fv_recorder *recorder = NULL;
    size_t bytes = 0;
    make_settings(run, settings);
    uint8_t *mask = run->rig ? add_masks(&settings->runtime.rig) : NULL;
    expect(fovea_size(&settings->runtime, &bytes, &error), &error);
    void *memory = aligned_alloc(FOVEA_BLOCK_ALIGNMENT, (bytes + 63) / 64 * 64);
    expect(fovea_init(memory, bytes, &settings->runtime, &rt, &error), &error);
    const uint32_t cameras = settings->runtime.rig.camera_count;
    struct fv_recorder_setup setup = {.path = path,
                                      .settings = settings,
                                      .kernel_set = fovea_cpu_name(rt),
                                      .frame_bytes =
                                          cameras * (size_t)run->width * (size_t)run->height};
    if (run->begin > 0) {
        setup.state_bytes = fovea_state_bytes(rt);
        setup.state = malloc(setup.state_bytes);
        setup.ring_bytes = fv_recorder_ring_bytes(&setup);
        setup.ring_memory = aligned_alloc(64, setup.ring_bytes);
    }
    expect(fv_recorder_open(&setup, &recorder, &error), &error);
    record_turns(run, rt, &settings->runtime, recorder);
    snprintf(error.text, sizeof error.text, "%s: not complete", path);
    expect(fv_recorder_close(recorder, NULL), &error);
    free(setup.state);
    free(setup.ring_memory);
    free(memory);
    free(mask);
    free(settings);
}
