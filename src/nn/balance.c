#include "nn/balance.h"

#include "nn/pixel.h"

static int32_t least(int32_t a, int32_t b)
{
    return a < b ? a : b;
}

/* Centre of cell `at` of `count` over `size` pixels. */
static int32_t centre(int32_t at, int32_t count, int32_t size)
{
    return (int32_t)((int64_t)(2 * at + 1) * size / (2 * count));
}

int32_t fv_nn_balance_rows(const struct fovea_image *image)
{
    return least(image->height, FV_NN_BALANCE_ROWS);
}

void fv_nn_balance_add(struct fv_nn_balance *balance, const struct fovea_image *image,
                       int32_t begin, int32_t end)
{
    const int32_t columns = least(image->width, FV_NN_BALANCE_COLUMNS),
                  rows = fv_nn_balance_rows(image);
    for (int32_t row = begin; row < end; row++) {
        for (int32_t column = 0; column < columns; column++) {
            uint8_t rgb[3];
            fv_pixel_fetch(image, centre(column, columns, image->width),
                           centre(row, rows, image->height), false, rgb);
            for (int c = 0; c < 3; c++)
                balance->sums[c] += rgb[c];
        }
    }
}
