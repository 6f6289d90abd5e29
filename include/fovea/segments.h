/* Line segments: straight edges of grey images, with ends between pixels.
 *
 * Works on memory of the caller:
 *
 *     size_t bytes = fovea_segments_size(&config, width, height, &error);
 *     fovea_segments_init(&segments, &config, width, height, memory, bytes, &error);
 *     fovea_segments_run(segments, &image, &found);
 *
 * The method is LSD (Grompone von Gioi, Jakubowicz, Morel and Randall, IPOL 2012) with its
 * refinement of regions and without its validation by number of false alarms: the image is smoothed
 * and reduced to 4/5, pixels are joined with neighbours whose gradients have the same direction to
 * 22.5 degrees, and a rectangle is fitted to each region. Regions end at 2,048 pixels, so that a
 * longer line is several segments. Segments come in order of the gradient that they begin with.
 *
 * Results are equal on every kernel set, compiler and architecture. */
#ifndef FOVEA_SEGMENTS_H
#define FOVEA_SEGMENTS_H

#include <stddef.h>
#include <stdint.h>

#include "fovea/image.h"
#include "fovea/status.h"

#ifdef __cplusplus
extern "C" {
#endif

struct fovea_segments_config {
    double length_min_px; /* [0, 10000], default 0: shorter segments are left out */
    uint32_t count_max;   /* [1, 20000], default 4000: later ones are left out */
};

/* Ends in pixels of the image (0, 0: the centre of the first pixel). Seen from the first end, the
 * bright side is on the right. */
struct fovea_segment {
    float x0_px, y0_px, x1_px, y1_px;
    float width_px; /* of the region of gradients, along them */
};

/* In the detector's memory, valid until the next run. */
struct fovea_segments_found {
    uint32_t count;
    const struct fovea_segment *list;
};

/* A detector in the caller's memory. */
struct fovea_segments;

/* Set every parameter to its default. Any thread. */
void fovea_segments_config_default(struct fovea_segments_config *config);

/* Bytes that a detector for images of width x height (within FOVEA_IMAGE_*) needs: about 6 for each
 * pixel. 0 when a parameter is out of its range: `error` names it. Init-only. */
size_t fovea_segments_size(const struct fovea_segments_config *config, int32_t width,
                           int32_t height, struct fovea_error *error);

/* Build a detector in `memory`, 64-byte aligned, which stays the caller's and must outlive it.
 * Errors: FOVEA_ERROR_ARGUMENT (a parameter, or the environment's FOVEA_CPU), FOVEA_ERROR_MEMORY
 * (size or alignment). Init-only. */
enum fovea_status fovea_segments_init(struct fovea_segments **segments,
                                      const struct fovea_segments_config *config, int32_t width,
                                      int32_t height, void *memory, size_t bytes,
                                      struct fovea_error *error);

/* Find the segments of a grey8 image of its size. FOVEA_ERROR_ARGUMENT: the image does not fit, and
 * `found` is left alone. Real-time safe: whatever the image, regions begin until 24 visits for each
 * pixel of it are spent. One thread per detector. */
enum fovea_status fovea_segments_run(struct fovea_segments *segments,
                                     const struct fovea_image *image,
                                     struct fovea_segments_found *found);

#ifdef __cplusplus
}
#endif
#endif
