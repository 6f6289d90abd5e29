/* From a camera image to a network's input tensor.
 *
 * Bilinear with 15-bit weights, pixel centres aligned (target x takes (x + 0.5) scale - 0.5),
 * edges repeated: integer arithmetic only. Letterboxing keeps the shape, centres the image and
 * fills the rest. Colours are reordered; a grey image gives three equal channels, a colour image
 * gives a grey one by BT.601. Values go through a table of 256 made from the model's mean and scale
 * and the input's quantisation. */
#ifndef FOVEA_NN_INPUT_H
#define FOVEA_NN_INPUT_H

#include <stdbool.h>

#include "fovea/image.h"
#include "nn/balance.h"
#include "nn/model.h"

#ifdef __cplusplus
extern "C" {
#endif

/* How the image lies in the input: input = image * scale + offset, per axis, in pixel-corner
 * coordinates. */
struct fv_nn_input_fit {
    int32_t image_width, image_height;
    int32_t left, top, width, height; /* part of the input that holds the image */
    float scale_x, scale_y;           /* input pixels per image pixel */
};

/* Whether the model takes images at all, judged by one of 8-bit grey. Init-only. */
bool fv_nn_takes_images(const struct fv_model *model);

/* Whether the model takes images at all (one input and no other, 8-bit or float [1, h, w, 1 or 3]:
 * nobody would set a second one, such as a state) and `image` has a format that can be read: all
 * but the compressed ones (nn/pixel.h). Fills `fit`. Real-time safe. FOVEA_ERROR_UNSUPPORTED: it
 * does not. */
enum fovea_status fv_nn_input_fit_of(const struct fv_model *model, const struct fovea_image *image,
                                     struct fv_nn_input_fit *fit);

/* Rows of the input that are filled in about 0.1 ms here, 0.25 ms on a slow board. Real-time safe.
 */
int32_t fv_nn_rows_per_unit(const struct fv_model *model, const struct fovea_image *image,
                            const struct fv_nn_input_fit *fit);

/* Fill rows [begin, end) of the input tensor (its height is preprocess.height). `balance`: NULL, or
 * the sums of the image, by which a network of colours sees them balanced, after interpolation.
 * Real-time safe. */
void fv_nn_fill(const struct fv_model *model, const struct fovea_image *image,
                const struct fv_nn_input_fit *fit, const struct fv_nn_balance *balance,
                uint8_t *arena, int32_t begin, int32_t end);

#ifdef __cplusplus
}
#endif
#endif
