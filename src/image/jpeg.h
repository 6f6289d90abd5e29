/* Baseline JPEG encoder for grey previews, cut into units (ITU-T T.81, Annex K tables).
 *
 * The libraries that encode JPEG allocate per image, keep addresses in their state and cannot stop
 * between blocks; a preview must fit the loop's job memory, be resumable every 64 blocks and give
 * the same bytes on every machine. So this one is ours: integers only, one component, no restart
 * markers.
 *
 * Memory: the caller's struct and output buffer. Real-time safe. */
#ifndef FOVEA_IMAGE_JPEG_H
#define FOVEA_IMAGE_JPEG_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "image/plane.h"

#ifdef __cplusplus
extern "C" {
#endif

struct fv_jpeg {
    int32_t width, height;  /* pixels */
    uint32_t blocks, block; /* 8x8 blocks in all, and the next to encode */
    int32_t last_dc;        /* of the block before: DC values are coded as differences */
    uint32_t bit_buffer;    /* bits not yet written, in the low bits */
    uint32_t bit_count;
    size_t capacity, used;  /* bytes of the output buffer */
    bool overflow;          /* the output did not fit; no more is written */
    uint16_t quantiser[64]; /* natural order, 1..255 */
};

/* Bytes of output buffer that suffice for any ordinary picture of this size; one that does not fit
 * is given up and reported by `overflow`. */
size_t fv_jpeg_capacity(int32_t width, int32_t height);

/* Write the headers. quality 1..100 in libjpeg's scale. */
void fv_jpeg_start(struct fv_jpeg *jpeg, int32_t width, int32_t height, uint32_t quality,
                   uint8_t *output, size_t capacity);

/* Encode up to `block_count` more blocks of the picture, which has the size given at the start;
 * edges are repeated to whole blocks. Returns true when the picture is complete (end marker
 * written) or has overflowed. */
bool fv_jpeg_encode(struct fv_jpeg *jpeg, const struct fv_plane *picture, uint32_t block_count,
                    uint8_t *output);

#ifdef __cplusplus
}
#endif
#endif
