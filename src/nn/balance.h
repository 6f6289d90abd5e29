/* White balance of the pictures that a network sees: base/grey_world.h, with the sums of a grid of
 * pixels in place of all of them, so that its cost does not depend on the size of the picture. */
#ifndef FOVEA_NN_BALANCE_H
#define FOVEA_NN_BALANCE_H

#include <stdint.h>

#include "fovea/image.h"

/* The grid: every pixel of a picture of at most 160 x 120, of a larger one the centres of as many
 * equal cells. */
enum { FV_NN_BALANCE_COLUMNS = 160, FV_NN_BALANCE_ROWS = 120 };

/* Of red, green and blue over the grid; of a grey picture all three are equal. */
struct fv_nn_balance {
    uint32_t sums[3];
};

/* Rows of the grid on this picture. */
int32_t fv_nn_balance_rows(const struct fovea_image *image);

/* Add rows [begin, end) of the grid on a checked, uncompressed picture (fv_pixel_known). Real-time
 * safe; 160 pixels a row. */
void fv_nn_balance_add(struct fv_nn_balance *balance, const struct fovea_image *image,
                       int32_t begin, int32_t end);

#endif
