#include "detect/job.h"

#include "detect/pixel.h"

void fv_detect_carve(struct fv_detect_memory *memory, struct fv_arena *arena,
                     const struct fv_model *model, size_t pixel_bytes)
{
    *memory = (struct fv_detect_memory){.pixel_bytes = pixel_bytes};
    memory->job = fv_arena_take(arena, 1, sizeof *memory->job);
    memory->scratch = fv_arena_take(arena, 1, sizeof *memory->scratch);
    memory->arena = fv_arena_take(arena, fv_nn_arena_bytes(model), 1);
    memory->pixels = fv_arena_take(arena, pixel_bytes, 1);
}

enum fovea_status fv_detect_start(const struct fv_detect_memory *memory,
                                  const struct fv_model *model, const struct fovea_image *image,
                                  int64_t stamp_ns, uint64_t sequence)
{
    struct fv_detect_job *job = memory->job;
    if (job->phase != FV_DETECT_IDLE) return FOVEA_AGAIN;
    struct fv_detect_view view;
    const enum fovea_status status = fv_detect_view(model, image, &view);
    if (status != FOVEA_OK) return status;
    struct fovea_image copied;
    if (fv_pixel_copy(image, memory->pixels, memory->pixel_bytes, &copied) != FOVEA_OK)
        return FOVEA_ERROR_UNSUPPORTED;
    job->view = view;
    job->phase = FV_DETECT_FILL;
    job->row = 0;
    job->progress = (struct fv_nn_progress){0, 0};
    job->stamp_ns = stamp_ns;
    job->sequence = sequence;
    job->width = copied.width;
    job->height = copied.height;
    job->stride_bytes = copied.stride_bytes;
    job->format = (int32_t)copied.format;
    return FOVEA_OK;
}

static void fill_some(const struct fv_detect_memory *memory, const struct fv_model *model)
{
    struct fv_detect_job *job = memory->job;
    const struct fovea_image image = {.data = memory->pixels,
                                      .width = job->width,
                                      .height = job->height,
                                      .stride_bytes = job->stride_bytes,
                                      .format = (enum fovea_pixel_format)job->format,
                                      .size_bytes = memory->pixel_bytes};
    const int32_t height = model->header->preprocess.height,
                  rows = fv_detect_rows_per_unit(model, &image, &job->view);
    const int32_t end = rows < height - job->row ? job->row + rows : height;
    fv_detect_fill(model, &image, &job->view, memory->arena, job->row, end);
    job->row = end;
    if (end == height) job->phase = FV_DETECT_RUN;
}

static void decode_some(const struct fv_detect_memory *memory, const struct fv_model *model)
{
    struct fv_detect_job *job = memory->job;
    if (fv_detect_decode_unit(model, memory->arena, &job->view, &memory->limits, memory->scratch) !=
        FOVEA_OK)
        return;
    job->count = fv_detect_decode_take(model, &memory->limits, memory->scratch, job->found,
                                       FOVEA_DETECTIONS_MAX, &job->uncertain);
    job->found_stamp_ns = job->stamp_ns;
    job->found_sequence = job->sequence;
    job->phase = FV_DETECT_IDLE;
}

static void run_some(const struct fv_detect_memory *memory, const struct fv_model *model,
                     const struct fv_kernels *kernels, uint32_t units, uint32_t *ran)
{
    struct fv_detect_job *job = memory->job;
    if (fv_nn_run(model, kernels, memory->arena, &job->progress, units, ran) != FOVEA_OK) return;
    fv_detect_decode_start(memory->scratch);
    job->phase = FV_DETECT_DECODE;
}

enum fovea_status fv_detect_advance(const struct fv_detect_memory *memory,
                                    const struct fv_model *model, const struct fv_kernels *kernels,
                                    uint32_t units, uint32_t *done)
{
    struct fv_detect_job *job = memory->job;
    *done = 0;
    while (*done < units && job->phase != FV_DETECT_IDLE) {
        uint32_t ran = 1;
        if (job->phase == FV_DETECT_FILL) {
            fill_some(memory, model);
        } else if (job->phase == FV_DETECT_RUN) {
            run_some(memory, model, kernels, units - *done, &ran);
        } else {
            decode_some(memory, model);
        }
        *done += ran;
    }
    return job->phase == FV_DETECT_IDLE ? FOVEA_OK : FOVEA_AGAIN;
}
