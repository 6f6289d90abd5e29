/* What a network found in a picture, as a line of JSON and drawn. */
#ifndef FOVEA_APP_LAB_FOUND_H
#define FOVEA_APP_LAB_FOUND_H

#include "detect/decode.h"
#include "detect/segmentation.h"
#include "support/canvas.h"

struct fv_found {
    const struct fv_model *model;
    int32_t count;
    struct fovea_detection list[FOVEA_DETECTIONS_MAX];
    struct fovea_keypoint points[FOVEA_KEYPOINTS_MAX]; /* of the first of the list */
    struct fv_detect_mask mask;
    struct fv_nn_input_fit fit; /* of the picture */
    struct fv_detect_room room; /* of these, and the mask's pixels */
};

/* Room for a model's results, the mask's pixels on the heap. FOVEA_ERROR_SYSTEM: out of memory. */
enum fovea_status fv_found_open(struct fv_found *found, const struct fv_model *model);
void fv_found_close(struct fv_found *found);

/* One line on stdout: "detections" with the members that the model's decoder gives ("box_px",
 * "keypoints_px"), or "classes"; and "mask" where it gives one, as runs along the rows. */
void fv_found_print(const struct fv_found *found, const char *path,
                    const struct fovea_image *image);

/* The mask, where the decoder gives one. */
void fv_found_segmentation(const struct fv_found *found, struct fovea_segmentation *segmentation);

/* "mask" as it stands in that line: its classes, and with `runs` each pixel. */
void fv_found_print_mask(const struct fv_found *found, bool runs);

/* Onto the picture, the best on top. */
void fv_found_draw(const struct fv_found *found, struct fv_canvas *canvas);

#endif
