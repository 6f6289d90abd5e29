#include "image/noise.h"

#include <string.h>

enum {
    COLUMNS = 16, /* of blocks */
    ROWS = 12,
    WIDTH = 16, /* of a block, pixels */
    HEIGHT = 8,
    QUARTER = COLUMNS * ROWS / 4,
    /* White noise of deviation s makes responses of deviation 6 s, whose mean magnitude is
     * sqrt(2 / pi) of that: 8 sqrt(pi / 2) / (6 * 16 * 8), in 1/65536. */
    SHIFT = 16,
    GAIN = 856,
};

/* Sum of the magnitudes in a block, whose first pixel has neighbours all around:
 *    1 -2  1
 *   -2  4 -2
 *    1 -2  1 */
static uint32_t roughness(const uint8_t *at, int32_t stride)
{
    int16_t bent[HEIGHT + 2][WIDTH], sum[WIDTH] = {0}; /* along rows; at most 8 * 2040 */
    uint32_t total = 0;
    at -= stride;
    for (int y = 0; y < HEIGHT + 2; y++, at += stride)
        for (int x = 0; x < WIDTH; x++)
            bent[y][x] = (int16_t)(at[x - 1] - 2 * at[x] + at[x + 1]);
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++) {
            const int16_t response = (int16_t)(bent[y][x] - 2 * bent[y + 1][x] + bent[y + 2][x]);
            sum[x] = (int16_t)(sum[x] + (response < 0 ? -response : response));
        }
    for (int x = 0; x < WIDTH; x++)
        total += (uint32_t)sum[x];
    return total;
}

/* First pixel of block i of `count`, of `size` pixels, along a side of `length`. */
static int32_t place(int i, int count, int size, int32_t length)
{
    return 1 + (int32_t)((int64_t)i * (length - 2 - size) / (count - 1));
}

uint32_t fv_noise(const struct fv_plane *plane)
{
    uint8_t blocks[FV_NOISE_MAX + 1]; /* by their noise */
    uint32_t noise = 0, below = 0;
    memset(blocks, 0, sizeof blocks);
    for (int r = 0; r < ROWS; r++)
        for (int c = 0; c < COLUMNS; c++) {
            const uint8_t *at = fv_plane_row(plane, place(r, ROWS, HEIGHT, plane->height)) +
                                place(c, COLUMNS, WIDTH, plane->width);
            const uint32_t noise_here =
                (roughness(at, plane->stride) * GAIN + (1U << (SHIFT - 1))) >> SHIFT;
            blocks[noise_here < FV_NOISE_MAX ? noise_here : FV_NOISE_MAX]++;
        }
    while ((below += blocks[noise]) <= QUARTER)
        noise++;
    return noise;
}
