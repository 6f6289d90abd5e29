#include "detect/job.h"

#include "detect/segmentation.h"

void fv_detect_carve(struct fv_detect_memory *memory, struct fv_arena *arena,
                     const struct fv_model *model, const struct fv_detect_limits *limits,
                     size_t pixel_bytes)
{
    *memory = (struct fv_detect_memory){.job = NULL};
    if (limits != NULL) memory->limits = *limits;
    memory->job = fv_arena_take(arena, 1, sizeof *memory->job);
    memory->scratch = fv_arena_take(arena, 1, sizeof *memory->scratch);
    const int32_t points = fv_detect_sets_max(model) * fv_detect_point_count(model);
    struct fv_detect_room *room = &memory->room;
    int32_t width, height;
    fv_detect_mask_size(model, &width, &height);
    if (points > 0) room->points = fv_arena_take(arena, (size_t)points, sizeof *room->points);
    if (width > 0) {
        room->mask = fv_arena_take(arena, 1, sizeof *room->mask);
        room->pixels = fv_arena_take(arena, (size_t)width * (size_t)height, 1);
        if (fv_detect_mask_confident(model))
            room->confidence = fv_arena_take(arena, (size_t)width * (size_t)height, 1);
    }
    struct fv_nn_job_state *state = memory->job == NULL ? NULL : &memory->job->nn; /* counting */
    fv_nn_job_carve(&memory->nn, model, state, pixel_bytes, arena);
}

enum fovea_status fv_detect_start(const struct fv_detect_memory *memory,
                                  const struct fovea_image *image, int64_t stamp_ns,
                                  uint64_t sequence)
{
    const enum fovea_status status = fv_nn_job_start(&memory->nn, image);
    if (status != FOVEA_OK) return status;
    memory->job->stamp_ns = stamp_ns;
    memory->job->sequence = sequence;
    return FOVEA_OK;
}

static void decode_some(const struct fv_detect_memory *memory)
{
    struct fv_detect_job *job = memory->job;
    const struct fv_nn_job *nn = &memory->nn;
    if (fv_detect_decode_unit(nn->model, nn->arena, &job->nn.fit, &memory->limits, memory->scratch,
                              &memory->room) != FOVEA_OK)
        return;
    job->count = fv_detect_decode_take(nn->model, &memory->limits, memory->scratch, job->found,
                                       FOVEA_DETECTIONS_MAX, &job->uncertain);
    job->found_stamp_ns = job->stamp_ns;
    job->found_sequence = job->sequence;
    fv_nn_job_end(nn);
}

enum fovea_status fv_detect_advance(const struct fv_detect_memory *memory,
                                    const struct fv_kernels *kernels, uint32_t units,
                                    uint32_t *done)
{
    const struct fv_nn_job *nn = &memory->nn;
    *done = 0;
    while (*done < units && !fv_nn_job_idle(nn)) {
        uint32_t ran = 1;
        if (fv_nn_job_done(nn))
            decode_some(memory);
        else if (fv_nn_job_advance(nn, kernels, units - *done, &ran) == FOVEA_OK)
            fv_detect_decode_start(memory->scratch);
        *done += ran;
    }
    return fv_nn_job_idle(nn) ? FOVEA_OK : FOVEA_AGAIN;
}

bool fv_detect_idle(const struct fv_detect_memory *memory)
{
    return fv_nn_job_idle(&memory->nn);
}

void fv_detect_stop(const struct fv_detect_memory *memory)
{
    fv_nn_job_forget(&memory->nn);
}

const struct fovea_detection *fv_detect_found(const struct fv_detect_memory *memory,
                                              uint32_t *count, uint32_t *uncertain)
{
    *count = (uint32_t)memory->job->count;
    *uncertain = (uint32_t)memory->job->uncertain;
    return memory->job->found;
}

void fv_detect_segmentation(const struct fv_detect_memory *memory,
                            struct fovea_segmentation *segmentation)
{
    const struct fv_detect_room *room = &memory->room;
    fv_segmentation_view(memory->nn.model, &memory->job->nn.fit, room->mask, room->pixels,
                         room->confidence, segmentation);
}
