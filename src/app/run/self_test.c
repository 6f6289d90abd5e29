#include "app/run/self_test.h"

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "base/hash.h"
#include "drivers/clock.h"
#include "fovea/fovea.h"
#include "runtime/state.h"

enum { WIDTH = 160, HEIGHT = 120, FRAMES = 3 };

/* Squares of two sizes with noise, moved by two pixels a frame: corners that match. */
static void paint(uint8_t *pixels, int frame)
{
    uint32_t noise = 12345;
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++) {
            const int u = x + 2 * frame, v = y + frame;
            const int square = ((u / 9 * 7 + v / 9 * 13) % 5) * 40 + ((u / 4 + v / 5) % 2) * 20;
            noise = noise * 1664525u + 1013904223u;
            pixels[y * WIDTH + x] = (uint8_t)(20 + square + (int)(noise >> 29));
        }
}

static bool configure(struct fovea_config *config)
{
    struct fovea_error error;
    struct fovea_camera *camera = &config->rig.cameras[0].camera;
    fovea_config_default(config);
    *camera = (struct fovea_camera){
        .width = WIDTH, .height = HEIGHT, .fx = 120, .fy = 120, .cx = 79.5, .cy = 59.5};
    config->rig.cameras[0].calibrated = true;
    config->features.count_max = 300;
    config->features.pyramid_levels = 4;
    config->odometry.keyframes = 8;
    config->odometry.landmarks = 1000;
    config->preview.period_frames = 0;
    return fovea_camera_prepare(camera, &error) == FOVEA_OK;
}

/* Hash of what the frames give; FV_HASH_START: no memory. */
static uint64_t outcome(const struct fv_kernels *kernels)
{
    static uint8_t pixels[WIDTH * HEIGHT];
    struct fovea_config config;
    struct fovea_error error;
    struct fovea *rt;
    size_t bytes = 0;
    uint64_t hash = FV_HASH_START;
    if (!configure(&config) || fovea_size(&config, &bytes, &error) != FOVEA_OK) return hash;
    void *memory = aligned_alloc(FOVEA_BLOCK_ALIGNMENT, (bytes + 63) / 64 * 64);
    if (memory == NULL) return hash;
    if (fovea_init(memory, bytes, &config, &rt, &error) == FOVEA_OK) {
        rt->kernels = *kernels;
        for (int n = 0; n < FRAMES; n++) {
            const struct fovea_frame frame = {.images[0] = {.data = pixels,
                                                            .width = WIDTH,
                                                            .height = HEIGHT,
                                                            .stride_bytes = WIDTH,
                                                            .format = FOVEA_PIXEL_GREY8,
                                                            .size_bytes = sizeof pixels},
                                              .stamp_ns = n * 33333333,
                                              .image_count = 1};
            struct fovea_inputs inputs = {
                .frame = &frame, .now_ns = frame.stamp_ns, .temperature_c = NAN};
            struct fovea_outputs outputs;
            paint(pixels, n);
            fovea_grants_fixed(&config, &inputs.grants);
            (void)fovea_step(rt, &inputs, &outputs);
            (void)fovea_work(rt, &inputs.grants, &outputs);
            const uint64_t state = fovea_state_hash(rt); /* the features are in it */
            hash = fv_hash(hash, &state, sizeof state);
        }
    }
    free(memory);
    return hash;
}

enum fv_self_test_result fv_self_test_kernels(const struct fv_kernels *kernels)
{
    struct fv_kernels plain;
    fv_kernels_init(&plain, FV_CPU_C);
    const uint64_t expected = outcome(&plain), found = outcome(kernels);
    if (expected == FV_HASH_START || found == FV_HASH_START) return FV_SELF_TEST_NO_MEMORY;
    return found == expected ? FV_SELF_TEST_SAME : FV_SELF_TEST_DIFFERS;
}

static bool clock_goes(void)
{
    struct timespec resolution;
    if (clock_getres(CLOCK_MONOTONIC, &resolution) != 0 || resolution.tv_sec > 0 ||
        resolution.tv_nsec > 1000)
        return false;
    const int64_t begin = fv_clock_ns(CLOCK_MONOTONIC);
    for (int i = 0; i < 10000000; i++)
        if (fv_clock_ns(CLOCK_MONOTONIC) != begin) return fv_clock_ns(CLOCK_MONOTONIC) > begin;
    return false;
}

void fv_self_test(char reason[FV_SELF_TEST_REASON_BYTES])
{
    struct fv_kernels kernels;
    enum fv_cpu_set set;
    struct fovea_error error;
    reason[0] = '\0';
    if (fv_cpu_from_environment(&set, &error) != FOVEA_OK) return; /* fovea_init has said so */
    fv_kernels_init(&kernels, set);
    const enum fv_self_test_result result = fv_self_test_kernels(&kernels);
    if (result == FV_SELF_TEST_NO_MEMORY)
        snprintf(reason, FV_SELF_TEST_REASON_BYTES, "there is no memory to try the kernels with");
    else if (result == FV_SELF_TEST_DIFFERS)
        snprintf(reason, FV_SELF_TEST_REASON_BYTES,
                 "the kernels of set %s do not give the bits of plain C",
                 fv_cpu_set_name(kernels.set));
    else if (!clock_goes())
        snprintf(reason, FV_SELF_TEST_REASON_BYTES,
                 "CLOCK_MONOTONIC stands, goes back or is coarser than a microsecond");
}
