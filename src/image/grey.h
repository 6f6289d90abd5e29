/* Grey levels from what cameras deliver.
 *
 *   grey8, NV12, YU12   the luma plane, copied
 *   Y10, Y12, Y14, Y16  the 8 high bits of the significant ones: shifted right by 2, 4, 6, 8; 255
 *                       where bits above are set
 *   YUYV, UYVY          the luma bytes
 *   RGB24, BGR24        (9798 R + 19235 G + 3735 B + 16384) >> 15: BT.601 luma, OpenCV's integers
 *   Bayer               the 3x3 binomial filter, (1 2 1; 2 4 2; 1 2 1) rounded half up, borders
 *                       mirrored about the edge pixel. At every site of any Bayer order it weighs
 *                       (R + 2 G + B) / 4, so no pattern is left.
 *
 * Luma ranges are left as the camera gives them (limited range is not stretched). */
#ifndef FOVEA_IMAGE_GREY_H
#define FOVEA_IMAGE_GREY_H

#include <stdint.h>

#include "fovea/image.h"
#include "image/plane.h"
#include "kernels/kernels.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Convert a checked, uncompressed image into grey levels, a plane of its size or larger.
 * The destination does not overlap the source; bytes past a row's last pixel are left alone.
 * Real-time safe. */
void fv_grey_convert(const struct fv_plane *grey, const struct fv_kernels *kernels,
                     const struct fovea_image *image);

#ifdef __cplusplus
}
#endif
#endif
