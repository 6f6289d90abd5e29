/* Detections: what an int8 network found in an image.
 *
 * A network reads an image resized to its input (stretched, or letterboxed with its shape kept); boxes are given in pixels
 * of the image it looked at, (0, 0) the centre of the top left pixel, max exclusive. */
#ifndef FOVEA_DETECT_H
#define FOVEA_DETECT_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum { FOVEA_DETECTIONS_MAX = 300 };

struct fovea_detection {
    float x_min_px, y_min_px, x_max_px, y_max_px;
    float score;        /* 0 to 1 */
    int32_t class_id;   /* index into the model's classes, background not counted */
};

#ifdef __cplusplus
}
#endif
#endif
