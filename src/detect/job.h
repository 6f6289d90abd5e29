/* Detection as a resumable job, a user of nn/job.h: an image is taken, the network runs over many
 * frames in units, its outputs are decoded, then the boxes appear with the stamp of the image that
 * they belong to.
 *
 * All state lies in pieces that the caller carves from its block and holds no addresses of them, so
 * it can be copied and hashed. Real-time safe. */
#ifndef FOVEA_DETECT_JOB_H
#define FOVEA_DETECT_JOB_H

#include "base/arena.h"
#include "detect/decode.h"
#include "nn/job.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The network's job first: while it is done and not idle, its outputs are being decoded. */
struct fv_detect_job {
    struct fv_nn_job_state nn;
    int64_t stamp_ns; /* of the image under way, then of the detections */
    uint64_t sequence;
    int32_t count, uncertain;
    /* of the last run that completed: `count`, then the uncertain ones */
    struct fovea_detection found[FOVEA_DETECTIONS_MAX];
    int64_t found_stamp_ns;
    uint64_t found_sequence;
};

/* Where a job's pieces are; made by carving, remade after a move. */
struct fv_detect_memory {
    struct fv_nn_job nn;
    struct fv_detect_job *job;
    struct fv_detect_scratch *scratch;
    struct fv_detect_room room; /* keypoints of the first of job->found; the mask */
    struct fv_detect_limits limits;
};

/* Carve the pieces for images of up to `pixel_bytes` bytes. `limits`: NULL for the model's own.
 * Works in counting mode. Init-only. */
void fv_detect_carve(struct fv_detect_memory *memory, struct fv_arena *arena,
                     const struct fv_model *model, const struct fv_detect_limits *limits,
                     size_t pixel_bytes);

/* Take an image, as fv_nn_job_start does. */
enum fovea_status fv_detect_start(const struct fv_detect_memory *memory,
                                  const struct fovea_image *image, int64_t stamp_ns,
                                  uint64_t sequence);

/* Go on for at most `units` units; `done` takes how many ran. FOVEA_OK: idle; job->found is new
 * when the sequence in found_sequence is that of the image taken. FOVEA_AGAIN: units are left. */
enum fovea_status fv_detect_advance(const struct fv_detect_memory *memory,
                                    const struct fv_kernels *kernels, uint32_t units,
                                    uint32_t *done);

/* The network's job, for a user that takes its outputs and not the boxes. */
static inline const struct fv_nn_job *fv_detect_network(const struct fv_detect_memory *memory)
{
    return &memory->nn;
}

/* Whether the outputs are being decoded: what was found last is being written over. */
static inline bool fv_detect_decoding(const struct fv_detect_memory *memory)
{
    return fv_nn_job_done(&memory->nn);
}
bool fv_detect_idle(const struct fv_detect_memory *memory);
/* Give up the image under way, and what the network knows of earlier ones. */
void fv_detect_stop(const struct fv_detect_memory *memory);
/* What the last run that completed found: `count` detections, then `uncertain` ones. Valid until
 * the next fv_detect_advance. */
const struct fovea_detection *fv_detect_found(const struct fv_detect_memory *memory,
                                              uint32_t *count, uint32_t *uncertain);
/* Keypoints of the first of them, as many each; NULL: none. Valid as long. */
static inline const struct fovea_keypoint *fv_detect_points(const struct fv_detect_memory *memory)
{
    return memory->room.points;
}
/* Its mask; the model's decoder gives one. Valid until the next run ends. */
void fv_detect_segmentation(const struct fv_detect_memory *memory,
                            struct fovea_segmentation *segmentation);

#ifdef __cplusplus
}
#endif
#endif
