/* Detection as a resumable job: an image is taken, the network runs over many frames in units, then
 * its boxes appear with the stamp of the image that they belong to.
 *
 * All state lies in pieces that the caller carves from its block and holds no addresses of them, so
 * it can be copied and hashed. Real-time safe. */
#ifndef FOVEA_DETECT_JOB_H
#define FOVEA_DETECT_JOB_H

#include "base/arena.h"
#include "detect/decode.h"
#include "nn/run.h"

#ifdef __cplusplus
extern "C" {
#endif

enum fv_detect_phase { FV_DETECT_IDLE = 0, FV_DETECT_FILL, FV_DETECT_RUN, FV_DETECT_DECODE };

struct fv_detect_job {
    int32_t phase, row;
    struct fv_nn_progress progress;
    struct fv_detect_view view;
    int64_t stamp_ns; /* of the image under way, then of the detections */
    uint64_t sequence;
    int32_t width, height, stride_bytes, format; /* of the copied image */
    int32_t count, uncertain;
    /* of the last run that completed: `count`, then the uncertain ones */
    struct fovea_detection found[FOVEA_DETECTIONS_MAX];
    int64_t found_stamp_ns;
    uint64_t found_sequence;
};

/* Where a job's pieces are; made by carving, remade after a move. */
struct fv_detect_memory {
    struct fv_detect_job *job;
    uint8_t *pixels, *arena;
    size_t pixel_bytes;
    struct fv_detect_scratch *scratch;
    struct fv_detect_limits limits; /* the caller sets them after carving; all 0 unless set */
};

/* Carve the pieces for images of up to `pixel_bytes` bytes. Works in counting mode. Init-only. */
void fv_detect_carve(struct fv_detect_memory *memory, struct fv_arena *arena,
                     const struct fv_model *model, size_t pixel_bytes);

/* Take an image: its pixels are copied, without what lies between rows. FOVEA_AGAIN: the job is
 * under way, nothing was taken. FOVEA_ERROR_UNSUPPORTED: the image's format or size does not fit.
 */
enum fovea_status fv_detect_start(const struct fv_detect_memory *memory,
                                  const struct fv_model *model, const struct fovea_image *image,
                                  int64_t stamp_ns, uint64_t sequence);

/* Go on for at most `units` units; `done` takes how many ran. FOVEA_OK: idle; job->found is new
 * when the sequence in found_sequence is that of the image taken. FOVEA_AGAIN: units are left. */
enum fovea_status fv_detect_advance(const struct fv_detect_memory *memory,
                                    const struct fv_model *model, const struct fv_kernels *kernels,
                                    uint32_t units, uint32_t *done);

#ifdef __cplusplus
}
#endif
#endif
