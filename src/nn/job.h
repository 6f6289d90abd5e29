/* A network over many frames: a picture is taken, becomes the model's input, and the model runs in
 * units, until its output tensors are there for the user of the job. Each job has one model; any
 * number of jobs, of the same or other models, may be under way at once. The states of a model go
 * from one picture that is taken to the next, and begin as real zeros.
 *
 * The state and the pieces lie in memory that the caller carves from its block, and hold no
 * addresses of it, so they can be copied and hashed. Real-time safe. */
#ifndef FOVEA_NN_JOB_H
#define FOVEA_NN_JOB_H

#include <stdbool.h>

#include "base/arena.h"
#include "nn/input.h"
#include "nn/run.h"

#ifdef __cplusplus
extern "C" {
#endif

enum fv_nn_job_phase {
    FV_NN_JOB_IDLE = 0,
    FV_NN_JOB_FILL = 1,
    FV_NN_JOB_RUN = 2,
    FV_NN_JOB_DONE = 3,   /* the outputs hold what the picture gave, until fv_nn_job_end */
    FV_NN_JOB_BALANCE = 4 /* before FILL, where it was asked for */
};

/* Part of the user's own state. */
struct fv_nn_job_state {
    int32_t phase, row; /* enum fv_nn_job_phase; the next, of BALANCE's grid or of the input */
    struct fv_nn_progress progress;
    struct fv_nn_input_fit fit;                  /* how the picture lies in the input */
    int32_t width, height, stride_bytes, format; /* of the copied picture */
    struct fv_nn_balance balance;                /* its sums, where `balanced` */
    uint32_t balanced;
};

/* Where a job's pieces are; made by carving, remade after a move. */
struct fv_nn_job {
    const struct fv_model *model;
    struct fv_nn_job_state *state;
    uint8_t *pixels, *arena;
    size_t pixel_bytes;
};

/* Carve the pieces for pictures of up to `pixel_bytes` bytes. `model` and `state` stay the
 * caller's. Works in counting mode. Init-only. */
void fv_nn_job_carve(struct fv_nn_job *job, const struct fv_model *model,
                     struct fv_nn_job_state *state, size_t pixel_bytes, struct fv_arena *arena);

/* Take a picture: its pixels are copied, without what lies between rows. FOVEA_AGAIN: the job is
 * not idle, nothing was taken. FOVEA_ERROR_UNSUPPORTED: the model takes no pictures, or the
 * format or size does not fit. */
enum fovea_status fv_nn_job_start(const struct fv_nn_job *job, const struct fovea_image *image);

/* Give the copied picture another luma, before the job goes on: `before` and `after` are grey8
 * images of its size, its grey levels as image/grey.h has them and the new ones. See
 * fv_pixel_relight. */
void fv_nn_job_relight(const struct fv_nn_job *job, const struct fovea_image *before,
                       const struct fovea_image *after);

/* Have the colours of the picture just taken balanced (nn/balance.h), at most 2 units more; nothing
 * happens where the network takes grey pictures. */
void fv_nn_job_balance(const struct fv_nn_job *job);

/* Go on for at most `units` units; `done` takes how many ran. FOVEA_OK: idle or done. FOVEA_AGAIN:
 * units are left. */
enum fovea_status fv_nn_job_advance(const struct fv_nn_job *job, const struct fv_kernels *kernels,
                                    uint32_t units, uint32_t *done);

static inline bool fv_nn_job_idle(const struct fv_nn_job *job)
{
    return job->state->phase == FV_NN_JOB_IDLE;
}
static inline bool fv_nn_job_done(const struct fv_nn_job *job)
{
    return job->state->phase == FV_NN_JOB_DONE;
}
/* Where fv_tensor_read and others find the outputs of a job that is done. */
static inline uint8_t *fv_nn_job_arena(const struct fv_nn_job *job)
{
    return job->arena;
}
/* The user is finished with the outputs, or gives up the picture under way. */
static inline void fv_nn_job_end(const struct fv_nn_job *job)
{
    job->state->phase = FV_NN_JOB_IDLE;
}

/* The same, and the states of the model become real zeros. */
void fv_nn_job_forget(const struct fv_nn_job *job);

#ifdef __cplusplus
}
#endif
#endif
