/* The edges of an image over many frames: it is copied, its edges and, where they are asked for,
 * its line segments are found in units, and leave in as many messages as they need, with the stamp
 * of the frame that they belong to. */
#ifndef FOVEA_RUNTIME_EDGES_H
#define FOVEA_RUNTIME_EDGES_H

#include "fovea/fovea.h"
#include "image/edges.h"
#include "image/segments.h"
#include "runtime/frame_id.h"

enum fv_edge_phase { FV_EDGE_IDLE = 0, FV_EDGE_FINDING, FV_EDGE_JOINING, FV_EDGE_SENDING };

/* No addresses and no padding: copied and hashed as bytes. */
struct fv_edge_state {
    struct fv_frame_id frame;
    struct fv_edges_state found;
    struct fv_segments_state joined;
    double low, high, length_min_px; /* of this image, as the configuration has them */
    uint32_t phase;                  /* enum fv_edge_phase */
    int32_t sent;                    /* rows */
};

struct fv_edge_stage {
    struct fv_edge_state *state;
    struct fv_plane picture; /* the image whose edges are found, no padding */
    struct fv_edges edges;
    bool has_segments;
    struct fv_segments segments; /* carved where it has */
    uint8_t *bits;               /* rows of one message */
    float (*ends)[4];            /* of the segments */
};

/* Take memory for images of width x height. Init-only. */
void fv_edge_stage_carve(struct fv_edge_stage *stage, const struct fovea_edge_job_config *config,
                         int32_t width, int32_t height, struct fv_arena *persistent,
                         struct fv_arena *job, struct fv_arena *frame);

/* Take the image of a frame, to find its edges with the thresholds of `config`; nothing where one
 * is under way. Real-time safe, as all that follows. */
void fv_edge_stage_ask(struct fv_edge_stage *stage, const struct fovea_edge_job_config *config,
                       const struct fv_frame_id *frame, const struct fv_plane *image);

bool fv_edge_stage_waiting(const struct fv_edge_stage *stage);

/* Do one unit. True: the next rows are ready to be sent. */
bool fv_edge_stage_unit(struct fv_edge_stage *stage, const struct fv_kernels *kernels);

/* The message of the next rows, which are then sent; returns its bytes. */
uint32_t fv_edge_stage_encode(struct fv_edge_stage *stage, uint8_t *buffer, size_t capacity);

#endif
