/* Single pixels of every uncompressed format as 8-bit red, green and blue.
 *
 *   grey8                    three equal values
 *   Y10, Y12, Y14, Y16       the 8 high bits of the significant ones, three equal values
 *   RGB24, BGR24             as they are
 *   YUYV, UYVY, NV12, YU12   BT.601 with luma from 16 to 235 (what cameras send and OpenCV takes
 *                            for granted); a network that takes grey gets the luma as it is
 *   Bayer                    of the cell of 2 x 2 that the pixel is in: red, the mean of the
 *                            greens, blue */
#ifndef FOVEA_DETECT_PIXEL_H
#define FOVEA_DETECT_PIXEL_H

#include <stdbool.h>
#include <stddef.h>

#include "fovea/image.h"

/* Whether pixels of this format can be fetched: all but the compressed ones. */
bool fv_pixel_known(enum fovea_pixel_format format);

/* The pixel (x, y) of a checked image. `luma`: YUV formats give their luma thrice. Real-time safe.
 */
void fv_pixel_fetch(const struct fovea_image *image, int32_t x, int32_t y, bool luma,
                    uint8_t rgb[3]);

/* Give a checked image, whose pixels are at `pixels`, the luma of `after`; `before` is its luma
 * now, both grey8 images of its size. Formats that keep luma of their own get it as it is; RGB, BGR
 * and Bayer values rise by the difference, within 0 to 255, so that colour differences stay.
 * Real-time safe; cost proportional to the pixels. */
void fv_pixel_relight(const struct fovea_image *image, uint8_t *pixels,
                      const struct fovea_image *before, const struct fovea_image *after);

/* Copy the pixels of a checked image, rows and planes without gaps, to `to`; `*copied` is a view of
 * the copy. FOVEA_ERROR_MEMORY: they do not fit into `capacity` bytes. Real-time safe. */
enum fovea_status fv_pixel_copy(const struct fovea_image *image, uint8_t *to, size_t capacity,
                                struct fovea_image *copied);

#endif
