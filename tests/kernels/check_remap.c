#include "kernels/check.h"

static struct fv_remap_block random_block(struct check *check, int32_t width, int32_t height)
{
    struct fv_remap_block block = {
        .x = (int16_t)check_between(check, 0, width - FV_REMAP_WINDOW_COLUMNS),
        .y = (int16_t)check_between(check, 0, height - FV_REMAP_WINDOW_ROWS)};
    for (int i = 0; i < FV_REMAP_BLOCK; i++) {
        static const uint8_t rows[3] = {0, FV_REMAP_ROW_1, FV_REMAP_ROW_1 | FV_REMAP_ROW_2};
        block.at[i] = (uint8_t)(check_between(check, 0, 14) | rows[check_between(check, 0, 2)]);
        if (check_between(check, 0, 5) == 0) block.at[i] |= FV_REMAP_OUTSIDE;
        block.fx[i] = (uint8_t)check_between(check, 0, 63);
        block.fy[i] = (uint8_t)check_between(check, 0, 63);
    }
    return block;
}

void check_remap_row_u8(struct check *check, fv_k_remap_row_u8_fn *reference,
                        fv_k_remap_row_u8_fn *variant)
{
    enum { SCATTERED = 4 * FV_REMAP_BLOCK };
    const int32_t width = check_between(check, 16, 60), height = check_between(check, 4, 30);
    const int32_t stride = width + check_between(check, 0, 20), count = check_between(check, 0, 20);
    const size_t bytes = (size_t)(stride * (height - 1) + width),
                 out_bytes = FV_REMAP_BLOCK * (size_t)count;
    uint8_t *source = check_buffer(check, bytes, 1, 0);
    check_fill(check, source, bytes);
    struct fv_remap_pixel scattered[SCATTERED];
    for (int i = 0; i < SCATTERED; i++) {
        scattered[i].x = (int16_t)check_between(check, -1, width - 2);
        scattered[i].y = (int16_t)check_between(check, 0, height - 2);
        scattered[i].fx = (uint8_t)check_between(check, 0, 63);
        scattered[i].fy = (uint8_t)check_between(check, 0, 63);
    }
    struct fv_remap_block *blocks = check_buffer(check, sizeof *blocks * (size_t)count, 4, 0);
    for (int32_t k = 0; k < count; k++) {
        blocks[k] = random_block(check, width, height);
        if (check_between(check, 0, 4) == 0)
            blocks[k] = (struct fv_remap_block){.x = FV_REMAP_BLOCK * check_between(check, 0, 3),
                                                .y = FV_REMAP_SCATTERED};
    }
    uint8_t *expected = check_buffer(check, out_bytes, 1, 0),
            *found = check_buffer(check, out_bytes, 1, 0);
    reference(expected, source, stride, blocks, count, scattered);
    variant(found, source, stride, blocks, count, scattered);
    check_equal(check, "remapped row", expected, found, out_bytes);
}

/* A map like that of a barrel lens: columns and rows advance a little slower than the output, and
 * bend. */
void bench_remap_row_u8(struct check *check, fv_k_remap_row_u8_fn *variant)
{
    (void)check;
    enum { BLOCKS = BENCH_WIDTH / FV_REMAP_BLOCK };
    static struct fv_remap_block map[BENCH_HEIGHT][BLOCKS];
    static int made;
    for (int y = 0; !made && y < BENCH_HEIGHT; y++)
        for (int k = 0; k < BLOCKS; k++) {
            struct fv_remap_block *block = &map[y][k];
            block->x = (int16_t)(k * FV_REMAP_BLOCK);
            block->y = (int16_t)(y > BENCH_HEIGHT - 4 ? BENCH_HEIGHT - 4 : y);
            for (int i = 0; i < FV_REMAP_BLOCK; i++) {
                block->at[i] = (uint8_t)(i | (k + i > BLOCKS ? FV_REMAP_ROW_1 : 0));
                block->fx[i] = (uint8_t)((k + 7 * i) % 64);
                block->fy[i] = (uint8_t)((y + 3 * i) % 64);
            }
        }
    made = 1;
    for (int y = 0; y < BENCH_HEIGHT; y++)
        variant(bench_scratch() + y * BENCH_STRIDE, bench_image(), BENCH_STRIDE, map[y], BLOCKS,
                NULL);
}
