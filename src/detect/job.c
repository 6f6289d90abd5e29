#include "detect/job.h"

#include <string.h>

/* Input rows filled in one unit: about 0.25 ms at 20 ns per pixel. */
static int32_t rows_per_unit(const struct fv_model *model)
{
    const int32_t width = model->header->preprocess.width;
    return width >= 12000 ? 1 : 12000 / (width < 1 ? 1 : width);
}

void fv_detect_carve(struct fv_detect_memory *memory, struct fv_arena *arena, const struct fv_model *model, size_t pixel_bytes)
{
    *memory = (struct fv_detect_memory){.pixel_bytes = pixel_bytes};
    memory->job = fv_arena_take(arena, 1, sizeof *memory->job);
    memory->scratch = fv_arena_take(arena, 1, sizeof *memory->scratch);
    memory->arena = fv_arena_take(arena, fv_nn_arena_bytes(model), 1);
    memory->pixels = fv_arena_take(arena, pixel_bytes, 1);
}

enum fovea_status fv_detect_start(const struct fv_detect_memory *memory, const struct fv_model *model, const struct fovea_image *image,
                                  int64_t stamp_ns, uint64_t sequence)
{
    struct fv_detect_job *job = memory->job;
    if (job->phase != FV_DETECT_IDLE) return FOVEA_AGAIN;
    const size_t bytes = (size_t)image->stride_bytes * (size_t)image->height;
    struct fv_detect_view view;
    if (bytes > memory->pixel_bytes || bytes > image->size_bytes) return FOVEA_ERROR_UNSUPPORTED;
    const enum fovea_status status = fv_detect_view(model, image, &view);
    if (status != FOVEA_OK) return status;
    memcpy(memory->pixels, image->data, bytes);
    job->view = view;
    job->phase = FV_DETECT_FILL;
    job->row = 0;
    job->progress = (struct fv_nn_progress){0, 0};
    job->stamp_ns = stamp_ns;
    job->sequence = sequence;
    job->width = image->width;
    job->height = image->height;
    job->stride_bytes = image->stride_bytes;
    job->format = (int32_t)image->format;
    return FOVEA_OK;
}

static void fill_some(const struct fv_detect_memory *memory, const struct fv_model *model)
{
    struct fv_detect_job *job = memory->job;
    const struct fovea_image image = {.data = memory->pixels, .width = job->width, .height = job->height,
                                      .stride_bytes = job->stride_bytes, .format = (enum fovea_pixel_format)job->format,
                                      .size_bytes = (size_t)job->stride_bytes * (size_t)job->height};
    const int32_t height = model->header->preprocess.height, rows = rows_per_unit(model);
    const int32_t end = rows < height - job->row ? job->row + rows : height;
    fv_detect_fill(model, &image, &job->view, memory->arena, job->row, end);
    job->row = end;
    if (end == height) job->phase = FV_DETECT_RUN;
}

static void finish(const struct fv_detect_memory *memory, const struct fv_model *model)
{
    struct fv_detect_job *job = memory->job;
    job->count = fv_detect_decode(model, memory->arena, &job->view, memory->scratch, job->found, FOVEA_DETECTIONS_MAX);
    job->found_stamp_ns = job->stamp_ns;
    job->found_sequence = job->sequence;
    job->phase = FV_DETECT_IDLE;
}

enum fovea_status fv_detect_advance(const struct fv_detect_memory *memory, const struct fv_model *model, const struct fv_kernels *kernels,
                                    uint32_t units, uint32_t *done)
{
    struct fv_detect_job *job = memory->job;
    *done = 0;
    while (*done < units && job->phase != FV_DETECT_IDLE) {
        uint32_t ran = 1;
        if (job->phase == FV_DETECT_FILL) {
            fill_some(memory, model);
        } else if (job->phase == FV_DETECT_RUN) {
            if (fv_nn_run(model, kernels, memory->arena, &job->progress, units - *done, &ran) == FOVEA_OK) job->phase = FV_DETECT_DECODE;
        } else {
            finish(memory, model);
        }
        *done += ran;
    }
    return job->phase == FV_DETECT_IDLE ? FOVEA_OK : FOVEA_AGAIN;
}
