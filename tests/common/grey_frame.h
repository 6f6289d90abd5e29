/* A frame of one grey image, for tests of the runtime. */
#ifndef FOVEA_TESTS_GREY_FRAME_H
#define FOVEA_TESTS_GREY_FRAME_H

#include "fovea/source.h"

/* `pixels`: width x height grey levels without gaps, which the frame refers to. */
static inline struct fovea_frame grey_frame(const uint8_t *pixels, int32_t width, int32_t height,
                                            int64_t stamp_ns, uint64_t sequence)
{
    return (struct fovea_frame){
        .image_count = 1,
        .images[0] = {.data = pixels,
                      .width = width,
                      .height = height,
                      .stride_bytes = width,
                      .format = FOVEA_PIXEL_GREY8,
                      .size_bytes = (size_t)width * (size_t)height},
        .stamp_ns = stamp_ns,
        .sequence = sequence,
    };
}

#endif
