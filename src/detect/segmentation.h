/* A finished mask as programs see it (fovea/segmentation.h), with its colours and its place in the
 * image. Real-time safe. */
#ifndef FOVEA_DETECT_SEGMENTATION_H
#define FOVEA_DETECT_SEGMENTATION_H

#include "detect/mask.h"
#include "fovea/segmentation.h"

/* x_raw = scale x + offset takes centres of the mask's pixels to the image. */
struct fv_segmentation_place {
    double scale[2], offset[2];
};
struct fv_segmentation_place fv_segmentation_place(const struct fv_model *model,
                                                   const struct fv_nn_input_fit *fit, int32_t width,
                                                   int32_t height);

/* Which pixels of a mask of this size show the image (fovea/segmentation.h). */
struct fovea_segmentation_part fv_segmentation_part(const struct fv_model *model,
                                                    const struct fv_nn_input_fit *fit,
                                                    int32_t width, int32_t height);

/* The colour of a class, or of an object among others (-1: none), red green blue. */
void fv_segmentation_colour(const struct fv_model *model, int32_t class_id, int32_t object,
                            uint8_t rgb[3]);

/* The mask of a picture that lies in the input as `fit` says; `confidence` may be NULL. Views into
 * what is given; inferences, stamp and sequence are 0. */
void fv_segmentation_view(const struct fv_model *model, const struct fv_nn_input_fit *fit,
                          const struct fv_detect_mask *mask, const uint8_t *pixels,
                          const uint8_t *confidence, struct fovea_segmentation *segmentation);

/* Lay the classes over rows [begin, end) of a grey picture of the same view, of any size, without
 * padding: each pixel goes two fifths of the way to a brightness that its class (or object) has by
 * its number, the first ones the farthest apart, and a pixel of another class than that left of or
 * above it becomes black or white, whichever is farther. Pixels whose class has no entry in the
 * list keep what they have. */
void fv_segmentation_overlay(const struct fovea_segmentation *segmentation, uint8_t *pixels,
                             int32_t width, int32_t height, int32_t begin, int32_t end);

#endif
