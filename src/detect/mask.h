/* Masks: which class, or which object, each pixel of a grid over the network's input shows.
 *
 * Of a network with prototypes (Bolya et al., "YOLACT", ICCV 2019; YOLOv8's form) an object has the
 * pixels whose centre lies in its box and where its coefficients times the prototypes are above 0,
 * which is a probability above one half; where objects overlap, the one of the better score has the
 * pixel. The products are whole numbers where the outputs are bytes, so they are exact. Of a
 * network that labels each pixel, the pixel has its class, or that of its largest score.
 *
 * Pixels beside the part that shows the image (borders of a letterbox) have none. No addresses in
 * the state. Real-time safe. */
#ifndef FOVEA_DETECT_MASK_H
#define FOVEA_DETECT_MASK_H

#include "fovea/detect.h"
#include "fovea/segmentation.h"
#include "nn/input.h"
#include "nn/model.h"

struct fv_head_job;

enum { FV_DETECT_MASK_SIDE_MAX = 8192, FV_DETECT_MASK_PIXELS_MAX = 1 << 20 };

struct fv_detect_mask {
    int32_t width, height, count;
    struct fovea_segmentation_class segments[FOVEA_SEGMENTATION_CLASSES_MAX]; /* all there are */
    /* Of what a pixel holds, the place in the segments; FOVEA_SEGMENTATION_NONE: none. */
    uint8_t index[256];
    uint32_t pixels[256]; /* that hold it */
};

/* Size of the model's mask, 0 x 0 where its decoder gives none or its outputs do not fit. */
void fv_detect_mask_size(const struct fv_model *model, int32_t *width, int32_t *height);
/* Whether its network gives the confidence of each pixel. */
bool fv_detect_mask_confident(const struct fv_model *model);

/* No pixel has a segment. `confidence`: NULL, or as many bytes as pixels. */
void fv_detect_mask_clear(const struct fv_model *model, struct fv_detect_mask *mask,
                          uint8_t *pixels, uint8_t *confidence);
/* Go on with the pixels of `count` objects, the best first, whose boxes and items are given: one
 * unit from `*object` and `*row` on. True: complete. */
bool fv_detect_mask_objects(const struct fv_head_job *job, const struct fovea_detection *objects,
                            const int32_t *items, int32_t count, struct fv_detect_mask *mask,
                            uint8_t *pixels, int64_t *object, int32_t *row);
/* The same for a network that labels each pixel: one unit from pixel `*at` on. */
bool fv_detect_mask_classes(const struct fv_head_job *job, struct fv_detect_mask *mask,
                            uint8_t *pixels, uint8_t *confidence, int64_t *at);

#endif
