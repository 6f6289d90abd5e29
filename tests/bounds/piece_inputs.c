/* Of pictures that become a network's input: copied and given another luma by the step, balanced
 * and sampled by units, in the formats that cameras give. */
#include <stdlib.h>
#include <string.h>

#include "bounds/counter.h"
#include "bounds/pieces.h"
#include "nn/job.h"
#include "nn/pixel.h"

enum { SIDE = 320, INPUT_BYTES = SIDE * SIDE * 3 * 4 };

struct feeding {
    struct fv_model_header header;
    struct fv_model_tensor tensor;
    struct fv_model model;
    struct fv_nn_job_state state;
    struct fv_nn_job job;
    struct fovea_image image, before, after;
    bool taken;
};

static const int32_t inputs[1] = {0};

static void start(void *context)
{
    struct feeding *w = context;
    w->taken = fv_nn_job_start(&w->job, &w->image) == FOVEA_OK;
}

static void relight(void *context)
{
    struct feeding *w = context;
    fv_nn_job_relight(&w->job, &w->before, &w->after);
}

static void advance(void *context)
{
    struct feeding *w = context;
    uint32_t done;
    (void)fv_nn_job_advance(&w->job, NULL, 1, &done);
}

static void open_model(struct feeding *w, int32_t channels, bool real, int32_t fit)
{
    memset(&w->header, 0, sizeof w->header);
    w->header.input_count = 1;
    w->header.preprocess = (struct fv_model_preprocess){.fit = fit,
                                                        .width = SIDE,
                                                        .height = SIDE,
                                                        .channels = channels,
                                                        .order = 1,
                                                        .scale = {0.01f, 0.01f, 0.01f}};
    w->tensor = (struct fv_model_tensor){.type = real ? FV_TYPE_F32 : FV_TYPE_U8,
                                         .rank = 4,
                                         .dims = {1, SIDE, SIDE, channels},
                                         .scale = 0.01f};
    w->model = (struct fv_model){.header = &w->header, .tensors = &w->tensor, .inputs = inputs};
    w->job.model = &w->model;
    w->job.state = &w->state;
}

/* One picture, up to the network. */
static void feed(struct feeding *w)
{
    memset(&w->state, 0, sizeof w->state);
    NOTE(picture_copied, start, w, 1);
    if (!w->taken) return; /* a format that networks do not take */
    NOTE(picture_relit, relight, w, 1);
    fv_nn_job_balance(&w->job);
    while (w->state.phase == FV_NN_JOB_BALANCE)
        NOTE(network_balanced, advance, w, 1);
    while (w->state.phase == FV_NN_JOB_FILL)
        NOTE(network_input, advance, w, 1);
}

/* Three bytes for each pixel hold any format; the noise is the same in all. */
static void make_pictures(struct feeding *w, int32_t width, int32_t height)
{
    const size_t pixels = (size_t)width * (size_t)height, bytes = 3 * pixels;
    uint8_t *data = malloc(bytes), *before = malloc(pixels), *after = malloc(pixels);
    w->job.pixels = malloc(bytes);
    w->job.arena = calloc(1, INPUT_BYTES);
    MUST(data != NULL && before != NULL && after != NULL && w->job.pixels != NULL &&
         w->job.arena != NULL);
    w->job.pixel_bytes = bytes;
    for (size_t i = 0; i < bytes; i++)
        data[i] = (uint8_t)((uint32_t)(i + 1) * 2654435761u >> 19);
    for (size_t i = 0; i < pixels; i++) {
        before[i] = (uint8_t)(i % 251);
        after[i] = (uint8_t)(255 - i % 241);
    }
    w->image =
        (struct fovea_image){.data = data, .width = width, .height = height, .size_bytes = bytes};
    w->before = w->after = (struct fovea_image){.width = width,
                                                .height = height,
                                                .stride_bytes = width,
                                                .format = FOVEA_PIXEL_GREY8,
                                                .size_bytes = pixels};
    w->before.data = before;
    w->after.data = after;
}

static int32_t row_bytes(enum fovea_pixel_format format, int32_t width)
{
    switch (format) {
    case FOVEA_PIXEL_RGB24:
    case FOVEA_PIXEL_BGR24:
        return 3 * width;
    case FOVEA_PIXEL_YUYV:
    case FOVEA_PIXEL_UYVY:
        return 2 * width;
    default:
        return width;
    }
}

void pieces_of_inputs(int32_t width, int32_t height)
{
    static struct feeding w;
    uint32_t formats = 0;
    make_pictures(&w, width, height);
    for (int format = 0; format < FOVEA_PIXEL_FORMAT_COUNT; format++) {
        w.image.format = (enum fovea_pixel_format)format;
        w.image.stride_bytes = row_bytes(w.image.format, width);
        if (!fv_pixel_known(w.image.format)) continue;
        formats++;
        for (int kind = 0; kind < 8; kind++) {
            open_model(&w, kind % 2 == 0 ? 3 : 1, kind / 2 % 2 == 1,
                       kind / 4 == 0 ? FV_FIT_STRETCH : FV_FIT_LETTERBOX);
            feed(&w);
            MUST(w.taken);
        }
    }
    MUST(formats > 0);
    free((void *)(uintptr_t)w.image.data);
    free((void *)(uintptr_t)w.before.data);
    free((void *)(uintptr_t)w.after.data);
    free(w.job.pixels);
    free(w.job.arena);
}
