#include "nn/job.h"

#include "nn/pixel.h"

void fv_nn_job_carve(struct fv_nn_job *job, const struct fv_model *model,
                     struct fv_nn_job_state *state, size_t pixel_bytes, struct fv_arena *arena)
{
    *job = (struct fv_nn_job){.model = model, .state = state, .pixel_bytes = pixel_bytes};
    job->arena = fv_arena_take(arena, fv_nn_arena_bytes(model), 1);
    job->pixels = fv_arena_take(arena, pixel_bytes, 1);
}

enum fovea_status fv_nn_job_start(const struct fv_nn_job *job, const struct fovea_image *image)
{
    struct fv_nn_input_fit fit;
    struct fovea_image copied;
    if (!fv_nn_job_idle(job)) return FOVEA_AGAIN;
    const enum fovea_status status = fv_nn_input_fit_of(job->model, image, &fit);
    if (status != FOVEA_OK) return status;
    if (fv_pixel_copy(image, job->pixels, job->pixel_bytes, &copied) != FOVEA_OK)
        return FOVEA_ERROR_UNSUPPORTED;
    *job->state = (struct fv_nn_job_state){.phase = FV_NN_JOB_FILL,
                                           .fit = fit,
                                           .width = copied.width,
                                           .height = copied.height,
                                           .stride_bytes = copied.stride_bytes,
                                           .format = (int32_t)copied.format};
    return FOVEA_OK;
}

/* The copied picture. */
static struct fovea_image copied_image(const struct fv_nn_job *job)
{
    const struct fv_nn_job_state *s = job->state;
    return (struct fovea_image){.data = job->pixels,
                                .width = s->width,
                                .height = s->height,
                                .stride_bytes = s->stride_bytes,
                                .format = (enum fovea_pixel_format)s->format,
                                .size_bytes = job->pixel_bytes};
}

void fv_nn_job_relight(const struct fv_nn_job *job, const struct fovea_image *before,
                       const struct fovea_image *after)
{
    const struct fovea_image image = copied_image(job);
    fv_pixel_relight(&image, job->pixels, before, after);
}

void fv_nn_job_balance(const struct fv_nn_job *job)
{
    if (job->model->header->preprocess.channels == 3) job->state->phase = FV_NN_JOB_BALANCE;
}

/* A unit: as many fetched pixels as a unit of the input makes. */
static void balance_some(const struct fv_nn_job *job)
{
    enum { ROWS = 9600 / FV_NN_BALANCE_COLUMNS };
    struct fv_nn_job_state *s = job->state;
    const struct fovea_image image = copied_image(job);
    const int32_t rows = fv_nn_balance_rows(&image),
                  end = ROWS < rows - s->row ? s->row + ROWS : rows;
    fv_nn_balance_add(&s->balance, &image, s->row, end);
    s->row = end;
    if (end < rows) return;
    s->row = 0;
    s->balanced = 1;
    s->phase = FV_NN_JOB_FILL;
}

static void fill_some(const struct fv_nn_job *job)
{
    struct fv_nn_job_state *s = job->state;
    const struct fovea_image image = copied_image(job);
    const int32_t height = job->model->header->preprocess.height,
                  rows = fv_nn_rows_per_unit(job->model, &image, &s->fit);
    const int32_t end = rows < height - s->row ? s->row + rows : height;
    fv_nn_fill(job->model, &image, &s->fit, s->balanced != 0 ? &s->balance : NULL, job->arena,
               s->row, end);
    s->row = end;
    if (end == height) s->phase = FV_NN_JOB_RUN;
}

void fv_nn_job_forget(const struct fv_nn_job *job)
{
    fv_nn_job_end(job);
    fv_nn_clear_states(job->model, job->arena);
}

enum fovea_status fv_nn_job_advance(const struct fv_nn_job *job, const struct fv_kernels *kernels,
                                    uint32_t units, uint32_t *done)
{
    struct fv_nn_job_state *s = job->state;
    *done = 0;
    for (; *done < units && s->phase == FV_NN_JOB_BALANCE; ++*done)
        balance_some(job);
    for (; *done < units && s->phase == FV_NN_JOB_FILL; ++*done)
        fill_some(job);
    if (*done < units && s->phase == FV_NN_JOB_RUN) {
        uint32_t ran = 0;
        if (fv_nn_run(job->model, kernels, job->arena, &s->progress, units - *done, &ran) ==
            FOVEA_OK)
            s->phase = FV_NN_JOB_DONE;
        *done += ran;
    }
    return fv_nn_job_idle(job) || fv_nn_job_done(job) ? FOVEA_OK : FOVEA_AGAIN;
}
